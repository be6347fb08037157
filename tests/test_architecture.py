"""Imports point one way, and starting the command line stays light."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "drlsl"
ORDER = [
    "errors",
    "logic",
    "plain_text",
    "traffic",
    "driving",
    "assurance",
    "config",
    "learning",
    "study",
    "verify",
    "cli",
]
ALLOWED_IN_LOGIC = {"llvmlite", "numba", "numpy", "torch"}
TORCH_BACK_END = {"torch_backend.py", "torch_ops.py"}


def imports(path: Path) -> Iterator[tuple[str, bool]]:
    """Every imported module, and whether it is imported with the file: not in a function or for types."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    lazy = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        or (isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING")
        for inner in ast.walk(node)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, id(node) not in lazy
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: a relative import"
            yield node.module or "", id(node) not in lazy


def layer(module: str) -> int:
    parts = module.split(".")
    return ORDER.index(parts[1]) if len(parts) > 1 and parts[1] in ORDER else -1


FILES = sorted(PACKAGE.rglob("*.py"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_point_one_way(path: Path) -> None:
    inside = path.relative_to(PACKAGE.parent).with_suffix("").parts
    own = layer(".".join(inside))
    for module, _ in imports(path):
        if module.startswith("drlsl.") and own >= 0:
            assert layer(module) <= own, f"{path} imports {module}, which is above it"


@pytest.mark.parametrize("path", sorted((PACKAGE / "logic").rglob("*.py")), ids=lambda path: path.name)
def test_logic_imports_the_standard_library_only(path: Path) -> None:
    array_back_end = "lowering" in path.parts
    for module, _ in imports(path):
        top = module.split(".")[0]
        if top == "drlsl":
            assert module.startswith("drlsl.logic"), f"{path} imports {module}"
        elif not (array_back_end and top in ALLOWED_IN_LOGIC):
            assert top in sys.stdlib_module_names, f"{path} imports {module}"
        if top == "torch":
            assert path.name in TORCH_BACK_END, f"{path} imports {module}"


@pytest.mark.parametrize("path", sorted((PACKAGE / "driving").rglob("*.py")), ids=lambda path: path.name)
def test_driving_never_imports_torch(path: Path) -> None:
    assert all(module.split(".")[0] != "torch" for module, _ in imports(path))


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_only_commands_ask_for_evidence(path: Path) -> None:
    if path.relative_to(PACKAGE).parts[0] not in ("assurance", "cli"):
        assert not any(module.startswith("drlsl.assurance") for module, _ in imports(path))


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_only_one_module_imports_ray(path: Path) -> None:
    if path.relative_to(PACKAGE).as_posix() != "study/cluster.py":
        assert all(module.split(".")[0] != "ray" for module, _ in imports(path))


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_only_one_module_imports_z3(path: Path) -> None:
    if path.relative_to(PACKAGE).as_posix() != "verify/solver.py":
        assert all(module.split(".")[0] != "z3" for module, _ in imports(path))


def loaded_by(code: str) -> set[str]:
    """The top-level modules that a fresh interpreter has loaded after `code`."""
    script = f"{code}\nimport sys; print(*sorted(sys.modules), file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return {name.split(".")[0] for name in done.stderr.split()}


def test_the_command_line_starts_light() -> None:
    assert loaded_by("import drlsl.cli").isdisjoint({"torch", "pandas", "matplotlib", "gymnasium", "numpy"})


def test_no_other_back_end_loads_torch() -> None:
    modules = sorted((PACKAGE / "logic" / "lowering").glob("*.py"))
    names = [f"drlsl.logic.lowering.{path.stem}" for path in modules if path.name not in TORCH_BACK_END]
    names = [name for name in names if "numba" not in name]  # an extra
    assert "torch" not in loaded_by(f"import {', '.join(names)}")


def test_a_query_stays_light() -> None:
    scene = Path(__file__).parents[1] / "examples" / "scene.json"
    loaded = loaded_by(f"from drlsl.cli import run; assert run(['query', '--state', {str(scene)!r}]) == 0")
    assert loaded.isdisjoint({"torch", "pandas", "matplotlib", "gymnasium"})
