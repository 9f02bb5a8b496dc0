"""SMT-LIB 2 terms and commands as text: small functions, so that theorem modules read like formulas."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import TypeAlias

Term: TypeAlias = str
"""A term of SMT-LIB 2."""
Command: TypeAlias = str
"""A declaration or definition of SMT-LIB 2."""

TRUE: Term = "true"
FALSE: Term = "false"


def apply(function: str, *arguments: Term) -> Term:
    """An application; of a constant, the constant."""
    return f"({function} {' '.join(arguments)})" if arguments else function


def conj(*terms: Term) -> Term:
    """All of them; of none, true."""
    return _fold("and", terms, TRUE)


def disj(*terms: Term) -> Term:
    """One of them at least; of none, false."""
    return _fold("or", terms, FALSE)


def all_of(terms: Iterable[Term]) -> Term:
    return conj(*terms)


def any_of(terms: Iterable[Term]) -> Term:
    return disj(*terms)


def neg(term: Term) -> Term:
    return apply("not", term)


def implies(premise: Term, conclusion: Term) -> Term:
    return apply("=>", premise, conclusion)


def iff(left: Term, right: Term) -> Term:
    return apply("=", left, right)


def eq(left: Term, right: Term) -> Term:
    return apply("=", left, right)


def distinct(*terms: Term) -> Term:
    return apply("distinct", *terms)


def ite(condition: Term, then: Term, otherwise: Term) -> Term:
    return apply("ite", condition, then, otherwise)


def lt(*terms: Term) -> Term:
    return apply("<", *terms)


def le(*terms: Term) -> Term:
    return apply("<=", *terms)


def plus(*terms: Term) -> Term:
    return _fold("+", terms, num(0))


def minus(left: Term, right: Term) -> Term:
    return apply("-", left, right)


def times(left: Term, right: Term) -> Term:
    return apply("*", left, right)


def num(value: Fraction | int | str) -> Term:
    """A real number, exactly."""
    fraction = Fraction(value)
    whole = f"{abs(fraction.numerator)}.0"
    text = whole if fraction.denominator == 1 else f"(/ {whole} {fraction.denominator}.0)"
    return f"(- {text})" if fraction < 0 else text


def integer(value: int) -> Term:
    return str(value) if value >= 0 else f"(- {-value})"


def least(first: Term, *others: Term) -> Term:
    """The minimum of numbers that are cheap to repeat."""
    result = first
    for other in others:
        result = ite(le(result, other), result, other)
    return result


def exactly_one(terms: Sequence[Term]) -> Term:
    pairs = [neg(conj(a, b)) for index, a in enumerate(terms) for b in terms[index + 1 :]]
    return conj(disj(*terms), *pairs)


def forall(variables: dict[str, str], body: Term) -> Term:
    """Universal quantification; `variables` maps names to sorts."""
    return _quantified("forall", variables, body)


def exists(variables: dict[str, str], body: Term) -> Term:
    return _quantified("exists", variables, body)


def sort(name: str) -> Command:
    """An arbitrary non-empty set."""
    return f"(declare-sort {name} 0)"


def const(name: str, kind: str) -> Command:
    return f"(declare-const {name} {kind})"


def consts(kind: str, *names: str) -> tuple[Command, ...]:
    return tuple(const(name, kind) for name in names)


def function(name: str, arguments: Sequence[str], kind: str) -> Command:
    return f"(declare-fun {name} ({' '.join(arguments)}) {kind})"


def define(name: str, variables: dict[str, str], kind: str, body: Term) -> Command:
    """A definition; `variables` maps parameter names to sorts."""
    return f"(define-fun {name} ({_bindings(variables)}) {kind}\n  {body})"


def _fold(operator: str, terms: Sequence[Term], neutral: Term) -> Term:
    match len(terms):
        case 0:
            return neutral
        case 1:
            return terms[0]
        case _:
            return apply(operator, *terms)


def _quantified(quantifier: str, variables: dict[str, str], body: Term) -> Term:
    return f"({quantifier} ({_bindings(variables)}) {body})"


def _bindings(variables: dict[str, str]) -> str:
    return " ".join(f"({name} {kind})" for name, kind in variables.items())
