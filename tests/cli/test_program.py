"""`drlsl` itself: its version, and what it says where no command is given."""

from __future__ import annotations

import logging
import os
import re
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest

import drlsl
from drlsl.cli import main, run

ROOT = Path(__file__).parents[2]


def test_the_version_is_one_everywhere(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--version"]) == 0
    assert capsys.readouterr().out == f"drlsl {drlsl.__version__}\n"
    assert metadata.version("drlsl") == drlsl.__version__
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.findall(r"^## \[(\d.*)\] - ", changes, re.M)[0] == drlsl.__version__


def test_the_version_loads_nothing_but_itself() -> None:
    code = "import drlsl, sys; drlsl.__version__; print(*sorted(n for n in sys.modules if 'drlsl' in n))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["drlsl", "drlsl.moved", "drlsl.registration", "drlsl.version"]


def test_a_warning_is_one_line() -> None:
    code = "import warnings; from drlsl import cli; cli.run = lambda _: warnings.warn('damaged'); cli.main()"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == "drlsl: warning: damaged\n"


@pytest.mark.parametrize("group", [[], ["data"], ["runs"], ["config"], ["rules"], ["bench"]], ids=" ".join)
def test_no_command_shows_the_help(group: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(group) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    lines = printed.err.splitlines()
    assert lines[0] == f"Usage: {' '.join(['drlsl', *group])} [OPTIONS] COMMAND [ARGS]..."
    assert "Commands:" in lines


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            "train --seeds 0",
            "'--seeds': input should be greater than or equal to 1, got '0'. See 'drlsl train --",
        ),
        ("train --num-envs x", "'--num-envs': input should be a valid integer, "),
        (
            "train --bootstrap none",
            "'--bootstrap': 'none' is not one of 'all', 'safe'. See 'drlsl train --help'.",
        ),
        (
            "config schema rules",
            "'of': 'rules' is not one of 'train', 'study'. See 'drlsl config schema --help'.",
        ),
        (
            "data list --jsn",
            "No such option: --jsn (Possible options: --json). See 'drlsl data list --help'.",
        ),
        ("rules chekc", "No such command 'chekc'. Did you mean 'check'? See 'drlsl rules --help'."),
        ("query", "Missing option '--state'. See 'drlsl query --help'."),
    ],
)
def test_a_wrong_line_is_told_in_a_sentence(
    arguments: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(arguments.split()) == 2
    told = capsys.readouterr().err
    assert message in told
    assert told.count("\n") == 1
    assert "Value error" not in told


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("drlsl tr", {"train"}),
        ("drlsl runs ", {"list", "compare", "metrics"}),
        ("drlsl train --method ", {"dqn", "mpsdqn", "dqnsl"}),
        ("drlsl train --preset pa", {"paper", "paper-code"}),
        ("drlsl data info high", {"highway-test", "highway-train"}),
        ("drlsl config show q", {"quick"}),
    ],
)
def test_a_shell_completes_a_line(line: str, expected: set[str]) -> None:
    """As the script of `drlsl --show-completion` asks for it."""
    asked = {
        "_DRLSL_COMPLETE": "complete_bash",
        "COMP_WORDS": line,
        "COMP_CWORD": str(len(line.split(" ")) - 1),
    }
    done = subprocess.run(
        [sys.executable, "-c", "from drlsl.cli import main; main()"],
        env={**os.environ, **asked},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr, set(done.stdout.split())) == (0, "", expected)


@pytest.mark.parametrize("terminal", [True, False])
def test_what_is_compiled_is_shown_on_a_terminal_alone(
    terminal: bool, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    logger = logging.getLogger("drlsl.lowering.backends.numba_compile")
    before, level = list(logger.handlers), logger.level
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    try:
        with pytest.raises(SystemExit):
            main(["--version"])
        logger.info("compiling rules to machine code, once")
    finally:
        logger.handlers[:] = before
        logger.setLevel(level)
    assert capsys.readouterr().err == ("compiling rules to machine code, once\n" if terminal else "")


def test_python_runs_the_package_as_the_command() -> None:
    done = subprocess.run([sys.executable, "-m", "drlsl", "--version"], capture_output=True, check=True)
    assert done.stdout.decode() == f"drlsl {drlsl.__version__}\n"


def test_a_terminal_that_cannot_show_a_character_is_told_its_number() -> None:
    line = [sys.executable, "-m", "drlsl", "query", "--state", str(ROOT / "examples" / "scene.json")]
    shown = []
    for encoding in ("utf-8", "ascii"):
        environment = os.environ | {"PYTHONIOENCODING": encoding}
        done = subprocess.run(line, capture_output=True, env=environment, check=True)
        assert done.stderr == b""
        shown.append(done.stdout.decode())
    assert "²" in shown[0]
    assert shown[1] == shown[0].encode("ascii", "backslashreplace").decode()
