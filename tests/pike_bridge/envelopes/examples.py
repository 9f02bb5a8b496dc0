"""Plans with parameters, and which choices the oracle allows when it is told the values of the parameters."""

import random
from dataclasses import replace
from fractions import Fraction

from benchmarks.generators.team_plans import Shape
from benchmarks.generators.team_plans import random_plan as structured_plan
from robust.pike_bridge.envelopes.parameters import TeamParameterKind, TeamParameterSpec, parametrize, specifications
from robust.pike_bridge.model import guard
from robust.pike_bridge.semantics import ExecutionExistence, Oracle

SMALL = Shape(top=3, squeeze=Fraction(0), threat_share=0.1, producer_share=0.8, inner_share=0.6)


def seeded(seed):
    """Draws that are always the same."""
    return random.Random(seed)  # noqa: S311


def parametric(plan, *texts):
    return parametrize(plan, specifications(texts, None))


def random_parameters(plan, seed, count=2):
    """A structured or any other plan with parameters for random bounds, of random kinds."""
    draw = seeded(f"parameters/{seed}")
    network = plan.network
    specs = []
    for at in draw.sample(range(len(network.activities)), min(count, len(network.activities))):
        kind = draw.choice(
            [
                TeamParameterKind.DURATION,
                TeamParameterKind.DURATION,
                TeamParameterKind.AT_LEAST,
                TeamParameterKind.AT_MOST,
            ]
        )
        attributes = {"default": network.activities[at].lower} if kind is TeamParameterKind.AT_MOST else {}
        specs.append(TeamParameterSpec(kind, network.activities[at].action, f"g{at}", attributes))
    bounded = [one for one in network.constraints if one.upper is not None]
    if bounded and draw.random() < 0.7:
        one = draw.choice(bounded)
        attributes = {"default": one.upper}
        specs.append(TeamParameterSpec(TeamParameterKind.AT_MOST, f"{one.source}:{one.target}", "limit", attributes))
    chosen = [one.name for one in network.choices if one.event is not None]
    if chosen and draw.random() < 0.3:
        name = draw.choice(chosen)
        event = next(one.event for one in network.choices if one.name == name)
        if any(one.target == event and one.lower is not None and one.lower >= 0 for one in network.constraints):
            specs.append(TeamParameterSpec(TeamParameterKind.HESITATION, name, "late"))
    return parametrize(plan, specs)


def structured(seed, epsilon=Fraction(1, 1000)):
    return structured_plan(seed, 0, SMALL).plan(epsilon)


def random_values(plan, draw):
    """Values around the nominal ones, on a grid that bounds are on, too, within the declared bounds."""
    values = {}
    for one in plan.declared:
        value = one.nominal + Fraction(draw.randint(-24, 32), draw.choice([1, 2, 4]))
        values[one.name] = value if one.lower is None else max(one.lower, value)
    return values


def disagreements(region, values, draw, most=8):
    """Full assignments to the key about which the oracle, told the values, differs from the region; and how many
    assignments were asked about, and how many of them are possible.

    Of each combination that the region tells apart one assignment is asked about, of many combinations some.
    """
    domains = region.plan.plan.network.domains
    possible = set(region.possible(values))
    asked = region.combinations
    asked = draw.sample(asked, most) if len(asked) > most else asked
    oracle = Oracle(region.plan.at(values))
    wrong, found = [], 0
    for each in asked:
        assignment = guard({name: draw.choice(domains[name]) for name in region.key} | dict(each.choices))
        exists = oracle.decide(assignment).verdict is ExecutionExistence.EXISTS
        found += exists
        if exists != (each.choices in possible):
            wrong.append((assignment, values))
    return wrong, len(asked), found


def strict(plan):
    return replace(plan, epsilon=Fraction(0))
