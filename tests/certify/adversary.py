"""False claims with certificates that somebody made up: none may be accepted.

A case is a plan with claims that are known to be false, because the simulator, the exact region or the oracle says so,
and a pool of lines from honest certificates: of this plan, of neighbouring claims and of other plans. A grammar makes
tapes of them: lines recombined, repeated, dropped, re-ordered and invented, numbers changed, proofs of other claims.

`python -m tests.certify.adversary 100000` prints what became of as many.
"""

from __future__ import annotations

import json
import sys
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache
from random import Random
from typing import Any
from unittest.mock import patch

from benchmarks.generators.team_plans import Shape, random_plan
from robust.api import check, envelope, region
from robust.certify.bad import face_lines, region_lines
from robust.certify.checker import choices, reader
from robust.certify.checker.claims import Claim
from robust.certify.checker.formulas import FALSE, Formulas, plus
from robust.certify.hints import KnownFacts, Line, NotRefutedError, implied, model, refutation
from robust.certify.tape import OrderLemmas, constant_times, good_lines, header
from robust.encode import create_encoding
from robust.errors import RobustError
from robust.pike_bridge.action_model import Instance
from robust.pike_bridge.files import tpnu_text
from robust.plan.model import Parameter, ParametrizedPlan
from robust.plan.simulate import simulate
from robust.qe.box import Box, Interval
from robust.qe.region import Region
from robust.smt.limits import Deadline
from tests.certify import tools
from tests.certify.texts import random_texts
from tests.sampling import Network, sample_schedules

WAIT = Deadline.after(3600)


@dataclass
class Case:
    """One thing to lie about: honest tapes, first lines of false claims, and how a claim that is accepted is judged."""

    name: str
    attempt: Callable[..., Claim | str]
    false: list[Line]
    honest: list[list[Line]]
    is_true: Callable[[Claim], bool]
    lies: list[list[Line]] = field(default_factory=list)
    pool: list[Line] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.pool = [line for lines in self.honest for line in lines[1:]]


# -- lies --------------------------------------------------------------------------------------------------------------


@contextmanager
def lying(random: Random) -> Iterator[None]:
    """The producer makes up what it does not find: refutations, multiples, orders, schedules."""

    def refuted(formulas: Formulas, facts: KnownFacts, literal: int, deadline: Deadline, also: Any = ()) -> Line:
        roots = [*formulas.roots(literal), *also]
        try:
            return refutation(formulas, facts, literal, deadline, roots[len(formulas.roots(literal)) :])
        except NotRefutedError:
            return made_up(formulas, len(facts.sides), roots, random)

    def multiples(facts: KnownFacts, form: Any, *, strictly: bool = False) -> list[tuple[int, Fraction]]:
        try:
            return implied(facts, form, strictly=strictly)
        except NotRefutedError:
            numbers = range(len(facts.sides))
            return [(number, Fraction(1)) for number in numbers if random.random() < 0.5]

    def longer(orders: OrderLemmas, pair: tuple[int, int], default: Any = None) -> Any:
        if not by:
            return honest_order(orders, pair, default)
        if pair not in asked:
            asked[pair] = by if random.random() < 0.6 else None
        if asked[pair] is None:
            return default
        orders._used[pair] = by
        return by

    def some_times(formulas: Formulas, ranges: Any) -> dict[str, dict[str, Fraction]]:
        found = constant_times(formulas, ranges)
        return {point: {} for point in formulas.free()} if found is None else found

    def strayed(orders: OrderLemmas) -> Iterator[Any]:
        """Paths of constraints that do not follow each other, but are long enough."""
        ground = orders._ground
        longest = max(range(len(ground.edges)), key=lambda number: ground.edges[number][2].get("", Fraction(0)))
        if not by:
            yield from honest_lemmas(orders)
            return
        for (a, b), bound in orders._used.items():
            enters = [number for number, edge in enumerate(ground.edges) if edge[1] == b]
            steps = [longest] * random.randint(1, 6) + [random.choice(enters)]
            total: dict[str, Fraction] = {"": -bound}
            for number in steps:
                total = plus(total, ground.edges[number][2])
            yield a, b, steps, bound, total

    asked: dict[tuple[int, int], Fraction | None] = {}
    honest_order, honest_lemmas = OrderLemmas.get, OrderLemmas.lemmas
    by = random.choice([Fraction(0), Fraction(0), Fraction(1, 1000), Fraction(5)])
    with (
        patch("robust.certify.tape.refutation", refuted),
        patch("robust.certify.bad.refutation", refuted),
        patch("robust.certify.tape.implied", multiples),
        patch("robust.certify.bad.implied", multiples),
        patch("robust.certify.tape.constant_times", some_times),
        patch.object(OrderLemmas, "get", longer),
        patch.object(OrderLemmas, "lemmas", strayed),
    ):
        yield


def made_up(formulas: Formulas, facts: int, roots: list[int], random: Random) -> Line:
    """A refutation of something that is not refuted: false lemmas, or propagation that leads nowhere."""
    nodes = range(2, len(formulas.circuit.nodes))
    compared = [number for number in nodes if not formulas.circuit.is_gate(number)]
    some = [[number, random.randint(1, 3)] for number in range(facts) if random.random() < 0.3]
    one = random.choice(compared) * random.choice([1, -1]) if compared else 1
    gate = abs(roots[0])
    wide = max(
        (each for each in nodes if each not in compared), key=lambda n: len(formulas.circuit.nodes[n]), default=1
    )
    return [
        "refute",
        *random.choice(
            [
                [[[], [], some]],
                [[[-roots[0]], [1], some], [[], [0, len(roots)]]],
                [[[one], [1], some], [[-one], [1], some], [[], [len(roots), len(roots) + 1]]],
                [[[one, -one], [1, 1], []], [[], [len(roots)]]],
                [[[one, -one], [1, 1], []]],
                [[[], [[wide, 0], [wide, 1]]]],
                [[[], [0, [random.choice([gate, -gate, one, -gate - 1, -2]), random.randrange(3)]]]],
                [[[], [0]]],
                [[[], [0, 0]]],
                [[[], [[gate, 0], 0]]],
                [[[], [0, [gate, 1]]]],
                [[[-roots[0]], [[gate, 0]]], [[], [0, len(roots)]]],
                [[[], []]],
                [[[], [0, len(roots)]]],
            ]
        ),
    ]


def lies(plan: ParametrizedPlan, ground: reader.Ground, box: Box | None, random: Random) -> Iterator[list[Line]]:
    """Tapes for a false claim that are honest but for what cannot be honest."""
    for _ in range(4):
        with lying(random):
            try:
                if box is not None:
                    lines = good_lines(ground, tools.EPSILON, box, solver="z3", deadline=WAIT)
                    yield [header("box", box), *lines]
                else:
                    wrong = random.choice([Region.universe, Region.nothing])(tuple(ground.parameters))
                    lines = region_lines(ground, tools.EPSILON, wrong, deadline=WAIT)
                    yield [header("region"), *lines]
            except (RobustError, NotRefutedError, reader.Unsupported, ValueError, KeyError):
                continue


def nothing_is_good(ground: reader.Ground, random: Random) -> Iterator[list[Line]]:
    """That the envelope is empty: by circles of constraints that are none."""
    formulas = Formulas(ground, tools.EPSILON)
    literals = [broken() for _, broken in formulas.obligations()]
    lines = [["refute", [[], [len(formulas.roots(each)), [1, 0]]]] for each in literals if each != FALSE]
    for number, (_, _, length) in enumerate(ground.edges):
        if length.keys() == {""} and length[""] > 0:
            steps = [number] * random.randint(1, 2) + random.choice([[], [random.randrange(len(ground.edges))]])
            yield [
                header("region"), ["bad", []], ["cycle", steps, []], ["good"], ["orders"], *lines, ["rest"],
                ["refute", [[], [0, [1, 0]]]],
            ]  # fmt: skip


# -- what is false -----------------------------------------------------------------------------------------------------


def refuted_at(plan: ParametrizedPlan, values: dict[str, Fraction], random: Random) -> bool:
    """Whether these values leave no schedule, or one that breaks something."""
    if not Network(plan, values).consistent:
        return True
    return any(simulate(plan, values, one).violations for one in sample_schedules(plan, values, random, 12))


def points(box: Box, random: Random, count: int) -> Iterator[dict[str, Fraction]]:
    """Corners, and points between."""
    for _ in range(count):
        chosen = {}
        for name, each in box.intervals.items():
            low = each.lower if each.lower is not None else (each.upper or Fraction(0)) - 5
            high = each.upper if each.upper is not None else low + 10
            share = random.choice([Fraction(0), Fraction(1), Fraction(random.randint(1, 15), 16)])
            chosen[name] = low + (high - low) * share
        if all(chosen[name] in each for name, each in box.intervals.items()):
            yield chosen


def is_false(plan: ParametrizedPlan, box: Box, random: Random) -> bool:
    return any(refuted_at(plan, values, random) for values in points(box, random, 25))


def grown(box: Box, random: Random) -> Box:
    """The box with some faces pushed out, or taken in."""
    for name in random.sample(list(box.intervals), random.randint(1, len(box.intervals))):
        each = box[name]
        by = random.choice([Fraction(1, 1000), Fraction(1, 2), Fraction(1), Fraction(7)])
        low = None if each.lower is None or random.random() < 0.1 else each.lower - random.choice([0, by])
        high = None if each.upper is None or random.random() < 0.1 else each.upper + random.choice([0, by])
        box = box.replace(name, Interval(low, high, low is not None, high is not None))
    return box


def plan_cases(seed: int) -> Iterator[Case]:
    """False claims about one random plan, of the kinds that it has."""
    texts, random = random_texts(seed, easy=True), Random(seed)
    try:
        plan = tools.assembled(texts)
        ground = reader.ground(*texts)
        proved = check(plan, timeout=20).answer.name == "PROVED"
        exact = region(plan, timeout=20) if plan.parameters else None
    except (RobustError, reader.Unsupported):
        return
    whole = exact.region if exact is not None and exact.is_exact else None
    boxes = [Box.nominal(plan.parameters)]
    if proved and plan.parameters:
        boxes.append(envelope(plan, timeout=20).box)
    honest = [lines for box in boxes if proved for lines in _honest(plan, ground, box, whole)]
    grew = [grown(random.choice(boxes), random) for _ in range(8)] if plan.parameters else []
    claims = [box for box in grew if is_false(plan, box, random)]
    false: list[Line] = [header(random.choice(["box", "maximal"]), box) for box in claims]
    false += [header("plan")] if is_false(plan, boxes[0], random) else []
    false += [header("maximal", boxes[0])] if len(boxes) > 1 and boxes[1] != boxes[0] else []
    false += [header("region")] if whole is not None else []
    if not honest:  # what would be honest of another plan
        honest = [[header("plan"), ["orders"], ["schedule"], ["kept"], ["refute", [[], [0]]]]]

    def is_true(claim: Claim) -> bool:
        return claim.kind == "region" and whole is not None and _same(claim, whole, plan, Random(seed))

    wrong = claims + boxes[:1] if header("plan") in false else []
    told = [lines for box in wrong for lines in lies(plan, ground, box, random)]
    told = [[header("plan"), *lines[1:]] if header("box", boxes[0]) == lines[0] else lines for lines in told]
    if whole is not None:
        told += lies(plan, ground, None, random)
        told += nothing_is_good(ground, random) if not whole.is_empty else ()
    if false:
        read = {id(tools.CHECKER): ground}

        def attempt(lines: list[Any], by: tools.Checker = tools.CHECKER) -> Claim | str:
            if id(by) not in read:
                read.clear()
                read.update({id(tools.CHECKER): ground, id(by): by.reader.ground(*texts)})
            return tools.judged(lines, read[id(by)], by=by)

        yield Case(f"plan {seed}", attempt, false, honest, is_true, told)


def _honest(plan: ParametrizedPlan, ground: reader.Ground, box: Box, whole: Region | None) -> Iterator[list[Line]]:
    try:
        lines = good_lines(ground, tools.EPSILON, box, solver="z3", deadline=WAIT)
        yield [header("box", box), *lines]
        faces = face_lines(ground, create_encoding("relational", plan), box, solver="z3", deadline=WAIT)
        yield [header("maximal", box), *lines, *faces]
        if whole is not None:
            yield [header("region"), *region_lines(ground, tools.EPSILON, whole, deadline=WAIT)]
    except (RobustError, NotRefutedError, reader.Unsupported):
        return


def _same(claim: Claim, whole: Region, plan: ParametrizedPlan, random: Random) -> bool:
    """Whether the region that is claimed is the envelope, at many points within the declared bounds."""
    for _ in range(200):
        point = {each.name: _value(each, random) for each in plan.parameters}
        bad = any(
            all((level := _at(form, point)) > 0 or (level == 0 and not strict) for form, strict in piece)
            for piece in claim.removed or []
        )
        if (point in whole) == bad:
            return False
    return True


def _value(parameter: Parameter, random: Random) -> Fraction:
    value = Fraction(random.randint(-40, 60), random.choice([1, 2, 3, 8]))
    value = value if parameter.lower is None else max(value, parameter.lower)
    return value if parameter.upper is None else min(value, parameter.upper)


def _at(form: dict[str, Fraction], point: dict[str, Fraction]) -> Fraction:
    return sum((factor * (point[name] if name else 1) for name, factor in form.items()), Fraction(0))


@cache
def network_case(seed: int) -> Case | None:
    """That a plan with choices has no correct execution, although it has one; honest tapes are of other plans."""
    instances = [random_plan(seed, index, Shape(top=3, inner=2)) for index in range(4)]
    possible, honest = [], []
    for one in instances:
        made = _choices(one)
        literal = made.circuit.all(made.parts)
        if model(made.formulas, KnownFacts([]), literal, WAIT) is not None:
            possible.append(one)
        else:
            honest.append([header("knowledge"), refutation(made.formulas, KnownFacts([]), literal, WAIT)])
    if not possible or not honest:
        return None
    read = {id(tools.CHECKER): _choices(possible[0])}

    def attempt(lines: list[Any], by: tools.Checker = tools.CHECKER) -> Claim | str:
        if id(by) not in read:
            read.clear()
            read.update({id(each): _choices(possible[0], each) for each in (tools.CHECKER, by)})
        made = read[id(by)]
        tape = by.proofs.Tape(json.dumps(line) for line in lines[1:])
        try:
            facts = by.proofs.Facts([])
            by.proofs.refute(tape, made.formulas, facts, made.circuit.all(made.parts))
            tape.finish()
        except by.proofs.Rejected as error:
            return str(error)
        except tools.MALFORMED as error:
            return type(error).__name__
        return Claim("knowledge", tools.EPSILON)

    return Case(f"network {seed}", attempt, [header("knowledge")], honest, lambda _: False)


def _choices(instance: Instance, by: tools.Checker = tools.CHECKER) -> choices.Choices:
    document = by.choices.network_of(tpnu_text(instance.network, domain="domain", problem="problem"))
    return by.choices.Choices((document, instance.domain, instance.problem), tools.EPSILON)


# -- tapes -------------------------------------------------------------------------------------------------------------

NUMBERS: list[Any] = [
    0, 1, -1, 2, 3, 7, -2, 10**20, "0", "1", "-1", "1/2", "1000", "2/4", True, False, None, 1.5, [], {},
]  # fmt: skip
KINDS = ("orders", "schedule", "kept", "refute", "face", "cycle", "broken", "bad", "good", "piece", "rest")


def invented(random: Random, depth: int = 0) -> Any:
    """Any value of the shapes that lines have."""
    if depth > 3 or random.random() < 0.4:
        return random.choice(NUMBERS)
    return [invented(random, depth + 1) for _ in range(random.choice([0, 1, 1, 2, 2, 3, 5]))]


def line(random: Random) -> Line:
    """A line that no honest certificate has."""
    kind = random.choice(KINDS)
    if kind == "refute":
        steps = [
            random.choice(
                [
                    [[], [random.randrange(4) for _ in range(random.randint(0, 3))]],
                    [[random.randint(-9, 9)], [[random.randrange(12), random.randrange(4)]]],
                    [[random.randint(-9, 9)], [1], [[random.randrange(6), 1]]],
                    [[], [], [[random.randrange(6), 1], [random.randrange(6), 1]]],
                ]
            )
            for _ in range(random.randint(1, 4))
        ]
        return [kind, *steps]
    if kind == "orders":
        return [
            kind,
            *([a, b, [random.randrange(9)], "1", []] for a, b in [(random.randrange(5), random.randrange(5))]),
        ]
    return [kind, *(invented(random) for _ in range(random.randrange(4)))]


def leaf_changed(value: Any, random: Random) -> Any:
    """One place of a line is something else."""
    if not isinstance(value, list) or not value or random.random() < 0.15:
        return random.choice(
            [value + random.choice([1, -1]) if type(value) is int else invented(random), invented(random)]
        )
    place = random.randrange(len(value))
    way = random.random()
    if way < 0.1:
        return value[:place] + value[place + 1 :]
    if way < 0.2:
        return [*value[:place], value[place], *value[place:]]
    if way < 0.25:
        return [*value[:place], random.choice(value), *value[place:]]
    return [*value[:place], leaf_changed(value[place], random), *value[place + 1 :]]


def changed(lines: list[Line], pool: list[Line], random: Random) -> list[Line]:  # noqa: PLR0911 - one return for each way
    """One change of a tape."""
    if not lines:
        return [random.choice(pool)]
    place, other = random.randrange(len(lines)), random.randrange(len(lines))
    way = random.randrange(9)
    if way == 0:
        return lines[:place] + lines[place + 1 :]
    if way == 1:
        return [*lines[:place], lines[other], *lines[place:]]
    if way == 2:
        return [*lines[:place], random.choice(pool), *lines[place:]]
    if way == 3:
        return [*lines[:place], random.choice(pool), *lines[place + 1 :]]
    if way == 4:
        swapped = list(lines)
        swapped[place], swapped[other] = lines[other], lines[place]
        return swapped
    if way == 5:
        return [*lines[:place], line(random), *lines[place + random.randrange(2) :]]
    if way == 6 and lines[place][0] == "refute":
        more = random.choice([each for each in pool if each[0] == "refute"] or [lines[place]])
        return [*lines[:place], [*lines[place], *more[1:]], *lines[place + 1 :]]
    kind, *rest = lines[place]
    if not rest:
        return lines[:place]
    inner = random.randrange(len(rest))
    return [
        *lines[:place],
        [kind, *rest[:inner], leaf_changed(rest[inner], random), *rest[inner + 1 :]],
        *lines[place + 1 :],
    ]


def forged(case: Case, others: list[Case], random: Random) -> list[Any]:
    """A false claim with a tape that somebody made up."""
    first = random.choice(case.false)
    if case.lies and random.random() < 0.4:
        lines = random.choice(case.lies)
        return lines if random.random() < 0.7 else [lines[0], *changed(lines[1:], case.pool, random)]
    pool = random.choice(others).pool if random.random() < 0.2 else case.pool
    way = random.random()
    if way < 0.1:
        lines = [random.choice(pool) if random.random() < 0.7 else line(random) for _ in range(random.randint(0, 12))]
    else:
        suited = [lines for lines in case.honest if lines[0][1] == first[1]] or case.honest
        lines = list(random.choice(suited)[1:])
        for _ in range(random.choice([0, 1, 1, 1, 2, 3, 6])):
            lines = changed(lines, pool, random)
    return [first, *lines]


@dataclass
class Outcome:
    """What became of the attempts; `accepted` are false claims that the checker believed."""

    rejected: Counter[str] = field(default_factory=Counter)
    true: int = 0
    accepted: list[tuple[str, list[Any]]] = field(default_factory=list)


def cases(count: int, first: int = 0) -> list[Case]:
    """Cases of random plans, and of plans with choices."""
    found: list[Case] = []
    seed = first
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        while len(found) < count:
            found += plan_cases(seed)
            network = network_case(seed // 4) if seed % 4 == 0 else None
            found += [network] if network is not None else []
            seed += 1
    return found


def run(count: int, *, plans: int, seed: int = 0) -> Outcome:
    """That many attempts."""
    random, known, outcome = Random(seed), cases(plans, seed), Outcome()
    for _ in range(count):
        case = random.choice(known)
        lines = forged(case, known, random)
        found = case.attempt(lines)
        if isinstance(found, str):
            outcome.rejected[found.split(":")[0][:40]] += 1
        elif case.is_true(found):
            outcome.true += 1
        else:
            outcome.accepted.append((case.name, lines))
    return outcome


if __name__ == "__main__":
    done = run(int(sys.argv[1]), plans=int(sys.argv[2]) if len(sys.argv) > 2 else 60)
    print(f"{sum(done.rejected.values())} rejected, {done.true} still true, {len(done.accepted)} false and accepted")
    for name, lines in done.accepted[:5]:
        print(name, json.dumps(lines)[:2000])
