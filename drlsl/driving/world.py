"""The world: N egos, each in its own moment of a recording, one step at a time. All physics is here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from drlsl.driving.actions import Action
from drlsl.driving.batch import EGO_ID, Decisions, SceneBatch
from drlsl.driving.config import EnvConfig
from drlsl.driving.control import LaneController, SpeedController, move, move_forward
from drlsl.driving.entry import Entry, find_entry
from drlsl.driving.fault import Track, Verdict, judge
from drlsl.driving.limits import CENTRE_TOLERANCE
from drlsl.driving.playback import NUMBERS, Playback, Playbacks, Traffic, road_of
from drlsl.driving.reward import reward_terms
from drlsl.driving.scene import Scene
from drlsl.driving.shield import Shield
from drlsl.errors import UserError
from drlsl.traffic.recording import Recording

Floats: TypeAlias = npt.NDArray[np.float64]
Integers: TypeAlias = npt.NDArray[np.int64]
Mask: TypeAlias = npt.NDArray[np.bool_]

MEMORY: Final = 12.0
"""How far back the ego's own track is kept for judging contacts [s]."""


@dataclass(frozen=True, slots=True)
class Contact:
    """A contact of one ego: the vehicle's id and the verdict on it."""

    vehicle: int
    verdict: Verdict

    @property
    def at_fault(self) -> bool:
        """Whether the ego is to blame."""
        return self.verdict is Verdict.AT_FAULT


@dataclass(frozen=True, slots=True, eq=False)
class StepResult:
    """What one step brought, for N egos; after a reset only `scenes` and `decisions` tell something.

    Arrays are of shape (N,); `rewards` holds the weighted terms. `contacts`: by ego, the contact that ended
    its episode. `changed`: the step started a lane change; `entered`: the ego was placed anew on the
    stretch.
    """

    scenes: SceneBatch
    decisions: Decisions
    reward: Floats
    rewards: dict[str, Floats]
    terminated: Mask
    truncated: Mask
    changed: Mask
    off_road: Mask
    contacts: dict[int, Contact]
    entered: Mask


@dataclass(slots=True)
class _Egos:
    """The state of N egos: arrays of shape (N,) in road coordinates; `speed` is along the heading."""

    x: Floats
    y: Floats
    speed: Floats
    vy: Floats
    target_lane: Integers
    target_y: Floats
    playback: Integers
    frame: Integers
    distance: Floats

    @classmethod
    def new(cls, count: int) -> _Egos:
        x, y, speed, vy, target_y, distance = (np.zeros(count) for _ in range(6))
        target_lane, playback, frame = (np.zeros(count, dtype=np.int64) for _ in range(3))
        return cls(x, y, speed, vy, target_lane, target_y, playback, frame, distance)


@dataclass(slots=True)
class _Past:
    """The newest rows of every ego's track, x, y and speed: a ring (3, N, T), and how many were written."""

    rows: Floats
    written: Integers

    @classmethod
    def new(cls, count: int, length: int) -> _Past:
        return cls(np.zeros((3, count, length)), np.zeros(count, dtype=np.int64))

    def begin(self, ego: int, egos: _Egos) -> None:
        """Forget an ego's track, which begins with the present."""
        self.rows[:, ego, 0] = egos.x[ego], egos.y[ego], egos.speed[ego]
        self.written[ego] = 1

    def write(self, egos: _Egos) -> None:
        """Add the present to every track."""
        everyone = np.arange(len(self.written))
        self.rows[:, everyone, self.written % self.rows.shape[2]] = (egos.x, egos.y, egos.speed)
        self.written += 1

    def track(self, index: int, sign: int, size: tuple[float, float]) -> Track:
        """One ego's track, oldest first."""
        length = self.rows.shape[2]
        kept = min(int(self.written[index]), length)
        order = (np.arange(kept) + int(self.written[index]) - kept) % length
        x, y, speed = self.rows[:, index, order]
        return Track(sign * x, y, speed, *size)


class World:
    """N egos that drive in recordings.

    An ego's episode: enter in a safe gap, drive `track_length` metres, re-entering at the beginning of the
    stretch whenever it or the recording ends. One step is one recorded frame. The world offers actions, it
    does not enforce them: a lane change that is not offered is driven as told. While a lane change is under
    way, new lane changes are not taken up. What an
    ego does between the end of its episode and its reset means nothing.
    """

    def __init__(
        self, config: EnvConfig, recordings: Sequence[Recording], shield: Shield, count: int
    ) -> None:
        """Lay out `recordings` for `count` egos.

        Raises:
            UserError: no recording has a lane of the direction that `config` asks for.
        """
        self.config = config
        self.shield = shield
        playbacks = [
            Playback.of(recording, direction, road)
            for recording in recordings
            for road in [road_of(recording, config.radar_range)]
            for direction in recording.directions
            if config.direction in ("both", direction.value)
        ]
        if not playbacks:
            names = ", ".join(recording.name for recording in recordings)
            raise UserError(f"no lane runs {config.direction} in {names}; choose the other direction or both")
        self.playbacks = Playbacks(playbacks)
        self.count = count
        self._size = (config.ego_length, config.ego_width)
        self._egos = _Egos.new(count)
        self._past = _Past.new(count, round(MEMORY / float(self.playbacks.dt.min())))
        self._speed_control = SpeedController.for_egos(count)
        self._lane_control = LaneController.for_egos(count)
        self._rngs = [np.random.default_rng() for _ in range(count)]
        self._ended = np.ones(count, dtype=np.bool_)
        self._scenes: SceneBatch | None = None
        self._decisions: Decisions | None = None

    @property
    def distance(self) -> Floats:
        """Metres driven in the episode, shape (N,)."""
        return self._egos.distance

    @property
    def speed(self) -> Floats:
        """Speed of the egos [m/s], shape (N,)."""
        return self._egos.speed

    def scene(self, ego: int) -> Scene:
        """The scene of one ego that the rules were last asked about."""
        if self._scenes is None:
            raise RuntimeError("reset the world before asking for a scene")
        return self._scenes.scene(ego)

    def playback_of(self, ego: int) -> Playback:
        """The playback that an ego drives in."""
        return self.playbacks.all[int(self._egos.playback[ego])]

    def frame_of(self, ego: int) -> int:
        """The recorded frame that an ego is in."""
        return int(self._egos.frame[ego])

    def reset(self, egos: Sequence[int], rngs: Sequence[np.random.Generator]) -> tuple[SceneBatch, Decisions]:
        """Begin new episodes for `egos`, each a function of its generator alone; the others stay as they are.

        Raises:
            UserError: the recording has no gap to enter.
        """
        for ego, rng in zip(egos, rngs, strict=True):
            self._rngs[ego] = rng
            self._ended[ego] = False
            self._egos.playback[ego] = rng.integers(len(self.playbacks.all))
            playback = self.playback_of(ego)
            self._egos.distance[ego] = 0.0
            frame = int(rng.integers(playback.frames))
            self._place(ego, find_entry(playback, self.shield, rng, frame=frame, size=self._size))
        return self._look(self._traffic())

    def step(self, actions: npt.NDArray[np.integer]) -> StepResult:
        """Drive one step with `actions` of shape (N,), each an `Action`.

        Raises:
            UserError: an action is unknown.
        """
        if self._decisions is None:
            raise RuntimeError("reset the world before the first step")
        if ((actions < 0) | (actions >= len(Action))).any():
            raise UserError(f"unknown action in {actions.tolist()}; known are 0 to {len(Action) - 1}")
        changed = self._steer(actions, self._decisions)
        before = self._egos.x.copy()
        self._drive(self._decisions)
        self._egos.distance += np.abs(self._egos.x - before)
        self._past.write(self._egos)
        over = self._egos.frame >= self.playbacks.frames[self._egos.playback]
        traffic = self._traffic()
        contacts = self._contacts(traffic, ~over & ~self._ended)
        off_road = self.playbacks.off_road(self._egos.playback, self._egos.y, self._size[1])
        touched = np.zeros(self.count, dtype=np.bool_)
        touched[list(contacts)] = True
        terminated = touched | off_road
        truncated = ~terminated & (self._egos.distance >= self.config.track_length)
        self._ended |= terminated | truncated
        entered = self._reenter(over)
        rewards = reward_terms(
            self.config.reward,
            changed=changed,
            speed=self._egos.speed,
            contact=touched,
            off_road=off_road,
            progress=self._egos.distance / self.config.track_length,
        )
        scenes, decisions = self._look(self._traffic() if entered.any() else traffic)
        return StepResult(
            scenes=scenes,
            decisions=decisions,
            reward=np.sum(list(rewards.values()), axis=0),
            rewards=rewards,
            terminated=terminated,
            truncated=truncated,
            changed=changed,
            off_road=off_road,
            contacts=contacts,
            entered=entered,
        )

    def _place(self, ego: int, entry: Entry) -> None:
        """Put an ego at an entry, its controllers and its past forgotten."""
        egos = self._egos
        egos.frame[ego], egos.x[ego], egos.speed[ego] = entry.frame, entry.x, entry.speed
        egos.y[ego] = egos.target_y[ego] = entry.lane.centre
        egos.vy[ego], egos.target_lane[ego] = 0.0, entry.lane.id
        chosen = np.zeros(self.count, dtype=np.bool_)
        chosen[ego] = True
        self._speed_control.reset(chosen)
        self._lane_control.reset(chosen)
        self._past.begin(ego, egos)

    def _steer(self, actions: npt.NDArray[np.integer], decisions: Decisions) -> Mask:
        """Set the lanes to steer for; returns which egos start a lane change, shape (N,)."""
        egos = self._egos
        settled: Mask = np.abs(egos.target_y - egos.y) <= CENTRE_TOLERANCE
        changed: Mask = settled & (actions != Action.LANE_KEEPING)
        for ego in np.flatnonzero(changed).tolist():
            self._start_lane_change(ego, Action(int(actions[ego])))
        for ego in np.flatnonzero(~changed & (decisions.lane_to_keep != egos.target_lane)).tolist():
            self._steer_for(ego, int(decisions.lane_to_keep[ego]))
        return changed

    def _start_lane_change(self, ego: int, action: Action) -> None:
        """Steer for the next lane to a side; where there is none, for where it would be, off the road."""
        playback, egos = self.playback_of(ego), self._egos
        leftward = 1 if action is Action.LEFT_LANE_CHANGE else -1
        turn = -leftward * playback.sign
        order = [lane.id for lane in playback.lanes]
        here = order.index(int(egos.target_lane[ego]))
        there = here + turn
        if 0 <= there < len(order):
            self._steer_for(ego, order[there])
        else:
            egos.target_y[ego] = playback.lanes[here].centre + turn * playback.lanes[here].width

    def _steer_for(self, ego: int, lane_id: int) -> None:
        lane = self.playback_of(ego).road.lane(lane_id)
        if lane is None:
            raise UserError(f"lane_to_keep/1 names lane {lane_id}, which the road does not have")
        self._egos.target_lane[ego], self._egos.target_y[ego] = lane.id, lane.centre

    def _drive(self, decisions: Decisions) -> None:
        """Run the controllers and move the egos and the recording on by one frame."""
        egos = self._egos
        dt = self.playbacks.dt[egos.playback]
        ax = self._speed_control.acceleration(egos.speed, decisions.target_speed, dt)
        ay = self._lane_control.acceleration(egos.y, egos.vy, egos.target_y, dt)
        along, egos.speed = move_forward(np.zeros(self.count), egos.speed, ax, dt)
        egos.x = egos.x + self.playbacks.sign[egos.playback] * along
        egos.y, egos.vy = move(egos.y, egos.vy, ay, dt)
        egos.frame = egos.frame + 1

    def _traffic(self) -> Traffic:
        return self.playbacks.traffic(self._egos.playback, self._egos.frame)

    def _contacts(self, traffic: Traffic, playing: Mask) -> dict[int, Contact]:
        """The contacts of the egos that `playing` marks; of several of one ego, one at fault first."""
        x, y, _, _, length, width = traffic.numbers
        egos = self._egos
        near = (np.abs(x - egos.x[:, None]) < (length + self._size[0]) / 2) & traffic.valid & playing[:, None]
        touching = near & (np.abs(y - egos.y[:, None]) < (width + self._size[1]) / 2)
        contacts: dict[int, Contact] = {}
        for ego in np.flatnonzero(touching.any(axis=1)).tolist():
            found = [self._judge(ego, slot) for slot in np.flatnonzero(touching[ego]).tolist()]
            contacts[ego] = next((contact for contact in found if contact.at_fault), found[0])
        return contacts

    def _judge(self, ego: int, slot: int) -> Contact:
        playback, frame = self.playback_of(ego), self.frame_of(ego)
        own = self._past.track(ego, playback.sign, self._size)
        placed_at = frame - int(self._past.written[ego]) + 1
        other = playback.track(frame, slot, frame - len(own.s) + 1)
        verdict = judge(
            own,
            other,
            playback.lanes,
            playback.road.time_step,
            other_appeared=int(playback.first[frame, slot]) > placed_at,
        )
        return Contact(int(playback.vehicle[frame, slot]), verdict)

    def _reenter(self, over: Mask) -> Mask:
        """Place anew the egos that drive on but have reached the end of the stretch or of the recording."""
        entered = np.zeros(self.count, dtype=np.bool_)
        egos = self._egos
        driven = self.playbacks.along(egos.playback, egos.x) + self.config.ego_length / 2
        gone = over | (driven >= self.playbacks.length[egos.playback])
        for ego in np.flatnonzero(gone & ~self._ended).tolist():
            playback = self.playback_of(ego)
            lane = playback.road.lane(int(self._egos.target_lane[ego]))
            frame = self.frame_of(ego) % playback.frames
            entry = find_entry(
                playback, self.shield, self._rngs[ego], frame=frame, size=self._size, lane=lane
            )
            self._place(ego, entry)
            entered[ego] = True
        return entered

    def _look(self, traffic: Traffic) -> tuple[SceneBatch, Decisions]:
        """The scenes around the egos and what the rules say about them."""
        egos = self._egos
        numbers = np.empty((len(NUMBERS), self.count, traffic.valid.shape[1] + 1))
        numbers[:, :, 1:] = traffic.numbers
        own = (egos.x, egos.y, self.playbacks.sign[egos.playback] * egos.speed, egos.vy, *self._size)
        for column, value in zip(numbers, own, strict=True):
            column[:, 0] = value
        x, y = numbers[:2]
        reach = np.hypot(x - x[:, :1], y - y[:, :1]) <= self.config.radar_range
        reach[:, 1:] &= traffic.valid
        own_lane = self.playbacks.lane_at(egos.playback, egos.y)
        scenes = SceneBatch.from_numbers(
            numbers,
            roads=self.playbacks.roads,
            road=self.playbacks.road[egos.playback],
            target_lane=egos.target_lane.copy(),
            id=np.concatenate((np.full((self.count, 1), EGO_ID), traffic.vehicle), axis=1),
            lane=np.concatenate((own_lane[:, None], traffic.lane), axis=1),
            valid=reach,
        )
        decisions = self.shield.decide_batch(scenes)
        self._scenes, self._decisions = scenes, decisions
        return scenes, decisions
