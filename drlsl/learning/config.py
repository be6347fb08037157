"""The configuration of a training run: its schema, and reading and writing it as YAML."""

import difflib
import importlib.resources
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BaseModel,
    Field,
    JsonValue,
    ValidationError,
    field_validator,
    model_validator,
)
from pydantic_core import ErrorDetails

from drlsl.driving import EnvConfig, Section
from drlsl.errors import UserError
from drlsl.files import YamlFile, parse_yaml, read_yaml, reason_of, section_of, setting_path, shown, to_yaml

Method = Literal["dqn", "mpsdqn", "dqnsl"]
Bootstrap = Literal["all", "safe"]
Device = Literal["auto", "cpu", "cuda"]
Precision = Literal["float32", "bfloat16"]
OFFERS: Mapping[Method, tuple[str, ...]] = {
    "dqn": ("rules", "all"),
    "mpsdqn": ("prediction",),
    "dqnsl": ("rules",),
}
"""Values of env.offers that a method allows."""

BUILT_IN = ("mlp", "dueling")
"""Built-in networks, which need no user function."""

OWN_FACTORY = re.compile(r"(?:.*\.py|[^\W\d]\w*(?:\.[^\W\d]\w*)*):[^\W\d]\w*")
"""Name of a user's function: by its file, or by its module."""

EXAMPLE = "episodes: 100"
"""Words for the kinds of a configuration's values in errors."""

LIKE_ENOUGH = 0.7
"""Similarity from which on an unknown key counts as a misspelt known one."""

Rate = Annotated[float, Field(gt=0.0, le=1.0)]
Probability = Annotated[float, Field(ge=0.0, le=1.0)]
Width = Annotated[int, Field(ge=1, le=4096)]


class NetworkConfig(Section):
    """The Q-network.

    Source: paper, Network and Hyperparameters.
    """

    factory: str = Field(
        default="mlp",
        description="What makes the network: mlp (fully connected layers, as in the paper), dueling, or a "
        "function of your own as FILE.py:FUNCTION or PACKAGE.MODULE:FUNCTION.",
    )
    arguments: dict[str, JsonValue] = Field(
        default_factory=dict, description="Keyword arguments for a function of your own."
    )
    window: int = Field(
        default=1,
        ge=1,
        le=64,
        description="Observations that the network sees: the latest and those before it.",
    )
    hidden: tuple[Width, ...] = Field(
        default=(256, 256),
        min_length=1,
        max_length=8,
        description="Width of each hidden layer of mlp and dueling; a ReLU follows each.",
    )
    noisy: bool = Field(
        default=False,
        description="Explore by noise in the weights, whose size is learnt, instead of random actions; ε is "
        "then 0.",
    )

    @property
    def built_in(self) -> bool:
        """True if the network is one of DRLSL's own."""
        return self.factory in BUILT_IN

    @field_validator("factory")
    @classmethod
    def _factory_has_a_name(cls, name: str) -> str:
        if name not in BUILT_IN and not OWN_FACTORY.fullmatch(name):
            raise ValueError(f"expected {', '.join(BUILT_IN)}, FILE.py:FUNCTION or PACKAGE.MODULE:FUNCTION")
        return name

    @model_validator(mode="after")
    def _arguments_have_a_function(self) -> Self:
        if self.built_in and self.arguments:
            raise ValueError(f"arguments are for a function of your own, and the factory is {self.factory}")
        return self


class LearningConfig(Section):
    """The Q-learning update and its replay memory.

    Source: paper, Algorithm 1 and Network and Hyperparameters.
    """

    discount: float = Field(default=0.95, ge=0, lt=1, description="Discount factor of the next reward.")
    batch_size: int = Field(default=128, ge=1, le=65_536, description="Transitions in a minibatch.")
    replay_capacity: int = Field(
        default=100_000, ge=1, le=10_000_000, description="Transitions kept; the oldest is overwritten."
    )
    learning_starts: int = Field(
        default=128,
        ge=1,
        description="Transitions held before the first update; from then on one update per step.",
    )
    target_every: int = Field(
        default=1_000,
        ge=1,
        description="Updates from one copy of the network into the target network to the next.",
    )
    bootstrap: Bootstrap = Field(
        default="safe",
        description="Actions that the target's maximum runs over: all, as in Algorithm 1, "
        "or those that are offered in the next state (safe).",
    )

    precision: Literal[Precision, "auto"] = Field(
        default="float32",
        description="Type of the numbers that learning multiplies between hidden layers; weights and acting "
        "are of float32 in any case. auto: bfloat16 where the processor multiplies that faster.",
    )

    overlap: bool = Field(
        default=False,
        description="Learn in a second thread while the environments drive, for two processors; an action "
        "then rests on weights without the updates of the step before.",
    )

    @model_validator(mode="after")
    def _sizes_fit(self) -> Self:
        if not self.batch_size <= self.learning_starts <= self.replay_capacity:
            raise ValueError(
                "expected batch_size <= learning_starts <= replay_capacity, "
                f"got {self.batch_size}, {self.learning_starts} and {self.replay_capacity}"
            )
        return self


class ScheduleConfig(Section):
    """Linear decay of the learning rate and the exploration rate, one step of it per episode.

    Source: paper, Network and Hyperparameters.
    """

    learning_rate_start: Rate = Field(default=0.01, description="Adam's learning rate in the first episode.")
    learning_rate_end: Rate = Field(default=1e-4, description="Adam's learning rate once the decay is over.")
    epsilon_start: Probability = Field(
        default=0.1, description="Chance of a random action in the first episode."
    )
    epsilon_end: Probability = Field(
        default=0.001, description="Chance of a random action once the decay is over."
    )
    fraction: Rate = Field(
        default=1.0,
        description="Share of the training's episodes that the decay takes; after it the end values stay.",
    )


class EvaluationConfig(Section):
    """Evaluation of a trained policy."""

    episodes: int = Field(default=50, ge=1, le=100_000, description="Episodes of `drlsl eval`.")
    episodes_after_training: int = Field(
        default=10,
        ge=0,
        le=100_000,
        description="Episodes of the short evaluation that ends `drlsl train`; 0: none.",
    )
    recording: str | None = Field(
        default=None,
        min_length=1,
        description="Recording of that evaluation; none: that of the training.",
    )
    beside: tuple[str, ...] = Field(
        default=(),
        description="Drivers that are shown beside the policy in it, behind the shield: keep, always-change, "
        "mobil, oracle, FILE.py:NAME or PACKAGE.MODULE:NAME.",
    )


class TrainConfig(Section):
    """Everything that determines the outcome of a training run; the defaults are the paper's values."""

    method: Method = Field(
        default="dqnsl",
        description="Actions that the agent chooses from: all (dqn), those that a linear prediction finds "
        "safe (mpsdqn) or those that the rules do (dqnsl).",
    )
    episodes: int = Field(default=1_500, ge=1, le=10_000_000, description="Episodes of training.")
    seed: int = Field(
        default=0,
        ge=0,
        lt=2**63,
        description="Seed of all that is random: weights, exploration, minibatches, episodes.",
    )
    num_envs: int = Field(
        default=1,
        ge=1,
        le=1_024,
        description="Environments driven in step; each of their steps is followed by one update. "
        "One is the paper's loop, several are faster.",
    )
    device: Device = Field(
        default="auto", description="Where the network lives; auto: CUDA if PyTorch finds it."
    )
    threads: int = Field(
        default=1,
        ge=1,
        le=256,
        description="PyTorch's CPU threads; with a network this small one is fastest.",
    )
    checkpoint_every: int = Field(default=25, ge=1, description="Episodes from one checkpoint to the next.")
    env: EnvConfig = Field(default_factory=EnvConfig, description="The environment.")
    network: NetworkConfig = Field(default_factory=NetworkConfig, description="The Q-network.")
    learning: LearningConfig = Field(
        default_factory=LearningConfig, description="The update and the replay memory."
    )
    schedule: ScheduleConfig = Field(
        default_factory=ScheduleConfig, description="Decay of learning rate and exploration."
    )
    evaluation: EvaluationConfig = Field(
        default_factory=EvaluationConfig, description="Evaluation of the policy."
    )

    @model_validator(mode="before")
    @classmethod
    def _prediction_for_mpsdqn(cls, values: Any) -> Any:
        """Default env.offers to "prediction" for mpsdqn."""
        if isinstance(values, Mapping) and values.get("method") == "mpsdqn":
            env = values.get("env", {})
            if isinstance(env, Mapping):
                return {**values, "env": {"offers": "prediction", **env}}
        return values

    @model_validator(mode="after")
    def _method_fits_what_is_offered(self) -> Self:
        expected = OFFERS[self.method]
        if self.env.offers not in expected:
            raise ValueError(
                f"method {self.method} needs env.offers {' or '.join(expected)}, not {self.env.offers}"
            )
        return self


class PpoConfig(Section):
    """Masked PPO of sb3-contrib, in the place of a DQN.

    The road, the seed, the episodes, the environments side by side, the discount and the width of the layers
    are those of a `TrainConfig`. Source of the defaults without a reason: Stable-Baselines3.
    """

    steps: int = Field(
        default=64,
        ge=2,
        description="Decisions of each environment between two updates; fewer than the 2,048 of "
        "Stable-Baselines3, so that a training of some 10,000 decisions has updates enough.",
    )
    batch_size: int = Field(default=128, ge=2, description="Decisions in a minibatch.")
    epochs: int = Field(default=10, ge=1, description="Passes over the decisions in an update.")
    learning_rate: float = Field(
        default=1e-3, gt=0, le=1, description="Adam's learning rate; higher, for the same reason."
    )
    gae_lambda: float = Field(
        default=0.95, ge=0, le=1, description="λ of the generalized advantage estimation."
    )
    clip_range: float = Field(default=0.2, gt=0, description="Bound of a change of a probability's ratio.")
    entropy: float = Field(
        default=0.01, ge=0, description="Weight of the entropy in the loss, which keeps it exploring."
    )

    def check_fits(self, config: TrainConfig) -> None:
        """Check that a training can be of masked PPO.

        Raises:
            UserError: it offers all actions, or has another network than fully connected layers.
        """
        if config.method == "dqn":
            raise UserError("ppo: it chooses among what is offered; method is dqnsl or mpsdqn, not dqn")
        network = config.network
        if network.factory != "mlp" or network.window != 1 or network.noisy:
            raise UserError("ppo: its network has fully connected layers; of network only hidden may be set")


def preset_names() -> list[str]:
    """Return the names of the configurations that ship with the package."""
    folder = importlib.resources.files("drlsl.learning").joinpath("presets")
    return sorted(item.name.removesuffix(".yaml") for item in folder.iterdir() if item.name.endswith(".yaml"))


def preset_values(name: str) -> dict[str, Any]:
    """Return the values that a shipped configuration sets.

    Raises:
        UserError: there is no such preset.
    """
    known = preset_names()
    if name not in known:
        raise UserError.no_such("preset", name, known)
    text = importlib.resources.files("drlsl.learning").joinpath("presets", f"{name}.yaml").read_text("utf-8")
    return parse_yaml(text, f"preset {name}").values


def load_config(path: Path) -> TrainConfig:
    """Read a training configuration from a YAML file; settings that are not in it keep their defaults.

    Raises:
        UserError: the file cannot be read, is not YAML, or holds an unknown key or a bad value.
    """
    file = read_yaml(path, "the configuration", EXAMPLE)
    return make_config(file.values, file.name, file)


def make_config(values: Mapping[str, Any], source: str, file: YamlFile | None = None) -> TrainConfig:
    """Check values and make the frozen configuration; `source` and `file` locate them in errors.

    Raises:
        UserError: a key is unknown (the message names the nearest known one) or a value is out of bounds.
    """
    unknown = [
        f"{_where(source, file, path)}unknown key '{path}'{_nearest_key(path)}"
        for path in _unknown_keys(TrainConfig, values)
    ]
    if unknown:
        raise UserError("; ".join(unknown))
    try:
        return TrainConfig.model_validate(values)
    except ValidationError as error:
        raise UserError("; ".join(_explain(item, source, file) for item in error.errors())) from error


def with_value(values: Mapping[str, Any], path: str, value: object) -> dict[str, Any]:
    """Return a copy of nested values with one of them, named by its dotted path, replaced."""
    head, _, rest = path.partition(".")
    if not rest:
        return {**values, head: value}
    below = values.get(head)
    return {**values, head: with_value(below if isinstance(below, Mapping) else {}, rest, value)}


def merged(base: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """Return the nested values of `base`, updated with those of `over`."""
    result = dict(base)
    for key, value in over.items():
        below = result.get(key)
        both = isinstance(below, Mapping) and isinstance(value, Mapping)
        result[key] = merged(below, value) if both else value  # type: ignore[arg-type]  # narrowed by `both`
    return result


def dump_yaml(config: TrainConfig) -> str:
    """Return the complete configuration as YAML that `load_config` reads back to an equal one."""
    return to_yaml(config.model_dump(mode="json"))


def describe_keys(model: type[BaseModel] = TrainConfig, path: str = "") -> Iterator[tuple[str, str]]:
    """Yield dotted path and description of each setting, in order."""
    for name, field in model.model_fields.items():
        section = section_of(field.annotation)
        if section is None:
            yield f"{path}{name}", field.description or ""
        else:
            yield from describe_keys(section, f"{path}{name}.")


def _unknown_keys(model: type[BaseModel], values: Mapping[Any, Any], path: str = "") -> Iterator[str]:
    for key, value in values.items():
        if key not in model.model_fields:
            yield f"{path}{key}"
            continue
        section = section_of(model.model_fields[key].annotation)
        if section is not None and isinstance(value, Mapping):
            yield from _unknown_keys(section, value, f"{path}{key}.")


def _nearest_key(path: str) -> str:
    """Return a hint at the known key most similar to `path`, in any section, or at all of the same name."""
    keys = [name for name, _ in describe_keys()]
    alike = [repr(name) for name in keys if name.rpartition(".")[2] == path.rpartition(".")[2]]
    if alike:
        return f"; did you mean {' or '.join(alike)}?"
    sections = {name.rpartition(".")[0] for name in keys} - {""}

    def likeness(name: str) -> tuple[float, float]:
        return _ratio(name.rpartition(".")[2], path.rpartition(".")[2]), _ratio(name, path)

    best = max([*keys, *sorted(sections)], key=likeness)
    if likeness(best)[0] < LIKE_ENOUGH:
        return "; `drlsl train --print-config` shows the known keys"
    return f"; did you mean '{best}'?"


def _ratio(one: str, other: str) -> float:
    return difflib.SequenceMatcher(None, one, other).ratio()


def _explain(problem: ErrorDetails, source: str, file: YamlFile | None) -> str:
    path = setting_path(TrainConfig, problem["loc"])
    value = problem["input"]
    got = "" if isinstance(value, Mapping | BaseModel) else f", got {shown(value)}"
    return f"{_where(source, file, path)}{path}: {reason_of(problem)}{got}"


def _where(source: str, file: YamlFile | None, path: str) -> str:
    """Return where a value was given: the nearest enclosing key in the file."""
    position = None if file is None else file.position(path.split("."))
    return f"{source}: " if position is None else f"{source}:{position[0]}:{position[1]}: "
