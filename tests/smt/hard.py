"""A query that no solver answers within minutes, for tests of time limits and interruption."""

from __future__ import annotations

from itertools import combinations, pairwise, permutations
from random import Random

from robust.encode.variables import Auxiliary, constant, variable
from robust.smt.session import Session
from robust.smt.terms import Formula, Terms


def job_shop(terms: Terms, *, jobs: int = 20, machines: int = 20, percent: int = 128, seed: int = 1) -> list[Formula]:
    """Random job shop; a makespan near 128 % of the greatest load is hard to find and hard to refute."""
    random = Random(seed)  # noqa: S311 - reproducible, not secret
    start = {(j, m): variable(Auxiliary("start", j * machines + m)) for j in range(jobs) for m in range(machines)}
    length = {key: random.randint(1, 99) for key in start}
    orders = [random.sample(range(machines), machines) for _ in range(jobs)]
    loads = [sum(length[j, m] for j in range(jobs)) for m in range(machines)]
    makespan = constant(max(loads) * percent // 100)
    formulas = []
    for j, order in enumerate(orders):
        formulas.append(terms.at_least(start[j, order[0]]))
        formulas += [
            terms.at_least(start[j, second] - start[j, first] - length[j, first]) for first, second in pairwise(order)
        ]
        formulas.append(terms.at_least(makespan - start[j, order[-1]] - length[j, order[-1]]))
    for m in range(machines):
        for i, j in combinations(range(jobs), 2):
            formulas.append(
                terms.disjunction(
                    terms.at_least(start[b, m] - start[a, m] - length[a, m]) for a, b in permutations((i, j))
                )
            )
    return formulas


def hard_session(solver: str) -> Session:
    """A session whose next check takes minutes."""
    terms = Terms()
    session = Session(terms, solver=solver)
    session.add(*job_shop(terms))
    return session
