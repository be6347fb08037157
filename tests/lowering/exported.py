"""Runs lowered programs in C and in JavaScript, many of them in one process."""

from __future__ import annotations

import ctypes
import json
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from drlsl.logic import Compound, String
from drlsl.logic.terms import NIL, Atom, Struct
from drlsl.lowering.backends import CProgram, c_program, c_support, js_source, js_support
from drlsl.lowering.frontend import Lowered, Query
from drlsl.lowering.ir import Node, Sym, resolve

Facts = Mapping[tuple[str, int], Sequence[Sequence[Any]]]

NODE: Final = shutil.which("node")
GCC: Final = shutil.which("gcc") or shutil.which("cc")
FLAGS: Final = ("-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror")
UNDECIDED: Final = "undecided"
MOST: Final = 400
"""Solutions of a query for which there is room in C."""


def run_js(programs: Sequence[Lowered], scenes: Sequence[Sequence[Facts]], folder: Path) -> list[list[Any]]:
    """Return the answers of each program about each of its scenes."""
    texts = [js_source(lowered, f"answer_{n}") for n, lowered in enumerate(programs)]
    names = ", ".join(f"answer_{n}" for n in range(len(programs)))
    main = (
        'import { readFileSync } from "node:fs";\n'
        "const scenes = JSON.parse(readFileSync(process.argv[2]));\n"
        f"const answers = [{names}].map((answer, n) => scenes[n].map((facts) => answer(facts)));\n"
        "console.log(JSON.stringify(answers));\n"
    )
    module, data = folder / "programs.mjs", folder / "scenes.json"
    module.write_text("\n".join([js_support(texts), *texts, main]))
    named = [[{f"{n}/{k}": rows for (n, k), rows in facts.items()} for facts in some] for some in scenes]
    data.write_text(json.dumps(named))
    assert NODE is not None
    ran = subprocess.run([NODE, str(module), str(data)], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr[-2000:]
    answers: list[list[Any]] = json.loads(ran.stdout)
    return [[UNDECIDED if one is None else one for one in some] for some in answers]


def loose(value: Any) -> Any:
    """A value in the form of JSON: no tuples, no terms of Prolog."""
    if isinstance(value, Compound):
        return {"name": value.name, "args": [loose(arg) for arg in value.args]}
    if isinstance(value, list | tuple):
        return [loose(item) for item in value]
    return str(value) if isinstance(value, String) else value


def run_c(programs: Sequence[Lowered], scenes: Sequence[Sequence[Facts]], folder: Path) -> list[list[Any]]:
    """Return the answers of each program about each of its scenes, in the form of JSON."""
    made = [_c_program(lowered, f"p{n}") for n, lowered in enumerate(programs)]
    texts = [part for program in made for part in (program.types, program.functions, _glue(program))]
    head = "#include <math.h>\n#include <stdbool.h>\n#include <stdint.h>\n#include <string.h>\n\n"
    source, library = folder / "programs.c", folder / "programs.so"
    source.write_text("\n".join([head, c_support(texts), *texts]))
    assert GCC is not None
    built = subprocess.run(
        [GCC, *FLAGS, "-O1", "-shared", "-fPIC", "-o", str(library), str(source), "-lm"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert built.returncode == 0, built.stderr[:3000]
    functions = ctypes.CDLL(str(library))
    return [
        [_ask(getattr(functions, f"run_{program.prefix}"), program, facts) for facts in some]
        for program, some in zip(made, scenes, strict=True)
    ]


def _c_program(lowered: Lowered, prefix: str) -> CProgram:
    rows = dict.fromkeys((name for name, _ in lowered.schema.relations), 16)
    return c_program(lowered, prefix, rows, {answer.query.name: MOST for answer in lowered.answers})


def _glue(program: CProgram) -> str:
    """A function from an array of doubles to one: counts and rows in, counts and solutions out."""
    p = program.prefix
    lines = [
        f"int run_{p}(const double *in, double *out);",
        f"int run_{p}(const double *in, double *out)",
        "{",
    ]
    lines += [f"    static {p}_facts facts;", f"    static {p}_answers answers;", "    (void)in; (void)out;"]
    for relation, name in program.relations.items():
        lines += [
            f"    facts.{name}_count = (int32_t)*in++;",
            f"    for (int32_t n = 0; n < facts.{name}_count; n += 1) {{",
        ]
        for place, kind in enumerate(relation.columns):
            field = relation.fields[place] if relation.fields else f"column_{place + 1}"
            cast = "(int32_t)" if kind == "atom" else ""
            lines.append(f"        facts.{name}[n].{field} = {cast}*in++;")
        lines.append("    }")
    lines.append(f"    if (!{p}_answer(&facts, &answers)) {{ return 0; }}")
    for query, name in program.queries.items():
        if query.mode == "holds":
            lines.append(f"    *out++ = answers.{name} ? 1.0 : 0.0;")
            continue
        lines += [
            f"    *out++ = answers.{name}.count;",
            f"    *out++ = answers.{name}.left_out;",
            f"    for (int32_t n = 0; n < answers.{name}.count; n += 1) {{",
            f"        *out++ = answers.{name}.pattern[n];",
            f"        memcpy(out, answers.{name}.value[n], sizeof answers.{name}.value[n]);",
            f"        out += sizeof answers.{name}.value[n] / sizeof(double);",
            "    }",
        ]
    return "\n".join([*lines, "    return 1;", "}", ""])


def _ask(function: Any, program: CProgram, facts: Facts) -> Any:
    atoms = dict(program.codes)
    strange: list[str] = []

    def code(value: Any) -> float:
        if not isinstance(value, str):
            return float(value)
        if value not in atoms:
            atoms[value] = len(strange)
            strange.append(value)
        return atoms[value]

    given: list[float] = []
    for relation in program.relations:
        rows = facts[relation.name, relation.arity]
        given.append(len(rows))
        given.extend(code(value) for row in rows for value in row)
    size = 64 + sum((MOST + 1) * 32 for _ in program.queries)
    out = (ctypes.c_double * size)()
    if not function((ctypes.c_double * len(given))(*given), out):
        return UNDECIDED
    names = {number: name for name, number in atoms.items()}
    numbers = iter(list(out))
    return [_answer(program, query, numbers, names) for query in program.queries]


def _answer(program: CProgram, query: Query, numbers: Any, names: Mapping[int, str]) -> Any:
    if query.mode == "holds":
        return bool(next(numbers))
    count, left_out = int(next(numbers)), int(next(numbers))
    assert left_out == 0 or query.mode == "first"
    patterns = program.patterns[query]
    width = max([1, *(len(_nodes(terms)) for terms in patterns)])
    solutions = []
    for _ in range(count):
        terms = patterns[int(next(numbers))]
        values = iter([next(numbers) for _ in range(width)])
        items = [_term(term, values, names) for term in terms]
        solutions.append(items[0] if len(items) == 1 else items)
    if query.mode == "first":
        return solutions[0] if solutions else None
    if query.mode == "set":
        return [item for n, item in enumerate(solutions) if item not in solutions[:n]]
    return solutions


def _nodes(terms: Sequence[Sym]) -> list[Node]:
    found = []
    for term in map(resolve, terms):
        if isinstance(term, Node):
            found.append(term)
        elif isinstance(term, Struct):
            found.extend(_nodes(term.args))
    return found


def _term(term: Sym, values: Any, names: Mapping[int, str]) -> Any:
    term = resolve(term)
    if isinstance(term, Node):
        value = next(values)
        return names[int(value)] if term.kind == "atom" else value
    if isinstance(term, Atom):
        return [] if term is NIL else term.name
    if isinstance(term, Struct):
        items: list[Sym] = []
        rest: Sym = term
        while isinstance(rest, Struct) and rest.name == "." and len(rest.args) == 2:
            items.append(rest.args[0])
            rest = resolve(rest.args[1])
        if rest is NIL:
            return [_term(item, values, names) for item in items]
        return {"name": term.name, "args": [_term(arg, values, names) for arg in term.args]}
    return term
