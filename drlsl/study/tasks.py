"""The tasks of a study: train, or drive a trained policy through a test."""

import importlib.util
import platform
from collections.abc import Callable, Iterator, Sequence
from importlib import metadata
from pathlib import Path
from time import perf_counter
from typing import Any

from drlsl.driving import EnvConfig, HighwayVectorEnv
from drlsl.driving.drivers import DRIVERS, Driver
from drlsl.driving.episodes import EpisodeRecorder, Origin
from drlsl.driving.shield import Shield
from drlsl.errors import UserError
from drlsl.files import digest
from drlsl.learning import (
    CHECKPOINT,
    MODEL,
    EpisodeSummary,
    NetworkConfig,
    Session,
    ShieldState,
    as_record,
    drive,
    factory_file,
    load_driver,
    load_policy,
    make_evaluation_env,
    require_masked_ppo,
    train_masked_ppo,
)
from drlsl.study.computer import processors
from drlsl.study.folder import StudyFolder
from drlsl.study.plan import Run, StudyConfig, Task
from drlsl.traffic import find_sources
from drlsl.version import __version__
from drlsl.workers import Stop

Perform = Callable[[Path, Task, Stop], None]
"""Performs a task of the study in a folder; once asked to stop, leaves it unfinished, to be resumed."""

SHIELDS: tuple[ShieldState, ...] = ("off", "on")

KEPT = 2
"""Episodes of a test with a contact at fault that are kept, for each policy with the shield and without."""

ORPHAN_S = 60.0
"""Time limit for the end of a process that still has the task of a killed study."""

PACKAGES = ("torch", "numpy", "gymnasium", "pandas")
"""Packages whose versions can change a result, as DRLSL's own can."""

PPO_PACKAGES = ("stable-baselines3", "sb3-contrib")
"""Packages that can change a training of masked PPO, too."""


def perform(root: Path, task: Task, stop: Stop) -> None:
    """Perform or resume a task; it is done when its result is in the folder.

    Raises:
        UserError: the recording or the rules cannot be used, or learning diverged.
    """
    if not (root.is_dir()):
        raise UserError(f"{root} is not on {platform.node()}: put the study where every node sees it")
    folder = StudyFolder.open(root)
    with folder.locked(task.name, wait_s=ORPHAN_S):
        if not folder.is_done(task):
            _train(folder, task, stop) if task.test is None else _test(folder, task, task.test, stop)


def inputs_of(study: StudyConfig) -> dict[str, Any]:
    """Return digests of all else that the results depend on: networks, rule programs, recordings.

    Raises:
        UserError: a network of the user's own or a package is not found, a rule file or a recording cannot be
            read, or the rules do not observe what they declare.
    """
    if any(method.ppo is not None for method in study.methods.values()):
        require_masked_ppo()
    digests: dict[str, str] = {}
    for method in {run.method: run for run in study.runs}.values():
        config = study.training(method)
        env = config.env
        digests |= _network_digests(config.network)
        digests |= _driver_digests(study.methods[method.method].driver)
        digests |= _rule_digests(env)
        digests |= _recording_digests(env.recordings)
    for test in study.tests:
        digests |= _recording_digests(study.test_env(study.runs[0], test).recordings)
    return {"digests": digests}


def _train(folder: StudyFolder, task: Task, stop: Stop) -> None:
    root, config = folder.run_path(task.run), folder.study.training(task.run)
    ppo = folder.study.methods[task.run.method].ppo
    if ppo is not None:
        trained = train_masked_ppo(root, config, ppo, stop)
        if trained is not None:
            folder.finish(task, {**_maker(*PPO_PACKAGES), "metrics": trained.sync_metrics()})
        return
    if (root / CHECKPOINT).is_file():
        folder.run(task.run)
        session = Session.resume(root)
    else:
        # Killed before its first checkpoint, a run has nothing to resume from.
        session = Session.start(root, config, force=root.exists())
    with session:
        for _ in session.run(stop):
            pass
        if session.trainer.finished == config.episodes:
            session.draw_figures()
            folder.finish(task, {**_maker(), "metrics": session.folder.sync_metrics()})


def _test(folder: StudyFolder, task: Task, test: str, stop: Stop) -> None:
    """Drive a policy through a test, or through a sweep, whose records have the value of its setting."""
    study = folder.study
    envs: list[tuple[dict[str, float], EnvConfig]]
    plain = test not in study.sweeps
    if test in study.sweeps:
        envs = [({"value": value}, env) for value, env in study.sweep_envs(task.run, test).items()]
    else:
        envs = [({}, study.test_env(task.run, test))]
    records = []
    started = perf_counter()
    for setting, config in envs:
        for record in _evaluations(folder, task, config, stop, keep=plain):
            records.append({**setting, **record})
        if stop():
            return
    folder.finish(task, {**_maker(), "wall_s": perf_counter() - started, "evaluations": records})


def _evaluations(
    folder: StudyFolder, task: Task, config: EnvConfig, stop: Stop, *, keep: bool
) -> Iterator[dict[str, Any]]:
    """Yield the records of a policy in one environment, shield off and on; ends early once asked to stop.

    `keep`: whether to keep the first contacts at fault as episodes.
    """
    run = task.run
    env = make_evaluation_env(config)
    driver = _driver(folder, run, env)
    for shield in SHIELDS:
        summaries = []
        for summary in drive(
            env, driver, shield=shield, episodes=folder.study.evaluation_episodes, seed=run.seed
        ):
            summaries.append(summary)
            if stop():
                return
        if keep:
            _keep_contacts(folder, task, env, driver, shield, summaries)
        yield as_record(summaries, env=config.model_dump(mode="json"), shield=shield, seed=run.seed)


def _keep_contacts(
    folder: StudyFolder,
    task: Task,
    env: HighwayVectorEnv,
    driver: Driver,
    shield: ShieldState,
    summaries: Sequence[EpisodeSummary],
) -> None:
    """Drive the first episodes with a contact at fault again, and keep them."""
    worst = [number for number, one in enumerate(summaries, start=1) if one.contact and one.at_fault][:KEPT]
    if not worst:
        return
    run, method = task.run, folder.study.methods[task.run.method]
    wants = "Q-values" if method.driver is None and method.ppo is None else "preferences"
    origin = Origin.of(env.config, env.shield, method.label, wants, enforced=shield == "on", seed=run.seed)
    recorder = EpisodeRecorder(env.world, origin, lambda one: folder.add_contact(task, shield, one))
    env.watch = recorder.watch
    try:
        for _ in drive(
            env, driver, shield=shield, episodes=len(worst), seed=run.seed, recorder=recorder, only=worst
        ):
            pass
    finally:
        env.watch = None


def _driver(folder: StudyFolder, run: Run, env: HighwayVectorEnv) -> Driver:
    """Return what a training has led to, or the driver of a method without one."""
    method = folder.study.methods[run.method]
    if method.driver is not None:
        return load_driver(method.driver, env, method.parameters)
    trained = folder.run(run)
    return load_policy(trained, env) if method.ppo is None else load_driver(str(trained.root / MODEL), env)


def _network_digests(config: NetworkConfig) -> dict[str, str]:
    """Return the digest of the file that defines the user's own network, if there is one."""
    if config.built_in:
        return {}
    return {f"network {config.factory}": digest([factory_file(config.factory)])}


def _driver_digests(name: str | None) -> dict[str, str]:
    """Return the digest of the file of a user's own driver, if there is one."""
    if name is None or name in DRIVERS:
        return {}
    path = Path(name.rpartition(":")[0] or name)
    if path.suffix not in (".py", ".zip"):
        module = importlib.util.find_spec(str(path))
        if module is None or module.origin is None:
            raise UserError(f"driver {name}: there is no module {path}")
        path = Path(module.origin)
    if not path.is_file():
        raise UserError(f"driver {name}: no file {path} in {Path.cwd()}")
    return {f"driver {name}": digest([path])}


def _rule_digests(env: EnvConfig) -> dict[str, str]:
    """Return the digests of the rule program's files, by name."""
    return {f"rules/{path.name}": digest([path]) for path in Shield.from_files(env.rules).files()}


def _recording_digests(recordings: Sequence[str]) -> dict[str, str]:
    sources = [source for name in recordings for source in find_sources(name)]
    return {f"recording {source.name}": digest(list(source.files)) for source in sources}


def _maker(*packages: str) -> dict[str, Any]:
    """Return the machine and the versions that made a result, those of further `packages` among them."""
    found = versions() | {name: metadata.version(name) for name in packages}
    return {"machine": processors(), "python": platform.python_version(), "packages": found}


def versions() -> dict[str, str]:
    """Return the versions of the packages that can change a result."""
    return {"drlsl": __version__, **{name: metadata.version(name) for name in PACKAGES}}
