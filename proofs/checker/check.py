#!/usr/bin/env python3
"""Checks certificates of `robust`: python check.py CERTIFICATE [--domain FILE] [--problem FILE] [--plan FILE] ...

One file, nothing but the standard library, no solver, exact rational arithmetic. A certificate is JSON, one line for
each statement, compressed by gzip, and read as a stream. What is checked:

* theory lemmas: the multiples of the linear constraints that a lemma names add up to a contradiction [Farkas 1902];
* refutations: each derived clause follows by unit propagation from the clauses that it names, in their order (LRAT);
* where formulas speak of the temporal network, of the box or of separations: that the ground plan says the same;
* schedules: they keep every constraint of the network all over the box;
* witnesses: executed on the ground plan, here, arbitrarily near to the face that they are about.

Exit codes: 0 established (what, and what is trusted, is printed), 1 rejected (one line says where and why), 2 the
certificate or an input file cannot be read.
"""

import argparse
import hashlib
import json
import sys
import zlib
from collections.abc import Iterator
from fractions import Fraction
from functools import cmp_to_key
from typing import Any

FORMAT = "robust/certificate/1"
INPUTS = ("domain", "problem", "plan", "network", "parameters")
KINDS = ("plan", "box", "maximal", "region", "knowledge")
LONGEST_LINE, LARGEST_TOTAL = 4 << 20, 512 << 20  # bytes, after decompression
LONGEST_NUMBER, LARGEST_MEMORY = 400, 6_000_000  # digits; numbers and names kept at one time
WORK_PER_BYTE, WORK_AT_ALL = 60, 2_000_000
MALFORMED = (TypeError, ValueError, KeyError, IndexError, AttributeError, RecursionError, OverflowError, MemoryError)

Clause = tuple[int, ...]
Linear = dict[str, Fraction]  # coefficients by variable; that of "" is the constant


class Rejected(Exception):
    """The certificate does not establish what it says."""


class Unreadable(Exception):
    """There is no certificate to check."""


def demand(condition: object, message: str) -> None:
    if not condition:
        raise Rejected(message)


# -- reading ---------------------------------------------------------------------------------------------------------


def lines_of(path: str) -> Iterator[bytes]:
    """The lines of a gzip file, in bounded memory."""
    total, rest, expand = 0, b"", zlib.decompressobj(31)
    try:
        with open(path, "rb") as file:
            while not expand.eof:
                data = expand.unconsumed_tail or file.read(1 << 16)
                demand(data, "the file ends early")
                piece = expand.decompress(data, 1 << 20)
                total += len(piece)
                *complete, rest = (rest + piece).split(b"\n")
                demand(total <= LARGEST_TOTAL and len(rest) <= LONGEST_LINE, "a line or the whole is too long")
                yield from complete
            demand(not rest and not expand.unused_data and not file.read(1), "there is something behind the end")
    except OSError as error:
        raise Unreadable(f"{path}: {error.strerror or error}") from None
    except zlib.error as error:
        raise Unreadable(f"{path}: not a whole gzip file: {error}") from None


def integer(digits: str) -> int:
    demand(len(digits) <= LONGEST_NUMBER, f"a number of over {LONGEST_NUMBER} digits")
    return int(digits)


def refuse(found: str) -> None:
    raise Rejected(f"found {found[:20]}, expected integers and fractions")


def parse(line: bytes) -> Any:
    try:
        return json.loads(line, parse_int=integer, parse_float=refuse, parse_constant=refuse)
    except (ValueError, RecursionError):
        raise Rejected("not a line of JSON") from None


def text(value: Any) -> str:
    demand(type(value) is str, "found something else, expected a text")
    return str(value)


def items(value: Any) -> list[Any]:
    demand(type(value) is list, "found something else, expected a list")
    return list(value)


def index(value: Any, among: Any) -> int:
    demand(type(value) is int and 0 <= value < len(among), f"found {str(value)[:20]!r}, expected a number of something")
    return int(value)


def pick(among: list[Any], value: Any) -> Any:
    return among[index(value, among)]


def rational(value: Any) -> Fraction:
    """A number: an integer, or a text such as "1/3"."""
    if type(value) is int:
        return Fraction(value)
    top, slash, bottom = text(value).partition("/")
    plain = top.removeprefix("-").isdecimal() and top.isascii() and (not slash or (bottom + "0").isdecimal())
    demand(plain and bottom.isascii() and (not slash or bottom.strip("0")), f"found {top[:20]!r}, expected a number")
    return Fraction(integer(top), integer(bottom) if slash else 1)


def optional(value: Any) -> Fraction | None:
    return None if value is None else rational(value)


class Budget:
    """Work and memory that a certificate of this size may cost."""

    def __init__(self) -> None:
        self.work, self.memory = WORK_AT_ALL, 0

    def spend(self, steps: int) -> None:
        self.work -= steps
        demand(self.work >= 0, "checking takes more steps than a certificate of this size may need")

    def keep(self, numbers: int) -> None:
        self.memory += numbers
        demand(self.memory <= LARGEST_MEMORY, f"more than {LARGEST_MEMORY} numbers to remember")


# -- numbers ---------------------------------------------------------------------------------------------------------


class Near:
    """A polynomial in an infinitesimal e > 0: what is said of it holds for every e that is small enough."""

    __slots__ = ("terms",)

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

    @property
    def sign(self) -> int:
        first = next((term for term in self.terms if term), 0)
        return (first > 0) - (first < 0)


def near(value: Any) -> Near:
    """A number, or a list: a polynomial in the infinitesimal, the constant first."""
    return Near(*map(rational, value)) if type(value) is list else Near(rational(value))


def linear(value: Any) -> Linear:
    """A list of [coefficient] and [coefficient, variable]."""
    total: Linear = {}
    for factor, *names in items(value):
        demand(len(names) <= 1, "a product of variables, expected a linear expression")
        total = combined(total, {text(names[0]) if names else "": rational(factor)})
    return total


def combined(left: Linear, right: Linear, factor: int = 1) -> Linear:
    """`left + factor * right`."""
    total = dict(left)
    for name, value in right.items():
        total[name] = total.get(name, Fraction(0)) + factor * value
    return {name: value for name, value in total.items() if value}


# -- the ground plan, and its simulation -----------------------------------------------------------------------------


class Plan:
    """The ground plan as the certificate states it: parameters, time points, network, actions, goal.

    An action is [identifier, name, start, end, durations, conditions, effects on atoms, on numbers, rates]. Durations and
    conditions are [timing, condition, label], effects [timing, atom, value, condition] and [timing, fluent, operator,
    expression, condition], rates [fluent, expression].
    """

    def __init__(self) -> None:
        self.parameters: list[str] = []
        self.declared: list[tuple[Fraction | None, Fraction | None]] = []
        self.points = [".zero"]
        self.constraints: list[tuple[int, int, Linear | None, Linear | None]] = []
        self.actions: dict[str, list[Any]] = {}
        self.at: dict[int, list[tuple[str, str]]] = {}  # who starts or ends at a time point
        self.literals: list[tuple[int, str, Any]] = []
        self.atoms: list[str] = []
        self.fluents: list[Any] = []
        self.goals: list[tuple[Any, str]] = []
        self.epsilon = Fraction(0)

    def edge(self, number: Any, side: Any) -> tuple[int, int, Linear]:
        """One side of a constraint as a lower bound: source, target and least distance."""
        source, target, lower, upper = pick(self.constraints, number)
        demand((lower if side == "l" else upper if side == "u" else None) is not None, "no such side")
        return (source, target, lower) if side == "l" else (target, source, combined({}, upper, -1))

    def footprint(self, point: int) -> list[set[str]]:
        """What a time point does: atoms read, added, deleted; fluents read, assigned, increased."""
        atoms, adds, deletes, fluents, assigns, increases = sets = [set[str]() for _ in range(6)]
        for name, timing in self.at.get(point, ()):
            _, _, _, _, durations, conditions, changes, numbers, rates = self.actions[name]
            pending = [part[1] for part in (*durations, *conditions) if part[0] == timing]
            expressions = [rate for _, rate in rates]
            increases.update(fluent for fluent, _ in rates)
            for when, atom, value, condition in changes:
                if when == timing:
                    pending.append(condition)
                    (adds if value is True else deletes).add(atom)
            for when, fluent, operator, expression, condition in numbers:
                if when == timing:
                    pending.append(condition)
                    expressions.append(expression)
                    (assigns if operator == "assign" else increases).add(fluent)
            for node in pending:
                kind, *rest = [""] if type(node) is bool else node
                pending += rest if kind in ("and", "or") else []
                atoms.update(rest[:1] if kind == "h" else [])
                expressions += rest[:1] if kind == "c" else []
            fluents.update(name for each in expressions for _, *names in each for name in names if name[0] == "(")
        for when, target, value in self.literals:
            if when == point:
                (assigns if type(value) is not bool else adds if value else deletes).add(target)
        return sets

    def obligations(self) -> Iterator[set[str]]:
        """The names of every obligation: one of each set."""
        for identifier, name, start, end, durations, conditions, *_ in self.actions.values():
            yield from ({text(part[2])} for part in (*durations, *conditions))
            if start != end:
                yield {f"{identifier} {name}: non-negative duration"}
        yield from ({label} for _, label in self.goals)
        prints = [self.footprint(point) for point in range(len(self.points))]
        for second in range(1, len(self.points)):
            for first in range(1, second):
                if self.are_mutex(first, second, prints[first], prints[second]):
                    yield self.separation(first, second)

    def separation(self, first: int, second: int) -> set[str]:
        a, b = self.points[first], self.points[second]
        return {f"separation: {a}, {b}", f"separation: {b}, {a}"}

    def are_mutex(self, first: int, second: int, one: list[set[str]], other: list[set[str]]) -> bool:
        """Whether two time points must be separated: the no-moving-targets rule of PDDL 2.1."""
        return not {first, second} <= {point for point, _, _ in self.literals} and any(
            (a[1] | a[2]) & b[0] or a[1] & b[2] or (a[4] | a[5]) & b[3] or a[4] & (b[4] | b[5])
            for a, b in ((one, other), (other, one))
        )


State = tuple[set[str], dict[str, Near]]  # atoms that are true, and the values of fluents


class Simulation:
    """One schedule of the plan, which the network allows, executed."""

    def __init__(self, plan: Plan, values: list[Any], times: list[Any], budget: Budget) -> None:
        demand(len(values) == len(plan.parameters) and len(times) == len(plan.points), "a value or a time is missing")
        self.plan, self.budget = plan, budget
        self.values = dict(zip(plan.parameters, map(near, values)))
        self.times = list(map(near, times))
        demand(not self.times[0].terms and all(time.sign >= 0 for time in self.times), "a time is negative")
        for name, bounds in zip(plan.parameters, plan.declared):
            for bound, sign in zip(bounds, (1, -1)):
                beyond = bound is not None and ((self.values[name] - Near(bound)) * Near(sign)).sign < 0
                demand(not beyond, f"{name} is outside its declared bounds")
        for number, (_, _, *bounds) in enumerate(plan.constraints):
            for side, bound in zip("lu", bounds):
                if bound is not None:
                    source, target, least = plan.edge(number, side)
                    gap = self.times[target] - self.times[source] - evaluated(least, self.values)
                    demand(gap.sign >= 0, f"the schedule breaks constraint {number} of the network")
        self.run()

    def run(self) -> None:
        """States before and after each happening, and slopes between them."""
        order = sorted(range(len(self.times)), key=cmp_to_key(lambda a, b: (self.times[a] - self.times[b]).sign))
        self.happenings: list[tuple[Near, State, State, dict[str, Near]]] = []
        self.before: dict[int, State] = {}
        rates: dict[tuple[str, int], Near] = {}
        fluents = {text(fluent): self.number(value, (set(), {}), None) for fluent, value in self.plan.fluents}
        state, slopes, now, place = (set(self.plan.atoms), fluents), dict[str, Near](), Near(), 0
        while place < len(order):
            time = self.times[order[place]]
            together = [point for point in order[place:] if not (self.times[point] - time).terms]
            self.budget.spend(len(order) - place)
            before = self.moved(state, slopes, time - now)
            self.before.update(dict.fromkeys(together, before))
            state = self.happen(together, before)
            slopes = self.slopes(time, state, rates)
            self.happenings.append((time, before, state, slopes))
            now, place = time, place + len(together)

    def moved(self, state: State, slopes: dict[str, Near], span: Near) -> State:
        self.budget.spend(len(state[0]) + len(state[1]))
        return state[0], {**state[1], **{fluent: state[1][fluent] + rate * span for fluent, rate in slopes.items()}}

    def happen(self, points: list[int], before: State) -> State:
        """Deletes, then adds; assignments, then increases; all read the state before."""
        adds, deletes, values, increases = set[str](), set[str](), dict(before[1]), list[tuple[str, Near]]()
        for point, target, value in self.plan.literals:
            if point in points and type(value) is bool:
                (adds if value else deletes).add(target)
            elif point in points:
                values[target] = near(value)
        for name, timing in (each for point in points for each in self.plan.at.get(point, ())):
            for when, atom, value, condition in self.plan.actions[name][6]:
                if when == timing and self.holds(condition, before, name):
                    (adds if value is True else deletes).add(text(atom))
            for when, fluent, operator, expression, condition in self.plan.actions[name][7]:
                if when == timing and self.holds(condition, before, name):
                    value = self.number(expression, before, name)
                    if operator == "assign":
                        values[text(fluent)] = value
                    else:
                        increases.append((text(fluent), value))
        for fluent, value in increases:
            values[fluent] += value
        return (before[0] - deletes) | adds, values

    def slopes(self, time: Near, state: State, rates: dict[tuple[str, int], Near]) -> dict[str, Near]:
        slopes, read = dict[str, Near](), set[str]()
        for name, action in self.plan.actions.items():
            if action[8] and (time - self.times[action[2]]).sign >= 0 and (self.times[action[3]] - time).sign > 0:
                for number, (fluent, rate) in enumerate(action[8]):
                    value = self.number(rate, state, name)
                    demand(not (rates.setdefault((name, number), value) - value).terms, "a rate changes")
                    demand(fluent in state[1], "a fluent has no value")
                    slopes[fluent] = slopes.get(fluent, Near()) + value
                    read.update(variable for _, *names in rate for variable in names)
        demand(not any(slopes[fluent].terms for fluent in read & slopes.keys()), "a rate changes continuously")
        return slopes

    def number(self, expression: Any, state: State, name: str | None) -> Near:
        """A list of [coefficient, variables...]: parameters, fluents such as "(fuel car)", "?duration"."""
        total = Near()
        for factor, *variables in items(expression):
            product = Near(rational(factor))
            for variable in variables:
                self.budget.spend(1)
                if variable == "?duration":
                    _, _, start, end, *_ = self.plan.actions[text(name)]
                    product *= self.times[end] - self.times[start]
                else:
                    product *= state[1][variable] if variable in state[1] else self.values[variable]
            total += product
        return total

    def holds(self, condition: Any, state: State, name: str | None) -> bool:
        """true, false, ["h", atom, value], ["c", expression, relation], ["and", ...] or ["or", ...]."""
        self.budget.spend(1)
        if type(condition) is bool:
            return condition
        kind, *parts = items(condition)
        if kind == "h":
            return (text(parts[0]) in state[0]) is parts[1]
        if kind == "c":
            sign = self.number(parts[0], state, name).sign
            return {">=": sign >= 0, ">": sign > 0, "=": sign == 0, "!=": sign != 0}[text(parts[1])]
        return {"and": all, "or": any}[kind](self.holds(part, state, name) for part in parts)

    def breaks(self, kind: str, *what: Any) -> str:
        """The obligation that is broken indeed."""
        plan = self.plan
        if kind == "goal":
            condition, label = pick(plan.goals, what[0])
            demand(not self.holds(condition, self.happenings[-1][2], None), "the goal holds")
            return str(label)
        if kind == "separation":
            first, second = (index(point, plan.points) for point in what)
            gap = self.times[first] - self.times[second]
            close = (gap - Near(plan.epsilon)).sign < 0 < (gap + Near(plan.epsilon)).sign
            mutex = first != second and plan.are_mutex(first, second, *map(plan.footprint, (first, second)))
            demand(close and mutex, "the time points need no separation, or are far enough apart")
            return plan.separation(first, second).pop()
        _, name, start, end, durations, conditions, *_ = plan.actions[text(what[0])]
        if kind == "length":
            demand((self.times[end] - self.times[start]).sign < 0, "the duration is not negative")
            return f"{what[0]} {name}: non-negative duration"
        timing, condition, label = pick({"duration": durations, "condition": conditions}[kind], what[1])
        if timing == "over all":
            instant = near(what[2])
            inside = (instant - self.times[start]).sign > 0 and (self.times[end] - instant).sign > 0
            demand(inside, "the instant is not inside the action")
            states = self.states_at(instant)
        else:
            states = [self.before[end if timing == "at end" else start]]
        demand(not all(self.holds(condition, state, what[0]) for state in states), "the condition holds")
        return str(label)

    def states_at(self, instant: Near) -> list[State]:
        """The states just before and just after an instant."""
        past = [happening for happening in self.happenings if (instant - happening[0]).sign >= 0]
        time, before, after, slopes = past[-1]
        return [self.moved(after, slopes, instant - time)] if (instant - time).terms else [before, after]


def evaluated(expression: Linear, values: dict[str, Near]) -> Near:
    total = Near()
    for name, factor in expression.items():
        total += Near(factor) * (values[name] if name else Near(1))
    return total


# -- refutations -----------------------------------------------------------------------------------------------------


class Proofs:
    """Nodes of formulas, lemmas, and the refutation that is being read."""

    def __init__(self, budget: Budget) -> None:
        self.budget = budget
        self.variables: list[str] = []
        self.nodes: list[Any] = [None]
        self.lemmas: list[Clause] = []
        self.clauses: list[Clause] = []

    def literals(self, value: Any) -> Clause:
        self.budget.keep(len(items(value)) + 1)
        demand(all(type(each) is int and 0 < abs(each) < len(self.nodes) for each in value), "an unknown literal")
        return tuple(value)

    def define(self, kind: str, *rest: Any) -> None:
        """v: a real variable. b: a boolean. a: a linear constraint. g: a conjunction. e: an equivalence."""
        self.budget.keep(1)
        if kind == "v":
            self.variables.append(text(rest[0]))
        elif kind == "b":
            self.nodes.append((kind, text(rest[0])))
        elif kind == "a":
            pairs, strict, bound = rest
            factors = {
                index(name, self.variables): factor for name, factor in zip(pairs[::2], pairs[1::2], strict=True)
            }
            demand(factors and 2 * len(factors) == len(pairs) and all(factors.values()), "a variable twice, or none")
            whole = {type(number) for number in (bound, *factors.values())} == {int}
            demand(whole and type(strict) is bool, "a malformed linear constraint")
            self.budget.keep(len(pairs))
            self.nodes.append((kind, factors, strict, bound))
        else:
            inputs = self.literals(rest[0])
            demand(kind == "g" or len(inputs) == 2, "an equivalence of other than two literals")
            self.nodes.append((kind, inputs))

    def constraint(self, literal: int) -> tuple[dict[int, int], bool, int]:
        """What a literal of an atom says: sum of factor * variable <= bound, or < if strict."""
        kind, factors, strict, bound = self.nodes[abs(literal)]
        demand(kind == "a", "expected a linear constraint")
        return (factors, strict, bound) if literal > 0 else ({n: -f for n, f in factors.items()}, not strict, -bound)

    def lemma(self, literals: Any, multipliers: Any) -> None:
        """The negations of the literals contradict each other."""
        clause, total, bound, strict = self.literals(literals), dict[int, int](), 0, False
        for literal, multiplier in zip(clause, items(multipliers), strict=True):
            demand(type(multiplier) is int and multiplier > 0, "expected multipliers above 0")
            factors, sharp, limit = self.constraint(-literal)
            self.budget.spend(len(factors))
            for name, factor in factors.items():
                total[name] = total.get(name, 0) + multiplier * factor
            bound, strict = bound + multiplier * limit, strict or sharp
        demand(not any(total.values()), "the multiples of the constraints do not cancel the variables")
        demand(bound < 0 or (strict and bound == 0), "the multiples of the constraints do not contradict each other")
        self.lemmas.append(clause)

    def hinted(self, hint: Any) -> Clause:
        """A clause by its number: of this refutation, below 0 a lemma, in a pair one of those that define a gate."""
        if type(hint) is int:
            return tuple(pick(self.clauses, hint) if hint >= 0 else pick(self.lemmas, ~hint))
        number, which = items(hint)
        kind, inputs = pick(self.nodes, number)
        if kind == "e":
            one, two, three = pick([(1, -1, -1), (1, 1, 1), (-1, -1, 1), (-1, 1, -1)], which)
            return (one * number, two * inputs[0], three * inputs[1])
        demand(kind == "g", "expected the clause of a gate")
        return (-number, pick([None, *inputs], which)) if which else (number, *(-each for each in inputs))

    def derive(self, literals: Any, hints: Any) -> None:
        """Unit propagation along the hints refutes the negation of the clause."""
        clause = self.literals(literals)
        false = set(clause)
        for hint in items(hints):
            hinted = self.hinted(hint)
            self.budget.spend(len(hinted))
            unassigned = {literal for literal in hinted if literal not in false}
            if not unassigned:
                self.clauses.append(clause)
                return
            demand(len(unassigned) == 1, "a hint is not a unit clause")
            false.add(-unassigned.pop())
        raise Rejected("the hints do not lead to a contradiction")


# -- certificates ----------------------------------------------------------------------------------------------------


class Certificate:
    """Reads a certificate line by line; `finish` says what has been established."""

    def __init__(self) -> None:
        self.budget, self.plan = Budget(), Plan()
        self.proofs = Proofs(self.budget)
        self.header: dict[str, Any] = {}
        self.box: list[tuple[Fraction | None, bool, Fraction | None, bool]] = []
        self.taken: set[str] = set()  # names of free time points
        self.where: list[tuple[Linear, bool] | None] = []  # what is known of the parameters: expressions >= 0, or > 0
        self.places: dict[int, Linear] = {0: {}}  # where time points are
        self.obligation, self.trusting = "", False
        self.refuted: dict[str, bool] = {}  # by obligation: whether the meaning of formulas is trusted
        self.folded: set[str] = set()
        self.faces: dict[tuple[int, str], str] = {}
        self.scheduled = self.ended = False

    def read(self, line: bytes) -> None:
        self.budget.work += WORK_PER_BYTE * len(line)
        value = parse(line)
        demand(not self.ended, "there is something behind the end")
        if not self.header:
            self.start(value)
            return
        kind, *rest = items(value)
        if kind in {"v", "b", "a", "g", "e"}:
            self.proofs.define(kind, *rest)
        elif kind == "l":
            self.proofs.lemma(*rest)
        elif kind in {"r", "d", "q"}:
            demand(self.obligation, "a step outside of a refutation")
            self.step(kind, *rest)
        else:
            demand(not self.obligation, "a refutation that does not end")
            self.budget.keep(len(rest))
            getattr(self, f"on_{kind}")(*rest)

    def start(self, header: Any) -> None:
        demand(type(header) is dict and header.get("format") == FORMAT, f"not a certificate of the format {FORMAT}")
        digests = [text(digest) for digest in header["inputs"].values()]
        demand(header["kind"] in KINDS and all(len(digest) == 64 for digest in digests), "a malformed header")
        self.header, self.plan.epsilon = header, rational(header.get("epsilon", 0))
        for name, *bounds in header.get("parameters", []):
            self.plan.parameters.append(text(name))
            lower, upper = map(optional, bounds)
            self.plan.declared.append((lower, upper))
        for low, low_closed, high, high_closed in header.get("box", []):
            self.box.append((optional(low), low_closed is True, optional(high), high_closed is True))
        demand(len({*self.plan.parameters}) == len(self.plan.parameters), "a parameter twice")
        for name, (low, low_closed, high, high_closed), bounds in zip(
            self.plan.parameters, self.box, self.plan.declared
        ):
            for sign, end, closed, bound in ((1, low, low_closed, bounds[0]), (-1, high, high_closed, bounds[1])):
                for value, strict in ((end, not closed), (bound, False)):
                    known = {name: Fraction(sign), "": -sign * value} if value else {name: Fraction(sign)}
                    self.where.append((known, strict) if value is not None else None)

    # the ground plan

    def on_point(self, name: str) -> None:
        self.plan.points.append(text(name))

    def on_constraint(self, source: int, target: int, *bounds: Any) -> None:
        lower, upper = (None if bound is None else linear(bound) for bound in bounds)
        ends = index(source, self.plan.points), index(target, self.plan.points)
        self.plan.constraints.append((*ends, lower, upper))

    def on_action(self, *parts: Any) -> None:
        name, _, start, end, *_ = parts
        demand(len(parts) == 9 and text(name) not in self.plan.actions, "a malformed action")
        self.plan.actions[name] = list(parts)
        for point, timing in {
            index(end, self.plan.points): "at end",
            index(start, self.plan.points): "at start",
        }.items():
            self.plan.at.setdefault(point, []).append((name, timing))

    def on_initial(self, atoms: Any, fluents: Any) -> None:
        self.plan.atoms, self.plan.fluents = list(map(text, items(atoms))), items(fluents)

    def on_literal(self, point: int, target: str, value: Any) -> None:
        self.plan.literals.append((index(point, self.plan.points), text(target), value))

    def on_goal(self, condition: Any, label: str) -> None:
        self.plan.goals.append((condition, text(label)))

    def on_place(self, point: int, value: Any, number: Any) -> None:
        """Where a time point is: at a variable of its own, or tied to another one by an equality."""
        place = linear(value)
        demand(index(point, self.plan.points) not in self.places, "a time point twice")
        if number is None:
            name = text(value[0][1])
            new = name and name not in self.taken and name not in self.plan.parameters and place == {name: 1}
            demand(new, "a free time point needs a variable of its own")
            self.taken.add(name)
        else:
            source, target, lower, upper = pick(self.plan.constraints, number)
            demand(lower is not None and lower == upper and point in (source, target), "the time points are not tied")
            other, sign = (source, 1) if point == target else (target, -1)
            demand(place == combined(self.places[other], lower, sign), "not where the equality puts the time point")
        self.places[point] = place

    # refutations

    def on_obligation(self, name: str) -> None:
        demand(name not in self.refuted, "an obligation twice")
        self.obligation, self.trusting, self.proofs.clauses = text(name), False, []

    def on_folded(self, name: str) -> None:
        self.folded.add(text(name))

    def step(self, kind: str, *rest: Any) -> None:
        if kind == "r":
            (literal,) = clause = self.proofs.literals([rest[0]])
            self.trusting |= rest[1] == "t"
            demand(rest[1] == "t" or self.same(literal, *self.claimed(*rest[1:])), "not what the plan or the box says")
            self.proofs.clauses.append(clause)
        elif kind == "d":
            self.proofs.derive(*rest)
        else:
            self.proofs.derive([], *rest)
            self.refuted[self.obligation], self.obligation = self.trusting, ""

    def claimed(self, kind: str, number: Any, side: Any = None) -> tuple[Linear, bool]:
        """The inequality `expression >= 0`, or `> 0`, that a root is said to be."""
        if kind == "w":  # the parameter values that the certificate is about
            return pick(self.where, number)
        if kind == "z":  # no time is negative
            return self.places[number], False
        if kind == "n":  # a side of a temporal constraint
            source, target, least = self.plan.edge(number, side)
            return combined(combined(self.places[target], self.places[source], -1), least, -1), False
        demand(kind == "s" and self.obligation in self.plan.separation(number, side), "not about the obligation")
        gap = combined(self.places[number], self.places[side], -1)  # less than epsilon apart
        return combined(gap, {"": self.plan.epsilon}), True

    def same(self, literal: int, expression: Linear, strict: bool) -> bool:
        factors, sharp, bound = self.proofs.constraint(literal)
        found = combined(
            {self.proofs.variables[name]: Fraction(-f) for name, f in factors.items()}, {"": Fraction(bound)}
        )
        name = self.proofs.variables[min(factors)]
        scale = expression.get(name, Fraction(0)) / found[name] if name in found else Fraction(0)
        return scale > 0 and sharp == strict and combined({}, found, scale) == expression

    # schedules and witnesses

    def on_schedule(self, times: Any) -> None:
        """Times as expressions over the parameters keep the network all over the box."""
        places = list(map(linear, items(times)))
        demand(len(places) == len(self.plan.points) and not places[0], "a time is missing, or zero is not at 0")
        bounds = [(0, point, Linear()) for point in range(len(places))]
        bounds += [
            self.plan.edge(number, side)
            for number, (_, _, *sides) in enumerate(self.plan.constraints)
            for side, bound in zip("lu", sides)
            if bound is not None
        ]
        for source, target, least in bounds:
            expression = combined(combined(places[target], places[source], -1), least, -1)
            lowest = expression.pop("", Fraction(0))
            for name, factor in expression.items():
                low, _, high, _ = self.box[self.plan.parameters.index(name)]
                lowest += factor * (low if factor > 0 else high)  # an infinite end is malformed here
            demand(lowest >= 0, "the schedule breaks a constraint of the network somewhere in the box")
        self.scheduled = True

    def face(self, number: Any, side: Any, values: list[Any]) -> list[Near]:
        """The parameter values are beyond the face, arbitrarily near to it, and within the others."""
        numbers = list(map(near, items(values)))
        demand(len(numbers) == len(self.box), "a value is missing")
        for place, (value, (low, low_closed, high, high_closed)) in enumerate(zip(numbers, self.box)):
            for name, end, closed, sign in (("lower", low, low_closed, -1), ("upper", high, high_closed, 1)):
                if end is not None:
                    beyond = (value - Near(end)) * Near(sign)
                    at = not (beyond.terms and beyond.terms[0]) and (beyond.sign > 0 if closed else beyond.sign == 0)
                    within = beyond.sign < 0 or (closed and beyond.sign == 0)
                    demand(at if (place, name) == (number, side) else within, "the witness is not at the face")
        return numbers

    def on_witness(self, number: int, side: str, values: Any, times: Any, what: Any) -> None:
        self.face(number, side, values)
        self.faces[number, side] = Simulation(self.plan, values, items(times), self.budget).breaks(*what)

    def on_cycle(self, number: int, side: str, values: Any, steps: Any) -> None:
        """Lower bounds along a closed walk add up to more than zero."""
        known = dict(zip(self.plan.parameters, self.face(number, side, values)))
        walk = [self.plan.edge(*step) if len(step) == 2 else (0, step[0], Linear()) for step in items(steps)]
        total = Near()
        for (_, target, least), (source, _, _) in zip(walk, walk[1:] + walk[:1]):
            demand(target == source, "the constraints do not form a cycle")
            total += evaluated(least, known)
        demand(total.sign > 0, "the constraints do not contradict each other")
        self.faces[number, side] = "no schedule"

    # what has been established

    def on_end(self) -> None:
        self.ended = True

    def finish(self) -> Iterator[str]:
        demand(self.ended, "the certificate ends early")
        kind = self.header["kind"]
        if kind == "knowledge":
            demand("correct execution" in self.refuted, "the formula of correct executions is not refuted")
            yield "established: the formula of the certificate has no model"
            yield "trusted: that the formula says what a correct execution of the plan is"
            return
        self.budget.spend(len(self.plan.points) ** 2)
        missing = [names for names in self.plan.obligations() if not names & (self.refuted.keys() | self.folded)]
        demand(
            not missing and (self.scheduled or kind == "region"),
            f"no proof of {sorted(missing[0])[0] if missing else 'a schedule'}",
        )
        demand(kind != "plan" or all(low == high is not None for low, _, high, _ in self.box), "expected a point")
        for place, (interval, declared) in enumerate(zip(self.box, self.plan.declared)):
            for name, end, closed, bound in zip(("lower", "upper"), interval[::2], interval[1::2], declared):
                free = kind != "maximal" or end is None or (closed and end == bound) or (place, name) in self.faces
                demand(free, f"no witness for the {name} face of {self.plan.parameters[place]}")
        where = {"plan": "at the nominal values", "region": "in the region"}.get(kind, "everywhere in the box")
        trusting = sum(self.refuted.values())
        if self.scheduled:
            yield f"established: the network has a schedule {where}"
        yield f"established: {len(self.refuted) - trusting} obligations hold {where}, by the ground plan alone"
        yield f"established: the formulas of {trusting} obligations have no model {where}"
        if kind == "maximal":
            yield f"established: no valid box contains this one: {len(self.faces)} faces have a witness, executed here"
        yield f"trusted: that those formulas say what breaks these obligations ({self.header['encoding']} encoding)"
        yield f"trusted: that {len(self.folded)} obligations hold because the encoding's formulas for them are constant"
        yield "trusted: that the ground plan in the certificate is what the input files say"


def check(path: str, files: dict[str, str]) -> list[str]:
    """What the certificate establishes and what remains trusted; raises Rejected or Unreadable."""
    certificate, number = Certificate(), 0
    try:
        for number, line in enumerate(lines_of(path), 1):
            certificate.read(line)
        said = list(certificate.finish())
        inputs = certificate.header["inputs"]
        for name, file in files.items():
            with open(file, "rb") as opened:
                found = hashlib.file_digest(opened, "sha256").hexdigest()
            demand(found == inputs.get(name), f"{file} is not the {name} that the certificate is about")
    except (Rejected, *MALFORMED) as error:
        why = str(error) if isinstance(error, Rejected) else f"malformed ({type(error).__name__})"
        raise Rejected(f"{path}: line {number}: {why}") from None
    except OSError as error:
        raise Unreadable(f"{error.filename}: {error.strerror or error}") from None
    how = {name: "the same" if name in files else "not compared" for name in inputs}
    return [*said, *(f"input: {name}, SHA-256 {inputs[name]}, {how[name]}" for name in inputs)]


def main() -> int:
    reader = argparse.ArgumentParser(description="Check a certificate of robust.")
    reader.add_argument("certificate")
    for name in INPUTS:
        reader.add_argument(f"--{name}", metavar="FILE")
    given = vars(reader.parse_args())
    try:
        lines = check(given.pop("certificate"), {name: file for name, file in given.items() if file is not None})
        code = 0
    except (Rejected, Unreadable) as error:
        code = 1 if isinstance(error, Rejected) else 2
        lines = [f"{'rejected' if code == 1 else 'unreadable'}: {error}"]
    for line in lines:
        print("".join(char if char.isprintable() and char.isascii() else "?" for char in line))
    return code


if __name__ == "__main__":
    sys.exit(main())
