"""The rooms: imports point one way, past no surface and in no circle, and the command line starts light."""

from __future__ import annotations

import ast
import subprocess
import sys
import tomllib
from collections import defaultdict
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "drlsl"
FILES = sorted(PACKAGE.rglob("*.py"))
TORCH_BACK_END = {"torch_backend.py", "torch_ops.py"}

SAME_NAME = {
    "__init__.py": "the surface of a room",
    "config.py": "the settings of a room, as its files and commands give them",
    "errors.py": "the errors that a package raises",
    "figures.py": "pictures made of results",
    "report.py": "what a person reads of results",
}
"""Files of one name in several rooms, and the part that they play in each."""


def name_of(path: Path) -> str:
    """The dotted name of a module."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {name_of(path): path for path in FILES}
ROOMS = {name for name, path in MODULES.items() if path.name == "__init__.py"}


def surface(room: str) -> dict[str, str]:
    """The names that a room offers, and the module of the room that each comes from."""
    folder = MODULES[room].parent
    lazy = folder / "__init__.pyi"
    names: dict[str, str] = {}
    for node in ast.parse((lazy if lazy.exists() else MODULES[room]).read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ImportFrom):
            module = f"{room}.{node.module}" if node.level else str(node.module)
            names |= {alias.asname or alias.name: module for alias in node.names}
    return names


SURFACES = {room: surface(room) for room in ROOMS}


def imports(path: Path) -> Iterator[tuple[str, str]]:
    """Every module that a file imports, and the name that it wants of it, if any."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, ""
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: a relative import"
            for alias in node.names:
                yield node.module or "", alias.name


def home(module: str, name: str) -> str:
    """The module that a name is defined in, behind all surfaces."""
    if f"{module}.{name}" in MODULES and name not in SURFACES.get(module, {}):
        return f"{module}.{name}"
    behind = SURFACES.get(module, {}).get(name)
    return module if behind is None or not behind.startswith("drlsl") else home(behind, name)


def test_imports_point_one_way() -> None:
    done = subprocess.run(
        [Path(sys.executable).parent / "lint-imports", "--no-cache"], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("page", ["CONTRIBUTING.md", "docs/architecture.md"])
def test_pages_tell_the_order_that_is_checked(page: str) -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contract = next(one for one in settings["tool"]["importlinter"]["contracts"] if one["name"] == "Rooms")
    order = " < ".join(", ".join(layer.split(" | ")) for layer in reversed(contract["layers"]))
    text = " ".join((ROOT / page).read_text(encoding="utf-8").split())
    assert f"`{order}`" in text, f"{page} should hold `{order}`"


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_outsiders_import_surfaces_only(path: Path) -> None:
    inside = name_of(path) if path.name == "__init__.py" else name_of(path).rpartition(".")[0]
    for module, name in imports(path):
        target = f"{module}.{name}" if f"{module}.{name}" in MODULES else module
        if target not in MODULES or target in ROOMS:
            continue
        room = target.rpartition(".")[0]
        assert f"{inside}.".startswith(f"{room}."), f"{path} imports {target}, which is inside {room}"


@pytest.mark.parametrize("room", sorted(ROOMS))
def test_a_surface_offers_what_is_there(room: str) -> None:
    for name, module in SURFACES[room].items():
        if module.startswith("drlsl"):
            assert module in MODULES, f"{room} offers {name} of {module}, which is not there"


def test_there_is_no_circle_of_modules() -> None:
    graph = {
        importer: {home(module, name) for module, name in imports(path)} & MODULES.keys() - {importer}
        for importer, path in MODULES.items()
        if importer not in ROOMS
    }
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(f"modules import each other: {' -> '.join(error.args[1])}")


def test_no_two_files_have_one_name() -> None:
    places = defaultdict(list)
    for path in FILES:
        places[path.name].append(path.relative_to(PACKAGE).as_posix())
    twice = {name: found for name, found in places.items() if len(found) > 1 and name not in SAME_NAME}
    assert not twice
    assert all(len(places[name]) > 1 for name in SAME_NAME)


@pytest.mark.parametrize("path", sorted((PACKAGE / "logic").rglob("*.py")), ids=name_of)
def test_logic_imports_the_standard_library_only(path: Path) -> None:
    for module, _ in imports(path):
        top = module.split(".")[0]
        if top == "drlsl":
            assert module.startswith("drlsl.logic"), f"{path} imports {module}"
        else:
            assert top in sys.stdlib_module_names, f"{path} imports {module}"


@pytest.mark.parametrize(
    ("library", "allowed"),
    [
        ("ray", {"drlsl.workers.cluster"}),
        ("z3", {"drlsl.verify.smt.solver"}),
        ("cvc5", {"drlsl.verify.smt.second"}),
        ("clingo", {"drlsl.induction.clause_search"}),
        ("numba", {f"drlsl.lowering.backends.numba_{part}" for part in ("compile", "operations")}),
    ],
)
def test_only_the_modules_meant_for_it_import_a_heavy_library(library: str, allowed: set[str]) -> None:
    users = {
        name
        for name, path in MODULES.items()
        if any(one.split(".")[0] == library for one, _ in imports(path))
    }
    assert users == allowed


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_torch_is_the_learners_and_one_back_ends(path: Path) -> None:
    if path.name in TORCH_BACK_END or path.relative_to(PACKAGE).parts[0] in ("learning", "benchmarks"):
        return
    assert all(module.split(".")[0] != "torch" for module, _ in imports(path))


def loaded_by(code: str) -> set[str]:
    """The top-level modules that a fresh interpreter has loaded after `code`."""
    script = f"{code}\nimport sys; print(*sorted(sys.modules), file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return {name.split(".")[0] for name in done.stderr.split()}


def test_the_command_line_starts_light() -> None:
    assert loaded_by("import drlsl.cli").isdisjoint({"torch", "pandas", "matplotlib", "gymnasium", "numpy"})


def test_no_other_back_end_loads_torch() -> None:
    modules = sorted((PACKAGE / "lowering" / "backends").glob("*.py"))
    names = [name_of(path) for path in modules if path.name not in TORCH_BACK_END]
    assert "torch" not in loaded_by(f"import {', '.join(names)}")


def test_a_query_stays_light() -> None:
    scene = ROOT / "examples" / "scene.json"
    loaded = loaded_by(f"from drlsl.cli import run; assert run(['query', '--state', {str(scene)!r}]) == 0")
    assert loaded.isdisjoint({"torch", "pandas", "matplotlib", "gymnasium", "numpy"})
    # Either of these takes about as long to load as the rest of a query takes.
    assert loaded.isdisjoint({"typer", "click", "pydantic", "pydantic_core"})


def test_training_begins_without_the_libraries_of_its_figures() -> None:
    assert loaded_by("import drlsl.learning.session").isdisjoint({"pandas", "matplotlib"})


def test_a_query_imports_no_other_command_and_no_compiler() -> None:
    scene = ROOT / "examples" / "scene.json"
    code = f"from drlsl.cli import run; assert run(['query', '--state', {str(scene)!r}]) == 0"
    names = "sorted(name for name in sys.modules if name.startswith(('drlsl.cli.', 'drlsl.logic.jit.')))"
    done = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport sys; print(*{names}, file=sys.stderr)"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert set(done.stderr.split()) == {
        "drlsl.cli.failures",
        "drlsl.cli.plain_query",
        "drlsl.cli.query_answer",
        "drlsl.logic.jit.tiering",
    }
