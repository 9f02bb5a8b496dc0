"""Boxes of plans: what is contingent, what is decided, the part that is controllable, and the widest boxes."""

from fractions import Fraction
from functools import cache
from itertools import product
from random import Random

import pytest

from robust import InputError, UnsupportedError, envelope
from robust.execute.controllability import Control, Controllability, ControlVerdict, Objective, shrink, widest
from robust.execute.controllable_boxes import HORIZON, Dynamically, GrowingBox, KnownSet, ends_of, loss, parametric_stnu
from robust.plan import model
from robust.qe.box import Box, Side
from robust.qe.polyhedron import Polyhedron
from robust.smt.limits import NEVER, Deadline, OutOfTimeError
from tests.cli import inputs
from tests.cli.running import answer_of, command, example
from tests.encode.asking import Judge
from tests.execute import plans
from tests.execute.plans import EPSILON, box_of, interval, text_of
from tests.network import oracles
from tests.plan.building import expression_of, reference
from tests.sampling import often

NOMINAL = Fraction(4)


def bound(value):
    """A number, None, a polynomial, or the name of a parameter."""
    return reference(value) if isinstance(value, str) else None if value is None else expression_of(value)


def plan_of(parameters, instances, constraints, literals=()):
    """A plan that has nothing but a network; constraints are (source, target, lower, upper), time points by name."""
    chosen = tuple(model.Parameter(name, NOMINAL) if isinstance(name, str) else name for name in parameters)
    actions = tuple(model.ActionInstance(name, "do", (), durative=True) for name in instances)
    at = {"Z": model.ZERO, **{str(p): p for action in actions for p in action.time_points}}
    bounds = tuple(model.TemporalConstraint(at[a], at[b], *map(bound, ends)) for a, b, *ends in constraints)
    return model.ParametrizedPlan("network", chosen, actions, bounds, frozenset(), {}, tuple(literals), ())


TWO = [("a.start", "a.end", "p", "p"), ("b.start", "b.end", "q", "q")]


def two(*constraints, extra=()):
    """Two actions whose durations are parameters, with requirements."""
    return plan_of(["p", "q", *extra], "ab", [*TWO, *constraints])


MEET = two(("a.end", "b.start", -1, 2))
"""The start of b is to be close to the end of a, at most one before."""
YES, NO, OPEN = ControlVerdict.CONTROLLABLE, ControlVerdict.NOT_CONTROLLABLE, ControlVerdict.UNKNOWN


def verdicts(plan, box):
    return tuple(finding.verdict for finding in Controllability(plan, box).findings())


def dynamic(plan, box):
    return Controllability(plan, box).finding(Control.DYNAMIC)


MINUS = -bound("p")
ROUND = [("a.end", "b.start", "r", "r"), ("b.end", "a.start", "r", "r")]
FIXED = [("b.start", "b.end", 3, 3), ("a.end", "b.end", 1, 1)]


@pytest.mark.parametrize(
    ("constraints", "intervals", "expected"),
    [
        (
            [TWO[0], ("Z", "b.start", "s", "s"), *FIXED],
            {"p": (1, None), "s": (0, 9)},
            {"a.start a.end": (1, None), ".zero b.start": (0, 9), "b.start b.end": (3, 3)},
        ),
        # turned so that they have a length
        (
            [("a.end", "a.start", MINUS, MINUS), ("b.start", "a.end", "d", "d")],
            {"p": (2, 5), "d": (-3, -1)},
            {"a.start a.end": (2, 5), "a.end b.start": (1, 3)},
        ),
        ([("b.start", "a.start", "d", "d")], {"d": (-3, -1)}, {"a.start b.start": (1, 3)}),
        # each time point ends one, and none goes round
        (
            [*TWO, *ROUND],
            {"p": (1, 2), "q": (1, 2), "r": (1, 2)},
            {"a.start a.end": (1, 2), "b.start b.end": (1, 2), "a.end b.start": (1, 2)},
        ),
    ],
)
def test_durations_and_starts_are_contingent(constraints, intervals, expected):
    box = box_of(**intervals)
    links = parametric_stnu(plan_of(intervals, "ab", constraints), box).at(ends_of(box)).contingents
    assert {f"{link.source} {link.target}": (link.lower, link.upper) for link in links} == expected


def test_a_timed_literal_is_no_end_and_bounds_are_linear():
    plan = plan_of([], "a", [], [model.TimedLiteral(Fraction(7), model.Atom("dark"), value=True)])
    links = parametric_stnu(plan, Box({})).at({}).links
    (fixed,) = [link for link in links if not link.is_contingent and link.upper is not None]
    assert (fixed.lower, fixed.upper, fixed.source) == (7, 7, model.ZERO)
    square = bound("p") * bound("p")
    with pytest.raises(UnsupportedError, match="not linear"):
        parametric_stnu(plan_of("p", "a", [("a.start", "a.end", square, square)]), box_of(p=(1, 2)))


BEFORE = ("b.start", "a.end", 1, 3)
AFTER_W = ("a.start", "b.start", "w", "w")
WINDOW = plan_of("w", "a", [("Z", "a.start", "w", bound("w") + 3)])
COOLING = plan_of("pw", "ab", [TWO[0], ("a.end", "b.start", "w", 9)])
LONG_BEFORE = two(("b.start", "a.end", 1, 6))


@pytest.mark.parametrize(
    ("plan", "intervals", "expected"),
    [
        (two(("Z", "b.end", 0, 9)), {"p": (3, 7), "q": (1, 10)}, (NO, NO, NO)),
        # A parameter that is not in the network does not matter.
        (two(("a.end", "b.start", -1, 2), extra=["r"]), {"p": (3, 7), "q": (1, 9), "r": (None, None)}, (YES, YES, NO)),
        # What may never end is no matter for those who see it.
        (MEET, {"p": (3, None), "q": (1, None)}, (YES, YES, NO)),
        (two(("a.end", "b.start", -2, -1)), {"p": (3, None), "q": (1, None)}, (YES, NO, NO)),
        (two(("a.end", "b.start", 0, None)), {"p": (3, None), "q": (1, None)}, (YES, YES, NO)),
        # A parameter in a requirement is hidden.
        (COOLING, {"p": (1, 5), "w": (2, 8)}, (YES, YES, NO)),
        (plan_of("w", "ab", [AFTER_W, ("Z", "b.start", "w", "w")]), {"w": (2, 8)}, (YES, YES, YES)),
        (WINDOW, {"w": (2, 5)}, (YES, YES, YES)),
        (WINDOW, {"w": (2, 8)}, (YES, OPEN, NO)),
        (plan_of("w", "a", [("Z", "a.start", "w", None)]), {"w": (2, None)}, (YES, OPEN, NO)),
        # Both ways round.
        (plan_of("w", "ab", [AFTER_W]), {"w": (-1, 2)}, (YES, YES, YES)),
    ],
)
def test_verdicts(plan, intervals, expected):
    assert verdicts(plan, box_of(**intervals)) == expected


def test_a_shared_parameter_is_decided_as_far_as_possible():
    """Both take as long: whoever sees the first end knows the second."""
    box = box_of(p=(1, 9))
    again = [("a.start", "a.end", "p", "p"), ("a.end", "b.start", 0, 0), ("b.start", "b.end", "p", "p")]
    assert verdicts(plan_of("p", "ab", again), box) == (YES, YES, NO)
    # c ends with b: found out in time, but not by a network with independent links.
    finding = dynamic(plan_of("p", "abc", [*again, ("c.start", "c.end", 1, 1), ("c.end", "b.end", 0, 0)]), box)
    reason = "p is the length of 2 links, the first of which reveals the others"
    assert (finding.verdict, finding.reason) == (OPEN, reason)
    # Even who knows p cannot make b end that early.
    finding = dynamic(plan_of("p", "ab", [*again, ("Z", "b.end", 0, 10)]), box)
    assert finding.verdict is NO
    assert finding.reason.endswith("even if p = 9 is known")
    # Two that start together and take equally long end together, although neither end is known.
    together = [("a.start", "a.end", "p", "p"), ("b.start", "b.end", "p", "p"), ("a.end", "b.end", 0, 0)]
    asked = Controllability(plan_of("p", "ab", together), box)
    assert [finding.verdict for finding in asked.findings()] == [YES, YES, YES]
    assert (asked.shrunk(Control.DYNAMIC).box, asked.waits()) == (box, ())


def test_a_link_that_may_end_before_it_starts_is_left_open():
    chain = [("c.start", "c.end", "p", "p"), ("c.end", "a.start", 0, 0), ("a.start", "b.start", "d", "d")]
    plan, box = plan_of(["p", model.Parameter("d", Fraction(1))], "abc", chain), box_of(p=(2, 3), d=(-1, 2))
    finding = dynamic(plan, box)
    assert (finding.verdict, "may end before it starts" in finding.reason) == (OPEN, True)
    assert shrink(plan, box, Control.DYNAMIC) == box_of(p=(2, 3), d=(0, 2))
    assert shrink(WINDOW, box_of(w=(2, 8)), Control.DYNAMIC) == box_of(w=("5/2", "11/2"))


def test_running_out_of_time_is_unknown():
    asked = Controllability(MEET, box_of(p=(3, 7), q=(1, 9)), deadline=Deadline.after(0))
    finding = asked.finding(Control.DYNAMIC)
    assert (finding.verdict, finding.reason) == (OPEN, "out of time")
    with pytest.raises(OutOfTimeError):
        asked.shrunk(Control.DYNAMIC)


@pytest.mark.parametrize(
    ("plan", "kind", "p", "q", "expected"),
    [
        (two(BEFORE), Control.DYNAMIC, "[1, 9]", "[1, 9]", "[3, 5]"),
        (MEET, Control.STRONG, "[1, 9]", "[1, 9]", "[5/2, 11/2]"),
        (MEET, Control.STRONG, "[3, 9]", "[1, 9]", "[3, 6]"),
        # Infinite ends come back where they have to.
        (LONG_BEFORE, Control.DYNAMIC, "[3, inf)", "[1, inf)", "[3, 8]"),
        (LONG_BEFORE, Control.STRONG, "[1, inf)", "[1, inf)", "[3/2, 13/2]"),
        # Open ends stay open.
        (LONG_BEFORE, Control.DYNAMIC, "(1, 9]", "[1, inf)", "[3/2, 13/2]"),
        (LONG_BEFORE, Control.DYNAMIC, "(3, 9]", "[1, inf)", "(3, 8]"),
        (LONG_BEFORE, Control.DYNAMIC, "[1, 8)", "[1, inf)", "[3/2, 13/2]"),
        (LONG_BEFORE, Control.DYNAMIC, "[3, 8)", "[1, inf)", "[3, 8)"),
        # Weakly controllable is the box itself; one beside the nominal point shrinks to its middle.
        (MEET, Control.WEAK, "[1, 9]", "[1, 9]", "[1, 9]"),
        (two(BEFORE), Control.DYNAMIC, "[10, 20]", "[1, 9]", "[14, 16]"),
    ],
)
def test_the_controllable_part_is_max_min_fair(plan, kind, p, q, expected):
    assert str(shrink(plan, box_of(p=p, q=q), kind)) == f"p ∈ {expected}, q ∈ {q}"


def test_weights_what_is_lost_and_faces_that_may_be_anywhere_but_not_nowhere():
    heavy = plan_of([model.Parameter("p", NOMINAL, Fraction(2)), "q"], "ab", [*TWO, ("a.end", "b.end", -3, 3)])
    box = box_of(p=(0, 9), q=(0, 9))
    part = shrink(heavy, box, Control.STRONG)
    assert (part, loss(box, part).share) == (box_of(p=(2, 6), q=(3, 5)), Fraction(12, 18))
    after, box = two(("a.end", "b.start", 0, None)), box_of(p=(1, None), q=(1, None))
    shrunk = Controllability(after, box).shrunk(Control.STRONG)
    assert shrunk.box == box_of(p=(1, NOMINAL + HORIZON), q=(1, None))
    assert shrunk.cut == (("p", Side.UPPER),)
    assert verdicts(after, shrunk.box) == (YES, YES, YES)
    lost = loss(box, shrunk.box)
    assert (lost.share, lost.faces["p", Side.UPPER], lost.faces["q", Side.UPPER]) == (None, None, 0)
    assert shrink(after, box, Control.DYNAMIC) == box


def random_plan(rng):
    """Three actions of uncertain length with requirements between their ends; most have schedules."""
    names = "abc"[: rng.randint(2, 3)]
    parameters = [model.Parameter(f"p{name}", NOMINAL, Fraction(rng.choice([1, 1, 2]))) for name in names]
    constraints = [(f"{name}.start", f"{name}.end", f"p{name}", f"p{name}") for name in names]
    points = [f"{name}.{side}" for name in names for side in ("start", "end")]
    for _ in range(rng.randint(1, 4)):
        constraints.append((*rng.sample(points, 2), low := rng.randint(-6, 4), low + rng.randint(1, 7)))
    return plan_of(parameters, names, constraints)


def random_box(seed, most):
    """A random plan, and a box of at most twice that width around its nominal values."""
    plan = random_plan(rng := Random(seed))  # noqa: S311
    ends = {p.name: (NOMINAL - rng.randint(0, most), NOMINAL + rng.randint(0, most)) for p in plan.parameters}
    return rng, plan, box_of(**ends)


def strong_oracle(stnu):
    """A schedule of the starts that suits every corner: one network with the requirements of all corners."""
    links = stnu.contingents
    before = {link.target: link for link in links}
    edges = {}
    for corner in product(*((link.lower, link.upper) for link in links)):
        length = dict(zip(links, corner, strict=True))
        place = {p: (before[p].source, length[before[p]]) if p in before else (p, Fraction(0)) for p in stnu.points}
        for link in stnu.links:
            if not link.is_contingent:
                (a, before_a), (b, before_b) = place[link.source], place[link.target]
                lower, upper = (None if e is None else e + before_a - before_b for e in (link.lower, link.upper))
                oracles.bound(edges, a, b, lower, upper)
    return oracles.consistent(stnu.points, edges)


def by_oracle(kind, plan, box):
    decide = (oracles.weak_by_corners, oracles.dynamic_by_reductions, strong_oracle)[list(Control).index(kind)]
    return decide(parametric_stnu(plan, box).at(ends_of(box)))


@pytest.mark.parametrize("kind", [Control.DYNAMIC, Control.STRONG])
def test_parts_are_controllable_and_no_face_can_move(kind):
    kept, tiny = list[bool](), Fraction(1, 10**6)
    for seed in range(often(70, 110)):
        plan = random_plan(Random(seed))  # noqa: S311
        box = box_of(**{p.name: (1, Random(seed).choice([6, 9])) for p in plan.parameters})  # noqa: S311
        if not by_oracle(Control.DYNAMIC, plan, Box.nominal(plan.parameters)):
            with pytest.raises(InputError, match="no schedule at the nominal values"):
                shrink(plan, box, kind)
            continue
        part = shrink(plan, box, kind)
        kept.append(part == box)
        assert kept[-1] is by_oracle(kind, plan, box), seed
        assert by_oracle(kind, plan, part), seed
        assert Controllability(plan, part).finding(kind).verdict is YES
        for name, side in product(part.intervals, Side):
            assert part[name].is_within(box[name])
            end = part[name].end(side)
            wider = part.moved((name, side), end + side.sign * tiny)
            assert end == box[name].end(side) or not by_oracle(kind, plan, wider), (seed, name, side)
    assert 3 < sum(kept) < len(kept) - 15


def test_a_leap_leads_to_a_wider_box_that_is_controllable_whatever_was_met_before():
    leaps = []
    for seed in range(often(70, 400)):
        plan = random_plan(Random(seed))  # noqa: S311
        start = Box.nominal(plan.parameters)
        if not by_oracle(Control.DYNAMIC, plan, start):
            continue
        most = box_of(**{p.name: (1, Random(seed).choice([6, 9])) for p in plan.parameters})  # noqa: S311
        beyond = (half for side in most.constraints() for half in side.negation())
        bad = KnownSet(tuple(Polyhedron(tuple(most), (half,)) for half in beyond))
        wanted = Dynamically(parametric_stnu(plan, start), NEVER)
        met, fixed = [*bad.pieces], tuple(most)[:1] if seed % 3 == 0 else ()
        for _ in range(2):  # the second time, all is known that it may meet
            growing = GrowingBox(bad, wanted, plan.parameters, start, met, fixed)
            growing.leap(NEVER)
            assert start.is_within(growing.box)
            assert by_oracle(Control.DYNAMIC, plan, growing.box), seed
            assert not any(piece.meets(growing.box) for piece in met)
            assert all(growing.box[name].width == 0 for name in fixed)
            leaps.append(growing.box != start)
    assert sum(leaps) > len(leaps) / 2 > 20


@pytest.mark.parametrize(("seeds", "most"), [(often(70, 110), 2), (often(50, 80), 1)])
def test_verdicts_agree_with_slow_ways_and_imply_each_other_and_a_strong_schedule_suits_all_values(seeds, most):
    seen, suited = set(), 0
    for seed in range(seeds):
        rng, plan, box = random_box(seed, most)
        controllable = weakly, dynamically, strongly = tuple(verdict is YES for verdict in verdicts(plan, box))
        assert controllable == tuple(by_oracle(kind, plan, box) for kind in Control), seed
        assert weakly >= dynamically >= strongly
        seen.add(controllable)
        asked = Controllability(plan, box)
        schedule, stnu = asked.strong_answer().schedule, asked.network.at(ends_of(box))
        for _ in range(0 if schedule is None else 10):
            times = {p: schedule.get(p, Fraction(0)) for p in stnu.executable}
            for link in stnu.contingents:
                share = Fraction(rng.randint(0, 10), 10)
                times[link.target] = times[link.source] + link.lower + (link.upper - link.lower) * share
            assert all(oracles.satisfies(link, times) for link in stnu.links if not link.is_contingent), seed
            suited += 1
    assert len(seen) == 4
    assert suited > 100


def said(tmp_path, low, *options):
    """The lines about a plan for tea, which is to be ready when the guest comes, but not long before."""
    texts = map(text_of, ("visit.pddl", "visit-problem.pddl", "visit.stn"))
    files = inputs.write(tmp_path, *(text.replace("LOW", low) for text in texts))
    ended = command("envelope", *files, "--controllability", "dynamic", *options)
    assert (ended.code, ended.err) == (0, "")
    return [" ".join(line.split()) for line in ended.out.splitlines() if line.strip(" ─")]


def test_text_says_what_is_lost_and_why_and_shows_waits(tmp_path):
    lines = said(tmp_path, "1")[-10:]
    expected = text_of("visit.txt").replace("REQUIREMENT", "c: f.end - b.end in [1, 5] (line 7)").splitlines()
    assert lines[2].startswith(expected.pop(2).removesuffix("STRONG"))
    assert lines[:2] + lines[3:] == expected
    assert said(tmp_path, "-3")[-1] == "b.start waits for f.end, at most 13 after f.start"
    quiet = said(tmp_path, "-3", "--quiet")
    assert quiet[-3:] == ["controllable: weakly", "controllable: dynamically", "not controllable: strongly"]


def test_an_invalid_plan_has_no_verdict():
    asked = (*example("plan-flexible-wait.stn"), "--controllability", "dynamic")
    answer = answer_of(command("envelope", *asked, "--json"))
    assert (answer["status"], answer["controllability"]) == ("invalid", None)
    assert "controllable" not in command("envelope", *asked).out
    assert "medium" in command("envelope", *example(), "--controllability", "medium").err


F = Fraction
GROWN = Objective(EPSILON, "relational")
AROUND = Objective(EPSILON, "relational", optimal=True, contain_nominal=True)
ANYWHERE = Objective(EPSILON, "relational", optimal=True)
KINDS = pytest.mark.parametrize("kind", [Control.DYNAMIC, Control.STRONG], ids=lambda kind: kind.value)


@cache
def overlapping():
    """The second task must start from 1 to 2 before the first one ends; the third comes after it, and ends by 30."""
    constraints = (
        "w1.end - w2.start in [1, 2]",
        "w2.end - w2.start in [4, 4]",
        "w3.end - w3.start in [third, third]",
        "w3.start - w1.end in [0.001, inf]",
        "w3.end - .zero in [0, 30]",
    )
    text = "parameter third default 5;" + plans.working(*constraints, on="abc")
    return plans.tasks(text, problem=plans.nothing_else("abc"))


def test_what_one_parameter_gives_back_another_one_takes():
    plan = overlapping()
    box = envelope(plan).box
    assert box["third"] == interval("[1, 24999/2000]")
    shrunk = shrink(plan, box, Control.DYNAMIC)
    assert shrunk["first"] == interval("[19/2, 21/2]")
    result = widest(plan, shrunk, Control.DYNAMIC, GROWN)
    assert result.box == box_of(first="[19/2, 21/2]", third="[1, 19499/1000]")
    assert {(face[0], face[1].value): stop.name.partition(":")[0] for face, stop in result.stops.items()} == {
        ("first", "lower"): "not dynamically controllable beyond",
        ("first", "upper"): "not dynamically controllable beyond",
        ("third", "lower"): "w3 work",
        ("third", "upper"): "not dynamically controllable beyond",
    }
    assert "w1.end - w2.start in [1, 2]" in result.stops["first", Side.UPPER].name


@KINDS
def test_the_widest_of_all_is_proved_by_cutting_planes(kind):
    plan = overlapping()
    around, anywhere = (widest(plan, Box.nominal(plan.parameters), kind, objective) for objective in (AROUND, ANYWHERE))
    assert (around.box, around.bound) == (box_of(first="[9, 10]", third="[1, 19999/1000]"), F(19999, 1000))
    # what is certain of the first is all for the third
    assert (anywhere.box, anywhere.bound) == (box_of(first="[1, 1]", third="[1, 28999/1000]"), F(27999, 1000))


def stands(judge, box, kind):
    """Whether a box is in the envelope and controllable, asked of what widening does not use."""
    return judge.contains(box) and Controllability(judge.plan, box).finding(kind).verdict is ControlVerdict.CONTROLLABLE


@KINDS
@pytest.mark.parametrize("seed", [*range(3), *(pytest.param(n, marks=pytest.mark.slow) for n in range(3, 60))])
def test_no_face_can_move_outwards(seed, kind):
    plan, valid = plans.drawn_with_box(Random(f"widest {seed}"))  # noqa: S311 - reproducible
    shrunk = shrink(plan, valid, kind)
    result = widest(plan, shrunk, kind, GROWN)
    box, judge = result.box, Judge(plan, EPSILON)
    assert all(part.is_within(box[name]) for name, part in shrunk.intervals.items())
    assert stands(judge, box, kind)
    for (name, side), stop in result.stops.items():
        assert stop.name
        end = box[name].end(side)
        assert not stands(judge, box.moved((name, side), end + side.sign * F(1, 10**6)), kind), (name, side, stop)
    best = widest(plan, shrunk, kind, AROUND)
    assert stands(judge, best.box, kind)
    if None not in {box.total_width, best.box.total_width}:
        assert best.box.total_width >= box.total_width
