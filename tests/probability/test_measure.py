"""Enclosures against mpmath with 90 digits; probabilities of polyhedra: known ones, volumes, and what has no width."""

from fractions import Fraction
from itertools import pairwise, product
from math import prod
from random import Random

import mpmath
import pytest

from robust import Box, InputError, Interval, Location
from robust.probability.distributions import UNIT, Below, Distribution, exp_minus, normal, parse_distribution
from robust.probability.measure import Bounds, Measure, RegionMeasure, box_probability
from robust.qe.constraint import LinearConstraint
from robust.qe.estimate import proportion_bounds
from robust.qe.polyhedron import Polyhedron, union_volume
from robust.smt.limits import NEVER, Deadline, OutOfTimeError

F = Fraction
PLACE = Location("here")


@pytest.fixture(autouse=True)
def digits():
    with mpmath.workdps(90):
        yield


def real(value: Fraction) -> mpmath.mpf:
    return mpmath.mpf(value.numerator) / value.denominator


def width_around(enclosure, true) -> int:
    assert enclosure[0] <= true * UNIT <= enclosure[1]
    return enclosure[1] - enclosure[0]


def places(low: float, high: float):
    random = Random(3)  # noqa: S311 - reproducible
    return [F(random.uniform(low, high)) for _ in range(200)] + [F(0), F(1, 3), F(1, 10**40), F(1), F(2)]


def test_exp_holds_the_true_value():
    for value in places(0, 140):
        assert width_around(exp_minus(value), mpmath.exp(-real(value))) < 2**10


def test_the_normal_distribution_holds_the_true_value():
    for value in [*places(-15, 15), F(13), F(-13), F(1301, 100), F(-20)]:
        narrow = width_around(normal(value), mpmath.ncdf(real(value)))
        assert narrow < UNIT >> 120


phi = mpmath.ncdf
CUMULATIVE = {
    "uniform:2:5": lambda x: min(max((x - 2) / 3, 0), 1),
    "normal:3:2": lambda x: phi((x - 3) / 2),
    "normal:3:2:1": lambda x: phi((x - 3) / 2) - phi((2 - x - 3) / 2) if x > 1 else mpmath.mpf(0),
    "normal:3:2:1:clip": lambda x: phi((x - 3) / 2) if x > 1 else mpmath.mpf(0),
    "half-normal:1:2": lambda x: 2 * phi((x - 1) / 2) - 1 if x > 1 else mpmath.mpf(0),
    "truncated-normal:3:2:1:6": lambda x: min(max(
        (phi((x - 3) / 2) - phi(-1)) / (phi(mpmath.mpf(3) / 2) - phi(-1)), 0), 1),
    "triangular:1:2:6": lambda x: mpmath.mpf(0) if x < 1 else (x - 1) ** 2 / 5 if x < 2 else
        1 - (6 - x) ** 2 / 20 if x < 6 else mpmath.mpf(1),
    "exponential:3:1": lambda x: 1 - mpmath.exp(-(x - 1) / 2) if x > 1 else mpmath.mpf(0),
    "empirical:2,2.5,4:1,2,5": lambda x: mpmath.mpf((x > 2) + 2 * (x > 2.5) + 5 * (x > 4)) / 8,
    "constant:3": lambda x: mpmath.mpf(x > 3),
}  # fmt: skip
"""The probability of less than x, by formulas of mpmath."""
KINDS = tuple(CUMULATIVE)


def cumulative(kind: str, at: Fraction) -> mpmath.mpf:
    return CUMULATIVE[kind](real(at))


@pytest.mark.parametrize("kind", KINDS)
def test_probabilities_of_intervals_hold_the_true_value(kind):
    one = parse_distribution(kind, None, PLACE)
    assert str(one) == kind
    random = Random(kind)  # noqa: S311 - reproducible
    for _ in range(40):
        low, high = sorted(F(random.randint(-4000, 12000), 999) for _ in range(2))
        for lower, upper in ((low, high), (None, high), (low, None)):
            least, most = one.between(lower, upper)
            for value, mass in one.atoms:
                if (lower is None or lower < value) and (upper is None or value < upper):
                    least, most = least + mass[0], most + mass[1]
            true = (1 if upper is None else cumulative(kind, upper)) - (0 if lower is None else cumulative(kind, lower))
            # An atom below or at an open end counts with what is above it only.
            assert width_around((least, most), true) < UNIT >> 100
    whole = one.between(None, None)
    total = [whole[side] + sum(mass[side] for _, mass in one.atoms) for side in (0, 1)]
    assert total[0] <= UNIT <= total[1]


@pytest.mark.parametrize("kind", KINDS[:-2])
def test_densities_are_lines_up_to_the_factor_that_is_said(kind):
    """Ratios of probabilities of small intervals to those of the weights differ by no more than the factor."""
    one = parse_distribution(kind, None, PLACE)
    random, met = Random(kind), 0  # noqa: S311 - reproducible
    for _ in range(60):
        low = F(random.randint(1001, 4900), 1000)
        high = low + F(random.randint(1, 900), 1000)
        if high > 5 or any(low < at < high for at in one.breaks) or low < (one.support[0] or 0):
            continue
        found = one.weights(low, high)
        if found is None:
            continue
        first, last, ratio = found
        met += 1
        shares = []
        for step in range(10):
            left, right = F(step, 10), F(step + 1, 10)
            mass = one.between(low + (high - low) * left, low + (high - low) * right)
            line = first + (last - first) * (left + right) / 2
            shares.append([F(end, UNIT) / line for end in mass])
        assert max(least for least, _ in shares) <= ratio * min(most for _, most in shares)
        assert ratio < 3
    assert met > 20


@pytest.mark.parametrize("kind", KINDS)
def test_draws_follow_the_distribution(kind):
    """The share of draws below each decile is the decile's, up to five standard errors."""
    one = parse_distribution(kind, None, PLACE)
    random = Random(5)  # noqa: S311 - reproducible
    drawn = [one.draw(random, None) for _ in range(4000)]
    for at in (F(3, 2), F(5, 2), F(7, 2), F(9, 2)):
        expected = float(cumulative(kind, at))
        assert (
            abs(sum(value < at for value in drawn) / 4000 - expected) <= 5 * (expected * (1 - expected) / 4000) ** 0.5
        )
    on_grid = [one.draw(random) for _ in range(20)]
    assert all(1000 % value.denominator == 0 for value in on_grid)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("norml:1:2", "found distribution 'norml', expected one of constant"),
        ("normal:1:0", "found deviation 0, expected a number above 0"),
        ("normal:1:-1", "found deviation -1, expected a number above 0"),
        ("normal::1", "found no 'mean', expected normal:MEAN:DEVIATION:MINIMUM:BELOW"),
        ("normal:1", "found no 'deviation'"),
        ("normal:1:2:3:4", "found '4' for 'below', expected fold or clip"),
        ("normal:1:2:3:clip:5", "found 5 numbers, expected normal:MEAN"),
        ("normal:a:2", "found 'a', expected a number"),
        ("uniform:3:2", "found lower above upper"),
        ("triangular:1:5:4", "found mode above upper"),
        ("exponential:1:2", "found mean below minimum"),
        ("truncated-normal:0:1:50:60", "found almost nothing between minimum and maximum"),
        ("truncated-normal:0:1:5:4", "found minimum above maximum"),
        ("empirical", "found no value of an empirical distribution, expected at least one"),
        ("empirical:1,2:3", "found 1 weights, expected 2, one for each value"),
        ("empirical:1,2:3,0", "found weight 0, expected a number above 0"),
        ("empirical:1,x", "found 'x', expected a number"),
    ],
)
def test_wrong_distributions_are_named(text, message):
    with pytest.raises(InputError) as caught:
        parse_distribution(text, None, PLACE)
    assert message in str(caught.value)
    assert str(caught.value).startswith("here: ")


def test_what_is_left_out_is_planned_and_what_is_not_random_constant():
    assert parse_distribution("normal::5", F(30), PLACE).numbers == {"mean": 30, "deviation": 5}
    assert parse_distribution("constant", F(7), PLACE).numbers == {"value": 7}
    assert parse_distribution("normal:1:2:0:clip", None, PLACE).below is Below.CLIP
    assert parse_distribution("triangular:1::4", F(2), PLACE).numbers["mode"] == 2
    for kind, numbers in (
        ("normal", {"mean": F(3), "deviation": F(0)}),
        ("uniform", {"lower": F(3), "upper": F(3)}),
        ("normal", {"mean": F(1), "deviation": F(0), "minimum": F(2)}),
    ):
        assert Distribution(kind, numbers).settled.numbers == {"value": 3}


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


@pytest.mark.parametrize("seed", range(20))
def test_what_was_observed_has_exact_probabilities(seed):
    """Against all combinations of values, with sides that go through some of them."""
    random = Random(f"observed {seed}")  # noqa: S311 - reproducible
    names = "abc"[: random.randint(1, 3)]
    kinds = {}
    for name in names:
        values = [str(random.randint(-4, 8)) for _ in range(random.randint(1, 7))]
        kinds[name] = f"empirical:{','.join(values)}:{','.join(str(random.randint(1, 4)) for _ in values)}"
    distributions = of(**kinds)
    base, removed = drawn_polyhedron(random, names), [drawn_polyhedron(random, names)]
    expected = F(0)
    for chosen in product(*(distributions[name].shares for name in names)):
        point = {name: value for name, (value, _) in zip(names, chosen, strict=True)}
        if point in base and point not in removed[0]:
            expected += prod(share for _, share in chosen)
    found = probability(base, removed, distributions, F(1, 10**9))
    assert found.lower <= expected <= found.upper


def test_a_hyperplane_has_no_probability_and_an_atom_has():
    level, beyond = (polyhedron("a", ({"a": 1}, relation, 1)) for relation in ("=", ">"))
    assert probability(level, (), of(a="normal:1:1")).upper == 0
    for base in (level, beyond):
        half = probability(base, (), of(a="normal:1:1:1:clip"))
        assert half.lower <= F(1, 2) <= half.upper
        assert half.width < F(1, 10**30)


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
    eighth = box_probability(box, of(a="normal:1:3", b="uniform:-1:3"))
    assert eighth.lower <= F(1, 8) <= eighth.upper
    assert eighth.width < F(1, 10**60)
    assert box_probability(Box({"a": Interval(F(3), F(3))}), of(a="constant:3")) == Bounds(F(1), F(1))
    assert box_probability(Box({"a": Interval(F(3), F(4), lower_closed=False)}), of(a="constant:3")).upper == 0
