"""What certificates claim of a plan, and how the claim follows: `plan`, `box`, `maximal`, `shape`, `region`.

The robustness envelope holds the parameter values, within the declared bounds, that leave some schedule of the network
and no schedule that breaks an obligation. Good values: one schedule, linear in the parameters, that keeps the network,
and a refutation of the violation of every obligation. Bad values: a circle of constraints that no times keep, or one
schedule that keeps the network and breaks one obligation, or some obligations of which every such schedule breaks one.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, NamedTuple

from .corners import corners, require_affine
from .formulas import TRUE, Formulas, plus, replaced
from .proofs import Facts, Tape, all_hold, demand, linear, listed, orders, rational, refute, schedule, sides, way, whole
from .reader import Fact, Ground, Linear, constant, need

SEGMENT = "~"
"""How far along a segment: more than 0, and at most 1."""
SCHEDULED = ", as far as the constraints of the plan have a schedule"


class Range(NamedTuple):
    """The values of one parameter; None is infinite."""

    lower: Fraction | None
    lower_closed: bool
    upper: Fraction | None
    upper_closed: bool

    def __str__(self) -> str:
        low = "(-inf" if self.lower is None else f"{'[' if self.lower_closed else '('}{self.lower}"
        return f"{low}, " + ("inf)" if self.upper is None else f"{self.upper}{']' if self.upper_closed else ')'}")

    def facts(self, name: str) -> Iterator[Fact]:
        if self.lower is not None:
            yield plus({name: Fraction(1)}, constant(self.lower), -1), not self.lower_closed
        if self.upper is not None:
            yield plus({name: Fraction(-1)}, constant(self.upper)), not self.upper_closed

    def ends(self) -> tuple[Any, Any]:
        """What compares with `(value, False)` and `(value, True)`; an empty range does not begin before it ends."""
        low = float("-inf") if self.lower is None else self.lower
        high = float("inf") if self.upper is None else self.upper
        return (low, not self.lower_closed), (high, self.upper_closed)

    def within(self, other: "Range") -> bool:
        """Whether every value of this range, which is not empty, is one of the other."""
        (low, high), (least, most) = self.ends(), other.ends()
        return bool(least <= low < high <= most)

    def holds(self, value: Fraction) -> bool:
        return Range(value, True, value, True).within(self)


Box = dict[str, Range]


@dataclass
class Claim:
    """What has been checked; `box` for plan, box and maximal, `removed` polyhedra for region, `choices` of plans with
    choices: those of the execution, or those that are assumed."""

    kind: str
    epsilon: Fraction
    text: str = ""
    box: Box | None = None
    removed: list[list[Fact]] | None = None
    choices: dict[str, str] = field(default_factory=dict)
    obligations: int = 0
    refuted: int = 0


def check(tape: Tape, ground: Ground, kind: str, stated: object, epsilon: Fraction) -> Claim:
    """Check the tape behind its first line, which states the kind and the box.

    Raises:
        Rejected: if the claim does not follow.
        Unsupported: if the checker does not know what the plan means.
    """
    claim = Claim(kind, epsilon)
    demand((stated is None) == (kind in ("plan", "region")), f"found a box of a certificate of kind {kind}, or none")
    if kind == "region":
        check_region(tape, ground, claim)
    elif kind == "corners":
        check_corners(tape, ground, claim, stated)
    else:
        box = nominal(ground) if kind == "plan" else box_of(ground, stated)
        state(ground, claim, box)
        formulas = Formulas(ground, epsilon)
        region = [fact for name, values in box.items() for fact in values.facts(name)]
        if kind == "shape":  # what of the box is within other sides, too: a point shows that there is something
            texts, point = listed(tape.next("shape"), 2)
            region += (shape := sides(texts, box))
            at = dict(zip(box, map(constant, map(rational, listed(point, len(box))))))
            there = [(replaced(form, at), strict) for form, strict in region]
            demand(inside(formulas, there) == TRUE, "the point is not in the shape")
            claim.box, claim.text = None, f"{claim.text} with {text_of(shape)}"
        facts = Facts(region, formulas)
        orders(tape, formulas, facts)
        schedule(tape, formulas, facts)
        claim.obligations, claim.refuted = all_hold(tape, formulas, facts)
        if kind == "maximal":
            for name in box:
                check_faces(tape, ground, claim, box, name)
            claim.text += "; no other valid box within the declared bounds contains this one"
    tape.finish()
    if ground.varied:
        claim.text += f", where {', '.join(meaning(ground, *each) for each in ground.varied.items())}"
    if ground.model.guessed:
        claim.text += f", reading {', '.join(sorted(ground.model.guessed))}"
    return claim


def state(ground: Ground, claim: Claim, box: Box) -> None:
    """The claim that a box, which is within the declared bounds, is good."""
    for name, values in box.items():
        demand(values.within(declared(ground, name)), f"the box leaves the declared bounds of {name}")
    place, claim.box = " x ".join(map(str, box.values())), box
    claim.text = "valid for every schedule" + (f", for all ({', '.join(box)}) in {place}" if place else "")


def check_corners(tape: Tape, ground: Ground, claim: Claim, stated: object) -> None:
    """A box is good, because it is at the corners of some parameters: see :mod:`.corners`."""
    rates, ends = listed(stated, 2)
    demand(all(type(name) is str and name in ground.parameters for name in listed(rates)), "found no parameter")
    demand(rates and len({*rates}) == len(rates), "expected rates, each once")
    claim.kind, box = "box", box_of(ground, ends)
    state(ground, claim, box)
    require_affine(ground, rates)
    region = [fact for name, values in box.items() if name not in rates for fact in values.facts(name)]
    for given in corners(box, rates):
        formulas = Formulas(ground, claim.epsilon, given)
        facts = Facts(region, formulas)
        orders(tape, formulas, facts)
        schedule(tape, formulas, facts)
        claim.obligations, refuted = all_hold(tape, formulas, facts)
        claim.refuted += refuted


def meaning(ground: Ground, of: tuple[str, str], name: str) -> str:
    """What a parameter stands for that the plan does not say, and what it stands in place of."""
    kind, subject = of
    if kind == "fluent":
        return f"{name} is {subject} ({ground.model.initial[subject]} in the problem)"
    return f"{name} is the duration of {subject} ({', '.join(ground.instead[subject])} in the domain)"


def declared(ground: Ground, name: str) -> Range:
    parameter = ground.parameters[name]
    return Range(parameter.lower, parameter.lower is not None, parameter.upper, parameter.upper is not None)


def nominal(ground: Ground) -> Box:
    values = {name: parameter.nominal for name, parameter in ground.parameters.items()}
    need(None not in values.values(), f"found a parameter without a nominal value in {', '.join(values)}")
    return {name: Range(value, True, value, True) for name, value in values.items()}


def box_of(ground: Ground, stated: object) -> Box:
    found: Box = {}
    for name, text in zip(ground.parameters, listed(stated, len(ground.parameters))):
        low, low_closed, high, high_closed = listed(text, 4)
        demand(type(low_closed) is type(high_closed) is bool, "expected true or false")
        ends = (None if low is None else rational(low), None if high is None else rational(high))
        demand(not (low is None and low_closed) and not (high is None and high_closed), "an infinite end is closed")
        found[name] = Range(ends[0], low_closed, ends[1], high_closed)
        demand(found[name].within(found[name]), "the box is empty")
    return found


def bad(tape: Tape, ground: Ground, claim: Claim, region: list[Fact], given: dict[str, Linear]) -> None:
    """No value of a region is in the envelope; `given` are the parameters as expressions over the region's names."""
    kind, *rest = tape.next("cycle", "broken", "every")
    if kind == "cycle":
        steps, multiples = listed(rest, 2)
        start, end, total = way(ground.edges, steps, len(ground.points))
        demand(start is not None and start == end, "the constraints do not form a circle")
        Facts(region).imply(replaced(total, given), multiples, strictly=True)
        return
    if kind == "every":
        demand(not given, "found every schedule on a segment")
        numbers, formulas = listed(*listed(rest, 1)), Formulas(ground, claim.epsilon)
        facts = Facts(region, formulas)
    else:
        number, texts, proofs, instant = listed(rest, 4)
        numbers, names = [whole(number)], {SEGMENT} if given else set(ground.parameters)
        times = [linear(text, names) for text in listed(texts, len(ground.points) - 1)]
        given = given | {f"@{point}": time for point, time in enumerate(times, start=1)}
        given |= {} if instant is None else {f"!{number}": linear(instant, names)}
        formulas, facts = Formulas(ground, claim.epsilon, given), Facts(region)
        for edge, multiples in zip(ground.edges, listed(proofs, len(ground.edges))):
            facts.imply(formulas.slack(edge), multiples)
    obligations = formulas.obligations()
    kept = [-obligations[whole(number, len(obligations))][1]() for number in numbers]
    refute(tape, formulas, facts, formulas.circuit.all(kept))


def check_faces(tape: Tape, ground: Ground, claim: Claim, box: Box, name: str) -> None:
    """Arbitrarily near to each face of a parameter that can be moved, outside of the box, there are bad values.

    They are on a segment from `limit`, on the face, to `beyond`: all of it but the limit itself is bad, and within the
    box in all other directions.
    """
    allowed, values = declared(ground, name), box[name]
    lower = (values.lower, values.lower_closed, allowed.lower, -1)
    for end, closed, bound, sign in (lower, (values.upper, values.upper_closed, allowed.upper, 1)):
        if end is None or (closed and end == bound):
            continue
        texts = listed(tape.next("face"), 2)
        limit, beyond = (dict(zip(box, map(rational, listed(text, len(box))))) for text in texts)
        demand(limit[name] == end, "the limit is not on the face")
        away = sign * (beyond[name] - end)
        demand(away > 0 if closed else away == 0, "the segment does not begin just outside of the face")
        for other in box.keys() - {name}:
            closure = box[other]._replace(lower_closed=True, upper_closed=True)
            demand(closure.holds(limit[other]) and box[other].holds(beyond[other]), "the segment leaves the box")
        given = {each: plus(constant(limit[each]), plus({}, {SEGMENT: beyond[each] - limit[each]})) for each in box}
        segment: list[Fact] = [({SEGMENT: Fraction(1)}, True), ({SEGMENT: Fraction(-1), "": Fraction(1)}, False)]
        bad(tape, ground, claim, segment, given)


def check_region(tape: Tape, ground: Ground, claim: Claim) -> None:
    """All values within the declared bounds are good but those in bad polyhedra. Schedules are given piece by piece, or
    those without one are what else the region lacks: the rest is whatever the network leaves a schedule."""
    bounds = [fact for name in ground.parameters for fact in declared(ground, name).facts(name)]
    claim.removed, good = [], list(bounds)
    while (line := tape.next("bad", "good"))[0] == "bad":
        piece = sides(listed(line, 2)[1], ground.parameters)
        demand(all(form.keys() - {""} for form, _ in piece), "found a side without parameters")
        bad(tape, ground, claim, [*piece, *bounds], {})
        claim.removed.append(piece)
        if len(piece) == 1:
            good.append((plus({}, piece[0][0], -1), not piece[0][1]))
    listed(line, 1)
    formulas = Formulas(ground, claim.epsilon)
    facts = Facts(good, formulas)
    outside = [-inside(formulas, piece) for piece in claim.removed if len(piece) != 1]
    orders(tape, formulas, facts)
    claim.obligations, claim.refuted = all_hold(tape, formulas, facts, outside)
    while (line := tape.next("piece", "rest", "network"))[0] == "piece":
        piece = sides(listed(line, 2)[1], ground.parameters)
        schedule(tape, formulas, Facts([*piece, *good]))
        outside.append(-inside(formulas, piece))
    listed(line, 1)
    if line[0] == "rest":
        refute(tape, formulas, Facts(good), formulas.circuit.all(outside))
    shown = "".join(f", without {text_of(piece)}" for piece in claim.removed)
    claim.text = f"the robustness envelope is exactly the declared bounds{shown}"
    claim.text += SCHEDULED if line[0] == "network" else ""


def inside(formulas: Formulas, piece: list[Fact]) -> int:
    return formulas.circuit.all([formulas.circuit.compare(*side) for side in piece])


def text_of(piece: list[Fact]) -> str:
    """A polyhedron for people: `x + 2 y > 3 and x <= 5`."""
    sides = []
    for form, strict in piece:
        sign = 1 if next(factor for name, factor in form.items() if name) > 0 else -1
        factors = [(name, str(sign * factor)) for name, factor in form.items() if name]
        terms = ({"1": "", "-1": "-"}.get(factor, f"{factor} ") + name for name, factor in factors)
        relation = (">" if sign > 0 else "<") + ("" if strict else "=")
        sides.append(f"{' + '.join(terms).replace('+ -', '- ')} {relation} {-sign * form.get('', Fraction(0))}")
    return f"({' and '.join(sides) or 'everything'})"
