"""Set drlsl rules learn beside a decision tree, RIPPER and FOLD-R++ on the same labelled lane changes.

It needs scikit-learn, wittgenstein and foldrpp, which DRLSL itself does not. What is judged is the text that
a learner writes, read back and evaluated here: foldrpp rounds the thresholds that it prints, so that its text
is not its model. The result is a table in Markdown.
"""

from __future__ import annotations

import argparse
import re
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from drlsl.driving.shield import Shield
from drlsl.induction import SearchProblem, covered, search
from drlsl.induction.lane_changes import ChangeExamples, Labelling, SceneBias, cached_changes
from drlsl.logic import Engine
from drlsl.traffic import load_recording
from drlsl.workers import followed

Rows = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

NOBODY = 1000.0
"""What the other learners see of a quantity that concerns no vehicle: easier than any."""


class Written(NamedTuple):
    """The text of a learner, the number of its literals, and which rows it offers."""

    text: str
    literals: int
    offers: Callable[[Rows], Mask]


def tree(rows: Rows, unsafe: Mask, names: list[str]) -> Written:
    """Return the text of a decision tree of depth 4 in which an unsafe row weighs 20 safe ones."""
    from sklearn.tree import DecisionTreeClassifier, export_text

    model = DecisionTreeClassifier(max_depth=4, class_weight={False: 1, True: 20}, random_state=0)
    text = str(export_text(model.fit(rows, unsafe), feature_names=names, decimals=2))
    lines = text.splitlines()

    def offers(some: Rows) -> Mask:
        result = np.ones(len(some), dtype=np.bool_)
        path: list[Mask] = []
        for line in lines:
            depth, told = line.count("|   "), line.split("--- ")[1]
            del path[depth:]
            test = re.fullmatch(r"(\w+) *(<=|>) *(-?[\d.]+)", told)
            here = np.logical_and.reduce(path) if path else np.ones(len(some), dtype=np.bool_)
            if test is None:
                if told == "class: True":
                    result &= ~here
                continue
            values = some[:, names.index(test[1])]
            path.append(values <= float(test[3]) if test[2] == "<=" else values > float(test[3]))
        return result

    return Written(text, sum("class" not in line for line in lines), offers)


def ripper(rows: Rows, unsafe: Mask, names: list[str]) -> Written:
    """Return the text of RIPPER's rules for safe rows."""
    import pandas as pd
    import wittgenstein

    frame = pd.DataFrame(rows, columns=names).assign(safe=~unsafe)
    model = wittgenstein.RIPPER(random_state=0)
    model.fit(frame, class_feat="safe", pos_class=True)
    text = str(model.ruleset_)
    rules = [one.strip("[]").split("^") for one in text.strip("[]").split("] V [")]

    def holds(condition: str, some: Rows) -> Mask:
        name, _, told = condition.partition("=")
        values = some[:, names.index(name)]
        one = re.fullmatch(r"([<>])(-?[\d.]+)|(-?[\d.]+)-(-?[\d.]+)", told.replace(" ", ""))
        if one is None:
            return np.asarray(values == float(told))
        if one[1] is not None:
            return np.asarray(values < float(one[2]) if one[1] == "<" else values > float(one[2]))
        return np.asarray((values >= float(one[3])) & (values <= float(one[4])))

    def offers(some: Rows) -> Mask:
        each = [np.logical_and.reduce([holds(one, some) for one in rule]) for rule in rules]
        return np.asarray(np.logical_or.reduce(each))

    return Written(text, sum(map(len, rules)), offers)


def fold(rows: Rows, unsafe: Mask, names: list[str]) -> Written:
    """Return the text of FOLD-R++'s program for safe rows."""
    from foldrpp import Foldrpp

    model = Foldrpp(str_attrs=[], num_attrs=names, label="safe", pos_val="1")
    keys = (*names, "label")
    told_rows = [(*row, int(not bad)) for row, bad in zip(rows.tolist(), unsafe, strict=True)]
    model.fit([dict(zip(keys, row, strict=True)) for row in told_rows], ratio=0.1)
    told = model.asp()
    text = told if isinstance(told, str) else "\n".join(told)

    def offers(some: Rows) -> Mask:
        engine = Engine()
        prolog = re.sub(r"(=<|>)-", r"\1 -", text.replace("not ", "\\+ "))
        engine.consult_text(f":- discontiguous(safe/2).\n{prolog}", "foldrpp")
        goal = engine.prepare("safe(0, '1')")
        found = []
        for row in some.tolist():
            for name, value in zip(names, row, strict=True):
                engine.replace_facts(name, 2, [(0, value)])
            found.append(goal.holds())
        return np.array(found)

    return Written(text, len(re.findall(r"N\d+(?:=<|>)|\\\+ |not ", text)), offers)


LEARNERS: dict[str, Callable[[Rows, Mask, list[str]], Written]] = {
    "decision tree, depth 4, unsafe x 20": tree,
    "RIPPER (wittgenstein)": ripper,
    "FOLD-R++ (foldrpp), ratio 0.1": fold,
}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--changes", type=int, default=3000, help="labelled lane changes of each recording")
    parser.add_argument("--train", nargs="+", default=["highway-train", "freeway"])
    parser.add_argument("--test", nargs="+", default=["highway-test"])
    parser.add_argument("--seconds", type=float, default=60.0, help="of the search for clauses")
    parser.add_argument("--texts", action="store_true", help="print what each learner wrote, too")
    asked = parser.parse_args()
    bias, how = SceneBias("learning.pl"), Labelling(changes=asked.changes)
    parts = [
        ChangeExamples(
            bias, [followed(cached_changes(how, "learning.pl", load_recording(name))) for name in names]
        )
        for names in (asked.train, asked.test)
    ]
    train, test = parts
    print(f"train: {len(train.unsafe):,} rows, {train.unsafe.sum():,} unsafe; ", end="")
    print(f"test: {len(test.unsafe):,} rows, {test.unsafe.sum():,} unsafe\n")
    print("| learner | s | literals | unsafe admitted, train / test | safe offered, train / test |")
    print("|---|---|---|---|---|")
    texts = []

    def row(name: str, seconds: float | None, literals: int | None, offered: list[Mask]) -> None:
        both = list(zip(offered, parts, strict=True))
        unsafe = " / ".join(str(int((mask & one.unsafe).sum())) for mask, one in both)
        safe = " / ".join(f"{mask[~one.unsafe].mean():.2f}" for mask, one in both)
        told = "-" if seconds is None else f"{seconds:.1f}"
        print(
            f"| {name} | {told} | {'-' if literals is None else literals} | {unsafe} | {safe} |", flush=True
        )

    shield = Shield.default(tier="numpy")
    row("highway.pl itself", None, None, [_offered(shield, one) for one in parts])
    names = [re.sub(r"\W+", "_", str(one)).strip("_").lower().replace("_side", "") for one in bias.quantities]
    numbers = [_numbers(bias, one) for one in parts]
    for name, learn in LEARNERS.items():
        begun = time.perf_counter()
        written = learn(numbers[0], train.unsafe, names)
        took = time.perf_counter() - begun
        texts.append(written.text)
        row(name, took, written.literals, [written.offers(one) for one in numbers])
    for clauses in (1, 3):
        begun = time.perf_counter()
        problem = SearchProblem(bias.quantities, train.eases[~train.unsafe], train.eases[train.unsafe])
        found = search(problem, clauses=clauses, literals=4, seconds=asked.seconds)
        literals = sum(one.literals for one in found.clauses)
        name = f"drlsl rules learn, K = {clauses}, {'optimal' if found.optimal else 'best found'}"
        row(name, time.perf_counter() - begun, literals, [covered(found.clauses, one.eases) for one in parts])
    if asked.texts:
        print("\n\n".join(["", *texts]))


def _offered(shield: Shield, examples: ChangeExamples) -> Mask:
    """Return which of the lane changes a shield offers."""
    mask = shield.decide_batch(examples.scenes).action_mask
    return np.asarray(mask[np.arange(len(mask)), 1 + examples.choice])


def _numbers(bias: SceneBias, examples: ChangeExamples) -> Rows:
    """Return the quantities as numbers, those that concern no vehicle as easy as none else."""
    values: Any = bias.values(examples.scenes)[np.arange(len(examples.choice)), examples.choice]
    easy = np.array([NOBODY if one.more else -NOBODY for one in bias.quantities])
    return np.asarray(np.where(np.isnan(values), easy, values))


if __name__ == "__main__":
    main()
