"""Plans to search boxes for, shipped, hand-made and drawn ones, and solvers that fail when they are told to."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

from hypothesis import strategies as st

from robust.irr.containment import Questions
from robust.plan.load import load_plan
from robust.plan.model import ZERO, Parameter, ParametrizedPlan
from robust.plan.polynomial import Polynomial
from robust.qe.box import Box
from robust.smt.session import Satisfiability, Session
from tests.plan.building import DURATION, END, action, at, at_least, at_most, between, number, plan_of, reference
from tests.strategies import plans

EXAMPLES = Path(__file__).parents[2] / "robust" / "examples"


def shipped(name: str, *specs: str) -> ParametrizedPlan:
    files = (EXAMPLES / name / file for file in ("domain.pddl", "problem.pddl", "plan.stn"))
    return load_plan(*files, parameters=specs)


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


def ask_solvers(monkeypatch) -> None:
    """Solvers are asked about parameters alone, too."""
    monkeypatch.setattr(Questions, "_takes_apart", lambda *_: False)


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
