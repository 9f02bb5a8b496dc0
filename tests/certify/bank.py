"""What a checker has to get right, to tell a changed one from the one that is meant: see `tests.certify.mutants`.

Nothing here is what the checker itself says of the meaning of a plan: that is the simulator's, the oracle's, or the
exact region's. A probe is a name and a function from a checker to whether it did right. What a probe compares with was
found out by the checker that is meant, and something false that it accepts is an error where probes are made.
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import cache, partial
from itertools import chain, product
from pathlib import Path
from random import Random
from typing import Any

from benchmarks.generators.team_plans import Shape, random_plan
from robust.api import envelope
from robust.certify import bad
from robust.certify.checker import reader
from robust.certify.hints import Line
from robust.certify.tape import header, write
from robust.encode import create_encoding
from robust.errors import RefutedError
from robust.irr.widen import DiscoveredBadSet
from robust.pike_bridge.action_model import load_team_plan
from robust.pike_bridge.semantics import Oracle
from robust.plan.load import load_plan
from robust.qe.box import Interval, Side
from robust.smt.limits import Deadline
from tests.certify import adversary, meaning, networks, tools
from tests.certify.adversary import PLANS, leaf_changes, named
from tests.certify.command_lines import command_lines
from tests.certify.tools import Checker, Holds

Probes = Iterator[tuple[str, Holds]]
Tried = list[tuple[list[Any], Any]]
"""Tapes, with the claim of each; None if it is rejected."""
KITCHEN = tools.EXAMPLES / "kitchen" / "kitchen.tpnu.json"


def probes(asked: tuple[str, ...]) -> list[tuple[str, Holds]]:
    """Those whose names begin with one of these; they take some seconds to make, and some to ask."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        every = [probe for names, make in SECTIONS if _overlap(names, asked) for probe in _made(make)]
    return [probe for probe in every if probe[0].startswith(asked)]


def _overlap(names: tuple[str, ...], asked: tuple[str, ...]) -> bool:
    return any(name.startswith(one) or one.startswith(name) for name in names for one in asked)


@cache
def _made(make: Callable[[Path], Probes]) -> list[tuple[str, Holds]]:
    return list(make(Path(tempfile.mkdtemp(prefix="robust-bank-"))))


# -- certificates ------------------------------------------------------------------------------------------------------


def forged(plans: int = 22, attempts: int = 1_500) -> Probes:
    """Honest certificates, which are accepted, and the adversary's, which are so only if what they claim is true."""
    known, random = adversary.cases(plans, 0), Random(1)
    tried = {case.name: [(lines, verdict(case.attempt(lines))) for lines in case.honest] for case in known}
    for _ in range(attempts):
        case = random.choice(known)
        lines = adversary.forged(case, known, random)
        claim = case.attempt(lines)
        assert isinstance(claim, str) or case.is_true(claim), f"{case.name}: something false is accepted: {lines}"
        tried[case.name].append((lines, verdict(claim)))
    yield from ((f"forged {case.name}", partial(_judges, case=case, tried=tried[case.name])) for case in known)
    for case, lines in rich(known):
        every = list(leaf_changes(lines))
        changes = [*named(lines), *every[:: max(1, len(every) // 400)]]
        known_changes = [(change, verdict(case.attempt(change))) for change in changes]
        yield f"leaves of {case.name} {lines[0][1]}", partial(_judges, case=case, tried=known_changes)


def rich(known: list[adversary.Case]) -> list[tuple[adversary.Case, list[Line]]]:
    """A few short tapes that have, together, everything that honest tapes have."""
    every = [(case, lines) for case in known for lines in case.honest if not isinstance(case.attempt(lines), str)]
    every.sort(key=lambda one: len(str(one[1])))
    chosen, seen = [], set[Any]()
    for case, lines in every:
        new = {shape(part) for line in lines for part in (line, *line[1:])}
        if not new <= seen and len(str(lines)) < 20_000:
            chosen.append((case, lines))
            seen |= new
    return chosen[-8:]


def shape(value: Any) -> Any:
    """What kinds of things a line has in it, as far as they matter to what looks at it."""
    if isinstance(value, list):
        return frozenset(shape(inner) for inner in value) if len(value) != 1 else (shape(value[0]),)
    return value if isinstance(value, bool) or str(value).isalpha() else type(value)


def verdict(claim: Any) -> Any:
    """What is claimed; None if it is rejected."""
    return None if isinstance(claim, str) else (claim.kind, claim.text, claim.obligations, claim.refuted)


def _judges(by: Checker, case: adversary.Case, tried: Tried) -> bool:
    return all(verdict(case.attempt(lines, by)) == want for lines, want in tried)


def small() -> Probes:
    """Certificates of the smallest plans: honest ones with all their changes, and those made up with care."""
    yield "small ranges", ranges
    for name, plan, lines in adversary.TABLES["honest"]:
        ground = reader.ground(*PLANS[plan])
        tried = [(one, verdict(tools.judged(one, ground))) for one in [lines, *leaf_changes(lines), *named(lines)]]
        assert tried[0][1] is not None, name
        yield f"small {name}", partial(_claims, texts=PLANS[plan], tried=tried)
    for name, plan, lines in adversary.TABLES["made up"]:
        yield f"small {name}", partial(_claims, texts=PLANS[plan], tried=[(lines, None)])


def ranges(by: Checker) -> bool:
    """What is inside of what, against a few values."""
    ends = [None, Fraction(0), Fraction(1)]
    sides = [(end, closed) for end in ends for closed in (False, True) if end is not None or not closed]
    every = [by.claims.Range(*low, *high) for low in sides for high in sides]
    values = [Fraction(number, 2) for number in range(-2, 5)]

    def inside(one: Any, value: Fraction) -> bool:
        above = one.lower is None or value > one.lower or (value == one.lower and one.lower_closed)
        return above and (one.upper is None or value < one.upper or (value == one.upper and one.upper_closed))

    filled = [one for one in every if any(inside(one, value) for value in values)]
    return all(one.holds(value) == inside(one, value) for one in filled for value in values) and all(
        one.within(other) == all(inside(other, value) for value in values if inside(one, value))
        for one in filled
        for other in filled
    )


def _claims(by: Checker, texts: Any, tried: Tried) -> bool:
    ground = by.reader.ground(*texts)
    return all(verdict(tools.judged(lines, ground, by=by)) == want for lines, want in tried)


def meanings() -> Probes:
    """Plans that mean nothing to the checker, and a parameter beside a plan."""
    for name, *texts in adversary.TABLES["without meaning"]:
        yield f"free of meaning {name}", partial(meaning.meaningless, texts=texts)
    yield "free parameter beside", meaning.reads_beside


def within() -> Probes:
    """A box inside of a valid one is not maximal: of the face that can be moved, that of the larger box is shown."""
    texts = [path.read_text(encoding="utf-8") for path in tools.NAVIGATION]
    plan, ground = load_plan(*tools.NAVIGATION), tools.grounded(tools.NAVIGATION)
    encoding, widest, deadline = create_encoding("relational", plan), envelope(plan).box, Deadline.after(60)
    bad_set = DiscoveredBadSet(encoding)
    of_widest = cache(partial(bad.nearby, ground, tools.EPSILON, widest, deadline=deadline))
    for moved, interval in widest.intervals.items():
        for away in (Side.LOWER, Side.UPPER):
            opened = Interval(interval.lower, interval.upper, away is Side.UPPER, away is Side.LOWER)
            smaller = widest.replace(moved, opened)
            lines = [header("maximal", smaller), *tools.made(tools.NAVIGATION, "box", box=smaller)[1:]]
            of_smaller = cache(partial(bad.nearby, ground, tools.EPSILON, smaller, deadline=deadline))
            for name, side in product(widest.intervals, (Side.LOWER, Side.UPPER)):
                box, reasons = (widest, of_widest) if (name, side) == (moved, away) else (smaller, of_smaller)
                end = box[name].end(side)
                assert end is not None
                lines += bad.Face(ground, reasons, box, bad_set, name, side, end, deadline).lines()
            yield f"within {moved} {away.value}", partial(_claims, texts=texts, tried=[(lines, None)])


def commands(folder: Path) -> Probes:
    """The command, with honest certificates."""
    delivery = tuple(tools.EXAMPLES / "delivery" / name for name in ("domain.pddl", "problem.pddl", "plan.stn"))
    every = ("plan", "box", "maximal", "region")
    for files, kinds in ((tools.NAVIGATION, every), (tools.GENERATOR, every), (delivery, ("box",))):
        for kind in kinds:
            path = folder / f"{files[0].parent.name}-{kind}.cert"
            write(tools.made(files, kind), path)
            yield f"honest {path.stem}", answers(path, files)


def answers(path: Path, files: Any, **demanded: Any) -> Holds:
    return partial(_answers, path=path, files=files, demanded=demanded, expected=answered(path, files, demanded))


def answered(path: Path, files: Any, demanded: dict[str, Any], by: Checker = tools.CHECKER) -> tuple[int, Any]:
    code, answer = tools.ask(path, files, by=by, **demanded)
    return code, None if code else answer


def _answers(by: Checker, path: Path, files: Any, demanded: dict[str, Any], expected: tuple[int, Any]) -> bool:
    return by is tools.CHECKER or answered(path, files, demanded, by) == expected


# -- plans with choices ------------------------------------------------------------------------------------------------


def with_choices(folder: Path, count: int = 16) -> Probes:
    """Formulas against the oracle, executions against the referee, certificates of both kinds."""
    for seed in range(count):
        path = random_plan(seed, 0, Shape(top=4, inner=2)).write(folder / f"choices-{seed}")
        (_, decides), *refereed = networks.agreements(path, seed)
        yield from ((f"oracle {seed}", decides), *refereed)
        try:
            lines = networks.knowledge(path, tools.EPSILON, Deadline.after(60))
        except RefutedError:
            assert refereed, f"the oracle finds no correct execution of {path}"
            continue
        write(lines, folder / f"{seed}.cert")
        assert answered(folder / f"{seed}.cert", (path,), {})[1]["kind"] == "knowledge"
        assert not refereed, f"the oracle finds a correct execution of {path}"
        for kind in (None, "knowledge", "execution", "plan"):
            yield f"knowledge {seed} {kind}", answers(folder / f"{seed}.cert", (path,), kind=kind)


def kitchen(folder: Path) -> Probes:
    """Changes of the certificates of both kinds."""
    witness = Oracle(load_team_plan(KITCHEN)).decide().witness
    for kind, lines in networks.certificates(KITCHEN, witness, {"xA1": "glass", "xA2": "coffee"}):
        every = list(leaf_changes(lines))
        for number, new in enumerate([lines, *every[:: max(1, len(every) // 60)]]):
            write(new, folder / f"{kind}-{number}.cert")
            yield f"leaves of {kind}", answers(folder / f"{kind}-{number}.cert", (KITCHEN,))


def small_networks(folder: Path) -> Probes:
    """A small network and its certificates, and what is no network, or none that the checker knows: few are
    established, and those are true."""
    established, count = [], 0
    for number, (name, path, tapes, epsilon) in enumerate(networks.small(folder / "small")):
        for place, lines in enumerate(tapes):
            certificate = folder / f"small-{number}-{place}.cert"
            write(lines, certificate)
            count += 1
            probe = answers(certificate, (path,), epsilon=epsilon)
            if probe.keywords["expected"][0] == 0:
                assert networks.is_true(path, lines), f"{name}: something false is accepted: {lines}"
                established.append(name)
            yield f"wrong network {name}", probe
    assert established[0] == "honest"
    assert count > 600 > 20 * len(established)


SECTIONS: tuple[tuple[tuple[str, ...], Callable[[Path], Probes]], ...] = (
    (("texts",), lambda _: meaning.texts_probes()),
    (("reading",), lambda _: meaning.readings()),
    (("free",), lambda _: chain(meaning.free(), meanings())),
    (("within",), lambda _: within()),
    (("small",), lambda _: small()),
    (("forged", "leaves of plan", "leaves of network"), lambda _: forged()),
    (("oracle", "executions", "knowledge"), with_choices),
    (("leaves of ex", "leaves of kn"), kitchen),
    (("wrong network",), small_networks),
    (("oracle", "executions"), networks.random_networks),
    (("honest",), commands),
    (("main",), command_lines),
)
"""What makes probes, by how their names begin."""
