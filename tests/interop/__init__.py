"""Trainings in the libraries that users train with: make test-interop."""
