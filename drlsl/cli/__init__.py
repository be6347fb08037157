"""The command line: `drlsl train`, `drlsl query` and the rest."""
