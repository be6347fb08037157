"""Episodes as arrays, with a header in JSON: what their files hold.

Every array but `header` is described by `Episode`. Reasons are rows: `reason_begin` (T + 1,) has the rows of
each frame, `reason_kind` indexes the header's `reason_kinds`, and `reason_arguments` (R, M) has a number, or
the index of a name in the header's `atoms`, for each letter of the kind.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from drlsl.driving.episodes.driven_episode import Answers, Ending, Episode, Origin, VehicleRows
from drlsl.driving.explain import Objection, Reason, RuleClause
from drlsl.driving.scene import ATOMS, Action, Road
from drlsl.driving.shield import ObservationSpace
from drlsl.errors import UserError
from drlsl.files import parse_json, problem_text, to_json
from drlsl.traffic import Direction, Lane
from drlsl.version import __version__

FORMAT: Final = "drlsl episode 1"

TOO_CLOSE: Final = "too_close"

Place = Annotated[int, Field(ge=0)]


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, defer_build=True)


class _LaneModel(_Model):
    id: int
    direction: Literal["left_to_right", "right_to_left"]
    centre: float
    width: float
    speed_limit: float
    end: float | None = None


class _RoadModel(_Model):
    lanes: list[_LaneModel] = Field(min_length=1)
    time_step: float
    radar_range: float
    acceleration_limit: float
    braking_limit: float
    centre_tolerance: float


class _OriginModel(_Model):
    driver: str
    recording: str
    enforced: bool
    offers: str
    seed: int
    number: int
    rules: list[str]
    digests: dict[str, str]
    wants: str


class _EndingModel(_Model):
    kind: Literal["completed", "contact", "off_road", "scene"]
    verdict: str
    vehicle: str
    closing_speed: float


class _ClauseModel(_Model):
    file: str
    line: int
    text: str


class ReasonKind(_Model):
    """A kind of reason; `letters`: n for each argument that is a number, a for each that is a name."""

    reason: str
    letters: str


class Header(_Model):
    """All of an episode that is no array."""

    format: Literal["drlsl episode 1"]
    made_by: str
    origin: _OriginModel
    ending: _EndingModel
    road: _RoadModel
    actions: list[str]
    observation: dict[str, tuple[float | str, float | str]]
    clauses: list[_ClauseModel]
    names: list[str]
    reason_kinds: list[ReasonKind]
    atoms: list[str]
    failures: dict[str, str]


FRAMES: Final = {
    "target_lane": "i",
    "distance": "f",
    "offered": "b",
    "target_speed": "f",
    "observation": "f",
    "front_is_free": "b",
    "lane_to_keep": "i",
    "comfortable_acceleration": "f",
    "action": "i",
    "preferences": "f",
    "changed": "b",
    "entered": "b",
}
"""The arrays with a row for each frame, and the kind of their values."""


def arrays_of(episode: Episode) -> dict[str, npt.NDArray[Any]]:
    """Return an episode as arrays; equal episodes have equal ones."""
    kinds: dict[tuple[str, str], int] = {}
    atoms: dict[str, int] = {}
    rows = [_reason_row(one, kinds, atoms) for found in episode.reasons for one in found]
    most = max([0, *(len(row[3]) for row in rows)])
    arguments = np.full((len(rows), most), np.nan)
    for number, row in enumerate(rows):
        arguments[number, : len(row[3])] = row[3]
    return {
        "header": np.array(to_json(_header(episode, kinds, atoms))),
        **{name: _of_frames(episode, name) for name in FRAMES},
        **_vehicle_arrays("vehicle", episode.traffic),
        **({} if episode.seen is None else _vehicle_arrays("seen", episode.seen)),
        "reason_begin": np.cumsum([0, *map(len, episode.reasons)], dtype=np.int64),
        "reason_action": np.array([row[0] for row in rows], dtype=np.int64),
        "reason_clause": np.array([row[1] for row in rows], dtype=np.int64),
        "reason_kind": np.array([row[2] for row in rows], dtype=np.int64),
        "reason_arguments": arguments,
    }


def _of_frames(episode: Episode, name: str) -> npt.NDArray[Any]:
    return np.asarray(getattr(episode.answers if hasattr(episode.answers, name) else episode, name))


def _vehicle_arrays(prefix: str, rows: VehicleRows) -> dict[str, npt.NDArray[Any]]:
    return {f"{prefix}_{name}": getattr(rows, name) for name in ("begin", "name", "lane", "numbers")}


def _reason_row(
    reason: Reason, kinds: dict[tuple[str, str], int], atoms: dict[str, int]
) -> tuple[int, int, int, list[float]]:
    """Return the action, the clause, -1 if unknown, the kind and the arguments of a reason."""
    details = arguments_of(reason.objection)
    letters = "".join("a" if isinstance(one, str) else "n" for one in details)
    numbers = [float(atoms.setdefault(one, len(atoms)) if isinstance(one, str) else one) for one in details]
    kind = kinds.setdefault((reason.objection.reason, letters), len(kinds))
    return int(reason.action), -1 if reason.clause is None else reason.clause, kind, numbers


def arguments_of(objection: Objection) -> tuple[str | float, ...]:
    """Return the arguments of the rules' term for an objection."""
    if objection.vehicle is None or objection.gap is None or objection.needed is None:
        return objection.details
    return objection.vehicle, objection.gap, objection.needed


def _header(
    episode: Episode, kinds: Mapping[tuple[str, str], int], atoms: Mapping[str, int]
) -> dict[str, Any]:
    space, road = episode.observation, asdict(episode.road)
    for lane in road["lanes"]:
        lane["direction"] = lane["direction"].value
        if lane["end"] is None:
            del lane["end"]
    bounds = zip(space.low, space.high, strict=True)
    return {
        "format": FORMAT,
        "made_by": f"drlsl {__version__}",
        "origin": asdict(episode.origin),
        "ending": asdict(episode.ending),
        "road": road,
        "actions": list(ATOMS),
        "observation": dict(zip(space.names, map(list, bounds), strict=True)),
        "clauses": [asdict(clause) for clause in episode.clauses],
        "names": list(episode.names),
        "reason_kinds": [{"reason": reason, "letters": letters} for reason, letters in kinds],
        "atoms": list(atoms),
        "failures": {str(frame): why for frame, why in episode.failures.items()},
    }


def episode_from(arrays: Mapping[str, npt.NDArray[Any]], path: str | Path) -> Episode:
    """Return the episode of the arrays of a file.

    Raises:
        UserError: they are none of an episode.
    """
    header = read_header(str(arrays["header"]), path)
    _check_arrays(arrays, header, path)
    seen = _vehicles("seen", arrays) if "seen_begin" in arrays else None
    names = tuple(header.observation)
    bounds = [tuple(map(float, pair)) for pair in header.observation.values()]
    return Episode(
        origin=Origin(**{**header.origin.model_dump(), "rules": tuple(header.origin.rules)}),
        ending=Ending(**header.ending.model_dump()),
        road=_road(header.road),
        observation=ObservationSpace.of(names, [(low, high) for low, high in bounds]),
        clauses=tuple(RuleClause(**clause.model_dump()) for clause in header.clauses),
        names=tuple(header.names),
        traffic=_vehicles("vehicle", arrays),
        seen=seen,
        answers=Answers(**{name: arrays[name] for name in Answers.__dataclass_fields__}),
        reasons=_reasons(arrays, header),
        failures={int(frame): why for frame, why in header.failures.items()},
        **{name: arrays[name] for name in FRAMES if name not in Answers.__dataclass_fields__},
    )


def read_header(text: str, path: str | Path) -> Header:
    """Return the header of a text.

    Raises:
        UserError: it is none of an episode.
    """
    data = parse_json(text, f"{path}: header")
    try:
        return Header.model_validate_json(text)
    except ValidationError as error:
        problem = error.errors(include_url=False, include_context=False)[0]
        if isinstance(data, dict) and data.get("format") != FORMAT:
            raise UserError(f"{path}: its format is {data.get('format')!r}; expected {FORMAT!r}") from error
        place = ".".join(map(str, problem["loc"]))
        raise UserError(f"{path}: header: {problem_text(problem, place, 'is not known')}") from error


def _check_arrays(arrays: Mapping[str, npt.NDArray[Any]], header: Header, path: str | Path) -> None:
    """Check that the arrays are there, of their kinds, and fit together.

    Raises:
        UserError: they do not.
    """
    if header.actions != list(ATOMS):
        raise UserError(f"{path}: its actions are {', '.join(header.actions)}; expected {', '.join(ATOMS)}")
    groups = {"vehicle": len(header.names), **({"seen": len(header.names)} if "seen_begin" in arrays else {})}
    wanted = {**FRAMES, "reason_begin": "i", "reason_action": "i", "reason_clause": "i", "reason_kind": "i"}
    wanted |= {"reason_arguments": "f"}
    for group in groups:
        wanted |= {f"{group}_begin": "i", f"{group}_name": "i", f"{group}_lane": "i", f"{group}_numbers": "f"}
    for name, kind in wanted.items():
        if name not in arrays or arrays[name].dtype.kind != kind:
            raise UserError(f"{path}: the array {name} is missing, or of another kind than {kind}")
    frames = arrays["target_lane"].size
    shapes = {"offered": len(ATOMS), "preferences": len(ATOMS), "observation": len(header.observation)}
    for name in FRAMES:
        shape = (frames, shapes[name]) if name in shapes else (frames,)
        if arrays[name].shape != shape or not frames:
            found = arrays[name].shape
            raise UserError(f"{path}: the array {name} has shape {found}; expected {shape}")
    for group, most in groups.items():
        _check_rows(
            arrays, group, frames, arrays[f"{group}_numbers"].shape == (arrays[f"{group}_name"].size, 6), path
        )
        _check_places(arrays[f"{group}_name"], most, f"{group}_name", path)
        if (np.diff(arrays[f"{group}_begin"]) < 1).any():
            raise UserError(f"{path}: a frame has no ego")
    reasons = arrays["reason_kind"].size
    _check_rows(arrays, "reason", frames, arrays["reason_arguments"].shape[:1] == (reasons,), path)
    _check_places(arrays["reason_kind"], len(header.reason_kinds), "reason_kind", path)
    _check_places(arrays["reason_action"], len(ATOMS), "reason_action", path)
    _check_places(arrays["reason_clause"] + 1, len(header.clauses) + 1, "reason_clause", path)


def _check_rows(
    arrays: Mapping[str, npt.NDArray[Any]], group: str, frames: int, fits: bool, path: str | Path
) -> None:
    begin, rows = (
        arrays[f"{group}_begin"],
        arrays["reason_kind" if group == "reason" else f"{group}_name"].size,
    )
    ordered = (
        begin.shape == (frames + 1,) and begin[0] == 0 and begin[-1] == rows and (np.diff(begin) >= 0).all()
    )
    if not (ordered and fits):
        raise UserError(f"{path}: the rows of {group}_begin do not fit the other arrays")


def _check_places(places: npt.NDArray[Any], most: int, name: str, path: str | Path) -> None:
    if places.size and (places.min() < 0 or places.max() >= most):
        raise UserError(f"{path}: a number in {name} is out of range")


def _road(model: _RoadModel) -> Road:
    lanes = tuple(
        Lane(one.id, Direction(one.direction), one.centre, one.width, one.speed_limit, one.end)
        for one in model.lanes
    )
    return Road(
        lanes,
        model.time_step,
        model.radar_range,
        model.acceleration_limit,
        model.braking_limit,
        model.centre_tolerance,
    )


def _vehicles(group: str, arrays: Mapping[str, npt.NDArray[Any]]) -> VehicleRows:
    return VehicleRows(*(arrays[f"{group}_{name}"] for name in ("begin", "name", "lane", "numbers")))


def _reasons(arrays: Mapping[str, npt.NDArray[Any]], header: Header) -> tuple[tuple[Reason, ...], ...]:
    rows = [
        _reason(action, clause, kind, numbers, header)
        for action, clause, kind, numbers in zip(
            arrays["reason_action"].tolist(),
            arrays["reason_clause"].tolist(),
            arrays["reason_kind"].tolist(),
            arrays["reason_arguments"].tolist(),
            strict=True,
        )
    ]
    begin = arrays["reason_begin"].tolist()
    return tuple(tuple(rows[first:end]) for first, end in pairwise(begin))


def _reason(action: int, clause: int, kind: int, numbers: Sequence[float], header: Header) -> Reason:
    form = header.reason_kinds[kind]
    values: list[str | float] = [
        header.atoms[int(number)] if letter == "a" else number
        for letter, number in zip(form.letters, numbers, strict=False)
    ]
    return Reason(Action(action), _objection(form, values), None if clause < 0 else clause)


def _objection(form: ReasonKind, values: Sequence[str | float]) -> Objection:
    match form.reason, form.letters, values:
        case "too_close", "ann", [str(vehicle), float(gap), float(needed)]:
            return Objection("too_close", vehicle, gap, needed)
    return Objection(form.reason, details=tuple(values))
