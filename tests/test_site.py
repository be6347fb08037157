"""The documentation as a site: no warnings, and a page with every name of every room."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

pytest.importorskip("mkdocs", reason="the extra 'docs' is not installed")
pytest.importorskip("mkdocstrings", reason="the extra 'docs' is not installed")

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr
    return folder


def test_every_name_of_every_room_is_described(site: Path) -> None:
    pages = {page.stem: page.read_text(encoding="utf-8") for page in site.glob("api/drlsl*.html")}
    assert {"drlsl", "drlsl.driving", "drlsl.logic", "drlsl.logic.core", "drlsl.learning"} <= pages.keys()
    for room, page in pages.items():
        names = {name for name in import_module(room).__all__ if not name.startswith("__")}
        described = set(re.findall(rf'id="{re.escape(room)}\.(\w+)"', page))
        assert names <= described, f"{room}: {names - described}"


def test_parameters_that_a_base_takes_are_described_with_the_class(site: Path) -> None:
    page = (site / "api" / "drlsl.shield.html").read_text(encoding="utf-8")
    for name in ("LogicShield", "LogicVectorShield"):
        assert f'id="drlsl.shield.{name}.__init__"' in page


def test_the_playground_can_be_reached_and_decides_by_itself(site: Path) -> None:
    assert 'href="playground.html"' in (site / "index.html").read_text(encoding="utf-8")
    page = (site / "playground.html").read_text(encoding="utf-8")
    data = json.loads(re.findall(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)[0])
    assert [one["name"].partition(",")[0] for one in data["episodes"]] == ["scene.json", "mobil"]
    assert all("module" in data["programs"][one["program"]] for one in data["episodes"])


def test_the_first_page_is_the_readme_and_leads_to_the_others(site: Path) -> None:
    first = (site / "index.html").read_text(encoding="utf-8")
    assert "Safe reinforcement learning for highway driving" in first
    assert 'href="verify.html"' in first
    assert (site / "rules" / "highway.pl").read_bytes() == (ROOT / "rules" / "highway.pl").read_bytes()
