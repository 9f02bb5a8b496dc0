"""Regions and boxes of plans with choices depend on the question alone: not on what was asked before in the process, in
which order, or on how the process hashes texts."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from itertools import product
from pathlib import Path

import pytest

from robust import pike
from tests.pike_bridge import plans
from tests.pike_bridge.envelopes.examples import random_parameters, seeded, structured

ROOT = Path(__file__).resolve().parents[3]
QUESTIONS = ("region", "region of all choices", "some choices", "all choices", "all choices, waiting")
ORDERS = ("forward", "backward", "shuffled", "alone")


def plan_of(number):
    """A structured plan or one of any other kind, with random parameters."""
    epsilon = (Fraction(0), Fraction(1, 4), Fraction(1, 1000))[number // 2 % 3]
    plan = structured(number) if number % 2 else replace(plans.random_plan(seeded(number)), epsilon=epsilon)
    return random_parameters(plan, number)


def answer(number, question):
    """Print what a program reads of it, but for how long it took."""
    plan = plan_of(number)
    if question.startswith("region"):
        result = pike.region(plan, choices=list(plan.plan.network.domains) if "all" in question else None)
    else:
        theirs = [each.name for each in plan.plan.network.choices if not each.controllable and "all" in question]
        result = pike.envelope(plan, for_all=theirs, patience=bool(theirs) and question.endswith("waiting"))
    document = {key: value for key, value in result.as_dict().items() if key != "seconds"}
    print(json.dumps([f"{number} {question}", document]), flush=True)  # noqa: T201 - to whoever started this


def answer_all(numbers, order):
    """All questions about some plans in an order, with other questions in between unless each is asked alone, in a
    process of its own."""
    questions = list(product(numbers, QUESTIONS))
    if order == "shuffled":
        seeded("order").shuffle(questions)
    for number, question in questions[::-1] if order == "backward" else questions:
        if order != "alone":
            answer(number, question)
            if number % 3 == 0:
                pike.check(plan_of(number).plan, all_scenarios=True)
        elif (child := os.fork()) == 0:
            answer(number, question)
            os._exit(0)
        else:
            assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


@pytest.mark.parametrize(
    ("numbers", "orders"),
    [(range(97, 98), ("forward", "backward")), pytest.param(range(300), ORDERS, marks=pytest.mark.slow)],
)
def test_no_history_changes_an_answer(numbers, orders):
    """By order in a process that hashes texts in its own way."""
    command = [sys.executable, "-m", __name__, f"{numbers.start}:{numbers.stop}"]
    running = [
        subprocess.Popen(
            [*command, order], env={**os.environ, "PYTHONHASHSEED": str(seed)}, cwd=ROOT, stdout=subprocess.PIPE
        )
        for seed, order in enumerate(orders, 1)
    ]
    answers = [dict(map(json.loads, process.communicate()[0].splitlines())) for process in running]
    assert len(answers[0]) == len(numbers) * len(QUESTIONS)
    assert answers == [answers[0]] * len(orders)


if __name__ == "__main__":
    answer_all(range(*map(int, sys.argv[1].split(":"))), sys.argv[2])
