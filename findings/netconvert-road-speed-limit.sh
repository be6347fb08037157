#!/usr/bin/env bash
# SUMO's netconvert reads the speed limits of OpenDRIVE's lanes, not those of its roads, and does not say so.
#
# One would guess: OpenDRIVE states a limit where the type of a road is given, `<type s="0" type="motorway"><speed .../></type>`, and
# a lane may have a limit of its own that takes its place. Whoever reads the one reads the other, or warns.
#
# What happens: the limit of the road is dropped without a word, whatever its unit. All of its lanes get 13.89 m/s, which is the
# limit of a town, motorway or not. A lane's own limit is read, unit and all; beside it a lane without one still has 13.89 m/s.
#
# Seen with eclipse-sumo 1.28.0 from PyPI, Linux x86_64, SUMO_HOME set, nothing on stderr:
#     road says 120 km/h               13.89 13.89 13.89
#     road and right lane say 120 km/h 33.33 13.89 13.89
#
# Why it matters: what follows the limits of such a network crawls along a motorway at 50 km/h, or, with one lane that speaks for
# itself, is faster on the right than on the left. Compare the limits with the source after every conversion.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check eclipse-sumo==1.28.0
cd "$work"
"$work/venv/bin/python" - <<'PY'
import os
import subprocess
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import sumo

LIMIT = '<speed {} max="120" unit="km/h"/>'
AT_THE_START = 'sOffset="0"'
LANES = (-1, -2, -3)


def speeds(lanes_that_say):
    """Convert a straight motorway of three lanes; return their limits, the right lane first."""
    lanes = "".join(
        f'<lane id="{lane}" type="driving" level="false"><link/>'
        '<width sOffset="0" a="3.75" b="0" c="0" d="0"/>'
        f"{LIMIT.format(AT_THE_START) if lane in lanes_that_say else ''}</lane>"
        for lane in LANES
    )
    Path("road.xodr").write_text(
        '<?xml version="1.0"?><OpenDRIVE><header revMajor="1" revMinor="6" north="0" south="0" east="0" west="0"/>'
        '<road name="motorway" length="500" id="1" junction="-1"><link/>'
        f'<type s="0" type="motorway">{LIMIT.format("")}</type>'
        '<planView><geometry s="0" x="0" y="0" hdg="0" length="500"><line/></geometry></planView>'
        '<lanes><laneSection s="0"><center><lane id="0" type="none" level="false"/></center>'
        f"<right>{lanes}</right></laneSection></lanes></road></OpenDRIVE>"
    )
    home = Path(sumo.SUMO_HOME)
    done = subprocess.run(
        [home / "bin" / "netconvert", "--opendrive-files", "road.xodr", "-o", "road.net.xml"],
        env={**os.environ, "SUMO_HOME": str(home)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert not done.stderr.strip(), f"netconvert says something now: {done.stderr}"
    lanes = ElementTree.parse("road.net.xml").iterfind("edge[@id='-1']/lane")
    return [float(lane.get("speed")) for lane in sorted(lanes, key=lambda lane: int(lane.get("index")))]


road = speeds(())
both = speeds((LANES[-1],))
print("road says 120 km/h              ", *(f"{speed:.2f}" for speed in road))
print("road and right lane say 120 km/h", *(f"{speed:.2f}" for speed in both))
assert road == [13.89] * 3, "the limit of the road is read now"
assert both == [33.33, 13.89, 13.89], "limits of lanes are read another way now"
PY
