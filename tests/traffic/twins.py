"""The same traffic in every format, in its own units and conventions, made from its documentation.

No row of a data set is in here: a few vehicles drive at steady speeds, and one in each direction changes
lanes.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from pathlib import Path
from typing import Any

from tests.traffic.writing import FOOT, Row, write_highd

ROAD = 300.0
"""Length of the stretch [m]."""

ANGLE = math.radians(17.0)
ORIGIN = (1250.0, -340.0)
"""How the road lies on maps, y upward."""


@dataclass(frozen=True)
class Traffic:
    """Rows in SI units, y downward, and the markings of the lanes; lane ids of rows count from the top."""

    rows: tuple[Row, ...]
    upper: tuple[float, ...]
    lower: tuple[float, ...]
    rate: float

    def strips(self) -> Iterator[tuple[int, int, float, float]]:
        """Id, sign of the traffic, upper and lower border of each lane."""
        number = 0
        for sign, markings in ((-1, self.upper), (1, self.lower)):
            for top, bottom in pairwise(markings):
                number += 1
                yield number, sign, top, bottom

    def lane(self, row: Row) -> tuple[int, int, float, float]:
        return next(strip for strip in self.strips() if strip[2] <= row.y <= strip[3])


def traffic(
    *, rate: float = 25.0, width: float = 4.0, directions: tuple[int, ...] = (-1, 1), median: float = 3.0
) -> Traffic:
    """Two lanes in each direction, three vehicles in each lane, one of which changes to the other lane."""
    upper = (0.0, width, 2 * width) if -1 in directions else ()
    begin = 2 * width + median if upper else 0.0
    lower = (begin, begin + width, begin + 2 * width) if 1 in directions else ()
    rows, vehicle = [], 0
    for number, sign, top, bottom in Traffic((), upper, lower, rate).strips():
        for place in range(4):
            vehicle += 1
            speed = 24.0 + 2.0 * (number % 2) + place
            length = 14.0 if place == 1 else 4.5
            begin_at = -70.0 + 60.0 * place
            for frame in range(1, int(16 * rate)):
                time = (frame - 1) / rate
                way = begin_at + speed * time
                if not length / 2 <= way <= ROAD - length / 2:
                    continue
                change = (1 if number % 2 else -1) * width if place == 2 else 0.0
                part = min(max((time - 1.0) / 6.0, 0.0), 1.0)
                y = (top + bottom) / 2 + change * part**3 * (10 - 15 * part + 6 * part**2)
                vy = change * 30 * part**2 * (1 - part) ** 2 / 6.0
                x = way if sign > 0 else ROAD - way
                rows.append(Row(frame, vehicle, x, y, sign * speed, vy, length, 2.5 if length > 10 else 1.8))
    rear = min(row.x - row.length / 2 for row in rows)
    first = min(row.frame for row in rows) - 1
    rows = [replace(row, x=row.x - rear, frame=row.frame - first) for row in rows]
    made = Traffic(tuple(rows), upper, lower, rate)
    return replace(made, rows=tuple(replace(row, lane=made.lane(row)[0]) for row in rows))


def trucks(made: Traffic) -> list[int]:
    return sorted({row.vehicle for row in made.rows if row.length > 10})


def write_twin(folder: Path, made: Traffic) -> Path:
    """The same in highD's layout."""
    return write_highd(
        folder, made.rows, upper=made.upper, lower=made.lower, frame_rate=made.rate, trucks=trucks(made)
    )


def on_map(x: float, y: float) -> tuple[float, float]:
    """A place on the road on a map, y upward."""
    left = -y
    return (
        ORIGIN[0] + x * math.cos(ANGLE) - left * math.sin(ANGLE),
        ORIGIN[1] + x * math.sin(ANGLE) + left * math.cos(ANGLE),
    )


def velocity_on_map(row: Row) -> tuple[float, float]:
    return (
        row.vx * math.cos(ANGLE) + row.vy * math.sin(ANGLE),
        row.vx * math.sin(ANGLE) - row.vy * math.cos(ANGLE),
    )


def by_vehicle(made: Traffic) -> Iterator[tuple[int, list[Row]]]:
    for vehicle, rows in groupby(
        sorted(made.rows, key=lambda row: (row.vehicle, row.frame)), lambda row: row.vehicle
    ):
        yield vehicle, list(rows)


def by_frame(made: Traffic) -> Iterator[tuple[int, list[Row]]]:
    for frame, rows in groupby(
        sorted(made.rows, key=lambda row: (row.frame, row.vehicle)), lambda row: row.frame
    ):
        yield frame, list(rows)


def _csv(path: Path, header: str, lines: Iterable[str]) -> Path:
    path.write_text("\n".join([header, *lines, ""]))
    return path


def write_exid(folder: Path, made: Traffic, *, pedestrian: bool = False) -> Path:
    """exiD: centres on a map, heading in degrees, lanelets whose columns may hold several values."""
    folder.mkdir()
    lines = []
    for vehicle, rows in by_vehicle(made):
        for age, row in enumerate(rows):
            number, sign, top, bottom = made.lane(row)
            x, y = on_map(row.x, row.y)
            vx, vy = velocity_on_map(row)
            half = 1 if row.x < ROAD / 2 else 2  # each lane is two lanelets, which overlap where they meet
            offset = sign * ((top + bottom) / 2 - row.y)
            lanelet, width, lateral = f"{100 * number + half}", f"{bottom - top:.5f}", f"{offset:.5f}"
            if abs(row.x - ROAD / 2) < 3:
                lanelet, width, lateral = f"{lanelet};900", f"{width};3.9", f"{lateral};0.4"
            heading = math.degrees(math.atan2(vy, vx)) % 360
            lines.append(
                f"7,{vehicle},{row.frame - 1},{age},{x:.5f},{y:.5f},{heading:.5f},{row.width},{row.length},"
                f"{vx:.5f},"
                f"{vy:.5f},0.0,0.0,{row.x:.5f},{lanelet},{width},{lateral}"
            )
    kinds = [
        f"7,{vehicle},{rows[0].frame - 1},{rows[-1].frame - 1},{len(rows)},{rows[0].width},{rows[0].length},"
        f"{'truck' if rows[0].length > 10 else 'van' if vehicle == 3 else 'car'}"
        for vehicle, rows in by_vehicle(made)
    ]
    if pedestrian:
        lines += [
            f"7,99,{frame},{frame},1.0,2.0,0.0,0.0,0.0,1.0,0.0,0.0,0.0,0.0,-1,-1,-1" for frame in range(9)
        ]
        kinds.append("7,99,0,8,9,0.0,0.0,pedestrian")
    _csv(
        folder / "07_tracks.csv",
        "recordingId,trackId,frame,trackLifetime,xCenter,yCenter,heading,width,length,xVelocity,yVelocity,"
        "xAcceleration,yAcceleration,traveledDistance,laneletId,laneWidth,latLaneCenterOffset",
        lines,
    )
    _csv(
        folder / "07_tracksMeta.csv",
        "recordingId,trackId,initialFrame,finalFrame,numFrames,width,length,class",
        kinds,
    )
    _csv(
        folder / "07_recordingMeta.csv",
        "recordingId,locationId,frameRate,speedLimit,weekday,startTime,duration,numTracks,numVehicles,numVRUs,"
        "latLocation,lonLocation,xUtmOrigin,yUtmOrigin,orthoPxToMeter",
        [f"7,0,{made.rate},-1.0,tuesday,10,16.0,16,16,0,50.8,6.1,295620.9,5629717.0,0.1"],
    )
    return folder


def _fcd_cells(made: Traffic, row: Row) -> dict[str, str]:
    vx, vy = velocity_on_map(row)
    heading = math.atan2(vy, vx)
    x, y = on_map(row.x, row.y)
    number, sign, *_ = made.lane(row)
    return {
        "id": f"flow.{row.vehicle}",
        "x": f"{x + row.length / 2 * math.cos(heading):.3f}",
        "y": f"{y + row.length / 2 * math.sin(heading):.3f}",
        "angle": f"{(90 - math.degrees(heading)) % 360:.3f}",
        "type": "lorry" if row.length > 10 else "saloon",
        "speed": f"{math.hypot(vx, vy):.3f}",
        "pos": f"{row.x:.3f}",
        "lane": f"{'east' if sign > 0 else 'west'}_{number}",
        "slope": "0.000",
    }


def _types(folder: Path) -> None:
    (folder / "traffic.rou.xml").write_text(
        '<routes><vType id="saloon" vClass="passenger" length="4.5" width="1.8"/>'
        '<vType id="lorry" vClass="truck" length="14.0" width="2.5"/></routes>\n'
    )


def write_fcd_xml(folder: Path, made: Traffic) -> Path:
    """SUMO's FCD: fronts on a map, angles clockwise from north, and a vehicle beside the road."""
    folder.mkdir()
    _types(folder)
    lines = ["<?xml version='1.0' encoding='UTF-8'?>", "<!-- generated by hand -->", "<fcd-export>"]
    for frame, rows in by_frame(made):
        lines.append(f'    <timestep time="{(frame - 1) / made.rate:.2f}">')
        for row in rows:
            cells = " ".join(f'{name}="{value}"' for name, value in _fcd_cells(made, row).items())
            lines.append(f"        <vehicle {cells}/>")
        lines.append(
            '        <vehicle id="parked" x="-1073741824.00" y="-1073741824.00" angle="-1073741824.00" '
            'type="saloon" '
            'speed="0.00" pos="-1073741824.00" lane="" slope="0.00"/>'
        )
        lines.append("    </timestep>")
    (folder / "fcd.xml").write_text("\n".join([*lines, "</fcd-export>", ""]))
    return folder / "fcd.xml"


def write_fcd_csv(folder: Path, made: Traffic) -> Path:
    folder.mkdir()
    _types(folder)
    names = sorted(_fcd_cells(made, made.rows[0]))
    lines = []
    for frame, rows in by_frame(made):
        for row in rows:
            cells = _fcd_cells(made, row)
            lines.append(";".join([f"{(frame - 1) / made.rate:.2f}", *(cells[name] for name in names)]))
    return _csv(
        folder / "fcd.csv", ";".join(["timestep_time", *(f"vehicle_{name}" for name in names)]), lines
    )


def write_fcd_parquet(folder: Path, made: Traffic) -> Path:
    import pyarrow
    import pyarrow.parquet

    folder.mkdir()
    _types(folder)
    columns: dict[str, list[object]] = {"timestep_time": []}
    for frame, rows in by_frame(made):
        for row in rows:
            columns["timestep_time"].append((frame - 1) / made.rate)
            for name, value in _fcd_cells(made, row).items():
                number = name in ("x", "y", "angle", "speed", "pos", "slope")
                columns.setdefault(f"vehicle_{name}", []).append(float(value) if number else value)
            columns.setdefault("vehicle_edge", []).append(None)
    pyarrow.parquet.write_table(pyarrow.table(columns), folder / "fcd.parquet")
    return folder / "fcd.parquet"


LIMIT = 33.33
"""Speed limit of the lanes of `write_net` [m/s]."""


def write_net(path: Path, made: Traffic) -> Path:
    """SUMO's network of the road: a lane of pedestrians beside it, and a street that crosses above it."""
    edges = []
    for sign, edge in ((-1, "west"), (1, "east")):
        lanes = []
        for number, own, top, bottom in made.strips():
            if own == sign:
                ends = [on_map(x, (top + bottom) / 2) for x in (-20.0, ROAD + 20.0)][::sign]
                shape = " ".join(f"{x:.3f},{y:.3f}" for x, y in ends)
                lanes.append(
                    f'<lane id="{edge}_{number}" index="{number}" disallow="tram rail" speed="{LIMIT}" '
                    f'length="{ROAD + 40}" width="{bottom - top}" shape="{shape}"/>'
                )
        lanes.append(
            f'<lane id="{edge}_9" index="9" allow="pedestrian" speed="1.5" length="9" width="2" '
            f'shape="{shape}"/>'
        )
        edges.append(f'<edge id="{edge}" from="a" to="b" priority="1">{"".join(lanes)}</edge>')
    above = " ".join(f"{x:.3f},{y:.3f}" for x, y in (on_map(150.0, -90.0), on_map(150.0, 90.0)))
    edges.append(f'<edge id="street"><lane id="street_0" speed="13.9" length="180" shape="{above}"/></edge>')
    edges.append(
        f'<edge id=":b" function="internal"><lane id=":b_0" speed="9" length="9" shape="{shape}"/></edge>'
    )
    path.write_text(f'<net version="1.20">\n{"".join(edges)}\n</net>\n')
    return path


def write_xodr(path: Path, made: Traffic) -> Path:
    """OpenDRIVE: one road along x, its left lanes those of traffic to the left, shoulders and a median."""
    start = on_map(0.0, made.upper[-1])

    def lane(number: int, kind: str, width: float) -> str:
        return f'<lane id="{number}" type="{kind}"><width sOffset="0" a="{width}" b="0" c="0" d="0"/></lane>'

    widths = [bottom - top for top, bottom in pairwise(made.upper)]
    left = [lane(number, "driving", width) for number, width in enumerate(reversed(widths), start=1)]
    left.append(lane(len(left) + 1, "shoulder", 2.5))
    right = [lane(-1, "median", made.lower[0] - made.upper[-1])]
    right += [
        lane(-2 - place, "driving", bottom - top) for place, (top, bottom) in enumerate(pairwise(made.lower))
    ]
    right.append(lane(-1 - len(right), "shoulder", 2.5))
    path.write_text(
        '<OpenDRIVE><header revMajor="1" revMinor="4" name="twin" version="1"/>'
        f'<road name="twin" length="{ROAD}" id="7" junction="-1"><planView>'
        f'<geometry s="0" x="{start[0]}" y="{start[1]}" hdg="{ANGLE}" length="{ROAD}"><line/></geometry>'
        f'</planView><lanes><laneSection s="0"><left>{"".join(reversed(left))}</left>'
        f'<center><lane id="0" type="none"/></center><right>{"".join(right)}</right></laneSection></lanes>'
        "</road></OpenDRIVE>\n"
    )
    return path


TGSIM_SPELLINGS: dict[str, Callable[[str], str]] = {
    "I-90": lambda name: name,
    "I-294": lambda name: name.replace("_", "-"),
    "I-395": lambda name: {"id": "ID"}.get(name, name),
}


def write_tgsim(path: Path, made: Traffic, spelling: str = "I-90") -> Path:
    """TGSIM: metres on an image, y downward, 10 Hz, lanes from the left, two runs."""
    names = (
        "id,time,xloc_kf,yloc_kf,lane_kf,speed_kf,acceleration_kf,length_smoothed,width_smoothed,type_most_common,"
        "av,run_index"
    )
    lines = []
    for run in (1, 2):
        for row in made.rows:
            x, y = on_map(row.x, row.y)
            kind = "large-vehicle" if row.length > 10 else "small-vehicle"
            lines.append(
                f"{row.vehicle},{(row.frame - 1) / made.rate:.1f},{x + 9 * run:.4f},{-y:.4f},{row.lane},"
                f"{math.hypot(row.vx, row.vy):.4f},0.0,{row.length},{row.width},{kind},no,{run}"
            )
    return _csv(path, ",".join(map(TGSIM_SPELLINGS[spelling], names.split(","))), lines)


def write_i24(path: Path, made: Traffic) -> Path:
    """I-24 MOTION: a document for each vehicle, feet, rears, north upward, Unix seconds."""
    documents = []
    for vehicle, rows in by_vehicle(made):
        sign = 1 if rows[0].vx > 0 else -1
        x = [(101_000.0 + row.x - sign * row.length / 2) / FOOT for row in rows]
        time = [1_669_118_400.0 + (row.frame - 1) / made.rate for row in rows]
        documents.append(
            {
                "_id": {"$oid": f"{vehicle:024x}"},
                "timestamp": time,
                "first_timestamp": time[0],
                "last_timestamp": time[-1],
                "x_position": x,
                "y_position": [(60.0 - row.y) / FOOT for row in rows],
                "starting_x": x[0],
                "ending_x": x[-1],
                "length": rows[0].length / FOOT,
                "width": rows[0].width / FOOT,
                "height": 5.0,
                "direction": sign,
                "coarse_vehicle_class": 4 if rows[0].length > 10 else 0,
                "fragment_ids": [],
            }
        )
    path.write_text(json.dumps(documents))
    return path


def write_commonroad(path: Path, made: Traffic, *, version: str = "2020a", speeds: bool = True) -> Path:
    """CommonRoad: lanelets in the direction of travel, obstacles by their centres, time steps."""
    lines = [
        "<?xml version='1.0' encoding='UTF-8'?>",
        f'<commonRoad timeStepSize="{1 / made.rate}" commonRoadVersion="{version}" '
        'benchmarkID="ZAM_Twin-1_1_T-1">',
    ]
    if version == "2020a":
        lines.append(
            "<location><geoNameId>-999</geoNameId><gpsLatitude>999</gpsLatitude><gpsLongitude>999</gpsLongitude>"
            "</location><scenarioTags><highway/></scenarioTags>"
        )
    for number, sign, top, bottom in made.strips():
        along = [0.0, ROAD / 3, ROAD][::sign]
        sides = (top, bottom) if sign > 0 else (bottom, top)
        lines.append(f'<lanelet id="{1000 + number}">')
        for name, y in zip(("leftBound", "rightBound"), sides, strict=True):
            points = (on_map(x, y) for x in along)
            lines.append(
                f"<{name}>"
                + "".join(f"<point><x>{x!r}</x><y>{y!r}</y></point>" for x, y in points)
                + f"</{name}>"
            )
        lines.append("</lanelet>")
    tag = "obstacle" if version == "2018b" else "dynamicObstacle"
    for vehicle, rows in by_vehicle(made):
        kind = "truck" if rows[0].length > 10 else "car"
        lines.append(f'<{tag} id="{vehicle}">' + ("<role>dynamic</role>" if version == "2018b" else ""))
        lines.append(
            f"<type>{kind}</type><shape><rectangle><length>{rows[0].length}</length><width>{rows[0].width}</width>"
            "</rectangle></shape>"
        )
        states = [
            _state(row, "initialState" if place == 0 else "state", speeds) for place, row in enumerate(rows)
        ]
        lines.append(states[0] + "<trajectory>" + "".join(states[1:]) + f"</trajectory></{tag}>")
    path.write_text("\n".join([*lines, "</commonRoad>", ""]))
    return path


def _state(row: Row, tag: str, speeds: bool) -> str:
    x, y = on_map(row.x, row.y)
    vx, vy = velocity_on_map(row)
    speed = f"<velocity><exact>{math.hypot(vx, vy)!r}</exact></velocity>" if speeds else ""
    return (
        f"<{tag}><position><point><x>{x!r}</x><y>{y!r}</y></point></position>"
        f"<orientation><exact>{math.atan2(vy, vx)!r}</exact></orientation><time><exact>{row.frame - 1}"
        "</exact></time>"
        f"{speed}</{tag}>"
    )


def write_automatum(folder: Path, made: Traffic, *, world: bool = True) -> Path:
    """AUTOMATUM: a JSON of objects with vectors, and the road as OpenDRIVE, whose lanes' widths are read."""
    folder.mkdir()
    objects = []
    for vehicle, rows in by_vehicle(made):
        points = [on_map(row.x, row.y) for row in rows]
        speeds = [velocity_on_map(row) for row in rows]
        heading = [math.atan2(vy, vx) for vx, vy in speeds]
        one = {
            "UUID": f"obj-{vehicle}",
            "objType": "truck" if rows[0].length > 10 else "car",
            "length": rows[0].length,
            "width": rows[0].width,
            "time": [(row.frame - 1) / made.rate for row in rows],
            "x_vec": [x for x, _ in points],
            "y_vec": [y for _, y in points],
            "psi_vec": heading,
            "vx_vec": [math.hypot(*speed) for speed in speeds],
            "vy_vec": [0.0 for _ in rows],
            "lane_id_vec": [-made.lane(row)[1] * row.lane for row in rows],
            "road_id_vec": [1 for _ in rows],
            "tth_dict_vec": [{"front_ego": None} for _ in rows],
        }
        if world:
            one |= {"vx_vec_world": [vx for vx, _ in speeds], "vy_vec_world": [vy for _, vy in speeds]}
        objects.append(one)
    objects.append({"UUID": "p", "objType": "pedestrians", "x_vec": [0.0, 1.0]})
    world_facts = {"Release": 3.0, "UUID": "made", "videoInfo": {"fps": made.rate}, "objects": objects}
    (folder / "dynamicWorld.json").write_text(json.dumps(world_facts))
    lanes = "".join(
        f'<lane id="{-sign * number}" type="driving"><width sOffset="0" a="{bottom - top}" b="0" c="0" '
        'd="0"/></lane>'
        for number, sign, top, bottom in made.strips()
    )
    (folder / "staticWorld.xodr").write_text(
        '<OpenDRIVE><road id="1"><lanes><laneSection '
        f's="0">{lanes}</laneSection></lanes></road></OpenDRIVE>\n'
    )
    return folder


def write_osi(path: Path, made: Traffic, *, speeds: bool = True, roads: bool = True) -> Path:
    """ASAM OSI: GroundTruth messages, boxes by their centres, the road in the first message."""
    import betterosi as osi

    with osi.Writer(str(path)) as writer:
        for frame, rows in by_frame(made):
            seconds, nanos = divmod(round((frame - 1) / made.rate * 1e9), 10**9)
            message = osi.GroundTruth(
                version=osi.InterfaceVersion(version_major=3, version_minor=8, version_patch=0),
                timestamp=osi.Timestamp(seconds=seconds, nanos=nanos),
                moving_object=[_osi_object(osi, made, row, speeds) for row in rows],
            )
            if roads and frame == made.rows[0].frame:
                _osi_road(osi, made, message)
            writer.add(message)
    return path


def _osi_object(osi: Any, made: Traffic, row: Row, speeds: bool) -> Any:
    x, y = on_map(row.x, row.y)
    vx, vy = velocity_on_map(row)
    kind = osi.MovingObject.VehicleClassification.Type
    return osi.MovingObject(
        id=osi.Identifier(value=row.vehicle),
        type=osi.MovingObject.Type.VEHICLE,
        base=osi.BaseMoving(
            position=osi.Vector3d(x=x, y=y, z=0.0),
            dimension=osi.Dimension3d(length=row.length, width=row.width, height=1.5),
            orientation=osi.Orientation3d(yaw=math.atan2(vy, vx)),
            **({"velocity": osi.Vector3d(x=vx, y=vy, z=0.0)} if speeds else {}),
        ),
        assigned_lane_id=[osi.Identifier(value=1000 + row.lane)],
        vehicle_classification=osi.MovingObject.VehicleClassification(
            type=kind.HEAVY_TRUCK if row.length > 10 else kind.CAR
        ),
    )


def _osi_road(osi: Any, made: Traffic, message: Any) -> None:
    for number, sign, top, bottom in made.strips():
        sides = (top, bottom) if sign > 0 else (bottom, top)
        for side, y in zip((1, 2), sides, strict=True):
            points = [on_map(x, y) for x in (0.0, ROAD / 2, ROAD)]
            message.lane_boundary.append(
                osi.LaneBoundary(
                    id=osi.Identifier(value=10 * number + side),
                    boundary_line=[
                        osi.LaneBoundary.BoundaryPoint(position=osi.Vector3d(x=x, y=y, z=0.0))
                        for x, y in points
                    ],
                )
            )
        message.lane.append(
            osi.Lane(
                id=osi.Identifier(value=1000 + number),
                classification=osi.Lane.Classification(
                    type=osi.Lane.Classification.Type.DRIVING,
                    left_lane_boundary_id=[osi.Identifier(value=10 * number + 1)],
                    right_lane_boundary_id=[osi.Identifier(value=10 * number + 2)],
                ),
            )
        )
