"""Searches that know what is bad: exact widening, and the box of greatest weighted width Σ ω(u − l) [IRR §5, CCMMZ].

A box misses a bad polyhedron if and only if its ends break one of the inequalities of that polyhedron's projection onto
the ends of the boxes that meet it; so each known bad polyhedron is a clause over the 2n ends, and the best box is found
as in :mod:`robust.irr.conflicts`. It is checked against the envelope, and a bad point in it adds a polyhedron. When it
is inside it is optimal: no box that misses even the known polyhedra is better.

:class:`BoxMethod` names the methods that find a box, IRR among them, and holds what each of them can be given.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from itertools import product
from typing import Any, Unpack

from robust.encode.interface import Encoding, Linear, variable
from robust.errors import UnsupportedError
from robust.irr import corners, proposals, stops, templates
from robust.irr import search as searching
from robust.irr.check import require_some_schedule
from robust.irr.conflicts import Candidate, Chosen, Clause, MasterProblem, Point
from robust.irr.containment import Containment, Margins, Questions
from robust.irr.questions import Manner, PlanQuestion
from robust.irr.search import BoxSearch, Conduct, EnvelopeResult, OutsideError, Step, ordered
from robust.irr.widen import BadSet, DiscoveredBadSet, Obstacle, Widening, faces_of
from robust.network.slack import OutsideFragmentError
from robust.plan.model import ParameterReference, ParametrizedPlan
from robust.plan.polynomial import Polynomial
from robust.qe import compute, simplex
from robust.qe.box import Box, Face, Interval, Side
from robust.qe.constraint import LinearConstraint
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region
from robust.searching import Searching, Status
from robust.smt import limits, session

ENUMERATION = 20.0
"""Seconds at most that the optimal box spends on knowing the envelope before it starts."""
REACH = Fraction(1_000_000)
"""How far from zero ends are looked for at first, in multiples of the greatest nominal value."""
FARTHEST = Fraction(2**80)
"""Where the search for ever wider boxes ends: the envelope has no widest one, nor an infinite one."""


class ExactSearch(BoxSearch):
    """Exact widening or the optimal box over a discovered bad set.

    `widen` is the max–min fair maximal box; with an order, as far as possible parameter by parameter in that order.
    `optimal` is the box of greatest weighted width, anywhere in the envelope or around the nominal point.

    Args:
        encoding: the plan's formulas.
        method: `widen` or `optimal`.
        order: for `widen`, see above.
        contain_nominal: for `optimal`, only boxes that contain the nominal point.
        solver: `z3` or `cvc5`.
        exporter: where queries are written, if anywhere.
        conduct: see :class:`Conduct`; `on_step` is called with every box that is known to be inside.

    Raises:
        InputError: if `order` names unknown or repeated parameters.
    """

    def __init__(
        self,
        encoding: Encoding,
        *,
        method: str = "widen",
        order: Sequence[str] = (),
        contain_nominal: bool = False,
        solver: str = "z3",
        exporter: session.Exporter | None = None,
        **conduct: Unpack[Conduct],
    ) -> None:
        self._bad = DiscoveredBadSet(encoding, solver=solver, exporter=exporter)
        self._best: OptimalBox | None = None
        self._contain_nominal = contain_nominal
        self._pieces: list[Polyhedron] = []
        parameters = encoding.plan.parameters
        turns = [[parameter] for parameter in ordered(parameters, order)] if order else [parameters]
        self._groups = [faces_of(turn) for turn in turns]
        self._by_paths = method == "widen" and not order and exporter is None and encoding.name == "relational"
        self._proposed = False
        super().__init__(self._bad, method=method, **conduct)
        self.contain_nominal = method != "optimal" or contain_nominal

    @property
    def checks(self) -> int:
        return self._bad.checks

    @property
    def bound(self) -> Fraction | None:
        return self._best.bound if self._best is not None else None

    def _search(self) -> None:
        if self.method == "widen":
            self._widen()
            return
        if self._contain_nominal or self._bad.piece_in(self.box, self.deadline) is None:
            # A good box at once, and the pieces that shape it.
            self._widen()
        known: list[Obstacle] = [*self._pieces, *self._enumerated()]
        self._best = OptimalBox(
            bad=self._bad, pieces=known, contain_nominal=self._contain_nominal, deadline=self.deadline
        )
        self._keep(self._best.run())

    def _widen(self) -> None:
        """Widen from the nominal point, and add the bad polyhedra that shape the box to the pieces."""
        if self._by_paths and self._is_proposed():
            return
        piece = self._bad.piece_in(self.box, self.deadline)
        if piece is not None:
            if piece in self._bad.existence:
                require_some_schedule(self.encoding, self._bad.open_session(), self.deadline)
            raise OutsideError(self._bad.reasons[piece], self.encoding.plan.nominal)
        self.verified = True
        Widening(
            bad=self._bad,
            parameters=self.encoding.plan.parameters,
            pieces=self._pieces,
            groups=self._groups,
            deadline=self.deadline,
            on_box=self._keep,
        ).run()

    def _is_proposed(self) -> bool:
        """Whether shortest paths find the widest box, and it is proved."""
        encoding = self.encoding
        try:
            proposal = proposals.propose(encoding.plan, encoding.epsilon, self.deadline)
        except OutsideFragmentError as error:
            self.fallback = str(error)
            return False
        self._bad.checks += 1
        left = self.deadline.remaining
        soon = self.deadline if left is None else limits.Deadline.after(left / 2)
        plan, epsilon, box = encoding.plan, encoding.epsilon, proposal.box
        try:
            proved = proposals.is_inside(
                plan, box, epsilon, soon, solver=self._bad.solver, statistics=self._bad.statistics
            )
        except limits.OutOfTimeError:
            proved = False
        self.deadline.enforce()
        if not proved:
            self.fallback = "the box that shortest paths found could not be proved"
            return False
        self._stops.update(proposal.stops)
        self._proposed = True
        self._keep(proposal.box)
        return True

    def _enumerated(self) -> list[Polyhedron]:
        """Bad polyhedra by enumeration, for a while: they are larger than what single boxes run into."""
        remaining = self.deadline.remaining
        result = compute.RegionSearch(
            self.encoding.plan,
            epsilon=self.encoding.epsilon,
            solver=self._bad.solver,
            encoding=self.encoding.name,
            timeout=ENUMERATION if remaining is None else min(ENUMERATION, remaining / 2),
            lift=False,
        ).run()
        if result.status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        difference = result.region.as_difference()
        outside = difference.base.complement() if difference.base is not None else []
        return [*outside, *difference.pieces]

    def _margins(self) -> Margins:
        if self._proposed:
            return {}
        return {
            (parameter.name, side): stops.JUST
            for parameter, side in product(self.encoding.plan.parameters, Side)
            if (end := self.box[parameter.name].end(side)) is not None
            and stops.declared_stop(parameter, side, end) is None
        }

    def _keep(self, box: Box) -> None:
        self.verified = True
        self._accept(box)
        self._record(self._bad.checks, accepted=True)


class OptimalBox(MasterProblem[Fraction]):
    """One search for the widest box; points are its ends, and it costs less the wider it is.

    Args:
        bad: the bad set.
        pieces: bad polyhedra that are known already, and other obstacles.
        contain_nominal: only boxes that contain the nominal point.
        deadline: when to stop.
        inside: where boxes are looked for, if that is less than what is not bad.
    """

    QUESTION = "a wider box that misses what is known"

    def __init__(
        self,
        *,
        bad: DiscoveredBadSet,
        pieces: list[Obstacle],
        contain_nominal: bool,
        deadline: limits.Deadline,
        inside: BadSet | None = None,
    ) -> None:
        super().__init__(solver=bad.solver, deadline=deadline)
        self._bad = bad
        self._pieces = pieces
        self._contain_nominal = contain_nominal
        self._inside = inside or bad
        self._parameters = bad.encoding.plan.parameters
        self._faces = faces_of(self._parameters)
        self._ends = [end_of(face) for face in self._faces]
        self._reach = REACH * max([Fraction(1), *(abs(parameter.nominal) for parameter in self._parameters)])
        weights = {parameter.name: parameter.weight for parameter in self._parameters}
        self._objective = {end_of((name, side)): side.sign * weights[name] for name, side in self._faces}

    @property
    def bound(self) -> Fraction | None:
        """What no box is wider than, in weighted width; None if not finite or not known."""
        return None if self.lowest is None else -self.lowest

    def run(self) -> Box:
        """Search until the best box is proved optimal; `bound` is then its weighted width over finite sides.

        Raises:
            OutOfTimeError: if the deadline passes first; no box is wider than `bound`.
            OutsideError: if no parameter values are inside.
            InputError: if no parameter values even leave a schedule.
        """
        while True:
            candidate = self._widest_known()
            box = self._box_at(candidate)
            far = [face for face in self._faces if abs(candidate.point[end_of(face)]) == self._reach]
            self.lowest = None if far else candidate.cost
            piece = self._bad_piece(box)
            if piece is None and not far:
                return self._with_ends_closed(box)
            if piece is None:
                unbounded = box
                for face in far:
                    unbounded = unbounded.moved(face, None)
                piece = self._bad_piece(unbounded)
                if piece is None or self._reach > FARTHEST:
                    return unbounded if piece is None else box
                self._reach *= 2
            elif piece in self._pieces:
                # Only approached, and from a side where some parameter has no room: take a box just short of it.
                return self._box_just_below(candidate)
            self._pieces.append(piece)

    def _bad_piece(self, box: Box) -> Obstacle | None:
        return self._inside.piece_in(box, self.deadline)

    # -- the best box that misses the known pieces --------------------------------------------------------------------

    def _widest_known(self) -> Candidate[Fraction]:
        """The widest box that misses every known piece, proved by an unsatisfiable query for a wider one."""
        self.clauses += [Clause(missing(piece, self._ends)) for piece in self._pieces[len(self.clauses) :]]
        candidate = self.best_known()
        if candidate is None:
            require_some_schedule(self._bad.encoding, self._bad.open_session(), self.deadline)
            reason = "the envelope is empty: no parameter values are inside"
            plan = self._bad.encoding.plan
            raise OutsideError(reason, plan.nominal if plan.has_nominal else {})
        return candidate

    def cheapest(self, chosen: Chosen, point: Point) -> Candidate[Fraction] | None:
        best = simplex.maximize(self._ends, [*self.always(), *chosen.values()], self._objective)
        if best is None or best.value is None:
            return None
        return Candidate(chosen, best.point, -best.value, best.attained)

    def cheaper(self, cost: Fraction) -> session.Formula:
        width = sum((variable(ParameterReference(n)).scaled(f) for n, f in self._objective.items()), _ZERO)
        return self.terms.greater(width + cost)

    def symbols(self) -> Iterable[str]:
        return self._ends

    def always(self) -> Iterator[LinearConstraint]:
        """Lower ends below upper ends, all within reach, and around the nominal point where that is asked for."""
        for parameter in self._parameters:
            low, high = end_of((parameter.name, Side.LOWER)), end_of((parameter.name, Side.UPPER))
            yield LinearConstraint.of({low: 1, high: -1}, "<=", 0)
            yield LinearConstraint.of({low: 1}, ">=", -self._reach)
            yield LinearConstraint.of({high: 1}, "<=", self._reach)
            if self._contain_nominal:
                yield LinearConstraint.of({low: 1}, "<=", parameter.nominal)
                yield LinearConstraint.of({high: 1}, ">=", parameter.nominal)

    # -- from ends to boxes --------------------------------------------------------------------------------------------

    def _box_at(self, candidate: Candidate[Fraction]) -> Box:
        """The box at the ends; if its width is only approached, without the ends of sides that have any width.

        Ends at the nominal point stay where the box is to contain it.
        """
        intervals = {}
        for parameter in self._parameters:
            low = candidate.point[end_of((parameter.name, Side.LOWER))]
            high = candidate.point[end_of((parameter.name, Side.UPPER))]
            closed = candidate.attained or low == high
            kept = parameter.nominal if self._contain_nominal else None
            intervals[parameter.name] = Interval(low, high, closed or low == kept, closed or high == kept)
        return Box(intervals)

    def _with_ends_closed(self, box: Box) -> Box:
        """Close every open end that allows it, one after the other."""
        for name in box.intervals:
            for side in Side:
                if not box[name].is_closed_at(side):
                    closed = box.moved((name, side), box[name].end(side))
                    if self._bad_piece(closed) is None:
                        box = closed
        return box

    def _box_just_below(self, candidate: Candidate[Fraction]) -> Box:
        """A box of the same width but for its open ends, or if there is none, a closed one that is a little narrower.

        Strict bounds on sides without any width must be kept; those on the others are what the open ends stand for.
        """
        flat = {
            end_of((name, side))
            for name, interval in self._box_at(candidate).intervals.items()
            for side in Side
            if interval.width == 0
        }
        strict = [*self.always(), *candidate.chosen.values()]
        kept = [c if flat & set(c.parameters) else c.closed() for c in strict]
        for shortfall in (Fraction(0), max(-candidate.cost, Fraction(1)) / 1_000_000):
            least = LinearConstraint.of(self._objective, ">=", -candidate.cost - shortfall)
            ends = simplex.feasible_point(self._ends, [*(strict if shortfall else kept), least])
            if ends is not None:
                box = self._box_at(replace(candidate, point=ends, attained=bool(shortfall)))
                piece = self._bad_piece(box)
                if piece is None:
                    return box if shortfall else self._with_ends_closed(box)
                if piece not in self._pieces:
                    self._pieces.append(piece)
                    return self.run()
        raise ValueError("a supremum is approached from within the constraints")


_ZERO: Linear = Polynomial({})


def missing(piece: Obstacle, ends: Sequence[str]) -> tuple[LinearConstraint, ...]:
    """A box misses the piece if and only if its ends, the variables of :func:`end_of`, satisfy one of these."""
    if not isinstance(piece, Polyhedron):
        rooms = piece.rooms
        return tuple(LinearConstraint.of({end_of(face): f for face, f in fs.items()}, ">=", -c) for fs, c in rooms)
    constraints = list(piece.constraints)
    for name, side in product(piece.parameters, (Side.UPPER, Side.LOWER)):
        if name in piece.mentioned:
            constraints.append(LinearConstraint.of({name: side.sign, end_of((name, side)): -side.sign}, "<=", 0))
    meeting = Polyhedron((*piece.parameters, *ends), tuple(constraints)).project(ends)
    return tuple(negated for constraint in meeting.constraints for negated in constraint.negation())


def end_of(face: Face) -> str:
    """The variable for an end; no parameter can have such a name."""
    return f"{face[1].value} end of {face[0]}"


@dataclass(frozen=True, slots=True)
class BoxMethod:
    """How a box is found.

    Attributes:
        name: `widen`, `irr` or `optimal`.
        beta: the precision of `irr`, in the parameters' units.
        doubling: whether `irr` doubles its steps until the first failure, as in its published runs.
        order: parameters in the order in which `irr` and `widen` take them; others follow in the plan's order.
        contain_nominal: whether the `optimal` box must contain the nominal point; other boxes always do.
    """

    name: str = "widen"
    beta: Fraction = Fraction(1)
    doubling: bool = False
    order: tuple[str, ...] = ()
    contain_nominal: bool = True

    def search(
        self, formulas: Encoding, *, solver: str, exporter: session.Exporter | None = None, **conduct: Unpack[Conduct]
    ) -> BoxSearch:
        """The search for a box of a plan.

        Raises:
            InputError: if `order` names unknown or repeated parameters.
            UnsupportedError: if there are products of two unknowns that corners do not decide, or with other methods.
        """
        decided = corners.corner_containment(formulas, solver=solver)
        if decided is not None and self.name == "widen" and not self.order:
            return corners.CornerWidening(decided, **conduct)
        if self.name == "irr":
            containment = decided or Containment(formulas, solver=solver, exporter=exporter)
            search = searching.IncrementalRobustification(
                containment, beta=self.beta, doubling=self.doubling, order=self.order, **conduct
            )
            search.fallback = None if decided is None else decided.reason
            return search
        return ExactSearch(
            formulas,
            method=self.name,
            order=self.order,
            contain_nominal=self.contain_nominal,
            solver=solver,
            exporter=exporter,
            **conduct,
        )


class EnvelopeQuestion(PlanQuestion[EnvelopeResult]):
    """For which box of values is the plan valid?

    Args:
        plan: the plan.
        manner: how it is asked about.
        method: how the box is found.
        shape: the name of a shape that is then widened around the box, and its directions, if one is.
        on_step: called after each step with the best box so far.
    """

    def __init__(
        self,
        plan: ParametrizedPlan,
        manner: Manner,
        method: BoxMethod,
        *,
        shape: tuple[str, Sequence[templates.Direction]] | None = None,
        on_step: Callable[[Step], None] | None = None,
    ) -> None:
        super().__init__(plan, manner)
        self.method = method
        self._shape = shape
        self._on_step = on_step
        self._questions: Questions[Any] | None = None

    def search(self, formulas: Encoding) -> Searching[EnvelopeResult]:
        search = self.method.search(
            formulas,
            solver=self.manner.solver,
            exporter=self.manner.exporter,
            deadline=self.manner.deadline,
            on_step=self._on_step,
        )
        self._questions = search.questions
        return search

    def nothing(self, *, timed_out: bool) -> EnvelopeResult:
        return EnvelopeResult(
            status=Status.TIMEOUT if timed_out else Status.INTERRUPTED,
            method=self.method.name,
            encoding=self.manner.encoding,
            solver=self.manner.solver,
            beta=self.method.beta if self.method.name == "irr" else None,
            parameters=self.plan.parameters,
            box=Box.nothing(self.plan.parameters),
            checks=0,
            unbounded_checks=0,
            first_widening_seconds=None,
            seconds=self.seconds,
            plan=self.plan,
        )

    def completed(self, result: EnvelopeResult) -> EnvelopeResult:
        result = corners.with_inner(result, self._questions, self.manner.deadline)
        if result.inner is not None:
            return result
        if not result.verified or result.cut_short:
            return result
        if result.contain_nominal:
            result = replace(result, tolerance=self.tolerance(result.box))
        return result if self._shape is None else self._shaped(result, *self._shape)

    def _shaped(self, result: EnvelopeResult, name: str, directions: Sequence[templates.Direction]) -> EnvelopeResult:
        """The box with a shape around it, inside the envelope."""
        manner = self.manner
        region = compute.RegionSearch(
            self.plan,
            epsilon=manner.epsilon,
            solver=manner.solver,
            timeout=manner.deadline.remaining,
            find_box=partial(proposals.known_box, self.plan, manner.epsilon, manner.solver),
        ).run()
        if not region.is_exact:
            return replace(result, status=Status(region.status.value), reason=region.reason)
        if not isinstance(region.region, Region):
            raise UnsupportedError("the envelope has too many inequalities for a shape; use --shape box")
        try:
            shape = templates.widened(
                directions, self.plan.parameters, region.region, result.box, name=name, deadline=manner.deadline
            )
        except (limits.OutOfTimeError, KeyboardInterrupt) as error:
            return replace(
                result, status=Status.TIMEOUT if isinstance(error, limits.OutOfTimeError) else Status.INTERRUPTED
            )
        return replace(result, shape=shape)
