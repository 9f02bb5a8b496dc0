"""The least change of a plan after which it is proved: exact, and at any time with its gap.

What may be changed become parameters of a plan of their own. In it, the changes that leave something bad, a schedule
that breaks an obligation or parameter values without a schedule, are a union of polyhedra, discovered one at a time as
in :mod:`robust.irr.widen`. What a plan is required to tolerate is projected out of each; a change is good if it breaks
one of the inequalities of each polyhedron that is left. The cheapest is found as in :mod:`robust.irr.conflicts`.

Cost is a pair: how many numbers change, and the weighted sum of the changes. By sum, the first counts only bounds that
were infinite: their distance from infinity is not defined, so as few as possible become finite.

The cheapest changes under given inequalities are found by exact linear programming. A bound that is infinite can stay
so, and then satisfies or breaks an inequality whatever the other numbers are; which of these become finite is said
beforehand. Where a strict inequality excludes the cheapest changes themselves, the ones that are found cost a little
more.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from fractions import Fraction
from operator import attrgetter

from robust import errors, searching
from robust.encode.encoding import RelationalEncoding
from robust.encode.interface import EPSILON, Facet
from robust.irr import containment, widen
from robust.irr import quantities as amounts
from robust.irr.check import Answer, Checker, CheckResult, within
from robust.irr.conflicts import Candidate, Chosen, Clause, Point, RepairSearching, RepairStatus
from robust.irr.quantities import Changeable, Cost, Quantity, QuantityChange, Unchanged, bound_name, lifted, quantities
from robust.plan.model import ParameterReference, ParametrizedPlan
from robust.plan.polynomial import Polynomial
from robust.presented import Presented
from robust.qe import nnf, simplex
from robust.qe.box import Box, Interval, Side
from robust.qe.conjunctions import Conjunction, project
from robust.qe.constraint import LinearConstraint
from robust.qe.eliminate.enumerate import projected, satisfiable
from robust.qe.polyhedron import Polyhedron
from robust.smt.limits import NEVER, Deadline, OutOfTimeError
from robust.smt.session import Formula, Satisfiability, Session

_NOTHING = Fraction(0)
_CLOSE = Fraction(1, 1_000_000)
"""How much more than the infimum is paid, as a share, where the infimum is only approached."""
_FAR = Fraction(1_000_000)
"""Where an infinite bound is looked for that became finite, as a multiple of the greatest number of the plan."""


@dataclass(frozen=True, slots=True)
class Programme:
    """The linear programme of the cheapest changes under some inequalities, of quantities that are `used`, of which
    `new` ones were infinite; `best` is its solution."""

    chosen: Chosen
    used: Sequence[str]
    new: Sequence[str]
    names: Sequence[str]
    constraints: Sequence[LinearConstraint]
    objective: Mapping[str, Fraction]
    best: simplex.Supremum

    @property
    def cost(self) -> Cost:
        """What they cost if the number of finite bounds that change does not count."""
        return Cost(len(self.new), -(self.best.value or _NOTHING))


class CheapestChanges:
    """What changes of one plan cost.

    Args:
        plan: the plan.
        quantities: what may be changed, by name.
        counts: whether every change counts, or only bounds that were infinite.
    """

    def __init__(self, plan: ParametrizedPlan, quantities: Mapping[str, Quantity], *, counts: bool) -> None:
        self._plan = plan
        self.quantities = quantities
        self._counts = counts
        numbers = [abs(quantity.old) for quantity in quantities.values() if quantity.old is not None]
        self.greatest = max([Fraction(1), *numbers, *(abs(p.nominal) for p in plan.parameters)])
        """The greatest number of the plan."""
        self._reach = _FAR * self.greatest

    def holds(
        self, choice: LinearConstraint, values: Mapping[str, Fraction], names: Iterable[str] | None = None
    ) -> bool:
        """Whether an inequality holds, where bounds that are not in `values` are what they were, perhaps infinite.

        With `names`, whether it holds because of these being infinite, or does not depend on it.
        """
        endless = [
            factor * self.quantities[name].side.sign
            for name, factor in choice.coefficients
            if name not in values and self.quantities[name].old is None and (names is None or name in names)
        ]
        if endless:
            return all(sign < 0 for sign in endless)
        return names is not None or choice.evaluate(Unchanged(self.quantities, values))

    def candidate(self, chosen: Chosen, free: Collection[str]) -> Candidate[Cost] | None:
        """The cheapest changes of `free` quantities that satisfy inequalities; None if none do."""
        programme = self.programme(chosen, free)
        return None if programme is None else self.solution(programme)

    def programme(self, chosen: Chosen, free: Collection[str]) -> Programme | None:
        """What the cheapest changes of `free` quantities that satisfy inequalities cost; None if none do."""
        constraints = []
        for choice in chosen.values():
            endless = [n for n in choice.parameters if n not in free and self.quantities[n].old is None]
            if not endless:
                old = {n: self.quantities[n].old or _NOTHING for n in choice.parameters if n not in free}
                constraints.append(choice.substitute(old))
            elif not self.holds(choice, {}, endless):
                return None
        mentioned = {name for constraint in constraints for name in constraint.parameters}
        # The other bound of a constraint may have to make room, unless it is infinite.
        partners = {other for name in mentioned if (other := self.partner(name)) is not None and other in free}
        used = sorted(mentioned | {name for name in partners if self.quantities[name].old is not None})
        constraints += self._always(used)
        if any(constraint.is_false for constraint in constraints):
            return None
        finite = [name for name in used if self.quantities[name].old is not None]
        constraints += [limit for name in finite for limit in self.price(name)]
        names = [*used, *map(cost_name, finite)]
        objective = {cost_name(name): Fraction(-1) for name in finite}
        best = simplex.maximize(names, constraints, objective)
        if best is None or best.value is None:
            return None
        return Programme(
            chosen, used, [name for name in used if name not in finite], names, constraints, objective, best
        )

    def solution(self, solved: Programme) -> Candidate[Cost]:
        """Changes that cost that, or little more."""
        best = solved.best
        point = self._point(solved)
        values = {name: point[name] for name in solved.used if point[name] != self.quantities[name].old}
        if not best.attained:
            values = self._without_idle(values, solved.constraints, point)
        count = len(values) if self._counts else solved.cost.count
        return Candidate(solved.chosen, values, Cost(count, solved.cost.total), best.attained)

    def _point(self, solved: Programme) -> Mapping[str, Fraction]:
        """A point that costs as little, or little more; bounds that were infinite are as far out as they can be."""
        names, kept, point = solved.names, solved.constraints, solved.best.point
        outwards = {name: Fraction(self.quantities[name].side.sign) for name in solved.new}
        for goal, best in ((solved.objective, solved.best), (outwards, None)):
            optimum = best or (simplex.maximize(names, kept, goal) if goal else None)
            if optimum is not None and optimum.value is not None:
                slack = _NOTHING if optimum.attained else max(abs(optimum.value), Fraction(1)) * _CLOSE
                kept = [*kept, LinearConstraint.of(goal, ">=", optimum.value - slack)]
                point = optimum.point
        # An optimum is on the boundary, which strict inequalities exclude.
        return (
            point
            if all(constraint.evaluate(point) for constraint in kept)
            else simplex.feasible_point(names, kept) or point
        )

    def _without_idle(
        self, values: Mapping[str, Fraction], constraints: Sequence[LinearConstraint], point: Mapping[str, Fraction]
    ) -> dict[str, Fraction]:
        """Changes without those that only use up what is paid above the infimum, one by one or both of a constraint."""
        kept = dict(values)
        for name in values:
            pair = {name, self.partner(name) or name}
            for idle in ({name}, pair):
                rest = {other: value for other, value in kept.items() if other not in idle}
                olds = {other: self.quantities[other].old for other in idle & point.keys()}
                at = {**point, **{other: old for other, old in olds.items() if old is not None}}
                if None not in olds.values() and all(constraint.evaluate({**at, **rest}) for constraint in constraints):
                    kept, point = rest, at
                    break
        return kept

    def partner(self, name: str) -> str | None:
        """The other bound of the same constraint, if it may be changed."""
        quantity = self.quantities[name]
        other = bound_name(quantity.constraint, Side.LOWER if quantity.side is Side.UPPER else Side.UPPER)
        return other if quantity.kind is Changeable.BOUND and other in self.quantities else None

    def _always(self, names: Collection[str]) -> Iterator[LinearConstraint]:
        """Bounds and nominal values within their limits, lower bounds not above upper ones; the others do not move."""
        for name in names:
            yield from self.limits(self.quantities[name])
        yield from dict.fromkeys(order for name in names for order in self.in_order(name, names))

    def limits(self, quantity: Quantity) -> Iterator[LinearConstraint]:
        far = self._reach if quantity.old is None else None
        lower = quantity.lower if quantity.lower is not None or far is None else -far
        upper = quantity.upper if quantity.upper is not None or far is None else far
        if lower is not None:
            yield LinearConstraint.of({quantity.name: 1}, ">=", lower)
        if upper is not None:
            yield LinearConstraint.of({quantity.name: 1}, "<=", upper)

    def in_order(self, name: str, moving: Collection[str]) -> Iterator[LinearConstraint]:
        """The lower bound is not above the upper one, if it is about a bound and both are numbers."""
        if self.quantities[name].kind is Changeable.NOMINAL:
            return
        constraint = self.quantities[name].constraint
        written = self._plan.constraints[constraint]
        form: dict[str, int] = {}
        least = _NOTHING
        for side, bound in ((Side.LOWER, written.lower), (Side.UPPER, written.upper)):
            if (bounded := bound_name(constraint, side)) in moving:
                form[bounded] = side.sign
            elif bound is None or not bound.is_constant:
                return
            else:
                least -= side.sign * bound.constant_term
        yield LinearConstraint.of(form, ">=", least)

    def price(self, name: str) -> Iterator[LinearConstraint]:
        """A change costs its amount times its weight, whichever way it goes."""
        quantity = self.quantities[name]
        old = quantity.old or _NOTHING
        for sign in (1, -1):
            slope = -sign * quantity.weight
            yield LinearConstraint.of({cost_name(name): 1, name: slope}, ">=", slope * old)


def cost_name(name: str) -> str:
    """The variable that is what a change of a quantity costs."""
    return f"cost of {name}"


@dataclass(frozen=True)
class Repair(Presented, ask="status"):
    """What a search found: `plan` is the repaired one, None if there is none; no repair costs less than `bound`.

    `check` is the proof of it. `contradiction` names what no allowed change reconciles, where there is no repair.
    Where the least cost is only approached, since a strict inequality excludes it, an optimal repair costs a millionth
    more and is not `attained`. `conflicts` and `candidates` are how many polyhedra were met and changes examined.
    `change`, `count`, `epsilon` and `solver` are as they were asked for.
    """

    status: RepairStatus
    required: Mapping[str, Interval]
    plan: ParametrizedPlan | None
    changes: tuple[QuantityChange, ...]
    cost: Cost | None
    bound: Cost
    conflicts: int
    candidates: int
    seconds: float
    attained: bool = True
    contradiction: tuple[str, ...] = ()
    check: CheckResult | None = None
    interrupted: bool = False
    reason: str | None = None
    change: str = "bounds"
    count: bool = False
    epsilon: Fraction = EPSILON
    solver: str = "z3"

    @property
    def cut_short(self) -> bool:
        """Whether something ended the search before it was done."""
        return self.status.is_open


_CHANGES = {
    frozenset({Changeable.BOUND}): "bounds",
    frozenset({Changeable.NOMINAL}): "nominal",
    frozenset(Changeable): "both",
}
"""What may change, in the words of options."""


@dataclass(eq=False)
class RepairSearch(RepairSearching[Cost, Repair]):
    """One search for the least change of a plan.

    Args:
        plan: the plan.
        require: the values that parameters must be able to have; the others have their nominal ones.
        kinds: what may be changed; nominal values of required parameters may not.
        count: whether every change counts, or only bounds that were infinite.
        reorder: whether bounds may change what comes first.
        epsilon: the separation of mutex time points.
        solver: `z3` or `cvc5`.
        deadline: when to stop with the best repair so far.
        on_repair: called with the cost of each better repair.
    """

    plan: ParametrizedPlan
    _: KW_ONLY
    require: Mapping[str, Interval] | None = None
    kinds: Collection[Changeable] = (Changeable.BOUND,)
    count: bool = False
    reorder: bool = False
    epsilon: Fraction = EPSILON
    solver: str = "z3"
    deadline: Deadline = NEVER
    on_repair: Callable[[Cost], None] | None = None

    def __post_init__(self) -> None:
        super().__init__(solver=self.solver, deadline=self.deadline, lowest=Cost())
        self._required = dict(self.require or {})
        changeable = quantities(self.plan, self.kinds, self._required, None if self.reorder else self.epsilon)
        self._quantities = {quantity.name: quantity for quantity in changeable}
        self._changes = CheapestChanges(self.plan, self._quantities, counts=self.count)
        self._infinity = self._changes.greatest * (1 + len(self.plan.constraints))
        self._proof: CheckResult | None = None
        self._declared: set[str] = set()
        self._contradiction: tuple[str, ...] = ()

    # -- the search ----------------------------------------------------------------------------------------------------

    def _search(self) -> None:
        plan = lifted(self.plan, list(self._quantities.values()))
        self._bad = _BadChanges(self.plan, RelationalEncoding(plan, self.epsilon), self.solver, self.deadline)
        self._network = self._bad.open_session()
        self._network.add_all(self._bad.encoding.network_formulas(), self.deadline)
        point = {name: self._required.get(name, Interval(value, value)) for name, value in self.plan.nominal.items()}
        self._network.add(
            *within(self._bad.encoding, {n: interval for n, interval in point.items() if n not in self._quantities})
        )
        self.search()
        if self.best is None and not self._contradiction:
            self._contradiction = tuple(self._irreconcilable())

    def is_hopeless(self) -> bool:
        self._contradiction = self._kept_nowhere()
        return bool(self._contradiction)

    def _kept_nowhere(self) -> tuple[str, ...]:
        """Obligations that no schedule keeps at one of the required points, whatever is changed; often there are none.

        A repaired plan has a schedule there, and all its schedules keep all obligations. None of those that are named
        can be left out. What the solver does not tell soon is left to the search.
        """
        encoding = self._bad.encoding
        asked = [obligation for obligation in encoding.obligations if obligation.violation is not None]
        kept = {obligation.name: encoding.terms.negation(obligation.violation) for obligation in asked}
        violations = {obligation.violation for obligation in asked}
        session = self._bad.open_session()
        formulas = {formula: None for obligation in asked for formula in encoding.full_query(obligation)}
        session.add_all([formula for formula in formulas if formula not in violations], self.deadline)
        fixed = {name: value for name, value in self.plan.nominal.items() if name not in self._quantities}
        for corner in _ends(self._required):
            at = {name: Interval(value, value) for name, value in {**fixed, **corner}.items()}
            with session.frame(*within(encoding, at)):

                def refuted(formulas: Iterable[Formula], session: Session = session) -> bool:
                    with session.frame(*formulas):
                        verdict = session.check("some valid schedule", self.deadline, containment.EFFORTS[1])
                    return verdict is Satisfiability.UNSATISFIABLE

                # Without any schedule there are statements to blame, which the search names.
                if refuted(()) or not refuted(kept.values()):
                    continue
                for name in reversed(kept.copy()):
                    others = {other: formula for other, formula in kept.items() if other != name}
                    if refuted(others.values()):
                        kept = others
                return tuple(kept)
        return ()

    def point_of(self, model: Point) -> Point:
        return {name: model[name] for name in self._declared if not self._has_flag(name) or model.get(_flag(name))}

    def holds(self, choice: LinearConstraint, point: Point) -> bool:
        return self._changes.holds(choice, point)

    def cheapest(self, chosen: Chosen, point: Point) -> Candidate[Cost] | None:
        return self._changes.candidate(chosen, point.keys())

    def step(self, candidate: Candidate[Cost], number: int) -> Candidate[Cost] | None:
        steps = []
        for choice in self.clauses[number].choices:
            self.deadline.enforce()
            chosen = {**candidate.chosen, number: choice}
            needed = {n for c in chosen.values() for n in c.parameters if not self._changes.holds(c, {}, (n,))}
            free = {n for n, quantity in self._quantities.items() if quantity.old is not None} | needed
            if (programme := self._changes.programme(chosen, free)) is not None:
                steps.append(programme)
        if self.count:
            return min(map(self._changes.solution, steps), key=attrgetter("cost"), default=None)
        return self._changes.solution(min(steps, key=attrgetter("cost"))) if steps else None

    def accept(self, candidate: Candidate[Cost]) -> None:
        """Check the repaired plan by itself, and keep it: it is better than those before it."""
        plan = self._changed(candidate)
        box = Box.nominal(plan.parameters).changed(self._required)
        encoding = RelationalEncoding(plan, self.epsilon, box.ranges)
        proof = Checker(encoding, box, solver=self.solver, deadline=self.deadline).run()
        if proof.answer is Answer.UNKNOWN:
            raise KeyboardInterrupt if proof.interrupted else OutOfTimeError(proof.reason)
        if proof.answer is Answer.REFUTED:
            broken = "; ".join(proof.counterexamples) or proof.reason
            raise errors.SolverError(
                f"the check does not confirm a repair ({broken}); please report this plan as a bug"
            )
        self.best, self._proof = candidate, proof
        if self.on_repair is not None:
            self.on_repair(candidate.cost)

    def conflict_at(self, candidate: Candidate[Cost]) -> Clause | None:
        while True:
            piece = self._bad.piece_in(self._box_at(candidate), self.deadline)
            if piece is None:
                return None
            clause = self._clause(piece)
            if not any(self.holds(choice, candidate.point) for choice in clause.choices):
                return clause
            if clause not in self.clauses:
                self.clauses.append(clause)
            if all(quantity.old is not None for quantity in self._quantities.values()):
                raise ValueError(f"{piece} meets what its clause excludes")
            # Only a bound that stands for an infinite one can have run into it.
            self._infinity *= 2

    def _box_at(self, candidate: Candidate[Cost]) -> Box:
        """Where the plan with parameters for what may be changed has to be valid."""
        moved = dict(self._required)
        for name, quantity in self._quantities.items():
            value = candidate.point.get(name, quantity.old)
            if value is not None:
                moved[name] = Interval(value, value)
            else:
                end = quantity.side.sign * self._infinity
                moved[name] = Interval(end, None) if quantity.side is Side.UPPER else Interval(None, end)
        return Box.nominal(self._bad.encoding.plan.parameters).changed(moved)

    def _clause(self, piece: Polyhedron) -> Clause:
        """What a repair must break of a polyhedron: it is bad whatever the required parameters are in it."""
        variable = self._quantities.keys() | self._required.keys()
        fixed = {name: value for name, value in self.plan.nominal.items() if name not in variable}
        bad = [constraint.substitute(fixed) for constraint in piece.constraints]
        if any(not self._required.keys().isdisjoint(constraint.parameters) for constraint in bad):
            bad += Box(self._required).constraints()
            projected = project(bad, self._required.keys(), self.deadline)
            if projected is None:
                raise ValueError(f"{piece} meets what is required, but no changes meet both")
            bad = list(projected)
        choices = dict.fromkeys(negated for constraint in bad for negated in constraint.negation())
        return Clause(tuple(filter(self._leaves_schedule, choices)), self._bad.reasons[piece])

    def _leaves_schedule(self, choice: LinearConstraint) -> bool:
        """Whether some changes that satisfy an inequality leave any schedule at all; else it is not worth a try."""
        terms = self._bad.encoding.terms
        with self._network.frame(choice.to_formula(terms)):
            return satisfiable(self._network, "some schedule under an inequality between changes", self.deadline)

    # -- what the solver knows -----------------------------------------------------------------------------------------

    def _has_flag(self, name: str) -> bool:
        """Whether a change of the quantity counts."""
        return self.count or self._quantities[name].old is None

    def symbols(self) -> Iterator[str]:
        for name in self._declared:
            yield name
            if self._has_flag(name):
                yield _flag(name)

    def formula(self, clause: Clause) -> Formula:
        return self._as_formula(self.session, clause, self._declared)

    def _as_formula(self, session: Session, clause: Clause, declared: set[str]) -> Formula:
        """The clause as a formula; what it mentions for the first time is declared."""
        terms = self.terms
        mentioned = {name for choice in clause.choices for name in choice.parameters}
        partners = {other for name in mentioned if (other := self._changes.partner(name)) is not None}
        new = sorted((mentioned | partners) - declared)
        declared.update(new)
        for name in new:
            session.add(*self._domain(name))
            session.add(*(self._formula(order) for order in self._changes.in_order(name, new)))
        return terms.disjunction(map(self._formula, clause.choices))

    def _formula(self, choice: LinearConstraint) -> Formula:
        """An inequality that bounds which stay infinite satisfy or break."""
        terms, plain = self.terms, choice.to_formula(self.terms)
        endless = [(n, f) for n, f in choice.coefficients if self._quantities[n].old is None]
        if not endless:
            return plain
        unchanged = [terms.equal(_variable(_flag(name))) for name, _ in endless]
        if all(factor * self._quantities[name].side.sign < 0 for name, factor in endless):
            return terms.disjunction((plain, *unchanged))
        return terms.conjunction((plain, *map(terms.negation, unchanged)))

    def _domain(self, name: str) -> Iterator[Formula]:
        """What holds of a quantity in every model: its limits, its price, and a flag that is 1 if it changes."""
        terms, quantity = self.terms, self._quantities[name]
        yield from (limit.to_formula(terms) for limit in self._changes.limits(quantity))
        flag = _variable(_flag(name))
        if self._has_flag(name):
            yield terms.disjunction((terms.equal(flag), terms.equal(flag - 1)))
        if quantity.old is not None:
            yield from (limit.to_formula(terms) for limit in self._changes.price(name))
            if self._has_flag(name):
                yield terms.disjunction((terms.equal(_variable(name) - quantity.old), terms.equal(flag - 1)))

    def cheaper(self, cost: Cost) -> Formula:
        terms = self.terms
        flags = [_variable(_flag(name)) for name in self._declared if self._has_flag(name)]
        costs = [_variable(cost_name(name)) for name in self._declared if self._quantities[name].old is not None]
        spare = Polynomial.constant(Fraction(cost.count)) - sum(flags, Polynomial[ParameterReference]({}))
        less = Polynomial.constant(cost.total) - sum(costs, Polynomial[ParameterReference]({}))
        return terms.disjunction((terms.greater(spare), terms.conjunction((terms.equal(spare), terms.greater(less)))))

    def _irreconcilable(self) -> Iterator[str]:
        """Obligations, or statements of the network, that no allowed changes reconcile; none can be left out."""
        needed = list(dict.fromkeys(clause.reason for clause in self.clauses))
        for reason in list(needed):
            session = Session(self.terms, solver=self.solver)
            others = [clause for clause in self.clauses if clause.reason in needed and clause.reason != reason]
            declared: set[str] = set()
            for clause in others:
                session.add(self._as_formula(session, clause, declared))
            if not satisfiable(session, f"changes without regard to {reason}", self.deadline):
                needed.remove(reason)
        yield from needed

    # -- results -------------------------------------------------------------------------------------------------------

    def _changed(self, candidate: Candidate[Cost]) -> ParametrizedPlan:
        return amounts.changed(self.plan, list(self._quantities.values()), candidate.point)

    def _result(self, status: searching.Status, reason: str | None = None) -> Repair:
        best, changes = self.best, () if self.best is None else tuple(self._changes_of(self.best))
        # Where the infimum is only approached, the changes cost a little more.
        total = sum((change.cost or _NOTHING for change in changes), _NOTHING)
        return Repair(
            status=self.repaired(status),
            required=self._required,
            plan=None if best is None else self._changed(best),
            changes=changes,
            cost=None if best is None else Cost(best.cost.count, total),
            bound=self.lowest or Cost(),
            conflicts=len(self.clauses),
            candidates=self.examined,
            seconds=self._seconds(),
            attained=best is None or best.attained,
            contradiction=self._contradiction,
            check=self._proof,
            interrupted=status is searching.Status.INTERRUPTED,
            reason=reason,
            change=_CHANGES[frozenset(self.kinds)],
            count=self.count,
            epsilon=self.epsilon,
            solver=self.solver,
        )

    def _changes_of(self, repair: Candidate[Cost]) -> Iterator[QuantityChange]:
        for name, quantity in self._quantities.items():
            if name in repair.point:
                yield amounts.change_of(self.plan, quantity, repair.point[name], self._served(name, repair.point))

    def _served(self, name: str, values: Point) -> tuple[str, ...]:
        """What breaks if a change is undone, together with that of the bound which would be on the wrong side of it."""
        undone = {other: value for other, value in values.items() if other != name}
        other = self._changes.partner(name)
        if self._quantities[name].old is not None and other in undone:
            now = Unchanged(self._quantities, undone)
            if not all(order.evaluate(now) for order in self._changes.in_order(name, {name, other})):
                del undone[other]
        broken = (
            clause.reason for clause in self.clauses if not any(self.holds(choice, undone) for choice in clause.choices)
        )
        return tuple(dict.fromkeys(broken))


class _BadChanges(widen.DiscoveredBadSet):
    """The bad set of a plan in which changes are parameters; reasons quote the plan as it was."""

    def __init__(self, plan: ParametrizedPlan, encoding: RelationalEncoding, solver: str, deadline: Deadline) -> None:
        super().__init__(encoding, solver=solver)
        self._deadline = deadline
        now = encoding.plan.constraints
        self._as_written = {str(new): str(old) for new, old in zip(now, plan.constraints, strict=True)}

    def _of_facet(self, facet: Facet, box: Box) -> Polyhedron:
        piece = super()._of_facet(facet, box)
        if facet.obligation is None:
            origins = dict.fromkeys(self._as_written.get(origin, origin) for origin in facet.origins)
            self.reasons[piece] = f"no schedule: {'; '.join(origins)}"
        return piece

    def _projection(self, constraints: Sequence[LinearConstraint], model: nnf.Model) -> Conjunction | None:
        """Exactly, or if there is much to eliminate, a part of it that has the model."""
        return projected(constraints, self._names, model, self._deadline)


def _ends(required: Mapping[str, Interval]) -> Iterator[dict[str, Fraction]]:
    """Where all required parameters are as small as they can be, and where all are as great."""
    for side in Side:
        ends = {
            name: interval.end(side) if interval.is_closed_at(side) else None for name, interval in required.items()
        }
        yield {name: required[name].some_value() if end is None else end for name, end in ends.items()}


def _flag(name: str) -> str:
    return f"change of {name}"


def _variable(name: str) -> Polynomial[ParameterReference]:
    return Polynomial.variable(ParameterReference(name))
