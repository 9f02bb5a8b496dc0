"""Behavior trees of PlanSys2: verdicts about trees by hand and mutants, and executions of trees that were written.

The interpreter here ticks trees and shares no code with the reader.
"""

import json
import random
import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

import robust
from robust.errors import InputError, RefutedError, UnsupportedError
from robust.execute.tree_writer import make_tree
from robust.execute.trees import distances_within, parse_tree
from robust.plan.model import ZERO, TemporalConstraint
from robust.plan.polynomial import Polynomial
from robust.plan.simulate import simulate
from tests.cli.running import answer_of, command

EPSILON = Fraction(1, 1000)
SHARED = Path(__file__).parents[3] / "shared"
WORKSHOP = Path(robust.__file__).parent / "examples" / "workshop"

# -- an interpreter ----------------------------------------------------------------------------------------------------


def parsed(text):
    return ET.fromstring(text)  # noqa: S314 - our own texts


class Interpreter:
    """Ticks a tree: starts come at once or are held back, and actions last as they are told to.

    `hold` says until when the start of an action is held back, or `late` how long once it could start; `durations` how
    long actions last; all by their names.
    In a sequence each thing happens ε after what came before it; children of Parallel may do things at one time.
    """

    def __init__(self, text, durations, hold=(), late=()):
        self.root = next(parsed(text).iter("BehaviorTree"))[0]
        self.durations, self.hold, self.late = durations, dict(hold), dict(late)
        self.starts, self.ends, self.done, self.memory = {}, {}, set(), {}

    def run(self):
        """The starts and ends of all actions; None for an execution that fails or never ends."""
        time = Fraction(0)
        for _ in range(10000):
            before = len(self.memory), len(self.done)
            status, _ = self.tick(self.root, time)
            if status == "running" and before != (len(self.memory), len(self.done)):
                continue  # what was done may let something else go on
            if status != "running":
                return (self.starts, self.ends) if status == "success" else None
            later = [end + EPSILON for end in self.ends.values()] + list(self.hold.values())
            later = [moment for moment in later if moment > time]
            if not later:
                return None
            time = min(later)
        return None

    def tick(self, node, time):
        """Status, and the time after what was done."""
        if self.memory.get((node, "status")) == "success":
            return "success", max(time, self.memory[node, "time"])
        status, after = self.visit(node, time)
        if status == "success" and not node.tag.startswith(("Check", "Wait")):
            self.memory[node, "status"], self.memory[node, "time"] = status, after
        return status, after

    def visit(self, node, time):  # noqa: PLR0911, PLR0912 - one case for each kind of node
        action = node.get("action")
        match node.tag:
            case "Sequence" | "SequenceStar" | "ReactiveSequence":
                for child in node:
                    status, time = self.tick(child, time)
                    if status != "success":
                        return status, time
                return "success", time
            case "Parallel":
                results = [self.tick(child, time) for child in node]
                if any(status == "failure" for status, _ in results):
                    return "failure", time
                succeeded = [after for status, after in results if status == "success"]
                if len(succeeded) >= int(node.get("success_threshold")):
                    return "success", max(succeeded)
                return "running", time
            case "WaitAction":
                over = action in self.done and self.ends[action] + EPSILON <= time
                return ("success" if over else "running"), time
            case "CheckAction":
                over = action in self.done and self.ends[action] + EPSILON <= time
                return ("success" if over else "failure"), time
            case "WaitAtStartReq":
                if action in self.late:
                    self.hold.setdefault(action, time + self.late[action])
                return ("success" if self.hold.get(action, 0) <= time else "running"), time
            case "ApplyAtStartEffect":
                self.starts[action] = time
                return "success", time + EPSILON
            case "ExecuteAction":
                start = self.starts.setdefault(action, time)
                end = self.ends.setdefault(action, start + self.durations[action])
                return ("success", max(time, end + EPSILON)) if end + EPSILON <= time else ("running", time)
            case "ApplyAtEndEffect":
                self.done.add(action)
                return "success", max(time, self.ends[action] + EPSILON)
        return "success", time


def schedule_of(plan, tree, starts, ends):
    schedule = {}
    for instance in plan.instances:
        name = tree.steps[instance.identifier]
        schedule |= {instance.end: ends[name], instance.start: starts[name]}
    return schedule


def violations(plan, schedule, parameters=None):
    free = replace(plan, constraints=())
    return simulate(free, plan.nominal if parameters is None else parameters, schedule, epsilon=EPSILON).violations


def durations_of(plan, tree, schedule):
    return {
        tree.steps[instance.identifier]: schedule[instance.end] - schedule[instance.start]
        for instance in plan.instances
    }


# -- a plan, and trees of it by hand -----------------------------------------------------------------------------------

DOMAIN = """(define (domain photos)
 (:requirements :durative-actions :typing)
 (:types robot place)
 (:predicates (at ?r - robot ?p - place) (have ?p - place) (ready) (sent))
 (:durative-action drive :parameters (?r - robot ?a ?b - place) :duration (= ?duration 10)
  :condition (at start (at ?r ?a)) :effect (and (at start (not (at ?r ?a))) (at end (at ?r ?b))))
 (:durative-action photo :parameters (?r - robot ?p - place) :duration (= ?duration 4)
  :condition (over all (at ?r ?p)) :effect (at end (have ?p)))
 (:durative-action merge :parameters (?a ?b - place) :duration (= ?duration 2)
  :condition (and (at start (have ?a)) (at start (have ?b))) :effect (at end (ready)))
 (:durative-action send :parameters () :duration (= ?duration 1)
  :condition (at start (ready)) :effect (at end (sent))))"""
PROBLEM = """(define (problem p) (:domain photos) (:objects r1 r2 - robot base a b - place)
 (:init (at r1 base) (at r2 base)) (:goal (and (sent) (at r1 base))))"""
PLAN = """0.000: (drive r1 base a) [10]
0.000: (drive r2 base b) [10]
10.001: (photo r1 a) [4]
10.001: (photo r2 b) [4]
14.002: (merge a b) [2]
14.002: (drive r1 a base) [10]
16.003: (send) [1]
"""
NAMES = {
    "to_a": "(drive r1 base a):0",
    "to_b": "(drive r2 base b):0",
    "at_a": "(photo r1 a):10001",
    "at_b": "(photo r2 b):10001",
    "merge": "(merge a b):14002",
    "back": "(drive r1 a base):14002",
    "send": "(send):16003",
}


def wait(name, node="WaitAction"):
    return f'<{node} action="{NAMES[name]}"/>'


def start(name):
    return f"{wait(name, 'WaitAtStartReq')}{wait(name, 'ApplyAtStartEffect')}"


def end(name, check=""):
    execution = f"<ReactiveSequence>{wait(name, 'CheckOverAllReq')}{wait(name, 'ExecuteAction')}</ReactiveSequence>"
    return f"{execution}{check}{wait(name, 'CheckAtEndReq')}{wait(name, 'ApplyAtEndEffect')}"


def step(name):
    return f"<Sequence>{start(name)}{end(name)}</Sequence>"


def seq(*nodes):
    return f"<Sequence>{''.join(step(node) if node in NAMES else node for node in nodes)}</Sequence>"


def par(*nodes, threshold=None):
    inner = "".join(step(node) if node in NAMES else node for node in nodes)
    return f'<Parallel success_threshold="{threshold or len(nodes)}" failure_threshold="1">{inner}</Parallel>'


def tree(inner):
    return f'<root main_tree_to_execute="MainTree">\n<BehaviorTree ID="MainTree">\n{inner}\n</BehaviorTree>\n</root>\n'


W = {name: wait(name) for name in NAMES}
CORRECT = {
    "one after another": seq("to_a", "to_b", "at_a", "at_b", "merge", "back", "send"),
    "another order": seq("to_b", "at_b", "to_a", "at_a", "back", "merge", "send"),
    "robots in parallel": seq(par(seq("to_a", "at_a"), seq("to_b", "at_b")), par("back", seq("merge", "send"))),
    "waits only": par(
        "to_a", "to_b", seq(W["to_a"], "at_a"), seq(W["to_b"], "at_b"), seq(W["at_a"], "back"),
        seq(W["at_a"], W["at_b"], "merge"), seq(W["merge"], "send"),
    ),
    "layers": seq(par("to_a", "to_b"), par("at_a", "at_b"), par("merge", "back"), "send"),
    "a chain for each robot": par(seq("to_a", "at_a", "back"), seq("to_b", "at_b", W["at_a"], "merge", "send")),
    "merging in the other chain": par(seq("to_a", "at_a", W["at_b"], "merge", "send", "back"), seq("to_b", "at_b")),
    "as the simple builder": par(
        seq("to_a", seq("at_a", par(seq(W["at_b"], "merge", "send"), "back"))), seq("to_b", seq("at_b"))
    ),
    "waiting twice": seq(par("to_a", "to_b"), W["to_a"], W["to_b"], par("at_a", "at_b"), par("merge", "back"), "send"),
    "waiting before all": par(seq(W["to_b"], "to_a", "at_a", "back"), seq("to_b", "at_b", W["back"], "merge", "send")),
    "in nested sequences": seq(seq(seq("to_a", "at_a"), seq("to_b", "at_b")), seq(seq("merge"), seq("send")), "back"),
    "parallels in parallels": seq(par(par(seq("to_a", "at_a"), seq("to_b", "at_b"))), par("merge", "back"), "send"),
    "a drive within another": par(
        seq(start("to_a"), par(seq(end("to_a"), "at_a", "back"), seq("to_b", "at_b"))),
        seq(W["at_a"], W["at_b"], "merge", "send"),
    ),
    "a last check": par(
        seq("to_a", "at_a", "back"), seq("to_b", "at_b", W["at_a"], "merge", "send", wait("at_a", "CheckAction"))
    ),
    "without effects": re.sub("<(Apply|Check|WaitAt)[^>]*>", "", seq(*NAMES)),
}  # fmt: skip
WRONG = {
    "a photo before the drive": seq("at_a", "to_a", "to_b", "at_b", "merge", "back", "send"),
    "a photo during the drive": seq(par("to_a", "at_a"), "to_b", "at_b", "merge", "back", "send"),
    "leaving during the photo": par(
        seq("to_a", par("at_a", "back")), seq("to_b", "at_b", W["at_a"], "merge", "send")
    ),
    "merging without waiting": par(seq("to_a", "at_a", "back"), seq("to_b", "at_b", "merge", "send")),
    "waiting for the wrong photo": par(seq("to_a", "at_a", "back"), seq("to_b", "at_b", W["at_b"], "merge", "send")),
    "waiting for the drive only": par(seq("to_a", "at_a", "back"), seq("to_b", "at_b", W["to_a"], "merge", "send")),
    "sending before merging": seq(par(seq("to_a", "at_a"), seq("to_b", "at_b")), "send", par("merge", "back")),
    "sending beside merging": seq(par(seq("to_a", "at_a"), seq("to_b", "at_b")), par("send", "merge", "back")),
    "all at once": par("to_a", "to_b", "at_a", "at_b", "merge", "back", "send"),
    "missing": seq(par(seq("to_a", "at_a"), seq("to_b", "at_b")), "merge", "send"),
    "twice": seq(par(seq("to_a", "at_a"), seq("to_b", "at_b")), par("merge", "back"), "send", "send"),
    "in a circle": par(seq(W["at_b"], "to_a", "at_a", "back"), seq(W["at_a"], "to_b", "at_b", "merge", "send")),
    "halted": seq(par(seq("to_a", "at_a"), seq("to_b", "at_b"), threshold=1), par("merge", "back"), "send"),
    "backwards": seq("send", "back", "merge", "at_b", "at_a", "to_b", "to_a"),
    "waits for nothing": par(
        seq(W["back"], "to_a", "at_a", "back"), seq("to_b", "at_b", W["at_a"], "merge", "send")
    ),
}  # fmt: skip
FAULTS = {
    "missing": "(drive r1 a base) is not executed, but is 1 step of the plan (n5)",
    "twice": "<tree>:3: ApplyAtStartEffect of (send):16003 a second time (first in line 3)",
    "in a circle": "<tree>:3: for ever wait for each other: ",
    "halted": "<tree>:3: Parallel succeeds when 1 of 2 children have: the others are halted",
    "waits for nothing": "<tree>:3: for ever wait for each other: ",
}


@pytest.fixture(scope="module")
def photos(tmp_path_factory):
    folder = tmp_path_factory.mktemp("photos")
    for name, text in (("domain.pddl", DOMAIN), ("problem.pddl", PROBLEM), ("plan.plan", PLAN)):
        (folder / name).write_text(text, encoding="utf-8")
    return robust.load_plan(*(folder / name for name in ("domain.pddl", "problem.pddl", "plan.plan")))


def checked(plan, text, folder, **options):
    file = folder / "tree.xml"
    file.write_text(text, encoding="utf-8")
    return robust.check(plan, tree=file, **options)


def confirm(plan, text, result):
    """Let the interpreter execute a proved tree; and follow a counterexample, which then breaks what it says."""
    read = parse_tree(text, plan)
    if result.answer.value == "proved":
        draw = random.Random(1)  # noqa: S311
        for _ in range(5):
            names = read.steps.values()
            hold = {name: Fraction(draw.choice((0, 0, 5, 10, 14, draw.randrange(40000) / 1000))) for name in names}
            lasting = durations_of(plan, read, earliest(plan))
            if "Apply" in text:
                assert not violations(plan, schedule_of(plan, read, *Interpreter(text, lasting, hold).run()))
    elif result.counterexamples:
        example = next(iter(result.counterexamples.values()))
        hold = {name: example.schedule[plan.instance[identifier].start] for identifier, name in read.steps.items()}
        lasting = durations_of(plan, read, example.schedule)
        followed = schedule_of(plan, read, *Interpreter(text, lasting, hold).run())
        assert followed == {point: example.schedule[point] for point in followed}
        assert example.obligation in {violation.obligation for violation in violations(plan, followed)}


def earliest(plan):
    return distances_within(plan, {name: (value, value) for name, value in plan.nominal.items()}).times


@pytest.mark.parametrize("name", CORRECT)
def test_correct_trees_are_proved(photos, tmp_path, name):
    result = checked(photos, tree(CORRECT[name]), tmp_path)
    assert result.answer.value == "proved"
    confirm(photos, tree(CORRECT[name]), result)


@pytest.mark.parametrize("name", WRONG)
def test_wrong_trees_are_refuted_by_an_execution_or_a_fault(photos, tmp_path, name):
    result = checked(photos, tree(WRONG[name]), tmp_path)
    assert result.answer.value == "refuted"
    if name in FAULTS:
        assert FAULTS[name].replace("<tree>", str(tmp_path / "tree.xml")) in result.reason
        ends = Interpreter(tree(WRONG[name]), dict.fromkeys(NAMES.values(), Fraction(1))).run()
        assert (ends is None) == (name in {"in a circle", "waits for nothing"})
    else:
        assert result.counterexamples
        confirm(photos, tree(WRONG[name]), result)


# -- mutants -----------------------------------------------------------------------------------------------------------


def mutants(text):
    """Trees with one wait less, with two neighbours swapped, or with a sequence made parallel."""
    count = len(list(parsed(text).iter()))
    for number in range(count):
        for change in ("drop", "swap", "parallel"):
            root = parsed(text)
            parents = {child: parent for parent in root.iter() for child in parent}
            node = list(root.iter())[number]
            if change == "drop" and node.tag == "WaitAction":
                parents[node].remove(node)
            elif change == "swap" and node.tag in ("WaitAction", "Sequence") and node in parents:
                siblings, at = parents[node], list(parents[node]).index(node)
                if siblings.tag != "Sequence" or at + 1 == len(siblings) or siblings[at + 1].tag != "Sequence":
                    continue
                siblings.remove(node)
                siblings.insert(at + 1, node)
            elif change == "parallel" and node.tag == "Sequence" and {child.tag for child in node} == {"Sequence"}:
                node.tag = "Parallel"
                node.attrib = {"success_threshold": str(len(node)), "failure_threshold": "1"}
            else:
                continue
            yield ET.tostring(root, encoding="unicode")


@pytest.mark.parametrize(
    "name", ["waits only", "a chain for each robot", "as the simple builder", "waiting before all"]
)
def test_verdicts_about_mutants_are_those_of_the_interpreter(photos, tmp_path, name):
    refuted = 0
    for text in mutants(tree(CORRECT[name])):
        result = checked(photos, text, tmp_path)
        refuted += result.answer.value == "refuted"
        confirm(photos, text, result)
        if result.answer.value == "refuted" and result.reason is not None:
            durations = durations_of(photos, parse_tree(tree(CORRECT[name]), photos), earliest(photos))
            assert "wait for each other" in result.reason
            assert Interpreter(text, durations).run() is None
    assert refuted >= 3


# -- trees that are written --------------------------------------------------------------------------------------------

LATE = Fraction(1, 100)
"""How late nodes begin where any delay would be too much."""
WITHIN = "turn-and-open", "rovers-2006-7", "drones"
"""Plans with actions that have to begin while others go on, or with windows of time: no tree keeps them at any pace."""


def shared_plans():
    for folder in ("pstn-plans", "planner-logs"):
        listed = SHARED / folder / "plans.json"
        for entry in json.loads(listed.read_text(encoding="utf-8")) if listed.exists() else ():
            yield entry["name"], tuple(SHARED / folder / entry[key] for key in ("domain", "problem", "log"))


FEW = {"rovers-2", "crew-2", "drones-13", "map-analyzer-2014-1"}
SHARED_PLANS = [
    pytest.param(name, files, 3 if name in FEW else 200, marks=() if name in FEW else pytest.mark.slow, id=name)
    for name, files in shared_plans()
] + [
    pytest.param(f"{name} often", files, 200, marks=pytest.mark.slow, id=f"{name} often")
    for name, files in shared_plans()
    if name in FEW
]


@pytest.mark.parametrize(("name", "files", "runs"), SHARED_PLANS)
def test_random_executions_of_written_trees_are_valid(name, files, runs, tmp_path):
    try:
        plan = robust.load_plan(*files, parameters=["duration:*"])
    except RefutedError:
        pytest.skip("the plan is invalid as it stands")
    lag = LATE if name.startswith(WITHIN) else None
    if lag is not None and len(plan.instances) < 100:
        with pytest.raises(RefutedError, match="found no tree that keeps the plan valid whenever nodes begin"):
            make_tree(plan)
    made = make_tree(plan, lag=lag)
    for share in (Fraction(1, 5), Fraction(1, 100), Fraction(0)):
        wide = {p.name: (p.nominal * (1 - share), p.nominal * (1 + share)) for p in plan.parameters}
        if checked(plan, made.text, tmp_path, at=wide, lag=lag).answer.value == "proved":
            break
    draw = random.Random(name)  # noqa: S311
    for _ in range(runs):
        values = {p.name: p.nominal * (1 + share * draw.randrange(-1000, 1001) / 1000) for p in plan.parameters}
        lasting = {identifier: values[parameter] for parameter, identifier in plan.lasting.items()}
        durations = {made.tree.steps[i.identifier]: lasting.get(i.identifier, Fraction(0)) for i in plan.instances}
        most = 30000 if lag is None else int((lag - EPSILON) * 1000)
        late = {key: Fraction(draw.choice((0, draw.randrange(most + 1))), 1000) for key in durations}
        starts, ends = Interpreter(made.text, durations, late=late).run()
        assert not violations(plan, schedule_of(plan, made.tree, starts, ends), values)


def test_a_tree_names_what_it_cannot_keep(photos):
    first, last = photos.instance["n0"], photos.instance["n6"]
    gap = TemporalConstraint(first.end, last.start, Polynomial.constant(5), None)
    deadline = TemporalConstraint(ZERO, last.end, None, Polynomial.constant(100))
    made = make_tree(replace(photos, constraints=(*photos.constraints, gap, deadline)))
    assert [str(item) for item in made.unkept] == ["c: n6.end - .zero in [-inf, 100]"]
    assert parse_tree(made.text, photos).orders == made.tree.orders


# -- reading -----------------------------------------------------------------------------------------------------------

REFUSALS = [
    ("<root", InputError, "found broken XML"),
    ('<!DOCTYPE r [<!ENTITY a "b">]><root/>', InputError, "<tree>:1: found a document type"),
    ("<tree/>", InputError, "<tree>:1: found <'tree'>, expected <root>"),
    ("<root/>", InputError, "<tree>: found no such tree, expected a BehaviorTree"),
    (tree("send").replace('ID="MainTree"', 'ID="Other"'), InputError, "expected the main tree 'MainTree'"),
    (tree(seq("send", "<Fallback/>")), UnsupportedError, "<tree>:3: found node 'Fallback', expected one of Sequence,"),
    (tree("<Sequence/>"), InputError, "<tree>:3: found Sequence without children"),
    (tree("<WaitAction/>"), InputError, "<tree>:3: found no action of WaitAction"),
    (tree('<WaitAction action="{next}"/>'), InputError, "found action '{next}' of WaitAction"),
    (
        tree(W["send"] + W["send"]),
        InputError,
        "<tree>:3: found WaitAction in BehaviorTree of line 2, expected one child",
    ),
    (tree(seq(start("send"), W["merge"], end("send"))), UnsupportedError, "found ExecuteAction of (send):16003 apart"),
    (
        tree(seq(start("send"), end("send", W["back"]))),
        UnsupportedError,
        "found ApplyAtEndEffect of (send):16003 apart",
    ),
    (
        tree(f"<ReactiveSequence>{step('send')}{step('merge')}</ReactiveSequence>"),
        UnsupportedError,
        "<tree>:3: found Sequence behind what acts in the ReactiveSequence of line 3",
    ),
    (tree(par("send", threshold="two")), InputError, "<tree>:3: found success_threshold 'two'"),
]


@pytest.mark.parametrize(("text", "kind", "message"), REFUSALS)
def test_what_is_no_tree_or_has_other_nodes_is_refused(photos, text, kind, message):
    with pytest.raises(kind, match=re.escape(message)):
        parse_tree(text, photos)


def test_faults_name_lines_and_what_is_meant(photos):
    text = tree(seq("to_a", "at_a")).replace("(photo r1 a)", "(photo r1 c)").replace("><", ">\n<")
    faults = parse_tree(text, photos).faults
    assert "(photo r1 a) is not executed, but is 1 step of the plan (n2)" in " ".join(faults)
    assert any(
        re.match(r"<tree>:\d+: \(photo r1 c\) is executed, but is no step of the plan; did you mean", f) for f in faults
    )


def test_other_notations_mean_the_same(photos):
    plain = tree(CORRECT["robots in parallel"])
    generic = re.sub(r"<(WaitAction|Parallel) ", r'<Action ID="\1" ', plain).replace("</Parallel>", "</Action>")
    newer = plain.replace("success_threshold", "success_count").replace("<Sequence>", "<SequenceWithMemory>")
    newer = newer.replace("</Sequence>", "</SequenceWithMemory>")
    orders = parse_tree(plain, photos).orders
    assert orders == parse_tree(generic, photos).orders == parse_tree(newer, photos).orders
    assert orders == parse_tree(plain.replace("</root>", "<TreeNodesModel><X/></TreeNodesModel></root>"), photos).orders


def test_a_check_before_the_end_puts_ends_in_order(photos, tmp_path):
    check = wait("to_b", "CheckAction")
    to_a = seq(start("to_a"), end("to_a", check), "at_a", "back")
    text = tree(par(to_a, "to_b", seq(W["to_b"], "at_b", W["at_a"], "merge", "send")))
    order = next(o for o in parse_tree(text, photos).orders if str(o.after) == "n0.end")
    assert str(order.before) == "n1.end"
    assert checked(photos, text, tmp_path).answer.value == "proved"


def test_deep_trees_are_read(photos):
    deep = "<Sequence>" * 5000 + "".join(step(name) for name in NAMES) + "</Sequence>" * 5000
    assert len(parse_tree(tree(deep), photos).orders) == len(NAMES) - 1


def test_executions_within_the_network_of_the_plan(photos, tmp_path):
    text = tree(CORRECT["robots in parallel"])
    assert checked(photos, text, tmp_path, within="plan").answer.value == "proved"
    apart = TemporalConstraint(photos.instance["n2"].end, photos.instance["n4"].start, None, Polynomial.constant(3))
    plan = replace(photos, constraints=(*photos.constraints, apart))
    assert checked(plan, text, tmp_path).answer.value == "proved"
    result = checked(plan, text, tmp_path, within="plan")
    assert result.answer.value == "refuted"
    (example,) = result.counterexamples.values()
    assert example.obligation == "plan: c: n4.start - n2.end in [-inf, 3]"
    assert example.schedule[apart.target] - example.schedule[apart.source] > 3
    assert "n4.start - n2.end = " in str(result)
    assert (
        checked(plan, text, tmp_path, within="plan", every=True).obligations.items()
        >= {example.obligation: result.answer}.items()
    )


def test_a_lag_bounds_what_waits_for_several_things_from_the_last_of_them(photos, tmp_path):
    text = tree(CORRECT["waits only"])
    latest = {"n4.end": 10 + 4 + 2, "n6.end": 10 + 4 + 2 + 1}
    for late, expected in ((Fraction(1, 20), "refuted"), (1, "proved")):
        bounds = [
            TemporalConstraint(ZERO, photos.instance[name.partition(".")[0]].end, None, Polynomial.constant(time))
            for name, time in ((name, Fraction(time) + late) for name, time in latest.items())
        ]
        plan = replace(photos, constraints=(*photos.constraints, *bounds))
        result = checked(plan, text, tmp_path, within="plan", lag="1/10")
        assert result.answer.value == expected
        assert checked(plan, text, tmp_path, within="plan").answer.value == "refuted"


def test_epsilon_of_zero_and_lags_below_it_are_refused(photos, tmp_path):
    with pytest.raises(UnsupportedError, match="found ε = 0"):
        checked(photos, tree(CORRECT["layers"]), tmp_path, epsilon=0)
    with pytest.raises(InputError, match="found a lag of 0, expected at least ε"):
        checked(photos, tree(CORRECT["layers"]), tmp_path, lag=0)


def test_names_are_those_of_an_executor_that_computes_with_single_precision(photos):
    made = make_tree(photos, starts={name: Fraction(251, 1000) for name in photos.instance})
    assert made.tree.steps["n6"] == "(send):250"  # 0.251 is a little less in 32 bits
    twice = replace(photos, instances=(*photos.instances, replace(photos.instance["n6"], identifier="n7")))
    with pytest.raises(UnsupportedError, match="found two steps"):
        make_tree(twice, starts={name: Fraction(0) for name in twice.instance})


def test_commands_write_and_read_trees(photos, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in (("domain.pddl", DOMAIN), ("problem.pddl", PROBLEM), ("plan.plan", PLAN)):
        Path(name).write_text(text, encoding="utf-8")
    pddl = ["domain.pddl", "problem.pddl"]
    converted = answer_of(command("convert", *pddl, "plan.plan", "--tree", "tree.xml", "-o", "plan.stn", "--json"))
    assert (converted["files"]["tree"], converted["unkept"]) == ("tree.xml", [])
    answer = answer_of(command("check", *pddl, "plan.plan", "--tree", "tree.xml", "--within", "plan", "--json"))
    assert (answer["verdict"], answer["tree"]) == ("proved", "tree.xml")
    assert set(NAMES.values()) == set(re.findall('ExecuteAction action="([^"]*)"', Path("tree.xml").read_text()))
    again = answer_of(
        command("convert", *pddl, "plan.stn", "--tree", "again.xml", "--lag", "1", "--json"), "robust/tree/1"
    )
    assert (again["steps"], again["verdict"]) == (7, "proved")
    Path("wrong.xml").write_text(tree(WRONG["merging without waiting"]), encoding="utf-8")
    refuted = command("check", *pddl, "plan.plan", "--tree", "wrong.xml")
    assert refuted.code == 1
    assert "refuted: an execution of wrong.xml breaks separation: end of photo r1 a (n2)" in refuted.out
    for words, message in (
        (["check", *pddl, "plan.plan", "--lag", "1"], "--lag: needs --tree FILE"),
        (["check", *pddl, "plan.plan", "--tree", "tree.xml", "--encoding", "positions"], "--tree: cannot be combined"),
        (["convert", *pddl, "plan.stn", "--tree", "x.xml", "--stnu", "x.stnu"], "combined with --stnu"),
        (["convert", *pddl, "plan.stn", "--tree", "x.xml", "-o", "x.stn"], "PLAN is a network already"),
    ):
        ended = command(*words)
        assert (ended.code, message in ended.err) == (2, True), ended.err
