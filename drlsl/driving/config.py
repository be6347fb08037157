"""The configuration of an environment: frozen, validated, readable from a file."""

from __future__ import annotations

from typing import Annotated, Final, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, field_validator

RADAR_RANGE: Final = 100.0
"""How far the ego sees [m]; one value for the facts, the rules and the observation."""

EGO_LENGTH: Final = 4.6
"""Length of the ego [m]. Source: the public code's 15 pixels at 3.25 pixels a metre."""

EGO_WIDTH: Final = 1.9
"""Width of the ego [m]: a passenger car's; the public code's 8 pixels are 2.46 m, a lorry's."""

TRACK_LENGTH: Final = 840.0
"""Least length of an episode [m] where none is given. Source: paper, Training."""


PREDICTION_HORIZON: Final = 3.0
"""How far ahead the prediction looks [s]: about as long as a lane change takes."""

PositiveSpeed: TypeAlias = Annotated[float, Field(gt=0.0, le=100.0)]

Name: TypeAlias = Annotated[str, Field(min_length=1)]


class Section(BaseModel):
    """A frozen group of settings that refuses unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


EntryPlace: TypeAlias = Literal["road", "ramp"]
"""Where the ego enters: on the road, or on its on-ramp."""

Term: TypeAlias = Literal[
    "paper", "lane_change", "velocity", "collision", "off_road", "lost_speed", "comfort", "jerk"
]

PAPER_TERMS: Final = ("lane_change", "velocity", "collision", "off_road")
"""Names of the terms that `paper` stands for, in its order. Source: paper, Reward Function."""


class RewardConfig(Section):
    """Terms, weights and shape of the reward; docs/reward.md says what each term can teach.

    Source: paper, Reward Function.
    """

    terms: tuple[Term, ...] = Field(
        ("paper",),
        min_length=1,
        description="Names of the terms that are added up; paper stands for lane_change, velocity, collision "
        "and off_road.",
    )
    lane_change: float = Field(5.0, ge=0, description="Weight of a started lane change (its term is -1).")
    lane_change_behind: float | None = Field(
        None,
        description="Reward of a lane change that is started while the front is busy, in place of the weight "
        "of lane_change; none: the same for all.",
    )
    velocity: float = Field(0.01, ge=0, description="Weight of the ego's speed in m/s, at every step.")
    lost_speed: float = Field(
        0.25,
        ge=0,
        description="Weight of lost speed, in m/s below the highest limit of the direction, for each second.",
    )
    comfort: float = Field(
        0.05, ge=0, description="Weight of the square of the acceleration in m/s², for each second."
    )
    jerk: float = Field(0.01, ge=0, description="Weight of the square of the jerk in m/s³, for each second.")
    collision: float = Field(
        100.0, ge=0, description="Weight of a contact (its term is -(1 - discount x/X))."
    )
    off_road: float = Field(
        100.0, ge=0, description="Weight of leaving the road (its term is -(1 - discount x/X))."
    )
    discount: float = Field(
        0.8,
        ge=0,
        le=1,
        description="Share by which a contact or leaving the road costs less at the end of the track.",
    )

    @field_validator("terms")
    @classmethod
    def _terms_differ(cls, terms: tuple[Term, ...]) -> tuple[Term, ...]:
        names = _expanded(terms)
        twice = [name for name in dict.fromkeys(names) if names.count(name) > 1]
        if twice:
            raise ValueError(f"{twice[0]} is named twice: paper stands for {', '.join(PAPER_TERMS)}")
        return terms

    @property
    def single_terms(self) -> list[str]:
        """Names of the terms, those that `paper` stands for in its place."""
        return _expanded(self.terms)


def _expanded(terms: tuple[Term, ...]) -> list[str]:
    return [name for term in terms for name in (PAPER_TERMS if term == "paper" else (term,))]


class SensingConfig(Section):
    """Faults of what the ego sees of other vehicles; it knows its own state exactly. All 0: no faults.

    Contacts, and the gaps in which the ego enters, are those of the true state of the road.
    """

    position_noise: float = Field(
        0.0, ge=0, description="Standard deviation in metres of the error of a place, along and across."
    )
    speed_noise: float = Field(
        0.0, ge=0, description="Standard deviation in m/s of the error of a speed, along and across."
    )
    noise_time: float = Field(
        1.0, ge=0, description="Seconds in which these errors change (first-order process); 0: white noise."
    )
    drop_rate: float = Field(0.0, ge=0, lt=1, description="Share of the vehicles that are not seen.")
    drop_time: float = Field(1.0, gt=0, description="Mean seconds for which a vehicle is not seen.")
    latency: float = Field(0.0, ge=0, le=5, description="Age of the sensed state in seconds.")

    @property
    def faulty(self) -> bool:
        """True if there is any fault."""
        return bool(self.position_noise or self.speed_noise or self.drop_rate or self.latency)


class EnvConfig(Section):
    """One driving environment.

    Shapes: observation (S,) as the rules declare it, action mask (3,).
    """

    recording: Name | tuple[Name, ...] = Field(
        "highway-train",
        min_length=1,
        description="A bundled recording's name or a path of recordings: a file, a folder, a data set with "
        "many; of several, one is drawn for every episode.",
    )
    direction: Literal["both", "left_to_right", "right_to_left"] = Field(
        "both",
        description="Which way the ego drives; both: drawn for every episode from those there are.",
    )
    rules: tuple[str, ...] = Field(
        (), description="Rule files to consult, in order; none: the default program, highway.pl."
    )
    tier: Literal["auto", "interpreter", "scalar", "numpy", "numba", "torch"] = Field(
        "auto", description="Tier that runs the rules; auto: the fastest that can run this program."
    )
    rule_seconds: float | None = Field(
        None,
        gt=0,
        description="Seconds that one question to the rules may take on the interpreter, besides its "
        "limit of inferences; a resumed run is sure to be the same to the bit only without.",
    )
    offers: Literal["rules", "prediction", "all"] = Field(
        "rules",
        description="Who says which actions are offered: the rules; a linear prediction, from which those "
        "that would end in a contact or off the road are left out; or nobody.",
    )
    prediction_horizon: float = Field(
        PREDICTION_HORIZON, gt=0, le=30, description="Seconds that the prediction looks ahead."
    )
    traffic: Literal["auto", "recorded", "reactive"] = Field(
        "auto",
        description="Whether recorded vehicles drive through the ego, or brake for it and follow (IDM); "
        "auto: as their recording says.",
    )
    entry: EntryPlace = Field(
        "road",
        description="Where the ego enters: in any lane of the road; or at the beginning of its merging lane, "
        "which it must leave before it ends.",
    )
    lane_limits: tuple[PositiveSpeed, ...] = Field(
        (),
        description="Speed limits of the lanes of a direction in m/s, from right to left; none: those of the "
        "recording.",
    )
    decision_period: float | None = Field(
        None,
        gt=0,
        le=60,
        description="Seconds for which an action is held, a multiple of the recording's frame; none: one "
        "frame. The rules still judge, and the ego still brakes, in every frame.",
    )
    sensing: SensingConfig = Field(SensingConfig(), description="Faults of what the ego sees.")
    track_length: float | None = Field(
        None,
        gt=0,
        description="Metres to drive in an episode; none: the paper's 840, or the whole stretch where it is "
        "longer than that.",
    )
    radar_range: float = Field(
        RADAR_RANGE, gt=0, description="Metres within which the ego sees other vehicles."
    )
    ego_length: float = Field(EGO_LENGTH, gt=0, description="Length of the ego in metres.")
    ego_width: float = Field(EGO_WIDTH, gt=0, description="Width of the ego in metres.")
    reward: RewardConfig = Field(RewardConfig(), description="Weights and shape of the reward.")

    @property
    def recordings(self) -> tuple[str, ...]:
        """The recordings that episodes are drawn from."""
        return (self.recording,) if isinstance(self.recording, str) else self.recording
