"""Tests of tasks performed side by side."""
