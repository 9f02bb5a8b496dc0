"""Refutations of formulas: found exactly where there is no model, and checked step by step."""

import json
from collections import Counter
from fractions import Fraction
from itertools import product
from random import Random

import pytest

from robust.certify import hints
from robust.certify.checker import proofs
from robust.certify.checker.formulas import Formulas, plus
from robust.certify.checker.reader import Ground, Model
from robust.certify.hints import KnownFacts
from robust.plan.polynomial import Polynomial
from robust.smt.limits import Deadline
from robust.smt.session import Satisfiability, Session
from robust.smt.terms import Terms
from tests.certify import tools

NONE = Deadline()


def without_zeros(form):
    return {name: value for name, value in form.items() if value}


def propagates_to_conflict(clauses, clause, hints):
    """Whether each hint is unit or false in its turn, and the last one false, if the clause is."""
    false = set(clause)
    for hint in hints:
        open_literals = set(clauses[hint]) - false
        if not open_literals:
            return True
        if len(open_literals) > 1:
            return False
        false.add(-open_literals.pop())
    return False


@pytest.mark.parametrize("seed", range(60))
def test_propositional_solver_agrees_with_truth_tables(seed):
    random = Random(seed)
    variables = random.randint(1, 7)
    clauses = [
        tuple(random.choice((1, -1)) * random.randint(1, variables) for _ in range(random.randint(1, 3)))
        for _ in range(random.randint(1, 5 * variables))
    ]
    solver = hints.PropositionalSolver()
    for clause in clauses:
        solver.add(clause)
    truths = solver.solve(NONE)
    assignments = [dict(enumerate(values, 1)) for values in product((False, True), repeat=variables)]

    def satisfied(values):
        return all(any(values[abs(literal)] == (literal > 0) for literal in clause) for clause in clauses)

    assert (truths is not None) == any(map(satisfied, assignments))
    if truths is not None:
        assert satisfied(truths)
        return
    for number, step in [*solver.derivations.items(), (len(solver.clauses), solver.refutation)]:
        assert all(hint < number for hint in step.hints)
        assert propagates_to_conflict(solver.clauses, step.clause, step.hints)


@pytest.mark.parametrize("seed", range(80))
def test_contradictions_agree_with_a_solver(seed):
    random, terms, sides = Random(seed), Terms(), []
    session = Session(terms)
    for _ in range(random.randint(1, 7)):
        factors = {name: random.randint(-2, 2) for name in random.sample("xyz", random.randint(1, 3))}
        factors = tuple(sorted(without_zeros(factors).items())) or (("x", 1),)
        side = hints.LinearSide(factors, random.randint(-3, 3), random.random() < 0.4)
        form = Polynomial({(name,): Fraction(factor) for name, factor in factors}) + side.constant
        session.add(terms.greater(form) if side.strict else terms.at_least(form))
        sides.append(side)
    answer = hints.contradiction(sides)
    assert isinstance(answer, hints.Conflict) == (session.check("sides") is Satisfiability.UNSATISFIABLE)
    if isinstance(answer, dict):
        assert all(side.holds(answer) for side in sides)
        return
    total = Counter()
    for index, multiple in answer.multiples.items():
        assert multiple > 0
        for name, factor in (*sides[index].factors, ("", sides[index].constant)):
            total[name] += multiple * factor
    constant = total.pop("")
    assert not any(total.values())
    assert constant < 0 or (constant == 0 and any(sides[index].strict for index in answer.multiples))


@pytest.mark.parametrize("seed", range(60))
def test_facts_that_matter_are_found(seed):
    """Multiples of many facts, of which few are looked at, leave something that is not negative of a form."""
    random = Random(seed)
    names = [f"x{index}" for index in range(5)]
    facts, total = [], {"": Fraction(1)}
    for _ in range(12):
        form = {name: Fraction(random.randint(-2, 2), random.randint(1, 2)) for name in random.sample(names, 2)}
        form[""] = Fraction(random.randint(0, 6))  # so that zero satisfies them all
        facts.append((without_zeros(form), False))
        total = plus(total, facts[-1][0], Fraction(random.randint(0, 2)))
    for number, factor in hints.implied(KnownFacts(facts), total, strictly=True):
        assert factor > 0
        total = plus(total, facts[number][0], -factor)
    assert total.keys() <= {""}
    assert total.get("", 0) >= 0
    with pytest.raises(hints.NotRefutedError):
        hints.implied(KnownFacts(facts), {"": Fraction(-1)})


def some_literal(circuit, random, depth):
    if depth == 0 or random.random() < 0.1:
        kind = random.randrange(4)
        if kind == 0:
            return circuit.compare({f"?{random.choice('pq')}": Fraction(1)}, True)
        form = {name: Fraction(random.randint(-2, 2)) for name in random.sample("xyz", 2)}
        form = without_zeros(form | {"": Fraction(random.randint(-4, 4), random.randint(1, 2))})
        return circuit.equal(form) if kind == 3 else circuit.compare(form, kind == 2)
    parts = [some_literal(circuit, random, depth - 1) for _ in range(random.randint(2, 3))]
    way = random.randrange(3)
    return -parts[0] if way == 2 else (circuit.all, circuit.any)[way](parts)


def term_of(terms, circuit, literal):
    """The literal for a solver."""
    if literal < 0:
        return terms.negation(term_of(terms, circuit, -literal))
    if circuit.is_gate(literal):
        return terms.conjunction([term_of(terms, circuit, part) for part in circuit.nodes[literal]])
    form, strict = circuit.said(literal)
    total = Polynomial({(name,): Fraction(value) for name, value in form.items() if name}) + form.get("", 0)
    return terms.greater(total) if strict else terms.at_least(total)


EMPTY = Ground(Model("(define (domain d))", "(define (problem x) (:domain d) (:init) (:goal (and)))"))
EMPTY.point(".zero")


def refuted(line, formulas, literal):
    proofs.refute(proofs.Tape([json.dumps(line)]), formulas, proofs.Facts([]), literal)


@pytest.mark.parametrize("seed", range(120))
def test_refutations_agree_with_a_solver_and_are_accepted(seed):
    random = Random(seed)
    formulas, terms, facts = Formulas(EMPTY, Fraction(0)), Terms(), KnownFacts([])
    literal = formulas.circuit.all([some_literal(formulas.circuit, random, random.randint(1, 4)) for _ in range(5)])
    session = Session(terms)
    session.add(term_of(terms, formulas.circuit, literal))
    if session.check("formulas") is Satisfiability.SATISFIABLE:
        assert hints.model(formulas, facts, literal, NONE) is not None
        with pytest.raises(hints.NotRefutedError):
            hints.refutation(formulas, facts, literal, NONE)
        return
    line = hints.refutation(formulas, facts, literal, NONE)
    refuted(line, formulas, literal)
    other = formulas.circuit.compare({"other": Fraction(1)})
    with pytest.raises((proofs.Rejected, *tools.MALFORMED)):
        refuted(line, formulas, other)


@pytest.mark.parametrize(
    "steps",
    [
        [[[], [["g", 0], ["g", 1]]]],  # the first hint leaves several literals open
        [[[], [0, ["g", 1]]]],  # no conflict
        [[[], [["g", 0]]]],
        [[[-2], [["g", 1], 0]], [[], [0, 1]]],  # a hint after the conflict, or none
        [[[2, -2], [1, 1], []]],  # true, but not the end
        [[["g"], [1], []], [[], [0]]],  # a gate is no comparison
        [],
    ],
)
def test_what_is_no_refutation(steps):
    formulas = Formulas(EMPTY, Fraction(0))
    literal = formulas.circuit.all([formulas.circuit.compare({name: Fraction(1)}) for name in "xyz"])
    line = json.loads(json.dumps(["refute", *steps]).replace('"g"', str(literal)))
    with pytest.raises((proofs.Rejected, *tools.MALFORMED)):
        refuted(line, formulas, literal)
