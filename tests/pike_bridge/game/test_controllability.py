"""Controllability of plans with choices: against minimax, against networks without choices, and by hand."""

import subprocess
import sys
from collections import Counter
from dataclasses import replace
from fractions import Fraction
from random import Random

import jsonschema
import pytest

from robust import pike
from robust.errors import InputError, UnsupportedError
from robust.network.uncertain import Stnu, UncertainLink, dynamic
from robust.pike_bridge.action_model import with_ends
from robust.pike_bridge.game.controllability import DecidingControllability
from robust.pike_bridge.game.deciding import ControllabilityVerdict
from robust.pike_bridge.game.rules import Game, GameRules
from robust.pike_bridge.model import INITIAL, Activity, Choice, Constraint, Event, TeamPlan, Tpnu, guard
from robust.pike_bridge.semantics import ExecutionExistence, Oracle
from robust.plan.model import ZERO, TimePoint, TimePointKind
from robust.smt.limits import Deadline
from tests.cli.running import command
from tests.pike_bridge.game.minimax import Minimax, TooLargeError, limited, longest, small_plan, tight_plan
from tests.sampling import often
from tests.schemas import schema

YES, NO = ControllabilityVerdict.CONTROLLABLE, ControllabilityVerdict.UNCONTROLLABLE
KITCHEN, WING = (f"robust/examples/{name}/{name}.tpnu.json" for name in ("kitchen", "wing"))


def bound(source, target, lower=0, upper=None, **given):
    lower, upper = (None if each is None else Fraction(each) for each in (lower, upper))
    return Constraint(source, target, lower, upper, guard(given))


def plan_of(events, choices, constraints, activities=()):
    labels = events if isinstance(events, dict) else {name: {} for name in events.split()}
    network = Tpnu(
        "by hand",
        tuple(Choice(name, ("a", "b"), ours, event) for name, ours, event in choices),
        tuple(Event(name, guard(label)) for name, label in labels.items()),
        tuple(constraints),
        tuple(activities),
    )
    return TeamPlan(with_ends(network, Fraction(0)), (), (), Fraction(1))


def work(source, target, lower, upper, agent="ann", **given):
    return Activity(f"(work {source})", source, target, Fraction(lower), Fraction(upper), agent, guard(given))


def decided(plan, **rules):
    return DecidingControllability(plan, GameRules(**rules)).run()


# -- against minimax ---------------------------------------------------------------------------------------------------


def least_limit(plan, free):
    """The least limit that no single situation with extreme lengths refutes; None if there is none."""
    for limit in range(1, longest(plan) + 1):
        game = Game(limited(plan, limit), GameRules(free))
        extremes = ([each.lower for _, each in game.contingent], [game.greatest(each) for _, each in game.contingent])
        oracles = [Oracle(game.fixed(lengths)) for lengths in extremes]
        if all(
            oracle.decide(case.values).verdict is ExecutionExistence.EXISTS
            for oracle in oracles
            for case in game.cases()
        ):
            return limit
    return None


def compared(seeds, wanted):
    """How often minimax and strategies say what, about so many plans; each verdict is the same."""
    table = Counter()
    for seed in seeds:
        random = Random(seed)  # noqa: S311 - reproducible
        plan = random.choice((small_plan, tight_plan))(random)
        agents = {each.agent for each in plan.network.activities}
        if len(plan.network.events) > 17 or not plan.network.choices or not agents:
            continue
        free = ("robot",) if random.random() < 0.3 and "robot" in agents else ()
        limit = random.randint(longest(plan) // 2, longest(plan))
        if random.random() < 0.6:
            limit = least_limit(plan, free) or limit
        plan = limited(plan, limit)
        try:
            truth = Minimax(plan, free, budget=3_000).controllable()
        except TooLargeError:
            continue
        answer = decided(plan, free=free)
        assert answer.verdict is (YES if truth else NO), (seed, limit, free, answer.reason)
        table[truth, min(len(answer.situations), 2)] += 1
        if sum(table.values()) == wanted:
            return table
    return table


def test_strategies_agree_with_minimax():
    table = compared(range(60), 10)
    assert table[True, 0]
    assert table[False, 1]


@pytest.mark.slow
@pytest.mark.parametrize("part", range(4))
def test_strategies_agree_with_minimax_on_many_plans(part):
    """1,000 plans."""
    table = compared(range(part * 10**6, (part + 1) * 10**6), 250)
    assert table[True, 0] > 20
    assert table[False, 1] > 20
    assert table[False, 2]


def test_rational_people_and_hesitation_agree_with_minimax():
    counts = Counter()
    for seed in range(often(150, 1500)):
        random = Random(f"people/{seed}")  # noqa: S311 - reproducible
        plan = small_plan(random)
        people = [each for each in plan.network.choices if not each.controllable]
        if len(plan.network.events) > 14 or len(people) != 1 or not plan.network.activities:
            continue
        plan = limited(plan, random.randint(2, longest(plan)))
        [choice] = people
        possible = [{choice.name: value} for value in choice.domain if _possible(plan, guard({choice.name: value}))]
        asking = Activity(
            "(ask)", "ask", choice.event, Fraction(0), Fraction(1), None, plan.network.guards[choice.event]
        )
        asked = replace(
            plan.network,
            events=(*plan.network.events, Event("ask", asking.guard)),
            activities=(*plan.network.activities, asking),
            constraints=(*plan.network.constraints, *_known_when_asked(plan, asking)),
        )
        try:
            rational = bool(possible) and Minimax(plan, kept=possible).controllable()
            hesitant = Minimax(replace(plan, network=asked)).controllable()
        except TooLargeError:
            continue
        assert decided(plan, rational=True).verdict is (YES if rational else NO), seed
        assert decided(plan, hesitate=Fraction(1)).verdict is (YES if hesitant else NO), seed
        counts[rational, hesitant] += 1
    assert sum(counts.values()) >= 3


def _possible(plan, values):
    return Oracle(plan).decide(values).verdict is ExecutionExistence.EXISTS


def _known_when_asked(plan, asking):
    events = {choice.name: choice.event for choice in plan.network.choices}
    return [Constraint(events[name], "ask", Fraction(0), None, asking.guard) for name, _ in asking.guard]


def test_without_choices_it_is_controllability_of_networks():
    verdicts = Counter()
    for seed in range(often(60, 1000)):
        plan = _without_choices(Random(seed))  # noqa: S311 - reproducible
        links = [
            UncertainLink(_point(each.source), _point(each.target), each.lower, each.upper, contingent, each.target)
            for each, contingent in [
                *((each, False) for each in plan.network.constraints),
                *((each.duration, each.lower != each.upper) for each in plan.network.activities),
            ]
        ]
        points = [ZERO, *(_point(each.name) for each in plan.network.events if each.name != INITIAL)]
        expected = dynamic(Stnu(tuple(points), tuple(links))).is_controllable
        assert decided(plan).verdict is (YES if expected else NO), seed
        verdicts[expected] += 1
    assert min(verdicts.values()) >= 5


def _point(event):
    return ZERO if event == INITIAL else TimePoint(TimePointKind.INSTANT, event)


def _without_choices(random):
    """A few activities one after another or side by side, and windows between their starts and ends."""
    names = [f"s{at}" for at in range(4)]
    activities = [
        work(name, f"{name}.end", lower, lower + random.randint(0, 3))
        for name in names
        for lower in (random.randint(1, 3),)
    ]
    events = " ".join(name for each in activities for name in (each.source, each.target))
    constraints = []
    for _ in range(random.randint(2, 5)):
        one, other = random.sample(events.split(), 2)
        lower = random.randint(-2, 2)
        constraints.append(bound(one, other, lower, lower + random.randint(0, 5)))
    return plan_of(events, (), constraints, activities)


# -- by hand -----------------------------------------------------------------------------------------------------------


def _never(**given):
    return bound(INITIAL, "one", 6, **given), bound(INITIAL, "one", 0, 5, **given)


def matching(*constraints):
    """People choose h at `ask`, the executive chooses r at `act`, and both have to be the same."""
    apart = [bound(INITIAL, "ask", upper=5, h=one, r=other) for one, other in ("ab", "ba")]
    apart += [bound(INITIAL, "ask", 6, h=one, r=other) for one, other in ("ab", "ba")]
    return plan_of("ask act", [("h", False, "ask"), ("r", True, "act")], [*apart, *constraints])


def test_who_chooses_first_decides():
    assert decided(matching()).verdict is YES
    assert decided(matching(bound("ask", "act", 0, 0))).verdict is YES
    refuted = decided(matching(bound("act", "ask", 1)))
    assert refuted.verdict is NO
    assert {each.values for each in refuted.situations} == {guard({"h": "a"}), guard({"h": "b"})}


def test_no_two_choices_at_one_moment_justify_each_other():
    """Each of two robots has to choose what the person chose whom the other one asks."""
    choices = [("h", False, "one"), ("g", False, "two"), ("r", True, "one"), ("s", True, "two")]
    wrong = [{"g": "a", "r": "b"}, {"g": "b", "r": "a"}, {"h": "a", "s": "b"}, {"h": "b", "s": "a"}]
    never = [each for label in wrong for each in _never(**label)]
    assert decided(plan_of("one two", choices, [*never, bound("one", "two", 0, 0)])).verdict is NO
    once = [each for each in never if not {"g", "r"} <= {name for name, _ in each.guard}]
    assert decided(plan_of("one two", choices, [*once, bound("one", "two", 0, 0)])).verdict is YES


def depending(least, most, low=1):
    """If work takes at most 2, a is right; if it takes `least` or more, b is."""
    constraints = [
        bound(INITIAL, "begin", 0, 0),
        bound("end", "choose", 0, 0),
        bound("begin", "end", 0, 2, r="a"),
        bound("begin", "end", least, None, r="b"),
    ]
    return plan_of("begin end choose", [("r", True, "choose")], constraints, [work("begin", "end", low, most)])


def test_a_choice_can_depend_on_a_length():
    found = decided(depending(2, 4))
    assert found.verdict is YES
    assert {branch.case.spans[0] for branch in found.strategy.parts[0].policy.branches} == {(1, 2), (2, 4)}
    assert {branch.scenario["r"] for branch in found.strategy.parts[0].policy.branches} == {"a", "b"}
    assert decided(depending(3, 4)).verdict is NO
    assert decided(depending(4, 4, low=2)).verdict is NO


def test_two_contingent_ends_at_one_event_cannot_both_be_served():
    activities = [work("one", "end", 1, 2), work("two", "end", 1, 2)]
    assert decided(plan_of("one two end", (), (), activities)).verdict is NO
    assert decided(plan_of("one two end", (), (), activities), free=("ann",)).verdict is YES
    either = plan_of(
        {"choose": {}, "one": {"r": "a"}, "two": {"r": "b"}, "first": {"r": "a"}, "second": {"r": "b"}},
        [("r", True, "choose")],
        (),
        [work("one", "first", 1, 2, r="a"), work("two", "second", 1, 2, r="b")],
    )
    assert decided(either).verdict is YES


def test_plans_outside_of_the_game_are_unknown_and_say_why():
    nowhere = replace(matching(), network=replace(matching().network, choices=(Choice("h", ("a", "b"), False, None),)))
    found = decided(nowhere)
    assert found.verdict is ControllabilityVerdict.UNKNOWN
    assert "choice h is made at no event" in found.reason
    with pytest.raises(UnsupportedError, match="can happen without it"):
        Game(
            plan_of({"x": {}, "s": {"r": "a"}, "e": {}}, [("r", True, "x")], (), [work("s", "e", 1, 2, r="a")]),
            GameRules(),
        )


# -- the stories -------------------------------------------------------------------------------------------------------


def test_the_kitchen_is_not_and_says_why():
    found = pike.controllable(KITCHEN)
    assert found.verdict is NO
    [situation] = found.situations
    assert situation.values == guard({"xA1": "mug", "xA2": "juice"})
    assert "with xA1 = mug, xA2 = juice, even if" in str(found)
    jsonschema.validate(found.as_dict(), schema("robust/pike-controllable/1"))


def test_the_kitchen_with_rational_people_needs_a_longer_limit():
    found = pike.controllable(KITCHEN, ["limit=at-most:e1:e44"], rational=True)
    [limit] = found.limits
    assert (limit.holds, limit.fails) == (Fraction("14.517"), Fraction("14.516"))
    assert "limit: 14.517 is enough; 14.516 is not enough." in str(found)


def test_the_wing_is_and_says_what_is_chosen():
    found = pike.controllable(WING)
    assert found.verdict is YES
    assert "if h2 = pliers: b2 = cleco" in str(found)
    jsonschema.validate(found.as_dict(), schema("robust/pike-controllable/1"))
    assert pike.controllable(WING, hesitate=5, free="baxter").verdict is YES
    assert pike.controllable(WING, assume={"b1": "cleco"}).verdict is NO


@pytest.mark.parametrize(
    ("options", "place", "message"),
    [
        ({"parameters": "coffee=duration:make-coffee"}, "--parameter", "found duration as coffee, expected at-least"),
        ({"free": "bob"}, "--free", "found unknown agent 'bob', expected one of the plan"),
        ({"repair": True}, "--repair", "found no parameters, expected bounds that may change"),
    ],
)
def test_what_does_not_fit_the_plan_is_called_as_it_was_given(options, place, message):
    (name, value), *_ = options.items()
    with pytest.raises(InputError, match=f"^{name}: {message}"):
        pike.controllable(KITCHEN, **options)
    typed = [place] if value is True else [place, value]
    assert f"error: {place}: {message}" in command("pike", "check", KITCHEN, "--controllable", *typed).err


def test_limits_of_contingent_lengths_go_the_other_way():
    plan = pike.parametrize(depending(3, 4), pike_specs("most=at-most:(work begin)"))
    found = pike.controllable(plan)
    [most] = found.limits
    assert (most.least, most.holds, most.fails) == (False, 2, 3)
    assert "most may be at most 2; 3 is too much." in str(found)


def pike_specs(*texts):
    from robust.pike_bridge.envelopes.parameters import specifications  # noqa: PLC0415 - here only

    return specifications(texts, None, ())


def test_out_of_time_is_unknown():
    found = DecidingControllability(depending(2, 4), GameRules(), deadline=Deadline.after(0)).run()
    assert (found.verdict, found.status) == (ControllabilityVerdict.UNKNOWN, "timeout")


@pytest.mark.parametrize(
    ("options", "code", "words"),
    [
        ([KITCHEN, "--controllable"], 1, "Not controllable: no correct execution exists with xA1 = mug, xA2 = juice"),
        ([WING, "--rational"], 2, "needs --controllable"),
        ([WING, "--controllable", "--patience"], 2, "cannot be combined with --patience; choose one"),
        ([WING, "--controllable", "--free", "bxter"], 2, "did you mean"),
    ],
)
def test_the_command_says_so_and_exits_with_the_verdict(options, code, words):
    done = subprocess.run(
        [sys.executable, "-m", "robust", "pike", "check", *options], capture_output=True, text=True, check=False
    )
    assert done.returncode == code
    assert words in done.stdout + done.stderr
