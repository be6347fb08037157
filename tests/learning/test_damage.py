"""One flipped bit anywhere in what a run reads back: refused by name, or of no consequence."""

import json
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch

from drlsl.errors import UserError
from drlsl.files import open_values, seal_values
from drlsl.learning import RunFolder, Session, checkpoint, load_state
from drlsl.learning.config import TrainConfig

from .test_session import flat, train_whole

pytestmark = pytest.mark.usefixtures("fake_driving")

SAMPLE = 100
FLIPS = [pytest.param(SAMPLE, id="sample"), pytest.param(500, id="all", marks=pytest.mark.slow)]


@pytest.fixture
def root(tmp_path: Path, tiny_config: TrainConfig) -> Path:
    train_whole(tmp_path / "run", tiny_config)
    return tmp_path / "run"


def flipped(content: bytes, count: int) -> list[bytes]:
    """Copies with one bit of each flipped: any, the first, the last, and each bit of the last 100 bytes."""
    draw = random.Random(12)
    places = [draw.randrange(8 * len(content)) for _ in range(count)]
    places += [
        0,
        8 * len(content) - 1,
        *(8 * (len(content) - end) + draw.randrange(8) for end in range(1, 100)),
    ]
    copies = []
    for place in places:
        copy = bytearray(content)
        copy[place // 8] ^= 1 << place % 8
        copies.append(bytes(copy))
    return copies


def accepted(path: Path, read: Callable[[], object], count: int) -> list[object]:
    """What is read of a file with a flipped bit, where it is not refused in one line that names it."""
    content = path.read_bytes()
    found, refusals = [], []
    for copy in flipped(content, count):
        path.write_bytes(copy)
        try:
            found.append(read())
        except UserError as error:
            refusals.append(str(error))
    assert all(path.name in line and "\n" not in line for line in refusals)
    path.write_bytes(content)
    assert read() is not None
    return found


@pytest.mark.parametrize("count", FLIPS)
@pytest.mark.parametrize("kind", ["checkpoint", "policy"])
def test_a_flipped_bit_of_a_state_is_refused(root: Path, kind: Any, count: int) -> None:
    path = root / f"{kind}.pt"
    assert accepted(path, lambda: load_state(path, kind), count) == []


@pytest.mark.parametrize("count", FLIPS)
def test_a_flipped_bit_of_a_configuration_changes_nothing(root: Path, count: int) -> None:
    whole = RunFolder.open(root).config
    found = accepted(root / "config.yaml", lambda: RunFolder.open(root).config, count)
    assert all(config == whole for config in found)


@pytest.mark.parametrize("count", FLIPS)
def test_a_flipped_bit_of_the_evaluations_changes_nothing(root: Path, count: int) -> None:
    folder = RunFolder.open(root)
    folder.save_evaluations([{"shield": "on", "totals": {"lane_changes": 3, "speed": 0.1}}], ("shield",))
    whole = folder.evaluations()
    found = accepted(root / "evaluation.json", folder.evaluations, count)
    assert all(evaluations == whole for evaluations in found)


@pytest.mark.parametrize("count", FLIPS)
def test_a_flipped_bit_of_the_metrics_is_refused_or_made_good(root: Path, count: int) -> None:
    path = root / "metrics.csv"
    whole = path.read_bytes()
    saved = load_state(root / "checkpoint.pt", "checkpoint")["metrics"]

    def resumed() -> bytes:
        RunFolder.open(root).keep_metrics(set(range(1, 7)), saved)
        return path.read_bytes()

    assert all(rows == whole for rows in accepted(path, resumed, count))


def test_a_damaged_policy_is_made_anew_from_the_checkpoint(root: Path) -> None:
    path = root / "policy.pt"
    whole = path.read_bytes()
    path.write_bytes(flipped(whole, 1)[0])
    with pytest.raises(
        UserError, match=r"policy\.pt: damaged policy: .*`drlsl train --resume` writes it anew"
    ):
        load_state(path, "policy")
    Session.resume(root).close()
    assert path.read_bytes() == whole


def test_files_stay_files_of_pytorch(root: Path) -> None:
    for mapped in (False, True):
        state = torch.load(root / "policy.pt", weights_only=True, mmap=mapped)
        assert state["kind"] == "policy"


def test_a_file_without_a_checksum_is_damaged(root: Path) -> None:
    path = root / "policy.pt"
    torch.save(torch.load(path, weights_only=True), path)
    with pytest.raises(UserError, match=r"policy\.pt: damaged policy: its checksum is missing"):
        load_state(path, "policy")


def test_files_of_before_are_read_with_a_warning(root: Path, caplog: pytest.LogCaptureFixture) -> None:
    for kind in ("checkpoint", "policy"):
        path = root / f"{kind}.pt"
        state = torch.load(path, weights_only=True)
        state.pop("metrics", None)
        torch.save({**state, "format": checkpoint.FORMAT_WITHOUT_CHECKSUM}, path)
        assert dict(flat(load_state(path, kind))).keys() == dict(flat(state)).keys()
        assert f"{path}: written before files had a checksum" in caplog.text
    path = root / "config.yaml"
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:-1]))
    (root / "evaluation.json").write_text(json.dumps({"evaluations": [{"shield": "on"}]}))
    with Session.resume(root) as session:
        assert session.folder.evaluations() == [{"shield": "on"}]
    assert load_state(root / "policy.pt", "policy")["format"] == checkpoint.FORMAT


def test_values_come_back_however_they_are_laid_out() -> None:
    values = {"b": [1, 2.5, None, True], "a": {"3": "ü", "x": (1, 2)}}
    text = seal_values(values)
    plain = json.loads(json.dumps(values))
    assert open_values(text) == plain
    assert open_values(json.dumps(json.loads(text), sort_keys=True)) == plain
    with pytest.raises(ValueError, match="does not match the content"):
        open_values(text.replace("2.5", "2.25"))
