"""Envelopes of plans with choices for people and programs: documents, and sentences about combinations of choices."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from typing import Annotated, Any

from robust.json_text import Count, End, JsonObject, Rational, Seconds, like, one_of
from robust.numbers import duration, exact_end, plural, readable
from robust.pike_bridge.envelopes.parameters import ParametricPlan, TeamParameter, TeamParameterKind
from robust.pike_bridge.envelopes.pieces import BoundStatement, Combination, OrderStatement, Statement, WaitingStatement
from robust.pike_bridge.envelopes.search import LabeledRegion, TeamEnvelope, TeamStop
from robust.pike_bridge.model import Guard, guard_text
from robust.plan.polynomial import Polynomial
from robust.qe.box import Interval, Side, interval_text
from robust.qe.constraint import LinearConstraint, Sense
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region, absorb, signed_sum
from robust.searching import Status
from robust.show.console import Console, printing
from robust.show.documents import SIDES, Document, Ended, SearchEnded, document_of, documenting, ends_of, has_table
from robust.show.region_documents import ConstraintRecord, PolyhedronRecord, rows_of

MANY = 20
"""Combinations that are told one by one."""
STATEMENTS = 6
"""Statements that are told of what ends a side."""


# -- JSON --------------------------------------------------------------------------------------------------------------


class TeamParameterRecord(JsonObject):
    """
    Attributes:
        meaning: for people
        lower: the declared bound
        upper: the declared bound
    """

    kind: Annotated[str, one_of(*(kind.value for kind in TeamParameterKind))]
    meaning: str
    nominal: Rational
    lower: End
    upper: End


class PossibleCombination(JsonObject):
    """
    Attributes:
        choices: values of choices; those left out do not matter
        polyhedra: the parameter values, within their declared bounds, for which a correct execution has these values;
            none: it is impossible, as far as is known
    """

    choices: dict[str, str]
    polyhedra: list[PolyhedronRecord]


class ExactCell(JsonObject):
    """
    Attributes:
        possible: the combinations that are possible for these parameter values, and no others are
    """

    possible: list[dict[str, str]]
    polyhedra: list[PolyhedronRecord]


class PikeRegion(JsonObject, tag_field="schema", tag="robust/pike-region/1"):
    """what `robust pike region --json` prints

    Attributes:
        status: timeout and interrupted: what is there is right, but not all there is
        choices: those that are distinguished
        combinations: they cover all values of these choices, each once
        exactly: the parameter values, cut by which combinations are possible; null if there was no time
        queries: questions to the solver
    """

    status: Ended
    assume: dict[str, str]
    choices: list[str]
    epsilon: Rational
    parameters: dict[str, TeamParameterRecord]
    combinations: list[PossibleCombination]
    exactly: list[ExactCell] | None
    queries: Count
    seconds: Seconds


class StoppedBy(JsonObject):
    """
    Attributes:
        choices: with which values of choices nothing correct is left beyond; empty: with all
        constraint: which inequality the parameters must satisfy; null for a declared bound
        statements: what of the plan says so
        reason: as text
    """

    choices: dict[str, str]
    constraint: str | None
    statements: list[str]
    reason: str


class TeamWithin(JsonObject):
    """
    Attributes:
        stopped_below: what ends the box there; null if unbounded or not known
    """

    kind: Annotated[str, one_of(*(kind.value for kind in TeamParameterKind))]
    meaning: str
    nominal: Rational
    lower: End
    upper: End
    lower_closed: bool
    upper_closed: bool
    stopped_below: StoppedBy | None
    stopped_above: StoppedBy | None


class BrokenCombination(JsonObject):
    """
    Attributes:
        choices: for which there is no correct execution at the nominal values
        possible: whether there is one for other parameter values
        needed: inequalities that the nominal values break, of those that would do
    """

    choices: dict[str, str]
    possible: bool
    needed: list[str]


class PikeEnvelope(JsonObject, tag_field="schema", tag="robust/pike-envelope/1"):
    """what `robust pike envelope --json` prints

    Attributes:
        status: invalid: what is asked for is not even so at the nominal values; timeout and interrupted: the box is
            right if verified, but may not be maximal
        verified: what is promised holds for all values in the box; if false, there are none in it: both ends are the
            nominal values, and open
        for_all: the choices of which every combination of values leads to a correct execution
        waiting: whether what they will be need not be known before they are made
        broken: if invalid: which combination is
        polyhedra: the parameter values for which what is promised holds, within the declared bounds; null if they are
            not all known
        boxes: tried by widening
    """

    status: SearchEnded
    verified: bool
    assume: dict[str, str]
    for_all: list[str]
    waiting: bool
    epsilon: Rational
    parameters: dict[str, TeamWithin]
    broken: BrokenCombination | None
    polyhedra: list[PolyhedronRecord] | None
    queries: Count
    boxes: Count
    seconds: Seconds


Cells = Sequence[tuple[tuple[Combination, ...], Region]]


def _choices(label: Guard) -> dict[str, str]:
    return dict(sorted(label))


def _polyhedra(pieces: Iterable[Polyhedron]) -> list[PolyhedronRecord]:
    return [PolyhedronRecord(constraints=list(map(_constraint, piece.constraints))) for piece in pieces]


def _constraint(constraint: LinearConstraint) -> ConstraintRecord:
    coefficients = {name: Fraction(factor) for name, factor in constraint.coefficients}
    return ConstraintRecord(coefficients=coefficients, relation=constraint.relation.value, constant=constraint.constant)


@documenting.register(LabeledRegion)
def whole_region_document(region: LabeledRegion) -> Document:
    """With the exact cells."""
    return region_document(region, cells_of(region))


def cells_of(region: LabeledRegion) -> Cells | None:
    return None if region.cut_short else region.exactly()


def region_document(region: LabeledRegion, cells: Cells | None) -> Document:
    """`robust/pike-region/1`."""
    combinations = [
        PossibleCombination(choices=_choices(entry.choices), polyhedra=_polyhedra(tidy(region.plan, entry.polyhedra)))
        for entry in region.combinations
    ]
    exactly = None
    if cells is not None:
        exactly = [
            ExactCell(
                possible=[_choices(combination.choices) for combination in possible],
                polyhedra=_polyhedra(_tidied(cell)),
            )
            for possible, cell in cells
        ]
    return document_of(
        PikeRegion,
        region,
        assume=_choices(region.assume),
        choices=region.key,
        epsilon=region.plan.plan.epsilon,
        parameters={
            parameter.name: TeamParameterRecord(
                kind=parameter.kind.value,
                meaning=parameter.meaning,
                nominal=parameter.parameter.nominal,
                lower=exact_end(parameter.parameter.lower, upper=False),
                upper=exact_end(parameter.parameter.upper, upper=True),
            )
            for parameter in region.plan.parameters
        },
        combinations=combinations,
        exactly=exactly,
    )


def possible_rows(region: Document) -> list[Document]:
    """The constraints under which each combination of choices is possible, piece by piece."""
    pieces = [
        ({**combination["choices"], "piece": number}, piece["constraints"])
        for combination in region["combinations"]
        for number, piece in enumerate(combination["polyhedra"])
    ]
    return rows_of(pieces, region["parameters"])


has_table(LabeledRegion, rows=possible_rows)
has_table(TeamEnvelope, "parameters", named="parameter", numbers=SIDES)


@documenting.register(TeamEnvelope)
def envelope_document(envelope: TeamEnvelope) -> Document:
    """`robust/pike-envelope/1`."""
    telling = Telling(envelope.plan)
    broken = None
    if envelope.broken is not None:
        needed = [telling.demand(constraint) for constraint in envelope.needed]
        broken = BrokenCombination(choices=_choices(envelope.broken), possible=envelope.possible, needed=needed)
    known = not envelope.cut_short and bool(envelope.combinations)
    return document_of(
        PikeEnvelope,
        envelope,
        assume=_choices(envelope.assume),
        epsilon=envelope.plan.plan.epsilon,
        parameters={parameter.name: _within(envelope, parameter, telling) for parameter in envelope.plan.parameters},
        broken=broken,
        polyhedra=_polyhedra(_tidied(envelope.region)) if known else None,
    )


def _within(envelope: TeamEnvelope, parameter: TeamParameter, telling: Telling) -> TeamWithin:
    interval = envelope.box[parameter.name]

    def stopped(side: Side) -> StoppedBy | None:
        stop = envelope.stops.get((parameter.name, side))
        if stop is None:
            return None
        constraint = None if stop.constraint is None else str(stop.constraint)
        statements = list(telling.statements(stop.statements))
        reason = telling.stop(stop)
        return StoppedBy(choices=_choices(stop.choices), constraint=constraint, statements=statements, reason=reason)

    return like(
        TeamWithin,
        ends_of(interval),
        kind=parameter.kind,
        meaning=parameter.meaning,
        nominal=parameter.parameter.nominal,
        stopped_below=stopped(Side.LOWER),
        stopped_above=stopped(Side.UPPER),
    )


def tidy(plan: ParametricPlan, pieces: Iterable[Polyhedron]) -> list[Polyhedron]:
    """The pieces within the declared bounds, without those that others contain, and without what follows."""
    bounds = tuple(plan.declared_box.constraints())
    return [polyhedron.simplified() for polyhedron in absorb(piece.restricted(bounds) for piece in pieces)]


def _tidied(region: Region) -> Sequence[Polyhedron]:
    return region.simplified().as_union().pieces if len(region.pieces) <= MANY else absorb(region.pieces)


# -- sentences ---------------------------------------------------------------------------------------------------------


class Telling:
    """Inequalities and statements of one plan in words."""

    def __init__(self, plan: ParametricPlan) -> None:
        self._plan = plan
        self._parameters = {parameter.name: parameter for parameter in plan.parameters}
        self._events: dict[str, str] = {}
        for activity in plan.plan.network.activities:
            self._events.setdefault(activity.source, f"the start of {activity.action}")
            self._events.setdefault(activity.target, f"the end of {activity.action}")

    def sentence(self, piece: Polyhedron) -> str:
        """The demands of a polyhedron beyond the declared bounds: `a may take up to 5; limit must be at least 7`."""
        bounds = set(self._plan.declared_box.constraints())
        by_parameter: dict[str, list[LinearConstraint]] = {}
        joint: list[str] = []
        for constraint in piece.constraints:
            if constraint in bounds:
                continue
            if len(constraint.parameters) == 1:
                by_parameter.setdefault(constraint.parameters[0], []).append(constraint)
            else:
                joint.append(self.demand(constraint))
        ranges = [
            self._range(name, Polyhedron((name,), tuple(kept)).extent(name)) for name, kept in by_parameter.items()
        ]
        return "; ".join([*ranges, *joint]) or "anything goes"

    def _range(self, name: str, interval: Interval | None) -> str:
        if interval is None:
            return "impossible"
        return self.interval(self._parameters[name], interval)

    def interval(self, parameter: TeamParameter, interval: Interval) -> str:
        """The values that a parameter may have, as a sentence."""
        words, low, high = parameter.words, interval.lower, interval.upper
        least = None if low is None or low == parameter.parameter.lower else readable(low)
        above = "" if interval.lower_closed else "more than "
        below = "" if interval.upper_closed else "less than "
        takes = "take" if parameter.kind is TeamParameterKind.DURATION else "be"
        verb, needs = f"may {takes}", f"must {takes}"
        if low is not None and low == high:
            return f"{words} {needs} exactly {readable(low)}"
        if least is None:
            return f"{words} {verb} anything" if high is None else f"{words} {verb} up to {below}{readable(high)}"
        if high is None:
            return f"{words} {needs} {above or 'at least '}{least}"
        return f"{words} {verb} {above}{least} to {below}{readable(high)}"

    def demand(self, constraint: LinearConstraint) -> str:
        """An inequality of several parameters: a limit is told by what it must be at least, others as a sum."""
        for name, factor in constraint.coefficients:
            limit = (
                self._parameters[name].kind is TeamParameterKind.AT_MOST
                and factor < 0
                and constraint.relation is not Sense.EQUAL
            )
            if limit and len(constraint.parameters) > 1:
                rest = [(self._words(n), Fraction(f, -factor)) for n, f in constraint.coefficients if n != name]
                number = constraint.constant / factor
                tail = "" if not number else f" {'+' if number > 0 else '−'} {readable(abs(number))}"
                word = "more than" if constraint.is_strict else "at least"
                return f"{self._words(name)} must be {word} {signed_sum(rest, '−', readable)}{tail}"
        terms, sign, number = constraint.oriented()
        words = [(self._words(name), factor) for name, factor in terms]
        return f"{signed_sum(words, '−', readable)} {sign} {readable(number)}"

    def _words(self, name: str) -> str:
        return self._parameters[name].words

    def statements(self, statements: Iterable[Statement]) -> Iterator[str]:
        """The statements of the plan as text, without separations of ε that are only the order of a program."""
        for statement in dict.fromkeys(statements):
            match statement:
                case BoundStatement(place, upper):
                    if not self._is_order(place, upper=upper):
                        yield self._bound(place, upper=upper)
                case OrderStatement(earlier, later):
                    yield f"{self._event(earlier)} is before {self._event(later)}"
                case WaitingStatement():
                    continue

    def _is_order(self, place: int, *, upper: bool) -> bool:
        """Whether a bound merely puts one event after another."""
        constraints = self._plan.plan.network.constraints
        bound = self._plan.bounds[place][upper]
        small = bound is not None and bound.is_constant and bound.constant_term <= self._plan.plan.epsilon
        return not upper and place < len(constraints) and small

    def _bound(self, place: int, *, upper: bool) -> str:
        network = self._plan.plan.network
        bound = self._plan.bounds[place][upper]
        number = "" if bound is None else self._number(bound)
        word = "at most" if upper else "at least"
        first = len(network.constraints)
        if place >= first:
            return f"{network.activities[place - first].action} takes {word} {number}"
        constraint = network.constraints[place]
        return f"from {self._event(constraint.source)} to {self._event(constraint.target)} {word} {number}"

    def _number(self, bound: Polynomial[Any]) -> str:
        words = [self._words(unknown.name) for unknown, _ in bound.coefficients()]
        constant = bound.constant_term
        return " + ".join([*words, *([readable(constant)] if constant or not words else [])])

    def _event(self, name: str) -> str:
        return self._events.get(name, name)

    def stop(self, stop: TeamStop) -> str:
        """The reason why a side ends."""
        if stop.declared:
            return "declared bound"
        with_choices = f"with {guard_text(stop.choices)}: " if stop.choices else ""
        reasons = list(self.statements(stop.statements))
        if stop.own:
            return f"{with_choices}its own other bound{': ' if reasons else ''}{'; '.join(reasons)}"
        demand = "" if stop.constraint is None else self.sentence(Polyhedron(self._plan.names, (stop.constraint,)))
        more = "" if len(reasons) <= STATEMENTS else f"; {len(reasons) - STATEMENTS} more (--json lists them)"
        because = f", because {'; '.join(reasons[:STATEMENTS])}{more}" if reasons else ""
        return f"{with_choices}{demand or 'not known'}{because}"


@printing.register(LabeledRegion)
def print_region(out: Console, region: LabeledRegion, *, quiet: bool) -> None:
    """For each combination of choices what the parameters may be, and which combinations are impossible."""
    telling = Telling(region.plan)
    by_sentence: dict[str, list[str]] = {}
    impossible = []
    for combination in region.combinations:
        pieces = tidy(region.plan, combination.polyhedra)
        if pieces:
            sentences = [telling.sentence(piece) for piece in pieces]
            by_sentence.setdefault(" – or else – ".join(sentences), []).append(guard_text(combination.choices))
        else:
            impossible.append(guard_text(combination.choices))
    if region.assume:
        out.line(f"Assumed: {guard_text(region.assume)}.")
    for sentence, combinations in by_sentence.items():
        shown = [label or "any choices" for label in combinations]
        for label in shown[: -1 if len(shown) <= MANY else MANY]:
            out.line(f"With {label}, or")
        more = "" if len(shown) <= MANY else f"{len(shown) - MANY} other combinations like "
        known = ", as far as is known yet" if region.cut_short else ""
        out.line(f"With {more}{shown[-1]}{known}: {sentence}.")
    if not by_sentence:
        known = " are known yet to lead" if region.cut_short else " lead"
        out.line(f"No parameter values{known} to a correct execution.")
    elif impossible:
        what = "Nothing is known yet of" if region.cut_short else "Impossible, whatever the parameters are:"
        out.line(what)
        for label in impossible[:MANY]:
            out.line(f"  {label}")
        if len(impossible) > MANY:
            out.line(f"  {len(impossible) - MANY} more (--json lists them)")
    if quiet:
        return
    out.print()
    for parameter in region.plan.parameters:
        out.line(f"{parameter.words}: {parameter.meaning}, {readable(parameter.parameter.nominal)} in the plan")
    count = plural(len(region.pieces), "polyhedron").replace("polyhedrons", "polyhedra")
    out.line(f"{_ended(region)}: {count}, {duration(region.seconds)}.")


def _ended(result: LabeledRegion | TeamEnvelope) -> str:
    if result.status is Status.UNKNOWN:
        return f"undecided, because {result.reason}"
    return "out of time" if result.status is Status.TIMEOUT else result.status.value


@printing.register(TeamEnvelope)
def print_envelope(out: Console, envelope: TeamEnvelope, *, quiet: bool) -> None:
    """Print what holds for which values; unless `quiet` also what limits each side."""
    telling = Telling(envelope.plan)
    promised = promise(envelope)
    if not envelope.verified:
        out.line(_failure(envelope, telling, promised))
    else:
        ranges = [telling.interval(parameter, envelope.box[parameter.name]) for parameter in envelope.plan.parameters]
        out.line(f"{promised}: {'; '.join(ranges)}.")
        if not quiet:
            out.print()
            for parameter in envelope.plan.parameters:
                out.line(f"{parameter.words} ∈ {interval_text(envelope.box[parameter.name])}: {parameter.meaning}, "
                           f"{readable(parameter.parameter.nominal)} in the plan")  # fmt: skip
                for side, word in ((Side.UPPER, "above"), (Side.LOWER, "below")):
                    stop = envelope.stops.get((parameter.name, side))
                    if stop is not None:
                        out.line(f"  {word}: {telling.stop(stop)}")
    if not quiet:
        out.print()
        out.line(f"{_ended(envelope)}: {plural(envelope.boxes, 'box').replace('boxs', 'boxes')} tried, "
                   f"{duration(envelope.seconds)}.")  # fmt: skip


def promise(envelope: TeamEnvelope) -> str:
    """The statement that holds for all values in the box."""
    assumed = f"With {guard_text(envelope.assume)}" if envelope.assume else ""
    if not envelope.for_all:
        return assumed or "For some choice of values"
    names = " and ".join(filter(None, (", ".join(envelope.for_all[:-1]), envelope.for_all[-1])))
    known = "even if the team learns of it only then, and waits" if envelope.waiting else "if it is known beforehand"
    return f"{assumed + ', whatever' if assumed else 'Whatever'} {names} will be, {known}"


def _failure(envelope: TeamEnvelope, telling: Telling, promised: str) -> str:
    """The reason why there is no box."""
    if envelope.broken is None:
        return "Nothing is known yet."
    choices = f" with {guard_text(envelope.broken)}" if envelope.broken else ""
    if envelope.cut_short:
        return f"{promised}: no correct execution{choices} is known yet at the nominal values."
    if not envelope.possible:
        return f"{promised}: there is no correct execution{choices}, whatever the parameters are."
    needed = " and ".join(map(telling.demand, envelope.needed))
    if envelope.waiting and not envelope.broken:
        return f"{promised}: not at the nominal values; {needed} would be needed."
    return f"{promised}: there is no correct execution{choices} at the nominal values; needed: {needed}."
