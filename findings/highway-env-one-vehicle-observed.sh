#!/usr/bin/env bash
# highway-env's Kinematics observation of one vehicle, the ego, holds all vehicles around it as well.
#
# One would guess: `vehicles_count` is the number of rows of the observation, the ego's and those of the nearest others, so that with
# 1 an agent sees itself alone.
#
# What happens: the space has one row, as was asked for. The observation has a row for the ego and for every vehicle in range, nearest
# first, so that their number changes from step to step: the road is asked for the 0 nearest others, and takes 0 to mean all. With 2
# or more both agree.
#
# Seen with highway-env 1.12.1 and gymnasium 1.4.0 from PyPI, Python 3.11, Linux x86_64, highway-fast-v0, ten steps of seed 0:
#     vehicles_count 1: space (1, 5), rows observed [9, 10]
#     vehicles_count 2: space (2, 5), rows observed [2]
#
# Why it matters: "ego only" is what one compares with to learn what the others' rows are worth. A loop that flattens the observation
# or takes its mean gets numbers of the very vehicles that were to be hidden; one that takes its shape from the space ends with an
# error somewhere else.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check highway-env==1.12.1 gymnasium==1.4.0 numpy==2.3.4
SDL_VIDEODRIVER=dummy PYGAME_HIDE_SUPPORT_PROMPT=1 "$work/venv/bin/python" -W ignore - <<'PY'
import gymnasium
import highway_env  # noqa: F401

found = {}
for count in (1, 2):
    env = gymnasium.make(
        "highway_env:highway-fast-v0",
        config={"observation": {"type": "Kinematics", "vehicles_count": count}},
        disable_env_checker=True,
    )
    observation, _ = env.reset(seed=0)
    rows = [len(observation)]
    for _ in range(10):
        observation, *_, over, _, _ = env.step(1)
        rows.append(len(observation))
        if over:
            break
    found[count] = env.observation_space.shape, sorted(set(rows))
    print(f"vehicles_count {count}: space {found[count][0]}, rows observed {found[count][1]}")

assert found[1][0] == (1, 5) and min(found[1][1]) > 1, "the behaviour has changed"
assert found[2] == ((2, 5), [2]), "the behaviour has changed"
PY
