"""The measures of an episode are what a plain loop over its frames finds."""

from __future__ import annotations

import numpy as np
import pytest

from drlsl.driving import EnvConfig
from drlsl.driving.envs import HighwayVectorEnv
from drlsl.driving.shield import Shield
from drlsl.driving.simulation import headway_quantile, measures_of
from drlsl.driving.simulation.measures import HEADWAY_CLASSES, HEADWAY_STEP


class Counted:
    """The measures of one episode, frame by frame, from the environment's own words."""

    def __init__(self, dt: float) -> None:
        self.dt = dt
        self.speeds: list[float] = []
        self.jerk_square = self.hard = self.short = self.imposed_hard = self.imposed = 0.0
        self.windows = 0
        self.offered = False
        self.headways = np.zeros(HEADWAY_CLASSES)
        self.follower: tuple[str, float] | None = None

    def add(self, env: HighwayVectorEnv, index: int, entered: bool, offered: bool, speed: float) -> None:
        self.windows += offered and not self.offered
        self.offered = offered
        self.speeds.append(speed)
        change = np.diff(self.speeds) / self.dt
        if len(change) >= 1:
            self.hard += self.dt * (change[-1] < -3.0)
        if len(change) >= 2:
            self.jerk_square += self.dt * ((change[-1] - change[-2]) / self.dt) ** 2
        if entered:
            # Where the ego was before it was placed anew is no longer to be seen: leave these episodes out.
            raise LookupError
        scene = env.world.scene(index)
        sign = env.world.playback_of(index).sign
        others = [one for one in scene.vehicles if one.lane == scene.ego.lane]
        ahead = [(sign * (one.x - scene.ego.x), one) for one in others if sign * (one.x - scene.ego.x) >= 0]
        behind = [(sign * (scene.ego.x - one.x), one) for one in others if sign * (one.x - scene.ego.x) < 0]
        if ahead:
            distance, leader = min(ahead, key=lambda pair: pair[0])
            gap = distance - (leader.length + scene.ego.length) / 2
            self.short += self.dt * (gap < 4.0 * (speed - sign * leader.vx))
            if speed >= 1.0:
                self.headways[min(int(max(gap, 0.0) / speed / HEADWAY_STEP), HEADWAY_CLASSES - 1)] += self.dt
        follower = min(behind, key=lambda pair: pair[0])[1] if behind else None
        if follower and self.follower and self.follower[0] == follower.id:
            braking = (self.follower[1] - sign * follower.vx) / self.dt
            self.imposed = max(self.imposed, braking)
            self.imposed_hard += self.dt * (braking > 3.0)
        self.follower = (follower.id, sign * follower.vx) if follower else None


@pytest.mark.parametrize("traffic", ["recorded", "reactive"])
def test_they_are_those_of_a_plain_loop(traffic: str) -> None:
    settings = {"recording": "highway-test", "track_length": 150.0, "traffic": traffic}
    env = HighwayVectorEnv(
        EnvConfig.model_validate(settings), num_envs=8, shield=Shield.default(tier="auto"), measured=True
    )
    env.reset(seed=5)
    counted = [Counted(0.04) for _ in range(8)]
    for index, one in enumerate(counted):
        one.speeds.append(float(env.world.speed[index]))
    going = set(range(8))
    rng = np.random.default_rng(0)
    compared = 0
    while going:
        mask = env.action_masks().copy()
        _, _, terminated, truncated, info = env.step((mask * rng.random((8, 3))).argmax(axis=1))
        for index in sorted(going):
            try:
                counted[index].add(
                    env,
                    index,
                    bool(info["entered"][index]),
                    bool(mask[index, 1:].any()),
                    float(info["speed"][index]),
                )
            except LookupError:
                going.discard(index)
                continue
            if terminated[index] or truncated[index]:
                going.discard(index)
                compared += 1
                found, mine = measures_of(info["measures"], index), counted[index]
                assert found.time == pytest.approx(0.04 * (len(mine.speeds) - 1))
                assert found.jerk_square == pytest.approx(mine.jerk_square)
                assert found.hard_braking == pytest.approx(mine.hard)
                assert found.short_ttc == pytest.approx(mine.short)
                assert found.windows == mine.windows
                assert found.imposed == pytest.approx(mine.imposed)
                assert found.imposed_hard == pytest.approx(mine.imposed_hard)
                assert found.headways == pytest.approx(mine.headways.tolist())
    assert compared >= 5


def test_a_new_episode_begins_at_nothing() -> None:
    config = EnvConfig(recording="highway-test", track_length=30.0)
    env = HighwayVectorEnv(
        config, num_envs=2, autoreset_mode="SameStep", shield=Shield.default(tier="auto"), measured=True
    )
    env.reset(seed=1)
    for _ in range(200):
        _, _, terminated, truncated, info = env.step([0, 0])
        over = np.flatnonzero(terminated | truncated)
        if over.size:
            assert (info["measures"]["time"][over] == 0.0).all()
            assert (info["final_info"]["measures"]["time"][over] > 0.5).all()
            return
    pytest.fail("no episode ended")


def test_the_quantile_of_headways() -> None:
    headways = np.zeros(HEADWAY_CLASSES)
    assert headway_quantile(headways, 0.5) is None
    headways[20] = 3.0
    headways[40] = 97.0
    assert headway_quantile(headways, 0.02) == pytest.approx(21 * HEADWAY_STEP)
    assert headway_quantile(headways, 0.5) == pytest.approx(41 * HEADWAY_STEP)
