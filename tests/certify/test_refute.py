"""Refutations of formulas: found exactly where there is no model, and checked step by step."""

from fractions import Fraction
from itertools import product
from random import Random

import pytest

from robust.certify.circuit import Atom, Circuit, Constraint, Translator, atom_of, conjuncts, constraint, contradiction
from robust.certify.document import CertificateWriter
from robust.certify.refute import NotRefutedError, PropositionalSolver, Refuter
from robust.plan.polynomial import Polynomial
from robust.smt.limits import Deadline
from robust.smt.session import Session, Verdict
from robust.smt.terms import Terms
from tests.certify import tools

NONE = Deadline()


# -- propositional ---------------------------------------------------------------------------------------------------


def propagates_to_conflict(clauses, clause, hints):
    """Whether each hint is unit or false in its turn, and the last one false, if the clause is."""
    false = set(clause)
    for hint in hints:
        left = set(clauses[hint]) - false
        if not left:
            return True
        if len(left) > 1:
            return False
        false.add(-left.pop())
    return False


@pytest.mark.parametrize("seed", range(60))
def test_propositional_solver_agrees_with_truth_tables(seed):
    random = Random(seed)
    variables = random.randint(1, 7)
    clauses = [
        tuple(random.choice((1, -1)) * random.randint(1, variables) for _ in range(random.randint(1, 3)))
        for _ in range(random.randint(1, 5 * variables))
    ]
    solver = PropositionalSolver()
    for clause in clauses:
        solver.add(clause)
    model = solver.solve(NONE)
    exists = any(
        all(any(values[abs(literal) - 1] == (literal > 0) for literal in clause) for clause in clauses)
        for values in product((False, True), repeat=variables)
    )
    assert (model is not None) == exists
    if model is not None:
        assert all(any(model[abs(literal)] == (literal > 0) for literal in clause) for clause in clauses)
    else:
        steps = [*solver.derivations.items(), (len(solver.clauses), solver.refutation)]
        for number, step in steps:
            assert all(hint < number for hint in step.hints)
            assert propagates_to_conflict(solver.clauses, step.clause, step.hints)


# -- linear ----------------------------------------------------------------------------------------------------------


def test_a_constraint_and_its_negation_share_an_atom():
    atom, positive = atom_of({"x": Fraction(-1, 2), "y": Fraction(1, 3)}, False, Fraction(1))
    other, negated = atom_of({"x": Fraction(3), "y": Fraction(-2)}, True, Fraction(-6))
    assert atom == other == Atom((("x", 3), ("y", -2)), True, -6)
    assert (positive, negated) == (False, True)
    assert constraint(atom, False) == Constraint((("x", -3), ("y", 2)), False, 6)


@pytest.mark.parametrize("seed", range(80))
def test_contradictions_agree_with_a_solver(seed):
    random = Random(seed)
    constraints = []
    for _ in range(random.randint(1, 7)):
        factors = {name: random.randint(-2, 2) for name in random.sample("xyz", random.randint(1, 3))}
        factors = tuple(sorted((name, factor) for name, factor in factors.items() if factor)) or (("x", 1),)
        constraints.append(Constraint(factors, random.random() < 0.4, random.randint(-3, 3)))
    terms = Terms()
    session = Session(terms)
    for each in constraints:
        rest = Polynomial({(name,): Fraction(-factor) for name, factor in each.coefficients}) + each.bound
        session.add(terms.greater(rest) if each.strict else terms.at_least(rest))
    found = contradiction(constraints)
    assert (found is None) == (session.check("constraints") is Verdict.SATISFIABLE)
    if found is not None:
        total, bound, strict = {}, 0, False
        for index, multiplier in zip(found.indices, found.multipliers, strict=True):
            assert multiplier > 0
            for name, factor in constraints[index].coefficients:
                total[name] = total.get(name, 0) + multiplier * factor
            bound += multiplier * constraints[index].bound
            strict |= constraints[index].strict
        assert not any(total.values())
        assert bound < 0 or (strict and bound == 0)


# -- formulas --------------------------------------------------------------------------------------------------------


def some_formula(terms, random, depth):
    if depth == 0 or random.random() < 0.1:
        kind = random.randrange(4)
        if kind == 0:
            return terms.manager.Symbol(random.choice("pq"))
        polynomial = Polynomial({(name,): Fraction(random.randint(-2, 2)) for name in random.sample("xyz", 2)})
        expression = polynomial + Fraction(random.randint(-4, 4), random.randint(1, 2))
        return (terms.at_least, terms.greater, terms.equal)[kind - 1](expression)
    parts = [some_formula(terms, random, depth - 1) for _ in range(random.randint(2, 3))]
    way = random.randrange(4)
    if way == 3:
        return terms.equivalence(*parts[:2])
    return terms.negation(parts[0]) if way == 2 else (terms.conjunction, terms.disjunction)[way](parts)


@pytest.mark.parametrize("seed", range(120))
def test_refutations_agree_with_a_solver_and_are_accepted(seed, tmp_path):
    random = Random(seed)
    terms = Terms()
    formulas = [some_formula(terms, random, random.randint(1, 4)) for _ in range(random.randint(2, 6))]
    session = Session(terms)
    session.add(*formulas)
    circuit = Circuit()
    translator = Translator(terms, circuit)
    roots = conjuncts(circuit, map(translator.literal, formulas))
    if session.check("formulas") is Verdict.SATISFIABLE:
        with pytest.raises(NotRefutedError):
            Refuter(circuit).refute(roots, NONE)
        return
    refutation = Refuter(circuit).refute(roots, NONE)
    writer = CertificateWriter(circuit, {"kind": "knowledge", "inputs": {}})
    writer.refuted("correct execution", roots, refutation, lambda _: ["t"])
    path = tmp_path / "formula.cert"
    writer.save(path)
    assert tools.rejection(path) is None
