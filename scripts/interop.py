"""Try libraries that users have, each in an environment of its own: train, or compare readers of traffic.

python scripts/interop.py                 # all of tests/interop/requirements: some minutes and 10 GB
python scripts/interop.py torchrl sb3     # some
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any, Final

ROOT: Final = Path(__file__).parents[1]
REQUIREMENTS: Final = ROOT / "tests" / "interop" / "requirements"
FOLDER: Final = ROOT / ".venv-interop"
_PIP: Final = ("-m", "pip", "install", "--quiet", "--disable-pip-version-check")


def install(name: str) -> str:
    """Make the environment of a library, unless it is there; return why it cannot be made, or nothing."""
    folder, pinned = FOLDER / name, REQUIREMENTS / f"{name}.txt"
    ready = folder / ".ready"
    if ready.exists() and ready.read_text() == pinned.read_text():
        return ""
    commands: list[list[str]] = [
        [sys.executable, "-m", "venv", str(folder)],
        [*_python(name), *_PIP, "-e", f"{ROOT}[fast,test]", "-r", str(pinned)],
    ]
    for command in commands:
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            lines = [line for line in done.stderr.splitlines() if line.startswith("ERROR")]
            return (lines or done.stderr.splitlines() or ["no message"])[-1]
    ready.write_text(pinned.read_text())
    return ""


def test(name: str) -> bool:
    """Run the tests of a library in its environment; return whether they passed."""
    command = [*_python(name), "-m", "pytest", "tests/interop", "-k", name, "-rs"]
    return subprocess.run(command, cwd=ROOT, env=_environment()).returncode == 0


def measure(name: str) -> dict[str, Any]:
    """Return what a training in a library, in its environment, is like."""
    command = [*_python(name), "-m", "tests.interop.measure", name]
    done = subprocess.run(
        command, cwd=ROOT, env=_environment(), stdout=subprocess.PIPE, text=True, check=True
    )
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def _python(name: str) -> list[str]:
    return [str(FOLDER / name / "bin" / "python")]


def _environment() -> dict[str, str]:
    return {**os.environ, "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


def main() -> int:
    """Install, test and measure the libraries, and print what was found."""
    known = sorted(path.stem for path in REQUIREMENTS.glob("*.txt"))
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"one of {', '.join(known)}")
    names = parser.parse_args().names or known
    if unknown := sorted(set(names) - set(known)):
        parser.error(f"{', '.join(unknown)}: expected some of {', '.join(known)}")
    rows, failed = [], []
    for name in names:
        if why := install(name):
            failed.append(f"{name} cannot be installed: {why}")
        elif not test(name):
            failed.append(f"{name}: a test failed")
        elif (ROOT / "tests" / "interop" / f"use_{name}.py").exists():
            rows.append(measure(name))  # the others read traffic, and are tested alone
    print("| library | version | not offered, of steps: single, vector | steps/s: single, vector |")
    print("|---|---|---|---|")
    for row in rows:
        one, many = row["single"], row["vector"]
        counts = ", ".join(f"{kind['not_offered']} of {kind['steps']:,}" for kind in (one, many))
        print(f"| {row['library']} | {row['version']} | {counts} | ", end="")
        print(f"{one['steps_per_second']:,}, {many['steps_per_second']:,} |")
    for row in rows:
        for title, count in row["bypasses"].items():
            print(f"{row['library']}: {title}: {count} not offered")
    for line in failed:
        print(line, file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
