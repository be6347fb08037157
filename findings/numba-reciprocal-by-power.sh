#!/usr/bin/env bash
# Numba raises for 1 / x at x = 0 and not for x ** -1, in one function and under one error model.
#
# One would guess: compiled with the error model "python", a function fails where Python fails. Python raises ZeroDivisionError for
# 1 / 0.0, for 0.0 ** -1.0 and for 0.0 ** -1, so the three are three spellings of one thing.
#
# What happens: the division, the floor division and the remainder raise, as in Python. The powers do not: they answer inf, or -inf
# for -0.0, under either error model. In the same way a power of a negative number with a fraction as exponent, a complex number in
# Python, is NaN, and one beyond the largest float, an OverflowError in Python, is inf.
#
# Seen with numba 0.68.1 from PyPI, Python 3.11, Linux x86_64 (Python, error model python, error model numpy):
#     1.0 / x        ZeroDivisionError ZeroDivisionError inf
#     x ** -1.0      ZeroDivisionError inf               inf
#     x ** -1        ZeroDivisionError inf               inf
#     (x + 1e200)**2 OverflowError     inf               inf
#
# Why it matters: whoever counts on the error model to be told of an impossible gap or time to collision is told for one spelling of
# the formula only. The other one goes on with inf, which any "is it more than needed?" takes for plenty of room.
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
for text in ("x ** -1.0", "x ** -1"):
    assert seen[text] == ["ZeroDivisionError", "inf", "inf"], "powers of zero are treated another way now"
assert seen["(x + 1e200)**2"] == ["OverflowError", "inf", "inf"], "overflow of powers is treated another way now"
PY
