"""The checker that Coq proves right, where it is built: it says the same of certificates as the one in Python."""

import json
import re
import subprocess
import sys
from collections import Counter
from fractions import Fraction
from itertools import accumulate
from pathlib import Path
from random import Random

import pytest

from benchmarks.suite import read_suite
from robust.certify import CheckerOutcome
from robust.certify.checker.claims import Claim, box_of, nominal
from robust.certify.checker.proofs import Rejected, Tape, sides
from robust.certify.checker.reader import Unsupported
from robust.certify.hints import NotRefutedError
from robust.certify.kernel import run
from robust.certify.kernel.claims import Translation
from robust.certify.kernel.run import opinions
from robust.certify.tape import write
from robust.errors import InputError, RefutedError, RobustError, UnsupportedError
from robust.smt.limits import Deadline
from tests.certify import adversary, tools
from tests.certify.texts import Texts, random_texts, tangled_texts

KERNEL = Path(__file__).parents[2] / "proofs" / "kernel" / "robust-kernel"
built = pytest.mark.skipif(not KERNEL.exists(), reason="make -C proofs/kernel has not built it")
ALL = ("plan", "box", "maximal", "shape", "region")
REFUSED = (Rejected, Unsupported, NotRefutedError, UnsupportedError, *tools.MALFORMED)


def said(ground, lines, path, epsilon=tools.EPSILON):
    """What the kernel says of a certificate; None if nothing can be made of it."""
    try:
        return asked(ground, lines, path, epsilon)
    except REFUSED:
        return None


def asked(ground, lines, path, epsilon=tools.EPSILON):
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
    path.write_text(Translation(ground, epsilon, Deadline.after(60)).file(tape, kind, stated, ["a plan"], ask))
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


@built
def test_faces_that_are_pushed_out(tmp_path):
    box = tools.made(tools.NAVIGATION, "box")[0]
    ground, names = tools.grounded(tools.NAVIGATION), [*tools.grounded(tools.NAVIGATION).parameters]
    lines = tools.made(tools.NAVIGATION, "maximal")
    for number in range(len(names)):
        for end in (0, 2):
            ends = [*box[2][number]]
            ends[end] = str(Fraction(ends[end]) + Fraction(end - 1, 100))
            for kind in ("box", "maximal"):
                wider = [[box[0], kind, tools.put(box[2], number, ends)], *lines[1:]]
                assert said(ground, wider, tmp_path / "wider.kernel") is None


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


def claimed(ground, lines):
    """What a certificate says that it claims."""
    _, kind, stated = lines[0]
    claim = Claim(kind, tools.EPSILON)
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
        accepted = said(ground, lines, folder / "forged.kernel") is not None
        counts[accepted, not isinstance(by_python, str)] += 1
        if accepted and not case.is_true(claimed(ground, lines)):
            false.append((case.name, lines))
    return counts, false


@built
def test_forged_certificates(tmp_path):
    counts, false = forgeries(150, 8, 3, tmp_path)
    assert false == []
    assert counts[False, False] > 50


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
    both = opinions(None, path, tools.NAVIGATION, epsilon=tools.EPSILON)
    assert [each.checker for each in both] == ["python", "kernel"]
    python, kernel = (each.verification.answer for each in both)
    assert {each.verification.outcome for each in both} == {CheckerOutcome.ESTABLISHED}
    assert all(python[key] == kernel[key] for key in ("claim", "box", "kind", "files", "obligations", "epsilon"))
    (other,) = opinions("kernel", path, tools.GENERATOR, epsilon=tools.EPSILON)
    assert other.verification.outcome is CheckerOutcome.REJECTED
    monkeypatch.setattr(run, "PATIENCE", 0)
    python, kernel = opinions(None, path, tools.NAVIGATION, epsilon=tools.EPSILON)
    assert python.verification.outcome is CheckerOutcome.ESTABLISHED
    assert "not established within 0 seconds" in kernel.verification.answer["reason"]


def test_not_found(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(InputError, match="make -C proofs/kernel install"):
        opinions("kernel", tmp_path / "plan.cert", tools.NAVIGATION, epsilon=tools.EPSILON)


if __name__ == "__main__":
    print(forgeries(int(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4])))
