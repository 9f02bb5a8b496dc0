"""How far bounds of a plan with choices can move, one at a time; and the least change of several together.

*Limits.* More time for a requirement, and a narrower range of a contingent length, never hurt: a bound that is a
parameter is moved by bisection, on the grid of the plan's numbers, to where controllability ends. Rational people may
have more values to choose from with more time, so that for them only the two values are known between which it ends.

*The least change* is found by conflicts (:mod:`robust.irr.conflicts`). Where a plan with changed bounds is refuted by a
single situation, the polyhedra of bounds that give this situation a correct execution
(:mod:`robust.pike_bridge.envelopes`) say what another change must satisfy: of each polyhedron an inequality that is
violated now. Where several situations are needed, one of the bounds must be moved further, by the grid of the plan's
numbers at least. Changes that only make it easier are tried. What rational people may choose changes with the bounds,
so that for them a repair is not proved to be the least.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from robust.errors import InputError, Location, did_you_mean
from robust.irr.conflicts import Candidate, Clause, Point, RepairStatus, WeightedRepairSearching
from robust.numbers import shorten
from robust.pike_bridge.envelopes.parameters import Bound, ParametricPlan, TeamParameter, TeamParameterKind
from robust.pike_bridge.envelopes.search import LabeledRegionSearch
from robust.pike_bridge.game.controllability import (
    BoundsRepair,
    DecidingControllability,
    EasedBound,
    MovableBound,
    TeamControllability,
)
from robust.pike_bridge.game.deciding import ControllabilityVerdict, GameSituation
from robust.pike_bridge.game.rules import STRICT, GameRules
from robust.pike_bridge.model import ALWAYS, Guard, common_measure, guard_text
from robust.pike_bridge.semantics import restrict
from robust.plan.model import ParameterReference, Relation
from robust.qe.constraint import LinearConstraint, Sense
from robust.searching import DECIDED, Announce, Searching, Status, unheard
from robust.smt.limits import NEVER, Deadline, OutOfTimeError


def is_least(plan: ParametricPlan, parameter: TeamParameter, rules: GameRules) -> bool:
    """Whether smaller values of a bound make it harder.

    Raises:
        InputError: if it is no single bound, or one of both sides' activities.
    """
    network = plan.plan.network
    if parameter.kind not in {TeamParameterKind.AT_LEAST, TeamParameterKind.AT_MOST}:
        message = f"found {parameter.kind.value} as {parameter.name}, expected at-least or at-most"
        raise InputError(message, Location("parameters"))
    activities = [
        network.activities[place - len(network.constraints)]
        for place in parameter.places
        if place >= len(network.constraints)
    ]
    nature = {each.lower != each.upper and each.agent not in rules.free for each in activities} or {False}
    if len(nature) > 1:
        message = f"{parameter.name} is of activities of both sides, expected either nature's or the executive's"
        raise InputError(message, Location("parameters"))
    return (parameter.kind is TeamParameterKind.AT_LEAST) == (nature == {True})


def extremes(plan: ParametricPlan, parameter: TeamParameter, *, least: bool) -> tuple[Fraction, Fraction]:
    """The hardest and the easiest value that are tried: the other bound, or so great that more is no help."""
    most = sum(map(abs, plan.plan.network.bounds), Fraction(1))
    [side] = parameter.kind.sides
    others = [plan.bounds[place][1 - side] for place in parameter.places]
    numbers = [each.constant_term for each in others if each is not None and each.is_constant]
    lowest = max(numbers, default=Fraction(0)) if side else Fraction(0)
    highest = most if side else min(numbers, default=most)
    return (lowest, highest) if least else (highest, lowest)


@dataclass
class FindingLimits(Searching[TeamControllability]):
    """Decides whether a plan is controllable, and how far bounds of it can move.

    Args:
        plan: the plan; each of its parameters is a bound that moves while all others stay as they are.
        rules: who decides what.
        assume: choices that are made already.
        repair: whether the least change of all bounds together is found instead.
        solver: `z3` or `cvc5`.

    Raises:
        InputError: if a parameter is no single bound, or of both sides' activities; if there is no such free agent, or
            nothing that could be repaired.
    """

    plan: ParametricPlan
    rules: GameRules = STRICT
    assume: Guard = ALWAYS
    repair: bool = False
    solver: str = "z3"
    deadline: Deadline = NEVER
    on_stage: Announce = unheard

    def __post_init__(self) -> None:
        super().__init__()
        agents = {each.agent for each in self.plan.plan.network.activities if each.agent is not None}
        for agent in self.rules.free:
            if agent not in agents:
                message = f"found unknown agent {shorten(agent)}, expected one of the plan{did_you_mean(agent, agents)}"
                raise InputError(message, Location("free"))
        if self.repair and not self.plan.parameters:
            raise InputError("found no parameters, expected bounds that may change", Location("repair"))
        self._asked = [(each, is_least(self.plan, each, self.rules)) for each in self.plan.parameters]
        self._nominal = self.deciding({})
        self._limits: list[MovableBound] = []

    def _result(self, status: Status, reason: str | None = None) -> TeamControllability:
        known = self._nominal._result(status, reason)
        known.limits, known.seconds = self._limits, self._seconds()
        return known

    def _search(self) -> None:
        self._nominal._search()
        if self.repair:
            repairing = LeastChangeSearch(self)
            self._nominal._known.repair = repairing.run()
            return
        for parameter, least in self._asked:
            self._limits.append(self._limit(parameter, least))

    def deciding(self, values: Mapping[str, Fraction]) -> DecidingControllability:
        plan = restrict(self.plan.at({**self.plan.nominal, **values}), self.assume)
        return DecidingControllability(plan, self.rules, self.solver, self.deadline, self.on_stage)

    def _limit(self, parameter: TeamParameter, least: bool) -> MovableBound:
        """Bisection on the grid of the plan's numbers, from the nominal value towards where the verdict is another."""
        plan, name = self.plan.plan, parameter.name
        grid = common_measure((plan.separation, *plan.network.bounds))
        hardest, easiest = extremes(self.plan, parameter, least=least)
        holds: Fraction | None = None
        fails: Fraction | None = None

        def is_enough(value: Fraction) -> bool:
            nonlocal holds, fails
            deciding = self.deciding({name: value})
            self.on_stage(f"{name} = {value}")
            deciding._search()
            verdict = deciding._known.verdict
            if verdict is ControllabilityVerdict.CONTROLLABLE:
                holds = value
            elif verdict is ControllabilityVerdict.UNCONTROLLABLE:
                fails = value
            return verdict is ControllabilityVerdict.CONTROLLABLE

        try:
            if is_enough(easiest) and not is_enough(hardest):
                good, bad = easiest, hardest
                while abs(good - bad) > grid:
                    middle = bad + round((good - bad) / grid / 2) * grid
                    good, bad = (middle, bad) if is_enough(middle) else (good, middle)
        except OutOfTimeError:
            self._limits.append(MovableBound(parameter, least, holds, fails))
            raise
        return MovableBound(parameter, least, holds, fails)


# -- the least change --------------------------------------------------------------------------------------------------


class LeastChangeSearch(WeightedRepairSearching[BoundsRepair]):
    """Finds the least change of the bounds of a plan together; a point has how far each one is eased."""

    def __init__(self, finding: FindingLimits) -> None:
        super().__init__(solver=finding.solver, deadline=finding.deadline)
        self._finding, self._plan = finding, finding.plan
        self._sign: dict[str, int] = {}
        self._most: dict[str, Fraction] = {}
        self._grid = common_measure((self._plan.plan.separation, *self._plan.plan.network.bounds))
        for parameter in self._plan.parameters:
            least = is_least(self._plan, parameter, finding.rules)
            _, easiest = extremes(self._plan, parameter, least=least)
            self._sign[parameter.name] = 1 if least else -1
            self._most[parameter.name] = max(Fraction(0), self._sign[parameter.name] * (easiest - self._old(parameter)))
            self.weight[parameter.name] = parameter.parameter.weight

    def _old(self, parameter: TeamParameter) -> Fraction:
        return self._plan.nominal[parameter.name]

    def limits(self, names: Sequence[str]) -> Iterator[LinearConstraint]:
        """No lower bound becomes greater than the upper one beside it."""
        yield from (LinearConstraint.of({name: 1}, "<=", self._most[name]) for name in names)
        for lower, upper in self._plan.bounds:
            if lower is not None and upper is not None and not (lower.is_constant or upper.is_constant):
                yield self._of_changes(LinearConstraint.from_polynomial(upper - lower, Relation.AT_LEAST), names)

    def _of_changes(self, constraint: LinearConstraint, names: Sequence[str] | None = None) -> LinearConstraint:
        """A constraint on bounds as one on their changes; those without names are not changed."""
        old = sum((factor * self._plan.nominal[name] for name, factor in constraint.coefficients), Fraction(0))
        changes = {
            name: factor * self._sign[name]
            for name, factor in constraint.coefficients
            if names is None or name in names
        }
        return LinearConstraint.of(changes, constraint.relation, constraint.constant - old)

    def room(self, name: str, point: Point) -> Fraction:
        """How much more a bound can be eased."""
        return self._most[name] - point.get(name, Fraction(0))

    def conflict_at(self, candidate: Candidate[Fraction]) -> Clause | None:
        """What other changes must satisfy; None if the plan with these is controllable."""
        values = self._values(candidate.point)
        deciding = self._finding.deciding(values)
        deciding._search()
        found = deciding._known
        if found.verdict is ControllabilityVerdict.CONTROLLABLE:
            return None
        if found.verdict is ControllabilityVerdict.UNKNOWN:
            raise OutOfTimeError(found.reason)
        choices = self._helping(found.situations[0], values) if len(found.situations) == 1 else None
        if choices is None:
            point = candidate.point
            choices = [
                LinearConstraint.of({name: 1}, ">=", point.get(name, Fraction(0)) + self._grid)
                for name in self.weight
                if self.room(name, point) >= self._grid
            ]
        reason = " or ".join(guard_text(each.values) for each in found.situations if each.values)
        return Clause(tuple(dict.fromkeys(choices)), reason)

    def _helping(self, situation: GameSituation, values: Mapping[str, Fraction]) -> list[LinearConstraint] | None:
        """An inequality that is violated now of each polyhedron in which the situation has a correct execution.

        None if that says nothing.
        """
        plan, network = self._plan, self._plan.plan.network
        bounds, places = list(plan.bounds), {each.source: at for at, each in enumerate(network.activities)}
        known = {ParameterReference(name): value for name, value in values.items()}
        for activity, length in situation.lengths.items():
            at = len(network.constraints) + places.get(activity.source, -1 - len(network.constraints))
            ends: list[Bound | None] = [each for each in bounds[at] if at >= 0 and each is not None]
            taken = next((each for each in ends if each is not None and each.evaluate(known) == length), None)
            if taken is None:
                return None
            bounds[at] = (taken, taken)
        search = LabeledRegionSearch(
            replace(plan, bounds=tuple(bounds)),
            (),
            assume=situation.values | self._finding.assume,
            solver=self._finding.solver,
            deadline=self.deadline,
        )
        region = search.run()
        if region.status not in DECIDED:
            raise OutOfTimeError(region.reason)
        violated = [
            next((each for each in piece.polyhedron.constraints if not each.evaluate(values)), None)
            for piece in region.pieces
        ]
        if any(each is None or each.relation is not Sense.AT_MOST for each in violated):
            return None
        return [self._of_changes(each) for each in violated if each is not None]

    def _values(self, point: Point) -> dict[str, Fraction]:
        return {name: old + self._sign[name] * point.get(name, Fraction(0)) for name, old in self._plan.nominal.items()}

    def _result(self, status: Status, reason: str | None = None) -> BoundsRepair:
        repaired = self.repaired(status)
        if self._finding.rules.rational and repaired in {RepairStatus.OPTIMAL, RepairStatus.IMPOSSIBLE}:
            repaired = RepairStatus.UNKNOWN if self.best is None else RepairStatus.FEASIBLE
        point = {} if self.best is None else self.best.point
        values = self._values(point)
        changes = (
            EasedBound(each, self._old(each), values[each.name], point[each.name] * self.weight[each.name])
            for each in self._plan.parameters
            if each.name in point
        )
        bound = None if self._finding.rules.rational else self.lowest
        return BoundsRepair(repaired, tuple(changes), bound, len(self.clauses))
