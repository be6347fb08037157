#!/usr/bin/env bash
# Gymnasium's vector RecordEpisodeStatistics leaves a step out of every episode but the first, in one of two autoreset modes.
#
# One would guess: the length and the return of an episode that the wrapper tells do not depend on whether a vector environment
# starts the next episode in the step that ended the last one (SAME_STEP) or in the step after (NEXT_STEP).
#
# What happens: with NEXT_STEP all is told rightly. With SAME_STEP the first episode is, and every later one lacks a step and the
# reward of it: the counts are cleared in the step after the end, which there is already a step of the new episode.
#
# Seen with gymnasium 1.2.2 from PyPI, Python 3.11, Linux x86_64, on episodes of five steps, each worth 1:
#     NEXT_STEP  lengths and returns: [(5, 5.0), (5, 5.0), (5, 5.0)]
#     SAME_STEP  lengths and returns: [(5, 5.0), (4, 4.0), (4, 4.0), (4, 4.0)]
# With 1.4.0 both are right.
#
# Why it matters: 1.2.2 is what RLlib 2.60 pins. Returns from there are lower than those of the same policy elsewhere, by a step's
# reward an episode, which nobody sees in a curve; where the first step is rewarded or punished most, by more.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check gymnasium==1.2.2 numpy==2.3.4
"$work/venv/bin/python" - <<'PY'
import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers.vector import RecordEpisodeStatistics


class FiveSteps(gymnasium.Env):
    """Every episode has five steps, each of which is worth 1."""

    observation_space = gymnasium.spaces.Box(0.0, 5.0, (1,))
    action_space = gymnasium.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.steps = 0
        return np.zeros(1, np.float32), {}

    def step(self, action):
        self.steps += 1
        return np.full(1, self.steps, np.float32), 1.0, self.steps == 5, False, {}


found = {}
for mode in (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP):
    envs = RecordEpisodeStatistics(SyncVectorEnv([FiveSteps] * 2, autoreset_mode=mode))
    envs.reset(seed=0)
    found[mode.name] = []
    for _ in range(20):
        *_, info = envs.step(envs.action_space.sample())
        told = info if "episode" in info else info.get("final_info", {})
        if "episode" in told:
            found[mode.name].append((int(told["episode"]["l"][0]), float(told["episode"]["r"][0])))
    print(f"{mode.name:9}  lengths and returns: {found[mode.name]}")

assert found["NEXT_STEP"] == [(5, 5.0)] * 3, "the behaviour has changed"
assert found["SAME_STEP"] == [(5, 5.0)] + [(4, 4.0)] * 3, "the behaviour has changed"
PY
