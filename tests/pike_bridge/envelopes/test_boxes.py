"""Boxes: inside, maximal, explained; boxes for executions that wait against a search for strategies."""

from dataclasses import replace
from fractions import Fraction
from itertools import product

import pytest

from robust.errors import InputError
from robust.pike_bridge.action_model import Instance
from robust.pike_bridge.builder import act, build, choose, parallel, sequence, within
from robust.pike_bridge.envelopes.pieces import _CertainOrder
from robust.pike_bridge.envelopes.search import TeamEnvelopeSearch
from robust.pike_bridge.model import guard
from robust.pike_bridge.online.world import Ending, Rehearsal, Story
from robust.pike_bridge.semantics import ExecutionExistence, Oracle
from robust.plan.pddl.write import ActionText, sketched_domain, sketched_problem
from robust.qe.box import Side
from robust.qe.region import Region
from robust.searching import Status
from robust.smt.limits import Deadline
from tests.pike_bridge import stories
from tests.pike_bridge.envelopes.examples import parametric, random_parameters, seeded, structured

TINY = Fraction(1, 10**6)


def holds_by_oracle(plan, values, assume, for_all):
    """Whether every combination of the choices has a correct execution, by the oracle, one after the other."""
    oracle = Oracle(plan.at(values))
    domains = plan.plan.network.domains
    return all(
        oracle.decide(assume | guard(dict(zip(for_all, each, strict=True)))).verdict is ExecutionExistence.EXISTS
        for each in product(*(domains[name] for name in for_all))
    )


def corner(box, draw):
    """A corner of the box, or a point inside where it has no end."""
    return {
        name: draw.choice([end for end in (one.lower, one.upper) if end is not None] or [one.some_value()])
        for name, one in box.intervals.items()
    }


def beyond(found, name, side):
    """A point of the box but for one parameter, which is just beyond a face, where what is promised is not so."""
    moved = found.box.moved((name, side), found.box[name].end(side) + side.sign * TINY)
    return found.region.point_outside(Region.of_box(found.plan.names, moved))


def check_box(plan, assume, for_all, seed):
    """A box is inside, and every face is tight: by the oracle alone."""
    draw = seeded(seed)
    found = TeamEnvelopeSearch(plan, assume=assume, for_all=for_all).run()
    if found.status is Status.INVALID:
        assert not holds_by_oracle(plan, plan.nominal, assume, for_all)
        return 0
    assert found.status is Status.COMPLETE
    assert plan.nominal in found.box
    for _ in range(6):
        point = corner(found.box, draw)
        if point in found.box:
            assert holds_by_oracle(plan, point, assume, for_all), point
    tight = 0
    for one in plan.declared:
        for side in Side:
            end = found.box[one.name].end(side)
            if end is None:
                continue
            stop = found.stops[one.name, side]
            assert stop.declared == (end == (one.lower if side is Side.LOWER else one.upper))
            if not stop.declared:
                point = beyond(found, one.name, side)
                assert point is not None, (one.name, side)
                assert not holds_by_oracle(plan, point, assume, for_all), (one.name, side)
                tight += 1
    return tight


def test_boxes_of_structured_plans_are_inside_and_tight():
    tight = 0
    for seed in (1, 3, 7, 12):
        plan = random_parameters(structured(seed), seed)
        tight += check_box(plan, guard({}), (), seed)
        open_choices = [one.name for one in plan.plan.network.choices if not one.controllable][:1]
        tight += check_box(plan, guard({}), tuple(open_choices), seed)
    assert tight > 2


@pytest.mark.parametrize("assume", [{}, {"xA1": "mug"}, {"xA1": "glass", "xR2": "milk"}])
def test_boxes_of_the_kitchen_are_inside_and_tight(assume):
    plan = parametric(stories.kitchen().plan(), "coffee=duration:make-coffee", "limit=at-most:e1:e44")
    assert check_box(plan, guard(assume), (), 1) > 0


def test_boxes_of_the_wing_are_inside_and_tight_whatever_is_picked():
    plan = parametric(stories.wing().plan(), "pick=duration:(pick human *)", "limit=at-most:e1:e58")
    assert check_box(plan, guard({}), ("h1", "h2"), 1) == 2


def test_the_stories_as_the_guide_tells_them():
    plan = parametric(stories.kitchen().plan(), "coffee=duration:make-coffee", "limit=at-most:e1:e44")
    box = TeamEnvelopeSearch(plan, for_all=["xA1"]).run().box
    assert (box["coffee"].upper, box["limit"].lower) == (Fraction("4.142"), Fraction("5.858"))
    late = parametric(stories.kitchen().plan(), "coffee=duration:make-coffee,default=2.5", "late=hesitation:xA1")
    box = TeamEnvelopeSearch(late, for_all=["xA1"], waiting=True).run().box
    assert (box["coffee"].upper, box["late"].upper) == (Fraction("3.8915"), Fraction("1.3915"))
    short = parametric(stories.wing().plan(), "pick=duration:(pick human *)", "limit=at-most:e1:e58,default=120")
    box = TeamEnvelopeSearch(short, for_all=["h1", "h2"]).run().box
    assert (box["pick"].upper, box["limit"].lower) == (Fraction("15.996"), Fraction("109.004"))


def test_an_activity_s_own_other_bound_is_named():
    plan = parametric(stories.kitchen().plan(), "most=at-most:make-coffee")
    found = TeamEnvelopeSearch(plan, assume=guard({"xA1": "mug"})).run()
    assert found.box["most"].lower == 3
    assert found.stops["most", Side.LOWER].own
    upper = parametric(stories.kitchen().plan(), "least=at-least:make-coffee")
    found = TeamEnvelopeSearch(upper, assume=guard({"xA1": "mug", "xA3": "cereal"})).run()
    assert found.box["least"].upper == 5
    assert found.stops["least", Side.UPPER].own


def test_impossible_combinations_are_named():
    plan = parametric(stories.kitchen().plan(), "coffee=duration:make-coffee")
    found = TeamEnvelopeSearch(plan, for_all=["xA1", "xA2"]).run()
    assert (found.status, found.possible) == (Status.INVALID, False)
    assert found.broken in {guard({"xA1": "mug", "xA2": "juice"}), guard({"xA1": "glass", "xA2": "coffee"})}


def test_nominal_values_outside_are_told_with_what_would_do():
    plan = parametric(stories.kitchen().plan(), "coffee=duration:make-coffee,default=5.5")
    found = TeamEnvelopeSearch(plan, assume=guard({"xA1": "mug"})).run()
    assert (found.status, found.possible, found.verified) == (Status.INVALID, True, False)
    assert [str(one) for one in found.needed] == ["coffee ≤ 1321/250"]


def test_searches_that_are_out_of_time_keep_what_they_have():
    plan = parametric(stories.wing().plan(), "pick=duration:(pick human *)")
    found = TeamEnvelopeSearch(plan, for_all=["h1", "h2"], deadline=Deadline.after(0)).run()
    assert found.status is Status.TIMEOUT
    assert not found.verified


def test_unknown_and_assumed_choices_are_refused():
    plan = parametric(stories.kitchen().plan(), "coffee=duration:make-coffee")
    with pytest.raises(InputError, match="unknown choice 'xA9'"):
        TeamEnvelopeSearch(plan, for_all=["xA9"])
    with pytest.raises(InputError, match="assumed to be mug"):
        TeamEnvelopeSearch(plan, for_all=["xA1"], assume=guard({"xA1": "mug"}))


# -- waiting -----------------------------------------------------------------------------------------------------------


def race(limit, robot_first):
    """A human chooses what to fetch; a robot must bring the same, and may begin before it is known."""
    human = choose("x", {"a": act("(fetch-a)", 2, 3), "b": act("(fetch-b)", 2, 3)}, controllable=False)
    robot = choose("y", {"a": act("(bring-a)", 4, 6), "b": act("(bring-b)", 4, 6)})
    both = sequence(robot, human) if robot_first else parallel(human, robot)
    network = build("race", within(sequence(both, act("(serve)", 1, 1)), upper=limit), epsilon=Fraction(1, 1000))
    actions = [
        ActionText("fetch-a", end_effects=("(has-a)",)),
        ActionText("fetch-b", end_effects=("(has-b)",)),
        ActionText("bring-a", at_end=("(has-a)",), end_effects=("(done)",)),
        ActionText("bring-b", at_end=("(has-b)",), end_effects=("(done)",)),
        ActionText("serve", at_start=("(done)",)),
    ]
    predicates = ("(has-a)", "(has-b)", "(done)")
    domain, problem = sketched_domain("race", predicates, actions), sketched_problem("race", "race", (), ())
    return Instance(network, domain, problem).plan()


def test_who_waits_needs_the_time_that_the_choice_takes():
    team = race(9, robot_first=False)
    plan = parametric(team, "late=hesitation:x")
    knowing = TeamEnvelopeSearch(plan, for_all=["x"]).run()
    waiting = TeamEnvelopeSearch(plan, for_all=["x"], waiting=True).run()
    assert knowing.verified
    assert waiting.verified
    # Whoever knows begins to bring at once, so that only the fetching has to be done in time: late + 2 ≤ 8.
    # Whoever waits begins to bring when it is known: late + 4 ≤ 8. The rest are separations of 1/1000.
    assert Fraction(5) < knowing.box["late"].upper < 6
    assert Fraction("3.9") < waiting.box["late"].upper < 4


def test_waiting_promises_no_more_than_knowing():
    for texts, for_all in (
        (("coffee=duration:make-coffee", "limit=at-most:e1:e44"), ["xA1"]),
        (("late=hesitation:xA1", "get=duration:(get human mug)"), ["xA1"]),
    ):
        plan = parametric(stories.kitchen().plan(), *texts)
        knowing = TeamEnvelopeSearch(plan, for_all=for_all).run()
        waiting = TeamEnvelopeSearch(plan, for_all=for_all, waiting=True).run()
        assert waiting.region.is_subset_of(knowing.region)


def waited(plan, for_all):
    return TeamEnvelopeSearch(plan, for_all=for_all, waiting=True).run()


def test_what_copies_share_makes_no_difference(monkeypatch):
    kitchen = parametric(stories.kitchen().plan(), "coffee=duration:make-coffee", "late=hesitation:xA1")
    asked = [(kitchen, ["xA1"]), (kitchen, ["xA1", "xA3"])]
    asked += [(parametric(race(9, robot_first=first), "late=hesitation:x"), ["x"]) for first in (True, False)]
    for seed in range(4):
        plan = random_parameters(structured(seed), seed)
        asked.append((plan, [one.name for one in plan.plan.network.choices if not one.controllable][:2]))
    together = [waited(*each) for each in asked]
    monkeypatch.setattr(_CertainOrder, "no_later", lambda *_: False)
    apart = [waited(*each) for each in asked]
    for one, other in zip(together, apart, strict=True):
        assert (one.box, one.verified, one.status) == (other.box, other.verified, other.status)
        assert one.region.is_subset_of(other.region)
        assert other.region.is_subset_of(one.region)
    assert sum(one.verified for one in together) > 2


def test_nobody_can_wait_for_what_comes_too_late():
    plan = parametric(race(30, robot_first=True), "serve=duration:serve")
    assert TeamEnvelopeSearch(plan, for_all=["x"]).run().verified is False  # bringing ends before fetching
    eager = parametric(race(30, robot_first=False), "serve=duration:serve")
    assert TeamEnvelopeSearch(eager, for_all=["x"], waiting=True).run().verified


def test_waiting_keeps_the_strict_order_without_epsilon():
    team = replace(race(9, robot_first=False), epsilon=Fraction(0))
    found = TeamEnvelopeSearch(parametric(team, "late=hesitation:x"), for_all=["x"], waiting=True).run()
    assert found.verified
    assert Fraction("3.9") < found.box["late"].upper < 4


def succeeds(plan, values, name, value):
    """Whether a patient executive has a correct execution if a choice becomes known as late as its event can be."""
    known = values["late"] + 2 * plan.plan.epsilon  # the initial state and the first event come before
    told = Story(outcomes={name: (value, known)})
    return Rehearsal(plan.at(values), told, infer=False).run().ending is Ending.SUCCEEDED


@pytest.mark.parametrize(
    ("team", "texts", "name"),
    [
        (stories.kitchen().plan(), ("coffee=duration:make-coffee", "late=hesitation:xA1"), "xA1"),
        (race(9, robot_first=False), ("late=hesitation:x", "serve=duration:serve"), "x"),
    ],
)
def test_the_patient_executive_keeps_what_boxes_promise_and_nobody_does_more(team, texts, name):
    plan = parametric(team, *texts)
    found = TeamEnvelopeSearch(plan, for_all=[name], waiting=True).run()
    values = team.network.domains[name]
    far = {one: interval.upper for one, interval in found.box.intervals.items()}
    assert all(succeeds(plan, far, name, value) for value in values)
    late = far | {"late": far["late"] + Fraction(1, 100)}
    assert late not in found.region
    assert not all(succeeds(plan, late, name, value) for value in values)
