"""The checker: what it says and needs, forgeries, what is small and dear; and refutations, found and checked."""

from __future__ import annotations

import ast
import gzip
import io
import json
import os
import shutil
import subprocess
import sys
import tokenize
from collections import Counter
from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import partial
from itertools import product
from pathlib import Path
from random import Random
from typing import Any

import pytest
from sympy import primerange

from robust.certify import FOLDER, CheckerOutcome, Demanded, hints, verify
from robust.certify.checker import proofs
from robust.certify.checker.formulas import Formulas, plus
from robust.certify.checker.reader import Ground, Model
from robust.certify.hints import KnownFacts
from robust.certify.tape import write
from robust.plan.polynomial import Polynomial
from robust.smt.limits import Deadline
from robust.smt.session import Satisfiability, Session, Terms
from tests.certify import tools
from tests.certify.adversary import LONGER
from tests.certify.texts import random_texts
from tests.tables import tables

TABLES = tables(__file__)

ALLOWED = {"argparse", "collections", "dataclasses", "fractions", "functools", "gzip", "hashlib", "itertools", "json"}
ALLOWED |= {"math", "pathlib", "re", "resource", "signal", "sys", "tomllib", "typing", "zlib"}


def test_it_is_short_and_needs_the_standard_library_only():
    total = 0
    for path in FOLDER.glob("*.py"):
        text = path.read_text(encoding="utf-8")
        total += len(lines_of_code(text))
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Import):
                assert {alias.name for alias in node.names} <= ALLOWED, path
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 1 or (node.module or "").split(".")[0] in ALLOWED, path
    assert 1_000 < total <= 1_600


def lines_of_code(text):
    """The lines that are neither blank, nor comments, nor documentation."""
    words = tokenize.generate_tokens(io.StringIO(text).readline)
    silent = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
    lines = {line for word in words if word.type not in silent for line in range(word.start[0], word.end[0] + 1)}
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            lines -= {*range(node.lineno, (node.end_lineno or node.lineno) + 1)}
    return lines


@pytest.fixture(scope="module")
def box():
    return tools.made(tools.NAVIGATION, "maximal")


@pytest.fixture(scope="module")
def region():
    return tools.made(tools.NAVIGATION, "region")


@pytest.fixture(scope="module")
def ground():
    return tools.grounded(tools.NAVIGATION)


def run_alone(folder, seeds, *words):
    """What is printed with any of these seeds of hashes; nothing of this package is on the path."""
    variables = [{**os.environ, "PYTHONPATH": "", "PYTHONHASHSEED": seed} for seed in seeds]
    command = partial(subprocess.run, [sys.executable, *words], cwd=folder, capture_output=True, text=True)
    runs = [command(env=environment, check=False) for environment in variables]
    assert {(run.returncode, run.stderr) for run in runs} == {(0, "")}
    (said,) = {run.stdout for run in runs}
    return said


def test_it_runs_from_a_copy_of_its_folder(box, tmp_path):
    write(box, tmp_path / "box.cert")
    shutil.copytree(FOLDER, tmp_path / "checker", ignore=shutil.ignore_patterns("__pycache__"))
    said = run_alone(tmp_path, "017", "-m", "checker", "box.cert", *map(str, tools.NAVIGATION))
    assert said.startswith(
        "established: valid for every schedule, for all (to_ridge, to_crater) in [25, 36] x [35, 46]; no other valid "
        "box within the declared bounds contains this one, epsilon = 1/1000\nof domain: sha256 "
    )


def test_what_is_mutex_does_not_depend_on_the_seed_of_hashes(tmp_path):
    script = (
        "import json, sys; sys.path.insert(0, sys.argv[1]); from checker.reader import ground, Unsupported; "
        "from checker.formulas import Formulas; from fractions import Fraction\n"
        "for texts in json.loads(sys.argv[2]):\n"
        "  try:\n"
        "    f = Formulas(ground(*texts), Fraction(1, 1000))\n"
        "    print([(label, make()) for label, make in f.obligations()], f.circuit.nodes)\n"
        "  except Unsupported as error: print(error)"
    )
    texts = json.dumps([random_texts(seed) for seed in range(12)])
    assert len(run_alone(tmp_path, "12", "-c", script, str(FOLDER.parent), texts).splitlines()) == 12


def test_it_says_what_was_demanded_and_of_which_format_a_certificate_is(box, tmp_path):
    path = tmp_path / "cert"
    assert "expected region" in tools.command(box, path, tools.NAVIGATION, kind="region")[1]["reason"]
    assert tools.ask(path, tools.NAVIGATION)[1]["epsilon"] == "1/1000"
    assert not any("1/1000" in json.dumps(line) for line in box)  # epsilon is an input of the check
    path.write_bytes(gzip.compress(b'{"format":"robust/certificate/1","kind":"plan"}\n["end"]\n'))
    code, answer = tools.ask(path, tools.NAVIGATION)
    assert (code, answer["reason"]) == (1, "expected a certificate of format robust/certificate/2")


def test_it_is_a_process_with_limits(box, tmp_path):
    heavy = gzip.compress(b'["robust/certificate/2","plan",null]\n[' + b"[" * (80 << 20) + b"\n", 1)
    paths = [tmp_path / name for name in ("box.cert", "heavy.cert", "no.cert")]
    write(box, paths[0])
    paths[1].write_bytes(heavy)
    paths[2].write_bytes(b"no gzip")
    established, *others = (verify(path, tools.NAVIGATION, Demanded(tools.EPSILON, "box")) for path in paths)
    assert established.outcome is CheckerOutcome.ESTABLISHED
    assert established.answer["files"].keys() == {"domain", "problem", "plan"}
    assert [other.outcome for other in others] == [CheckerOutcome.REJECTED, CheckerOutcome.UNREADABLE]


ONCE = json.loads(Path(__file__).with_name("data").joinpath("once_accepted.json").read_text(encoding="utf-8"))
"""Honest tapes of the example; forgeries of each class that once was accepted: other lines in place of some (`forged`),
or another text (`texts`)."""


def rejected(lines, ground):
    return isinstance(tools.judged(lines, ground), str)


def test_what_was_accepted_once_is_rejected(ground):
    """A schedule given twice, roots smuggled in, names and formulas of its own, everything folded, other numbers."""
    honest = ONCE["honest"]
    assert not any(rejected(lines, ground) for lines in honest.values())
    for name, kind, start, stop, lines in ONCE["forged"]:
        assert rejected([*honest[kind][:start], *lines, *honest[kind][stop:]], ground), (name, lines)
    for name, kind, old, new in ONCE["texts"]:
        assert rejected(json.loads(json.dumps(honest[kind]).replace(old, new)), ground), (name, new)


@pytest.mark.parametrize(
    ("kind", "every"),
    [("box", 7), ("region", 35), *(pytest.param(kind, 1, marks=pytest.mark.slow) for kind in ("box", "region"))],
)
def test_true_is_not_one(kind, every, ground, request):
    lines = request.getfixturevalue(kind)
    twinned = [(path, twin) for path, value in leaves(lines)[::every] for twin in twins(value)]
    assert len(twinned) > 40
    for path, twin in twinned:
        assert rejected(replaced(lines, path, twin), ground), (path, twin)


def twins(value):
    """What equals a value, or looks like it, and is of another type."""
    if isinstance(value, bool):
        return int(value), str(value).lower()
    if value in (0, 1):
        return bool(value), float(value), str(value)
    return (str(value),) if isinstance(value, int) else ()


def leaves(value, path=()):
    if not isinstance(value, list):
        return [(path, value)]
    return [leaf for index, inner in enumerate(value) for leaf in leaves(inner, (*path, index))]


def replaced(value, path, new):
    return tools.put(value, path[0], replaced(value[path[0]], path[1:], new)) if path else new


@pytest.mark.parametrize(("ends", "reason"), TABLES["what is true of nothing is not a claim"])
def test_what_is_true_of_nothing_is_not_a_claim(ends, reason, box, ground):
    (name, kind, (_, other)), *rest = box
    assert tools.judged([[name, kind, [ends, other]], *rest], ground) == reason


LARGEST, SECONDS, MEMORY_MB = 100_000, 5, 300
LONG = 3_900_000
"""Bytes: about as many as the checker unpacks of a certificate of that size."""
TABLE = Path(__file__).with_name("data").joinpath("hostile.json").read_text(encoding="utf-8")
TABLE = TABLE.replace("{4000 nines}", "9" * 4000).replace("{4000 sevens}", "7" * 4000)
FIRST = {"box": [["0", True, "9", True]], "narrow": [["3", True, "9", True]]}
BAD: list[Any] = [[[["k", "-1"], ["", "3"]], True]]


def certificate(kind, *more):
    """A certificate of JSON, of a text with one part again and again, and of the same lines again and again."""
    first = ["robust/certificate/2", "box" if kind in FIRST else kind.partition(",")[0], FIRST.get(kind)]
    return dumped(first) + ("\n" * (kind != "plan, unended")) + "".join(map(repeated, more))


def dumped(line):
    return json.dumps(line, separators=(",", ":"))


def repeated(line):
    if isinstance(line, list):
        return f"{dumped(line)}\n"
    if "lines" in line:
        return "".join(f"{dumped(one)}\n" for one in line["lines"]) * line["times"]
    before, part, after = line["before"], line["part"], line["after"] or ""
    times = line.get("times", (LONG - len(before) - len(after)) // len(part))
    return before + part * times + after + "\n" * (line["after"] is not None)


def coprime():
    """Sides of a polyhedron, and multiples of them, whose denominators have nothing in common."""
    primes: Iterator[int] = primerange(1000, 10**6)
    bad = [[[["k", f"-1/{next(primes)}"], ["", f"1/{next(primes)}"]], True] for _ in range(3000)]
    return certificate("region", ["bad", bad], ["cycle", [0, 2], [[index, 1] for index in range(3000)]])


def long_numbers():
    """The sum of multiples of one fact each with a thousand digits."""
    factors = [[0, f"{10**998 + 2 * index + 1}/{10**997 * 3 + 7 * index}"] for index in range(1000)]
    return certificate("region", ["bad", BAD * 1000], ["cycle", [0, 2], factors])


def cycles():
    """Bad values in one polyhedron after the other, all of them different."""
    bad = (["bad", [*BAD, [[["k", "1"], ["", str(number)]], True]]] for number in range(1, 35_000))
    return certificate("region", *(line for piece in bad for line in (piece, ["cycle", [0, 2], [[0, 1]]])))


HOSTILE: dict[str, Callable[[], str]] = {
    "coprime denominators": coprime,
    "long numbers": long_numbers,
    "bad values in many polyhedra": cycles,
    "a bomb": lambda: "\0" * 90_000_000,
    **{name: partial(certificate, *content) for name, content in json.loads(TABLE).items()},
}
QUICK = {"empty lists", "a walk of six million steps", "coprime denominators"}
MEASURE = """import resource, subprocess, sys
ended = subprocess.run(sys.argv[1:], capture_output=True, text=True)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(ended.returncode, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024, ended.stdout, ended.stderr)"""
"""In a process of its own: what a child is said to have in memory is not less than what its parent had."""


@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in HOSTILE]
)
def test_what_costs_much_is_refused_cheaply(name, tmp_path):
    packed = gzip.compress(HOSTILE[name]().encode())
    packed += gzip.compress(Random(1).randbytes(max(LARGEST - len(packed) - 100, 0)))
    assert len(packed) <= LARGEST
    path = tools.kept(tmp_path / "hostile.cert", packed)
    words = [sys.executable, "-m", FOLDER.name, path, *map(str, tools.written(LONGER, tmp_path))]
    measured = [sys.executable, "-I", "-c", MEASURE, *words]
    ended = subprocess.run(measured, cwd=FOLDER.parent, capture_output=True, text=True, check=True)
    code, seconds, megabytes, said = ended.stdout.split(maxsplit=3)
    assert code in "1234"
    assert len(said.strip().splitlines()) == 1
    assert float(seconds) <= SECONDS
    assert float(megabytes) <= MEMORY_MB


NONE = Deadline()


def without_zeros(form):
    return {name: value for name, value in form.items() if value}


def propagates_to_conflict(clauses, clause, hints):
    """Whether each hint is unit or false in its turn, and the last one false, if the clause is."""
    false = set(clause)
    for hint in hints:
        open_literals = set(clauses[hint]) - false
        if not open_literals:
            return True
        if len(open_literals) > 1:
            return False
        false.add(-open_literals.pop())
    return False


@pytest.mark.parametrize("seed", range(60))
def test_propositional_solver_agrees_with_truth_tables(seed):
    random = Random(seed)
    variables = random.randint(1, 7)
    clauses = [
        tuple(random.choice((1, -1)) * random.randint(1, variables) for _ in range(random.randint(1, 3)))
        for _ in range(random.randint(1, 5 * variables))
    ]
    solver = hints.PropositionalSolver()
    for clause in clauses:
        solver.add(clause)
    truths = solver.solve(NONE)
    assignments = [dict(enumerate(values, 1)) for values in product((False, True), repeat=variables)]

    def satisfied(values):
        return all(any(values[abs(literal)] == (literal > 0) for literal in clause) for clause in clauses)

    assert (truths is not None) == any(map(satisfied, assignments))
    if truths is not None:
        assert satisfied(truths)
        return
    for number, step in [*solver.derivations.items(), (len(solver.clauses), solver.refutation)]:
        assert all(hint < number for hint in step.hints)
        assert propagates_to_conflict(solver.clauses, step.clause, step.hints)


@pytest.mark.parametrize("seed", range(80))
def test_contradictions_agree_with_a_solver(seed):
    random, terms, sides = Random(seed), Terms(), []
    session = Session(terms)
    for _ in range(random.randint(1, 7)):
        factors = {name: random.randint(-2, 2) for name in random.sample("xyz", random.randint(1, 3))}
        factors = tuple(sorted(without_zeros(factors).items())) or (("x", 1),)
        side = hints.LinearSide(factors, random.randint(-3, 3), random.random() < 0.4)
        form = Polynomial({(name,): Fraction(factor) for name, factor in factors}) + side.constant
        session.add(terms.greater(form) if side.strict else terms.at_least(form))
        sides.append(side)
    answer = hints.contradiction(sides)
    assert isinstance(answer, hints.Conflict) == (session.check("sides") is Satisfiability.UNSATISFIABLE)
    if isinstance(answer, dict):
        assert all(side.holds(answer) for side in sides)
        return
    total = Counter()
    for index, multiple in answer.multiples.items():
        assert multiple > 0
        for name, factor in (*sides[index].factors, ("", sides[index].constant)):
            total[name] += multiple * factor
    constant = total.pop("")
    assert not any(total.values())
    assert constant < 0 or (constant == 0 and any(sides[index].strict for index in answer.multiples))


@pytest.mark.parametrize("seed", range(60))
def test_facts_that_matter_are_found(seed):
    """Multiples of many facts, of which few are looked at, leave something that is not negative of a form."""
    random = Random(seed)
    names = [f"x{index}" for index in range(5)]
    facts, total = [], {"": Fraction(1)}
    for _ in range(12):
        form = {name: Fraction(random.randint(-2, 2), random.randint(1, 2)) for name in random.sample(names, 2)}
        form[""] = Fraction(random.randint(0, 6))  # so that zero satisfies them all
        facts.append((without_zeros(form), False))
        total = plus(total, facts[-1][0], Fraction(random.randint(0, 2)))
    for number, factor in hints.implied(KnownFacts(facts), total, strictly=True):
        assert factor > 0
        total = plus(total, facts[number][0], -factor)
    assert total.keys() <= {""}
    assert total.get("", 0) >= 0
    with pytest.raises(hints.NotRefutedError):
        hints.implied(KnownFacts(facts), {"": Fraction(-1)})


def some_literal(circuit, random, depth):
    if depth == 0 or random.random() < 0.1:
        kind = random.randrange(4)
        if kind == 0:
            return circuit.compare({f"?{random.choice('pq')}": Fraction(1)}, True)
        form = {name: Fraction(random.randint(-2, 2)) for name in random.sample("xyz", 2)}
        form = without_zeros(form | {"": Fraction(random.randint(-4, 4), random.randint(1, 2))})
        return circuit.equal(form) if kind == 3 else circuit.compare(form, kind == 2)
    parts = [some_literal(circuit, random, depth - 1) for _ in range(random.randint(2, 3))]
    way = random.randrange(3)
    return -parts[0] if way == 2 else (circuit.all, circuit.any)[way](parts)


def term_of(terms, circuit, literal):
    """The literal for a solver."""
    if literal < 0:
        return terms.negation(term_of(terms, circuit, -literal))
    if circuit.is_gate(literal):
        return terms.conjunction([term_of(terms, circuit, part) for part in circuit.nodes[literal]])
    form, strict = circuit.said(literal)
    total = Polynomial({(name,): Fraction(value) for name, value in form.items() if name}) + form.get("", 0)
    return terms.greater(total) if strict else terms.at_least(total)


EMPTY = Ground(Model("(define (domain d))", "(define (problem x) (:domain d) (:init) (:goal (and)))"))
EMPTY.point(".zero")


def refuted(line, formulas, literal):
    proofs.refute(proofs.Tape([json.dumps(line)]), formulas, proofs.Facts([]), literal)


@pytest.mark.parametrize("seed", range(120))
def test_refutations_agree_with_a_solver_and_are_accepted(seed):
    random = Random(seed)
    formulas, terms, facts = Formulas(EMPTY, Fraction(0)), Terms(), KnownFacts([])
    literal = formulas.circuit.all([some_literal(formulas.circuit, random, random.randint(1, 4)) for _ in range(5)])
    session = Session(terms)
    session.add(term_of(terms, formulas.circuit, literal))
    if session.check("formulas") is Satisfiability.SATISFIABLE:
        assert hints.model(formulas, facts, literal, NONE) is not None
        with pytest.raises(hints.NotRefutedError):
            hints.refutation(formulas, facts, literal, NONE)
        return
    line = hints.refutation(formulas, facts, literal, NONE)
    refuted(line, formulas, literal)
    other = formulas.circuit.compare({"other": Fraction(1)})
    with pytest.raises((proofs.Rejected, *tools.MALFORMED)):
        refuted(line, formulas, other)


@pytest.mark.parametrize("steps", TABLES["what is no refutation"])
def test_what_is_no_refutation(steps):
    formulas = Formulas(EMPTY, Fraction(0))
    literal = formulas.circuit.all([formulas.circuit.compare({name: Fraction(1)}) for name in "xyz"])
    line = json.loads(json.dumps(["refute", *steps]).replace('"g"', str(literal)))
    with pytest.raises((proofs.Rejected, *tools.MALFORMED)):
        refuted(line, formulas, literal)
