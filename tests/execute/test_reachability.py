"""Proofs that there is no plan: bounds against everything that random valid plans do, and against planners."""

from fractions import Fraction
from itertools import product
from math import inf
from random import Random

import pytest

from benchmarks.generators.delivery import DeliveryVariant, delivery_domain, table_problems
from benchmarks.generators.plans import drawn_plan
from benchmarks.irr.tables import RememberingPlanner
from robust.execute.planners import PLANNERS, create_planner
from robust.execute.planners import reachability as relaxed
from robust.execute.planners.interface import PlannerAnswer, PlannerStatus, check
from robust.execute.planners.reachability import EarliestTimes, ReachabilityFirst, relaxed_problem, unreachable
from robust.plan.load import assemble
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.simulate import simulate
from robust.plan.stn import InstanceDeclaration, STNPlan
from robust.plan.timed import parse_timed_plan
from robust.smt.limits import Deadline
from tests.execute.plans import ERRAND, ERRANDS, VALID, Fake, durative, errand, errands

F = Fraction
EPSILON = F(1, 1000)


class Silent:
    """A planner that notes what it is asked, and when it has to be done."""

    name = "silent"

    def __init__(self):
        self.asked = []

    def solve(self, domain, problem, deadline):
        self.asked.append((problem, deadline))
        return PlannerAnswer(self.name, PlannerStatus.TIMEOUT, None, 0.0, "no idea")


def parsed(domain_text: str, problem_text: str):
    domain = parse_domain(domain_text)
    return domain, parse_problem(problem_text, domain)


def proof(domain_text: str, problem_text: str) -> str | None:
    return unreachable(*parsed(domain_text, problem_text), Deadline())


def bound_of_goal(domain, problem) -> Fraction | None:
    """When the goal can be reached, in the problem's unit; None if never."""
    found = relaxed_problem(domain, problem, Deadline())
    bound = EarliestTimes(found, Deadline()).condition(found.goal)
    return None if bound == inf else F(bound, found.ticks)


def closing_at(time: str):
    return parse_problem(ERRAND.replace("at 20", f"at {time}"), errands)


def test_a_planner_is_only_asked_where_there_is_no_proof():
    silent, deadline = Silent(), Deadline.after(20)
    planner = ReachabilityFirst(silent)
    assert planner.name == "silent"
    assert planner.solve(errands, errand, deadline).message == "no idea"
    answer = planner.solve(errands, closing_at("9.499"), deadline)
    assert 0 < answer.seconds < 10
    text = "the goal is out of reach: (open) ends at 9.499, and what needs it would end at 9.5 or later"
    assert answer == PlannerAnswer("reachability", PlannerStatus.NO_PLAN, None, answer.seconds, text)
    assert silent.asked == [(errand, deadline)]
    assert planner.solve(errands, closing_at("9.5"), deadline).plan is None
    assert len(silent.asked) == 2


def test_every_planner_comes_after_the_proof(tmp_path):
    planner, late = create_planner(Fake(tmp_path).printing(VALID)), Deadline.after(20)
    assert planner.solve(errands, closing_at("9"), late).planner == "reachability"
    assert planner.solve(errands, errand, late).plan is not None
    assert all(isinstance(create_planner(name), ReachabilityFirst) for name in PLANNERS)


def test_what_is_left_to_the_planner(monkeypatch):
    """What cannot be made ground, what is asked too late, and what has too many actions."""
    early = ERRAND.replace("at 20", "at 9")
    divided = ERRANDS.replace("(= ?duration (distance ?a ?b))", "(= ?duration (/ 1 (distance ?a ?b)))")
    assert proof(divided, early.replace("(= (distance home market) 7.5)", "(= (distance home market) 0)")) is None
    assert unreachable(errands, closing_at("9"), Deadline.after(0)) is None
    monkeypatch.setattr(relaxed, "MOST_ACTIONS", 4)  # go both ways, shop twice
    assert proof(ERRANDS, early) is not None
    monkeypatch.setattr(relaxed, "MOST_ACTIONS", 3)
    assert proof(ERRANDS, early) is None


@pytest.mark.parametrize(
    ("condition", "shortest"),
    [
        ("", "7.5"),
        ("(at start (>= (distance ?a ?b) 8))", None),
        ("(at start (>= (distance ?a ?b) 7))", "7.5"),
        ("(over all (not (at ?b)))", "7.5"),
        ("(at start (or (done ?a) (done ?b)))", "7.5"),
        ("(at end (done ?a))", "9.5"),  # which is not done on the way
        ("(at start (open)) (at end (not (open)))", "7.5"),
        ("(at start (done ?b))", None),
    ],
)
def test_bounds_by_hand(condition, shortest):
    """When the robot can be at the market, if going there needs this."""
    domain = ERRANDS.replace("(at start (at ?a))", f"(and (at start (at ?a)) {condition})")
    bound = bound_of_goal(*parsed(domain, ERRAND.replace("(done market)", "(at market)")))
    assert bound == (None if shortest is None else F(shortest))


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


def delivery_until(near: str, far: str) -> tuple[str, str]:
    table = table_problems()[0]
    text = table.text
    for deadline, other in zip(table.deadlines, (near, far), strict=True):
        assert text.count(f"(at {float(deadline):g} ") == 1
        text = text.replace(f"(at {float(deadline):g} ", f"(at {other} ")
    return delivery_domain(DeliveryVariant.DURATIONS), text


def test_the_bound_of_a_delivery_is_what_it_takes():
    """One robot can only be in one place: the bounds are those of the best plans, without the gaps between actions."""
    assert proof(*delivery_until("414", "1")) is None
    assert proof(*delivery_until("1", "504")) is None
    text = proof(*delivery_until("413.999", "503.999"))
    assert text == (
        "the goal is out of reach: (window_open order1) ends at 413.999, and what needs it would end at 414 or later; "
        "(window_open order2) ends at 503.999, and what needs it would end at 504 or later"
    )


@pytest.mark.parametrize("variant", DeliveryVariant)
def test_problems_with_plans_are_not_refused(variant):
    domain = delivery_domain(variant)
    assert [proof(domain, one.text) for one in table_problems(variant)[::11]] == [None] * 10


TOGETHER = "0: (a) [1]\n0: (b) [1]"
USE = "(:action b :parameters () :precondition (x) :effect (and (not (x)) (y)))"
CORNERS = {
    "starts that make true what the other needs": (
        durative("a", "1", "(over all (q))", "(at start (p)) (at end (x))")
        + durative("b", "1", "(over all (p))", "(at start (q)) (at end (y))"),
        "",
        TOGETHER,
    ),
    "ends that make false what the other needs until then": (
        durative("a", "1", "(over all (q))", "(at end (not (p))) (at end (x))")
        + durative("b", "1", "(over all (p))", "(at end (not (q))) (at end (y))"),
        "(p) (q)",
        TOGETHER,
    ),
    "an action that overlaps itself, to bring again what was used up": (
        durative("a", "4", "(at start (p))", "(at end (x))") + USE,
        "(p) (at 2 (not (p)))",
        "0: (a) [4]\n1: (a) [4]\n4.5: (b)",
    ),
    "what an end needs comes meanwhile": (
        durative("a", "4", "(over all (p)) (at end (x))", "(at end (y))") + durative("b", "3", "", "(at end (x))"),
        "(p) (at 5 (not (p)))",
        "0: (a) [4]\n0: (b) [3]",
    ),
    "an end that needs what its start brings about": (
        durative("a", "2", "(at end (q))", "(at start (p)) (at end (x)) (at end (y))")
        + durative("b", "1", "(at start (p))", "(at end (q))"),
        "",
        "0: (a) [2]\n0.5: (b) [1]",
    ),
    "nothing is inside an action without a duration": (
        durative("a", "0", "(over all (q))", "(at end (x)) (at end (y))"), "", "0: (a) [0]",
    ),
    "a window as long as the action": (
        durative("a", "3", "(over all (p))", "(at end (x)) (at end (y))"), "(at 1 (p)) (at 4 (not (p)))", "1: (a) [3]",
    ),
}  # fmt: skip


@pytest.mark.parametrize("corner", CORNERS)
def test_corners_of_the_semantics(corner):
    actions, initial, steps = CORNERS[corner]
    domain, problem = parsed(
        f"(define (domain c) (:predicates (p) (q) (x) (y)) {actions})",
        f"(define (problem c) (:domain c) (:init {initial}) (:goal (and (x) (y))))",
    )
    plan = parse_timed_plan(steps)
    check(plan, domain, problem, EPSILON)  # it is a plan
    assert unreachable(domain, problem, Deadline()) is None
    assert bound_of_goal(domain, problem) <= max(step.time + (step.duration or 0) for step in plan.steps)


@pytest.mark.parametrize("seed", range(0, 60, 4))
def test_drawn_plans_are_not_refused(seed):
    """Of domains with parameters, numbers and continuous effects."""
    drawn = drawn_plan(seed)
    assert proof(drawn.domain, drawn.problem) is None


ATOMS = tuple(f"p{i}" for i in range(5))
HALVES = tuple(F(i, 2) for i in range(13))


def random_world(random: Random) -> tuple[str, str]:
    """A few actions of all kinds over a few atoms."""

    def literal(negative: float) -> str:
        atom = f"({random.choice(ATOMS)})"
        return f"(not {atom})" if random.random() < negative else atom

    def condition() -> str:
        return f"(or {literal(0.2)} {literal(0.2)})" if random.random() < 0.1 else literal(0.15)

    def effect(timing: str) -> str:
        made = f"(at {timing} {literal(0.4)})"
        return f"(when (at {timing} {literal(0.2)}) {made})" if random.random() < 0.1 else made

    def action(name: str) -> str:
        if random.random() < 0.15:
            return f"(:action {name} :parameters () :precondition {condition()} :effect {literal(0.4)})"
        shortest = random.choice((0, 0.5, 1, 1, 2, 3))
        duration = random.choice((f"{shortest}", f">= {shortest}"))
        timings = ["at start", "over all", "at end"]
        conditions = " ".join(f"({random.choice(timings)} {condition()})" for _ in range(random.randint(0, 3)))
        effects = " ".join(effect(random.choice(("start", "end"))) for _ in range(random.randint(1, 3)))
        return durative(name, duration, conditions, effects)

    actions = " ".join(action(f"a{i}") for i in range(random.randint(2, 5)))
    domain = f"(define (domain w) (:predicates {' '.join(f'({one})' for one in ATOMS)}) {actions})"
    literals = {(random.choice(HALVES[1:]), one): random.random() < 0.5 for one in ATOMS if random.random() < 0.25}
    timed = (f"(at {float(t)} {f'({one})' if value else f'(not ({one}))'})" for (t, one), value in literals.items())
    initial = " ".join(f"({one})" for one in ATOMS if random.random() < 0.4)
    return domain, f"(define (problem r) (:domain w) (:init {initial} {' '.join(timed)}) (:goal (p0)))"


class Schedules:
    """Valid schedules of a world, made by chance: what is added is kept if nothing is broken."""

    def __init__(self, domain, problem, random: Random) -> None:
        self.domain, self.problem, self.random = domain, problem, random
        self.chosen: list[tuple[str, Fraction, Fraction]] = []

    def run(self, chosen):
        declared = tuple(
            InstanceDeclaration(f"n{i}", name, (), self.domain.actions[name].durative, self.domain.location)
            for i, (name, _, _) in enumerate(chosen)
        )
        plan = assemble(self.domain, self.problem, STNPlan((), declared, (), "random"))
        schedule = {point: point.time or F(0) for point in plan.time_points}
        for instance, (_, start, end) in zip(plan.instances, chosen, strict=True):
            schedule |= {instance.end: end, instance.start: start}
        return simulate(plan, {}, schedule, epsilon=EPSILON)

    def extend(self) -> None:
        new = [self._instance() for _ in range(self.random.choice((1, 1, 1, 2, 2, 3)))]
        simulation = self.run([*self.chosen, *new])
        if all(one.obligation.startswith("goal") for one in simulation.violations):
            self.chosen += new

    def _instance(self) -> tuple[str, Fraction, Fraction]:
        """An action as soon and as short as it goes, or at some moment, often one at which something happens."""
        name = self.random.choice(sorted(self.domain.actions))
        moments = [moment for _, start, end in self.chosen for moment in (start, end, end, end + EPSILON)]
        start = self.random.choice((F(0), self.random.choice(moments or HALVES), self.random.choice(HALVES)))
        schema = self.domain.actions[name]
        if not schema.durative:
            return name, start, start
        bound = schema.durations[0]
        more = F(0) if bound.comparator.value == "=" else self.random.choice((F(0), F(0), *HALVES[:4]))
        return name, start, start + bound.bound.value + more

    def states(self):
        """Moments with the atoms that hold right after what happens then."""
        atoms = set(self.problem.atoms)
        yield F(0), frozenset(atoms)
        for step in self.run(self.chosen).trace if self.chosen else ():
            for atom, value in step.atoms_changed:
                (atoms.add if value else atoms.discard)(atom)
            yield step.time, frozenset(atoms)


@pytest.mark.parametrize(
    ("seeds", "least"),
    [(range(100), (1000, 200, 20)), pytest.param(range(1000, 5000), (1000, 1000, 1000), marks=pytest.mark.slow)],
    ids=["short", "long"],
)
def test_whatever_a_valid_plan_reaches_is_not_before_its_bound(seeds, least):
    """Of pairs of atoms that were seen together, some are later, and some no later than their bound."""
    seen = later = exact = 0
    for seed in seeds:
        random = Random(seed)  # noqa: S311 - reproducible
        domain, problem = parsed(*random_world(random))
        found = relaxed_problem(domain, problem, Deadline())
        times = EarliestTimes(found, Deadline())
        schedules = Schedules(domain, problem, random)
        for _ in range(20):
            schedules.extend()
        for moment, atoms in schedules.states():
            numbers = [found.number[atom] for atom in sorted(atoms) if atom in found.number]
            for a, b in product(numbers, repeat=2):
                bound = times.together((a, b))
                assert bound <= moment * found.ticks, (seed, found.facts[a], found.facts[b], moment)
                seen, later, exact = seen + 1, later + (bound > 0), exact + (0 < bound == moment * found.ticks)
    assert all(count > few for count, few in zip((seen, later, exact), least, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["aries", "kairos"])
def test_no_planner_solves_what_is_refused(name):
    planner = create_planner(name)
    assert isinstance(planner, ReachabilityFirst)
    refused = 0
    for seed in range(20000, 20120):
        random = Random(seed)  # noqa: S311 - reproducible
        domain_text, problem_text = random_world(random)
        if "(when" in domain_text:
            continue
        domain, problem = parsed(domain_text, problem_text)
        if unreachable(domain, problem, Deadline()) is not None:
            refused += 1
            assert planner.planner.solve(domain, problem, Deadline.after(2)).plan is None, seed
    assert refused > 10
