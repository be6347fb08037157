"""`drlsl data`: look at recordings of traffic, and make new ones."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from drlsl.cli.options import recordings
from drlsl.cli.stopping import cleaned_up_on_signal
from drlsl.errors import UserError

if TYPE_CHECKING:
    from rich.table import Table

    from drlsl.traffic import Merge, Recording, RecordingReport, Source, Spread

app = typer.Typer(help="Look at recordings of traffic, and make new ones.", no_args_is_help=True)

PathArguments = Annotated[
    list[str],
    typer.Argument(
        metavar="PATH...",
        help="A bundled recording's name, a file, a folder, a data set's root or a .zip of one, or a "
        "pattern of these; #PART chooses of several, as in #07, #us-101 or #*.",
        show_default=False,
        autocompletion=recordings,
    ),
]
LaneLimits = Annotated[
    str | None,
    typer.Option(
        metavar="M/S,...",
        help="Speed limits in m/s that drivers keep, from the right lane to the left; one: all lanes.",
    ),
]
Merges = Annotated[
    list[str] | None,
    typer.Option(
        metavar="AT:LENGTH:FLOW",
        help="An on-ramp on the right of each direction: its lane begins AT metres into the stretch and "
        "ends LENGTH metres later; FLOW vehicles per hour come from it. May be repeated.",
    ),
]
TrafficOption = Annotated[
    Literal["recorded", "reactive"] | None,
    typer.Option(
        help="Whether the vehicles are to brake for an ego, as the recording then says; the preset's by "
        "default."
    ),
]
FillGaps = Annotated[
    float | None,
    typer.Option(metavar="SECONDS", help="Fill gaps in tracks of at most so long; a note counts them."),
]
Smooth = Annotated[
    float | None,
    typer.Option(metavar="SECONDS", help="Velocities from positions, by straight lines through so long."),
]
Every = Annotated[int, typer.Option(min=1, help="Keep every n-th frame.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]


@app.command("list")
def list_recordings(as_json: JsonOption = False) -> None:
    """List the recordings that come with DRLSL."""
    from drlsl.traffic import bundled_recordings, load_recording

    recordings = [load_recording(name) for name in bundled_recordings()]
    if as_json:
        rows = [
            {
                "name": recording.name,
                "duration_s": recording.duration,
                "frame_rate_hz": recording.frame_rate,
                "vehicles": len(recording.vehicle_class),
                "lanes": {way.value: len(recording.lanes_of(way)) for way in recording.directions},
            }
            for recording in recordings
        ]
        typer.echo(json.dumps(rows, indent=2))
        return
    from rich.console import Console
    from rich.table import Table

    table = Table(title="Bundled recordings")
    table.add_column("recording", no_wrap=True)
    for heading in ("min", "frames\n/s", "vehicles"):
        table.add_column(heading, no_wrap=True)
    table.add_column("lanes")
    for recording in recordings:
        ways = ((way, len(recording.lanes_of(way))) for way in recording.directions)
        table.add_row(
            recording.name,
            f"{recording.duration / 60:.1f}",
            f"{recording.frame_rate:g}",
            str(len(recording.vehicle_class)),
            ", ".join(f"{count} {_words(way.value)}" for way, count in ways),
        )
    Console().print(table)


@app.command()
def info(
    paths: PathArguments,
    as_json: JsonOption = False,
    cache: Annotated[bool, typer.Option(help="Use and keep a copy that loads faster.")] = True,
) -> None:
    """Describe recordings: vehicles, lanes, speeds, gaps, and what was dropped from their files."""
    from dataclasses import asdict

    from drlsl.traffic import load_source, recording_report

    sources, several = _sources(paths)
    reports = []
    for source in sources:
        report = recording_report(load_source(source, cache=cache))
        if as_json:
            reports.append(asdict(report))
        else:
            _print_report(report, source.format)
    if as_json:
        typer.echo(json.dumps(reports if several else reports[0], indent=2))


@app.command()
@cleaned_up_on_signal()
def convert(
    paths: PathArguments,
    out: Annotated[
        Path,
        typer.Option(help="Folder to write, or a file that ends in .parquet or .npz.", show_default=False),
    ],
    to: Annotated[
        Literal["highd", "parquet", "npz"] | None,
        typer.Option(
            help="The format; parquet if the file to write is called so. Episodes: parquet or npz.",
            show_default="highd",
        ),
    ] = None,
    fill_gaps: FillGaps = None,
    smooth: Smooth = None,
    every: Every = 1,
    force: Annotated[bool, typer.Option("--force", help="Replace what exists.")] = False,
) -> None:
    """Write recordings in highD's layout or, exactly, as Parquet (extra `parquet`); repair them if asked.

    Episodes, files or folders of them, are written as Parquet or as .npz.
    """
    from drlsl.traffic import load_source

    if episodes := _episodes(paths):
        repairs = fill_gaps is not None or smooth is not None or every != 1
        _convert_episodes(episodes, out, to, repairs=repairs, force=force)
        return
    if to == "npz" or out.suffix == ".npz":
        raise UserError(f"{', '.join(paths)}: no episodes, which alone are written as .npz")
    kind = to or ("parquet" if out.suffix == ".parquet" else "highd")
    sources, _ = _sources(paths)
    for source, target in zip(sources, _targets(sources, out, kind, force=force), strict=True):
        recording = _edited(load_source(source), fill_gaps=fill_gaps, smooth=smooth, every=every)
        _write(recording, target, kind, force=force)


@app.command()
@cleaned_up_on_signal()
def cut(
    path: Annotated[str, typer.Argument(metavar="PATH", show_default=False, autocompletion=recordings)],
    out: Annotated[
        Path,
        typer.Option(help="Folder to write, or a file that ends in .parquet.", show_default=False),
    ],
    begin: Annotated[float | None, typer.Option(help="First second.")] = None,
    end: Annotated[float | None, typer.Option(help="Second before which it ends.")] = None,
    x_from: Annotated[float | None, typer.Option(help="Where the stretch begins, in metres.")] = None,
    x_to: Annotated[float | None, typer.Option(help="Where the stretch ends, in metres.")] = None,
    fill_gaps: FillGaps = None,
    smooth: Smooth = None,
    every: Every = 1,
    force: Annotated[bool, typer.Option("--force", help="Replace what exists.")] = False,
) -> None:
    """Write a part of a recording: a span of time, a stretch of road."""
    from math import inf

    from drlsl.traffic import cut, load_recording

    kind = "parquet" if out.suffix == ".parquet" else "highd"
    _check(out, kind, force=force)
    part = cut(
        load_recording(path),
        seconds=(-inf if begin is None else begin, inf if end is None else end),
        metres=(-inf if x_from is None else x_from, inf if x_to is None else x_to),
    )
    part = _edited(part, fill_gaps=fill_gaps, smooth=smooth, every=every)
    _write(part, out, kind, force=force)


def _sources(paths: Sequence[str]) -> tuple[list[Source], bool]:
    """Return the recordings that paths mean, and whether there are or could be several."""
    from drlsl.traffic import find_sources

    sources = [source for path in paths for source in find_sources(path)]
    return sources, len(sources) > 1


def _episodes(paths: Sequence[str]) -> list[Path]:
    """Return the files of the episodes that paths name, none if they name recordings.

    Raises:
        UserError: they name both.
    """
    from drlsl.cli.episode_folder import episodes_of

    found = [episodes_of(Path(path)) for path in paths]
    if any(found) and not all(found):
        other = next(path for path, files in zip(paths, found, strict=True) if not files)
        raise UserError(f"{other}: no episodes, as others are that are named; convert these apart")
    return [one for files in found for one in files]


def _convert_episodes(episodes: list[Path], out: Path, to: str | None, *, repairs: bool, force: bool) -> None:
    """Write episodes in another format, and say what was written.

    Raises:
        UserError: a flag is none for episodes, or they cannot be read or written.
    """
    from drlsl.cli.episode_folder import convert_episodes
    from drlsl.traffic import counted

    if repairs:
        raise UserError("--fill-gaps, --smooth and --every are for recordings, not for episodes")
    kind = to or out.suffix.removeprefix(".")
    if kind not in ("npz", "parquet"):
        raise UserError(
            f"--out {out}: episodes become .npz or .parquet; name such a file, or add --to parquet"
        )
    files = convert_episodes(episodes, out, f".{kind}", force=force)
    typer.echo(f"{out}: {counted(len(files), 'episode')}")


def _targets(sources: Sequence[Source], out: Path, kind: str, *, force: bool) -> list[Path]:
    """Return where each recording is to be written: one to `out` itself, several into it.

    Raises:
        UserError: two would be written to one place, or what is there may not be replaced.
    """
    suffix = ".parquet" if kind == "parquet" else ""
    several = len(sources) > 1
    targets = [out / f"{_file_name(one.name)}{suffix}" for one in sources] if several else [out]
    for number, target in enumerate(targets):
        if target in targets[:number]:
            first, second = (sources[at].files[0] for at in (targets.index(target), number))
            raise UserError(
                f"{target}: {first} and {second} would both be called so; convert them one by one"
            )
        _check(target, kind, force=force)
    return targets


def _check(out: Path, kind: str, *, force: bool) -> None:
    """Check that a recording may be written to a folder or file.

    Raises:
        UserError: it exists and `force` is not given, or it cannot be replaced.
    """
    from drlsl.files import not_replaceable
    from drlsl.traffic import check_folder

    if kind == "highd":
        check_folder(out, force=force)
    elif out.exists() and not force:
        raise UserError(f"{out}: exists already; choose another file or add --force to replace it")
    elif what := not_replaceable(out):
        raise UserError(f"{out}: is {what}, expected a file to write")


def _file_name(name: str) -> str:
    """Return the name of a recording as that of a file."""
    return re.sub(r"[^\w.-]+", "-", name)


def _edited(recording: Recording, *, fill_gaps: float | None, smooth: float | None, every: int) -> Recording:
    """Return a recording with the repairs that are asked for."""
    from drlsl import traffic

    if fill_gaps is not None:
        recording = traffic.fill_gaps(recording, fill_gaps)
    if smooth is not None:
        recording = traffic.smooth(recording, smooth)
    return recording if every == 1 else traffic.thin(recording, every)


def _write(recording: Recording, out: Path, kind: str, *, force: bool) -> None:
    """Write a recording, and say what was done to it.

    Raises:
        UserError: it exists and `force` is not given, or it cannot be written.
    """
    from drlsl.traffic import counted, highd_content, write_highd, write_parquet

    _check(out, kind, force=force)
    if kind == "highd":
        write_highd(highd_content(recording), out, force=force)
    else:
        write_parquet(recording, out)
    vehicles = counted(len(recording.vehicle_class), "vehicle")
    typer.echo(f"{out}: {vehicles}, {_seconds(recording.duration)} s at {recording.frame_rate:g} Hz")
    for note in recording.notes:
        typer.echo(f"note: {note}")


def _print_report(report: RecordingReport, kind: str) -> None:
    from rich.console import Console

    from drlsl.traffic import counted

    console = Console()
    for table in (_summary(report, kind), *_lane_tables(report)):
        console.print(table)
    for item in report.dropped:
        console.print(f"dropped: {counted(item.rows, 'row')}: {item.reason}", markup=False, highlight=False)
    for note in report.notes:
        console.print(f"note: {note}", markup=False, highlight=False)


@app.command()
@cleaned_up_on_signal()
def generate(
    out: Annotated[Path, typer.Option(help="Folder to write, in highD layout.", show_default=False)],
    preset: Annotated[
        str,
        typer.Option(
            help="Kind of road and traffic: the name of a bundled recording; flags below change it."
        ),
    ] = "highway-train",
    seed: Annotated[
        int | None, typer.Option(min=0, help="Seed of the traffic; the preset's by default.")
    ] = None,
    minutes: Annotated[float | None, typer.Option(help="Length; the preset's by default.")] = None,
    stretch: Annotated[float | None, typer.Option(help="Metres of road to record.")] = None,
    flow: Annotated[
        float | None, typer.Option(help="Vehicles per hour that want to drive in each direction.")
    ] = None,
    truck_share: Annotated[
        float | None, typer.Option(help="Share of these that are trucks, from 0 to 1.")
    ] = None,
    lane_limits: LaneLimits = None,
    merge: Merges = None,
    traffic: TrafficOption = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the folder if it exists.")] = False,
    compress: Annotated[bool, typer.Option("--compress", help="Write .csv.xz instead of .csv.")] = False,
) -> None:
    """Make a synthetic recording with the traffic simulator SUMO (extra `sumo`)."""
    from dataclasses import replace

    from drlsl.traffic import Traffic, check_folder, find_preset, simulate, write_highd

    check_folder(out, force=force)
    chosen = find_preset(preset)
    flags = {
        "stretch": stretch,
        "flow": flow,
        "truck_share": truck_share,
        "lane_limits": None if lane_limits is None else _lane_limits(lane_limits, chosen.lanes),
        "merges": _merges(merge) if merge else None,
        "traffic": None if traffic is None else Traffic(traffic),
    }
    changes: dict[str, Any] = {name: value for name, value in flags.items() if value is not None}
    chosen = replace(chosen, **changes)
    content = simulate(
        chosen,
        seed=chosen.seed if seed is None else seed,
        minutes=chosen.minutes if minutes is None else minutes,
    )
    write_highd(content, out, force=force, compress=compress)
    typer.echo(f"{out}: {len(content.vehicle_class)} vehicles, {len(content.tracks):,} rows")


def _lane_limits(text: str, lanes: int) -> tuple[float, ...]:
    """Return the limits that --lane-limits gives, one for each lane [m/s].

    Raises:
        UserError: the text is not numbers joined by commas.
    """
    limits = _numbers("--lane-limits", text, ",", "numbers in m/s joined by commas, as in 22.2,27.8,33.3")
    return limits * lanes if len(limits) == 1 else limits


def _merges(texts: Sequence[str]) -> tuple[Merge, ...]:
    """Return the on-ramps that --merge gives, in order along the road.

    Raises:
        UserError: a text is not AT:LENGTH:FLOW.
    """
    from drlsl.traffic import Merge

    merges = []
    for text in texts:
        expected = "AT:LENGTH:FLOW in metres, metres and vehicles per hour, as in 300:250:600"
        numbers = _numbers("--merge", text, ":", expected)
        if len(numbers) != 3:
            raise UserError(f"--merge {text}: expected {expected}")
        merges.append(Merge(*numbers))
    return tuple(sorted(merges, key=lambda merge: merge.at))


def _numbers(flag: str, text: str, mark: str, expected: str) -> tuple[float, ...]:
    """Return the numbers of a flag.

    Raises:
        UserError: there is anything else.
    """
    try:
        return tuple(float(item) for item in text.split(mark))
    except ValueError:
        raise UserError(f"{flag} {text}: expected {expected}") from None


def _words(value: str) -> str:
    return value.replace("_", " ")


def _summary(report: RecordingReport, kind: str) -> Table:
    from rich.table import Table

    from drlsl.traffic import counted

    table = Table(title=report.name, show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    kinds = f"{counted(report.cars, 'car')}, {counted(report.trucks, 'truck')}"
    if report.motorcycles:
        kinds += f", {counted(report.motorcycles, 'motorcycle')}"
    frames = f"{counted(report.frames, 'frame')} at {report.frame_rate_hz:g} Hz"
    rows = {
        "format": kind,
        "duration": f"{_seconds(report.duration_s)} s, {frames}",
        "road": f"{report.x_min_m:.1f} to {report.x_max_m:.1f} m",
        "vehicles": f"{report.vehicles} ({kinds}), at most {report.most_in_one_frame} at once",
        "rows": f"{report.rows:,}, of which {report.rows_off_lane:,} in no lane",
        "gap to leader": _spread(report.gap_m, "m"),
        "time headway": _spread(report.time_headway_s, "s"),
        "lane changes": f"{report.lane_changes}",
        "appearances": f"{report.appearances}, of which {report.appearances_mid_road} mid-road",
        "overlapping boxes": f"{report.overlaps} (pairs, counted once a frame)",
        "lateral speed": f"at most {report.largest_lateral_speed_m_s:.2f} m/s",
        "traffic": f"{report.traffic}, if env.traffic is auto",
    }
    for name, value in rows.items():
        table.add_row(name, value)
    for lane in report.merging_lanes:
        table.add_row(
            "merging lane",
            f"{_words(lane.direction)}, {lane.begin_m:.0f} to {lane.end_m:.0f} m, "
            f"{counted(lane.vehicles, 'vehicle')}",
        )
    return table


def _seconds(duration: float) -> str:
    """Return a duration to tenths, to more digits where it is so short that these would mislead."""
    return f"{duration:.1f}" if duration >= 1.0 else f"{duration:.2g}"


def _spread(spread: Spread | None, unit: str) -> str:
    if spread is None:
        return "none"
    low, middle, high = f"{spread.p5:.1f}", f"{spread.p50:.1f}", f"{spread.p95:.1f}"
    return f"min {spread.minimum:.1f}, 5% {low}, median {middle}, 95% {high} {unit}"


def _lane_tables(report: RecordingReport) -> tuple[Table, Table]:
    """Return the lanes and the traffic in them, apart so that both fit on 60 columns."""
    from rich.table import Table

    road, traffic = Table("lane", "direction", title="Lanes"), Table("lane", title="Traffic in the lanes")
    for table, headings in (
        (road, ("centre\n(m)", "width\n(m)", "limit\n(m/s)", "vehicles")),
        (traffic, ("mean\n(m/s)", "min\n(m/s)", "max\n(m/s)", "vehicles\nper km", "median\ngap (m)")),
    ):
        for heading in headings:
            table.add_column(heading, justify="right", no_wrap=True)
    for lane in report.lanes:
        speed, gap = lane.speed_m_s, lane.gap_m
        speeds = (
            [f"{value:.1f}" for value in (speed.mean, speed.minimum, speed.maximum)] if speed else ["-"] * 3
        )
        road.add_row(
            str(lane.id),
            _words(lane.direction),
            f"{lane.centre_m:.2f}",
            f"{lane.width_m:.2f}",
            f"{lane.speed_limit_m_s:.1f}",
            f"{lane.vehicles:,}",
        )
        median = f"{gap.p50:.1f}" if gap else "-"
        traffic.add_row(str(lane.id), *speeds, f"{lane.density_veh_per_km:.1f}", median)
    return road, traffic
