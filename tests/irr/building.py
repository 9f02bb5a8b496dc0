"""Plans to search boxes for: shipped ones and drawn ones."""

from __future__ import annotations

from pathlib import Path

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from robust.irr.search import EnvelopeResult
from robust.plan.load import load_plan
from robust.plan.model import ParametrizedPlan
from robust.qe.box import Box
from tests.strategies import plans

EXAMPLES = Path(__file__).parents[2] / "robust" / "examples"


def shipped(name: str, *specs: str) -> ParametrizedPlan:
    files = (EXAMPLES / name / file for file in ("domain.pddl", "problem.pddl", "plan.stn"))
    return load_plan(*files, parameters=specs)


def drawn(examples: int) -> settings:
    return settings(
        max_examples=examples,
        deadline=None,
        derandomize=True,
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much, HealthCheck.data_too_large],
    )


def parametric(**options) -> st.SearchStrategy[ParametrizedPlan]:
    chosen = {"linear": True, "tame": True, "instances": 3, "infeasible": False, **options}
    return plans(**chosen).filter(lambda plan: bool(plan.parameters))


def accepted_boxes(result: EnvelopeResult) -> list[Box]:
    return [step.box for step in result.trace if step.accepted]
