"""The engine that unified-planning calls: plans are judged exactly, those with a network for every schedule they allow.

Separation is the problem's `epsilon`, or else that of the engine's parameters. Steps of sequential plans are one unit
of time apart, so they are always separated.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from unified_planning.engines import Credits, Engine, results
from unified_planning.engines.mixins import PlanValidatorMixin
from unified_planning.model import ProblemKind, UPState
from unified_planning.plans import PlanKind

from robust.encode.interface import EPSILON
from robust.errors import InputError, Location, RobustError
from robust.execute import causal, distances
from robust.irr.check import Answer, CheckResult
from robust.numbers import parse_number, plural, readable, readable_values
from robust.plan import load, model
from robust.plan.pddl.syntax import Domain, Problem
from robust.plan.simulate import Simulation, Violation, simulate
from robust.plan.stn import STNPlan
from robust.plan.timed import TimedPlan
from robust.smt.limits import Deadline, one_question
from robust.unified_planning.convert import converted, instances_of
from robust.unified_planning.problems import type_bounds

if TYPE_CHECKING:
    import unified_planning.model as up
    import unified_planning.plans as up_plans

MOST_ORDERS = 1000
"""Sequences of a partial-order plan that are tried."""
INITIALLY = Fraction(-1)
"""What unified-planning calls the time of the initial state in a trace."""

KIND = {
    "problem_class": "ACTION_BASED",
    "problem_type": "SIMPLE_NUMERIC_PLANNING GENERAL_NUMERIC_PLANNING",
    "time": "CONTINUOUS_TIME TIMED_EFFECTS TIMED_GOALS INTERMEDIATE_CONDITIONS_AND_EFFECTS DURATION_INEQUALITIES "
    "SELF_OVERLAPPING",
    "expression_duration": "STATIC_FLUENTS_IN_DURATIONS FLUENTS_IN_DURATIONS INT_TYPE_DURATIONS REAL_TYPE_DURATIONS",
    "numbers": "CONTINUOUS_NUMBERS DISCRETE_NUMBERS BOUNDED_TYPES",
    "conditions_kind": "NEGATIVE_CONDITIONS DISJUNCTIVE_CONDITIONS EQUALITIES EXISTENTIAL_CONDITIONS "
    "UNIVERSAL_CONDITIONS",
    "effects_kind": "CONDITIONAL_EFFECTS INCREASE_EFFECTS DECREASE_EFFECTS INCREASE_CONTINUOUS_EFFECTS "
    "DECREASE_CONTINUOUS_EFFECTS STATIC_FLUENTS_IN_NUMERIC_ASSIGNMENTS FLUENTS_IN_NUMERIC_ASSIGNMENTS FORALL_EFFECTS",
    "typing": "FLAT_TYPING HIERARCHICAL_TYPING",
    "fluents_type": "NUMERIC_FLUENTS INT_FLUENTS REAL_FLUENTS",
    "quality_metrics": "ACTIONS_COST FINAL_VALUE MAKESPAN PLAN_LENGTH OVERSUBSCRIPTION TEMPORAL_OVERSUBSCRIPTION",
    "actions_cost_kind": "STATIC_FLUENTS_IN_ACTIONS_COST FLUENTS_IN_ACTIONS_COST INT_NUMBERS_IN_ACTIONS_COST "
    "REAL_NUMBERS_IN_ACTIONS_COST",
    "oversubscription_kind": "INT_NUMBERS_IN_OVERSUBSCRIPTION REAL_NUMBERS_IN_OVERSUBSCRIPTION",
}
"""The features of problems whose plans are judged, by kind; metrics do not bear on validity."""

CREDITS = Credits(
    "robust",
    "The robust developers",
    "",
    "",
    "Apache-2.0",
    "Validates plans exactly, and STN plans for every schedule that they allow.",
    "Each condition, separation and goal of a plan is one obligation, proved or refuted in rational arithmetic; STN "
    "plans are valid if no schedule that their network allows breaks one. Mutex happenings are epsilon apart.",
)


class RobustValidator(Engine, PlanValidatorMixin):  # type: ignore[misc]
    """Judges sequential, time-triggered and STN plans of unified-planning.

    Args:
        epsilon: the separation of mutex time points for problems that do not say theirs.
        timeout: seconds after which an STN plan is called unknown; None never.
        **options: what unified-planning gives to every engine.

    Raises:
        InputError: if `epsilon` is no number above 0.
    """

    def __init__(self, epsilon: Any = EPSILON, timeout: float | None = None, **options: Any) -> None:
        Engine.__init__(self)
        PlanValidatorMixin.__init__(self)
        place = Location("epsilon")
        self._epsilon = parse_number(str(epsilon), place)
        if self._epsilon <= 0:
            raise InputError(f"found {epsilon}, expected a number above 0", place)
        self._timeout = timeout

    @property
    def name(self) -> str:
        return "robust"

    @staticmethod
    def supported_kind() -> ProblemKind:
        kind = ProblemKind()
        for family, features in KIND.items():
            for feature in features.split():
                getattr(kind, f"set_{family}")(feature)
        return kind

    @staticmethod
    def supports(problem_kind: ProblemKind) -> bool:
        return bool(problem_kind <= RobustValidator.supported_kind())

    @staticmethod
    def supports_plan(plan_kind: PlanKind) -> bool:
        return plan_kind in {
            PlanKind.SEQUENTIAL_PLAN,
            PlanKind.TIME_TRIGGERED_PLAN,
            PlanKind.STN_PLAN,
            PlanKind.PARTIAL_ORDER_PLAN,
        }

    @staticmethod
    def get_credits(**_: Any) -> Credits:
        return CREDITS

    def _validate(self, problem: up.AbstractProblem, plan: up_plans.Plan) -> results.ValidationResult:
        epsilon = getattr(problem, "epsilon", None)
        judge = _PlanJudge(problem, plan, self._epsilon if epsilon is None else Fraction(epsilon))
        try:
            return judge.result(self._timeout)
        except RobustError as error:
            return _result(results.ValidationResultStatus.UNKNOWN, str(error))


def _result(
    status: results.ValidationResultStatus, message: str | None = None, **known: Any
) -> results.ValidationResult:
    messages = [] if message is None else [results.LogMessage(results.LogLevel.INFO, message)]
    return results.ValidationResult(status, "robust", messages, **known)


@dataclass(frozen=True)
class _PlanJudge:
    """Judges one plan."""

    problem: up.Problem
    plan: up_plans.Plan
    epsilon: Fraction

    def result(self, timeout: float | None) -> results.ValidationResult:
        if self.plan.kind is PlanKind.STN_PLAN and not self.plan.is_consistent():
            return _result(results.ValidationResultStatus.INVALID, "the plan's network has no schedule")
        if self.plan.kind is PlanKind.PARTIAL_ORDER_PLAN:
            return self._of_orders(timeout)
        domain, problem, plan = converted(self.problem, self.plan)
        if isinstance(plan, STNPlan):
            return self._of_network(domain, problem, plan, timeout)
        return self._of_schedule(domain, problem, plan)

    def _of_schedule(self, domain: Domain, problem: Problem, timed: TimedPlan) -> results.ValidationResult:
        declared = distances.declarations(timed, domain, self.epsilon) if timed.steps else ()
        plan = load.assemble(domain, problem, STNPlan((), declared, (), timed.file), may_be_empty=True)
        epsilon = self.epsilon if self.plan.kind is PlanKind.TIME_TRIGGERED_PLAN else Fraction(1)
        simulation = simulate(plan, plan.nominal, distances.schedule_of(timed, declared), epsilon=epsilon)
        outside = self._outside(simulation)
        if simulation.valid and outside is not None:
            return _result(results.ValidationResultStatus.INVALID, outside)
        if simulation.valid:
            return _result(results.ValidationResultStatus.VALID, trace=self._trace(simulation, None))
        first = min(simulation.violations, key=lambda violation: violation.time)
        return self._refuted(simulation, first, "")

    def _of_network(
        self, domain: Domain, problem: Problem, stn: STNPlan, timeout: float | None
    ) -> results.ValidationResult:
        checked = self._checked(domain, problem, stn, timeout)
        if checked.answer is Answer.PROVED and type_bounds(self.problem):
            return self._within_bounds(timeout)
        if checked.answer is Answer.PROVED:
            return _result(results.ValidationResultStatus.VALID)
        if checked.answer is Answer.UNKNOWN:
            return _result(results.ValidationResultStatus.UNKNOWN, checked.reason or "not decided")
        example = next(iter(checked.counterexamples.values()))
        names = {instance.identifier: str(instance) for instance in stn.instances}
        times = ", ".join(
            f"{point.kind.value} of {names[point.instance]} at {readable(time)}"
            for point, time in sorted(example.schedule.items(), key=lambda item: item[1])
            if point.instance is not None
        )
        broken = next(
            violation for violation in example.simulation.violations if violation.obligation == example.obligation
        )
        return self._refuted(example.simulation, broken, f"; the plan allows this schedule: {times}")

    def _checked(self, domain: Domain, problem: Problem, stn: STNPlan, timeout: float | None) -> CheckResult:
        plan = load.assemble(domain, problem, stn, may_be_empty=True)
        with one_question():
            return causal.check_plan(plan, self.epsilon, "z3", Deadline.after(timeout))

    def _within_bounds(self, timeout: float | None) -> results.ValidationResult:
        """A network that is valid but for bounds of types, which are now conditions of what changes a fluent."""
        domain, problem, stn = converted(self.problem, self.plan, bounded=True)
        if not isinstance(stn, STNPlan):
            raise TypeError(f"a network became {type(stn).__name__}")
        checked = self._checked(domain, problem, stn, timeout)
        if checked.answer is Answer.PROVED:
            return _result(results.ValidationResultStatus.VALID)
        for example in checked.counterexamples.values():
            if (outside := self._outside(example.simulation)) is not None:
                return _result(results.ValidationResultStatus.INVALID, outside)
        what = next(iter(checked.counterexamples), checked.reason or "not decided")
        found = f"found bounds of types that are not decided ({what})"
        return _result(results.ValidationResultStatus.UNKNOWN, f"{found}, expected a plan with times for them")

    def _of_orders(self, timeout: float | None) -> results.ValidationResult:
        """A partial-order plan, by all sequences that it allows."""
        deadline, count = Deadline.after(timeout), 0
        for count, sequence in enumerate(self.plan.all_sequential_plans(), start=1):
            if count > MOST_ORDERS or deadline.passed:
                message = f"found a partial-order plan with more than {count - 1} orders, expected fewer"
                return _result(results.ValidationResultStatus.UNKNOWN, message)
            judged = _PlanJudge(self.problem, sequence, self.epsilon).result(timeout)
            if judged.status is not results.ValidationResultStatus.VALID:
                return judged
        return _result(results.ValidationResultStatus.VALID, f"valid in each of {plural(count, 'order')}")

    def _outside(self, simulation: Simulation) -> str | None:
        """The first value that leaves the bounds of its fluent's type; between happenings, values are in between."""
        bounds = {name.lower(): ends for name, ends in type_bounds(self.problem).items()}
        for step in simulation.trace:
            for fluent, value in step.fluents.items():
                lower, upper = bounds.get(fluent.function, (None, None))
                if (lower is not None and value < lower) or (upper is not None and value > upper):
                    ends = f"[{'-inf' if lower is None else lower}, {'inf' if upper is None else upper}]"
                    return (
                        f"{fluent} = {readable(value)} at {readable(step.time)}, expected a value in {ends}, its type"
                    )
        return None

    def _refuted(self, simulation: Simulation, broken: Violation, more: str) -> results.ValidationResult:
        reason = _reason(broken)
        message = f"{broken.obligation} is broken at {readable(broken.time)}: {readable_values(broken.detail)}{more}"
        known: dict[str, Any] = {"reason": reason, "trace": self._trace(simulation, broken)}
        if reason is results.FailedValidationReason.INAPPLICABLE_ACTION:
            number = model.concerned(broken.obligation)[0].removeprefix("n")
            known["inapplicable_action"] = instances_of(self.plan)[int(number.partition("p")[0])]
        return _result(results.ValidationResultStatus.INVALID, message, **known)

    # -- states --------------------------------------------------------------------------------------------------------

    def _trace(self, simulation: Simulation, broken: Violation | None) -> list[UPState] | dict[Fraction, UPState]:
        """States up to the first violation, in unified-planning's form for the kind of plan."""
        timed = dict(self._states(simulation, broken))
        if self.plan.kind is not PlanKind.SEQUENTIAL_PLAN:
            return timed
        ends = {Fraction(number) for number in range(1, len(self.plan.actions) + 1)}
        return [state for time, state in timed.items() if time == INITIALLY or time in ends]

    def _states(self, simulation: Simulation, broken: Violation | None) -> Iterator[tuple[Fraction, UPState]]:
        known = {fluent.name.lower(): fluent for fluent in self.problem.fluents}
        objects = {thing.name.lower(): thing for thing in self.problem.all_objects}
        manager = self.problem.environment.expression_manager

        def expression(name: str, arguments: tuple[str, ...]) -> up.FNode:
            return manager.FluentExp(known[name], tuple(manager.ObjectExp(objects[argument]) for argument in arguments))

        def number(name: str, value: Fraction) -> up.FNode:
            return manager.Int(int(value)) if known[name].type.is_int_type() else manager.Real(value)

        state = UPState(self.problem.explicit_initial_values, self.problem)
        yield INITIALLY, state
        for step in simulation.trace:
            if all(point.kind is model.TimePointKind.ZERO for point in step.points):
                continue
            if broken is not None and (step.time > broken.time or (step.time == broken.time and _at_once(broken))):
                return
            changes = {
                expression(atom.predicate, atom.arguments): manager.Bool(value) for atom, value in step.atoms_changed
            }
            for fluent, value in step.fluents.items():
                changes[expression(fluent.function, fluent.arguments)] = number(fluent.function, value)
            state = state.make_child(changes)
            yield step.time, state


_SEPARATION = "separation: "
_GOAL = "goal"


def _reason(broken: Violation) -> results.FailedValidationReason:
    if broken.obligation.startswith(_SEPARATION):
        return results.FailedValidationReason.MUTEX_CONFLICT
    if broken.obligation.startswith(_GOAL):
        return results.FailedValidationReason.UNSATISFIED_GOALS
    return results.FailedValidationReason.INAPPLICABLE_ACTION


def _at_once(broken: Violation) -> bool:
    """Whether what is broken is demanded before the effects of its time: an action's condition, but not a goal."""
    return (
        _reason(broken) is not results.FailedValidationReason.UNSATISFIED_GOALS and "over all" not in broken.obligation
    )
