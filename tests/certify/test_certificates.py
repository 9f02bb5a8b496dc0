"""Certificates of every kind: made, accepted by the checker, and only for what is true and has a meaning."""

import json
from contextlib import nullcontext, suppress
from fractions import Fraction
from random import Random

import pytest

from benchmarks.suite import read_deliveries, read_suite
from robust import Box, InputError, Interval, RefutedError, RobustError, UnsupportedError, check, envelope, region
from robust.certify import tape
from robust.certify.bad import declared_bounds, face_lines, lifted_lines, region_lines, shape_lines, side_of
from robust.certify.checker import reader
from robust.certify.checker.claims import SCHEDULED
from robust.certify.checker.formulas import Formulas
from robust.certify.produce import PlanCertificate, export, knowledge
from robust.certify.tape import header
from robust.encode import create_encoding
from robust.encode.encoding import RelationalEncoding
from robust.pike_bridge.action_model import load_team_plan
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region
from robust.reading import load_plan
from robust.smt.limits import Deadline, OutOfTimeError
from tests.certify import networks, tools
from tests.certify.adversary import BESIDE, PLAIN, TABLES, changed, same_region
from tests.certify.test_reader import meaningless
from tests.certify.texts import Texts, random_texts
from tests.pike_bridge.stories import sat_plan
from tests.sampling import often

STEP = Fraction(1, 100)


def soon():
    return Deadline.after(60)


def good(ground, box, solver="z3"):
    return tape.good_lines(ground, tools.EPSILON, box, solver=solver, deadline=soon())


def assert_region_is_certified(plan, ground):
    """The region, and the same with times if it can be said so."""
    whole = region(plan).region
    lines = region_lines(ground, tools.EPSILON, whole, deadline=soon())
    assert not isinstance(tools.judged([header("region"), *lines], ground), str)
    if (lifted := tools.lifted(plan)) is not None:
        lines = lifted_lines(ground, tools.EPSILON, lifted, deadline=soon())
        claim = tools.judged([header("region"), *lines], ground)
        assert not isinstance(claim, str), claim
        assert claim.text.endswith(SCHEDULED)
        assert same_region(claim, whole, plan, Random(0))


def assert_all_is_certified(plan, ground, solver="z3"):
    """The widest box and the region have certificates; the claim of the box, and the lines of its faces."""
    box = envelope(plan).box
    faces = [*face_lines(ground, create_encoding("relational", plan), box, solver=solver, deadline=soon())]
    claim = tools.judged([header("maximal", box), *good(ground, box, solver), *faces], ground)
    assert not isinstance(claim, str), claim
    assert_region_is_certified(plan, ground)
    return claim, faces


def assert_certified(files, *kinds):
    claims = [tools.judged(tools.made(files, kind), tools.grounded(files)) for kind in kinds]
    assert not [claim for claim in claims if isinstance(claim, str)]
    assert [(claim.kind, claim.epsilon) for claim in claims] == [(kind, tools.EPSILON) for kind in kinds]


@pytest.mark.parametrize("files", [tools.NAVIGATION, tools.GENERATOR], ids=["navigation", "generator"])
def test_examples(files):
    assert_certified(files, "plan", "box", "maximal", "shape", "region")


def test_recorded_plans(dataset):
    """One of each family; all are certified by `python -m benchmarks.certificates`."""
    recorded = {one.name: one.files for one in read_suite(dataset)}
    recorded |= {one.instance: files for one, files in read_deliveries(dataset)}
    for name in ("auv_mission_10_0_3", "generator_linear_05_2", "solar_rover_01_3", "delivery_g02_w06"):
        assert_certified(recorded[name], "plan", "maximal")
    for name in ("generator_linear_05_2", "solar_rover_01_2"):
        assert_certified(recorded[name], "shape", "region")


def pushed_out(lines):
    """A shape with one of its faces, or of its hull's, farther out."""
    (format_, kind, ends), (_, sides, point) = lines[:2]
    for place, (low, low_closed, high, high_closed) in enumerate(ends):
        for further in ((low, high and str(Fraction(high) + STEP)), (low and str(Fraction(low) - STEP), high)):
            moved = [further[0], low_closed, further[1], high_closed]
            yield [[format_, kind, tools.put(ends, place, moved)], *lines[1:]]
    for place, (form, strict) in enumerate(sides):
        values = dict(form) | {"": str(Fraction(dict(form).get("", 0)) + STEP)}
        moved = [sorted([name, value] for name, value in values.items() if value != "0"), strict]
        yield [lines[0], ["shape", tools.put(sides, place, moved), point], *lines[2:]]


def stated(lines, names):
    """The shape in the first two lines of a certificate."""
    (*_, ends), (_, sides, _) = lines[:2]
    box = {
        name: Interval(low and Fraction(low), high and Fraction(high), low_closed, high_closed)
        for name, (low, low_closed, high, high_closed) in zip(names, ends, strict=True)
    }
    hull = Polyhedron.of_box(names, Box(box))
    slanting = [side_of({name: Fraction(factor) for name, factor in form}, strict) for form, strict in sides]
    return Region.union_of(names, [Polyhedron(names, (*hull.constraints, *slanting))])


@pytest.mark.parametrize("first", range(0, often(20, 200), 20))
def test_shapes_of_random_plans(first):
    """No face can be moved; whatever is changed in a certificate, only what is inside the region is accepted."""
    shapes = accepted = 0
    for seed in range(first, first + 20):
        texts, random = random_texts(seed, easy=True), Random(seed)
        try:
            plan, ground = tools.assembled(texts), reader.ground(*texts)
            shape, whole = envelope(plan, shape="octagon").shape, region(plan).region
        except (InputError, UnsupportedError, reader.Unsupported):
            continue
        if shape is None or meaningless(tools.CHECKER, texts):
            continue
        lines = shape_lines(ground, tools.EPSILON, shape, solver="z3", deadline=soon())
        assert tools.judged(lines, ground).kind == "shape"
        shapes += 1
        for tried in (
            *pushed_out(lines),
            *([lines[0], *changed(lines[1:], lines, random)] for _ in range(often(40, 400))),
        ):
            if not isinstance(tools.judged(tried, ground), str):
                assert stated(tried, shape.parameters).is_subset_of(whole)
                accepted += 1
    assert shapes > 3
    assert accepted > 0


@pytest.mark.parametrize("first", range(0, often(40, 60), 20))
def test_random_plans(first):
    done = 0
    for seed in range(first, first + 20):
        texts = random_texts(seed, easy=True)
        try:
            plan, ground = tools.assembled(texts), reader.ground(*texts)
            proved = check(plan).answer.name == "PROVED"
        except (InputError, UnsupportedError, reader.Unsupported):
            continue
        if meaningless(tools.CHECKER, texts):
            continue
        with nullcontext() if proved else pytest.raises(RefutedError):
            lines = [header("plan"), *good(ground, Box.nominal(plan.parameters))]
            assert not isinstance(tools.judged(lines, ground), str)
        if plan.parameters:
            (assert_all_is_certified if proved else assert_region_is_certified)(plan, ground)
        done += 1
    assert done > 8


SMALL = """(define (domain d) (:predicates (p)) (:functions (f))
 (:durative-action a :parameters () :duration (and (>= ?duration 1) (<= ?duration 1)) :condition {}
  :effect (and (at start (increase (f) 1)) (at end (p)))))"""
PROBLEM = "(define (problem x) (:domain d) (:init (= (f) 0)) (:goal (and)))"
HEAD = "parameter k default 1; durative-action instance i : (a);"
FLEXIBLE = f"{HEAD} c: i.start - .zero in [k, inf]; c: i.end - i.start in [1, 1]; c: i.end - .zero in [-inf, 4];"
TWO = f"parameter n default 2; {HEAD} c: i.start - .zero in [k, n]; c: i.end - i.start in [1, 1];"


def small(condition="()", plan=FLEXIBLE):
    return Texts(SMALL.format(condition), PROBLEM, plan)


@pytest.mark.parametrize("solver", ["z3", "cvc5"])
@pytest.mark.parametrize(
    ("condition", "plan"),
    [("()", FLEXIBLE), ("()", TWO), ("(at end (<= (f) 1))", FLEXIBLE), ("(over all (< (f) 2))", FLEXIBLE)],
)
def test_small_plans(condition, plan, solver):
    texts = small(condition, plan)
    ours = tools.assembled(texts)
    assert plan == TWO or str(envelope(ours).box) == "k ∈ (-inf, 3]"
    claim, faces = assert_all_is_certified(ours, reader.ground(*texts), solver)
    assert any(line[0] == "cycle" for line in faces)
    assert "no other valid box" in claim.text


def test_schedules_that_move_with_the_parameters():
    """No constant times suit the box, affine ones do; a corner without any is said."""
    tied = small(plan=TWO.replace("[k, n]", "[k, k]") + "c: .zero - i.end in [-inf, n];")
    ranges = {"k": (Fraction(0), Fraction(5)), "n": (Fraction(2), Fraction(2))}
    # the start is tied to k
    assert tape.constant_times(Formulas(reader.ground(*tied), tools.EPSILON), ranges) is not None
    bound = FLEXIBLE.replace("[k, inf]", "[k, 3]") + "c: i.start - .zero in [-inf, k];"
    ground = reader.ground(*small(plan=bound))
    facts = tape.box_facts(Box({"k": Interval(Fraction(0), Fraction(3))}))
    assert tape.affine_times(Formulas(ground, tools.EPSILON), facts, solver="z3", deadline=soon()) is not None
    with pytest.raises(RefutedError, match="allows no schedule"):
        good(ground, Box({"k": Interval(Fraction(4), Fraction(5))}))


def test_orders_and_circles_of_a_network():
    ground = reader.ground(*small())
    orders = tape.OrderLemmas(ground, {"k": (Fraction(2), Fraction(3))})
    assert [orders.get((0, 2)), orders.get((0, 1)), orders.get((2, 1)), orders.get((1, 1), 7)] == [3, 2, None, 7]
    lemmas = {(a, b): (path, bound) for a, b, path, bound, _ in orders.lemmas()}
    assert lemmas.keys() == {(0, 1), (0, 2)}
    assert tape.positive_circle(ground, {"k": Fraction(3)}) is None
    circle = tape.positive_circle(ground, {"k": Fraction(7, 2)})
    assert circle is not None
    assert {ground.edges[number][:2] for number in circle} == {(0, 1), (1, 2), (2, 0)}


def test_what_is_not_true_has_no_certificate():
    plan, ground = load_plan(*tools.NAVIGATION), tools.grounded(tools.NAVIGATION)
    box, exact = envelope(plan).box, region(plan).region
    with pytest.raises(RefutedError, match="a schedule breaks"):
        good(ground, box.replace("to_ridge", Interval(Fraction(25), Fraction(37))))
    smaller = box.replace("to_ridge", Interval(Fraction(26), Fraction(36)))
    with pytest.raises(UnsupportedError, match="can be moved"):
        tools.made(tools.NAVIGATION, "maximal", box=smaller)
    for wrong, error in ((exact.universe, RefutedError), (exact.nothing, UnsupportedError)):
        with pytest.raises(error):
            region_lines(ground, tools.EPSILON, wrong(exact.parameters), deadline=soon())
    with pytest.raises(OutOfTimeError):
        tape.good_lines(ground, tools.EPSILON, box, solver="z3", deadline=Deadline.after(0))
    assert declared_bounds(ground).intervals.keys() == box.intervals.keys()


def test_a_construct_that_the_checker_does_not_know(tmp_path):
    files = tools.written(small(), tmp_path)
    plan = load_plan(*files)
    tools.written(small()._replace(domain=SMALL.replace("(:functions (f))", "(:functions (f)) (:event x)")), tmp_path)
    with pytest.raises(UnsupportedError, match="the checker of certificates does not read this"):
        PlanCertificate(files, plan)


@pytest.mark.parametrize("epsilon", [Fraction(0), tools.EPSILON])
def test_epsilon_zero_and_conditions_of_one_name(epsilon, tmp_path):
    """Two conditions of one action that look alike; separations that are none."""
    condition = "(and (at end (>= ?duration 1)) (at end (>= ?duration 1)) (at start (>= ?duration 1)))"
    files = tools.written(small(condition), tmp_path)
    lines = tools.made(files, "maximal", epsilon=epsilon)
    assert not isinstance(tools.judged(lines, tools.grounded(files), epsilon=epsilon), str)


def test_a_certificate_of_another_network(tmp_path):
    wrong = sat_plan([[1, 2], [-1, 2], [1, -2], [-1, -2]]).write(tmp_path / "wrong")
    right = sat_plan([[1, 2], [-1, 2], [1, -2]]).write(tmp_path / "right")
    lines = knowledge(wrong, tools.EPSILON, soon())
    assert tools.command(lines, tmp_path / "c", [wrong])[0] == 0
    asked = (([right], {}), ([wrong], {"kind": "plan"}), (tools.NAVIGATION, {}))
    assert [tools.ask(tmp_path / "c", files, **demanded)[0] for files, demanded in asked] == [1, 1, 1]
    with pytest.raises(RefutedError):
        knowledge(right, tools.EPSILON, soon())


@pytest.mark.filterwarnings("ignore")
def test_proofs_by_another_solver(tmp_path):
    plan = load_plan(*tools.NAVIGATION)
    encoding, box = RelationalEncoding(plan), envelope(plan).box
    assert export(encoding, box, tmp_path / "proofs", soon()) >= 0
    with pytest.raises(OutOfTimeError):
        export(encoding, box, tmp_path, Deadline.after(0))
    wider = box.replace("to_ridge", Interval(Fraction(0), Fraction(100)))
    with pytest.raises(RefutedError, match="a schedule breaks"):
        export(encoding, wider, tmp_path, Deadline())


DOMAIN = """(define (domain d) (:predicates (p) (q)) (:functions (f) (g) (h) (unset))
 (:durative-action a :parameters () :duration (and (>= ?duration 1) (<= ?duration 2)) :condition ()
  :effect (and {})))"""
ITS_PROBLEM = "(define (problem x) (:domain d) (:init (p) (= (f) 0) (= (g) 1) (= (h) 0)) (:goal (and)))"
ONE = "durative-action instance i : (a); c: i.start - .zero in [1, 1]; c: i.end - i.start in [1, 2];"
TWICE = ONE + "durative-action instance j : (a); c: j.start - i.start in [{0}, {0}]; c: j.end - j.start in [1, 2];"


def claim(effects, epsilon=tools.EPSILON, plan=ONE):
    """What the checker says of the certificate that is as honest as one can be."""
    ground = reader.ground(DOMAIN.format(effects), ITS_PROBLEM, plan)
    lines = tape.good_lines(ground, epsilon, Box({}), solver="z3", deadline=soon())
    return tools.judged([header("plan"), *lines], ground, epsilon=epsilon)


@pytest.mark.parametrize("effect", TABLES["undefined"])
@pytest.mark.parametrize("epsilon", [Fraction(0), tools.EPSILON])
def test_effects_that_nothing_reads_have_a_meaning(effect, epsilon):
    with pytest.raises((reader.Unsupported, RefutedError)):
        claim(effect, epsilon)
    texts = Texts(DOMAIN.format(effect), ITS_PROBLEM, ONE)
    if "0)" in effect:  # a division by zero is refused where it is read
        with pytest.raises(reader.Unsupported):
            reader.ground(*texts)
        return
    ground = reader.ground(*texts)
    kept = ["kept", *[[] for _ in ground.edges]]
    times = [[["", "1"]], [["", "2"]]]
    for refuted in range(5):
        for schedule in (times, times[1:], []):
            refutations = [["refute", [[], [0, [1, 0]]]]] * refuted
            forged = [header("plan"), ["orders"], ["schedule", *schedule], kept, *refutations]
            assert isinstance(tools.judged(forged, ground, epsilon=epsilon), str)


@pytest.mark.parametrize("conditions", [("(p)", "(p)"), ("(p)", "(not (q))"), ("(>= (g) 1)", "(and)"), ("(p)", "(q)")])
def test_two_changes_in_one_happening_are_a_conflict(conditions):
    """Whether they are in force together is an obligation of its own; (p) and (q) never are."""
    effects = [f"(at end (when {condition} (assign (f) {value})))" for value, condition in enumerate(conditions)]
    never = conditions == ("(p)", "(q)")
    with nullcontext() if never else pytest.raises((RefutedError, reader.Unsupported)):
        assert not isinstance(claim(" ".join(effects)), str)


@pytest.mark.parametrize("effect", ["(at start (assign (f) 1))", "(at start (q)) (at end (not (q)))"])
def test_without_a_separation_two_points_are_still_at_two_times(effect):
    for away, holds in (("0", "assign" not in effect), ("1/1000000", True), ("1", "assign" in effect)):
        with nullcontext() if holds else pytest.raises(RefutedError):
            plan = TWICE.format(away).replace("[1, 2]", "[1, 1]")
            assert not isinstance(claim(effect, Fraction(0), plan), str)


LASTING = Texts(
    "(define (domain d) (:durative-action d :parameters () :duration (= ?duration 10) :condition () :effect ()))",
    PLAIN.problem,
    "parameter k default 5 lb 0; durative-action instance i : (d); c: i.end - i.start in [k, k];",
)


@pytest.mark.parametrize(
    ("texts", "beside", "said"),
    [
        (*BESIDE, ", where x is (f) (1 in the problem), epsilon"),
        (LASTING, '[parameters.k]\nduration = "i"\n', ", where k is the duration of i (10 in the domain), epsilon"),
    ],
)
def test_the_claim_says_what_parameters_stand_for(texts, beside, said, tmp_path):
    files = tools.written(texts, tmp_path)
    files[2].with_suffix(".toml").write_text(beside, encoding="utf-8")
    code, answer = tools.command(tools.made(files, "plan"), tmp_path / "cert", files)
    assert (code, said in answer["claim"]) == (0, True)


def test_the_claim_names_files_that_the_network_names(tmp_path):
    path = networks.files(tmp_path, networks.patched({"domain": "./domain.pddl"}))
    code, answer = tools.command(networks.EXECUTION, tmp_path / "cert", [path])
    named = ", of domain './domain.pddl' and problem 'problem.pddl', epsilon = 1/1000"
    assert (code, named in answer["claim"]) == (0, True)


@pytest.mark.parametrize(
    "value",
    ["a\nestablished: all", "a\x1b[2K\x1b[1Aestablished", "a\x7f", "a\u2028b", "a\u202eb", "a, e9 at 7", "ä\ud800"],
)
@pytest.mark.parametrize("old", ['"x"', '"a"', '"e2"', '"small"', '"domain.pddl"'])
def test_names_never_reach_a_terminal_as_they_are(value, old, tmp_path):
    """One line of ASCII, in which a name that could be taken for something else is quoted."""
    path = networks.files(tmp_path, json.dumps(networks.DOCUMENT).replace(old, json.dumps(value)))
    _, answer = tools.command(networks.EXECUTION, tmp_path / "cert", [path])
    said = answer.get("claim") or answer["reason"]
    assert said.isascii() is said.isprintable() is True
    assert value not in said or f"{value}'" in said


@pytest.mark.parametrize(("kind", "codes"), [("refused", (1, 4)), ("unknown", (4,))])
def test_networks_that_this_package_refuses_or_the_checker_does_not_know(kind, codes, tmp_path):
    for number, changes in enumerate(networks.TABLES[kind]):
        path = networks.files(tmp_path / str(number), networks.patched(changes))
        with pytest.raises(RobustError) if kind == "refused" else suppress(RobustError):
            load_team_plan(path)
        assert tools.command(networks.OUT_OF_NOTHING, tmp_path / "cert", [path])[0] == 4, changes
        assert tools.command(networks.EXECUTION, tmp_path / "cert", [path])[0] in codes, changes


def spoilt(seed, directory):
    """A random network with some of its members exchanged."""
    random = Random(seed)
    path = networks.random_network(seed, directory)
    document = json.loads(path.read_text(encoding="utf-8"))
    events = [event["name"] for event in document["events"]]
    document["choices"].append({"name": "y", "domain": ["1", "2"], "controllable": True, "at": random.choice(events)})
    for _ in range(random.choice([1, 1, 2])):
        member = random.choice(document[random.choice(["choices", "events", "constraints", "activities"])])
        key = random.choice(sorted(member))
        guard = random.choice([{}, {"x": "1"}, {"x": "2"}, {"y": "1"}, {"x": "1", "y": "1"}, {"x": "3"}, {"z": "1"}])
        member[key] = random.choice(
            {
                "at": [*events, "e_initial", "nowhere"], "from": [*events, "e_goal"], "to": [*events, "e_initial"],
                "guard": [guard], "lower": [0, 1, 2, -1, "5/2", None], "upper": [0, 2, None, "1/2", -1, "x"],
            }.get(key, [member[key], member[key], "", 1, True, None])
        )  # fmt: skip
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


@pytest.mark.parametrize("seeds", [range(60), pytest.param(range(60, 4000), marks=pytest.mark.slow)], ids=str)
def test_whatever_this_package_refuses_the_checker_does_not_know(seeds, tmp_path):
    refused = 0
    for seed in seeds:
        path = spoilt(seed, tmp_path / str(seed))
        try:
            load_team_plan(path)
        except RobustError:
            refused += 1
            with pytest.raises((reader.Unsupported, *tools.MALFORMED)):
                networks.stated(tools.CHECKER, path, None)
    assert refused > len(seeds) / 4
