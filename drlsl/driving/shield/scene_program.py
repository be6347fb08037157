"""Array programs that are asked about scenes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from drlsl.driving.scene import EGO, EGO_ID, SCHEMA, Road, Row, SceneBatch, road_facts
from drlsl.lowering.backends import BatchAnswer, BatchProgram, Rows
from drlsl.lowering.ir import Relation
from drlsl.traffic import Mask

FIRST_OTHER: Final = 1 << 20
"""The integer of vehicle 0 in arrays; atoms of the program have smaller ones."""

KEPT: Final = 256
"""Rows of roads whose facts are kept: egos enter on one road after the other, and facts take long to make."""


class SceneProgram:
    """An array program that is given scenes; the facts of their roads are kept for later batches."""

    def __init__(self, program: BatchProgram[Any]) -> None:
        self._program = program
        self._reads_names = 0 in program.columns_read("vehicle", 8)
        self._roads: tuple[Road, ...] = ()
        self._road_rows: dict[tuple[str, int], Any] = {}
        self._known: dict[tuple[Road, ...], dict[tuple[str, int], Any]] = {}

    def __call__(self, scenes: SceneBatch) -> tuple[Sequence[BatchAnswer[npt.NDArray[Any]]], Mask]:
        """Return the answers, and the scenes that are undecided, as NumPy arrays."""
        result = self._program(self._facts(scenes))
        if isinstance(result.undecided, np.ndarray):
            return result.answers, result.undecided
        answers = [BatchAnswer(_numpy(answer.value), _numpy(answer.fails)) for answer in result.answers]
        return answers, _numpy(result.undecided)

    def _facts(self, scenes: SceneBatch) -> dict[tuple[str, int], Any]:
        if scenes.roads != self._roads:
            self._roads, self._road_rows = scenes.roads, self._rows_of(scenes.roads)
        names = None
        if self._reads_names:
            names = np.where(scenes.id == EGO_ID, self._program.code(EGO), scenes.id + FIRST_OTHER)
        road_rows = self._road_rows
        if len(scenes.roads) > 1:
            road_rows = {name: replace(rows, index=scenes.road) for name, rows in road_rows.items()}
        return {
            **road_rows,
            ("vehicle", 8): Rows((names, *scenes.columns), scenes.valid),
            ("target_lane", 1): Rows([scenes.target_lane]),
        }

    def _rows_of(self, roads: tuple[Road, ...]) -> dict[tuple[str, int], Any]:
        """Return the facts of the roads that the program reads, a table for each road."""
        if roads not in self._known:
            while len(self._known) >= KEPT:
                del self._known[next(iter(self._known))]
            self._known[roads] = self._made_of(roads)
        return self._known[roads]

    def _made_of(self, roads: tuple[Road, ...]) -> dict[tuple[str, int], Any]:
        facts = [road_facts(road) for road in roads]
        rows = {
            (name, arity): self._tables(SCHEMA.relations[name, arity], [one[name, arity] for one in facts])
            for name, arity in facts[0]
            if (name, arity) in self._program.reads
        }
        if len(roads) > 1:
            return rows
        return {key: self._program.table(*key, one) for key, one in rows.items()}

    def _tables(self, relation: Relation, tables: Sequence[Sequence[Row]]) -> Rows:
        most = max(map(len, tables))
        columns = []
        for place, kind in enumerate(relation.columns):
            column = np.zeros((len(tables), most), dtype=np.float64 if kind == "float" else np.int64)
            for number, rows in enumerate(tables):
                cells = [row[place] for row in rows]
                codes = [self._program.code(str(cell)) for cell in cells] if kind == "atom" else cells
                column[number, : len(rows)] = codes
            columns.append(column)
        if relation.single:
            return Rows([column[:, 0] for column in columns])
        return Rows(columns, np.arange(most) < np.array([[len(rows)] for rows in tables]))


def _numpy(values: Any) -> npt.NDArray[Any]:
    """Return values as a NumPy array, from whatever device they are on."""
    return np.asarray(values.cpu())
