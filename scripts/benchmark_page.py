"""Write docs/benchmark.json, benchmark.png and the tables of docs/benchmark.md from a finished study.

    python scripts/benchmark_page.py STUDY_FOLDER [DOCS_FOLDER]

What stands in docs/benchmark.md above the marker is written by people and kept.
"""

import json
import shutil
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from drlsl.study import StudyFolder, benchmark, collect

DOCS = Path(__file__).parents[1] / "docs"

MARKER = "<!-- what follows is made by scripts/benchmark_page.py -->"

COLUMNS: Mapping[str, tuple[str, str]] = {
    "time_saved": ("time saved", ".1%"),
    "time_saved_interval": ("interval", ".1%"),
    "at_fault": ("at fault", "d"),
    "excused": ("excused", "d"),
    "off_road": ("off-road", "d"),
    "completed": ("completed", "d"),
    "lane_changes_per_km": ("changes/km", ".2f"),
    "windows_per_km": ("windows/km", ".2f"),
    "interventions_per_km": ("interventions/km", ".2f"),
    "headway_5": ("headway 5 % [s]", ".2f"),
    "headway_50": ("headway 50 % [s]", ".2f"),
    "short_ttc": ("TTC < 4 s", ".2%"),
    "hard_braking": ("hard braking", ".2%"),
    "jerk_rms": ("RMS jerk [m/s³]", ".2f"),
    "imposed_braking": ("imposed braking [m/s²]", ".2f"),
}
"""Keys of the benchmark, with the heading and the format of each column."""


def table(outcomes: Mapping[str, Mapping[str, Any]], labels: Mapping[str, str]) -> str:
    """Return the methods of one scenario as a table in Markdown."""
    head = ["method", *(heading for heading, _ in COLUMNS.values())]
    lines = [f"| {' | '.join(head)} |", f"| --- |{' --: |' * len(COLUMNS)}"]
    for name, outcome in outcomes.items():
        cells = [_cell(outcome[key], form) for key, (_, form) in COLUMNS.items()]
        lines.append(f"| {labels[name]} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _cell(value: Any, form: str) -> str:
    if value is None:
        return "-"
    if isinstance(value, list):
        return f"{value[0]:{form}} to {value[1]:{form}}"
    return format(value, form)


def main(study: str, docs: str = str(DOCS)) -> None:
    """Write the three files; the picture is that of the study's report."""
    folder = StudyFolder.open(Path(study))
    results = collect(folder)
    labels = {name: method.label for name, method in results.study.methods.items()}
    on, off = benchmark(results), benchmark(results, "off")
    Path(docs, "benchmark.json").write_text(json.dumps(on, indent=1) + "\n", encoding="utf-8")
    shutil.copyfile(folder.report / "figures" / "outcome.png", Path(docs, "benchmark.png"))
    page = Path(docs, "benchmark.md")
    text = page.read_text(encoding="utf-8") if page.exists() else "# Benchmark\n\n"
    parts = [text.partition(MARKER)[0].rstrip(), MARKER]
    for test, scenario in results.study.tests.items():
        parts += [f"## {scenario.label}", "Shield on:", table(on[test], labels)]
        parts += ["Shield off:", table(off[test], labels)]
    page.write_text("\n\n".join(parts) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
