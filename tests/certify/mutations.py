"""Changed certificates, and whether what they still establish is true.

`python -m tests.certify.mutations 10000` changes that many certificates, all cases in turn, and prints what became of
them, by kind of change. A certificate that is accepted and says something false ends it.
"""

from __future__ import annotations

import gzip
import json
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import partial
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from robust.api import check, region
from robust.certify.circuit import Atom, Circuit, Conjunction
from robust.certify.document import _literal, _node, mismatch
from robust.certify.ground import GroundPlan
from robust.certify.witness import Witnesses
from robust.encode import create_encoding
from robust.errors import UnsupportedError
from robust.irr.check import Answer
from robust.qe.box import Box, Interval
from robust.qe.constraint import LinearConstraint
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region
from robust.smt.limits import Deadline
from robust.smt.session import Session, Verdict
from robust.smt.terms import Formula, Terms
from tests.certify import tools


def _of_plan(files, path, **options):
    """Makes a certificate; its plan and its input files."""
    return tools.certificate(files, path, **options)[0], tools.by_name(files)


CASES = {
    "navigation, maximal": partial(_of_plan, tools.NAVIGATION, kind="maximal"),
    "generator, maximal": partial(_of_plan, tools.GENERATOR, kind="maximal"),
    "navigation, plan": partial(_of_plan, tools.NAVIGATION, kind="plan", encoding="positions"),
    "navigation, region": partial(_of_plan, tools.NAVIGATION, kind="region"),
    "no correct execution": lambda path: (None, tools.knowledge_certificate(path)),
}
SLOWEST = 10  # seconds of one check
REJECTED, ELSEWHERE, TRUE = "rejected", "not about the plan", "true"


class Mutator:
    """Changes one certificate in one place, in a way of a kind that it names."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._text = gzip.decompress(data)
        self._lines = self._text.splitlines(keepends=True)
        self._kinds = [b"header", *(json.loads(line)[0].encode() for line in self._lines[1:])]
        self._ways: dict[str, Callable[[Random], bytes]] = {
            "bit of the file": self._bit_of_file,
            "file cut off": lambda random: data[: random.randrange(len(data))],
            "bit of the text": self._bit_of_text,
            "line dropped": lambda random: self._without(random, *self._kinds),
            "lemma dropped": lambda random: self._without(random, b"lemma"),
            "line repeated": self._repeated,
            "lines swapped": self._swapped,
            "face shifted": self._face,
            "digests swapped": self._digests,
            "multiplier changed": lambda random: self._number(random, b"lemma", b"schedule", b"broken", b"cycle"),
            "proof changed": lambda random: self._number(random, b"root", b"derive", b"qed", b"witness", b"folded"),
            "anything changed": lambda random: self._number(random, *self._kinds),
        }

    def mutated(self, random: Random) -> tuple[str, bytes]:
        """The kind of change, and the changed file."""
        way = random.choice(list(self._ways))
        return way, self._ways[way](random)

    @staticmethod
    def _packed(lines: list[bytes]) -> bytes:
        return gzip.compress(b"".join(lines), compresslevel=1, mtime=0)

    def _place(self, random: Random, *kinds: bytes) -> int:
        """A line of one of these kinds, or any if there is none."""
        places = [index for index, kind in enumerate(self._kinds) if kind in kinds]
        return random.choice(places or range(len(self._lines)))

    def _bit_of_file(self, random: Random) -> bytes:
        place = random.randrange(len(self._data))
        return self._data[:place] + bytes([self._data[place] ^ (1 << random.randrange(8))]) + self._data[place + 1 :]

    def _bit_of_text(self, random: Random) -> bytes:
        text = bytearray(self._text)
        text[random.randrange(len(text))] ^= 1 << random.randrange(8)
        return self._packed([bytes(text)])

    def _without(self, random: Random, *kinds: bytes) -> bytes:
        place = self._place(random, *kinds)
        return self._packed(self._lines[:place] + self._lines[place + 1 :])

    def _repeated(self, random: Random) -> bytes:
        place, other = (random.randrange(len(self._lines)) for _ in range(2))
        return self._packed([*self._lines[:place], self._lines[other], *self._lines[place:]])

    def _swapped(self, random: Random) -> bytes:
        lines = list(self._lines)
        place, other = (random.randrange(len(lines)) for _ in range(2))
        lines[place], lines[other] = lines[other], lines[place]
        return self._packed(lines)

    def _replaced(self, place: int, value: object) -> bytes:
        lines = list(self._lines)
        lines[place] = json.dumps(value, separators=(",", ":")).encode() + b"\n"
        return self._packed(lines)

    def _face(self, random: Random) -> bytes:
        """A face of the box, or of a polyhedron of the region."""
        header = json.loads(self._lines[0])
        if not header.get("box"):
            return self._number(random, b"piece", b"outside")
        ends = random.choice(header["box"])
        side = random.randrange(4)
        if side % 2:
            ends[side] = not ends[side]
        else:
            step = Fraction(random.choice((-7, -1, 1, 3)), random.choice((1, 2, 1000)))
            ends[side] = str(Fraction(ends[side] or 0) + step)
        return self._replaced(0, header)

    def _digests(self, random: Random) -> bytes:
        header = json.loads(self._lines[0])
        inputs = header["inputs"]
        if len(inputs) < 2:
            return self._number(random, b"header")
        first, second = random.sample(sorted(inputs), 2)
        inputs[first], inputs[second] = inputs[second], inputs[first]
        return self._replaced(0, header)

    def _number(self, random: Random, *kinds: bytes) -> bytes:
        """A number, truth value or text somewhere in a line of these kinds becomes another."""
        place = self._place(random, *kinds)
        line = [json.loads(self._lines[place])]
        leaves = list(_leaves(line, 0))
        if leaves:
            holder, key = random.choice(leaves)
            holder[key] = _another(holder[key], random)
        return self._replaced(place, line[0])


def _another(value, random):
    match value:
        case bool():
            return not value
        case int():
            return random.choice((value + 1, value - 1, -value, 0, value * 2, 10**60, str(value), None))
        case str():
            return random.choice((value + "0", value[1:], "1/3", "-1", "", 7))
    return random.choice((0, [], "x"))


def _leaves(holder, key) -> Iterator:
    value = holder[key]
    if isinstance(value, dict | list) and value:
        for inner in value if isinstance(value, dict) else range(len(value)):
            yield from _leaves(value, inner)
    else:
        yield holder, key


# -- whether what a certificate says is true, by a solver and by this package's own methods ---------------------------


class Judge:
    """Judges certificates about one plan, or about a plan with choices if it is None; equal claims are judged once."""

    def __init__(self, plan) -> None:
        self._plan = plan
        self._formulas: dict[str, bool] = {}
        self._claims: dict[str, bool] = {}

    def judge(self, path, what: str) -> None:
        """The formulas of a certificate have no model, as a solver says, too."""
        lines = tools.lines_of(path)
        kinds = ("a", "g", "obligation", "root")
        stated = [line for line in lines[1:] if line[0] in kinds]
        key = json.dumps(stated)
        if key not in self._formulas:
            self._formulas[key] = formulas_are_unsatisfiable(stated)
        assert self._formulas[key], f"{what}: a formula has a model"

    def judge_claim(self, path, what: str) -> None:
        """What a certificate says of the plan is true."""
        if self._plan is None:
            return
        header, *lines = tools.lines_of(path)
        pieces = [line for line in lines if line[0] == "piece"]
        key = json.dumps([header["kind"], header.get("box"), header["encoding"], header["epsilon"], pieces])
        if key not in self._claims:
            true = region_is_envelope(pieces, self._plan) if pieces else box_is_as_claimed(header, self._plan)
            self._claims[key] = true
        assert self._claims[key], f"{what}: the claim is false"


def formulas_are_unsatisfiable(lines) -> bool:
    """Whether a solver agrees that each formula has no model: lines of nodes, obligations and roots."""
    nodes: list[int] = [0]
    circuit = Circuit()
    formulas: list[list[int]] = []
    for kind, *rest in lines:
        if kind == "obligation":
            formulas.append([])
        elif kind == "root":
            formulas[-1].append(_literal(nodes, rest[0]))
        else:
            nodes.append(_node(circuit, nodes, kind, rest))
    terms = Terms()
    built: dict[int, Formula] = {}
    for literals in formulas:
        session = Session(terms)
        session.add(*(_formula(terms, circuit, literal, built) for literal in literals))
        if session.check("a formula of a certificate") is not Verdict.UNSATISFIABLE:
            return False
    return True


def _formula(terms, circuit, literal, built):
    number = abs(literal)
    if number not in built:
        node = circuit.node(number)
        parts = [_formula(terms, circuit, each, built) for each in getattr(node, "inputs", ())]
        manager = terms.manager
        match node:
            case Atom(coefficients, strict, bound):
                total = manager.Plus([manager.Times(terms.number(Fraction(f)), terms.real(n)) for n, f in coefficients])
                built[number] = (manager.LT if strict else manager.LE)(total, terms.number(Fraction(bound)))
            case Conjunction():
                built[number] = terms.conjunction(parts)
    return built[number] if literal > 0 else terms.negation(built[number])


def box_is_as_claimed(header, plan) -> bool:
    """Whether the plan is valid all over the box, and no valid box contains it, if that is claimed."""
    ends = zip(header["parameters"], header["box"], strict=True)
    box = Box(
        {
            name: Interval(_end(low), _end(high), low_closed, high_closed)
            for (name, *_), (low, low_closed, high, high_closed) in ends
        }
    )
    if check(plan, at=box.intervals).answer is not Answer.PROVED:
        return False
    if header["kind"] == "maximal":
        try:
            list(Witnesses(create_encoding("relational", plan), GroundPlan(plan), box, deadline=Deadline()).lines())
        except UnsupportedError:
            return False
    return True


def _end(value):
    return None if value is None else Fraction(value)


def region_is_envelope(pieces, plan) -> bool:
    """Whether polyhedra are together the envelope that elimination finds."""
    names = tuple(parameter.name for parameter in plan.parameters)
    polyhedra = []
    for _, constraints in pieces:
        sides = []
        for expression, strict in constraints:
            factors = {term[1]: Fraction(term[0]) for term in expression if len(term) > 1}
            constant = sum((Fraction(term[0]) for term in expression if len(term) == 1), Fraction(0))
            sides.append(LinearConstraint.of(factors, ">" if strict else ">=", -constant))
        polyhedra.append(Polyhedron(names, tuple(sides)))
    return Region.union_of(names, polyhedra).equals(region(plan).region)


# -- what becomes of them --------------------------------------------------------------------------------------------


def outcomes(original: Path, plan, files, count: int, seed: int) -> Counter:
    """How many changed certificates became what, by kind of change; a false one that is accepted ends it.

    Args:
        original: a certificate that the checker accepts.
        plan: the plan that it is about; None for a plan with choices.
        files: the input files, by what they are.
    """
    random = Random(seed)
    mutator, judge = Mutator(original.read_bytes()), Judge(plan)
    given = {name: str(file) for name, file in files.items()}
    assert tools.rejection(original, given) is None
    changed = original.with_name("changed.cert")
    found: Counter = Counter()
    for number in range(count):
        way, mutant = mutator.mutated(random)
        changed.write_bytes(mutant)
        started = time.perf_counter()
        reason = tools.rejection(changed, given)
        what = f"mutant {number} of seed {seed} ({way})"
        assert time.perf_counter() - started < SLOWEST, f"{what}: the checker takes too long"
        if reason is not None:
            found[way, REJECTED] += 1
            continue
        judge.judge(changed, what)
        about = plan is None or mismatch(changed, plan, Deadline()) is None
        if about:
            judge.judge_claim(changed, what)
        found[way, TRUE if about else ELSEWHERE] += 1
    return found


def run(count: int, directory: Path, seed: int) -> Counter:
    """Changed certificates of all cases in turn, `count` in all."""
    found: Counter = Counter()
    for index, (name, make) in enumerate(CASES.items()):
        path = directory / f"{index}.cert"
        one = outcomes(path, *make(path), (count + index) // len(CASES), seed)
        print(f"{name}: {_totals(one)}", file=sys.stderr, flush=True)
        found += one
    return found


def _totals(found: Counter) -> str:
    return ", ".join(f"{_sum(found, what)} {what}" for what in (REJECTED, ELSEWHERE, TRUE))


def _sum(found: Counter, what: str) -> int:
    return sum(count for (_, outcome), count in found.items() if outcome == what)


def table(found: Counter) -> str:
    """Markdown: a row for each kind of change."""
    rows = ["| change | rejected | not about the plan | still true |", "|---|---|---|---|"]
    for way in sorted({way for way, _ in found}):
        rows.append(f"| {way} | {found[way, REJECTED]} | {found[way, ELSEWHERE]} | {found[way, TRUE]} |")
    rows.append(f"| all | {' | '.join(str(_sum(found, what)) for what in (REJECTED, ELSEWHERE, TRUE))} |")
    return "\n".join(rows)


if __name__ == "__main__":
    with TemporaryDirectory() as temporary:
        print(table(run(int(sys.argv[1]), Path(temporary), seed=2)))
