"""Plans with choices in Python: written as programs, read from files, executed, and asked how far reality may deviate.

from robust import pike

plan = pike.load("kitchen.tpnu.json")
coffee = ["coffee=duration:make-coffee", "limit=at-most:e1:e44"]
print(pike.region(plan, coffee).possible({"coffee": Fraction(3), "limit": Fraction(7)}))
print(pike.envelope(plan, coffee, for_all=["xA1"]).box)
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence

from robust.pike_bridge.action_model import Instance, load_team_plan
from robust.pike_bridge.builder import act, build, choose, parallel, sequence, within
from robust.pike_bridge.compile import checked_assumptions
from robust.pike_bridge.envelopes.parameters import ParametricPlan, parametrize, specifications
from robust.pike_bridge.envelopes.search import LabeledRegion, LabeledRegionSearch, TeamEnvelope, TeamEnvelopeSearch
from robust.pike_bridge.files import read_tpnu, write_tpnu
from robust.pike_bridge.model import EPSILON, TeamPlan, Tpnu
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.progress import Completion, Estimate, Outcome
from robust.pike_bridge.online.reasoners import make_reasoner
from robust.smt.limits import Deadline, noticing_interrupts

__all__ = [
    "EPSILON",
    "Completion",
    "Estimate",
    "Instance",
    "LabeledRegion",
    "Outcome",
    "ParametricPlan",
    "PlanExecutive",
    "TeamEnvelope",
    "TeamPlan",
    "Tpnu",
    "act",
    "build",
    "choose",
    "envelope",
    "load",
    "make_reasoner",
    "parallel",
    "parametrize",
    "read_tpnu",
    "region",
    "sequence",
    "within",
    "write_tpnu",
]

load = load_team_plan
"""Read a `.tpnu.json` file with its PDDL; see :func:`robust.pike_bridge.action_model.load_team_plan`."""


def region(
    plan: TeamPlan | ParametricPlan,
    parameters: Sequence[str] = (),
    *,
    parameter_file: str | os.PathLike[str] | None = None,
    choices: Sequence[str] | None = None,
    assume: Mapping[str, str] | None = None,
    solver: str = "z3",
    timeout: float | None = None,
) -> LabeledRegion:
    """For which parameter values which choices lead to a correct execution.

    Args:
        plan: the plan; one that has parameters already is taken as it is.
        parameters: what is a parameter, as :mod:`robust.pike_bridge.envelopes.parameters` describes it.
        parameter_file: more of them, in a TOML file.
        choices: those that are told apart; those of people and nature, if not given.
        assume: values of choices that are made already.
        timeout: seconds after which what is known is returned.

    Raises:
        InputError: if a parameter, a choice or a value is unknown or wrong.
        SolverError: if the solver is unknown, not installed, or fails.
    """
    varied = _parametric(plan, parameters, parameter_file)
    with noticing_interrupts():
        return LabeledRegionSearch(
            varied,
            choices,
            assume=checked_assumptions(varied.plan, dict(assume or {})),
            solver=solver,
            deadline=Deadline.after(timeout),
        ).run()


def envelope(
    plan: TeamPlan | ParametricPlan,
    parameters: Sequence[str] = (),
    *,
    parameter_file: str | os.PathLike[str] | None = None,
    assume: Mapping[str, str] | None = None,
    for_all: Sequence[str] = (),
    patience: bool = False,
    solver: str = "z3",
    timeout: float | None = None,
) -> TeamEnvelope:
    """A box of parameter values around the nominal ones that no other such box contains.

    Args:
        plan, parameters, parameter_file, assume, timeout: as of :func:`region`.
        for_all: choices of which every combination of values must lead to a correct execution.
        patience: with `for_all`: what is chosen becomes known only then, and the team waits for it.

    Raises:
        InputError: if a parameter, a choice or a value is unknown or wrong.
        SolverError: if the solver is unknown, not installed, or fails.
    """
    varied = _parametric(plan, parameters, parameter_file)
    with noticing_interrupts():
        return TeamEnvelopeSearch(
            varied,
            assume=checked_assumptions(varied.plan, dict(assume or {})),
            for_all=for_all,
            waiting=patience,
            solver=solver,
            deadline=Deadline.after(timeout),
        ).run()


def _parametric(
    plan: TeamPlan | ParametricPlan, parameters: Sequence[str], file: str | os.PathLike[str] | None
) -> ParametricPlan:
    return plan if isinstance(plan, ParametricPlan) else parametrize(plan, specifications(parameters, file))
