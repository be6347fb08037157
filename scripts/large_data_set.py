"""Make a data set of highD's size from bundled recordings, and print what driving in it costs.

`python scripts/large_data_set.py make ROOT [--recordings 60] [--minutes 17]` writes recordings in highD's
layout that ROOT does not have yet; 60 take 5 GB. Each is a row of bundled recordings, in an order and from
moments drawn by its number: where two meet, vehicles vanish and others appear.

`python scripts/large_data_set.py measure ROOT [--against CHECKOUT]` loads ROOT, then prints what a process
that starts to train on it needs up to its first step, and the speed of 256 environments beside that on six
single recordings of it, which differ in traffic, for this checkout and for another one. The first load of a
checkout takes minutes; its cache is ROOT/cache-NAME. Seconds and processor seconds are told, since a busy
machine lengthens the former. Memory is what no other process shares: anonymous pages, in
/proc/PID/smaps_rollup (Linux).
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from drlsl.traffic import Tracks, VehicleClass, highd_content, load_recording, write_highd

BASES: Final = ("highway-train", "highway-test")
"""Recordings of one road."""

SINGLE: Final = 6
"""Recordings whose speed is measured alone, at most."""

LEAST: Final = 0.5
"""Least part of a bundled recording that is taken at once."""

CHILD: Final = """
import json, sys, time
begun = float(sys.argv[1])
from itertools import cycle
from pathlib import Path
import numpy as np

def private():
    lines = Path("/proc/self/smaps_rollup").read_text().splitlines()
    return sum(int(line.split()[1]) for line in lines if line.startswith("Anonymous:")) / 1e6

def peak():
    import resource
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6

def train(name):
    from drlsl.learning import make_config, make_training_env, merged, preset_values
    from drlsl.learning.trainer import Trainer
    values = merged(preset_values("quick"), {"device": "cpu", "env": {"recording": name}})
    config = make_config(values, "train")
    told = Trainer(make_training_env(config), config).run()
    next(iter(told))
    wall, cpu = time.time() - begun, time.process_time()
    return {"start_s": wall, "start_cpu_s": cpu, "private_gb": private(), "most_resident_gb": peak()}

def speed(names):
    from drlsl.driving import EnvConfig
    from drlsl.driving.envs import HighwayVectorEnv
    envs = [HighwayVectorEnv(EnvConfig(recording=name), num_envs=256) for name in names]
    weights = cycle(np.random.default_rng(0).random((97, 256, 3)))
    for env in envs:
        env.reset(seed=0)
    taken = [[] for _ in envs]
    for part in range(33):
        for env, times in zip(envs, taken):
            start = time.process_time()
            for _ in range(100):
                env.step((env.action_masks() * next(weights)).argmax(axis=1))
            if part >= 3:
                times.append(25600 / (time.process_time() - start))
    return {"steps_per_s": [float(np.median(times)) for times in taken], "private_gb": private()}

print(json.dumps({"train": train, "speed": speed}[sys.argv[2]](json.loads(sys.argv[3]))))
"""
"""What a process of a checkout does; only names that older checkouts have, too."""


def make(root: Path, recordings: int, minutes: float) -> None:
    """Write the recordings that are missing."""
    for number in range(1, recordings + 1):
        folder = root / "data" / f"{number:02d}"
        if not folder.exists():
            write_recording(folder, number, minutes)
            print(folder, flush=True)


def write_recording(folder: Path, number: int, minutes: float) -> None:
    """Write one recording, a function of its number and minutes."""
    bases = [highd_content(load_recording(name)) for name in BASES]
    frames = round(minutes * 60 * bases[0].frame_rate)
    rng, parts, filled, vehicles = np.random.default_rng(number), [], 0, 0
    classes: dict[int, VehicleClass] = {}
    while filled < frames:
        base = bases[rng.integers(len(bases))]
        length = int(base.tracks.frame.max()) + 1
        begin = int(rng.integers(round(length * (1 - LEAST))))
        end = min(length, begin + frames - filled)
        inside = (base.tracks.frame >= begin) & (base.tracks.frame < end)
        tracks = base.tracks.take(inside)
        parts.append(replace(tracks, frame=tracks.frame - begin + filled, vehicle=tracks.vehicle + vehicles))
        classes |= {one + vehicles: base.vehicle_class[one] for one in np.unique(tracks.vehicle).tolist()}
        filled, vehicles = filled + end - begin, vehicles + int(base.tracks.vehicle.max()) + 1
    columns = {
        item.name: np.concatenate([getattr(part, item.name) for part in parts]) for item in fields(Tracks)
    }
    content = replace(bases[0], tracks=Tracks(**columns), vehicle_class=classes)
    write_highd(content, folder, f"{number:02d}")


def measure(root: Path, against: Path | None) -> None:
    """Print the rows for this checkout and for another one."""
    here = Path(__file__).resolve().parent.parent
    found = {}
    for name, checkout in (("this", here), ("other", against)):
        if checkout is not None:
            found[name] = measured(root, name, checkout)
            print(f"{name:<6}{json.dumps(found[name])}", flush=True)
    if against is not None:
        ratio = found["other"]["start"]["private_gb"] / found["this"]["start"]["private_gb"]
        print(f"private memory: {ratio:.1f} times less")
    *single, whole = found["this"]["speed"]["steps_per_s"]
    ratio = whole / float(np.median(single))
    print(f"256 environments in the data set: {ratio:.3f} of the median speed in one recording")


def measured(root: Path, name: str, checkout: Path) -> dict[str, Any]:
    """Return what a checkout needs: its first start, which fills the cache, another start, and speeds."""
    data = root / "data"
    recordings = sorted(data.iterdir())
    single = recordings[:: max(1, len(recordings) // SINGLE)][:SINGLE]

    def ask(what: str, about: Any) -> Any:
        done = subprocess.run(
            [sys.executable, "-c", CHILD, str(time.time()), what, json.dumps(about)],
            env=os.environ | {"DRLSL_CACHE": str(root / f"cache-{name}"), "PYTHONPATH": str(checkout)},
            cwd=checkout,
            stdout=subprocess.PIPE,
            check=True,
        )
        return json.loads(done.stdout.splitlines()[-1])

    return {
        "first": ask("train", str(data)),
        "start": ask("train", str(data)),
        "one": ask("train", str(single[0])),
        "speed": ask("speed", [*map(str, single), str(data)]),
    }


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    commands = parser.add_subparsers(dest="command", required=True)
    making, measuring = commands.add_parser("make"), commands.add_parser("measure")
    for each in (making, measuring):
        each.add_argument("root", type=Path)
    making.add_argument("--recordings", type=int, default=60)
    making.add_argument("--minutes", type=float, default=17.0)
    measuring.add_argument("--against", type=Path)
    given = parser.parse_args()
    if given.command == "make":
        make(given.root, given.recordings, given.minutes)
    else:
        measure(given.root, given.against)
