"""Certificates as files: one JSON value on each line, compressed, nodes and lemmas written once."""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, assert_never

from robust.certify.circuit import Atom, Circuit, Conjunction, Node, Translator, conjuncts
from robust.certify.exactness import network_roles
from robust.certify.ground import GroundPlan, Line, number, optional
from robust.certify.refute import Clause, Derived, GateClause, Lemma, Refutation, RootClause
from robust.encode import create_encoding
from robust.files import atomic_write
from robust.plan.model import ParametrizedPlan
from robust.smt.limits import Deadline

FORMAT = "robust/certificate/1"

Role = Callable[[int], Line]
"""What a root of a formula is, for the checker to compare: see the checker's `claimed`."""


class CertificateWriter:
    """Collects the lines of one certificate.

    Args:
        circuit: whose nodes refutations mention.
        header: what the first line says besides the format.
    """

    def __init__(self, circuit: Circuit, header: Mapping[str, Any]) -> None:
        self._circuit = circuit
        self._lines: list[str] = []
        self._nodes: dict[int, int] = {}
        self._lemmas: dict[Lemma, int] = {}
        self._write({"format": FORMAT, **header})

    def add(self, *lines: Line) -> None:
        for line in lines:
            self._write(line)

    def _write(self, value: object) -> None:
        self._lines.append(json.dumps(value, separators=(",", ":")))

    def refuted(self, name: str, roots: Sequence[int], refutation: Refutation, role: Role) -> None:
        """One obligation: the definitions that it needs, then its steps; roots that it does not use are left out."""
        used = [roots[step.index] for step in refutation if isinstance(step, RootClause)]
        self._define(used)
        lemmas = {index: self._lemma(step) for index, step in enumerate(refutation) if isinstance(step, Lemma)}
        self._define(step.gate for step in refutation if isinstance(step, GateClause))
        self.add(["obligation", name])
        hints: list[int | list[int]] = []
        clauses = 0
        for index, step in enumerate(refutation):
            match step:
                case GateClause(gate, which):
                    hints.append([self._nodes[gate], which])
                    continue
                case Lemma():
                    hints.append(~lemmas[index])
                    continue
                case RootClause(place):
                    self.add(["root", self._literal(roots[place]), *role(roots[place])])
                case Derived(clause, named):
                    chain = [hints[hint] for hint in named]
                    self.add(["derive", self._literals(clause), chain] if clause else ["qed", chain])
            hints.append(clauses)
            clauses += 1

    def _lemma(self, lemma: Lemma) -> int:
        if lemma not in self._lemmas:
            self._define(lemma.clause)
            self._lemmas[lemma] = len(self._lemmas)
            self.add(["lemma", self._literals(lemma.clause), list(lemma.multipliers)])
        return self._lemmas[lemma]

    def _literal(self, literal: int) -> int:
        number = self._nodes[abs(literal)]
        return number if literal > 0 else -number

    def _literals(self, clause: Clause) -> list[int]:
        return [self._literal(literal) for literal in clause]

    def _define(self, literals: Iterable[int]) -> None:
        """Write nodes that are not written yet, inputs first."""
        pending = [abs(literal) for literal in literals]
        while pending:
            number = pending[-1]
            node = self._circuit.node(number)
            inputs = node.inputs if isinstance(node, Conjunction) else ()
            missing = [abs(literal) for literal in inputs if abs(literal) not in self._nodes]
            if number not in self._nodes and missing:
                pending += missing
                continue
            pending.pop()
            if number not in self._nodes:
                self.add(self._definition(node))
                self._nodes[number] = len(self._nodes) + 1

    def _definition(self, node: Node) -> Line:
        match node:
            case Atom(coefficients, strict, bound):
                # Certificates say `expression ≥ 0`, or `> 0`.
                terms: Line = [[-factor, name] for name, factor in coefficients]
                return ["a", [*terms, [bound]] if bound else terms, strict]
            case Conjunction(inputs):
                return ["g", self._literals(inputs)]
        assert_never(node)

    def save(self, path: Path) -> int:
        """Write the file, with a last line that says that nothing is missing; its size in bytes."""
        self.add(["end"])
        data = gzip.compress(("\n".join(self._lines) + "\n").encode(), mtime=0)
        atomic_write(path, data, None)
        return len(data)


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
