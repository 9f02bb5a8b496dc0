"""Why no valid box contains a box: for each face, bad parameter values arbitrarily near to it, and how they are bad.

Values beyond a face are written with an infinitesimal ε > 0: a + ε·(q − a), where a is on the face and q beyond. Both
satisfy the closure of one conjunction of constraints that makes a schedule break an obligation, and q satisfies the
conjunction itself; then so does every point between them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from robust.certify.ground import GroundPlan, Line, Step, length_of, number, positive_cycle
from robust.encode.interface import Encoding, Obligation
from robust.errors import UnsupportedError
from robust.irr.containment import within
from robust.irr.widen import DiscoveredBadSet
from robust.plan.model import TimePoint
from robust.plan.simulate import simulate
from robust.qe.box import Box, Interval, Side
from robust.qe.constraint import LinearConstraint
from robust.qe.nnf import Reader, conjunction, implicant, names_in
from robust.qe.polyhedron import Polyhedron
from robust.qe.simplex import feasible_point, maximize
from robust.smt.limits import Deadline, OutOfTimeError
from robust.smt.session import Verdict

Point = Mapping[str, Fraction]


@dataclass(frozen=True, slots=True)
class Approach:
    """Values `limit + ε·(inside − limit)`; where both are equal, a point."""

    limit: Point
    inside: Point

    def at(self, step: Fraction) -> dict[str, Fraction]:
        """The values for a concrete ε."""
        return {name: near + step * (self.inside[name] - near) for name, near in self.limit.items()}

    def line(self, near: Fraction, far: Fraction) -> Any:
        return number(near) if near == far else [number(near), number(far - near)]

    def values(self, names: Iterator[str] | list[str]) -> Line:
        return [self.line(self.limit[name], self.inside[name]) for name in names]


class Witnesses:
    """Finds a witness for each face of a box that can be moved at all.

    Args:
        encoding: the plan's formulas.
        ground: the plan as certificates state it.
        box: a box inside the envelope.
        deadline: when to give up, with OutOfTimeError.
        solver: `z3` or `cvc5`.
    """

    def __init__(
        self, encoding: Encoding, ground: GroundPlan, box: Box, *, deadline: Deadline, solver: str = "z3"
    ) -> None:
        self._encoding = encoding
        self._ground = ground
        self._box = box
        self._deadline = deadline
        self._bad = DiscoveredBadSet(encoding, solver=solver)
        self._reader = Reader(encoding.terms)
        self._obligations = {obligation.name: obligation for obligation in encoding.obligations}
        self._names = [parameter.name for parameter in encoding.plan.parameters]

    def lines(self) -> Iterator[Line]:
        """A line of the certificate for each face that is neither infinite nor a declared bound.

        Raises:
            UnsupportedError: if no witness is found: the box is not maximal, or a witness cannot be written down.
            OutOfTimeError: if the deadline passes.
        """
        for index, parameter in enumerate(self._encoding.plan.parameters):
            interval = self._box[parameter.name]
            if interval.lower is not None and not (interval.lower_closed and interval.lower == parameter.lower):
                yield self._face(index, Side.LOWER)
            if interval.upper is not None and not (interval.upper_closed and interval.upper == parameter.upper):
                yield self._face(index, Side.UPPER)

    # -- beyond one face -----------------------------------------------------------------------------------------------

    def _face(self, index: int, side: Side) -> Line:
        name, interval = self._names[index], self._box[self._names[index]]
        end, closed = interval.end(side), interval.is_closed_at(side)
        if end is None:
            raise ValueError("an infinite face needs no witness")
        reach = end + side.sign
        while True:
            beyond = self._beyond(name, side, end, closed, reach)
            piece = self._bad.piece_in(beyond, self._deadline)
            if piece is None:
                raise UnsupportedError(f"no bad values at the {side.value} end of {name}: the box is not maximal")
            nearest = self._nearest(list(piece.constraints), list(piece.parameters), beyond, name, side)
            if nearest is not None and nearest.limit[name] == end:
                line = self._explain(piece, nearest, beyond=beyond, index=index, side=side, end=end)
                if line is not None:
                    return line
                raise UnsupportedError(f"no witness that can be written down at the {side.value} end of {name}")
            reach = (end + nearest.limit[name]) / 2 if nearest is not None else (end + reach) / 2

    def _beyond(self, name: str, side: Side, end: Fraction, closed: bool, reach: Fraction) -> Box:
        """What the box grows by if the face moves as far as `reach`, or if its end becomes part of it."""
        if not closed:
            return self._box.replace(name, Interval(end, end))
        if side is Side.UPPER:
            return self._box.replace(name, Interval(end, reach, lower_closed=False))
        return self._box.replace(name, Interval(reach, end, upper_closed=False))

    def _nearest(
        self, constraints: list[LinearConstraint], names: list[str], beyond: Box, name: str, side: Side
    ) -> Approach | None:
        """The point of a polyhedron beyond the face that is nearest to it, and one inside."""
        everything = [*constraints, *beyond.constraints()]
        inside = feasible_point(names, everything)
        if inside is None:
            return None
        best = maximize(names, everything, {name: Fraction(-side.sign)})
        if best is None or best.value is None:
            return None
        return Approach(inside, inside) if best.point[name] == inside[name] else Approach(best.point, inside)

    def _explain(
        self, piece: Polyhedron, nearest: Approach, *, beyond: Box, index: int, side: Side, end: Fraction
    ) -> Line | None:
        obligation = self._obligations.get(self._bad.reasons[piece])
        if obligation is not None:
            found = self._breaking(obligation, beyond, self._names[index], side, end)
            if found is not None:
                return ["witness", self._names[index], side.value, *self._schedule(obligation, found)]
        steps = self._cycle(nearest)
        return None if steps is None else ["cycle", self._names[index], side.value, nearest.values(self._names), steps]

    # -- schedules that break an obligation ----------------------------------------------------------------------------

    def _breaking(self, obligation: Obligation, beyond: Box, name: str, side: Side, end: Fraction) -> Approach | None:
        """Parameter values and times, up to the face, with which the obligation breaks in one and the same way."""
        encoding = self._encoding
        formulas = encoding.full_query(obligation)
        while True:
            session = self._bad.open_session()
            session.add_all([*formulas, *within(encoding, beyond.intervals)], self._deadline)
            verdict = session.check(f"{obligation.name}: beyond {name}", self._deadline)
            if verdict is Verdict.UNKNOWN:
                raise OutOfTimeError(session.failure)
            if verdict is Verdict.UNSATISFIABLE:
                return None
            symbols = {symbol for formula in session.assertions for symbol in encoding.terms.variables(formula)}
            chosen: dict[Any, None] = {}
            implicant(conjunction(map(self._reader.read, formulas)), session.values(symbols), chosen)
            constraints = [leaf for leaf in chosen if isinstance(leaf, LinearConstraint)]
            unknowns = [symbol.symbol_name() for symbol in encoding.unknowns()]
            names = sorted(names_in(conjunction(constraints)) | set(unknowns))
            nearest = self._nearest(constraints, names, beyond, name, side)
            if nearest is None or nearest.limit[name] == end:
                return nearest
            beyond = self._beyond(name, side, end, True, (end + nearest.limit[name]) / 2)

    def _schedule(self, obligation: Obligation, approach: Approach) -> Iterator[Any]:
        """Values of parameters, times, and what is broken."""
        times = [self._times(dict(point)) for point in (approach.limit, approach.inside)]
        yield approach.values(self._names)
        points = self._encoding.plan.time_points
        yield [approach.line(times[0][point], times[1][point]) for point in points]
        yield from self._broken(obligation.name, approach)

    def _times(self, values: dict[str, Fraction]) -> dict[TimePoint, Fraction]:
        return self._encoding.schedule(values)

    def _broken(self, name: str, approach: Approach) -> Line:
        """The obligation in the checker's terms."""
        for index, ((_, end, *_), label) in enumerate(self._ground.conditions):
            if name == label:
                return ["condition", index, None if end is None else self._instant(name, approach)]
        numbers = {str(point): index for point, index in self._ground.numbers.items()}
        first, _, second = name.removeprefix("separation: ").partition(", ")
        return ["separation", numbers[first], numbers[second]]

    def _instant(self, name: str, approach: Approach) -> Any:
        """When an over-all condition is false: a linear function of ε, found by executing the schedule for small ε."""
        steps = [Fraction(1, 2**power) for power in (20, 21, 22)]
        first, second, third = (self._moment(name, approach, step) for step in steps)
        slope = (first - second) / (steps[0] - steps[1])
        start = first - slope * steps[0]
        if start + slope * steps[2] != third:
            raise UnsupportedError(f"the instant at which {name!r} breaks is not linear near the face")
        return approach.line(start, start + slope)

    def _moment(self, name: str, approach: Approach, step: Fraction) -> Fraction:
        plan, values = self._encoding.plan, approach.at(step)
        parameters = {parameter: values[parameter] for parameter in self._names}
        done = simulate(plan, parameters, self._times(values), epsilon=self._encoding.epsilon)
        times = [violation.time for violation in done.violations if violation.obligation == name]
        if not times or done.network_violations:
            raise UnsupportedError(f"the simulator does not confirm that {name!r} breaks near the face")
        return times[0]

    # -- values without any schedule -----------------------------------------------------------------------------------

    def _cycle(self, approach: Approach) -> list[Step] | None:
        """Constraints of the network in a circle whose least lengths add up to more than zero near the face."""
        step = Fraction(1)
        for _ in range(40):
            cycle = positive_cycle(self._ground, approach.at(step))
            if cycle is None:
                return None
            limit, inside = (length_of(self._ground, cycle, point) for point in (approach.limit, approach.inside))
            if limit > 0 or (limit == 0 and inside > 0):
                return cycle
            step /= 1024
        return None
