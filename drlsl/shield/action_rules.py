"""A rule program that says which of some actions are offered, asked about facts on any tier."""

from __future__ import annotations

import copy
import logging
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from difflib import get_close_matches
from functools import partial
from typing import Any, Final

import numpy as np

from drlsl.errors import UserError
from drlsl.logic import Compound, Engine, Limits, Variable
from drlsl.logic.terms import Atom
from drlsl.lowering import find_mistakes
from drlsl.lowering.backends import compile_scalar
from drlsl.lowering.frontend import Query, lower
from drlsl.lowering.ir import Kind, NotLowerable, Schema, Undecided
from drlsl.shield.asked import clauses_about_others, read_asked, with_arguments
from drlsl.shield.fact_batch import ManyFacts, count_of, facts_of_one
from drlsl.shield.fact_forms import FactForms, Facts
from drlsl.shield.offer_tiers import ArrayTier, BySize, Found, InterpretedTier, OfferTier, ScalarTier, States
from drlsl.shield.offers import Counts, Offer, Offers
from drlsl.shield.rule_answers import Interpreter
from drlsl.shield.rule_failure import RuleFailure
from drlsl.shield.rule_files import Rules, loaded
from drlsl.shield.state_memory import StateMemory
from drlsl.shield.tiers import ARRAY_TIERS, array_compiler, check_tier, choose_tier, fastest_for_many

_LOG: Final = logging.getLogger(__name__)

LIMITS: Final = Limits(inferences=2_000_000)
"""The limits of one decision by the interpreter: rules that never end must not stop the fallback."""

PATIENCE: Final = 100
"""Decisions after which one is told that the kinds of facts are still not known."""

ASK: Final = "offered(Action)"
REASONS: Final = "objection(Action, Reason)"

_NOTHING: Final = "the rules offer no action"


class ActionRules:
    """The actions that a rule program offers; threads may share one, and take turns.

    The program is asked for every solution of `ask`, each an action's name. Where it fails, raises an error,
    goes beyond `limits` or offers nothing, the `fallback` alone is offered, and that is counted.
    """

    def __init__(
        self,
        rules: Rules,
        actions: Sequence[str],
        *,
        fallback: str,
        ask: str = ASK,
        reasons: str = REASONS,
        tier: str = "auto",
        schema: Schema | None = None,
        limits: Limits = LIMITS,
        remember: int = 0,
    ) -> None:
        """Load the program and check it; findings that are no errors are logged as warnings.

        Without a `schema` the facts are those of predicates that the program declares dynamic, and the first
        facts tell the kinds of their columns. What was found for `remember` states is kept, and given
        again for the same facts; facts in arrays are decided anew each time.

        Raises:
            UserError: the program cannot be loaded, does not define what is asked, calls a predicate that is
                not defined, or names an action that is not among `actions`; or the tier cannot run it, as far
                as is known without facts.
        """
        self.actions: Final = _checked_names(actions)
        self._places = {name: place for place, name in enumerate(self.actions)}
        if fallback not in self._places:
            raise UserError(f"fallback: {fallback} is {self._not_among(fallback)}")
        self.fallback: Final = fallback
        self.counts: Final = Counts()
        self._engine = loaded(rules)
        self._ask = read_asked(self._engine, ask, "ask", 1)
        if not self._engine.defines(self._ask.name, 1):
            raise UserError(f"the rules do not define {self._ask}, which says what is offered; see `ask`")
        self._reasons = read_asked(self._engine, reasons, "reasons", 2)
        if not self._engine.defines(self._reasons.name, 2) and reasons != REASONS:
            raise UserError(
                f"the rules do not define {self._reasons}, which says why an action is not offered"
            )
        for asked in (self._ask, self._reasons):
            for place, problem in clauses_about_others(self._engine, asked, self._problem_with):
                raise UserError(f"{place}: {problem}")
        self._forms = FactForms(self._engine, schema)
        self._check_for_mistakes(schema)
        self._tier_name = check_tier(tier)
        self._query = Query(self._ask.name, 1, "set")
        self._why = Query(self._reasons.name, 2, "all")
        if not isinstance(limits, Limits):
            raise UserError(f"limits is {limits!r:.80}; expected drlsl.logic.Limits(inferences=100_000)")
        self._limits = limits
        self._known: StateMemory[Offer] = StateMemory(remember)
        self._known_reasons: StateMemory[Sequence[tuple[Any, ...]]] = StateMemory(remember)
        self._names: dict[int, str] = {}  # of integers in arrays
        self._states = States(self._place, len(self.actions), self._forms, self._names)
        self._reference = InterpretedTier(Interpreter(self._engine, [self._query], limits), self._states)
        self._lock = threading.RLock()
        self._forget_code()
        self._check_possible_answers()
        if tier != "auto":
            self._tier(many=False)

    def __getstate__(self) -> dict[str, Any]:
        """Return the engine and what is known of the facts; a copy generates the code of its tiers anew."""
        with self._lock:
            state = vars(self).copy()
        for name in ("_lock", "_for_one", "_for_many", "_say"):
            del state[name]
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._lock = threading.RLock()
        self._forget_code()

    def __copy__(self) -> ActionRules:
        """Return a deep copy: two on one engine would overwrite each other's facts."""
        return copy.deepcopy(self)

    def _forget_code(self) -> None:
        self._for_one: OfferTier | None = None
        self._for_many: OfferTier | None = None
        self._say: Callable[[Facts], tuple[Any, ...]] | None = None

    def with_tier(self, tier: str) -> ActionRules:
        """Return rules of the same program that run on another tier, with counts of their own.

        Raises:
            UserError: the tier cannot run the program.
        """
        with self._lock:
            other = ActionRules.__new__(ActionRules)
            vars(other).update(vars(self) | {"_tier_name": check_tier(tier), "counts": Counts()})
            other._forget_code()
            other._tier(many=tier in ARRAY_TIERS)
        return other

    @property
    def engine(self) -> Engine:
        """The engine with the program."""
        return self._engine

    def offer(self, facts: Facts) -> Offer:
        """Return the actions offered in the state of `facts`.

        Raises:
            UserError: facts are not of the form that was declared, the tier cannot run the program, or the
                rules offer an action that is not among `actions`.
        """
        with self._lock:
            self._check_forms(facts)
            self.counts.decisions += 1
            key = self._known.key(facts)
            if (known := self._known.get(key)) is not None:
                return known
            try:
                offer = Offer(self._decided(facts))
            except RuleFailure as failure:
                return self._failed(str(failure))
            self._known.keep(key, offer)
            return offer

    def decide(self, facts: Facts) -> tuple[str, ...]:
        """Return the actions that the rules themselves offer in the state of `facts`, never none.

        Raises:
            RuleFailure: the rules gave no usable answer.
            UserError: as `offer` does.
        """
        with self._lock:
            self._check_forms(facts)
            return self._decided(facts)

    def offers(self, facts: ManyFacts) -> Offers:
        """Return the actions offered in each of N states.

        Raises:
            UserError: as `offer` does.
        """
        with self._lock:
            if self._known.most and not isinstance(facts, Mapping):
                return self._offers_of_each(facts)
            self._learn_many(facts)
            offers = self._decided_many(facts, count_of(facts))
            self.counts.decisions += len(offers.mask)
            for failure in offers.failures.values():
                self._count_failure(failure)
            return offers

    def decide_many(self, facts: ManyFacts) -> Offers:
        """Return the actions offered in each of N states, without counting failures.

        Raises:
            UserError: as `offer` does.
        """
        with self._lock:
            self._learn_many(facts)
            return self._decided_many(facts, count_of(facts))

    def objections(self, facts: Facts, action: str) -> tuple[str, ...]:
        """Return why an action is not offered in the state of `facts`; nothing if the rules do not say it.

        Raises:
            UserError: facts are not of the form that was declared, or `action` is not among `actions`.
        """
        if action not in self._places:
            raise UserError(f"the action {action} is {self._not_among(action)}")
        if not self._engine.defines(self._reasons.name, 2):
            return ()
        with self._lock:
            try:
                solutions = self._said(facts)
            except RuleFailure as failure:
                return (str(failure),)
            at = self._reasons.action
            return tuple(self._engine.format(each[1 - at]) for each in solutions if each[at] == action)

    def objections_in(self, facts: ManyFacts, index: int, action: str) -> tuple[str, ...]:
        """Return why an action is not offered in one of many states; nothing if the rules do not say it.

        Raises:
            UserError: facts are not of the form that was declared.
        """
        schema = self._forms.schema or self._forms.guess("int")
        return self.objections(facts_of_one(facts, index, schema, self._names), action)

    def code(self, atom: str) -> int:
        """Return the integer of a name, for columns of names in arrays.

        Raises:
            UserError: the facts have no `schema` that says which columns hold names.
        """
        with self._lock:
            if self._forms.schema is None:
                raise UserError(
                    "names in arrays as integers need a `schema`; give the names as texts without"
                )
            code = self._tier(many=True).code(atom)
            self._names[code] = atom
            return code

    @property
    def tier(self) -> str:
        """The tier for one state; "interpreter" until the kinds of all facts are known."""
        with self._lock:
            return self._tier(many=False).name

    @property
    def tier_for_many(self) -> str:
        """The tier for many states; "interpreter" until the kinds of all facts are known."""
        with self._lock:
            return self._tier(many=True).name

    def _offers_of_each(self, facts: Sequence[Facts]) -> Offers:
        mask = np.zeros((len(facts), len(self.actions)), dtype=np.bool_)
        failures = {}
        for index, each in enumerate(facts):
            offer = self.offer(each)
            mask[index, [self._places[name] for name in offer.actions]] = True
            if offer.failure:
                failures[index] = offer.failure
        return Offers(mask, failures)

    def _check_forms(self, facts: Facts) -> None:
        if self._forms.schema is None:
            self._forms.learn(facts)
            self._warn_of_unknown_forms()
        elif not isinstance(facts, Mapping) or facts.keys() != self._forms.keys:
            self._forms.check_keys(facts)

    def _decided(self, facts: Facts) -> tuple[str, ...]:
        try:
            offered = self._tier(many=False).one(facts)
        except Undecided:
            self.counts.interpreted += 1
            offered = self._reference.one(facts)
        if not offered:
            raise RuleFailure(_NOTHING)
        return tuple(self.actions[place] for place in sorted({self._place(name) for name in offered}))

    def _decided_many(self, facts: ManyFacts, count: int) -> Offers:
        found = self._tier(many=True).many(facts, count)
        mask, failures = found.mask, found.failures
        if found.undecided:
            self._interpret(found.undecided, facts, found)
        nothing: list[int] = np.flatnonzero(~mask.any(axis=1)).tolist()
        for index in nothing:
            failures.setdefault(index, _NOTHING)
            mask[index, self._places[self.fallback]] = True
        return Offers(mask, failures)

    def _interpret(self, states: Sequence[int], facts: ManyFacts, found: Found) -> None:
        """Have the interpreter decide the states that a faster tier left to it."""
        self.counts.interpreted += len(states)
        schema = self._forms.schema
        assert schema is not None
        for index in states:
            found.mask[index] = False
            try:
                offered = self._reference.one(facts_of_one(facts, index, schema, self._names))
                found.mask[index, [self._place(each) for each in offered]] = True
            except RuleFailure as failure:
                found.failures[index] = str(failure)

    def _learn_many(self, facts: ManyFacts) -> None:
        if isinstance(facts, Mapping):
            if self._forms.schema is None:
                self._forms.learn_arrays(facts)
            self._forms.check_keys(facts)
            return
        for each in facts:
            if self._forms.schema is None:
                self._forms.learn(each)
            self._forms.check_keys(each)

    def _said(self, facts: Facts) -> Sequence[tuple[Any, ...]]:
        key = self._known_reasons.key(facts)
        solutions = self._known_reasons.get(key)
        if solutions is None:
            solutions = self._ask_why(facts)
            self._known_reasons.keep(key, solutions)
        return solutions

    def _ask_why(self, facts: Facts) -> Sequence[tuple[Any, ...]]:
        if self._forms.schema is not None:
            if self._say is None:
                self._say = self._sayer(self._forms.schema)
            with suppress(Undecided):
                (solutions,) = self._say(facts)
                return solutions  # type: ignore[no-any-return]
        return self._interpreted_reasons(facts)[0]  # type: ignore[no-any-return]

    def _sayer(self, schema: Schema) -> Callable[[Facts], tuple[Any, ...]]:
        """Return what gives the solutions of the question for reasons."""
        if self._tier_name != "interpreter":
            with suppress(NotLowerable):
                return compile_scalar(lower(self._engine, schema, [self._why]))
        return self._interpreted_reasons

    def _interpreted_reasons(self, facts: Facts) -> tuple[Any, ...]:
        interpreter = Interpreter(self._engine, [self._why], self._limits)
        interpreter.state(self._forms.conformed(facts))
        return interpreter.answers()

    def _warn_of_unknown_forms(self) -> None:
        if self.counts.decisions == PATIENCE and self._tier_name != "interpreter" and self._forms.unknown():
            _LOG.warning(
                "the rules run on the interpreter, which is slow: in %d states there were no facts of %s, so "
                "the kinds of their columns are not known; declare them by `schema`",
                PATIENCE,
                ", ".join(self._forms.unknown()),
            )

    def _failed(self, reason: str) -> Offer:
        self._count_failure(reason)
        return Offer((self.fallback,), reason)

    def _count_failure(self, reason: str) -> None:
        """Count a decision in which the fallback alone is offered; tell of the first."""
        if not self.counts.fail_safes:
            told = "the fallback %s alone is offered, this time and as often as `counts` says: %s"
            _LOG.warning(told, self.fallback, reason)
        self.counts.fail(reason)

    def _place(self, action: Any) -> int:
        """Return the place of an action that the rules offer.

        Raises:
            UserError: it is not among `actions`.
        """
        place = self._places.get(action) if isinstance(action, str) else None
        if isinstance(action, Variable):
            raise UserError(
                f"{self._ask}: an action is a variable without a value; names begin in lower case"
            )
        if isinstance(action, Compound):
            raise UserError(f"{self._ask}: {with_arguments(action.name, len(action.args))}")
        if place is None:
            raise UserError(f"{self._ask}: {self._problem_with(self._engine.format(action))}")
        return place

    def _problem_with(self, name: str) -> str:
        """Return the problem with an action's name; nothing if there is none."""
        return (
            ""
            if name in self._places
            else f"the rules name the action {name}, which is {self._not_among(name)}"
        )

    def _not_among(self, name: str) -> str:
        near = get_close_matches(name, self.actions, 1)
        return f"not among {', '.join(self.actions)}" + (f"; did you mean {near[0]}?" if near else "")

    def _check_for_mistakes(self, schema: Schema | None) -> None:
        """Refuse a program with mistakes that are errors, and tell of others."""
        for finding in find_mistakes(self._engine, schema or Schema(())):
            if finding.error:
                raise UserError(f"the rules cannot be used: {finding}")
            _LOG.warning("%s", finding)

    def _check_possible_answers(self) -> None:
        """Check the actions that the program can offer, as far as it can be lowered without facts."""
        kinds: tuple[Kind, ...] = ("float", "atom") if self._forms.schema is None else ("float",)
        for kind in kinds:
            with suppress(NotLowerable):
                (answer,) = lower(self._engine, self._forms.guess(kind), [self._query]).answers
                for value, _ in answer.choices or ():
                    self._place(value.name if isinstance(value, Atom) else value)

    def _tier(self, *, many: bool) -> OfferTier:
        if self._forms.schema is None:
            return self._reference
        tier = self._for_many if many else self._for_one
        if tier is None:
            arrays = many or self._tier_name in ARRAY_TIERS
            fastest = self._fastest_for_many if arrays else partial(self._lowered, "scalar")
            reference: OfferTier = self._reference
            tier = choose_tier(self._tier_name, reference, self._lowered, fastest)
            _LOG.info("the rules run on the %s tier", tier.name)
            if many or arrays:
                self._for_many = tier
            if not many:
                self._for_one = tier
        return tier

    def _fastest_for_many(self) -> OfferTier:
        try:
            return fastest_for_many(self._lowered, BySize)
        except NotLowerable as problem:
            tier = self._lowered("scalar")
            _LOG.warning("the rules run on the scalar tier, one state at a time: %s", problem)
            return tier

    def _lowered(self, name: str) -> OfferTier:
        if name == "scalar":
            return ScalarTier(self._engine, self._query, self._states)
        return ArrayTier(name, self._engine, self._query, self._states, self.actions, array_compiler(name))


def _checked_names(actions: Sequence[str]) -> tuple[str, ...]:
    """Return the names of actions.

    Raises:
        UserError: there are none, one is no name, or two are the same.
    """
    names = tuple(actions)
    for name in names:
        if not isinstance(name, str) or not name:
            raise UserError(f"actions: the name {name!r} is no text; give the names that the rules use")
    if not names:
        raise UserError("actions: there are none; give the names that the rules use")
    if len(set(names)) < len(names):
        raise UserError(f"actions: a name is given twice in {', '.join(names)}")
    return names
