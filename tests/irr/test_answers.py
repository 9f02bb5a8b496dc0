"""What checks and searches say: whole answers, reasons, numbers of queries, and whom they ask."""

import logging
import re
from dataclasses import replace
from fractions import Fraction
from functools import partial
from itertools import product

import pytest

from robust import EnvelopeResult, InputError, Location, Status, check, compare, envelope, pike
from robust.encode.encoding import RelationalEncoding
from robust.irr.check import Answer, Checker, CheckResult, Counterexample
from robust.irr.containment import Containment, Refutation
from robust.options.declare import settings
from robust.pike_bridge.envelopes.search import TeamEnvelope
from robust.plan.model import ZERO, ParametrizedPlan, TemporalConstraint
from robust.plan.simulate import simulate
from robust.qe.box import Box, Interval, Side
from robust.qe.polyhedron import Polyhedron
from robust.smt.limits import NEVER
from robust.smt.session import Satisfiability, Session, Statistics
from tests.cli.running import EXAMPLES
from tests.irr.building import ask_solvers, fail_at_query, lasts, loose, parameter, shipped, timed, weighted
from tests.plan.building import DURATION, END, START, F, G, above, action, at_most, number, plan_of, reference, value

PLAN = timed(parameter("k", 6), pieces=lasts(3, 11))
NAMES = ["i act: non-negative duration", "i act: at end c0", "i act: at end c1"]
PROVED, REFUTED, UNKNOWN = Answer.PROVED, Answer.REFUTED, Answer.UNKNOWN
both_solvers = pytest.mark.parametrize("solver", ["z3", "cvc5"])
every_method = pytest.mark.parametrize("method", ["irr", "widen", "optimal"])


def box(low: int, high: Fraction | int) -> Box:
    return Box({"k": Interval(Fraction(low), Fraction(high))})


def timeless(result: CheckResult) -> CheckResult:
    assert result.seconds > 0
    return replace(result, seconds=0.0, statistics=Statistics())


def answer(within: Box, verdict: Answer, answers: list[Answer], shown=(), **more) -> CheckResult:
    named = dict(zip(NAMES, answers, strict=True))
    return CheckResult(verdict, within, named, dict(shown), 0.0, statistics=Statistics(), **more)


def shown(name: str, k: Fraction) -> dict[str, Counterexample]:
    """The only schedule there is with that length, as the simulator sees it."""
    [i] = PLAN.instances
    schedule = {ZERO: Fraction(0), i.start: Fraction(1), i.end: 1 + k}
    return {name: Counterexample(name, {"k": k}, schedule, simulate(PLAN, {"k": k}, schedule))}


@both_solvers
def test_whole_answers_of_checks(monkeypatch, solver) -> None:
    ask_solvers(monkeypatch)
    seen: list[tuple[int, int, str]] = []
    inside = check(PLAN, at=["k=3:11"], solver=solver, on_obligation=lambda *one: seen.append(one))
    assert timeless(inside) == answer(box(3, 11), PROVED, [PROVED] * 3, solver=solver)
    assert seen == [(index, 3, name) for index, name in enumerate(NAMES)]
    assert (inside.statistics.queries, inside.statistics.unsatisfiable, inside.cut_short) == (3, 3, False)
    for every, last in ((False, UNKNOWN), (True, PROVED)):
        result = check(PLAN, at=["k=2"], every=every, solver=solver)
        broken, answers = shown(NAMES[1], Fraction(2)), [PROVED, REFUTED, last]
        assert timeless(result) == answer(box(2, 2), REFUTED, answers, broken, solver=solver, every=every)
    with monkeypatch.context() as patched:
        asked: list[str] = []
        original = Session.check
        patched.setattr(Session, "check", lambda *given: asked.append(given[1]) or original(*given))
        check(PLAN, at=["k=2"], solver=solver)
        assert asked == [NAMES[0], NAMES[1], f"{NAMES[1]}: counterexample"]
    everything = check(PLAN, at=["k=0:inf"], every=True, solver=solver)
    assert [*everything.obligations.values()] == [PROVED, REFUTED, REFUTED]
    for name, example in everything.counterexamples.items():
        assert {name: example} == shown(name, example.parameters["k"])
    late = check(PLAN, timeout=0, solver=solver)
    assert timeless(late) == answer(box(6, 6), UNKNOWN, [UNKNOWN] * 3, timed_out=True, solver=solver)


def test_nothing_is_examined_where_schedules_are_not_known_to_exist(monkeypatch) -> None:
    ask_solvers(monkeypatch)
    seen: list[tuple[int, int, str]] = []
    options = {"at": ["k=0:5"], "on_obligation": lambda *one: seen.append(one)}
    known = check(loose(1), **options)
    assert (known.answer, len(seen), known.statistics.queries) == (PROVED, 1, 2)
    monkeypatch.setattr(Session, "check", lambda *_: Satisfiability.UNKNOWN)
    unknown = check(loose(1), **options)
    assert (unknown.answer, len(seen), unknown.cut_short, unknown.timed_out) == (UNKNOWN, 1, True, False)


@pytest.mark.parametrize("timed_out", [False, True])
def test_a_check_that_is_given_up_says_why(timed_out) -> None:
    checker = Checker(RelationalEncoding(PLAN), box(2, 4))
    ending = {"timed_out": timed_out, "interrupted": not timed_out}
    nothing = replace(answer(box(2, 4), UNKNOWN, [UNKNOWN] * 3, **ending), obligations={})  # not built yet
    assert timeless(checker.so_far(timed_out=timed_out)) == nothing
    done = checker.run()
    assert timeless(checker.so_far(timed_out=timed_out)) == timeless(replace(done, **ending))


@pytest.mark.parametrize(
    "search", [check, compare, *(partial(envelope, method=m) for m in ("irr", "widen", "optimal"))]
)
@pytest.mark.parametrize("place", [None, Location("late.stn", 3)])
def test_a_network_without_any_schedule_is_a_mistake(search, place) -> None:
    """i lasts 5, and ends by 1."""
    i = action("i")
    ends = ((i.start, i.end, number(5), number(5), place), (ZERO, i.end, number(0), number(1), None))
    constraints = tuple(TemporalConstraint(*each) for each in ends)
    with pytest.raises(InputError) as error:
        search(plan_of(i, parameters=(parameter("k", 1),), constraints=constraints))
    assert str(error.value) == (
        f"{'late.stn: ' if place else ''}the plan's network has no schedule: i.start ≥ 0; "
        f"c: i.end - i.start in [5, 5]{' (line 3)' if place else ''}; c: i.end - .zero in [0, 1] contradict each "
        "other; expected constraints that can hold together"
    )


def test_containment_does_not_ask_again(monkeypatch) -> None:
    ask_solvers(monkeypatch)
    containment = Containment(RelationalEncoding(PLAN))
    counted: list[int] = []
    for within in (box(3, 11), box(4, 10), box(3, 12), box(11, 12), box(2, 3)):
        containment.refute(within, NEVER)
        counted.append(containment.statistics.queries)
    assert counted[0] == counted[1] < counted[2] == counted[3] < counted[4]


CONTRADICTION = re.compile(
    r"no schedule( with [^:]*)?: (?:.*; )?c: i\.end - \.zero in \[-inf, k \+ 2\](?:; .*?)?( contradict .*)?"
)


def test_refutations_are_whole() -> None:
    containment = Containment(RelationalEncoding(PLAN), solver="cvc5")
    refutation = containment.refute(box(12, 12), NEVER)
    assert refutation == Refutation(NAMES[2], {"k": Fraction(12)}) == containment.refute(box(12, 14), NEVER)
    none = Containment(RelationalEncoding(loose(1))).refute(box(-3, 0), NEVER)
    assert CONTRADICTION.fullmatch(none.reason).groups() == (" with k = -3", " contradict each other")
    assert (none.values, none.facet.obligation) == ({"k": -3}, None)


@both_solvers
@every_method
def test_searches_ask_the_solver_that_they_name_and_write_each_query(monkeypatch, tmp_path, method, solver) -> None:
    ask_solvers(monkeypatch)
    asked: set[str] = set()
    make = Session.__init__
    noted = lambda *a, solver="z3", **b: make(*a, solver=asked.add(solver) or solver, **b)  # noqa: E731
    monkeypatch.setattr(Session, "__init__", noted)
    result = envelope(PLAN, method=method, solver=solver, smt2=tmp_path)
    assert len(list(tmp_path.iterdir())) == result.statistics.queries > 0
    known = {
        "irr": (1, box(3, Fraction(21, 2)), None),
        "widen": (None, box(3, 11), None),
        "optimal": (None, box(3, 11), 8),
    }
    assert (asked, result.solver, result.method, result.encoding) == ({solver}, solver, method, "relational")
    assert (result.status, result.beta, result.box, result.bound) == (Status.COMPLETE, *known[method])
    assert 0 < result.first_widening_seconds < result.seconds
    assert result.checks >= len(result.trace) > 0
    assert all(0 < step.seconds < result.seconds for step in result.trace)
    assert (result.verified, result.cut_short, result.reason, result.values) == (True, False, None, {})


@pytest.mark.parametrize("options", [{"method": "widen"}, {"method": "optimal", "contain_nominal": True}])
def test_the_nominal_point_is_known_before_anything_wider(monkeypatch, options) -> None:
    fail_at_query(monkeypatch, 7, "time")
    result = envelope(PLAN, **options)
    assert (result.status, result.verified, result.box) == (Status.TIMEOUT, True, box(6, 6))
    assert (result.trace, result.first_widening_seconds) == ((), None)


@pytest.mark.parametrize("method", ["irr", "widen"])
def test_an_invalid_plan_says_what_breaks(method) -> None:
    k = parameter("k", 2)
    broken = envelope(timed(k, pieces=lasts(3, 11)), method=method)
    assert (broken.status, broken.verified, broken.box, broken.trace) == (Status.INVALID, False, Box.nothing([k]), ())
    assert (broken.reason, broken.values) == (NAMES[1], {"k": Fraction(2)})
    nowhere = envelope(loose(-2), method=method)
    said = (" with k = -2", " contradict each other") if method == "irr" else (None, None)
    assert CONTRADICTION.fullmatch(nowhere.reason).groups() == said
    assert (nowhere.status, nowhere.values) == (Status.INVALID, {"k": Fraction(-2)})
    empty = envelope(timed(parameter("k", 6), pieces=lasts(6, 5)), method="optimal")
    reason = "the envelope is empty: no parameter values are inside"
    assert (empty.status, empty.reason, empty.values) == (Status.INVALID, reason, {"k": Fraction(6)})


def holds_nothing(result: EnvelopeResult | TeamEnvelope, status: Status, nominal: dict[str, Fraction]) -> None:
    """No value is in the box, or in one of its intervals, and no question takes it for a box."""
    assert (result.status, result.verified) == (status, False)
    assert nominal not in result.box
    assert all(value not in result.box[name] for name, value in nominal.items())
    assert list(result.box.intervals) == list(nominal)
    assert Polyhedron.of_box(tuple(nominal), result.box).is_empty
    for given in (result, result.box):
        with pytest.raises(InputError, match=r"the envelope has no verified box|is empty"):
            settings(given, None)
    ends = result.as_dict()["parameters"].values()
    assert not any(each["lower_closed"] or each["upper_closed"] for each in ends)


@pytest.mark.parametrize("method", ["widen", "irr", "optimal", "risk"])
def test_a_search_that_proved_nothing_has_a_box_without_values(monkeypatch, method) -> None:
    given = {"method": method, "distribution": ["k=normal:2:1"]} if method == "risk" else {"method": method}
    around = {"contain_nominal": True} if method == "optimal" else {}
    outside = {"k": Fraction(2)}
    nowhere, refuted = (timed(parameter("k", 2), pieces=lasts(*ends)) for ends in ((11, 3), (3, 11)))
    holds_nothing(envelope(nowhere, **given), Status.INVALID, outside)
    if method != "risk":
        holds_nothing(envelope(refuted, **given, **around), Status.INVALID, outside)
        broken = envelope(timed(length=number(2), pieces=lasts(3, 11)), **given)
        assert (broken.status, {} in broken.box) == (Status.INVALID, False)
    holds_nothing(envelope(PLAN, **given, timeout=0), Status.TIMEOUT, {"k": Fraction(6)})
    fail_at_query(monkeypatch, 1, KeyboardInterrupt)
    holds_nothing(envelope(PLAN, **given), Status.INTERRUPTED, {"k": Fraction(6)})


def test_a_box_of_people_s_choices_that_was_not_proved_has_no_values(monkeypatch) -> None:
    plan, coffee = EXAMPLES / "kitchen" / "kitchen.tpnu.json", "coffee=duration:make-coffee"
    for more in ({"assume": {"xA1": "mug"}}, {"for_all": ["xA1", "xA2"]}, {"for_all": ["xA1"], "patience": True}):
        late = pike.envelope(plan, f"{coffee},default=5.5", **more)
        holds_nothing(late, Status.INVALID, {"coffee": Fraction("5.5")})
    holds_nothing(pike.envelope(plan, coffee, timeout=0), Status.TIMEOUT, {"coffee": Fraction(3)})
    fail_at_query(monkeypatch, 1, KeyboardInterrupt)
    holds_nothing(pike.envelope(plan, coffee), Status.INTERRUPTED, {"coffee": Fraction(3)})


def test_steps_of_irr_are_logged(caplog) -> None:
    with caplog.at_level(logging.INFO, logger="robust.irr"):
        result = envelope(PLAN, method="irr", beta=4)
    words = {True: "grown", False: "blocked"}
    assert [record.getMessage() for record in caplog.records if record.name.startswith("robust.irr")] == [
        f"check {step.check}: k {step.side.value} {words[step.accepted]}" for step in result.trace
    ]
    tried = [(6, 6), (6, 6), (6, 9), (3, 9), (3, 9), (3, 9)]
    assert [(step.check, step.delta, step.box) for step in result.trace] == [
        (number + 1, 6 if number < 2 else 3, box(*ends)) for number, ends in enumerate(tried)
    ]


def strict(weight: int, *pieces, sign: int = 1) -> ParametrizedPlan:
    """i lasts k + m or k - m, with m above 0."""
    k, m = replace(parameter("k", 2, 0), weight=Fraction(weight)), parameter("m", 1, None, 4)
    pieces = ((START, above(value(F), number(0))), *pieces)
    plan = timed(k, m, length=reference("k") + reference("m").scaled(sign), pieces=pieces)
    return replace(plan, initial_fluents={F: reference("m"), G: reference("k")})


SHORT, SHORTER = (END, at_most(DURATION, 8)), (END, above(number(8), DURATION))
OPTIMA = {
    "pentagon": (shipped("two_sample_navigation"), 25, 25),
    "weighted": (shipped("two_sample_navigation", "to_crater,weight=3"), 75, 57),
    "open": (strict(1, SHORT), 8, 8),
    "approached": (strict(3, SHORT), 24, 22),
    "both": (strict(1, SHORTER), 8, 8),
    "sliding": (strict(3, SHORTER, sign=-1), 24, 24),
    "apart": (strict(3, (START, above(number(8), value(G))), sign=-1), 24, 22),
}


@pytest.mark.parametrize(
    ("name", "contain_nominal", "enumerated", "solver"),
    [
        *product(OPTIMA, (False, True), (20.0, 0.0), ("z3",)),
        ("weighted", False, 20.0, "cvc5"),
        ("approached", True, 20.0, "cvc5"),
    ],
)
def test_optima_do_not_depend_on_what_is_known_at_first(monkeypatch, name, contain_nominal, enumerated, solver) -> None:
    plan, free, around = OPTIMA[name]
    monkeypatch.setattr("robust.irr.exact.ENUMERATION", enumerated)
    result = envelope(plan, method="optimal", contain_nominal=contain_nominal, solver=solver)
    optimum = around if contain_nominal else free
    assert (result.status, result.bound) == (Status.COMPLETE, optimum)
    # Without a nominal point in it, the widest m is flat and only approaches 0.
    shortfall = 0 if contain_nominal or plan.instances[0].identifier != "i" else Fraction(free, 10**6)
    assert weighted(plan, result.box) == optimum - shortfall
    assert not contain_nominal or plan.nominal in result.box
    containment = Containment(RelationalEncoding(plan))
    assert containment.refute(result.box, NEVER) is None
    for which, side in product(result.box.intervals, Side):
        closed = result.box.moved((which, side), result.box[which].end(side))
        assert result.box[which].is_closed_at(side) or containment.refute(closed, NEVER)
