"""From files to plans."""

import pytest

from robust.errors import InputError, UnsupportedError
from robust.pike_bridge.action_model import load_network, load_team_plan, team_plan_of
from robust.pike_bridge.files import write_tpnu
from tests.pike_bridge.kitchen import DOMAIN, PROBLEM, kitchen


@pytest.fixture
def files(tmp_path):
    (tmp_path / "pddl").mkdir()
    (tmp_path / "pddl" / "domain.pddl").write_text(DOMAIN, encoding="utf-8")
    (tmp_path / "pddl" / "problem.pddl").write_text(PROBLEM, encoding="utf-8")
    path = tmp_path / "kitchen.tpnu.json"
    write_tpnu(path, kitchen(), domain="pddl/domain.pddl", problem="pddl/problem.pddl")
    return path


def edit(path, before, after):
    text = path.read_text(encoding="utf-8")
    assert before in text
    path.write_text(text.replace(before, after, 1), encoding="utf-8")


def test_a_plan_from_files_is_that_in_memory(files):
    assert load_team_plan(files) == team_plan_of(kitchen(), DOMAIN, PROBLEM)
    assert load_network(files) == kitchen()


def test_actions_are_located(files):
    edit(files, "(get human glass)", "(grab human glass)")
    with pytest.raises(InputError, match=r"kitchen.tpnu.json:\d+:16: found action 'grab', expected one of domain"):
        load_team_plan(files)
    edit(files, "(grab human glass)", "(get human bagel)")
    with pytest.raises(InputError, match=r"kitchen.tpnu.json:\d+:16: found 'bagel' of type food"):
        load_team_plan(files)
    edit(
        files,
        '(get human bagel)", "from": "e4", "to": "e5", "lower": 0.5, "upper": 2',
        '(get human glass)", "from": "e4", "to": "e5", "lower": 11, "upper": 12',
    )
    with pytest.raises(InputError, match=r"kitchen.tpnu.json:\d+:5: found activity .* with bounds \[11, 12\]"):
        load_team_plan(files)


def test_networks_are_checked_first(files):
    edit(files, '"at": "e1"', '"at": "e99"')
    for load in (load_team_plan, load_network):
        with pytest.raises(InputError, match=r"kitchen.tpnu.json:\d+:\d+: found event 'e99'"):
            load(files)


def test_missing_files(files):
    (files.parent / "pddl" / "problem.pddl").unlink()
    with pytest.raises(InputError, match=r"pddl/problem.pddl: found no such file"):
        load_team_plan(files)
    load_network(files)
    with pytest.raises(InputError, match="no such file"):
        load_team_plan(files.with_name("other.tpnu.json"))


def test_unsupported_domains_are_located(files):
    edit(files.parent / "pddl" / "domain.pddl", "(over all (taken ?v))", "(over all (or (taken ?v) (filled ?v)))")
    with pytest.raises(UnsupportedError, match=r"domain.pddl:\d+:\d+: found a disjunction .* of \(pour robot mug\)"):
        load_team_plan(files)
