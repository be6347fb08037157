#!/usr/bin/env bash
# lxd-io leaves out every recording of a levelX data set whose picture of the road is missing.
#
# One would guess: a recording is its three tables (tracks, tracksMeta, recordingMeta). The picture from above, of several megabytes
# each, serves plots alone, so a copy of the data without pictures, as one makes it for a cluster, holds the same recordings.
#
# What happens: Dataset lists the recordings that have all three tables and a picture. One without a picture is not in recording_ids,
# and nothing is raised: there is a line of log, "Incomplete data for recording 2", the same as when a table is missing. A copy
# without any picture is a data set of 0 recordings.
#
# Seen with lxd-io 0.4.10 from PyPI, polars 1.35.2, Python 3.11, Linux x86_64, on two recordings with all their tables:
#     a picture for both: [1, 2]
#     a picture for one:  [1]
#     no picture:         []
#
# Why it matters: counts and means over "the data set" are then over a part of it, or a loop runs over nothing and ends well. Where
# tables are written by another program, as converters and simulators do, a picture of one pixel has to be written beside them.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check lxd-io==0.4.10 polars==1.35.2 matplotlib==3.10.7
"$work/venv/bin/python" - "$work" <<'PY'
import sys
from pathlib import Path

import matplotlib.image
import numpy as np
from loguru import logger
from lxd_io import Dataset

logger.remove()
said = []
logger.add(lambda line: said.append(str(line)), level="WARNING", format="{message}")

data = Path(sys.argv[1]) / "highd-dataset-v1.0" / "data"
data.mkdir(parents=True)
for number in (1, 2):
    (data / f"{number:02}_recordingMeta.csv").write_text("id,frameRate,locationId,speedLimit\n%d,25,1,33.3\n" % number)
    (data / f"{number:02}_tracksMeta.csv").write_text("id,width,height,initialFrame,finalFrame,numFrames,class,drivingDirection\n1,4.5,1.8,1,1,1,Car,2\n")
    (data / f"{number:02}_tracks.csv").write_text("frame,id,x,y,width,height,xVelocity,yVelocity,xAcceleration,yAcceleration,laneId\n1,1,10.0,20.0,4.5,1.8,30.0,0.0,0.0,0.0,5\n")
    matplotlib.image.imsave(data / f"{number:02}_highway.png", np.zeros((1, 1, 3)))

found = {"a picture for both": Dataset(data.parent).recording_ids}
(data / "02_highway.png").unlink()
found["a picture for one"] = Dataset(data.parent).recording_ids
(data / "01_highway.png").unlink()
found["no picture"] = Dataset(data.parent).recording_ids
for name, numbers in found.items():
    print(f"{name + ':':<19} {numbers}")
assert list(found.values()) == [[1, 2], [1], []], "the behaviour has changed"
assert any("Incomplete data for recording 2" in line for line in said), "the behaviour has changed"
PY
