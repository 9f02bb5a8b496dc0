"""What a certificate may say, and why it is believed: a tape of hints that the checker asks for, line by line.

The tape names no formula: the checker makes each one itself and pulls what is hard to find, in its own order. Linear
facts follow from others by adding multiples of them [Farkas 1902]; a formula is refuted by clauses, each of which is
such a sum, or follows from earlier ones by unit propagation along hints. Nothing is named twice, skipped or left over.
"""

import json
import re
from collections.abc import Iterable
from fractions import Fraction
from typing import Any

from .formulas import FALSE, Formulas, add, plus, replaced
from .reader import Fact, Linear, constant

RATIONAL = re.compile("-?[1-9][0-9]{0,999}(?:/[1-9][0-9]{0,999})?|0")


class Rejected(Exception):
    """The certificate does not establish its claim."""


def demand(condition: object, message: str) -> None:
    if not condition:
        raise Rejected(message)


def whole(value: Any, below: int | None = None) -> int:
    demand(type(value) is int and (below is None or 0 <= value < below), "expected the number of something")
    return int(value)


def listed(value: Any, size: int | None = None) -> list[Any]:
    demand(type(value) is list and (size is None or len(value) == size), "expected a list of another length")
    return list(value)


def rational(value: Any) -> Fraction:
    demand(type(value) is str and RATIONAL.fullmatch(value), "expected a rational number as text")
    found = Fraction(value)
    demand(str(found) == value, "expected a rational number in lowest terms")
    return found


def linear(value: Any, names: Iterable[str]) -> Linear:
    """Pairs of name and coefficient, each name once."""
    terms = [listed(each, 2) for each in listed(value)]
    found = {name: rational(factor) for name, factor in terms}
    demand(len(found) == len(terms) and found.keys() <= {"", *names} and all(found.values()), "found a malformed sum")
    return found


def sides(value: Any, names: Iterable[str]) -> list[Fact]:
    """Pairs of a linear form and whether it is more than zero, rather than at least."""
    facts = [listed(each, 2) for each in listed(value)]
    demand(all(type(strict) is bool for _, strict in facts), "expected true or false")
    return [(linear(form, names), strict) for form, strict in facts]


class Tape:
    """The certificate's lines, each read once, in the order in which the checker asks for them."""

    def __init__(self, lines: Iterable[str]) -> None:
        self.lines = iter(lines)

    def next(self, *kinds: str) -> list[Any]:
        """The rest of the next line, which is of one of these kinds; the kind comes first if there are several."""
        line = next(self.lines, None)
        demand(line is not None, f"the certificate ends where {' or '.join(kinds)} is expected")
        found = listed(json.loads(line or "", parse_float=str, parse_constant=str))
        demand(found and type(found[0]) is str and found[0] in kinds, f"expected {' or '.join(kinds)}")
        return found[1:] if len(kinds) == 1 else found

    def finish(self) -> None:
        demand(next(self.lines, None) is None, "something is left over at the end of the certificate")


class Facts:
    """What is known: first of the parameters, then what the network says of the times."""

    def __init__(self, region: list[Fact], formulas: Formulas | None = None) -> None:
        self.known = list(region)
        self.of_parameters = len(region)
        if formulas is not None:
            self.known += [(formulas.slack(edge), False) for edge in formulas.ground.edges]

    def add(self, total: Linear, multiples: Any, below: int) -> tuple[Linear, bool]:
        """The sum, which is changed, and positive multiples of facts, and whether one of these is strict."""
        strict = False
        demand(len(listed(multiples)) <= below, "expected one multiple of each fact")
        for number, factor in (listed(each, 2) for each in multiples):
            fact = self.known[whole(number, below)]
            size = factor if type(factor) is int else rational(factor)
            demand(size > 0 and (type(factor) is int or size.denominator > 1), "expected a multiple above zero")
            add(total, fact[0], size)
            strict = strict or fact[1]
        return total, strict

    def imply(self, expression: Linear, multiples: Any, strictly: bool = False) -> None:
        """`expression >= 0`, or `> 0`, by what is known of the parameters."""
        total, strict = self.add({}, multiples, self.of_parameters)
        rest = plus(expression, total, -1)
        value = rest.pop("", Fraction(0))
        demand(not rest and (value > 0 or (value == 0 and (strict or not strictly))), "the multiples do not add up")


def way(edges: list[tuple[int, int, Linear]], steps: Any, most: int) -> tuple[int | None, int | None, Linear]:
    """From where to where some constraints lead, one after the other, and how long that takes at least."""
    start, place, total = None, None, Linear()
    demand(len(listed(steps)) <= most, "found more constraints than time points")
    for step in steps:
        source, target, length = edges[whole(step, len(edges))]
        demand(place in (None, source), "the constraints do not form a path")
        start, place = source if start is None else start, target
        add(total, length)
    return start, place, total


def orders(tape: Tape, formulas: Formulas, facts: Facts) -> None:
    """Order lemmas: t_b - t_a is at least a number, by constraints of the network, or earlier lemmas, from a to b."""
    edges, points = [*formulas.ground.edges], len(formulas.ground.points)
    for a, b, path, text, multiples in (listed(each, 5) for each in tape.next("orders")):
        start, end, total = way(edges, path, points - 1)
        bound = rational(text)
        demand((start, end) == (whole(a), whole(b)) and a != b, "a path from or to elsewhere")
        demand((a, b) not in formulas.known, "an order twice")
        facts.imply(plus(total, constant(bound), -1), multiples)
        formulas.known[a, b] = bound
        edges.append((a, b, constant(bound)))


def schedule(tape: Tape, formulas: Formulas, facts: Facts) -> None:
    """Times, linear in the parameters, of the free time points, such that the whole network is kept."""
    free = formulas.free()
    texts = listed(tape.next("schedule"), len(free))
    times = {point: linear(text, formulas.ground.parameters) for point, text in zip(free, texts)}
    proofs = listed(tape.next("kept"), len(formulas.ground.edges))
    for edge, multiples in zip(formulas.ground.edges, proofs):
        facts.imply(replaced(formulas.slack(edge), times), multiples)


def refute(tape: Tape, formulas: Formulas, facts: Facts, literal: int, also: Iterable[int] = ()) -> None:
    """The literal, with what it depends on, contradicts what is known, and the other literals."""
    circuit = formulas.circuit
    clauses: list[tuple[int, ...]] = [(root,) for root in [*formulas.roots(literal), *also]]
    steps = tape.next("refute")
    for step in steps:
        literals, *proof = listed(step)
        clause = tuple(whole(each) for each in listed(literals))
        demand(len(clause) < 2 * len(circuit.nodes), "a literal twice")
        demand(all(0 < abs(each) < len(circuit.nodes) for each in clause), "no such literal")
        if len(proof) == 2:
            lemma(formulas, facts, clause, *proof)
        else:
            demand(len(proof) == 1, "neither a lemma nor a clause")
            false = set(clause)
            demand(len(listed(proof[0])) <= len(circuit.nodes), "a hint twice")
            *hints, last = [hinted(formulas, clauses, hint) for hint in proof[0]]
            for hint in hints:
                rest = {each for each in hint if each not in false}
                demand(len(rest) == 1, "not a unit clause, or a hint after the conflict")
                false.update(-each for each in rest)
            demand(all(each in false for each in last), "the hints lead to no conflict")
        clauses.append(clause)
    demand(clauses[-1] == () and steps, "no contradiction at the end")


def lemma(formulas: Formulas, facts: Facts, clause: tuple[int, ...], multipliers: Any, multiples: Any) -> None:
    """Not all literals are false: positive multiples of their negations and of facts add up to a contradiction."""
    total, strict = Linear(), False
    for literal, factor in zip(clause, listed(multipliers, len(clause))):
        demand(not formulas.circuit.is_gate(abs(literal)) and whole(factor) > 0, "no comparison, or a multiple below 1")
        form, more = formulas.circuit.said(-literal)
        add(total, {name: Fraction(value) for name, value in form.items()}, factor)
        strict = strict or more
    total, more = facts.add(total, multiples, len(facts.known))
    value = total.pop("", Fraction(0))
    demand(not total and (value < 0 or (value == 0 and (strict or more))), "the multiples do not add up")


def hinted(formulas: Formulas, clauses: list[tuple[int, ...]], hint: Any) -> tuple[int, ...]:
    """An earlier clause, or one that defines a gate: 0 for `gate, or not all inputs`, then one for each input."""
    if type(hint) is int:
        return clauses[whole(hint, len(clauses))]
    gate, which = listed(hint, 2)
    demand(whole(gate, len(formulas.circuit.nodes)) > 0 and formulas.circuit.is_gate(gate), "no such gate")
    inputs = formulas.circuit.nodes[gate]
    whole(which, len(inputs) + 1)
    return (-gate, inputs[which - 1]) if which else (gate, *(-each for each in inputs))


def all_hold(tape: Tape, formulas: Formulas, facts: Facts, also: Iterable[int] = ()) -> tuple[int, int]:
    """No obligation can break: how many there are, and how many of them are not constant by what is known."""
    obligations = formulas.obligations()
    asked = 0
    for label, broken in obligations:
        literal = broken()
        if literal != FALSE:
            asked += 1
            try:
                refute(tape, formulas, facts, literal, also)
            except Rejected as error:
                raise Rejected(f"{label}: {error}") from None
    formulas.evaluate()
    return len(obligations), asked
