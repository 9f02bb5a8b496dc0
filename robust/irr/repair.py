"""The least change of a plan after which it is proved: exact, and at any time with its gap.

What may be changed become parameters of a plan of their own. In it, the changes that leave something bad, a schedule
that breaks an obligation or parameter values without a schedule, are a union of polyhedra, discovered one at a time as
in :mod:`robust.irr.widen`. What a plan is required to tolerate is projected out of each; a change is good if it breaks
one of the inequalities of each polyhedron that is left. A solver looks for cheaper and cheaper choices of one broken
inequality for each, exact linear programming makes the best of each choice, and when there is no cheaper one its cost
is a lower bound. If nothing bad is left by these changes they are optimal; else there is another polyhedron. Going on
from there with the cheapest inequality of one polyhedron after the other finds a repair early that may not be the
cheapest.

Cost is a pair: how many numbers change, and the weighted sum of the changes. By sum, the first counts only bounds that
were infinite: no distance from infinity can be told, so as few as possible become finite.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from robust.encode.encoding import RelationalEncoding
from robust.encode.interface import EPSILON, Facet
from robust.errors import SolverError
from robust.irr.cheapest import Candidate, CheapestChanges, cost_name
from robust.irr.check import Answer, Checker, CheckResult
from robust.irr.containment import EFFORTS, within
from robust.irr.quantities import (
    Change,
    Cost,
    Kind,
    RepairStatus,
    Unchanged,
    change_of,
    changed,
    lifted,
    quantities,
)
from robust.irr.widen import DiscoveredBadSet
from robust.plan.model import ParameterReference, ParametrizedPlan
from robust.plan.polynomial import Polynomial
from robust.presented import Presented
from robust.qe.box import Box, Interval, Side
from robust.qe.conjunctions import Conjunction, project, project_at, variables_of
from robust.qe.constraint import LinearConstraint
from robust.qe.eliminate.enumerate import CROWDED, satisfiable
from robust.qe.nnf import Model
from robust.qe.polyhedron import Polyhedron
from robust.smt.limits import NEVER, Deadline, OutOfTimeError
from robust.smt.session import Session, Verdict
from robust.smt.terms import Formula, Terms

_NOTHING = Fraction(0)


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
    changes: tuple[Change, ...]
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


@dataclass(frozen=True, slots=True)
class _Clause:
    """One of these inequalities holds in every repair; `reason` is what breaks otherwise."""

    choices: tuple[LinearConstraint, ...]
    reason: str


_CHANGES = {frozenset({Kind.BOUND}): "bounds", frozenset({Kind.NOMINAL}): "nominal", frozenset(Kind): "both"}
"""What may change, in the words of options."""


class RepairSearch:
    """One search; knows at any moment what it has found.

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

    def __init__(
        self,
        plan: ParametrizedPlan,
        *,
        require: Mapping[str, Interval] | None = None,
        kinds: Collection[Kind] = (Kind.BOUND,),
        count: bool = False,
        reorder: bool = False,
        epsilon: Fraction = EPSILON,
        solver: str = "z3",
        deadline: Deadline = NEVER,
        on_repair: Callable[[Cost], None] | None = None,
    ) -> None:
        self._plan = plan
        self._required = dict(require or {})
        self._kinds = kinds
        self._counts = count
        self._epsilon = epsilon
        self._solver = solver
        self._deadline = deadline
        self._on_repair = on_repair
        self._started = time.perf_counter()
        gap = None if reorder else epsilon
        self._quantities = {one.name: one for one in quantities(plan, kinds, self._required, gap)}
        self._cheapest = CheapestChanges(plan, self._quantities, counts=count)
        self._infinity = self._cheapest.greatest * (1 + len(plan.constraints))
        self._clauses: list[_Clause] = []
        self._examined = 0
        self._lowest = Cost()
        self._best: Candidate | None = None
        self._proof: CheckResult | None = None
        self._terms = Terms()
        self._session = Session(self._terms, solver=solver)
        self._asserted = 0
        self._declared: set[str] = set()
        self._hopeful = False

    def run(self) -> Repair:
        """Search until the best repair is proved to be the cheapest, or time is out."""
        try:
            return self._search()
        except OutOfTimeError as stopped:
            return self._unfinished(reason=stopped.reason)
        except KeyboardInterrupt:
            return self._unfinished(interrupted=True)

    def so_far(self, *, timed_out: bool) -> Repair:
        """The best repair by now, and how much cheaper one could be."""
        return self._unfinished(interrupted=not timed_out)

    # -- the search ----------------------------------------------------------------------------------------------------

    def _search(self) -> Repair:
        plan = lifted(self._plan, list(self._quantities.values()))
        self._bad = _BadChanges(self._plan, RelationalEncoding(plan, self._epsilon), self._solver, self._deadline)
        self._network = self._bad.open_session()
        self._network.add_all(self._bad.encoding.network_formulas(), self._deadline)
        point = {name: self._required.get(name, Interval(value, value)) for name, value in self._plan.nominal.items()}
        self._network.add(
            *within(self._bad.encoding, {n: one for n, one in point.items() if n not in self._quantities})
        )
        while self._best is None or self._best.cost > self._lowest:
            candidate = self._cheapest_known()
            if candidate is None:
                break
            self._lowest = candidate.cost
            if self._clause_at(candidate) is None:
                self._accept(candidate)
                continue
            if not self._hopeful and (broken := self._hopeless()):
                return self._result(RepairStatus.IMPOSSIBLE, contradiction=broken)
            self._hopeful = True
            self._dive(candidate)
        if self._best is None:
            return self._result(RepairStatus.IMPOSSIBLE, contradiction=tuple(self._contradiction()))
        self._lowest = self._best.cost
        return self._result(RepairStatus.OPTIMAL if self._best.values else RepairStatus.UNNEEDED)

    def _hopeless(self) -> tuple[str, ...]:
        """Obligations that no schedule keeps at one of the required points, whatever is changed; often there are none.

        A repaired plan has a schedule there, and all its schedules keep all obligations. None of those that are named
        can be left out. What the solver does not tell soon is left to the search.
        """
        encoding = self._bad.encoding
        asked = [one for one in encoding.obligations if one.violation is not encoding.terms.false]
        kept = {one.name: encoding.terms.negation(one.violation) for one in asked}
        session = self._bad.open_session()
        formulas = (formula for one in asked for formula in encoding.full_query(one) if formula is not one.violation)
        session.add_all(list(dict.fromkeys(formulas)), self._deadline)
        fixed = {one.name: one.nominal for one in self._plan.parameters if one.name not in self._quantities}
        for corner in _ends(self._required):
            at = {name: Interval(value, value) for name, value in {**fixed, **corner}.items()}
            with session.frame(*within(encoding, at)):

                def refuted(formulas: Iterable[Formula], session: Session = session) -> bool:
                    with session.frame(*formulas):
                        return session.check("some valid schedule", self._deadline, EFFORTS[1]) is Verdict.UNSATISFIABLE

                # Without any schedule there are statements to blame, which the search names.
                if refuted(()) or not refuted(kept.values()):
                    continue
                for name in reversed(kept.copy()):
                    others = {other: formula for other, formula in kept.items() if other != name}
                    if refuted(others.values()):
                        kept = others
                return tuple(kept)
        return ()

    def _cheapest_known(self) -> Candidate | None:
        """The cheapest changes that no known clause forbids; None if they are no cheaper than the best repair."""
        for clause in self._clauses[self._asserted :]:
            self._session.add(self._asserted_clause(self._session, clause, self._declared))
        self._asserted = len(self._clauses)
        least, found = self._best, None
        while True:
            cheaper = [] if least is None else [self._cheaper(least.cost)]
            with self._session.frame(*cheaper):
                if not satisfiable(self._session, "cheaper changes that no known clause forbids", self._deadline):
                    return found
                known = self._session.values(self._terms.real(ParameterReference(n)) for n in self._symbols())
            least = found = self._improved({name: Fraction(value) for name, value in known.items()})

    def _improved(self, model: Mapping[str, Fraction]) -> Candidate:
        """The best of the choices that a model makes."""
        free = {name for name in self._declared if not self._has_flag(name) or model.get(_flag(name))}
        values = {name: model[name] for name in free if name in model}
        chosen = (next(one for one in clause.choices if self._cheapest.holds(one, values)) for clause in self._clauses)
        found = self._cheapest.candidate(tuple(chosen), free)
        if found is None:
            raise ValueError("a model satisfies the inequalities that were chosen by it")
        return found

    def _dive(self, candidate: Candidate) -> None:
        """Satisfy one clause after the other by its cheapest inequality; the end is a repair, if there is one."""
        while (clause := self._clause_at(candidate)) is not None:
            steps = []
            for choice in clause.choices:
                self._deadline.enforce()
                chosen = (*candidate.chosen, choice)
                needed = {n for one in chosen for n in one.parameters if not self._cheapest.holds(one, {}, (n,))}
                free = {n for n, one in self._quantities.items() if one.old is not None} | needed
                if (found := self._cheapest.programme(chosen, free)) is not None:
                    steps.append(found)
            if self._counts:
                candidate = min(map(self._cheapest.solution, steps), key=lambda one: one.cost, default=candidate)
            elif steps:
                candidate = self._cheapest.solution(min(steps, key=lambda one: one.cost))
            if not steps or (self._best is not None and candidate.cost >= self._best.cost):
                return
        self._accept(candidate)

    def _accept(self, candidate: Candidate) -> None:
        """Check the repaired plan by itself; it is the best one by now."""
        plan = self._changed(candidate)
        box = Box.nominal(plan.parameters).changed(self._required)
        encoding = RelationalEncoding(plan, self._epsilon)
        proof = Checker(encoding, box, solver=self._solver, deadline=self._deadline).run()
        if proof.answer is Answer.UNKNOWN:
            raise KeyboardInterrupt if proof.interrupted else OutOfTimeError(proof.reason)
        if proof.answer is Answer.REFUTED:
            found = "; ".join(proof.counterexamples) or proof.reason
            raise SolverError(f"the check does not confirm a repair ({found}); please report this plan as a bug")
        self._best, self._proof = candidate, proof
        if self._on_repair is not None:
            self._on_repair(candidate.cost)

    def _clause_at(self, candidate: Candidate) -> _Clause | None:
        """A clause that the changes do not satisfy; None if nothing bad is left by them."""
        self._deadline.enforce()
        for known in self._clauses:
            if not any(self._cheapest.holds(choice, candidate.values) for choice in known.choices):
                return known
        self._examined += 1
        while True:
            piece = self._bad.piece_in(self._box_at(candidate), self._deadline)
            if piece is None:
                return None
            clause = self._clause(piece)
            if clause not in self._clauses:
                self._clauses.append(clause)
            if not any(self._cheapest.holds(choice, candidate.values) for choice in clause.choices):
                return clause
            if all(one.old is not None for one in self._quantities.values()):
                raise ValueError(f"{piece} meets what its clause excludes")
            # Only a bound that stands for an infinite one can have run into it.
            self._infinity *= 2

    def _box_at(self, candidate: Candidate) -> Box:
        """Where the plan with parameters for what may be changed has to be valid."""
        moved = dict(self._required)
        for name, one in self._quantities.items():
            value = candidate.values.get(name, one.old)
            if value is not None:
                moved[name] = Interval(value, value)
            else:
                end = one.side.sign * self._infinity
                moved[name] = Interval(end, None) if one.side is Side.UPPER else Interval(None, end)
        return Box.nominal(self._bad.encoding.plan.parameters).changed(moved)

    def _clause(self, piece: Polyhedron) -> _Clause:
        """What a repair must break of a polyhedron: it is bad whatever the required parameters are in it."""
        fixed = {
            one.name: one.nominal
            for one in self._plan.parameters
            if one.name not in self._quantities and one.name not in self._required
        }
        bad = [one.substitute(fixed) for one in piece.constraints]
        if any(not self._required.keys().isdisjoint(one.parameters) for one in bad):
            bad += Box(self._required).constraints()
            projected = project(bad, self._required.keys(), self._deadline)
            if projected is None:
                raise ValueError(f"{piece} meets what is required, but no changes meet both")
            bad = list(projected)
        choices = dict.fromkeys(negated for one in bad for negated in one.negation())
        return _Clause(tuple(filter(self._leaves_schedule, choices)), self._bad.reasons[piece])

    def _leaves_schedule(self, choice: LinearConstraint) -> bool:
        """Whether some changes that satisfy an inequality leave any schedule at all; else it is not worth a try."""
        terms = self._bad.encoding.terms
        with self._network.frame(choice.to_formula(terms)):
            return satisfiable(self._network, "some schedule under an inequality between changes", self._deadline)

    # -- what the solver knows -----------------------------------------------------------------------------------------

    def _has_flag(self, name: str) -> bool:
        """Whether a change of the quantity counts."""
        return self._counts or self._quantities[name].old is None

    def _symbols(self) -> Iterator[str]:
        for name in self._declared:
            yield name
            if self._has_flag(name):
                yield _flag(name)

    def _asserted_clause(self, session: Session, clause: _Clause, declared: set[str]) -> Formula:
        """The clause as a formula; what it mentions for the first time is declared."""
        terms = self._terms
        mentioned = {name for choice in clause.choices for name in choice.parameters}
        partners = {other for name in mentioned if (other := self._cheapest.partner(name)) is not None}
        new = sorted((mentioned | partners) - declared)
        declared.update(new)
        for name in new:
            session.add(*self._domain(name))
            session.add(*(self._formula(order) for order in self._cheapest.in_order(name, new)))
        return terms.disjunction(map(self._formula, clause.choices))

    def _formula(self, choice: LinearConstraint) -> Formula:
        """An inequality that bounds which stay infinite satisfy or break."""
        terms, plain = self._terms, choice.to_formula(self._terms)
        endless = [(n, f) for n, f in choice.coefficients if self._quantities[n].old is None]
        if not endless:
            return plain
        unchanged = [terms.equal(_variable(_flag(name))) for name, _ in endless]
        if all(factor * self._quantities[name].side.sign < 0 for name, factor in endless):
            return terms.disjunction((plain, *unchanged))
        return terms.conjunction((plain, *map(terms.negation, unchanged)))

    def _domain(self, name: str) -> Iterator[Formula]:
        """What holds of a quantity in every model: its limits, its price, and a flag that is 1 if it changes."""
        terms, one = self._terms, self._quantities[name]
        yield from (limit.to_formula(terms) for limit in self._cheapest.limits(one))
        flag = _variable(_flag(name))
        if self._has_flag(name):
            yield terms.disjunction((terms.equal(flag), terms.equal(flag - 1)))
        if one.old is not None:
            yield from (limit.to_formula(terms) for limit in self._cheapest.price(name))
            if self._has_flag(name):
                yield terms.disjunction((terms.equal(_variable(name) - one.old), terms.equal(flag - 1)))

    def _cheaper(self, cost: Cost) -> Formula:
        """That changes cost less."""
        terms = self._terms
        flags = [_variable(_flag(name)) for name in self._declared if self._has_flag(name)]
        costs = [_variable(cost_name(name)) for name in self._declared if self._quantities[name].old is not None]
        spare = Polynomial.constant(Fraction(cost.count)) - sum(flags, Polynomial[ParameterReference]({}))
        less = Polynomial.constant(cost.total) - sum(costs, Polynomial[ParameterReference]({}))
        return terms.disjunction((terms.greater(spare), terms.conjunction((terms.equal(spare), terms.greater(less)))))

    def _contradiction(self) -> Iterator[str]:
        """Obligations, or statements of the network, that no allowed changes reconcile; none can be left out."""
        needed = list(dict.fromkeys(clause.reason for clause in self._clauses))
        for reason in list(needed):
            session = Session(self._terms, solver=self._solver)
            others = [clause for clause in self._clauses if clause.reason in needed and clause.reason != reason]
            declared: set[str] = set()
            for clause in others:
                session.add(self._asserted_clause(session, clause, declared))
            if not satisfiable(session, f"changes without regard to {reason}", self._deadline):
                needed.remove(reason)
        yield from needed

    # -- results -------------------------------------------------------------------------------------------------------

    def _changed(self, candidate: Candidate) -> ParametrizedPlan:
        return changed(self._plan, list(self._quantities.values()), candidate.values)

    def _unfinished(self, *, interrupted: bool = False, reason: str | None = None) -> Repair:
        status = RepairStatus.UNKNOWN if self._best is None else RepairStatus.FEASIBLE
        return self._result(status, interrupted=interrupted, reason=reason)

    def _result(
        self,
        status: RepairStatus,
        *,
        contradiction: tuple[str, ...] = (),
        interrupted: bool = False,
        reason: str | None = None,
    ) -> Repair:
        best = self._best
        return Repair(
            status=status,
            required=self._required,
            plan=None if best is None else self._changed(best),
            changes=() if best is None else tuple(self._changes(best)),
            cost=None if best is None else self._paid(best),
            bound=self._lowest,
            conflicts=len(self._clauses),
            candidates=self._examined,
            seconds=time.perf_counter() - self._started,
            attained=best is None or best.attained,
            contradiction=contradiction,
            check=self._proof,
            interrupted=interrupted,
            reason=reason,
            change=_CHANGES[frozenset(self._kinds)],
            count=self._counts,
            epsilon=self._epsilon,
            solver=self._solver,
        )

    def _paid(self, found: Candidate) -> Cost:
        """What the changes cost: a little more than the infimum where that is only approached."""
        return Cost(found.cost.count, sum((one.cost or _NOTHING for one in self._changes(found)), _NOTHING))

    def _changes(self, found: Candidate) -> Iterator[Change]:
        for name, one in self._quantities.items():
            if name in found.values:
                yield change_of(self._plan, one, found.values[name], self._served(name, found.values))

    def _served(self, name: str, values: Mapping[str, Fraction]) -> tuple[str, ...]:
        """What breaks if a change is undone, together with that of the bound which would be on the wrong side of it."""
        undone = {other: value for other, value in values.items() if other != name}
        other = self._cheapest.partner(name)
        if self._quantities[name].old is not None and other in undone:
            now = Unchanged(self._quantities, undone)
            if not all(order.evaluate(now) for order in self._cheapest.in_order(name, {name, other})):
                del undone[other]
        broken = (c.reason for c in self._clauses if not any(self._cheapest.holds(each, undone) for each in c.choices))
        return tuple(dict.fromkeys(broken))


class _BadChanges(DiscoveredBadSet):
    """The bad set of a plan in which changes are parameters; reasons quote the plan as it was."""

    def __init__(self, plan: ParametrizedPlan, encoding: RelationalEncoding, solver: str, deadline: Deadline) -> None:
        super().__init__(encoding, solver=solver)
        self._deadline = deadline
        now = encoding.plan.constraints
        self._as_written = {str(new): str(old) for new, old in zip(now, plan.constraints, strict=True)}

    def _of_facet(self, facet: Facet, box: Box) -> Polyhedron:
        piece = super()._of_facet(facet, box)
        if facet.obligation is None:
            told = dict.fromkeys(self._as_written.get(origin, origin) for origin in facet.origins)
            self.reasons[piece] = f"no schedule: {'; '.join(told)}"
        return piece

    def _projection(self, constraints: Sequence[LinearConstraint], model: Model) -> Conjunction | None:
        """Exactly, or if there is much to eliminate, a part of it that has the model."""
        names = variables_of(constraints)
        eliminated = set(names).difference(self._names)
        if sum(1 for one in constraints if not eliminated.isdisjoint(one.parameters)) > CROWDED:
            return project_at(constraints, eliminated, {name: Fraction(model.get(name, 0)) for name in names})
        return project(constraints, eliminated, self._deadline)


def _ends(required: Mapping[str, Interval]) -> Iterator[dict[str, Fraction]]:
    """Where all required parameters are as small as they can be, and where all are as great."""
    for side in Side:
        ends = {name: one.end(side) if one.is_closed_at(side) else None for name, one in required.items()}
        yield {name: required[name].some_value() if end is None else end for name, end in ends.items()}


def _flag(name: str) -> str:
    return f"change of {name}"


def _variable(name: str) -> Polynomial[ParameterReference]:
    return Polynomial.variable(ParameterReference(name))
