"""Time-triggered plans, and problems for planners, for the study of conversions: deterministic in their seed.

Of drawn plans a domain is drawn first: durative and instantaneous actions over a few atoms and numeric fluents, with
conditions and effects at start, over all and at end, continuous effects, disjunctions, duration inequalities and timed
literals. Then steps are drawn one after another, and kept if the simulator finds that the plan is still valid. The goal
is some of what holds at the end and did not hold in the beginning.

Others are of the delivery domain (:mod:`benchmarks.generators.delivery`).
"""

from __future__ import annotations

from fractions import Fraction
from random import Random

from robust.encode.interface import EPSILON
from robust.execute.distances import InvalidPlanError, Original, declarations, schedule_of, validated
from robust.plan.load import assemble
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.plan.pddl.syntax import Domain, Problem
from robust.plan.pddl.write import action_text, conjunction_text, define, sketched_problem
from robust.plan.stn import STNPlan
from robust.plan.timed import TimedPlan, TimedStep

from . import delivery
from .delivery import Order, PlanTexts

OBJECTS = ("a", "b", "c")
PREDICATES = ("ready", "clean", "open")
TRIALS = 60
LONGEST = 8
HORIZON = 24

_DECLARED = (
    "(:requirements :typing :durative-actions :numeric-fluents :duration-inequalities :negative-preconditions "
    ":disjunctive-preconditions :timed-initial-literals :continuous-effects)",
    "(:types thing)",
    f"(:predicates {' '.join(f'({name} ?x - thing)' for name in PREDICATES)})",
    "(:functions (stock ?x - thing) (level))",
)


def drawn_plan(seed: int) -> PlanTexts:
    """The plan of that seed: at least two steps, and a goal that does not hold in the beginning."""
    random = Random(seed)  # noqa: S311 (not for secrets)
    while True:
        draft = _Draft(random)
        steps = draft.steps()
        goal = draft.goal(steps)
        if len(steps) > 1 and goal:
            return PlanTexts(draft.domain_text, draft.problem_text(goal), "".join(f"{step}\n" for step in steps))


def delivery_plan(seed: int) -> PlanTexts:
    """A generated plan of robots that fulfil all orders, with up to eight preparation steps."""
    return delivery.scaling_instance(1 + seed % 8, seed)


def delivery_order(seed: int) -> tuple[str, str]:
    """Domain and problem of one or two orders, all of which are wanted, some before a deadline."""
    random = Random(seed)  # noqa: S311 (not for secrets)
    orders = tuple(_order(random) for _ in range(random.randint(1, 2)))
    variant, robots = delivery.DeliveryVariant.DURATIONS, random.randint(1, 2)
    options = delivery.DeliveryOptions(variant, orders, robots=robots, spindles=1, every_order=True)
    return delivery.delivery_domain(variant), delivery.delivery_problem(options, seed)


def _order(random: Random) -> Order:
    deadline = Fraction(random.randint(1200, 2400)) if random.random() < 0.7 else None
    return Order(random.randint(1, 2), deadline, random.randint(0, 4))


class _Draft:
    """A domain and an initial state, and the steps that fit them."""

    def __init__(self, random: Random) -> None:
        self._random = random
        self._objects = OBJECTS[: random.randint(1, len(OBJECTS))]
        durative = [self._durative(f"do-{i}") for i in range(random.randint(3, 6))]
        instantaneous = [self._instantaneous(f"set-{i}") for i in range(random.randint(1, 2))]
        self.domain_text = define("domain", "drawn", [*_DECLARED, *durative, *instantaneous])
        self._initial = self._initial_state()
        self._domain = parse_domain(self.domain_text)
        self._problem = parse_problem(self.problem_text(""), self._domain)

    # -- the domain --------------------------------------------------------------------------------------------------

    def _durative(self, name: str) -> str:
        random = self._random
        timings = ("at start", "over all", "over all", "at end")
        conditions = [f"({random.choice(timings)} {self._condition()})" for _ in range(random.randint(1, 3))]
        effects = [f"({random.choice(('at start', 'at end', 'at end'))} {self._effect()})"]
        effects += [f"(at start {self._effect()})" for _ in range(random.randint(0, 1))]
        if random.random() < 0.4:
            effects.append(f"({random.choice(('increase', 'decrease'))} (level) (* #t {random.randint(1, 2)}))")
        needed = conjunction_text(conditions)
        return action_text(name, needed, effects, parameters="?x ?y - thing", duration=self._duration())

    def _instantaneous(self, name: str) -> str:
        condition, effect = self._condition("?x"), self._effect("?x")
        return f"(:action {name} :parameters (?x - thing) :precondition {condition} :effect {effect})"

    def _duration(self) -> str:
        short, long = sorted((self._random.randint(1, LONGEST), self._random.randint(1, LONGEST)))
        exactly, between = f"(= ?duration {long})", f"(and (>= ?duration {short}) (<= ?duration {long}))"
        return self._random.choice((exactly, exactly, between, f"(>= ?duration {short})"))

    def _literal(self, *variables: str) -> str:
        atom = f"({self._random.choice(PREDICATES)} {self._random.choice(variables or ('?x', '?x', '?y'))})"
        return atom if self._random.random() < 0.65 else f"(not {atom})"

    def _condition(self, *variables: str) -> str:
        random = self._random
        kind = random.random()
        if kind < 0.55:
            return self._literal(*variables)
        if kind < 0.65:
            return f"(or {self._literal(*variables)} {self._literal(*variables)})"
        fluent = random.choice(("(level)", "(stock ?x)"))
        return f"({random.choice(('>=', '<='))} {fluent} {random.randint(4, 12)})"

    def _effect(self, *variables: str) -> str:
        random = self._random
        if random.random() < 0.6:
            return self._literal(*variables)
        fluent = random.choice(("(level)", "(stock ?x)"))
        return f"({random.choice(('increase', 'decrease'))} {fluent} {random.randint(1, 3)})"

    # -- the problem -------------------------------------------------------------------------------------------------

    def _initial_state(self) -> list[str]:
        random = self._random
        atoms = [f"({name} {thing})" for name in PREDICATES for thing in self._objects]
        values = [f"(= (level) {random.randint(6, 10)})"]
        values += [f"(= (stock {thing}) {random.randint(6, 10)})" for thing in self._objects]
        changing = random.sample(atoms, random.randint(0, 2))
        literals = [f"(at {random.randint(1, HORIZON)} {random.choice((atom, f'(not {atom})'))})" for atom in changing]
        return [*(atom for atom in atoms if random.random() < 0.5), *values, *literals]

    def problem_text(self, goal: str) -> str:
        """The problem with that conjunction of literals as its goal."""
        objects = f"{' '.join(self._objects)} - thing"
        return sketched_problem("drawn-problem", "drawn", self._initial, [goal], objects=objects)

    # -- the plan ----------------------------------------------------------------------------------------------------

    def steps(self) -> list[TimedStep]:
        """Steps that make a valid plan together, in the order of their starts."""
        wanted = self._random.randint(3, 9)
        steps: list[TimedStep] = []
        for _ in range(TRIALS):
            longer = sorted((*steps, self._step()), key=lambda step: step.time)
            if len(steps) < wanted and _valid(self._domain, self._problem, longer) is not None:
                steps = longer
        return steps

    def _step(self) -> TimedStep:
        random = self._random
        action = random.choice(sorted(self._domain.actions))
        start = Fraction(random.randint(0, 4 * HORIZON), 4)
        if not self._domain.actions[action].durative:
            return TimedStep(start, action, (random.choice(self._objects),))
        arguments = (random.choice(self._objects), random.choice(self._objects))
        return TimedStep(start, action, arguments, Fraction(random.randint(1, LONGEST)))

    def goal(self, steps: list[TimedStep]) -> str:
        """Some of the atoms that the plan made true, empty if there are none."""
        original = _valid(self._domain, self._problem, steps) if steps else None
        if original is None:
            return ""
        final = original.execution.happenings[-1].after.atoms
        new = sorted(str(atom) for atom in final - original.plan.initial_atoms)
        return " ".join(self._random.sample(new, self._random.randint(1, len(new)))) if new else ""


def _valid(domain: Domain, problem: Problem, steps: list[TimedStep]) -> Original | None:
    plan = TimedPlan(tuple(steps))
    instances = declarations(plan, domain, EPSILON)
    bare = assemble(domain, problem, STNPlan((), instances, (), plan.file))
    try:
        return validated(bare, schedule_of(plan, instances), EPSILON, plan.file)
    except InvalidPlanError:
        return None
