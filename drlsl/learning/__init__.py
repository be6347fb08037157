"""Deep Q-learning with a shield. Import the modules below; this package itself loads nothing."""
