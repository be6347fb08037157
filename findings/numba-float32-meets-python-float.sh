#!/usr/bin/env bash
# Numba and NumPy 2: a function of float32 arrays gives other numbers, of another type, once it is compiled.
#
# One would guess: compiled or not, a loop over an array of float32 gives the same number up to the last bits, since numba aims at
# NumPy's types. Summing the vector [1e8, 1, -1e8], step by step from total = 0.0, must then lose the 1 in both or in neither.
#
# What happens: under NumPy 2 a Python float takes the type of the float32 that it meets, so that total is of float32 from the first
# step on, and the 1 is lost. To numba 0.0 is a number of float64, and so is every sum with it: the 1 is kept. The same for a threshold:
# a gap of float32 that was rounded from 0.1 is "not more than 0.1" as it stands, and more than 0.1 when it is compiled.
#
# Seen with numba 0.68.1 and numpy 2.4.6 from PyPI, Python 3.11, Linux x86_64 (as it stands, compiled):
#     sum of [1e8, 1, -1e8]     0.0     1.0
#     float32(0.1) > 0.1        False   True
#     type of float32(1) + 1.0  float32 float64
#
# Why it matters: learning and sensing work in float32, and a function is tried out and tested as it stands before it is compiled. A
# loss, a mean speed or a comparison with a limit may then be decided the other way in production, without a word. Write the types
# out: np.float64(x) before adding, np.float32(limit) before comparing.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check numba==0.68.1 numpy==2.4.6
"$work/venv/bin/python" - <<'PY'
import numba
import numpy as np


def total(values):
    result = 0.0
    for value in values:
        result += value
    return result


def exceeds(values):
    return values[0] > 0.1


def increased(values):
    return np.array([values[0] + 1.0])


def both(function, values):
    return function(values), numba.njit(function)(values)


numbers = np.array([1e8, 1.0, -1e8], dtype=np.float32)
sums = both(total, numbers)
beyond = both(exceeds, np.array([0.1], dtype=np.float32))
types = [result.dtype.name for result in both(increased, np.ones(1, dtype=np.float32))]
print("sum of [1e8, 1, -1e8]    ", *map(float, sums))
print("float32(0.1) > 0.1       ", *map(bool, beyond))
print("type of float32(1) + 1.0 ", *types)
assert [float(one) for one in sums] == [0.0, 1.0], "sums agree now"
assert [bool(one) for one in beyond] == [False, True], "comparisons agree now"
assert types == ["float32", "float64"], "types agree now"
PY
