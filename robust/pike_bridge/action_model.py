"""Networks joined with the domain and the problem that say what their activities need and do [PIKE §4.4].

The events of the initial state and of the goal are added where they are missing, what never changes is decided, and
activities are bounded by the durations that their actions allow.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import TypeAlias, assert_never

import robust
from robust.errors import InputError, UnsupportedError
from robust.network.differences import reachable
from robust.numbers import format_number
from robust.pike_bridge import files, model
from robust.plan import model as states
from robust.plan.pddl import forms, grounding, reader, syntax
from robust.plan.polynomial import Polynomial
from robust.records import atomic_write


def with_ends(network: model.Tpnu, epsilon: Fraction) -> model.Tpnu:
    """The network with `e_initial` and `e_goal`, added if missing, every other event between them.

    An event is constrained to be ε after `e_initial` unless it follows anyway: along constraints with lower bounds of
    at least zero that hold whenever the event is activated, the first of them at least ε after `e_initial`. Likewise
    for `e_goal`.
    """
    names = {event.name for event in network.events}
    before = () if model.INITIAL in names else (model.Event(model.INITIAL),)
    after = () if model.GOAL in names else (model.Event(model.GOAL),)
    complete = replace(network, events=(*before, *network.events, *after))
    for end in (model.GOAL, model.INITIAL):
        added = (
            model.Constraint(
                *((event.name, end) if end == model.GOAL else (end, event.name)), epsilon, None, event.guard
            )
            for event in _unconnected(complete, end, epsilon)
        )
        complete = replace(complete, constraints=(*complete.constraints, *added))
    return complete


def _unconnected(network: model.Tpnu, end: str, epsilon: Fraction) -> list[model.Event]:
    """A small set of events from which, with the end, all others are reached in the end's direction of time.

    What is reached from an event certainly follows it (or precedes it, if the end is the goal) whenever it is activated
    itself.
    """
    guards = network.guards
    following: dict[str, list[str]] = {}
    for constraint in network.temporal_constraints:
        near, far = constraint.source, constraint.target
        if end == model.GOAL:
            near, far = far, near
        least = epsilon if near == end else 0
        certain = constraint.lower is not None and constraint.lower >= least and constraint.guard <= guards[far]
        if certain and near != far:
            following.setdefault(near, []).append(far)
    reached = reachable(following, end)
    entered = {far for fars in following.values() for far in fars}
    inner = [event for event in network.events if event.name not in {model.INITIAL, model.GOAL}]
    inner += [] if end == model.GOAL else [model.Event(model.GOAL)]
    chosen = []
    # Events that nothing leads to first: what is left then lies on cycles, and one event of each cycle will do.
    for event in sorted(inner, key=lambda event: event.name in entered):
        if event.name not in reached:
            chosen.append(event)
            reached |= reachable(following, event.name)
    return chosen


Durations: TypeAlias = tuple[Fraction, Fraction | None]
"""How long an action may take: at least and at most; None is no upper bound."""


def team_plan(
    network: model.Tpnu,
    domain: syntax.Domain,
    problem: syntax.Problem,
    *,
    places: files.Places = files.NOWHERE,
    epsilon: Fraction = model.EPSILON,
) -> model.TeamPlan:
    """The plan of a network and a domain and a problem that have been read; `places` says where the network is written.

    Raises:
        InputError: if network, domain or problem are wrong or do not fit together.
        UnsupportedError: if the actions or the goal need more than conjunctions of literals.
    """
    if epsilon < 0:
        raise InputError(f"found ε = {format_number(epsilon)}, expected a number of at least 0")
    files.validate(network, places)
    return _Joining(network, domain, problem, places, epsilon).plan()


class _Joining:
    """A network joined with a domain and a problem."""

    def __init__(
        self,
        network: model.Tpnu,
        domain: syntax.Domain,
        problem: syntax.Problem,
        places: files.Places,
        epsilon: Fraction,
    ) -> None:
        self._domain, self._problem = domain, problem
        self._network, self._places, self._epsilon = network, places, epsilon
        self._instances: dict[str, states.ActionInstance] = {}
        for at, activity in enumerate(network.activities):
            if activity.action not in self._instances:
                self._instances[activity.action] = self._ground(at, activity)
        self._touched = {effect.atom for one in self._instances.values() for effect in one.atom_effects}
        """What effects of the plan are about; other atoms never change."""

    def plan(self) -> model.TeamPlan:
        if self._problem.timed_literals:
            first = self._problem.timed_literals[0]
            message = f"found a timed initial literal at {format_number(first.time)}"
            raise UnsupportedError(f"{message}, expected an initial state at time 0 only", self._problem.location)
        allowed = {name: self._durations(one) for name, one in self._instances.items()}
        activities = tuple(
            self._bounded(at, activity, allowed[activity.action])
            for at, activity in enumerate(self._network.activities)
        )
        network = with_ends(replace(self._network, activities=activities), self._epsilon)
        conditions = [
            condition for at, activity in enumerate(activities) for condition in self._conditions(at, activity)
        ]
        conditions += [model.Condition(literal, model.GOAL, model.GOAL, model.ALWAYS, None) for literal in self._goal()]
        effects = [effect for at, activity in enumerate(activities) for effect in self._effects(at, activity)]
        atoms = {condition.literal.atom for condition in conditions} | {effect.literal.atom for effect in effects}
        initial = [
            model.Effect(model.Literal(atom, atom in self._problem.atoms), model.INITIAL, model.ALWAYS, None)
            for atom in sorted(atoms)
        ]
        return model.TeamPlan(network, tuple(conditions), (*initial, *effects), self._epsilon)

    def _ground(self, at: int, activity: model.Activity) -> states.ActionInstance:
        location = self._places.of("activities", at, "action") or activity.location
        name, *arguments = activity.action.strip("()").split()
        schema = self._domain.actions.get(name)
        if schema is not None and not schema.durative:
            defined = f"the instantaneous action defined at {schema.location}"
            message = f"found {activity.action}, {defined}, expected a durative action because activities take time"
            raise InputError(message, location)
        return grounding.ground_action(self._domain, self._problem, activity.action, name, arguments, True, location)

    def _schema(self, instance: states.ActionInstance) -> syntax.ActionSchema:
        return self._domain.actions[instance.action]

    def _bounded(self, at: int, activity: model.Activity, allowed: Durations) -> model.Activity:
        """The activity with those of its durations that the action allows."""
        lower = max(activity.lower, allowed[0])
        upper = min((each for each in (activity.upper, allowed[1]) if each is not None), default=None)
        if upper is not None and lower > upper:
            own, others = _interval(activity.lower, activity.upper), _interval(*allowed)
            schema = self._schema(self._instances[activity.action])
            message = f"found activity {activity.action} with bounds {own}, expected some of the durations {others}"
            place = self._places.of("activities", at) or activity.location
            raise InputError(f"{message} that the action defined at {schema.location} allows", place)
        return replace(activity, lower=lower, upper=upper)

    # -- conditions ----------------------------------------------------------------------------------------------

    def _conditions(self, at: int, activity: model.Activity) -> Iterable[model.Condition]:
        instance = self._instances[activity.action]
        schema = self._schema(instance)
        return dict.fromkeys(
            model.Condition(literal, *_span(activity, timed.timing), activity.guard, at)
            for timed in instance.conditions
            for literal in self._literals(timed.condition, timed.text, f"{instance}", schema)
        )

    def _goal(self) -> Iterable[model.Literal]:
        return dict.fromkeys(
            literal
            for one in grounding.ground_goal(self._domain, self._problem)
            for literal in self._literals(one.condition, one.text, "the goal", self._problem)
        )

    def _literals(
        self, condition: states.Condition, text: str, owner: str, declared: syntax.ActionSchema | syntax.Problem
    ) -> Iterator[model.Literal]:
        """The literals of a conjunction.

        Those that nothing in the plan changes stay, too: something outside of it may, and a link from the initial state
        is what monitoring notices that by.
        """
        simplified = (
            self._simplified(condition) if isinstance(condition, states.NumericCondition | states.Or) else condition
        )
        match simplified:
            case states.Truth(value):
                if not value:
                    yield _never(condition, text)
            case states.Holds(atom, value):
                yield model.Literal(atom, value)
            case states.And(operands):
                for operand in operands:
                    yield from self._literals(operand, text, owner, declared)
            case states.NumericCondition() | states.Or():
                kind = "a numeric condition" if isinstance(simplified, states.NumericCondition) else "a disjunction"
                message = f"found {kind} {text} of {owner}, expected a conjunction of literals in plans with choices"
                raise UnsupportedError(message, declared.location)
            case _:
                assert_never(simplified)

    # -- effects -------------------------------------------------------------------------------------------------

    def _effects(self, at: int, activity: model.Activity) -> Iterator[model.Effect]:
        instance = self._instances[activity.action]
        changed = [effect.fluent for effect in instance.numeric_effects]
        changed += [effect.fluent for effect in instance.continuous_effects]
        if changed:
            message = f"found a change of the number {changed[0]} by {instance}"
            expected = "expected effects on propositions only in plans with choices"
            raise UnsupportedError(f"{message}, {expected}", self._schema(instance).location)
        unconditional = [effect for effect in instance.atom_effects if self._happens(effect, instance)]
        added = {(effect.timing, effect.atom) for effect in unconditional if effect.value}
        for timing, atom, value in dict.fromkeys(
            (effect.timing, effect.atom, effect.value) for effect in unconditional
        ):
            if value or (timing, atom) not in added:
                event = activity.target if timing is states.Timing.AT_END else activity.source
                yield model.Effect(model.Literal(atom, value), event, activity.guard, at)

    def _happens(self, effect: states.AtomEffect, instance: states.ActionInstance) -> bool:
        condition = self._simplified(effect.condition)
        if isinstance(condition, states.Truth):
            return condition.value
        message = f"found a conditional effect on {effect.atom} of {instance}"
        expected = "expected effects without conditions in plans with choices"
        raise UnsupportedError(f"{message}, {expected}", self._schema(instance).location)

    # -- what never changes ----------------------------------------------------------------------------------------

    def _simplified(self, condition: states.Condition) -> states.Condition:
        """The condition with what never changes decided."""
        match condition:
            case states.Truth():
                return condition
            case states.Holds(atom, value):
                return condition if atom in self._touched else states.Truth((atom in self._problem.atoms) == value)
            case states.NumericCondition(expression, relation):
                known = self._known(expression)
                return states.Truth(relation.holds(known.constant_term)) if known.is_constant else condition
            case states.And(operands):
                return states.junction([self._simplified(operand) for operand in operands], every=True)
            case states.Or(operands):
                return states.junction([self._simplified(operand) for operand in operands], every=False)
            case _:
                assert_never(condition)

    def _durations(self, instance: states.ActionInstance) -> Durations:
        """The durations that the action allows."""
        lower: Fraction = Fraction(0)
        upper: Fraction | None = None
        for constraint in instance.durations:
            slope, limit = self._limit(constraint, instance)
            both = constraint.condition.relation is states.Relation.EQUAL
            if slope > 0 or both:
                lower = max(lower, limit)
            if slope < 0 or both:
                upper = limit if upper is None else min(upper, limit)
        return lower, upper

    def _limit(
        self, constraint: states.DurationConstraint, instance: states.ActionInstance
    ) -> tuple[Fraction, Fraction]:
        """A bound on the duration, and the factor whose sign says on which side it is."""
        schema = self._schema(instance)
        expression = self._known(constraint.condition.expression)
        for variable in sorted(expression.variables, key=str):
            if isinstance(variable, states.Fluent) and variable.function not in self._domain.written:
                reason = f"duration {constraint.text} of {instance} reads it"
                remedy = f"add (= {variable} VALUE) to the problem's :init"
                message = f"found no initial value of {variable}, expected one because {reason}: {remedy}"
                raise InputError(message, schema.location)
        slope = dict(expression.coefficients()).get(states.Duration(), Fraction(0))
        strict = constraint.condition.relation not in {states.Relation.AT_LEAST, states.Relation.EQUAL}
        if expression.variables != {states.Duration()} or not expression.is_linear or slope == 0 or strict:
            message = f"found duration {constraint.text} of {instance}, expected <=, >= or = and a constant"
            raise UnsupportedError(f"{message} in plans with choices", schema.location)
        return slope, -expression.constant_term / slope

    def _known(self, expression: states.Expression) -> states.Expression:
        """With the values of fluents that no action of the domain changes."""
        values = self._problem.fluents

        def value(variable: states.NumericVariable) -> states.Expression:
            static = isinstance(variable, states.Fluent) and variable.function not in self._domain.written
            if isinstance(variable, states.Fluent) and static and variable in values:
                return Polynomial.constant(values[variable])
            return Polynomial.variable(variable)

        return expression.substitute(value)


def _never(condition: states.Condition, text: str) -> model.Literal:
    """What stands for a condition that can never be met: a literal that nothing produces."""
    if isinstance(condition, states.Holds):
        return model.Literal(condition.atom, condition.value)
    # No object has a name in parentheses, so that nothing else is about this atom.
    return model.Literal(states.Atom("never", (text,)))


def _span(activity: model.Activity, timing: states.Timing) -> tuple[str, str]:
    match timing:
        case states.Timing.AT_START:
            return activity.source, activity.source
        case states.Timing.AT_END:
            return activity.target, activity.target
        case states.Timing.OVER_ALL:
            return activity.source, activity.target
        case _:
            assert_never(timing)


def _interval(lower: Fraction, upper: Fraction | None) -> str:
    return f"[{format_number(lower)}, {'∞' if upper is None else format_number(upper)}]"


@dataclass(frozen=True, slots=True)
class Instance:
    """What `.tpnu.json` and two PDDL files say together."""

    network: model.Tpnu
    domain: str
    problem: str

    @staticmethod
    def read(path: str | os.PathLike[str]) -> Instance:
        """The texts of a `.tpnu.json` file, its domain and its problem; InputError if one cannot be read."""
        document = files.read_tpnu(path)
        domain, problem = (forms.read_text(document.beside(each)) for each in (document.domain, document.problem))
        return Instance(document.network, domain, problem)

    @property
    def name(self) -> str:
        """The name of the network."""
        return self.network.name

    def plan(self, epsilon: Fraction = model.EPSILON) -> model.TeamPlan:
        """The plan with the conditions and effects of its activities; errors as of :func:`team_plan`."""
        domain = reader.parse_domain(self.domain)
        return team_plan(self.network, domain, reader.parse_problem(self.problem, domain), epsilon=epsilon)

    def write(self, directory: str | os.PathLike[str], name: str = "plan") -> Path:
        """Write `NAME.tpnu.json`, `domain.pddl` and `problem.pddl`; the path of the first.

        Raises:
            InputError: if the directory or a file in it cannot be written.
        """
        place = Path(directory)
        try:
            place.mkdir(parents=True, exist_ok=True)
            atomic_write(place / "domain.pddl", self.domain, None)
            atomic_write(place / "problem.pddl", self.problem, None)
        except OSError as error:
            raise InputError(f"cannot write to {str(place)!r}: {(error.strerror or str(error)).lower()}") from None
        path = place / f"{name}.tpnu.json"
        files.write_tpnu(path, self.network, domain="domain.pddl", problem="problem.pddl")
        return path


def load_team_plan(path: str | os.PathLike[str], *, epsilon: Fraction = model.EPSILON) -> model.TeamPlan:
    """Read a `.tpnu.json` file, its domain and its problem.

    Args:
        epsilon: how much earlier is "before", for producers, consumers and threats; 0: strictly.

    Raises:
        InputError: with the place, if a file cannot be read, is wrong, or does not fit the others.
        UnsupportedError: if the actions or the goal need more than conjunctions of literals.
    """
    document = files.read_tpnu(path)
    files.validate(document.network, document.places)
    domain = reader.read_domain(document.beside(document.domain))
    problem = reader.read_problem(document.beside(document.problem), domain)
    return team_plan(document.network, domain, problem, places=document.places, epsilon=epsilon)


def shipped(name: str) -> Instance:
    """A story: the breakfast plan `kitchen` [PIKE §1.1], or the `wing` of an aeroplane [PIKE §6.1]."""
    return Instance.read(Path(robust.__file__).with_name("examples") / name / f"{name}.tpnu.json")
