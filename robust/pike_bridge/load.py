"""From files to plans with choices: a `.tpnu.json` with the PDDL domain and problem that it names."""

from __future__ import annotations

import os
from fractions import Fraction

from robust.pike_bridge.action_model import team_plan
from robust.pike_bridge.document import read_tpnu
from robust.pike_bridge.model import EPSILON, TeamPlan, Tpnu
from robust.pike_bridge.validate import validate
from robust.plan.pddl.reader import read_domain, read_problem


def load_team_plan(path: str | os.PathLike[str], *, epsilon: Fraction = EPSILON) -> TeamPlan:
    """Read a `.tpnu.json` file, its domain and its problem.

    Args:
        epsilon: how far apart a producer, its consumer and what threatens them are kept.

    Raises:
        InputError: with the place, if a file cannot be read, is wrong, or does not fit the others.
        UnsupportedError: if the actions or the goal need more than conjunctions of literals.
    """
    document = read_tpnu(path)
    validate(document.network, document.places)
    domain = read_domain(document.beside(document.domain))
    problem = read_problem(document.beside(document.problem), domain)
    return team_plan(document.network, domain, problem, places=document.places, epsilon=epsilon)


def load_network(path: str | os.PathLike[str]) -> Tpnu:
    """Read only the network of a `.tpnu.json` file, for what needs no action model.

    Raises:
        InputError: with line and column, if the file cannot be read or its network is wrong.
    """
    document = read_tpnu(path)
    validate(document.network, document.places)
    return document.network
