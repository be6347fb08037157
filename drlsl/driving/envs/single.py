"""The Gymnasium environment: the world with one ego."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, ClassVar, Final, NamedTuple, TypeAlias

import gymnasium
import numpy as np
import numpy.typing as npt

from drlsl import masks
from drlsl.driving.config import EnvConfig
from drlsl.driving.envs.settings import check_options, the_config
from drlsl.driving.rendering import RENDER_MODES, Renderer
from drlsl.driving.scene import ATOMS, Action, Scene, one_action
from drlsl.driving.shield import Decisions, ObservationSpace, Shield
from drlsl.driving.simulation import (
    StepResult,
    World,
    drive_decision,
    frames_per_decision,
    load_playbacks,
)
from drlsl.masks import Mode, Settled, check_mode, settle

Observation: TypeAlias = npt.NDArray[np.float32]

ENV_MODES: Final[tuple[Mode, ...]] = ("mask", "replace", "raise")
"""What an environment can do with an action that was not offered."""

FALLBACK: Final = Action.LANE_KEEPING
"""What is driven in the place of an action that was not offered, in the mode `replace`."""

NOT_TAKEN: Final = -1
"""`info["taken"]` where an episode begins."""


class HighwayEnv(gymnasium.Env[Any, np.int64]):
    """Drive a recorded highway: observation float32 (S,), actions `Action`.

    The rules say what is observed, and within which bounds (`shield.observation`).

    `info` of reset and step holds `action_mask` int8 (3,), `offered` (whether the action asked for was),
    `taken` (the action that was driven, `NOT_TAKEN` after a reset), `rewards` (the weighted terms),
    `lane_change`, `contact`, `at_fault`, `contact_reason`, `off_road`, `entered`, `speed` [m/s], `distance`
    [m], `target_speed` [m/s] and `fail_safe` with `fail_safe_reason`. Terminated on a contact or off the
    road, truncated at the end of the track.

    The mask is offered, not enforced, unless `mode` is `replace` (keep the lane instead) or `raise`. With a
    `mask_format` other than gymnasium's, observation and info are as that library wants them
    (`drlsl.masks.FORMATS`).
    """

    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES)}  # noqa: RUF012  (Gymnasium declares it so)

    DEFAULTS: ClassVar[Mapping[str, Any]] = MappingProxyType({})
    """Settings that differ from those of `EnvConfig` where none are given."""

    def __init__(
        self,
        config: EnvConfig | None = None,
        *,
        shield: Shield | None = None,
        discount: float = 1.0,
        render_mode: str | None = None,
        mode: Mode = "mask",
        mask_format: str = "gymnasium",
        **settings: Any,
    ) -> None:
        """Make the environment of `config`, or of `settings`, fields of `EnvConfig`.

        `discount` is that of a decision, for the rewards of its frames
        (`drlsl.driving.simulation.drive_decision`). `render_mode`: `human` shows every frame in a window,
        `rgb_array` makes `render` return the last one of a decision.

        Raises:
            TypeError: there is no such setting.
            UserError: a setting has a value that it cannot have, or the recording, the rules or the render
                mode cannot be used.
        """
        self.config: EnvConfig = the_config(type(self).__name__, config, settings, _KEYWORDS, self.DEFAULTS)
        self._mode = check_mode(mode, ENV_MODES)
        self._format = masks.mask_format(mask_format)
        self.shield = shield or Shield.from_files(
            self.config.rules, tier=self.config.tier, seconds=self.config.rule_seconds
        )
        self.world = World(self.config, load_playbacks([self.config]), self.shield)
        self._frames = frames_per_decision(self.config.decision_period, self.world.playbacks)
        self._discount = discount
        self._terms = self.config.reward.single_terms
        self.action_space = gymnasium.spaces.Discrete(len(Action))
        self.observation_space = self._format.space(observation_box(self.shield.observation), len(Action))
        self._decisions: Decisions | None = None
        self.render_mode = render_mode
        self.metadata = {**self.metadata, "render_fps": render_rate(self.world, self._frames)}
        self._renderer = None if render_mode is None else Renderer(render_mode, self.world)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; with a seed, the episode is a function of the seed.

        Raises:
            ValueError: there are options, and it has none.
        """
        check_options(options)
        super().reset(seed=seed, options=options)
        self.world.reset([0], [self.np_random])
        if self._renderer is not None:
            self._renderer.watch(None)
        return self._told(self.world.decisions, None, Settled(_NONE, _YES))

    def step(self, action: np.int64 | int) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Drive one decision: a recorded frame, or those of `decision_period`.

        Raises:
            TypeError, ValueError: the action is not an `Action`; nothing is driven.
            ActionNotOffered: in the mode `raise`, the action was not offered; nothing is driven.
        """
        number, offered = one_action(action), self.world.decisions.action_mask
        settled = Settled(np.array([number]), _YES)
        if not offered[0, number]:
            settled = settle(settled.taken, offered, self._mode, fallback=FALLBACK, names=ATOMS)
        result = drive_decision(
            self.world,
            settled.taken,
            frames=self._frames,
            discount=self._discount,
            watch=None if self._renderer is None else self._renderer.watch,
        )
        observation, info = self._told(result.decisions, result, settled)
        return (
            observation,
            float(result.reward[0]),
            bool(result.terminated[0]),
            bool(result.truncated[0]),
            info,
        )

    def render(self) -> npt.NDArray[np.uint8] | None:
        """Return the picture of the present, uint8 (400, 1200, 3), in the mode `rgb_array`; else None.

        Raises:
            RuntimeError: the environment was not reset.
        """
        if self._renderer is None or self._renderer.live:
            return None
        return self._renderer.picture()

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._renderer is not None:
            self._renderer.close()

    def action_masks(self) -> npt.NDArray[np.bool_]:
        """Return the mask of the actions that the rules offer now, shape (3,)."""
        if self._decisions is None:
            raise RuntimeError("reset the environment first: no action is offered yet")
        return np.asarray(self._decisions.action_mask[0])

    def get_state(self) -> dict[str, Any]:
        """Return the state of the environment between two steps, in arrays and plain types."""
        return self.world.get_state()

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Take over what `get_state` gave in an environment of the same configuration."""
        self.world.set_state(state)
        self._decisions = self.world.decisions
        self.np_random = self.world.rngs[0]

    def scene(self) -> Scene:
        """Return the last scene that the rules were asked about."""
        return self.world.scene(0)

    def _told(
        self, decisions: Decisions, result: StepResult | None, settled: Settled
    ) -> tuple[Any, dict[str, Any]]:
        """Return the observation and the info, in the format of the library."""
        self._decisions = decisions
        observation = np.asarray(decisions.observation[0], dtype=np.float32)
        return self._format.one(observation, self._info(decisions, result, settled), decisions.action_mask[0])

    def _info(self, decisions: Decisions, result: StepResult | None, settled: Settled) -> dict[str, Any]:
        contact = result.contacts.get(0) if result is not None else None
        failures = result.failures if result is not None else decisions.failures
        return {
            "offered": bool(settled.offered[0]),
            "taken": int(settled.taken[0]),
            "rewards": {term: float(result.rewards[term][0]) if result else 0.0 for term in self._terms},
            "lane_change": bool(result.changed[0]) if result else False,
            "contact": contact is not None,
            "at_fault": contact is not None and contact.at_fault,
            "contact_reason": contact.verdict.value if contact else "",
            "off_road": bool(result.off_road[0]) if result else False,
            "entered": bool(result.entered[0]) if result else True,
            "speed": float((result or self.world).speed[0]),
            "distance": float((result or self.world).distance[0]),
            "target_speed": float(decisions.target_speed[0]),
            "fail_safe": 0 in failures,
            "fail_safe_reason": failures.get(0, ""),
        }


_KEYWORDS: Final = ("config", "shield", "discount", "mode", "mask_format", "render_mode")
"""What the environment takes besides the settings."""

_NONE: Final = np.array([NOT_TAKEN])
_YES: Final = np.array([True])


class Spaces(NamedTuple):
    """The spaces of one environment, and the names of the numbers of an observation."""

    single_observation_space: gymnasium.Space[Observation]
    single_action_space: gymnasium.Space[np.int64]
    observation_names: tuple[str, ...]


def render_rate(world: World, frames: int) -> float:
    """Return how many decisions of so many `frames` there are in a second."""
    return 1 / (world.playbacks.all[0].road.time_step * frames)


def spaces_of(shield: Shield) -> Spaces:
    """Return the spaces of an environment with the rules of `shield`."""
    actions = gymnasium.spaces.Discrete(len(Action))
    return Spaces(observation_box(shield.observation), actions, shield.observation.names)


def observation_box(space: ObservationSpace) -> gymnasium.Space[Observation]:
    """Return the observation space of a rule program, float32 (S,), as Gymnasium's."""
    low, high = (np.array(bounds, np.float32) for bounds in (space.low, space.high))
    return gymnasium.spaces.Box(low, high, dtype=np.float32)


def make_env(config: EnvConfig) -> HighwayEnv:
    """Return the environment of `config`, without Gymnasium's wrappers."""
    return HighwayEnv(config)
