"""The built-in predicates, one module for each family."""
