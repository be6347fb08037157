"""Add files outside docs/ to the documentation site, an API page for each package, and the playground.

MkDocs loads this file as a hook (mkdocs.yml). A package's page has the names in `__all__` of its `__init__`.
"""

from __future__ import annotations

import re
from contextlib import redirect_stdout
from importlib import import_module
from io import StringIO
from pathlib import Path
from pkgutil import walk_packages
from tempfile import TemporaryDirectory
from types import ModuleType

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from pygments.formatters import HtmlFormatter

import drlsl
from drlsl.cli import run

ROOT = Path(__file__).parents[1]

PAGES = {"index.md": "README.md"} | {
    name: name for name in ("CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md")
}
"""Pages of the site, and the files of the repository that they come from."""

PLAYGROUND = "playground.html"

LINK = re.compile(r"(?<=\]\()(?!https?:|#)([^)#\s]+)")


def rooms() -> list[ModuleType]:
    """Return the packages with public names, except the commands, which have a page of their own."""
    names = ["drlsl", *(found.name for found in walk_packages(drlsl.__path__, "drlsl.") if found.ispkg)]
    found = [import_module(name) for name in names if not name.startswith("drlsl.cli")]
    return [room for room in found if getattr(room, "__all__", None)]


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Put the API pages last in the navigation."""
    assert config.nav is not None
    pages = [{room.__name__: f"api/{room.__name__}.md"} for room in rooms()]
    config.nav.append({"API": ["api/index.md", *pages]})
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages, and each file outside docs/ that a page links to."""
    for place, source in PAGES.items():
        files.append(File.generated(config, place, content=(ROOT / source).read_text(encoding="utf-8")))
    listed = [f"- [`{room.__name__}`]({room.__name__}.md): {_summary(room)}" for room in rooms()]
    text = "\n".join(["# The Python interface", "", *listed, ""])
    files.append(File.generated(config, "api/index.md", content=text))
    for room in rooms():
        files.append(File.generated(config, f"api/{room.__name__}.md", content=_page(room)))
    files.append(File.generated(config, PLAYGROUND, content=_playground()))
    colours = HtmlFormatter().get_style_defs(".highlight")
    files.append(File.generated(config, "css/code.css", content=colours))
    for file in [*files]:
        if file.src_uri.endswith(".md"):
            _add_targets(file, files, config)
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Redirect links out of docs/ to the places of their targets in the site."""
    return LINK.sub(lambda link: _in_site(link.group(1), page.file), markdown)


def _summary(room: ModuleType) -> str:
    return (room.__doc__ or "").strip().splitlines()[0]


def _page(room: ModuleType) -> str:
    names = [f"::: {room.__name__}.{name}" for name in sorted(room.__all__) if not name.startswith("__")]
    return "\n\n".join([f"# `{room.__name__}`", _summary(room), *names]) + "\n"


def _in_site(link: str, file: File) -> str:
    """Return a link from a page to a file of the repository as it is in the site."""
    target = _target(link, file)
    if target is None:
        return link
    place = next((place for place, source in PAGES.items() if source == target), target)
    return place.removeprefix("docs/")


def _target(link: str, file: File) -> str | None:
    """Return the file of the repository that a page links to; None for a link within the API."""
    if file.src_uri.startswith("api/"):
        return None
    home = ROOT if file.src_uri in PAGES else ROOT / "docs"
    return (home / link).resolve().relative_to(ROOT).as_posix()


def _add_targets(file: File, files: Files, config: MkDocsConfig) -> None:
    for link in LINK.findall(file.content_string):
        target = _target(link, file)
        known = target is None or target.startswith("docs/") or target in PAGES.values()
        if target is None or known or files.get_file_from_path(target):
            continue
        files.append(File.generated(config, target, abs_src_path=str(ROOT / target)))


def _playground() -> str:
    """Return the page of a scene and a drive, in which vehicles can be dragged and the rules answer."""
    with TemporaryDirectory() as folder:
        drives, page = Path(folder) / "drives", Path(folder) / PLAYGROUND
        _drlsl(
            "eval", "mobil", "--recording", "overtake-test", "--episodes", "1", "--episodes-out", str(drives)
        )
        shown = [ROOT / "examples" / "scene.json", *drives.glob("*-shield-on-*")]
        _drlsl("view", *map(str, shown), "--out", str(page), "--title", "Playground")
        return page.read_text(encoding="utf-8")


def _drlsl(*arguments: str) -> None:
    """Run a command without its words.

    Raises:
        RuntimeError: it failed; stderr says why.
    """
    with redirect_stdout(StringIO()):
        status = run(arguments)
    if status:
        raise RuntimeError(f"drlsl {' '.join(arguments)}: exit status {status}")
