"""How likely people leave a correct execution: against enumerated trees, and journals as a source of tables."""

from dataclasses import replace
from fractions import Fraction
from itertools import product

import pytest
from hypothesis import given, settings

from robust import pike
from robust.errors import InputError
from robust.pike_bridge.action_model import shipped
from robust.pike_bridge.builder import k_intents
from robust.pike_bridge.files import parse_tpnu, tpnu_text
from robust.pike_bridge.likelihood import learnt, order_of_choices
from robust.pike_bridge.model import Likelihood, guard
from robust.pike_bridge.semantics import Oracle
from tests.pike_bridge import plans
from tests.sampling import often

HALF = Fraction(1, 2)


def with_tables(plan, random):
    """The plan with random tables, which are about choices that are listed before."""
    choices = []
    for choice in plan.network.choices:
        tables = ()
        if not choice.controllable and random.random() < 0.8:
            known = [guard({each.name: random.choice(each.domain)}) for each in choices if random.random() < 0.5]
            tables = tuple(Likelihood(shares(choice.domain, random), label) for label in [*known, guard({})])
        choices.append(replace(choice, probability=tables))
    return replace(plan, network=replace(plan.network, choices=tuple(choices)))


def shares(domain, random):
    weights = [random.randint(0, 3) for _ in domain]
    weights[random.randrange(len(domain))] += 1
    return tuple((value, Fraction(weight, sum(weights))) for value, weight in zip(domain, weights, strict=True))


def enumerated(order, correct, known, decided=None):
    """How likely what is known is, and that with success, by listing every branch of the tree."""
    decided = decided or {}
    if len(decided) == len(order):
        return 1, int(guard(decided) in correct)
    choice = order[len(decided)]
    ahead = {
        value: enumerated(order, correct, known, {**decided, choice.name: value})
        for value in ([known[choice.name]] if choice.name in known else choice.domain)
    }
    if choice.controllable:
        return max(ahead.values(), key=lambda pair: pair[1] / pair[0] if pair[0] else 0)
    rows = [row for row in choice.probability if all(decided[name] == value for name, value in row.guard)]
    table = dict(rows[0].values) if rows else dict.fromkeys(choice.domain, Fraction(1, len(choice.domain)))
    weights = {value: table[value] or int(choice.name in known) for value in ahead}
    return tuple(sum(weights[value] * ahead[value][side] for value in ahead) for side in (0, 1))


@given(plans.seeds)
@settings(max_examples=often(25, 500))
def test_chances_are_those_of_enumerated_trees(random):
    plan = with_tables(plans.random_plan(random), random)
    network = plan.network
    known = {each.name: random.choice(each.domain) for each in network.choices if random.random() < 0.25}
    correct = {guard(execution.scenario) for execution in Oracle(plan).scenarios(guard(known))}
    results = [pike.chance(plan, backend=backend, assume=known) for backend in ("pitms", "oracle")]
    for result in results:
        for people_first, bounds in ((True, result.success), (False, result.hasty)):
            likely, success = enumerated(order_of_choices(plan, people_first=people_first), correct, known)
            assert bounds.lower == bounds.upper == (success / likely if likely else 0)
        assert_intents_add_up(result)
    assert replace(results[0], backend="oracle") == results[1]


def assert_intents_add_up(result):
    """Values of one choice are as likely as success and all else together."""
    for name in {intent.choice for intent in result.intents}:
        own = [intent for intent in result.intents if intent.choice == name]
        assert sum(intent.probability for intent in own) == 1
        parts = (intent.probability * intent.success.lower for intent in own if intent.success is not None)
        assert sum(parts) == result.success.lower
