"""The domain of an environment's actions, for the loop of learning."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

from drlsl.induction.domain import Effort, Examined, Progress, Tell, Trial, unseen
from drlsl.induction.environments.action_examples import ActionExamples
from drlsl.induction.environments.futures import Episode, way_back
from drlsl.induction.environments.labelled_actions import LabelledActions, labelled_actions
from drlsl.induction.environments.plain_facts import of_json
from drlsl.induction.environments.rule_stress import rule_stress
from drlsl.induction.environments.state_bias import StateBias
from drlsl.induction.environments.stress_outcome import BadAction
from drlsl.induction.learnt_file import FileForm
from drlsl.shield import NamedActions, program_files
from drlsl.workers import ALONE, Crew

ROUND_SEEDS: Final = 10_000
"""Seeds of a round: those of labels begin at 0, those of round n at n times this."""

HELD_OUT_SEEDS: Final = 1_000_000
"""The first seed of the episodes that judge, from which nothing is learnt."""


@dataclass(frozen=True, slots=True)
class EnvRequest:
    """A request to learn in an environment: the domain's name, how much to label and to drive, the search.

    None is what the domain says is usual.
    """

    domain: str
    examples: int | None = None
    episodes: int | None = None
    effort: Effort = field(default_factory=Effort)
    seed: int = 0
    crew: Crew = ALONE


class EnvironmentDomain:
    """The actions of an environment, labelled by looking ahead."""

    def __init__(self, request: EnvRequest, progress: Progress = unseen) -> None:
        """Load the domain and its program, and try whether it can be labelled.

        `progress` shows how far what takes long is.

        Raises:
            UserError: it cannot be.
            PrologError: the bias is not a valid program.
        """
        self._request, self._progress = request, progress
        self.bias: Final = StateBias.of(request.domain)
        self.named: Final = self.bias.named
        self.effort: Final = request.effort
        domain = self.named.domain
        episode = Episode(self.named, request.seed)
        NamedActions.of(episode.env.action_space, domain.actions)
        self.bias.values(episode.facts())
        self.way: Final = way_back(self.named, request.seed)
        self._examples = request.examples or domain.examples
        self._episodes = request.episodes or domain.episodes

    @property
    def form(self) -> FileForm:
        """The words of the file of learnt rules around its clauses."""
        return self.bias.form

    def settings(self) -> dict[str, Any]:
        """Return all that the rounds depend on, the text of the program among it."""
        effort = asdict(self.effort)
        del effort["rounds"]
        total = hashlib.sha256()
        for file in self._files():
            total.update(file.read_bytes())
        return {
            "domain": self._request.domain,
            "horizon": self.named.domain.horizon,
            "draws": self.named.domain.draws,
            "examples": self._examples,
            "episodes": self._episodes,
            **effort,
            "seed": self._request.seed,
            "files": total.hexdigest()[:32],
        }

    def _files(self) -> list[Path]:
        """Return the files of the program, and that of the domain."""
        place = Path(self._request.domain.rpartition(":")[0])
        return [file for file in (*program_files(self.bias.engine), place) if file.is_file()]

    def label(self, folder: Path, tell: Tell) -> list[LabelledActions]:
        """Return labelled actions; they are kept in the folder of the rounds."""
        domain = self.named.domain
        means = {
            "table": "by its table of chances",
            "copies": "by trying them in copies of it",
            "replays": "by playing the episodes again",
        }[self.way]
        tell(
            f"labelling {self._examples:,} actions in {self.named.name}, {means}, {domain.horizon} decisions "
            "ahead"
        )
        found = labelled_actions(
            self.named.name,
            self.way,
            self._examples,
            folder,
            seed=self._request.seed,
            crew=self._request.crew,
            progress=lambda count: self._progress("labelling", count, self._examples),
        )
        left = ", ".join(f"{count:,} {why}" for why, count in sorted(found.left_out.items()))
        tell(
            f"{found.episodes:,} episodes, {found.failures:,} of which failed: {len(found):,} actions, "
            f"{sum(found.unsafe):,} unsafe; left out: {left or 'none'}"
        )
        return [found]

    def left_out(self, parts: Sequence[LabelledActions]) -> dict[str, dict[str, int]]:
        """Return how many actions have no label, by reason."""
        return {self.named.name: dict(LabelledActions.joined(parts).left_out)}

    def examples(self, parts: Sequence[LabelledActions], bad: Sequence[BadAction]) -> ActionExamples:
        """Return the actions of some parts, and bad ones as unsafe."""
        rows = LabelledActions.joined(parts)
        return ActionExamples(
            self.bias,
            [*rows.facts, *(one.facts for one in bad)],
            [*rows.action, *(one.action for one in bad)],
            [*rows.unsafe, *(True for _ in bad)],
            [*rows.origin, *(one.origin for one in bad)],
        )

    def examine(self, trial: Trial, tell: Tell) -> Examined:
        """Drive behind the learnt rules, and look back from each failure."""
        tell(f"round {trial.number}: driving up to {self._episodes:,} episodes")
        found = rule_stress(
            self.named.name,
            self.way,
            trial.rules,
            trial.clauses,
            episodes=self._episodes,
            seed=self._request.seed + trial.number * ROUND_SEEDS,
            crew=self._request.crew,
            progress=lambda count: self._progress("driving", count, self._episodes),
        )
        return Examined({self.named.name: asdict(found.counts)}, {}, found.bad, found.counts.unexplained)

    def is_clean(self, stress: Mapping[str, Any]) -> bool:
        """Return whether no failure came from what was learnt to be safe, and the rules never failed."""
        return stress["failures"] == stress["unexplained"] and not stress["fail_safes"]

    def words(self, name: str, stress: Mapping[str, Any]) -> str:
        """Return the failures in a few words."""
        return (
            f"{name} {stress['failures']:,} failures in {stress['episodes']:,} episodes, "
            f"{stress['unexplained']:,} where nothing was learnt to be safe"
        )

    def sentence(self, name: str, stress: Mapping[str, Any]) -> str:
        """Return what happened behind the rules."""
        share = stress["not_learnt"] / max(1, stress["decisions"])
        return (
            f"stress in {name}: {stress['episodes']:,} episodes, {stress['decisions']:,} decisions, in "
            f"{share:.0%} of which nothing was learnt to be safe; {stress['failures']:,} failures, "
            f"{stress['unexplained']:,} where nothing was learnt to be safe"
        )

    def bad_as_json(self, bad: BadAction) -> dict[str, Any]:
        """Return a bad action as a file of a round has it."""
        return asdict(bad)

    def bad_of_json(self, values: dict[str, Any], place: str) -> BadAction:
        """Return the bad action that a file has."""
        return BadAction(of_json(values["facts"]), values["action"], values["origin"])
