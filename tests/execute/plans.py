"""Time-triggered plans for tests: small ones, drawn ones, and the earliest schedules of plan files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

from robust.execute.convert import Conversion, Mode, convert
from robust.plan.load import load_plan
from robust.plan.model import ParametrizedPlan, TimePoint
from robust.plan.parameters import parse_specs
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.timed import TimedPlan, TimedStep, parse_timed_plan
from tests.sampling import Network

EPSILON = Fraction(1, 1000)


def converted(
    domain: str, problem: str, plan: str, *specs: str, mode: Mode = Mode.CAUSAL, timeout: float | None = None
) -> Conversion:
    """The conversion of three texts."""
    parsed = parse_domain(domain)
    read, steps = parse_problem(problem, parsed), parse_timed_plan(plan, "plan.txt")
    return convert(parsed, read, steps, mode=mode, specs=parse_specs(specs), timeout=timeout)


def durative(name: str, duration: str, conditions: str, effects: str) -> str:
    """A durative action without parameters, as PDDL; `duration` is its length, or a comparison with it as `>= 2`."""
    operator, length = duration.split() if " " in duration else ("=", duration)
    return (
        f"(:durative-action {name} :parameters () :duration ({operator} ?duration {length}) "
        f":condition (and {conditions}) :effect (and {effects}))"
    )


def lines(found: Conversion) -> set[str]:
    """The constraints without durations."""
    return {
        f"{one.target} - {one.source} in [{one.lower}, {one.upper}]"
        for one in found.plan.constraints
        if one.source.instance is None or one.source.instance != one.target.instance
    }


def earliest(plan: ParametrizedPlan) -> dict[TimePoint, Fraction]:
    """The earliest schedule at nominal parameter values."""
    network = Network(plan, plan.nominal)
    assert network.consistent
    column = [row[0] for row in network.distances]
    return {point: Fraction(-(column[i] or 0), network.scale) for i, point in enumerate(network.points)}


def timed(plan: ParametrizedPlan, times: Mapping[TimePoint, Fraction]) -> TimedPlan:
    """The plan's instances at these times."""
    lengths = {one: times[one.end] - times[one.start] if one.durative else None for one in plan.instances}
    steps = (TimedStep(times[one.start], one.action, one.arguments, length) for one, length in lengths.items())
    return TimedPlan(tuple(steps))


def bare(domain: Path, problem: Path, plan: Path) -> tuple[ParametrizedPlan, dict[TimePoint, Fraction]]:
    """A plan file without its constraints, and its earliest schedule."""
    loaded = load_plan(domain, problem, plan)
    return replace(loaded, constraints=()), earliest(loaded)


def allows(outer: ParametrizedPlan, inner: ParametrizedPlan) -> list[str]:
    """The constraints of `outer` that some schedule of `inner` breaks, at nominal values: none if it allows all."""
    network = Network(inner, inner.nominal)
    index = {point: i for i, point in enumerate(network.points)}
    broken = []
    for one in outer.constraints:
        for source, target, bound in ((one.source, one.target, one.upper), (one.target, one.source, one.lower)):
            if bound is None:
                continue
            sign = 1 if bound is one.upper and source == one.source else -1
            most = network.distances[index[source]][index[target]]
            limit = sign * bound.constant_term
            if most is None or Fraction(most, network.scale) > limit:
                broken.append(f"{target} - {source} <= {limit}")
    return broken
