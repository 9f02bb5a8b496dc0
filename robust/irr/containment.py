"""CheckInEnvelope: is a box inside the robustness envelope [IRR §4, Algorithm 1 lines 18–22, Theorem 1]?"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import ClassVar, Generic, TypeVar

from robust.encode.interface import Encoding, Facet, Obligation
from robust.irr.check import no_schedule, within, worst_point
from robust.plan.model import ParameterReference
from robust.qe import nnf
from robust.qe.box import Box, Face, Interval
from robust.qe.polyhedron import Polyhedron
from robust.smt.limits import Deadline, OutOfTimeError, raise_if_interrupted
from robust.smt.session import Exporter, Formula, Satisfiability, Session, Statistics

Found = TypeVar("Found")

Margins = Mapping[Face, Fraction]
"""How far beyond its faces is looked for what ends a box."""

EFFORTS = 300_000, 3_000_000, 30_000_000, 0
"""Steps of a solver for each question before another gets more: about 10 ms, 0.1 s, 1 s, and without a limit."""


@dataclass
class ObligationQuestion:
    """One obligation, and the parameters that matter to it.

    Once it is `opened`, it has a solver session of its own, unless it speaks of parameters alone, or nothing breaks it:
    then all that breaks it is a union of `pieces`.
    """

    obligation: Obligation
    opened: bool = False
    pieces: tuple[Polyhedron, ...] = ()
    session: Session | None = None
    parameters: tuple[str, ...] = ()
    proved_for: Mapping[str, Interval] | None = None


class Questions(ABC, Generic[Found]):
    """Asks of boxes what is bad in them: existence of schedules first, then one obligation at a time.

    The most recently failed obligation is asked first. Obligations over parameters alone are decided here, by exact
    arithmetic, unless queries are to be written; the others by a solver, and what was proved for a box is not asked
    again for a box that is within it in all parameters that matter.

    Args:
        encoding: the plan's formulas.
        solver: `z3` or `cvc5`.
        statistics: where queries are counted.
        exporter: where queries are written, if anywhere.
    """

    PROVING: ClassVar[bool] = False
    """Whether few proofs about large boxes are asked for, instead of many about small ones."""

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
        self._names = tuple(parameter.name for parameter in encoding.plan.parameters)
        self._written: dict[str, tuple[Interval, tuple[Formula, ...]]] = {}
        self.reader = nnf.FormulaReader(encoding.terms)

    @cached_property
    def _in_order(self) -> tuple[ObligationQuestion, ...]:
        """A question for each obligation that is not settled."""
        return tuple(ObligationQuestion(o) for o in self.encoding.obligations if o.violation is not None)

    @cached_property
    def _questions(self) -> list[ObligationQuestion]:
        """The questions, first those that were answered last by something bad."""
        return list(self._in_order)

    def open_session(self) -> Session:
        """A new session over the encoding's terms that counts and exports like the others."""
        return Session(
            self.encoding.terms,
            solver=self.solver,
            statistics=self.statistics,
            exporter=self._exporter,
            proving=self.PROVING,
        )

    @abstractmethod
    def _of_facet(self, facet: Facet, box: Box) -> Found:
        """What is found where a facet of enc_valid breaks in the box."""

    @abstractmethod
    def _of_piece(self, question: ObligationQuestion, piece: Polyhedron, box: Box) -> Found:
        """What is found where a piece of what breaks the obligation meets the box."""

    @abstractmethod
    def _of_model(self, question: ObligationQuestion, session: Session, box: Box) -> Found:
        """What is found where the session has a model that breaks the obligation in the box."""

    def _look_in(self, box: Box, deadline: Deadline) -> Found | None:
        raise_if_interrupted()
        deadline.enforce()
        facet = self.encoding.validity.broken_facet(box.grid, self.open_session, deadline)
        if isinstance(facet, Satisfiability):
            raise OutOfTimeError(self.statistics.failure)
        return self._of_facet(facet, box) if facet is not None else self._broken_in(box, deadline)

    def _broken_in(self, box: Box, deadline: Deadline) -> Found | None:
        """What some schedule breaks for values in the box, where there is one."""
        # What breaks is found soon, what holds is proved late: so all questions get a little time before any gets more.
        questions = list(self._questions)
        for effort in EFFORTS:
            hard: list[ObligationQuestion] = []
            for question in questions:
                obstacle = self._ask(question, box, deadline, effort, hard)
                if obstacle is not None:
                    self._questions.remove(question)
                    self._questions.insert(0, question)
                    return obstacle
            questions = hard
        return None

    # -- what ends the sides of a box ----------------------------------------------------------------------------------

    def ended_by_network(self, box: Box, reach: Margins, deadline: Deadline) -> dict[Face, Facet | None]:
        """The faces just beyond which some parameter values leave no schedule, with what contradicts itself there.

        They are found by questions with one answer each, so that they are the same whatever was asked before.
        """
        if not self._no_schedule(_moved(box, reach), deadline):
            return {}
        ended: dict[Face, Facet | None] = {}
        for face, margin in reach.items():
            step = margin
            while (facet := self._no_schedule(beyond := _moved(box, {face: step}), deadline)) is not None:
                near = self._distance(facet, face, step, box)
                if not near:
                    facet = self.encoding.validity.contradiction(self._unschedulable(beyond, deadline))
                    near = None if facet is None else self._distance(facet, face, step, box)
                if not near:
                    ended[face] = facet
                    break
                step = near / 2
        return ended

    def _no_schedule(self, box: Box, deadline: Deadline) -> Facet | None:
        """A facet of the network alone that some point of the box breaks; whatever ended a search has been met."""
        deadline.enforce()
        return self.encoding.validity.known_facet(box.grid)

    def _unschedulable(self, box: Box, deadline: Deadline) -> dict[str, Fraction]:
        """A point without a schedule of a box that has some: one value after the other, in the middle or at an end."""
        for name, interval in box.intervals.items():
            ends = [end for end in (interval.lower, interval.upper) if end is not None]
            for value in (interval.some_value(), *ends):
                fixed = box.replace(name, Interval(value, value))
                if self._no_schedule(fixed, deadline) is not None:
                    box = fixed
                    break
        return {name: interval.some_value() for name, interval in box.intervals.items()}

    def ended_by(self, box: Box, reach: Margins, deadline: Deadline) -> dict[Face, tuple[str, ...]]:
        """For each face, the obligations that break just beyond it, in the plan's order.

        Most break nowhere around the box, so that one question about all faces is enough for them.
        """
        ended: dict[Face, list[str]] = {face: [] for face in reach}
        for question in self._in_order:
            left = [face for face in reach if not question.opened or face[0] in question.parameters]
            for face in self._ended(question, box, {face: reach[face] for face in left}, deadline):
                ended[face].append(question.obligation.name)
        return {face: tuple(names) for face, names in ended.items()}

    def _ended(self, question: ObligationQuestion, box: Box, reach: Margins, deadline: Deadline) -> set[Face]:
        """The faces just beyond which an obligation breaks."""
        ended = set(self._known_ends(question, box, reach))
        groups = [{face: step for face, step in reach.items() if face not in ended}]
        while groups:
            group = groups.pop()
            met = self._ask(question, _moved(box, group), deadline, EFFORTS[-1], []) if group else None
            if met is None:
                continue
            distances = {face: self._distance(met, face, step, box) for face, step in group.items()}
            touched = {face for face, distance in distances.items() if distance == 0}
            ended |= touched
            rest = [face for face in group if face not in touched]
            if touched or len(rest) > 1:
                parts = [rest] if touched else [rest[: len(rest) // 2], rest[len(rest) // 2 :]]
                groups += [{face: group[face] for face in part} for part in parts]
            else:
                groups += [{face: (distances[face] or group[face]) / 2} for face in rest]
        return ended

    def _known_ends(self, question: ObligationQuestion, box: Box, reach: Margins) -> Iterable[Face]:
        """Faces just beyond which an obligation is known to break."""
        return ()

    @abstractmethod
    def _distance(self, obstacle: Found | Facet, face: Face, step: Fraction, box: Box) -> Fraction | None:
        """How far a face has to move alone to meet what was found; 0 if it is as near as counts, None if never."""

    def _ask(
        self, question: ObligationQuestion, box: Box, deadline: Deadline, effort: int, hard: list[ObligationQuestion]
    ) -> Found | None:
        """What is found; a question that needs more than the effort is added to the hard ones."""
        if not question.opened:
            self._open(question, deadline)
        if question.session is None:
            met = next((piece for piece in question.pieces if piece.meets(box)), None)
            return None if met is None else self._of_piece(question, met, box)
        session, proved = question.session, question.proved_for
        # Most intervals are the very objects of the box before.
        if proved is not None and all(
            box[name] is proved[name] or box[name].is_within(proved[name]) for name in question.parameters
        ):
            return None
        with session.frame(*(formula for name in question.parameters for formula in self._bounds(name, box[name]))):
            verdict = session.check(question.obligation.name, deadline, effort)
            if verdict is Satisfiability.SATISFIABLE:
                return self._of_model(question, session, box)
        if verdict is Satisfiability.UNSATISFIABLE:
            question.proved_for = box.intervals
        elif not effort or deadline.passed or session.failure is not None:
            raise OutOfTimeError(session.failure)
        else:
            hard.append(question)
        return None

    def _open(self, question: ObligationQuestion, deadline: Deadline) -> None:
        """Take the query apart, or make a session for it."""
        formulas = self.encoding.query(question.obligation)
        relevant = self.encoding.parameters_in(formulas)
        question.parameters = tuple(name for name in self._names if name in relevant)
        if self._exporter is None and self._takes_apart(question, formulas):
            question.opened = True
            return
        session = self.open_session()
        session.add_all(formulas, deadline)
        # What no parameter values at all can break is not asked about one box after the other.
        verdict = session.check(question.obligation.name, deadline, EFFORTS[0])
        if verdict is Satisfiability.UNKNOWN:
            deadline.enforce()
        if verdict is not Satisfiability.UNSATISFIABLE:
            question.session = session
        question.opened = True

    def _takes_apart(self, question: ObligationQuestion, formulas: Sequence[Formula]) -> bool:
        """Whether the query speaks of parameters alone, and says in few words what breaks the obligation."""
        symbols = {symbol for formula in formulas for symbol in self.encoding.terms.variables(formula)}
        if len(symbols) > len(question.parameters):
            return False
        alternatives = nnf.alternatives_of(nnf.conjunction(map(self.reader.read, formulas)))
        if alternatives is None:
            return False
        question.pieces = tuple(Polyhedron(self._names, constraints) for constraints in alternatives)
        return True

    def _bounds(self, name: str, interval: Interval) -> tuple[Formula, ...]:
        """The bounds of a parameter; from box to box few of them change."""
        known = self._written.get(name)
        if known is None or known[0] is not interval:
            known = self._written[name] = interval, tuple(within(self.encoding, {name: interval}))
        return known[1]


@dataclass(frozen=True)
class Refutation:
    """Why a box is not inside: it holds parameter values without a schedule, or with one that breaks an obligation.

    `reason` names the obligation or the contradicting statements, `values` are the parameter values, `facet` is what
    they break if it is an inequality over parameters.
    """

    reason: str
    values: Mapping[str, Fraction]
    facet: Facet | None = None


class Containment(Questions[Callable[[], Refutation]]):
    """Decides boxes; where a solver has found a point, a box that contains it is not asked about again."""

    @cached_property
    def _refuted(self) -> list[Refutation]:
        """By models: what a facet or a piece breaks is found again sooner than among many points."""
        return []

    def contains(self, box: Box, deadline: Deadline) -> bool:
        """Whether the box is inside the envelope.

        Raises:
            OutOfTimeError: if the deadline passes first.
        """
        return self._met_before(box) is None and self._look_in(box, deadline) is None

    def _met_before(self, box: Box) -> Refutation | None:
        """A point of the box that was found to break the plan, the last one first."""
        return next((known for known in reversed(self._refuted) if box.includes(known.values)), None)

    def keeps(self, box: Box, deadline: Deadline) -> bool:
        """Whether all schedules keep all obligations for values in the box; some values may leave no schedule.

        Raises:
            OutOfTimeError: if the deadline passes first.
        """
        return self._broken_in(box, deadline) is None

    def refute(self, box: Box, deadline: Deadline) -> Refutation | None:
        """Why the box is not inside the envelope; None if it is.

        Raises:
            OutOfTimeError: if the deadline passes first.
        """
        if (known := self._met_before(box)) is not None:
            return known
        obstacle = self._look_in(box, deadline)
        return None if obstacle is None else obstacle()

    def _known_ends(self, question: ObligationQuestion, box: Box, reach: Margins) -> Iterable[Face]:
        points = [known.values for known in self._refuted if known.reason == question.obligation.name]
        return (face for face, step in reach.items() if any(map(_moved(box, {face: step}).__contains__, points)))

    def _distance(
        self, obstacle: Callable[[], Refutation] | Facet, face: Face, step: Fraction, box: Box
    ) -> Fraction | None:
        """0 if it is met within the step."""
        beyond = _moved(box, {face: step})
        met = obstacle.breaks_in(beyond.grid) if isinstance(obstacle, Facet) else beyond.includes(obstacle().values)
        return Fraction(0) if met else None

    def _of_facet(self, facet: Facet, box: Box) -> Callable[[], Refutation]:
        def refutation() -> Refutation:
            values = worst_point(facet, box)
            return Refutation(facet.obligation or no_schedule(facet, values), values, facet)

        return refutation

    def _of_piece(self, question: ObligationQuestion, piece: Polyhedron, box: Box) -> Callable[[], Refutation]:
        def refutation() -> Refutation:
            point = piece.restricted(box.constraints()).some_point()
            if point is None:
                raise ValueError(f"{piece} meets {box}, but no point is in both")
            return Refutation(question.obligation.name, point)

        return refutation

    def _of_model(self, question: ObligationQuestion, session: Session, box: Box) -> Callable[[], Refutation]:
        symbols = [self.encoding.terms.real(ParameterReference(name)) for name in box.intervals]
        values = session.values(symbols)
        point = {name: Fraction(values.get(name, box[name].some_value())) for name in box.intervals}
        refutation = Refutation(question.obligation.name, point)
        self._refuted.append(refutation)
        return lambda: refutation


def _moved(box: Box, reach: Margins) -> Box:
    """The box with some of its finite faces farther out."""
    for face, step in reach.items():
        end = box[face[0]].end(face[1])
        if end is not None:
            box = box.moved(face, end + face[1].sign * step)
    return box
