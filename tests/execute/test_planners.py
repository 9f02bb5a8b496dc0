"""Planners that behave and others, the text that they read and print; bounds against what random valid plans do."""

import json
import re
from fractions import Fraction
from itertools import product
from math import inf
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.generators.delivery import DeliveryVariant, delivery_domain, table_problems
from benchmarks.generators.plans import drawn_plan
from benchmarks.irr.tables import RememberingPlanner
from robust.errors import InputError, UnsupportedError
from robust.execute.distances import declarations, schedule_of
from robust.execute.planners import PLANNERS, aries, create_planner, interface, reachability
from robust.execute.planners.interface import PlannerAnswer, PlannerStatus, check
from robust.execute.planners.reachability import EarliestTimes, ReachabilityFirst, relaxed_problem, unreachable
from robust.numbers import parse_number
from robust.plan.load import assemble
from robust.plan.pddl.reader import parse_domain, parse_problem, read_domain, read_problem
from robust.plan.pddl.write import decimal, domain_text, problem_text
from robust.plan.simulate import simulate
from robust.plan.stn import STNPlan
from robust.plan.timed import TimedPlan, TimedStep, parse_timed_plan
from robust.smt.limits import Deadline
from tests.children import Told, interrupted_after
from tests.execute import plans
from tests.execute.plans import BETTER, EPSILON, ERRAND, ERRANDS, TOO_LATE, VALID, durative, errand, errands, text_of
from tests.plan.building import EVERYTHING

F = Fraction


@pytest.fixture
def fake(tmp_path):
    return plans.Fake(tmp_path)


def ask(command, seconds=20):
    return create_planner(command).solve(errands, errand, Deadline.after(seconds))


SOLVED, TIMEOUT, CRASHED = PlannerStatus.SOLVED, PlannerStatus.TIMEOUT, PlannerStatus.CRASHED
NO_PLAN = PlannerStatus.NO_PLAN
TABLES = json.loads(text_of("planners.json"))
"""What planners print and do then, and the answer; templates and domains, and conditions, with what is said of them."""
PRINTED = {"{VALID}": VALID, "{BETTER}": BETTER, "{TOO_LATE}": TOO_LATE}


@pytest.mark.parametrize(("text", "then", "seconds", "status", "plan", "message"), TABLES["answers"])
def test_answers(fake, text, then, seconds, status, plan, message):
    """The last valid plan counts, whatever the exit code, and at the deadline."""
    for name, steps in PRINTED.items():
        text = text.replace(name, steps)
    answer = ask(fake.printing(text, then), seconds)
    assert answer.status is PlannerStatus[status]
    assert message in answer.message if status in {"NO_PLAN", "NONSENSE"} else message == answer.message
    assert "\n" not in answer.message
    assert answer.plan == (None if plan is None else parse_timed_plan(PRINTED[f"{{{plan}}}"]))
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


def test_what_is_no_answer():
    answer = ask("command:/no/such/planner {domain} {problem}")
    reason = "cannot start '/no/such/planner': No such file or directory"
    assert (answer.status, reason in answer.message) == (CRASHED, True)
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
    assert ask(fake.command(body), 1.5).status is TIMEOUT
    assert told.gone()
    with pytest.raises(KeyboardInterrupt), interrupted_after(1.5):
        ask(fake.command(body))
    assert told.gone()


@pytest.mark.parametrize(("text", "message"), TABLES["unusable"])
def test_unusable_planners(text, message):
    with pytest.raises(InputError, match=message):
        create_planner(text)


def test_missing_packages(monkeypatch):
    def missing(_):
        raise ImportError("no module")

    monkeypatch.setattr(aries.importlib, "import_module", missing)
    monkeypatch.setattr(interface, "program", lambda _: None)
    for name in ("aries", "kairos"):
        with pytest.raises(UnsupportedError, match=rf"found no planner {name}.*pip install 'robust-plans\[planners\]'"):
            create_planner(name)


def test_text_of_a_domain_with_everything():
    text = re.sub(r":synth-parameters (\(\?rate\)|\?speed)", "", EVERYTHING).replace("()\n", "")
    text = text.replace("?speed", "5").replace("?rate", "2").replace("(decrease (total) 3)", "(scale-up (total) 3)")
    domain = parse_domain(text.rstrip()[:-1] + "(:durative-action w :duration () :condition () :effect ()))")
    assert parse_domain(domain_text(domain)) == domain


EXAMPLES = sorted((plans.ROOT / "robust/examples").rglob("*domain*.pddl"))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.parent.name)
def test_text_of_the_examples(path):
    domain = read_domain(path)
    if domain.parameters or any(action.synth_parameters for action in domain.actions.values()):
        with pytest.raises(UnsupportedError, match="synthesis parameter"):
            domain_text(domain)
        return
    assert (again := parse_domain(domain_text(domain))) == domain
    for problem in (read_problem(file, domain) for file in path.parent.glob("*problem*.pddl")):
        assert parse_problem(problem_text(problem, domain), again) == problem


def test_times_that_are_no_decimals_are_rounded_to_the_safe_side():
    literals = "(at 9.00049 (not (open))) (at 8.00051 (open))"
    text = problem_text(parse_problem(ERRAND.replace("(at 20 (not (open)))", literals), errands), errands)
    assert all(literal in text for literal in ("(at 9 (not (open)))", "(at 8.001 (open))"))


@given(value=st.fractions(min_value=-1000, max_value=1000), places=st.integers(0, 9))
def test_decimals(value, places):
    down, near, up = (parse_number(decimal(value, places, up=way)) for way in (False, None, True))
    unit = F(1, 10**places)
    assert value - unit < down <= value <= up < value + unit
    assert abs(near - value) <= unit / 2


@pytest.fixture(params=["aries", "kairos"])
def planner(request):
    pytest.importorskip({"aries": "up_aries", "kairos": "kairos"}[request.param])
    return create_planner(request.param)


def parsed(domain_text, problem_text):
    domain = parse_domain(domain_text)
    return domain, parse_problem(problem_text, domain)


def solve(planner, domain, problem, seconds=60):
    return planner.solve(*parsed(domain, problem), Deadline.after(seconds))


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
    for written, delivered in ((text, None), (late, "order2")):
        problem = parse_problem(written, domain)
        answer = planner.solve(domain, problem, Deadline.after(60))
        assert answer.status is SOLVED, answer.message
        check(answer.plan, domain, problem, EPSILON)
        orders = {step.arguments[2] for step in answer.plan.steps if step.action == "deliver"}
        assert delivered in {None, *orders}


def test_no_plan_before_the_window_closes_and_none_at_all_and_long_times(planner):
    """Whether it is proved or not depends on the planner; times are beyond the horizon that Aries has by itself."""
    assert solve(planner, ERRANDS, ERRAND.replace("(at 20 (", "(at 9 ("), 2).status in (NO_PLAN, TIMEOUT)
    if planner.name == "kairos":
        domain = "(define (domain d) (:predicates (p) (q)) (:action a :parameters () :precondition (q) :effect (p)))"
        answer = solve(planner.planner, domain, "(define (problem x) (:domain d) (:init) (:goal (p)))")
        assert (answer.status, answer.plan, "unsolvable" in answer.message) == (NO_PLAN, None, True)
    answer = solve(planner, ERRANDS, ERRAND.replace("7.5)", "40000.25)").replace("(at 20 ", "(at 50000 "))
    assert answer.status is SOLVED, answer.message
    assert answer.plan.steps[0].duration == F("40000.25")


def test_aries_on_the_logic_of_pddl():
    pytest.importorskip("up_aries")
    answer = solve(create_planner("aries"), text_of("logic.pddl"), text_of("logic-problem.pddl"))
    assert answer.status is SOLVED, answer.message
    assert {step.action: step.duration is None for step in answer.plan.steps} == {"light": True, "drive": False}
    for epsilon in (Fraction(1), Fraction(1, 10**6), Fraction(0)):
        with pytest.raises(InputError, match="expected 1/20000 to 1/10"):
            create_planner("aries", epsilon=epsilon)


@pytest.mark.parametrize(("old", "new", "message"), TABLES["aries"])
def test_what_aries_does_not_solve_is_known_beforehand(old, new, message):
    pytest.importorskip("up_aries")
    assert old in ERRANDS
    with pytest.raises(UnsupportedError, match=message):
        solve(aries.aries_planner(), ERRANDS.replace(old, new), ERRAND)


class Silent:
    """A planner that notes what it is asked, and when it has to be done."""

    def __init__(self):
        self.name, self.asked = "silent", []

    def solve(self, domain, problem, deadline):
        self.asked.append((problem, deadline))
        return PlannerAnswer(self.name, TIMEOUT, None, 0.0, "no idea")


def proof(domain_text, problem_text):
    return unreachable(*parsed(domain_text, problem_text), Deadline())


def bound_of_goal(domain, problem):
    """When the goal can be reached, in the problem's unit; None if never."""
    relaxed = relaxed_problem(domain, problem, Deadline())
    bound = EarliestTimes(relaxed, Deadline()).condition(relaxed.goal)
    return None if bound == inf else F(bound, relaxed.ticks)


def closing_at(time):
    return parse_problem(ERRAND.replace("at 20", f"at {time}"), errands)


def test_a_planner_is_only_asked_where_there_is_no_proof(fake):
    silent, deadline = Silent(), Deadline.after(20)
    planner = ReachabilityFirst(silent)
    assert planner.name == "silent"
    assert planner.solve(errands, errand, deadline).message == "no idea"
    answer = planner.solve(errands, closing_at("9.499"), deadline)
    assert 0 < answer.seconds < 10
    text = "the goal is out of reach: (open) ends at 9.499, and what needs it would end at 9.5 or later"
    assert answer == PlannerAnswer("reachability", NO_PLAN, None, answer.seconds, text)
    assert silent.asked == [(errand, deadline)]
    assert planner.solve(errands, closing_at("9.5"), deadline).plan is None
    assert len(silent.asked) == 2
    assert ask(fake.printing(VALID)).plan is not None
    assert all(isinstance(create_planner(name), ReachabilityFirst) for name in (*PLANNERS, fake.printing(VALID)))


def test_what_is_left_to_the_planner(monkeypatch):
    early = ERRAND.replace("at 20", "at 9")
    divided = ERRANDS.replace("(= ?duration (distance ?a ?b))", "(= ?duration (/ 1 (distance ?a ?b)))")
    assert proof(divided, early.replace("(= (distance home market) 7.5)", "(= (distance home market) 0)")) is None
    assert unreachable(errands, closing_at("9"), Deadline.after(0)) is None
    for most, proved in ((4, True), (3, False)):  # go both ways, shop twice
        monkeypatch.setattr(reachability, "MOST_ACTIONS", most)
        assert (proof(ERRANDS, early) is not None) is proved


@pytest.mark.parametrize(("condition", "shortest"), TABLES["bounds"])
def test_bounds_by_hand(condition, shortest):
    """When the robot can be at the market, if going there needs this."""
    domain = ERRANDS.replace("(at start (at ?a))", f"(and (at start (at ?a)) {condition})")
    assert bound_of_goal(*parsed(domain, ERRAND.replace("(done market)", "(at market)"))) == (shortest and F(shortest))


def test_the_same_question_has_the_same_answer():
    silent = Silent()
    planner = RememberingPlanner(silent)
    assert planner.name == "silent"
    first = planner.solve(errands, errand, Deadline())
    assert planner.solve(errands, parse_problem(ERRAND, errands), Deadline.after(1)) is first
    assert len(silent.asked) == 1
    for old, new in (("7.5", "8"), ("(open)", ""), ("at 20", "at 21"), ("(done market)", "(done home)")):
        planner.solve(errands, parse_problem(ERRAND.replace(old, new, 1), errands), Deadline())
    planner.solve(parse_domain(ERRANDS), errand, Deadline())
    assert len(silent.asked) == 6


def test_the_bound_of_a_delivery_is_what_it_takes():
    table = table_problems()[0]

    def proof_until(*times):
        text = table.text
        for deadline, time in zip(table.deadlines, times, strict=True):
            assert text.count(f"(at {float(deadline):g} ") == 1
            text = text.replace(f"(at {float(deadline):g} ", f"(at {time} ")
        return proof(delivery_domain(DeliveryVariant.DURATIONS), text)

    assert proof_until("414", "1") is proof_until("1", "504") is None
    assert proof_until("413.999", "503.999") == (
        "the goal is out of reach: (window_open order1) ends at 413.999, and what needs it would end at 414 or later; "
        "(window_open order2) ends at 503.999, and what needs it would end at 504 or later"
    )


@pytest.mark.parametrize("step", [50, pytest.param(11, marks=pytest.mark.slow)])
@pytest.mark.parametrize("variant", DeliveryVariant)
def test_problems_with_plans_are_not_refused(variant, step):
    """Of the tables, and drawn ones with parameters, numbers and continuous effects."""
    problems = [(delivery_domain(variant), problem.text) for problem in table_problems(variant)[::step]]
    seeds = range(4 * (variant is DeliveryVariant.BATTERY), 60, 8)
    problems += [(plan.domain, plan.problem) for plan in map(drawn_plan, seeds)]
    assert {proof(*texts) for texts in problems} == {None}


@pytest.mark.parametrize("corner", text_of("corners.txt").split("== ")[1:])
def test_corners_of_the_semantics(corner):
    """Actions, then an initial state, then a plan."""
    _, actions, initial, steps = re.fullmatch(r"(.*?)\n(.*)\n-- (.*?)\n(.*)", corner, re.DOTALL).groups()
    domain, problem = parsed(
        f"(define (domain c) (:predicates (p) (q) (x) (y)) {actions})",
        f"(define (problem c) (:domain c) (:init {initial}) (:goal (and (x) (y))))",
    )
    plan = parse_timed_plan(steps)
    check(plan, domain, problem, EPSILON)  # it is a plan
    assert unreachable(domain, problem, Deadline()) is None
    assert bound_of_goal(domain, problem) <= max(step.time + (step.duration or 0) for step in plan.steps)


ATOMS = tuple(f"p{i}" for i in range(5))
HALVES = tuple(F(i, 2) for i in range(13))


def random_world(random):
    """A few actions of all kinds over a few atoms."""
    pick = random.choice

    def literal(negative):
        atom = f"({pick(ATOMS)})"
        return f"(not {atom})" if random.random() < negative else atom

    def condition():
        return f"(or {literal(0.2)} {literal(0.2)})" if random.random() < 0.1 else literal(0.15)

    def effect(timing):
        change = f"(at {timing} {literal(0.4)})"
        return f"(when (at {timing} {literal(0.2)}) {change})" if random.random() < 0.1 else change

    def action(name):
        if random.random() < 0.15:
            return f"(:action {name} :parameters () :precondition {condition()} :effect {literal(0.4)})"
        duration = pick(("", ">= ")) + f"{pick((0, 0.5, 1, 1, 2, 3))}"
        timings = ("at start", "over all", "at end")
        conditions = " ".join(f"({pick(timings)} {condition()})" for _ in range(random.randint(0, 3)))
        effects = " ".join(effect(pick(("start", "end"))) for _ in range(random.randint(1, 3)))
        return durative(name, duration, conditions, effects)

    actions = " ".join(action(f"a{i}") for i in range(random.randint(2, 5)))
    domain = f"(define (domain w) (:predicates {' '.join(f'({atom})' for atom in ATOMS)}) {actions})"
    later = {(pick(HALVES[1:]), atom): pick(("({})", "(not ({}))")) for atom in ATOMS if random.random() < 0.25}
    initial = [f"({atom})" for atom in ATOMS if random.random() < 0.4]
    initial += [f"(at {float(time)} {form.format(atom)})" for (time, atom), form in later.items()]
    return domain, f"(define (problem r) (:domain w) (:init {' '.join(initial)}) (:goal (p0)))"


def states_of_a_schedule(domain, problem, random):
    """Moments with the atoms that hold right after, in a schedule made by chance: what breaks nothing is added."""

    def step():
        """An action as soon and as short as it goes, or at some moment, often one at which something happens."""
        schema = domain.actions[random.choice(sorted(domain.actions))]
        start = random.choice((F(0), random.choice(moments or HALVES), random.choice(HALVES)))
        if not schema.durative:
            return TimedStep(start, schema.name, (), None)
        bound = schema.durations[0]
        more = F(0) if bound.comparator.value == "=" else random.choice((F(0), F(0), *HALVES[:4]))
        return TimedStep(start, schema.name, (), bound.bound.value + more)

    chosen, moments, trace, atoms = [], [], (), set(problem.atoms)
    for _ in range(20):
        new = [step() for _ in range(random.choice((1, 1, 1, 2, 2, 3)))]
        timed = TimedPlan((*chosen, *new))
        declared = declarations(timed, domain, EPSILON)
        plan = assemble(domain, problem, STNPlan((), declared, (), "random"))
        simulation = simulate(plan, {}, schedule_of(timed, declared), epsilon=EPSILON)
        if all(breach.obligation.startswith("goal") for breach in simulation.violations):
            chosen, trace = timed.steps, simulation.trace
            ends = [(added.time, added.time + (added.duration or 0)) for added in new]
            moments += [moment for start, end in ends for moment in (start, end, end, end + EPSILON)]
    yield F(0), frozenset(atoms)
    for happening in trace:
        for atom, value in happening.atoms_changed:
            (atoms.add if value else atoms.discard)(atom)
        yield happening.time, frozenset(atoms)


@pytest.mark.parametrize(
    ("seeds", "least"),
    [(range(25), (250, 50, 5)), pytest.param(range(1000, 5000), (1000, 1000, 1000), marks=pytest.mark.slow)],
    ids=["short", "long"],
)
def test_whatever_a_valid_plan_reaches_is_not_before_its_bound(seeds, least):
    """Of pairs of atoms that were seen together, some are later, and some no later than their bound."""
    seen = later = exact = 0
    for seed in seeds:
        random = Random(seed)  # noqa: S311 - reproducible
        domain, problem = parsed(*random_world(random))
        relaxed = relaxed_problem(domain, problem, Deadline())
        times = EarliestTimes(relaxed, Deadline())
        for moment, atoms in states_of_a_schedule(domain, problem, random):
            numbers = [relaxed.number[atom] for atom in sorted(atoms) if atom in relaxed.number]
            for a, b in product(numbers, repeat=2):
                bound, ticks = times.together((a, b)), moment * relaxed.ticks
                assert bound <= ticks, (seed, relaxed.facts[a], relaxed.facts[b], moment)
                seen, later, exact = seen + 1, later + (bound > 0), exact + (0 < bound == ticks)
    assert all(count > few for count, few in zip((seen, later, exact), least, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["aries", "kairos"])
def test_no_planner_solves_what_is_refused(name):
    planner, refused = create_planner(name), 0
    for seed in range(20000, 20120):
        texts = random_world(Random(seed))  # noqa: S311
        if "(when" not in texts[0] and unreachable(*parsed(*texts), Deadline()) is not None:
            refused += 1
            assert planner.planner.solve(*parsed(*texts), Deadline.after(2)).plan is None, seed
    assert refused > 10
