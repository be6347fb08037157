import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from drlsl.errors import UserError
from drlsl.files import parse_yaml
from drlsl.learning.config import (
    TrainConfig,
    describe_keys,
    dump_yaml,
    load_config,
    make_config,
    merged,
    preset_names,
    preset_values,
    with_value,
)


def error_of(text: str, tmp_path: Path) -> str:
    path = tmp_path / "run.yaml"
    path.write_text(text)
    with pytest.raises(UserError) as caught:
        load_config(path)
    message = str(caught.value)
    assert message.startswith(f"{path}")
    assert "\n" not in message
    return message.removeprefix(f"{path}")


def test_the_defaults_are_the_papers() -> None:
    config = make_config({}, "test")
    assert config.method == "dqnsl"
    assert config.episodes == 1_500
    assert config.network.hidden == (256, 256)
    assert config.learning.discount == 0.95
    assert config.learning.batch_size == 128
    assert config.learning.replay_capacity == 100_000
    assert config.learning.target_every == 1_000
    assert (config.schedule.learning_rate_start, config.schedule.learning_rate_end) == (0.01, 1e-4)
    assert (config.schedule.epsilon_start, config.schedule.epsilon_end) == (0.1, 0.001)
    assert (config.env.track_length, config.env.traffic) == (None, "auto")


def test_the_paper_preset_prints_the_papers_target() -> None:
    paper = make_config(preset_values("paper"), "preset")
    assert paper.learning.bootstrap == "all"
    given = {"learning": {"bootstrap": "all"}, "env": {"rules": ["paper_observation.pl"]}}
    expected = merged(make_config({}, "test").model_dump(), given)
    assert paper == make_config(expected, "test")


PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=5,
)
"""Values that a file may hold."""


def test_presets_ship_and_hold() -> None:
    assert preset_names() == ["paper", "paper-code", "quick", "tiny"]
    for name in preset_names():
        assert isinstance(make_config(preset_values(name), name), TrainConfig)
    expected = "^preset 'quik': no such preset; expected one of paper, paper-code, quick, tiny$"
    with pytest.raises(UserError, match=expected):
        preset_values("quik")


@given(
    st.fixed_dictionaries(
        {},
        optional={
            "seed": st.integers(0, 2**63 - 1),
            "episodes": st.integers(1, 10**7),
            "method": st.sampled_from(["dqn", "mpsdqn", "dqnsl"]),
            "network": st.builds(
                lambda widths: {"hidden": widths}, st.lists(st.integers(1, 4096), min_size=1, max_size=8)
            )
            | st.builds(
                lambda path, arguments: {"factory": f"{path}.py:make", "arguments": arguments},
                st.text(st.characters(exclude_categories=("C", "Z")), min_size=1),
                st.dictionaries(st.text(), PLAIN, max_size=3),
            ),
            "schedule": st.fixed_dictionaries(
                {}, optional={"epsilon_end": st.floats(0, 1), "learning_rate_end": st.floats(1e-300, 1)}
            ),
            "env": st.fixed_dictionaries(
                {}, optional={"rules": st.lists(st.text(), max_size=3), "recording": st.text(min_size=1)}
            ),
        },
    )
)
@example({"env": {"recording": "\x85"}})
@example({"env": {"recording": "a \u2028b\u2029"}})
@settings(max_examples=60, deadline=None)
def test_a_dumped_configuration_reads_back_equal(values: dict[str, Any]) -> None:
    config = make_config(values, "test")
    assert make_config(parse_yaml(dump_yaml(config), "dump").values, "dump") == config


def test_a_method_brings_what_it_is_offered() -> None:
    assert make_config({"method": "mpsdqn"}, "test").env.offers == "prediction"
    assert make_config({"method": "dqn", "env": {"offers": "all"}}, "test").env.offers == "all"
    for method, offers in (
        ("mpsdqn", "rules"),
        ("dqnsl", "prediction"),
        ("dqnsl", "all"),
        ("dqn", "prediction"),
    ):
        with pytest.raises(UserError, match=f"method {method} needs env.offers .*, not {offers}"):
            make_config({"method": method, "env": {"offers": offers}}, "test")


def test_an_empty_file_is_all_defaults(tmp_path: Path) -> None:
    path = tmp_path / "run.yaml"
    path.write_text("# nothing\n")
    assert load_config(path) == make_config({}, "test")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("episdes: 3\n", ":1:1: unknown key 'episdes'; did you mean 'episodes'?"),
        (
            "seed: 1\nlearning:\n  discout: 0.9\n",
            ":3:3: unknown key 'learning.discout'; did you mean 'learning.discount'?",
        ),
        ("batch_size: 64\n", ":1:1: unknown key 'batch_size'; did you mean 'learning.batch_size'?"),
        (
            "learning:\n  episodes: 3\n",
            ":2:3: unknown key 'learning.episodes'; did you mean 'episodes' or 'evaluation.episodes'?",
        ),
        ("env:\n  recordin: x\n", ":2:3: unknown key 'env.recordin'; did you mean 'env.recording'?"),
        ("zzz: 1\n", ":1:1: unknown key 'zzz'; `drlsl train --print-config` shows the known keys"),
        ("3: 1\n", ":1:1: unknown key '3'; `drlsl train --print-config` shows the known keys"),
    ],
)
def test_an_unknown_key_names_its_place_and_the_nearest(text: str, message: str, tmp_path: Path) -> None:
    assert error_of(text, tmp_path) == message


@pytest.mark.parametrize(
    ("text", "place", "part"),
    [
        ("episodes: 0\n", ":1:1: episodes: ", "greater than or equal to 1, got 0"),
        ("seed: 1\nlearning:\n  batch_size: many\n", ":3:3: learning.batch_size: ", "got 'many'"),
        ("schedule:\n  epsilon_start: .nan\n", ":2:3: schedule.epsilon_start: ", "finite number"),
        ("schedule:\n  learning_rate_start: .inf\n", ":2:3: schedule.learning_rate_start: ", "got inf"),
        ("schedule: {learning_rate_end: 0}\n", ":1:12: schedule.learning_rate_end: ", "greater than 0"),
        ("learning: {discount: 1}\n", ":1:12: learning.discount: ", "less than 1"),
        ("network: {hidden: [64, 0]}\n", ":1:11: network.hidden.1: ", "greater than or equal to 1"),
        ("network: {hidden: []}\n", ":1:11: network.hidden: ", "at least 1 item"),
        ("method: mps\n", ":1:1: method: ", "'dqn', 'mpsdqn' or 'dqnsl', got 'mps'"),
        ("learning:\n  learning_starts: 5\n", ":1:1: learning: ", "batch_size <= learning_starts"),
        ("env:\n  track_length: -1\n", ":2:3: env.track_length: ", "greater than 0"),
        ("learning: 7\n", ":1:1: learning: ", "input should be keys with values, got 7"),
        (
            "env:\n  rules: my.pl\n",
            ":2:3: env.rules: ",
            "input should be a list, such as ['my.pl'], got 'my.pl'",
        ),
    ],
)
def test_a_bad_value_names_its_place_and_bound(text: str, place: str, part: str, tmp_path: Path) -> None:
    message = error_of(text, tmp_path)
    assert message.startswith(place)
    assert part in message


def test_every_bad_value_is_named(tmp_path: Path) -> None:
    message = error_of("episodes: 0\nseed: -1\n", tmp_path)
    assert ":1:1: episodes: " in message
    assert ":2:1: seed: " in message


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: [1\nb: 2\n", ":2:2: not valid YAML: "),
        ("a: b: c\n", ":1:5: not valid YAML: "),
        ("seed: 1\nseed: 2\n", ":2:1: key 'seed' is given twice"),
        ("env:\n  rules: []\n  rules: []\n", ":3:3: key 'env.rules' is given twice"),
        ("- 1\n- 2\n", ": expected keys with values (such as 'episodes: 100'), got [1, 2]"),
        (
            "a: !!python/object/apply:os.getcwd []\n",
            ":1:4: not valid YAML: could not determine a constructor",
        ),
        ("a: \x01\n", ": not valid YAML: "),
        ("a: &x [*x]\n", ":1:1: unknown key 'a'"),
        ("env: &x\n  recording: *x\n", ":2:3: env.recording: "),
        ("[" * 20_000, ": the YAML is nested too deeply"),
        ("? [a, b]\n: 1\n", ":1:3: not valid YAML: "),
    ],
)
def test_a_file_that_is_not_a_yaml_mapping(text: str, message: str, tmp_path: Path) -> None:
    assert error_of(text, tmp_path).startswith(message)


def test_a_file_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"cannot read the configuration .*: No such file"):
        load_config(tmp_path / "none.yaml")
    with pytest.raises(UserError, match=r"cannot read the configuration .*: Is a directory"):
        load_config(tmp_path)
    (tmp_path / "latin.yaml").write_bytes(b"recording: M\xfcnchen")
    with pytest.raises(UserError, match=r"not UTF-8 text \(byte 12\)"):
        load_config(tmp_path / "latin.yaml")


def test_values_are_laid_over_one_another() -> None:
    base = {"seed": 1, "learning": {"discount": 0.9, "batch_size": 8}}
    assert merged(base, {"learning": {"discount": 0.5}, "episodes": 2}) == {
        "seed": 1,
        "episodes": 2,
        "learning": {"discount": 0.5, "batch_size": 8},
    }
    assert with_value(base, "learning.discount", 0.1)["learning"] == {"discount": 0.1, "batch_size": 8}
    assert with_value({}, "a.b.c", 1) == {"a": {"b": {"c": 1}}}
    assert base == {"seed": 1, "learning": {"discount": 0.9, "batch_size": 8}}


def test_every_setting_is_described() -> None:
    described = dict(describe_keys())
    assert "learning.discount" in described
    assert "env.reward.velocity" in described
    assert [key for key, text in described.items() if not text.endswith(".")] == []


def test_the_configuration_loads_without_torch() -> None:
    code = "import sys, drlsl.learning.config as _; print(*{'torch', 'gymnasium', 'pandas'} & {*sys.modules})"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == ""


def test_the_documentation_lists_every_setting_with_its_default() -> None:
    text = (Path(__file__).parents[1] / "docs" / "training.md").read_text("utf-8")
    defaults = make_config({}, "test").model_dump(mode="json")
    for key, description in describe_keys():
        value: Any = defaults
        for part in key.split("."):
            value = value[part]
        assert f"| `{key}` | {value if value != [] else 'none'} | {description} |" in text
