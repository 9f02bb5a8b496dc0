"""Affine maps from polyhedra of parameter values to schedules, and the multipliers that show that they are right."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from math import lcm

from robust.certify.linear import Constraint, contradiction
from robust.encode.variables import Auxiliary, Linear, constant, variable
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Session, Verdict
from robust.smt.terms import Formula, Terms

Form = Mapping[str, Fraction]
"""Coefficients by name, that of `""` is the constant."""

Half = tuple[Form, bool]
"""`form ≥ 0`, or `> 0`."""


def form_of(expression: Linear) -> dict[str, Fraction]:
    """A polynomial by the names of its unknowns."""
    form = {str(unknown): factor for unknown, factor in expression.coefficients()}
    return {**form, "": expression.constant_term} if expression.constant_term else form


def combined(left: Form, right: Form, factor: Fraction | int = 1) -> dict[str, Fraction]:
    """`left + factor · right`."""
    total = dict(left)
    for name, value in right.items():
        total[name] = total.get(name, Fraction(0)) + factor * value
    return {name: value for name, value in total.items() if value}


def substituted(form: Form, values: Mapping[str, Form]) -> dict[str, Fraction]:
    """A form with forms for some of its names."""
    total: dict[str, Fraction] = {}
    for name, factor in form.items():
        total = combined(total, values.get(name, {name: Fraction(1)}), factor)
    return total


def section(
    unknowns: Sequence[str],
    parameters: Sequence[str],
    where: Sequence[Half],
    required: Iterable[Half],
    *,
    solver: str,
    deadline: Deadline,
) -> dict[str, dict[str, Fraction]] | None:
    """Each unknown as an affine function of the parameters, such that what is required holds all over a polyhedron.

    By Farkas' lemma a required form is a sum of multiples of the polyhedron's sides and of something that is not
    negative; for fixed sides that is linear in the multipliers and in the coefficients of the functions.

    Returns:
        The functions; None if there are none, although each point may have values of its own.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    terms = Terms()
    columns = ("", *parameters)
    numbers = {(name, column): index for index, (name, column) in enumerate((n, c) for n in unknowns for c in columns)}
    sought = {key: variable(Auxiliary("coefficient", index)) for key, index in numbers.items()}
    conditions: list[Formula] = []
    count = 0
    for form, strict in dict.fromkeys((tuple(form.items()), strict) for form, strict in required):
        rest = {column: constant(0) for column in columns}
        for name, factor in form:
            if name in rest:
                rest[name] += factor
            else:
                for column in columns:
                    rest[column] += sought[name, column].scaled(factor)
        multipliers = []
        for side, _ in where:
            multiplier = variable(Auxiliary("multiplier", count))
            count += 1
            multipliers.append(multiplier)
            for name, factor in side.items():
                rest[name] -= multiplier.scaled(factor)
        if strict:
            sharpness = sum((m for m, (_, sharp) in zip(multipliers, where, strict=True) if sharp), rest[""])
            conditions.append(terms.greater(sharpness))
        conditions += [terms.at_least(each) for each in (rest[""], *multipliers)]
        conditions += [terms.equal(rest[column]) for column in parameters]
    session = Session(terms, solver=solver)
    session.add_all(conditions, deadline)
    verdict = session.check("a schedule that is affine on a polyhedron", deadline)
    if verdict is Verdict.UNKNOWN:
        raise OutOfTimeError
    if verdict is Verdict.UNSATISFIABLE:
        return None
    values = session.values([terms.real(each) for term in sought.values() for each in term.variables])
    found: dict[str, dict[str, Fraction]] = {name: {} for name in unknowns}
    for (name, column), term in sought.items():
        value = Fraction(values.get(str(next(iter(term.variables))), 0))
        if value:
            found[name][column] = value
    return found


def multiples(where: Sequence[Half], form: Form) -> list[tuple[int, Fraction]]:
    """Positive multiples of the sides of a polyhedron, by number, that leave something not negative of a form.

    Raises:
        ValueError: if the form is negative somewhere in the polyhedron, or the polyhedron is empty.
    """
    if not form.keys() - {""} and form.get("", 0) >= 0:
        return []
    negated, scale = _constraint(combined({}, form, -1), True)
    sides = [_constraint(side, sharp) for side, sharp in where]
    found = contradiction([negated, *(each for each, _ in sides)])
    if found is None or 0 not in found.indices:
        raise ValueError(f"{dict(form)} is negative somewhere")
    weights = dict(zip(found.indices, found.multipliers, strict=True))
    unit = weights.pop(0) * scale
    return [(index - 1, weight * sides[index - 1][1] / Fraction(unit)) for index, weight in weights.items()]


def _constraint(form: Form, strict: bool) -> tuple[Constraint, int]:
    """`form ≥ 0` times a number, as integers, and that number."""
    scale = lcm(*(factor.denominator for factor in form.values()))
    factors = tuple((name, int(-factor * scale)) for name, factor in form.items() if name)
    return Constraint(factors, strict, int(form.get("", Fraction(0)) * scale)), scale
