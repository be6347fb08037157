"""Filling the gaps that were cut into real tracks takes away the endings that they add."""

from __future__ import annotations

import os
import random
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest

from drlsl.driving.shield import Shield
from drlsl.traffic import Recording, fill_gaps, load_recording
from drlsl.traffic.edit import rows_of
from tests.driving.test_stress import run_stress

FOLDER = os.environ.get("DRLSL_SHARED")
GAPS = [1 + round(54 * number / 14) for number in range(15)]
"""Frames of each gap: 15 of them, from 1 to 55."""

pytestmark = [pytest.mark.shared, pytest.mark.skipif(FOLDER is None, reason="needs DRLSL_SHARED")]


def holed(path: Path) -> Path:
    """A copy of a gapless table with 15 gaps, each in the track of another vehicle."""
    header, *lines = (Path(FOLDER or "") / "data" / "us101" / "us101_w2.csv").read_text().splitlines()
    rows = [line.split(",") for line in lines]
    frames = defaultdict(list)
    for row in rows:
        frames[row[0]].append(int(row[1]))
    rng = random.Random(1)
    lost = set()
    for vehicle, gap in zip(
        rng.sample([one for one in frames if len(frames[one]) >= 75], 15), GAPS, strict=True
    ):
        begin = rng.randint(min(frames[vehicle]) + 8, max(frames[vehicle]) - 8 - gap)
        lost |= {(vehicle, frame) for frame in range(begin, begin + gap)}
    kept = [",".join(row) for row in rows if (row[0], int(row[1])) not in lost]
    path.write_text("\n".join([header, *kept, ""]))
    return path


def test_filled_tracks_are_near_those_that_were_driven(tmp_path: Path) -> None:
    whole = load_recording(Path(FOLDER or "") / "data" / "us101" / "us101_w2.csv", cache=False)
    filled = fill_gaps(load_recording(holed(tmp_path / "holed.csv"), cache=False), 6.0)
    assert f"15 gaps of at most 6 s filled in tracks with {sum(GAPS)} rows" in filled.notes
    mine, true = rows_of(filled), rows_of(whole)
    assert mine.frame.tolist() == true.frame.tolist()
    assert np.abs(mine.x - true.x).max() < 5.0
    assert np.sqrt(np.mean((mine.x - true.x) ** 2)) < 0.5


@pytest.mark.slow
def test_filling_takes_away_what_comes_out_of_nowhere(tmp_path: Path) -> None:
    made = load_recording(holed(tmp_path / "holed.csv"), cache=False)

    def endings(recording: Recording) -> tuple[int, int]:
        total = run_stress(
            recording, Shield.default(tier="auto"), ["random", "always-change", "adversarial"], 300
        ).total
        return total.contacts["out_of_nowhere"], total.contacts_at_fault

    before, after = endings(made), endings(fill_gaps(made, 6.0))
    assert before[0] > 10
    assert after[0] <= 0.2 * before[0]
    assert before[1] == after[1] == 0
