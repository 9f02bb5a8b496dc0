"""Dynamic controllability: against all reductions, against a game, and on known examples."""

import random
import time
from dataclasses import replace
from fractions import Fraction

import pytest

from robust.errors import InputError
from robust.execute.controllability.dynamic import (
    ContingentLink,
    RequirementLink,
    Step,
    Stnu,
    Way,
    dynamic,
    explain,
    negative_cycle,
    total,
    weight_in,
)
from robust.plan.model import ZERO
from robust.smt.limits import Deadline, OutOfTimeError
from tests.execute.controllability_oracles import (
    dynamic_by_game,
    dynamic_by_reductions,
    network,
    point,
    random_network,
    weak_by_corners,
)

# name, requirements, contingent links, weakly, dynamically
EXAMPLES = [
    ("nothing", [], [], True, True),
    ("a contradiction", [("Z", "x", 3, 2)], [], False, False),
    ("a delay that is waited for", [("c", "x", 0, 1)], [("Z", "c", 1, 9)], True, True),
    ("a delay that is not", [("Z", "x", 0, 5), ("c", "x", 0, None)], [("Z", "c", 1, 9)], False, False),
    # To be ready shortly before something that comes by surprise.
    ("to know beforehand", [("x", "c", 1, 2)], [("Z", "c", 5, 9)], True, False),
    ("to know well enough", [("x", "c", 1, 6)], [("Z", "c", 5, 9)], True, True),
    # Conditional waits as in Morris, Muscettola and Vidal (2001): until c, or for so long.
    ("a wait", [("x", "c", -5, 3)], [("Z", "c", 1, 10)], True, True),
    ("a wait that is too short", [("x", "c", -5, 3), ("Z", "x", 0, 6)], [("Z", "c", 1, 10)], False, False),
    ("execution with the observation", [("x", "c", 0, 3)], [("Z", "c", 1, 10)], True, True),
    ("execution before the observation", [("x", "c", 1, 3)], [("Z", "c", 1, 10)], True, False),
    ("reaction at once", [("c", "x", 0, 0)], [("Z", "c", 0, 10)], True, True),
    ("no reaction before", [("c", "x", -1, -1)], [("Z", "c", 1, 2)], True, False),
    ("two ends that must meet", [("c", "d", 0, 0)], [("Z", "c", 1, 2), ("Z", "d", 1, 2)], False, False),
    ("start late enough", [("c", "d", 0, 4)], [("x", "c", 1, 3), ("y", "d", 1, 3)], True, True),
    ("the second starts with the first", [("c", "d", 0, 2)], [("Z", "c", 1, 3), ("c", "d", 1, 2)], True, True),
    # Two links in a row, and something that has to be between their ends.
    ("between two", [("c", "x", 0, 2), ("x", "d", 1, 3)], [("Z", "c", 1, 5), ("c", "d", 1, 4)], True, False),
    ("between two, more room", [("c", "x", 0, 2), ("x", "d", 0, 3)], [("Z", "c", 1, 5), ("c", "d", 1, 4)], True, True),
    ("an end that never has to come", [("c", "x", 0, 1)], [("Z", "c", 1, None)], True, True),
    ("a deadline for what may never end", [("c", "x", 0, 1), ("Z", "x", 0, 99)], [("Z", "c", 1, None)], None, False),
    ("a wait without end", [("x", "c", None, 3)], [("Z", "c", 1, None)], True, True),
    ("before what may never end", [("c", "x", -3, -3)], [("Z", "c", 1, None)], True, False),
    ("a link of fixed length", [("x", "c", 1, 2)], [("Z", "c", 5, 5)], True, True),
]  # fmt: skip


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example[0])
def test_examples(example):
    _, requirements, contingents, weakly, dynamically = example
    stnu = network(requirements, contingents)
    assert dynamic(stnu).is_controllable is dynamically
    if all(link.upper is not None for link in stnu.contingents):
        assert dynamic_by_reductions(stnu) is dynamically
        assert dynamic_by_game(stnu, 30) is dynamically
        assert weak_by_corners(stnu) is weakly


def agree(seeds, sizes, oracle):
    verdicts = []
    for seed in seeds:
        rng = random.Random(seed)  # noqa: S311
        executable, contingents, requirements, size = sizes
        stnu = random_network(
            rng, rng.randint(1, executable), rng.randint(1, contingents), rng.randint(1, requirements), size
        )
        answer = dynamic(stnu)
        assert answer.is_controllable is oracle(stnu), (seed, *map(str, stnu.links))
        if answer.is_controllable:
            assert weak_by_corners(stnu), seed
        else:
            confirm(stnu, answer.cycle)
        verdicts.append(answer.is_controllable)
    assert len(verdicts) // 10 < sum(verdicts) < len(verdicts) * 9 // 10


def confirm(stnu, cycle):
    """Check a certificate from its definition alone."""
    weight = weight_in(stnu)
    places = [stnu.ends(step) for step in cycle.steps]
    assert all(places[i - 1][1] == places[i][0] for i in range(len(places)))
    assert all(total(piece, weight) < (0, 0) for piece in cycle.pieces)
    lower = [at for at, step in enumerate(cycle.steps) if step.way is Way.SHORTEST]
    assert lower == [at for at, _ in cycle.moats]
    twice = cycle.steps * 2
    for at, length in cycle.moats:
        moat = twice[at + 1 : at + 1 + length]
        assert total(moat, weight) < (0, 0)
        assert Step(cycle.steps[at].link, Way.LONGEST) not in moat


def test_against_all_reductions():
    agree(range(700), (4, 3, 7, 5), dynamic_by_reductions)


def test_against_a_game():
    agree(range(350), (2, 2, 5, 3), lambda stnu: dynamic_by_game(stnu, 30))


@pytest.mark.slow
def test_against_all_reductions_at_length():
    agree(range(1000, 21_000), (5, 4, 9, 6), dynamic_by_reductions)


@pytest.mark.slow
def test_against_a_game_at_length():
    agree(range(1000, 9000), (3, 2, 6, 3), lambda stnu: dynamic_by_game(stnu, 30))


def with_lengths(stnu, change):
    """The network with other ends of its contingent links."""
    links = (replace(one, **change(one)) if isinstance(one, ContingentLink) else one for one in stnu.links)
    return Stnu(stnu.points, tuple(links))


def test_what_may_never_end_is_what_may_take_very_long():
    seen = set()
    for seed in range(400):
        stnu = random_network(random.Random(seed), 3, 3, 5, 5, unbounded=True)  # noqa: S311
        finite = with_lengths(stnu, lambda link: {} if link.upper is not None else {"upper": Fraction(10_000)})
        controllable = dynamic(stnu).is_controllable
        assert controllable is dynamic(finite).is_controllable, seed
        seen.add((controllable, finite != stnu))
    assert len(seen) == 4


def test_a_longer_link_is_never_easier():
    lost = 0
    for seed in range(300):
        stnu = random_network(random.Random(seed), 3, 3, 4, 4)  # noqa: S311
        wide = with_lengths(stnu, lambda link: {"lower": link.lower / 2, "upper": link.upper + Fraction(1, 3)})
        before, after = dynamic(stnu).is_controllable, dynamic(wide).is_controllable
        assert before or not after
        lost += before and not after
    assert lost


def test_the_explanation_names_what_contradicts():
    stnu = network([("x", "c", 1, 3)], [("Z", "c", 1, 10)])
    text = explain(stnu, dynamic(stnu).cycle)
    assert text == "c as long as 10, c as short as 1 cannot be met with c - x in [1, 3]"
    text = explain(stnu := network([("Z", "x", 3, 2)], []), dynamic(stnu).cycle)
    assert text == "contradiction: x - .zero in [3, 2]"
    stnu = network([("c", "x", 0, 1), ("Z", "x", 0, 99)], [("Z", "c", 1, None)])
    assert explain(stnu, dynamic(stnu).cycle).startswith("c is unbounded cannot be met with ")


def test_a_walk_that_proves_nothing_is_no_certificate():
    stnu = network([("x", "c", -5, 3)], [("Z", "c", 1, 10)])
    with pytest.raises(ValueError, match="not negative"):
        negative_cycle([Step(0, Way.AT_MOST), Step(0, Way.AT_LEAST)], weight_in(stnu))


@pytest.mark.parametrize(
    ("links", "message"),
    [
        ([ContingentLink(ZERO, point("c"), Fraction(3), Fraction(2))], "expected 0 <= lower <= upper"),
        ([ContingentLink(ZERO, point("c"), Fraction(-1), Fraction(2))], "expected 0 <= lower <= upper"),
        ([ContingentLink(point("x"), ZERO, Fraction(0), Fraction(2))], "which happens at time zero"),
        ([ContingentLink(ZERO, point("c"), Fraction(1), None)] * 2, "where another one ends already"),
        ([RequirementLink(ZERO, point("d"), None, None)], "not in the network"),
        (
            [ContingentLink(*map(point, pair), Fraction(1), Fraction(2)) for pair in ("xc", "cx")],
            "go round in a circle",
        ),
    ],
)
def test_networks_that_make_no_sense(links, message):
    with pytest.raises(InputError, match=message):
        Stnu((ZERO, point("x"), point("c")), tuple(links))


def test_zero_comes_first():
    with pytest.raises(InputError, match="the network begins with"):
        Stnu((point("x"), ZERO), ())


def chain(length):
    """Actions one after the other, the start of each soon after the end of the one before."""
    requirements = [(f"c{i}", f"x{i + 1}", 0, 1) for i in range(length)]
    return network(requirements, [("Z" if i == 0 else f"x{i}", f"c{i}", 1, 1 + i % 3) for i in range(length)])


def test_long_plans_do_not_exhaust_the_stack():
    started = time.perf_counter()
    assert dynamic(chain(400)).is_controllable
    assert time.perf_counter() - started < 20


def test_the_deadline_is_kept():
    with pytest.raises(OutOfTimeError):
        dynamic(chain(3), Deadline.after(0))
