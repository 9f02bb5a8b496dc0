"""Plans to search boxes for, shipped, hand-made and drawn ones, and solvers that fail when they are told to."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

from hypothesis import strategies as st

from robust.irr.containment import Questions
from robust.network.slack import OutsideFragmentError
from robust.plan.load import assemble
from robust.plan.model import ZERO, Parameter, ParametrizedPlan, TimePoint
from robust.plan.parameters import parse_specs
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.polynomial import Polynomial
from robust.plan.stn import parse_stn
from robust.qe.box import Box
from robust.reading import load_plan
from robust.smt.session import Satisfiability, Session
from tests.plan.building import DURATION, END, action, at, at_least, at_most, between, number, plan_of, reference
from tests.sampling import bound_value
from tests.strategies import plans

EXAMPLES = Path(__file__).parents[2] / "robust" / "examples"


def shipped(name: str, *specs: str, plan: str = "plan.stn") -> ParametrizedPlan:
    files = (EXAMPLES / name / file for file in ("domain.pddl", "problem.pddl", plan))
    return load_plan(*files, parameters=specs)


def assembled(domain: str, problem: str, plan: str, *specs: str) -> ParametrizedPlan:
    """A plan of three texts."""
    read = parse_domain(domain)
    return assemble(read, parse_problem(problem, read), parse_stn(plan), parse_specs(specs))


def parametric(**options) -> st.SearchStrategy[ParametrizedPlan]:
    chosen = {"linear": True, "tame": True, "instances": 3, "infeasible": False, **options}
    return plans(**chosen).filter(lambda plan: bool(plan.parameters))


def parameter(name: str, nominal: Fraction | int, lower: int | None = None, upper: int | None = None) -> Parameter:
    ends = [None if end is None else Fraction(end) for end in (lower, upper)]
    return Parameter(name, Fraction(nominal), lower=ends[0], upper=ends[1])


def timed(*parameters: Parameter, length: Polynomial | None = None, pieces=(), **options) -> ParametrizedPlan:
    """One action from 1, which lasts as long as all parameters together if no length is given."""
    i = action("i", *pieces)
    length = sum((reference(one.name) for one in parameters), number(0)) if length is None else length
    constraints = (at(i.start, 1), between(i.start, i.end, length, length))
    return plan_of(i, parameters=parameters, constraints=constraints, **options)


def lasts(low: int, high: int):
    return ((END, at_least(DURATION, low)), (END, at_most(DURATION, high)))


def loose(k: int) -> ParametrizedPlan:
    """From k on, i lasts at least 1, until k + 2: that there are schedules over a box takes a query."""
    i, early = action("i"), reference("k")
    constraints = (between(ZERO, i.start, early), between(i.start, i.end, 1), between(ZERO, i.end, None, early + 2))
    return plan_of(i, parameters=(parameter("k", k),), constraints=constraints)


def earliest(bounds: Iterable, times: dict, zero: Any) -> dict | None:
    """The least times from these on with (source, target, least) kept, by plain iteration; None if zero is late."""
    for _ in range(len(times) + 1):
        before = dict(times)
        for source, target, least in bounds:
            times[target] = max(times[target], times[source] + least)
        if times == before:
            return None if times.get(zero, 0) > 0 else times
    return None


def both_ways(constraint: tuple, source: Any, target: Any, value: Callable) -> Iterator[tuple]:
    """What (lower, upper) of a constraint say: lower bounds in both directions."""
    for bound, *ends, sign in ((constraint[0], source, target, 1), (constraint[1], target, source, -1)):
        if bound is not None:
            yield *ends, sign * value(bound)


def schedule_of(
    plan: ParametrizedPlan, values: Mapping[str, Fraction], *extra: tuple
) -> dict[TimePoint, Fraction] | None:
    """The earliest schedule of a plan, with further lower bounds; None if there is none."""
    bounds = [
        bound
        for one in plan.constraints
        for bound in both_ways((one.lower, one.upper), one.source, one.target, lambda end: bound_value(end, values))
    ]
    times = {point: point.time or Fraction(0) for point in plan.time_points}
    return earliest([*bounds, *extra], times, plan.time_points[0])


def ask_solvers(monkeypatch) -> None:
    """Solvers are asked about parameters alone, too, and about what shortest paths could settle."""
    monkeypatch.setattr(Questions, "_takes_apart", lambda *_: False)
    monkeypatch.setattr("robust.encode.settled.proved", lambda *_: frozenset())
    monkeypatch.setattr("robust.encode.validity.Validity._has_no_simple_cycle", lambda *_: False)

    def outside(*_):
        raise OutsideFragmentError("not asked")

    monkeypatch.setattr("robust.irr.proposals.propose", outside)


def fail_at_query(monkeypatch, number: int, error) -> None:
    """The query of that number ends with KeyboardInterrupt, or UNKNOWN as if out of time."""
    ask_solvers(monkeypatch)
    original, count = Session.check, []

    def failing(self, question, deadline, *effort):
        count.append(question)
        if len(count) < number:
            return original(self, question, deadline, *effort)
        if error == "time":
            return Satisfiability.UNKNOWN
        raise error

    monkeypatch.setattr(Session, "check", failing)


def weighted(plan: ParametrizedPlan, box: Box) -> Fraction | None:
    """The sum of the widths times their weights; None if one is infinite."""
    widths = [box[parameter.name].width for parameter in plan.parameters]
    if any(width is None for width in widths):
        return None
    return sum((p.weight * (w or 0) for p, w in zip(plan.parameters, widths, strict=True)), Fraction(0))
