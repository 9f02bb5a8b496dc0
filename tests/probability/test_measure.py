"""Probabilities of polyhedra: known ones, volumes for uniform distributions, and what has no width."""

from fractions import Fraction
from itertools import pairwise
from random import Random

import mpmath
import pytest

from robust.errors import Location
from robust.probability.distributions import parse_distribution
from robust.probability.measure import Bounds, Measure, RegionMeasure, box_probability
from robust.qe.box import Box, Interval
from robust.qe.constraint import LinearConstraint
from robust.qe.estimate import proportion_bounds
from robust.qe.polyhedron import Polyhedron, union_volume
from robust.smt.limits import NEVER, Deadline, OutOfTimeError

F = Fraction
PLACE = Location("here")


def of(**kinds):
    return {name: parse_distribution(kind, None, PLACE) for name, kind in kinds.items()}


def polyhedron(names, *sides) -> Polyhedron:
    return Polyhedron(tuple(names), tuple(LinearConstraint.of(*side) for side in sides))


CLOSE = F(1, 1000)


def probability(base, removed, distributions, within=CLOSE) -> Bounds:
    found = Measure([(base, tuple(removed))], distributions).run(within, NEVER)
    assert found.width <= within
    return found


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_a_sum_of_normal_variables_is_normal(count):
    names = [f"x{number}" for number in range(count)]
    factors = dict(zip(names, (1, -2, 3, -1), strict=False))
    distributions = of(**{name: f"normal:{number}:{number + 1}" for number, name in enumerate(names)})
    mean = sum(factor * number for number, factor in enumerate(factors.values()))
    deviation = sum((factor * (number + 1)) ** 2 for number, factor in enumerate(factors.values())) ** 0.5
    base = polyhedron(names, (factors, "<=", F(3, 2)))
    found = probability(base, (), distributions, F(1, 100) if count == 4 else F(1, 1000))
    expected = float(mpmath.ncdf((1.5 - mean) / deviation))
    assert found.lower - F(1, 10**12) <= expected <= found.upper + F(1, 10**12)


def drawn_polyhedron(random: Random, names) -> Polyhedron:
    sides = []
    for _ in range(random.randint(1, 3)):
        factors = {name: random.randint(-3, 3) for name in names}
        factors = factors if any(factors.values()) else {names[0]: 1}
        sides.append((factors, random.choice(["<=", "<"]), F(random.randint(-4, 12), 2)))
    return polyhedron(names, *sides)


@pytest.mark.parametrize("seed", range(25))
def test_with_uniform_distributions_probabilities_are_volumes(seed):
    random = Random(seed)  # noqa: S311 - reproducible
    names = ["a", "b", "c"][: random.randint(1, 3)]
    ends = {name: (random.randint(-2, 0), random.randint(1, 3)) for name in names}
    distributions = of(**{name: f"uniform:{low}:{high}" for name, (low, high) in ends.items()})
    box = Polyhedron.of_box(names, Box({name: Interval(F(low), F(high)) for name, (low, high) in ends.items()}))
    base, removed = drawn_polyhedron(random, names), [drawn_polyhedron(random, names) for _ in range(2)]
    found = probability(base, removed, distributions, F(1, 200))
    inside = box.intersection(base)
    lost = union_volume([inside.intersection(piece) for piece in removed])
    whole, size = inside.volume(), box.volume()
    assert found.lower <= (whole - lost) / size <= found.upper
    product = RegionMeasure(base, removed, distributions).run(F(1, 200), NEVER)
    assert product.width <= F(1, 200)
    assert product.lower <= (whole - lost) / size <= product.upper


def test_one_side_of_a_uniform_box_is_exact_at_once():
    measure = Measure([(polyhedron("ab", ({"a": 1, "b": 2}, "<=", 1)), ())], of(a="uniform:0:1", b="uniform:0:1"))
    assert measure.cells == 1
    assert measure.bounds.lower <= F(1, 4) <= measure.bounds.upper
    assert measure.bounds.width < F(1, 10**15)


@pytest.mark.parametrize(("relation", "expected"), [("<=", 1), ("<", 0), (">=", 1), (">", 0), ("=", 1)])
def test_constants_respect_strict_sides(relation, expected):
    base = polyhedron("ab", ({"a": 1}, relation, 3))
    assert probability(base, (), of(a="constant:3", b="normal:0:1")) == Bounds(F(expected), F(expected))


def test_a_hyperplane_has_no_probability_and_an_atom_has():
    base = polyhedron("a", ({"a": 1}, "=", 1))
    assert probability(base, (), of(a="normal:1:1")).upper == 0
    clipped = probability(base, (), of(a="normal:1:1:1:clip"))
    assert clipped.lower <= F(1, 2) <= clipped.upper
    assert clipped.width < F(1, 10**30)
    beyond = probability(polyhedron("a", ({"a": 1}, ">", 1)), (), of(a="normal:1:1:1:clip"))
    assert beyond.lower <= F(1, 2) <= beyond.upper


def test_bounds_become_narrower_with_each_step_and_hold_when_time_is_out():
    base = polyhedron("ab", ({"a": 1, "b": 1}, "<=", 1), ({"a": 1, "b": -3}, "<=", 2))
    measure = Measure([(base, ())], of(a="normal:0:1", b="exponential:1"))
    known = [measure.bounds]
    for _ in range(60):
        measure.step()
        known.append(measure.bounds)
    exact = probability(base, (), of(a="normal:0:1", b="exponential:1"), F(1, 10**5))
    for wide, narrow in pairwise(known):
        assert wide.lower <= narrow.upper
        assert wide.upper >= narrow.lower
    assert all(one.lower <= exact.upper and exact.lower <= one.upper for one in known)
    assert known[-1].width < known[0].width / 4
    stopped = Measure([(base, ())], of(a="normal:0:1", b="exponential:1"))
    with pytest.raises(OutOfTimeError):
        stopped.run(F(1, 1000), Deadline.after(0))
    assert stopped.bounds.lower <= exact.lower <= exact.upper <= stopped.bounds.upper


def test_independent_parameters_cost_the_sum_and_not_the_product():
    names = "abcdefgh"
    sides = [({name: 1}, "<=", number) for number, name in enumerate(names)] + [({"a": 1, "b": 1}, "<=", 1)]
    distributions = of(**dict.fromkeys(names, "normal:0:2"))
    measure = RegionMeasure(polyhedron(names, *sides), (), distributions)
    found = measure.run(F(1, 10**4), NEVER)
    assert found.width <= F(1, 10**4)
    assert measure.cells < 5000


def drawn_groups(random: Random) -> tuple[list[list[str]], Polyhedron, list[Polyhedron]]:
    """Two or three groups of parameters that no side and no removed polyhedron has in common."""
    groups = [
        [f"{letter}{number}" for number in range(random.randint(1, 2))] for letter in "abc"[: random.randint(2, 3)]
    ]
    names = [name for group in groups for name in group]
    sides, removed = [], []
    for group in groups:
        sides += drawn_polyhedron(random, group).constraints
        if random.random() < 0.5:
            removed.append(Polyhedron(tuple(names), drawn_polyhedron(random, group).constraints))
    return groups, Polyhedron(tuple(names), tuple(sides)), removed


@pytest.mark.parametrize("seed", range(20))
def test_factors_agree_with_random_points_and_with_the_whole(seed):
    """What is computed group by group is what points drawn in all parameters say, and the measure without groups."""
    random = Random(f"groups {seed}")  # noqa: S311 - reproducible
    groups, base, removed = drawn_groups(random)
    kinds = ("normal:1:2", "uniform:-2:3", "exponential:2", "triangular:-1:0:4", "normal:1:2:0:clip")
    distributions = of(**{name: random.choice(kinds) for name in base.parameters})
    measure = RegionMeasure(base, removed, distributions)
    found = measure.run(F(1, 500), NEVER)
    assert base.is_empty or len(measure._measures) >= len(groups)
    whole = Measure([(base, tuple(removed))], distributions)
    for _ in range(300):
        if not whole.is_done:
            whole.step()
    assert whole.bounds.lower <= found.upper
    assert found.lower <= whole.bounds.upper
    draws, good = 2000, 0
    for _ in range(draws):
        point = {name: one.settled.draw(random, None) for name, one in distributions.items()}
        good += point in base and not any(point in piece for piece in removed)
    least, most = proportion_bounds(good, draws, 0.9999)
    assert found.lower <= most
    assert found.upper >= least


def test_boxes_are_exact():
    box = Box({"a": Interval(None, F(1), upper_closed=True), "b": Interval(F(0), F(1))})
    found = box_probability(box, of(a="normal:1:3", b="uniform:-1:3"))
    assert found.lower <= F(1, 8) <= found.upper
    assert found.width < F(1, 10**60)
    closed = box_probability(Box({"a": Interval(F(3), F(3))}), of(a="constant:3"))
    assert closed == Bounds(F(1), F(1))
    assert box_probability(Box({"a": Interval(F(3), F(4), lower_closed=False)}), of(a="constant:3")).upper == 0
