"""Labeled regions and boxes against the oracle, which is told values for parameters, whatever was asked before."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from functools import cache
from itertools import count, product
from pathlib import Path

import pytest

from robust import InputError, Region, SolverError, Status, pike
from robust.pike import Instance, Oracle, act, build, choose, parallel, sequence, within
from robust.pike_bridge.envelopes.pieces import ParametricEdge, _CertainOrder, cycles
from robust.pike_bridge.envelopes.search import LabeledRegionSearch, TeamEnvelopeSearch
from robust.pike_bridge.knowledge.sat import satisfiable
from robust.pike_bridge.model import guard
from robust.pike_bridge.online.world import Ending, Rehearsal, Story
from robust.plan.model import Parameter
from robust.plan.pddl.write import ActionText, sketched_domain, sketched_problem
from robust.qe.box import Side
from robust.qe.constraint import LinearConstraint
from robust.qe.polyhedron import Polyhedron
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Satisfiability, Session, Terms
from tests.pike_bridge import plans, stories
from tests.pike_bridge.envelopes import examples
from tests.pike_bridge.envelopes.examples import parametric, random_parameters, seeded, structured
from tests.sampling import often

COFFEE, LIMIT, LATE = "coffee=duration:make-coffee", "limit=at-most:e1:e44", "late=hesitation:xA1"
PICK = "pick=duration:(pick human *)"


@cache
def kitchen(*texts):
    return parametric(stories.kitchen().plan(), *texts)


@cache
def wing(*texts):
    return parametric(stories.wing().plan(), *texts)


@cache
def region_of(plan, *key, **assumed):
    return LabeledRegionSearch(plan, list(key) or None, assume=guard(assumed)).run()


def envelope(plan, *for_all, waiting=False, **assumed):
    return TeamEnvelopeSearch(plan, for_all=for_all, waiting=waiting, assume=guard(assumed)).run()


def compare(plan, draw, points):
    region = LabeledRegionSearch(plan).run()
    assert not region.cut_short
    return sum(examples.compare_with_oracle(region, examples.random_values(plan, draw), draw) for _ in range(points))


QUICK, SLOW = range(4), pytest.param("structured", range(4, 40), marks=pytest.mark.slow)


@pytest.mark.parametrize(
    ("kind", "seeds"),
    [("structured", QUICK), SLOW, *((Fraction(each), range(often(12, 25))) for each in ("0", "1/4", "1/1000"))],
)
def test_plans_agree_with_the_oracle_at_random_values(kind, seeds):
    """Structured ones, and those of all kinds by their ε."""
    possible = 0
    for seed in seeds:
        draw = seeded(seed if kind == "structured" else f"{seed}/{kind}")
        plan = structured(seed) if kind == "structured" else replace(plans.random_plan(draw), epsilon=kind)
        possible += compare(random_parameters(plan, seed), draw, 3 if kind == "structured" else 6)
    assert possible > min(len(seeds), 20)  # it is not that nothing is ever possible


def test_exact_cells_and_combinations_are_disjoint_and_cover_everything():
    plan, draw = kitchen(COFFEE, LIMIT), seeded(7)
    cells = region_of(plan).exactly()
    for _ in range(200):
        values = examples.random_values(plan, draw)
        [inside] = [possible for possible, cell in cells if values in cell]
        assert {each.choices for each in inside} == set(region_of(plan).possible(values))
    region = region_of(random_parameters(structured(3), 3))
    domains = {name: region.plan.plan.network.domains[name] for name in region.key}
    known = [{name: (value,) for name, value in each.choices} for each in region.combinations]
    covered = [assignment for each in known for assignment in product(*(domains | each).values())]
    assert sorted(covered) == sorted(product(*domains.values()))


def test_keys_what_is_assumed_and_whose_bounds_are_named():
    glass = region_of(kitchen(COFFEE), xA1="glass")
    assert "xA1" not in glass.key
    assert all(piece.polyhedron.is_universal for piece in glass.pieces)  # no coffee is made
    narrow, both = region_of(wing(PICK), "h1"), region_of(wing(PICK), "h1", "h2")
    for value in ("pliers", "cleco", "both"):
        wide = narrow.region({"h1": value})
        assert all(both.region({"h1": value, "h2": other}).is_subset_of(wide) for other in ("pliers", "both"))
    assert set(wing(PICK).plan.network.uncontrollable) == {"h1", "h2"}
    plan = parametric(replace(stories.kitchen().plan(), epsilon=Fraction(0)), COFFEE)
    pieces = region_of(plan, xA1="mug").pieces
    [upper] = {piece.polyhedron.extent("coffee").upper for piece in pieces if "cereal" in str(piece.label)}
    assert upper == Fraction("5.284")  # the network's own separations stay
    for kind, side, end, assumed in ("at-most", Side.LOWER, 3, {}), ("at-least", Side.UPPER, 5, {"xA3": "cereal"}):
        answer = envelope(kitchen(f"own={kind}:make-coffee"), xA1="mug", **assumed)
        assert (answer.box["own"].end(side), answer.stops["own", side].own) == (end, True)


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
    plan, crash = kitchen(COFFEE, LIMIT), (Status.UNKNOWN, "z3 crashed")
    whole, box = region_of(plan), envelope(plan)
    assert box.status is Status.COMPLETE
    with monkeypatch.context() as patch:
        failing(patch, 2)
        region = LabeledRegionSearch(plan).run()
    assert (region.status, region.reason, region.cut_short) == (*crash, True)
    assert region.pieces == whole.pieces[:2]
    assert region.as_dict()["status"] == "unknown"
    assert "undecided, because z3 crashed" in str(region)
    with monkeypatch.context() as patch:
        failing(patch, 4)
        early = envelope(plan)
    assert (early.status, early.reason, early.verified) == (*crash, True)
    assert Region.of_box(plan.names, early.box).is_subset_of(box.region)
    for failure in ("z3 crashed", None):  # without time limit it is not out of time
        failing(monkeypatch, 0, failure)
        with pytest.raises(SolverError, match=failure or "the solver gave up, asked: anything"):
            satisfiable(Session(Terms()), "anything", Deadline())
        with pytest.raises(SolverError if failure else OutOfTimeError):
            satisfiable(Session(Terms()), "anything", Deadline.after(0))


TINY = Fraction(1, 10**6)


def check_box(plan, for_all, seed, **assumed):
    """A box is inside, and every face is tight: by the oracle alone. How many faces are not where they are declared."""
    draw, found = seeded(seed), envelope(plan, *for_all, **assumed)
    domains = plan.plan.network.domains

    def holds(values):
        """Whether every combination of the choices has a correct execution."""
        oracle, combinations = Oracle(plan.at(values)), product(*(domains[name] for name in for_all))
        made = (guard(assumed) | guard(dict(zip(for_all, each, strict=True))) for each in combinations)
        return all(examples.exists(oracle.decide(each)) for each in made)

    if found.status is Status.INVALID:
        assert not holds(plan.nominal)
        return 0
    assert found.status is Status.COMPLETE
    assert plan.nominal in found.box
    for _ in range(6):
        intervals = found.box.intervals.items()
        ends = {name: [end for end in (each.lower, each.upper) if end is not None] for name, each in intervals}
        corner = {name: draw.choice(known or [found.box[name].some_value()]) for name, known in ends.items()}
        assert corner not in found.box or holds(corner), corner
    tight = 0
    for parameter, side in product(plan.declared, Side):
        face, end = (parameter.name, side), found.box[parameter.name].end(side)
        if end is not None:
            declared = found.stops[face].declared
            assert declared == (end == (parameter.lower if side is Side.LOWER else parameter.upper))
            if not declared:  # something is wrong just beyond
                beyond = Region.of_box(plan.names, found.box.moved(face, end + side.sign * TINY))
                point = found.region.point_outside(beyond)
                assert point is not None, face
                assert not holds(point), face
                tight += 1
    return tight


def test_boxes_of_structured_plans_the_wing_and_the_kitchen_are_inside_and_tight():
    tight = 0
    for seed in (1, 3, 7, 12):
        plan = random_parameters(structured(seed), seed)
        tight += check_box(plan, (), seed) + check_box(plan, plan.plan.network.uncontrollable[:1], seed)
    assert tight > 2
    assert check_box(wing(PICK, "limit=at-most:e1:e58"), ("h1", "h2"), 1) == 2

    for assumed in {}, {"xA1": "mug"}, {"xA1": "glass", "xR2": "milk"}:
        assert check_box(kitchen(COFFEE, LIMIT), (), 1, **assumed) > 0


def test_why_there_is_no_box():
    """Impossible combinations and what nominal values would do are named; what is found in time is kept."""
    impossible = envelope(kitchen(COFFEE), "xA1", "xA2")
    assert (impossible.status, impossible.possible) == (Status.INVALID, False)
    assert impossible.broken in {guard({"xA1": "mug", "xA2": "juice"}), guard({"xA1": "glass", "xA2": "coffee"})}
    outside = envelope(kitchen(f"{COFFEE},default=5.5"), xA1="mug")
    assert (outside.status, outside.possible, outside.verified) == (Status.INVALID, True, False)
    assert [str(each) for each in outside.needed] == ["coffee ≤ 1321/250"]
    late = TeamEnvelopeSearch(wing(PICK), for_all=["h1", "h2"], deadline=Deadline.after(0)).run()
    assert (late.status, late.verified) == (Status.TIMEOUT, False)
    with pytest.raises(InputError, match="unknown choice 'xA9'"):
        envelope(kitchen(COFFEE), "xA9")
    with pytest.raises(InputError, match="assumed to be mug"):
        envelope(kitchen(COFFEE), "xA1", xA1="mug")


def race(limit, robot_first=False):
    """A human chooses what to fetch; a robot must bring the same, and may begin before it is known."""
    human = choose("x", {"a": act("(fetch-a)", 2, 3), "b": act("(fetch-b)", 2, 3)}, controllable=False)
    robot = choose("y", {"a": act("(bring-a)", 4, 6), "b": act("(bring-b)", 4, 6)})
    both = sequence(robot, human) if robot_first else parallel(human, robot)
    network = build("race", within(sequence(both, act("(serve)", 1, 1)), upper=limit), epsilon=Fraction(1, 1000))
    actions = [ActionText("serve", at_start=("(done)",))]
    for item in "ab":
        actions.append(ActionText(f"fetch-{item}", end_effects=(f"(has-{item})",)))
        actions.append(ActionText(f"bring-{item}", at_end=(f"(has-{item})",), end_effects=("(done)",)))
    domain = sketched_domain("race", ("(has-a)", "(has-b)", "(done)"), actions)
    return Instance(network, domain, sketched_problem("race", "race", (), ())).plan()


@pytest.mark.parametrize("epsilon", [None, Fraction(0)])
def test_who_waits_needs_the_time_that_the_choice_takes(epsilon):
    team = race(9) if epsilon is None else replace(race(9), epsilon=epsilon)
    plan = parametric(team, "late=hesitation:x")
    knowing, waiting = envelope(plan, "x"), envelope(plan, "x", waiting=True)
    # Whoever knows begins to bring at once, so that only the fetching has to be done in time: late + 2 ≤ 8.
    # Whoever waits begins to bring when it is known: late + 4 ≤ 8. The rest are separations of 1/1000.
    assert knowing.verified
    assert waiting.verified
    assert Fraction(5) < knowing.box["late"].upper < 6
    assert Fraction("3.9") < waiting.box["late"].upper < 4


def test_what_copies_share_makes_no_difference(monkeypatch):
    asked = [(kitchen(COFFEE, LATE), ["xA1"]), (kitchen(COFFEE, LATE), ["xA1", "xA3"])]
    asked += [(parametric(race(9, robot_first=first), "late=hesitation:x"), ["x"]) for first in (True, False)]
    drawn = [random_parameters(structured(seed), seed) for seed in range(often(1, 2))]
    asked += [(plan, plan.plan.network.uncontrollable[:2]) for plan in drawn]
    together = [envelope(plan, *for_all, waiting=True) for plan, for_all in asked]
    monkeypatch.setattr(_CertainOrder, "no_later", lambda *_: False)
    for shared, (plan, for_all) in zip(together, asked, strict=True):
        apart = envelope(plan, *for_all, waiting=True)
        assert (shared.box, shared.verified, shared.status) == (apart.box, apart.verified, apart.status)
        assert shared.region.is_subset_of(apart.region)
        assert apart.region.is_subset_of(shared.region)
    assert sum(each.verified for each in together) > 2


def test_waiting_promises_no_more_than_knowing_and_nobody_can_wait_for_what_comes_too_late():
    for texts in (COFFEE, LIMIT), (LATE, "get=duration:(get human mug)"):
        knowing, waiting = (envelope(kitchen(*texts), "xA1", waiting=waiting) for waiting in (False, True))
        assert waiting.region.is_subset_of(knowing.region)
    late, eager = (parametric(race(30, robot_first=first), "serve=duration:serve") for first in (True, False))
    assert envelope(late, "x").verified is False  # bringing ends before fetching
    assert envelope(eager, "x", waiting=True).verified


@pytest.mark.parametrize(
    ("team", "texts", "name"),
    [(stories.kitchen().plan(), (COFFEE, LATE), "xA1"), (race(9), ("late=hesitation:x", "serve=duration:serve"), "x")],
)
def test_the_patient_executive_keeps_what_boxes_promise_and_nobody_does_more(team, texts, name):
    """Held against an executive to whom the choice becomes known as late as its event can be."""
    plan = parametric(team, *texts)
    found = envelope(plan, name, waiting=True)

    def succeeds(values, value):
        known = values["late"] + 2 * team.epsilon  # the initial state and the first event come before
        told = Story(outcomes={name: (value, known)})
        return Rehearsal(plan.at(values), told, infer=False).run().ending is Ending.SUCCEEDED

    far = {parameter: interval.upper for parameter, interval in found.box.intervals.items()}
    late = far | {"late": far["late"] + Fraction(1, 100)}
    assert all(succeeds(far, value) for value in team.network.domains[name])
    assert late not in found.region
    assert not all(succeeds(late, value) for value in team.network.domains[name])


def edge(source, target, constant, origin, strict=False, **factors):
    return ParametricEdge(source, target, Fraction(constant), factors, strict, origin)


def random_edges(draw, names):
    points = [f"t{at}" for at in range(draw.randint(2, 5))]
    for number in range(draw.randint(3, 9)):
        source, target = draw.sample(points, 2)
        factors = {name: draw.choice((-1, 1)) for name in names if draw.random() < 0.35}
        yield edge(source, target, Fraction(draw.randint(-4, 6), 2), number, draw.random() < 0.3, **factors)


def by_fourier_motzkin(edges, parameters, bounds):
    times = sorted({end for each in edges for end in (each.source, each.target)})
    names = tuple(each.name for each in parameters)
    constraints = list(bounds)
    for each in edges:
        form = {each.target: 1, each.source: -1, **{name: -factor for name, factor in each.factors.items()}}
        constraints.append(LinearConstraint.of(form, "<" if each.strict else "<=", each.constant))
    return Polyhedron((*names, *times), tuple(constraints)).project(names)


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_cycles_are_the_projection_within_the_bounds(count):
    """And each follows from the edges that it names."""
    draw, names, empty = seeded(f"differences/{count}"), tuple(f"p{at}" for at in range(count)), 0
    for _ in range(60):
        ends = [(draw.choice((None, Fraction(0))), draw.choice((None, Fraction(4)))) for _ in names]
        parameters = [
            Parameter(name, Fraction(1), lower=lower, upper=upper)
            for name, (lower, upper) in zip(names, ends, strict=True)
        ]
        sides = ((each, end) for each in parameters for end in ((">=", each.lower), ("<=", each.upper)))
        bounds = [LinearConstraint.of({each.name: 1}, sign, end) for each, (sign, end) in sides if end is not None]
        edges = list(random_edges(draw, names))
        expected, answer = by_fourier_motzkin(edges, parameters, bounds), cycles(edges, parameters)
        polyhedron = Polyhedron(names, (*(each.constraint for each in answer), *bounds))
        assert polyhedron.equals(expected), edges
        for cycle in answer:
            behind = [each for each in edges if each.origin in cycle.origins]
            assert by_fourier_motzkin(behind, parameters, ()).satisfies(cycle.constraint)
        empty += expected.is_empty
    assert 2 < empty < 58


def test_events_at_the_same_time_are_one():
    same = [edge("a", "b", 0, 0), edge("b", "a", 0, 1)]
    [cycle] = cycles([*same, edge("a", "c", 0, 2, p=1), edge("c", "b", -3, 3)], [Parameter("p", Fraction(1))])
    assert str(cycle.constraint) == "p ≥ 3"
    assert [each.constraint.is_false for each in cycles([edge("a", "b", 0, 0, True), same[1]], [])] == [True]
    with pytest.raises(OutOfTimeError):
        cycles(same, [], Deadline.after(0))


ROOT = Path(__file__).resolve().parents[3]
QUESTIONS = ("region", "region of all choices", "some choices", "all choices", "all choices, waiting")
ORDERS = ("forward", "backward", "shuffled", "alone")


def plan_of(number):
    """A structured plan or one of any other kind, with random parameters."""
    epsilon = (Fraction(0), Fraction(1, 4), Fraction(1, 1000))[number // 2 % 3]
    plan = structured(number) if number % 2 else replace(plans.random_plan(seeded(number)), epsilon=epsilon)
    return random_parameters(plan, number)


def answer(number, question):
    """Print what a program reads of it, but for how long it took."""
    plan = plan_of(number)
    if question.startswith("region"):
        result = pike.region(plan, choices=list(plan.plan.network.domains) if "all" in question else None)
    else:
        theirs = [each.name for each in plan.plan.network.choices if not each.controllable and "all" in question]
        result = pike.envelope(plan, for_all=theirs, patience=bool(theirs) and question.endswith("waiting"))
    document = {key: value for key, value in result.as_dict().items() if key != "seconds"}
    print(json.dumps([f"{number} {question}", document]), flush=True)  # noqa: T201 - to whoever started this


def answer_all(numbers, order):
    """All questions about some plans in an order, with other questions in between unless each is asked alone, in a
    process of its own."""
    questions = list(product(numbers, QUESTIONS))
    if order == "shuffled":
        seeded("order").shuffle(questions)
    for number, question in questions[::-1] if order == "backward" else questions:
        if order != "alone":
            answer(number, question)
            if number % 3 == 0:
                pike.check(plan_of(number).plan, all_scenarios=True)
        elif (child := os.fork()) == 0:
            answer(number, question)
            os._exit(0)
        else:
            assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


@pytest.mark.parametrize(
    ("numbers", "orders"),
    [(range(97, 98), ("forward", "backward")), pytest.param(range(300), ORDERS, marks=pytest.mark.slow)],
)
def test_no_history_changes_an_answer(numbers, orders):
    """By order in a process that hashes texts in its own way."""
    command = [sys.executable, "-m", __name__, f"{numbers.start}:{numbers.stop}"]
    running = [
        subprocess.Popen(
            [*command, order], env={**os.environ, "PYTHONHASHSEED": str(seed)}, cwd=ROOT, stdout=subprocess.PIPE
        )
        for seed, order in enumerate(orders, 1)
    ]
    answers = [dict(map(json.loads, process.communicate()[0].splitlines())) for process in running]
    assert len(answers[0]) == len(numbers) * len(QUESTIONS)
    assert answers == [answers[0]] * len(orders)


if __name__ == "__main__":
    answer_all(range(*map(int, sys.argv[1].split(":"))), sys.argv[2])
