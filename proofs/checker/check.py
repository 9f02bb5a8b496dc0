#!/usr/bin/env python3
"""Checks certificates of `robust`: python check.py CERTIFICATE [--domain FILE] [--problem FILE] [--plan FILE] ...

One file, nothing but the standard library, no solver, exact rational arithmetic. A certificate is JSON, one line for
each statement, compressed by gzip, and read as a stream. Checked are theory lemmas, by multiples that add up to a
contradiction [Farkas 1902]; refutations, by unit propagation along hints (LRAT); what formulas say of network, box and
separations, against the ground plan; schedules; that polyhedra are all parameter values; and witnesses, executed on the
ground plan arbitrarily near to a face. Exit codes: 0 established (what, and what is trusted), 1 rejected, 2 unreadable.
"""

import argparse
import gzip
import hashlib
import json
import re
import resource
import sys
import zlib
from collections.abc import Iterator
from fractions import Fraction
from functools import cmp_to_key
from typing import Any

FORMAT = "robust/certificate/1"
LONGEST_LINE, LARGEST_TOTAL = 4 << 20, 512 << 20  # bytes after decompression
WORK_PER_BYTE, WORK_AT_ALL, MEMORY = 60, 2_000_000, 6_000_000  # steps; what is kept at one time, in some 100 bytes
LARGEST_MEMORY = 2 << 30  # bytes; the system sees to it when this file runs as a program
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
    demand(type(value) is int or re.fullmatch("-?[0-9]+(/0*[1-9][0-9]*)?", value), "found a text, expected a number")
    return Fraction(value)


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
        return Near(*(left + right for left, right in zip(short, long)), *long[len(short) :])

    def __mul__(self, other: "Near") -> "Near":
        terms: list[Fraction | int] = [0] * (len(self.terms) + len(other.terms))
        for i, left in enumerate(self.terms):
            for j, right in enumerate(other.terms):
                terms[i + j] += left * right
        return Near(*terms)

    def __sub__(self, other: "Near") -> "Near":
        return self + Near(*(-term for term in other.terms))

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

    work, memory = WORK_AT_ALL, MEMORY

    def __init__(self) -> None:
        self.declared: dict[str, tuple[Fraction | None, ...]] = {}  # bounds of parameters
        self.epsilon = Fraction(0)
        self.points: list[str] = []
        self.constraints: list[tuple[int, int, Linear]] = []  # source, target, least distance
        self.conditions: list[Any] = []  # [time point, null, condition, label], or [start, end, ...] if over all
        self.effects: list[list[Any]] = []  # by time point: [kind, target, expression, condition]
        self.rates: list[Any] = []  # [start, end, fluent, expression]
        self.initial: tuple[list[str], list[Any]] = ([], [])
        self.prints: list[set[tuple[str, str]]] = []  # by time point: (what is done, to what)
        self.timed = set[int]()  # time points of timed initial literals
        self.state("point", ".zero")

    def spend(self, steps: int, kept: int = 0) -> None:
        self.work, self.memory = self.work - steps, self.memory - kept
        demand(self.work >= 0 and self.memory >= 0, "checking takes more work or memory than its size may need")

    def state(self, kind: str, *rest: Any) -> None:
        if kind == "point":
            self.spend(len(self.points))
            demand(rest[0] not in self.points, "a time point twice")
            self.timed.update([len(self.points)] if rest[1:] else [])
            self.points.append(rest[0])
            self.effects.append([])
            self.prints.append(set())
        elif kind == "constraint":
            demand(pick(self.points, rest[0]) and pick(self.points, rest[1]), "a time point without a name")
            self.constraints.append((rest[0], rest[1], linear(rest[2])))
        elif kind == "condition":
            point, end, condition, _ = rest
            self.conditions.append(rest)
            if end is None and point is not None:
                self.note(point, "", "", [], condition)
        elif kind in ("effect", "mention"):
            pick(self.effects, rest[0]).extend([rest[1:]] if kind == "effect" else [])
            self.note(*rest)
        elif kind == "rate":
            self.rates.append(rest)
            for point in rest[:2]:
                self.note(point, "increase", rest[2], rest[3], True)
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

    def edges(self) -> Iterator[tuple[int, int, Linear]]:
        """The whole network: no time is negative, and every constraint."""
        for edge in (*((0, point, Linear()) for point in range(len(self.points))), *self.constraints):
            self.spend(len(edge[2]) + 1)
            yield edge

    def are_mutex(self, first: int, second: int) -> bool:
        """Whether two time points must be separated: the no-moving-targets rule of PDDL 2.1."""
        for a, b in ((first, second), (second, first)) if not {first, second} <= self.timed else ():
            done = pick(self.prints, b)
            if any((harm, name) in done for kind, name in pick(self.prints, a) for harm in HARMS.get(kind, ())):
                return True
        return False

    def separation(self, first: Any, second: Any) -> set[str]:
        ends = pick(self.points, first), pick(self.points, second)
        return {f"separation: {a}, {b}" for a, b in (ends, ends[::-1])}

    def require(self, known: set[str]) -> None:
        """Every obligation of the plan is among the known ones."""
        for *_, label in self.conditions:
            demand(label in known, f"there is no proof of {label}")
        self.spend(len(self.points) * sum(len(done) + 1 for done in self.prints))
        for second in range(1, len(self.points)):
            for first in (first for first in range(1, second) if self.are_mutex(first, second)):
                demand(self.separation(first, second) & known, f"no separation of {first} and {second}")


class Simulation:
    """One schedule of the plan, which the network allows, executed."""

    def __init__(self, plan: Plan, values: dict[str, Near], times: list[Near]) -> None:
        self.plan, self.times = plan, times
        demand(len(times) == len(plan.points) and not times[0].terms, "a time is missing, or zero is not at 0")
        for source, target, least in plan.edges():
            gap = times[target] - times[source] - evaluated(least, values)
            demand(gap.sign >= 0, "the schedule breaks a constraint of the network")
        self.known = {**values, **{f"@{point}": time for point, time in enumerate(times)}}
        self.before: dict[int, State] = {}
        self.happenings: list[tuple[Near, State, State, dict[str, Near]]] = []  # time, states, slopes after it
        order = sorted(range(len(times)), key=cmp_to_key(lambda a, b: (times[a] - times[b]).sign))  # type: ignore[call-overload]
        fluents = {fluent: self.number(value, (set(), {})) for fluent, value in self.plan.initial[1]}
        state, slopes, now = (set(self.plan.initial[0]), fluents), dict[str, Near](), Near()
        while order:
            time = self.times[order[0]]
            together = [point for point in order if not (self.times[point] - time).terms]
            self.plan.spend(len(order) + len(self.plan.rates))
            order = order[len(together) :]
            before = self.moved(state, slopes, time - now)
            self.before.update(dict.fromkeys(together, before))
            state, now = self.happen(together, before), time
            slopes = self.slopes(time, state)
            self.happenings.append((time, before, state, slopes))

    def moved(self, state: State, slopes: dict[str, Near], span: Near) -> State:
        self.plan.spend(len(state[0]) + len(state[1]), len(state[0]) + 4 * len(state[1]))
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
                self.plan.spend(1)
                product *= state[1][variable] if variable in state[1] else self.known[variable]
            total += product
        return total

    def holds(self, condition: Any, state: State) -> bool:
        """true, false, ["h", atom, value], ["c", expression, relation], ["and", ...] or ["or", ...]."""
        self.plan.spend(1)
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
                inside = (instant - self.times[point]).sign > 0 < (self.times[end] - instant).sign
                demand(inside, "the instant is not inside the action")
                time, *states, slopes = [each for each in self.happenings if (instant - each[0]).sign >= 0][-1]
                if (instant - time).terms:
                    states = [self.moved(states[1], slopes, instant - time)]
            demand(not all(self.holds(condition, state) for state in states), "the condition holds")


class Certificate:
    """Reads a certificate line by line; `finish` says what has been established."""

    def __init__(self) -> None:
        self.plan, self.header = Plan(), dict[str, Any]()
        self.nodes: list[Any] = [None]  # of formulas
        self.lemmas, self.clauses = list[tuple[int, ...]](), list[tuple[int, ...]]()  # of all, of this refutation
        self.box: dict[str, tuple[Fraction | None, bool, Fraction | None, bool]] = {}  # ends, and whether they belong
        self.where: list[Any] = []  # what is known of the parameters: (expression, strict) for `>= 0` or `> 0`
        self.places: dict[int, Linear] = {0: {}}  # where time points are
        self.obligation = self.part = ""  # what is refuted; a region's piece, what is outside of it, or the rest
        self.refuted, self.proved, self.always, self.trusting, self.folded = (set[str]() for _ in range(5))
        self.free, self.times = dict[str, int](), list[Linear]()  # time points by their variables; the schedule
        self.known: list[Any] = []  # what is known in each polyhedron, by number
        self.parts: dict[str, set[int]] = {"piece": set(), "outside": set(), "formula": set()}  # numbers of polyhedra
        self.faces, self.stated, self.ended = set[tuple[str, str]](), False, False

    def read(self, line: bytes) -> None:
        self.plan.spend(-WORK_PER_BYTE * len(line))
        value = json.loads(line, parse_float=str, parse_constant=str)
        demand(not self.ended, "there is something behind the end")
        if not self.header:
            return self.start(value)
        kind, *rest = value
        self.plan.spend(0, 0 if kind in ("lemma", "derive", "qed") else len(line) // 4)
        proof = kind in ("a", "g", "lemma") or bool(self.obligation) == (kind in ("root", "derive", "qed"))
        demand(proof, "a step outside of a refutation, or none")
        if kind in ("lemma", "derive", "root", "place", "schedule", "apart"):
            getattr(self, kind)(*rest)
        elif kind in ("piece", "outside", "rest"):
            self.begin(kind, *rest)
        elif kind in ("a", "g"):
            self.define(*rest)
        elif kind == "qed":
            self.derive([], *rest)
            self.refuted.add(self.obligation)
            self.obligation = ""
        elif kind == "obligation":
            inside = (self.header["kind"] == "region") == bool(self.part)
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
            demand(not self.stated, "a part of the ground plan after the first conclusion from it")
            return self.plan.state(kind, *rest)
        self.stated = True

    def start(self, header: Any) -> None:
        demand(type(header) is dict and header.get("format") == FORMAT, f"not a certificate of the format {FORMAT}")
        kind = header["kind"] in ("plan", "box", "maximal", "region", "knowledge")
        demand(kind and {len(digest) for digest in header["inputs"].values()} <= {64}, "a malformed header")
        self.header, self.plan.epsilon = header, rational(header.get("epsilon", 0))
        for name, lower, upper in header.get("parameters", []):
            demand(name and name not in self.plan.declared, "a parameter twice")
            self.plan.declared[name] = tuple(None if each is None else rational(each) for each in (lower, upper))
        bounds = [(low, True, high, True) for _, low, high in header.get("parameters", [])]
        ends = bounds if header["kind"] == "region" else header.get("box", [])
        for name, (low, low_closed, high, high_closed) in zip(self.plan.declared, ends, strict=True):
            lower, upper = (None if each is None else rational(each) for each in (low, high))
            point = lower == upper and low_closed and high_closed
            demand(lower is None or upper is None or lower < upper or point, "the box is empty")
            demand({type(low_closed), type(high_closed)} == {bool}, "an end of the box is neither open nor closed")
            self.box[name] = lower, low_closed, upper, high_closed
            for sign, end, closed in ((1, lower, low_closed), (-1, upper, high_closed)):
                known = None if end is None else combined({name: Fraction(sign)}, {"": end}, -sign)
                self.where.append((known, not closed))
        self.bounds = self.where

    def literals(self, value: Any) -> tuple[int, ...]:
        self.plan.spend(0, len(value) + 1)
        demand(all(type(each) is int and 0 < abs(each) < len(self.nodes) for each in value), "an unknown literal")
        return tuple(value)

    def define(self, value: Any, strict: bool | None = None) -> None:
        """A linear constraint `expression >= 0`, or `> 0`; or, without `strict`, a conjunction of literals."""
        demand(strict is None or (type(strict) is bool and any(linear(value))), "a malformed linear constraint")
        self.nodes.append((self.literals(value),) if strict is None else (linear(value), strict))

    def constraint(self, literal: int) -> tuple[Linear, bool]:
        expression, strict = self.nodes[abs(literal)]
        return (expression, strict) if literal > 0 else (combined({}, expression, -1), not strict)

    def lemma(self, literals: Any, multipliers: Any) -> None:
        """The negations of the literals contradict each other."""
        clause, total, strict = self.literals(literals), Linear(), False
        for literal, multiplier in zip(clause, multipliers, strict=True):
            expression, sharp = self.constraint(-literal)
            demand(type(multiplier) is int and multiplier > 0, "expected multipliers above 0")
            self.plan.spend(len(expression) + len(total))
            total, strict = combined(total, expression, multiplier), strict or sharp
        value = total.pop("", 0)
        demand(not total and value <= 0 and (strict or value), "the multiples do not add up to a contradiction")
        self.lemmas.append(clause)

    def derive(self, literals: Any, hints: Any) -> None:
        """Unit propagation along clauses or lemmas (below 0), or [conjunction, which clause of it]."""
        clause = self.literals(literals)
        false = set(clause)
        for hint in hints:
            if type(hint) is int:
                hinted = pick(self.clauses, hint) if hint >= 0 else pick(self.lemmas, ~hint)
            else:
                (inputs,), which = pick(self.nodes, hint[0]), hint[1] - 1
                hinted = (-hint[0], pick(inputs, which)) if which >= 0 else (hint[0], *(-each for each in inputs))
            self.plan.spend(len(hinted))
            unassigned = {literal for literal in hinted if literal not in false}
            if not unassigned:
                return self.clauses.append(clause)
            demand(len(unassigned) == 1, "a hint is not a unit clause")
            false.add(-unassigned.pop())
        raise Rejected("the hints do not lead to a contradiction")

    def place(self, point: int, how: Any) -> None:
        """Where a time point is: at a variable of its own, or tied to another one by an equality."""
        demand(pick(self.plan.points, point) and point not in self.places, "a time point twice")
        if type(how) is str:
            demand(how and how not in {*self.free, *self.plan.declared}, "a time point needs a variable of its own")
            self.free[how], self.places[point] = point, {how: Fraction(1)}
        else:
            (source, target, least), back = (pick(self.plan.constraints, each) for each in how)
            demand(target == point and back == (point, source, combined({}, least, -1)), "time points are not tied")
            self.places[point] = combined(self.places[source], least)

    def apart(self, first: Any, second: Any) -> None:
        """All schedules keep the same time between two time points."""
        gap = combined(self.places[second], self.places[first], -1)
        demand(gap.keys() == {""} and gap[""] >= self.plan.epsilon, "the time points may be too close")
        self.always.add(min(self.plan.separation(first, second)))

    def begin(self, part: str, constraints: Any = ()) -> None:
        """What follows is about a piece of a region, a polyhedron outside of it, or the rest within the bounds."""
        self.complete()
        self.part, self.refuted, self.times = part, set(), []
        self.where = self.bounds if part == "rest" else [(linear(known), strict) for known, strict in constraints]
        if part != "rest":
            demand({name for side, _ in self.where for name in side} <= {"", *self.plan.declared}, "not a polyhedron")
            self.parts[part].add(len(self.known))
            self.known.append(tuple(self.where))

    def root(self, literal: Any, kind: str, *rest: Any) -> None:
        """What is refuted; outside of a region: that a schedule exists, or that the one given keeps an obligation."""
        allowed = {"outside": "wx" if self.times else "wzn", "rest": "wo"}.get(self.part, "wznst")
        demand(kind in list(allowed), "a conjunct of a kind that nothing speaks for here")
        self.clauses.append(self.literals([literal]))
        if kind == "o":  # the parameter values are not in a polyhedron
            for each, said in zip(pick(self.nodes, -literal)[0], pick(self.known, rest[0]), strict=True):
                self.compare(each, *said)
        elif kind == "x":  # not all of what breaks an obligation is so
            demand(len({*map(str, rest[0])}) == 2 or ["t"] in rest[0], "less than what breaks the obligation")
            self.parts["formula"].update([len(self.known)] if ["t"] in rest[0] else ())
            for each, (how, *what) in zip(pick(self.nodes, -literal)[0], rest[0], strict=True):
                demand(how == "t" or (how == "s" and self.plan.are_mutex(*what)), "not what breaks an obligation")
                self.compare(each, *self.claimed(how, *what)) if how == "s" else None
        elif kind == "t":
            self.trusting.add(self.obligation)
        else:
            self.compare(literal, *self.claimed(kind, *rest))

    def compare(self, literal: int, found: Linear, sharp: bool) -> None:
        """The literal says that `found >= 0`, or `> 0`."""
        expression, strict = self.constraint(literal)
        name = next((name for name in found if name), "")
        scale = expression.get(name, Fraction(0)) / found[name]
        demand(scale > 0 and sharp is strict and combined({}, found, scale) == expression, "a formula says otherwise")

    def claimed(self, kind: str, number: Any, side: Any = None) -> tuple[Linear, bool]:
        """The inequality `expression >= 0`, or `> 0`, that a root is said to be."""
        if kind == "w":  # the parameter values that the certificate is about
            return pick(self.where, number)  # type: ignore[no-any-return]
        if kind == "z":  # no time is negative
            return self.places[number], False
        if kind == "n":  # a temporal constraint
            source, target, least = pick(self.plan.constraints, number)
        else:  # less than epsilon apart
            demand(kind == "s" and self.obligation in self.plan.separation(number, side), "not about the obligation")
            source, target, least = side, number, {"": -self.plan.epsilon}
        self.plan.spend(len(self.places[source]) + len(self.places[target]))
        return combined(combined(self.places[target], self.places[source], -1), least, -1), kind == "s"

    def schedule(self, times: Any, multiples: Any, others: Any = ()) -> None:
        """Times over the parameters keep the network, by multiples of what is known; and values of other variables."""
        self.times = list(map(linear, times))
        demand(len(times) == len(self.plan.points) and not times[0], "a time is missing, or zero is not at 0")
        for (source, target, least), each in zip(self.plan.edges(), multiples, strict=True):
            rest = combined(combined(self.times[target], self.times[source], -1), least, -1)
            for number, factor in each:
                self.plan.spend(len(rest) + len(self.times[source]))
                demand(rational(factor) > 0, "expected multipliers above 0")
                rest = combined(rest, pick(self.where, number)[0], -rational(factor))
            demand(rest.pop("", 0) >= 0 and not rest, "the schedule breaks a constraint of the network somewhere")
        values = {name: self.times[point] for name, point in self.free.items()}
        for name, value in others:
            new = name not in {*values, *self.plan.declared} and {*linear(value)} <= {"", *self.plan.declared}
            demand(new, "a variable with two values")
            values[name] = linear(value)
        for name, value in values.items() if self.part == "outside" else ():
            self.where += [(combined({name: Fraction(sign)}, value, -sign), False) for sign in (1, -1)]

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
            memory = self.plan.memory
            Simulation(self.plan, values, list(map(near, course))).require_broken(*what)
            self.plan.memory = memory  # nothing of it is kept
        else:
            each = self.plan.constraints
            walk = [(0, *step, Linear()) if type(step) is list else pick(each, step) for step in course]
            circle = all(before[1] == after[0] for before, after in zip(walk, walk[1:] + walk[:1]))
            length = sum((evaluated(least, values) for *_, least in walk), Near())
            demand(circle and length.sign > 0, "the constraints do not contradict each other in a circle")
        self.faces.add((face, side))

    def complete(self) -> None:
        """Enough has been said of the parameter values that this is about."""
        if self.part in ("outside", "rest"):
            demand(self.refuted, "nothing says why a polyhedron is outside, or that there are no others")
        elif self.part or self.header["kind"] not in ("knowledge", "region"):
            demand(self.times, "there is no schedule")
            self.proved |= self.refuted | self.always
            self.plan.require(self.refuted | self.always | self.folded)

    def finish(self) -> Iterator[str]:
        demand(self.ended, "the certificate ends early")
        kind, ends = self.header["kind"], ("lower", "upper")
        if kind == "knowledge":
            demand("correct execution" in self.refuted, "the formula of correct executions is not refuted")
            yield "established: the formula of the certificate has no model"
            return (yield "trusted: that the formula says what a correct execution of the plan is")
        demand(kind != "plan" or all(low == high is not None for low, _, high, _ in self.box.values()), "not a point")
        demand(kind != "region" or self.part == "rest", "nothing is said of the rest of the parameter space")
        for name, interval in self.box.items():
            for side, end, closed, bound in zip(ends, interval[::2], interval[1::2], self.plan.declared[name]):
                free = kind != "maximal" or end is None or (closed and end == bound) or (name, side) in self.faces
                demand(free, f"no witness for the {side} face of {name}")
        pieces, outside, trusting = map(len, self.parts.values())
        where = {"plan": "at the point", "region": f"in each of the pieces ({pieces})"}.get(kind, "all over the box")
        yield f"established: the network has a schedule {where}"
        yield f"established: {len(self.proved - self.trusting)} obligations hold {where}, by the ground plan alone"
        yield f"established: the formulas of {len(self.proved & self.trusting)} obligations have no model {where}"
        if kind == "maximal":
            yield f"established: no valid box contains this one: {len(self.faces)} faces have a witness, executed here"
        if kind == "region":
            yield f"established: {outside} polyhedra outside and the pieces are all parameter values within the bounds"
            yield f"established: those are bad, {trusting} of them if the formula of an obligation says what breaks it"
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
    same = {name: "the same" if name in files else "not compared" for name in inputs}
    return [*said, *(f"input: {name}, SHA-256 {inputs[name]}, {same[name]}" for name in inputs)]


def main() -> int:
    reader = argparse.ArgumentParser(description="Check a certificate of robust.")
    for name in ("certificate", "--domain", "--problem", "--plan", "--network", "--parameters"):
        reader.add_argument(name, metavar="FILE")
    given, most = vars(reader.parse_args()), resource.getrlimit(resource.RLIMIT_AS)[1]
    resource.setrlimit(resource.RLIMIT_AS, (min({LARGEST_MEMORY, most} - {resource.RLIM_INFINITY}), most))
    try:
        code, lines = 0, check(given.pop("certificate"), {name: file for name, file in given.items() if file})
    except (Rejected, OSError, zlib.error) as error:
        code, lines = (1, [f"rejected: {error}"]) if isinstance(error, Rejected) else (2, [f"unreadable: {error}"])
    print(*("".join(one if one.isprintable() and one.isascii() else "?" for one in line) for line in lines), sep="\n")
    return code


if __name__ == "__main__":
    sys.exit(main())
