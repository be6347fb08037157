"""Write the report of a study; every number in it comes from the tables that are written beside it."""

from collections.abc import Iterator
from pathlib import Path

import pandas as pd

from drlsl.driving.episodes import load_episode
from drlsl.driving.page import least_thinning, write_page
from drlsl.driving.simulation import BRAKING, INTRUSION, REACTION
from drlsl.files import write_atomic
from drlsl.learning import FIGURES
from drlsl.study import result_tables as tables
from drlsl.study import statistics
from drlsl.study.claims import agreement, claims
from drlsl.study.document import Block, Heading, Link, Listing, Paragraph, Picture, markdown, page
from drlsl.study.figures import outcome_figure, sweep_figure, training_figures
from drlsl.study.folder import StudyFolder
from drlsl.study.plan import StudyConfig, dump_study, make_study
from drlsl.study.result_tables import Table
from drlsl.study.results import Results, collect

TITLE = "Safe reinforcement learning on the highway: a study"
CONTACTS_PAGE = "contacts.html"
"""The page on which contacts at fault are watched."""

WALL_TIME = "Wall time"
"""The only section that a second run of the same study changes."""


def write_report(folder: StudyFolder) -> Path:
    """Write report.md, report.html, and the tables and figures behind them; return the folder.

    The same results give the same files.

    Raises:
        UserError: a result is damaged, or a file cannot be written.
    """
    contacts = [load_episode(path) for path in folder.contacts()]
    blocks = list(_blocks(collect(folder), len(contacts)))
    out = folder.report
    (out / "figures").mkdir(parents=True, exist_ok=True)
    (out / "tables").mkdir(exist_ok=True)
    for block in blocks:
        if isinstance(block, Picture):
            write_atomic(out / block.path, block.png)
        elif isinstance(block, Table):
            text = block.frame.to_csv(index=False, lineterminator="\n")
            write_atomic(out / "tables" / f"{block.stem}.csv", text.encode())
    if contacts:
        write_page(out / CONTACTS_PAGE, contacts, title="Contacts at fault", every=least_thinning(contacts))
    write_atomic(out / "report.md", markdown(blocks).encode())
    write_atomic(out / "report.html", page(TITLE, blocks).encode())
    return out


def _blocks(results: Results, watchable: int) -> Iterator[Block]:
    yield Heading(1, TITLE)
    yield from _outcome(results)
    yield from _summary(results)
    yield from _table_1(results)
    yield from _training(results)
    yield from _over_seeds(results)
    yield from _contacts(results, watchable)
    yield from _interventions(results)
    yield from _sweeps(results)
    yield from _failures(results)
    yield from _making(results)
    yield from _section(WALL_TIME, "Minutes of one process per seed, as measured by the runs themselves.")
    yield tables.wall_time(results)


def _outcome(results: Results) -> Iterator[Block]:
    """Yield the first picture, if anything can be compared with lane keeping."""
    if not results.tests["time_saved"].notna().any():
        return
    caption = (
        "Quick and safe: the share of lane keeping's time that each method saves, over the episodes that "
        "both completed, against its contacts at fault. Filled: with the shield; hollow: without. The lines "
        f"are {statistics.LEVEL:.0%} intervals over seeds."
    )
    yield Picture("figures/outcome.png", caption, outcome_figure(results))


def _summary(results: Results) -> Iterator[Block]:
    study = results.study
    names = "; ".join(method.label for method in study.methods.values())
    seeds = "1 seed" if study.seeds == 1 else f"{study.seeds} seeds"
    tests = "; ".join(test.label for test in study.tests.values())
    yield Paragraph(
        f"{len(study.methods)} methods ({names}), {seeds} each, tested in "
        f"{study.evaluation_episodes} episodes per seed of each of these, with and without the shield: "
        f"{tests}. The policies and the rules are the same in all of them."
    )
    if results.missing:
        yield Paragraph(
            f"{len(results.missing)} of {len(study.tasks)} runs have no result and are missing from all "
            f"numbers below: {', '.join(task.name for task in results.missing)}."
        )
    yield Heading(2, "Expected and found")
    words = {True: "yes", False: "NO", None: "no result"}
    found = [
        {"statement": one.statement, "holds": words[one.holds], "numbers": one.evidence}
        for one in claims(results)
    ]
    frame = pd.DataFrame(found, columns=["statement", "holds", "numbers"])
    yield Table(
        "claims",
        "Statements",
        frame,
        frame,
        "Interquartile means over seeds; medians for convergence, sums for counts.",
    )


def _section(title: str, words: str, level: int = 2) -> Iterator[Block]:
    """Yield the heading of a section and its first paragraph."""
    yield Heading(level, title)
    yield Paragraph(words)


def _table_1(results: Results) -> Iterator[Block]:
    yield from _section(
        "Table 1",
        "As in the paper, the safety module is off: the policy takes whichever of the three actions it "
        "values most. Collisions are all contacts; the paper does not say who is at fault. Time steps are "
        "those of episodes that reached the end of the track. In brackets are the paper's numbers; those "
        "of its DQNSL are shown for both rule programs.",
    )
    for test in results.study.tests:
        yield tables.table_1(results, test, "off")
    yield agreement(results)
    yield from _section(
        "The same with the safety module on",
        "The policy takes the action it values most among those that its safety module offers: the linear "
        "prediction for MPSDQN, the rules for the others, even for DQN, which was trained without them. "
        "The paper has no such numbers; those in brackets are its numbers without the module.",
        level=3,
    )
    for test in results.study.tests:
        yield tables.table_1(results, test, "on")


def _training(results: Results) -> Iterator[Block]:
    yield Heading(2, "Training")
    yield tables.training(results)
    for stem, png in training_figures(results).items():
        title = FIGURES[stem][1]
        caption = (
            f"{title} per episode: moving average over a fifteenth of the training, interquartile mean "
            "over seeds; the band reaches from the lowest seed to the highest."
        )
        yield Picture(f"figures/{stem}.png", caption, png)
    yield from _section(
        "Convergence",
        "A training has converged at the first episode from which the moving average of its return, "
        f"over 1/{round(1 / statistics.WINDOW_SHARE)} of the training, stays within "
        f"{statistics.TOLERANCE:.0%} of its final value. One that gets there only in the last such window "
        "has not converged, and counts as the latest in the median over seeds. The paper's episodes were "
        "read from its figure.",
        level=3,
    )
    yield tables.convergence(results)


def _over_seeds(results: Results) -> Iterator[Block]:
    yield from _section(
        "Over the seeds",
        "Interquartile means over seeds of each run's result, in square brackets their "
        f"{statistics.LEVEL:.0%} stratified bootstrap intervals ({statistics.DRAWS:,} resamples of the "
        "seeds within each test; Agarwal et al., 2021). With few seeds an interval says little, with one "
        "there is none. Numbers are per episode, interventions per step; return and time steps are not "
        "combined over tests, since they depend on the recording's frame rate.",
    )
    yield tables.estimates(results, "off")
    yield tables.estimates(results, "on")


def _contacts(results: Results, watchable: int) -> Iterator[Block]:
    yield from _section(
        "Contacts, and who is at fault",
        "Recorded vehicles do not see the ego and may drive into it. Every contact ends the episode and is "
        "counted. The ego is at fault unless one of four rules excuses it; in doubt it is at fault. The "
        f"rules require a time to collision of v/(2 · {BRAKING:g} m/s²) + {REACTION:g} s (UN R157) for a "
        f"closing speed v, and a vehicle enters a lane when it is {INTRUSION:g} m over the line.",
    )
    rules = (
        "struck from behind: the other vehicle came from behind and still had that time when the ego "
        "entered the lane, or both were wholly in one lane when it last had it",
        "cut off: the ego was wholly in its lane before the other vehicle entered it ahead, with less "
        "than that time left",
        "struck from the side: the same with the other vehicle alongside",
        "out of nowhere: the other vehicle's track began inside the stopping distance of the rear one "
        "of the two, which has had no time to stop since",
    )
    yield Listing(rules, numbered=True)
    yield Paragraph("Sums over all seeds; completed: episodes that reached the end of the track.")
    yield tables.contacts(results)
    if watchable:
        contacts = "1 contact" if watchable == 1 else f"{watchable} contacts"
        yield Link(f"How {contacts} at fault came about: watch, and ask the rules what if", CONTACTS_PAGE)


def _interventions(results: Results) -> Iterator[Block]:
    yield from _section(
        "How often the shield intervened",
        "Share of steps in which the action of highest value was not one that the method's safety module "
        "finds safe. With the shield off, such actions are carried out; the share then shows how much of "
        "the rules the policy has learned.",
    )
    yield tables.interventions(results)


def _sweeps(results: Results) -> Iterator[Block]:
    study = results.study
    if not study.sweeps or results.sweeps.empty:
        return
    yield Heading(2, "Contacts at fault against the strength of sensing faults and other settings")
    tests = ", ".join(dict.fromkeys(study.tests[sweep.test].label for sweep in study.sweeps.values()))
    yield Paragraph(
        f"The same policies in the same episodes ({tests}), with one setting changed at a time. Counted are "
        "the episodes of all seeds that ended in a contact at fault."
    )
    caption = (
        "Contacts at fault against each setting, shield on: mean over seeds; the band reaches from the "
        "lowest seed to the highest."
    )
    yield Picture("figures/sweeps.png", caption, sweep_figure(results))
    yield tables.sweeps(results, "on")
    yield tables.sweeps(results, "off")


def _failures(results: Results) -> Iterator[Block]:
    yield Heading(2, "Runs that failed")
    if not results.attempts:
        yield Paragraph("None.")
        return
    yield Paragraph("A run that fails is tried once more and resumes where it stopped.")
    points = []
    for task, failures in results.attempts.items():
        end = "given up" if task in results.missing else "then done"
        points.append(f"{task.name}: {'; '.join(failure.summary for failure in failures)}; {end}")
    yield Listing(tuple(points))


def _making(results: Results) -> Iterator[Block]:
    yield Heading(2, "How this was made")
    yield Paragraph(str(results.inputs["command"]), code=True)
    for maker in results.makers:
        packages = ", ".join(f"{name} {version}" for name, version in maker["packages"].items())
        yield Paragraph(f"On {maker['machine']}; Python {maker['python']}, {packages}.")
    yield Paragraph("SHA-256 of the inputs:")
    frame = pd.DataFrame(list(results.inputs["digests"].items()), columns=["file", "SHA-256"])
    yield Table("inputs", "Inputs", frame, frame)
    yield Paragraph("The study:")
    yield Paragraph(dump_study(_portable(results.study)), code=True)


def _portable(study: StudyConfig) -> StudyConfig:
    """Return the study without the local paths of its recordings."""
    values = study.model_dump(mode="json")
    for scenario in values["tests"].values():
        recording = scenario["recording"]
        several = isinstance(recording, list)
        scenario["recording"] = [Path(one).name for one in recording] if several else Path(recording).name
    return make_study(values, "study")
