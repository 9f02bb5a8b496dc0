"""Plans with choices for the bank: small and dense random ones, with a referee of executions, and networks that mean
nothing: `data/networks.json` has one of which one value of the choice leaves a correct execution, and changes of it.
"""

from __future__ import annotations

import json
from copy import deepcopy
from fractions import Fraction
from functools import partial
from pathlib import Path
from random import Random

from robust.certify.checker.formulas import TRUE
from robust.certify.hints import KnownFacts, model
from robust.certify.produce import execution, knowledge
from robust.certify.tape import header
from robust.errors import InputError, RobustError, UnsupportedError
from robust.pike_bridge.action_model import load_team_plan
from robust.pike_bridge.semantics import Execution, ExecutionExistence, Oracle, faults
from robust.smt.limits import Deadline
from tests.certify import tools
from tests.certify.texts import Grammar

TABLES = json.loads(Path(__file__).with_name("data").joinpath("networks.json").read_text(encoding="utf-8"))
DOCUMENT = TABLES["document"]
"""With x = b=c it has no correct execution."""
EXECUTION = [header("execution"), ["execution", [0], ["1", "3", "2", "0", "5"]]]
"""With x = a, of the small network."""
OUT_OF_NOTHING = [["robust/certificate/2", "knowledge", []], ["refute", [[], [0, [1, 0]]]]]
"""Refutes what is false by itself."""


def files(directory, document=DOCUMENT, domain=TABLES["domain"], problem=TABLES["problem"]):
    """The network with its domain and problem, written."""
    directory.mkdir(parents=True, exist_ok=True)
    text = document if isinstance(document, str) else json.dumps(document)
    for name, content in (("domain.pddl", domain), ("problem.pddl", problem), ("plan.tpnu.json", text)):
        (directory / name).write_text(content, encoding="utf-8")
    return directory / "plan.tpnu.json"


def certificates(path, witness, assumed):
    """Both kinds: of a correct execution, and that there is none with the assumed values."""
    assert witness is not None
    return [
        ("execution", execution(path, tools.EPSILON, witness.scenario, witness.schedule)),
        ("knowledge", knowledge(path, tools.EPSILON, Deadline.after(60), assumed)),
    ]


def stated(by, path, execution):
    document = by.choices.network_of(path.read_text(encoding="utf-8"))
    texts = [(path.parent / document[key]).read_text(encoding="utf-8") for key in ("domain", "problem")]
    return by.choices.Choices((document, *texts), tools.EPSILON, execution)


def agreements(path, seed):
    """The formula of all executions against the oracle, single executions against the referee."""
    plan = load_team_plan(path)
    decision = Oracle(plan).decide()
    exists = decision.verdict is ExecutionExistence.EXISTS
    yield f"oracle {path.parent.name}", partial(_decides, path=path, exists=exists)
    if decision.witness is not None:
        known = executions(plan, decision.witness, Random(seed))
        yield f"executions {path.parent.name}", partial(_referees, path=path, known=known)


def _decides(by, path, exists):
    """Whether the formula of all executions can be met, as the oracle says."""
    choices = stated(by, path, None)
    literal = choices.circuit.all(choices.parts)
    return (model(choices.formulas, KnownFacts([]), literal, Deadline.after(60)) is not None) == exists


def executions(plan, witness, random):
    """The witness and others like it, with whether they are correct."""
    known, step = [(witness, True)], Fraction(1, 1000)
    for _ in range(14):
        times = dict(witness.schedule)
        for event in random.sample(sorted(times), random.choice([1, 1, 2, 3])):
            other = random.choice(sorted(times))
            away = random.choice([-step, step, step / 2, 2 * step, Fraction(0)])
            times[event] = random.choice([times[event] + away, times[other] + away])
        moved = Execution(witness.scenario, times)
        known.append((moved, not faults(plan, moved)))
    return known


def _referees(by, path, known):
    """Whether single executions are correct, as the referee says."""
    free = stated(by, path, None)
    for one, correct in known:
        values = [values.index(one.scenario[name]) for name, values in free.domains.items()]
        times = [str(one.schedule[event]) if event in one.schedule else None for event in free.guards]
        if all(part == TRUE for part in stated(by, path, [values, times]).parts) != correct:
            return False
    return True


def random_network(seed, directory):
    """A few activities between a few events; it may mean nothing, or have no correct execution."""
    random = Random(seed)
    guard = random.choice([{}, {"x": "1"}])
    guards: dict[str, dict[str, str]] = {"e1": {}, "e2": {}, "e3": guard, "e4": guard}
    names = [f"a{number}" for number in range(random.choice([1, 2, 3, 3]))]
    activities = []
    for name in names:
        a, b = sorted(random.sample(sorted(guards), 2))
        more = random.choice([{}, {}, {"x": "1"}])
        span = {"action": f"({name})", "from": a, "to": b, "lower": 1, "upper": random.choice([None, 6])}
        activities.append({**span, "guard": {**guards[a], **guards[b], **more}, "agent": random.choice([None, "i"])})
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
    draw = Grammar(random).draw
    actions = " ".join(draw("network_action").replace("NAME", name) for name in names)
    domain = f"(define (domain d) (:predicates (p) (q) (r) (s) (n)) (:functions (f)) {actions})"
    problem = f"(define (problem m) (:domain d) (:init {draw('network_initial')}) (:goal (and {draw('network_goal')})))"
    return files(directory, document, domain, problem)


def random_networks(folder, first=0, count=150):
    """The checker, the oracle and the referee of executions agree."""
    for seed in range(first, first + count):
        path = random_network(seed, folder / f"network-{seed}")
        try:
            yield from agreements(path, seed)
        except RobustError:
            continue


def patched(changes):
    """The small network with other values at paths like `choices/0/at`; `~` is none at all."""
    document = deepcopy(DOCUMENT)
    for path, value in changes.items():
        *way, last = [int(word) if word.isdigit() else word for word in path.split("/")]
        inner = document
        for step in way:
            inner = inner[step]
        if value == "~":
            del inner[last]
        elif last == (len(inner) if isinstance(inner, list) else None):
            inner.append(value)
        else:
            inner[last] = value
    return document


def wrong_documents():
    """Networks with something left out, added, repeated, of another type, or about what is not there."""
    yield from (("list", "[]"), ("null", "null"))
    text = json.dumps(DOCUMENT)
    yield "key twice", text.replace('"name": "small"', '"name": "small", "name": "other"')
    yield "guard twice", text.replace('{"x": "b=c"}', '{"x": "a", "x": "b=c"}')
    changes = [*TABLES["refused"], *TABLES["unknown"], *TABLES["others"]]
    yield from ((str(change), patched(change)) for change in changes)


def small(directory):
    """Name, network, certificates, and epsilon; few of them are established."""
    execution, both = EXECUTION[1], [EXECUTION, OUT_OF_NOTHING]
    path = files(directory / "honest")
    yield "honest", path, both, "1/1000"
    yield "epsilon 0", path, both, "0"
    wrong = [
        [["robust/certificate/2", "execution", claimed], execution] for claimed in ([], [["x", "a"]], {}, "", False)
    ]
    wrong += [[*EXECUTION, more] for more in (execution, [], None)]
    wrong += [[header("execution"), ["execution", *parts]] for parts in TABLES["executions"]]
    yield "executions", path, wrong, "1/1000"
    for number, (name, changed) in enumerate(wrong_documents()):
        yield name, files(directory / f"document {number}", changed), both, "1/1000"
    for number, changes in enumerate(TABLES["models"]):
        texts = [TABLES["domain"], TABLES["problem"]]
        for old, new in changes.items():
            texts = [text.replace(old, new) for text in texts]
        yield str(changes), files(directory / f"model {number}", DOCUMENT, *texts), both, "1/1000"


def is_true(path, lines):
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
    events = [*(event["name"] for event in document["events"]), "e_initial", "e_goal"]
    schedule = {event: Fraction(time) for event, time in zip(events, times, strict=True) if time is not None}
    return not faults(plan, Execution(scenario, schedule))
