"""The shield of any environment."""
