"""The events of the initial state and of the goal, which are before and after all others [PIKE §4.4]."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import assert_never

from robust.errors import InputError, UnsupportedError
from robust.numbers import format_number
from robust.pike_bridge.files import read_tpnu, write_tpnu
from robust.pike_bridge.model import (
    ALWAYS,
    EPSILON,
    GOAL,
    INITIAL,
    Activity,
    Condition,
    Constraint,
    Effect,
    Event,
    Literal,
    TeamPlan,
    Tpnu,
)
from robust.pike_bridge.validate import NOWHERE, Places, validate
from robust.plan.model import (
    ActionInstance,
    And,
    Atom,
    AtomEffect,
    Comparison,
    Duration,
    DurationConstraint,
    Expression,
    Fluent,
    Holds,
    NumericVariable,
    Or,
    Relation,
    Timing,
    Truth,
)
from robust.plan.model import (
    Condition as StateCondition,
)
from robust.plan.pddl.grounding import ground_action, ground_goal, junction
from robust.plan.pddl.reader import parse_domain, parse_problem, read_domain, read_problem
from robust.plan.pddl.syntax import ActionSchema, Domain, Problem
from robust.plan.polynomial import Polynomial


def with_ends(network: Tpnu, epsilon: Fraction) -> Tpnu:
    """The network with `e_initial` and `e_goal`, added if missing, every other event between them.

    An event is constrained to be ε after `e_initial` unless it follows anyway: along constraints with lower bounds of
    at least zero that hold whenever the event is activated, the first of them at least ε after `e_initial`. Likewise
    for `e_goal`.
    """
    names = {event.name for event in network.events}
    before = () if INITIAL in names else (Event(INITIAL),)
    after = () if GOAL in names else (Event(GOAL),)
    complete = replace(network, events=(*before, *network.events, *after))
    inner = [event for event in complete.events if event.name not in {INITIAL, GOAL}]
    to_goal = [
        Constraint(event.name, GOAL, epsilon, None, event.guard)
        for event in _unconnected(inner, GOAL, _Links(complete, epsilon, forward=False))
    ]
    complete = replace(complete, constraints=(*complete.constraints, *to_goal))
    from_initial = [
        Constraint(INITIAL, event.name, epsilon, None, event.guard)
        for event in _unconnected([*inner, Event(GOAL)], INITIAL, _Links(complete, epsilon, forward=True))
    ]
    return replace(complete, constraints=(*complete.constraints, *from_initial))


def _unconnected(events: Iterable[Event], end: str, links: _Links) -> list[Event]:
    """A small set of events from which, with the end, all others are reached."""
    reached: set[str] = set()
    links.reach(end, reached)
    chosen = []
    # Events that nothing leads to first: what is left then lies on cycles, and one event of each cycle will do.
    for event in sorted(events, key=lambda event: event.name in links.entered):
        if event.name not in reached:
            chosen.append(event)
            links.reach(event.name, reached)
    return chosen


class _Links:
    """For each event, those that certainly follow it (or precede it) whenever they are activated themselves."""

    def __init__(self, network: Tpnu, epsilon: Fraction, *, forward: bool) -> None:
        self._following: dict[str, list[str]] = {}
        self.entered: set[str] = set()
        guards = network.guards
        end = INITIAL if forward else GOAL
        for constraint in network.temporal_constraints:
            near, far = constraint.source, constraint.target
            if not forward:
                near, far = far, near
            least = epsilon if near == end else 0
            if constraint.lower is None or constraint.lower < least or near == far:
                continue
            if constraint.guard <= guards[far]:
                self._following.setdefault(near, []).append(far)
                self.entered.add(far)

    def reach(self, start: str, reached: set[str]) -> None:
        """Add all that certainly follows an event."""
        pending = [start]
        while pending:
            event = pending.pop()
            if event not in reached:
                reached.add(event)
                pending.extend(self._following.get(event, ()))


@dataclass(frozen=True, slots=True)
class Durations:
    """How long an action may take; None is no upper bound."""

    lower: Fraction
    upper: Fraction | None


class StaticFacts:
    """The atoms that no effect of the plan touches, and the fluents that no action of the domain changes."""

    def __init__(self, domain: Domain, problem: Problem, instances: Iterable[ActionInstance]) -> None:
        self._initial = problem.atoms
        self._touched = {effect.atom for instance in instances for effect in instance.atom_effects}
        self._values: Mapping[Fluent, Fraction] = {
            fluent: value for fluent, value in problem.fluents.items() if fluent.function not in domain.written
        }
        self._written = domain.written

    def simplify(self, condition: StateCondition) -> StateCondition:
        """The condition with what never changes decided."""
        match condition:
            case Truth():
                return condition
            case Holds(atom, value):
                return condition if atom in self._touched else Truth((atom in self._initial) == value)
            case Comparison(expression, relation):
                known = self._known(expression)
                return _truth(known.constant_term, relation) if known.is_constant else condition
            case And(operands):
                return junction([self.simplify(operand) for operand in operands], every=True)
            case Or(operands):
                return junction([self.simplify(operand) for operand in operands], every=False)
            case _:
                assert_never(condition)

    def durations(self, instance: ActionInstance, schema: ActionSchema) -> Durations:
        """The durations that the action allows.

        Raises:
            InputError: if a number that decides about the duration has no value.
            UnsupportedError: if the duration depends on what changes or is a parameter, or has a strict bound.
        """
        lower: Fraction = Fraction(0)
        upper: Fraction | None = None
        for constraint in instance.durations:
            slope, limit = self._limit(constraint, instance, schema)
            both = constraint.condition.relation is Relation.EQUAL
            if slope > 0 or both:
                lower = max(lower, limit)
            if slope < 0 or both:
                upper = limit if upper is None else min(upper, limit)
        return Durations(lower, upper)

    def _limit(
        self, constraint: DurationConstraint, instance: ActionInstance, schema: ActionSchema
    ) -> tuple[Fraction, Fraction]:
        """A bound on the duration, and the factor whose sign says on which side it is."""
        expression = self._known(constraint.condition.expression)
        for variable in sorted(expression.variables, key=str):
            if isinstance(variable, Fluent) and variable.function not in self._written:
                reason = f"duration {constraint.text} of {instance} reads it"
                remedy = f"add (= {variable} VALUE) to the problem's :init"
                message = f"found no initial value of {variable}, expected one because {reason}: {remedy}"
                raise InputError(message, schema.location)
        slope = dict(expression.coefficients()).get(Duration(), Fraction(0))
        strict = constraint.condition.relation not in {Relation.AT_LEAST, Relation.EQUAL}
        if expression.variables != {Duration()} or not expression.is_linear or slope == 0 or strict:
            message = f"found duration {constraint.text} of {instance}, expected <=, >= or = and a constant"
            raise UnsupportedError(f"{message} in plans with choices", schema.location)
        return slope, -expression.constant_term / slope

    def _known(self, expression: Expression) -> Expression:
        """With the values of fluents that never change."""

        def value(variable: NumericVariable) -> Expression:
            if isinstance(variable, Fluent) and variable in self._values:
                return Polynomial.constant(self._values[variable])
            return Polynomial.variable(variable)

        return expression.substitute(value)


def _truth(value: Fraction, relation: Relation) -> Truth:
    match relation:
        case Relation.AT_LEAST:
            return Truth(value >= 0)
        case Relation.GREATER:
            return Truth(value > 0)
        case Relation.EQUAL:
            return Truth(value == 0)
        case Relation.DIFFERENT:
            return Truth(value != 0)
        case _:
            assert_never(relation)


def team_plan_of(network: Tpnu, domain: str, problem: str, *, epsilon: Fraction = EPSILON) -> TeamPlan:
    """The plan of a network, such as one of :mod:`robust.pike_bridge.builder`, and the text of a domain and a problem.

    Raises:
        InputError: if network, domain or problem are wrong or do not fit together.
        UnsupportedError: if the actions or the goal need more than conjunctions of literals.
    """
    parsed = parse_domain(domain)
    return team_plan(network, parsed, parse_problem(problem, parsed), epsilon=epsilon)


def team_plan(
    network: Tpnu, domain: Domain, problem: Problem, *, places: Places = NOWHERE, epsilon: Fraction = EPSILON
) -> TeamPlan:
    """The plan of a network and a domain and a problem that have been read; `places` says where the network is written.

    Raises:
        InputError: if network, domain or problem are wrong or do not fit together.
        UnsupportedError: if the actions or the goal need more than conjunctions of literals.
    """
    if epsilon <= 0:
        raise InputError(f"found ε = {format_number(epsilon)}, expected a number above 0")
    validate(network, places)
    return _Joining(network, domain, problem, places, epsilon).plan()


class _Joining:
    """A network joined with a domain and a problem."""

    def __init__(self, network: Tpnu, domain: Domain, problem: Problem, places: Places, epsilon: Fraction) -> None:
        self._domain = domain
        self._problem = problem
        self._places = places
        self._epsilon = epsilon
        self._network = network
        instances: dict[str, ActionInstance] = {}
        for at, activity in enumerate(network.activities):
            if activity.action not in instances:
                instances[activity.action] = self._ground(at, activity)
        self._instances = instances
        self._facts = StaticFacts(domain, problem, instances.values())

    def plan(self) -> TeamPlan:
        if self._problem.timed_literals:
            first = self._problem.timed_literals[0]
            message = f"found a timed initial literal at {format_number(first.time)}"
            raise UnsupportedError(f"{message}, expected an initial state at time 0 only", self._problem.location)
        durations = {
            action: self._facts.durations(instance, self._schema(instance))
            for action, instance in self._instances.items()
        }
        activities = tuple(
            self._bounded(at, activity, durations[activity.action])
            for at, activity in enumerate(self._network.activities)
        )
        network = with_ends(replace(self._network, activities=activities), self._epsilon)
        conditions = [one for at, activity in enumerate(activities) for one in self._conditions(at, activity)]
        conditions += [Condition(literal, GOAL, GOAL, ALWAYS, None) for literal in self._goal()]
        effects = [one for at, activity in enumerate(activities) for one in self._effects(at, activity)]
        atoms = {one.literal.atom for one in conditions} | {one.literal.atom for one in effects}
        initial = [Effect(Literal(atom, atom in self._problem.atoms), INITIAL, ALWAYS, None) for atom in sorted(atoms)]
        return TeamPlan(network, tuple(conditions), (*initial, *effects), self._epsilon)

    def _ground(self, at: int, activity: Activity) -> ActionInstance:
        location = self._places.of("activities", at, "action") or activity.location
        name, *arguments = activity.action.strip("()").split()
        schema = self._domain.actions.get(name)
        if schema is not None and not schema.durative:
            defined = f"the instantaneous action defined at {schema.location}"
            message = f"found {activity.action}, {defined}, expected a durative action because activities take time"
            raise InputError(message, location)
        return ground_action(self._domain, self._problem, activity.action, name, arguments, True, location)

    def _schema(self, instance: ActionInstance) -> ActionSchema:
        return self._domain.actions[instance.action]

    def _bounded(self, at: int, activity: Activity, allowed: Durations) -> Activity:
        """The activity with those of its durations that the action allows."""
        lower = max(activity.lower, allowed.lower)
        upper = allowed.upper if activity.upper is None else activity.upper
        if allowed.upper is not None and upper is not None:
            upper = min(upper, allowed.upper)
        if upper is not None and lower > upper:
            own, others = _interval(activity.lower, activity.upper), _interval(allowed.lower, allowed.upper)
            schema = self._schema(self._instances[activity.action])
            message = f"found activity {activity.action} with bounds {own}, expected some of the durations {others}"
            place = self._places.of("activities", at) or activity.location
            raise InputError(f"{message} that the action defined at {schema.location} allows", place)
        return replace(activity, lower=lower, upper=upper)

    # -- conditions ----------------------------------------------------------------------------------------------

    def _conditions(self, at: int, activity: Activity) -> Iterator[Condition]:
        instance = self._instances[activity.action]
        found: dict[Condition, None] = {}
        for timed in instance.conditions:
            first, last = _span(activity, timed.timing)
            for literal in self._literals(timed.condition, timed.text, f"{instance}", self._schema(instance)):
                found[Condition(literal, first, last, activity.guard, at)] = None
        yield from found

    def _goal(self) -> Iterator[Literal]:
        found: dict[Literal, None] = {}
        for one in ground_goal(self._domain, self._problem):
            found.update(dict.fromkeys(self._literals(one.condition, one.text, "the goal", self._problem)))
        yield from found

    def _literals(
        self, condition: StateCondition, text: str, owner: str, declared: ActionSchema | Problem
    ) -> Iterator[Literal]:
        """The literals of a conjunction.

        Those that nothing in the plan changes stay, too: something outside of it may, and a link from the initial state
        is what monitoring notices that by.
        """
        simplified = self._facts.simplify(condition) if isinstance(condition, Comparison | Or) else condition
        match simplified:
            case Truth(value):
                if not value:
                    yield _never(condition, text)
            case Holds(atom, value):
                yield Literal(atom, value)
            case And(operands):
                for operand in operands:
                    yield from self._literals(operand, text, owner, declared)
            case Comparison() | Or():
                kind = "a numeric condition" if isinstance(simplified, Comparison) else "a disjunction"
                message = f"found {kind} {text} of {owner}, expected a conjunction of literals in plans with choices"
                raise UnsupportedError(message, declared.location)
            case _:
                assert_never(simplified)

    # -- effects -------------------------------------------------------------------------------------------------

    def _effects(self, at: int, activity: Activity) -> Iterator[Effect]:
        instance = self._instances[activity.action]
        numeric = [effect.fluent for effect in instance.numeric_effects]
        numeric += [effect.fluent for effect in instance.continuous_effects]
        if numeric:
            message = f"found a change of the number {numeric[0]} by {instance}"
            expected = "expected effects on propositions only in plans with choices"
            raise UnsupportedError(f"{message}, {expected}", self._schema(instance).location)
        unconditional = [effect for effect in instance.atom_effects if self._happens(effect, instance)]
        added = {(effect.timing, effect.atom) for effect in unconditional if effect.value}
        for timing, atom, value in dict.fromkeys((one.timing, one.atom, one.value) for one in unconditional):
            if value or (timing, atom) not in added:
                event = activity.target if timing is Timing.AT_END else activity.source
                yield Effect(Literal(atom, value), event, activity.guard, at)

    def _happens(self, effect: AtomEffect, instance: ActionInstance) -> bool:
        condition = self._facts.simplify(effect.condition)
        if isinstance(condition, Truth):
            return condition.value
        message = f"found a conditional effect on {effect.atom} of {instance}"
        expected = "expected effects without conditions in plans with choices"
        raise UnsupportedError(f"{message}, {expected}", self._schema(instance).location)


def _never(condition: StateCondition, text: str) -> Literal:
    """What stands for a condition that can never be met: a literal that nothing produces."""
    if isinstance(condition, Holds):
        return Literal(condition.atom, condition.value)
    # No object has a name in parentheses, so that nothing else is about this atom.
    return Literal(Atom("never", (text,)))


def _span(activity: Activity, timing: Timing) -> tuple[str, str]:
    match timing:
        case Timing.AT_START:
            return activity.source, activity.source
        case Timing.AT_END:
            return activity.target, activity.target
        case Timing.OVER_ALL:
            return activity.source, activity.target
        case _:
            assert_never(timing)


def _interval(lower: Fraction, upper: Fraction | None) -> str:
    return f"[{format_number(lower)}, {'∞' if upper is None else format_number(upper)}]"


@dataclass(frozen=True, slots=True)
class Instance:
    """What `.tpnu.json` and two PDDL files say together."""

    network: Tpnu
    domain: str
    problem: str

    @property
    def name(self) -> str:
        return self.network.name

    def plan(self, epsilon: Fraction = EPSILON) -> TeamPlan:
        """The plan with the conditions and effects of its activities."""
        return team_plan_of(self.network, self.domain, self.problem, epsilon=epsilon)

    def write(self, directory: str | os.PathLike[str], name: str = "plan") -> Path:
        """Write `NAME.tpnu.json`, `domain.pddl` and `problem.pddl`; the path of the first.

        Raises:
            InputError: if the directory or a file in it cannot be written.
        """
        place = Path(directory)
        try:
            place.mkdir(parents=True, exist_ok=True)
            (place / "domain.pddl").write_text(self.domain, encoding="utf-8")
            (place / "problem.pddl").write_text(self.problem, encoding="utf-8")
        except OSError as error:
            raise InputError(f"cannot write to {str(place)!r}: {(error.strerror or str(error)).lower()}") from None
        path = place / f"{name}.tpnu.json"
        write_tpnu(path, self.network, domain="domain.pddl", problem="problem.pddl")
        return path


def load_team_plan(path: str | os.PathLike[str], *, epsilon: Fraction = EPSILON) -> TeamPlan:
    """Read a `.tpnu.json` file, its domain and its problem.

    Args:
        epsilon: how far apart a producer, its consumer and what threatens them are kept.

    Raises:
        InputError: with the place, if a file cannot be read, is wrong, or does not fit the others.
        UnsupportedError: if the actions or the goal need more than conjunctions of literals.
    """
    document = read_tpnu(path)
    validate(document.network, document.places)
    domain = read_domain(document.beside(document.domain))
    problem = read_problem(document.beside(document.problem), domain)
    return team_plan(document.network, domain, problem, places=document.places, epsilon=epsilon)


def load_network(path: str | os.PathLike[str]) -> Tpnu:
    """Read only the network of a `.tpnu.json` file, for what needs no action model.

    Raises:
        InputError: with line and column, if the file cannot be read or its network is wrong.
    """
    document = read_tpnu(path)
    validate(document.network, document.places)
    return document.network
