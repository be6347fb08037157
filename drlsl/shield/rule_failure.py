"""The failure of rules, of whatever they are asked."""


class RuleFailure(Exception):
    """The rules gave no usable answer: an error, an exhausted limit, no action, a number out of range."""
