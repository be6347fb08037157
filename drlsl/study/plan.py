"""The plan of a study: its methods, seeds and tests, and the tasks that follow from them."""

import importlib.resources
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, ValidationError, model_validator

from drlsl.driving import EnvConfig, Section
from drlsl.driving.drivers import DRIVERS, KEEP, is_driver, make_driver
from drlsl.errors import UserError
from drlsl.files import parse_yaml, read_yaml, reason_of, to_yaml
from drlsl.learning import (
    PpoConfig,
    TrainConfig,
    make_config,
    merged,
    preset_names,
    preset_values,
    with_value,
)
from drlsl.study.paper import PaperMethod, PaperTest

Name = Annotated[str, Field(pattern=r"^[a-z0-9]+([._-][a-z0-9]+)*$", max_length=60)]
"""Names of methods and tests are parts of file names."""

US_101 = re.compile(r"us-?101", re.IGNORECASE)
"""Paths of recordings of the paper's third scenario."""


class MethodConfig(Section):
    """One way to train, or a driver that is not trained."""

    label: str = Field(min_length=1, description="Its label in the report.")
    train: dict[str, Any] = Field(
        default_factory=dict, description="Settings of the training, laid over the study's own."
    )
    paper: PaperMethod | None = Field(default=None, description="The method of the paper to compare with.")
    driver: str | None = Field(
        default=None,
        min_length=1,
        description="A driver of `drlsl eval` that is not trained, such as mobil; train then holds the "
        "settings of its env only.",
    )
    parameters: dict[str, Any] = Field(default_factory=dict, description="Parameters of the driver, by name.")
    ppo: PpoConfig | None = Field(
        default=None,
        description="Settings of masked PPO (extra sb3), which is then trained in the place of a DQN; {}: as "
        "they are by default.",
    )

    @model_validator(mode="after")
    def _is_trained_or_not(self) -> Self:
        if self.driver is None:
            if self.parameters:
                raise ValueError("parameters are those of a driver; give the driver, or leave them out")
            return self
        if self.ppo is not None:
            raise ValueError(f"driver {self.driver} is not trained: leave out ppo")
        if self.train.keys() - {"env"}:
            raise ValueError(f"driver {self.driver} is not trained: train may hold env only")
        if not (is_driver(self.driver) or self.driver.endswith(".zip")):
            known = ", ".join(DRIVERS)
            raise ValueError(
                f"no driver '{self.driver}'; expected {known}, FILE.py:NAME, MODULE:NAME or a .zip"
            )
        if self.driver in DRIVERS:
            try:
                make_driver(self.driver, self.parameters)
            except UserError as error:
                raise ValueError(str(error)) from error
        return self


class ScenarioConfig(Section):
    """Traffic to test every policy in, exactly as it was trained."""

    label: str = Field(min_length=1, description="Its label in the report.")
    recording: str | tuple[str, ...] = Field(
        description="As env.recording: a bundled recording's name or a path, or several to draw from."
    )
    direction: Literal["both", "left_to_right", "right_to_left"] = Field(
        default="both", description="As env.direction."
    )
    traffic: Literal["auto", "recorded", "reactive"] = Field(default="auto", description="As env.traffic.")
    paper: PaperTest | None = Field(default=None, description="The paper's scenario to compare with.")


class SweepConfig(Section):
    """A setting of the environment, such as a sensing fault, varied on top of one of the tests."""

    label: str = Field(min_length=1, description="Label of the setting in the report, with its unit.")
    test: Name = Field(
        description="The test that it varies, whose own result stands for the unchanged setting."
    )
    setting: str = Field(description="Key under env, such as sensing.latency.")
    values: tuple[float, ...] = Field(min_length=1, description="Values of the setting.")


class StudyConfig(Section):
    """Everything that determines what a study reports."""

    seeds: int = Field(default=3, ge=1, le=1_000, description="Trainings of each method, seeds 0, 1, …")
    preset: str = Field(default="paper", description="Preset of `drlsl train` that the trainings start from.")
    train: dict[str, Any] = Field(
        default_factory=dict, description="Settings of every training, laid over the preset."
    )
    methods: dict[Name, MethodConfig] = Field(min_length=1, description="Methods to compare, by name.")
    tests: dict[Name, ScenarioConfig] = Field(min_length=1, description="Traffic to test them in, by name.")
    sweeps: dict[Name, SweepConfig] = Field(
        default_factory=dict, description="Settings whose strength is varied in a test, by name."
    )
    evaluation_episodes: int = Field(
        default=50, ge=1, le=100_000, description="Episodes of each test, with the shield and without."
    )

    @model_validator(mode="after")
    def _trainings_are_valid(self) -> Self:
        if self.preset not in preset_names():
            raise ValueError(f"no preset '{self.preset}'; expected one of {', '.join(preset_names())}")
        for method in self.methods:
            try:
                training = self.training(Run(method, 0))
                if (ppo := self.methods[method].ppo) is not None:
                    ppo.check_fits(training)
            except UserError as error:
                raise ValueError(str(error)) from error
        return self

    @model_validator(mode="after")
    def _sweeps_are_valid(self) -> Self:
        for name, sweep in self.sweeps.items():
            if name in self.tests:
                raise ValueError(f"sweep {name}: there is a test of that name")
            if sweep.test not in self.tests:
                raise ValueError(f"sweep {name}: no test '{sweep.test}'; there are {', '.join(self.tests)}")
            try:
                self.sweep_envs(self.runs[0], name)
            except ValidationError as error:
                problem = error.errors()[0]
                raise ValueError(f"sweep {name}: env.{sweep.setting}: {reason_of(problem)}") from error
            trained = {self._trained_value(name, run) for run in self.runs[: len(self.methods)]}
            if len(trained) > 1:
                raise ValueError(f"sweep {name}: the methods were trained with unlike env.{sweep.setting}")
            known = self.trained_value(name)
            if known in sweep.values:
                raise ValueError(f"sweep {name}: {known:g} is what test '{sweep.test}' has; leave it out")
        return self

    @property
    def runs(self) -> list["Run"]:
        """Methods with every seed, seed by seed, so that an interrupted study can compare finished seeds."""
        return [Run(method, seed) for seed in range(self.seeds) for method in self.methods]

    @property
    def baseline(self) -> str | None:
        """The method whose time the others are compared with: the first that keeps its lane."""
        return next((name for name, method in self.methods.items() if method.driver == KEEP), None)

    @property
    def learnt(self) -> list[str]:
        """The names of the methods that are trained."""
        return [name for name, method in self.methods.items() if method.driver is None]

    @property
    def tasks(self) -> list["Task"]:
        """Every training, each followed by its tests and sweeps."""
        return [
            Task(run, test)
            for run in self.runs
            for test in (None, *self.tests, *self.sweeps)
            if test is not None or run.method in self.learnt
        ]

    def needs(self, task: "Task") -> "Task | None":
        """Return the task that must be done before."""
        trained = task.test is not None and task.run.method in self.learnt
        return Task(task.run) if trained else None

    def training(self, run: "Run") -> TrainConfig:
        """Return the configuration of a training.

        Raises:
            UserError: the settings do not make one.
        """
        values = merged(preset_values(self.preset), self.train)
        values = merged(values, self.methods[run.method].train)
        return make_config({**values, "seed": run.seed}, f"method {run.method}")

    def test_env(self, run: "Run", test: str) -> EnvConfig:
        """Return the environment of a test: that of the training in other traffic."""
        scenario = self.tests[test].model_dump(include={"recording", "direction", "traffic"})
        return EnvConfig.model_validate(self.training(run).env.model_dump() | scenario)

    def sweep_envs(self, run: "Run", sweep: str) -> dict[float, EnvConfig]:
        """Return the environments of a sweep, by the value of its setting; all else is as in its test."""
        config = self.sweeps[sweep]
        values = self.test_env(run, config.test).model_dump()
        return {
            value: EnvConfig.model_validate(with_value(values, config.setting, value))
            for value in config.values
        }

    def trained_value(self, sweep: str) -> float:
        """Return the value of a sweep's setting in its test, and in the training of every method."""
        return self._trained_value(sweep, self.runs[0])

    def _trained_value(self, sweep: str, run: "Run") -> float:
        config = self.sweeps[sweep]
        value: Any = self.test_env(run, config.test).model_dump()
        for key in config.setting.split("."):
            value = value[key]
        return float(value)

    def extends(self, other: "StudyConfig") -> bool:
        """Return whether this is the other study, perhaps with more seeds, methods, tests or sweeps."""
        same = {"preset", "train", "evaluation_episodes"}
        return (
            self.model_dump(include=same) == other.model_dump(include=same)
            and self.seeds >= other.seeds
            and _holds(self.methods, other.methods)
            and _holds(self.tests, other.tests)
            and _holds(self.sweeps, other.sweeps)
        )


@dataclass(frozen=True, slots=True, order=True)
class Run:
    """One training of a method."""

    method: str
    seed: int

    @property
    def name(self) -> str:
        """The name of its folder."""
        return f"{self.method}-seed{self.seed}"


@dataclass(frozen=True, slots=True)
class Task:
    """A piece of work for one process: a training, or the policy of one in a test or a sweep."""

    run: Run
    test: str | None = None

    @property
    def name(self) -> str:
        """The name of its files."""
        return self.run.name if self.test is None else f"{self.run.name}.{self.test}"


def study_presets() -> list[str]:
    """Return the names of the studies that ship with the package."""
    folder = importlib.resources.files("drlsl.study").joinpath("presets")
    return sorted(item.name.removesuffix(".yaml") for item in folder.iterdir() if item.name.endswith(".yaml"))


def preset_study(name: str) -> StudyConfig:
    """Return a study that ships with the package.

    Raises:
        UserError: there is none of this name.
    """
    if name not in study_presets():
        raise UserError.no_such("preset", name, study_presets())
    file = importlib.resources.files("drlsl.study").joinpath("presets", f"{name}.yaml")
    return make_study(parse_yaml(file.read_text("utf-8"), f"preset {name}").values, f"preset {name}")


def load_study(path: Path) -> StudyConfig:
    """Return a study from a YAML file.

    Raises:
        UserError: the file cannot be read, or is no valid study.
    """
    return make_study(read_yaml(path, "the study", "seeds: 3").values, str(path))


def make_study(values: Mapping[str, Any], source: str) -> StudyConfig:
    """Check values and make the frozen configuration; `source` names their origin in errors.

    Raises:
        UserError: a key is unknown or a value out of bounds.
    """
    try:
        return StudyConfig.model_validate(values)
    except ValidationError as error:
        problems = (
            f"{'.'.join(map(str, item['loc']))}: {reason_of(item)}".removeprefix(": ")
            for item in error.errors()
        )
        raise UserError(f"{source}: {'; '.join(problems)}") from error


def dump_study(study: StudyConfig) -> str:
    """Return the study as YAML that `load_study` reads back to an equal one."""
    return to_yaml(study.model_dump(mode="json"))


def with_changes(
    study: StudyConfig,
    *,
    seeds: int | None = None,
    episodes: int | None = None,
    methods: list[str] | None = None,
    tests: list[str] | None = None,
) -> StudyConfig:
    """Return the study with other seeds, episodes of training or methods, and with further tests.

    Raises:
        UserError: a method is unknown, a test's name is taken, or a number is out of bounds.
    """
    values = study.model_dump(mode="json")
    if seeds is not None:
        values["seeds"] = seeds
    if episodes is not None:
        values["train"] = {**values["train"], "episodes": episodes}
    if methods:
        unknown = [name for name in methods if name not in study.methods]
        if unknown:
            raise UserError(f"no method '{unknown[0]}': expected some of {', '.join(study.methods)}")
        values["methods"] = {name: values["methods"][name] for name in methods}
    for path in tests or []:
        name, scenario = scenario_of(path)
        known = study.tests.get(name)
        if known is not None and known != ScenarioConfig.model_validate(scenario):
            raise UserError(f"--test {path}: there is a test '{name}' already; give the path another name")
        values["tests"][name] = scenario
    return make_study(values, "command line")


def scenario_of(path: str) -> tuple[str, dict[str, Any]]:
    """Return the name and configuration of the test for a path: a recording, or a folder of NGSIM tables."""
    found = Path(path)
    tables = sorted(found.glob("*.csv")) if found.is_dir() else []
    several = bool(tables) and not any(re.match(r"\d+_tracks", table.name) for table in tables)
    recordings = [str(table.resolve()) for table in tables] if several else _absolute(path)
    name = re.sub(r"[^a-z0-9]+", "-", found.name.lower().partition(".")[0]).strip("-") or "test"
    scenario: dict[str, Any] = {"label": found.name, "recording": recordings}
    if US_101.search(found.name):
        scenario |= {"label": "NGSIM US-101", "paper": "ngsim"}
    return name, scenario


def _absolute(path: str) -> str:
    """Return an absolute path, valid in every folder; the name of a bundled recording is kept."""
    stem, mark, part = path.partition("#")
    return f"{Path(stem).resolve()}{mark}{part}" if Path(stem).exists() else path


def _holds(mine: Mapping[str, Any], theirs: Mapping[str, Any]) -> bool:
    return all(mine.get(name) == value for name, value in theirs.items())
