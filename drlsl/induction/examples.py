"""The examples of a search: what was chosen where, whether it was unsafe, and the eases of its quantities."""

from __future__ import annotations

from collections.abc import Sequence

from drlsl.induction.quantities import Bias
from drlsl.traffic import Floats, Integers, Mask


class Examples:
    """N choices, one after another: `eases` (N, Q), `unsafe` (N,), `choice` (N,), `origin` (N,).

    `choice` indexes the choices of `bias`; `origin` says where each was found.
    """

    def __init__(
        self, bias: Bias, values: Floats, choice: Integers, unsafe: Mask, origin: Sequence[str]
    ) -> None:
        """Take the values of the quantities, shape (N, Q).

        Raises:
            UserError: a quantity is beyond 32 bits, or no number.
        """
        self.bias = bias
        self.eases: Integers = bias.eases(values)
        self.choice, self.unsafe, self.origin = choice, unsafe, list(origin)

    @property
    def unsafe_places(self) -> Integers:
        """The places of the unsafe ones, shape (U,)."""
        return self.unsafe.nonzero()[0]

    def words(self, place: int) -> str:
        """Return where an example comes from, its choice and its quantities, `-` for none."""
        values = dict.fromkeys(  # a condition of either direction is two quantities, which say the same
            f"{_short(str(one), one.variable)} {one.words(int(ease))}"
            for one, ease in zip(self.bias.quantities, self.eases[place], strict=True)
        )
        choice = self.bias.choice_words(int(self.choice[place]))
        return f"{self.origin[place]}, {choice}: {', '.join(values)}"


def _short(quantity: str, variable: str) -> str:
    """Return gap(Side, behind, _) as gap behind."""
    words = quantity.replace("(", " ").replace(")", " ").replace(",", " ").split()
    return " ".join(word for word in words if word not in (variable, "_"))
