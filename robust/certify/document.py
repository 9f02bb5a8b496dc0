"""Certificates as files: one JSON value on each line, compressed, nodes and lemmas written once."""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, assert_never

from robust.certify.circuit import Circuit, Conjunction, Node
from robust.certify.ground import Line
from robust.certify.linear import Atom
from robust.certify.propositional import Clause
from robust.certify.refute import Derived, GateClause, Lemma, Refutation, RootClause

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
        path.write_bytes(data)
        return len(data)
