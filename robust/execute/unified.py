"""unified-planning objects in and out: an optional extra, imported only when one of these functions is called.

Numbers stay exact: unified-planning has fractions in its plans, and its problems are not printed with decimals on the
way (:mod:`robust.execute.unified_problem`).
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

from robust.errors import InputError, SolverError, did_you_mean
from robust.plan.model import ParameterReference, TimePoint, TimePointKind
from robust.plan.pddl.syntax import Domain, Problem
from robust.plan.stn import InstanceDeclaration, STNBound, STNPlan
from robust.plan.timed import TimedPlan, TimedStep

if TYPE_CHECKING:
    import unified_planning.model as up_model
    import unified_planning.plans as up_plans


def from_unified_planning(
    problem: up_model.Problem, plan: up_plans.TimeTriggeredPlan
) -> tuple[Domain, Problem, TimedPlan]:
    """What :func:`robust.execute.convert.convert` takes, from unified-planning's problem and plan; numbers stay exact.

    Raises:
        SolverError: if unified-planning is not installed.
        InputError: for another kind of plan, and for names that PDDL cannot tell apart.
        UnsupportedError: for what PDDL 2.1 with timed initial literals cannot say.
    """
    plans = _module("unified_planning.plans")
    if not isinstance(plan, plans.TimeTriggeredPlan):
        raise InputError(f"found a {type(plan).__name__}, expected a TimeTriggeredPlan of unified-planning")
    from robust.execute.unified_expressions import name_of  # noqa: PLC0415 - needs unified-planning
    from robust.execute.unified_problem import problem_of  # noqa: PLC0415 - needs unified-planning

    steps = tuple(
        TimedStep(
            Fraction(start),
            name_of(instance.action.name),
            tuple(name_of(argument.object().name) for argument in instance.actual_parameters),
            None if duration is None else Fraction(duration),
        )
        for start, instance, duration in plan.timed_actions
    )
    return (*problem_of(problem), TimedPlan(steps, "<unified-planning plan>"))


def to_unified_planning(
    stn: STNPlan, problem: up_model.Problem, values: Mapping[str, Fraction] | None = None
) -> up_plans.STNPlan:
    """The plan as unified-planning's STNPlan over the actions of `problem`, with exact bounds.

    unified-planning has no parameters: each stands for its value in `values`, or for its nominal one.

    Raises:
        SolverError: if unified-planning is not installed.
        InputError: for an action, an object or a parameter without counterpart in `problem` or `values`.
    """
    plans = _module("unified_planning.plans")
    nodes = _nodes(stn, problem, plans)
    nominal = {one.name: one.default for one in stn.parameters if one.default is not None}
    known = {**nominal, **(values or {})}
    constraints = [
        (nodes[one.source], _value(one.lower, known), _value(one.upper, known), nodes[one.target])
        for one in stn.constraints
    ]
    start = nodes[_ZERO]
    constraints += [(start, Fraction(0), None, node) for point, node in nodes.items() if point != _ZERO]
    found: up_plans.STNPlan = plans.STNPlan(constraints)
    return found


_ZERO = TimePoint(TimePointKind.ZERO)


def _nodes(stn: STNPlan, problem: up_model.Problem, plans: ModuleType) -> dict[TimePoint, up_plans.STNPlanNode]:
    """A node for every time point. An instantaneous action has a start only, as unified-planning itself makes them."""
    kinds = _module("unified_planning.model").TimepointKind
    node = import_module("unified_planning.plans.stn_plan").STNPlanNode
    nodes: dict[TimePoint, up_plans.STNPlanNode] = {_ZERO: node(kinds.GLOBAL_START)}
    for one in stn.instances:
        instance = _instance(one, problem, plans)
        nodes[one.start] = node(kinds.START, instance)
        if one.durative:
            nodes[one.end] = node(kinds.END, instance)
    return nodes


def _instance(one: InstanceDeclaration, problem: up_model.Problem, plans: ModuleType) -> up_plans.ActionInstance:
    actions = {action.name.lower(): action for action in problem.actions}
    objects = {found.name.lower(): found for found in problem.all_objects}
    if one.action not in actions:
        hint = did_you_mean(one.action, actions)
        raise InputError(f"found action {one.action!r}, expected one of the problem{hint}", one.location)
    for argument in one.arguments:
        if argument not in objects:
            hint = did_you_mean(argument, objects)
            raise InputError(f"found object {argument!r}, expected one of the problem{hint}", one.location)
    manager = problem.environment.expression_manager
    arguments = [manager.ObjectExp(objects[argument]) for argument in one.arguments]
    found: up_plans.ActionInstance = plans.ActionInstance(actions[one.action], arguments)
    return found


def _value(bound: STNBound, known: Mapping[str, Fraction]) -> Fraction | None:
    if not isinstance(bound, ParameterReference):
        return bound
    if bound.name not in known:
        raise InputError(
            f"found parameter {bound.name!r} without a value, expected one{did_you_mean(bound.name, known)}"
        )
    return known[bound.name]


def _module(name: str) -> ModuleType:
    try:
        return import_module(name)
    except ImportError as error:
        message = "found no unified-planning, expected it to be installed: pip install 'robust[up]'"
        raise SolverError(message) from error
