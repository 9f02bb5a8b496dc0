"""Certificates for tests: made once, taken apart, changed, put together again, and judged by a solver."""

from __future__ import annotations

import gzip
import importlib.util
import json
import zlib
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from random import Random

from robust.api import check, envelope
from robust.certify.circuit import Boolean, Circuit, Conjunction, Equivalence
from robust.certify.ground import GroundPlan
from robust.certify.linear import Atom
from robust.certify.matching import _literal, _node, read
from robust.certify.produce import PlanCertificate, digests
from robust.certify.verify import checker_path
from robust.certify.witness import Witnesses
from robust.encode.interface import create_encoding
from robust.errors import UnsupportedError
from robust.irr.box import Box, Interval
from robust.irr.check import Answer
from robust.plan.load import load_plan
from robust.plan.model import ParametrizedPlan
from robust.smt.limits import Deadline
from robust.smt.session import Session, Verdict
from robust.smt.terms import Formula, Terms

EXAMPLES = Path(__file__).parents[2] / "robust" / "examples"
NAVIGATION = tuple(EXAMPLES / "two_sample_navigation" / name for name in ("domain.pddl", "problem.pddl", "plan.stn"))
GENERATOR = tuple(EXAMPLES / "generator" / name for name in ("domain.pddl", "problem.pddl", "plan.stn"))


def load_checker():
    """The checker as a module, which knows nothing of this package."""
    spec = importlib.util.spec_from_file_location("certificate_checker", checker_path())
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


CHECKER = load_checker()


def rejection(path, files=None):
    """Why the checker does not accept a certificate; None if it does. Any other exception is a fault of the checker."""
    try:
        CHECKER.check(str(path), files or {})
    except (CHECKER.Rejected, OSError, zlib.error) as error:
        return str(error) or "unreadable"
    return None


def certificate(files, path, *, kind="box", encoding="relational", box=None):
    """A certificate of the plan in `files`, written to `path`; the plan and the box."""
    plan = load_plan(*files)
    if box is None:
        box = Box.nominal(plan.parameters) if kind == "plan" else envelope(plan).box
    inputs = digests(dict(zip(("domain", "problem", "plan"), files, strict=True)))
    made = PlanCertificate(create_encoding(encoding, plan), kind=kind, inputs=inputs, box=box)
    made.add_box()
    if kind == "maximal":
        made.add_witnesses()
    made.writer.save(path)
    return plan, box


def lines_of(path):
    return [json.loads(line) for line in gzip.decompress(path.read_bytes()).split(b"\n") if line]


def write_lines(path, lines):
    text = "".join(json.dumps(line, separators=(",", ":")) + "\n" for line in lines)
    path.write_bytes(gzip.compress(text.encode(), compresslevel=1, mtime=0))


# -- changes ---------------------------------------------------------------------------------------------------------


def mutated(data: bytes, lines: list, random: Random) -> bytes:
    """One certificate that differs in one place from the one that `data` and `lines` are."""
    way = random.randrange(10)
    if way == 0:
        place = random.randrange(len(data))
        return data[:place] + bytes([data[place] ^ (1 << random.randrange(8))]) + data[place + 1 :]
    if way == 1:
        return data[: random.randrange(len(data))]
    if way == 2:
        text = bytearray("".join(json.dumps(line, separators=(",", ":")) + "\n" for line in lines).encode())
        text[random.randrange(len(text))] ^= 1 << random.randrange(8)
        return gzip.compress(bytes(text), compresslevel=1, mtime=0)
    changed = json.loads(json.dumps(lines))
    place = random.randrange(len(changed))
    match way:
        case 3:
            del changed[place]
        case 4:
            changed.insert(place, changed[random.randrange(len(changed))])
        case 5:
            other = random.randrange(len(changed))
            changed[place], changed[other] = changed[other], changed[place]
        case 6:
            _shift_face(changed[0], random)
        case 7:
            inputs = changed[0]["inputs"]
            first, second = random.sample(sorted(inputs), 2)
            inputs[first], inputs[second] = inputs[second], inputs[first]
        case 8:
            kinds = ("lemma", "root", "derive", "witness", "schedule")
            place = random.choice([index for index, line in enumerate(changed) if index and line[0] in kinds])
            _change_number(changed, place, random)
        case _:
            _change_number(changed, place, random)
    text = "".join(json.dumps(line, separators=(",", ":")) + "\n" for line in changed)
    return gzip.compress(text.encode(), compresslevel=1, mtime=0)


def _shift_face(header, random):
    if not header["box"]:
        return
    ends = random.choice(header["box"])
    side = random.randrange(4)
    if side % 2:
        ends[side] = not ends[side]
    else:
        ends[side] = str(
            Fraction(ends[side] or 0) + Fraction(random.choice((-7, -1, 1, 3)), random.choice((1, 2, 1000)))
        )


def _change_number(lines, place, random):
    """A number, truth value or text somewhere in a line becomes another."""
    leaves = list(_leaves(lines, place))
    if not leaves:
        return
    holder, key = random.choice(leaves)
    value = holder[key]
    if isinstance(value, bool):
        holder[key] = not value
    elif isinstance(value, int):
        holder[key] = random.choice((value + 1, value - 1, -value, 0, value * 2, 10**60, str(value), None))
    elif isinstance(value, str):
        holder[key] = random.choice((value + "0", value[1:], "1/3", "-1", "", 7))
    else:
        holder[key] = random.choice((0, [], "x"))


def _leaves(holder, key) -> Iterator:
    value = holder[key]
    if isinstance(value, dict | list) and value:
        for inner in value if isinstance(value, dict) else range(len(value)):
            yield from _leaves(value, inner)
    else:
        yield holder, key


# -- judgement -------------------------------------------------------------------------------------------------------


def formulas_are_unsatisfiable(path) -> bool:
    """Whether a solver agrees that each formula of a certificate has no model."""
    lines = lines_of(path)
    found = read(path)
    nodes: list[int] = [0]
    circuit = Circuit()
    roots, name = {}, ""
    for kind, *rest in lines[1:]:
        if kind in ("a", "b", "g", "e"):
            nodes.append(_node(circuit, nodes, kind, rest))
        elif kind == "obligation":
            name = rest[0]
        elif kind == "root":
            roots.setdefault(name, []).append(_literal(nodes, rest[0]))
    assert set(found.roots) >= set(roots)
    terms = Terms()
    built: dict[int, Formula] = {}
    for literals in roots.values():
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
            case Boolean(name):
                built[number] = manager.Symbol(f"boolean {name}")
            case Conjunction():
                built[number] = terms.conjunction(parts)
            case Equivalence():
                built[number] = manager.Iff(*parts)
    return built[number] if literal > 0 else terms.negation(built[number])


def claim_is_true(path, plan: ParametrizedPlan) -> bool:
    """Whether a solver agrees with what a certificate claims of a plan."""
    header = lines_of(path)[0]
    box = Box(
        {
            name: Interval(_end(low), _end(high), low_closed, high_closed)
            for (name, *_), (low, low_closed, high, high_closed) in zip(
                header["parameters"], header["box"], strict=True
            )
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
