"""Is a certificate about a plan? Its ground plan and its formulas, held against what the input files become here.

The checker cannot say so, because it reads no PDDL and encodes nothing. This can, but trusts this package's readers
and its encoding. It is meant for certificates that the checker has accepted.
"""

from __future__ import annotations

import gzip
import json
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

from robust.certify.circuit import Circuit, Conjunction, Translator, conjuncts
from robust.certify.exactness import network_roles
from robust.certify.ground import GroundPlan, number, optional
from robust.encode.interface import create_encoding
from robust.plan.model import ParametrizedPlan
from robust.smt.limits import Deadline

GROUND = frozenset(("point", "constraint", "condition", "effect", "rate", "initial", "place"))


@dataclass(frozen=True)
class Certified:
    """What a certificate says, apart from its proofs: its lines by kind, the trusted roots of each obligation, and the
    literals that are said to be true together where an obligation breaks outside of a region."""

    header: dict[str, Any]
    ground: list[Any]
    folded: frozenset[str]
    roots: dict[str, list[int]]
    broken: list[tuple[str, frozenset[int]]]
    circuit: Circuit


def read(path: Path) -> Certified:
    """The statements of a certificate that the checker has accepted."""
    circuit = Circuit()
    nodes = [0]
    ground, folded, roots = [], set(), dict[str, list[int]]()
    broken: list[tuple[str, frozenset[int]]] = []
    name, part = "", ""
    with gzip.open(path) as file:
        header = json.loads(next(file))
        for line in map(json.loads, file):
            kind, *rest = line
            if kind in GROUND:
                ground.append(line)
            elif kind in ("a", "g"):
                nodes.append(_node(circuit, nodes, kind, rest))
            elif kind == "folded":
                folded.add(rest[0])
            elif kind in ("piece", "outside", "rest"):
                part = kind
            elif kind == "obligation":
                name = rest[0]
                if part in ("", "piece"):
                    roots.setdefault(name, [])
            elif kind == "root" and rest[1] == "x":
                node = circuit.node(_literal(nodes, rest[0]))
                broken.append((name, frozenset(node.inputs if isinstance(node, Conjunction) else ())))
            elif kind == "root" and rest[1] == "t":
                roots[name].append(_literal(nodes, rest[0]))
    return Certified(header, ground, frozenset(folded), roots, broken, circuit)


def _literal(nodes: list[int], literal: int) -> int:
    return nodes[literal] if literal > 0 else -nodes[-literal]


def _node(circuit: Circuit, nodes: list[int], kind: str, rest: list[Any]) -> int:
    if kind == "g":
        return circuit.add(Conjunction(tuple(_literal(nodes, literal) for literal in rest[0])))
    factors = {term[1]: -Fraction(term[0]) for term in rest[0] if len(term) > 1}
    constant = sum((Fraction(term[0]) for term in rest[0] if len(term) == 1), Fraction(0))
    return circuit.at_most(factors, constant, strict=rest[1])


def mismatch(path: Path, plan: ParametrizedPlan, deadline: Deadline) -> str | None:
    """Where a certificate about a plan differs from the plan; None if it does not.

    Args:
        path: a certificate of any kind but `knowledge`, accepted by the checker.
        plan: the plan that it is said to be about.
        deadline: when to give up, with OutOfTimeError.
    """
    found = read(path)
    parameters = [[p.name, optional(p.lower), optional(p.upper)] for p in plan.parameters]
    if found.header["parameters"] != parameters:
        return "the certificate is about other parameters"
    ground = GroundPlan(plan)
    if [json.loads(json.dumps(line)) for line in ground.lines()] != found.ground:
        return "the ground plan in the certificate is not the one of the files"
    if found.header["kind"] == "plan":
        point = [[number(p.nominal), True, number(p.nominal), True] for p in plan.parameters]
        if found.header["box"] != point:
            return "the point of the certificate is not the nominal one"
    encoding = create_encoding(found.header["encoding"], plan, Fraction(found.header["epsilon"]), deadline)
    translator = Translator(encoding.terms, found.circuit)
    network = set(network_roles(ground, found.circuit))
    for obligation in encoding.obligations:
        deadline.enforce()
        if obligation.violation is encoding.terms.false:
            continue
        if obligation.name in found.folded:
            return f"the encoding's formula for {obligation.name!r} is not constant"
        roots = found.roots.get(obligation.name, [])
        broken = [literals for name, literals in found.broken if name == obligation.name]
        literals = map(translator.literal, encoding.query(obligation) if roots or broken else ())
        formula = set(conjuncts(found.circuit, literals))
        if not set(roots) <= formula or not all(formula <= each | network for each in broken):
            return f"the formula for {obligation.name!r} is not the encoding's"
    return next(_foreign(found, {obligation.name for obligation in encoding.obligations}), None)


def _foreign(found: Certified, names: set[str]) -> Iterator[str]:
    for name in (*found.folded, *found.roots, *(name for name, _ in found.broken)):
        if name not in names:
            yield f"the plan has no obligation {name!r}"
