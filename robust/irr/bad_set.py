"""The complement of the envelope, discovered polyhedron by polyhedron as boxes run into it."""

from __future__ import annotations

from dataclasses import dataclass

from robust.encode.interface import Encoding, Facet, Obligation
from robust.irr.box import Box, Interval
from robust.irr.containment import within
from robust.plan.model import Relation
from robust.qe.constraint import LinearConstraint
from robust.qe.nnf import Literal, Nnf, Reader, conjunction, implicant, names_in
from robust.qe.polyhedron import Polyhedron
from robust.qe.projection import eliminate
from robust.smt.export import Exporter
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Session, Verdict
from robust.smt.statistics import Statistics


@dataclass
class _Question:
    """One obligation: its query as a solver session and as a normal form, made when first asked."""

    obligation: Obligation
    session: Session
    formula: Nnf
    parameters: frozenset[str]
    proved_for: dict[str, Interval] | None = None


class DiscoveredBadSet:
    """Finds bad polyhedra in boxes.

    A model of a query is generalised to its implicant, a conjunction of inequalities, which is projected exactly onto
    the parameters; a facet of enc_valid that the box breaks is a polyhedron as it is.

    Args:
        encoding: the plan's formulas.
        solver: `z3` or `cvc5`.
        statistics: where queries are counted.
        exporter: where queries are written, if anywhere.
    """

    def __init__(
        self,
        encoding: Encoding,
        *,
        solver: str = "z3",
        statistics: Statistics | None = None,
        exporter: Exporter | None = None,
    ) -> None:
        self.encoding = encoding
        self.solver = solver
        self.statistics = statistics or Statistics()
        self._exporter = exporter
        self._reader = Reader(encoding.terms)
        self._parameters = tuple(parameter.name for parameter in encoding.plan.parameters)
        self._questions: list[_Question] | None = None
        self.reasons: dict[Polyhedron, str] = {}
        """The obligation, or the statements of the network, that each polyhedron breaks."""
        self.existence: set[Polyhedron] = set()
        """The polyhedra that leave no schedule."""
        self.checks = 0

    def piece_in(self, box: Box, deadline: Deadline) -> Polyhedron | None:
        """A polyhedron of bad values that meets the box; None if the box is inside the envelope.

        Raises:
            OutOfTimeError: if the deadline passes first.
        """
        self.checks += 1
        found = self.encoding.validity.broken_facet(box.ranges, self.open_session, deadline)
        if isinstance(found, Verdict):
            raise OutOfTimeError
        if found is not None:
            return self._beyond(found)
        if self._questions is None:
            self._questions = [
                self._question(obligation)
                for obligation in self.encoding.obligations
                if obligation.violation is not self.encoding.terms.false
            ]
        for index, question in enumerate(self._questions):
            piece = self._ask(question, box, deadline)
            if piece is not None:
                self._questions.insert(0, self._questions.pop(index))
                return piece
        return None

    def _beyond(self, facet: Facet) -> Polyhedron:
        inside = LinearConstraint.from_polynomial(facet.expression, Relation.AT_LEAST)
        piece = Polyhedron(self._parameters, tuple(inside.negation()))
        if facet.obligation is None:
            self.existence.add(piece)
        self.reasons[piece] = facet.obligation or f"no schedule: {'; '.join(facet.origins)}"
        return piece

    def _question(self, obligation: Obligation) -> _Question:
        formulas = self.encoding.query(obligation)
        session = self.open_session()
        session.add(*formulas)
        formula = conjunction(self._reader.read(formula) for formula in formulas)
        return _Question(obligation, session, formula, self.encoding.parameters_in(formulas))

    def _ask(self, question: _Question, box: Box, deadline: Deadline) -> Polyhedron | None:
        relevant = {name: box[name] for name in self._parameters if name in question.parameters}  # in a fixed order
        proved = question.proved_for
        if proved is not None and all(interval.is_within(proved[name]) for name, interval in relevant.items()):
            return None
        with question.session.frame(*within(self.encoding, relevant)):
            verdict = question.session.check(question.obligation.name, deadline)
            if verdict is Verdict.UNKNOWN:
                raise OutOfTimeError
            if verdict is Verdict.SATISFIABLE:
                piece = self._generalised(question)
                self.reasons[piece] = question.obligation.name
                return piece
        question.proved_for = relevant
        return None

    def _generalised(self, question: _Question) -> Polyhedron:
        """All parameter values that break the obligation in the way that the model does."""
        terms = self.encoding.terms
        symbols = {symbol for formula in question.session.assertions for symbol in terms.variables(formula)}
        model = question.session.values(symbols)
        chosen: dict[LinearConstraint | Literal, None] = {}
        if not implicant(question.formula, model, chosen):
            raise ValueError(f"the solver's model does not satisfy the query of {question.obligation.name!r}")
        constraints = [leaf for leaf in chosen if isinstance(leaf, LinearConstraint)]
        names = sorted(names_in(conjunction(constraints)) | set(self._parameters))
        hidden = [name for name in names if name not in self._parameters]
        return Polyhedron(self._parameters, eliminate(names, constraints, hidden))

    def open_session(self) -> Session:
        """A new session over the encoding's terms that counts and exports like the others."""
        return Session(self.encoding.terms, solver=self.solver, statistics=self.statistics, exporter=self._exporter)
