"""The clause store: predicates, their clauses in order, and the index on the first argument.

Lists of clauses only grow at the end or are replaced, so an iteration that remembers a list, its length and
the program's generation sees the predicate as it was when the iteration began: the logical update view (ISO
13211-1, 7.5.4).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Final, TypeAlias

from drlsl.logic.core.goal_tree import Goal, read_body
from drlsl.logic.syntax import ReadTerm
from drlsl.logic.terms import TRUE, Atom, Struct, Term, Var, deref

Indicator: TypeAlias = tuple[str, int]
Row: TypeAlias = tuple[Term, ...]

_MOST_KEPT: Final = 200_000  # answers in the tables that a program keeps for later queries


class Clause:
    """A clause ``head :- body``; a fact's body is ``true``.

    `span` is the place where the clause was read, None for an asserted one; `names` maps the source's names
    of variables to the variables of `head` and `body`; `origin` is its `ReadTerm`, and `source` the name of
    the text.
    """

    __slots__ = ("body", "code", "erased", "head", "names", "origin", "predicate", "source", "span")

    def __init__(
        self,
        head: Term,
        body: Term,
        span: Any = None,
        names: dict[str, Var] | None = None,
        source: str | None = None,
        origin: Any = None,
    ) -> None:
        self.head = head
        self.body = body
        self.span = span
        self.names = names or {}
        self.source = source
        self.origin = origin
        self.erased = 0  # the generation of its removal; 0 until then
        self.code: Any = None  # the solver's code of the clause, made when it is first tried
        self.predicate: Any = None  # its predicate

    @property
    def args(self) -> tuple[Term, ...]:
        """The arguments of the head."""
        return self.head.args if type(self.head) is Struct else ()

    def __repr__(self) -> str:
        return f"Clause({self.head!r}, {self.body!r}, span={self.span!r})"


def body_of(clause: Clause) -> Goal:
    """Return the body of a clause as its text has it, with places, where it was read from one."""
    read = clause.origin
    if isinstance(read, ReadTerm) and isinstance(read.term, Struct) and read.term.name == ":-":
        return read_body(read.term.args[1], read.place(read.term, 1) or clause.span, read)
    return read_body(clause.body, clause.span)


def index_key(term: Term) -> Any:
    """Return the key of a dereferenced term that is not a variable: terms of different keys never unify."""
    kind = type(term)
    if kind is Struct:
        return term.name, len(term.args)  # type: ignore[union-attr]  # kind says so
    if kind is float or kind is str:
        return kind, term
    return term


class Predicate:
    """The clauses of one name and arity.

    A predicate holds either clauses or, after `Program.replace_facts`, rows of atomic arguments; rows become
    clauses on demand.
    """

    __slots__ = (
        "_dead",
        "_row_index",
        "arity",
        "buckets",
        "clauses_entry",
        "cold",
        "defined",
        "discontiguous",
        "dynamic",
        "entry",
        "multifile",
        "name",
        "others",
        "program",
        "rows",
        "start",
        "stored",
        "tabled",
    )

    def __init__(self, program: Program, name: str, arity: int) -> None:
        self.program = program
        self.name = name
        self.arity = arity
        self.dynamic = False
        self.discontiguous = False
        self.multifile = False
        self.defined = False  # defined in the program: it has or had clauses, or was declared
        self.tabled: Any = None  # the function that answers a call from a table; None without a table
        self.clauses_entry: Any = None  # the function that runs the clauses of a tabled predicate
        self.cold = 0  # the number of calls by the plain solver before they go through `entry`
        self.entry: Any = None  # the function by which compiled code calls it
        self.stored: list[Clause] = []  # erased ones included
        self.rows: list[Row] | None = None  # the facts as rows while the predicate was filled in bulk
        self._row_index: dict[Any, list[Row]] | None = None
        self.buckets: dict[Any, list[Clause]] | None = None  # by key of the first argument, once asked for
        self.others: list[Clause] = []  # those that match any key, and are in every bucket
        self._dead = 0
        self.start = 0  # every clause before this place of `stored` is erased
        self.reset()

    def __repr__(self) -> str:
        return f"Predicate({self.name}/{self.arity}, {len(self)} clauses)"

    def __len__(self) -> int:
        return len(self.stored) - self._dead if self.rows is None else len(self.rows)

    def reset(self) -> None:
        """Forget the code of the clauses."""
        self.entry = self.program.make_entry(self)

    def changed(self) -> None:
        """Forget the code of the clauses, and every answer that was found with them."""
        self.program.tables.clear()
        self.reset()

    def ask(self, clause: Clause) -> None:
        """Take the clause of a query, which affects no other code."""
        clause.predicate = self
        self.stored = [clause]
        self.defined = True

    @property
    def indicator(self) -> Indicator:
        return self.name, self.arity

    @property
    def clauses(self) -> Sequence[Clause]:
        """The clauses in order, without those removed."""
        stored = self.stored_clauses()
        return stored if not self._dead else [clause for clause in stored if not clause.erased]

    def stored_clauses(self) -> list[Clause]:
        """Return the stored list of clauses, erased ones included, for iterations that check generations."""
        if self.rows is not None:
            self.replace(self._row_clauses(self.rows))
        return self.stored

    def listed(self) -> list[Clause]:
        """Return the clauses in order, without converting rows to clauses for good."""
        return list(self.clauses) if self.rows is None else self._row_clauses(self.rows)

    def _row_clauses(self, rows: Iterable[Row]) -> list[Clause]:
        return [Clause(Struct(self.name, row) if row else Atom(self.name), TRUE) for row in rows]

    def index(self) -> None:
        """Make the index by which clauses are looked up."""
        if self.buckets is None and len(self.stored) > 1:
            self.make_buckets()

    def candidates(self, first: Term) -> list[Clause]:
        """Return the clauses whose first argument may unify with a dereferenced term, with erased ones."""
        clauses = self.stored_clauses() if self.rows is not None else self.stored
        if len(clauses) < 2:
            return clauses
        index = self.buckets
        if index is None:
            index = self.make_buckets()
        kind = type(first)
        if kind is Struct:
            return index.get((first.name, len(first.args)), self.others)  # type: ignore[union-attr]
        if kind is Var:
            return clauses
        if kind is float or kind is str:
            return index.get((kind, first), self.others)
        return index.get(first, self.others)

    def candidate_rows(self, first: Term) -> list[Row]:
        """Return the rows whose first argument equals `first`, dereferenced; all if it is a variable."""
        rows = self.rows
        assert rows is not None
        if type(first) is Var or not self.arity:
            return rows
        index = self._row_index
        if index is None:
            index = self._row_index = {}
            for row in rows:
                index.setdefault(index_key(row[0]), []).append(row)
        return index.get(index_key(first), [])

    def make_buckets(self) -> dict[Any, list[Clause]]:
        if self._dead:
            self._purge()
        index: dict[Any, list[Clause]] = {}
        others: list[Clause] = []
        for clause in self.stored:
            _index_clause(index, others, clause)
        self.others = others
        self.buckets = index
        return index

    def _purge(self) -> None:
        self.stored = [clause for clause in self.stored if not clause.erased]
        self._dead = 0
        self.start = 0
        self.buckets = None

    def append(self, clause: Clause) -> None:
        """Add a clause after the others."""
        clauses = self.stored_clauses()
        clause.predicate = self
        clauses.append(clause)
        self.defined = True
        self.changed()
        if self.buckets is not None:
            if self.arity:
                _index_clause(self.buckets, self.others, clause)
            else:
                self.buckets = None

    def prepend(self, clause: Clause) -> None:
        """Add a clause before the others."""
        clause.predicate = self
        self.buckets = None
        self.stored = [clause, *self.stored_clauses()[self.start :]]
        self._dead -= self.start
        self.start = 0
        self.defined = True
        self.changed()

    def replace(self, clauses: list[Clause]) -> None:
        """Replace all clauses by these; running iterations keep the old ones."""
        self.buckets = None
        self.rows = self._row_index = None
        self._dead = 0
        self.start = 0
        self.stored = clauses
        self.defined = True
        self.changed()
        for clause in clauses:
            clause.predicate = self

    def replace_rows(self, rows: list[Row]) -> None:
        """Replace all clauses by these facts."""
        self.rows = rows
        self._row_index = None
        self.stored = []
        self.buckets = None
        self._dead = 0
        self.start = 0
        self.defined = True
        self.changed()

    def erase(self, clause: Clause) -> bool:
        """Remove a clause; return False if it was removed before."""
        if clause.erased:
            return False
        self.program.generation += 1
        clause.erased = self.program.generation
        self._dead += 1
        self.changed()
        clauses = self.stored
        start = self.start
        while start < len(clauses) and clauses[start].erased:
            start += 1
        self.start = start
        if self._dead > 8 + len(clauses) // 2:
            self._purge()
        elif self.buckets is not None and self.arity:
            self._unindex(clause)
        return True

    def _unindex(self, clause: Clause) -> None:
        """Remove an erased clause from its bucket by replacing the bucket, so old iterations keep theirs."""
        first = deref(clause.args[0])
        if type(first) is Var:
            self.buckets = None
            return
        assert self.buckets is not None
        key = index_key(first)
        bucket = self.buckets.get(key)
        if bucket is not None and len(bucket) <= 64:
            left = [other for other in bucket if not other.erased]
            if left:
                self.buckets[key] = left
            elif self.others:
                self.buckets = None
            else:
                del self.buckets[key]


def _index_clause(index: dict[Any, list[Clause]], others: list[Clause], clause: Clause) -> None:
    if not clause.args or type(deref(clause.args[0])) is Var:
        for each in index.values():
            each.append(clause)
        others.append(clause)
        return
    key = index_key(deref(clause.args[0]))
    bucket = index.get(key)
    if bucket is not None:
        bucket.append(clause)
    else:
        index[key] = [*others, clause]


class Tables:
    """The complete tables of a program, by predicate and call; any change of a clause drops them all."""

    __slots__ = ("_answers", "_tables", "generation")

    def __init__(self) -> None:
        self._tables: dict[Any, Any] = {}
        self._answers = 0
        self.generation = 0  # the number of times that they were dropped

    def get(self, key: Any) -> Any:
        """Return the table of a call; None if there is none."""
        return self._tables.get(key)

    def keep(self, tables: Mapping[Any, Any], generation: int) -> None:
        """Keep tables for later calls, if no clause was changed since the generation that they began in."""
        if generation != self.generation:
            return
        self._answers += sum(len(table.answers) + 1 for table in tables.values())
        if self._answers > _MOST_KEPT:
            self.clear()
        else:
            self._tables.update(tables)

    def clear(self) -> None:
        """Drop every table."""
        self.generation += 1
        self._answers = 0
        if self._tables:
            self._tables = {}


class Program:
    """The predicates of one engine by name and arity."""

    __slots__ = ("generation", "link", "make_entry", "predicates", "resume", "tables")

    def __init__(
        self,
        link: Callable[[Any, str, int], None],
        make_entry: Callable[[Predicate], Any],
        resume: Callable[[Clause], None],
    ) -> None:
        self.resume = resume  # may compile the body of a clause that the plain solver often returns to
        self.make_entry = make_entry  # the function by which compiled code calls a predicate at first
        self.link = link  # sets the target of a node in a clause of this program
        self.predicates: dict[Indicator, Predicate] = {}
        self.tables = Tables()
        self.generation = 1

    def get(self, name: str, arity: int) -> Predicate:
        """Return the predicate of that name and arity, created if necessary; see `Predicate.defined`."""
        predicate = self.predicates.get((name, arity))
        if predicate is None:
            predicate = self.predicates.setdefault((name, arity), Predicate(self, name, arity))
        return predicate

    def find(self, name: str, arity: int) -> Predicate | None:
        """Return the predicate of that name and arity if the program defines it."""
        predicate = self.predicates.get((name, arity))
        return predicate if predicate is not None and predicate.defined else None

    def replace_facts(self, name: str, arity: int, rows: Iterable[Row]) -> None:
        """Replace the clauses of a predicate, which becomes dynamic, by these rows of atomic terms."""
        predicate = self.get(name, arity)
        predicate.dynamic = True
        predicate.replace_rows(list(rows))

    def remove_source(self, source: str) -> None:
        """Remove every clause that came from the named source."""
        for predicate in self.predicates.values():
            if predicate.rows is None and any(clause.source == source for clause in predicate.clauses):
                left = [clause for clause in predicate.clauses if clause.source != source]
                if not left:
                    predicate.tabled = None
                predicate.replace(left)

    def snapshot(self) -> dict[Indicator, tuple[Any, ...]]:
        """Return all that `restore` needs to restore the present program."""
        return {
            key: (
                None if predicate.rows is not None else list(predicate.clauses),
                predicate.rows,
                predicate.dynamic,
                predicate.discontiguous,
                predicate.multifile,
                predicate.defined,
                predicate.tabled,
            )
            for key, predicate in self.predicates.items()
        }

    def restore(self, snapshot: dict[Indicator, tuple[Any, ...]]) -> None:
        """Restore the program of a snapshot."""
        for key, predicate in self.predicates.items():
            clauses, rows, dynamic, discontiguous, multifile, defined, tabled = snapshot.get(
                key, ([], None, False, False, False, False, None)
            )
            if predicate.tabled is not tabled:
                predicate.tabled = tabled
                predicate.changed()
            if rows is not None:
                predicate.replace_rows(rows)
            elif len(predicate) != len(clauses) or list(predicate.clauses) != clauses:
                for clause in clauses:
                    clause.erased = 0
                predicate.replace(clauses)
            predicate.dynamic = dynamic
            predicate.discontiguous = discontiguous
            predicate.multifile = multifile
            predicate.defined = defined
