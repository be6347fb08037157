"""The one error class for mistakes that a user can correct."""


class UserError(Exception):
    """Bad input: the message says what was wrong, where, what was expected and what to do.

    The command line prints the message on one line of stderr and exits with status 2.
    """
