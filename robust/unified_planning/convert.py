"""Plans of unified-planning in and out, with exact numbers.

An optional extra, imported only when one of these functions is called.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

from robust.encode.interface import EPSILON
from robust.errors import InputError, UnsupportedError, did_you_mean
from robust.plan.model import ParameterReference, TimePoint, TimePointKind
from robust.plan.pddl import syntax
from robust.plan.stn import InstanceDeclaration, STNBound, STNConstraint, STNPlan
from robust.plan.timed import TimedPlan, TimedStep
from robust.unified_planning.problems import ActionPart, module_of, name_of, parts_of, problem_of, timed_goals

if TYPE_CHECKING:
    import unified_planning.model as up
    import unified_planning.plans as up_plans

    from robust.execute.convert import Conversion

# -- plans in ----------------------------------------------------------------------------------------------------------


def from_unified_planning(
    problem: up.Problem, plan: up_plans.Plan
) -> tuple[syntax.Domain, syntax.Problem, TimedPlan | STNPlan]:
    """Domain, problem and plan from unified-planning's problem and plan; numbers stay exact.

    A time-triggered plan is what :func:`robust.convert` and :func:`robust.execute.validate.validate` take; so is a
    sequential one, whose steps are one unit of time apart. A plan with a network is what
    :func:`robust.plan.load.assemble` takes: a schedule of its actions is allowed if some time for the end of the plan
    goes with it.

    Args:
        problem: a problem of unified-planning.
        plan: one of its plans for it, of any kind but a hierarchical one.

    Returns:
        The three, as :mod:`robust.plan` reads them from files; times are in the unit of the plan.

    Raises:
        UnsupportedError: if unified-planning is not installed, and for what PDDL 2.1 with timed initial literals cannot
            say.
        InputError: for another kind of plan, and for names that PDDL cannot tell apart.
    """
    return converted(problem, plan, bounded=True)


def converted(
    problem: up.Problem, plan: up_plans.Plan, *, bounded: bool = False
) -> tuple[syntax.Domain, syntax.Problem, TimedPlan | STNPlan]:
    """Domain, problem and plan from unified-planning's; bounds of types are ignored unless `bounded`."""
    plans = module_of("unified_planning.plans")
    read = problem_of(problem, bounded=bounded)
    if isinstance(plan, plans.STNPlan):
        return (*read, _network(plan, problem))
    if isinstance(plan, plans.SequentialPlan):
        for what, items in (("timed effects", problem.timed_effects), ("timed goals", problem.timed_goals)):
            if items:
                raise UnsupportedError(f"found {what} beside a plan without times, expected one with times")
        steps = tuple(_step(Fraction(number), action, None) for number, action in enumerate(plan.actions, start=1))
        return (*read, TimedPlan(steps, _PLAN))
    if isinstance(plan, plans.TimeTriggeredPlan):
        return (*read, _timed(plan, problem))
    if isinstance(plan, plans.PartialOrderPlan):
        return (*read, _ordered(plan))
    kinds = "a sequential, a time-triggered, a partial-order or an STN plan"
    raise InputError(f"found a {type(plan).__name__}, expected {kinds} of unified-planning")


def _timed(plan: up_plans.TimeTriggeredPlan, problem: up.Problem) -> TimedPlan:
    """The steps, and those of their parts, at the times where these are tied to."""
    steps = [_step(*action) for action in plan.timed_actions]
    names = [f"n{number}" for number in range(len(steps))]
    ties: list[tuple[TimePoint, TimePoint, Fraction]] = []
    for name, arguments, part, owner in _part_instances(plan, problem):
        times = {_ZERO: Fraction(0)}
        if owner is not None:
            step = steps[owner]
            times = {_point(f"n{owner}", "start", step.duration): step.time}
            times[_point(f"n{owner}", "end", step.duration)] = step.time + (step.duration or 0)
        bound = _bound_to(name, part, list(times))
        begin, end = (times[source] + apart for source, _, apart in (bound[0], bound[-1]))
        if (part.end is not None and end <= begin) or begin < 0:
            raise UnsupportedError(f"found {part.name} from {begin} to {end}, expected a time after the beginning")
        steps.append(TimedStep(begin, part.name, arguments, None if part.end is None else end - begin))
        names.append(name)
        ties += bound
    return TimedPlan(tuple(steps), _PLAN, names=tuple(names) if ties else (), ties=tuple(ties))


def _part_instances(
    plan: up_plans.Plan, problem: up.Problem
) -> Iterator[tuple[str, tuple[str, ...], ActionPart, int | None]]:
    """Identifier, arguments and part of what is tied to steps, by the number of the step, or to the beginning."""
    for number, instance in enumerate(instances_of(plan)):
        for index, part in enumerate(parts_of(instance.action, {})):
            yield f"n{number}p{index}", _arguments(instance), part, number
    for index, part in enumerate(timed_goals(problem)):
        yield f"goal{index}", (), part, None


def _point(name: str, which: str, duration: object) -> TimePoint:
    kind = TimePointKind.INSTANT if duration is None else TimePointKind(which)
    return TimePoint(kind, name)


def _bound_to(name: str, part: ActionPart, owner: Sequence[TimePoint]) -> list[tuple[TimePoint, TimePoint, Fraction]]:
    """How the time points of a part are tied to the first and the last of its owner's."""
    timings = [part.begin] if part.end is None else [part.begin, part.end]
    kinds = [TimePointKind.INSTANT] if part.end is None else [TimePointKind.START, TimePointKind.END]
    return [
        (owner[0] if timing.is_from_start() else owner[-1], TimePoint(kind, name), Fraction(timing.delay))
        for kind, timing in zip(kinds, timings, strict=True)
    ]


def _ordered(plan: up_plans.PartialOrderPlan) -> STNPlan:
    """A network in which each action follows those that the plan has before it."""
    names = {instance: f"n{number}" for number, instance in enumerate(instances_of(plan))}
    declared = tuple(
        InstanceDeclaration(name, name_of(instance.action.name), _arguments(instance), durative=False)
        for instance, name in names.items()
    )
    points = {instance: declaration.start for instance, declaration in zip(names, declared, strict=True)}
    after = (
        STNConstraint(points[later], points[earlier], EPSILON, None)
        for earlier, others in plan.get_adjacency_list.items()
        for later in others
    )
    return STNPlan((), declared, tuple(after), _PLAN)


_PLAN = "<unified-planning plan>"


def _step(start: Fraction, instance: up_plans.ActionInstance, duration: Fraction | None) -> TimedStep:
    length = None if duration is None else Fraction(duration)
    return TimedStep(Fraction(start), name_of(instance.action.name), _arguments(instance), length)


def _arguments(instance: up_plans.ActionInstance) -> tuple[str, ...]:
    other = next((parameter for parameter in instance.actual_parameters if not parameter.is_object_exp()), None)
    if other is not None:
        raise UnsupportedError(f"found argument {other} of {instance.action.name!r}, expected objects")
    return tuple(name_of(argument.object().name) for argument in instance.actual_parameters)


def instances_of(plan: up_plans.Plan) -> list[up_plans.ActionInstance]:
    """The action instances of a plan, in the order in which `n0`, `n1`, … are given to them."""
    if hasattr(plan, "timed_actions"):
        return [instance for _, instance, _ in plan.timed_actions]
    if hasattr(plan, "actions"):
        return list(plan.actions)
    if hasattr(plan, "get_adjacency_list"):
        return list(plan.get_adjacency_list)
    constraints = plan.get_constraints()
    nodes = (node for source in constraints for node in (source, *(target for _, _, target in constraints[source])))
    return list(dict.fromkeys(node.action_instance for node in nodes if node.action_instance is not None))


def _network(plan: up_plans.STNPlan, problem: up.Problem) -> STNPlan:
    kinds = module_of("unified_planning.model").TimepointKind
    declared = {
        instance: InstanceDeclaration(
            f"n{number}", name_of(instance.action.name), _arguments(instance), hasattr(instance.action, "duration")
        )
        for number, instance in enumerate(instances_of(plan))
    }

    def point(node: up_plans.STNPlanNode) -> TimePoint | None:
        if node.action_instance is None:
            return _ZERO if node.kind is kinds.GLOBAL_START else None
        declaration = declared[node.action_instance]
        return declaration.end if declaration.durative and node.kind is kinds.END else declaration.start

    edges = [
        (point(source), point(target), lower, upper)
        for source, others in plan.get_constraints().items()
        for lower, upper, target in others
    ]
    constraints = [
        STNConstraint(target, source, lower, upper)
        for source, target, lower, upper in _without_end(edges)
        if source != target
    ]
    known, parts = list(declared.values()), []
    for name, arguments, part, number in _part_instances(plan, problem):
        parts.append(InstanceDeclaration(name, part.name, arguments, part.end is not None))
        owner = [_ZERO] if number is None else [known[number].start, known[number].end]
        constraints += [STNConstraint(point, source, k, k) for source, point, k in _bound_to(name, part, owner)]
    return STNPlan((), (*known, *parts), tuple(constraints), _PLAN)


_Edge = tuple[TimePoint | None, TimePoint | None, Fraction | None, Fraction | None]


def _without_end(edges: Iterable[_Edge]) -> Iterator[tuple[TimePoint, TimePoint, Fraction | None, Fraction | None]]:
    """The network without the end of the plan, which is None here: what its bounds say about pairs of the others."""
    after: list[tuple[TimePoint, Fraction]] = []
    before: list[tuple[TimePoint, Fraction]] = []
    for source, target, lower, upper in edges:
        if source is not None and target is not None:
            yield source, target, lower, upper
            continue
        # As bounds of how long after the other point the plan ends.
        other = source or target
        least, most = (lower, upper) if source is not None else (_minus(upper), _minus(lower))
        if other is not None:
            after.extend([] if least is None else [(other, least)])
            before.extend([] if most is None else [(other, most)])
    for early, least in after:
        for late, most in before:
            yield late, early, None, most - least


def _minus(bound: Fraction | None) -> Fraction | None:
    return None if bound is None else -bound


# -- plans out ---------------------------------------------------------------------------------------------------------


def to_unified_planning(
    plan: STNPlan | TimedPlan | Conversion, problem: up.Problem, values: Mapping[str, Fraction] | None = None
) -> up_plans.Plan:
    """The plan over the actions of a unified-planning problem, with exact numbers.

    A plan with a network becomes an STNPlan, one with times a TimeTriggeredPlan, or a SequentialPlan if the problem
    knows no time. unified-planning has no parameters: each stands for its value in `values`, or for its nominal one.

    Args:
        plan: a conversion, or a plan as read from a file.
        problem: the problem whose actions and objects it names.
        values: of parameters, by name.

    Returns:
        The plan of unified-planning, with times in the unit of the plan.

    Raises:
        UnsupportedError: if unified-planning is not installed.
        InputError: for an action, an object or a parameter without counterpart in `problem` or `values`.
    """
    plans = module_of("unified_planning.plans")
    plan = getattr(plan, "stn", plan)
    if not isinstance(plan, STNPlan | TimedPlan):
        raise InputError(f"found a {type(plan).__name__}, expected a plan with a network, or with times")
    plan = _without_parts(plan, problem)
    if isinstance(plan, TimedPlan):
        steps = [(step.time, _instance(step, problem, plans), step.duration) for step in plan.steps]
        if problem.kind.has_continuous_time() or problem.kind.has_discrete_time():
            return plans.TimeTriggeredPlan(steps, problem.environment)
        ordered = sorted(steps, key=lambda step: step[0])
        return plans.SequentialPlan([instance for _, instance, _ in ordered], problem.environment)
    nodes = _nodes(plan, problem, plans)
    nominal = {parameter.name: parameter.default for parameter in plan.parameters if parameter.default is not None}
    known = {**nominal, **(values or {})}
    constraints = [
        (
            nodes[constraint.source],
            _value(constraint.lower, known),
            _value(constraint.upper, known),
            nodes[constraint.target],
        )
        for constraint in plan.constraints
    ]
    start = nodes[_ZERO]
    constraints += [(start, Fraction(0), None, node) for point, node in nodes.items() if point != _ZERO]
    return plans.STNPlan(constraints, problem.environment)


_ZERO = TimePoint(TimePointKind.ZERO)


def _without_parts(plan: STNPlan | TimedPlan, problem: up.Problem) -> STNPlan | TimedPlan:
    """The plan with the actions of the problem alone: what is said of their parts is said of what these are tied to."""
    parts = {part.name for action in problem.actions for part in parts_of(action, {})}
    parts |= {part.name for part in timed_goals(problem)}
    if isinstance(plan, TimedPlan):
        return replace(plan, steps=tuple(step for step in plan.steps if step.action not in parts), names=(), ties=())
    gone = {point for each in plan.instances if each.action in parts for point in (each.start, each.end)}
    tied = {
        bound.target: (bound.source, bound.lower)
        for each in plan.constraints
        for bound in (each, _turned(each))
        if bound.target in gone and bound.source not in gone and bound.lower == bound.upper
        if isinstance(bound.lower, Fraction)
    }

    def owner(point: TimePoint) -> tuple[TimePoint, Fraction]:
        if point not in gone:
            return point, Fraction(0)
        if point not in tied:
            raise InputError(f"found {point}, a part of an action, expected it as far from the action as it has to be")
        return tied[point]

    constraints = []
    for each in plan.constraints:
        (target, late), (source, early) = owner(each.target), owner(each.source)
        if target != source:
            lower, upper = (_moved(bound, early - late) for bound in (each.lower, each.upper))
            constraints.append(STNConstraint(target, source, lower, upper, each.location))
    kept = tuple(each for each in plan.instances if each.action not in parts)
    return replace(plan, instances=kept, constraints=tuple(constraints))


def _turned(bound: STNConstraint) -> STNConstraint:
    """The same said of the two time points the other way round; with a parameter it is left as it is."""
    if isinstance(bound.lower, ParameterReference) or isinstance(bound.upper, ParameterReference):
        return bound
    return STNConstraint(bound.source, bound.target, _minus(bound.upper), _minus(bound.lower))


def _moved(bound: STNBound, distance: Fraction) -> STNBound:
    if not distance or bound is None:
        return bound
    if isinstance(bound, ParameterReference):
        raise UnsupportedError(f"found parameter {bound.name!r} as a distance from a part of an action, expected none")
    return bound + distance


def _nodes(stn: STNPlan, problem: up.Problem, plans: ModuleType) -> dict[TimePoint, up_plans.STNPlanNode]:
    """A node for every time point. An instantaneous action has a start only, as unified-planning itself makes them."""
    kinds = module_of("unified_planning.model").TimepointKind
    node = import_module("unified_planning.plans.stn_plan").STNPlanNode
    nodes: dict[TimePoint, up_plans.STNPlanNode] = {_ZERO: node(kinds.GLOBAL_START)}
    for declaration in stn.instances:
        instance = _instance(declaration, problem, plans)
        nodes[declaration.start] = node(kinds.START, instance)
        if declaration.durative:
            nodes[declaration.end] = node(kinds.END, instance)
    return nodes


def _instance(step: InstanceDeclaration | TimedStep, problem: up.Problem, plans: ModuleType) -> up_plans.ActionInstance:
    actions = {action.name.lower(): action for action in problem.actions}
    objects = {instance.name.lower(): instance for instance in problem.all_objects}
    action = _known("action", step.action, actions, step)
    chosen = [_known("object", argument, objects, step) for argument in step.arguments]
    manager = problem.environment.expression_manager
    instance: up_plans.ActionInstance = plans.ActionInstance(
        action, [manager.ObjectExp(argument) for argument in chosen]
    )
    return instance


def _known(kind: str, name: str, known: Mapping[str, Any], step: InstanceDeclaration | TimedStep) -> Any:
    if name not in known:
        hint = did_you_mean(name, known)
        raise InputError(f"found {kind} {name!r}, expected one of the problem{hint}", step.location)
    return known[name]


def _value(bound: STNBound, known: Mapping[str, Fraction]) -> Fraction | None:
    if not isinstance(bound, ParameterReference):
        return bound
    if bound.name not in known:
        raise InputError(
            f"found parameter {bound.name!r} without a value, expected one{did_you_mean(bound.name, known)}"
        )
    return known[bound.name]
