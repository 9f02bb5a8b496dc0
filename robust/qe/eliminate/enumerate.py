"""The satisfying points of quantifier-free formulas as polyhedra, found lazily by satisfiability queries.

Every model is generalised to a conjunction of constraints that implies the formula; constraints that the implication
does not need are dropped one by one, so that few and large pieces cover the formula (prime implicants in the sense of
Quine, modulo linear arithmetic).
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import TypeVar

from robust.qe.constraint import Coefficients, LinearConstraint, trim
from robust.qe.eliminate.interface import (
    Conjunction,
    Context,
    Eliminator,
    Query,
    irredundant,
    outside,
    project,
    project_at,
    solve_equalities,
    variables_of,
    without,
)
from robust.qe.nnf import (
    FALSE,
    TRUE,
    Junction,
    Literal,
    Model,
    Nnf,
    Reader,
    conjunction,
    disjunction,
    implicant,
    names_in,
    negation,
)
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Session, Verdict

Leaf = LinearConstraint | Literal
L = TypeVar("L", bound=Leaf)


class Outlook:
    """A session in which nothing must be left: whether a conjunction stays inside what its assertions exclude."""

    def __init__(self, session: Session, reader: Reader, deadline: Deadline) -> None:
        self._session = session
        self._reader = reader
        self._deadline = deadline

    def add(self, *formulas: Nnf) -> None:
        for formula in formulas:
            self._session.add(self._reader.write(formula))

    def exclude(self, piece: Conjunction) -> None:
        self._session.add(self._reader.outside(piece))

    def excludes(self, constraints: Iterable[Leaf], *extra: Nnf) -> bool:
        """Whether no point of the conjunction satisfies the assertions.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        with self._session.frame(*(self._reader.write(part) for part in (*constraints, *extra))):
            return not satisfiable(self._session, "a generalised piece stays inside", self._deadline)

    def generalize(self, leaves: tuple[L, ...]) -> tuple[L, ...]:
        """A part of the conjunction that is still excluded, of which nothing more can be left out."""
        return minimal(leaves, self.excludes)


def minimal(leaves: tuple[L, ...], enough: Callable[[tuple[L, ...]], bool]) -> tuple[L, ...]:
    """A part of the leaves that is still enough, of which no single one can be left out [Junker 2004, QuickXplain].

    All of them together are enough; those in front are dropped rather than those behind.
    """

    def search(fixed: tuple[L, ...], open_: tuple[L, ...], changed: bool) -> tuple[L, ...]:
        if changed and enough(fixed):
            return ()
        if len(open_) <= 1:
            return open_
        middle = len(open_) // 2
        front, back = open_[:middle], open_[middle:]
        needed_front = search((*fixed, *back), front, True)
        needed_back = search((*fixed, *needed_front), back, bool(needed_front))
        return (*needed_front, *needed_back)

    return search((), leaves, True)


def satisfiable(session: Session, question: str, deadline: Deadline) -> bool:
    """The verdict of a session as a truth value.

    Raises:
        OutOfTimeError: if the solver does not decide before the deadline.
    """
    verdict = session.check(question, deadline)
    if verdict is Verdict.UNKNOWN:
        raise OutOfTimeError
    return verdict is Verdict.SATISFIABLE


def model_of(session: Session, reader: Reader, names: Iterable[str]) -> Model:
    """The values of the named symbols in the last model."""
    return session.values(reader.symbols(names))


@dataclass(frozen=True)
class QueryImplicant:
    """Leaves that are true in a model of a query and imply, within its network, that the query is satisfiable.

    `chosen` implies all but the definitions; `support` implies those of the symbols `defined`, which are all that these
    leaves mention. Other definitions have a value anyway and need not be looked at.
    """

    chosen: tuple[Leaf, ...]
    support: tuple[Leaf, ...]
    defined: frozenset[str]

    @staticmethod
    def at(query: Query, model: Model) -> QueryImplicant:
        definition = {definition.symbol: definition.formula for definition in query.definitions}
        chosen: dict[Leaf, None] = {}
        support: dict[Leaf, None] = {}
        implicant(query.core, model, chosen)
        pending = _mentioned(chosen) & definition.keys()
        done: set[str] = set()
        while pending:
            symbol = min(pending)
            done.add(symbol)
            implicant(definition[symbol], model, support)
            pending = (_mentioned({**chosen, **support}) & definition.keys()) - done
        return QueryImplicant(tuple(chosen), tuple(support), frozenset(done))


def _mentioned(leaves: Mapping[Leaf, None]) -> set[str]:
    return {
        name for leaf in leaves for name in (leaf.parameters if isinstance(leaf, LinearConstraint) else (leaf.name,))
    }


def polyhedra_of(
    formula: Nnf,
    make_session: Callable[[], Session],
    reader: Reader,
    deadline: Deadline,
    known: Iterable[Conjunction] = (),
) -> Iterator[Conjunction]:
    """Conjunctions, over the formula's own real symbols, whose union is the formula; points of `known` may be skipped.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    asked, complement = make_session(), Outlook(make_session(), reader, deadline)
    asked.add(reader.write(formula))
    complement.add(negation(formula))
    for piece in known:
        asked.add(reader.outside(piece))
        complement.exclude(piece)
    names = names_in(formula)
    while satisfiable(asked, "another polyhedron", deadline):
        chosen: dict[LinearConstraint | Literal, None] = {}
        implicant(formula, model_of(asked, reader, names), chosen)
        leaves = trim(leaf for leaf in chosen if isinstance(leaf, LinearConstraint))
        piece = irredundant(complement.generalize(leaves)) or ()
        yield piece
        asked.add(reader.outside(piece))
        complement.exclude(piece)


Side = tuple[Fraction, bool]
"""An upper bound of a linear form, and whether it is strict."""

Task = Generator["Task", Nnf, Nnf]
"""A computation of a formula that yields the tasks whose results it needs; see :func:`perform`."""


def perform(task: Task, deadline: Deadline) -> Nnf:
    """The result of a task: recursion that the interpreter's stack does not limit [Ganz, Friedman and Wand 1999].

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    stack = [task]
    result: Nnf | None = None
    while stack:
        deadline.enforce()
        try:
            needed = next(stack[-1]) if result is None else stack[-1].send(result)
        except StopIteration as stop:
            stack.pop()
            result = stop.value
        else:
            stack.append(needed)
            result = None
    if result is None:
        raise AssertionError("a task ended without a result")
    return result


class Facts:
    """Upper bounds of linear forms and values of Booleans that hold where a subformula is looked at.

    What has been learnt since a mark can be taken back.
    """

    def __init__(self, leaves: Iterable[Leaf] = ()) -> None:
        self._bounds: dict[Coefficients, Side] = {}
        self._booleans: dict[str, bool] = {}
        self._before: list[tuple[Coefficients | str, Side | bool | None]] = []
        for leaf in leaves:
            self.learn(leaf)

    @property
    def mark(self) -> int:
        return len(self._before)

    def learn(self, leaf: Leaf) -> None:
        if isinstance(leaf, Literal):
            self._before.append((leaf.name, self._booleans.get(leaf.name)))
            self._booleans[leaf.name] = leaf.value
            return
        for half in leaf.halves():
            known = self._bounds.get(half.coefficients)
            if known is None or (half.constant, not half.is_strict) < (known[0], not known[1]):
                self._before.append((half.coefficients, known))
                self._bounds[half.coefficients] = (half.constant, half.is_strict)

    def forget(self, mark: int) -> None:
        """Take back what has been learnt since the mark."""
        while len(self._before) > mark:
            key, before = self._before.pop()
            if isinstance(key, str):
                del self._booleans[key]
                if isinstance(before, bool):
                    self._booleans[key] = before
            else:
                del self._bounds[key]
                if isinstance(before, tuple):
                    self._bounds[key] = before

    def apply(self, leaf: Leaf) -> Nnf:
        """The leaf, or its truth where the facts decide it."""
        if isinstance(leaf, Literal):
            known = self._booleans.get(leaf.name)
            return leaf if known is None else (TRUE if known is leaf.value else FALSE)
        if not self._bounds:
            return leaf
        halves = [self._half(half) for half in leaf.halves()]
        if any(half is FALSE for half in halves):
            return FALSE
        if all(half is TRUE for half in halves):
            return TRUE
        return leaf

    def _half(self, half: LinearConstraint) -> Nnf:
        above = self._bounds.get(half.coefficients)
        # Lexicographically: a smaller bound is tighter, and of equal ones a strict one is.
        if above is not None and (above[0], not above[1]) <= (half.constant, not half.is_strict):
            return TRUE
        below = self._bounds.get(tuple((name, -factor) for name, factor in half.coefficients))
        if below is not None:
            # form ≥ −bound contradicts form ≤ constant
            floor = -below[0]
            if floor > half.constant or (floor == half.constant and (below[1] or half.is_strict)):
                return FALSE
        return half


def simplified(root: Nnf, assumed: Iterable[Leaf] = (), deadline: Deadline | None = None) -> Nnf:
    """A formula that is equivalent wherever what is assumed holds, simplified by what surrounds each of its parts.

    In a conjunction the other operands may assume a constraint, in a disjunction they may assume its negation [Dolzmann
    and Sturm 1997, "Simplification of quantifier-free formulae over ordered fields"].

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    return perform(_simplify(root, Facts(assumed)), deadline or Deadline.after(None))


def _simplify(node: Nnf, facts: Facts) -> Task:
    if not isinstance(node, Junction):
        return facts.apply(node)
    conjunctive, mark = node.conjunctive, facts.mark
    absorbing = FALSE if conjunctive else TRUE
    while isinstance(node, Junction) and node.conjunctive is conjunctive:
        nested = [operand for operand in node.operands if isinstance(operand, Junction)]
        leaves = [operand for operand in node.operands if not isinstance(operand, Junction)]
        # Equalities say most in a conjunction, and nothing that can be used in a disjunction.
        leaves.sort(key=lambda leaf: _is_equality(leaf) is not conjunctive)
        parts: list[Nnf] = []
        for leaf in leaves:
            parts.append(facts.apply(leaf))
            _assume(parts[-1], conjunctive, facts)
        found = 0
        for operand in nested:
            if absorbing in parts:
                break
            parts.append((yield _simplify(operand, facts)))
            found += _assume(parts[-1], conjunctive, facts)
        facts.forget(mark)
        node = conjunction(parts) if conjunctive else disjunction(parts)
        # Constraints that came to light may say something of the operands before them.
        if not found or len(nested) == 1:
            break
    return node


def _is_equality(leaf: Leaf) -> bool:
    return isinstance(leaf, LinearConstraint) and leaf.is_equality


def _assume(node: Nnf, conjunctive: bool, facts: Facts) -> int:
    """Learn what other operands may assume of one that is a leaf or consists of leaves; how many leaves there were.

    That is the leaf itself in a conjunction; in a disjunction its negation, if that is one leaf.
    """
    if isinstance(node, Junction):
        leaves = [o for o in node.operands if not isinstance(o, Junction)] if node.conjunctive is conjunctive else []
    else:
        leaves = [node]
    for leaf in leaves:
        if conjunctive:
            facts.learn(leaf)
        elif isinstance(leaf, Literal):
            facts.learn(Literal(leaf.name, not leaf.value))
        elif not leaf.is_equality:
            facts.learn(leaf.negation()[0])
    return len(leaves)


CROWDED = 40
"""With more constraints than this on eliminated variables, projection is at the model only."""


class Project(Eliminator):
    """Lazy enumeration; see the module."""

    name = "project"

    def eliminate(self, query: Query, known: Iterable[Conjunction], deadline: Deadline) -> Iterator[Conjunction]:
        search = _Search(self.context, query, deadline)
        for piece in known:
            search.exclude(piece)
        while (found := search.next_piece()) is not None:
            yield found
            search.exclude(found)


class _Search:
    """The sessions of one query: where pieces come from, what they must not lose, and what is known already."""

    def __init__(self, context: Context, query: Query, deadline: Deadline) -> None:
        self._context = context
        self._reader = context.reader
        self._query = query
        self._deadline = deadline
        self._definition = {definition.symbol: definition.formula for definition in query.definitions}
        self._names = names_in(query.formula)
        self._asked = context.session()
        self._asked.add_all([self._reader.write(query.formula)], deadline)
        self._projects = bool(query.network or self._names - set(query.kept) - self._definition.keys())
        self._excluded: list[Conjunction] = []

    def exclude(self, piece: Conjunction) -> None:
        self._asked.add(self._reader.outside(piece))
        self._excluded.append(piece)
        for outlook in ("_needs", "_known"):
            if outlook in self.__dict__:
                self.__dict__[outlook].exclude(piece)

    @cached_property
    def _needs(self) -> Outlook:
        """Where a conjunction stays inside the query or what is excluded; opened once there is something to find."""
        made = self._known_only()
        made.add(*self._query.network, *self._definition.values(), negation(self._query.core))
        return made

    @cached_property
    def _known(self) -> Outlook:
        """Where a conjunction stays inside what is excluded."""
        return self._known_only()

    def _known_only(self) -> Outlook:
        made = Outlook(self._context.session(), self._reader, self._deadline)
        for piece in self._excluded:
            made.exclude(piece)
        return made

    def next_piece(self) -> Conjunction | None:
        """A polyhedron of kept symbols that the query covers and that is not covered yet; None if there is none.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        if not satisfiable(self._asked, self._query.name, self._deadline):
            return None
        model = model_of(self._asked, self._reader, self._names)
        leaves = self._needs.generalize(self._implicant(model))
        constraints = tuple(leaf for leaf in leaves if isinstance(leaf, LinearConstraint))
        if not self._projects:
            return constraints
        piece = self._projection(trim((*constraints, *self._query.network)), model)
        return minimal(piece, lambda part: self._known.excludes(part, outside(piece)))

    def _implicant(self, model: Model) -> tuple[Leaf, ...]:
        """Leaves without defined symbols that imply the query, within its network."""
        found = QueryImplicant.at(self._query, model)
        # What the violation itself says comes last, where fewer constraints are dropped.
        leaves = (*found.support, *found.chosen)
        constraints = (leaf for leaf in leaves if isinstance(leaf, LinearConstraint))
        literals = (leaf for leaf in leaves if isinstance(leaf, Literal))
        return (*dict.fromkeys(literals), *solve_equalities(constraints, found.defined))

    def _projection(self, constraints: Conjunction, model: Model) -> Conjunction:
        eliminated = set(variables_of(constraints)) - set(self._query.kept)
        if sum(1 for c in constraints if not eliminated.isdisjoint(c.parameters)) > CROWDED:
            point = {name: Fraction(model.get(name, 0)) for name in variables_of(constraints)}
            return project_at(constraints, eliminated, point)
        return project(constraints, eliminated, self._deadline) or ()


class FourierMotzkin(Eliminator):
    """Implicants, projected one at a time."""

    name = "fourier-motzkin"

    def eliminate(self, query: Query, known: Iterable[Conjunction], deadline: Deadline) -> Iterator[Conjunction]:
        context, formula = self.context, query.formula
        session = context.session()
        session.add_all([context.reader.write(without(formula, known))], deadline)
        names, eliminated = names_in(formula), query.eliminated
        while satisfiable(session, query.name, deadline):
            found = QueryImplicant.at(query, model_of(session, context.reader, names))
            leaves = (*query.network, *found.chosen, *found.support)
            constraints = trim(leaf for leaf in leaves if isinstance(leaf, LinearConstraint))
            piece = project(constraints, eliminated, deadline)
            if piece is None:
                raise AssertionError(f"{query.name}: an implicant with a model has an empty projection")
            yield piece
            session.add(context.reader.outside(piece))
