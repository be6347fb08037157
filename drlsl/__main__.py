"""`python -m drlsl`, the same as `drlsl`."""

from drlsl.cli import main

if __name__ == "__main__":
    main()
