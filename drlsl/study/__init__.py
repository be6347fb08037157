"""Every method trained over several seeds, tested and reported; this package itself loads nothing."""
