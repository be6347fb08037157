"""The world: N egos, each in its own moment of a recording, one step at a time. All physics is here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from drlsl.driving.actions import Action
from drlsl.driving.batch import EGO_ID, Decisions, SceneBatch
from drlsl.driving.config import EnvConfig
from drlsl.driving.control import LaneController, SpeedController, move, move_forward
from drlsl.driving.entry import Entries, Entry
from drlsl.driving.fault import Track, Verdict, judge
from drlsl.driving.limits import CENTRE_TOLERANCE
from drlsl.driving.playback import Playback, Playbacks
from drlsl.driving.reward import reward_terms
from drlsl.driving.scene import Scene
from drlsl.driving.shield import Shield
from drlsl.errors import UserError

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
    """What one step brought, for N egos.

    Arrays are of shape (N,); `rewards` holds the weighted terms. `contacts`: by ego, the contact that ended
    its episode. `changed`: the step started a lane change; `entered`: the ego was placed anew on the
    stretch; `distance` [m] driven in the episode, `speed` [m/s].
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
    distance: Floats
    speed: Floats


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
    ended: Mask

    @classmethod
    def new(cls, count: int) -> _Egos:
        x, y, speed, vy, target_y, distance = (np.zeros(count) for _ in range(6))
        target_lane, playback, frame = (np.zeros(count, dtype=np.int64) for _ in range(3))
        ended = np.ones(count, dtype=np.bool_)
        return cls(x, y, speed, vy, target_lane, target_y, playback, frame, distance, ended)


@dataclass(slots=True)
class _Past:
    """The newest rows of every ego's track, x, y and speed, in a ring of shape (T, 3, N).

    All egos write in the same row. `kept` (N,): how many of an ego's rows are there.
    """

    rows: Floats
    kept: Integers
    now: int = 0

    @classmethod
    def new(cls, count: int, length: int) -> _Past:
        return cls(np.zeros((length, 3, count)), np.zeros(count, dtype=np.int64))

    def begin(self, ego: int, egos: _Egos) -> None:
        """Forget an ego's track, which begins with the present."""
        self.rows[self.now, :, ego] = egos.x[ego], egos.y[ego], egos.speed[ego]
        self.kept[ego] = 1

    def write(self, egos: _Egos) -> None:
        """Add the present to every track."""
        self.now = (self.now + 1) % len(self.rows)
        row = self.rows[self.now]
        row[0], row[1], row[2] = egos.x, egos.y, egos.speed
        self.kept += 1

    def track(self, index: int, sign: int, size: tuple[float, float]) -> Track:
        """One ego's track, oldest first."""
        kept = min(int(self.kept[index]), len(self.rows))
        x, y, speed = self.rows[(self.now + 1 - kept + np.arange(kept)) % len(self.rows), :, index].T
        return Track(sign * x, y, speed, *size)


@dataclass(frozen=True, slots=True, eq=False)
class _Surroundings:
    """The scenes around egos; of shape (N, S): who is `recorded`, and where seen from the ego, `dx`, `dy`."""

    scenes: SceneBatch
    recorded: Mask
    dx: Floats
    dy: Floats


class World:
    """N egos that drive in recordings.

    An ego's episode: enter in a safe gap, drive `track_length` metres, re-entering at the beginning of the
    stretch whenever it or the recording ends. One step is one recorded frame. The world offers actions, it
    does not enforce them: a lane change that is not offered is driven as told. While a lane change is under
    way, new lane changes are not taken up. What an ego does between the end of its episode and its reset
    means nothing.
    """

    def __init__(self, config: EnvConfig, playbacks: Sequence[Sequence[Playback]], shield: Shield) -> None:
        """Lay out the playbacks; for each ego those that it may drive in, one drawn for every episode.

        Of `config`, everything but the recording and the direction counts.
        """
        distinct = list(dict.fromkeys(one for choices in playbacks for one in choices))
        numbers = {one: number for number, one in enumerate(distinct)}
        self._choices = [[numbers[one] for one in choices] for choices in playbacks]
        self.config = config
        self.shield = shield
        self.playbacks = Playbacks(distinct)
        self.count = len(playbacks)
        self._size = (config.ego_length, config.ego_width)
        self._entries = [Entries(one, shield, self._size) for one in self.playbacks.all]
        self._widest = self.playbacks.film.numbers[4:, :, 1:].max(axis=(1, 2), initial=0.0)
        self._egos = _Egos.new(self.count)
        self._courses = self.playbacks.courses.take(self._egos.playback)
        self._past = _Past.new(self.count, round(MEMORY / float(self.playbacks.courses.dt.min())))
        self._speed_control = SpeedController.for_egos(self.count)
        self._lane_control = LaneController.for_egos(self.count)
        self.rngs = [np.random.default_rng() for _ in range(self.count)]
        """The generator of each ego's episode."""
        self._everyone = np.arange(self.count)
        self._scenes: SceneBatch | None = None
        self._decisions: Decisions | None = None

    @property
    def decisions(self) -> Decisions:
        """What the rules say about the scenes that the egos are in."""
        if self._decisions is None:
            raise RuntimeError("reset the world first: it has no scenes yet")
        return self._decisions

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
            raise RuntimeError("reset the world first: it has no scenes yet")
        return self._scenes.scene(ego)

    def playback_of(self, ego: int) -> Playback:
        """The playback that an ego drives in."""
        return self.playbacks.all[int(self._egos.playback[ego])]

    def frame_of(self, ego: int) -> int:
        """The recorded frame that an ego is in."""
        return int(self._egos.frame[ego])

    def reset(self, egos: Sequence[int], rngs: Sequence[np.random.Generator]) -> None:
        """Begin new episodes for `egos`, each a function of its generator alone; the others stay as they are.

        The first reset has to be of all egos, in order.

        Raises:
            UserError: the recording has no gap to enter.
        """
        for ego, rng in zip(egos, rngs, strict=True):
            self._begin(ego, rng)
        places = np.asarray(egos)
        scenes = self._look(places).scenes
        decisions = self.shield.decide_batch(scenes)
        if self._scenes is not None and self._decisions is not None:
            scenes = self._scenes.replaced(places, scenes)
            decisions = self._decisions.replaced(places, decisions)
        elif places.tolist() != self._everyone.tolist():
            raise RuntimeError("the first reset has to be of all egos, in order")
        self._scenes, self._decisions = scenes, decisions

    def step(
        self, actions: npt.NDArray[np.integer], restarts: Mapping[int, np.random.Generator] | None = None
    ) -> StepResult:
        """Drive one step with `actions` of shape (N,), each an `Action`.

        Egos whose episode has ended do not count: their rewards are 0 and nothing happens to them. Those in
        `restarts` begin a new episode instead, as in `reset`.

        Raises:
            UserError: an action is unknown.
        """
        if actions.min() < 0 or actions.max() >= len(Action):
            raise UserError(f"unknown action in {actions.tolist()}; known are 0 to {len(Action) - 1}")
        egos = self._egos
        playing = ~egos.ended
        changed = self._steer(actions, self.decisions, playing)
        self._drive(self.decisions)
        over = egos.frame >= self._courses.frames
        around = self._look()
        contacts = self._contacts(around, playing & ~over)
        touched = np.zeros(self.count, dtype=np.bool_)
        touched[list(contacts)] = True
        off_road = self._off_road() & playing
        terminated = touched | off_road
        truncated = (egos.distance >= self.config.track_length) & playing & ~terminated
        egos.ended |= terminated | truncated
        speed, distance = egos.speed.copy(), egos.distance.copy()
        rewards = reward_terms(
            self.config.reward,
            changed=changed,
            speed=speed * playing,
            contact=touched,
            off_road=off_road,
            progress=distance / self.config.track_length,
        )
        entered = self._reenter(over)
        decisions = self._decide(around.scenes, [*entered.nonzero()[0].tolist(), *self._restart(restarts)])
        return StepResult(
            scenes=around.scenes,
            decisions=decisions,
            reward=sum(rewards.values(), np.zeros(self.count)),
            rewards=rewards,
            terminated=terminated,
            truncated=truncated,
            changed=changed,
            off_road=off_road,
            contacts=contacts,
            entered=entered,
            distance=distance,
            speed=speed,
        )

    def get_state(self) -> dict[str, Any]:
        """Where every ego is and what its controllers and its generator remember: arrays and plain types."""
        if self._scenes is None:
            raise RuntimeError("reset the world first: it has no state yet")
        return {
            "egos": {field.name: getattr(self._egos, field.name).copy() for field in fields(self._egos)},
            "past": {"rows": self._past.rows.copy(), "kept": self._past.kept.copy(), "now": self._past.now},
            "integrals": (self._speed_control.integral.copy(), self._lane_control.integral.copy()),
            "rngs": [rng.bit_generator.state for rng in self.rngs],
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Take over what `get_state` gave in a world of the same making."""
        self._egos = _Egos(**{name: array.copy() for name, array in state["egos"].items()})
        self._past = _Past(state["past"]["rows"].copy(), state["past"]["kept"].copy(), state["past"]["now"])
        speed, lane = state["integrals"]
        self._speed_control, self._lane_control = SpeedController(speed.copy()), LaneController(lane.copy())
        self.rngs = [np.random.default_rng() for _ in range(self.count)]
        for rng, rng_state in zip(self.rngs, state["rngs"], strict=True):
            rng.bit_generator.state = rng_state
        self._courses = self.playbacks.courses.take(self._egos.playback)
        self._decide(self._look().scenes, [])

    def _begin(self, ego: int, rng: np.random.Generator) -> None:
        """Begin an episode of one ego."""
        self.rngs[ego] = rng
        choices = self._choices[ego]
        self._egos.playback[ego] = choices[rng.integers(len(choices))]
        self._egos.ended[ego], self._egos.distance[ego] = False, 0.0
        frame = int(rng.integers(self.playback_of(ego).frames))
        self._place(ego, self._entries[self._egos.playback[ego]].find(rng, frame=frame))
        self._courses = self.playbacks.courses.take(self._egos.playback)

    def _restart(self, restarts: Mapping[int, np.random.Generator] | None) -> list[int]:
        """Begin the episodes that are asked for; returns whose."""
        for ego, rng in (restarts or {}).items():
            self._begin(ego, rng)
        return list(restarts or {})

    def _place(self, ego: int, entry: Entry) -> None:
        """Put an ego at an entry, its controllers and its past forgotten."""
        egos = self._egos
        egos.frame[ego], egos.x[ego], egos.speed[ego] = entry.frame, entry.x, entry.speed
        egos.y[ego] = egos.target_y[ego] = entry.lane.centre
        egos.vy[ego], egos.target_lane[ego] = 0.0, entry.lane.id
        self._speed_control.reset(ego)
        self._lane_control.reset(ego)
        self._past.begin(ego, egos)

    def _steer(self, actions: npt.NDArray[np.integer], decisions: Decisions, playing: Mask) -> Mask:
        """Set the lanes to steer for; returns which egos start a lane change, shape (N,)."""
        egos = self._egos
        settled: Mask = np.abs(egos.target_y - egos.y) <= CENTRE_TOLERANCE
        changed: Mask = settled & (actions != Action.LANE_KEEPING) & playing
        for ego in changed.nonzero()[0].tolist():
            self._start_lane_change(ego, Action(int(actions[ego])))
        moved = (decisions.lane_to_keep != egos.target_lane) & ~changed & playing
        for ego in moved.nonzero()[0].tolist():
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
        egos, dt = self._egos, self._courses.dt
        ax = self._speed_control.acceleration(egos.speed, decisions.target_speed, dt)
        ay = self._lane_control.acceleration(egos.y, egos.vy, egos.target_y, dt)
        along, egos.speed = move_forward(egos.speed, ax, dt)
        egos.x = egos.x + self._courses.sign * along
        egos.y, egos.vy = move(egos.y, egos.vy, ay, dt)
        egos.frame = egos.frame + 1
        egos.distance += along
        self._past.write(egos)

    def _off_road(self) -> Mask:
        """Whether any part of an ego is beyond the lanes of its direction, shape (N,)."""
        half, courses = self._size[1] / 2, self._courses
        return np.asarray(
            (self._egos.y - half < courses.low) | (self._egos.y + half > courses.high), dtype=np.bool_
        )

    def _look(self, places: Integers | None = None) -> _Surroundings:
        """The scenes around the egos in `places`, or around all of them."""
        egos, courses = self._egos, self._courses

        def chosen(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
            return values if places is None else values.take(places, axis=0)

        film = self.playbacks.film
        rows = chosen(courses.begin + np.minimum(egos.frame, courses.frames - 1))
        numbers, vehicle = film.numbers.take(rows, axis=1), film.vehicle.take(rows, axis=0)
        lane, recorded = film.lane.take(rows, axis=0), film.valid.take(rows, axis=0)
        vehicle[:, 0] = EGO_ID
        x, y = chosen(egos.x), chosen(egos.y)
        nearest = np.abs(chosen(courses.centre) - y[:, None]).argmin(axis=1)
        lane[:, 0] = chosen(courses.lane_id)[self._everyone[: len(nearest)], nearest]
        own = (x, y, chosen(courses.sign) * chosen(egos.speed), chosen(egos.vy), *self._size)
        for column, value in zip(numbers, own, strict=True):
            column[:, 0] = value
        dx, dy = numbers[0] - x[:, None], numbers[1] - y[:, None]
        valid = dx * dx + dy * dy <= self.config.radar_range**2
        valid &= recorded
        valid[:, 0] = True
        scenes = SceneBatch.from_numbers(
            numbers,
            roads=self.playbacks.roads,
            road=chosen(courses.road),
            target_lane=chosen(egos.target_lane).copy(),
            id=vehicle,
            lane=lane,
            valid=valid,
        )
        return _Surroundings(scenes, recorded, dx, dy)

    def _decide(self, scenes: SceneBatch, placed: Sequence[int]) -> Decisions:
        """What the rules say about `scenes`, in which the `placed` egos are now somewhere else."""
        if placed:
            places = np.array(placed)
            scenes.put(places, self._look(places).scenes)
        self._scenes, self._decisions = scenes, self.shield.decide_batch(scenes)
        return self._decisions

    def _contacts(self, around: _Surroundings, playing: Mask) -> dict[int, Contact]:
        """The contacts of the egos that `playing` marks; of several of one ego, one at fault first."""
        (longest, widest), (length, width) = self._widest, self._size
        near = np.abs(around.dx) < (longest + length) / 2
        near &= np.abs(around.dy) < (widest + width) / 2
        near &= around.recorded
        scenes = around.scenes
        contacts: dict[int, Contact] = {}
        for place in np.flatnonzero(near).tolist():
            ego, slot = divmod(place, near.shape[1])
            touching = (
                playing[ego]
                and abs(around.dx[ego, slot]) < (scenes.length[ego, slot] + length) / 2
                and abs(around.dy[ego, slot]) < (scenes.width[ego, slot] + width) / 2
            )
            if touching and not (ego in contacts and contacts[ego].at_fault):
                contact = self._judge(ego, slot)
                if contact.at_fault or ego not in contacts:
                    contacts[ego] = contact
        return contacts

    def _judge(self, ego: int, slot: int) -> Contact:
        playback, frame = self.playback_of(ego), self.frame_of(ego)
        own = self._past.track(ego, playback.sign, self._size)
        placed_at = frame - int(self._past.kept[ego]) + 1
        other = playback.track(frame, slot, frame - len(own.s) + 1)
        verdict = judge(
            own,
            other,
            playback.lanes,
            playback.road.time_step,
            other_appeared=int(playback.film.first[frame, slot]) > placed_at,
        )
        return Contact(int(playback.film.vehicle[frame, slot]), verdict)

    def _reenter(self, over: Mask) -> Mask:
        """Place anew the egos that drive on but have reached the end of the stretch or of the recording."""
        egos, courses = self._egos, self._courses
        driven = courses.sign * (egos.x - courses.start) + self.config.ego_length / 2
        entered: Mask = (over | (driven >= courses.length)) & ~egos.ended
        for ego in entered.nonzero()[0].tolist():
            playback = self.playback_of(ego)
            lane = playback.road.lane(int(egos.target_lane[ego]))
            frame, rng = self.frame_of(ego) % playback.frames, self.rngs[ego]
            self._place(ego, self._entries[egos.playback[ego]].find(rng, frame=frame, lane=lane))
        return entered
