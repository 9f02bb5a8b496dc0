"""What is executed and planned in tests: plans with boxes, drawn values, conversions, and planners as small scripts."""

import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from pathlib import Path
from random import Random
from textwrap import dedent

from robust import Box, Interval, ParametrizedPlan, envelope, reading
from robust.errors import Location
from robust.execute.convert import Conversion, Mode, Settings, convert
from robust.execute.dispatchable import Dispatchable, make_dispatchable
from robust.execute.rules import Rule, Rules, Subject
from robust.plan import load, parameters, stn, timed
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.probability.distributions import parse_form

EPSILON = Fraction(1, 1000)

ROOT = Path(__file__).parents[2]
DOMAINS = ROOT / "benchmarks" / "domains"
PLANS = (
    ("robot_delivery", "domain", "problem-two-orders", "two-orders-10"),
    ("robot_delivery", "domain", "problem-one-order", "one-order-preparation-3"),
    ("robot_delivery", "domain-battery", "problem-battery", "one-order-battery-6"),
    ("generator", "domain", "problem-5", "plan-5-2"),
    ("generator", "domain", "problem-5", "plan-5-pauses-3"),
    ("solar_rover", "domain-yield", "problem-yield", "plan-yield"),
    ("auv_survey", "domain", "problem-two-vehicles", "two-vehicles-5"),
)
FIRST_ORDER = (ROOT / "robust/examples/delivery/steps.plan").read_text(encoding="utf-8")


def text_of(name: str) -> str:
    """A text of the folder `data`."""
    return Path(__file__).with_name("data").joinpath(name).read_text(encoding="utf-8")


def interval(ends: str | Sequence[Fraction | int | str | None]) -> Interval:
    """An interval as people write it, such as "[1, inf)", or by its closed ends."""
    if isinstance(ends, str):
        lower, upper = (None if end == "inf" else Fraction(end) for end in ends[1:-1].split(", "))
        return Interval(lower, upper, ends[0] == "[", ends[-1] == "]")
    return Interval(*(None if end is None else Fraction(end) for end in ends))


def box_of(**intervals: str | Sequence[Fraction | int | str | None]) -> Box:
    return Box({name: interval(ends) for name, ends in intervals.items()})


def drawn(box: Box, random: Random, *, width: Fraction = Fraction(50)) -> dict[str, Fraction]:
    """A point of a box, often a corner; infinite sides are cut."""
    values = {}
    for name, allowed in box.intervals.items():
        low = (allowed.upper or Fraction(0)) - width if allowed.lower is None else allowed.lower
        high = low + width if allowed.upper is None else allowed.upper
        share = random.choice([Fraction(0), Fraction(1), Fraction(random.randint(1, 99), 100)])
        chosen = low + (high - low) * share
        values[name] = chosen if chosen in allowed else (low + high) / 2
    return values


TASKS, TWO_TASKS, PLAN = map(text_of, ("tasks.pddl", "two-tasks.pddl", "two-tasks.stn"))


def tasks(plan: str = PLAN, *specs: str, problem: str = TWO_TASKS) -> ParametrizedPlan:
    """The small plan: `work a` takes as long as nature wants, `work b` from 5 to 8 as the dispatcher wants."""
    domain = parse_domain(TASKS)
    return load.assemble(domain, parse_problem(problem, domain), stn.parse_stn(plan), parameters.parse_specs(specs))


def working(*constraints: str, on: Sequence[str] = "ab") -> str:
    """A plan in which w1 works on the first task as long as nature wants, w2 on the second one, and so on."""
    instances = (f"durative-action instance w{number} : (work {task});" for number, task in enumerate(on, 1))
    first = "parameter first default 10;", *instances, "c: w1.end - w1.start in [first, first];"
    return "\n".join([*first, *(f"c: {constraint};" for constraint in constraints)])


def nothing_else(on: Sequence[str], until: int = 300) -> str:
    """The problem of working on these tasks, all of which are ready."""
    ready, done = (" ".join(f"({what} {task})" for task in on) for what in ("ready", "done"))
    initial = f"{ready} (open) (at {until} (not (open))) (= (stock) 0)"
    objects = f"(:objects {' '.join(on)} - task)"
    return f"(define (problem p) (:domain tasks) {objects} (:init {initial}) (:goal (and {done})))"


def tasks_dispatchable(box: Mapping[str, tuple[int, int]] | None = None, plan: str = PLAN, *specs: str) -> Dispatchable:
    """That plan with a box."""
    return make_dispatchable(tasks(plan, *specs), box_of(**({"first": (4, 20)} if box is None else box)))


@cache
def with_box(folder: str, domain: str, problem: str, plan: str) -> Dispatchable:
    """A benchmark plan with its box by exact widening."""
    base = DOMAINS / folder
    loaded = reading.load_plan(base / f"{domain}.pddl", base / f"{problem}.pddl", base / f"{plan}.stn")
    result = envelope(loaded)
    assert result.verified
    return make_dispatchable(loaded, result.box)


def constant(subject: Subject, name: str, value: Fraction | int | str) -> Rule:
    """The rule that something always has this value."""
    return Rule(subject, name, parse_form(f"constant:{value}", Location(name)))


def fixed(values: Mapping[str, Fraction]) -> Rules:
    """A world in which parameters have these values."""
    return Rules(tuple(constant(Subject.PARAMETER, name, value) for name, value in values.items()))


def drawn_plan(random: Random, *, tasks_at_most: int = 5, loose: bool = False) -> ParametrizedPlan:
    """A random partial order of tasks, some a limited time after others, with a deadline that some values miss; a
    `loose` one has no limits, and a deadline that leaves room."""
    count = random.randint(2, tasks_at_most)
    declared, constraints = [], []
    for number in range(1, count + 1):
        if number > 1:
            declared.append(f"parameter d{number} default {random.randint(2, 9)};")
            constraints.append(f"w{number}.end - w{number}.start in [d{number}, d{number}]")
        for before in range(1, number):
            if random.random() < 0.6:
                least = random.choice(["0.001", "1", "2.5"])
                most = "inf" if loose else random.choice(["inf", "inf", "inf", "12", "20"])
                constraints.append(f"w{number}.start - w{before}.end in [{least}, {most}]")
            elif not loose and random.random() < 0.15:
                constraints.append(f"w{number}.end - w{before}.start in [0.001, 30]")
        constraints.append(f"w{number}.end - .zero in [0, {200 if loose else 12 * count}]")
    objects = [f"t{number}" for number in range(count)]
    text = "\n".join([*declared, working(*constraints, on=objects)])
    return tasks(text, problem=nothing_else(objects, until=201))


def drawn_with_box(random: Random) -> tuple[ParametrizedPlan, Box]:
    """A drawn plan whose nominal values leave a schedule, and its box by exact widening."""
    while True:
        plan = drawn_plan(random)
        result = envelope(plan)
        if result.verified:
            return plan, result.box


def converted(domain: str, problem: str, plan: str, *specs: str, **options: object) -> Conversion:
    """The conversion of three texts, if not said otherwise the least constrained one."""
    parsed = parse_domain(domain)
    read, steps = parse_problem(problem, parsed), timed.parse_timed_plan(plan, "plan.txt")
    settings = Settings(specs=parameters.parse_specs(specs), **{"mode": Mode.CAUSAL, **options})  # type: ignore[arg-type]
    return convert(parsed, read, steps, settings)


def durative(name: str, duration: str, conditions: str, effects: str) -> str:
    """A durative action without parameters, as PDDL; `duration` is its length, or a comparison with it as `>= 2`."""
    operator, length = duration.split() if duration[0] in "<>" else ("=", duration)
    return (
        f"(:durative-action {name} :parameters () :duration ({operator} ?duration {length}) "
        f":condition (and {conditions}) :effect (and {effects}))"
    )


ERRANDS, ERRAND = map(text_of, ("errands.pddl", "errand.pddl"))
VALID = "0.000: (GO HOME MARKET) [7.500]\n7.501: (shop market)  [2.000]\n"
BETTER = "0: (go home market) [7.5]\n7.5: (shop market) [2]\n"
TOO_LATE = "0.000: (go home market) [7.5]\n18.5: (shop market) [2.0]\n"

errands = parse_domain(ERRANDS)
errand = parse_problem(ERRAND, errands)


@dataclass(frozen=True)
class Fake:
    """A script in a folder; `command` is the template that starts it."""

    folder: Path

    def command(self, body: str, arguments: str = "{domain} {problem} {output} {timeout}") -> str:
        script = self.folder / "fake.py"
        script.write_text(f"import os, signal, subprocess, sys, time\n{dedent(body)}", encoding="utf-8")
        return f"command:{shlex.quote(sys.executable)} -I {shlex.quote(str(script))} {arguments}"

    def printing(self, text: str, then: str = "") -> str:
        return self.command(f"print({text!r}, flush=True)\n{dedent(then)}")
