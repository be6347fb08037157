"""Tables of scenes of driving, with the expected answers of the rules."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final, Literal

from pydantic import Field

from drlsl.assurance.case_rows import EgoRow, Layout, RoadRow, Staging, VehicleRow
from drlsl.assurance.checks import Case, Check, Equals, Holds, Nearest, Observed, Offered
from drlsl.assurance.driving_rules import ACTIONS, COMFORT, ENTRY, FRONT, LANE, OBSERVATION, SPEED
from drlsl.assurance.table_rows import ASKED_BASE, AskedRow, TableForm, goal_checks, opposed, table_rows
from drlsl.assurance.tested_rules import Question
from drlsl.driving.scene import EGO, Action
from drlsl.errors import UserError
from drlsl.files import Location, YamlFile, read_yaml
from drlsl.traffic import Direction

ActionWord = Literal["keep", "left", "right"]
Section = Literal["front", "front_right", "right", "back_right", "back", "back_left", "left", "front_left"]

_ACTIONS: Final = {
    "keep": Action.LANE_KEEPING.atom,
    "left": Action.LEFT_LANE_CHANGE.atom,
    "right": Action.RIGHT_LANE_CHANGE.atom,
}
_FORM: Final = TableForm(
    "scenes",
    "scene",
    ("road", "ego", "vehicles", "directions", *ASKED_BASE),
    apart=("ahead", "behind", "offset"),
)


class SceneRow(AskedRow):
    """One scene with its answers."""

    scene: str
    directions: Literal["both", "left_to_right", "right_to_left"] = "both"
    road: RoadRow = RoadRow()
    ego: EgoRow = EgoRow()
    vehicles: dict[str, VehicleRow | None] = Field({})
    actions: list[ActionWord] | None = None
    target_speed: float | None = None
    comfortable_acceleration: float | None = None
    front_is_free: bool | None = None
    entry_is_safe: bool | None = None
    lane_to_keep: Literal["left", "own", "right"] | int | None = None
    observation: dict[str, float] | None = None
    sections: dict[Section, str | None] | None = None
    objections: dict[ActionWord, list[str]] | None = None


def load_table(path: Path, observed: Sequence[str]) -> list[Case]:
    """Return the cases of a table of scenes; `observed` are the names of the numbers of `state/1`.

    Raises:
        UserError: the file cannot be read or does not describe scenes; the message names file, line and key.
    """
    return scene_cases(read_yaml(path, example="scenes:"), observed)


def scene_cases(file: YamlFile, observed: Sequence[str]) -> list[Case]:
    """Return the cases of a table of scenes; `observed` are the names of the numbers of `state/1`.

    Raises:
        UserError: the file does not describe scenes; the message names file, line and key.
    """
    return [
        case
        for row in table_rows(file, _FORM)
        for case in _cases(file, row.checked(file, SceneRow), row.own, tuple(observed))
    ]


def _cases(file: YamlFile, row: SceneRow, place: Location, observed: tuple[str, ...]) -> Iterator[Case]:
    """Yield the case of a row in each direction of travel."""
    where = f"{file.name}:{file.line(place)}"
    if EGO in row.vehicles:
        raise file.error([*place, "vehicles", EGO], f"vehicles: {EGO!r} is the ego's own name")
    for name in row.observation or ():
        if name not in observed:
            known = f"the rules observe {', '.join(observed)}"
            raise file.error([*place, "observation", name], f"observation.{name}: {known}")
    vehicles = {name: vehicle for name, vehicle in row.vehicles.items() if vehicle is not None}
    asked = row.model_fields_set - {"scene", "row", *_FORM.base}
    if not asked:
        raise file.error(place, f"{row.scene}: expects nothing; give actions, target_speed, goals …")
    for direction in Direction:
        if row.directions not in ("both", direction.value):
            continue
        staging = Staging(row.road, row.ego, vehicles, direction)
        try:
            scene = staging.state()
            checks = tuple(_checks(row, direction, observed))
        except ValueError as error:
            raise UserError(f"{where}: {row.scene}: {error}") from error
        name = " / ".join(filter(None, (row.scene, row.row)))
        yield Case(where, f"{name} ({direction.value})", scene, checks, row.fails, staging)


def _checks(row: SceneRow, direction: Direction, observed: tuple[str, ...]) -> Iterator[Check]:
    if row.actions is not None:
        wanted = tuple(_ACTIONS[word] for word in row.actions)
        yield Offered("actions", ACTIONS, wanted)
    if row.target_speed is not None:
        yield Equals("target_speed", SPEED, row.target_speed, row.tolerance)
    if row.comfortable_acceleration is not None:
        yield Equals("comfortable_acceleration", COMFORT, row.comfortable_acceleration, row.tolerance)
    for question, holds in ((FRONT, row.front_is_free), (ENTRY, row.entry_is_safe)):
        if holds is not None:
            yield Holds(question.goal, question, holds)
    if row.lane_to_keep is not None:
        layout = Layout(row.road, direction)
        lane = layout.lane_id(layout.number(row.lane_to_keep, layout.number(row.ego.lane, 0)))
        yield Equals("lane_to_keep", LANE, lane, 0.0)
    if row.observation:
        yield Observed("observation", OBSERVATION, observed, tuple(row.observation.items()), row.tolerance)
    if row.sections:
        yield from _section_checks(row.sections)
    for side, reasons in (row.objections or {}).items():
        question = Question(f"objection({_ACTIONS[side]}, Reason)", "all")
        yield opposed(f"objections {side}", question, reasons, row.tolerance)
    yield from goal_checks(row)


def _section_checks(sections: Mapping[Section, str | None]) -> Iterator[Check]:
    question = Question("busy_section(Section, Car, Gap)", "all")
    yield Nearest("sections", question, tuple(sections.items()))
    for section, car in sections.items():
        for word, holds in (("busy", car is not None), ("free", car is None)):
            goal = f"{section}_is_{word}"
            yield Holds(goal, Question(goal, "holds"), holds)
