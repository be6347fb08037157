"""Labelled actions: episodes by chance, and a verdict on each action in each state on the way."""

from __future__ import annotations

import itertools
import json
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from drlsl.errors import UserError
from drlsl.files import parse_json, read_text, write_atomic
from drlsl.induction.environments.futures import FUTURES, Episode, OnceFutures, Way
from drlsl.induction.environments.lookahead import Lookahead, Verdict
from drlsl.induction.environments.plain_facts import PlainFacts, of_json
from drlsl.induction.environments.state_bias import StateBias
from drlsl.workers import Crew, Function, Stop, in_order

BLOCK: Final = 4
"""Episodes that are labelled, or judge, in one piece of work."""


@dataclass(frozen=True, slots=True)
class LabelledActions:
    """N actions: the facts of the state in which each was tried, its name, its label and its origin.

    `failures` of the `episodes`; `left_out` counts the actions without a label, by reason.
    """

    facts: tuple[PlainFacts, ...]
    action: tuple[str, ...]
    unsafe: tuple[bool, ...]
    origin: tuple[str, ...]
    episodes: int = 0
    failures: int = 0
    left_out: Mapping[str, int] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.action)

    def as_json(self) -> dict[str, Any]:
        """Return them as a file has them: each state once."""
        states = list(dict.fromkeys(self.facts))
        place = {facts: number for number, facts in enumerate(states)}
        return {
            "states": states,
            "rows": [
                [place[facts], *rest]
                for facts, *rest in zip(self.facts, self.action, self.unsafe, self.origin, strict=True)
            ],
            "episodes": self.episodes,
            "failures": self.failures,
            "left_out": dict(self.left_out),
        }

    @classmethod
    def of_json(cls, values: dict[str, Any]) -> LabelledActions:
        """Return what a file has."""
        states = [of_json(one) for one in values["states"]]
        rows = values["rows"]
        return cls(
            tuple(states[row[0]] for row in rows),
            tuple(row[1] for row in rows),
            tuple(row[2] for row in rows),
            tuple(row[3] for row in rows),
            values["episodes"],
            values["failures"],
            values["left_out"],
        )

    @classmethod
    def joined(cls, parts: Sequence[LabelledActions]) -> LabelledActions:
        """Return several, one after another."""
        left_out: Counter[str] = Counter()
        for part in parts:
            left_out.update(part.left_out)
        return cls(
            tuple(one for part in parts for one in part.facts),
            tuple(one for part in parts for one in part.action),
            tuple(one for part in parts for one in part.unsafe),
            tuple(one for part in parts for one in part.origin),
            sum(part.episodes for part in parts),
            sum(part.failures for part in parts),
            dict(left_out),
        )

    def first(self, count: int) -> LabelledActions:
        """Return the first so many of them."""
        return LabelledActions(
            self.facts[:count],
            self.action[:count],
            self.unsafe[:count],
            self.origin[:count],
            self.episodes,
            self.failures,
            self.left_out,
        )


def lookahead_in(episode: Episode, way: Way) -> tuple[Any, Lookahead]:
    """Return the futures of an episode, and the verdicts by them."""
    domain = episode.named.domain
    futures = FUTURES[way](episode)
    if domain.draws == 1 and not futures.exact:
        futures = OnceFutures(episode, futures)
    actions = [domain.actions[name] for name in domain.preferred]
    return futures, Lookahead(futures, actions, domain.horizon)


def label_episode(bias: StateBias, way: Way, seed: int) -> LabelledActions:
    """Drive an episode by chance, and label each action in each state of it.

    In episodes with an odd seed one is careful: an action is drawn among those that are safe, if there are.

    Raises:
        UserError: the environment, or a function of the domain, raised an error.
    """
    named = bias.named
    episode = Episode(named, seed)
    futures, lookahead = lookahead_in(episode, way)
    rng = np.random.default_rng([seed, 1])
    rows: list[tuple[PlainFacts, str, bool, str]] = []
    left_out: Counter[str] = Counter()
    end = "goes_on"
    while end == "goes_on":
        facts, state = episode.facts(), futures.here()
        safe = []
        for place in bias.available(facts):
            name = bias.choices[place]
            verdict = lookahead.verdict(state, named.domain.actions[name])
            if verdict == Verdict.CUT:
                left_out["cut short"] += 1
                continue
            where = f"seed {seed}, decision {len(episode.taken) + 1}"
            rows.append((facts, name, verdict == Verdict.UNSAFE, where))
            safe += [name] * (verdict == Verdict.SAFE)
        names = safe if safe and seed % 2 else bias.choices
        end = episode.step(named.domain.actions[names[int(rng.integers(len(names)))]])
    facts_of, action, unsafe, origin = zip(*rows, strict=True) if rows else ((), (), (), ())
    return LabelledActions(facts_of, action, unsafe, origin, 1, int(end == "failed"), dict(left_out))


def labelled_actions(
    name: str,
    way: Way,
    count: int,
    folder: Path,
    *,
    seed: int,
    crew: Crew,
    progress: Callable[[int], None],
) -> LabelledActions:
    """Return `count` labelled actions; blocks of episodes are kept in `folder`, and read again from there.

    Raises:
        UserError: there is no action to label, or none is unsafe.
    """
    parts = list(_kept(folder))
    label = partial(_labelling, name, way, seed)
    blocks = in_order(crew.perform(label, itertools.count(len(parts)), files=StateBias.of(name).own_files))
    while sum(map(len, parts)) < count:
        part = next(blocks)
        if not len(part):
            raise UserError("no action could be labelled in some episodes; is action/1 true of any?")
        write_atomic(_file(folder, len(parts)), json.dumps(part.as_json(), separators=(",", ":")).encode())
        parts.append(part)
        progress(min(count, sum(map(len, parts))))
    found = LabelledActions.joined(parts).first(count)
    if not any(found.unsafe):
        raise UserError(
            f"none of {len(found):,} actions was unsafe in {found.episodes:,} episodes, of which "
            f"{found.failures} failed; see whether failed(step) tells failures, or give a longer horizon"
        )
    return found


def _kept(folder: Path) -> Iterator[LabelledActions]:
    """Yield the blocks that an earlier call has left."""
    for number in itertools.count():
        path = _file(folder, number)
        if not path.is_file():
            return
        yield LabelledActions.of_json(parse_json(read_text(path), path.name))


def _file(folder: Path, number: int) -> Path:
    return folder / f"labels-{number:04d}.json"


def _labelling(name: str, way: Way, seed: int) -> Function[int, LabelledActions]:
    """Return the function that labels a block of episodes."""
    bias = StateBias.of(name)

    def label(number: int, _stop: Stop) -> LabelledActions:
        first = seed + number * BLOCK
        episodes = [label_episode(bias, way, one) for one in range(first, first + BLOCK)]
        return LabelledActions.joined(episodes)

    return label
