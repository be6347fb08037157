"""Tables of scenes with expected answers, as a rule author writes them beside the rules."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeAlias

from pydantic import Field

from drlsl.assurance.case_rows import EgoRow, Layout, RoadRow, Row, Staging, VehicleRow
from drlsl.assurance.checked_values import checked
from drlsl.assurance.checks import (
    ACTIONS,
    COMFORT,
    ENTRY,
    FRONT,
    LANE,
    OBSERVATION,
    SPEED,
    Case,
    Check,
    Equals,
    Holds,
    Nearest,
    Observed,
    Offered,
    Opposed,
    Question,
    Solves,
)
from drlsl.driving.scene import EGO, Action
from drlsl.errors import UserError
from drlsl.files import YamlFile, read_yaml
from drlsl.traffic import Direction

ActionWord = Literal["keep", "left", "right"]
Section = Literal["front", "front_right", "right", "back_right", "back", "back_left", "left", "front_left"]
Bindings: TypeAlias = dict[str, Any]

SUFFIX: Final = ".test.yaml"
TOLERANCE: Final = 0.001

_ACTIONS: Final = {
    "keep": Action.LANE_KEEPING.atom,
    "left": Action.LEFT_LANE_CHANGE.atom,
    "right": Action.RIGHT_LANE_CHANGE.atom,
}
_BASE: Final = ("road", "ego", "vehicles", "tolerance", "directions")


class CaseRow(Row):
    """One scene with its answers: the keys of the file, of the scene and of the row, merged."""

    scene: str
    row: str | None = None
    directions: Literal["both", "left_to_right", "right_to_left"] = "both"
    tolerance: Annotated[float, Field(ge=0)] = TOLERANCE
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
    goals: dict[str, bool | Bindings | list[Bindings]] | None = None
    fails: str | None = None


def tables_of(rules: Sequence[Path]) -> list[Path]:
    """Return the tables beside rule files: `highway.test.yaml` and `highway.*.test.yaml` for highway.pl."""
    return [
        table
        for rule in rules
        for table in sorted(rule.parent.glob(f"{rule.stem}*{SUFFIX}"))
        if table.name[len(rule.stem)] == "."
    ]


def load_table(path: Path, observed: Sequence[str]) -> list[Case]:
    """Return the cases of a table; `observed` are the names of the numbers of `state/1`.

    Raises:
        UserError: the file cannot be read or does not describe scenes; the message names file, line and key.
    """
    file = read_yaml(path, example="scenes:")
    unknown = [key for key in file.values if key not in (*_BASE, "scenes")]
    if unknown:
        raise file.error(
            unknown[:1], f"{unknown[0]} is not a key of a table; expected scenes, {', '.join(_BASE)}"
        )
    scenes = file.values.get("scenes")
    if not isinstance(scenes, list) or not scenes:
        raise file.error(["scenes"], "scenes: expected a list of scenes")
    base = {key: value for key, value in file.values.items() if key in _BASE}
    return [
        case
        for index, scene in enumerate(scenes)
        for case in _scene_cases(file, base, index, scene, tuple(observed))
    ]


def _scene_cases(
    file: YamlFile, base: Mapping[str, Any], index: int, scene: object, observed: tuple[str, ...]
) -> Iterator[Case]:
    place: list[int | str] = ["scenes", index]
    if not isinstance(scene, dict):
        raise file.error(place, "expected a scene: keys such as scene, ego, vehicles, actions")
    rows = scene.get("rows")
    below = laid_over(base, {key: value for key, value in scene.items() if key != "rows"})
    if rows is None:
        yield from _cases(file, _checked_row(file, below, place, place), place, observed)
        return
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise file.error([*place, "rows"], "rows: expected a list of overrides of this scene")
    for number, row in enumerate(rows):
        own = [*place, "rows", number]
        yield from _cases(file, _checked_row(file, laid_over(below, row), place, own), own, observed)


def _checked_row(
    file: YamlFile, values: Mapping[str, Any], scene: Sequence[int | str], own: Sequence[int | str]
) -> CaseRow:
    _refuse_cut_goals(file, values.get("goals"), own)
    return checked(file, CaseRow, values, [], scene, own)


def laid_over(base: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """Return the nested values of `base` updated by `over`; a vehicle's place along the road is one value."""
    result = dict(base)
    for key, value in over.items():
        below = result.get(key)
        if not isinstance(below, dict) or not isinstance(value, dict) or key == "goals":
            result[key] = {**below, **value} if key == "goals" and isinstance(below, dict) else value
            continue
        if value.keys() & _PLACES:
            below = {name: item for name, item in below.items() if name not in _PLACES}
        result[key] = laid_over(below, value)
    return result


_PLACES: Final = {"ahead", "behind", "offset"}


def _cases(
    file: YamlFile, row: CaseRow, place: Sequence[int | str], observed: tuple[str, ...]
) -> Iterator[Case]:
    """Yield the case of a row in each direction of travel."""
    where = f"{file.name}:{file.line(place)}"
    if EGO in row.vehicles:
        raise file.error([*place, "vehicles", EGO], f"vehicles: {EGO!r} is the ego's own name")
    for name in row.observation or ():
        if name not in observed:
            known = f"the rules observe {', '.join(observed)}"
            raise file.error([*place, "observation", name], f"observation.{name}: {known}")
    vehicles = {name: vehicle for name, vehicle in row.vehicles.items() if vehicle is not None}
    asked = row.model_fields_set - {"scene", "row", *_BASE}
    if not asked:
        raise file.error(place, f"{row.scene}: expects nothing; give actions, target_speed, goals …")
    for direction in Direction:
        if row.directions not in ("both", direction.value):
            continue
        staging = Staging(row.road, row.ego, vehicles, direction)
        try:
            scene = staging.scene()
            checks = tuple(_checks(row, direction, observed))
        except ValueError as error:
            raise UserError(f"{where}: {row.scene}: {error}") from error
        name = " / ".join(filter(None, (row.scene, row.row)))
        yield Case(where, f"{name} ({direction.value})", scene, checks, row.fails, staging)


def _checks(row: CaseRow, direction: Direction, observed: tuple[str, ...]) -> Iterator[Check]:
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
        yield Opposed(f"objections {side}", question, tuple(reasons))
    for goal, expected in (row.goals or {}).items():
        yield _goal_check(goal, expected, row.tolerance)


def _section_checks(sections: Mapping[Section, str | None]) -> Iterator[Check]:
    question = Question("busy_section(Section, Car, Gap)", "all")
    yield Nearest("sections", question, tuple(sections.items()))
    for section, car in sections.items():
        for word, holds in (("busy", car is not None), ("free", car is None)):
            goal = f"{section}_is_{word}"
            yield Holds(goal, Question(goal, "holds"), holds)


def _refuse_cut_goals(file: YamlFile, goals: object, place: Sequence[int | str]) -> None:
    """Refuse a goal that YAML cut at a comma because it had no quotes."""
    for goal, answer in goals.items() if isinstance(goals, dict) else ():
        if answer is None:
            hint = "; between braces a goal with a comma needs quotes" if "(" in str(goal) else ""
            raise file.error([*place, "goals", goal], f"goals: {goal} has no answer{hint}")


def _goal_check(goal: str, expected: bool | Bindings | list[Bindings], tolerance: float) -> Check:
    if isinstance(expected, bool):
        return Holds(goal, Question(goal, "holds"), expected)
    rows = [expected] if isinstance(expected, dict) else expected
    return Solves(goal, Question(goal, "all"), tuple(rows), tolerance)
