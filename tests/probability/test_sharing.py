"""Durations that share factors or are correlated: against draws and sums of code of its own, and in worlds."""

from collections.abc import Iterable
from fractions import Fraction
from itertools import pairwise, product
from math import erf
from random import Random

import numpy as np
import pytest

import robust
from robust import InputError, Location
from robust.execute.rules import parse_rules
from robust.execute.worlds import Luck
from robust.probability.averages import Conditional, FactorAverage
from robust.probability.distributions import parse_distribution
from robust.probability.risk import RiskStatus
from robust.probability.sharing import SharedFactor, one_factor, require_covariance, root
from tests.probability.ordered_plans import OrderedPlan, ordered_plan
from tests.probability.test_lateness import sampled

F = Fraction
HERE = Location("here")


def factor_of(kind: str, *, scales: bool = False) -> SharedFactor:
    known = parse_distribution(kind, None, HERE)
    return SharedFactor("f", known, frozenset({"x"}) if scales else frozenset(), {} if scales else {"x": F(1)})


# -- averages ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("log_concave", [True, False])
def test_averages_of_a_normal_law_over_a_normal_factor(log_concave):
    """P(X + F ≤ 1) for standard normal X and F is Φ(1/√2)."""
    truth = (1 + erf(0.5)) / 2
    looked: list[Fraction] = []
    told: list[tuple[float, float]] = []

    def at(value: Fraction) -> Conditional:
        looked.append(value)
        law = (1 + erf((1 - float(value)) / 2**0.5)) / 2
        return Conditional(max(0.0, law - 1e-6), min(1.0, law + 1e-6))

    average = FactorAverage(factor_of("normal:0:1"), at, 0.0 if log_concave else None)
    average.run(1e-3 if log_concave else 0.01, lambda: told.append((average.lower, average.upper)))
    assert average.lower <= truth <= average.upper
    assert average.upper - average.lower <= (1e-3 if log_concave else 0.02)
    assert len(looked) <= 40 if log_concave else len(looked) >= 80
    assert all(a[0] <= b[0] <= b[1] <= a[1] for a, b in pairwise(told))


def test_averages_over_discrete_factors_are_sums():
    average = FactorAverage(
        factor_of("empirical:1,2,4:1,2,1"), lambda value: Conditional(*[1 / float(value)] * 2), None
    )
    average.run(1e-9)
    assert average.lower <= (1 + 1 + 0.25) / 4 <= average.upper <= average.lower + 1e-5


# -- plans -------------------------------------------------------------------------------------------------------------


def share_of_draws(known: OrderedPlan, result, change, seed: int, draws: int) -> tuple[float, float]:
    """How often plans are in time, and the standard deviation of that."""
    random = np.random.default_rng(seed)
    lengths = [sampled(result.distributions[name], random, draws) for name in known.names]
    ends = known.ends(change(lengths, random, draws))
    share = float(np.mean(np.max(ends, axis=0) <= float(known.latest) + 1e-9))
    return share, max((share * (1 - share) / draws) ** 0.5, 1 / draws)


def scaling(lengths, random, draws):
    values = 0.9 + 0.4 * random.random(draws)
    return [own * values if number % 2 else own for number, own in enumerate(lengths)]


def shifting(lengths, random, draws):
    values = np.abs(random.standard_normal(draws))
    return [own + values if number % 3 == 0 else own for number, own in enumerate(lengths)]


def both(lengths, random, draws):
    return shifting(scaling(lengths, random, draws), random, draws)


SCALES, SHIFTS = "weather*{}=uniform:0.9:1.3", "queue+{}=half-normal:0:1"
KINDS = ("truncated-normal::15%:1%", "uniform:3:21", "triangular:50%::160%", "exponential::90%", "half-normal::10%",
         "empirical:80%,90%,100%,130%:1,2,5,2")  # fmt: skip


def hunt_factors(seed: int, plans: Iterable[int], draws: int) -> float:
    """The greatest distance of bounds from the share of draws, in standard deviations."""
    worst = 0.0
    for number in plans:
        random = Random(f"factors {seed} {number}")  # noqa: S311 - reproducible
        known = ordered_plan(random, random.randint(5, 9), late=f"+{random.randint(10, 40)}%")
        every = [",".join(f"a{at}" for at in range(0 if step == 3 else 1, len(known.planned), step)) for step in (2, 3)]
        which = number % 3
        factor = [SCALES.format(every[0])] * (which != 1) + [SHIFTS.format(every[1])] * (which != 0)
        kind = random.choice(KINDS[:5] if which == 2 else KINDS)
        result = robust.risk(known.plan, {"*": kind}, factor=factor, within="1/20" if which == 2 else "1/50", draws=999)
        change = (scaling, shifting, both)[which]
        share, sigma = share_of_draws(known, result, change, number, draws)
        low, high = float(result.probability.lower), float(result.probability.upper)
        worst = max(worst, (low - share) / sigma, (share - high) / sigma)
        assert high - low <= 0.1, (number, kind, which)
        strong, dynamic = result.probabilities.strong, result.probabilities.dynamic
        assert strong.lower <= dynamic.upper
        assert abs(result.estimate.successes / 999 - share) < 0.1
    return worst


def test_bounds_with_factors_hold_the_share_of_draws():
    assert hunt_factors(0, range(2), 40_000) < 4


@pytest.mark.slow
def test_bounds_with_factors_hold_the_share_of_draws_of_many_plans():
    assert hunt_factors(1, range(60), 200_000) < 4


def test_a_search_with_factors_that_is_cut_short_keeps_its_bounds():
    known = ordered_plan(Random(3), 6, late="+15%")  # noqa: S311 - reproducible
    asked = {"factor": ["weather*a0,a2=triangular:0.9:1:1.3"], "within": "1/100", "draws": 99}
    told = []
    whole = robust.risk(known.plan, {"*": "uniform:3:21"}, on_bounds=told.append, **asked)
    assert all(a.lower <= b.lower <= b.upper <= a.upper for a, b in pairwise(told))
    again = robust.risk(known.plan, {"*": "uniform:3:21"}, **asked)
    assert (again.probability, again.probabilities, again.late) == (whole.probability, whole.probabilities, whole.late)
    late = robust.risk(known.plan, {"*": "uniform:3:21"}, timeout=0, **asked)
    assert late.status is RiskStatus.TIMEOUT
    count = 0

    def interrupting(_):
        nonlocal count
        count += 1
        if count == 3:
            raise KeyboardInterrupt

    stopped = robust.risk(known.plan, {"*": "uniform:3:21"}, on_bounds=interrupting, **asked)
    assert stopped.status is RiskStatus.INTERRUPTED
    for cut in (late, stopped):
        assert cut.probability.lower <= whole.probability.lower <= whole.probability.upper <= cut.probability.upper


def world_of(known: OrderedPlan, matrix: list[list[int]]) -> str:
    names = ", ".join(f'"(a{number})"' for number in range(len(matrix)))
    return f"[[covariance]]\ndurations = [{names}]\nmatrix = {matrix}\n"


MATRICES = {
    "one factor": [[4, 2, 1], [2, 5, 2], [1, 2, 3]],
    "of both signs": [[4, -2, 1], [-2, 5, -2], [1, -2, 3]],
    "no factor": [[4, 1, 1, 0], [1, 4, 0, 1], [1, 0, 4, 1], [0, 1, 1, 4]],
}


@pytest.mark.parametrize("case", MATRICES)
def test_bounds_with_covariances_hold_the_share_of_draws(case, tmp_path):
    matrix = MATRICES[case]
    known = ordered_plan(Random(3), 6, late="+15%")  # noqa: S311 - reproducible
    file = tmp_path / "world.toml"
    file.write_text(world_of(known, matrix))
    result = robust.risk(known.plan, {}, world=file, within="1/30")
    assert bool(result.factors) == (case != "no factor")
    random = np.random.default_rng(1)
    own = random.multivariate_normal(np.zeros(len(matrix)), matrix, 200_000).T
    lengths = [np.full(200_000, float(planned)) for planned in known.planned]
    for number, noise in enumerate(own):
        lengths[number] = lengths[number] + noise
    fits = (np.max(known.ends(lengths), axis=0) <= float(known.latest) + 1e-9) & (np.min(lengths, axis=0) >= 0)
    share = float(np.mean(fits))
    assert float(result.probability.lower) - 0.004 <= share <= float(result.probability.upper) + 0.004
    assert result.probability.width <= (F(1, 4) if case == "no factor" else F(1, 25))
    assert result.status is not RiskStatus.UNKNOWN
    assert abs(result.estimate.successes / result.estimate.draws - share) < 0.03


# -- matrices ----------------------------------------------------------------------------------------------------------


def exactly(rows):
    return tuple(tuple(map(F, row)) for row in rows)


def test_factors_and_noise_make_their_matrix():
    for case, rows in MATRICES.items():
        matrix = exactly(rows)
        found = one_factor(matrix)
        assert (found is None) == (case == "no factor")
        for loadings, variance in found or ():
            for first, second in product(loadings, repeat=2):
                shared = loadings[first] * loadings[second] * variance
                assert matrix[first][second] == shared if first != second else matrix[first][first] >= shared
        square = np.array(root(matrix))
        assert np.allclose(square @ square.T, np.array(rows))


@pytest.mark.parametrize(
    ("rows", "found"), [([[1, 2], [2, 1]], "not positive semidefinite"), ([[1, 0], [1, 1]], "to be symmetric")]
)
def test_other_matrices_are_no_covariances(rows, found):
    with pytest.raises(InputError, match=found):
        require_covariance(exactly(rows), HERE)


# -- worlds ------------------------------------------------------------------------------------------------------------

WORLD = """
[[factor]]
name = "weather"
scales = ["a0", "a1"]
distribution = "uniform"
lower = 0.5
upper = 2

[[factor]]
name = "queue"
shifts = ["*"]
distribution = "empirical"
values = [0, 1]

[[covariance]]
durations = ["a2", "a3"]
matrix = [[1, 0.9], [0.9, 1]]
"""


def test_worlds_draw_what_durations_share():
    known = ordered_plan(Random(3), 5)  # noqa: S311 - reproducible
    rules = parse_rules(WORLD)
    steps = {step.action: step for step in known.plan.instances}
    assert all(rules.is_random(step) for step in steps.values())
    drawn = []
    for seed in range(400):
        luck = Luck(rules, seed)
        lengths = {name: luck.duration(step, F(10)) for name, step in steps.items()}
        queue = lengths["a4"] - 10
        assert queue in (0, 1)
        assert lengths["a0"] == lengths["a1"]
        drawn.append([float(lengths[name] - queue) for name in ("a0", "a2", "a3")])
        assert luck.duration(steps["a0"], F(20)) - queue == 2 * (lengths["a0"] - queue)
    columns = np.array(drawn).T
    assert 5 <= columns[0].min() <= 5.5
    assert 19.5 <= columns[0].max() <= 20
    assert np.corrcoef(columns[1], columns[2])[0, 1] == pytest.approx(0.9, abs=0.03)
    assert columns[1].std() == pytest.approx(1, abs=0.15)


WRONG = {
    '[[factor]]\nname = "w"\nscales = ["a"]\ndistribution = "normal"\nmean = 1\ndeviation = 1': "found no minimum of a",
    '[[factor]]\nname = "w"\ndistribution = "uniform"\nlower = 1\nupper = 2': "found none, expected one of scales",
    '[[factor]]\nname = "w"\nshifts = []\ndistribution = "uniform"\nlower = 1\nupper = 2': "expected a list of names",
    '[[covariance]]\ndurations = ["a", "b"]\nmatrix = [[1]]': "found no matrix with 2 rows and columns",
    '[[covariance]]\ndurations = ["a"]\nmatrix = [[-1]]': "not positive semidefinite",
    '[[covariance]]\ndurations = ["a"]\nmatrix = [[1]]\nmean = [1]': "found key 'mean', expected another",
}


@pytest.mark.parametrize("text", WRONG)
def test_wrong_factors_and_covariances_say_what_is_wrong(text):
    with pytest.raises(InputError, match=WRONG[text]):
        parse_rules(text, "world.toml")


@pytest.mark.parametrize(
    ("factor", "found"),
    [
        ("weather=uniform:1:2", "expected NAME"),
        ("weather*nothing=uniform:1:2", "found unknown parameter"),
        ("weather*a0=uniform:-1:2", "expected one above 0"),
        ("weather*a0=truncated-normal:1:10%:0.5:2", "found a share as 'deviation', but no planned value"),
    ],
)
def test_wrong_factors_of_options_say_what_is_wrong(factor, found):
    known = ordered_plan(Random(3), 5)  # noqa: S311 - reproducible
    with pytest.raises(InputError, match=found):
        robust.risk(known.plan, {}, factor=[factor])
