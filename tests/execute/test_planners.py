"""Planners that behave and planners that do not, and the text that they read and print."""

import re
from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.generators.delivery import DeliveryVariant, delivery_domain, table_problems
from robust.errors import InputError, UnsupportedError
from robust.execute.planners import aries, create_planner
from robust.execute.planners import interface as kairos
from robust.execute.planners.interface import PlannerAnswer, PlannerStatus, check
from robust.numbers import parse_number
from robust.plan.pddl.reader import parse_domain, parse_problem, read_domain, read_problem
from robust.plan.pddl.write import decimal, domain_text, problem_text
from robust.plan.timed import parse_timed_plan
from robust.smt.limits import Deadline
from tests.children import Told, interrupted_after
from tests.execute.plans import BETTER, EPSILON, ERRAND, ERRANDS, TOO_LATE, VALID, Fake, errand, errands
from tests.plan.building import EVERYTHING

ROOT = Path(__file__).parents[2]


@pytest.fixture
def fake(tmp_path):
    return Fake(tmp_path)


def ask(command: str, seconds: float | None = 20) -> PlannerAnswer:
    return create_planner(command).solve(errands, errand, Deadline.after(seconds))


SOLVED, TIMEOUT, CRASHED = PlannerStatus.SOLVED, PlannerStatus.TIMEOUT, PlannerStatus.CRASHED
NOTHING = "no valid plan before the deadline"
SEGFAULT = "os.kill(os.getpid(), signal.SIGSEGV)"


@pytest.mark.parametrize(
    ("text", "then", "seconds", "status", "plan", "message"),
    [
        (f"searching: 12 states (fast) [ok]\n; cost 9.501\n{VALID}\nbye", "", 20, SOLVED, VALID, ""),
        (VALID, "", None, SOLVED, VALID, ""),
        # the last valid plan counts, whatever the exit code, and at the deadline
        (f"{VALID}\n{BETTER}", "", 20, SOLVED, BETTER, ""),
        (f"{BETTER}\nnext\n{TOO_LATE}", "", 20, SOLVED, BETTER, ""),
        (VALID, "sys.exit(3)", 20, SOLVED, VALID, ""),
        (VALID, "time.sleep(60)", 1, SOLVED, VALID, ""),
        ("", "time.sleep(60)", 0.5, TIMEOUT, None, NOTHING),
        (VALID, "time.sleep(60)", 0, TIMEOUT, None, NOTHING),
        (VALID.splitlines()[0], "time.sleep(60)", 0.5, TIMEOUT, None, NOTHING),
        ("", "raise RuntimeError('out of ideas')", 20, CRASHED, None, "exit code 1: RuntimeError: out of ideas"),
        ("", "sys.exit(9)", 20, CRASHED, None, "exit code 9: no message"),
        ("so far so good", SEGFAULT, 20, CRASHED, None, "killed by signal 11: so far so good"),
        ("", "x = bytearray(2**36)", 20, CRASHED, None, "exit code 1: MemoryError"),
    ],
)
def test_answers(fake, text, then, seconds, status, plan, message):
    answer = ask(fake.printing(text, then), seconds)
    assert (answer.status, answer.message) == (status, message)
    assert answer.plan == (None if plan is None else parse_timed_plan(plan))
    assert 0 < answer.seconds < 20


def test_what_the_planner_reads_and_where_it_writes(fake):
    body = f"""
    texts = [open(path).read() for path in sys.argv[1:3]]
    open({str(fake.folder / "seen")!r}, "w").write(chr(0).join(texts))
    assert 15 < float(sys.argv[4]) <= 20
    open(sys.argv[3], "w").write({VALID!r})
    print("0: (go home home) [1]")
    """
    assert ask(fake.command(body)).plan == parse_timed_plan(VALID)
    domain, problem = (fake.folder / "seen").read_text().split("\0")
    assert (parse_domain(domain), parse_problem(problem, errands)) == (errands, errand)
    numbered = f"[open(sys.argv[3] + f'.{{i}}', 'w').write(p) for i, p in enumerate([{VALID!r}, {BETTER!r}])]"
    assert ask(fake.command(numbered)).plan == parse_timed_plan(BETTER)


NONSENSE, NO_PLAN = PlannerStatus.NONSENSE, PlannerStatus.NO_PLAN


@pytest.mark.parametrize(
    ("text", "status", "message"),
    [
        ("", NO_PLAN, ""),
        ("; No plan found", NO_PLAN, ""),
        ("the problem is UNSOLVABLE", NO_PLAN, ""),
        ("goal unreachable", NO_PLAN, ""),
        ("42", NONSENSE, "found no plan in what it printed, ending with '42'"),
        ("\x00\xff garbage", NONSENSE, "ending with"),
        ("0: (fly home market) [7.5]", NONSENSE, "found action 'fly', expected one of domain 'errands'"),
        ("0: (go home moon) [7.5]", NONSENSE, "found 'moon'"),
        ("1.2.3: (go home market) [7.5]", NONSENSE, "found '1.2.3' as time"),
        ("0: (go home market) [7.5]", NONSENSE, "goal"),
        ("0: (go home market) [7]\n7: (shop market) [2]", NONSENSE, "invalid plan"),
        (TOO_LATE, NONSENSE, "'n1 shop: over all (open)' broken at time 20"),
    ],
)
def test_nonsense_and_no_plan(fake, text, status, message):
    answer = ask(fake.printing(text))
    assert (answer.status, answer.plan) == (status, None)
    assert message in answer.message
    assert "\n" not in answer.message


def test_what_is_no_answer():
    answer = ask("command:/no/such/planner {domain} {problem}")
    assert answer.status is PlannerStatus.CRASHED
    assert "cannot start '/no/such/planner': No such file or directory" in answer.message
    for status, plan in ((SOLVED, None), (TIMEOUT, parse_timed_plan(VALID))):
        with pytest.raises(ValueError, match="a plan goes with 'solved' only"):
            PlannerAnswer("p", status, plan)


def test_ending_with_whoever_asked(fake):
    """All that a planner has started is gone at the deadline and on Ctrl-C, whatever it does about signals."""
    told = Told(fake.folder)
    body = f"""
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    subprocess.run([sys.executable, "-c", {told.code!r}])
    """
    assert ask(fake.command(body), 1.5).status is PlannerStatus.TIMEOUT
    assert told.gone()
    with pytest.raises(KeyboardInterrupt), interrupted_after(1.5):
        ask(fake.command(body))
    assert told.gone()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("areis", "found planner 'areis', expected aries, kairos or command:TEMPLATE; did you mean 'aries'?"),
        ("", "found planner ''"),
        ("command:", "found no command"),
        ("command:p {domain} {probelm}", "found field {probelm}.*did you mean 'problem'"),
        ("command:p {domain}", r"found no \{problem\}"),
        ("command:p '{domain} {problem}", "No closing quotation"),
        ("command:p {domain} {problem", "expected words and fields"),
        ("command:p {} {problem}", r"found field \{\}"),
    ],
)
def test_planners_that_cannot_be_made(text, message):
    with pytest.raises(InputError, match=message):
        create_planner(text)


def test_missing_packages(monkeypatch):
    def missing(_):
        raise ImportError("no module")

    monkeypatch.setattr(aries.importlib, "import_module", missing)
    monkeypatch.setattr(kairos, "program", lambda _: None)
    for name in ("aries", "kairos"):
        with pytest.raises(UnsupportedError, match=rf"found no planner {name}.*pip install 'robust-plans\[planners\]'"):
            create_planner(name)


def test_text_of_a_domain_with_everything():
    text = re.sub(r":synth-parameters (\(\?rate\)|\?speed)", "", EVERYTHING).replace("()\n", "")
    text = text.replace("?speed", "5").replace("?rate", "2").replace("(decrease (total) 3)", "(scale-up (total) 3)")
    domain = parse_domain(text.rstrip()[:-1] + "(:durative-action w :duration () :condition () :effect ()))")
    assert parse_domain(domain_text(domain)) == domain


@pytest.mark.parametrize(
    "path", sorted((ROOT / "robust/examples").rglob("*domain*.pddl")), ids=lambda path: path.parent.name
)
def test_text_of_the_examples(path):
    domain = read_domain(path)
    if domain.parameters or any(action.synth_parameters for action in domain.actions.values()):
        with pytest.raises(UnsupportedError, match="synthesis parameter"):
            domain_text(domain)
        return
    again = parse_domain(domain_text(domain))
    assert again == domain
    for problem in (read_problem(one, domain) for one in path.parent.glob("*problem*.pddl")):
        assert parse_problem(problem_text(problem, domain), again) == problem


def test_times_that_are_no_decimals_are_rounded_to_the_safe_side():
    problem = parse_problem(
        ERRAND.replace("(at 20 (not (open)))", "(at 9.00049 (not (open))) (at 8.00051 (open))"), errands
    )
    text = problem_text(problem, errands)
    assert "(at 9 (not (open)))" in text
    assert "(at 8.001 (open))" in text


@given(value=st.fractions(min_value=-1000, max_value=1000), places=st.integers(0, 9))
def test_decimals(value, places):
    down, near, up = (parse_number(decimal(value, places, up=way)) for way in (False, None, True))
    unit = Fraction(1, 10**places)
    assert value - unit < down <= value <= up < value + unit
    assert abs(near - value) <= unit / 2


@pytest.fixture(params=["aries", "kairos"])
def planner(request):
    pytest.importorskip({"aries": "up_aries", "kairos": "kairos"}[request.param])
    return create_planner(request.param)


def solve(planner, domain: str, problem: str, seconds: float = 60) -> PlannerAnswer:
    read = parse_domain(domain)
    return planner.solve(read, parse_problem(problem, read), Deadline.after(seconds))


@pytest.mark.parametrize("variant", DeliveryVariant)
def test_delivery(planner, variant):
    """A problem of the tables, and what is left of it when the first order has to be given up after its preparation."""
    domain = parse_domain(delivery_domain(variant))
    text = late = table_problems(variant, battery=Fraction(600))[0].text
    for old, new in (
        ("(window_open order1)\n", "\n"),
        ("(at 420.389 (not (window_open order1)))", ""),
        ("(robot_at robot1 dock1)", "(robot_at robot1 base_station)"),
        ("(at 739.779 ", "(at 514.278 "),
        ("(hand_empty robot1)", "(holding robot1 spindle1_1)"),
        ("(on_shelf spindle1_1)", ""),
    ):
        assert old in late
        late = late.replace(old, new)
    for problem, delivered in ((parse_problem(text, domain), None), (parse_problem(late, domain), "order2")):
        answer = planner.solve(domain, problem, Deadline.after(60))
        assert answer.status is PlannerStatus.SOLVED, answer.message
        check(answer.plan, domain, problem, EPSILON)
        assert delivered in {None, *(one.arguments[2] for one in answer.plan.steps if one.action == "deliver")}


def test_no_plan_before_the_window_closes(planner):
    """Whether it is proved or not depends on the planner; there is no plan either way."""
    answer = solve(planner, ERRANDS, ERRAND.replace("(at 20 (", "(at 9 ("), 2)
    assert answer.status in (PlannerStatus.NO_PLAN, PlannerStatus.TIMEOUT)


def test_kairos_proves_that_there_is_no_plan():
    pytest.importorskip("kairos")
    domain = "(define (domain d) (:predicates (p) (q)) (:action a :parameters () :precondition (q) :effect (p)))"
    answer = solve(kairos.kairos_planner(), domain, "(define (problem x) (:domain d) (:init) (:goal (p)))")
    assert (answer.status, answer.plan) == (PlannerStatus.NO_PLAN, None)
    assert "unsolvable" in answer.message


def test_long_times(planner):
    """Beyond the horizon that Aries has by itself."""
    problem = ERRAND.replace("7.5)", "40000.25)").replace("(at 20 ", "(at 50000 ")
    answer = solve(planner, ERRANDS, problem)
    assert answer.status is PlannerStatus.SOLVED, answer.message
    assert answer.plan.steps[0].duration == Fraction("40000.25")


LOGIC = """(define (domain logic) (:requirements :adl :durative-actions)
(:types place truck - object)
(:predicates (at ?t - truck ?p - place) (lit ?p - place) (ready ?t - truck) (blocked ?p - place) (checked))
(:action light :parameters (?p - place) :precondition (or (lit ?p) (not (blocked ?p)))
 :effect (forall (?q - place) (lit ?q)))
(:durative-action drive :parameters (?t - truck ?a ?b - place) :duration (= ?duration 3)
 :condition (and (at start (at ?t ?a)) (at start (not (= ?a ?b))) (at start (forall (?p - place) (lit ?p)))
  (at start (imply (checked) (ready ?t))) (over all (exists (?p - place) (not (blocked ?p)))))
 :effect (and (at start (not (at ?t ?a))) (at end (at ?t ?b)))))
"""
LOGIC_PROBLEM = """(define (problem x) (:domain logic) (:objects a b c - place t - truck)
(:init (at t a) (blocked a) (blocked b) (at 5 (not (blocked b)))) (:goal (and (at t b) (or (checked) (lit a)))))"""


def test_aries_on_the_logic_of_pddl():
    pytest.importorskip("up_aries")
    answer = solve(create_planner("aries"), LOGIC, LOGIC_PROBLEM)
    assert answer.status is PlannerStatus.SOLVED, answer.message
    assert {step.action: step.duration is None for step in answer.plan.steps} == {"light": True, "drive": False}
    for epsilon in (Fraction(1), Fraction(1, 10**6), Fraction(0)):
        with pytest.raises(InputError, match="expected 1/20000 to 1/10"):
            create_planner("aries", epsilon=epsilon)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("(at end (done ?p))", "(when (at end (open)) (at end (done ?p)))", "a conditional effect"),
        ("(at end (done ?p))", "(and (at end (done ?p)) (increase (distance ?p ?p) (* #t 1)))", "which changes"),
        ("(>= ?duration 2)", "(>= ?duration (* 2 (distance ?p ?p)))", "a product or quotient in a duration"),
        ("(>= ?duration 2)", "(>= ?duration 0.0001)", "not an integer"),
        ("(and (over all (at ?p))", "(and (at start (<= (distance ?p ?p) 0.5)) (over all (at ?p))", "not an integer"),
    ],
)
def test_what_aries_does_not_solve_is_known_beforehand(old, new, message):
    pytest.importorskip("up_aries")
    assert old in ERRANDS
    with pytest.raises(UnsupportedError, match=message):
        solve(aries.aries_planner(), ERRANDS.replace(old, new), ERRAND)
