"""Labeled regions against the oracle, which is told values instead of parameters, and against their own parts."""

from fractions import Fraction
from itertools import count, product

import pytest

from robust.errors import SolverError
from robust.pike_bridge.envelopes.search import LabeledRegionSearch, TeamEnvelopeSearch, uncontrollable
from robust.pike_bridge.knowledge.sat import satisfiable
from robust.pike_bridge.model import guard
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region
from robust.searching import Status
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Satisfiability, Session
from robust.smt.terms import Terms
from tests.pike_bridge import plans, stories
from tests.pike_bridge.envelopes.examples import (
    disagreements,
    parametric,
    random_parameters,
    random_values,
    seeded,
    strict,
    structured,
)


def full(choices, domains, key):
    """The full assignments to the key that a combination stands for."""
    known = dict(choices)
    for values in product(*(([known[name]] if name in known else domains[name]) for name in key)):
        yield tuple(sorted(zip(key, values, strict=True)))


def compare(plan, draw, points):
    region = LabeledRegionSearch(plan).run()
    assert not region.cut_short
    total = 0
    for _ in range(points):
        wrong, _, found = disagreements(region, random_values(plan, draw), draw)
        assert not wrong
        total += found
    return total


@pytest.mark.parametrize("seeds", [range(8), pytest.param(range(8, 40), marks=pytest.mark.slow)], ids=len)
def test_structured_plans_agree_with_the_oracle_at_random_values(seeds):
    found = sum(compare(random_parameters(structured(seed), seed), seeded(seed), 3) for seed in seeds)
    assert found > len(seeds)  # it is not that nothing is ever possible


@pytest.mark.parametrize("epsilon", [Fraction(0), Fraction(1, 4), Fraction(1, 1000)])
def test_plans_of_all_kinds_agree_with_the_oracle_at_random_values(epsilon):
    found = 0
    for seed in range(25):
        draw = seeded(f"{seed}/{epsilon}")
        plan = plans.random_plan(draw)
        plan = type(plan)(plan.network, plan.conditions, plan.effects, epsilon)
        found += compare(random_parameters(plan, seed), draw, 6)
    assert found > 20


def test_the_kitchen_as_the_guide_tells_it():
    plan = parametric(stories.kitchen().plan(), "coffee=duration:make-coffee", "limit=at-most:e1:e44")
    region = LabeledRegionSearch(plan).run()
    cereal = {"xA1": "mug", "xA2": "coffee", "xA3": "cereal", "xA4": "cereal"}
    at_seven = region.region(cereal).slice({"limit": Fraction(7)})
    assert at_seven.pieces[0].extent("coffee").upper == Fraction("5.284")
    bagel = region.region(cereal | {"xA3": "bagel", "xA4": "bagel"})
    assert bagel.slice({"limit": Fraction(7)}).pieces[0].extent("coffee").upper == Fraction("2.783")
    assert bagel.slice({"coffee": Fraction(3)}).pieces[0].extent("limit").lower == Fraction("7.217")
    assert region.region(cereal | {"xA2": "juice"}).is_empty


def test_exact_cells_are_disjoint_cover_everything_and_say_what_is_possible():
    plan = parametric(stories.kitchen().plan(), "coffee=duration:make-coffee", "limit=at-most:e1:e44")
    region = LabeledRegionSearch(plan).run()
    cells = region.exactly()
    draw = seeded(7)
    for _ in range(200):
        values = random_values(plan, draw)
        inside = [possible for possible, cell in cells if values in cell]
        assert len(inside) == 1
        assert {one.choices for one in inside[0]} == set(region.possible(values))


def test_combinations_cover_all_values_once():
    plan = random_parameters(structured(3), 3)
    region = LabeledRegionSearch(plan).run()
    domains = plan.plan.network.domains
    covered = [one for each in region.combinations for one in full(each.choices, domains, region.key)]
    assert len(covered) == len(set(covered))
    assert set(covered) == set(full({}, domains, region.key))


def test_assumed_choices_are_not_told_apart_and_hold():
    plan = parametric(stories.kitchen().plan(), "coffee=duration:make-coffee")
    region = LabeledRegionSearch(plan, assume=guard({"xA1": "glass"})).run()
    assert "xA1" not in region.key
    assert all(piece.polyhedron.is_universal for piece in region.pieces)  # no coffee is made


def test_a_key_of_one_choice_leaves_the_others_as_it_suits():
    plan = parametric(stories.wing().plan(), "pick=duration:(pick human *)")
    one = LabeledRegionSearch(plan, ["h1"]).run()
    both = LabeledRegionSearch(plan, ["h1", "h2"]).run()
    for value in ("pliers", "cleco", "both"):
        wide = one.region({"h1": value})
        assert all(both.region({"h1": value, "h2": other}).is_subset_of(wide) for other in ("pliers", "both"))
    assert set(uncontrollable(plan)) == {"h1", "h2"}


def test_pieces_hold_only_what_is_possible_strictly():
    plan = parametric(strict(stories.kitchen().plan()), "coffee=duration:make-coffee")
    region = LabeledRegionSearch(plan, assume=guard({"xA1": "mug"})).run()
    [upper] = {piece.polyhedron.extent("coffee").upper for piece in region.pieces if "cereal" in str(piece.label)}
    assert upper == Fraction("5.284")  # the network's own separations stay
    assert all(isinstance(piece.polyhedron, Polyhedron) for piece in region.pieces)


def failing(monkeypatch, answers, failure="z3 crashed"):
    """Solvers give so many answers, and fail from then on."""
    check, numbers = Session.check, count(1)

    def answer(session, *asked):
        if next(numbers) <= answers:
            return check(session, *asked)
        session.failure = failure
        return Satisfiability.UNKNOWN

    monkeypatch.setattr(Session, "check", answer)


def test_what_is_found_before_a_solver_fails_is_kept_and_not_called_out_of_time(monkeypatch):
    plan = parametric(stories.kitchen().plan(), "coffee=duration:make-coffee", "limit=at-most:e1:e44")
    whole = LabeledRegionSearch(plan).run()
    failing(monkeypatch, 2)
    region = LabeledRegionSearch(plan).run()
    assert (region.status, region.reason, region.cut_short) == (Status.UNKNOWN, "z3 crashed", True)
    assert region.pieces == whole.pieces[:2]
    assert region.as_dict()["status"] == "unknown"
    assert "undecided, because z3 crashed" in str(region)


def test_a_box_among_what_is_found_before_a_solver_fails(monkeypatch):
    plan = parametric(stories.kitchen().plan(), "coffee=duration:make-coffee", "limit=at-most:e1:e44")
    whole = TeamEnvelopeSearch(plan).run()
    failing(monkeypatch, 4)
    envelope = TeamEnvelopeSearch(plan).run()
    assert (envelope.status, envelope.reason, envelope.verified) == (Status.UNKNOWN, "z3 crashed", True)
    assert whole.status is Status.COMPLETE
    assert Region.of_box(plan.names, envelope.box).is_subset_of(whole.region)


@pytest.mark.parametrize("failure", ["z3 crashed", None])
def test_a_solver_that_gives_up_without_time_limit_is_not_out_of_time(monkeypatch, failure):
    failing(monkeypatch, 0, failure)
    with pytest.raises(SolverError, match=failure or "the solver gave up, asked: anything"):
        satisfiable(Session(Terms()), "anything", Deadline())
    with pytest.raises(SolverError if failure else OutOfTimeError):
        satisfiable(Session(Terms()), "anything", Deadline.after(0))
