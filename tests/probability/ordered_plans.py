"""Plans of actions that wait for each other, and when they end, said again without any code of the package."""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from random import Random

import numpy as np

from robust.execute.convert import Settings, convert
from robust.plan.model import ParametrizedPlan
from robust.plan.parameters import parse_specs
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.timed import parse_timed_plan

APART = Fraction(1, 1000)


@dataclass(frozen=True)
class OrderedPlan:
    """`before[i]` are the actions whose ends action i waits for."""

    plan: ParametrizedPlan
    planned: Sequence[int]
    before: Sequence[Sequence[int]]
    latest: Fraction

    @property
    def names(self) -> list[str]:
        """The parameters in the order of actions."""
        identifiers = {step.action: step.identifier for step in self.plan.instances}
        return [f"dur_{identifiers[f'a{number}']}" for number in range(len(self.planned))]

    def ends(self, lengths):
        """When actions end that start as soon as they may; exact numbers, or arrays of them."""
        ends = []
        for number, waits in enumerate(self.before):
            start = lengths[number] * 0
            for other in waits:
                start = later(start, ends[other] + (APART if isinstance(start, Fraction) else 0.001))
            ends.append(start + lengths[number])
        return ends


def later(first, second):
    return max(first, second) if isinstance(first, Fraction) else np.maximum(first, second)


def ordered_plan(random: Random, count: int, *, width: int = 3, late: str = "+8%") -> OrderedPlan:
    """Actions that wait for up to three of the `width` before them, and a time by which all must end."""
    planned = [random.randint(3, 20) for _ in range(count)]
    before = []
    for number in range(count):
        near = list(range(max(0, number - width), number))
        before.append(sorted(random.sample(near, min(len(near), random.choice((0, 1, 1, 2, 2, 3))))))
    actions = "".join(
        f"(:durative-action a{number} :parameters () :duration (= ?duration {planned[number]}) :condition (and "
        f"(at start (ready)){''.join(f' (at start (done{other}))' for other in before[number])}) "
        f":effect (and (at end (done{number}))))\n"
        for number in range(count)
    )
    atoms = " ".join(f"(done{number})" for number in range(count))
    domain = parse_domain(
        f"(define (domain d) (:requirements :durative-actions) (:predicates (ready) {atoms})\n{actions})"
    )
    problem = parse_problem(f"(define (problem p) (:domain d) (:init (ready)) (:goal (and {atoms})))", domain)
    ordered = OrderedPlan(None, planned, before, Fraction(0))  # type: ignore[arg-type]
    ends = ordered.ends([Fraction(length) for length in planned])
    lines = [
        f"{float(end - length):.3f}: (a{n}) [{length}]"
        for n, (end, length) in enumerate(zip(ends, planned, strict=True))
    ]
    timed = parse_timed_plan("\n".join(lines))
    plan = convert(domain, problem, timed, Settings(specs=parse_specs(["duration:*"]), deadline=late)).plan
    latest = max(ends) * (1 + Fraction(late.strip("+%")) / 100)
    return OrderedPlan(plan, planned, before, latest)
