"""`bench figure20b` on a few plans."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib.resources import files

import jsonschema
import pytest

from robust.bench.figure20b import chosen, run_figure20b
from robust.bench.latency import measure_latency
from robust.errors import InputError
from robust.smt.limits import Deadline
from tests.bench.conftest import rendered


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """Of the first five plans, two admit a correct execution."""
    seen = []
    found = run_figure20b(
        backends=chosen(("smt", "bdd")),
        problems=5,
        plot=tmp_path_factory.mktemp("plots") / "plot.svg",
        on_result=lambda *progress: seen.append(progress),
    )
    assert [done for done, _, _ in seen] == [1, 2, 3, 4, 5, 1, 2, 3, 4]
    return found


def test_a_few_plans(report):
    assert report.agrees
    assert report.admitting == ("random_0_000", "random_0_004")
    assert [(each.instance, each.backend) for each in report.executions] == [
        (instance, backend) for instance in report.admitting for backend in ("smt", "bdd")
    ]
    for execution in report.executions:
        assert execution.executed
        assert 0 < execution.slowest < 60
        assert execution.preparation > 0
    first, second = report.executions[:2]
    assert first.decisions == second.decisions
    assert len(first.steps) == len(second.steps)


def test_what_is_printed(report):
    value = json.loads(json.dumps(report.as_dict(), allow_nan=False))
    schema = json.loads(files("robust.bench").joinpath("schemas/bench-figure20b.schema.json").read_text())
    jsonschema.validate(value, schema)
    text = rendered(report.tables())
    assert "5 plans of seed 0: 2 of 5 decided ones admit a correct execution" in text
    assert "2 (100.0%)" in text


def test_different_decisions_are_a_failure(report):
    *others, last = report.executions
    changed = replace(last, decisions=(*last.decisions[:3], "something else", *last.decisions[4:]))
    wrong = replace(report, executions=(*others, changed))
    assert wrong.differences == ["random_0_004: smt and bdd differ from decision 4 on"]
    assert not wrong.agrees
    assert "differ from decision 4 on" in rendered(wrong.tables())


def test_what_a_time_out_has_decided_may_be_less_but_not_other(report):
    *others, last = report.executions
    late = replace(last, outcome="timeout", decisions=last.decisions[:3])
    assert replace(report, executions=(*others, late)).agrees
    assert not replace(report, executions=(*others, replace(last, decisions=last.decisions[:3]))).agrees
    assert not replace(report, executions=(*others, replace(late, decisions=("other",)))).agrees


def test_a_failed_process_is_a_failure():
    found = run_figure20b(backends=("no such back end",), problems=1)
    assert not found.agrees
    assert "unknown reasoner" in found.executions[0].message


def test_a_passed_deadline_keeps_what_was_measured():
    latency = measure_latency(0, backend="bdd", deadline=Deadline.after(0))
    assert latency.outcome == "timeout"
    assert latency.steps == ()


def test_wrong_options():
    with pytest.raises(InputError, match="unknown back end 'bbd'; did you mean 'bdd'"):
        chosen(("bbd",))
    with pytest.raises(InputError, match="problems is 0"):
        run_figure20b(backends=("bdd",), problems=0)
    assert chosen(()) == ("smt", "pitms", "atms", "bdd", "sat")
