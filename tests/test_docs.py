"""The documentation keeps up with the code."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

from scripts.cli_reference import reference
from scripts.follow_clause import walk
from tests.installed import needs_torch

ROOT = Path(__file__).parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")])


QUESTION_WORDS = ("What", "Who", "Whose", "Which", "Where", "When", "How", "Why", "Whether", "That")


def question_words(text: str) -> list[str]:
    """The docstrings that begin with a question word instead of a verb or a noun."""
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    nodes = [node for node in ast.walk(ast.parse(text)) if isinstance(node, documented)]
    docstrings = [ast.get_docstring(node) or "" for node in nodes]
    return [text for text in docstrings if re.match(rf"({'|'.join(QUESTION_WORDS)})\b", text)]


def test_docstrings_begin_with_a_verb_or_a_noun() -> None:
    """Ruff's D401 sees most functions; modules, classes and properties are looked at here."""
    assert question_words('class A:\n    @property\n    def b(self): "How many."\n') == ["How many."]
    sources = sorted((ROOT / "drlsl").rglob("*.py*"))
    texts = {path: path.read_text(encoding="utf-8") for path in sources if path.suffix in (".py", ".pyi")}
    assert {path.name: found for path, text in texts.items() if (found := question_words(text))} == {}


def test_the_reference_of_the_commands_is_current() -> None:
    assert (ROOT / "docs" / "cli.md").read_text(encoding="utf-8") == reference()


def test_the_page_on_lowering_follows_a_clause_as_the_code_does() -> None:
    assert walk() in (ROOT / "docs" / "lowering.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\((?!http)([^)#]+)", page.read_text(encoding="utf-8")):
        assert (page.parent / target).exists(), f"{page.name} links to {target}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_that_are_shown_exist(page: Path) -> None:
    known = set(
        re.findall(r"^## `drlsl (.+)`$", (ROOT / "docs" / "cli.md").read_text(encoding="utf-8"), re.M)
    )
    groups = {name.split()[0] for name in known if " " in name}
    for first, second in re.findall(
        r"^ {4}\$? ?drlsl (\w+) ?([\w-]*)", page.read_text(encoding="utf-8"), re.M
    ):
        name = f"{first} {second}" if first in groups else first
        assert name in known, f"{page.name} shows drlsl {name}"


def test_the_python_of_the_readme_runs() -> None:
    """In an interpreter of its own: what another test has imported must not help it."""
    blocks = re.findall(
        r"^```python\n(.*?)^```", (ROOT / "README.md").read_text(encoding="utf-8"), re.M | re.S
    )
    assert blocks
    for block in blocks:
        subprocess.run([sys.executable, "-c", block], cwd=ROOT, check=True)


@needs_torch
def test_the_networks_of_the_documentation_are_trained(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from drlsl.cli import run

    text = (ROOT / "docs" / "training.md").read_text(encoding="utf-8")
    networks, script = re.findall(r"^```python\n(.*?)^```", text, re.M | re.S)
    monkeypatch.chdir(tmp_path)
    Path("networks.py").write_text(networks, encoding="utf-8")
    Path("train.py").write_text(script, encoding="utf-8")
    subprocess.run([sys.executable, "train.py"], check=True)
    assert run(["eval", "runs/wide", "--episodes", "1"]) == 0
    commands = re.findall(r"^ {4}drlsl (train --network networks\.py:.*)$", text, re.M)
    assert len(commands) == 2
    for number, command in enumerate(commands):
        arguments = command.split()
        arguments[-1] = f"run{number}"
        assert run([*arguments, "--preset", "tiny", "--episodes", "1"]) == 0


@pytest.mark.parametrize("program", sorted((ROOT / "rules").rglob("*.pl")), ids=lambda path: path.name)
def test_every_predicate_of_the_rules_has_a_header(program: Path) -> None:
    text = program.read_text(encoding="utf-8")
    comments = " ".join(re.findall(r"^%(.*)$", text, re.M))
    heads = set(re.findall(r"^([a-z]\w*)(?=[(. ])", text, re.M))
    assert not {name for name in heads if not re.search(rf"\b{name}\b", comments)}
