"""Studies from presets, files and flags, and the tasks that follow."""

from pathlib import Path
from typing import Any

import pytest

from drlsl.errors import UserError
from drlsl.study import StudyConfig, dump_study, load_study, preset_study, with_changes
from drlsl.study.paper import METHODS, TABLE_1
from drlsl.study.plan import Run, Task, make_study, scenario_of, study_presets

from .fake import study

SWEEP = {"label": "latency [s]", "test": "freeway", "setting": "sensing.latency", "values": [0.5]}
LATE = {"label": "late", "train": {"env": {"sensing": {"latency": 0.2}}}}


@pytest.mark.parametrize("name", ["full", "paper", "smoke"])
def test_presets_are_what_the_paper_compares(name: str) -> None:
    preset = preset_study(name)
    assert {method.paper for method in preset.methods.values()} >= set(METHODS)
    rules = {preset.training(Run(method, 0)).env.rules for method in preset.methods}
    own = () if name == "smoke" else ("paper_observation.pl",)
    assert rules == {own, ("paper.pl",)}
    assert set(preset.tests) == {"left-to-right", "right-to-left", "freeway", "freeway-reactive"}


def test_the_benchmark_sets_learnt_drivers_beside_others() -> None:
    preset = preset_study("benchmark")
    assert set(study_presets()) == {"benchmark", "benchmark-beside", "full", "paper", "paper-code", "smoke"}
    assert {method.driver for method in preset.methods.values()} == {None, "keep", "always-change", "mobil"}
    assert preset.baseline == "keep"
    for run in preset.runs[: len(preset.methods)]:
        assert preset.test_env(run, "overtake-test").decision_period == 1.0


def test_the_paper_preset_has_the_papers_numbers() -> None:
    preset = preset_study("paper")
    assert preset.evaluation_episodes == 50
    for run in preset.runs:
        config = preset.training(run)
        assert (config.episodes, config.learning.bootstrap, config.threads) == (1_500, "all", 1)
        assert config.seed == run.seed
    offers = {method: preset.training(Run(method, 0)).env.offers for method in preset.methods}
    assert offers["mpsdqn"] == "prediction"
    assert offers["dqnsl-highway"] == "rules"


def test_the_full_preset_has_every_combination_once() -> None:
    preset = preset_study("full")
    seen = set()
    for method in preset.methods:
        config = preset.training(Run(method, 0))
        seen.add((config.method, config.env.rules, config.network.noisy, config.learning.bootstrap))
    assert len(seen) == len(preset.methods) == 14


def test_tasks_follow_what_they_need() -> None:
    plan = study(seeds=2, methods=3)
    tasks = plan.tasks
    assert len(tasks) == 2 * 3 * (1 + 2 + 1)
    assert len({task.name for task in tasks}) == len(tasks)
    for place, task in enumerate(tasks):
        before = plan.needs(task)
        assert before is None or before in tasks[:place]
    assert Task(Run("m0", 1), "freeway").name == "m0-seed1.freeway"


def test_a_policy_is_tested_as_it_was_trained_in_other_traffic() -> None:
    preset = preset_study("paper")
    for run in preset.runs[:4]:
        trained, tested = preset.training(run).env, preset.test_env(run, "right-to-left")
        assert (tested.recording, tested.direction) == ("highway-test", "right_to_left")
        same = {"recording", "direction"}
        assert tested.model_dump(exclude=same) == trained.model_dump(exclude=same)
        reactive = preset.test_env(run, "freeway-reactive")
        assert (reactive.recording, reactive.direction, reactive.traffic) == ("freeway", "both", "reactive")


def test_a_sweep_changes_one_setting_of_its_test() -> None:
    preset = preset_study("paper")
    for run in preset.runs[:4]:
        for name, sweep in preset.sweeps.items():
            plain = preset.test_env(run, sweep.test).model_dump()
            envs = preset.sweep_envs(run, name)
            assert tuple(envs) == sweep.values
            for value, env in envs.items():
                changed = env.model_dump()
                (_, field) = sweep.setting.split(".")
                assert changed["sensing"].pop(field) == value
                del plain["sensing"][field]
                assert changed == plain
                plain["sensing"][field] = 0.0
            assert preset.trained_value(name) == 0.0


def test_every_sensing_fault_has_a_sweep() -> None:
    for preset in (preset_study("paper"), preset_study("full")):
        faults = {sweep.setting.removeprefix("sensing.") for sweep in preset.sweeps.values()}
        assert faults == {"position_noise", "speed_noise", "drop_rate", "latency"}


@pytest.mark.parametrize("name", study_presets())
def test_a_dumped_study_reads_back_equal(name: str, tmp_path: Path) -> None:
    path = tmp_path / "study.yaml"
    path.write_text(dump_study(preset_study(name)))
    assert load_study(path) == preset_study(name)


def test_changes(tmp_path: Path) -> None:
    (tmp_path / "NGSIM US-101").mkdir()
    for name in ("b.csv", "a.csv"):
        (tmp_path / "NGSIM US-101" / name).write_text("vehicle_id\n")
    where = str(tmp_path / "NGSIM US-101")
    changed = with_changes(preset_study("paper"), seeds=1, episodes=7, methods=["dqn"], tests=[where])
    assert [run.name for run in changed.runs] == ["dqn-seed0"]
    assert changed.training(changed.runs[0]).episodes == 7
    added = changed.tests["ngsim-us-101"]
    assert added.recording == (f"{where}/a.csv", f"{where}/b.csv")
    assert (added.label, added.paper) == ("NGSIM US-101", "ngsim")
    assert changed.test_env(changed.runs[0], "ngsim-us-101").recordings == added.recording
    assert with_changes(changed, tests=[where]) == changed


def test_a_recording_is_a_test_whatever_its_form(tmp_path: Path) -> None:
    folder = tmp_path / "my_Traffic.v2"
    folder.mkdir()
    (folder / "01_tracks.csv").write_text("")
    assert scenario_of(str(folder)) == ("my-traffic", {"label": "my_Traffic.v2", "recording": str(folder)})
    assert scenario_of(f"{folder}#01")[1]["recording"] == f"{folder}#01"
    assert scenario_of("freeway") == ("freeway", {"label": "freeway", "recording": "freeway"})


def test_a_test_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "freeway").mkdir()
    with pytest.raises(UserError, match="there is a test 'freeway' already"):
        with_changes(preset_study("paper"), tests=[str(tmp_path / "freeway")])


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"sedes": 3}, "sedes: there is no such setting"),
        ({"seeds": 0}, "seeds: input should be greater than or equal to 1"),
        ({"preset": "quik"}, "no preset 'quik'; expected one of paper, paper-code, quick, tiny"),
        ({"methods": {"a/b": {"label": "x"}}}, "methods.a/b"),
        ({"methods": {"a": {"label": "x", "train": {"episodse": 1}}}}, "method a: unknown key 'episodse'"),
        ({"methods": {"a": {"label": "x", "paper": "SAC"}}}, "methods.a.paper"),
        ({"tests": {}}, "tests"),
        (
            {"sweeps": {"s": SWEEP}, "methods": {"a": {"label": "a"}, "b": LATE}},
            "sweep s: the methods were trained with unlike env.sensing.latency",
        ),
        ({"sweeps": {"freeway": SWEEP}}, "sweep freeway: there is a test of that name"),
        (
            {"sweeps": {"s": {**SWEEP, "test": "gone"}}},
            "sweep s: no test 'gone'; there are left-to-right, fre",
        ),
        (
            {"sweeps": {"s": {**SWEEP, "setting": "sensing.age"}}},
            "sweep s: env.sensing.age: there is no such",
        ),
        ({"sweeps": {"s": {**SWEEP, "values": [9.0]}}}, "sweep s: env.sensing.latency: .*less than or equal"),
        (
            {"sweeps": {"s": {**SWEEP, "values": [0.0]}}},
            "sweep s: 0 is what test 'freeway' has; leave it out",
        ),
    ],
)
def test_what_is_no_study_is_refused(change: dict[str, object], told: str) -> None:
    with pytest.raises(UserError, match=f"^here: .*{told}"):
        make_study({**study().model_dump(mode="json"), **change}, "here")


def test_what_extends_a_study() -> None:
    small, large = study(seeds=1, methods=1), study(seeds=2, methods=2)
    assert large.extends(small)
    assert small.extends(small)
    assert not small.extends(large)
    assert not study(episodes=13).extends(study(episodes=12))
    without = make_study({**large.model_dump(mode="json"), "sweeps": {}}, "test")
    assert large.extends(without)
    assert not without.extends(large)


def test_the_papers_table_is_whole() -> None:
    for rows in TABLE_1.values():
        assert {name: len(values) for name, values in rows.items()} == dict.fromkeys(
            ("lane_changes", "collisions", "off_road", "time_steps"), len(METHODS)
        )


def with_driver(**method: Any) -> StudyConfig:
    values = study(seeds=2, methods=1).model_dump(mode="json")
    return make_study(
        {**values, "methods": {**values["methods"], "baseline": {"label": "B", **method}}}, "test"
    )


def test_a_driver_is_tested_and_not_trained() -> None:
    plan = with_driver(driver="mobil", parameters={"politeness": 0.0}, train={"env": {"rules": ["paper.pl"]}})
    assert plan.learnt == ["m0"]
    mine = [task for task in plan.tasks if task.run.method == "baseline"]
    assert [task.test for task in mine] == ["left-to-right", "freeway", "latency"] * 2
    assert all(plan.needs(task) is None for task in mine)
    assert plan.test_env(Run("baseline", 0), "freeway").rules == ("paper.pl",)
    assert make_study(plan.model_dump(mode="json"), "again") == plan


@pytest.mark.parametrize(
    ("method", "message"),
    [
        ({"driver": "mobile"}, "no driver 'mobile'; expected keep, always-change, mobil, oracle"),
        ({"driver": "keep", "train": {"episodes": 3}}, "driver keep is not trained: train may hold env only"),
        ({"driver": "keep", "parameters": {"a": 1}}, "driver keep: a: there is no such setting"),
        ({"parameters": {"a": 1}}, "parameters are those of a driver"),
        ({"driver": "keep", "ppo": {}}, "driver keep is not trained: leave out ppo"),
        ({"ppo": {}, "train": {"method": "dqn"}}, "ppo: it chooses among what is offered"),
        ({"ppo": {"epochs": 0}}, "ppo.epochs: input should be greater than or equal to 1"),
    ],
)
def test_drivers_that_no_study_can_have(method: dict[str, Any], message: str) -> None:
    with pytest.raises(UserError, match=message):
        with_driver(**method)
