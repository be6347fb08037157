"""Text files and JSON at the edges of what they may hold."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drlsl.driving.scene import load_scene
from drlsl.errors import UserError
from drlsl.files import plain_text, read_yaml
from drlsl.files.plain_text import parse_json, printable, read_text, to_json


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{}".encode("utf-16"), "not UTF-8 text .* looks like UTF-16; save it as UTF-8"),
        (b"caf\xe9", r"not UTF-8 text \(byte 3\); save it as UTF-8"),
    ],
)
def test_files_of_other_encodings(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "file.json"
    path.write_bytes(content)
    with pytest.raises(UserError, match=message):
        read_text(path)


def test_a_byte_order_mark_is_skipped(tmp_path: Path) -> None:
    path = tmp_path / "file.json"
    path.write_bytes(b"\xef\xbb\xbf{}")
    assert read_text(path) == "{}"


def test_a_file_that_never_ends_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(plain_text, "LARGEST_FILE", 2**20)
    with pytest.raises(UserError, match="cannot read the scene /dev/zero: it is larger than 1 MiB"):
        read_text("/dev/zero", "the scene")
    with pytest.raises(UserError, match=r"cannot read the scene .*: No such file"):
        read_text(tmp_path / "nofile", "the scene")
    with pytest.raises(UserError, match=r"cannot read .*: Is a directory"):
        read_text(tmp_path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"a": 1, "b": {"c": 1, "c": 2}}', 'f: the key "c" is given 2 times; give it once'),
        ('{"a": %s}' % ("9" * 5000), "f: an integer of 5000 digits"),
        ("[" * 100_000, "f: nested too deeply"),
        ('{"a": 1,\n "b" 2}', "f:2:6: not JSON: "),
    ],
)
def test_json_that_is_refused(text: str, message: str) -> None:
    with pytest.raises(UserError, match=message):
        parse_json(text, "f")


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
)


def as_text(value: Any) -> Any:
    if isinstance(value, list):
        return [as_text(item) for item in value]
    if isinstance(value, dict):
        return {name: as_text(item) for name, item in value.items()}
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


@given(VALUES)
def test_what_is_written_reads_back(value: Any) -> None:
    assert parse_json(to_json(value), "f") == as_text(value)


def test_long_integers_are_written_as_text() -> None:
    assert json.loads(to_json({"a": 10**5000})) == {"a": "1" + "0" * 5000}


@given(st.text())
def test_printable_text_is_one_line_and_says_the_same(text: str) -> None:
    shown = printable(text)
    assert shown.isprintable()
    assert "\n" not in shown
    assert (shown == text) == text.isprintable()


def test_a_byte_order_mark_is_skipped_in_scenes_tables_and_configurations(tmp_path: Path) -> None:
    """Rule files have theirs in tests/logic/test_loading.py."""
    scene = Path("examples/scene.json").read_bytes()
    (tmp_path / "scene.json").write_bytes(b"\xef\xbb\xbf" + scene)
    assert load_scene(tmp_path / "scene.json") == load_scene("examples/scene.json")
    (tmp_path / "file.yaml").write_bytes(b"\xef\xbb\xbfepisodes: 3\n")
    assert read_yaml(tmp_path / "file.yaml").values == {"episodes": 3}
