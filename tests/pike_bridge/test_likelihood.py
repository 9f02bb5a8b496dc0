"""How likely people leave a correct execution: against enumerated trees, and journals as a source of tables."""

import json
import re
from dataclasses import replace
from fractions import Fraction
from itertools import count

import jsonschema
import pytest
from hypothesis import given, settings

from robust import pike
from robust.errors import InputError
from robust.pike_bridge.action_model import shipped
from robust.pike_bridge.builder import build, choose, k_intents, sequence, within
from robust.pike_bridge.files import SCHEMA_FILE, parse_tpnu, tpnu_text, validate
from robust.pike_bridge.likelihood import LikelyChoices, learnt, order_of_choices
from robust.pike_bridge.model import (
    Choice,
    Condition,
    Constraint,
    Effect,
    Event,
    Likelihood,
    Literal,
    TeamPlan,
    Tpnu,
    guard,
)
from robust.pike_bridge.online.progress import Chosen
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.online.service import Service, read_request
from robust.pike_bridge.semantics import ExecutionExistence, Oracle, OracleAnswer
from robust.plan.model import Atom
from robust.smt.limits import NEVER
from tests.pike_bridge import plans
from tests.sampling import often
from tests.schemas import schema


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
@settings(max_examples=often(60, 500))
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


@pytest.mark.parametrize("backend", ["pitms", "oracle"])
@pytest.mark.parametrize("wrong", [None, "1", "2"])
def test_what_is_known_may_depend_on_choices_of_the_team(backend, wrong):
    """x = 1 is half as likely if z = 1 as otherwise; success is certain, if need be by the other value of z."""
    moments = [{value: sequence() for value in "12"}, {value: sequence() for value in "12"}]
    if wrong is not None:
        moments[0][wrong] = within(sequence(sequence(), sequence()), upper=0)
    network = build("n", sequence(choose("z", moments[0]), choose("x", moments[1], controllable=False)))
    half, one = (
        tuple((value, Fraction(n, 2)) for value, n in zip("12", each, strict=True)) for each in ((1, 1), (2, 0))
    )
    table = (Likelihood(half, guard({"z": "1"})), Likelihood(one, guard({})))
    choices = tuple(each if each.name == "z" else replace(each, probability=table) for each in network.choices)
    plan = TeamPlan(replace(network, choices=choices), (), ())
    found = pike.chance(plan, backend=backend, assume={"x": "1"})
    assert found.success == found.hasty == pike.ChanceBounds(Fraction(1), Fraction(1))


def assert_intents_add_up(result):
    """Values of one choice are as likely as success and all else together."""
    for name in {intent.choice for intent in result.intents}:
        own = [intent for intent in result.intents if intent.choice == name]
        assert sum(intent.probability for intent in own) == 1
        parts = (intent.probability * intent.success.lower for intent in own if intent.success is not None)
        assert sum(parts) == result.success.lower


def text_of(probability, **changes):
    """A file with two choices of people and one of the team; y has the probabilities, or what is changed has them."""
    choices = [
        {"name": "x", "domain": ["1", "2"], "controllable": False, "at": "a"},
        {"name": "y", "domain": ["1", "2"], "controllable": False, "at": "b", "probability": probability},
        {"name": "z", "domain": ["1", "2"], "controllable": True, "at": "b"},
    ]
    for choice in choices:
        choice.update(changes.get(choice["name"], {}))
    events = [{"name": "a"}, {"name": "b"}]
    constraints = [{"from": "a", "to": "b", "lower": 1, "upper": None}]
    whole = {"choices": choices, "events": events, "constraints": constraints}
    return json.dumps({"format": "tpnu/1", "name": "n", "domain": "d.pddl", "problem": "p.pddl", **whole})


CONDITIONAL = [{"guard": {"x": "1"}, "values": {"1": "1/3", "2": "2/3"}}, {"values": {"1": 0.25, "2": 0.75}}]


@pytest.mark.parametrize("probability", [{"1": 0.7, "2": 0.3}, CONDITIONAL])
def test_tables_are_read_as_they_are_written(probability):
    network = parse_tpnu(text_of(probability)).network
    assert network.choices[1].probability[-1].guard == guard({})
    assert parse_tpnu(tpnu_text(network, domain="d.pddl", problem="p.pddl")).network == network
    jsonschema.validate(json.loads(text_of(probability)), json.loads(SCHEMA_FILE.read_text()))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            text_of({"1": 0.7, "2": 0.2}),
            "found probabilities 0.7, 0.2, expected numbers of at least 0 that add up to 1",
        ),
        (text_of({"1": 1.5, "2": -0.5}), "expected numbers of at least 0 that add up to 1"),
        (text_of({"1": 1}), "found probabilities of 1, expected one for each of 1, 2"),
        (text_of({"1": "half", "2": 0.5}), "found 'half', expected a number"),
        (text_of([]), "expected at least one table of probabilities"),
        (text_of(0.5), "expected probabilities by value"),
        (text_of(CONDITIONAL[:1]), "found no last row without guard, expected one"),
        (text_of([CONDITIONAL[1], CONDITIONAL[1]]), "found no last row without guard, expected one"),
        (text_of([{"guard": {"w": "1"}, "values": {"1": 1, "2": 0}}, CONDITIONAL[1]]), "found choice 'w'"),
        (text_of({"1": 1, "2": 0}, y={"controllable": True}), "expected none: the executive decides it"),
    ],
)
def test_wrong_tables_are_refused_with_their_place(text, message):
    with pytest.raises(InputError, match=re.escape(message)) as refused:
        validate(parse_tpnu(text, "plan.tpnu.json").network)
    assert refused.value


def test_tables_that_depend_on_each_other_are_refused():
    table = [{"guard": {"y": "1"}, "values": {"1": 1, "2": 0}}, {"values": {"1": 0.5, "2": 0.5}}]
    network = parse_tpnu(text_of(CONDITIONAL, x={"probability": table})).network
    with pytest.raises(InputError, match="probabilities that depend on each other: x, y"):
        order_of_choices(TeamPlan(network, (), ()))


def test_what_is_learnt_are_smoothed_shares():
    plan = k_intents((2,), 0).instance.plan()
    (mine,) = (choice for choice in plan.network.choices if not choice.controllable)
    first, second = mine.domain
    known = learnt(plan, [{mine.name: first}] * 6 + [{mine.name: second}] * 2 + [{}])
    (choice,) = (choice for choice in known.network.choices if not choice.controllable)
    assert choice.probability == (Likelihood(((first, Fraction(7, 10)), (second, Fraction(3, 10)))),)
    assert learnt(plan, [{}]) == plan
    for wrong in ({mine.name: "nothing"}, {"nowhere": first}):
        with pytest.raises(InputError, match=r"expected one of 1, 2|unknown choice .nowhere"):
            learnt(plan, [wrong])


def test_probabilities_are_learnt_from_journals(tmp_path):
    """What was observed in one execution counts, and the journal of a plan is one of the plan with probabilities."""
    plan = shipped("wing").plan()
    record = pike.run(plan, seed=1)
    with pike.Journal(tmp_path / "run.jsonl", plan) as journal:
        for step in record.steps:
            journal.write(pike.JournalStep(step.time, step.messages, step.decisions))
    result = pike.chance(plan, learn=tmp_path / "run.jsonl")
    assert not result.uniform
    expected = {(name, value): Fraction(1 + (record.choices[name] == value), 4) for name in ("h1", "h2") for value in H}
    assert {(each.choice, each.value): each.probability for each in result.intents} == expected


H = ("pliers", "cleco", "both")


def one_or_the_other(mine):
    """The team chooses what it supports, people choose what they need afterwards; 1 suits the second and third."""
    choices = (
        Choice("team", ("1", "2"), True, "a"),
        Choice("people", ("1", "2", "3"), False, "b", (Likelihood(mine),)),
    )
    events = (Event("a"), Event("b"), *(Event(f"c{value}", guard({"people": value})) for value in "123"))
    bounds = [Constraint("a", "b", Fraction(1), None)]
    bounds += [Constraint("b", f"c{value}", Fraction(1), None, guard({"people": value})) for value in "123"]
    made = {"1": "23", "2": "1"}
    effects = [
        Effect(Literal(Atom(f"ready{need}")), "a", guard({"team": value}), None)
        for value in made
        for need in made[value]
    ]
    needs = [
        Condition(Literal(Atom(f"ready{value}")), f"c{value}", f"c{value}", guard({"people": value}), None)
        for value in "123"
    ]
    return TeamPlan(Tpnu("one or the other", choices, events, tuple(bounds), ()), tuple(needs), tuple(effects))


@pytest.mark.parametrize(
    ("wanted", "choice"), [(Fraction(1), "2"), (Fraction(6, 10), "2"), (Fraction(3, 10), "1"), (Fraction(0), "1")]
)
def test_the_team_chooses_by_what_is_likely(wanted, choice):
    """2 succeeds with probability 0.6, 1 with 0.4 but with more of what people may choose."""
    plan = one_or_the_other((("1", Fraction(6, 10)), ("2", Fraction(3, 10)), ("3", Fraction(1, 10))))
    record = pike.run(plan, chance=wanted, patience="eager", budget=None, seed=0, human="likely")
    assert record.choices["team"] == choice
    expected = Fraction(6, 10) if choice == "2" else Fraction(4, 10)
    chosen = next(step for step in record.steps if any(isinstance(each, Chosen) for each in step.decisions))
    assert chosen.success.lower == expected
    assert pike.chance(plan, assume={"team": choice}).success.lower == expected


def test_chances_are_told_while_a_plan_runs():
    """By a question to the service, with the schema of its answers; without --chance it does not know."""
    plan = one_or_the_other((("1", Fraction(6, 10)), ("2", Fraction(3, 10)), ("3", Fraction(1, 10))))
    likely = LikelyChoices(plan, Fraction(1), deadline=NEVER)
    for chances, success in ((likely, "3/5"), (None, None)):
        executive = pike.PlanExecutive(plan, SemanticReasoner, preference=chances, patience=None)
        service = Service(executive, likely=chances)
        list(service.step(Fraction(0), ()))
        request = read_request(b'{"kind": "chance"}', 1, plan, timed=True)
        (answer,) = service.answer(request)
        jsonschema.validate(answer, schema("robust/pike-stdio/1"))
        assert answer["success"] == success
        assert answer["intents"] == ({"people": {"1": "3/5", "2": "3/10", "3": "1/10"}} if chances else {})


def test_people_choose_by_their_tables():
    plan = one_or_the_other((("1", Fraction(0)), ("2", Fraction(0)), ("3", Fraction(1))))
    assert {pike.run(plan, human="likely", seed=seed).choices["people"] for seed in range(5)} == {"3"}


def test_an_interrupted_oracle_leaves_bounds(monkeypatch):
    """What was not decided in time is open, and the exact chance lies within."""
    plan = shipped("wing").plan()
    exact, decide, asked = pike.chance(plan), Oracle.decide, count()

    def impatient(oracle, *args, **options):
        return decide(oracle, *args, **options) if next(asked) < 6 else OracleAnswer(ExecutionExistence.UNKNOWN)

    monkeypatch.setattr(Oracle, "decide", impatient)
    result = pike.chance(plan, backend="oracle")
    assert result.status == "timeout"
    assert result.success.lower <= exact.success.lower <= result.success.upper
    assert result.hasty.lower <= exact.hasty.lower <= result.hasty.upper


def test_many_scenarios_need_no_enumeration():
    """2¹⁶ scenarios; the diagrams of the πTMS have few nodes."""
    plan = k_intents((2,) * 16, 3).instance.plan()
    result = pike.chance(plan)
    assert result.status == "complete"
    assert result.success == (1, 1)
    guessed = {f"x{number}": plan.network.domains[f"x{number}"][0] for number in (1, 2, 3)}
    assert pike.chance(plan, assume=guessed).success == (Fraction(1, 8), Fraction(1, 8))


def test_what_is_unlikely_is_not_said_to_be_impossible():
    """Nor what is likely to be certain."""
    rare = Fraction(1, 10**6)
    text = str(pike.chance(one_or_the_other((("1", rare), ("2", 1 - rare), ("3", Fraction(0))))))
    assert text.startswith("Success is more than 99.99% likely.")
    for value, share in (("1", "less than 0.01%"), ("2", "more than 99.99%"), ("3", "0.00%")):
        assert re.search(f"people = {value} +{share} ", text)
