"""The checker that Coq proves right, where it is built: it says the same of certificates as the one in Python."""

import json
import re
import subprocess
import sys
from collections import Counter
from copy import copy
from fractions import Fraction
from itertools import accumulate
from pathlib import Path
from random import Random

import pytest

from benchmarks.suite import read_deliveries, read_suite
from robust.certify import CheckerOutcome, Demanded
from robust.certify.bad import region_lines
from robust.certify.checker.claims import Claim, Range, box_of, declared, nominal
from robust.certify.checker.formulas import Formulas, replaced
from robust.certify.checker.proofs import Rejected, Tape, sides
from robust.certify.checker.reader import Unsupported, constant
from robust.certify.hints import KnownFacts, NotRefutedError, refutation
from robust.certify.kernel import run
from robust.certify.kernel.claims import Translation
from robust.certify.kernel.questions import OpenFormulas
from robust.certify.kernel.run import opinions
from robust.certify.tape import header, positive_circle, write
from robust.errors import InputError, RefutedError, RobustError, UnsupportedError
from robust.qe.region import Region
from robust.smt.limits import NEVER, Deadline, OutOfTimeError
from tests.certify import adversary, tools
from tests.certify.texts import Texts, random_texts, tangled_texts

KERNEL = Path(__file__).parents[2] / "proofs" / "kernel" / "robust-kernel"
built = pytest.mark.skipif(not KERNEL.exists(), reason="make -C proofs/kernel has not built it")
ALL = ("plan", "box", "maximal", "shape", "region")
REFUSED = (Rejected, Unsupported, NotRefutedError, UnsupportedError, OutOfTimeError, *tools.MALFORMED)


def said(ground, lines, path, epsilon=tools.EPSILON, seconds=60):
    """What the kernel says of a certificate; None if nothing can be made of it."""
    try:
        return asked(ground, lines, path, epsilon, seconds)
    except REFUSED:
        return None


def asked(ground, lines, path, epsilon=tools.EPSILON, seconds=60):
    """What the kernel says of a certificate, with errors; None if it rejects it."""

    def kernel(*words):
        return subprocess.run([KERNEL, *words, path], capture_output=True, text=True, check=False)

    def ask(text):
        path.write_text(text)
        answer = kernel("--formulas")
        if answer.returncode:
            raise Rejected(answer.stderr)
        return answer.stdout

    tape = Tape(line if isinstance(line, str) else json.dumps(line) for line in lines[1:])
    _, kind, stated = lines[0]
    path.write_text(Translation(ground, epsilon, Deadline.after(seconds)).file(tape, kind, stated, ["a plan"], ask))
    answer = kernel()
    assert (answer.returncode, answer.stderr) in ((0, ""), (1, "")), answer
    return answer.stdout if answer.returncode == 0 else None


@built
@pytest.mark.parametrize(("files", "kind"), [(files, k) for files in (tools.GENERATOR, tools.NAVIGATION) for k in ALL])
def test_agrees(files, kind, tmp_path):
    lines, ground = tools.made(files, kind), tools.grounded(files)
    answer = said(ground, lines, tmp_path / "plan.kernel")
    claim = tools.judged(lines, ground)
    assert claim.kind == kind
    if kind in ("plan", "box", "maximal"):
        assert answer.startswith(f"established: {claim.text}, epsilon = 1/1000\n")
    assert answer.startswith("established: ")
    assert f"checked: {claim.obligations} obligations" in answer


def faces(ground, lines):
    """Of each face of a maximal box that is neither infinite nor a declared bound: the parameter and the end, by their
    places, and a value of all parameters at most 1/100 beyond it."""
    box, shown = box_of(ground, lines[0][2]), iter([line for line in lines if line[0] == "face"])
    for place, (name, values) in enumerate(box.items()):
        allowed = declared(ground, name)
        ends = (values.lower, values.lower_closed, allowed.lower), (values.upper, values.upper_closed, allowed.upper)
        for number, (end, closed, bound) in enumerate(ends):
            if end is not None and not (closed and end == bound):
                limit, beyond = ([*map(Fraction, each)] for each in next(shown)[1:])
                away = abs(beyond[place] - limit[place])
                step = min(Fraction(1), Fraction(1, 100) / away) if away else Fraction(1)
                yield place, 2 * number, [a + step * (b - a) for a, b in zip(limit, beyond, strict=True)]


PATIENCE = 5
"""Seconds for refutations of what is not false."""


def check_face(ground, lines, face, path):
    """Neither checker establishes anything of a box with a face moved out by 1/100, and both establish that a value
    within it breaks something: of a plan that allows only that value, no value is in the envelope."""
    place, end, values = face
    ends = [*lines[0][2][place]]
    ends[end] = str(Fraction(ends[end]) + Fraction(end - 1, 100))
    for kind in ("box", "maximal"):
        wider = [[lines[0][0], kind, tools.put(lines[0][2], place, ends)], *lines[1:]]
        assert said(ground, wider, path, seconds=PATIENCE) is None
        assert isinstance(tools.judged(wider, ground), str)
    pinned = copy(ground)
    pinned.parameters = {
        name: each._replace(lower=value, upper=value)
        for (name, each), value in zip(ground.parameters.items(), values, strict=True)
    }
    nothing = Region.nothing(ground.parameters)
    empty = [header("region"), *region_lines(pinned, tools.EPSILON, nothing, deadline=NEVER.within(100))]
    assert tools.judged(empty, pinned).kind == "region"
    (bad,) = [sides(line[1], ground.parameters) for line in empty if line[0] == "bad"]
    at = {name: constant(each.lower) for name, each in pinned.parameters.items()}
    for form, strict in bad:
        assert Range(Fraction(0), not strict, None, False).holds(replaced(form, at).get("", Fraction(0)))
    answer = said(pinned, empty, path)
    bounds = " x ".join(f"[{value}, {value}]" for value in values)
    whole = "established: the robustness envelope is exactly the declared bounds"
    assert answer.startswith(f"{whole} {bounds}, without (")


@built
def test_faces_that_are_pushed_out(tmp_path):
    ground, lines = tools.grounded(tools.NAVIGATION), tools.made(tools.NAVIGATION, "maximal")
    for face in faces(ground, lines):
        check_face(ground, lines, face, tmp_path / "wider.kernel")


@built
@pytest.mark.slow
def test_faces_of_recorded_plans(dataset, tmp_path):
    """One face of the largest box of each recorded plan, another one each time."""
    recorded = [one.files for one in read_suite(dataset)] + [files for _, files in read_deliveries(dataset)]
    counts = Counter()
    for number, files in enumerate(recorded):
        ground, lines = tools.grounded(files), tools.made(files, "maximal")
        assert (said(ground, lines, tmp_path / "whole.kernel") or "").startswith("established: "), files
        if found := [*faces(ground, lines)]:
            check_face(ground, lines, face := found[number % len(found)], tmp_path / "wider.kernel")
            counts[positive_circle(ground, dict(zip(ground.parameters, face[2], strict=True))) is not None] += 1
    assert counts.total() >= 60
    assert counts[True] >= 10  # there, no schedule is left
    assert counts[False] >= 40


DOMAIN = """(define (domain d) (:predicates (p) (q)) (:functions (f) (g))
 (:durative-action a :parameters () :duration (= ?duration 2) :condition (over all (>= (f) LEVEL))
  :effect (and (when (at start (p)) (at start (assign (f) (+ (g) 3)))) (at end (increase (g) (f)))
   (when (at start (OTHER)) (at start (increase (f) (* 2 (g))))) (when (at end (>= (f) 4)) (at end (q))))))"""
PROBLEM = "(define (problem x) (:domain d) (:init (= (f) 1) (= (g) 1) (p)) (:goal (and (q) (>= (g) 5))))"
PLAN = """parameter k default 5 lb 0 ub 9; durative-action instance i : (a);
c: i.start - .zero in [0, k]; c: i.end - i.start in [2, 2];"""


def reading_plan(level, other, directory):
    """A plan whose effects have conditions, read fluents, and assign."""
    domain = DOMAIN.replace("LEVEL", level).replace("OTHER", other)
    return tools.written(Texts(domain, PROBLEM, PLAN), directory)


@built
@pytest.mark.parametrize("kind", ["plan", "box"])
def test_effects_that_read(kind, tmp_path):
    files = reading_plan("4", "q", tmp_path / "good")
    lines, path = tools.made(files, kind), tmp_path / "reading.kernel"
    answer = said(tools.grounded(files), lines, path)
    assert answer.startswith("established: ")
    assert f"checked: {tools.judged(lines, tools.grounded(files)).obligations} obligations" in answer


@built
@pytest.mark.parametrize(("level", "other"), [("4.01", "q"), ("4", "p")])
def test_wrong_levels_and_conflicts_are_not_established(level, other, tmp_path):
    """A certificate of the plan as it was says nothing of a level above, or of an assignment with an increase."""
    lines = tools.made(reading_plan("4", "q", tmp_path / "good"), "plan")
    files = reading_plan(level, other, tmp_path / "wrong")
    assert said(tools.grounded(files), lines, tmp_path / "wrong.kernel") is None
    with pytest.raises(RefutedError):
        tools.made(files, "plan")


STEADY = """(define (domain d) (:predicates (p)) (:functions (f) (speed) (half) (nothing))
 (:durative-action a :parameters () :duration (= ?duration (* 4 (half)))
  :condition (at end (>= (* (speed) (f)) (- (/ (* 9 ?duration) (DIVISOR)) (- (f) (f)))))
  :effect (and (increase (f) (* #t (* (speed) (half)))) OTHER)))"""
AT_0 = "(define (problem x) (:domain d) (:init (= (f) 0) (= (speed) 3) (= (half) 0.5) (= (nothing) 0)) (:goal (and)))"


def steady_plan(divisor, other, directory):
    """A plan with products and quotients of fluents that nothing changes."""
    domain = STEADY.replace("DIVISOR", divisor).replace("OTHER", other)
    return tools.written(Texts(domain, AT_0, PLAN), directory)


@built
def test_expressions_are_read_as_they_are_written(tmp_path):
    files = steady_plan("+ (speed) (- (half) 1.5)", "", tmp_path / "good")
    lines = tools.made(files, "plan")
    assert said(tools.grounded(files), lines, tmp_path / "good.kernel").startswith("established: ")
    for divisor, other in (
        ("+ (speed) (- (half) 1.51)", ""),
        ("nothing", ""),
        ("- (half) 0.5", ""),
        ("speed", "(at end (increase (f) (/ 1 (nothing))))"),
        ("speed", "(at end (increase (half) 1))"),
    ):
        files = steady_plan(divisor, other, tmp_path / "wrong")
        assert said(tools.grounded(files), lines, tmp_path / "wrong.kernel") is None
    ground = tools.grounded(steady_plan("speed", "(at end (increase (f) (* (f) ?duration)))", tmp_path / "wrong"))
    with pytest.raises(UnsupportedError, match="not linear"):
        asked(ground, lines, tmp_path / "wrong.kernel")


@built
@pytest.mark.parametrize("every", [9, pytest.param(1, marks=pytest.mark.slow)])
def test_recorded_plans_of_divers(every, dataset, tmp_path):
    """Robots under water, which assign a fluent."""
    for files in [one.files for one in read_suite(dataset) if "auv" in str(one.files[2])][::every]:
        for kind in ("plan", "box"):
            answer = said(tools.grounded(files), tools.made(files, kind), tmp_path / "auv.kernel")
            assert (answer or "").startswith("established: "), (files, kind)


DRAINING = """(define (domain d) (:predicates (p)) (:functions (f))
 (:durative-action a :parameters () :duration (= ?duration 1) :condition (at start (>= (f) 2))
  :effect (and (at start (decrease (f) 1)) (at end (increase (f) 0.5)))))"""
FULL = "(define (problem x) (:domain d) (:init (= (f) 6)) (:goal (>= (f) 1.5)))"
IN_A_ROW = "parameter k default 5 lb 0 ub 9;" + "".join(
    f"durative-action instance i{n} : (a); c: i{n}.end - i{n}.start in [1, 1];"
    + (f"c: i{n}.start - i{n - 1}.end in [1, inf];" if n else "c: i0.start - .zero in [k, k];")
    for n in range(9)
)


@built
def test_changes_in_a_known_order_are_added_up(tmp_path, monkeypatch):
    """The kernel puts numbers in for what steps in a row have changed: nothing is left that has to be refuted."""
    files = tools.written(Texts(DRAINING, FULL, IN_A_ROW), tmp_path / "plan")
    lines, ground = tools.made(files, "box"), tools.grounded(files)
    monkeypatch.delattr(OpenFormulas, "refutation")
    assert said(ground, lines, tmp_path / "row.kernel").startswith("established: ")
    files = tools.written(Texts(DRAINING, FULL.replace("6", "5.9"), IN_A_ROW), tmp_path / "wrong")
    with pytest.raises(AttributeError):  # which it would have to be, of what is false
        asked(tools.grounded(files), lines, tmp_path / "row.kernel")


CONFLICT = """(define (domain d) (:predicates (p)) (:functions (f))
 (:durative-action a :parameters () :duration (>= ?duration 1) :condition (over all (>= (f) 2))
  :effect (and (when (at start (p)) (at start (assign (f) 2)))
   (when (at start (>= ?duration 3)) (at start (increase (f) 1))))))"""
OF_ONE = "(define (problem x) (:domain d) (:init (= (f) 1) (p)) (:goal (and)))"
LASTING_K = "parameter k default 2 lb 0 ub 9; durative-action instance i : (a); c: i.end - i.start in [k, k];"
ODD = [tangled_texts(5), Texts(CONFLICT, OF_ONE, LASTING_K)]
"""One lists an effect twice; values of the other are bad because an assignment and an increase meet."""


@built
@pytest.mark.parametrize("texts", [*ODD, *(random_texts(seed, easy=True) for seed in (6, 10, 13, 19))])
def test_envelopes_of_small_plans(texts, tmp_path):
    files = tools.written(texts, tmp_path / "plan")
    answer = said(tools.grounded(files), tools.made(files, "region"), tmp_path / "small.kernel")
    assert answer is not None
    assert answer.startswith("established: the robustness envelope is exactly ")


@built
def test_values_with_negative_durations(dataset, tmp_path):
    """They are bad for that, not for what the checker in Python makes of continuous effects in less than no time."""
    (files,) = [one.files for one in read_suite(dataset) if one.files[2].match("solar-rover/plan_01_2.stn")]
    lines, ground = tools.made(files, "region"), tools.grounded(files)
    assert "without (" in said(ground, lines, tmp_path / "negative.kernel")


NO_ROOM = "parameter k default 4 lb 3 ub 9; durative-action instance i : (a); c: i.end - i.start in [k, 2.5];"


@built
def test_no_value_leaves_a_schedule(tmp_path):
    """The declared bounds leave no schedule: nothing is in the envelope, and both checkers say so."""
    ground = tools.grounded(tools.written(Texts(CONFLICT, OF_ONE, NO_ROOM), tmp_path / "plan"))
    lines = [header("region"), *region_lines(ground, tools.EPSILON, Region.nothing(["k"]), deadline=NEVER)]
    assert tools.judged(lines, ground).kind == "region"
    assert "without (" in said(ground, lines, tmp_path / "empty.kernel")
    ground.parameters["k"] = ground.parameters["k"]._replace(lower=Fraction(2))
    assert isinstance(tools.judged(lines, ground), str)
    assert said(ground, lines, tmp_path / "empty.kernel") is None


BROKEN = """(define (domain d) (:predicates (p)) (:functions (f) (g))
 (:durative-action a :parameters () :duration (= ?duration 5) :condition (CONDITION)
  :effect (at end (increase (g) (* 2 (f)))))
 (:durative-action b :parameters () :duration (= ?duration 1)
  :effect (and (at start (not (p))) (at start (decrease (f) 1)) (at end (increase (g) 1)))))"""
OF_ONES = "(define (problem x) (:domain d) (:init (p) (= (f) 1) (= (g) 1)) (:goal (GOAL)))"
LATER = """parameter k default 7 lb 1 ub 9; durative-action instance i : (a); durative-action instance j : (b);
c: i.start - .zero in [0, 0]; c: i.end - i.start in [5, 5];
c: j.start - .zero in [k, k]; c: j.end - j.start in [1, 1];"""


def by_every(lines, ground):
    """A certificate that shows no schedule that breaks something, but that each does; and what they break."""
    certificate, known, broken = [*lines], KnownFacts([]), []
    for place, line in enumerate(lines):
        if line[0] == "bad":
            region = sides(line[1], ground.parameters)
            bounds = [fact for name in ground.parameters for fact in declared(ground, name).facts(name)]
            formulas = Formulas(ground, tools.EPSILON)
            known = KnownFacts([*region, *bounds, *((formulas.slack(edge), False) for edge in ground.edges)])
        elif line[0] == "broken":
            name, is_broken = formulas.obligations()[line[1]]
            broken.append(name)
            certificate[place : place + 2] = [["every", [line[1]]], refutation(formulas, known, -is_broken(), NEVER)]
    return certificate, broken


@built
@pytest.mark.parametrize(
    ("condition", "goal", "name"),
    [
        ("over all (p)", "and", "i: over all"),
        ("over all (>= (f) 1)", "and", "i: over all"),
        ("at end (>= (f) 1)", "and", "i: at end"),
        ("and", ">= (g) 4", "goal 1"),
    ],
)
def test_each_schedule_breaks_something(condition, goal, name, tmp_path):
    texts = Texts(BROKEN.replace("CONDITION", condition), OF_ONES.replace("GOAL", goal), LATER)
    files = tools.written(texts, tmp_path / "plan")
    ground = tools.grounded(files)
    lines, broken = by_every(tools.made(files, "region"), ground)
    assert name in broken
    claim = tools.judged(lines, ground)
    assert claim.kind == "region"
    answer = said(ground, lines, tmp_path / "every.kernel")
    assert answer is not None
    less = [["every", []] if line[0] == "every" else line for line in lines]
    assert said(ground, less, tmp_path / "none.kernel") is None


def claimed(ground, lines, answer):
    """What a certificate says that it claims, in the kernel's words."""
    _, kind, stated = lines[0]
    claim = Claim(kind, tools.EPSILON, answer)
    if kind in ("plan", "box", "maximal"):
        claim.box = nominal(ground) if kind == "plan" else box_of(ground, stated)
    if kind == "region":
        claim.removed = [sides(line[1], ground.parameters) for line in lines if line[0] == "bad"]
    return claim


def forgeries(attempts, plans, seed, folder):
    """How many forged certificates of plans the kernel, and Python, accepts; those accepted of something false."""
    outcome = adversary.run(attempts, plans=plans, seed=seed)
    counts, false = Counter(), []
    for case, lines, by_python in outcome.tried:
        if lines[0][1:2] not in (["plan"], ["box"], ["maximal"], ["region"]) or not case.name.startswith("plan"):
            continue
        ground = case.read(tools.CHECKER)
        answer = said(ground, lines, folder / "forged.kernel")
        counts[answer is not None, not isinstance(by_python, str)] += 1
        if answer is not None and not case.is_true(claimed(ground, lines, answer)):
            false.append((case.name, lines))
    return counts, false


@built
@pytest.mark.parametrize(("count", "plans"), [(150, 8), pytest.param(1500, 30, marks=pytest.mark.slow)])
def test_forged_certificates(count, plans, tmp_path):
    counts, false = forgeries(count, plans, 3, tmp_path)
    assert false == []
    assert counts[False, False] > count // 3


FORGED = {
    "(drive scout base ridge)": ["(drive scout base scout)", "(drive scout base)", "(fly scout base ridge)"],
    "(durative-action drive_3": ["(action drive_3", "(durative-action drive_1"],
    "(drive_3.end drive_3.start 20 20)": ["(drive_3.end drive_3.start 2 inf)", "(drive_3.end drive_3.start 20 120)"],
    "scout - rover base ridge": ["scout - site base ridge"],
    " (daylight) (at 21": [" (at 21"],
    "(at 21 (lit ridge))": ["(at 121 (lit ridge))"],
    "(>= ?duration 1)": ["(>= ?duration 1000)", "(forall (?s - site) (>= ?duration 1000))"],
    "(at start (at ?r ?from))": ["(at start (not (at ?r ?from)))", "(at start (exists (?s - rover) (at ?r ?s)))"],
    "(at end (at ?r ?to))": ["(at end (when (= ?from ?to) (at ?r ?to)))"],
    "(over all (daylight))": ["(over all (forall (?s - site) (lit ?s)))"],
    "(= (charge scout) 170)": ["(= (charge scout) 17)"],
}
"""Parts of the trees of a plan that is valid, and what makes another plan of it, which is not."""


@built
def test_forged_trees(tmp_path):
    ground, path = tools.grounded(tools.NAVIGATION), tmp_path / "forged.kernel"
    assert said(ground, tools.made(tools.NAVIGATION, "plan"), path) is not None
    whole = path.read_text()
    for old, every in FORGED.items():
        assert whole.count(old) == 1, old
        for new in every:
            path.write_text(whole.replace(old, new))
            answer = subprocess.run([KERNEL, path], capture_output=True, text=True, check=False)
            assert (answer.returncode, answer.stdout) in ((1, "rejected\n"), (2, "")), (new, answer)


@built
@pytest.mark.parametrize("count", [12, pytest.param(150, marks=pytest.mark.slow)])
def test_certificates_of_texts_with_less(count, tmp_path):
    """A certificate of a plan, and texts of which a form is left out: what is established is valid."""
    random, verdicts = Random(count), Counter()
    plans = [tools.NAVIGATION, tools.GENERATOR, reading_plan("4", "q", tmp_path / "reading")]
    for files in (*plans, steady_plan("+ (speed) (- (half) 1.5)", "", tmp_path / "steady")):
        lines = tools.made(files, "plan")
        texts = [re.sub(";[^\n]*", "", path.read_text()) for path in files[:2]]
        for _ in range(count):
            changed, which = [*texts, files[2].read_text()], random.randrange(2)
            start = random.choice([match.start() for match in re.finditer(r"\((?!define)", texts[which])])
            depths = accumulate({"(": 1, ")": -1}.get(letter, 0) for letter in texts[which][start:])
            end = start + next(number for number, depth in enumerate(depths) if not depth) + 1
            changed[which] = texts[which][:start] + texts[which][end:]
            try:
                established = said(tools.reader.ground(*changed), lines, tmp_path / "less.kernel") is not None
                valid = bool(tools.made(tools.written(Texts(*changed), tmp_path / "less"), "plan"))
            except RefutedError:
                valid = False
            except (Unsupported, RobustError):
                continue
            verdicts[established, valid] += 1
    assert not verdicts[True, False]
    assert verdicts[True, True] > count / 4
    assert verdicts[False, False] > count / 4


@built
def test_opinions(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(KERNEL.parent), prepend=":")
    path = tmp_path / "plan.cert"
    write(tools.made(tools.NAVIGATION, "maximal"), path)
    both = opinions(None, path, tools.NAVIGATION, Demanded(tools.EPSILON))
    assert [each.checker for each in both] == ["python", "kernel"]
    python, kernel = (each.verification.answer for each in both)
    assert {each.verification.outcome for each in both} == {CheckerOutcome.ESTABLISHED}
    assert all(python[key] == kernel[key] for key in ("claim", "box", "kind", "files", "obligations", "epsilon"))
    (other,) = opinions("kernel", path, tools.GENERATOR, Demanded(tools.EPSILON))
    assert other.verification.outcome is CheckerOutcome.REJECTED
    monkeypatch.setattr(run, "PATIENCE", 0)
    python, kernel = opinions(None, path, tools.NAVIGATION, Demanded(tools.EPSILON))
    assert python.verification.outcome is CheckerOutcome.ESTABLISHED
    assert "not established within 0 seconds" in kernel.verification.answer["reason"]


def test_not_found(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(InputError, match="make -C proofs/kernel install"):
        opinions("kernel", tmp_path / "plan.cert", tools.NAVIGATION, Demanded(tools.EPSILON))


if __name__ == "__main__":
    print(forgeries(int(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4])))
