#!/usr/bin/env bash
# Numba: whether 1 / x fails at x = 0 hangs on how it is written, and for powers not on the error model.
#
# One would guess: the error model decides. Under "python" a function fails where Python fails, and Python raises ZeroDivisionError
# for 1.0 / 0.0, for 0.0 ** -1.0 and for 0.0 ** -1 alike; under "numpy" all three are inf.
#
# What happens: the division obeys the error model. A power with the exponent -1.0 is inf under both models, and one with the exponent
# -1 raises under both. A power beyond the largest float, an OverflowError in Python, is inf under both.
#
# Seen with numba 0.68.1 from PyPI, Python 3.11, Linux x86_64 (Python, error model python, error model numpy):
#     1.0 / x        ZeroDivisionError ZeroDivisionError inf
#     x ** -1.0      ZeroDivisionError inf               inf
#     x ** -1        ZeroDivisionError ZeroDivisionError ZeroDivisionError
#     (x + 1e200)**2 OverflowError     inf               inf
#
# Why it matters: whoever counts on the error model to be told of an impossible gap or time to collision is told for some spellings of
# the formula only: another one goes on with inf, which any "is it more than needed?" takes for plenty of room. And whoever chose the
# model "numpy" so that one bad row spoils only itself has a batch that fails as a whole.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check numba==0.68.1
"$work/venv/bin/python" - <<'PY'
import numba

FUNCTIONS = {
    "1.0 / x": lambda x: 1.0 / x,
    "x ** -1.0": lambda x: x**-1.0,
    "x ** -1": lambda x: x**-1,
    "(x + 1e200)**2": lambda x: (x + 1e200) ** 2,
}


def outcome(function):
    try:
        return str(function(0.0))
    except ArithmeticError as error:
        return type(error).__name__


seen = {}
for text, function in FUNCTIONS.items():
    compiled = [numba.njit(error_model=model)(function) for model in ("python", "numpy")]
    seen[text] = [outcome(function), *map(outcome, compiled)]
    print(f"{text:<14} {seen[text][0]:<17} {seen[text][1]:<17} {seen[text][2]}")
assert seen["1.0 / x"] == ["ZeroDivisionError", "ZeroDivisionError", "inf"], "division changed"
assert seen["x ** -1.0"] == ["ZeroDivisionError", "inf", "inf"], "powers with a float changed"
assert seen["x ** -1"] == ["ZeroDivisionError"] * 3, "powers with an integer changed"
assert seen["(x + 1e200)**2"] == ["OverflowError", "inf", "inf"], "overflow of powers is treated another way now"
PY
