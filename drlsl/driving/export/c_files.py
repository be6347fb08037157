"""A rule program as a header and a source file of C99."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from typing import Final

from drlsl.driving.export.js_files import ULPS
from drlsl.driving.export.rule_program import OBJECTION, RuleProgram
from drlsl.driving.export.stored import StoredDecision
from drlsl.driving.export.templates_text import filled
from drlsl.driving.scene import ATOMS, EGO, EGO_LIMITS, Action, Vehicle, scene_defaults
from drlsl.driving.shield import ACTIONS, COMFORT, FREE, LANE, SPEED, STATE, Question, query_of
from drlsl.logic.terms import Atom, Struct
from drlsl.lowering.backends import CProgram, c_program, c_support
from drlsl.lowering.ir import Node, NotLowerable, Relation, Sym, resolve
from drlsl.traffic import Direction, Lane

LANES: Final = 16
VEHICLES: Final = 64
REASONS: Final = 256
"""For how many lanes, vehicles and reasons there is room."""

_ATOMS: Final = (EGO, Direction.LEFT_TO_RIGHT.value, Direction.RIGHT_TO_LEFT.value, *ATOMS)
_ROWS: Final = {"vehicle": VEHICLES + 1, "road_lane": LANES, "lane_end": LANES}


def c_files(program: RuleProgram, stored: Sequence[StoredDecision]) -> dict[str, str]:
    """Return `rules.h`, `rules.c` and the check with its stored decisions, by name.

    Raises:
        NotLowerable: the program cannot be lowered, or its answers have no form in C.
    """
    lowered = program.decision(ordered=False)
    decision = c_program(lowered, "decision", _ROWS, {}, _ATOMS)
    _check_answers(program, decision)
    reasons, exact = None, program.is_exact(lowered)
    if program.has_reasons:
        lowered = program.reasons()
        reasons = c_program(lowered, "reasons", _ROWS, {OBJECTION.name: REASONS}, list(decision.codes))
        exact = exact and program.is_exact(lowered)
    head = "/*\n" + program.head(" *") + "\n */"
    return {
        "rules.h": _header(program, reasons, head),
        "rules.c": _source(program, decision, reasons, head),
        "check.c": _check(stored, head, exact=exact),
    }


def _check_answers(program: RuleProgram, decision: CProgram) -> None:
    """Check that the answers are numbers, as many as a decision has."""
    wanted = {SPEED: 1, STATE: len(program.shield.observation), LANE: 1, COMFORT: 1}
    for question in program.questions:
        if question not in wanted:
            continue
        for terms in decision.patterns[query_of(question)]:
            items = _items(terms[0]) if question is STATE else [terms[0]]
            if len(items) != wanted[question] or not all(map(_is_number, items)):
                raise NotLowerable(
                    str(question), None, f"it gives something else than {wanted[question]} numbers"
                )


def _items(term: Sym) -> list[Sym]:
    items, rest = [], resolve(term)
    while isinstance(rest, Struct) and rest.name == "." and len(rest.args) == 2:
        items.append(resolve(rest.args[0]))
        rest = resolve(rest.args[1])
    return items


def _is_number(term: Sym) -> bool:
    term = resolve(term)
    return (
        term.kind in ("int", "float", "number") if isinstance(term, Node) else isinstance(term, int | float)
    )


def _header(program: RuleProgram, reasons: CProgram | None, head: str) -> str:
    return filled(
        "rules.h",
        HEAD=head,
        LANES=str(LANES),
        VEHICLES=str(VEHICLES),
        REASONS=str(REASONS),
        DETAILS=str(max([1, *(len(details) for _, details in _reason_kinds(reasons))])),
        OBSERVATION=str(len(program.shield.observation)),
        ACTIONS=", ".join(f"DRLSL_{action.name}" for action in Action),
    )


def _reason_kinds(reasons: CProgram | None) -> list[tuple[str, str]]:
    """Return the name of each reason and the letters of its details."""
    patterns = reasons.patterns[OBJECTION] if reasons is not None else []
    return list(dict.fromkeys(_kind(terms[1]) for terms in patterns))


def _kind(reason: Sym) -> tuple[str, str]:
    reason = resolve(reason)
    if isinstance(reason, Atom):
        return reason.name, ""
    return reason.name, "".join("n" if _is_number(detail) else "a" for detail in reason.args)


def _source(program: RuleProgram, decision: CProgram, reasons: CProgram | None, head: str) -> str:
    made = [one for one in (decision, reasons) if one is not None]
    texts = [part for one in made for part in (one.types, one.functions)]
    space, defaults = program.shield.observation, scene_defaults()
    kinds = _reason_kinds(reasons)
    return filled(
        "rules.c",
        HEAD=head,
        ACTION_NAMES=_strings(ATOMS),
        OBSERVATION_NAMES=_strings(space.names),
        REASON_NAMES=_strings([name for name, _ in kinds] or [""]),
        REASON_DETAILS=_strings([details for _, details in kinds] or [""]),
        ATOM_NAMES=_strings(made[-1].codes),
        TIME_STEP=repr(defaults["time_step_s"]),
        RADAR_RANGE=repr(defaults["radar_range_m"]),
        LIMITS="\n".join(f"    .{name} = {value!r}," for name, value in EGO_LIMITS.items()),
        BOUNDS=", ".join(f"{{{low!r}, {high!r}}}" for low, high in _floats(space.low, space.high)),
        PROGRAM="\n".join([c_support(texts), *texts]),
        FILLS="\n".join(map(_fill, made)),
        WRITE=_indented(_write(program, decision)),
        FIND=_indented(_find(reasons)),
    )


def _floats(low: Iterable[float], high: Iterable[float]) -> list[tuple[float, float]]:
    return [(float(one), float(other)) for one, other in zip(low, high, strict=True)]


def _strings(texts: Iterable[str]) -> str:
    return ", ".join(json.dumps(text) for text in texts)


def _indented(lines: Iterable[str]) -> str:
    return "\n".join(f"    {line}" for line in lines)


def _fill(program: CProgram) -> str:
    """Return the function that states the facts of a scene."""
    lines = []
    for relation, name in program.relations.items():
        lines += _ROWS_OF.get(relation.name, []) or _single(relation, name)
    if any(relation.name == "vehicle" for relation in program.relations):
        lines += _VEHICLE_ROWS
    if not any(relation.name == "road_lane" for relation in program.relations):
        lines.append("(void)scene;")
    codes = {
        "@ROW@": f"{program.prefix}_vehicle_row",
        "@EGO@": str(program.codes[EGO]),
        "@RIGHT@": str(program.codes[Direction.LEFT_TO_RIGHT.value]),
        "@LEFT@": str(program.codes[Direction.RIGHT_TO_LEFT.value]),
    }
    text = _indented(lines)
    for place, value in codes.items():
        text = text.replace(place, value)
    p = program.prefix
    return f"static void {p}_fill(const drlsl_scene *scene, {p}_facts *facts)\n{{\n{text}\n}}\n"


def _single(relation: Relation, name: str) -> list[str]:
    if relation.name == "vehicle":
        return []
    value = "(double)scene->target_lane" if relation.name == "target_lane" else f"scene->road.{relation.name}"
    return [f"facts->{name}[0].column_1 = {value};", f"facts->{name}_count = 1;"]


_LANE_ROWS: Final = """\
facts->road_lane_count = scene->road.lane_count;
for (int32_t place = 0; place < scene->road.lane_count; place += 1) {
    const drlsl_lane *const lane = &scene->road.lanes[place];
    facts->road_lane[place].id = (double)lane->id;
    facts->road_lane[place].direction = lane->direction == DRLSL_LEFT_TO_RIGHT ? @RIGHT@ : @LEFT@;
    facts->road_lane[place].centre = lane->centre;
    facts->road_lane[place].width = lane->width;
    facts->road_lane[place].speed_limit = lane->speed_limit;
}""".splitlines()

_VEHICLE_ROWS: Final = """\
facts->vehicle_count = 0;
for (int32_t place = -1; place < scene->vehicle_count; place += 1) {
    const drlsl_vehicle *const vehicle = place < 0 ? &scene->ego : &scene->vehicles[place];
    if (place < 0 || is_seen(scene, vehicle)) {
        facts->vehicle[facts->vehicle_count] = (@ROW@){
            place < 0 ? @EGO@ : vehicle->id, (double)vehicle->lane, vehicle->x, vehicle->y,
            vehicle->vx, vehicle->vy, vehicle->length, vehicle->width};
        facts->vehicle_count += 1;
    }
}""".splitlines()


_END_ROWS: Final = """\
facts->lane_end_count = 0;
for (int32_t place = 0; place < scene->road.lane_count; place += 1) {
    const drlsl_lane *const lane = &scene->road.lanes[place];
    if (lane->ends) {
        facts->lane_end[facts->lane_end_count].lane = (double)lane->id;
        facts->lane_end[facts->lane_end_count].x = lane->end;
        facts->lane_end_count += 1;
    }
}""".splitlines()

_ROWS_OF: Final = {"road_lane": _LANE_ROWS, "lane_end": _END_ROWS}


def _write(program: RuleProgram, decision: CProgram) -> list[str]:
    """Return the lines that write the answers into a decision."""
    lines = _write_actions(decision)
    for question, problem, target in (
        (SPEED, "DRLSL_NO_SPEED", "decision->target_speed"),
        (COMFORT, "DRLSL_NO_ACCELERATION", "decision->comfortable_acceleration"),
    ):
        if program.defines(question):
            lines += _write_numbers(question, decision, problem, [target])
        else:
            lines.append(f"{target} = INFINITY;")
    size = len(program.shield.observation)
    places = [f"decision->observation[{place}]" for place in range(size)]
    lines += _write_numbers(STATE, decision, "DRLSL_NO_OBSERVATION", places)
    lines.append(f"decision->front_is_free = answers->{decision.queries[query_of(FREE)]};")
    if program.defines(LANE):
        lines += ["double lane = NAN;", *_write_numbers(LANE, decision, "DRLSL_NO_LANE", ["lane"])]
        lines += [
            "if (!(fabs(lane) <= 2147483647.0)) {",
            "    decision->problem = DRLSL_NO_LANE;",
            "    return false;",
            "}",
            "decision->lane_to_keep = (int32_t)lane;",
            "(void)scene;",
        ]
    else:
        lines.append("decision->lane_to_keep = scene->target_lane;")
    return lines


def _write_actions(decision: CProgram) -> list[str]:
    query = query_of(ACTIONS)
    name = decision.queries[query]
    lines = [f"for (int32_t n = 0; n < answers->{name}.count; n += 1) {{"]
    for number, (term,) in enumerate(decision.patterns[query]):
        action = Action[resolve(term).name.upper()]
        test = f"answers->{name}.pattern[n] == {number}"
        lines += [f"    if ({test}) {{", f"        decision->offered[DRLSL_{action.name}] = true;", "    }"]
    return [*lines, "}"]


def _write_numbers(question: Question, decision: CProgram, problem: str, targets: Sequence[str]) -> list[str]:
    """Return the lines that write the numbers of the first solution, or return false."""
    query = query_of(question)
    name = decision.queries[query]
    lines = [
        f"if (answers->{name}.count == 0) {{",
        f"    decision->problem = {problem};",
        "    return false;",
        "}",
    ]
    for number, terms in enumerate(decision.patterns[query]):
        lines.append(f"if (answers->{name}.pattern[0] == {number}) {{")
        place = 0
        items = _items(terms[0]) if question is STATE else [resolve(terms[0])]
        for target, item in zip(targets, items, strict=True):
            if isinstance(item, Node):
                lines.append(f"    {target} = answers->{name}.value[0][{place}];")
                place += 1
            else:
                lines.append(f"    {target} = {float(item)!r};")
        lines.append("}")
    return lines


def _find(reasons: CProgram | None) -> list[str]:
    """Return the lines that find the reasons."""
    if reasons is None:
        return []
    kinds, name = _reason_kinds(reasons), reasons.queries[OBJECTION]
    lines = [
        "reasons_facts facts;",
        "reasons_answers answers;",
        "memset(&answers, 0, sizeof answers);",
        "reasons_fill(scene, &facts);",
        "if (!reasons_answer(&facts, &answers)) {",
        "    reasons->status = DRLSL_UNDECIDED;",
        "    return DRLSL_UNDECIDED;",
        "}",
        f"reasons->count = answers.{name}.count;",
        f"reasons->left_out = answers.{name}.left_out;",
        "for (int32_t place = 0; place < reasons->count; place += 1) {",
        "    drlsl_reason *const one = &reasons->reasons[place];",
        "    for (int32_t n = 0; n < DRLSL_MAX_DETAILS; n += 1) {",
        "        one->details[n] = 0.0;",
        "    }",
    ]
    for number, (action, reason) in enumerate(reasons.patterns[OBJECTION]):
        lines.append(f"    if (answers.{name}.pattern[place] == {number}) {{")
        lines.append(f"        one->action = DRLSL_{resolve(action).name.upper()};")
        lines.append(f"        one->reason = {kinds.index(_kind(reason))};")
        value = 0
        for detail, term in enumerate(resolve(reason).args if isinstance(resolve(reason), Struct) else ()):
            text = f"answers.{name}.value[place][{value}]"
            term = resolve(term)
            if isinstance(term, Node):
                value += 1
            else:
                text = repr(float(reasons.codes[term.name] if isinstance(term, Atom) else term))
            lines.append(f"        one->details[{detail}] = {text};")
        lines.append("    }")
    return [*lines, "}"]


def _check(stored: Sequence[StoredDecision], head: str, *, exact: bool) -> str:
    lanes: list[str] = []
    vehicles: list[str] = []
    decisions: list[str] = []
    roads: dict[object, int] = {}
    for one in stored:
        scene = one.scene
        if scene.road not in roads:
            roads[scene.road] = len(lanes)
            lanes += map(_lane, scene.road.lanes)
        numbers = [
            *(roads[scene.road], len(scene.road.lanes), repr(scene.road.time_step), scene.target_lane),
            *(len(vehicles), len(scene.vehicles) + 1),
        ]
        decisions.append(f"    {{{', '.join(map(str, numbers))}, {_stored(one)}}},")
        vehicles += [
            _vehicle(number, car) for number, car in enumerate((scene.ego, *scene.vehicles), start=-1)
        ]
    return filled(
        "check.c",
        HEAD=head,
        COUNT=str(len(stored)),
        ULPS="0" if exact else str(ULPS),
        LANES="\n".join(lanes),
        VEHICLES="\n".join(vehicles),
        STORED="\n".join(decisions),
    )


def _lane(lane: Lane) -> str:
    numbers = ", ".join(map(repr, map(float, (lane.centre, lane.width, lane.speed_limit))))
    end = "false, 0.0" if lane.end is None else f"true, {float(lane.end)!r}"
    return f"    {{{lane.id}, DRLSL_{lane.direction.name}, {numbers}, {end}}},"


def _vehicle(number: int, car: Vehicle) -> str:
    return f"    {{{number}, {car.lane}, {', '.join(repr(float(value)) for value in car[2:])}}},"


def _stored(one: StoredDecision) -> str:
    decision = one.decision
    if decision is None:
        return "false, {false}, 0.0, 0.0, false, 0, 0, 0.0, {0.0}"
    comfort = decision.comfortable_acceleration
    reasons = [reason for found in one.unsafe.values() for reason in found]
    numbers = [
        float(value)
        for reason in reasons
        for value in (reason.gap, reason.needed, *reason.details)
        if isinstance(value, int | float)
    ]
    parts = [
        "true",
        f"{{{', '.join(_truth(bool(offered)) for offered in decision.action_mask)}}}",
        repr(float(decision.target_speed)),
        "INFINITY" if comfort == float("inf") else repr(float(comfort)),
        _truth(decision.front_is_free),
        str(decision.lane_to_keep),
        str(len(reasons)),
        repr(sum(numbers)),
        f"{{{', '.join(repr(float(value)) for value in decision.observation)}}}",
    ]
    return ", ".join(parts)


def _truth(value: bool) -> str:
    return "true" if value else "false"
