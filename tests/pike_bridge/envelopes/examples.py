"""Plans with parameters, and which choices the oracle allows when it is told the values of the parameters."""

import random
from fractions import Fraction

from benchmarks.generators.team_plans import Shape
from benchmarks.generators.team_plans import random_plan as structured_plan
from robust.pike_bridge.envelopes.parameters import TeamParameterKind as Kind
from robust.pike_bridge.envelopes.parameters import TeamParameterSpec, parametrize, specifications
from robust.pike_bridge.model import guard
from robust.pike_bridge.semantics import Oracle
from tests.pike_bridge.online.examples import exists

SMALL = Shape(top=3, squeeze=Fraction(0), threat_share=0.1, producer_share=0.8, inner_share=0.6)


def seeded(seed):
    """Draws that are always the same."""
    return random.Random(seed)  # noqa: S311


def parametric(plan, *texts):
    return parametrize(plan, specifications(texts, None))


def random_parameters(plan, seed):
    """A structured or any other plan with parameters for random bounds, of random kinds."""
    draw, network, specs = seeded(f"parameters/{seed}"), plan.network, []
    for at in draw.sample(range(len(network.activities)), min(2, len(network.activities))):
        kind = draw.choice([Kind.DURATION, Kind.DURATION, Kind.AT_LEAST, Kind.AT_MOST])
        attributes = {"default": network.activities[at].lower} if kind is Kind.AT_MOST else {}
        specs.append(TeamParameterSpec(kind, network.activities[at].action, f"g{at}", attributes))
    bounded = [each for each in network.constraints if each.upper is not None]
    if bounded and draw.random() < 0.7:
        limit = draw.choice(bounded)
        specs.append(
            TeamParameterSpec(Kind.AT_MOST, f"{limit.source}:{limit.target}", "limit", {"default": limit.upper})
        )
    choices = [each for each in network.choices if each.event is not None]
    if choices and draw.random() < 0.3:
        choice = draw.choice(choices)
        lowest = [each.lower for each in network.constraints if each.target == choice.event]
        if any(lower is not None and lower >= 0 for lower in lowest):
            specs.append(TeamParameterSpec(Kind.HESITATION, choice.name, "late"))
    return parametrize(plan, specs)


def structured(seed, epsilon=Fraction(1, 1000)):
    return structured_plan(seed, 0, SMALL).plan(epsilon)


def random_values(plan, draw):
    """Values around the nominal ones, on a grid that bounds are on, too, within the declared bounds."""
    values = {}
    for parameter in plan.declared:
        value = parameter.nominal + Fraction(draw.randint(-24, 32), draw.choice([1, 2, 4]))
        values[parameter.name] = value if parameter.lower is None else max(parameter.lower, value)
    return values


def compare_with_oracle(region, values, draw, most=8):
    """Held against the oracle, which is told the values: how many of the assignments asked about are possible.

    Of each combination that the region tells apart one full assignment to the key is asked about, of many some.
    """
    domains, possible = region.plan.plan.network.domains, set(region.possible(values))
    asked = region.combinations
    asked = draw.sample(asked, most) if len(asked) > most else asked
    oracle, count = Oracle(region.plan.at(values)), 0
    for each in asked:
        assignment = guard({name: draw.choice(domains[name]) for name in region.key} | dict(each.choices))
        answer = exists(oracle.decide(assignment))
        assert answer == (each.choices in possible), (assignment, values)
        count += answer
    return count
