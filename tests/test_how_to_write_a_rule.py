"""docs/how-to-write-a-rule.md says what is so: its rules, its commands and their answers, its slips."""

from __future__ import annotations

import re
import shlex
from io import StringIO
from pathlib import Path

import pytest

from drlsl.cli import run
from scripts.overtakings import main as overtakings
from tests.installed import needs_torch

ROOT = Path(__file__).parents[1]
RULES = ROOT / "rules"
PAGE = (ROOT / "docs" / "how-to-write-a-rule.md").read_text(encoding="utf-8")

SESSIONS = re.findall(r"^ {4}\$ (drlsl .*)\n((?: {4}(?!\$).*\n|\n(?= {4}(?!\$)))*)", PAGE, re.M)
"""Commands with the answers that the page shows; ... stands for lines that it leaves out."""

MINUTES = "rules verify"


def shown(kind: str) -> list[str]:
    blocks = re.findall(rf"^```{kind}\n(.*?)^```", PAGE, re.M | re.S)
    assert blocks
    return blocks


@pytest.mark.parametrize("kind", ["prolog", "yaml"])
def test_what_it_shows_is_in_the_files(kind: str) -> None:
    suffix = {"prolog": "*.pl", "yaml": "*.test.yaml"}[kind]
    files = [path.read_text(encoding="utf-8") for path in sorted(RULES.glob(suffix))]
    for block in shown(kind):
        assert any(block in text for text in files), block


def answers(command: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    if "--what-if" in command or "rules verify" in command:
        pytest.importorskip("z3", reason="the extra verify")
    status = run(shlex.split(command)[1:])
    return status, capsys.readouterr().out


def agrees(wanted: str, given: str) -> bool:
    """Whether a text is what is shown, with whatever stands where ... does, and times as they may be."""
    pattern = "".join(
        r"(?:.*\n)*?" if line.strip() == "..." else rf"{re.escape(line.rstrip())}[ ]*\n"
        for line in (wanted if wanted.endswith("\n") else wanted + "\n").splitlines()
    )
    pattern = re.sub(r"(?:\\ )+\d+\\\.\d\\ s\[", r" +[\\d.]+ s[", pattern)
    return re.fullmatch(rf"{pattern}(?:\n)*", given) is not None


def sessions(*, slow: bool) -> list[tuple[str, str]]:
    found = [
        (command, re.sub(r"^ {4}", "", answer, flags=re.M).rstrip("\n"))
        for command, answer in SESSIONS
        if command.removeprefix("drlsl ").startswith(MINUTES) == slow
    ]
    assert found
    return found


@pytest.mark.parametrize(("command", "answer"), sessions(slow=False))
def test_commands_answer_as_shown(
    command: str, answer: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    status, given = answers(command, capsys)
    assert status == 0
    assert agrees(answer, given), given


@pytest.mark.slow
@pytest.mark.parametrize(("command", "answer"), sessions(slow=True))
def test_proofs_are_as_shown(
    command: str, answer: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    status, given = answers(command, capsys)
    assert status == ("refuted" in answer)
    assert agrees(answer, given), given


@needs_torch
def test_driving_works_as_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every command, with a folder of its own and fewer episodes."""
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr("sys.stdout", StringIO())
    commands = re.findall(r"^ {4}((?:drlsl|python) .*)$", PAGE.split("## 8.")[1].replace("\\\n", " "), re.M)
    assert {command.split()[1] for command in commands} == {"train", "eval", "scripts/overtakings.py"}
    for command in commands:
        few = re.sub(
            r"(--episodes |episodes=)\d+", r"\g<1>1", command.replace("runs/left", str(tmp_path / "left"))
        )
        words = shlex.split(few)
        if words[0] == "python":
            overtakings([*words[2:], *(() if "--episodes" in few else ("--episodes", "1"))])
        elif words[1] == "train":
            assert run([*words[1:], "--preset", "tiny", "--set", "evaluation.episodes_after_training=0"]) == 0
        else:
            assert run([*words[1:], "--episodes", "1"]) == 0


SLIPS = re.findall(r"^\| [^|]+ \| `(.+?)` for `(.+?)` \| `(.+?)` \|$", PAGE, re.M)


def test_all_slips_are_read() -> None:
    assert len(SLIPS) == len(re.findall(r"^\|.*\|$", PAGE.split("| slip |")[1].split("\n\n")[0], re.M)) - 1


@pytest.mark.parametrize(("new", "old", "message"), SLIPS)
def test_slips_are_named_as_shown(
    new: str, old: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (RULES / "overtake_left.pl").read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "overtake_left.pl"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    status = run(["rules", "check", str(path)])
    printed = capsys.readouterr()
    assert message in printed.out + printed.err
    assert status == (0 if message.startswith("it calls") else 2 if printed.err else 1)
