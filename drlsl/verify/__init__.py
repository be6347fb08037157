"""Proofs of properties of rule programs, and scenes that break them, by an SMT solver."""
