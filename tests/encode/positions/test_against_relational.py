"""The two encodings describe the same robustness envelope: they share no code but the plan model."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from fractions import Fraction
from random import Random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from robust.api import check
from robust.encode.interface import Facet, Stage
from robust.errors import InputError, UnsupportedError
from robust.irr.check import Answer, CheckResult
from robust.plan.model import ParametrizedPlan
from robust.smt.limits import Deadline
from robust.smt.session import Session, Verdict
from tests.encode.positions.asking import both, difference
from tests.sampling import sample_parameters
from tests.strategies import plans

RANDOM = st.randoms(use_true_random=True)
DRAWN = settings(max_examples=25, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
THOROUGH = settings(DRAWN, max_examples=200)
VERY_SMALL = {"linear": True, "instances": 2, "atoms": 2, "fluents": 1, "parameters": 2}


def verdict(
    plan: ParametrizedPlan, encoding: str, at: Mapping[str, Fraction], every: bool = False
) -> CheckResult | str:
    """The result, with every counterexample confirmed by the simulator, or the name of the error."""
    try:
        return check(plan, encoding=encoding, at=at, every=every)
    except (InputError, UnsupportedError) as error:
        return type(error).__name__


def same_verdict(plan: ParametrizedPlan, random: Random) -> None:
    for at in (plan.nominal, sample_parameters(plan, random)):
        one, other = verdict(plan, "relational", at), verdict(plan, "positions", at)
        if UnsupportedError.__name__ in (one, other):
            continue
        if isinstance(one, str) or isinstance(other, str):
            assert one == other
        else:
            assert one.answer is other.answer


def same_obligations(plan: ParametrizedPlan, seen: Counter[Answer]) -> None:
    """The relational encoding assumes less of the earlier stages: where one of them breaks it may refute more."""
    one, other = (verdict(plan, name, {}, every=True) for name in ("relational", "positions"))
    if isinstance(one, str) or isinstance(other, str) or one.reason or other.reason:
        return
    stages = {o.name: o.stage for o in both(plan)[1].obligations}
    assert list(one.obligations) == list(other.obligations) == list(stages)
    broken = any(one.obligations[name] is Answer.REFUTED for name in stages if stages[name] is not Stage.CONDITION)
    for name, answer in one.obligations.items():
        if broken and answer is Answer.REFUTED and stages[name] is not Stage.DURATION:
            continue
        assert answer is other.obligations[name], name
        seen[answer] += 1


def same_envelope(plan: ParametrizedPlan) -> Verdict:
    """Equivalence for all parameter values, by quantifiers; UNKNOWN if the solver gives up."""
    relational, positions = both(plan)
    try:
        answers = [difference(relational, positions), difference(positions, relational)]
    except UnsupportedError:
        return Verdict.UNKNOWN
    assert Verdict.SATISFIABLE not in answers
    return answers[0] if Verdict.UNKNOWN not in answers else Verdict.UNKNOWN


@DRAWN
@given(plan=plans(), random=RANDOM)
def test_same_verdicts(plan: ParametrizedPlan, random: Random) -> None:
    same_verdict(plan, random)


def test_same_verdict_for_each_obligation() -> None:
    seen: Counter[Answer] = Counter()

    @DRAWN
    @given(plan=plans(linear=True))
    def run(plan: ParametrizedPlan) -> None:
        same_obligations(plan, seen)

    run()
    assert seen[Answer.PROVED] > 20
    assert seen[Answer.REFUTED] > 2


def test_same_envelopes() -> None:
    seen: Counter[Verdict] = Counter()

    @settings(DRAWN, max_examples=15)
    @given(plan=plans(**VERY_SMALL))
    def run(plan: ParametrizedPlan) -> None:
        seen[same_envelope(plan)] += 1

    run()
    assert seen[Verdict.UNSATISFIABLE] > 10


def same_existence(plan: ParametrizedPlan, random: Random, seen: Counter[bool]) -> None:
    """enc_valid of both encodings over boxes, the positions encoding's facets are sound and necessary."""
    relational, positions = both(plan)
    for _ in range(4):
        low, high = sample_parameters(plan, random), sample_parameters(plan, random)
        ranges = {
            name: (
                None if random.random() < 0.1 else min(low[name], high[name]),
                None if random.random() < 0.1 else max(low[name], high[name]),
            )
            for name in plan.nominal
        }
        answers = [
            e.validity.broken_facet(ranges, lambda e=e: Session(e.terms), Deadline()) for e in (relational, positions)
        ]
        if isinstance(answers[0], Facet) and answers[0].obligation is not None:
            continue
        assert (answers[0] is None) == (answers[1] is None)
        seen[answers[1] is None] += 1
        if isinstance(answers[1], Facet):
            assert answers[1].breaks_in(ranges)
            session = Session(positions.terms)
            session.add(*positions.network_formulas(), positions.terms.greater(-answers[1].expression))
            assert session.check("a facet follows from the network") is Verdict.UNSATISFIABLE


def test_same_existence_of_schedules() -> None:
    seen: Counter[bool] = Counter()

    @settings(DRAWN, max_examples=80)
    @given(plan=plans(linear=True, continuous=False, over_all=False, fluents=1), random=RANDOM)
    def run(plan: ParametrizedPlan, random: Random) -> None:
        same_existence(plan, random, seen)

    run()
    assert min(seen[True], seen[False]) > 10


@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {"linear": True, "instances": 5}, {"linear": True, "tame": True}])
def test_same_verdicts_thoroughly(options: dict[str, bool | int]) -> None:
    @THOROUGH
    @given(plan=plans(**options), random=RANDOM)
    def run(plan: ParametrizedPlan, random: Random) -> None:
        same_verdict(plan, random)
        same_obligations(plan, Counter())
        # Products of unknowns are drawn unless excluded; neither encoding decides them.
        with suppress(*(() if options.get("linear") else (UnsupportedError,))):
            same_existence(plan, random, Counter())

    run()


@pytest.mark.slow
@pytest.mark.parametrize("options", [VERY_SMALL, {**VERY_SMALL, "tame": True}])
def test_same_envelopes_thoroughly(options: dict[str, bool | int]) -> None:
    @settings(DRAWN, max_examples=150)
    @given(plan=plans(**options))
    def run(plan: ParametrizedPlan) -> None:
        same_envelope(plan)

    run()
