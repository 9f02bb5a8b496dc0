"""Bounds for many random durations: laws against exact ones, paths by enumeration, plans by a simulator of its own."""

from collections.abc import Iterable
from fractions import Fraction
from itertools import pairwise, product
from math import prod
from random import Random

import numpy as np
import pytest

import robust
from robust import Interval, Location
from robust.execute.convert import Settings, convert
from robust.plan.parameters import parse_specs
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.timed import parse_timed_plan
from robust.probability import lateness
from robust.probability import risk as risks
from robust.probability.distributions import UNIT, Distribution, parse_distribution
from robust.probability.lateness import SINK, ChainLaws, PathBounds, PathEdge
from robust.probability.measure import interval_probability
from robust.probability.random_durations import RandomDuration, cumulative
from robust.probability.risk import RiskStatus
from robust.smt.limits import NEVER, Deadline, OutOfTimeError
from tests.probability.ordered_plans import ordered_plan

F = Fraction
HERE = Location("here")
KINDS = (
    "uniform:2:5", "normal:3:2:0", "normal:3:2:1:clip", "half-normal:1:2", "truncated-normal:3:2:1:6",
    "triangular:1:2:6", "exponential:3:1", "empirical:2,2.5,4:1,2,5", "constant:3",
)  # fmt: skip


def lasting(name: str, kind: str, low: int | None = 0, high: int | None = None) -> RandomDuration:
    ends = [None if end is None else F(end) for end in (low, high)]
    return RandomDuration(name, parse_distribution(kind, None, HERE).settled, Interval(*ends))


# -- laws --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_cumulative_probabilities_are_those_of_the_exact_enclosures(kind):
    known = parse_distribution(kind, None, HERE).settled
    values = np.linspace(0, 12, 401)
    law, error = cumulative(known, values)
    assert error < 1e-10
    for value, share in zip(values, law, strict=True):
        exact = known.between(None, F(float(value)))[0] / UNIT if value >= float(known.support[0] or 0) else 0.0
        assert abs(share - exact) <= error


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("ends", [(0, None), (F(3, 2), 4)])
def test_laws_hold_the_probability_of_each_place(kind, ends):
    known = lasting("a", kind, *ends)
    if not known.mass[0]:
        return
    unit, size = F(1, 37), 600
    for upper in (False, True):
        first, law = known.law(unit, size, upper=upper)
        whole = np.concatenate([np.zeros(first), law, np.full(size, law[-1])])[:size]
        for place in range(0, size, 7):
            at = (place + upper) * unit
            end, exact = min(at, known.interval.upper or at), F(0)
            if end > known.interval.lower:
                inside = Interval(known.interval.lower, end, upper_closed=not upper)
                exact = F(interval_probability(inside, known.distribution)[0], known.mass[0])
            assert (whole[place] >= exact - F(1, 10**15)) if upper else (whole[place] <= exact + F(1, 10**15))
            assert abs(whole[place] - float(exact)) < 0.4 or known.distribution.kind in {"constant", "empirical"}


# -- paths -------------------------------------------------------------------------------------------------------------


def drawn_graph(random: Random) -> tuple[list[PathEdge], dict[str, RandomDuration]]:
    """A connected graph without cycles; most edges are random, with two or three values."""
    count = random.randint(3, 6)
    legs = [(node, node + 1) for node in range(count - 1)]
    legs += [(node, node + 2) for node in range(count - 2) if random.random() < 0.8]
    legs += [tuple(sorted(random.sample(range(count), 2))) for _ in range(random.randint(0, 3))]
    edges, durations = [], {}
    for number, (source, last) in enumerate(legs[:9]):
        target = SINK if last == count - 1 else last
        constant = F(random.randint(0, 3))
        if random.random() < 0.9:
            values = ",".join(map(str, random.sample(range(12), random.choice((2, 2, 3)))))
            weights = ",".join(str(random.randint(1, 9)) for _ in values.split(","))
            durations[f"x{number}"] = lasting(f"x{number}", f"empirical:{values}:{weights}")
        names = (f"x{number}",) if f"x{number}" in durations else ()
        edges.append(PathEdge(source, target, constant, names))
    return lateness.connected(edges), durations


def longest(edges, lengths) -> Fraction:
    """By relaxing every edge as often as there are edges."""
    times = {0: F(0)}
    for _ in edges:
        for edge in edges:
            if edge.source in times:
                arrival = times[edge.source] + edge.constant + sum(lengths[name] for name in edge.names)
                times[edge.target] = max(arrival, times.get(edge.target, arrival))
    return times[SINK]


def hunt_paths(seed: int, count: int) -> tuple[int, int]:
    """How many graphs were drawn, and how many of them had edges that branches share."""
    random, met = Random(f"paths {seed}"), 0  # noqa: S311 - reproducible
    for _ in range(count):
        edges, durations = drawn_graph(random)
        names = sorted({name for edge in edges for name in edge.names})
        if not names:
            continue
        outcomes: dict[Fraction, Fraction] = {}
        for chosen in product(*(durations[name].distribution.shares for name in names)):
            lengths = {name: value for name, (value, _) in zip(names, chosen, strict=True)}
            end = longest(edges, lengths)
            outcomes[end] = outcomes.get(end, F(0)) + prod(share for _, share in chosen)
        latest = random.choice(sorted(outcomes))
        if not latest:
            continue
        truth = sum(share for end, share in outcomes.items() if end <= latest)
        for within in (0.3, 0.02, 1e-6):
            known: list[tuple[float, float]] = []
            bounds = PathBounds(edges, ChainLaws(durations, latest))
            bounds.run(within, lambda known=known, bounds=bounds: known.append((bounds.lower, bounds.upper)), NEVER)
            assert F(bounds.lower) <= truth <= F(bounds.upper)
            assert all(a[0] <= b[0] <= b[1] <= a[1] for a, b in pairwise(known))
            assert bounds.upper - bounds.lower <= max(within, 1e-4)
        met += bounds.cells > 1
    return count, met


def test_bounds_hold_the_probability_of_all_combinations():
    assert hunt_paths(0, 8)[1] >= 2


@pytest.mark.slow
def test_bounds_hold_the_probability_of_all_combinations_of_many():
    assert hunt_paths(1, 400)[1] >= 40


def test_out_of_time_bounds_are_those_of_the_moment():
    edges, durations = drawn_graph(Random("time"))  # noqa: S311 - reproducible
    bounds = PathBounds(edges, ChainLaws(durations, F(9)))
    with pytest.raises(OutOfTimeError):
        bounds.run(1e-9, lambda: None, Deadline.after(0))
    assert (bounds.lower, bounds.upper) == (0.0, 1.0)


# -- plans -------------------------------------------------------------------------------------------------------------


def kind_for(random: Random, planned: int) -> str:
    return random.choice((
        "truncated-normal::15%:1%", f"uniform:{planned * 0.8:.2f}:{planned * 1.3:.2f}", "normal::10%:10%",
        f"triangular:{planned * 0.5:.2f}::{planned * 1.6:.2f}", "exponential::90%", "half-normal::10%",
        "empirical:80%,90%,100%,130%:1,2,5,2",
    ))  # fmt: skip


def sampled(distribution: Distribution, random: np.random.Generator, count: int):  # noqa: PLR0911 - one for each kind
    """Draws by quantiles and rejection, in code of its own."""
    numbers = {key: float(value) for key, value in distribution.numbers.items()}
    match distribution.kind:
        case "uniform":
            return numbers["lower"] + (numbers["upper"] - numbers["lower"]) * random.random(count)
        case "triangular":
            return random.triangular(numbers["lower"], numbers["mode"], numbers["upper"], count)
        case "exponential":
            least = numbers.get("minimum", 0.0)
            return least - (numbers["mean"] - least) * np.log1p(-random.random(count))
        case "half-normal":
            return numbers["origin"] + np.abs(random.standard_normal(count)) * numbers["deviation"]
        case "empirical":
            ends = np.cumsum([float(share) for _, share in distribution.shares])
            places = np.minimum(np.searchsorted(ends, random.random(count)), len(ends) - 1)
            return np.array([float(value) for value, _ in distribution.shares])[places]
    drawn = random.standard_normal((count, 40)) * numbers["deviation"] + numbers["mean"]
    least = numbers["minimum"]
    if distribution.kind == "normal":
        return np.where(drawn[:, 0] < least, 2 * least - drawn[:, 0], drawn[:, 0])
    return drawn[np.arange(count), np.argmax(drawn >= least, axis=1)]


def hunt_plans(seed: int, plans: Iterable[int], draws: int) -> float:
    """The greatest distance of bounds from the share of draws, in standard deviations."""
    worst = 0.0
    for number in plans:
        random = Random(f"plans {seed} {number}")  # noqa: S311 - reproducible
        known = ordered_plan(random, random.randint(7, 16), late=f"+{random.randint(2, 25)}%")
        kinds = {name: kind_for(random, length) for name, length in zip(known.names, known.planned, strict=True)}
        result = robust.risk(known.plan, kinds, within="1/500")
        assert result.probabilities is not None
        generator = np.random.default_rng(number)
        lengths = [sampled(result.distributions[name], generator, draws) for name in known.names]
        share = float(np.mean(np.max(known.ends(lengths), axis=0) <= float(known.latest) + 1e-9))
        sigma = max((share * (1 - share) / draws) ** 0.5, 1 / draws)
        low, high = float(result.probability.lower), float(result.probability.upper)
        worst = max(worst, (low - share) / sigma, (share - high) / sigma)
        assert high - low <= 0.01
        assert result.probabilities.strong.lower <= result.probabilities.dynamic.upper
        assert result.probabilities.dynamic.lower <= result.probabilities.weak.upper
    return worst


def test_bounds_hold_the_share_of_draws():
    assert hunt_plans(0, range(3), 40_000) < 4


def test_no_value_is_lost_between_cells_on_a_finer_lattice():
    assert hunt_plans(7, [59], 40_000) < 4


@pytest.mark.slow
def test_bounds_hold_the_share_of_draws_of_many_plans():
    assert hunt_plans(1, range(300), 200_000) < 4


def hunt_discrete(seed: int, plans: int) -> None:
    """Weak, dynamic and strong probabilities against all combinations of values."""
    for number in range(plans):
        random = Random(f"discrete {seed} {number}")  # noqa: S311 - reproducible
        known = ordered_plan(random, 7, late=f"+{random.randint(1, 30)}%")
        values = [sorted(random.sample(range(max(1, n - 3), n + 6), 2)) for n in known.planned]
        weights = [[random.randint(1, 4) for _ in pair] for pair in values]
        kinds = {
            name: f"empirical:{','.join(map(str, pair))}:{','.join(map(str, shares))}"
            for name, pair, shares in zip(known.names, values, weights, strict=True)
        }
        result = robust.risk(known.plan, kinds, within="1/1000000")
        probabilities = result.probabilities
        assert probabilities is not None
        identifiers = {step.action: step.identifier for step in known.plan.instances}
        starts = [probabilities.starts[f"{identifiers[f'a{n}']}.start"] for n in range(len(known.planned))]
        asap = fixed = best = F(0)
        for chosen in product((0, 1), repeat=len(values)):
            lengths = [F(pair[side]) for pair, side in zip(values, chosen, strict=True)]
            share = prod(F(w[side], sum(w)) for w, side in zip(weights, chosen, strict=True))
            asap += share * (max(known.ends(lengths)) <= known.latest)
            if max(known.ends(lengths)) <= known.latest:  # a schedule that leaves each duration this long
                fits = (sum(w[: side + 1]) for w, side in zip(weights, chosen, strict=True))
                best = max(best, prod(F(fit, sum(w)) for w, fit in zip(weights, fits, strict=True)))
            ends = [start + length for start, length in zip(starts, lengths, strict=True)]
            waits = (starts[n] >= ends[other] + F(1, 1000) for n, before in enumerate(known.before) for other in before)
            fixed += share * (all(waits) and max(ends) <= known.latest)
        for bounds, truth in ((probabilities.weak, asap), (probabilities.dynamic, asap), (probabilities.strong, fixed)):
            assert bounds.lower <= truth <= bounds.upper
            assert bounds.width < F(1, 1000)
        assert probabilities.strong.lower <= best <= probabilities.best_strong.upper
        assert probabilities.best_dynamic.lower <= asap <= probabilities.best_dynamic.upper
        assert probabilities.best_dynamic.width < F(1, 1000)
        assert probabilities.best_strong.upper <= probabilities.best_dynamic.upper <= probabilities.weak.upper
        assert result.probability.lower == 1 or abs(result.estimate.successes / result.estimate.draws - asap) < 0.03


def test_three_probabilities_are_those_of_all_combinations():
    hunt_discrete(0, 3)


@pytest.mark.slow
def test_three_probabilities_are_those_of_all_combinations_in_many_plans():
    hunt_discrete(1, 200)


def test_where_all_values_succeed_all_three_probabilities_are_one():
    known = ordered_plan(Random(3), 6, late="+20%")  # noqa: S311 - reproducible
    result = robust.risk(known.plan, {"*": "uniform:80%:120%"})
    assert (result.status, result.probability.lower, result.estimate) == (RiskStatus.COMPLETE, 1, None)
    found = result.probabilities
    assert {each.lower for each in (found.weak, found.dynamic, found.best_dynamic, found.strong)} == {1}
    assert found.starts


def test_three_probabilities_differ_where_an_end_waits_for_another():
    """A fixed start of the second action dares what an executor does not that waits until the first has ended.

    The second ends after the first, and needs that only then. Within 11: a schedule exists unless the third takes 20;
    the executor fails with (8, 6) as well; the start at 5 with (8, 3) instead, which no fixed start makes better.
    """
    planned = (8, 6, 1, 1, 1)
    atoms = " ".join(f"(done{number})" for number in range(len(planned)))
    actions = "".join(
        f"(:durative-action a{number} :parameters () :duration (= ?duration {length}) :condition (and "
        f"(at start (ready)){' (at end (done0))' if number == 1 else ''}) :effect (at end (done{number})))"
        for number, length in enumerate(planned)
    )
    domain = parse_domain(
        f"(define (domain d) (:requirements :durative-actions) (:predicates (ready) {atoms}) {actions})"
    )
    problem = parse_problem(f"(define (problem p) (:domain d) (:init (ready)) (:goal (and {atoms})))", domain)
    timed = parse_timed_plan("\n".join(f"{3 * (n == 1)}: (a{n}) [{length}]" for n, length in enumerate(planned)))
    plan = convert(domain, problem, timed, Settings(specs=parse_specs(["duration:*"]), deadline="11")).plan
    kinds = {"a0": "empirical:4,8:1,1", "a1": "empirical:3,6:1,3", "a2": "empirical:1,20:9,1"}
    known = robust.risk(plan, kinds, within="1/100000").probabilities
    in_time = F(9, 10)
    for bounds, truth in (
        (known.weak, in_time),
        (known.dynamic, in_time * F(5, 8)),
        (known.best_dynamic, in_time * F(7, 8)),
        (known.best_strong, in_time * F(7, 8)),
    ):
        assert bounds.lower <= truth <= bounds.upper
    assert known.dynamic.width < F(1, 10**6)
    assert known.dynamic.upper < known.strong.lower <= in_time * F(7, 8)


def test_chains_that_are_late_are_certified():
    """Against draws: chains to each deadline, and what a unit of time more gains."""
    known = ordered_plan(Random("chains"), 9, late="+12%")  # noqa: S311 - reproducible
    result = robust.risk(known.plan, {"*": "truncated-normal::15%:1%"})
    generator = np.random.default_rng(1)
    lengths = [sampled(result.distributions[name], generator, 100_000) for name in known.names]
    ends, latest = np.array(known.ends(lengths)), float(known.latest)
    late = ends.max(axis=0) > latest + 1e-9
    gain = result.late.certified_gain
    share = float(np.mean(late & (ends.max(axis=0) <= latest + 1 + 1e-9)))
    assert float(gain.lower) - 0.004 <= share <= float(gain.upper) + 0.004
    for point in result.late.points:
        number = next(
            n
            for n, name in enumerate(known.names)
            if f"end of {name.removeprefix('dur_')}" in point.name or f"{name.removeprefix('dur_')}.end" in point.name
        )
        share = float(np.mean(ends[number] > latest))
        assert float(point.certified.lower) - 0.006 <= share <= float(point.certified.upper) + 0.006
    for duration in result.late.durations[:3]:
        assert duration.certified.lower <= duration.certified.upper <= 1
        assert duration.estimate <= float(duration.certified.upper) + 0.02


def test_probabilities_grow_with_the_deadline():
    plans = [ordered_plan(Random(8), 8, late=late).plan for late in ("+2%", "+8%", "+20%")]  # noqa: S311 - reproducible
    bounds = [robust.risk(plan, {"*": "truncated-normal::15%"}, draws=9).probability for plan in plans]
    assert all(less.lower <= more.upper and less.upper <= more.upper + F(1, 1000) for less, more in pairwise(bounds))


def test_a_search_that_is_cut_short_keeps_its_bounds(monkeypatch):
    known = ordered_plan(Random("cut"), 12)  # noqa: S311 - reproducible
    exact = robust.risk(known.plan, {"*": "truncated-normal::15%"})
    assert exact.status is RiskStatus.COMPLETE
    assert {share.name for share in exact.late.durations} <= set(known.names)
    assert all(share.estimate <= float(share.certified.upper) + 0.02 for share in exact.late.durations)
    late = robust.risk(known.plan, {"*": "truncated-normal::15%"}, timeout=0)
    assert late.status is RiskStatus.TIMEOUT
    assert late.probability.lower <= exact.probability.lower <= exact.probability.upper <= late.probability.upper
    told = []

    def interrupting(bounds):
        told.append(bounds)
        if len(told) == 3:
            raise KeyboardInterrupt

    stopped = robust.risk(known.plan, {"*": "truncated-normal::15%"}, on_bounds=interrupting)
    assert stopped.status is RiskStatus.INTERRUPTED
    assert stopped.probability == told[-1]
    assert told[-1].lower <= exact.probability.upper
    again = robust.risk(known.plan, {"*": "truncated-normal::15%"})
    assert (again.probability, again.late) == (exact.probability, exact.late)
    monkeypatch.setattr(risks.Risk, "_by_longest_paths", lambda _, **__: False)
    without = robust.risk(known.plan, {"*": "truncated-normal::15%"}, timeout=0.5)
    assert without.probability.lower <= exact.probability.upper
    assert exact.probability.lower <= without.probability.upper
