"""`drlsl config`: settings in full, and a schema that accepts what the reader accepts."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import yaml

from drlsl.cli import run
from drlsl.learning import load_config, make_config, preset_names, preset_values


def printed(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert run(["config", *arguments]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("preset", preset_names())
def test_a_preset_in_full_is_a_file_to_train_with(
    preset: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "full.yaml"
    path.write_text(printed(capsys, "show", preset))
    assert load_config(path) == make_config(preset_values(preset), "test")
    assert printed(capsys, "show", str(path)) == path.read_text()


def test_a_file_gets_the_defaults(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("learning:\n  discount: 0.5\n")
    found = yaml.safe_load(printed(capsys, "show", str(path)))
    assert found["learning"]["discount"] == 0.5
    assert found["learning"]["batch_size"] == 128


@pytest.mark.parametrize(
    ("source", "part"),
    [
        ("quik", "quik: expected a preset (paper, paper-code, quick, tiny), a run folder or a file"),
        (".", ".: no run here"),
    ],
)
def test_what_means_nothing_is_refused(
    source: str,
    part: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["config", "show", source]) == 2
    error = capsys.readouterr().err
    assert part in error
    assert error.count("\n") == 1


jsonschema = pytest.importorskip("jsonschema")


def schema(capsys: pytest.CaptureFixture[str], of: str) -> Any:
    found = json.loads(printed(capsys, "schema", of))
    jsonschema.Draft202012Validator.check_schema(found)
    return jsonschema.Draft202012Validator(found)


def test_the_schema_accepts_settings_and_refuses_slips(capsys: pytest.CaptureFixture[str]) -> None:
    checker = schema(capsys, "train")
    for preset in preset_names():
        assert checker.is_valid(preset_values(preset))
        assert checker.is_valid(yaml.safe_load(printed(capsys, "show", preset)))
    for wrong in ({"episode": 1}, {"learning": {"discount": 2}}, {"method": "ppo"}, {"env": {"lanes": 3}}):
        assert not checker.is_valid(wrong)
    properties = checker.schema["properties"]
    assert properties["episodes"]["description"] == "Episodes of training."


def test_the_schema_of_a_study_accepts_the_studies_that_ship(capsys: pytest.CaptureFixture[str]) -> None:
    checker = schema(capsys, "study")
    assert run(["study", "--print-config"]) == 0
    assert checker.is_valid(yaml.safe_load(capsys.readouterr().out))
    assert not checker.is_valid({"seeds": 3})
