"""The files that programs name: where they are searched, and which one may be meant by a misspelt name."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from pathlib import Path

from drlsl.logic.errors import ExistenceError, existence_error, instantiation_error, type_error
from drlsl.logic.loading.shipped import shipped_folder
from drlsl.logic.terms import Atom, Term, Var, deref


class NoSuchFile(ExistenceError):
    """A file that a program names, and that is in none of the places that are searched."""

    def __init__(self, term: Term, name: str, places: Sequence[Path]) -> None:
        super().__init__(existence_error("source_sink", term).term)
        self._name = name
        self._places = tuple(places)

    def message(self) -> str:
        """Return the error, with a hint at a file of a similar name."""
        return super().message() + similar_file(self._name, self._places)


def find_file(term: Term, folder: Path | None, search: Sequence[Path] = ()) -> Path:
    """Return the file that an atom names, with or without ``.pl``.

    It is searched in the folder, in those of the search path, then among the programs that ship.

    Raises:
        ExistenceError: There is no such file.
    """
    term = deref(term)
    if type(term) is Var:
        raise instantiation_error()
    if type(term) is not Atom and type(term) is not str:
        raise type_error("atom", term)
    name = term.name if type(term) is Atom else str(term)
    shipped = shipped_folder()
    places = [folder or Path(), *search, *([] if shipped is None else [shipped])]
    for place in places:
        for candidate in (place / name, place / f"{name}.pl"):
            if candidate.is_file():
                return candidate
    raise NoSuchFile(term, name, places)


def similar_file(name: str, places: Iterable[Path]) -> str:
    """Return a hint at a rule file of a similar name in one of the places; nothing if there is none."""
    for place in places:
        wanted = place / name
        stems = sorted(path.stem for path in wanted.parent.glob("*.pl"))
        for near in get_close_matches(wanted.stem, stems, 1):
            return f"; did you mean {Path(name).with_name(f'{near}.pl')}?"
    return ""
