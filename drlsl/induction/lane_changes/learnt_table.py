"""The table of a learnt program: scenes on both sides of each limit, and what mutants need."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import yaml

from drlsl.assurance import EgoRow, RoadRow, Score, Staging, VehicleRow
from drlsl.driving.scene import Action, SceneBatch
from drlsl.driving.shield import Shield
from drlsl.induction.lane_changes.change_examples import ChangeExamples
from drlsl.induction.lane_changes.scene_bias import SIDES, Side
from drlsl.induction.lane_changes.told_scene import accelerations, faster, moves, simplified, staged
from drlsl.induction.learnt_file import FixedLimit, fixed_limits
from drlsl.induction.noticing_table import TableDraft, write_noticing_table
from drlsl.induction.search_problem import LearntClause
from drlsl.traffic import Direction
from drlsl.workers import ALONE, Crew

_ROADS: Final = """\
  - scene: nobody else on the road
    ego: {lane: 2}
    rows:
      - {row: middle lane, actions: [keep, left, right], objections: {left: [], right: []}}
      - {row: right lane, ego: {lane: 1}, actions: [keep, left], objections: {right: [no_lane]}}
      - {row: left lane, ego: {lane: 3}, actions: [keep, right], objections: {left: [no_lane]}}
      - row: on the way to the left
        ego: {target: left}
        actions: [keep]
        objections: {right: [changing_lanes], left: [changing_lanes]}
      - row: on the way to the right
        ego: {target: right}
        actions: [keep]
        objections: {right: [changing_lanes], left: [changing_lanes]}
"""

_FINEST: Final = 0.01
"""How far from a limit the nearer of two scenes stands [m, m/s]."""

_FASTER: Final = (0.0, 10.0, 20.0)
"""How much faster all drive in scenes near a limit, if the example itself cannot be moved to it [m/s]."""

NOT_FOUND: Final = (
    "No scene near those of the table was found in which it differs: the example that fixes the limit is not "
    "near it, or another clause decides there."
)


class LearntTable:
    """Makes the rows of a table for the clauses in a rule file."""

    def __init__(self, rules: Path, clauses: Sequence[LearntClause], examples: ChangeExamples) -> None:
        self._rules, self._clauses, self._examples = rules, clauses, examples
        self._bias = examples.scene_bias
        self._shield = Shield.from_files([rules], tier="scalar")

    def text(self) -> str:
        """Return the table."""
        head = f"# Scenes that fix the limits of {self._rules.name}; written by drlsl rules learn."
        return f"{head}\n\nscenes:\n\n{_ROADS}" + "".join(self._scenes())

    def _scenes(self) -> Iterator[str]:
        for limit in fixed_limits(self._clauses, self._examples):
            rows = None if limit.example is None else list(self._rows(limit))
            if not rows:
                continue
            assert limit.example is not None
            one = self._bias.quantities[limit.quantity]
            yield f"\n  # clause {limit.clause + 1}; {self._examples.words(limit.example)}\n"
            yield f"  - scene: '{one.bound(limit.ease)}'\n"
            yield "    rows:\n"
            side = SIDES[int(self._examples.choice[limit.example])]
            for words, scene in rows:
                yield f"      - {self._row(words, scene, side)}\n"

    def _rows(self, limit: FixedLimit) -> Iterator[tuple[str, Staging]]:
        """Yield the scene that fixes a limit, and one on either side of the limit, if they are found."""
        assert limit.example is not None
        side = int(self._examples.choice[limit.example])
        scene = staged(self._examples.scenes.scene(limit.example))
        if scene is None or not self._leaves_out(scene, side, limit):
            return
        scene = simplified(scene, lambda other: self._leaves_out(other, side, limit))
        yield "the example", scene
        for speed in _FASTER:
            near = faster(scene, speed)
            for change in (moves, accelerations):
                found = self._crossing(near, side, limit, change)
                if found is not None:
                    yield "just not", found[0]
                    yield "just", found[1]
                    return

    def _leaves_out(self, scene: Staging, side: int, limit: FixedLimit) -> bool:
        """Return whether only this limit of the clause leaves it out, and no other clause offers it."""
        violated = self._violated(scene, side)
        return violated is not None and violated[limit.clause] == {limit.quantity} and all(violated)

    def _violated(self, scene: Staging, side: int) -> list[set[int]] | None:
        """Return the quantities that each clause finds too hard.

        None if the lane change is not possible, or if rounding makes a difference between the two directions.
        """
        if not self._possible(scene, side):
            return None
        try:
            batch = SceneBatch.of([replace(scene, direction=one).state() for one in Direction])
        except ValueError:
            return None
        eases = self._bias.eases(self._bias.values(batch)[:, side])
        one, other = (
            [
                {q for q, limit in enumerate(clause.limits) if limit is not None and row[q] < limit}
                for clause in self._clauses
            ]
            for row in eases
        )
        return one if one == other else None

    def _possible(self, scene: Staging, side: int) -> bool:
        """Return whether only the openings could speak against the lane change."""
        lanes = scene.road.lanes if isinstance(scene.road.lanes, int) else len(scene.road.lanes)
        wanted = scene.ego.lane + (1 if SIDES[side] == "left" else -1)
        return 1 <= wanted <= lanes and abs(scene.ego.shift) < scene.road.centre_tolerance

    def _crossing(
        self,
        scene: Staging,
        side: int,
        limit: FixedLimit,
        change: Callable[[Staging, float], Iterator[Staging]],
    ) -> tuple[Staging, Staging] | None:
        """Return the last scene that the limit leaves out and the first one that it does not."""
        for number in range(len(list(change(scene, 1.0)))):

            def at(amount: float, number: int = number) -> Staging:
                return list(change(scene, amount))[number]

            def meets(amount: float, at: Callable[[float], Staging] = at) -> bool:
                violated = self._violated(at(amount), side)
                return violated is not None and not violated[limit.clause]

            far = next((float(step) for step in range(1, 40) if meets(float(step))), None)
            if far is None:
                continue
            low, high = round((far - 1.0) / _FINEST), round(far / _FINEST)
            while high - low > 1:
                middle = (low + high) // 2
                low, high = (low, middle) if meets(middle * _FINEST) else (middle, high)
            for nearest in (low, low - 1, low - 2):
                before = at(nearest * _FINEST)
                if self._leaves_out(before, side, limit):
                    return before, at(high * _FINEST)
        return None

    def _row(self, words: str, scene: Staging, side: Side) -> str:
        """Return a row of the table, with the actions that the rules offer, and why not to this side."""
        told: dict[str, Any] = {"row": words, **yaml.safe_load(scene.row())}
        del told["directions"]
        told["actions"] = _actions(scene, self._shield)
        told["objections"] = {side: [] if side in told["actions"] else ["no_opening"]}
        return _flow(told)


def _flow(row: dict[str, Any]) -> str:
    return yaml.safe_dump(row, default_flow_style=True, width=math.inf, sort_keys=False).strip()


def _actions(scene: Staging, shield: Shield) -> list[str]:
    """Return the actions that the rules offer, as a table has them."""
    words = {Action.LANE_KEEPING: "keep", Action.LEFT_LANE_CHANGE: "left", Action.RIGHT_LANE_CHANGE: "right"}
    return [words[action] for action in sorted(shield.decide(scene.state()).safe_actions)]


def _expecting(row: str, shield: Shield) -> str:
    """Return a row that a witness gave, with the actions that the rules offer."""
    told = yaml.safe_load(row)
    vehicles = {name: VehicleRow(**car) for name, car in told.get("vehicles", {}).items()}
    ego, road = EgoRow(**told.get("ego", {})), RoadRow(**told.get("road", {}))
    scene = Staging(road, ego, vehicles, Direction(told["directions"]))
    return _flow({**told, "actions": _actions(scene, shield)})


def write_table(
    rules: Path, clauses: Sequence[LearntClause], examples: ChangeExamples, *, crew: Crew = ALONE
) -> Score:
    """Write the table of learnt rules beside them, and the reasons of the mutants that it cannot notice.

    Rows that notice surviving mutants are added, as far as they are found.

    Raises:
        UserError: a file cannot be written.
    """
    shield = Shield.from_files([rules])
    draft = TableDraft(
        text=LearntTable(rules, clauses, examples).text(),
        subject="scene",
        asked="safe_actions",
        expecting=lambda row: _expecting(row, shield),
        learnt="opening/1",
        not_found=NOT_FOUND,
    )
    return write_noticing_table(rules, draft, crew=crew)
