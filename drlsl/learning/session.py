"""A training run in its folder: starting, resuming and finishing it."""

import shlex
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, Self

from gymnasium.vector import AutoresetMode

from drlsl import driving
from drlsl.driving.shield import PAPER_OBSERVATION
from drlsl.errors import UserError
from drlsl.files import FolderLock, digests, refuse_while_loading
from drlsl.learning.checkpoint import load_state, save_state
from drlsl.learning.config import NetworkConfig, TrainConfig, make_config, merged, preset_values
from drlsl.learning.figures import write_training_figures
from drlsl.learning.fleet import HasSpaces, VectorHighway
from drlsl.learning.network import Policy
from drlsl.learning.network_factory import Factory, factory_name
from drlsl.learning.rundir import RunFolder
from drlsl.learning.tensorboard import TensorBoardLog, require_tensorboard
from drlsl.learning.trainer import StepEvent, Trainer, make_learner, resolve_device


class Session(AbstractContextManager["Session"]):
    """A trainer and the run folder that records it, locked against others until it is closed.

    As a context manager it is closed at the end.
    """

    def __init__(self, folder: RunFolder, trainer: Trainer, lock: FolderLock, *, tensorboard: bool) -> None:
        self.folder = folder
        self.trainer = trainer
        self.root = folder.root
        """The run folder."""
        self.config = folder.config
        """The settings of the training."""
        self.episodes = folder.config.episodes
        """Number of episodes from the first to the last."""
        self._lock = lock
        self._log = TensorBoardLog(folder) if tensorboard else None
        self.saved_steps = trainer.total_steps
        """The step after which the last checkpoint was written."""

    @classmethod
    def start(
        cls, root: Path, config: TrainConfig, *, force: bool = False, tensorboard: bool = False
    ) -> Self:
        """Begin a new run; the folder is made only once the environment and the learner exist.

        `tensorboard`: whether to write event files for TensorBoard, too.

        Raises:
            UserError: the environment cannot be made, the folder is occupied or used by another process, or
                TensorBoard is not installed.
        """
        if tensorboard:
            require_tensorboard()
        trainer = Trainer(make_training_env(config), config)
        return cls.begin(root, trainer, config, force=force, tensorboard=tensorboard)

    @classmethod
    def begin(
        cls, root: Path, trainer: Trainer, config: TrainConfig, *, force: bool, tensorboard: bool
    ) -> Self:
        """Begin a new run of a trainer that has not trained yet; see `start`.

        Raises:
            UserError: the folder is occupied or used by another process.
        """
        folder = RunFolder.create(root, config, force=force)
        session = cls(folder, trainer, folder.lock(), tensorboard=tensorboard)
        session.checkpoint()
        return session

    @classmethod
    def resume(cls, root: Path, *, tensorboard: bool = False) -> Self:
        """Resume a run from its last checkpoint; metrics rows after it are dropped, to be made again.

        Event files for TensorBoard are continued if there are any; `tensorboard` begins them otherwise, with
        the episodes so far.

        Raises:
            UserError: there is no run, another process is training it, its files are inconsistent, or
                TensorBoard is not installed and asked for.
        """
        folder = RunFolder.open(root)
        tensorboard = tensorboard or folder.tensorboard.is_dir()
        if tensorboard:
            require_tensorboard()
        lock = folder.lock()
        try:
            return cls._resumed(folder, lock, tensorboard)
        except BaseException:
            lock.release()
            raise

    @classmethod
    def _resumed(cls, folder: RunFolder, lock: FolderLock, tensorboard: bool) -> Self:
        state = load_state(folder.checkpoint, "checkpoint")
        if make_config(state["config"], f"{folder.checkpoint}") != folder.config:
            raise UserError(
                f"{folder.root}: config.yaml was changed after the checkpoint; undo that, or use --force"
            )
        trainer = Trainer(make_training_env(folder.config), folder.config)
        _check_observation(folder, folder.checkpoint, state, trainer.observes)
        _check_rules(folder, state, trainer.rule_digests)
        try:
            trainer.set_state(state["trainer"])
        except ValueError as error:
            raise UserError(f"{folder.checkpoint}: {error}") from error
        folder.keep_metrics(trainer.done(), state.get("metrics"))
        session = cls(folder, trainer, lock, tensorboard=tensorboard)
        # A run that was killed between the two has the weights of the previous checkpoint.
        session._save_policy()
        return session

    @property
    def finished(self) -> int:
        """Number of finished episodes."""
        return self.trainer.finished

    @property
    def total_steps(self) -> int:
        """Number of steps so far."""
        return self.trainer.total_steps

    @property
    def runs(self) -> tuple["Session", ...]:
        """The runs that are trained: this one."""
        return (self,)

    def close(self) -> None:
        """Write what is left, and unlock the folder."""
        if self._log is not None:
            self._log.close()
        self._lock.release()

    def __exit__(self, *exception: object) -> None:
        self.close()

    def run(self, stop: Callable[[], bool] = lambda: False) -> Iterator[StepEvent]:
        """Train, recording each episode; once `stop` holds, the run ends with the current step.

        A checkpoint is written every few episodes, at the end and on `stop`.
        """
        for event in self.trainer.run():
            stopping = stop()
            self.record(event, save=stopping)
            yield event
            if stopping:
                return

    def record(self, event: StepEvent, *, save: bool) -> None:
        """Record the episodes that ended; a checkpoint is written if one is due, or with `save`."""
        for episode in event.ended:
            row = self.folder.append_metrics(episode)
            if self._log is not None:
                self._log.add(row)
        if save or any(_checkpoint_is_due(self.config, episode.finished) for episode in event.ended):
            self.checkpoint()

    def checkpoint(self) -> None:
        """Write the whole state of the learner, then the weights separately."""
        trainer = self.trainer
        state = {
            "config": self.folder.config.model_dump(mode="json"),
            "metrics": self.folder.sync_metrics(),
            "observes": list(trainer.observes),
            "rules": dict(trainer.rule_digests),
            "trainer": trainer.get_state(),
        }
        save_state(self.folder.checkpoint, "checkpoint", state)
        self._save_policy()
        self.saved_steps = trainer.total_steps

    def _save_policy(self) -> None:
        trainer = self.trainer
        state = {
            "episodes": trainer.finished,
            "network": trainer.agent.network.get_state(),
            "observes": list(trainer.observes),
            "made_by": self.folder.config.network.model_dump(mode="json"),
            "rules": dict(trainer.rule_digests),
        }
        save_state(self.folder.policy, "policy", state)

    def draw_figures(self) -> list[Path]:
        """Write the training figures of the episodes so far."""
        return write_training_figures({self.folder.config.method: self.folder.metrics()}, self.folder.figures)


def load_policy(folder: RunFolder, env: HasSpaces) -> Policy:
    """Return the policy of a run's last checkpoint, for an environment with the same spaces.

    Raises:
        UserError: the weights are missing, damaged, or of another network than config.yaml describes, that
            network cannot be made here, or the policy observes other numbers than the environment gives.
    """
    state = load_state(folder.policy, "policy")
    config = folder.config
    # Missing in files from before there were other networks than fully connected ones.
    made_by = state.get("made_by")
    if made_by is not None and NetworkConfig.model_validate(made_by) != config.network:
        raise UserError(f"{folder.policy}: the weights do not fit the network of config.yaml")
    _check_observation(folder, folder.policy, state, env.observation_names)
    agent, _ = make_learner(env.single_observation_space, env.single_action_space, config)
    try:
        agent.network.set_state(state["network"])
    except ValueError as error:
        raise UserError(f"{folder.policy}: {error}") from error
    return Policy(agent.network, resolve_device(config.device), config.network.window)


def _check_observation(
    folder: RunFolder, path: Path, state: Mapping[str, Any], given: tuple[str, ...]
) -> None:
    """Check that the rules give what an agent observes; files from before name nothing: the paper's numbers.

    Raises:
        UserError: they give other numbers; the message names the rules to judge the agent with.
    """
    observes = tuple(state.get("observes", PAPER_OBSERVATION.names))
    if observes == given:
        return
    lacking = [name for name in observes if name not in given]
    if lacking:
        problem = f"the agent observes {lacking[0]}, which the rules do not give"
    elif len(observes) != len(given):
        problem = f"the agent observes {len(observes)} numbers, the rules give {len(given)}"
    else:
        problem = "the agent observes what the rules give, but in another order"
    rules = folder.config.env.rules
    if observes == PAPER_OBSERVATION.names:
        rules = (*rules, "paper_observation.pl")
    flags = " ".join(f"--rules {shlex.quote(file)}" for file in rules or ("highway.pl",))
    judged = f"`drlsl eval {shlex.quote(str(folder.root))} {flags}`"
    if path == folder.policy:
        raise UserError(f"{path}: {problem}; judge it with {judged}")
    raise UserError(
        f"{path}: {problem}; {judged} judges it, and to train on, begin again with {flags} --force"
    )


def _check_rules(folder: RunFolder, state: Mapping[str, Any], given: Mapping[str, str]) -> None:
    """Check that the rules are those of the checkpoint; files from before tell nothing of them.

    Raises:
        UserError: they are not.
    """
    if changed := _changed(state, given):
        raise UserError(
            f"{folder.root}: the rules were changed after the checkpoint: {', '.join(changed)}; "
            "put them back as they were, or begin again with --force"
        )


def changed_rules(folder: RunFolder, env: VectorHighway) -> list[str]:
    """Return the names of the rule files that are not as they were when the policy was trained.

    Policies from before tell nothing of their rules: none.

    Raises:
        UserError: the weights are missing or damaged.
    """
    return _changed(load_state(folder.policy, "policy"), digests(env.rule_files()))


def _changed(state: Mapping[str, Any], given: Mapping[str, str]) -> list[str]:
    """Return the names of the rule files that differ from those of a state."""
    held = state.get("rules", given)
    return sorted(name for name in {*held, *given} if held.get(name) != given.get(name))


def make_training_env(config: TrainConfig) -> VectorHighway:
    """Return the environments of a training.

    Raises:
        UserError: the recording or the rules cannot be used.
    """
    discount = config.learning.discount
    return driving.make_vec(config.env, config.num_envs, AutoresetMode.DISABLED, discount=discount)


def _checkpoint_is_due(config: TrainConfig, finished: int) -> bool:
    return finished % config.checkpoint_every == 0 or finished == config.episodes


def train(
    out: str | Path,
    *,
    network: str | Factory | Mapping[str, Any] | None = None,
    preset: str = "quick",
    force: bool = False,
    tensorboard: bool = False,
    **settings: Any,
) -> RunFolder:
    """Train from the first episode to the last, as `drlsl train` does, and return the run's folder.

    Args:
        out: the new run folder.
        network: mlp, dueling, or a function or class at the top level of a file that makes a torch.nn.Module
            of the numbers of observed values and of actions; or the settings of a network, with such a
            `factory` among them.
        preset: the settings to start from.
        force: whether an earlier run in `out` is replaced.
        tensorboard: whether to write event files for TensorBoard, too.
        settings: any others, such as `episodes=100, env={"recording": "freeway"}`.

    Raises:
        UserError: a setting, the network or the environment cannot be used, or the folder is occupied.
    """
    refuse_while_loading("a training")
    values = merged(merged(preset_values(preset), settings), {"network": _plain_settings(network)})
    config = make_config(values, "train()")
    with Session.start(Path(out), config, force=force, tensorboard=tensorboard) as session:
        for _ in session.run():
            pass
        session.draw_figures()
        return session.folder


def _plain_settings(network: str | Factory | Mapping[str, Any] | None) -> dict[str, Any]:
    """Return the settings of a network as in a file: a function by its name."""
    if isinstance(network, Mapping):
        factory = network.get("factory")
        return {**network, **(_plain_settings(factory) if factory is not None else {})}
    if network is None:
        return {}
    return {"factory": network if isinstance(network, str) else factory_name(network)}
