#!/usr/bin/env bash
# Griffe reads Python without running it: a constant that is bound by unpacking is not there for it.
#
# One would guess: a tool that documents packages from their text knows every name that a module binds at its top level. Two ways
# to write the same constants, `LOW = 0.0` on a line of its own or `LOW, HIGH = 0.0, 40.0`, make no difference to readers, to the
# import system or to type checkers, and so none to the tool.
#
# What happens: names that one statement unpacks are no members of the module. A package that offers such a name through its
# `__init__` and `__all__` has an alias that leads nowhere, and whoever follows it, as mkdocstrings does for the page of the
# package, gets AliasResolutionError, which names the package and not the statement that was passed over.
#
# Seen with griffelib 2.4.1 from PyPI, Python 3.11, Linux:
#     LIMIT  Attribute
#     LOW    AliasResolutionError
#
# Why it matters: a documentation built with warnings as errors stops, with a message that sends the reader to the wrong file; a
# documentation built without leaves the constants out.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check griffelib==2.4.1
mkdir "$work/speeds"
printf 'LOW, HIGH = 0.0, 40.0\nLIMIT = 30.0\n' > "$work/speeds/constants.py"
printf 'from speeds.constants import HIGH, LIMIT, LOW\n\n__all__ = ["HIGH", "LIMIT", "LOW"]\n' > "$work/speeds/__init__.py"
cd "$work"
"$work/venv/bin/python" - <<'PY'
import griffe
import speeds

assert speeds.LOW == 0.0, "Python itself finds the name"
package = griffe.load("speeds", search_paths=["."])
seen = {}
for name in ("LIMIT", "LOW"):
    try:
        seen[name] = type(package[name].final_target).__name__
    except griffe.AliasResolutionError as error:
        seen[name] = type(error).__name__
    print(f"{name:<6} {seen[name]}")
assert seen["LIMIT"] == "Attribute", "a plain assignment is no longer seen"
assert seen["LOW"] == "AliasResolutionError", "names that are unpacked are seen now"
PY
