"""The error of learning that diverged."""

from drlsl.errors import UserError


class DivergedError(UserError):
    """Learning produced a value that is not finite."""

    def __init__(self, what: str) -> None:
        super().__init__(f"{what}: train again with a lower schedule.learning_rate_start")
