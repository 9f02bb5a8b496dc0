#!/usr/bin/env python3
"""Checks certificates of `robust`: python check.py CERTIFICATE [--domain FILE] [--problem FILE] [--plan FILE] ...

One file, nothing but the standard library, no solver, exact rational arithmetic. A certificate is JSON, one line for
each statement, compressed by gzip, and read as a stream. Checked are theory lemmas, by multiples that add up to a
contradiction [Farkas 1902]; refutations, by unit propagation along hints (LRAT); what formulas say of the temporal
network, of the box and of separations, against the ground plan; schedules, all over the box; and witnesses, which are
executed on the ground plan arbitrarily near to the face that they are about.
Exit codes: 0 established (it prints what, and what is trusted), 1 rejected (where and why), 2 unreadable.
"""

import argparse
import gzip
import hashlib
import json
import sys
import zlib
from collections.abc import Iterator
from fractions import Fraction
from typing import Any

FORMAT = "robust/certificate/1"
KINDS = ("plan", "box", "maximal", "region", "knowledge")
INPUTS = ("domain", "problem", "plan", "network", "parameters")
LONGEST_LINE, LARGEST_TOTAL = 4 << 20, 512 << 20  # bytes after decompression
WORK_PER_BYTE, WORK_AT_ALL, MEMORY = 60, 2_000_000, 6_000_000  # steps; numbers and names kept at one time
HARMS = {"add": ["read", "delete"], "delete": ["read"], "assign": ["look", "assign", "increase"], "increase": ["look"]}
MALFORMED = (TypeError, ValueError, LookupError, AttributeError, RecursionError, OverflowError, MemoryError, EOFError)

Linear = dict[str, Fraction]  # coefficients by variable; that of "" is the constant
State = tuple[set[str], dict[str, "Near"]]  # atoms that are true, and the values of fluents


class Rejected(Exception):
    """The certificate does not establish what it says."""


def demand(condition: object, message: str) -> None:
    if not condition:
        raise Rejected(message)


def lines_of(path: str) -> Iterator[bytes]:
    """The lines of a gzip file, in bounded memory."""
    total = 0
    with gzip.open(path) as file:
        while line := file.readline(LONGEST_LINE):
            total += len(line)
            demand(total <= LARGEST_TOTAL and line.endswith(b"\n"), "a line or the whole is too long, or cut off")
            yield line


def pick(among: Any, place: Any) -> Any:
    demand(type(place) is int and 0 <= place < len(among), f"found {str(place)[:20]!r}, expected a number of something")
    return among[place]


def rational(value: Any) -> Fraction:
    """A number: an integer, or a text such as "1/3"."""
    if type(value) is int:
        return Fraction(value)
    top, slash, bottom = value.partition("/")
    plain = top.isascii() and top.removeprefix("-").isdecimal() and bottom.isascii()
    demand(plain and (not slash or (bottom.isdecimal() and bottom.strip("0"))), "found a text, expected a number")
    return Fraction(int(top), int(bottom) if slash else 1)


class Budget:
    work, memory = WORK_AT_ALL, MEMORY

    def spend(self, steps: int, kept: int = 0) -> None:
        self.work, self.memory = self.work - steps, self.memory - kept
        demand(self.work >= 0 and self.memory >= 0, "checking takes more work or memory than its size may need")


class Near:
    """A polynomial in an infinitesimal e > 0: what is said of it holds for every e that is small enough."""

    def __init__(self, *terms: Fraction | int) -> None:
        while terms and not terms[-1]:
            terms = terms[:-1]
        small = all(max(abs(term.numerator), term.denominator).bit_length() <= 4000 for term in terms)
        demand(len(terms) <= 12 and small, "a number of the simulation grows too large")
        self.terms = terms

    def __add__(self, other: "Near") -> "Near":
        short, long = sorted((self.terms, other.terms), key=len)
        return Near(*map(sum, zip(short, long)), *long[len(short) :])

    def __mul__(self, other: "Near") -> "Near":
        terms: list[Fraction | int] = [0] * (len(self.terms) + len(other.terms))
        for i, left in enumerate(self.terms):
            for j, right in enumerate(other.terms):
                terms[i + j] += left * right
        return Near(*terms)

    def __sub__(self, other: "Near") -> "Near":
        return self + other * Near(-1)

    def __lt__(self, other: "Near") -> bool:
        return (self - other).sign < 0

    @property
    def sign(self) -> int:
        first = next((term for term in self.terms if term), 0)
        return (first > 0) - (first < 0)


def near(value: Any) -> Near:
    return Near(*map(rational, value)) if type(value) is list else Near(rational(value))


def linear(value: Any) -> Linear:
    """A list of [coefficient] and [coefficient, variable], each variable once."""
    terms = {"".join(names): rational(factor) for factor, *names in value if len(names) < 2 and names != [""]}
    demand(len(terms) == len(value) and all(terms.values()), "not a linear expression")
    return terms


def combined(left: Linear, right: Linear, factor: Fraction | int = 1) -> Linear:
    """`left + factor * right`."""
    total = dict(left)
    for name, value in right.items():
        total[name] = total.get(name, Fraction(0)) + factor * value
    return {name: value for name, value in total.items() if value}


def evaluated(expression: Linear, values: dict[str, Near]) -> Near:
    return sum((Near(factor) * (values[name] if name else Near(1)) for name, factor in expression.items()), Near())


class Plan:
    """The ground plan as the certificate states it: time points by number, network, conditions, effects, rates."""

    def __init__(self, budget: Budget) -> None:
        self.budget = budget
        self.declared: dict[str, tuple[Fraction | None, ...]] = {}  # bounds of parameters
        self.epsilon = Fraction(0)
        self.points: list[str] = []
        self.constraints: list[tuple[int, int, Linear | None, Linear | None]] = []
        self.conditions: list[Any] = []  # [time point, null, condition, label], or [start, end, ...] if over all
        self.effects: list[list[Any]] = []  # by time point: [kind, target, expression, condition]
        self.rates: list[Any] = []  # [start, end, fluent, expression]
        self.initial: tuple[list[str], list[Any]] = ([], [])
        self.prints: list[set[tuple[str, str]]] = []  # by time point: (what is done, to what)
        self.timed = set[int]()  # time points of timed initial literals
        self.state("point", ".zero")

    def state(self, kind: str, *rest: Any) -> None:
        if kind == "point":
            self.timed.update([len(self.points)] if rest[1:] else [])
            self.points.append(rest[0])
            self.effects.append([])
            self.prints.append(set())
        elif kind == "constraint":
            demand(pick(self.points, rest[0]) and pick(self.points, rest[1]), "a time point without a name")
            lower, upper = (None if bound is None else linear(bound) for bound in rest[2:])
            self.constraints.append((rest[0], rest[1], lower, upper))
        elif kind == "condition":
            point, end, condition, label = rest
            self.conditions.append((point, end, condition, label))
            if end is None and point is not None:
                self.note(point, "", "", [], condition)
        elif kind == "effect":
            pick(self.effects, rest[0]).append(rest[1:])
            self.note(*rest)
        elif kind == "rate":
            self.rates.append(rest)
            self.note(rest[0], "increase", rest[2], rest[3], True)
            self.note(rest[1], "increase", rest[2], rest[3], True)
        else:
            demand(kind == "initial", "found a line of no known kind")
            self.initial = rest[0], rest[1]

    def note(self, point: Any, kind: str, target: str, expression: Any, condition: Any) -> None:
        """What a time point reads and writes."""
        done = pick(self.prints, point)
        done.add((kind, target))
        expressions, pending = [expression], [condition]
        for node, *rest in (each for each in pending if type(each) is list):
            pending += rest if node in ("and", "or") else []
            done.update({("read", rest[0])} if node == "h" else ())
            expressions += rest[:1] if node == "c" else []
        done.update(("look", name) for each in expressions for _, *names in each for name in names)

    def edge(self, number: Any, side: Any) -> tuple[int, int, Linear]:
        """One side of a constraint as a lower bound: source, target and least distance."""
        source, target, *bounds = pick(self.constraints, number)
        bound = bounds[{"l": 0, "u": 1}[side]]
        self.budget.spend(len(bound))
        return (source, target, bound) if side == "l" else (target, source, combined({}, bound, -1))

    def edges(self) -> Iterator[tuple[int, int, Linear]]:
        """The whole network: no time is negative, and every side of a constraint."""
        yield from ((0, point, Linear()) for point in range(len(self.points)))
        for number, (_, _, *sides) in enumerate(self.constraints):
            yield from (self.edge(number, side) for side, bound in zip("lu", sides) if bound is not None)

    def are_mutex(self, first: int, second: int) -> bool:
        """Whether two time points must be separated: the no-moving-targets rule of PDDL 2.1."""
        return not {first, second} <= self.timed and any(
            (harm, name) in pick(self.prints, b)
            for a, b in ((first, second), (second, first))
            for kind, name in pick(self.prints, a)
            for harm in HARMS.get(kind, ())
        )

    def separation(self, first: Any, second: Any) -> set[str]:
        ends = pick(self.points, first), pick(self.points, second)
        return {f"separation: {a}, {b}" for a, b in (ends, ends[::-1])}

    def require(self, known: set[str]) -> None:
        """Every obligation of the plan is among the known ones."""
        for *_, label in self.conditions:
            demand(label in known, f"there is no proof of {label}")
        self.budget.spend(len(self.points) * sum(len(done) + 1 for done in self.prints))
        for second in range(1, len(self.points)):
            for first in (first for first in range(1, second) if self.are_mutex(first, second)):
                demand(self.separation(first, second) & known, f"no separation of {first} and {second}")


class Simulation:
    """One schedule of the plan, which the network allows, executed."""

    def __init__(self, plan: Plan, values: dict[str, Near], times: list[Near]) -> None:
        self.plan, self.budget, self.times = plan, plan.budget, times
        demand(len(times) == len(plan.points) and not times[0].terms, "a time is missing, or zero is not at 0")
        for source, target, least in plan.edges():
            gap = times[target] - times[source] - evaluated(least, values)
            demand(gap.sign >= 0, "the schedule breaks a constraint of the network")
        self.known = {**values, **{f"@{point}": time for point, time in enumerate(times)}}
        self.before: dict[int, State] = {}
        self.happenings: list[tuple[Near, State, State, dict[str, Near]]] = []  # time, states, slopes after it
        order = sorted(range(len(times)), key=times.__getitem__)
        fluents = {fluent: self.number(value, (set(), {})) for fluent, value in self.plan.initial[1]}
        state, slopes, now = (set(self.plan.initial[0]), fluents), dict[str, Near](), Near()
        while order:
            time = self.times[order[0]]
            together = [point for point in order if not (self.times[point] - time).terms]
            self.budget.spend(len(order) + len(self.plan.rates))
            order = order[len(together) :]
            before = self.moved(state, slopes, time - now)
            self.before.update(dict.fromkeys(together, before))
            state, now = self.happen(together, before), time
            slopes = self.slopes(time, state)
            self.happenings.append((time, before, state, slopes))

    def moved(self, state: State, slopes: dict[str, Near], span: Near) -> State:
        self.budget.spend(len(state[0]) + len(state[1]))
        return state[0], {**state[1], **{fluent: state[1][fluent] + rate * span for fluent, rate in slopes.items()}}

    def happen(self, points: list[int], before: State) -> State:
        """Deletes, then adds; assignments, then increases; all read the state before."""
        adds, deletes, values, increases = set[str](), set[str](), dict(before[1]), list[tuple[str, Near]]()
        for kind, target, expression, condition in (effect for point in points for effect in self.plan.effects[point]):
            if not self.holds(condition, before):
                continue
            if kind in ("add", "delete"):
                (adds if kind == "add" else deletes).add(target)
            elif kind == "assign":
                values[target] = self.number(expression, before)
            else:
                increases.append((target, self.number(expression, before)))
        for fluent, amount in increases:
            values[fluent] += amount
        return (before[0] - deletes) | adds, values

    def slopes(self, time: Near, state: State) -> dict[str, Near]:
        slopes, read = dict[str, Near](), set[str]()
        for start, end, fluent, rate in self.plan.rates:
            if (time - self.times[start]).sign >= 0 and (self.times[end] - time).sign > 0:
                slopes[fluent] = slopes.get(fluent, Near()) + self.number(rate, state)
                read.update(variable for _, *names in rate for variable in names)
        demand(not any(slopes[fluent].terms for fluent in read & slopes.keys()), "a rate changes continuously")
        return slopes

    def number(self, expression: Any, state: State) -> Near:
        """A list of [coefficient, variables...]: parameters, fluents such as "(fuel car)", times such as "@7"."""
        total = Near()
        for factor, *variables in expression:
            product = Near(rational(factor))
            for variable in variables:
                self.budget.spend(1)
                product *= state[1][variable] if variable in state[1] else self.known[variable]
            total += product
        return total

    def holds(self, condition: Any, state: State) -> bool:
        """true, false, ["h", atom, value], ["c", expression, relation], ["and", ...] or ["or", ...]."""
        self.budget.spend(1)
        if type(condition) is bool:
            return condition
        kind, *parts = condition
        if kind == "h":
            return (parts[0] in state[0]) is parts[1]
        if kind == "c":
            sign = self.number(parts[0], state).sign
            return {">=": sign >= 0, ">": sign > 0, "=": sign == 0, "!=": sign != 0}[parts[1]]
        return {"and": all, "or": any}[kind](self.holds(part, state) for part in parts)

    def require_broken(self, kind: str, first: Any, second: Any) -> None:
        """The schedule breaks an obligation indeed: a condition (at an instant, if over all), or a separation."""
        if kind == "separation":
            gap = pick(self.times, first) - pick(self.times, second)
            close = (gap - Near(self.plan.epsilon)).sign < 0 < (gap + Near(self.plan.epsilon)).sign
            demand(close and first != second and self.plan.are_mutex(first, second), "the time points are apart")
        else:
            point, end, condition, _ = pick(self.plan.conditions, first)
            states = [self.happenings[-1][2] if point is None else self.before[point]]
            if end is not None:
                instant = near(second)
                inside = (instant - self.times[point]).sign > 0 and (self.times[end] - instant).sign > 0
                time, *states, slopes = [each for each in self.happenings if (instant - each[0]).sign >= 0][-1]
                if (instant - time).terms:
                    states = [self.moved(states[1], slopes, instant - time)]
                demand(inside, "the instant is not inside the action")
            demand(not all(self.holds(condition, state) for state in states), "the condition holds")


class Certificate:
    """Reads a certificate line by line; `finish` says what has been established."""

    def __init__(self) -> None:
        self.budget, self.header = Budget(), dict[str, Any]()
        self.plan = Plan(self.budget)
        self.nodes: list[Any] = [None]  # of formulas
        self.lemmas: list[tuple[int, ...]] = []
        self.clauses: list[tuple[int, ...]] = []  # of the present refutation
        self.box: dict[str, tuple[Fraction | None, bool, Fraction | None, bool]] = {}  # ends, and whether they belong
        self.where: list[Any] = []  # what is known of the parameters: (expression, strict) for `>= 0` or `> 0`
        self.places: dict[int, Linear] = {0: {}}  # where time points are
        self.obligation = ""  # that is being refuted
        self.refuted, self.trusting, self.names, self.folded = set[str](), set[str](), set[str](), set[str]()
        self.faces = set[tuple[str, str]]()
        self.pieces = 0  # of a region
        self.stated = self.scheduled = self.ended = False

    def read(self, line: bytes) -> None:
        self.budget.spend(-WORK_PER_BYTE * len(line))
        value = json.loads(line, parse_float=str, parse_constant=str)
        demand(not self.ended, "there is something behind the end")
        if not self.header:
            return self.start(value)
        kind, *rest = value
        proof = kind in ("b", "a", "g", "e", "lemma")
        demand(
            proof or bool(self.obligation) == (kind in ("root", "derive", "qed")),
            "a step outside of a refutation, or none",
        )
        if kind in ("lemma", "derive", "root", "place", "piece", "schedule"):
            getattr(self, kind)(*rest)
        elif proof:
            self.define(kind, *rest)
        elif kind == "qed":
            self.derive([], *rest)
            self.refuted.add(self.obligation)
            self.obligation = ""
        elif kind == "obligation":
            inside = (self.header["kind"] == "region") == (self.pieces > 0)
            demand(inside and rest[0] and rest[0] not in self.refuted, "an obligation twice, nameless or outside")
            self.obligation, self.clauses = rest[0], []
        elif kind in ("witness", "cycle"):
            self.witness(kind, *rest)
        elif kind == "folded":
            self.folded.add(rest[0])
        elif kind == "end":
            self.complete()
            self.ended = True
        else:
            self.budget.spend(0, len(line) // 8)
            demand(not self.stated, "a part of the ground plan after the first conclusion from it")
            return self.plan.state(kind, *rest)
        self.stated = True

    def start(self, header: Any) -> None:
        demand(type(header) is dict and header.get("format") == FORMAT, f"not a certificate of the format {FORMAT}")
        digests = {len(digest) for digest in header["inputs"].values()}
        demand(header["kind"] in KINDS and digests <= {64}, "a malformed header")
        self.header, self.plan.epsilon = header, rational(header.get("epsilon", 0))
        for name, lower, upper in header.get("parameters", []):
            demand(name and name not in self.plan.declared, "a parameter twice")
            self.plan.declared[name] = tuple(None if each is None else rational(each) for each in (lower, upper))
        for name, (low, low_closed, high, high_closed) in zip(self.plan.declared, header.get("box", [])):
            lower, upper = (None if each is None else rational(each) for each in (low, high))
            demand({type(low_closed), type(high_closed)} == {bool}, "an end of the box is neither open nor closed")
            point = lower == upper and low_closed and high_closed
            demand(lower is None or upper is None or lower < upper or point, "the box is empty")
            self.box[name] = lower, low_closed, upper, high_closed
            for sign, end, closed in ((1, lower, low_closed), (-1, upper, high_closed)):
                known = None if end is None else combined({name: Fraction(sign)}, {"": end}, -sign)
                self.where.append((known, not closed))

    def literals(self, value: Any) -> tuple[int, ...]:
        self.budget.spend(0, len(value) + 1)
        demand(all(type(each) is int and 0 < abs(each) < len(self.nodes) for each in value), "an unknown literal")
        return tuple(value)

    def define(self, kind: str, value: Any, strict: Any = None) -> None:
        """b: a boolean. a: a linear constraint `expression >= 0`, or `> 0`. g: a conjunction. e: an equivalence."""
        if kind == "a":
            self.budget.spend(0, len(value))
            demand(type(strict) is bool and any(linear(value)), "a malformed linear constraint")
            self.nodes.append((kind, linear(value), strict))
        elif kind == "b":
            self.nodes.append((kind,))
        else:
            self.nodes.append((kind, self.literals(value)))
            demand(kind == "g" or len(value) == 2, "an equivalence of other than two literals")

    def constraint(self, literal: int) -> tuple[Linear, bool]:
        """What a literal of a constraint says."""
        _, expression, strict = self.nodes[abs(literal)]
        return (expression, strict) if literal > 0 else (combined({}, expression, -1), not strict)

    def lemma(self, literals: Any, multipliers: Any) -> None:
        """The negations of the literals contradict each other."""
        clause, total, strict = self.literals(literals), Linear(), False
        for literal, multiplier in zip(clause, multipliers, strict=True):
            expression, sharp = self.constraint(-literal)
            demand(type(multiplier) is int and multiplier > 0, "expected multipliers above 0")
            self.budget.spend(len(expression) + len(total))
            total, strict = combined(total, expression, multiplier), strict or sharp
        value = total.pop("", Fraction(0))
        demand(not total, "the multiples of the constraints do not cancel the variables")
        demand(value < 0 or (strict and value == 0), "the multiples of the constraints do not contradict each other")
        self.lemmas.append(clause)

    def hinted(self, hint: Any) -> tuple[int, ...]:
        """A clause by its number: of this refutation, below 0 a lemma, in a pair one of those that define a gate."""
        if type(hint) is int:
            return tuple(pick(self.clauses, hint) if hint >= 0 else pick(self.lemmas, ~hint))
        number, which = hint
        kind, inputs = pick(self.nodes, number)
        if kind == "e":
            one, two, three = pick([(1, -1, -1), (1, 1, 1), (-1, -1, 1), (-1, 1, -1)], which)
            return (one * number, two * inputs[0], three * inputs[1])
        return (-number, pick((0, *inputs), which)) if which else (number, *(-each for each in inputs))

    def derive(self, literals: Any, hints: Any) -> None:
        """Unit propagation along the hints refutes the negation of the clause."""
        clause = self.literals(literals)
        false = set(clause)
        for hint in hints:
            hinted = self.hinted(hint)
            self.budget.spend(len(hinted))
            unassigned = {literal for literal in hinted if literal not in false}
            if not unassigned:
                return self.clauses.append(clause)
            demand(len(unassigned) == 1, "a hint is not a unit clause")
            false.add(-unassigned.pop())
        raise Rejected("the hints do not lead to a contradiction")

    def place(self, point: int, value: Any, number: Any) -> None:
        """Where a time point is: at a variable of its own, or tied to another one by an equality."""
        place = linear(value)
        demand(pick(self.plan.points, point) and point not in self.places, "a time point twice")
        if number is None:
            name = value[0][1]
            new = name and name not in self.names and name not in self.plan.declared and place == {name: 1}
            demand(new, "a free time point needs a variable of its own")
            self.names.add(name)
        else:
            source, target, lower, upper = pick(self.plan.constraints, number)
            demand(lower is not None and lower == upper and point in (source, target), "the time points are not tied")
            other, sign = (source, 1) if point == target else (target, -1)
            demand(place == combined(self.places[other], lower, sign), "not where the equality puts the time point")
        self.places[point] = place

    def piece(self, constraints: Any) -> None:
        """What follows is about one polyhedron of a region."""
        self.complete()
        self.pieces, self.refuted = self.pieces + 1, set()
        self.where = [(linear(expression), strict) for expression, strict in constraints]

    def root(self, literal: int, kind: str, *rest: Any) -> None:
        """A conjunct of the formula: it is trusted, or says what the ground plan or the box says."""
        self.clauses.append(self.literals([literal]))
        if kind == "t":
            return self.trusting.add(self.obligation)
        (expression, strict), (found, sharp) = self.claimed(kind, *rest), self.constraint(literal)
        name = next(name for name in found if name)
        scale = expression.get(name, Fraction(0)) / found[name]
        same = scale > 0 and sharp is strict and combined({}, found, scale) == expression
        demand(same, "a formula is not what the plan or the box says")

    def claimed(self, kind: str, number: Any, side: Any = None) -> tuple[Linear, bool]:
        """The inequality `expression >= 0`, or `> 0`, that a root is said to be."""
        if kind == "w":  # the parameter values that the certificate is about
            return pick(self.where, number)  # type: ignore[no-any-return]
        if kind == "z":  # no time is negative
            return self.places[number], False
        if kind == "n":  # a side of a temporal constraint
            source, target, least = self.plan.edge(number, side)
        else:  # less than epsilon apart
            demand(kind == "s" and self.obligation in self.plan.separation(number, side), "not about the obligation")
            source, target, least = side, number, {"": -self.plan.epsilon}
        self.budget.spend(len(self.places[source]) + len(self.places[target]))
        return combined(combined(self.places[target], self.places[source], -1), least, -1), kind == "s"

    def schedule(self, times: Any) -> None:
        """Times as expressions over the parameters keep the network all over the box."""
        places = list(map(linear, times))
        demand(len(places) == len(self.plan.points) and not places[0], "a time is missing, or zero is not at 0")
        for source, target, least in self.plan.edges():
            self.budget.spend(len(places[source]) + len(places[target]))
            expression = combined(combined(places[target], places[source], -1), least, -1)
            lowest = expression.pop("", Fraction(0))
            for name, factor in expression.items():  # an infinite end is malformed here
                lowest += factor * Fraction(self.box[name][0 if factor > 0 else 2])  # type: ignore[arg-type]
            demand(lowest >= 0, "the schedule breaks a constraint of the network somewhere in the box")
        self.scheduled = True

    def witness(self, kind: str, face: str, side: str, numbers: Any, course: Any, *what: Any) -> None:
        """Beyond a face, arbitrarily near to it and within the others: a schedule that breaks something, or none."""
        values = dict(zip(self.box, map(near, numbers), strict=True))
        demand(face in self.box and side in ("lower", "upper"), "there is no such face")
        for name, (low, low_closed, high, high_closed) in self.box.items():
            for place, end, closed, sign in (("lower", low, low_closed, -1), ("upper", high, high_closed, 1)):
                if end is not None:
                    beyond = (values[name] - Near(end)) * Near(sign)
                    at = not (beyond.terms and beyond.terms[0]) and (beyond.sign > 0 if closed else beyond.sign == 0)
                    within = beyond.sign < 0 or (closed and beyond.sign == 0)
                    demand(at if (name, place) == (face, side) else within, "the witness is not at the face")
        if kind == "witness":
            Simulation(self.plan, values, list(map(near, course))).require_broken(*what)
        else:
            walk = [self.plan.edge(*step) if len(step) == 2 else (0, step[0], Linear()) for step in course]
            total = Near()
            for (_, target, least), (source, _, _) in zip(walk, walk[1:] + walk[:1]):
                demand(target == source, "the constraints do not form a cycle")
                total += evaluated(least, values)
            demand(total.sign > 0, "the constraints do not contradict each other")
        self.faces.add((face, side))

    def complete(self) -> None:
        if self.pieces or self.header["kind"] not in ("knowledge", "region"):
            self.plan.require(self.refuted | self.folded)

    def finish(self) -> Iterator[str]:
        demand(self.ended, "the certificate ends early")
        kind, ends = self.header["kind"], ("lower", "upper")
        if kind == "knowledge":
            demand("correct execution" in self.refuted, "the formula of correct executions is not refuted")
            yield "established: the formula of the certificate has no model"
            yield "trusted: that the formula says what a correct execution of the plan is"
            return
        demand(kind == "region" or self.box.keys() == self.plan.declared.keys(), "a box of another dimension")
        demand(kind != "plan" or all(low == high is not None for low, _, high, _ in self.box.values()), "not a point")
        demand(self.scheduled or kind == "region", "there is no schedule")
        for name, interval in self.box.items():
            for side, end, closed, bound in zip(ends, interval[::2], interval[1::2], self.plan.declared[name]):
                free = kind != "maximal" or end is None or (closed and end == bound) or (name, side) in self.faces
                demand(free, f"no witness for the {side} face of {name}")
        where = {"plan": "at the point", "region": f"in {self.pieces} pieces"}.get(kind, "all over the box")
        if kind != "region":
            yield f"established: the network has a schedule {where}"
        yield f"established: {len(self.refuted - self.trusting)} obligations hold {where}, by the ground plan alone"
        yield f"established: the formulas of {len(self.refuted & self.trusting)} obligations have no model {where}"
        if kind == "maximal":
            yield f"established: no valid box contains this one: {len(self.faces)} faces have a witness, executed here"
        yield f"trusted: that those formulas say what breaks these obligations ({self.header['encoding']} encoding)"
        yield f"trusted: that {len(self.folded)} obligations hold because the encoding's formulas for them are constant"
        yield "trusted: that the ground plan in the certificate is what the input files say"


def check(path: str, files: dict[str, str]) -> list[str]:
    """What the certificate establishes and what remains trusted; raises Rejected, or OSError."""
    certificate, number = Certificate(), 0
    try:
        for number, line in enumerate(lines_of(path), 1):
            certificate.read(line)
        said, inputs = list(certificate.finish()), certificate.header["inputs"]
        for name, file in files.items():
            with open(file, "rb") as opened:
                found = hashlib.file_digest(opened, "sha256").hexdigest()
            demand(found == inputs.get(name), f"{file} is not the {name} that the certificate is about")
    except (Rejected, *MALFORMED) as error:
        why = str(error) if isinstance(error, Rejected) else f"malformed ({type(error).__name__})"
        raise Rejected(f"{path}: line {number}: {why}") from None
    how = {name: "the same" if name in files else "not compared" for name in inputs}
    return [*said, *(f"input: {name}, SHA-256 {inputs[name]}, {how[name]}" for name in inputs)]


def main() -> int:
    reader = argparse.ArgumentParser(description="Check a certificate of robust.")
    for name in ("certificate", *(f"--{name}" for name in INPUTS)):
        reader.add_argument(name, metavar="FILE")
    given = vars(reader.parse_args())
    try:
        code, lines = 0, check(given.pop("certificate"), {name: file for name, file in given.items() if file})
    except (Rejected, OSError, zlib.error) as error:
        code, lines = (1, [f"rejected: {error}"]) if isinstance(error, Rejected) else (2, [f"unreadable: {error}"])
    for line in lines:
        print("".join(char if char.isprintable() and char.isascii() else "?" for char in line))
    return code


if __name__ == "__main__":
    sys.exit(main())
