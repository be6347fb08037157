#!/usr/bin/env bash
# cvc5 from Python: the overall time limit is accepted and has no effect; the one for each check works.
#
# One would guess: cvc5 documents two limits, `tlimit` for all its work and `tlimit-per` for each check. Set from Python, either
# ends a check that takes longer, or an option that cannot work there is refused.
#
# What happens: setting `tlimit` raises nothing, and the check runs on to its end, however long that is: here some seconds with
# a limit of 20 ms. With `tlimit-per` the same check ends after 20 ms as unknown, with the explanation TIMEOUT.
#
# Seen with cvc5 1.4.2 from PyPI, Python 3.11, Linux x86_64:
#     tlimit      unsat after 6.5 s
#     tlimit-per  unknown after 0.0 s
#
# Why it matters: whoever embeds the solver and bounds it by the option whose name says so has no bound at all, and notices only
# at the first question that is hard.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check cvc5==1.4.2
"$work/venv/bin/python" - <<'PY'
import time

from cvc5.pythonic import Bool, Not, Or, SolverFor

HOLES = 8
LIMIT_MS = 20


def check(option):
    """Ask for one pigeon more than there are holes, each hole for one: there is no way, which takes seconds to find out."""
    solver = SolverFor("QF_LIA")
    solver.setOption(option, str(LIMIT_MS))
    sits = [[Bool(f"p{pigeon}_{hole}") for hole in range(HOLES)] for pigeon in range(HOLES + 1)]
    for pigeon in sits:
        solver.add(Or(*pigeon))
    for hole in range(HOLES):
        for one in range(HOLES + 1):
            for other in range(one):
                solver.add(Or(Not(sits[one][hole]), Not(sits[other][hole])))
    started = time.perf_counter()
    answer = str(solver.check())
    took = time.perf_counter() - started
    print(f"{option:<10}  {answer} after {took:.1f} s")
    return answer, took


answer, took = check("tlimit")
assert answer == "unsat" and took > 5 * LIMIT_MS / 1000, "tlimit now has an effect"
answer, took = check("tlimit-per")
assert answer == "unknown", "tlimit-per no longer ends a check"
PY
