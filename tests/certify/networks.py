"""Plans with choices for the bank: random ones, with a referee of executions, and networks that mean nothing.

The random ones are small and dense, so that conditions of all times, literals of both signs, effects at both ends,
shared events and choices meet each other.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from random import Random
from typing import Any

from robust.certify.checker.formulas import TRUE
from robust.certify.hints import KnownFacts, Line, model
from robust.certify.tape import header
from robust.errors import InputError, UnsupportedError
from robust.pike_bridge.action_model import load_team_plan
from robust.pike_bridge.semantics import Execution, ExecutionExistence, Oracle, faults
from robust.smt.limits import Deadline
from tests.certify import tools
from tests.certify.tools import Checker

Document = dict[str, Any]

# -- what the checker makes of a network -------------------------------------------------------------------------------


def stated(by: Checker, path: Path, found: list[Any] | None) -> Any:
    document = by.choices.network_of(path.read_text(encoding="utf-8"))
    texts = [(path.parent / document[each]).read_text(encoding="utf-8") for each in ("domain", "problem")]
    return by.choices.Choices((document, *texts), tools.EPSILON, found)


def decides(by: Checker, path: Path, exists: bool) -> bool:
    """Whether the formula of all executions can be met, as the oracle says."""
    made = stated(by, path, None)
    found = model(made.formulas, KnownFacts([]), made.circuit.all(made.parts), Deadline.after(60))
    return (found is not None) == exists


def executions(plan: Any, witness: Execution, random: Random) -> list[tuple[Execution, bool]]:
    """The witness and others like it, with whether they are correct."""
    found = [(witness, True)]
    step = Fraction(1, 1000)
    for _ in range(14):
        times = dict(witness.schedule)
        for event in random.sample(sorted(times), random.choice([1, 1, 2, 3])):
            other = random.choice(sorted(times))
            away = random.choice([-step, step, step / 2, 2 * step, Fraction(0)])
            times[event] = random.choice([times[event] + away, times[other] + away])
        one = Execution(witness.scenario, times)
        found.append((one, not faults(plan, one)))
    return found


def referees(by: Checker, path: Path, known: list[tuple[Execution, bool]]) -> bool:
    """Whether single executions are correct, as the referee says."""
    free = stated(by, path, None)
    for one, correct in known:
        values = [values.index(one.scenario[name]) for name, values in free.domains.items()]
        times = [str(one.schedule[event]) if event in one.schedule else None for event in free.guards]
        made = stated(by, path, [values, times])
        if all(part == TRUE for part in made.parts) != correct:
            return False
    return True


# -- random networks ---------------------------------------------------------------------------------------------------

ATOMS = ("(p)", "(q)", "(r)")
TIMES = ("at start", "at end", "over all")


def literal(random: Random) -> str:
    atom = random.choice(ATOMS)
    return random.choice([atom, f"(not {atom})"])


def action(random: Random, name: str) -> str:
    """An action with conditions of all times, some of what never changes, and effects at both ends."""
    conditions = [f"({when} {literal(random)})" for when in TIMES for _ in range(random.choice([0, 0, 1, 2]))]
    settled = ["(s)", "(not (n))", "(or (n) (s))", "(>= (f) 4)", "(and (s) (not (n)))"]
    conditions += [f"({random.choice(TIMES)} {each})" for each in random.sample(settled, random.choice([0, 1, 2]))]
    if random.random() < 0.1:
        conditions.append(f"(at end {random.choice(['(n)', '(>= (f) 6)', '(or (n) (not (s)))', '(not (s))'])})")
    random.shuffle(conditions)
    effects = []
    for when in TIMES[:2]:
        for _ in range(random.choice([0, 1, 1, 2])):
            effect = f"({when} {literal(random)})"
            only = random.choice(["(s)", "(n)", "(>= (f) 5)", "(and)"])
            effects.append(effect if random.random() < 0.7 else f"(when ({when} {only}) {effect})")
    duration = random.choice(["(>= ?duration 2)", "(and (>= ?duration 1) (<= ?duration (f)))", "(= ?duration (f))"])
    return (
        f"(:durative-action {name} :parameters () :duration {duration} "
        f":condition (and {' '.join(conditions)}) :effect (and {' '.join(effects)}))"
    )


def random_network(seed: int, directory: Path) -> Path:
    """A few activities between a few events; it may mean nothing, or have no correct execution."""
    random = Random(seed)
    guard = random.choice([{}, {"x": "1"}])
    guards: dict[str, dict[str, str]] = {"e1": {}, "e2": {}, "e3": guard, "e4": guard}
    names = [f"a{number}" for number in range(random.choice([1, 2, 3, 3]))]
    activities = []
    for name in names:
        a, b = sorted(random.sample(sorted(guards), 2))
        more = random.choice([{}, {}, {"x": "1"}])
        document = {"action": f"({name})", "from": a, "to": b, "lower": 1, "upper": random.choice([None, 6])}
        activities.append(
            {**document, "guard": {**guards[a], **guards[b], **more}, "agent": random.choice([None, "i"])}
        )
    ends = [("e1", "e2"), ("e1", "e3"), ("e1", "e4"), *random.sample([("e2", "e3"), ("e3", "e4"), ("e2", "e4")], 1)]
    constraints = [
        {"from": a, "to": b, "lower": random.choice([0, 0, "1/2", 1]), "upper": random.choice([None, None, 3, "7.5"]),
         "guard": {**guards[a], **guards[b]}}
        for a, b in ends
    ]  # fmt: skip
    document = {
        "format": "tpnu/1", "name": f"random {seed}", "domain": "domain.pddl", "problem": "problem.pddl",
        "choices": [{"name": "x", "domain": ["1", "2"], "controllable": seed % 2 == 1, "at": "e1"}],
        "events": [{"name": name, "guard": guard} for name, guard in guards.items()],
        "constraints": constraints, "activities": activities,
    }  # fmt: skip
    initial = " ".join([*random.sample(ATOMS, random.choice([0, 1, 2, 3])), "(s)", "(= (f) 5)"])
    goal = " ".join([*(literal(random) for _ in range(random.choice([0, 1, 1]))), "(or (s) (n))"])
    actions = " ".join(action(random, name) for name in names)
    domain = f"(define (domain d) (:predicates (p) (q) (r) (s) (n)) (:functions (f)) {actions})"
    problem = f"(define (problem m) (:domain d) (:init {initial}) (:goal (and {goal})))"
    return files(directory, document, domain, problem)


def files(directory: Path, document: Document | str, domain: str, problem: str) -> Path:
    directory.mkdir(parents=True, exist_ok=True)
    text = document if isinstance(document, str) else json.dumps(document)
    for name, content in (("domain.pddl", domain), ("problem.pddl", problem), ("plan.tpnu.json", text)):
        (directory / name).write_text(content, encoding="utf-8")
    return directory / "plan.tpnu.json"


# -- networks that mean nothing ----------------------------------------------------------------------------------------

DOMAIN = """(define (domain d) (:predicates (p) (q) (r) (s) (n)) (:functions (f) (g))
(:durative-action go :parameters (?o) :duration (and (>= ?duration 1) (<= ?duration 3))
 :condition (and (at start (p)) (over all (q)) (at end (not (r))))
 :effect (and (at start (q)) (at end (r)))))"""
PROBLEM = "(define (problem m) (:domain d) (:objects o) (:init (p) (s) (= (f) 5) (= (g) 0)) (:goal (and (q) (r))))"
EXECUTION: list[Line] = [header("execution"), ["execution", [0], ["1", "3", "2", "0", "5"]]]
"""With x = a, of `document()`."""
OUT_OF_NOTHING: list[Line] = [["robust/certificate/2", "knowledge", []], ["refute", [[], [0, [1, 0]]]]]
"""Refutes what is false by itself."""


def document() -> Document:
    """With x = b=c it has no correct execution."""
    return {
        "format": "tpnu/1", "name": "small", "domain": "domain.pddl", "problem": "problem.pddl", "parameters": [],
        "choices": [{"name": "x", "domain": ["a", "b=c"], "controllable": True, "at": "e1"}],
        "events": [{"name": "e1"}, {"name": "e2"}, {"name": "e3", "guard": {"x": "a"}}],
        "constraints": [
            {"from": "e1", "to": "e3", "lower": "0.5", "upper": None, "guard": {"x": "a"}},
            {"from": "e1", "to": "e2", "lower": None, "upper": 0, "guard": {"x": "b=c"}},
        ],
        "activities": [{"action": "(go o)", "from": "e1", "to": "e2", "lower": 1, "upper": 4, "agent": "robot"}],
    }  # fmt: skip


def wrong_documents() -> Iterator[tuple[str, Document | str]]:
    """Networks with something left out, added, repeated, of another type, or about what is not there."""
    honest = document()
    yield "list", "[]"
    yield "null", "null"
    yield "key twice", json.dumps(honest).replace('"name": "small"', '"name": "small", "name": "other"')
    yield "guard twice", json.dumps(honest).replace('{"x": "b=c"}', '{"x": "a", "x": "b=c"}')
    for key in ("format", "domain", "problem"):
        yield f"without {key}", {each: value for each, value in honest.items() if each != key}
        yield f"{key} of another type", {**honest, key: True}
    yield "without files", {**honest, "domain": None, "problem": None}
    yield "files of a type", {**honest, "domain": True, "problem": True}
    yield "other format", {**honest, "format": "tpnu/2"}
    yield "more", {**honest, "more": []}
    for kind in ("choices", "events", "constraints", "activities"):
        for new in (None, "text", {}, True):
            yield f"{kind} {new}", {**honest, kind: new}
            yield f"one of {kind} {new}", {**honest, kind: [new, *honest[kind]]}
        yield f"{kind} twice", {**honest, kind: [*honest[kind], honest[kind][0]]}
        for index, each in enumerate(honest[kind]):
            for changed in members_changed(each):
                yield f"{kind} {changed}", {**honest, kind: put(honest[kind], index, changed)}
    for end in ("e_initial", "e_goal"):
        guarded = [*honest["events"], {"name": end, "guard": {"x": "a"}}]
        yield f"guard of {end}", {**honest, "events": guarded}
    for values in ([], ["a", "a", "b=c"], ["a", ["b"]]):
        yield f"domain {values}", {**honest, "choices": [{**honest["choices"][0], "domain": values}]}
        yield (
            f"another {values}",
            {**honest, "choices": [*honest["choices"], {**honest["choices"][0], "name": "y", "domain": values}]},
        )
    span = {"from": "e1", "to": "e3", "lower": 0, "upper": None}
    for a, b in (("e1", "e3"), ("e3", "e1"), ("e3", "e3")):
        for guard in ({}, {"x": "b=c"}):
            constraint = {**span, "from": a, "to": b, "guard": guard}
            yield f"unguarded {a} {b} {guard}", {**honest, "constraints": [*honest["constraints"], constraint]}
            work = {**honest["activities"][0], "from": a, "to": b, "guard": guard}
            yield f"unguarded activity {a} {b} {guard}", {**honest, "activities": [*honest["activities"], work]}


def put(values: list[Any], index: int, new: Any) -> list[Any]:
    return [*values[:index], new, *values[index + 1 :]]


def members_changed(one: Document) -> Iterator[Document]:
    """Without one of its members, or with another value; not what the checker reads and this package does not."""
    yield {**one, "more": "text"}
    for key in one:
        yield {each: value for each, value in one.items() if each != key}
        for new in (None, True, [], {}, "nowhere", float("nan"), float("inf"), {"x": "d"}, {"y": "a"}, {"x": ["a"]}, 7):
            generous = {"lower": [7, *([] if "action" in one else [None])]}
            if new not in generous.get(key, ()):
                yield {**one, key: new}


def wrong_models() -> Iterator[tuple[str, str, str]]:
    """Domains and problems with what certificates of plans with choices are not about, or hardly."""
    condition, effect = "(at start (p))", "(at start (q))"
    for new in (
        "(at start (or (p) (r)))", "(over all (not (and (p) (r))))", "(at start (not (not (p))))",
        "(at start (imply (r) (p)))", "(at start (= (g) 0))",
    ):  # fmt: skip
        domain = DOMAIN.replace(condition, f"{condition} {new}")
        yield new, domain.replace(effect, f"{effect} (at end (increase (g) 1))") if "(g)" in new else domain, PROBLEM
    for new in (
        "(at end (increase (f) 1))", "(at end (assign (f) 1))", "(increase (f) (* #t 1))",
        "(when (at start (r)) (at start (q)))", "(when (at start (not (r))) (at start (q)))",
        "(when (at start (>= ?duration 1)) (at start (q)))", "(when (at end (>= ?duration 2)) (at end (not (q))))",
    ):  # fmt: skip
        yield new, DOMAIN.replace(effect, f"{effect} {new}"), PROBLEM
        yield f"only {new}", DOMAIN.replace(effect, new), PROBLEM
    for both in ("(at end (r)) (at end (not (r)))", "(at end (not (r))) (at end (r))"):
        yield "an add wins", DOMAIN.replace("(at end (r))", both), PROBLEM
    yield "parameter", DOMAIN.replace("(?o)", "(?o) :synth-parameters (?v)"), PROBLEM
    yield "parameter of all", DOMAIN.replace("(:functions", "(:synth-parameters ?v) (:functions"), PROBLEM
    yield "goal", DOMAIN, PROBLEM.replace("(and (q) (r))", "(or (q) (r))")
    yield "timed", DOMAIN, PROBLEM.replace("(s)", "(s) (at 3 (n))")


def small(directory: Path) -> Iterator[tuple[str, Path, list[list[Line]], str]]:
    """Name, network, certificates, and epsilon; few of them are established."""
    honest, execution = document(), EXECUTION[1]
    path = files(directory / "honest", honest, DOMAIN, PROBLEM)
    yield "honest", path, [EXECUTION, OUT_OF_NOTHING], "1/1000"
    yield "epsilon 0", path, [EXECUTION, OUT_OF_NOTHING], "0"
    wrong: list[list[Line]] = [
        [["robust/certificate/2", "execution", stated], execution] for stated in ([], [["x", "a"]], {}, "", False)
    ]
    wrong += [[*EXECUTION, more] for more in (execution, [], None)]
    wrong += [[header("execution"), ["execution", *each]] for each in wrong_executions()]
    yield "executions", path, wrong, "1/1000"
    for number, (name, changed) in enumerate(wrong_documents()):
        there = files(directory / f"document {number}", changed, DOMAIN, PROBLEM)
        yield name, there, [EXECUTION, OUT_OF_NOTHING], "1/1000"
    for number, (name, domain, problem) in enumerate(wrong_models()):
        there = files(directory / f"model {number}", honest, domain, problem)
        yield name, there, [EXECUTION, OUT_OF_NOTHING], "1/1000"


def wrong_executions() -> Iterator[list[Any]]:
    _, values, times = EXECUTION[1]
    for index in range(len(times)):
        for new in (None, "7", "-1", 1, "1/0", "2/4"):
            yield [values, put(times, index, new)]
    for others in ([], [1], [-1], [-2], [2], [True], [False], ["a"], [0, 0]):
        yield [others, times]
    yield [[1], ["1", "3", None, "0", "5"]]
    yield [[1], ["1", "1", None, "0", "5"]]
    yield [values, times[:-1]]
    yield [values, [*times, "6"]]
    yield [values]
    yield [values, times, []]
    yield ["", times]


def is_true(path: Path, lines: list[Line]) -> bool:
    """Whether a certificate that has been established is true, as far as this package understands the files."""
    try:
        plan = load_team_plan(path)
    except UnsupportedError:
        return True
    except InputError:
        return False
    if lines[0][1] == "knowledge":
        return Oracle(plan).decide().verdict is ExecutionExistence.NONE
    _, numbers, times = lines[1]
    document = json.loads(path.read_text(encoding="utf-8"))
    scenario = {each["name"]: each["domain"][number] for each, number in zip(document["choices"], numbers, strict=True)}
    events = [*(each["name"] for each in document["events"]), "e_initial", "e_goal"]
    schedule = {event: Fraction(time) for event, time in zip(events, times, strict=True) if time is not None}
    return not faults(plan, Execution(scenario, schedule))
