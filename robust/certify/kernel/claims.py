"""The verified checker's input, made from a certificate for the checker in Python, and from the same files.

What the plan is, and what is claimed, is printed by `terms`, which is trusted. Schedules, order lemmas and the reasons
of bad values are those of the certificate; the verified checker prints its own formulas, for which refutations are
found anew. Nothing of that is trusted.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import combinations
from typing import Any

from robust.certify.checker.claims import SEGMENT, Box, Range, box_of, declared, nominal
from robust.certify.checker.formulas import Formulas as TheirFormulas
from robust.certify.checker.formulas import mutex, names_in, plus, replaced
from robust.certify.checker.proofs import Tape, demand, linear, sides
from robust.certify.checker.reader import Fact, Ground, Linear, constant
from robust.certify.hints import NotRefutedError
from robust.certify.kernel.evaluation import IndexedFacts, Place
from robust.certify.kernel.questions import OpenFormulas, facts_of, multiples, renamed
from robust.certify.kernel.terms import PlanTerms, listed, truth
from robust.smt.limits import Deadline

Ask = Callable[[str], str]
"""What `robust-kernel --formulas` prints of a file with this content."""
EMPTY = "()"


@dataclass(frozen=True, slots=True)
class KernelQuestion:
    """What the kernel is asked for, and the words for the certificate that its answer becomes."""

    words: str
    answered: Callable[[Sequence[Sequence[str]]], str]


@dataclass(frozen=True, slots=True)
class Sides:
    """Sides of a polyhedron over the parameters, in the kernel's order; on a segment, what each parameter is there."""

    facts: Sequence[Fact]
    given: Mapping[str, Linear] = field(default_factory=dict)

    def through(self, form: Linear) -> list[tuple[int, Fraction]]:
        """Multiples of the sides that put what parameters are on a segment into a form that is subtracted."""
        places = {name: 2 + 2 * number for number, name in enumerate(self.given)}
        return [(places[name] + (factor < 0), abs(factor)) for name, factor in form.items() if name in places]

    @staticmethod
    def segment(limit: Mapping[str, Fraction], beyond: Mapping[str, Fraction]) -> "Sides":
        along = {SEGMENT: Fraction(1)}
        given = {name: plus(constant(limit[name]), plus({}, along, beyond[name] - limit[name])) for name in limit}
        facts: list[Fact] = [(along, True), (plus(constant(Fraction(1)), along, -1), False)]
        for name, form in given.items():
            facts += _equal(name, form)
        return Sides(facts, given)


class Translation:
    """A certificate in the verified checker's words.

    Args:
        ground: the plan, as the checker in Python reads it.
        epsilon: how far apart mutex time points have to be.
        deadline: when to give up, with OutOfTimeError.
    """

    def __init__(self, ground: Ground, epsilon: Fraction, deadline: Deadline) -> None:
        self._ground, self._deadline = ground, deadline
        self._terms = PlanTerms(ground)
        self._plan = [*self._terms.sections(), f"(epsilon {epsilon})"]
        self._theirs = TheirFormulas(ground, epsilon)
        self._numbers = self._terms.numbers
        self._questions: list[KernelQuestion] = []
        self._edges = [
            (plus({f"@{b}": Fraction(1)}, plus({f"@{a}": Fraction(1)}, w), -1), False) for a, b, w in ground.edges
        ]
        self._pairs: list[tuple[int, int]] = []

    def file(self, tape: Tape, kind: str, stated: object, texts: Sequence[str], ask: Ask) -> str:
        """The kernel's whole input.

        Args:
            tape: the certificate behind its first line, which states the kind and the box.
            texts: what the files are, line by line, which the kernel repeats.
            ask: what prints the formulas that remain.

        Raises:
            Rejected: if a line of the certificate is not what is expected.
            NotRefutedError: if a formula of the kernel can be true where the certificate's facts hold.
            UnsupportedError: if the kernel does not know what the plan, or the certificate, says.
            OutOfTimeError: if the deadline passes.
        """
        head = "\n".join([listed(("texts", *texts)), *self._plan])
        claim = self._envelope(tape) if kind == "region" else self._good(tape, kind, stated)
        words = "\n".join(question.words for question in self._questions)
        pairs, *blocks = ask(f"{head}\n{words}\n").splitlines()
        points = [int(word) for word in pairs.split()]
        self._pairs = list(zip(points[::2], points[1::2], strict=True))
        answers: list[list[list[str]]] = [[]]
        for line in blocks:
            if line == ".":
                answers.append([])
            else:
                answers[-1].append(line.split())
        filled = [question.answered(answer) for question, answer in zip(self._questions, answers, strict=False)]
        for number in reversed(range(len(filled))):
            claim = claim.replace(f"<{number}>", filled[number])
        return f"{head}\n{claim}\n"

    def _asked(self, words: str, answered: Callable[[Sequence[Sequence[str]]], str]) -> str:
        """Stands for the answer in the claim."""
        self._questions.append(KernelQuestion(words, answered))
        return f"<{len(self._questions) - 1}>"

    # -- good values ---------------------------------------------------------------------------------------------------

    def _good(self, tape: Tape, kind: str, stated: object) -> str:
        ground = self._ground
        box = nominal(ground) if kind == "plan" else box_of(ground, stated)
        more: list[Fact] = []
        point = [_inside(values) for values in box.values()]
        if kind == "shape":
            texts, there = tape.next("shape")
            more, point = sides(texts, box), [Fraction(value) for value in there]
        region = Sides([*(fact for name, values in box.items() for fact in values.facts(name)), *more])
        lemmas = self._lemmas(tape, region)
        schedule = self._schedule(tape, region)
        proofs = listed((lemmas, self._obligations(region, lemmas, [])))
        within = listed(multiples([each]) for each in self._within(box, region.facts))
        rest = (listed(point), within, schedule, proofs)
        ranges = listed(map(_range, box.values()))
        if kind != "maximal":
            return listed(("good", self._terms.bounds(), ranges, self._terms.sides(more), *rest))
        self._skip(tape)
        faces = listed(listed(self._face(tape, box, name, upper) for upper in (False, True)) for name in box)
        return listed(("maximal", self._terms.bounds(), ranges, faces, *rest))

    def _skip(self, tape: Tape) -> None:
        """Refutations for the other checker."""
        formulas = self._theirs
        for _, broken in formulas.obligations():
            if broken() != -1:
                tape.next("refute")

    def _within(self, box: Box, facts: Sequence[Fact]) -> Iterator[tuple[int, int]]:
        """Each declared bound follows from the end of the box."""
        for name in box:
            for form, _ in declared(self._ground, name).facts(name):
                alike = (number for number, (side, _) in enumerate(facts) if _same_direction(side, form))
                found = next(alike, None)
                demand(found is not None, f"the box leaves the declared bounds of {name}")
                yield found or 0, 1

    def _lemmas(self, tape: Tape, region: Sides) -> str:
        found = []
        first = len(region.facts)
        for a, b, path, bound, more in tape.next("orders"):
            self._theirs.known[a, b] = Fraction(bound)
            steps = [(first + step, 1) for step in path]
            found.append(listed((a, b, bound, multiples([*steps, *_sums(more)]))))
        return listed((*found, *self._durations(first)))

    def _durations(self, first: int) -> Iterator[str]:
        """Constant bounds of durations, which the other checker does not need to be told."""
        owners = {duty.owner for duty in self._ground.duties}
        for number, (a, b, w) in enumerate(self._ground.edges):
            new = (a, b) not in self._theirs.known and ((a, b) in owners or (b, a) in owners)
            if new and w.keys() <= {""}:
                yield listed((a, b, w.get("", 0), multiples([(first + number, 1)])))

    def _schedule(self, tape: Tape, region: Sides) -> str:
        free, ties = self._theirs.free(), self._theirs.ties
        texts = tape.next("schedule")
        times = {point: linear(text, self._ground.parameters) for point, text in zip(free, texts, strict=True)}
        return self._placement([replaced(ties[p], times) for p in sorted(ties)], tape.next("kept"), region)

    def _placement(self, times: Sequence[Linear], kept: Sequence[Any], region: Sides) -> str:
        slacks = (plus(plus(times[b], times[a], -1), w, -1) for a, b, w in self._ground.edges)
        keeps = (multiples([*_sums(m), *region.through(s)]) for m, s in zip(kept, slacks, strict=True))
        return listed((listed(map(self._terms.expression, times)), listed(keeps)))

    def _known(self, region: Sequence[Fact]) -> IndexedFacts:
        """What is known of a region and of the network."""
        numbers = {(a, b, frozenset(w.items())): len(region) + n for n, (a, b, w) in enumerate(self._ground.edges)}
        places = {}
        for (a, b, w), number in numbers.items():
            back = numbers.get((b, a, frozenset((name, -value) for name, value in w)))
            if back is not None and a < b:
                form = renamed(plus({f"@{a}": Fraction(1)}, dict(w)), self._numbers)
                places[f"@{b}"] = Place(number, back, form)
        return IndexedFacts(facts_of([*region, *self._edges], self._numbers), len(region), places)

    def _placed(self, region: Sides, more: Sequence[Fact], times: Mapping[str, Linear]) -> IndexedFacts:
        """What is known where times, and parameters on a segment, are forms over the unknowns of a region."""
        sides = [*region.facts, *more]
        given = {f"#{self._numbers[name]}": form for name, form in region.given.items()}
        first = [*range(2, 2 + 2 * len(given), 2), *range(len(sides), len(sides) + 2 * len(times), 2)]
        forms = [(name, renamed(form, self._numbers)) for name, form in ({**given, **times}).items()]
        places = {name: Place(n, n + 1, form) for (name, form), n in zip(forms, first, strict=True)}
        facts = [*sides, *(fact for name, form in times.items() for fact in _equal(name, form))]
        return IndexedFacts(facts_of(facts, self._numbers), len(sides), places)

    def _obligations(self, region: Sides, lemmas: str, removed: Sequence[Sequence[Fact]]) -> str:
        def answered(lines: Sequence[Sequence[str]]) -> str:
            known = self._known(region.facts) if lines else None
            found = []
            for number, *words in lines:
                refuted = OpenFormulas.of(words).refutation(known, self._deadline)  # type: ignore[arg-type]
                found.append(f"({number} {refuted})")
            return listed(found)

        outside = listed(self._terms.sides(piece) for piece in removed)
        return self._asked(listed(("obligations", self._terms.sides(region.facts), lemmas, outside)), answered)

    def _refuted(self, lines: Sequence[Sequence[str]], known: IndexedFacts) -> str:
        """The refutation of the one formula, if there is something to refute."""
        return OpenFormulas.of(lines[0][1:]).refutation(known, self._deadline) if lines else "(() () ())"

    # -- bad values ----------------------------------------------------------------------------------------------------

    def _face(self, tape: Tape, box: Box, name: str, upper: bool) -> str:
        values, allowed = box[name], declared(self._ground, name)
        end, closed = (values.upper, values.upper_closed) if upper else (values.lower, values.lower_closed)
        bound = allowed.upper if upper else allowed.lower
        if end is None or (closed and end == bound):
            return EMPTY
        points = [[Fraction(value) for value in each] for each in tape.next("face")]
        limit, beyond = (dict(zip(box, each, strict=True)) for each in points)
        return listed((*map(listed, points), self._reason(tape, Sides.segment(limit, beyond))))

    def _reason(self, tape: Tape, region: Sides) -> str:
        kind, *rest = tape.next("cycle", "broken", "every")
        if kind == "cycle":
            steps, found = rest
            total: Linear = {}
            for step in steps:
                total = plus(total, self._ground.edges[step][2])
            edges = [(len(region.facts) + step, 1) for step in steps]
            return listed(("none", multiples([*edges, *_sums(found), *region.through(total)])))
        tape.next("refute")
        if kind == "broken":
            return self._broken(region, *rest)
        names = [(self._name(number), halves) for number in rest[0] for halves in self._halves(number)]

        def answered(lines: Sequence[Sequence[str]]) -> str:
            proof = self._refuted(lines, self._known(region.facts))
            which = (listed((self._number(name), listed(halves))) for name, halves in names)
            return listed(("each", listed(which), EMPTY, proof))

        which = (listed((listed(name), listed(halves))) for name, halves in names)
        words = listed(("each", listed(which), self._terms.sides(region.facts), EMPTY))
        return self._asked(words, answered)

    def _broken(self, region: Sides, number: int, texts: Sequence[Any], kept: Sequence[Any], instant: Any) -> str:
        names = {SEGMENT} if region.given else set(self._ground.parameters)
        times = [Linear(), *(linear(text, names) for text in texts)]
        place = self._placement(times, kept, region)
        name = self._name(number)
        half = Fraction(1, 2)
        halves = (plus(plus({}, times[p], half), times[q], half) for p, q in self._halves(number))
        at = [linear(instant, names)] if instant is not None else [*halves]
        placed = {f"@{point}": form for point, form in enumerate(times)}
        looked_at = (
            len(name) == 2 or number >= len(self._ground.duties) or self._ground.duties[number].first is not None
        )

        def at_one(lines: Sequence[Sequence[str]], more: Sequence[Fact]) -> str | None:
            """One of the instants will do, all over the region and some more sides."""
            for tried in at:
                now = {"now": tried} if looked_at else {}
                with suppress(NotRefutedError):
                    proof = self._refuted(lines, self._placed(region, more, {**now, **placed}))
                    return listed(("breaks", place, self._terms.expression(tried), self._number(name), proof))
            return None

        def answered(lines: Sequence[Sequence[str]]) -> str:
            if (found := at_one(lines, [])) is not None:
                return found
            for one, other in combinations(at, 2):
                gap = plus(one, other, -1)
                first = at_one(lines, [(gap, False)])
                second = first and at_one(lines, [(plus({}, gap, -1), True)])
                if first and second:
                    return listed(("split", listed((self._terms.expression(gap), "f")), first, second))
            raise NotRefutedError("found no instant at which a schedule of the certificate breaks what it is to break")

        return self._asked(listed(("breaks", listed(name))), answered)

    def _name(self, number: int) -> tuple[int, ...]:
        """An obligation of the checker in Python: the number of a duty, or after these of a conflict; or two points."""
        duties, apart = len(self._ground.duties), mutex(self._ground)
        if number < duties:
            return (number,)
        if number - duties < len(apart):
            return apart[number - duties]
        return (number - len(apart),)

    def _number(self, name: tuple[int, ...]) -> int:
        """The kernel's number of an obligation."""
        return len(self._pairs) + name[0] + 1 if len(name) == 1 else self._pairs.index((name[0], name[1])) + 1

    def _halves(self, number: int) -> Iterator[tuple[int, int]]:
        """Between which time points, halfway, an obligation may be broken where the certificate does not say when."""
        duty = self._ground.duties[number] if number < len(self._ground.duties) else None
        if duty is None or duty.first is None:
            yield 0, 0
        elif duty.last is None:
            yield duty.first, duty.first
        else:
            written = {*names_in(duty.condition)}
            points = [p for p, effects in enumerate(self._ground.effects) if {e.target for e in effects} & written]
            yield from ((point, point) for point in points)
            yield from ((duty.first, point) for point in (duty.last, *points))

    # -- the whole envelope --------------------------------------------------------------------------------------------

    def _envelope(self, tape: Tape) -> str:
        ground, terms = self._ground, self._terms
        bounds = [fact for name in ground.parameters for fact in declared(ground, name).facts(name)]
        good, removed, reasons = [*bounds], list[list[Fact]](), list[str]()
        while (line := tape.next("bad", "good"))[0] == "bad":
            piece = sides(line[1], ground.parameters)
            reasons.append(listed((terms.sides(piece), self._reason(tape, Sides([*piece, *bounds])))))
            removed.append(piece)
            if len(piece) == 1:
                good.append((plus({}, piece[0][0], -1), not piece[0][1]))
        lemmas = self._lemmas(tape, Sides(good))
        proofs = listed((lemmas, self._obligations(Sides(good), lemmas, removed)))
        pieces, schedules = list[list[Fact]](), list[str]()
        while (line := tape.next("refute", "piece", "rest", "network"))[0] in ("refute", "piece"):
            if line[0] == "piece":
                pieces.append(sides(line[1], ground.parameters))
                schedule = self._schedule(tape, Sides([*pieces[-1], *good]))
                schedules.append(listed((terms.sides(pieces[-1]), schedule)))
        cover = EMPTY
        if line[0] == "rest":
            words = listed(("outside", listed(map(terms.sides, (*removed, *pieces)))))
            known = IndexedFacts(facts_of(good, self._numbers), len(good), {})
            cover = self._asked(words, lambda lines: self._refuted(lines, known))
        return listed(("envelope", terms.bounds(), listed(reasons), proofs, listed(schedules), cover))


def _inside(values: Range) -> Fraction:
    """A value of a range."""
    low, high = values.lower, values.upper
    if low is not None and high is not None:
        return (low + high) / 2
    return high - 1 if high is not None else low + 1 if low is not None else Fraction(0)


def _range(values: Range) -> str:
    ends = ((values.lower, values.lower_closed), (values.upper, values.upper_closed))
    return listed(text for end, closed in ends for text in (("-", "f") if end is None else (end, truth(closed))))


def _same_direction(side: Linear, form: Linear) -> bool:
    return {n: v for n, v in side.items() if n} == {n: v for n, v in form.items() if n}


def _sums(found: Sequence[Any]) -> list[tuple[int, Fraction]]:
    return [(number, Fraction(factor)) for number, factor in found]


def _equal(name: str, form: Linear) -> list[Fact]:
    """Both directions of an equation."""
    gap = plus({name: Fraction(1)}, form, -1)
    return [(gap, False), (plus({}, gap, -1), False)]
