"""What the activities of a network need and do, from a PDDL domain and problem [PIKE §2.1, §4.4].

Conditions are conjunctions of literals, effects are literals. Disjunctions and numbers are allowed where what never
changes in the plan decides them. Where an activity deletes and adds an atom at one event, the atom is added, as PDDL
has it. The duration constraints of an action and the bounds of its activity hold both: their intersection is taken.

Activities take time, so that their actions are durative: an instantaneous action is refused.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from typing import assert_never

from robust.errors import InputError, UnsupportedError
from robust.pike_bridge.ends import with_ends
from robust.pike_bridge.model import (
    ALWAYS,
    EPSILON,
    GOAL,
    INITIAL,
    Activity,
    Condition,
    Effect,
    Literal,
    TeamPlan,
    Tpnu,
)
from robust.pike_bridge.places import NOWHERE, Places
from robust.pike_bridge.static_facts import Durations, StaticFacts
from robust.pike_bridge.validate import validate
from robust.plan.model import ActionInstance, And, Atom, AtomEffect, Comparison, Holds, Or, Timing, Truth
from robust.plan.model import Condition as StateCondition
from robust.plan.numerals import format_number
from robust.plan.pddl.grounding import ground_action, ground_goal
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.pddl.syntax import ActionSchema, Domain, Problem


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
