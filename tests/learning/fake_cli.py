"""The command line with the fake environment, slowed down, as a process of its own that can be stopped."""

import sys
import time

from drlsl import driving
from drlsl.cli import run

from .fake import FakeHighway, FakeVector

STEP_S = 0.004


class SlowHighway(FakeHighway):
    def step(self, action):  # type: ignore[no-untyped-def]
        time.sleep(STEP_S)
        return super().step(action)


if __name__ == "__main__":
    vars(driving)["make_vec"] = lambda config, num_envs, mode, **_: FakeVector(
        SlowHighway(config.track_length), *(FakeHighway(config.track_length) for _ in range(num_envs - 1))
    )
    sys.exit(run(sys.argv[1:]))
