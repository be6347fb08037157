"""Versions to measure: DRLSL as a checkout has it, or as a wheel that is installed for the purpose."""

from __future__ import annotations

import email.parser
import os
import resource
import subprocess
import sys
import venv
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from drlsl.errors import UserError


@dataclass(frozen=True, slots=True)
class Subject:
    """An installed DRLSL, which runs in `folder` on one thread and keeps machine code in `cache`."""

    program: Path
    folder: Path
    cache: Path
    settings: tuple[str, ...] = ()
    """Settings of its training, each KEY=VALUE."""

    def run(self, *arguments: str, cache: Path | None = None) -> str:
        """Return the output of its command.

        Raises:
            UserError: it fails.
        """
        return self._run([str(self.program), *arguments], cache)

    def run_code(self, code: str, *arguments: str, cache: Path | None = None) -> str:
        """Return the output of a script that its Python runs.

        Raises:
            UserError: it fails.
        """
        return self._run([str(self.program.with_name("python")), "-c", code, *arguments], cache)

    def _run(self, command: list[str], cache: Path | None) -> str:
        environment = {
            **os.environ,
            "OMP_NUM_THREADS": "1",
            "MKL_NUM_THREADS": "1",
            "DRLSL_CACHE": str(cache or self.cache),
        }
        done = subprocess.run(command, cwd=self.folder, env=environment, capture_output=True, text=True)
        if done.returncode != 0:
            problem = (done.stderr.strip().splitlines() or ["no message"])[-1]
            told = " ".join(one for one in command if "\n" not in one)
            raise UserError(f"{told} ended with {done.returncode}: {problem}")
        return done.stdout


def children_time() -> float:
    """Return the processor time of all processes that this one has waited for [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def subject(source: Path, work: Path) -> Subject:
    """Return the DRLSL of a checkout, or of a wheel, which is installed in an environment of its own.

    That has the packages of this Python besides, so that two wheels differ in nothing else. `work` is an
    empty folder for it and for its cache.

    Raises:
        UserError: a folder is not a checkout with a virtual environment; or a file is no wheel of DRLSL, or
            cannot be installed or started here.
    """
    work.mkdir(parents=True)
    if source.suffix == ".whl":
        return Subject(_installed(source, work / "environment"), work, work / "cache")
    program = source / ".venv" / "bin" / "drlsl"
    if not program.is_file():
        raise UserError(
            f"{source}: no .venv/bin/drlsl; name a wheel, or a checkout in which `make check` was run"
        )
    return Subject(program.absolute(), source.absolute(), (work / "cache").absolute())


def _installed(wheel: Path, folder: Path) -> Path:
    """Return the `drlsl` command of a wheel after its installation in a virtual environment."""
    name = _name(wheel)
    if name != "drlsl":
        raise UserError(f"{wheel}: a wheel of {name}, expected one of drlsl")
    if find_spec("pip") is None:
        raise UserError(f"{sys.executable} has no pip, which installs wheels; run `python -m ensurepip`")
    venv.create(folder, symlinks=True)
    (packages,) = folder.glob("lib/python*/site-packages")
    shared = [path for path in sys.path if Path(path).name in ("site-packages", "dist-packages")]
    (packages / "shared.pth").write_text("".join(f"{path}\n" for path in shared), encoding="utf-8")
    python = folder / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--python", str(python), "--disable-pip-version-check"]
    _check(wheel, [*pip, "install", "--quiet", "--no-deps", "--no-index", str(wheel)], {})
    program = folder.absolute() / "bin" / "drlsl"
    if not program.is_file():
        raise UserError(f"{wheel}: it installs no command drlsl")
    _check(wheel, [str(program), "bench", "--help"], {"COLUMNS": "80"})
    return program


def _name(wheel: Path) -> str:
    """Return the name of the distribution in a wheel."""
    try:
        with zipfile.ZipFile(wheel) as archive:
            (found,) = (
                one
                for one in archive.namelist()
                if one.count("/") == 1 and one.endswith(".dist-info/METADATA")
            )
            text = archive.read(found).decode("utf-8", errors="replace")
    except OSError as error:
        raise UserError(f"{wheel}: cannot be read: {error.strerror or error}") from error
    except (ValueError, zipfile.BadZipFile) as error:
        raise UserError(f"{wheel}: not a wheel") from error
    return str(email.parser.HeaderParser().parsestr(text)["Name"])


def _check(wheel: Path, command: list[str], environment: Mapping[str, str]) -> None:
    """Run a step of the installation.

    Raises:
        UserError: it fails.
    """
    done = subprocess.run(command, env={**os.environ, **environment}, capture_output=True, text=True)
    if done.returncode != 0:
        said = (done.stderr or done.stdout).strip().splitlines() or ["no message"]
        problem = next((line for line in said if line.startswith("ERROR: ")), said[-1])
        raise UserError(f"{wheel}: cannot be used here: {problem.removeprefix('ERROR: ')}")
