"""CheckInEnvelope: is a box inside the robustness envelope [IRR §4, Algorithm 1 lines 18–22, Theorem 1]?"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction

from robust.encode.interface import Encoding, Facet, Obligation
from robust.encode.variables import variable
from robust.errors import InputError, Location
from robust.irr.box import Box, Interval
from robust.plan.model import ParameterReference, Relation
from robust.qe.constraint import LinearConstraint
from robust.qe.nnf import Literal, Nnf, Reader, conjunction, implicant, names_in
from robust.qe.polyhedron import Polyhedron, eliminate
from robust.smt.export import Exporter
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Session, Statistics, Verdict
from robust.smt.terms import Formula


@dataclass(frozen=True)
class Refutation:
    """Why a box is not inside: it holds parameter values without a schedule, or with one that breaks an obligation.

    `reason` names the obligation or the contradicting statements, `values` are the parameter values, `facet` is what
    they break if it is an inequality over parameters.
    """

    reason: str
    values: Mapping[str, Fraction]
    facet: Facet | None = None


@dataclass
class _Question:
    """One obligation with its own solver session, opened when first asked, and the parameters that matter to it."""

    obligation: Obligation
    session: Session | None = None
    parameters: frozenset[str] = frozenset()
    proved_for: dict[str, Interval] | None = None


class Containment:
    """Decides boxes, one obligation at a time, the most recently failed first.

    What was proved for a box is not asked again for a box that is the same in all parameters that matter; what was
    refuted at a point is not asked again for a box that contains the point.

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
        self.statistics = statistics or Statistics()
        self.solver = solver
        self._exporter = exporter
        self._questions = list(self._open_questions())
        self._refuted: list[Refutation] = []

    def refute(self, box: Box, deadline: Deadline) -> Refutation | None:
        """Why the box is not inside the envelope; None if it is.

        Raises:
            OutOfTimeError: if the deadline passes first.
        """
        for known in reversed(self._refuted):
            if known.values in box:
                return known
        refutation = self._refute_existence(box, deadline) or self._refute_obligations(box, deadline)
        if refutation is not None:
            self._refuted.append(refutation)
        return refutation

    def _refute_existence(self, box: Box, deadline: Deadline) -> Refutation | None:
        answer = self.encoding.validity.broken_facet(box.ranges, self.open_session, deadline)
        match answer:
            case None:
                return None
            case Facet():
                values = worst_point(answer, box)
                return Refutation(answer.obligation or no_schedule(answer, values), values, answer)
            case Verdict():
                raise OutOfTimeError

    def _refute_obligations(self, box: Box, deadline: Deadline) -> Refutation | None:
        for index, question in enumerate(self._questions):
            values = self._ask(question, box, deadline)
            if values is not None:
                self._questions.insert(0, self._questions.pop(index))
                return Refutation(question.obligation.name, values)
        return None

    def _ask(self, question: _Question, box: Box, deadline: Deadline) -> dict[str, Fraction] | None:
        """Parameter values in the box with which the obligation breaks; None if there are none."""
        session = question.session or self._open(question, deadline)
        relevant = {name: box[name] for name in question.parameters}
        if question.proved_for is not None and all(
            interval.is_within(question.proved_for[name]) for name, interval in relevant.items()
        ):
            return None
        with session.frame(*within(self.encoding, relevant)):
            verdict = session.check(question.obligation.name, deadline)
            if verdict is Verdict.UNKNOWN:
                raise OutOfTimeError
            if verdict is Verdict.SATISFIABLE:
                return self._point_in(box, session)
        question.proved_for = relevant
        return None

    def _open_questions(self) -> Iterator[_Question]:
        for obligation in self.encoding.obligations:
            if obligation.violation is not self.encoding.terms.false:
                yield _Question(obligation)

    def _open(self, question: _Question, deadline: Deadline) -> Session:
        formulas = self.encoding.query(question.obligation)
        question.parameters = self.encoding.parameters_in(formulas)
        session = self.open_session()
        session.add_all(formulas, deadline)
        question.session = session
        return session

    def open_session(self) -> Session:
        """A new session over the encoding's terms that counts and exports like the others."""
        return Session(self.encoding.terms, solver=self.solver, statistics=self.statistics, exporter=self._exporter)

    def _point_in(self, box: Box, session: Session) -> dict[str, Fraction]:
        symbols = {name: self.encoding.terms.real(ParameterReference(name)) for name in box.intervals}
        values = session.values(symbols.values())
        return {name: Fraction(values.get(name, box[name].some_value())) for name in box.intervals}


def within(encoding: Encoding, intervals: Mapping[str, Interval]) -> Iterator[Formula]:
    """enc_R: the parameters are within their intervals."""
    terms = encoding.terms
    for name, interval in intervals.items():
        value = variable(ParameterReference(name))
        if interval.lower is not None:
            above = value - interval.lower
            yield terms.at_least(above) if interval.lower_closed else terms.greater(above)
        if interval.upper is not None:
            below = -value + interval.upper
            yield terms.at_least(below) if interval.upper_closed else terms.greater(below)


def no_schedule(facet: Facet, values: Mapping[str, Fraction]) -> str:
    """The statements of the network that contradict each other, and with which parameter values."""
    names = sorted(str(unknown) for unknown in facet.expression.variables)
    where = f" with {', '.join(f'{name} = {values[name]}' for name in names)}" if names else ""
    return f"no schedule{where}: {_contradiction(facet)}"


def _contradiction(facet: Facet) -> str:
    return f"{'; '.join(facet.origins)} {'contradict each other' if len(facet.origins) > 1 else 'cannot hold'}"


def require_some_schedule(encoding: Encoding, session: Session, deadline: Deadline) -> None:
    """Tell a plan that can never be executed from parameter values that leave no schedule.

    Args:
        encoding: the plan's formulas.
        session: a new session over the encoding's terms.
        deadline: when to give up, as if there were a schedule.

    Raises:
        InputError: if no parameter values leave a schedule; the message names statements that contradict each other.
    """
    session.add(*encoding.network_formulas())
    if session.check("enc_tn", deadline) is Verdict.UNSATISFIABLE:
        facet = encoding.validity.contradiction(encoding.plan.nominal)
        place = next((item.location for item in encoding.plan.constraints if item.location), None)
        why = _contradiction(facet) if facet is not None else "its constraints contradict each other"
        raise InputError(
            f"the plan's network has no schedule: {why}; expected constraints that can hold together",
            Location(place.file) if place else None,
        )


def worst_point(facet: Facet, box: Box) -> dict[str, Fraction]:
    """A point of the box at which the facet breaks, as far out as the box allows.

    An infinite end is replaced by a value far enough to break the facet whatever the other parameters are, and a point
    on an open end by one inside that still breaks it.
    """
    inside = {name: interval.some_value() for name, interval in box.intervals.items()}
    values = dict(inside)
    infinite: list[tuple[str, Fraction]] = []
    for unknown, factor in facet.expression.coefficients():
        name = str(unknown)
        end = box[name].lower if factor > 0 else box[name].upper
        if end is None:
            infinite.append((name, factor))
        else:
            values[name] = end
    for name, factor in infinite[:1]:
        values[name] -= (max(_value(facet, values), Fraction(0)) + 1) / factor
    if values not in box:
        outer, inner = _value(facet, values), _value(facet, inside)
        share = Fraction(1, 2) if inner < 0 else outer / (outer - inner) / 2
        values = {name: value + (inside[name] - value) * share for name, value in values.items()}
    return values


def _value(facet: Facet, values: Mapping[str, Fraction]) -> Fraction:
    return facet.expression.evaluate({unknown: values[str(unknown)] for unknown in facet.expression.variables})


@dataclass
class _BadSetQuestion:
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
        self._questions: list[_BadSetQuestion] | None = None
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

    def _question(self, obligation: Obligation) -> _BadSetQuestion:
        formulas = self.encoding.query(obligation)
        session = self.open_session()
        session.add(*formulas)
        formula = conjunction(self._reader.read(formula) for formula in formulas)
        return _BadSetQuestion(obligation, session, formula, self.encoding.parameters_in(formulas))

    def _ask(self, question: _BadSetQuestion, box: Box, deadline: Deadline) -> Polyhedron | None:
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

    def _generalised(self, question: _BadSetQuestion) -> Polyhedron:
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
