"""A user's own Python code: finding an object by its name, and reporting the errors of such code."""

import importlib
import importlib.util
import inspect
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from types import ModuleType
from typing import Any, Final

from drlsl.errors import UserError

_LOADING: Final[ContextVar[str]] = ContextVar("loading", default="")
"""The name whose file is being run."""

_PACKAGE: Final = Path(__file__).parents[1]


@contextmanager
def users_code(what: str) -> Iterator[None]:
    """Report an exception of a user's code in one line: the error, and its place in that code.

    Raises:
        UserError: the code raised an exception.
    """
    try:
        yield
    except UserError:
        raise
    except (Exception, SystemExit) as error:
        raise UserError(f"{what}: {_described(error)}") from error


def find_object(name: str, what: str) -> Any:
    """Find an object by FILE.py:NAME or PACKAGE.MODULE:NAME, running its file at most once.

    `what` says in errors what it is for.

    Raises:
        UserError: there is no such file, module or object, or the file cannot be run.
    """
    place, _, attribute = name.rpartition(":")
    found = _of_main(place)
    if found is None:
        token = _LOADING.set(what)
        try:
            found = _from_file(Path(place), what) if place.endswith(".py") else _from_module(place, what)
        finally:
            _LOADING.reset(token)
    result = getattr(found, attribute, None)
    if result is None:
        raise UserError(f"{what}: {place} has no '{attribute}'")
    return result


def refuse_while_loading(activity: str) -> None:
    """Refuse an activity, such as a training, while a user's file is being run to find an object in it.

    Raises:
        UserError: a file is being run.
    """
    if _LOADING.get():
        raise UserError(
            f"{_LOADING.get()}: its file starts {activity} when it is imported; put that below "
            "`if __name__ == '__main__':`"
        )


def _of_main(place: str) -> ModuleType | None:
    """Return the script that is running, if it is the wanted file or module, so that it is not run again."""
    main = sys.modules["__main__"]
    spec = getattr(main, "__spec__", None)
    if spec is not None and spec.name == place:
        return main
    file = getattr(main, "__file__", None)
    same = file is not None and place.endswith(".py") and Path(file).resolve() == Path(place).resolve()
    return main if same else None


def _from_file(path: Path, what: str) -> ModuleType:
    if not path.is_file():
        raise UserError(f"{what}: no file {path} in {Path.cwd()}")
    spec = importlib.util.spec_from_file_location(f"drlsl_user_{path.stem}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # As for any import: a data class, for one, looks its module up while it is being run.
    sys.modules[spec.name] = module
    with users_code(f"{what}: cannot run the file"), _importable(path.parent):
        spec.loader.exec_module(module)
    return module


def _from_module(name: str, what: str) -> ModuleType:
    with users_code(f"{what}: cannot import the module"), _importable(Path.cwd()):
        return importlib.import_module(name)


@contextmanager
def _importable(folder: Path) -> Iterator[None]:
    """Let modules in a folder be imported, after those that are installed."""
    entry = str(folder.resolve())
    if entry in sys.path:
        yield
        return
    sys.path.append(entry)
    try:
        yield
    finally:
        sys.path.remove(entry)


def _described(error: BaseException) -> str:
    """Return the type of an error, the first line of its message, and its last place outside of libraries."""
    lines = str(error).splitlines()
    text = f"{type(error).__name__}: {lines[0]}" if lines else type(error).__name__
    if isinstance(error, SyntaxError):
        return text
    frames = traceback.extract_tb(error.__traceback__)
    places = [
        f" ({Path(frame.filename).name}:{frame.lineno})"
        for frame in frames
        if Path(frame.filename).is_file()
        and "site-packages" not in frame.filename
        and not Path(frame.filename).is_relative_to(_PACKAGE)
        and not Path(frame.filename).is_relative_to(Path(inspect.__file__).parent)
    ]
    return text + (places[-1] if places else "")
