"""What a checker has to get right, to tell a changed one from the one that is meant: see `tests.certify.mutants`.

A probe is a name and a function from a checker to whether it did right: what it says of a plan is compared with the
simulator, the oracle or the exact region, and otherwise with what the checker that is meant says.
"""

import ast
import tempfile
import warnings
from functools import cache, partial
from itertools import chain, product
from pathlib import Path

import pytest

from benchmarks.generators.team_plans import Shape, random_plan
from robust import RefutedError, envelope
from robust.certify import bad
from robust.certify.checker import proofs, reader
from robust.certify.checker.formulas import Formulas
from robust.certify.tape import header, write
from robust.encode import create_encoding
from robust.irr.widen import DiscoveredBadSet
from robust.pike_bridge.action_model import load_team_plan
from robust.pike_bridge.semantics import Oracle
from robust.qe.box import Interval, Side
from robust.reading import load_plan
from robust.smt.limits import Deadline
from tests.certify import adversary, networks, test_reader, tools
from tests.certify.adversary import PLANS, TABLES, cases, leaf_changes, named, run
from tests.certify.command_lines import command_lines
from tests.certify.mutants import ASKED, MODULES, TEXTS, accepted, load, mutants, noticed_by

KITCHEN = tools.EXAMPLES / "kitchen" / "kitchen.tpnu.json"


def probes(asked):
    """Those whose names begin with one of these; they take some seconds to make, and some to ask."""
    pairs = [(make, name, one) for names, make in SECTIONS for name in names for one in asked]
    makers = dict.fromkeys(make for make, name, one in pairs if name.startswith(one) or one.startswith(name))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return [probe for make in makers for probe in _made(make) if probe[0].startswith(asked)]


@cache
def _made(make):
    return list(make(Path(tempfile.mkdtemp(prefix="robust-bank-"))))


def forged(plans=22, attempts=1_500):
    """Honest certificates, which are accepted, and the adversary's, which are so only if what they claim is true."""
    known, outcome = cases(plans, 0), run(attempts, plans=plans, seed=1)
    assert outcome.accepted == []
    tried = {case.name: [(lines, verdict(case.attempt(lines))) for lines in case.honest] for case in known}
    for case, lines, claim in outcome.tried:
        tried[case.name].append((lines, verdict(claim)))
    yield from ((f"forged {case.name}", partial(_judges, case=case, tried=tried[case.name])) for case in known)
    for case, lines in rich(known):
        every = list(leaf_changes(lines))
        changes = [*named(lines), *every[:: max(1, len(every) // 400)]]
        known_changes = [(change, verdict(case.attempt(change))) for change in changes]
        yield f"leaves of {case.name} {lines[0][1]}", partial(_judges, case=case, tried=known_changes)


def rich(known):
    """A few short tapes that have, together, everything that honest tapes have."""
    every = [(case, lines) for case in known for lines in case.honest if not isinstance(case.attempt(lines), str)]
    every.sort(key=lambda one: len(str(one[1])))
    chosen, seen = [], set()
    for case, lines in every:
        new = {shape(part) for line in lines for part in (line, *line[1:])}
        if not new <= seen and len(str(lines)) < 20_000:
            chosen.append((case, lines))
            seen |= new
    return chosen[-8:]


def shape(value):
    """What kinds of things a line has in it, as far as they matter to what looks at it."""
    if isinstance(value, list):
        return frozenset(shape(inner) for inner in value) if len(value) != 1 else (shape(value[0]),)
    return value if isinstance(value, bool) or str(value).isalpha() else type(value)


def verdict(claim):
    """What is claimed; None if it is rejected."""
    return None if isinstance(claim, str) else (claim.kind, claim.text, claim.obligations, claim.refuted)


def _judges(by, case, tried):
    return all(verdict(case.attempt(lines, by)) == want for lines, want in tried)


def small():
    """Certificates of the smallest plans: honest ones with all their changes, and those made up with care."""
    for name, plan, lines in adversary.TABLES["honest"]:
        ground = reader.ground(*PLANS[plan])
        tried = [(one, verdict(tools.judged(one, ground))) for one in [lines, *leaf_changes(lines), *named(lines)]]
        assert tried[0][1] is not None, name
        yield f"small {name}", partial(_claims, texts=PLANS[plan], tried=tried)
    for name, plan, lines in adversary.TABLES["made up"]:
        yield f"small {name}", partial(_claims, texts=PLANS[plan], tried=[(lines, None)])


def _claims(by, texts, tried):
    ground = by.reader.ground(*texts)
    return all(verdict(tools.judged(lines, ground, by=by)) == want for lines, want in tried)


def meanings():
    """Plans that mean nothing to the checker, and a parameter beside a plan."""
    for name, *texts in adversary.TABLES["without meaning"]:
        yield f"free of meaning {name}", partial(test_reader.meaningless, texts=texts)
    yield "free parameter beside", test_reader.reads_beside


def within():
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


def commands(folder):
    """The command, with honest certificates."""
    delivery = tuple(tools.EXAMPLES / "delivery" / name for name in ("domain.pddl", "problem.pddl", "plan.stn"))
    every = ("plan", "box", "maximal", "shape", "region")
    for files, kinds in ((tools.NAVIGATION, every), (tools.GENERATOR, every), (delivery, ("box",))):
        for kind in kinds:
            path = folder / f"{files[0].parent.name}-{kind}.cert"
            write(tools.made(files, kind), path)
            yield f"honest {path.stem}", answers(path, files)


def answers(path, files, **demanded):
    return partial(_answers, path=path, files=files, demanded=demanded, expected=answered(path, files, demanded))


def answered(path, files, demanded, by=tools.CHECKER):
    code, answer = tools.ask(path, files, by=by, **demanded)
    return code, None if code else answer


def _answers(by, path, files, demanded, expected):
    return by is tools.CHECKER or answered(path, files, demanded, by) == expected


def with_choices(folder, count=16):
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


def kitchen(folder):
    """Changes of the certificates of both kinds."""
    witness = Oracle(load_team_plan(KITCHEN)).decide().witness
    for kind, lines in networks.certificates(KITCHEN, witness, {"xA1": "glass", "xA2": "coffee"}):
        every = list(leaf_changes(lines))
        for number, new in enumerate([lines, *every[:: max(1, len(every) // 60)]]):
            write(new, folder / f"{kind}-{number}.cert")
            yield f"leaves of {kind}", answers(folder / f"{kind}-{number}.cert", (KITCHEN,))


def small_networks(folder):
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


SECTIONS = (
    (("texts",), lambda _: test_reader.texts_probes()),
    (("reading",), lambda _: test_reader.readings()),
    (("free",), lambda _: chain(test_reader.free(), meanings())),
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


QUICK = {
    "texts": lambda _: test_reader.texts_probes(),
    "formulas over all times": lambda _: chain(test_reader.free(1_000, 30), meanings()),
    "forgeries": lambda _: small(),
    "plans with choices": partial(with_choices, count=9),
    "random networks": partial(networks.random_networks, first=150, count=20),
    "small networks": small_networks,
    "command lines": command_lines,
}


@pytest.mark.parametrize(
    ("make", "least"),
    [
        *(pytest.param(make, 20, id=name) for name, make in QUICK.items()),
        *(pytest.param(make, 4, id=f"all {names}", marks=pytest.mark.slow) for names, make in SECTIONS),
    ],
)
def test_the_checker_does_right(make, least, tmp_path):
    """Making the probes judges what is accepted; most of them ask the checker again."""
    asked = list(make(tmp_path))
    assert len(asked) >= least
    assert [name for name, holds in asked if not holds(tools.CHECKER)] == []


def test_no_false_claim_is_accepted():
    kinds = {lines[0][1] for case in cases(12, 0) for lines in case.honest if not isinstance(case.attempt(lines), str)}
    assert kinds >= {"box", "maximal", "region"}
    outcome = run(500, plans=12)
    assert outcome.accepted == []
    assert sum(outcome.rejected.values()) > 475
    assert len(outcome.rejected) > 15, "the attempts fail for few reasons only"


@pytest.mark.slow
@pytest.mark.parametrize("first", range(1_000, 11_000, 1_000))
def test_no_false_claim_of_very_many_is_accepted(first):
    assert run(10_000, plans=40, first=first, seed=first).accepted == []


@pytest.mark.parametrize("check", ["imply", "lemma", "demand"])
def test_a_checker_that_believes_more_is_found_out(check, monkeypatch):
    """The adversary is no decoration: without one of the checks it gets false claims through."""
    monkeypatch.setattr(proofs.Facts if check == "imply" else proofs, check, lambda *_, **__: None)
    assert any(run(200, plans=20, seed=seed).accepted for seed in range(50))


@pytest.mark.parametrize(
    ("kind", "every"), [("maximal", 4), ("region", 1), pytest.param("maximal", 1, marks=pytest.mark.slow)]
)
def test_refutations_that_somebody_might_try(kind, every):
    """Comparisons as gates, literals that are none, clauses that are not there, contradictions out of nothing."""
    lines, ground = tools.made(tools.NAVIGATION, kind), tools.grounded(tools.NAVIGATION)
    tried = [forged for forged in adversary.named(lines) if len(forged) == len(lines)]
    changed = [next(new[0] for new, old in zip(forged, lines, strict=True) if new != old) for forged in tried]
    refuting = [forged for forged, place in zip(tried, changed, strict=True) if place == "refute"]
    assert len(refuting) > 300
    assert all(isinstance(tools.judged(forged, ground), str) for forged in refuting[::every])


def test_false_orders_leave_a_value_without_a_last_assignment():
    ground = reader.ground(*TABLES["false orders"])
    formulas = Formulas(ground, tools.EPSILON)
    ends = [number for number, effects in enumerate(ground.effects) if effects]
    formulas.known.update({(a, b): tools.EPSILON for a in ends for b in ends if a != b})
    assert all(make() for _, make in formulas.obligations())


def test_changes_are_of_the_present_text_and_what_is_accepted_has_a_reason():
    """The tree is as before after all of them."""
    every = {module: list(mutants(module)) for module in MODULES}
    proofs_changes = every["proofs"]
    assert len(proofs_changes) > 400
    assert sum(mutant.before != mutant.after for mutant in proofs_changes) > 0.95 * len(proofs_changes)
    assert ast.unparse(proofs_changes[0].tree) == ast.unparse(ast.parse(TEXTS["proofs"]))
    assert load().proofs.Rejected is not tools.CHECKER.proofs.Rejected
    assert all(accepted().values())
    assert accepted().keys() <= {mutant.key for changes in every.values() for mutant in changes}


def test_a_box_without_one_of_its_faces_is_not_maximal():
    """What is shown beyond the face of the larger box says nothing of the face itself, which could be added."""
    asked = list(within())
    assert len(asked) == 4
    assert all(holds(tools.CHECKER) for _, holds in asked)
    changes = (each for each in mutants("claims") if each.after.startswith("demand(away > 0, "))
    changed = next(changes).checker()
    assert not all(holds(changed) for _, holds in asked)


@pytest.mark.slow
@pytest.mark.parametrize(("module", "function", "line"), TABLES["believes more"])
def test_a_checker_that_believes_more_is_noticed(module, function, line):
    changes = (each for each in mutants(module) if each.function == function and line in each.after)
    assert noticed_by(next(changes), probes(ASKED[module]), 60) is not None
