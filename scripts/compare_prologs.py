"""Run the check of rules exported to Prolog in four systems.

`python scripts/compare_prologs.py [FOLDER] [FILE...]`: FOLDER is one where
`npm install tau-prolog@0.3.4 trealla@0.17.10` was run. A system that is not installed is named.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from drlsl.driving.export import export_rules
from scripts.compare_exports import FILES

SCENES: Final = 200

TAU: Final = """
const { readFileSync } = require("fs");
const session = require(process.argv[2] + "/node_modules/tau-prolog").create(2e9);
const failed = (error = "no") => { console.log(String(error)); process.exit(1); };
const ask = () => session.query("drlsl_check.", {
    success: () => session.answer({ success: () => {}, fail: failed, error: failed, limit: failed }),
    error: failed,
});
const consult = ([file, ...rest], next) => file === undefined ? next() : session.consult(
    readFileSync(file, "utf8"), { text: true, success: () => consult(rest, next), error: failed });
consult(process.argv.slice(3), ask);
"""

TREALLA: Final = """
import { readFileSync } from "node:fs";
const { load, Prolog } = await import(process.argv[2] + "/node_modules/trealla/trealla.js");
await load();
const system = new Prolog();
for (const file of process.argv.slice(3)) await system.consultText(readFileSync(file, "utf8"));
console.log((await system.queryOnce("drlsl_check")).stdout);
"""


def commands(modules: Path, folder: Path) -> Iterator[tuple[str, list[str] | None]]:
    """Yield each system and the command that runs the check in it; None where it is not installed."""
    rules, check = str(folder / "rules.pl"), str(folder / "check.pl")
    ask = ["-g", "drlsl_check", "-t", "halt", rules, check]
    yield "SWI-Prolog", ["swipl", *ask] if shutil.which("swipl") else None
    consult = ["--consult-file", rules, "--consult-file", check, "--query-goal", "drlsl_check,halt"]
    yield "GNU Prolog", ["gprolog", *consult] if shutil.which("gprolog") else None
    for name, package, file, text in (
        ("Tau Prolog", "tau-prolog", "tau.cjs", TAU),
        ("Trealla", "trealla", "trealla.mjs", TREALLA),
    ):
        (folder / file).write_text(text)
        is_there = shutil.which("node") and (modules / "node_modules" / package).is_dir()
        yield name, ["node", str(folder / file), str(modules), rules, check] if is_there else None


def main(modules: Path, files: list[str]) -> int:
    """Print how many stored decisions each system gives; return how many differ."""
    wrong = 0
    for file in files:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name) / "prolog"
            export_rules([Path(file)], "prolog", folder, decisions=SCENES)
            for system, command in commands(modules.resolve(), folder):
                if command is None:
                    print(f"{file}: {system} is not installed")
                    continue
                ran = subprocess.run(
                    command,
                    capture_output=True,
                    text=True,
                    env=os.environ | {"GLOBALSZ": "1000000"},
                    check=False,
                )
                found = re.search(r"(\d+) of (\d+) decisions are the stored ones", ran.stdout)
                wrong += found is None or found[1] != found[2]
                print(f"{file}: {system}: {found[0] if found else (ran.stdout + ran.stderr)[-300:]}")
    return wrong


if __name__ == "__main__":
    folder, *rest = sys.argv[1:] or ["."]
    sys.exit(1 if main(Path(folder), rest or list(FILES)) else 0)
