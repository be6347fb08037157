"""The report: its numbers against the episodes they come from, its files, and what it owns up to."""

import re
from html.parser import HTMLParser
from pathlib import Path

import pandas as pd
import pytest

from drlsl.learning import RunFolder
from drlsl.study import StudyFolder, write_report
from drlsl.study.claims import Claim, agreement, claims
from drlsl.study.document import Block, Paragraph, markdown, page
from drlsl.study.plan import Run, Task
from drlsl.study.result_tables import (
    Table,
    contacts,
    convergence,
    estimates,
    interventions,
    sweeps,
    table_1,
    training,
)
from drlsl.study.results import Results, collect
from drlsl.workers import Failure

from .fake import INPUTS, perform, study


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> StudyFolder:
    root = tmp_path_factory.mktemp("study") / "study"
    made = StudyFolder.prepare(root, study(seeds=4, methods=3, episodes=60), INPUTS)
    for task in made.study.tasks:
        if task.name != "m2-seed3.freeway":
            perform(root, task, lambda: False)
    made.add_failure(Task(Run("m0", 1)), Failure("out of memory", "Traceback ..."))
    return made


@pytest.fixture(scope="module")
def results(folder: StudyFolder) -> Results:
    return collect(folder)


def episodes_of(
    folder: StudyFolder, method: str, test: str, shield: str, value: float | None = None
) -> pd.DataFrame:
    """Every episode of a test, from the records."""
    rows = []
    for run in folder.study.runs:
        task = Task(run, test)
        if run.method == method and folder.is_done(task):
            records = folder.result(task)["evaluations"]
            (record,) = [one for one in records if (one["shield"], one.get("value")) == (shield, value)]
            rows += [{**episode, "seed": run.seed} for episode in record["per_episode"]]
    return pd.DataFrame(rows)


def test_table_1_is_the_mean_over_seeds_of_the_episodes_counted(
    folder: StudyFolder, results: Results
) -> None:
    for test in folder.study.tests:
        for shield in ("off", "on"):
            table = table_1(results, test, shield)
            for name, method in folder.study.methods.items():
                found = episodes_of(folder, name, test, shield)
                seeds = found["seed"].nunique()
                rows = table.frame[table.frame["method"] == method.label].set_index("row")["mean"]
                assert rows["Lane changes"] == pytest.approx(found["lane_changes"].sum() / seeds)
                assert rows["Collisions"] == pytest.approx(found["contact"].sum() / seeds)
                at_fault = (found["contact"] & found["at_fault"]).sum()
                assert rows["… ego at fault"] == pytest.approx(at_fault / seeds)
                ended = found[~found["contact"]].groupby("seed")["steps"].mean()
                assert rows["Time steps"] == pytest.approx(ended.mean())


def test_table_1_shows_the_papers_numbers_beside(results: Results) -> None:
    shown = table_1(results, "left-to-right", "off").shown.set_index("")
    assert str(shown.loc["Time steps", "Method 0"]).endswith("(657)")
    assert str(shown.loc["Lane changes", "Method 1"]).endswith("(43)")
    assert "(" not in str(shown.loc["Lane changes", "Method 2"])
    assert "(" not in "".join(table_1(results, "freeway", "off").shown.to_numpy().ravel())


def test_contacts_add_up(folder: StudyFolder, results: Results) -> None:
    frame = contacts(results).frame
    assert len(frame) == 2 * 2 * 3
    for row in frame.to_dict("records"):
        found = episodes_of(folder, row["method"], row["test"], row["shield"])
        reasons = found.loc[found["contact"], "contact_reason"].value_counts()
        assert row["episodes"] == len(found)
        assert row["completed"] == (~found["contact"]).sum()
        assert row["contacts_at_fault"] == reasons.get("at_fault", 0)
        assert row["cut_off"] == reasons.get("cut_off", 0)


def test_sweeps_stand_beside_their_test(folder: StudyFolder, results: Results) -> None:
    frame = sweeps(results, "on").frame.set_index(["value", "method"])
    assert sorted(set(frame.index.get_level_values("value"))) == [0.0, 0.5, 1.0]
    for method in folder.study.methods:
        plain = episodes_of(folder, method, "freeway", "on")
        assert frame.loc[(0.0, method), "episodes"] == len(plain)
        assert frame.loc[(0.0, method), "contacts_at_fault"] == (plain["contact"] & plain["at_fault"]).sum()
        for value in (0.5, 1.0):
            found = episodes_of(folder, method, "latency", "on", value)
            at_fault = int((found["contact"] & found["at_fault"]).sum())
            assert frame.loc[(value, method), "contacts_at_fault"] == at_fault
            assert frame.loc[(value, method), "episodes"] == len(found) == 12
            shown = sweeps(results, "on").shown.set_index("value")
            assert shown.loc[f"{value:g}", folder.study.methods[method].label] == f"{at_fault} of 12"
    assert set(results.tests["test"]) == set(folder.study.tests)
    assert set(results.sweeps["test"]) == {"latency"}


def test_the_training_table_is_the_metrics(folder: StudyFolder, results: Results) -> None:
    frame = training(results).frame.set_index("method")
    for method in folder.study.methods:
        runs = [RunFolder.open(folder.run_path(Run(method, seed))).metrics() for seed in range(4)]
        rows = pd.concat(runs)
        assert frame.loc[method, "Collision reward"] == pytest.approx(rows["reward_collision"].mean())
        at_fault = int((rows["contact"].astype(bool) & rows["at_fault"].astype(bool)).sum())
        assert frame.loc[method, "contacts at fault"] == at_fault
        assert frame.loc[method, "contacts not at fault"] == int(rows["contact"].sum()) - at_fault
        share = rows["interventions"].sum() / rows["steps"].sum()
        shown = interventions(results).frame.set_index("method")
        assert shown.loc[method, "training"] == pytest.approx(share)
    assert training(results).shown.set_index("method").loc["Method 0", "Off-road reward"] == "0.00 (-60.1)"


def test_estimates_use_a_result_a_seed(folder: StudyFolder, results: Results) -> None:
    frame = estimates(results, "off").frame.set_index(["test", "method"])
    found = episodes_of(folder, "m1", "freeway", "off").groupby("seed")["lane_changes"].mean().sort_values()
    assert frame.loc[("freeway", "m1"), "lane_changes"] == pytest.approx(found.iloc[1:3].mean())
    assert frame["return"].isna().loc[("all tests", "m1")]
    assert list(convergence(results).frame["seeds"]) == [4, 4, 4]


def test_claims_are_held_against_the_numbers(results: Results) -> None:
    found = {claim.statement: claim for claim in claims(results)}
    safe = found["Method 1: no contact at fault and never off the road in training"]
    assert safe == Claim(safe.statement, True, "240 episodes: 0 at fault, 0 off-road")
    blamed = results.training.assign(at_fault=1)
    assert not claims(replaced(results, training=blamed))[0].holds
    tests = results.tests.assign(off_road=1)
    assert not claims(replaced(results, tests=tests))[1].holds
    assert not any("Method 0:" in claim.statement for claim in claims(results))


def test_calmer_means_in_every_test(results: Results) -> None:
    calm = results.tests.copy()
    calm.loc[calm["method"] == "m1", ["lane_changes", "mean_steps_completed"]] = [0, 500.0]
    fewer, no_more = claims(replaced(results, tests=calm))[2:4]
    assert fewer.holds
    assert no_more.holds
    calm.loc[(calm["method"] == "m1") & (calm["test"] == "freeway"), "lane_changes"] = 1_000
    calm.loc[(calm["method"] == "m1") & (calm["test"] == "freeway"), "mean_steps_completed"] = 1_000.0
    fewer, no_more = claims(replaced(results, tests=calm))[2:4]
    assert not fewer.holds
    assert not no_more.holds


def test_a_seed_that_never_converges_counts_as_the_latest(results: Results) -> None:
    trained = results.training.copy()
    rising = (trained["method"] == "m0") | ((trained["method"] == "m1") & (trained["seed"] == 2))
    trained["return"] = trained["episode"].where(rising, 7.0)
    found = replaced(results, training=trained)
    sooner = next(claim for claim in claims(found) if "Method 1: converges before" in claim.statement)
    assert sooner.holds
    assert sooner.evidence.endswith("by seed 4, 4, never, 4 vs never, never, never, never")
    shown = convergence(found).shown.set_index("method")
    assert list(shown.loc["Method 1", ["converged", "median"]]) == ["3 of 4", "4"]
    assert list(shown.loc["Method 0", ["converged", "median"]]) == ["0 of 4", "never"]
    half = (trained["method"] == "m1") & (trained["seed"] > 0)
    trained["return"] = trained["return"].where(~half, trained["episode"])
    assert not next(
        claim
        for claim in claims(replaced(results, training=trained))
        if "Method 1: converges before" in claim.statement
    ).holds


def test_a_claim_without_results_is_open(folder: StudyFolder, tmp_path: Path) -> None:
    empty = StudyFolder.prepare(tmp_path / "empty", folder.study, INPUTS)
    assert {claim.holds for claim in claims(collect(empty))} == {None}
    text = (write_report(empty) / "report.md").read_text()
    assert "48 of 48 runs have no result" in text
    assert "| no result |" in text


def test_the_order_of_the_methods_is_held_against_the_papers(results: Results) -> None:
    tests = results.tests.copy()
    known = tests["test"] == "left-to-right"
    tests.loc[known, "lane_changes"] = tests.loc[known, "method"].map({"m0": 200, "m1": 40, "m2": 300})
    tests.loc[known & (tests["method"] == "m1"), "mean_steps_completed"] = float("nan")
    frame = agreement(replaced(results, tests=tests)).frame.set_index("row")
    assert frame.loc["Lane changes", "paper"] == "DQNSL 43; DQN 204"
    assert frame.loc["Lane changes", "study"] == "Method 1 40; Method 0 200; Method 2 300"
    assert frame.loc["Lane changes", "pairs in the paper's order"] == "1 of 1"
    # The paper has both at 0: no order to keep.
    assert frame.loc["Off-road", "pairs in the paper's order"] == "0 of 0"
    assert str(frame.loc["Time steps", "study"]).endswith("Method 1 -")
    assert frame.loc["Time steps", "pairs in the paper's order"] == "0 of 0"
    swapped = tests.assign(lane_changes=-tests["lane_changes"])
    frame = agreement(replaced(results, tests=swapped)).frame.set_index("row")
    assert frame.loc["Lane changes", "pairs in the paper's order"] == "0 of 1"


def replaced(results: Results, **changes: pd.DataFrame) -> Results:
    kept = {name: getattr(results, name) for name in Results.__dataclass_fields__}
    return Results(**{**kept, **changes})


class Page(HTMLParser):
    """Tags that are open, cells, and what a page would load."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.cells: list[str] = []
        self.loads: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.loads += [value or "" for name, value in attrs if name in ("src", "href")]
        assert tag not in ("script", "link", "iframe")
        if tag not in ("meta", "img"):
            self.open.append(tag)
        if tag == "td":
            self.cells.append("")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] == "td":
            self.cells[-1] += data


def test_the_report_is_whole_and_the_same_every_time(folder: StudyFolder) -> None:
    out = write_report(folder)
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    write_report(folder)
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before
    text = (out / "report.md").read_text()
    assert "1 of 48 runs have no result and are missing from all numbers below: m2-seed3.freeway" in text
    assert "- m0-seed1: out of memory; then done" in text
    assert "rules/highway.pl" in text
    for figure in re.findall(r"\]\((figures/\w+\.png)\)", text):
        assert (out / figure).read_bytes().startswith(b"\x89PNG")
    assert len(list((out / "figures").iterdir())) == 6
    found = Page()
    found.feed((out / "report.html").read_text())
    assert found.open == []
    assert len(found.loads) == 6
    assert all(load.startswith("data:image/png;base64,") for load in found.loads)


def test_markdown_and_html_have_the_same_cells(folder: StudyFolder) -> None:
    out = write_report(folder)
    lines = [line for line in (out / "report.md").read_text().splitlines() if line.startswith("| ")]
    rules = [place for place, line in enumerate(lines) if set(line) <= set("| -:")]
    body = [line for place, line in enumerate(lines) if place not in rules and place + 1 not in rules]
    cells = [cell for line in body for cell in line[2:-2].split(" | ")]
    found = Page()
    found.feed((out / "report.html").read_text())
    assert [cell.strip() for cell in cells] == [cell.strip() for cell in found.cells]
    assert len(list((out / "tables").iterdir())) >= 12


def test_text_is_escaped() -> None:
    frame = pd.DataFrame({"a|b": ["<x>", "1 | 2"]})
    blocks: list[Block] = [
        Paragraph("a < b & c"),
        Paragraph("<pre>", code=True),
        Table("t", "T <1>", frame, frame),
    ]
    shown = page("<title>", blocks)
    assert "&lt;x&gt;" in shown
    assert "a &lt; b &amp; c" in shown
    assert "<title>&lt;title&gt;</title>" in shown
    assert r"| 1 \| 2 |" in markdown(blocks)
