"""The powers of growth on docs/performance.md are slopes of lines, and its table has every curve."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scripts.growth import CURVES, MARKER, memory_power, power, table, write_page

PAGE = Path(__file__).parents[1] / "docs" / "performance.md"
SIZES = (1.0, 10.0, 100.0, 1000.0, 10_000.0)


@given(st.floats(0.1, 3.0), st.floats(1e-6, 1e3))
def test_the_power_of_a_power_is_that_power(exponent: float, factor: float) -> None:
    assert power(SIZES, [factor * size**exponent for size in SIZES]) == pytest.approx(exponent)


def test_what_does_not_grow_at_first_does_not_hide_what_does_later() -> None:
    assert power(SIZES, [5.0, 5.0, 100.0, 1000.0, 10_000.0]) == pytest.approx(1.0)


def test_memory_counts_from_the_smallest_size() -> None:
    def points(*peaks: float) -> list[dict[str, float]]:
        return [{"size": size, "peak_mb": peak} for size, peak in zip(SIZES, peaks, strict=True)]

    assert memory_power(points(150, 151, 160, 250, 1150)) == pytest.approx(1.0)
    assert memory_power(points(150, 151, 150, 152, 155)) is None


def test_the_page_is_written_below_its_marker(tmp_path: Path) -> None:
    found = {
        name: [{"size": size, "s": size / 1e4, "peak_mb": 100.0} for size in curve.sizes]
        for name, curve in CURVES.items()
    }
    (tmp_path / "performance.md").write_text(f"Kept.\n\n{MARKER}\n\nold\n", encoding="utf-8")
    write_page(found, tmp_path)
    text = (tmp_path / "performance.md").read_text(encoding="utf-8")
    assert text == f"Kept.\n\n{MARKER}\n\n{table(found)}\n"
    assert (tmp_path / "growth.png").read_bytes().startswith(b"\x89PNG")


def test_the_page_has_every_curve() -> None:
    text = PAGE.read_text(encoding="utf-8").partition(MARKER)[2]
    rows = [row.split(" | ") for row in text.splitlines() if row.startswith("| ")][1:]
    expected = [(curve.title, f"{curve.sizes[-1]:,} {curve.of}") for curve in CURVES.values()]
    assert [(row[0].removeprefix("| "), row[1].split(" to ")[1]) for row in rows] == expected
