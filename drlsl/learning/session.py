"""A training run from its folder: started, gone on with, and finished."""

from collections.abc import Callable, Iterator
from pathlib import Path

from drlsl import driving
from drlsl.config import TrainConfig, make_config
from drlsl.errors import UserError
from drlsl.learning.checkpoint import load_state, save_state
from drlsl.learning.episode import Highway
from drlsl.learning.figures import write_training_figures
from drlsl.learning.network import Policy, QNetwork
from drlsl.learning.rundir import RunFolder
from drlsl.learning.trainer import EpisodeEvent, StepEvent, Trainer, make_learner, resolve_device


class Session:
    """A trainer and the run folder that records it."""

    def __init__(self, folder: RunFolder, env: Highway, trainer: Trainer) -> None:
        self.folder = folder
        self.env = env
        self.trainer = trainer
        self.saved_episode = trainer.episode
        """The episode after which the last checkpoint was written."""

    @classmethod
    def start(cls, root: Path, config: TrainConfig, *, force: bool = False) -> "Session":
        """Begin a new run; the folder is made only once the environment and the learner stand.

        Raises:
            UserError: the environment cannot be made, or the folder is occupied.
        """
        env = driving.make_env(config.env)
        trainer = Trainer(env, config)
        session = cls(RunFolder.create(root, config, force=force), env, trainer)
        session.checkpoint()
        return session

    @classmethod
    def resume(cls, root: Path) -> "Session":
        """Go on with a run from its last checkpoint; metrics rows after it are dropped, to be made again.

        Raises:
            UserError: there is no run, or its files do not fit one another.
        """
        folder = RunFolder.open(root)
        state = load_state(folder.checkpoint, "checkpoint")
        if make_config(state["config"], f"{folder.checkpoint}") != folder.config:
            raise UserError(
                f"{root}: config.yaml was changed after the checkpoint; undo that, or use --force"
            )
        env = driving.make_env(folder.config.env)
        trainer = Trainer(env, folder.config)
        trainer.set_state(state["trainer"])
        folder.truncate_metrics(trainer.episode)
        return cls(folder, env, trainer)

    def run(self, stop: Callable[[], bool] = lambda: False) -> Iterator[StepEvent | EpisodeEvent]:
        """Train on, recording each episode; once `stop` holds, the run ends with the episode in hand.

        A checkpoint is written every few episodes, at the end and on `stop`. It holds no environment, so it
        is only ever taken between two episodes.
        """
        config, trainer = self.folder.config, self.trainer
        for event in trainer.run():
            if isinstance(event, EpisodeEvent):
                self.folder.append_metrics(event)
                stopping = stop()
                due = event.episode % config.checkpoint_every == 0 or event.episode == config.episodes
                if due or stopping:
                    self.checkpoint()
                yield event
                if stopping:
                    return
            else:
                yield event

    def checkpoint(self) -> None:
        """Write the whole state of the learner, then the weights by themselves."""
        self.folder.sync_metrics()
        config = self.folder.config.model_dump(mode="json")
        trainer = self.trainer
        save_state(self.folder.checkpoint, "checkpoint", {"config": config, "trainer": trainer.get_state()})
        network = trainer.agent.network.state_dict()
        save_state(self.folder.policy, "policy", {"episode": trainer.episode, "network": network})
        self.saved_episode = trainer.episode

    def draw_figures(self) -> list[Path]:
        """Write the training figures of the episodes so far."""
        return write_training_figures({self.folder.config.method: self.folder.metrics()}, self.folder.figures)


def load_policy(folder: RunFolder, env: Highway) -> Policy:
    """The policy of a run as its last checkpoint left it, for an environment with the same spaces.

    Raises:
        UserError: the weights are missing, damaged, or of another network than config.yaml describes.
    """
    state = load_state(folder.policy, "policy")
    agent, _ = make_learner(env, folder.config)
    network: QNetwork = agent.network
    try:
        network.load_state_dict(state["network"])
    except RuntimeError as error:
        raise UserError(f"{folder.policy}: the weights do not fit the network of config.yaml") from error
    return Policy(network, resolve_device(folder.config.device))
