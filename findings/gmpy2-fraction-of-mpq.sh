#!/usr/bin/env bash
# A Python fraction made from gmpy2's rational looks like any other, and gmpy2 no longer takes it for a number.
#
# One would guess: fractions.Fraction and gmpy2.mpq mix freely, as Fraction and int do; gmpy2 converts fractions that it meets in
# arithmetic, so a value may go to one and come back.
#
# What happens: Fraction(mpq(1, 3)) keeps gmpy2's integers as numerator and denominator. It prints, hashes, and compares with other
# fractions as usual. But mpq arithmetic with it, in either order, mpq(...) of it, and even mpq == fraction raise SystemError ("Object
# does not appear to be Fraction"); fraction == mpq is True. A Fraction of Python's integers is converted, as one would guess.
#
# Seen with gmpy2 2.3.2 from PyPI, Python 3.11, Linux x86_64:
#     of Python's integers: product 1/6, equal True, reversed True
#     of mpq:               product SystemError, equal SystemError, reversed True
#
# Why it matters: mpq is several times as fast as Fraction in exact arithmetic, so it is put where Fraction was, and values cross
# between the two at the edges. The error comes far from the line that made the fraction, only on values that went both ways, and
# is of a class that few handlers of arithmetic errors catch. Fraction(int(x.numerator), int(x.denominator)) is safe.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check gmpy2==2.3.2
"$work/venv/bin/python" - <<'PY'
from fractions import Fraction

from gmpy2 import mpq


def told(compute):
    try:
        return str(compute())
    except SystemError:
        return "SystemError"


found = {}
for name, third in (("of Python's integers", Fraction(1, 3)), ("of mpq", Fraction(mpq(1, 3)))):
    assert third == Fraction(1, 3)
    assert hash(third) == hash(Fraction(1, 3))
    found[name] = [told(lambda: mpq(1, 2) * third), told(lambda: mpq(1, 3) == third), told(lambda: third == mpq(1, 3))]
    product, equal, turned = found[name]
    print(f"{name + ':':<22}product {product}, equal {equal}, reversed {turned}")

assert found["of Python's integers"] == ["1/6", "True", "True"], "the behaviour has changed"
assert found["of mpq"] == ["SystemError", "SystemError", "True"], "the behaviour has changed"
PY
