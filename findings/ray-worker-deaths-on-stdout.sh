#!/usr/bin/env bash
# Ray prints news of its cluster to the standard output of a program that told it to print nothing.
#
# One would guess: ray.init(log_to_driver=False) keeps what happens in the cluster out of the program's output, so that a program
# which prints JSON for the next one in a pipe can do so while Ray does its work again that a lost worker did not finish.
#
# What happens: the task is done again and its result is right. But when a worker process dies, lines about it in the name of the
# node's raylet come out on standard output, not standard error, between what the program prints.
#
# Seen with Ray 2.60.0 from PyPI, Python 3.11, Linux x86_64: the JSON on standard output is preceded by two lines that begin with
# "(raylet)".
#
# Why it matters: workers are lost on preemptible machines and when memory runs out, so seldom in a trial and often in a long run.
# Then the pipe's next program stops at a line that is no JSON. What must be read by a program is better written to a file, or
# standard output redirected while Ray is at work.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check ray==2.60.0
cat > "$work/program.py" <<'PY'
import json
import os
import signal
import sys
import time

import ray


@ray.remote(max_retries=2)
def squared(number: int, mark: str) -> int:
    """Return a square; the first try ends as one does whose machine is taken away."""
    if not os.path.exists(mark):
        open(mark, "w").close()
        os.kill(os.getpid(), signal.SIGKILL)
    return number * number


ray.init(num_cpus=1, include_dashboard=False, log_to_driver=False, logging_level="critical")
result = ray.get(squared.remote(7, sys.argv[1]))
time.sleep(5)  # news may come a little later
ray.shutdown()
print(json.dumps(result))
PY
"$work/venv/bin/python" "$work/program.py" "$work/mark" > "$work/out" 2> "$work/err"
cat "$work/out"
[ "$(tail -n 1 "$work/out")" = 49 ] || { echo "the result is another: the behaviour has changed"; exit 1; }
grep -q raylet "$work/out" || { echo "nothing about the raylet on standard output: the behaviour has changed"; exit 1; }
