"""Which plans a folder or a list is: what belongs together by name, and what is wrong with lists."""

import json
from pathlib import Path

import pytest

from robust.errors import InputError
from robust.sweeps.batch import SuitePlan, read_suite
from tests.tables import tables

TABLES = tables(__file__)

ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / "shared"


def folder(tmp_path, files):
    """A folder of empty plans, and of PDDL files that define what their names say."""
    for name in files.split():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        kind = "domain" if "domain" in path.name else "problem"
        path.write_text(f"; (define (nothing\n(DEFINE ({kind} x))" if name.endswith(".pddl") else "", encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize(("files", "domain", "problem"), TABLES["files that belong together"])
def test_files_that_belong_together(tmp_path, files, domain, problem):
    (one,) = read_suite(folder(tmp_path, files)).instances
    assert (one.name, one.domain, one.problem, one.trouble) == (files.split()[-1], domain, problem, None)


def test_plans_in_hidden_folders_and_other_files_are_none(tmp_path):
    path = folder(tmp_path, "domain.pddl problem.pddl .git/plan.stn .hidden.stn notes.txt b.stn a.stn")
    suite = read_suite(path)
    assert [(one.name, one.trouble) for one in suite.instances] == [("a.stn", None), ("b.stn", None)]
    assert suite.notes == ("passed over notes.txt: names of plans end in .stn, .plan, .log, .sol, .soln, .solution",)


@pytest.mark.parametrize(("files", "trouble"), TABLES["what is not clear is said of that plan"])
def test_what_is_not_clear_is_said_of_that_plan(tmp_path, files, trouble):
    (one,) = read_suite(folder(tmp_path, files)).instances
    assert trouble in one.trouble
    assert "a list may say which" in one.trouble


def test_folders_that_there_are():
    names = {one.name for one in read_suite(ROOT / "robust" / "examples").instances if one.trouble is None}
    assert {"delivery/plan.stn", "delivery/steps.plan", "generator/plan.stn"} <= names


@pytest.mark.parametrize(("name", "count"), [("paper-dataset", 61), ("planner-logs", 33)])
def test_data_sets_are_read_as_folders_and_as_lists(name, count):
    data = DATA / name
    if not data.is_dir():
        pytest.skip("the data set is not here")
    by_folder = read_suite(data).instances
    assert (len(by_folder), {one.trouble for one in by_folder}) == (count, {None})
    (listed,) = data.glob("*.json")
    known = {(one.domain, one.problem, one.plan) for one in by_folder}
    assert {(one.domain, one.problem, one.plan) for one in read_suite(listed).instances} <= known


def test_lines(tmp_path):
    path = tmp_path / "suite.txt"
    lines = ["# two", "", "d.pddl 'my problem.pddl' a.stn # the first"]
    lines += [f"d.pddl p.pddl {plan}" for plan in ("sub/b.plan", "a.stn")]
    path.write_text("\n".join((*lines, "")))
    suite = read_suite(path)
    assert suite.folder == tmp_path
    assert suite.instances == (
        SuitePlan("a.stn", "d.pddl", "my problem.pddl", "a.stn"),
        SuitePlan("sub/b.plan", "d.pddl", "p.pddl", "sub/b.plan"),
        SuitePlan("a.stn (2)", "d.pddl", "p.pddl", "a.stn"),
    )


def test_json_and_csv_say_the_same(tmp_path):
    entries = [
        {"instance": "one", "domain": "d.pddl", "problem": "p.pddl", "plan": "a.stn", "steps": 3},
        {"name": "two", "domain": "d.pddl", "problem": "p, q.pddl", "log": "b.log"},
        {"domain": "d.pddl", "problem": "p.pddl", "plan": "c.stn"},
    ]
    (tmp_path / "a.json").write_text(json.dumps(entries))
    rows = "one,d.pddl,p.pddl,,a.stn", 'two,d.pddl,"p, q.pddl",b.log,', ",d.pddl,p.pddl,,c.stn"
    (tmp_path / "a.CSV").write_text("\n".join(("name,domain,problem,log,plan", *rows, "")))
    first, second = (read_suite(tmp_path / name).instances for name in ("a.json", "a.CSV"))
    assert first == second
    expected = [("one", "p.pddl", "a.stn"), ("two", "p, q.pddl", "b.log"), ("c.stn", "p.pddl", "c.stn")]
    assert [(one.name, one.problem, one.plan) for one in first] == expected


NO_PROBLEM = '[\n{"domain": "d", "plan": "a"}]'


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.txt", "", "a.txt: found no plan, expected lines of DOMAIN PROBLEM PLAN"),
        ("a.txt", "# nothing\n", "a.txt: found no plan"),
        ("a.txt", "d p a\nd p\n", "a.txt:2: found 2 files, expected DOMAIN PROBLEM PLAN"),
        ("a.txt", "d p 'a\n", 'a.txt:1: found "d p \'a", expected quotes in pairs'),
        ("a.json", "", "a.json:1:1: found an empty file"),
        ("a.json", "[]", "a.json:1:1: found an empty list, expected a list of objects"),
        ("a.json", "{}", "a.json:1:1: found an empty object, expected a list of objects"),
        ("a.json", "[1]", "a.json:1:2: found 1, expected an object"),
        ("a.json", '[{"domain": 1}]', "a.json:1:13: found 1 as domain, expected a text"),
        ("a.json", NO_PROBLEM, "a.json:2:1: found no problem, expected domain, problem and plan"),
        ("a.csv", "", "a.csv: found no plan, expected a head"),
        ("a.csv", "domain,problem,plan\nd,p\n", "a.csv:2: found no plan, expected domain"),
        ("a.csv", "domain,problem,plan\nd,p,a,b\n", "a.csv:2: found more cells than the 3 of the head"),
        ("a.csv", 'domain,problem,plan\n"d"x,p,a\n', "a.csv:2: found no CSV"),
    ],
)
def test_malformed_lists_name_the_place(tmp_path, name, text, message):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_suite(path)
    assert str(caught.value).startswith(f"{tmp_path}/{message}")
    assert "\n" not in str(caught.value)


def test_nothing_there(tmp_path):
    with pytest.raises(InputError, match="no such file or folder"):
        read_suite(tmp_path / "none")
    with pytest.raises(InputError, match=r"found no plan, expected files that end in \.stn"):
        read_suite(tmp_path)
