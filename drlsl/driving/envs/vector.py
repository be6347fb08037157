"""The vector environment: the world with N egos, as Gymnasium's VectorEnv."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, Final, TypeAlias

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from drlsl import masks
from drlsl.driving.config import EnvConfig
from drlsl.driving.envs.settings import check_options, the_config
from drlsl.driving.envs.single import ENV_MODES, FALLBACK, NOT_TAKEN, observation_box, render_rate
from drlsl.driving.rendering import RGB_ARRAY, Renderer
from drlsl.driving.scene import ATOMS, Action, SceneBatch, several_actions
from drlsl.driving.shield import Decisions, Shield
from drlsl.driving.simulation import (
    Playback,
    StepResult,
    World,
    drive_decision,
    frames_per_decision,
    in_direction,
    load_playbacks,
)
from drlsl.errors import UserError
from drlsl.masks import Mode, Settled, check_mode, settle
from drlsl.traffic import Floats, Integers, Mask

Observations: TypeAlias = npt.NDArray[np.float32]

_RESET_MASK: Final = "reset_mask"


class HighwayVectorEnv(VectorEnv[Any, Integers, npt.NDArray[Any]]):
    """N highways driven together: observations float32 (N, S), actions (N,).

    Sub-environment i equals, to the bit, a `HighwayEnv` with the same configuration and seed. `info` holds
    the same keys, as arrays with a first axis of N, each with a mask beside it (`speed`, `_speed`), as in
    Gymnasium: `action_mask` is int8 (N, 3). `mode` and `mask_format` are those of `HighwayEnv`, too.

    All autoreset modes of Gymnasium are supported: NEXT_STEP, SAME_STEP with `final_obs` and `final_info`,
    and DISABLED with `options={"reset_mask": mask}` of `reset`.
    """

    metadata: dict[str, Any] = {"render_modes": [RGB_ARRAY]}  # noqa: RUF012  (Gymnasium declares it so)

    DEFAULTS: ClassVar[Mapping[str, Any]] = MappingProxyType({})
    """Settings that differ from those of `EnvConfig` where none are given."""

    def __init__(
        self,
        config: EnvConfig | Sequence[EnvConfig] | None = None,
        *,
        num_envs: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        shield: Shield | None = None,
        playbacks: Sequence[Playback] | None = None,
        discount: float = 1.0,
        measured: bool = False,
        render_mode: str | None = None,
        mode: Mode = "mask",
        mask_format: str = "gymnasium",
        **settings: Any,
    ) -> None:
        """Make `num_envs` environments of one `config`, or of `settings`, or one for each of several configs.

        Several configurations may differ in recording and direction. `playbacks`, if given, replace the
        recordings. `discount` is that of a decision, for the rewards of its frames
        (`drlsl.driving.simulation.drive_decision`). `measured`: info holds `measures`, those of the episodes
        up to now (`drlsl.driving.simulation.Measures`). `render_mode` is `rgb_array`, or None.

        Raises:
            TypeError: there is no such setting.
            UserError: a setting has a value that it cannot have, a recording, the rules, the render mode or
                the autoreset mode cannot be used, or the configurations do not fit together.
        """
        given = the_config(type(self).__name__, config, settings, _KEYWORDS, self.DEFAULTS)
        configs = _configs(given, num_envs)
        self._mode = check_mode(mode, ENV_MODES)
        self._format = masks.mask_format(mask_format)
        self.config = configs[0]
        self.num_envs = len(configs)
        self.autoreset_mode = _checked_autoreset(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        self.shield = shield or Shield.from_files(
            self.config.rules, tier=self.config.tier, seconds=self.config.rule_seconds
        )
        self.world = World(self.config, _played(configs, playbacks), self.shield, measured=measured)
        self._frames = frames_per_decision(self.config.decision_period, self.world.playbacks)
        self._discount = discount
        self._decisions: Decisions | None = None
        self.single_action_space = gymnasium.spaces.Discrete(len(Action))
        self.single_observation_space = self._format.space(
            observation_box(self.shield.observation), len(Action)
        )
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._terms = self.config.reward.single_terms
        self._rngs: list[np.random.Generator] = [seeding.np_random()[0] for _ in configs]
        self._over = np.ones(self.num_envs, dtype=np.bool_)
        self._blank = _Blank(self.num_envs)
        self.render_mode = render_mode
        self.metadata |= {"render_fps": render_rate(self.world, self._frames)}
        self._renderer = None if render_mode is None else Renderer(render_mode, self.world, (RGB_ARRAY,))
        self.watch: Callable[[StepResult], None] | None = None
        """Called with the result of every frame, also of those within a decision."""

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode in every environment, or in those that `options["reset_mask"]` marks.

        Environment i takes the seed + i, or the i-th of several seeds.

        Raises:
            ValueError: the seeds or the mask are not of shape (N,), or there is no such option.
        """
        check_options(options, (_RESET_MASK,))
        asked = self._asked(options)
        for index, one in enumerate(self._seeds(seed)):
            if asked[index] and one is not None:
                self._rngs[index] = seeding.np_random(one)[0]
        places = np.flatnonzero(asked).tolist()
        self.world.reset(places, [self._rngs[index] for index in places])
        self._over &= ~asked
        self._decisions = self.world.decisions
        return self._told(self._info(None, asked))

    def step(
        self, actions: npt.NDArray[np.integer] | Sequence[int]
    ) -> tuple[Any, Floats, Mask, Mask, dict[str, Any]]:
        """Drive one decision in every environment: a recorded frame, or those of `decision_period`.

        Raises:
            ResetNeeded: autoreset is disabled and an episode is over.
            TypeError, ValueError: `actions` are not N valid actions; nothing is driven.
            ActionNotOffered: in the mode `raise`, an action was not offered; nothing is driven.
        """
        again: list[int] = self._over.nonzero()[0].tolist()
        if again and self.autoreset_mode is not AutoresetMode.NEXT_STEP:
            raise gymnasium.error.ResetNeeded(f"the episodes of {again} are over: reset them first")
        restarts = {index: self._rngs[index] for index in again}
        settled = settle(
            several_actions(actions, self.num_envs),
            self.world.decisions.action_mask,
            self._mode,
            fallback=FALLBACK,
            names=ATOMS,
            free=self._over if again else None,
        )
        result = drive_decision(
            self.world,
            settled.taken,
            restarts,
            frames=self._frames,
            discount=self._discount,
            watch=self.watch,
        )
        self._decisions = result.decisions
        if self._renderer is not None:
            self._renderer.watch(result)
        over = result.terminated | result.truncated
        info = self._info(result, self._blank.all, settled, began=again)
        if self.autoreset_mode is AutoresetMode.SAME_STEP and over.any():
            info = self._reset_within(over, info)
        else:
            self._over = over
        observations, info = self._told(info)
        return observations, result.reward, result.terminated, result.truncated, info

    def render(self) -> tuple[npt.NDArray[np.uint8], ...] | None:
        """Return a picture of every environment, uint8 (400, 1200, 3), in the mode `rgb_array`; else None."""
        if self._renderer is None:
            return None
        return tuple(map(self._renderer.picture, range(self.num_envs)))

    def rule_files(self) -> list[Path]:
        """Return the files of the rules that offer actions."""
        return self.shield.files()

    @property
    def observation_names(self) -> tuple[str, ...]:
        """The names of the numbers of an observation."""
        return self.shield.observation.names

    def action_masks(self) -> Mask:
        """Return the masks of the actions that the rules offer now, shape (N, 3)."""
        return self._latest().action_mask

    def scenes(self) -> SceneBatch:
        """Return the scenes that the rules see now."""
        return self.world.seen

    def branch(self, egos: Integers) -> World:
        """Return a world in which the egos of some environments drive on (`World.branch`)."""
        return self.world.branch(egos)

    def get_state(self) -> dict[str, Any]:
        """Return the state of every environment between two steps, in arrays and plain types."""
        return {"world": self.world.get_state(), "over": self._over.copy()}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Take over what `get_state` gave in an environment of the same configuration."""
        self.world.set_state(state["world"])
        self._decisions = self.world.decisions
        self._rngs = self.world.rngs
        self._over = state["over"].copy()

    def _seeds(self, seed: int | Sequence[int | None] | None) -> Sequence[int | None]:
        if seed is None:
            return [None] * self.num_envs
        seeds = [seed + index for index in range(self.num_envs)] if isinstance(seed, int) else seed
        if len(seeds) != self.num_envs:
            raise ValueError(f"{len(seeds)} seeds for {self.num_envs} environments")
        return seeds

    def _asked(self, options: dict[str, Any] | None) -> Mask:
        """Return the mask of the environments to reset, shape (N,)."""
        mask = (options or {}).get(_RESET_MASK)
        if mask is None:
            return self._blank.all
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (self.num_envs,):
            raise ValueError(f"reset_mask is {mask!r}; expected a Boolean array of shape ({self.num_envs},)")
        if not mask.any():
            raise ValueError("reset_mask marks no environment")
        return mask

    def _reset_within(self, over: Mask, info: dict[str, Any]) -> dict[str, Any]:
        """Begin the next episodes at once; the last results of the ended ones are kept beside."""
        final_obs = np.full(self.num_envs, None, dtype=object)
        places = np.flatnonzero(over).tolist()
        observations = self._observations()
        for index in places:
            final_obs[index] = observations[index]
        self.world.reset(places, [self._rngs[index] for index in places])
        self._decisions = self.world.decisions
        merged = _merged(info, self._info(None, over), over)
        merged |= {"final_obs": final_obs, "_final_obs": over, "final_info": _only(info, over)}
        return merged | {"_final_info": over}

    def _observations(self) -> Observations:
        return self._latest().observation.astype(np.float32)

    def _latest(self) -> Decisions:
        """Return the decisions of the last reset or step."""
        return self.world.decisions if self._decisions is None else self._decisions

    def _told(self, info: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
        """Return the observations and the info, in the format of the library."""
        return self._format.many(self._observations(), info, self._latest().action_mask)

    def _info(
        self,
        result: StepResult | None,
        told: Mask,
        settled: Settled | None = None,
        began: Sequence[int] = (),
    ) -> dict[str, Any]:
        """Return the info of the environments that `told` marks; without a result, as after a reset."""
        decisions, world = self._latest(), self.world
        nothing, no_reason = self._blank.nothing, self._blank.no_reason
        contact, at_fault, reason = nothing, nothing, no_reason
        if result is not None and result.contacts:
            contact, at_fault, reason = nothing.copy(), nothing.copy(), no_reason.copy()
            for index, met in result.contacts.items():
                contact[index], at_fault[index], reason[index] = True, met.at_fault, met.verdict.value
        fail_safe, why = nothing, no_reason
        failures = decisions.failures if result is None else result.failures
        if failures:
            fail_safe, why = nothing.copy(), no_reason.copy()
            for index, failure in failures.items():
                fail_safe[index], why[index] = True, failure
        entered = result.entered if result else told
        speed, distance = (result or world).speed, (result or world).distance
        if began or result is None:
            entered, speed, distance = entered.copy(), speed.copy(), distance.copy()
            places = list(began)
            entered[places] = True
            speed[places], distance[places] = world.speed[places], world.distance[places]
        rewards = result.rewards if result else dict.fromkeys(self._terms, np.zeros(self.num_envs))
        columns: dict[str, Any] = {
            "action_mask": decisions.action_mask.astype(np.int8),
            "offered": told if settled is None else settled.offered,
            "taken": self._blank.not_taken if settled is None else _taken(settled, began),
            "rewards": _with_masks(rewards, told),
            "lane_change": result.changed if result else nothing,
            "contact": contact,
            "at_fault": at_fault,
            "contact_reason": reason,
            "off_road": result.off_road if result else nothing,
            "entered": entered,
            "speed": speed,
            "distance": distance,
            "target_speed": decisions.target_speed,
            "fail_safe": fail_safe,
            "fail_safe_reason": why,
        }
        if world.measures is not None:
            columns["measures"] = _with_masks(world.measures.as_columns(), told)
        return _with_masks(columns, told)


_KEYWORDS: Final = (
    *("config", "num_envs", "autoreset_mode", "shield", "playbacks", "discount", "measured", "mode"),
    *("mask_format", "render_mode"),
)
"""What the environment takes besides the settings."""


def make_vec(
    config: EnvConfig,
    num_envs: int,
    autoreset_mode: AutoresetMode = AutoresetMode.NEXT_STEP,
    *,
    discount: float = 1.0,
    measured: bool = False,
) -> HighwayVectorEnv:
    """Return the vector environment of `config`, without Gymnasium's wrappers."""
    return HighwayVectorEnv(
        config, num_envs=num_envs, autoreset_mode=autoreset_mode, discount=discount, measured=measured
    )


def _configs(config: EnvConfig | Sequence[EnvConfig], num_envs: int | None) -> list[EnvConfig]:
    """Return one configuration for each environment."""
    if isinstance(config, EnvConfig):
        configs = [config] * (1 if num_envs is None else num_envs)
    else:
        configs = list(config)
        if num_envs not in (None, len(configs)):
            raise UserError(f"{len(configs)} configurations for {num_envs} environments")
    if not configs:
        raise UserError("a vector environment needs one environment or more")
    alike = {
        one.model_copy(update={"recording": "", "direction": "both"}).model_dump_json() for one in configs
    }
    if len(alike) > 1:
        raise UserError("the configurations differ in more than recording and direction")
    return configs


def _checked_autoreset(mode: AutoresetMode | str) -> AutoresetMode:
    """Return an autoreset mode, given by itself or by its name.

    Raises:
        UserError: there is none.
    """
    try:
        return AutoresetMode(mode)
    except ValueError as error:
        raise UserError.no_such("autoreset_mode", mode, [one.value for one in AutoresetMode]) from error


def _played(configs: Sequence[EnvConfig], playbacks: Sequence[Playback] | None) -> list[list[Playback]]:
    """Return what each environment plays back: its recording, or those of `playbacks` in its direction."""
    if playbacks is None:
        return load_playbacks(configs)
    return [in_direction(playbacks, one) for one in configs]


class _Blank:
    """Arrays of shape (N,), read-only, that infos share if there is nothing to report."""

    def __init__(self, count: int) -> None:
        self.all = _constant(count, True)
        self.nothing = _constant(count, False)
        self.no_reason = _constant(count, "")
        self.not_taken = _constant(count, NOT_TAKEN)

    def __reduce__(self) -> tuple[Any, ...]:
        """Make a copy with new arrays: copies of them would be writable."""
        return _Blank, (len(self.all),)


def _constant(count: int, value: bool | int | str) -> npt.NDArray[Any]:
    """Return an array of one value, read-only."""
    result = np.full(count, value, dtype=object if isinstance(value, str) else type(value))
    result.setflags(write=False)
    return result


def _taken(settled: Settled, began: Sequence[int]) -> Integers:
    """Return the actions that were driven; where an episode began, none was."""
    if not began:
        return settled.taken
    taken = settled.taken.copy()
    taken[list(began)] = NOT_TAKEN
    return taken


def _with_masks(columns: dict[str, Any], told: Mask) -> dict[str, Any]:
    """Return the columns, each with a mask of the environments that have it."""
    result = {}
    for name, column in columns.items():
        result[name], result["_" + name] = column, told
    return result


def _names(info: dict[str, Any]) -> Iterable[str]:
    return (name for name in info if not name.startswith("_"))


def _merged(info: dict[str, Any], other: dict[str, Any], places: Mask) -> dict[str, Any]:
    """Return `info` with the values of `other` in `places`."""
    result = dict(info)
    for name in _names(info):
        if isinstance(info[name], dict):
            result[name] = _merged(info[name], other[name], places)
        else:
            result[name] = info[name].copy()
            result[name][places] = other[name][places]
    return result


def _only(info: dict[str, Any], places: Mask) -> dict[str, Any]:
    """Return the values of `info` in `places`, blank elsewhere."""
    result: dict[str, Any] = {}
    for name in _names(info):
        column = info[name]
        if isinstance(column, dict):
            result[name] = _only(column, places)
        else:
            result[name] = np.zeros_like(column)
            if column.dtype == object:
                result[name][:] = None
            result[name][places] = column[places]
        result[f"_{name}"] = places
    return result
