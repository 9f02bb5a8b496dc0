"""Plans that are cut at joins: against the same plans as one, against minimax, and large ones."""

from collections import Counter
from dataclasses import replace
from fractions import Fraction
from random import Random

import pytest

from benchmarks.generators.team_plans import blocks
from robust.pike_bridge import builder
from robust.pike_bridge.action_model import with_ends
from robust.pike_bridge.game.controllability import DecidingControllability
from robust.pike_bridge.game.deciding import ControllabilityVerdict
from robust.pike_bridge.game.dividing import GameParts
from robust.pike_bridge.game.rules import Game, GameRules
from robust.pike_bridge.model import (
    ALWAYS,
    INITIAL,
    Condition,
    Constraint,
    Effect,
    Literal,
    TeamPlan,
    contradicts,
    guard,
)
from robust.pike_bridge.semantics import ExecutionExistence, Oracle
from robust.plan.model import Atom
from robust.show.pike_games import headline
from robust.smt.limits import Deadline
from tests.pike_bridge.game.minimax import PLACEHOLDER, Minimax, TooLargeError, limited, longest
from tests.pike_bridge.game.test_controllability import NO, YES, decided


def chained(random):
    """Two or three steps with joins between them, windows and values that do not go together within a step."""
    names = iter("uvw")

    def step(depth=0):
        kind = random.choices(("act", "choose", "parallel"), (0.3, 0.5, 0.3) if depth == 0 else (1, 0, 0))[0]
        if kind == "choose" and (name := next(names, None)) is not None:
            return builder.choose(name, {value: step(1) for value in "ab"}, controllable=random.random() < 0.4)
        if kind == "parallel":
            return builder.parallel(step(1), step(1))
        lower = random.choice((1, 1, 2))
        return builder.act("(do)", lower, lower + random.choice((0, 1, 2)), agent=random.choice(("ann", "robot")))

    whole = builder.within(builder.sequence(*(step() for _ in range(random.choice((2, 2, 3))))), upper=PLACEHOLDER)
    network = with_ends(builder.build("chained", whole, epsilon=1), Fraction(0))
    windows = []
    for _ in range(random.choice((0, 0, 1, 2))):
        one, other = random.sample(network.events, 2)
        if not contradicts(one.guard, other.guard):
            least = random.choice((None, None, Fraction(1), Fraction(3)))
            most = random.choice((None, (least or 0) + random.randint(1, 6)))
            windows.append(Constraint(one.name, other.name, least, most, one.guard | other.guard))
    network = replace(network, constraints=(*network.constraints, *windows))
    return TeamPlan(network, (), (), Fraction(1))


def as_one(plan, **rules):
    deciding = DecidingControllability(plan, GameRules(**rules), deadline=Deadline.after(60))
    game = Game(plan, deciding.rules)
    deciding._decide(game, GameParts(game, apart=False))
    return deciding._known


def compared(seeds, wanted):
    """How often what is said, in how many parts; each verdict is that of the plan as one, and of minimax."""
    table = Counter()
    for seed in seeds:
        random = Random(f"chain/{seed}")  # noqa: S311 - reproducible
        plan = chained(random)
        if not plan.network.choices:
            continue
        rational = random.random() < 0.3
        free = ("robot",) if random.random() < 0.3 and any(a.agent == "robot" for a in plan.network.activities) else ()
        hard = longest(plan) + len(plan.network.events) // 2
        plan = limited(plan, random.randint(hard // 2, hard))
        answer, whole = decided(plan, rational=rational, free=free), as_one(plan, rational=rational, free=free)
        if ControllabilityVerdict.UNKNOWN in {answer.verdict, whole.verdict}:
            table["unknown"] += 1
            continue
        assert answer.verdict is whole.verdict, seed
        if answer.exceeded is not None:
            assert answer.exceeded.needed > answer.exceeded.limit
            _confirm(plan, answer)
        if not rational:
            try:
                truth = Minimax(plan, free, budget=3_000).controllable()
                assert answer.verdict is (YES if truth else NO), seed
                table["minimax"] += 1
            except TooLargeError:
                table["too large"] += 1
        table[answer.verdict, answer.exceeded is not None, answer.parts > 1] += 1
        if sum(count for key, count in table.items() if isinstance(key, tuple)) == wanted:
            break
    return table


def _confirm(plan, answer):
    """A single situation has no correct execution of the whole plan, as the oracle says."""
    for situation in answer.situations:
        network = plan.network
        lengths = {each.source: length for each, length in situation.lengths.items()}
        fixed = [
            replace(each, lower=lengths[each.source], upper=lengths[each.source]) if each.source in lengths else each
            for each in network.activities
        ]
        oracle = Oracle(replace(plan, network=replace(network, activities=tuple(fixed))))
        assert oracle.decide(situation.values).verdict is ExecutionExistence.NONE


def test_parts_say_what_the_whole_says():
    table = compared(range(60), 20)
    assert table[YES, False, True]
    assert table[NO, True, True]
    assert table["minimax"]


@pytest.mark.slow
@pytest.mark.parametrize("part", range(4))
def test_parts_say_what_the_whole_says_of_many_plans(part):
    """1,000 plans."""
    table = compared(range(part * 10**6, (part + 1) * 10**6), 250)
    assert table["minimax"] > 100


def _blocks(count, slack):
    return blocks(count, slack=Fraction(slack)).plan()


def test_blocks_are_decided_block_by_block():
    found = decided(_blocks(2, "1.01"), rational=True)
    assert found.verdict is YES
    assert found.parts == len(found.strategy.parts) == 4
    assert "if x2 = 3: z2 = 3" in str(found)


def test_blocks_that_take_too_long_together_say_which_and_why():
    plan = _blocks(2, 1)
    found = decided(plan, rational=True)
    assert found.verdict is NO
    assert (found.exceeded.limit, found.exceeded.needed) == (24, Fraction("24.017"))
    _confirm(plan, found)
    text = "e36 to e72 takes 12.009 with x2 = 3, where (bring-2-3) takes 5 and (use-2-3) takes 5"
    assert text in str(found)
    assert next(headline(found)).endswith(".")  # where it is all that is shown
    assert "there is no correct execution at all" in str(decided(_blocks(2, "0.4"), rational=True))


@pytest.mark.slow
@pytest.mark.parametrize("count", [4, 8, 16])
def test_large_plans_are_decided(count):
    assert decided(_blocks(count, "1.01"), rational=True).verdict is YES
    plan = _blocks(count, 1)
    found = decided(plan, rational=True)
    assert found.verdict is NO
    _confirm(plan, found)


def test_no_part_ends_within_a_lower_bound():
    """The last part may have to be over soon after the first began, or not before: a plan of two parts or of one."""
    plan = _blocks(2, "1.01")
    network = plan.network
    for bound, parts in (
        (Constraint("e1", "e72", Fraction(20), None), 3),
        (Constraint("e36", "e72", None, Fraction(13)), 4),
    ):
        longer = replace(plan, network=replace(network, constraints=(*network.constraints, bound)))
        game = Game(longer, GameRules(rational=True))
        assert len(GameParts(game).parts) == parts


def test_what_is_true_from_the_start_is_not_made_so_by_a_part():
    """The second part begins with a condition, ε after the first one's beginning and not after its own."""
    steps = [builder.act("(one)", 1, 2, agent="ann"), builder.act("(two)", 1, 2, agent="ann")]
    network = builder.build("conditions", builder.within(builder.sequence(*steps), upper=4), epsilon=0)
    begins = network.activities[1].source
    literal = Literal(Atom("p"))
    conditions = Condition(literal, begins, begins, ALWAYS, 1)
    effects = Effect(literal, INITIAL, ALWAYS, None)
    found = decided(TeamPlan(with_ends(network, Fraction(0)), (conditions,), (effects,), Fraction(1)))
    assert (found.verdict, found.parts > 1) == (YES, True)


def test_bounds_that_contradict_each_other_are_no_error():
    plan = _blocks(1, "1.01")
    after = Constraint("e_goal", "e8", Fraction(1), Fraction(2), guard({"x1": "3"}))
    network = replace(plan.network, constraints=(*plan.network.constraints, after))
    assert decided(replace(plan, network=network)).verdict is NO


def test_an_unbounded_activity_exceeds_each_limit():
    steps = [builder.act("(wait)", 1, None, agent="ann"), builder.act("(go)", 1, 2, agent="ann")]
    network = builder.build("unbounded", builder.within(builder.sequence(*steps), upper=50))
    plan = TeamPlan(with_ends(network, Fraction(0)), (), (), Fraction(1, 1000))
    found = decided(plan)
    assert found.verdict is NO
    assert [each.action for situation in found.situations for each in situation.lengths] == ["(wait)"]
