"""Prove random properties, and attack each proved one with other scenes: none may be broken.

python -m scripts.random_properties --state random.jsonl --count 3000 --jobs 2

Results are appended to the state file; the same command resumes from there. The exit status is 1 if a proved
property is broken in exact arithmetic, or the tiers disagree about it; its program is printed.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Final

from drlsl.verify import Case, Prover, Task
from drlsl.verify.attack import Orders, attack
from tests.verify.random_properties import RULES, random_program

CASE: Final = Case(0, 2, 1, 1)
VEHICLES: Final = 2
ATTACK_SEED: Final = 7
_TASKS_OF_A_PROCESS: Final = 50
BROKEN: Final = ("exact", "tiers")
"""Results of an attack that contradict a proof."""


@dataclass(frozen=True, slots=True)
class Record:
    """Result for the property of one seed; `hit` is what the attack found if it was proved."""

    seed: int
    status: str
    reason: str = ""
    hit: str | None = None
    scenes: int = 0
    seconds: float = 0.0


def examine(seed: int, *, scenes: int, time_limit: float) -> Record:
    """Prove the property of a seed, and attack it if it is proved; `seconds` is processor time."""
    started = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        rules, properties = Path(folder, "rules.pl"), Path(folder, "properties.pl")
        rules.write_text(RULES, encoding="utf-8")
        properties.write_text(random_program(seed), encoding="utf-8")
        prover = Prover.of([rules], [properties])
    if prover.refused:
        return Record(seed, "unknown", prover.refused["p"])
    (finding,) = prover.run(Task(CASE, ("p",), VEHICLES, time_limit))
    hit, tried = None, 0
    if finding.status == "proved":
        orders = Orders([CASE], VEHICLES, scenes, ATTACK_SEED + seed)
        result = attack(prover.book, prover.property("p"), orders)
        hit, tried = result.hit.kind if result.hit else None, result.scenes
    return Record(seed, finding.status, finding.reason, hit, tried, round(time.process_time() - started, 3))


def main(arguments: Sequence[str] | None = None) -> int:
    """Examine the seeds that are not done yet; return 1 if a proved property is broken."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--count", type=int, default=3000)
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--state", type=Path, required=True, help="a file of JSON lines")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--scenes", type=int, default=100_000, help="scenes to attack a proved property with")
    parser.add_argument("--time-limit", type=float, default=1.0, help="seconds for a proof")
    options = parser.parse_args(arguments)
    records = _done(options.state)
    seeds = [seed for seed in range(options.first, options.first + options.count) if seed not in records]
    task = partial(examine, scenes=options.scenes, time_limit=options.time_limit)
    with (
        options.state.open("a", encoding="utf-8") as file,
        multiprocessing.get_context("spawn").Pool(options.jobs, maxtasksperchild=_TASKS_OF_A_PROCESS) as pool,
    ):
        for record in pool.imap_unordered(task, seeds):
            records[record.seed] = record
            file.write(json.dumps(asdict(record)) + "\n")
            file.flush()
            if record.hit in BROKEN:
                print(
                    f"BROKEN ({record.hit}), seed {record.seed}:\n{random_program(record.seed)}", flush=True
                )
    return report(list(records.values()))


def _done(state: Path) -> dict[int, Record]:
    """Return the records of a state file; a truncated last line is ignored."""
    records = {}
    for line in state.read_text(encoding="utf-8").splitlines() if state.exists() else ():
        try:
            record = Record(**json.loads(line))
        except (ValueError, TypeError):
            continue
        records[record.seed] = record
    return records


def report(records: Sequence[Record]) -> int:
    """Print a summary; return 1 if a proved property is broken."""
    statuses = Counter(record.status for record in records)
    hits = Counter(record.hit or "none" for record in records if record.status == "proved")
    seconds = sum(record.seconds for record in records)
    print(f"{len(records)} properties: {', '.join(f'{n} {status}' for status, n in statuses.most_common())}")
    print(f"hits on proved properties: {', '.join(f'{n} {kind}' for kind, n in hits.most_common())}")
    print(f"{sum(record.scenes for record in records)} scenes, {seconds:.0f} s of processor time")
    return int(any(record.hit in BROKEN for record in records))


if __name__ == "__main__":
    sys.exit(main())
