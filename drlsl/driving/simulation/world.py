"""The world: N egos, each in its own moment of a recording, one step at a time. All physics is here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy, deepcopy
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from drlsl.driving.config import EnvConfig
from drlsl.driving.scene import Action, Scene, SceneBatch, several_actions, taken_rows
from drlsl.driving.shield import Decisions, Shield
from drlsl.driving.simulation.contacts import Contact, Surroundings, worst_contacts
from drlsl.driving.simulation.ego_loops import (
    ACCELERATION,
    CONTACT,
    DISTANCE,
    ENTERS,
    FIRST_TERM,
    JERK,
    OFF_ROAD,
    PLAYING,
    REWARD,
    SPEED,
    TERMINATED,
    TRUNCATED,
    finish,
    look,
)
from drlsl.driving.simulation.egos import Egos
from drlsl.driving.simulation.entry import KEPT, Entries, Entry, beginnings, track_length
from drlsl.driving.simulation.fault import judge
from drlsl.driving.simulation.measures import Measures, Meter
from drlsl.driving.simulation.playback import Playback, Playbacks
from drlsl.driving.simulation.prediction import NOTHING_OFFERED, lane_goes_on, predicted_actions
from drlsl.driving.simulation.reactive import ReactiveTraffic
from drlsl.driving.simulation.reward import chosen_terms, reward_weights
from drlsl.driving.simulation.sensing import Sensing
from drlsl.lowering.backends import machine_code
from drlsl.traffic import NUMBERS, Floats, Integers, Mask, Traffic

MEMORY: Final = 12.0
"""Length of the tracks that are kept for judging contacts [s]."""

_NO_LAGS: Final = (np.empty((0, 0)), np.empty((0, 0)))

NOT_RESET: Final = "reset the environment first: it has no scenes yet"


@dataclass(frozen=True, slots=True, eq=False)
class StepResult:
    """The results of one step, for N egos; `scenes` are the true ones, whatever the rules see of them.

    Arrays are of shape (N,); `rewards` holds the weighted terms. `contacts`: by ego, the contact that ended
    its episode. `changed`: the step started a lane change; `entered`: the ego was placed anew on the
    stretch; `distance` [m] driven in the episode, `speed` [m/s]. `failures`: by ego, why the rules failed.
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
    failures: dict[int, str]


class World:
    """N egos that drive in recordings.

    An ego's episode: enter in a safe gap, drive the length of the track, re-entering at the beginning of the
    stretch, or of its merging lane, whenever it or the recording ends. One step is one recorded frame. The
    world offers actions, but does not enforce them: it also drives a lane change that is not offered. During
    a lane change, new lane changes are ignored. Between the end of its episode and its reset, an ego's state
    is undefined.
    """

    def __init__(
        self,
        config: EnvConfig,
        playbacks: Sequence[Sequence[Playback]],
        shield: Shield,
        *,
        measured: bool = False,
    ) -> None:
        """Lay out the playbacks: for each ego those that it may drive in, one drawn for every episode.

        The recording and the direction of `config` are ignored. `measured`: take the `Measures` of episodes.

        Raises:
            UserError: the tier cannot run the rules, or they do not observe what they declare.
        """
        shield.prepare()
        distinct = list(dict.fromkeys(one for choices in playbacks for one in choices))
        numbers = {one: number for number, one in enumerate(distinct)}
        self._choices = [[numbers[one] for one in choices] for choices in playbacks]
        self.config = config
        self.shield = shield
        self.playbacks = Playbacks(distinct)
        self.count = len(playbacks)
        films, dt = self.playbacks.films, float(self.playbacks.courses.dt.min())
        size, memory = (config.ego_length, config.ego_width), max(round(MEMORY / dt), 1)
        kept = KEPT // len(distinct)
        self._entries = [Entries(one, shield, size, kept) for one in self.playbacks.all]
        self._egos = Egos(self.count, size, memory)
        self._courses = self.playbacks.courses.take(self._egos.at.playback)
        self._tracks = np.array([track_length(one, config) for one in self.playbacks.all])
        self._beginnings: dict[int, int] = {}
        self._reacts = np.array(
            [Traffic.REACTIVE is _traffic(one, config) for one in self.playbacks.all], dtype=np.bool_
        )
        self._reactive = ReactiveTraffic(films, self.count, memory) if self._reacts.any() else None
        self._sensing = (
            Sensing(config.sensing, self.playbacks, config.radar_range, self.count)
            if config.sensing.faulty
            else None
        )
        self._meter = Meter(self.count) if measured else None
        self._terms = config.reward.single_terms
        self._weights, self._chosen_terms = reward_weights(config.reward), chosen_terms(config.reward)
        self.rngs = [np.random.default_rng() for _ in range(self.count)]
        """The generator of each ego's episode."""
        self._everyone = np.arange(self.count)
        self._scenes: SceneBatch | None = None
        self._seen: SceneBatch | None = None
        self._decisions: Decisions | None = None

    @property
    def decisions(self) -> Decisions:
        """The decisions about the egos' present scenes."""
        if self._decisions is None:
            raise RuntimeError(NOT_RESET)
        return self._decisions

    @property
    def seen(self) -> SceneBatch:
        """The scenes of the last query of the rules."""
        if self._seen is None:
            raise RuntimeError(NOT_RESET)
        return self._seen

    @property
    def measures(self) -> Measures | None:
        """The measures of the episodes up to now, if they are taken."""
        return None if self._meter is None else self._meter.totals

    @property
    def distance(self) -> Floats:
        """Metres driven in the episode, shape (N,)."""
        return self._egos.at.distance

    @property
    def speed(self) -> Floats:
        """Speed of the egos [m/s], shape (N,)."""
        return self._egos.at.speed

    def scene(self, ego: int) -> Scene:
        """Return the scene of one ego in the last query of the rules."""
        return self.seen.scene(ego)

    def traffic_around(self, ego: int) -> Scene:
        """Return the scene of one ego as it is, with all traffic on the road, in radar range or not."""
        return self._look(np.array([ego]), reach=np.inf).scenes.scene(0)

    def targets(self) -> Floats:
        """Return the y [m] that each action would steer each ego for, shape (N, 3).

        NaN for a lane change that would be ignored; beyond the road on a side without a lane.
        """
        return self._egos.targets(self.decisions.lane_to_keep, self._courses, self._everyone)

    def playback_of(self, ego: int) -> Playback:
        """Return the playback that an ego drives in."""
        return self.playbacks.all[int(self._egos.at.playback[ego])]

    def frame_of(self, ego: int) -> int:
        """Return the recorded frame that an ego is in."""
        return int(self._egos.at.frame[ego])

    def reset(self, egos: Sequence[int], rngs: Sequence[np.random.Generator]) -> None:
        """Begin new episodes for `egos`, each a function of its generator alone; others are left unchanged.

        The first reset must be of all egos, in order.

        Raises:
            UserError: the recording has no gap to enter.
        """
        self._begin(dict(zip(egos, rngs, strict=True)))
        places = np.asarray(egos)
        scenes = self._look(places).scenes
        seen = self._perceive(scenes, places)
        decisions = self._ask(seen, places)
        if self._scenes is not None and self._seen is not None and self._decisions is not None:
            # The old ones may have been handed out: leave them unchanged.
            seen = self._seen.replaced(places, seen) if self._sensing else seen
            scenes = self._scenes.replaced(places, scenes)
            decisions = self._decisions.replaced(places, decisions)
        elif places.tolist() != self._everyone.tolist():
            raise RuntimeError("the first reset must be of all egos, in order")
        self._scenes, self._decisions = scenes, decisions
        self._seen = seen if self._sensing else scenes

    def step(
        self,
        actions: npt.NDArray[np.integer] | Sequence[int],
        restarts: Mapping[int, np.random.Generator] | None = None,
    ) -> StepResult:
        """Drive one step with `actions` of shape (N,), each an `Action`.

        Egos whose episode has ended have rewards of 0 and no events. Those in `restarts` begin a new episode
        instead, as in `reset`.

        Raises:
            TypeError, ValueError: `actions` are not N valid actions; nothing is driven.
            UserError: the rules keep a lane that the road does not have.
        """
        actions, before = several_actions(actions, self.count), self.decisions
        changed = self._move(actions, before)
        around = self._look()
        events, numbers, eventful = self._finish(around.touching, changed, before.front_is_free)
        contacts: dict[int, Contact] = {}
        if around.any_touches:
            contacts = worst_contacts(around.touching, self._judge, events[CONTACT])
        self._measure(around.scenes, before.action_mask, events[PLAYING], numbers)
        entered = events[ENTERS]
        placed = self._reenter(entered) if eventful else []
        if restarts:
            self._begin(restarts)
            placed += restarts
        decisions = self._decide(around.scenes, placed)
        return StepResult(
            scenes=around.scenes,
            decisions=decisions,
            reward=numbers[REWARD],
            rewards=dict(zip(self._terms, numbers[FIRST_TERM:], strict=True)),
            terminated=events[TERMINATED],
            truncated=events[TRUNCATED],
            changed=changed,
            off_road=events[OFF_ROAD],
            contacts=contacts,
            entered=entered,
            distance=numbers[DISTANCE],
            speed=numbers[SPEED],
            failures=decisions.failures,
        )

    def _move(self, actions: Integers, decisions: Decisions) -> Mask:
        """Move the traffic that reacts and the egos by one frame; return which egos began a lane change."""
        egos, at = self._egos, self._egos.at
        changed = egos.steer(actions, decisions.lane_to_keep, self._courses)
        if self._reactive is not None and self._scenes is not None:
            self._reactive.advance(self._scenes, self._courses, at.frame, self._reacts.take(at.playback))
        egos.drive(decisions.target_speed, decisions.comfortable_acceleration, self._courses)
        return changed

    def _finish(self, touching: Mask, changed: Mask, front_is_free: Mask) -> tuple[Mask, Floats, bool]:
        """Return the events and the numbers of the frame, by rows (`ego_loops`), and whether there are any.

        Egos whose episodes end are marked so.
        """
        at, past, courses = self._egos.at, self._egos.past, self._courses
        events = np.empty((PLAYING + 1, self.count), dtype=np.bool_)
        numbers = np.empty((FIRST_TERM + len(self._terms), self.count))
        eventful = machine_code(finish)(
            touching,
            changed,
            front_is_free,
            at.x,
            at.y,
            at.speed,
            at.frame,
            at.distance,
            at.ended,
            at.playback,
            courses.frames,
            courses.dt,
            courses.sign,
            courses.start,
            courses.length,
            courses.low,
            courses.high,
            courses.low_after,
            courses.high_after,
            courses.end,
            courses.limit,
            self._tracks,
            past.rows,
            past.now,
            past.kept,
            *self._egos.size,
            self._weights,
            self._chosen_terms,
            events,
            numbers,
        )
        return events, numbers, eventful

    def _measure(self, scenes: SceneBatch, offered: Mask, playing: Mask, numbers: Floats) -> None:
        """Add a step to the measures of comfort and of gaps, if they are taken."""
        if self._meter is not None:
            motion = numbers[ACCELERATION], numbers[JERK]
            self._meter.add(playing, scenes, offered, motion, sign=self._courses.sign, dt=self._courses.dt)

    def branch(self, egos: Integers) -> World:
        """Return a world in which ego i drives on from where the i-th of `egos` is; nothing changes here.

        An ego may be named several times. What its recording, its traffic and its random draws will bring is
        the same in both worlds, so equal actions lead to equal results. A branch takes no measures.
        """
        scenes, seen, decisions = self._scenes, self.seen, self.decisions
        twin = copy(self)
        twin.count, twin._everyone = len(egos), np.arange(len(egos))
        twin._choices = [self._choices[ego] for ego in egos.tolist()]
        twin.rngs = [deepcopy(self.rngs[ego]) for ego in egos.tolist()]
        twin._egos = self._egos.taken(egos)
        twin._courses = self.playbacks.courses.take(twin._egos.at.playback)
        twin._reactive = None if self._reactive is None else self._reactive.taken(egos)
        twin._sensing = None if self._sensing is None else self._sensing.taken(egos)
        twin._meter = None
        twin._seen = taken_rows(seen, egos)
        twin._scenes = twin._seen if scenes is None or scenes is seen else taken_rows(scenes, egos)
        twin._decisions = decisions.taken(egos)
        return twin

    def get_state(self) -> dict[str, Any]:
        """Return the state of traffic, egos, controllers and generators, in arrays and plain types.

        The egos' sensing and decisions are included if they cannot be computed again.
        """
        if self._scenes is None:
            raise RuntimeError(NOT_RESET)
        state = {**self._egos.get_state(), "rngs": [rng.bit_generator.state for rng in self.rngs]}
        if self._reactive is not None:
            state["reactive"] = self._reactive.get_state()
        if self._sensing is not None:
            state["sensing"] = self._sensing.get_state()
        return state

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Take over what `get_state` gave in a world made alike."""
        self._egos.set_state(state)
        self.rngs = [np.random.default_rng() for _ in range(self.count)]
        for rng, rng_state in zip(self.rngs, state["rngs"], strict=True):
            rng.bit_generator.state = rng_state
        self._courses = self.playbacks.courses.take(self._egos.at.playback)
        if self._reactive is not None:
            self._reactive.set_state(state["reactive"])
        scenes = self._look().scenes
        seen = scenes
        if self._sensing is not None:
            self._sensing.set_state(state["sensing"])
            seen = self._sensing.shown(scenes, self._courses, self._everyone)
        self._scenes, self._seen = scenes, seen
        self._decisions = self._ask(seen, self._everyone)

    def _begin(self, episodes: Mapping[int, np.random.Generator]) -> None:
        """Begin an episode of each ego that has a generator here."""
        at = self._egos.at
        for ego, rng in episodes.items():
            self.rngs[ego] = rng
            if self._sensing is not None:
                self._sensing.begin(ego, rng)
            choices = self._choices[ego]
            at.playback[ego] = choices[rng.integers(len(choices))]
            at.ended[ego], at.distance[ego] = False, 0.0
            if self._meter is not None:
                self._meter.begin(ego)
            frame = int(rng.integers(self._beginnings_of(int(at.playback[ego]))))
            self._place(ego, self._entries[at.playback[ego]].find(rng, frame=frame))
        self._courses = self.playbacks.courses.take(at.playback)

    def _beginnings_of(self, playback: int) -> int:
        """Return the `beginnings` of a playback; they are found when an ego first drives in it."""
        if playback not in self._beginnings:
            self._beginnings[playback] = beginnings(self.playbacks.all[playback], self.config)
        return self._beginnings[playback]

    def _place(self, ego: int, entry: Entry) -> None:
        """Put an ego at an entry, with all traffic around it on the record."""
        self._egos.place(ego, entry)
        if self._reactive is not None:
            self._reactive.forget(ego)
        if self._sensing is not None:
            self._sensing.forget(ego)
        if self._meter is not None:
            self._meter.forget(ego)

    def _look(self, places: Integers | None = None, *, reach: float | None = None) -> Surroundings:
        """Return the scenes around the egos in `places`, or around all of them.

        They hold the vehicles within `reach` [m], by default the radar range.
        """
        at, courses, films = self._egos.at, self._courses, self.playbacks.films
        places = self._everyone if places is None else places
        shape = len(places), films.slots
        numbers = np.empty((len(NUMBERS), *shape))
        vehicle, lane = np.empty(shape, np.int64), np.empty(shape, np.int64)
        valid, touching = np.empty(shape, np.bool_), np.empty(shape, np.bool_)
        lags = _NO_LAGS if self._reactive is None else (self._reactive.lag, self._reactive.speed)
        any_touches = machine_code(look)(
            places,
            films.cells,
            films.table,
            at.x,
            at.y,
            at.speed,
            at.vy,
            at.frame,
            courses.cells_begin,
            courses.first_piece,
            courses.frames,
            courses.slots,
            courses.sign,
            courses.lane_id,
            courses.centre,
            *lags,
            *self._egos.size,
            self.config.radar_range if reach is None else reach,
            numbers,
            vehicle,
            lane,
            valid,
            touching,
        )
        scenes = SceneBatch.from_numbers(
            numbers,
            roads=self.playbacks.roads,
            road=courses.road.take(places),
            target_lane=at.target_lane.take(places),
            id=vehicle,
            lane=lane,
            valid=valid,
        )
        return Surroundings(scenes, touching, any_touches)

    def _decide(self, scenes: SceneBatch, placed: Sequence[int]) -> Decisions:
        """Return the decisions about `scenes`, in which the egos `placed` were moved."""
        if placed:
            places = np.array(placed)
            scenes.put(places, self._look(places).scenes)
        self._scenes, self._seen = scenes, self._perceive(scenes, self._everyone)
        self._decisions = self._ask(self._seen, self._everyone)
        return self._decisions

    def _perceive(self, scenes: SceneBatch, places: Integers) -> SceneBatch:
        """Return what the egos in `places` see in `scenes`."""
        if self._sensing is None:
            return scenes
        return self._sensing.perceive(scenes, self._courses.take(places), self._egos.at.frame[places], places)

    def _ask(self, seen: SceneBatch, places: Integers) -> Decisions:
        """Return the decisions about what the egos in `places` see."""
        decisions = self.shield.decide_batch(seen)
        if self.config.offers == "rules":
            return decisions
        if self.config.offers == "all":
            mask = np.ones_like(decisions.action_mask)
            return replace(decisions, action_mask=mask)
        courses = self._courses.take(places)
        targets = self._egos.targets(decisions.lane_to_keep, self._courses, places)
        mask = predicted_actions(seen, targets, courses.low, courses.high, self.config.prediction_horizon)
        if np.isfinite(courses.end).any():
            mask &= lane_goes_on(seen, targets, courses, self.config.prediction_horizon)
        # If the rules failed, their fail-safe stands.
        mask[list(decisions.failures)] = decisions.action_mask[list(decisions.failures)]
        stuck = np.flatnonzero(~mask.any(axis=1)).tolist()
        mask[stuck, Action.LANE_KEEPING] = True
        failures = {**decisions.failures, **dict.fromkeys(stuck, NOTHING_OFFERED)}
        return replace(decisions, action_mask=mask, failures=failures)

    def _judge(self, ego: int, slot: int) -> Contact:
        """Return the contact of an ego with the vehicle in a slot."""
        playback, frame, past = self.playback_of(ego), self.frame_of(ego), self._egos.past
        own = past.track(ego, playback.sign, self._egos.size)
        placed_at = frame - int(past.kept[ego]) + 1
        other = playback.track(frame, slot, frame - len(own.s) + 1)
        if self._reactive is not None:
            other = self._reactive.driven(ego, slot, other)
        verdict = judge(
            own,
            other,
            playback.lanes,
            playback.road.time_step,
            other_appeared=playback.film.first_of(frame, slot) > placed_at,
        )
        closing = abs(float(own.speed[-1] - other.speed[-1]))
        return Contact(playback.film.vehicle_in(frame, slot), verdict, closing)

    def _reenter(self, entering: Mask) -> list[int]:
        """Place the egos anew that have reached the end of the stretch or of the recording; return them."""
        at, placed = self._egos.at, entering.nonzero()[0].tolist()
        for ego in placed:
            playback = self.playback_of(ego)
            lane = playback.road.lane(int(at.target_lane[ego]))
            frame, rng = self.frame_of(ego) % playback.frames, self.rngs[ego]
            self._place(ego, self._entries[at.playback[ego]].find(rng, frame=frame, lane=lane))
        return placed


def _traffic(playback: Playback, config: EnvConfig) -> Traffic:
    """Return what the vehicles of a playback do about an ego: as configured, else as the recording says."""
    return playback.traffic if config.traffic == "auto" else Traffic(config.traffic)
