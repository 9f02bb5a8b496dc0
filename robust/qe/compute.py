"""The elimination problems whose union is the complement of the robustness envelope.

`exists` says which parameter values leave a schedule; `violations` say, among those, which ones let some schedule break
an obligation. How they are grouped is the splitting:

- monolithic: the complement is one formula with both quantifiers;
- partial: existence is one problem, all obligations together are another;
- full: every obligation is a problem of its own, parameter-only ones first.

The search for the envelope stops at the first obligation that excludes a value. :func:`what_breaks` enumerates every
one by itself, so that several can be named at one point. Where the network has no schedule, or a demand on durations
over parameters alone does not hold, nothing is said of other obligations: nothing else is to be examined there.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from fractions import Fraction
from functools import cached_property, partial
from graphlib import CycleError, TopologicalSorter
from itertools import islice
from types import MappingProxyType

from robust.encode import create_encoding
from robust.encode.encoding import RelationalEncoding
from robust.encode.interface import EPSILON, Encoding, Facet, Grid, Obligation, Range, Stage
from robust.encode.validity import Validity
from robust.plan.model import ParametrizedPlan, Relation
from robust.presented import Presented
from robust.qe import estimate, inner
from robust.qe.box import Box
from robust.qe.conjunctions import Conjunction, half_space, project_at
from robust.qe.constraint import LinearConstraint, substitute_equality
from robust.qe.eliminate import create_eliminator
from robust.qe.eliminate.enumerate import polyhedra_of, satisfiable
from robust.qe.eliminate.interface import Definition, Query, Solvers, outside
from robust.qe.inner import EnvelopeFactor, FactorSearch
from robust.qe.lifted import SHORT, LiftedRegion, lifted_envelope
from robust.qe.nnf import FALSE, TRUE, FormulaReader, Junction, Nnf, conjunction, disjunction, names_in, negation
from robust.qe.polyhedron import Point, Polyhedron
from robust.qe.region import Region, absorb
from robust.qe.symmetry import Symmetry, find_symmetry
from robust.searching import Searching, Status
from robust.smt.limits import Deadline, DiedError, OutOfTimeError
from robust.smt.session import Satisfiability, Session, Statistics


class ProblemBuilder:
    """Builds queries from an encoding.

    Args:
        encoding: the plan's formulas.
        context: the solvers, which examine definitions.
    """

    def __init__(self, encoding: Encoding, context: Solvers) -> None:
        self._encoding = encoding
        self._context = context
        self._reader = context.reader
        self._session = context.session()
        self._kept = tuple(parameter.name for parameter in encoding.plan.parameters)
        self._unknowns = {symbol.symbol_name() for symbol in encoding.unknowns()} | set(self._kept)
        self._defined: dict[Nnf, Mapping[str, bool]] = {}

    def violations(self, splitting: str) -> tuple[Query, ...]:
        """The queries of a splitting, quickest first; just one unless it is full."""
        queries = [
            self.query(obligation) for obligation in self._encoding.obligations if obligation.violation is not None
        ]
        if splitting != "full":
            return (merged("all obligations", self._kept, queries),)
        return tuple(sorted(queries, key=lambda query: len(query.eliminated)))

    def existence(self) -> Query:
        """∃ times. enc_tn."""
        network = conjunction(map(self._reader.read, self._encoding.network_formulas()))
        constraints, rest = _inequalities([network])
        return Query("some schedule exists", self._kept, constraints, TRUE, (), rest)

    def without_schedule(self, deadline: Deadline) -> Iterator[Conjunction]:
        """Half-spaces of bad values that together hold every value that leaves no schedule, within the bounds.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        return _UnschedulableValues(self._encoding, self._context, self.existence()).pieces(deadline)

    def query(self, obligation: Obligation, *, whole: bool = False) -> Query:
        """∃ times, auxiliaries. enc_tn ∧ enc_eff ∧ ¬P; with the whole of enc_tn, also where enc_valid does not hold."""
        network: list[Nnf] = []
        others: list[Nnf] = []
        for formula in self._encoding.full_query(obligation) if whole else self._encoding.query(obligation):
            if formula is not obligation.violation:
                node = self._reader.read(formula)
                (network if names_in(node) <= self._unknowns else others).append(node)
        constraints, rest = _inequalities(network)
        definitions, undefined = self._definitions(others)
        violation = self._reader.read(obligation.violation)
        return Query(obligation.name, self._kept, constraints, violation, definitions, conjunction((rest, *undefined)))

    def _definitions(self, formulas: Iterable[Nnf]) -> tuple[tuple[Definition, ...], list[Nnf]]:
        """Tell apart definitions of single symbols that can always be satisfied, without circles, and the rest."""
        open_ = {formula: [n for n, total in self._candidates(formula).items() if total] for formula in formulas}
        chosen: dict[str, Nnf] = {}
        while unique := [(formula, names[0]) for formula, names in open_.items() if len(names) == 1]:
            for formula, name in unique:
                if name not in chosen:
                    chosen[name] = formula
                del open_[formula]
            open_ = {formula: [n for n in names if n not in chosen] for formula, names in open_.items()}
        definitions = _in_order([Definition(name, formula) for name, formula in chosen.items()]) or ()
        taken = {definition.formula for definition in definitions}
        return definitions, [formula for formula in formulas if formula not in taken]

    def _candidates(self, formula: Nnf) -> Mapping[str, bool]:
        """Symbols that the formula may define, and whether it does so whatever the other symbols are."""
        if formula not in self._defined:
            names = sorted(names_in(formula) - self._unknowns)
            cases = {name: _cases(formula, name) for name in names}
            self._defined[formula] = {
                name: self._is_total(name, case) for name, case in cases.items() if case is not None
            }
        return self._defined[formula]

    def _is_total(self, name: str, cases: list[tuple[Nnf, LinearConstraint]]) -> bool:
        """Whether cases that apply together agree."""
        clashes = []
        for index, (condition, value) in enumerate(cases):
            for other_condition, other_value in cases[:index]:
                equal = substitute_equality(value, other_value, name)
                clashes.append(conjunction((condition, other_condition, negation(equal))))
        clash = disjunction(clashes)
        if clash is FALSE:
            return True
        with self._session.frame(self._reader.write(clash)):
            return self._session.check(f"definition of {name}") is Satisfiability.UNSATISFIABLE


def declared_bounds(plan: ParametrizedPlan) -> Conjunction:
    """The declared parameter bounds."""
    return tuple(Box.declared(plan.parameters).constraints())


def beyond_bounds(plan: ParametrizedPlan) -> list[Conjunction]:
    """Half-spaces that together hold all that is outside of the declared parameter bounds."""
    return [(half,) for bound in declared_bounds(plan) for half in bound.negation()]


def merged(name: str, kept: tuple[str, ...], queries: Iterable[Query]) -> Query:
    """The disjunction of several queries; definitions stay apart, because they can always be satisfied."""
    queries = list(queries)
    violation = disjunction(conjunction((*q.network, q.violation, q.remainder)) for q in queries)
    definitions = {d.formula: d for query in queries for d in query.definitions}
    ordered = _in_order(list(definitions.values()))
    if ordered is None:
        return Query(name, kept, (), disjunction(query.formula for query in queries))
    return Query(name, kept, (), violation, ordered)


def _in_order(definitions: Sequence[Definition]) -> tuple[Definition, ...] | None:
    """Each definition after those that it depends on; None if there is a circle, or a symbol has two."""
    by_symbol = {definition.symbol: definition for definition in definitions}
    depends = {
        symbol: names_in(definition.formula) & by_symbol.keys() - {symbol} for symbol, definition in by_symbol.items()
    }
    try:
        order = [by_symbol[symbol] for symbol in TopologicalSorter(depends).static_order()]
    except CycleError:
        return None
    return tuple(order) if len(order) == len(definitions) else None


def _inequalities(formulas: Iterable[Nnf]) -> tuple[Conjunction, Nnf]:
    """The constraints of a conjunction, and what is not one."""
    whole = conjunction(formulas)
    parts = whole.operands if isinstance(whole, Junction) and whole.conjunctive else (whole,)
    constraints = tuple(part for part in parts if isinstance(part, LinearConstraint))
    return constraints, conjunction(part for part in parts if not isinstance(part, LinearConstraint))


def _cases(formula: Nnf, name: str) -> list[tuple[Nnf, LinearConstraint]] | None:
    """The formula as a conjunction of implications `condition → name = value`, name nowhere else; None if it is not."""
    parts = formula.operands if isinstance(formula, Junction) and formula.conjunctive else (formula,)
    cases = []
    for part in parts:
        operands = part.operands if isinstance(part, Junction) else (part,)
        values = [o for o in operands if isinstance(o, LinearConstraint) and o.is_equality and name in o.parameters]
        rest = [operand for operand in operands if operand not in values]
        if len(values) != 1 or any(name in names_in(operand) for operand in rest):
            return None
        cases.append((negation(disjunction(rest)), values[0]))
    return cases


@dataclass(eq=False)
class _UnschedulableValues:
    """Finds what lies outside enc_valid, but within the declared bounds.

    Args:
        encoding: the plan's formulas; its `validity` may report facets that are duration obligations as well.
        context: the solvers.
        query: ∃ times. enc_tn.
    """

    encoding: Encoding
    context: Solvers
    query: Query

    def __post_init__(self) -> None:
        self._rest = Polyhedron(self.query.kept, declared_bounds(self.encoding.plan))

    def pieces(self, deadline: Deadline) -> Iterator[Conjunction]:
        while not self._rest.is_empty:
            deadline.enforce()
            extents = self._rest.bounding_box() or {}
            facet = self._facet({name: (extent.lower, extent.upper) for name, extent in extents.items()}, deadline)
            if facet is None:
                return
            inside = LinearConstraint.from_polynomial(facet.expression, Relation.AT_LEAST)
            if self._rest.satisfies(inside):
                yield from self._by_points(deadline)
                return
            yield self._beyond(inside)

    def _beyond(self, inside: LinearConstraint) -> Conjunction:
        """What a half-space excludes, which need not be looked at again."""
        self._rest = self._rest.restricted([inside])
        return tuple(inside.negation()) if not inside.is_false else ()

    def _facet(self, ranges: Mapping[str, Range], deadline: Deadline) -> Facet | None:
        facet = self.encoding.validity.broken_facet(Grid(ranges), self.context.session, deadline)
        if isinstance(facet, Satisfiability):
            raise OutOfTimeError(self.context.statistics.failure)
        return facet

    def _by_points(self, deadline: Deadline) -> Iterator[Conjunction]:
        reader = self.context.reader
        session = self.context.session()
        network = self.context.session()
        network.add(reader.write(self.query.formula))
        session.add(*map(reader.write, self._rest.constraints))
        while satisfiable(session, "enc_valid: a point that is left", deadline):
            values = session.values(reader.symbols(self.query.kept))
            point = {name: Fraction(values.get(name, 0)) for name in self.query.kept}
            facet = self._facet({name: (value, value) for name, value in point.items()}, deadline)
            if facet is not None:
                inside = LinearConstraint.from_polynomial(facet.expression, Relation.AT_LEAST)
                session.add(reader.write(inside))
                yield self._beyond(inside)
            else:
                session.add(reader.outside(self._around(point, network, deadline)))

    def _around(self, point: Mapping[str, Fraction], network: Session, deadline: Deadline) -> Conjunction:
        """Parameter values that leave a schedule, the point's among them."""
        reader = self.context.reader
        fixed = (LinearConstraint.of({name: 1}, "=", value) for name, value in point.items())
        with network.frame(*(reader.write(constraint) for constraint in fixed)):
            if not satisfiable(network, "enc_tn at a point", deadline):
                raise AssertionError("the network has no schedule at a point where no facet breaks")
            values = network.values(reader.symbols(self.query.eliminated))
        model = {**point, **{name: Fraction(values.get(name, 0)) for name in self.query.eliminated}}
        return project_at(self.query.network, self.query.eliminated, model)


FEW = 6
"""Parameters up to which envelopes are enumerated whatever they are."""

RegionStatus = Status
"""How an enumeration ended: the region is the envelope if COMPLETE, and an outer bound of it otherwise."""


@dataclass(frozen=True)
class RegionResult(Presented, ask="status"):
    """The robustness envelope [IRR, Definition 2] and how it was computed; seconds are by the clock.

    `region` is the envelope itself where `status` is COMPLETE; otherwise every point of the envelope is in it, but not
    every point of it is in the envelope. `pieces` counts the polyhedra of bad values that were found. `reason` says
    which failure of a solver ended an enumeration that is UNKNOWN.

    `factors` say the same of independent groups of parameters, one by one, and have inner bounds beside the outer ones;
    back ends other than `project`, which find no inner bounds, leave them out. `open_share` is how much lies between
    the two; None where it is not known, or the envelope is exact. `plan` is what it is about, for nominal values.

    With more than a few parameters, where one order is left, `lifted` is the envelope as difference constraints between
    times; `region` is the same object if there are too many inequalities without times. An enumeration that was cut
    short has no factors at first: `box` was proved by then to be inside the envelope, if any was looked for. It was
    `sliced` if rates multiply times that vary; if it is UNKNOWN then, `reason` says so.
    """

    status: Status
    region: Region
    backend: str
    splitting: str
    learning: bool
    encoding: str
    solver: str
    seconds: float
    pieces: int
    statistics: Statistics = field(default_factory=Statistics)
    factors: tuple[EnvelopeFactor, ...] = ()
    open_share: estimate.OpenShare | None = None
    reason: str | None = None
    epsilon: Fraction = EPSILON
    plan: ParametrizedPlan | None = field(default=None, repr=False, compare=False)
    lifted: LiftedRegion | None = field(default=None, repr=False)
    box: Box | None = None
    sliced: bool = False

    @property
    def is_exact(self) -> bool:
        """Whether the region is the envelope itself, and not a bound of it."""
        return self.status is Status.COMPLETE

    @property
    def cut_short(self) -> bool:
        """Whether something ended the enumeration before it was done."""
        return not self.is_exact

    def inner(self, at: Point = MappingProxyType({})) -> Region:
        """An inner bound, with some parameters fixed: the envelope, or as much of what is proved as is not too long."""
        if self.is_exact:
            return self.region.slice(at)
        proved = inner.inner_region(self.region.parameters, self.factors, at)
        if self.box is None:
            return proved
        boxed = Polyhedron.of_box(self.region.parameters, self.box).slice(at)
        return Region.union_of(proved.parameters, absorb([boxed, *proved.pieces]))

    def is_proved(self, point: Point) -> bool:
        """Whether a point is known to be in the envelope."""
        if self.is_exact:
            return point in self.region
        if self.box is not None and self.box.includes(point):
            return True
        return bool(self.factors) and all(factor.is_proved(point) for factor in self.factors)

    @property
    def meaning(self) -> str:
        """What the region is, in a sentence."""
        if self.is_exact:
            return "the robustness envelope"
        ended = f"{_ENDED[self.status]} the enumeration of bad parameter values"
        if self.sliced and self.status is Status.UNKNOWN:
            ended = f"{self.reason}"
        return f"an outer bound of the robustness envelope: {ended}"


_ENDED = {
    Status.TIMEOUT: "the time limit ended",
    Status.INTERRUPTED: "an interruption ended",
    Status.UNKNOWN: "a solver failed in",
}


@dataclass(eq=False)
class RegionSearch(Searching[RegionResult]):
    """All parameter values under which a plan is valid, exactly.

    Args:
        plan: the plan, see :func:`robust.load_plan`.
        backend: one of :data:`robust.backends.ELIMINATORS`.
        splitting: `monolithic`, `partial` or `full`, see :mod:`robust.qe.compute`.
        learning: tell later problems what earlier ones have excluded.
        epsilon: the separation of mutex time points.
        solver: `z3` or `cvc5`, for the queries of our own back ends.
        encoding: `relational` or `positions`.
        timeout: seconds after which what has been found is returned with status TIMEOUT; None never.
        on_piece: called with each polyhedron of bad parameter values when it is found; where parameters are
            interchangeable, what it holds may be bad only if they ascend.
        on_cell: called with each polyhedron of good parameter values, likewise.
        lift: keep what has too many inequalities as difference constraints.
        find_box: finds a box inside the envelope by a deadline, which is known if a long enumeration is cut short.
    """

    plan: ParametrizedPlan
    _: KW_ONLY
    backend: str = "project"
    splitting: str = "full"
    learning: bool = True
    epsilon: Fraction = EPSILON
    solver: str = "z3"
    encoding: str = "relational"
    timeout: float | None = None
    on_piece: Callable[[Polyhedron], None] | None = None
    on_cell: Callable[[Polyhedron], None] | None = None
    lift: bool = True
    find_box: Callable[[Deadline], Box | None] | None = None

    def __post_init__(self) -> None:
        super().__init__()
        self._deadline = Deadline.after(self.timeout)
        self._statistics = Statistics()
        self._parameters = tuple(parameter.name for parameter in self.plan.parameters)
        self._bounds = declared_bounds(self.plan)
        self._pieces: list[Conjunction] = []
        """What is bad by itself; the rest is known to the groups."""
        self._factors: list[FactorSearch] = []
        self._count = 0
        self._share: estimate.OpenShare | None = None
        self._region: Region | None = None
        self._lifted: LiftedRegion | None = None
        self._box: Box | None = None

    def run(self) -> RegionResult:
        """The envelope, or, out of time, after Ctrl-C or where a solver failed, an outer bound of it.

        Raises:
            UnsupportedError: an expression that is not linear, or one that the back end cannot handle.
            SolverError: a solver is not installed.
        """
        status, reason = self._ending()
        if self._lifted is not None:
            return self._result(status, reason)
        # Half-spaces become sides of the polyhedron to subtract from.
        sides = [half.negation()[0] for piece in self._bad if (half := half_space(piece)) is not None]
        base = Polyhedron(self._parameters, (*self._bounds, *sides)).simplified()
        self._region = self._without(base, (piece for piece in self._bad if half_space(piece) is None))
        if status is not Status.COMPLETE:
            self._share = self.open_share
            try:
                self._share = inner.open_share(self._factors)
            except KeyboardInterrupt:
                status = Status.INTERRUPTED
        return self._result(status, reason)

    @property
    def open_share(self) -> estimate.OpenShare | None:
        """The share of open points, if random points have been drawn already."""
        return self._share or inner.open_share(self._factors, draw=False)

    @property
    def _bad(self) -> list[Conjunction]:
        """The bad set so far."""
        return [*self._pieces, *(piece for factor in self._factors for piece in factor.lifted)]

    def _without(self, base: Polyhedron, pieces: Iterable[Conjunction]) -> Region:
        return Region.difference(base, (Polyhedron(self._parameters, piece) for piece in pieces))

    def _result(self, status: Status, reason: str | None = None) -> RegionResult:
        region = self._region or self._without(Polyhedron(self._parameters, self._bounds), self._bad)
        factors = tuple(factor.factor() for factor in self._factors)
        share = None if status is Status.COMPLETE else self.open_share
        asked = self.backend, self.splitting, self.learning, self.encoding, self.solver
        statistics = self._statistics
        known = RegionResult(status, region, *asked, self._seconds(), self._count, statistics, factors, share, reason)
        return replace(known, epsilon=self.epsilon, plan=self.plan, lifted=self._lifted, box=self._box)

    def _ending(self) -> tuple[Status, str | None]:
        try:
            return super()._ending()
        except DiedError as died:
            return Status.UNKNOWN, died.message

    @property
    def _by_groups(self) -> bool:
        """Whether the search is our own, and as the default has it."""
        return self.backend == "project" and self.splitting == "full" and self.learning

    def _search(self) -> None:
        encoding = create_encoding(self.encoding, self.plan, self.epsilon, self._deadline)
        context = Solvers(encoding.terms, FormulaReader(encoding.terms), self.solver, self._statistics)
        if self.lift and len(self._parameters) > FEW and self._by_groups and isinstance(encoding, RelationalEncoding):
            lifted = lifted_envelope(encoding, context.reader, self._deadline)
            if lifted is not None:
                self._region, self._lifted = lifted.explicit(SHORT), lifted
                return
            if self.find_box is not None:
                self._box = self.find_box(self._deadline)
        eliminator = create_eliminator(self.backend, context)
        builder = ProblemBuilder(encoding, context)
        violations = builder.violations(self.splitting)
        if self.splitting == "monolithic" and eliminator.alternation:
            self._add(eliminator.eliminate_nested(violations[0], builder.existence(), self._deadline))
            return
        if self.backend == "project":
            existence = builder.without_schedule(self._deadline)
        else:
            # What none of the pieces that leave a schedule covers, within the declared bounds.
            rest = conjunction(map(outside, eliminator.eliminate(builder.existence(), (), self._deadline)))
            existence = polyhedra_of(rest, context, self._deadline, beyond_bounds(self.plan))
        if self.splitting == "monolithic":
            # Only one quantifier at a time: the inner one goes first, and its result becomes part of the outer formula.
            (query,) = violations
            beyond = disjunction(conjunction(piece) for piece in existence)
            whole = disjunction((beyond, conjunction((query.violation, query.remainder))))
            violations = (replace(query, name="the whole envelope", violation=whole, remainder=TRUE),)
        else:
            self._add(existence)
        if self._by_groups:
            self._search_factors(context, violations)
            return
        for query in violations:
            self._add(eliminator.eliminate(query, self._known(), self._deadline))

    def _search_factors(self, context: Solvers, violations: Sequence[Query]) -> None:
        """Group by group, up to symmetry; again without where that leaves too much to describe."""
        facets = list(self._pieces)
        symmetry = find_symmetry(self.plan, self._deadline)
        sides = [side for facet in facets for constraint in facet for side in constraint.negation()]
        if () in facets:
            sides.append(LinearConstraint.false())
        base = Polyhedron(self._parameters, (*self._bounds, *sides))
        groups = [
            inner.ParameterGroup(
                names, queries, base.project(names), tuple(self._known()), self.plan.nominal, symmetry.within(names)
            )
            for names, queries in inner.independent_groups(self._parameters, violations, facets)
        ]
        search = partial(FactorSearch, context, deadline=self._deadline, on_piece=self._tell, on_cell=self.on_cell)
        self._factors = [search(group) for group in groups]
        pending = list(range(len(groups)))
        while pending:
            for index in [*pending]:
                factor = self._factors[index]
                factor.run()
                if factor.done and factor.lift():
                    pending.remove(index)
                elif factor.done:
                    self._factors[index] = search(replace(groups[index], symmetry=Symmetry()))

    def _known(self) -> list[Conjunction]:
        """What a problem need not describe again."""
        return [*beyond_bounds(self.plan), *self._pieces] if self.learning else []

    def _add(self, pieces: Iterable[Conjunction]) -> None:
        for piece in pieces:
            self._pieces.append(piece)
            self._tell(Polyhedron(self._parameters, piece))

    def _tell(self, piece: Polyhedron) -> None:
        self._count += 1
        if self.on_piece is not None:
            self.on_piece(piece)


MOST = 1000
"""Polyhedra of all obligations together, after which the enumeration ends."""


@dataclass(frozen=True, slots=True)
class BrokenObligation:
    """Within the declared bounds, at every value in a piece that leaves a schedule, some schedule breaks `obligation`.

    A `demand` is one on durations over parameters alone; of other obligations pieces say nothing where one breaks.
    """

    obligation: str
    pieces: tuple[Polyhedron, ...]
    demand: bool


@dataclass(frozen=True, slots=True)
class Breaks:
    """What breaks where, in the order in which obligations are examined; all of it, if `complete`."""

    obligations: tuple[BrokenObligation, ...]
    complete: bool


def what_breaks(
    plan: ParametrizedPlan, *, epsilon: Fraction = EPSILON, solver: str = "z3", timeout: float | None = None
) -> Breaks:
    """Enumerate, obligation by obligation; out of time, or beyond :data:`MOST`, what was found by then.

    Raises:
        UnsupportedError: an expression that is not linear.
    """
    broken: list[BrokenObligation] = []
    try:
        for obligation in _enumerated(plan, epsilon, solver, Deadline.after(timeout)):
            broken.append(obligation)
            if sum(len(obligation.pieces) for obligation in broken) > MOST:
                return Breaks(tuple(broken), complete=False)
    except OutOfTimeError:
        return Breaks(tuple(broken), complete=False)
    return Breaks(tuple(broken), complete=True)


def _enumerated(
    plan: ParametrizedPlan, epsilon: Fraction, solver: str, deadline: Deadline
) -> Iterator[BrokenObligation]:
    """Each obligation that can break, when all about it is known."""
    piece_of = partial(Polyhedron, tuple(parameter.name for parameter in plan.parameters))
    causes = Causes(plan, epsilon, solver, deadline)
    demands = causes.demands()
    yield from (BrokenObligation(name, tuple(map(piece_of, halves)), demand=True) for name, halves in demands.items())
    known: list[Conjunction] = [*causes.outside, *causes.without_schedule()]
    for obligation in causes.obligations:
        if obligation.name not in demands:
            pieces = tuple(map(piece_of, islice(causes.pieces(obligation, known), MOST + 1)))
            if pieces:
                yield BrokenObligation(obligation.name, pieces, demand=False)


class Causes:
    """All that can go wrong with a plan, each by itself, as the parameter values with which it does.

    Raises:
        OutOfTimeError: whatever is asked, when the deadline passes.
        UnsupportedError: an expression that is not linear.
    """

    def __init__(self, plan: ParametrizedPlan, epsilon: Fraction, solver: str, deadline: Deadline) -> None:
        self.outside = beyond_bounds(plan)
        """Outside of declared bounds."""
        self._deadline = deadline
        self._encoding = create_encoding("relational", plan, epsilon, deadline)
        self._context = Solvers(self._encoding.terms, FormulaReader(self._encoding.terms), solver)
        self._builder = ProblemBuilder(self._encoding, self._context)

    def demands(self) -> dict[str, list[Conjunction]]:
        """Demands on durations over parameters alone do not hold, by obligation."""
        validity = self._encoding.validity
        demands: dict[str, list[Conjunction]] = {}
        for facet in validity.facets if isinstance(validity, Validity) else ():
            if facet.obligation is not None:
                demands.setdefault(facet.obligation, []).extend(beyond(facet))
        return demands

    def without_schedule(self) -> Iterator[Conjunction]:
        """There is no schedule."""
        return self._builder.without_schedule(self._deadline)

    @cached_property
    def obligations(self) -> list[Obligation]:
        """The obligations that can break in some schedule."""
        return [obligation for obligation in self._encoding.obligations if obligation.violation is not None]

    @cached_property
    def _durations_may_break(self) -> bool:
        """If so, there may be schedules and yet none with all that later obligations assume."""
        return any(obligation.stage is Stage.DURATION for obligation in self.obligations)

    def pieces(self, obligation: Obligation, known: Iterable[Conjunction]) -> Iterator[Conjunction]:
        """An obligation breaks in some schedule, but for what is known already."""
        query = self._builder.query(obligation, whole=self._durations_may_break)
        return create_eliminator("project", self._context).eliminate(query, known, self._deadline)


def beyond(facet: Facet) -> Iterator[Conjunction]:
    """Half-spaces of values that a facet excludes."""
    side = LinearConstraint.from_polynomial(facet.expression, Relation.AT_LEAST)
    yield from [()] if side.is_false else [(half,) for half in side.negation()]
