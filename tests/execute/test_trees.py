"""Behavior trees of PlanSys2: verdicts about trees by hand and mutants, and executions of trees that were written.

The interpreter of :mod:`tests.execute.trees` shares no code with the reader.
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
from tests.execute.trees import (
    CORRECT,
    EPSILON,
    FAULTS,
    LAGS,
    NAMES,
    PLANS,
    WRONG,
    Interpreter,
    W,
    end,
    par,
    parsed,
    seq,
    start,
    step,
    tree,
    wait,
)

SHARED = Path(__file__).parents[3] / "shared"
WORKSHOP = Path(robust.__file__).parent / "examples" / "workshop"


def schedule_of(plan, tree, starts, ends):
    schedule = {}
    for instance in plan.instances:
        name = tree.steps[instance.identifier]
        schedule |= {instance.end: ends[name], instance.start: starts[name]}
    return schedule


def violations(plan, schedule, parameters=None):
    free = replace(plan, constraints=()) if plan.constraints else plan
    return simulate(free, plan.nominal if parameters is None else parameters, schedule, epsilon=EPSILON).violations


def durations_of(plan, tree, schedule):
    return {
        tree.steps[instance.identifier]: schedule[instance.end] - schedule[instance.start]
        for instance in plan.instances
    }


FILES = "domain.pddl", "problem.pddl", "plan.plan"


def written(domain, folder):
    """The files of a plan, in a folder."""
    for name, text in zip(FILES, PLANS[domain].split("===\n"), strict=True):
        (folder / name).write_text(text, encoding="utf-8")
    return [folder / name for name in FILES]


@pytest.fixture(scope="module")
def plans(tmp_path_factory):
    return {domain: robust.load_plan(*written(domain, tmp_path_factory.mktemp(domain))) for domain in PLANS}


@pytest.fixture(scope="module")
def photos(plans):
    return plans["photos"]


def checked(plan, text, folder, **options):
    file = folder / "tree.xml"
    file.write_text(text, encoding="utf-8")
    return robust.check(plan, tree=file, **options)


def confirm(plan, text, result, lag=None):
    """Let the interpreter execute a proved tree; and follow counterexamples, which then break what they say."""
    read = parse_tree(text, plan)
    names = read.steps.values()
    if result.answer.value == "proved" and "Apply" in text:
        draw = random.Random(1)  # noqa: S311
        lasting = durations_of(plan, read, earliest(plan))
        runs = []
        for _ in range(5):
            most = 40000 if lag is None else lag * 1000 - 1
            times = {name: Fraction(draw.choice((0, 0, 5000, 10000, 14000, draw.randrange(40000)))) for name in names}
            late = {name: min(time, Fraction(most)) / 1000 for name, time in times.items()}
            ends = Interpreter(text, lasting, **{"hold" if lag is None else "late": late}).run()
            assert ends is not None or "CheckAction" in text
            runs += [] if ends is None else [violations(plan, schedule_of(plan, read, *ends))]
        assert runs
        assert not any(runs)
    for example in result.counterexamples.values():
        hold = {name: example.schedule[plan.instance[identifier].start] for identifier, name in read.steps.items()}
        lasting = durations_of(plan, read, example.schedule)
        followed = schedule_of(plan, read, *Interpreter(text, lasting, hold).run())
        assert followed == {point: example.schedule[point] for point in followed}
        assert example.obligation in {violation.obligation for violation in violations(plan, followed)}


def earliest(plan):
    return distances_within(plan, {name: (value, value) for name, value in plan.nominal.items()}).times


def named(trees):
    return [(domain, name) for domain, known in trees.items() for name in known]


@pytest.mark.parametrize(("domain", "name"), named(CORRECT))
def test_correct_trees_are_proved(plans, domain, name, tmp_path):
    text, lag = tree(CORRECT[domain][name]), LAGS.get(name)
    result = checked(plans[domain], text, tmp_path, lag=lag)
    assert result.answer.value == "proved"
    confirm(plans[domain], text, result, lag)


@pytest.mark.parametrize(("domain", "name"), named(WRONG))
def test_wrong_trees_are_refuted_by_an_execution(plans, domain, name, tmp_path):
    breaks, inner = WRONG[domain][name]
    result = checked(plans[domain], tree(inner), tmp_path, lag=LAGS.get(name), every=True)
    assert result.answer.value == "refuted"
    assert any(breaks in obligation for obligation in result.counterexamples), list(result.counterexamples)
    confirm(plans[domain], tree(inner), result)


@pytest.mark.parametrize("name", FAULTS)
def test_trees_that_never_execute_the_plan_are_refuted_by_a_fault(photos, tmp_path, name):
    reason, inner = FAULTS[name]
    result = checked(photos, tree(inner), tmp_path)
    assert result.answer.value == "refuted"
    assert reason.replace("<tree>", str(tmp_path / "tree.xml")) in result.reason
    ends = Interpreter(tree(inner), dict.fromkeys(NAMES["photos"].values(), Fraction(1))).run()
    assert (ends is None) == (name in {"in a circle", "waits for nothing"})


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
    for text in mutants(tree(CORRECT["photos"][name])):
        result = checked(photos, text, tmp_path)
        refuted += result.answer.value == "refuted"
        confirm(photos, text, result)
        if result.answer.value == "refuted" and result.reason is not None:
            durations = durations_of(photos, parse_tree(tree(CORRECT["photos"][name]), photos), earliest(photos))
            assert "wait for each other" in result.reason
            assert Interpreter(text, durations).run() is None
    assert refuted >= 3


# -- trees that are written --------------------------------------------------------------------------------------------

LATE = Fraction(1, 100)
"""How late nodes begin where any delay would be too much."""
WITHIN = "turn-and-open", "rovers-2006-7", "drones", "map-analyzer-2014-3", "delivery"
"""Plans with actions that have to begin while others go on, or with windows of time: no tree keeps them at any pace."""


INVALID = {"map-analyzer-2014-3": "1/2000", "map-analyzer-2014-5": None, "map-analyzer-2014-7": None}
"""Plans that break something as they stand, with the tolerance that mends them, if one does."""


def exported_plans():
    for folder in ("pstn-plans", "planner-logs"):
        listed = SHARED / folder / "plans.json"
        for entry in json.loads(listed.read_text(encoding="utf-8")) if listed.exists() else ():
            yield entry["name"], tuple(SHARED / folder / entry[key] for key in ("domain", "problem", "log"))
    for name, plan in (("workshop", "plan.log"), ("delivery", "steps.plan")):  # for the two that are invalid
        yield name, tuple(WORKSHOP.parent / name / file for file in ("domain.pddl", "problem.pddl", plan))


FEW = {"rovers-2", "crew-2", "drones-13", "map-analyzer-2014-1", "workshop", "delivery"}
EXPORTED = [
    pytest.param(name, files, runs, marks=marks, id=f"{name}, {runs} executions")
    for name, files in exported_plans()
    for runs, marks in ((3, ()), (200, pytest.mark.slow))
    if runs > 3 or name in FEW
]


@pytest.mark.filterwarnings("ignore::robust.errors.InputWarning")  # of domains that declare types twice
@pytest.mark.parametrize(("name", "files", "runs"), EXPORTED)
def test_random_executions_of_written_trees_are_valid(name, files, runs, tmp_path):
    if name in INVALID:
        with pytest.raises(RefutedError, match="invalid plan"):
            robust.load_plan(*files)
        if INVALID[name] is None:
            return
    plan = robust.load_plan(*files, parameters=["duration:*"], tolerance=INVALID.get(name))
    lag = LATE if name.startswith(WITHIN) else None
    if lag is not None and len(plan.instances) < 100:
        with pytest.raises(RefutedError, match="found no tree that keeps the plan valid whenever nodes begin"):
            make_tree(plan)
    made = make_tree(plan, lag=lag)
    for share in (Fraction(1, 5), Fraction(1, 100), Fraction(0)):
        wide = {p.name: (p.nominal * (1 - share), p.nominal * (1 + share)) for p in plan.parameters}
        if checked(plan, made.text, tmp_path, at=wide, lag=lag).answer.value == "proved":
            break
    draw, free = random.Random(name), replace(plan, constraints=())  # noqa: S311
    for _ in range(runs):
        values = {p.name: p.nominal * (1 + share * draw.randrange(-1000, 1001) / 1000) for p in plan.parameters}
        lasting = {identifier: values[parameter] for parameter, identifier in plan.lasting.items()}
        durations = {made.tree.steps[i.identifier]: lasting.get(i.identifier, Fraction(0)) for i in plan.instances}
        most = 30000 if lag is None else int((lag - EPSILON) * 1000)
        late = {key: Fraction(draw.choice((0, draw.randrange(most + 1))), 1000) for key in durations}
        starts, ends = Interpreter(made.text, durations, late=late).run()
        assert not violations(free, schedule_of(free, made.tree, starts, ends), values)


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
    ("<tree/>", InputError, "<tree>:1: found element 'tree', expected <root> with a"),
    ("", InputError, "<tree>:1:1: found broken XML (no element found)"),
    ("\n<root/>", InputError, "<tree>:2: found no BehaviorTree in <root>, expected <BehaviorTree ID=...>"),
    (tree(""), InputError, "<tree>:2: found BehaviorTree without children"),
    (
        tree(step("send")).replace('"MainTree"', '"X"', 1),
        InputError,
        "<tree>:1: found main tree 'X', expected one of 'M",
    ),
    (tree(seq("send", "<Fallback/>")), UnsupportedError, "<tree>:3: found node 'Fallback', expected one of Sequence,"),
    (tree("<Sequence/>"), InputError, "<tree>:3: found Sequence without children"),
    (
        tree(seq("send", '<SubTree ID="MainTree"/>')),
        UnsupportedError,
        "<tree>:3: found node 'SubTree', expected one of",
    ),
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
    plain = tree(CORRECT["photos"]["robots in parallel"])
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
    deep = "<Sequence>" * 5000 + "".join(step(name) for name in NAMES["photos"]) + "</Sequence>" * 5000
    assert len(parse_tree(tree(deep), photos).orders) == len(NAMES["photos"]) - 1


def test_executions_within_the_network_of_the_plan(photos, tmp_path):
    text = tree(CORRECT["photos"]["robots in parallel"])
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
    text = tree(CORRECT["photos"]["waits only"])
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
        checked(photos, tree(CORRECT["photos"]["layers"]), tmp_path, epsilon=0)
    with pytest.raises(InputError, match="found a lag of 0, expected at least ε"):
        checked(photos, tree(CORRECT["photos"]["layers"]), tmp_path, lag=0)


def test_names_are_those_of_an_executor_that_computes_with_single_precision(photos):
    made = make_tree(photos, starts={name: Fraction(251, 1000) for name in photos.instance})
    assert made.tree.steps["n6"] == "(send):250"  # 0.251 is a little less in 32 bits
    twice = replace(photos, instances=(*photos.instances, replace(photos.instance["n6"], identifier="n7")))
    with pytest.raises(UnsupportedError, match="found two steps"):
        make_tree(twice, starts={name: Fraction(0) for name in twice.instance})


def test_commands_write_and_read_trees(photos, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    written("photos", tmp_path)
    pddl = ["domain.pddl", "problem.pddl"]
    converted = answer_of(command("convert", *pddl, "plan.plan", "--tree", "tree.xml", "-o", "plan.stn", "--json"))
    assert (converted["files"]["tree"], converted["unkept"]) == ("tree.xml", [])
    answer = answer_of(command("check", *pddl, "plan.plan", "--tree", "tree.xml", "--within", "plan", "--json"))
    assert (answer["verdict"], answer["tree"]) == ("proved", "tree.xml")
    assert set(NAMES["photos"].values()) == set(
        re.findall('ExecuteAction action="([^"]*)"', Path("tree.xml").read_text())
    )
    again = answer_of(
        command("convert", *pddl, "plan.stn", "--tree", "again.xml", "--lag", "1", "--json"), "robust/tree/1"
    )
    assert (again["steps"], again["verdict"]) == (7, "proved")
    Path("wrong.xml").write_text(tree(WRONG["photos"]["merging without waiting"][1]), encoding="utf-8")
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
