"""Files as people have them: highD and NGSIM changed by a seeded script, and what of them is true.

A mutation changes the cells or the bytes of a file. What it leaves is loaded rightly, or with a note, or
refused.
"""

from __future__ import annotations

import gzip
import lzma
import random
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from tests.traffic.writing import Row, write_highd, write_ngsim_csv

Table: TypeAlias = list[list[str]]
Cells: TypeAlias = Callable[[Table, random.Random], object]
Bytes: TypeAlias = Callable[[bytes, random.Random], bytes]


def rows_of(rate: float, lanes: dict[float, int], *, frames: int, start: int = 1) -> list[Row]:
    """Two vehicles in each lane, at steady speeds; a lane is its centre [m] and the sign of its traffic."""
    rows = []
    for number, (y, sign) in enumerate(lanes.items()):
        for place in range(2):
            vehicle, speed = 2 * number + place + 1, 22.0 + 1.5 * number + place
            length = 12.0 if (number, place) == (0, 0) else 4.2 + 0.1 * number
            for step in range(frames):
                x = 150.0 + sign * (speed * step / rate + 40.0 * place - 75.0)
                rows.append(Row(start + step, vehicle, x, y, sign * speed, length=length, lane=number + 1))
    return rows


def write_base(kind: str, folder: Path) -> Path:
    """A recording that is in order, in the layout of `kind`; its path."""
    if kind == "highd":
        lanes = {10.0: -1, 14.0: -1, 22.0: 1, 26.0: 1}
        rows = rows_of(25.0, lanes, frames=120)
        write_highd(folder / "h", rows, upper=(8.0, 12.0, 16.0), lower=(20.0, 24.0, 28.0), trucks=[1])
        meta = folder / "h" / "01_tracksMeta.csv"
        lines = meta.read_text().splitlines()
        meta.write_text("\n".join([f"{lines[0]},numFrames", *(f"{line},120" for line in lines[1:]), ""]))
        return folder / "h"
    rows = rows_of(10.0, {1.8: 1, 5.4: 1, 9.0: 1}, frames=90, start=12)
    return write_ngsim_csv(folder / "n.csv", rows, site="us-101")


@dataclass(frozen=True)
class Names:
    """The columns of a table that mutations name."""

    x: str
    y: str
    speed: str
    length: str
    width: str
    frame: str
    vehicle: str


HIGHD = Names("x", "y", "xVelocity", "width", "height", "frame", "id")
NGSIM = Names("Local_Y", "Local_X", "v_Vel", "v_length", "v_Width", "Frame_ID", "Vehicle_ID")


def column(table: Table, name: str) -> int:
    return [cell.lower() for cell in table[0]].index(name.lower())


def change(table: Table, name: str, new: Callable[[str], str], rows: range | list[int] | None = None) -> None:
    place = column(table, name)
    for row in rows if rows is not None else range(1, len(table)):
        table[row][place] = new(table[row][place])


def scaled(name: str, factor: float) -> Cells:
    return lambda table, _: change(table, name, lambda cell: repr(float(cell) * factor))


def one(name: str, values: tuple[str, ...]) -> Cells:
    """One cell becomes something else."""
    return lambda table, rng: change(
        table, name, lambda _: rng.choice(values), [rng.randrange(1, len(table))]
    )


def thin(name: str) -> Cells:
    def mutate(table: Table, rng: random.Random) -> None:
        every, place = rng.randint(2, 5), column(table, name)
        table[1:] = [row for row in table[1:] if int(row[place]) % every == 0]

    return mutate


def missing_frames(name: str) -> Cells:
    def mutate(table: Table, rng: random.Random) -> None:
        first, place = rng.randint(20, 40), column(table, name)
        table[1:] = [row for row in table[1:] if not first <= int(row[place]) <= first + 10]

    return mutate


def shuffled_columns(table: Table, rng: random.Random) -> None:
    order = rng.sample(range(len(table[0])), len(table[0]))
    table[:] = [[row[place] for place in order] for row in table]


def shuffled_rows(table: Table, rng: random.Random) -> None:
    table[1:] = rng.sample(table[1:], len(table) - 1)


def repeated_rows(table: Table, rng: random.Random) -> None:
    table.extend([list(row) for row in rng.sample(table[1:], 9)])


def contradictions(share: float, name: str) -> Cells:
    def mutate(table: Table, rng: random.Random) -> None:
        extra = [list(row) for row in rng.sample(table[1:], int(share * len(table)) or 1)]
        for row in extra:
            row[column(table, name)] = repr(float(row[column(table, name)]) + 7.0)
        table.extend(extra)

    return mutate


def lost_rows(table: Table, rng: random.Random) -> None:
    for _ in range(rng.randint(1, 30)):
        del table[rng.randrange(1, len(table))]


def lost_column(name: str) -> Cells:
    def mutate(table: Table, _: random.Random) -> None:
        place = column(table, name)
        for row in table:
            del row[place]

    return mutate


def twice(name: str) -> Cells:
    def mutate(table: Table, _: random.Random) -> None:
        place = column(table, name)
        for index, row in enumerate(table):
            row.append(row[place] if index == 0 else "1.0")

    return mutate


def extra_column(table: Table, _: random.Random) -> None:
    for index, row in enumerate(table):
        row.insert(1, "remark" if index == 0 else '"a, b"')


def renamed(name: str) -> Cells:
    return lambda table, _: table[0].__setitem__(column(table, name), f"{name}_2")


def swapped(one: str, other: str) -> Cells:
    def mutate(table: Table, _: random.Random) -> None:
        first, second = column(table, one), column(table, other)
        for row in table[1:]:
            row[first], row[second] = row[second], row[first]

    return mutate


def header_again(table: Table, rng: random.Random) -> None:
    table.insert(rng.randrange(2, len(table)), list(table[0]))


def short_line(table: Table, rng: random.Random) -> None:
    del table[rng.randrange(1, len(table))][rng.randrange(3)]


def unquoted_decimal_comma(name: str) -> Cells:
    return lambda table, rng: change(
        table, name, lambda cell: cell.replace(".", ","), [rng.randrange(1, len(table))]
    )


def quoted_decimal_commas(*names: str) -> Cells:
    def mutate(table: Table, _: random.Random) -> None:
        for name in names:
            change(table, name, lambda cell: f'"{float(cell):.3f}"'.replace(".", ","))

    return mutate


def grouped_thousands(name: str) -> Cells:
    return lambda table, _: change(table, name, lambda cell: f'"{float(cell) + 0.0:,.3f}"')


def cells_of(names: Names) -> dict[str, Cells]:
    """Mutations of the table of tracks."""
    return {
        "x in feet": scaled(names.x, 1 / 0.3048),
        "x in other feet": scaled(names.x, 0.3048),
        "x in centimetres": scaled(names.x, 100.0),
        "y in feet": scaled(names.y, 1 / 0.3048),
        "speed in km/h": scaled(names.speed, 3.6),
        "speed of feet in km/h": scaled(names.speed, 1.09728),
        "speed in mph": scaled(names.speed, 2.236936),
        "speed turned around": scaled(names.speed, -1.0),
        "lengths in feet": scaled(names.length, 1 / 0.3048),
        "lengths in metres for feet": scaled(names.length, 0.3048),
        "lengths in millimetres": scaled(names.length, 1000.0),
        "widths in feet": scaled(names.width, 1 / 0.3048),
        "length and width swapped": swapped(names.length, names.width),
        "x and y swapped": swapped(names.x, names.y),
        "a lone x": one(names.x, ("60000", "1000000", "-9999", "1e9", "4000")),
        "a lone y": one(names.y, ("60000", "1000000", "-9999", "900")),
        "a lone speed": one(names.speed, ("1e4", "-9999", "9999.99", "1e308")),
        "a lone length": one(names.length, ("450", "-1", "1e9", "5600")),
        "a lone frame": one(names.frame, ("1.5", "-1", "99999999", "2147483648")),
        "a lone vehicle": one(names.vehicle, ("1.5", "-1", "9999", "2147483648")),
        "no number in x": one(names.x, ("", "nan", "NA", "None", "-", "inf", "null", "#REF!", "12:30")),
        "no number in speed": one(names.speed, ("", "nan", "NA", "None", "-", "inf", "true")),
        "thinned": thin(names.frame),
        "missing frames": missing_frames(names.frame),
        "shuffled columns": shuffled_columns,
        "shuffled rows": shuffled_rows,
        "repeated rows": repeated_rows,
        "some contradictions": contradictions(0.002, names.x),
        "many contradictions": contradictions(0.4, names.x),
        "lost rows": lost_rows,
        "lost column": lost_column(names.x),
        "column twice": twice(names.x),
        "column of text": extra_column,
        "renamed column": renamed(names.speed),
        "header again": header_again,
        "short line": short_line,
        "decimal comma": unquoted_decimal_comma(names.x),
        "decimal commas in x": quoted_decimal_commas(names.x),
        "decimal commas in length": quoted_decimal_commas(names.length),
        "decimal commas": quoted_decimal_commas(names.x, names.y, names.speed, names.length, names.width),
        "thousands in x": grouped_thousands(names.x),
        "whole numbers with points": lambda table, _: change(table, names.vehicle, lambda cell: f"{cell}.0"),
        "upper case": lambda table, _: table[0].__setitem__(slice(None), [name.upper() for name in table[0]]),
    }


NGSIM_CELLS: dict[str, Cells] = {
    "rounded times": lambda table, _: change(table, "Global_Time", lambda cell: f"{float(cell):.5E}"),
    "no site": lost_column("Location"),
    "all in metres": lambda table, rng: [
        scaled(name, 0.3048)(table, rng) for name in ("Local_X", "Local_Y", "v_Vel", "v_length", "v_Width")
    ],
    "speed in m/s": scaled("v_Vel", 0.3048),
    "one lane id": lambda table, _: change(table, "Lane_ID", lambda _: "1"),
    "a lone class": one("v_Class", ("9", "0", "2.5")),
    "no size": lambda table, _: change(table, "v_length", lambda _: "0", [3, 4, 5]),
    "another site": lambda table, _: change(table, "Location", lambda _: "i-80", [*range(1, 90)]),
}

HIGHD_META: dict[str, Cells] = {
    "limit in km/h": lambda table, rng: change(
        table, "speedLimit", lambda _: rng.choice(("120", "100", "130"))
    ),
    "limit of nothing": lambda table, rng: change(
        table, "speedLimit", lambda _: rng.choice(("0", "-5", "nan"))
    ),
    "another rate": lambda table, rng: change(
        table, "frameRate", lambda _: rng.choice(("24", "30", "10", "29.97", "0", "-25", "1"))
    ),
    "markings in feet": lambda table, _: change(
        table, "lowerLaneMarkings", lambda cell: ";".join(repr(float(y) / 0.3048) for y in cell.split(";"))
    ),
    "sides swapped": swapped("upperLaneMarkings", "lowerLaneMarkings"),
    "no lower side": lambda table, _: change(table, "lowerLaneMarkings", lambda _: ""),
    "a marking lost": lambda table, _: change(table, "upperLaneMarkings", lambda _: "8.0;16.5"),
    "two recordings": lambda table, _: table.append(list(table[1])),
}

HIGHD_VEHICLES: dict[str, Cells] = {
    "two classes": lambda table, _: table.append(["3", "Truck", "120"]),
    "a vehicle twice": lambda table, _: table.append(["3", "Car", "120"]),
    "vehicle missing": lambda table, rng: table.__delitem__(rng.randrange(1, len(table))),
    "class of its own": one("class", ("PKW", "", "bus", "1")),
    "class in capitals": lambda table, _: change(table, "class", str.upper),
    "more frames": lambda table, _: change(table, "numFrames", lambda _: "150"),
}


def cut(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data) // 4, len(data) - 4)]


def cut_at_a_line(data: bytes, rng: random.Random) -> bytes:
    lines = data.splitlines(keepends=True)
    return b"".join(lines[: rng.randrange(len(lines) // 2, len(lines))])


BYTES: dict[str, Bytes] = {
    "semicolons": lambda data, _: data.replace(b",", b";"),
    "semicolons and decimal commas": lambda data, _: data.replace(b",", b";").replace(b".", b","),
    "tabs": lambda data, _: data.replace(b",", b"\t"),
    "spaces after commas": lambda data, _: data.replace(b",", b", "),
    "all quoted": lambda data, _: b"\n".join(
        b",".join(b'"' + cell + b'"' for cell in line.split(b",")) for line in data.splitlines()
    ),
    "UTF-16": lambda data, _: data.decode().encode("utf-16"),
    "UTF-16 without a mark": lambda data, _: data.decode().encode("utf-16-le"),
    "byte order mark": lambda data, _: b"\xef\xbb\xbf" + data,
    "Latin-1": lambda data, _: data.replace(b"\n", b",\xe4\n", 1).replace(b"\n", b",1\n")[:-3] + b"1\n",
    "carriage returns and newlines": lambda data, _: data.replace(b"\n", b"\r\n"),
    "carriage returns": lambda data, _: data.replace(b"\n", b"\r"),
    "blank lines": lambda data, _: data.replace(b"\n", b"\n\n", 40),
    "no last newline": lambda data, _: data.rstrip(b"\n"),
    "commas at the ends of lines": lambda data, _: data.replace(b"\n", b",\n"),
    "cut": cut,
    "cut at a line": cut_at_a_line,
    "zeros at the end": lambda data, _: data + bytes(512),
    "zeros in the middle": lambda data, _: data[:900] + bytes(200) + data[1100:],
    "nothing": lambda *_: b"",
    "header alone": lambda data, _: data.split(b"\n")[0] + b"\n",
    "a page of the portal": lambda *_: b"<!DOCTYPE html>\n<html><body>Sign in, please</body></html>\n",
    "a pointer of Git LFS": lambda *_: (
        b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n"
    ),
    "gzip without its name": lambda data, _: gzip.compress(data),
    "xz without its name": lambda data, _: lzma.compress(data),
    "zip without its name": lambda data, _: b"PK\x03\x04" + data,
    "Parquet without its name": lambda data, _: b"PAR1" + data + b"PAR1",
    "the same twice": lambda data, _: data + data.split(b"\n", 1)[1],
}

Mutation: TypeAlias = tuple[str, str, Cells | None, Bytes | None]
"""A file, what is done to it, and what does it: to its cells or to its bytes."""


def _of(file: str, cells: dict[str, Cells], data: dict[str, Bytes]) -> list[Mutation]:
    return [
        *((file, name, one, None) for name, one in cells.items()),
        *((file, name, None, one) for name, one in data.items()),
    ]


MUTATIONS: dict[str, list[Mutation]] = {
    "highd": [
        *_of("01_tracks.csv", cells_of(HIGHD), BYTES),
        *_of("01_recordingMeta.csv", HIGHD_META, {"UTF-16": BYTES["UTF-16"], "cut": BYTES["cut"]}),
        *_of("01_tracksMeta.csv", HIGHD_VEHICLES, {}),
    ],
    "ngsim": _of("n.csv", cells_of(NGSIM) | NGSIM_CELLS, BYTES),
}


def mutate(kind: str, path: Path, seed: int) -> list[str]:
    """Change the files of a recording; return what was done to them: one thing, for some seeds two."""
    rng = random.Random(f"{kind} {seed}")
    known = MUTATIONS[kind]
    chosen = [known[seed % len(known)]]  # each is met once before any is met again
    if seed >= len(known):
        chosen.append(rng.choice(known))
    done = []
    for name, what, cells, data in sorted(chosen, key=lambda item: item[2] is None):
        file = path / name if path.is_dir() else path
        if data is not None:
            file.write_bytes(data(file.read_bytes(), rng))
        elif cells is not None:
            table = [line.split(",") for line in file.read_text().splitlines()]
            try:
                cells(table, rng)
            except (ValueError, IndexError):  # the other one left nothing to change
                continue
            file.write_text("\n".join([*map(",".join, table), ""]))
        done.append(f"{name}: {what}")
    return done
