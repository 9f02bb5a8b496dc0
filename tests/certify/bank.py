"""What a checker has to get right, to tell a changed one from the one that is meant: see `tests.certify.mutants`.

Nothing here is what the checker itself says of the meaning of a plan: that is the simulator's, the oracle's, or the
exact region's. A probe is a name and a function from a checker to whether it did right.
"""

from __future__ import annotations

import json
import tempfile
import warnings
from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import cache, partial
from itertools import chain
from pathlib import Path
from random import Random
from typing import Any

from benchmarks.generators.team_plans import Shape, random_plan
from robust.api import envelope
from robust.certify.bad import _Face, _reasons
from robust.certify.checker import reader
from robust.certify.checker.proofs import RATIONAL
from robust.certify.hints import Line
from robust.certify.produce import execution, knowledge
from robust.certify.tape import header, write
from robust.encode import create_encoding
from robust.errors import RobustError
from robust.irr.widen import DiscoveredBadSet
from robust.pike_bridge.action_model import load_team_plan
from robust.pike_bridge.semantics import ExecutionExistence, Oracle
from robust.plan.load import load_plan
from robust.plan.simulate import simulate
from robust.qe.box import Interval, Side
from robust.smt.limits import Deadline
from tests.certify import adversary, elaborate, forgeries, networks, tools
from tests.certify.command_lines import command_lines
from tests.certify.evaluation import Evaluation, broken_freely, free_formulas
from tests.certify.test_reader import DOMAIN, PLAN, PROBLEM, WRONG, broken, compare, key
from tests.certify.texts import Texts, random_texts, tangled_texts
from tests.certify.tools import Checker
from tests.sampling import sample_parameters, sample_schedules

Holds = Callable[[Checker], bool]
DELIVERY = tuple(tools.EXAMPLES / "delivery" / name for name in ("domain.pddl", "problem.pddl", "plan.stn"))
KITCHEN = tools.EXAMPLES / "kitchen" / "kitchen.tpnu.json"


def probes(asked: tuple[str, ...]) -> list[tuple[str, Holds]]:
    """Those whose names begin with one of these; they take some seconds to make, and some to ask."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        every = [each for names, make in SECTIONS if _overlap(names, asked) for each in _made(make)]
    return [each for each in every if each[0].startswith(asked)]


def _overlap(names: tuple[str, ...], asked: tuple[str, ...]) -> bool:
    return any(name.startswith(one) or one.startswith(name) for name in names for one in asked)


@cache
def _made(make: Callable[[Path], Iterator[tuple[str, Holds]]]) -> list[tuple[str, Holds]]:
    return list(make(Path(tempfile.mkdtemp(prefix="robust-bank-"))))


# -- plans -------------------------------------------------------------------------------------------------------------


def readings(first: int = 0, count: int = 120) -> Iterator[tuple[str, Holds]]:
    """What texts mean: the same as this package reads, and what single schedules break according to the simulator."""
    for seed in range(first, first + count):
        texts = random_texts(seed)
        try:
            plan = tools.assembled(texts)
        except RobustError:
            continue
        yield f"reading {seed}", _reading(texts, plan, Random(seed))


def _reading(texts: Texts, plan: Any, random: Random) -> Holds:
    known = []
    parameters = sample_parameters(plan, random)
    for schedule in sample_schedules(plan, parameters, random, 3):
        try:
            want = {key(each.obligation) for each in simulate(plan, parameters, schedule).violations}
            ours = broken(reader.ground(*texts), plan, parameters, schedule)
        except (RobustError, reader.Unsupported):
            continue
        if not any(isinstance(each, tuple) and each[1] == "non-negative duration" for each in want):
            known.append((schedule, want, {each for each in ours if str(each).startswith("separation")}))

    def holds(by: Checker) -> bool:
        ground = by.reader.ground(*texts)
        compare(plan, ground, by)
        for schedule, want, separations in known:
            if broken(ground, plan, parameters, schedule, by) != want | separations:
                return False
        return True

    return holds


def free(first: int = 0, count: int = 250) -> Iterator[tuple[str, Holds]]:
    """Formulas over all times at once, at single schedules; half of them with the orders that the network implies."""
    for seed in range(first, first + count):
        texts, random = tangled_texts(seed), Random(seed)
        try:
            plan, ground = tools.assembled(texts), reader.ground(*texts)
            parameters = sample_parameters(plan, random)
            near = random.choice([1, Fraction(3, 4)]) * tools.EPSILON
            schedules = sample_schedules(plan, parameters, random, 5, epsilon=near)
            known = [
                (one, {key(each.obligation) for each in simulate(plan, parameters, one).violations})
                for one in schedules
            ]
            holds = partial(
                _evaluates, ground=ground, plan=plan, parameters=parameters, known=known, ordered=seed % 2 == 1
            )
            fine = holds(tools.CHECKER)
        except (RobustError, reader.Unsupported):
            continue
        if known and not any(_is_negative(want) for _, want in known):
            assert fine, seed
            yield f"free {seed}", holds


def _is_negative(want: set[object]) -> bool:
    """Flows of negative length have no meaning."""
    return any(isinstance(each, tuple) and each[1] == "non-negative duration" for each in want)


def _evaluates(by: Checker, ground: Any, plan: Any, parameters: Any, known: list[Any], ordered: bool) -> bool:
    formulas = free_formulas(ground, plan, parameters if ordered else None, by)
    for schedule, want in known:
        found, unseen = (set(map(key, labels)) for labels in broken_freely(formulas, plan, parameters, schedule))
        apart = {each for each in found if str(each).startswith("separation")}
        wanted = {each for each in want if not str(each).startswith("separation")}
        if not found - apart <= wanted or not wanted <= found | unseen or apart != too_near(formulas, plan, schedule):
            return False
    return True


def too_near(formulas: Any, plan: Any, schedule: Any) -> set[str]:
    """The separations that the schedule breaks, by the names of the time points in the labels."""
    times = {str(point): schedule[point] for point in plan.time_points}
    labels = [label for label, _ in formulas.obligations() if label.startswith("separation: ")]
    pairs = {label: label.removeprefix("separation: ").split(", ") for label in labels}
    return {label for label, (a, b) in pairs.items() if abs(times[a] - times[b]) < tools.EPSILON}


def wrong_texts() -> Iterator[tuple[str, Holds]]:
    """Texts that mean nothing, or what the checker does not know."""
    for old, new in WRONG:
        changed = [text.replace(old, new) for text in (DOMAIN, PROBLEM, PLAN)]
        yield f"wrong text {new}", partial(_is_unsupported, texts=changed)


def _is_unsupported(by: Checker, texts: list[str]) -> bool:
    try:
        by.reader.ground(*texts)
    except by.reader.Unsupported:
        return True
    return False


# -- certificates ------------------------------------------------------------------------------------------------------


def forged(plans: int = 22, attempts: int = 1_500) -> Iterator[tuple[str, Holds]]:
    """Honest certificates, which are accepted, and the adversary's, which are so only if what they claim is true."""
    known, random = adversary.cases(plans), Random(1)
    tried: dict[str, list[tuple[list[Any], Any]]] = {case.name: [] for case in known}
    for case in known:
        for lines in case.honest:
            tried[case.name].append((lines, verdict(case.attempt(lines))))
    for _ in range(attempts):
        case = random.choice(known)
        lines = adversary.forged(case, known, random)
        found = case.attempt(lines)
        if not isinstance(found, str) and not case.is_true(found):
            raise AssertionError(f"{case.name}: something false is accepted: {lines}")
        tried[case.name].append((lines, verdict(found)))
    for case in known:
        yield f"forged {case.name}", partial(_judges, case=case, tried=tried[case.name])
    for case, lines in rich(known):
        changes = [*named(lines), *some(leaf_changes(lines), 400)]
        yield (
            f"leaves of {case.name} {lines[0][1]}",
            partial(_judges, case=case, tried=[(one, verdict(case.attempt(one))) for one in changes]),
        )


def rich(known: list[adversary.Case]) -> list[tuple[adversary.Case, list[Line]]]:
    """A few short tapes that have, together, everything that honest tapes have."""
    every = [(case, lines) for case in known for lines in case.honest if not isinstance(case.attempt(lines), str)]
    every.sort(key=lambda one: len(str(one[1])))
    chosen, seen = [], set[Any]()
    for case, lines in every:
        new = {feature for line in lines for feature in features(line)} | {lines[0][1]}
        if not new <= seen and len(str(lines)) < 20_000:
            chosen.append((case, lines))
            seen |= new
    return chosen[-8:]


def features(line: Line) -> Iterator[Any]:
    """What kinds of things a line has in it."""
    kind, *rest = line
    yield kind, bool(rest) and bool(rest[0])
    if kind in ("bad", "piece"):
        yield kind, len(rest[0]) > 1, *sorted({strict for _, strict in rest[0]})
    for step in rest if kind == "refute" else ():
        if len(step) == 3:
            yield kind, min(len(step[0]), 2), bool(step[2])
        else:
            yield kind, "gates", any(isinstance(hint, list) for hint in step[1][:-1]), isinstance(step[1][-1], list)
    if kind == "broken":
        yield kind, rest[3] is not None


def named(lines: list[Line]) -> Iterator[list[Line]]:
    """Forgeries that were thought of: proofs that would be believed if one check were missing."""
    gates = range(1, 40)
    for index, line in enumerate(lines):
        if line[0] == "refute":
            steps = [[[[], [0, [gate, which], [gate, which]]]] for gate in gates for which in (0, 1, 2)]
            steps += [[[[], [[gate, which]]]] for gate in gates for which in (0, 1, -1)]
            steps += [[[[gate], [], []]] for gate in gates] + [[[[-gate], [1], []], [[], [0, 1]]] for gate in gates]
            steps += [[[[0], [1], []], [[], [1]]], [[[], [-1]]], [[[], [0, -1]]], [[[], [True]]], [[[], [0, 0, 0]]]]
            steps += [[[[0], [0]], [[], [1]]], [[[0], [0, 0]], [[], [1, 1]]], [[]], [[[], [], [], []]], [[[]]], []]
            for step in steps:
                yield [*lines[:index], ["refute", *step], *lines[index + 1 :]]
            yield [*lines[:index], ["refute", *line[1:], [[], [0]]], *lines[index + 1 :]]
            break
    for index, line in enumerate(lines):
        if line[0] == "orders":
            for a, b in ((0, 0), (0, 1), (1, 0), (1, 2), (1, 1)):
                for bound in ("0", "1", "1/2", "-1"):
                    for path in ([], [0], [0, 0], [0, 1], [1, 0], [-1], [True]):
                        yield [*lines[:index], [*line, [a, b, path, bound, []]], *lines[index + 1 :]]
            yield [*lines[:index], [*line, *line[1:]], *lines[index + 1 :]]
        if line[0] == "cycle":
            for path in ([], [0], [1], [0, 0], [*line[1], *line[1]], line[1][:-1], line[1][::-1]):
                for multiples in (line[2], [], [[0, 1]]):
                    yield [*lines[:index], ["cycle", path, multiples], *lines[index + 1 :]]


def verdict(found: Any) -> Any:
    """What is claimed; None if it is rejected."""
    if isinstance(found, str):
        return None
    return found.kind, found.text, found.obligations, found.refuted


def _judges(by: Checker, case: adversary.Case, tried: list[tuple[list[Any], Any]]) -> bool:
    return all(verdict(case.attempt(lines, by)) == want for lines, want in tried)


def leaf_changes(lines: list[Line]) -> Iterator[list[Line]]:
    """Each place of each line changed a little: another number, a twin of another type, something more, nothing."""
    for index, line in enumerate(lines):
        for new in _changes(line):
            yield [*lines[:index], new, *lines[index + 1 :]]
        yield [*lines[:index], *lines[index + 1 :]]
        yield [*lines[:index], line, *lines[index:]]


def some(changes: Iterator[list[Line]], count: int) -> list[list[Line]]:
    every = list(changes)
    return every[:: max(1, len(every) // count)]


def _changes(value: Any) -> Iterator[Any]:
    if isinstance(value, list):
        for index, each in enumerate(value):
            for new in _changes(each):
                yield [*value[:index], new, *value[index + 1 :]]
        yield value[:-1]
        yield [*value, value[-1] if value else 0]
    elif isinstance(value, bool):
        yield from (not value, int(value), None)
    elif isinstance(value, int):
        yield from (value + 1, value - 1, -value, str(value), bool(value), float(value), str(Fraction(value)), 10**9)
    else:
        yield from (1, f"{value}0", f"{value}/1", None, [value])
        if isinstance(value, str) and RATIONAL.fullmatch(value):
            for away in (Fraction(1, 1000), Fraction(1, 2), Fraction(3)):
                yield from (str(Fraction(value) + away), str(Fraction(value) - away))


def small() -> Iterator[tuple[str, Holds]]:
    """Certificates of the smallest plans: honest ones with all their changes, and those made up with care."""
    yield "small ranges", ranges
    for name, texts, lines in forgeries.honest():
        ground = reader.ground(*texts)
        tried = [(one, verdict(tools.judged(one, ground))) for one in [lines, *leaf_changes(lines), *named(lines)]]
        assert tried[0][1] is not None, name
        yield f"small {name}", partial(_claims, texts=texts, tried=tried)
    for name, texts, lines in forgeries.made_up():
        yield f"small {name}", partial(_refuses, texts=texts, lines=lines)


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


def _claims(by: Checker, texts: Texts, tried: list[tuple[list[Any], Any]]) -> bool:
    ground = by.reader.ground(*texts)
    return all(verdict(tools.judged(lines, ground, by=by)) == want for lines, want in tried)


def meanings() -> Iterator[tuple[str, Holds]]:
    """Plans that mean nothing to the checker, and a parameter beside a plan."""
    for name, texts in forgeries.without_meaning():
        yield f"free of meaning {name}", partial(_means_nothing, texts=texts)
    yield "free parameter beside", _reads_beside


def _means_nothing(by: Checker, texts: Texts) -> bool:
    try:
        for _, make in by.formulas.Formulas(by.reader.ground(*texts), tools.EPSILON).obligations():
            make()
    except by.reader.Unsupported:
        return True
    return False


def _reads_beside(by: Checker) -> bool:
    texts, beside = forgeries.BESIDE
    for value, breaks in ((Fraction(1), False), (Fraction(1, 2), True)):
        for given in (None, {"x": {"": value}}):
            ground = by.reader.ground(*texts, beside)
            times = {f"@{point}": Fraction(point) for point in range(1, len(ground.points))}
            points = {name: {"": time} for name, time in times.items()}
            formulas = by.formulas.Formulas(ground, tools.EPSILON, None if given is None else {**given, **points})
            (goal,) = [make() for label, make in formulas.obligations() if label.startswith("goal")]
            if Evaluation(formulas, {"x": value, **times}).true(goal) != breaks:
                return False
    return True


def within() -> Iterator[tuple[str, Holds]]:
    """A box inside of a valid one is not maximal: of the face that can be moved, that of the larger box is shown."""
    texts = [path.read_text(encoding="utf-8") for path in tools.NAVIGATION]
    plan, ground = load_plan(*tools.NAVIGATION), tools.grounded(tools.NAVIGATION)
    encoding, widest = create_encoding("relational", plan), envelope(plan).box
    for moved, each in widest.intervals.items():
        for away in (Side.LOWER, Side.UPPER):
            opened = Interval(each.lower, each.upper, away is Side.UPPER, away is Side.LOWER)
            smaller = widest.replace(moved, opened)
            lines = [header("maximal", smaller), *tools.made(tools.NAVIGATION, "box", box=smaller)[1:]]
            for name in widest.intervals:
                for side in (Side.LOWER, Side.UPPER):
                    box = widest if (name, side) == (moved, away) else smaller
                    lines += face_of(ground, encoding, box, name, side)
            yield f"within {moved} {away.value}", partial(_refuses, texts=texts, lines=lines)


def face_of(ground: Any, encoding: Any, box: Any, name: str, side: Side) -> list[Line]:
    end = box[name].end(side)
    assert end is not None
    bad, deadline = DiscoveredBadSet(encoding), Deadline.after(60)
    face = _Face(ground, lambda: _reasons(ground, encoding.epsilon, box, deadline), box, bad, name, side, end, deadline)
    return face.lines()


def _refuses(by: Checker, texts: list[str], lines: list[Line]) -> bool:
    return isinstance(tools.judged(lines, by.reader.ground(*texts), by=by), str)


def commands(folder: Path) -> Iterator[tuple[str, Holds]]:
    """The command, with honest certificates and demands that they meet or do not."""
    for files, kinds in (
        (tools.NAVIGATION, ("plan", "box", "maximal", "region")),
        (tools.GENERATOR, ("plan", "box", "maximal", "region")),
        (DELIVERY, ("box",)),
    ):
        for kind in kinds:
            path = folder / f"{files[0].parent.name}-{kind}.cert"
            write(tools.made(files, kind), path)
            for demanded in demands(path, files, folder):
                name = "demanded of" if demanded else "honest"
                yield f"{name} {path.stem} {demanded}", partial(_answers, path=path, files=files, demanded=demanded)


def demands(path: Path, files: Any, folder: Path) -> Iterator[dict[str, Any]]:
    yield {}
    if files is not tools.NAVIGATION:
        return
    for kind in ("plan", "box", "maximal", "region", "knowledge", "execution"):
        yield {"kind": kind}
    for epsilon in ("0", "1/2", "100", "-1", "x", "1/0", ""):
        yield {"epsilon": epsilon}
    yield {"assume": ["a=b"]}
    box = tools.ask(path, files)[1].get("box")
    if box is not None:
        for number, changed in enumerate(boxes(box)):
            wanted = folder / f"{path.stem}-{number}.json"
            wanted.write_text(json.dumps(changed), encoding="utf-8")
            for kind in (None, "maximal") if path.stem.endswith("maximal") else (None,):
                yield {"box": str(wanted), "kind": kind}


def boxes(box: dict[str, Any]) -> Iterator[Any]:
    yield {"parameters": box}
    yield box
    yield {}
    name = next(iter(box))
    yield {name: box[name]}
    for end, value in (
        ("lower", "26"), ("lower", "24"), ("upper", "35"), ("upper", "37"), ("upper", "inf"), ("lower", "-inf"),
        ("upper", "x"), ("lower_closed", False), ("upper_closed", False), ("lower", "36"), ("upper", "25"),
    ):  # fmt: skip
        yield {**box, name: {**box[name], end: value}}
    yield {each: {"lower": ends["lower"], "upper": ends["upper"]} for each, ends in box.items()}


def answered(path: Path, files: Any, demanded: dict[str, Any], by: Checker = tools.CHECKER) -> tuple[int, Any]:
    code, answer = tools.ask(path, files, by=by, **demanded)
    return code, None if code else answer


def _answers(by: Checker, path: Path, files: Any, demanded: dict[str, Any]) -> bool:
    return answered(path, files, demanded, by) == expected(path, tuple(files), json.dumps(demanded))


@cache
def expected(path: Path, files: tuple[Path, ...], demanded: str) -> tuple[int, Any]:
    return answered(path, files, json.loads(demanded))


# -- plans with choices ------------------------------------------------------------------------------------------------


def with_choices(folder: Path) -> Iterator[tuple[str, Holds]]:
    """Formulas against the oracle, executions against the referee, certificates of both kinds."""
    for seed in range(16):
        path = random_plan(seed, 0, Shape(top=4, inner=2)).write(folder / f"choices-{seed}")
        plan = load_team_plan(path)
        found = Oracle(plan).decide()
        yield f"oracle {seed}", partial(networks.decides, path=path, exists=found.verdict is ExecutionExistence.EXISTS)
        if found.witness is not None:
            yield (
                f"executions {seed}",
                partial(networks.referees, path=path, known=networks.executions(plan, found.witness, Random(seed))),
            )
        else:
            lines = knowledge(path, tools.EPSILON, Deadline.after(60))
            write(lines, folder / f"{seed}.cert")
            for demanded in ({}, {"kind": "knowledge"}, {"kind": "execution"}, {"kind": "plan"}, {"assume": ["a=b"]}):
                yield (
                    f"knowledge {seed}",
                    partial(_answers, path=folder / f"{seed}.cert", files=(path,), demanded=demanded),
                )
    assumed = {"xA1": "glass", "xA2": "coffee"}
    witness = Oracle(load_team_plan(KITCHEN)).decide().witness
    assert witness is not None
    for kind, lines in {
        "knowledge": knowledge(KITCHEN, tools.EPSILON, Deadline.after(60), assumed),
        "execution": execution(KITCHEN, tools.EPSILON, witness.scenario, witness.schedule),
    }.items():
        write(lines, folder / f"{kind}.cert")
        both = ["xA1=glass", "xA2=coffee"]
        for assume in ([], both, both[:1], [*both, "xA3=bagel"], ["xA1=mug"], ["xA1"], ["xA1=glass", "xA2=juice"]):
            for asked in (None, kind, "plan"):
                demanded = {"kind": asked, "assume": assume}
                yield (
                    f"kitchen {kind} {demanded}",
                    partial(_answers, path=folder / f"{kind}.cert", files=(KITCHEN,), demanded=demanded),
                )
        for number, new in enumerate(some(leaf_changes(lines), 60)):
            write(new, folder / f"{kind}-{number}.cert")
            yield (
                f"leaves of {kind}",
                partial(_answers, path=folder / f"{kind}-{number}.cert", files=(KITCHEN,), demanded={}),
            )


def small_networks(folder: Path) -> Iterator[tuple[str, Holds]]:
    """A small network and its certificates, and what is no network, or none that the checker knows."""
    for number, (name, path, tapes, epsilon) in enumerate(networks.small(folder / "small")):
        for place, lines in enumerate(tapes):
            certificate = folder / f"small-{number}-{place}.cert"
            write(lines, certificate)
            demanded = {"epsilon": epsilon}
            if not answered(certificate, (path,), demanded)[0] and not networks.is_true(path, lines):
                raise AssertionError(f"{name}: something false is accepted: {lines}")
            yield f"wrong network {name}", partial(_answers, path=certificate, files=(path,), demanded=demanded)


def random_networks(folder: Path) -> Iterator[tuple[str, Holds]]:
    for seed in range(150):
        path = networks.random_network(seed, folder / f"network-{seed}")
        try:
            plan = load_team_plan(path)
        except RobustError:
            continue
        found = Oracle(plan).decide()
        yield (
            f"oracle of network {seed}",
            partial(networks.decides, path=path, exists=found.verdict is ExecutionExistence.EXISTS),
        )
        if found.witness is not None:
            known = networks.executions(plan, found.witness, Random(seed))
            yield f"executions of network {seed}", partial(networks.referees, path=path, known=known)


SECTIONS: tuple[tuple[tuple[str, ...], Callable[[Path], Iterator[tuple[str, Holds]]]], ...] = (
    (("texts",), lambda _: elaborate.probes()),
    (("reading",), lambda _: readings()),
    (("free",), lambda _: chain(free(), meanings())),
    (("wrong text",), lambda _: wrong_texts()),
    (("within",), lambda _: within()),
    (("small",), lambda _: small()),
    (("forged", "leaves of plan", "leaves of network"), lambda _: forged()),
    (("oracle", "executions", "knowledge", "kitchen", "leaves of ex", "leaves of kn"), with_choices),
    (("wrong network",), small_networks),
    (("oracle", "executions"), random_networks),
    (("honest", "demanded"), commands),
    (("main",), command_lines),
)
"""What makes probes, by how their names begin."""
