"""What is read is what the text mentions: cancelling and constant texts, by all that separate time points, and by VAL.

`m` lasts from 1 to 11. `w` changes `(f)` or `(p)` at one moment: that of a reader, one shortly after it, or another.
"""

from contextlib import nullcontext
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

import pytest

from robust import Answer, InputError, check
from robust.backends import ENCODINGS
from robust.certify.checker.formulas import mutex
from robust.certify.checker.reader import ground
from robust.encode.network import mutex_pairs
from robust.encode.settled import Accesses, proved
from robust.execute.distances import Original
from robust.execute.room import esterel_edges
from robust.plan import simulate as simulator
from robust.plan.load import assemble
from robust.plan.model import ZERO, ParametrizedPlan, TimePoint
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.simulate import simulate
from robust.plan.stn import parse_stn
from tests.pddl_text import PddlText
from tests.plan.building import groups
from tests.val import run_val

EPSILON = Fraction(1, 1000)
START, FAR, END, AFTERWARDS = map(Fraction, (1, 5, 11, 20))
OF_F, OF_P = "(assign (f) 5)", "(p)"
NAMED = {OF_F: "(f)", OF_P: "(p)"}


class Case(NamedTuple):
    """Parts of `m`, what `w` does, and at which of its time points `m` reads what `w` changes."""

    condition: str = ""
    duration: str = "(= ?duration 10)"
    effect: str = ""
    write: str = OF_F
    reads: tuple[Fraction, ...] = (START,)


TEXTS = {name: lines.splitlines() for name, lines in groups(Path(__file__).with_name("reads.txt")).items()}
NUMERIC, LOGICAL = TEXTS["numeric"], TEXTS["logical"]
MOMENTS = {"start": (START,), "end": (END,), "never": ()}


def other(line: str) -> Case:
    """Of a line such as `start effect: TEXT`."""
    head, _, text = line.partition(": ")
    moment, field = head.split()
    return Case(**{field: text}, write=OF_P if "(p)" in text else OF_F, reads=MOMENTS[moment])


CASES = (
    *(
        Case(f"({timing} {text})", write=write, reads=reads)
        for texts, write in ((NUMERIC, OF_F), (LOGICAL, OF_P))
        for text in texts
        for timing, reads in (("at start", (START,)), ("at end", (END,)), ("over all", ()))
    ),
    *(
        Case(effect=f"(when ({timing} {text}) ({timing} (q)))", write=write, reads=reads)
        for text, write in ((NUMERIC[0], OF_F), (NUMERIC[8], OF_F), (LOGICAL[1], OF_P))
        for timing, reads in (("at start", (START,)), ("at end", (END,)))
    ),
    *map(other, TEXTS["others"]),
)
ARGUMENTS = [pytest.param(case, id=" ".join(filter(None, case[:3]))) for case in CASES]


def texts(case: Case, moment: Fraction, init: str = "(= (f) 5)") -> PddlText:
    domain = f"""(define (domain d) (:requirements :typing :fluents :durative-actions :duration-inequalities :equality
 :negative-preconditions :disjunctive-preconditions :conditional-effects :quantified-preconditions)
(:types t) (:constants a b - t) (:predicates (top) (p) (q) (r)) (:functions (f) (g) (h ?x - t))
(:action w :parameters () :precondition (top) :effect (and {case.write}))
(:durative-action m :parameters () :duration {case.duration}
 :condition (and (at start (top)) {case.condition}) :effect (and (at end (r)) {case.effect})))"""
    problem = f"(define (problem x) (:domain d) (:init (top) {init} (= (g) 5) (= (h a) 1) (= (h b) 1)) (:goal (top)))"
    return PddlText(domain, problem, f"{float(moment)}: (w)\n{START}: (m) [{END - START}]\n")


def network(moment: Fraction) -> str:
    return f"""action instance w : (w); durative-action instance m : (m);
c: w - .zero in [{moment}, {moment}]; c: m.start - .zero in [{START}, {START}]; c: m.end - .zero in [{END}, {END}];
"""


def load(text: PddlText, steps: str) -> ParametrizedPlan:
    domain = parse_domain(text.domain)
    return assemble(domain, parse_problem(text.problem, domain), parse_stn(steps))


def schedule(plan: ParametrizedPlan, moment: Fraction) -> dict[TimePoint, Fraction]:
    i, w = plan.instance["m"], plan.instance["w"]
    return {w.start: moment, i.start: START, i.end: END}


@pytest.mark.parametrize("case", ARGUMENTS)
def test_reads(case: Case) -> None:
    """The pairs, by the simulator, both encodings, shortest paths and the checker of certificates, and what VAL says.

    Whether somebody reads what `w` changes less than ε away is all that can be wrong.
    """
    text = texts(case, START)
    plan = load(text, network(START))
    m, w = plan.instance["m"], plan.instance["w"].start
    expected = {(w, m.start if moment == START else m.end) for moment in case.reads}
    assert set(mutex_pairs(plan)) == set(simulator.mutex_pairs(plan)) == expected
    assert {m.at(mention.timing) for mention in m.mentions} <= set(m.time_points)
    accesses = Accesses(plan)
    readers = {point for name, points in accesses.readers.items() if str(name) == NAMED[case.write] for point in points}
    assert readers == {accesses.index[point] for _, point in expected}
    checked = ground(text.domain, text.problem, network(START))
    assert set(mutex(checked)) == {tuple(sorted(checked.number[str(point)] for point in pair)) for pair in expected}
    for moment in (START, END, START + EPSILON / 2, FAR):
        plan = load(text, network(moment))
        valid = all(abs(moment - read) >= EPSILON for read in case.reads)
        violations = {violation.obligation for violation in simulate(plan, {}, schedule(plan, moment)).violations}
        assert (violations == set()) == valid, moment
        for encoding in ENCODINGS:
            answers = check(plan, encoding=encoding, every=True).obligations
            assert {name for name, answer in answers.items() if answer is Answer.REFUTED} == violations, encoding
            assert Answer.UNKNOWN not in answers.values()
            separations = {name for name in answers if name.startswith("separation: ")}
            assert violations <= separations
            assert separations & set(proved(plan, EPSILON, mutex_pairs(plan))) == separations - violations
        if moment in {START, END, FAR}:
            assert run_val(texts(case, moment), tolerance=EPSILON).valid == (moment not in case.reads), moment


def test_the_transformer_keeps_away_from_what_is_mentioned() -> None:
    plan = load(texts(Case("(at start (>= (f) (f)))"), FAR), network(FAR))
    edges = esterel_edges(Original(plan, {ZERO: Fraction(0), **schedule(plan, FAR)}, EPSILON))
    m, w = plan.instance["m"], plan.instance["w"]
    assert [edge.weight for edge in edges if (edge.source, edge.target) == (m.start, w.start)] == [EPSILON]


WITHOUT_VALUE = [
    # Not those with a disjunction, of which VAL evaluates no more than it needs in a state.
    *((Case(f"({timing} {text})"), True) for text in NUMERIC[:4] for timing in ("at start", "over all", "at end")),
    (Case(duration="(= ?duration (+ 10 (- (f) (f))))"), True),
    (Case(effect="(at start (assign (g) (* 0 (f))))"), True),
    (Case(effect="(when (at start (>= (f) (f))) (at start (q)))"), True),
    (Case("(at start (imply (>= (f) (f)) (top)))"), True),
    # What equality decides is not evaluated.
    (Case("(at start (or (= a a) (>= (f) 0)))"), False),
    (Case("(at start (forall (?x - t) (imply (not (= ?x ?x)) (>= (f) 0))))"), False),
    (Case(effect="(when (at start (and (= a b) (>= (f) 0))) (at start (q)))"), False),
    (Case(), False),
]


@pytest.mark.parametrize(("case", "fails"), WITHOUT_VALUE)
def test_a_mention_needs_a_value(case: Case, fails: bool) -> None:
    """A fluent without initial value is an error wherever it is evaluated, even if it cancels; for VAL, too."""
    text = texts(case, AFTERWARDS, init="")
    with pytest.raises(InputError, match=r"no initial value of \(f\)") if fails else nullcontext():
        load(text, network(AFTERWARDS))
    assert ("undefined numeric expression" in run_val(text, tolerance=EPSILON).report) == fails


def test_a_mention_in_the_goal_needs_a_value() -> None:
    domain, problem, steps = texts(Case(), AFTERWARDS, init="")
    for goal, fails in (("(>= (f) (- (f) 1))", True), ("(or (= a a) (>= (f) 0))", False)):
        text = PddlText(domain, problem.replace("(:goal (top))", f"(:goal {goal})"), steps)
        message = r"no initial value of \(f\), expected one because the goal \(>= \(f\) \(- \(f\) 1\)\) reads it"
        with pytest.raises(InputError, match=message) if fails else nullcontext():
            load(text, "action instance w : (w);")
