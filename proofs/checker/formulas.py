"""What breaks a plan, as directly as the semantics says it: a circuit over times, parameters and auxiliary values.

A plan is valid for some parameter values if the network has a schedule, and no schedule of the network breaks an
obligation. The state at a moment is what the writes before it left: an atom is true if it was added and not deleted
later (at one time an add wins over a delete), or true at first and never deleted; a fluent is its last assignment, or
its initial value, and all increases and continuous changes since then. Moments are ("before", point), ("after", point),
("instant", name) for an instant inside an action, and ("final", None).
"""

from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction
from functools import cache, partial
from itertools import combinations
from math import gcd, lcm
from typing import Any

from .reader import Duty, Effect, Ground, Linear, Tree, constant, decided, need

Moment = tuple[str, Any]
Node = tuple[Any, ...]
Obligation = tuple[str, Callable[[], int]]
TRUE, FALSE = 1, -1
NUMERIC = {"assign", "increase"}
PRODUCT = "found a product of two things that are not constant"
LARGEST, TOO_LONG = 1 << 20_000, "found numbers of more than 6,000 digits"


def add(total: Linear, right: Linear, factor: Fraction | int = 1) -> None:
    """Make `total` what `total + factor * right` is."""
    for name, term in right.items():
        value = term if factor == 1 else factor * term
        if name in total:
            value = total[name] + value
            need(value.denominator < LARGEST, TOO_LONG)
        if value:
            total[name] = value
        else:
            total.pop(name, None)


def plus(left: Linear, right: Linear, factor: Fraction | int = 1) -> Linear:
    """`left + factor * right`."""
    total = dict(left)
    add(total, right, factor)
    return total


def replaced(expression: Linear, given: Mapping[str, Linear]) -> Linear:
    """The expression with expressions for some of its names."""
    total: Linear = {}
    for name, factor in expression.items():
        add(total, given.get(name, {name: Fraction(1)}), factor)
    return total


class Circuit:
    """Literals are numbers, negative if negated; 1 is true.

    A node is a conjunction of literals, or (strict, terms): that a linear form with coprime integers as coefficients,
    the first of them positive, is at least 0, or more than 0.
    """

    def __init__(self) -> None:
        self.nodes: list[Node] = [(0,), ()]
        self.numbers: dict[Node, int] = {(): TRUE}

    def add(self, node: Node) -> int:
        if node not in self.numbers:
            self.numbers[node] = len(self.nodes)
            self.nodes.append(node)
        return self.numbers[node]

    def all(self, literals: Iterator[int] | list[int]) -> int:
        inputs = set(literals) - {TRUE}
        if any(-each in inputs for each in inputs) or FALSE in inputs:
            return FALSE
        return inputs.pop() if len(inputs) == 1 else self.add(tuple(sorted(inputs)))

    def any(self, literals: Iterator[int] | list[int]) -> int:
        return -self.all([-each for each in literals])

    def compare(self, expression: Linear, strict: bool = False) -> int:
        """`expression >= 0`, or `> 0`."""
        names = sorted(name for name in expression if name)
        if not names:
            value = expression.get("", Fraction(0))
            return TRUE if value > 0 or (value == 0 and not strict) else FALSE
        scale = lcm(*(value.denominator for value in expression.values()))
        whole = {name: int(value * scale) for name, value in expression.items()}
        divisor = gcd(*whole.values()) * (1 if whole[names[0]] > 0 else -1)
        node = tuple((name, whole[name] // divisor) for name in [*names, ""] if name in whole)
        return self.add((strict, node)) if divisor > 0 else -self.add((not strict, node))

    def equal(self, expression: Linear) -> int:
        return self.all([self.compare(expression), self.compare(plus({}, expression, -1))])

    def is_gate(self, number: int) -> bool:
        return not self.nodes[number] or type(self.nodes[number][0]) is int

    def said(self, literal: int) -> tuple[dict[str, int], bool]:
        """What the literal of a comparison says: `form >= 0`, or `> 0`."""
        strict, terms = self.nodes[abs(literal)]
        return (dict(terms), strict) if literal > 0 else ({name: -value for name, value in terms}, not strict)


class Formulas:
    """The formulas of one plan. `given` are expressions for parameters and points (`@3`), where they are not free."""

    def __init__(self, ground: Ground, epsilon: Fraction, given: Mapping[str, Linear] | None = None) -> None:
        self.ground, self.epsilon, self.circuit, self.given = ground, epsilon, Circuit(), given or {}
        self.known: dict[tuple[int, int], Fraction] = {}  # (a, b): t_b - t_a is at least that, as has been proved
        self.definitions: dict[str, list[int]] = {}  # auxiliary value: the literals that define it
        self.instants: dict[str, tuple[int, int]] = {}  # instants inside actions, with the ends of the actions
        self.states: dict[tuple[str, Moment], Any] = {}  # of atoms and fluents; None while they are looked for
        self.writes, self.flows = dict[str, list[tuple[int, Effect]]](), dict[str, list[tuple[int, int, Tree]]]()
        for point, effects in enumerate(ground.effects):
            for effect in effects:
                self.writes.setdefault(effect.target, []).append((point, effect))
        for start, end, fluent, rate in ground.flows:
            self.flows.setdefault(fluent, []).append((start, end, rate))
        points = {f"@{point}": point for point in range(1, len(ground.points))}
        self.ties: dict[int, Linear] = {
            0: {},
            **{points[name]: self.given[name] for name in points if name in self.given},
        }
        if len(self.ties) < len(ground.points):
            self.tie()

    # -- time ----------------------------------------------------------------------------------------------------------

    def tie(self) -> None:
        """Time points at a fixed distance, by the network, from others: expressions over the others."""
        edges = {(a, b, frozenset(w.items())) for a, b, w in self.ground.edges}
        tied: dict[int, list[tuple[int, Linear]]] = {}
        for a, b, w in self.ground.edges:
            back = plus({}, w, -1)
            if (b, a, frozenset(back.items())) in edges:  # which comes by itself
                tied.setdefault(a, []).append((b, w))
        for root in range(len(self.ground.points)):
            self.ties.setdefault(root, {f"@{root}": Fraction(1)})
            queue = [root]
            for point in queue:
                for other, w in tied.get(point, ()):
                    if other not in self.ties:
                        self.ties[other] = plus(self.ties[point], w)
                        queue.append(other)

    def free(self) -> list[str]:
        """The time points that others are tied to."""
        return [f"@{point}" for point, tie in sorted(self.ties.items()) if tie == {f"@{point}": Fraction(1)}]

    def at(self, moment: Moment) -> Linear:
        kind, where = moment
        return self.ties[where] if kind != "instant" else replaced({where: Fraction(1)}, self.given)

    def gap(self, a: int, b: int) -> Linear:
        """t_b - t_a."""
        return plus(self.ties[b], self.ties[a], -1)

    def slack(self, edge: tuple[int, int, Linear]) -> Linear:
        """What a constraint of the network says is not negative."""
        a, b, w = edge
        return plus(self.gap(a, b), replaced(w, self.given), -1)

    def earlier(self, a: int, b: int, strict: bool = True) -> int:
        """t_a < t_b, or <=."""
        forward, back = self.known.get((a, b)), self.known.get((b, a))
        if forward is not None and (forward > 0 or (forward == 0 and not strict)):
            return TRUE
        if back is not None and (back > 0 or (back == 0 and strict)):
            return FALSE
        return self.circuit.compare(self.gap(a, b), strict)

    def passed(self, point: int, moment: Moment) -> int:
        """Whether a time point is over at a moment."""
        kind, where = moment
        if kind == "final":
            return TRUE
        if kind != "instant":
            return self.earlier(point, where, kind == "before")
        start, end = self.instants[where]
        if self.earlier(point, start, False) == TRUE:
            return TRUE
        if self.earlier(end, point, False) == TRUE:
            return FALSE
        return self.circuit.compare(plus(self.at(moment), self.ties[point], -1), True)

    # -- state ---------------------------------------------------------------------------------------------------------

    def happened(self, target: str, kind: str, moment: Moment) -> Iterator[tuple[int, Effect, int]]:
        """The changes of a kind that may have happened, and whether they have."""
        for point, effect in self.writes.get(target, ()):
            done = self.passed(point, moment) if effect.kind == kind else FALSE
            if done != FALSE and effect.when is not True:
                done = self.circuit.all([done, self.truth(effect.when, ("before", point), effect.owner)])
            if done != FALSE:
                yield point, effect, done

    def state(self, name: str, moment: Moment, find: Callable[[str, Moment], Any]) -> Any:
        if (name, moment) not in self.states:
            self.states[name, moment] = None
            self.states[name, moment] = find(name, moment)
        need(self.states[name, moment] is not None, f"{name} depends on itself")
        return self.states[name, moment]

    def holds(self, atom: str, moment: Moment) -> int:
        deletes = [*self.happened(atom, "delete", moment)]
        cases = [-self.circuit.any([gone for *_, gone in deletes])] if self.ground.model.initial.get(atom) else []
        for point, _, added in self.happened(atom, "add", moment):
            kept = [-self.circuit.all([gone, self.earlier(point, other)]) for other, _, gone in deletes]
            cases.append(self.circuit.all([added, *kept]))
        return self.circuit.any(cases)

    def choice(self, cases: list[tuple[int, Linear]]) -> Linear:
        """The value of the first case whose condition is true; that of the last one is."""
        cases = [case for case in cases if case[0] != FALSE]
        value = cases[-1][1]
        for condition, other in reversed(cases[:-1]):
            if condition == TRUE or value == other:
                value = other
                continue
            name = f"={len(self.definitions)}"
            yes, no = (self.circuit.equal(plus({name: Fraction(1)}, each, -1)) for each in (other, value))
            self.definitions[name] = [self.circuit.any([-condition, yes]), self.circuit.any([condition, no])]
            value = {name: Fraction(1)}
        return value

    def level(self, fluent: str, moment: Moment) -> Linear:
        """The value of a fluent at a moment."""
        begins = self.initially(fluent)
        assigned = [*self.happened(fluent, "assign", moment)]
        cases: list[tuple[int, Linear]] = []
        for rank, (point, effect, done) in enumerate(assigned):
            others = [(r, other, was) for r, (other, _, was) in enumerate(assigned) if r != rank]
            later = [self.circuit.all([was, self.earlier(point, other, r < rank)]) for r, other, was in others]
            last = self.circuit.all([done, *(-each for each in later)])
            if last != FALSE:
                value = self.expression(effect.amount, ("before", point), effect.owner)
                cases.append((last, plus(value, self.change(fluent, point, moment))))
        if cases and any(done == TRUE for *_, done in assigned):
            cases[-1] = (TRUE, cases[-1][1])
        else:
            cases.append((TRUE, plus(begins, self.change(fluent, None, moment))))
        return self.choice(cases)

    def initially(self, fluent: str) -> Linear:
        value, name = self.ground.model.initial.get(fluent), self.ground.varied.get(("fluent", fluent))
        need(type(value) is Fraction, f"{fluent} has no initial value")
        return replaced({name: Fraction(1)}, self.given) if name else constant(Fraction(value or 0))

    def change(self, fluent: str, since: int | None, moment: Moment) -> Linear:
        """What increases and continuous effects add, since the beginning or since an assignment."""
        total: Linear = {}
        for point, effect, done in self.happened(fluent, "increase", moment):
            counts = done if since is None else self.circuit.all([done, self.earlier(since, point, False)])
            if counts != FALSE:
                amount = self.expression(effect.amount, ("before", point), effect.owner)
                total = plus(total, self.choice([(counts, amount), (TRUE, {})]))
        for start, end, rate in self.flows.get(fluent, ()):
            total = plus(total, self.flowed(start, end, rate, moment))
            if since is not None:
                total = plus(total, self.flowed(start, end, rate, ("before", since)), -1)
        return total

    def flowed(self, start: int, end: int, rate: Tree, moment: Moment) -> Linear:
        """What a continuous effect has added: the rate times how long it has acted."""
        for name in names_in(rate):
            need(name not in self.writes and name not in self.flows, "the rate of a continuous effect changes")
        slope = self.expression(rate, ("before", start), (start, end))
        ended, started = self.passed(end, moment), self.passed(start, moment)
        cases = [(ended, multiplied(slope, self.gap(start, end)))] if ended != FALSE else []
        if ended != TRUE and started != FALSE:
            cases.append((started, multiplied(slope, plus(self.at(moment), self.ties[start], -1))))
        return self.choice([*cases, (TRUE, {})])

    # -- expressions and conditions ------------------------------------------------------------------------------------

    def expression(self, tree: Tree, moment: Moment, owner: tuple[int, int] | None) -> Linear:
        kind, *rest = tree
        if kind == "number":
            return constant(rest[0])
        if kind == "parameter":
            return replaced({rest[0]: Fraction(1)}, self.given)
        if kind == "duration" and owner is not None:
            return self.gap(*owner)
        if kind == "fluent":
            return dict(self.state(rest[0], moment, self.level))
        total, *parts = [self.expression(each, moment, owner) for each in rest]
        if kind == "-" and not parts:
            return plus({}, total, -1)
        for part in parts:
            if kind in ("+", "-"):
                total = plus(total, part, 1 if kind == "+" else -1)
            elif kind == "*":
                total = multiplied(total, part)
            else:
                need(part.keys() == {""}, "found a division by something that is not constant, or by zero")
                total = {name: value / part[""] for name, value in total.items()}
        return total

    def truth(self, tree: Tree, moment: Moment, owner: tuple[int, int] | None) -> int:
        if type(tree) is bool:
            return TRUE if tree else FALSE
        kind, *rest = tree
        if kind == "atom":
            return int(self.state(rest[0], moment, self.holds))
        if kind == "not":
            return -self.truth(rest[0], moment, owner)
        if kind in ("and", "or"):
            join = self.circuit.all if kind == "and" else self.circuit.any
            return join([self.truth(each, moment, owner) for each in rest])
        left, right = (self.expression(each, moment, owner) for each in rest)
        if kind == "=":
            return self.circuit.equal(plus(left, right, -1))
        least = plus(left, right, -1) if kind[0] == ">" else plus(right, left, -1)
        return self.circuit.compare(least, len(kind) == 1)

    # -- obligations ---------------------------------------------------------------------------------------------------

    def obligations(self) -> list[Obligation]:
        """Each obligation, with the literal of what breaks it: durations, conditions, goal, separations, conflicts."""
        names, duties, apart = self.ground.points, self.ground.duties, mutex(self.ground)
        found: list[Obligation] = [(each.label, partial(self.broken, f"!{i}", each)) for i, each in enumerate(duties)]
        found += [(f"separation: {names[a]}, {names[b]}", partial(self.separation, a, b)) for a, b in apart]
        for point, effects in enumerate(self.ground.effects):
            for one, other in combinations([each for each in effects if each.kind in NUMERIC], 2):
                if one.target == other.target and "assign" in (one.kind, other.kind):
                    need(not decided(one.when) is decided(other.when) is True, f"found two effects on {one.target}")
                    found.append((f"effects of {names[point]} agree", partial(self.conflict, point, one, other)))
        return found

    def separation(self, a: int, b: int) -> int:
        """Less than epsilon apart, or at one time."""
        if any((least := self.known.get(pair, -1)) >= self.epsilon and least > 0 for pair in ((a, b), (b, a))):
            return FALSE
        bound = constant(self.epsilon)
        sides = (plus(bound, self.gap(a, b), sign) for sign in (1, -1))
        return self.circuit.all([self.circuit.compare(side, self.epsilon > 0) for side in sides])

    def conflict(self, point: int, *effects: Effect) -> int:
        """All of them happen."""
        return self.circuit.all([self.truth(each.when, ("before", point), each.owner) for each in effects])

    def evaluate(self) -> None:
        """All effects have a meaning, also where nothing reads what they change."""
        changes = [each for writes in self.writes.values() for each in writes]
        changes += [(a, Effect("increase", fluent, rate, True, (a, b))) for a, b, fluent, rate in self.ground.flows]
        for point, effect in changes:
            self.truth(effect.when, ("before", point), effect.owner)
            if effect.kind in NUMERIC:
                self.initially(effect.target)
                self.expression(effect.amount, ("before", point), effect.owner)

    def broken(self, instant: str, duty: Duty) -> int:
        if duty.first is None or duty.last is None:
            moment = ("final", None) if duty.first is None else ("before", duty.first)
            return -self.truth(duty.condition, moment, duty.owner)
        return self.circuit.any(list(self.broken_inside(instant, duty.condition, duty.first, duty.last)))

    def broken_inside(self, instant: str, condition: Tree, start: int, end: int) -> Iterator[int]:
        """False right after a happening inside, or before any happening or at any instant inside."""
        names = set(names_in(condition))
        if any(name in self.flows for name in names):
            self.instants[instant] = start, end
            time = self.at(("instant", instant))
            sides = (plus(time, self.ties[start], -1), plus(self.ties[end], time, -1))
            inside = [self.circuit.compare(side, True) for side in sides]
            yield self.circuit.all([*inside, -self.truth(condition, ("instant", instant), (start, end))])
        else:
            order = self.earlier(start, end)
            yield self.circuit.all([order, -self.truth(condition, ("after", start), (start, end))])
        for point in sorted({point for name in names for point, _ in self.writes.get(name, ())}):
            inside = [self.earlier(start, point), self.earlier(point, end)]
            if FALSE not in inside:
                yield self.circuit.all([*inside, -self.truth(condition, ("after", point), (start, end))])

    def roots(self, literal: int) -> list[int]:
        """The literal, and the definitions of all auxiliary values that it depends on."""
        found, seen, names, queue = [literal], set[int](), set[str](), [abs(literal)]
        while queue:
            number = queue.pop()
            if number not in seen:
                seen.add(number)
                below = [*self.circuit.nodes[number]]
                if not self.circuit.is_gate(number):
                    new = {name: None for name, _ in below[1] if name in self.definitions and name not in names}
                    names.update(new)
                    below = [each for name in new for each in self.definitions[name]]
                    found += below
                queue += map(abs, below)
        return found


def multiplied(left: Linear, right: Linear) -> Linear:
    if left.keys() <= {""}:
        left, right = right, left
    need(right.keys() <= {""}, PRODUCT)
    numbers = [part for value in (*left.values(), *right.values()) for part in value.as_integer_ratio()]
    need(all(abs(part) < LARGEST for part in numbers), TOO_LONG)
    return {name: value * right[""] for name, value in left.items()} if right else {}


def names_in(tree: Tree) -> Iterator[str]:
    """The atoms and fluents that a condition or an expression mentions."""
    if type(tree) is tuple:
        if tree[0] in ("atom", "fluent"):
            yield tree[1]
        elif tree[0] not in ("number", "parameter"):
            for each in tree[1:]:
                yield from names_in(each)


HARM = {"add": ["read", "delete"], "delete": ["read"], "assign": ["read", "assign", "increase"], "increase": ["read"]}


@cache
def mutex(ground: Ground) -> list[tuple[int, int]]:
    """The pairs of time points that must be apart: no moving targets [PDDL 2.1]. What a text mentions, it reads."""
    changes = [(point, effect) for point, effects in enumerate(ground.effects) for effect in effects]
    flows = ((point, flow) for flow in ground.flows for point in flow[:2])
    changes += [(point, Effect("increase", fluent, rate, True, None)) for point, (*_, fluent, rate) in flows]
    reads = [(duty.first, duty.condition) for duty in ground.duties if duty.first is not None and duty.last is None]
    reads += [(point, ("", effect.amount, effect.when)) for point, effect in changes]
    done = [(name, point, "read") for point, trees in reads for name in names_in(trees)]
    done += [(effect.target, point, effect.kind) for point, effect in changes]
    does: dict[tuple[str, str], set[int]] = {}
    for name, point, kind in done:
        does.setdefault((name, kind), set()).add(point)
    harms = [(does[key], does.get((key[0], other), ())) for key in does for other in HARM.get(key[1], ())]
    pairs = {(min(a, b), max(a, b)) for some, others in harms for a in some for b in others if a != b}
    return sorted(pair for pair in pairs if not ground.timed.issuperset(pair))
