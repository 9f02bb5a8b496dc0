"""What certificates claim of a plan, and how the claim follows: `plan`, `box`, `maximal` and `region`.

The robustness envelope holds the parameter values, within the declared bounds, that leave some schedule of the network
and no schedule that breaks an obligation. Good values: one schedule, linear in the parameters, that keeps the network,
and a refutation of the violation of every obligation. Bad values: a circle of constraints that no times keep, or one
schedule that keeps the network and breaks one obligation.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction

from .formulas import Formulas, constant, plus, replaced
from .proofs import Facts, Tape, all_hold, demand, linear, listed, orders, rational, refute, schedule, sides, whole
from .reader import Fact, Ground, Linear, need

SEGMENT = "~"
"""How far along a segment: more than 0, and at most 1."""


@dataclass(frozen=True)
class Range:
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

    @property
    def empty(self) -> bool:
        ends = [] if self.lower is None or self.upper is None else [self.lower, self.upper]
        return ends != sorted(ends) or (len({*ends}) == 1 and not (self.lower_closed and self.upper_closed))

    def holds(self, value: Fraction, closure: bool = False) -> bool:
        facts = [(form.get("", Fraction(0)) + form["x"] * value, strict) for form, strict in self.facts("x")]
        return all(level > 0 or (level == 0 and (closure or not strict)) for level, strict in facts)

    def within(self, other: "Range") -> bool:
        """Whether every value of this range, which is not empty, is one of the other."""
        low, least = (self.lower, not self.lower_closed), (other.lower, not other.lower_closed)
        high, most = (self.upper, self.upper_closed), (other.upper, other.upper_closed)
        above = other.lower is None or (self.lower is not None and low >= least)
        return above and (other.upper is None or (self.upper is not None and high <= most))


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
    if kind == "region":
        demand(stated is None, "the certificate of a region has no box")
        check_region(tape, ground, claim)
    else:
        claim.box = nominal(ground) if kind == "plan" else box_of(ground, stated)
        demand(kind != "plan" or stated is None, "the certificate of a plan has no box")
        for name, values in claim.box.items():
            demand(values.within(declared(ground, name)), f"the box leaves the declared bounds of {name}")
        good(tape, ground, claim, [fact for name, values in claim.box.items() for fact in values.facts(name)])
        place = " x ".join(map(str, claim.box.values()))
        claim.text = "valid for every schedule" + (f", for all ({', '.join(claim.box)}) in {place}" if place else "")
        if kind == "maximal":
            for name in claim.box:
                check_faces(tape, ground, claim, claim.box, name)
            claim.text += "; no other valid box within the declared bounds contains this one"
    tape.finish()
    if ground.varied:
        claim.text += f", where {', '.join(meaning(ground, *each) for each in ground.varied.items())}"
    if ground.model.guessed:
        claim.text += f", reading {', '.join(sorted(ground.model.guessed))}"
    return claim


def meaning(ground: Ground, of: tuple[str, str], name: str) -> str:
    """What a parameter stands for that the plan does not say, and what it stands in place of."""
    kind, subject = of
    if kind == "fluent":
        return f"{name} is {subject} ({ground.model.initial[subject]} in the problem)"
    return f"{name} is the duration of {subject} ({', '.join(ground.instead[subject])} in the domain)"


def declared(ground: Ground, name: str) -> Range:
    parameter = ground.parameters[name]
    found = Range(parameter.lower, parameter.lower is not None, parameter.upper, parameter.upper is not None)
    need(not found.empty, f"the declared bounds of {name} leave no value")
    return found


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
        demand(not found[name].empty, "the box is empty")
    return found


def good(tape: Tape, ground: Ground, claim: Claim, region: list[Fact]) -> None:
    """All values of a region have a schedule, and none that breaks an obligation."""
    formulas = Formulas(ground, claim.epsilon)
    facts = Facts(region, formulas)
    orders(tape, formulas, facts)
    schedule(tape, formulas, facts)
    obligations, refuted = all_hold(tape, formulas, facts)
    claim.obligations += obligations
    claim.refuted += refuted


def bad(tape: Tape, ground: Ground, claim: Claim, region: list[Fact], given: dict[str, Linear]) -> None:
    """No value of a region is in the envelope; `given` are the parameters as expressions over the region's names."""
    names = {SEGMENT} if given else set(ground.parameters)
    kind, *rest = tape.next("cycle", "broken")
    if kind == "cycle":
        steps, multiples = listed(rest, 2)
        demand(len(listed(steps)) <= len(ground.points), "the constraints form more than one circle")
        total, start, place = Linear(), None, None
        for step in steps:
            a, b, length = ground.edges[whole(step, len(ground.edges))]
            demand(place is None or a == place, "the constraints do not form a path")
            total, start, place = plus(total, replaced(length, given)), a if start is None else start, b
        demand(start is not None and start == place, "the constraints do not form a circle")
        Facts(region).imply(total, multiples, strictly=True)
        return
    number, texts, proofs, instant = listed(rest, 4)
    times = [linear(text, names) for text in listed(texts, len(ground.points) - 1)]
    given = given | {f"@{point}": time for point, time in enumerate(times, start=1)}
    if instant is not None:
        given[f"!{whole(number)}"] = linear(instant, names)
    formulas = Formulas(ground, claim.epsilon, given)
    facts = Facts(region)
    for edge, multiples in zip(ground.edges, listed(proofs, len(ground.edges))):
        facts.imply(formulas.slack(edge), multiples)
    obligations = formulas.obligations()
    refute(tape, formulas, facts, -obligations[whole(number, len(obligations))][1]())


def check_faces(tape: Tape, ground: Ground, claim: Claim, box: Box, name: str) -> None:
    """Arbitrarily near to each face of a parameter that can be moved, outside of the box, there are bad values.

    They are on a segment from `limit`, on the face, to `beyond`: all of it but the limit itself is bad, and within the
    box in all other directions.
    """
    allowed, values = declared(ground, name), box[name]
    for end, closed, bound, sign in (
        (values.lower, values.lower_closed, allowed.lower, -1),
        (values.upper, values.upper_closed, allowed.upper, 1),
    ):
        if end is None or (closed and end == bound):
            continue
        texts = listed(tape.next("face"), 2)
        limit, beyond = (dict(zip(box, map(rational, listed(text, len(box))))) for text in texts)
        demand(limit[name] == end, "the limit is not on the face")
        away = sign * (beyond[name] - end)
        demand(away > 0 if closed else away == 0, "the segment does not begin just outside of the face")
        for other in box.keys() - {name}:
            inside = box[other].holds(limit[other], closure=True) and box[other].holds(beyond[other])
            demand(inside, "the segment leaves the box in another direction")
        given = {each: plus(constant(limit[each]), plus({}, {SEGMENT: beyond[each] - limit[each]})) for each in box}
        segment: list[Fact] = [({SEGMENT: Fraction(1)}, True), ({SEGMENT: Fraction(-1), "": Fraction(1)}, False)]
        bad(tape, ground, claim, segment, given)


def check_region(tape: Tape, ground: Ground, claim: Claim) -> None:
    """All values within the declared bounds are good but those in bad polyhedra; schedules are given piece by piece."""
    names = ground.parameters
    bounds = [fact for name in names for fact in declared(ground, name).facts(name)]
    claim.removed, good = [], list(bounds)
    while (line := tape.next("bad", "good"))[0] == "bad":
        piece = sides(listed(line, 2)[1], names)
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
    while (line := tape.next("piece", "rest"))[0] == "piece":
        piece = sides(listed(line, 2)[1], names)
        schedule(tape, formulas, Facts([*piece, *good]))
        outside.append(-inside(formulas, piece))
    listed(line, 1)
    refute(tape, formulas, Facts(good), formulas.circuit.all(outside))
    shown = "".join(f", without {text_of(piece)}" for piece in claim.removed)
    claim.text = f"the robustness envelope is exactly the declared bounds{shown}"


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
