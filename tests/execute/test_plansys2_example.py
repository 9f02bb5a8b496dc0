"""The example that feeds a monitor from PlanSys2's messages: replayed here without ROS."""

import ast
import importlib.util
import json
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace

import pytest

import robust
from robust.execute.logs import read_runs

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "examples" / "plansys2"
RECORDED = (FOLDER / "recorded.yaml").read_text(encoding="utf-8")
WORKSHOP = [
    str(ROOT / "robust" / "examples" / "workshop" / name) for name in ("domain.pddl", "problem.pddl", "plan.log")
]


@pytest.fixture(scope="module")
def example():
    spec = importlib.util.spec_from_file_location("feed", FOLDER / "feed.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_recorded_execution_is_followed_to_its_end(example):
    feed = example.Feed(*WORKSHOP, deadline="+10%")
    messages = list(example.recorded(RECORDED))
    answers = [json.loads(example.slack(answer)) for message in messages for answer in feed.tell(message)]
    assert len(messages) > len(answers) == 2 * len(feed.plan.instances)
    assert all(answer["refused"] is None for answer in answers)
    assert {answer["prospect"] for answer in answers[:-1]} == {"on track"}
    assert answers[-1]["prospect"] == "done"
    slack = [
        answer["running"]["paint ann chair"]["slack"] for answer in answers if "paint ann chair" in answer["running"]
    ]
    assert slack == sorted(slack, reverse=True)
    assert slack[0] > 0


def test_runs_that_are_learnt_are_those_that_the_monitor_hears(example):
    feed = example.Feed(*WORKSHOP)
    for message in example.recorded(RECORDED):
        feed.tell(message)
    runs = {run.action: Fraction(run.duration) for run in read_runs(FOLDER / "recorded.yaml")}
    assert {f"({name})": end - start for _, name, start, end in feed.monitor.ended} == runs


def test_times_are_in_the_unit_of_the_plan_and_failures_are_told(example):
    feed = example.Feed(*WORKSHOP, unit=Fraction(60))
    begun = example.ExecutionInfo("(saw ann chair):1", 1_000_000_000_000, 1_000_000_000_000, 1)
    assert feed.tell(begun._replace(status=0)) == []
    (started,) = feed.tell(begun)
    assert (started.running[0].step, started.running[0].since) == ("n0", Fraction(1, 1000))
    assert feed.tell(begun) == []
    (failed,) = feed.tell(begun._replace(stamp=begun.start + 120 * 10**9, status=2))
    assert failed.prospect is robust.Prospect.BROKEN
    assert failed.time == 2 + Fraction(1, 1000)


def test_ends_of_unheard_starts_and_unknown_actions(example):
    feed = example.Feed(*WORKSHOP)
    ended = example.ExecutionInfo("(saw ann chair)", 10**12, 10**12 + 12 * 10**9, 3)
    assert [answer.refused for answer in feed.tell(ended)] == [None, None]
    with pytest.raises(robust.InputError, match="found action '\\(fly\\):0', expected one of"):
        feed.tell(ended._replace(name="(fly):0"))


def test_a_message_of_ros_says_what_its_echo_says(example):
    first = next(message for message in example.recorded(RECORDED) if message.status == 1)
    stamps = [SimpleNamespace(sec=time // 10**9, nanosec=time % 10**9) for time in (first.start, first.stamp)]
    message = SimpleNamespace(
        start_stamp=stamps[0], status_stamp=stamps[1], action_full_name=first.name, status=first.status
    )
    assert example.of_ros(message) == first


def test_slack_is_rounded_down_and_names_no_limit(example):
    feed = example.Feed(*WORKSHOP)
    begun = example.ExecutionInfo("(saw ann chair):1", 10**12, 10**12, 1)
    (answer,) = feed.tell(begun)
    assert json.loads(example.slack(answer))["running"] == {"saw ann chair": {"slack": None, "ends_by": None}}


def test_the_node_uses_what_the_feed_has(example):
    """It cannot be run without ROS: its syntax and the names that it imports are checked."""
    tree = ast.parse((FOLDER / "slack_node.py").read_text(encoding="utf-8"))
    (names,) = (node.names for node in tree.body if isinstance(node, ast.ImportFrom) and node.module == "feed")
    assert all(hasattr(example, name.name) for name in names)
