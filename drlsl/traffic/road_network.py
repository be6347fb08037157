"""The road that SUMO simulates: one straight carriageway per direction, with its on-ramps."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Final

from drlsl.traffic.road import Direction
from drlsl.traffic.road_presets import Preset

MARGIN: Final = 50.0
"""Length of road simulated beyond both ends of the stretch, for smoothing and differences [m]."""

FREE_SPEED: Final = 50.0
"""Speed limit given to SUMO where only the drivers' wishes count [m/s]."""

RAMP_RUN_UP: Final = 300.0
"""Length of an on-ramp that is simulated before its lane begins [m]."""

RAMP_LIMIT: Final = 80 / 3.6
"""Speed limit of an on-ramp [m/s]; on its merging lane, that of the right lane holds."""

APART: Final = 1000.0
"""Distance between the carriageways in SUMO's plane [m], in which all run towards +x."""

RAMP_EDGE: Final = "ramp"
"""Beginning of the names of on-ramps, after the direction."""


@dataclass(frozen=True, slots=True)
class _Section:
    """A part of a carriageway with a constant number of lanes, from x `begin` to `end` [m]."""

    name: str
    begin: float
    end: float
    lanes: int


def main_route(preset: Preset, direction: Direction) -> str:
    """Return the edges of the carriageway, joined by spaces."""
    return " ".join(f"{direction.value}_{section.name}" for section in _sections(preset))


def ramp_route(preset: Preset, direction: Direction, number: int) -> str:
    """Return the edges from an on-ramp on."""
    main = main_route(preset, direction).split()
    first = main.index(f"{direction.value}_merge{number}")
    return " ".join([f"{direction.value}_{RAMP_EDGE}{number}", *main[first:]])


def write_network(folder: Path, preset: Preset, netconvert: Path) -> Path:
    """Write the network of a preset; return the file."""
    nodes: list[str] = []
    edges: list[str] = []
    connections: list[str] = []
    for number, direction in enumerate(preset.directions):
        name, y = direction.value, -APART * number
        sections = _sections(preset)
        for section in sections:
            nodes.append(_node(f"{name}_{section.name}", section.begin, y))
            edges.append(_edge(preset, name, section, sections))
        nodes.append(_node(f"{name}_end", sections[-1].end, y))
        for one, other in pairwise(sections):
            connections.extend(_connections(name, one, other))
        for merge in range(len(preset.merges)):
            node, edge, connection = _ramp(preset, name, merge, y)
            nodes.append(node)
            edges.append(edge)
            connections.append(connection)
    (folder / "road.nod.xml").write_text(f"<nodes>{''.join(nodes)}</nodes>")
    (folder / "road.edg.xml").write_text(f"<edges>{''.join(edges)}</edges>")
    (folder / "road.con.xml").write_text(f"<connections>{''.join(connections)}</connections>")
    network = folder / "road.net.xml"
    command = [str(netconvert), "-n", "road.nod.xml", "-e", "road.edg.xml", "-x", "road.con.xml"]
    command += ["-o", network.name, "--no-turnarounds", "true", "--precision", "6"]
    command += ["--offset.disable-normalization", "true", "--xml-validation", "never"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"netconvert failed: {done.stderr.strip()}")
    return network


def _sections(preset: Preset) -> list[_Section]:
    """Return the sections of one carriageway, from its start to its end."""
    end = preset.run_up + preset.stretch + MARGIN
    sections = []
    begin, name = 0.0, "road"
    for number, merge in enumerate(preset.merges):
        joins, ends = preset.run_up + merge.at, preset.run_up + merge.end
        sections.append(_Section(name, begin, joins, preset.lanes))
        sections.append(_Section(f"merge{number}", joins, ends, preset.lanes + 1))
        begin, name = ends, f"road{number + 1}"
    sections.append(_Section(name, begin, end, preset.lanes))
    sections.append(_Section("exit", end, end + preset.run_out, preset.lanes))
    return sections


def _node(name: str, x: float, y: float) -> str:
    return f'<node id="{name}" x="{x}" y="{y}"/>'


def _edge(preset: Preset, name: str, section: _Section, sections: list[_Section]) -> str:
    """Return the edge of a section, whose end is where the next one begins."""
    after = sections.index(section) + 1
    end = f"{name}_{sections[after].name}" if after < len(sections) else f"{name}_end"
    held_up = section.name == "exit" and preset.bottleneck is not None
    speed = preset.bottleneck if held_up else FREE_SPEED
    limits = () if held_up else preset.lane_limits
    if limits and section.lanes > preset.lanes:
        limits = (limits[0], *limits)
    lanes = "".join(f'<lane index="{index}" speed="{limit}"/>' for index, limit in enumerate(limits))
    return (
        f'<edge id="{name}_{section.name}" from="{name}_{section.name}" to="{end}" '
        f'numLanes="{section.lanes}" width="{preset.lane_width}" speed="{speed}">{lanes}</edge>'
    )


def _connections(name: str, one: _Section, other: _Section) -> Iterator[str]:
    """Yield the connections of the lanes of two sections, counted from the left."""
    for lane in range(1, min(one.lanes, other.lanes) + 1):
        yield (
            f'<connection from="{name}_{one.name}" to="{name}_{other.name}" '
            f'fromLane="{one.lanes - lane}" toLane="{other.lanes - lane}"/>'
        )


def _ramp(preset: Preset, name: str, number: int, y: float) -> tuple[str, str, str]:
    """Return the node, edge and connection of an on-ramp, which runs beside the road before it joins it."""
    joins = preset.run_up + preset.merges[number].at
    beside = y - (preset.lanes + 0.5) * preset.lane_width
    start, ramp, merge = f"{name}_start{number}", f"{name}_{RAMP_EDGE}{number}", f"{name}_merge{number}"
    edge = (
        f'<edge id="{ramp}" from="{start}" to="{merge}" numLanes="1" width="{preset.lane_width}" '
        f'spreadType="center" shape="{joins - RAMP_RUN_UP},{beside} {joins},{beside}" speed="{RAMP_LIMIT}"/>'
    )
    connection = f'<connection from="{ramp}" to="{merge}" fromLane="0" toLane="0"/>'
    return _node(start, joins - RAMP_RUN_UP, beside), edge, connection
