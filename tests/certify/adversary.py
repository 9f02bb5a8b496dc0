"""False claims with certificates that somebody made up: none may be accepted.

A case is a plan with claims that the simulator, the exact region or the oracle says are false, and a pool of lines from
honest certificates: a grammar recombines, repeats, drops, re-orders, changes and invents lines. `data/forgeries.json`
has plans as small as possible with tapes made up with care: each would be believed if one of the checker's demands were
missing or weaker. `python -m tests.certify.adversary 100000` prints what became of as many attempts.
"""

from __future__ import annotations

import json
import sys
import warnings
from collections import Counter
from collections.abc import Callable
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache, partial
from itertools import count
from pathlib import Path
from random import Random
from typing import Any, NamedTuple
from unittest.mock import patch

from benchmarks.generators.team_plans import Shape, random_plan
from robust import Box, Interval, Region, RobustError, check, envelope, region
from robust.certify import bad, hints, tape
from robust.certify.checker import reader
from robust.certify.checker.claims import SCHEDULED, Claim
from robust.certify.checker.formulas import FALSE, Formulas, plus
from robust.certify.checker.proofs import RATIONAL
from robust.certify.hints import KnownFacts, Line, NotRefutedError
from robust.certify.tape import OrderLemmas, header
from robust.encode import create_encoding
from robust.pike_bridge.files import tpnu_text
from robust.plan.simulate import simulate
from robust.smt.limits import Deadline
from tests.certify import tools
from tests.certify.texts import Texts, random_texts
from tests.certify.tools import CHECKER, Checker
from tests.execute.plans import drawn
from tests.irr.building import schedule_of
from tests.sampling import Network, sample_parameters, sample_schedules

WAIT = Deadline.after(3600)
TABLES = json.loads(Path(__file__).with_name("data").joinpath("forgeries.json").read_text(encoding="utf-8"))
PLANS = {name: Texts(*texts) for name, texts in TABLES["plans"].items()}
PLAIN = PLANS["one action of k, from 0 to 9"]
LONGER = PLANS["one action of k, at least 3"]
"""The envelope is k >= 3; the first constraint says k - 3 >= 0 without any time."""
BESIDE = Texts(*TABLES["beside"][:3]), TABLES["beside"][3]
"""The initial value of f is the parameter x: 1 is enough."""


@contextmanager
def lying(random):
    """The producer makes up what it does not find: refutations, multiples, orders, schedules."""

    def refuted(formulas, facts, literal, deadline, also=()):
        try:
            return hints.refutation(formulas, facts, literal, deadline, also)
        except NotRefutedError:
            return made_up(formulas, len(facts.sides), [*formulas.roots(literal), *also], random)

    def multiples(facts, form, *, strictly=False):
        try:
            return hints.implied(facts, form, strictly=strictly)
        except NotRefutedError:
            return [(number, Fraction(1)) for number in range(len(facts.sides)) if random.random() < 0.5]

    def longer(orders, pair, default=None):
        if pair not in asked:
            asked[pair] = by if random.random() < 0.6 else None
        if asked[pair] is None:
            return default
        orders._used[pair] = by
        return by

    def some_times(formulas, ranges):
        return honest_times(formulas, ranges) or {point: {} for point in formulas.free()}

    def strayed(orders):
        """Paths of constraints that do not follow each other, but are long enough."""
        edges = orders._ground.edges
        longest = max(range(len(edges)), key=lambda number: edges[number][2].get("", Fraction(0)))
        for (a, b), bound in orders._used.items():
            enters = [number for number, edge in enumerate(edges) if edge[1] == b]
            steps = [longest] * random.randint(1, 6) + [random.choice(enters)]
            total = {"": -bound}
            for number in steps:
                total = plus(total, edges[number][2])
            yield a, b, steps, bound, total

    asked = {}
    honest_times = tape.constant_times
    by = random.choice([Fraction(0), Fraction(0), Fraction(1, 1000), Fraction(5)])
    with (
        patch.multiple(tape, refutation=refuted, implied=multiples, constant_times=some_times),
        patch.multiple(bad, refutation=refuted, implied=multiples),
        patch.multiple(OrderLemmas, get=longer, lemmas=strayed) if by else nullcontext(),
    ):
        yield


def made_up(formulas, facts, roots, random):
    """A refutation of something that is not refuted: false lemmas, or propagation that leads nowhere."""
    circuit, nodes = formulas.circuit, range(2, len(formulas.circuit.nodes))
    compared = [number for number in nodes if not circuit.is_gate(number)]
    some = [[number, random.randint(1, 3)] for number in range(facts) if random.random() < 0.3]
    one = random.choice(compared) * random.choice([1, -1]) if compared else 1
    root, gate, last = roots[0], abs(roots[0]), len(roots)
    wide = max((n for n in nodes if circuit.is_gate(n)), key=lambda n: len(circuit.nodes[n]), default=1)
    other = random.choice([gate, -gate, one, -gate - 1, -2])
    proofs = [
        [[[], [], some]], [[[], [[wide, 0], [wide, 1]]]], [[[], [0, [other, random.randrange(3)]]]], [[[], [0]]],
        [[[], [0, 0]]], [[[], [[gate, 0], 0]]], [[[], [0, [gate, 1]]]], [[[], []]], [[[], [0, last]]],
        [[[-root], [1], some], [[], [0, last]]], [[[-root], [[gate, 0]]], [[], [0, last]]],
        [[[one], [1], some], [[-one], [1], some], [[], [last, last + 1]]],
        [[[one, -one], [1, 1], []], [[], [last]]], [[[one, -one], [1, 1], []]],
    ]  # fmt: skip
    return ["refute", *random.choice(proofs)]


def lies(ground, box, random):
    """Tapes for a false claim, of a box or of the region, that are honest but for what cannot be honest."""
    for _ in range(4):
        with lying(random):
            try:
                wrong = random.choice([Region.universe, Region.nothing])(tuple(ground.parameters))
                yield (
                    good(ground, box)
                    if box is not None
                    else bad.region_lines(ground, tools.EPSILON, wrong, deadline=WAIT)
                )
            except (RobustError, reader.Unsupported, ValueError, KeyError):
                continue


def good(ground, box):
    return tape.good_lines(ground, tools.EPSILON, box, solver="z3", deadline=WAIT)


def nothing_is_good(ground, random):
    """That the envelope is empty: by circles of constraints that are none."""
    formulas, false = Formulas(ground, tools.EPSILON), [0, [1, 0]]
    literals = [broken() for _, broken in formulas.obligations()]
    lines = [["refute", [[], [len(formulas.roots(literal)), [1, 0]]]] for literal in literals if literal != FALSE]
    rest = [["good"], ["orders"], *lines, ["rest"], ["refute", [[], false]]]
    for number, (_, _, length) in enumerate(ground.edges):
        if length.keys() == {""} and length[""] > 0:
            steps = [number] * random.randint(1, 2) + random.choice([[], [random.randrange(len(ground.edges))]])
            yield [header("region"), ["bad", []], ["cycle", steps, []], *rest]


@dataclass
class Case:
    """One thing to lie about: honest tapes, first lines of false claims, and how a claim that is accepted is judged."""

    name: str
    read: Callable[[Checker], Any]
    check: Callable[[Checker, Any, list[Any]], Any]
    false: list[Line]
    honest: list[list[Line]]
    is_true: Callable[[Claim], bool]
    lies: list[list[Line]] = field(default_factory=list)
    known: dict[Checker, Any] = field(default_factory=dict)

    def attempt(self, lines, by=CHECKER):
        """The claim that is established, or why it is rejected."""
        if by not in self.known:
            kept = self.known.get(CHECKER)
            self.known = {CHECKER: kept or self.read(CHECKER)}
            self.known[by] = self.known.get(by) or self.read(by)
        return tools.attempted(lambda: self.check(by, self.known[by], lines), by)

    @property
    def pool(self):
        return [line for lines in self.honest for line in lines[1:]]


def is_false(plan, box, random):
    """Whether some values of the box, most of them at its ends, leave no schedule, or one that breaks something."""
    for values in (drawn(box, random, width=Fraction(10)) for _ in range(25)):
        if all(values[name] in interval for name, interval in box.intervals.items()):
            if not Network(plan, values).consistent:
                return True
            schedules = sample_schedules(plan, values, random, 12)
            if any(simulate(plan, values, schedule).violations for schedule in schedules):
                return True
    return False


def grown(box, random):
    """The box with some faces pushed out."""
    for name in random.sample(list(box.intervals), random.randint(1, len(box.intervals))):
        by = random.choice([Fraction(1, 1000), Fraction(1, 2), Fraction(1), Fraction(7)])
        ends = ((box[name].lower, -by), (box[name].upper, by))
        low, high = (
            None if end is None or random.random() < 0.1 else end + random.choice([0, way]) for end, way in ends
        )
        box = box.replace(name, Interval(low, high, low is not None, high is not None))
    return box


def plan_case(seed):
    """False claims about one random plan, of the kinds that it has."""
    texts, random = random_texts(seed, easy=True), Random(seed)
    try:
        plan = tools.assembled(texts)
        ground = reader.ground(*texts)
        proved = check(plan, timeout=20).answer.name == "PROVED"
        exact = region(plan, timeout=20) if plan.parameters else None
    except (RobustError, reader.Unsupported):
        return None
    whole = exact.region if exact is not None and exact.is_exact else None
    boxes = [Box.nominal(plan.parameters)]
    if proved and plan.parameters:
        boxes.append(envelope(plan, timeout=20).box)
    honest = [lines for box in boxes if proved for lines in _honest(plan, ground, box, whole)]
    claims = [grown(random.choice(boxes), random) for _ in range(8)] if plan.parameters else []
    claims = [box for box in claims if is_false(plan, box, random)]
    false = [header(random.choice(["box", "maximal"]), box) for box in claims]
    false += [header("maximal", boxes[0])] if boxes[1:] and boxes[1] != boxes[0] else []
    lied = [[header("box", box), *lines] for box in claims for lines in lies(ground, box, random)]
    if is_false(plan, boxes[0], random):
        false.append(header("plan"))
        lied += [[header("plan"), *lines] for lines in lies(ground, boxes[0], random)]
    if whole is not None:
        false.append(header("region"))
        lied += [[header("region"), *lines] for lines in lies(ground, None, random)]
        lied += nothing_is_good(ground, random) if not whole.is_empty else ()
    if not false:
        return None
    if not honest:  # what would be honest of another plan
        honest = [[header("plan"), ["orders"], ["schedule"], ["kept"], ["refute", [[], [0]]]]]

    def read(by):
        return by.reader.ground(*texts)

    def is_true(claim):
        return claim.kind == "region" and whole is not None and same_region(claim, whole, plan, Random(seed))

    return Case(f"plan {seed}", read, tools.checked, false, honest, is_true, lied)


def _honest(plan, ground, box, whole):
    try:
        lines = good(ground, box)
        yield [header("box", box), *lines]
        faces = bad.face_lines(ground, create_encoding("relational", plan), box, solver="z3", deadline=WAIT)
        yield [header("maximal", box), *lines, *faces]
        if whole is not None:
            yield [header("region"), *bad.region_lines(ground, tools.EPSILON, whole, deadline=WAIT)]
            if (lifted := tools.lifted(plan)) is not None:
                yield [header("region"), *bad.lifted_lines(ground, tools.EPSILON, lifted, deadline=WAIT)]
    except (RobustError, reader.Unsupported):
        return


def same_region(claim, whole, plan, random):
    """Whether the region that is claimed is the envelope, at many points within the declared bounds."""
    for _ in range(200):
        point = sample_parameters(plan, random, spread=random.choice([Fraction(2), Fraction(40)]))
        levels = [[(tape.evaluated(form, point), strict) for form, strict in piece] for piece in claim.removed or []]
        is_bad = any(all(level > 0 or (level == 0 and not strict) for level, strict in piece) for piece in levels)
        if (point in whole) != (not is_bad and (SCHEDULED not in claim.text or schedule_of(plan, point) is not None)):
            return False
    return True


def network_case(seed):
    """That a plan with choices has no correct execution, although it has one; honest tapes are of other plans."""
    possible, honest = [], []
    for index in range(4):
        instance = random_plan(seed, index, Shape(top=3, inner=2))
        stated = _choices(instance)
        literal = stated.circuit.all(stated.parts)
        if hints.model(stated.formulas, KnownFacts([]), literal, WAIT) is not None:
            possible.append(instance)
        else:
            line = hints.refutation(stated.formulas, KnownFacts([]), literal, WAIT)
            honest.append([header("knowledge"), line])
    if not possible or not honest:
        return None

    def check(by, stated, lines):
        tape_of = by.proofs.Tape(json.dumps(line) for line in lines[1:])
        by.proofs.refute(tape_of, stated.formulas, by.proofs.Facts([]), stated.circuit.all(stated.parts))
        tape_of.finish()
        return Claim("knowledge", tools.EPSILON)

    read = partial(_choices, possible[0])
    return Case(f"network {seed}", read, check, [header("knowledge")], honest, lambda _: False)


def _choices(instance, by=CHECKER):
    document = by.choices.network_of(tpnu_text(instance.network, domain="domain", problem="problem"))
    return by.choices.Choices((document, instance.domain, instance.problem), tools.EPSILON)


NUMBERS = [
    0, 1, -1, 2, 3, 7, -2, 10**20, "0", "1", "-1", "1/2", "1000", "2/4", True, False, None, 1.5, [], {},
]  # fmt: skip
KINDS = [
    "orders",
    "schedule",
    "kept",
    "refute",
    "face",
    "cycle",
    "broken",
    "bad",
    "good",
    "piece",
    "rest",
    "network",
    "every",
]


def invented(random, depth=0):
    """Any value of the shapes that lines have."""
    if depth > 3 or random.random() < 0.4:
        return random.choice(NUMBERS)
    return [invented(random, depth + 1) for _ in range(random.choice([0, 1, 1, 2, 2, 3, 5]))]


def invented_line(random):
    """A line that no honest certificate has."""
    kind, draw = random.choice(KINDS), random.randrange
    if kind == "refute":
        ways = [
            lambda: [[], [draw(4) for _ in range(draw(4))]],
            lambda: [[draw(-9, 10)], [[draw(12), draw(4)]]],
            lambda: [[draw(-9, 10)], [1], [[draw(6), 1]]],
            lambda: [[], [], [[draw(6), 1], [draw(6), 1]]],
        ]
        return [kind, *(random.choice(ways)() for _ in range(random.randint(1, 4)))]
    if kind == "orders":
        return [kind, [draw(5), draw(5), [draw(9)], "1", []]]
    return [kind, *(invented(random) for _ in range(draw(4)))]


def leaf_changed(value, random):
    """One place of a line is something else."""
    if not isinstance(value, list) or not value or random.random() < 0.15:
        near = value + random.choice([1, -1]) if type(value) is int else invented(random)
        return random.choice([near, invented(random)])
    place, way = random.randrange(len(value)), random.random()
    if way < 0.1:
        return tools.put(value, place)
    if way < 0.25:
        return [*value[:place], value[place] if way < 0.2 else random.choice(value), *value[place:]]
    return tools.put(value, place, leaf_changed(value[place], random))


def changed(lines, pool, random):  # noqa: PLR0911 - one for each way
    """One change of a tape: a line goes, comes, is exchanged, is longer, or says something else."""
    if not lines:
        return [random.choice(pool)]
    place, other = random.randrange(len(lines)), random.randrange(len(lines))
    way, (kind, *rest) = random.randrange(9), lines[place]
    if way < 4:
        new = [[], [lines[other], lines[place]], [random.choice(pool), lines[place]], [random.choice(pool)]]
        return tools.put(lines, place, *(new[way] if way else ()))
    if way == 4:
        return tools.put(tools.put(lines, place, lines[other]), other, lines[place])
    if way == 5:
        return [*lines[:place], invented_line(random), *lines[place + random.randrange(2) :]]
    if way == 6 and kind == "refute":
        more = random.choice([line for line in pool if line[0] == "refute"] or [lines[place]])
        return tools.put(lines, place, [*lines[place], *more[1:]])
    if not rest:
        return lines[:place]
    inner = random.randrange(len(rest))
    return tools.put(lines, place, [kind, *tools.put(rest, inner, leaf_changed(rest[inner], random))])


def forged(case, others, random):
    """A false claim with a tape that somebody made up."""
    first = random.choice(case.false)
    if case.lies and random.random() < 0.4:
        lines = random.choice(case.lies)
        return lines if random.random() < 0.7 else [lines[0], *changed(lines[1:], case.pool, random)]
    pool = random.choice(others).pool if random.random() < 0.2 else case.pool
    if random.random() < 0.1:
        count = random.randint(0, 12)
        return [first, *(random.choice(pool) if random.random() < 0.7 else invented_line(random) for _ in range(count))]
    suited = [lines for lines in case.honest if lines[0][1] == first[1]] or case.honest
    lines = random.choice(suited)[1:]
    for _ in range(random.choice([0, 1, 1, 1, 2, 3, 6])):
        lines = changed(lines, pool, random)
    return [first, *lines]


def named(lines):
    """Forgeries that were thought of: proofs that would be believed if one check were missing."""
    first = next((index for index, line in enumerate(lines) if line[0] == "refute"), None)
    if first is not None:
        steps = [*TABLES["refutations"], [*lines[first][1:], [[], [0]]]]
        yield from (tools.put(lines, first, ["refute", *step]) for step in steps)
    for index, line in enumerate(lines):
        if line[0] == "orders":
            yield from (tools.put(lines, index, [*line, order]) for order in TABLES["orders"])
            yield tools.put(lines, index, [*line, *line[1:]])
        if line[0] == "cycle":
            for path in ([], [0], [1], [0, 0], [*line[1], *line[1]], line[1][:-1], line[1][::-1]):
                for multiples in (line[2], [], [[0, 1]]):
                    yield tools.put(lines, index, ["cycle", path, multiples])


def leaf_changes(lines):
    """Each place of each line changed a little: another number, a twin of another type, something more, nothing."""
    for index, line in enumerate(lines):
        yield from (tools.put(lines, index, new) for new in _changes(line))
        yield from (tools.put(lines, index), tools.put(lines, index, line, line))


def _changes(value):
    if isinstance(value, list):
        for index, inner in enumerate(value):
            yield from (tools.put(value, index, new) for new in _changes(inner))
        yield from (value[:-1], [*value, value[-1] if value else 0])
    elif isinstance(value, bool):
        yield from (not value, int(value), None)
    elif isinstance(value, int):
        yield from (value + 1, value - 1, -value, str(value), bool(value), float(value), str(Fraction(value)), 10**9)
    else:
        yield from (1, f"{value}0", f"{value}/1", None, [value])
        if isinstance(value, str) and RATIONAL.fullmatch(value):
            for away in (Fraction(1, 1000), Fraction(1, 2), Fraction(3)):
                yield from (str(Fraction(value) + away), str(Fraction(value) - away))


@cache
def cases(number, first):
    """Cases of random plans, and of plans with choices."""
    known = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for seed in count(first):
            if len(known) >= number:
                return known
            new = [plan_case(seed), network_case(seed // 4) if seed % 4 == 0 else None]
            known += [case for case in new if case is not None]
    raise AssertionError


class Outcome(NamedTuple):
    """What became of attempts: tapes by cases, with the claim of each or why it was rejected."""

    tried: list[tuple[Case, list[Any], Claim | str]]

    @property
    def rejected(self):
        return Counter(claim.split(":")[0][:40] for _, _, claim in self.tried if isinstance(claim, str))

    @property
    def accepted(self):
        """False claims that the checker believed."""
        claims = ((case, lines, claim) for case, lines, claim in self.tried if not isinstance(claim, str))
        return [(case.name, lines) for case, lines, claim in claims if not case.is_true(claim)]


def run(attempts, *, plans, first=0, seed=0):
    """That many attempts at cases of plans from the first seed on."""
    random, known = Random(seed), cases(plans, first)
    made = [(case, forged(case, known, random)) for case in random.choices(known, k=attempts)]
    return Outcome([(case, lines, case.attempt(lines)) for case, lines in made])


if __name__ == "__main__":
    done = run(int(sys.argv[1]), plans=int(sys.argv[2]) if len(sys.argv) > 2 else 60)
    rejected, accepted = done.rejected.total(), len(done.accepted)
    print(f"{rejected} rejected, {len(done.tried) - rejected - accepted} still true, {accepted} false and accepted")
    for name, lines in done.accepted[:5]:
        print(name, json.dumps(lines)[:2000])
