"""Certificates of plans with choices against networks that mean nothing, and the checker's command as a whole."""

from __future__ import annotations

from random import Random

import pytest

from robust.certify.checker.reader import Unsupported
from robust.certify.tape import write
from robust.errors import RobustError
from robust.pike_bridge.action_model import load_team_plan
from robust.pike_bridge.semantics import Oracle
from tests.certify import command_lines, networks, tools


def test_small_networks(tmp_path):
    """What is established is true, of whatever network; of most nothing is."""
    established = []
    for number, (name, path, tapes, epsilon) in enumerate(networks.small(tmp_path)):
        for place, lines in enumerate(tapes):
            certificate = tmp_path / f"{number}-{place}"
            write(lines, certificate)
            code, _ = tools.ask(certificate, [path], epsilon=epsilon)
            if code == 0:
                assert networks.is_true(path, lines), name
                established.append(name)
    assert established[0] == "honest"
    assert number > 300 > 10 * len(established)


@pytest.mark.parametrize(
    ("domain", "document"),
    [
        ("(?o) :synth-parameters (?v)", {}),
        ("(?o)", {"constraints": {}}),
        ("(?o)", {"activities": {}}),
        ("(?o)", {"choices": [{**networks.document()["choices"][0], "domain": ["a", "a", "b=c"]}]}),
        ("(?o)", {"events": [*networks.document()["events"], {"name": "e1"}]}),
        ("(?o)", {"constraints": [{"from": "e1", "to": "e2", "lower": "2", "upper": "1"}]}),
        ("(?o)", {"parameters": [5]}),
        ("(?o)", {"parameters": [{"name": "k", "x": "1"}]}),
        ("(?o)", {"parameters": [{"name": "k", "default": 2}]}),
    ],
)
def test_networks_of_which_nothing_is_proved(tmp_path, domain, document):
    """Parameters of actions, no lists, values and events twice, empty ranges, malformed parameters."""
    text = networks.DOMAIN.replace("(?o)", domain)
    path = networks.files(tmp_path / "network", {**networks.document(), **document}, text, networks.PROBLEM)
    for lines in (networks.EXECUTION, networks.OUT_OF_NOTHING):
        assert tools.command(lines, tmp_path / "cert", [path])[0] == 4


def test_random_networks(tmp_path):
    """The checker, the oracle and the referee of executions agree."""
    seen = set()
    for seed in range(150, 190):
        path = networks.random_network(seed, tmp_path / str(seed))
        try:
            plan = load_team_plan(path)
        except RobustError:
            continue
        witness = Oracle(plan).decide().witness
        seen.add(witness is None)
        assert networks.decides(tools.CHECKER, path, witness is not None)
        if witness is not None:
            assert networks.referees(tools.CHECKER, path, networks.executions(plan, witness, Random(seed)))
    assert seen == {True, False}


def test_command_lines(tmp_path):
    """Each ends with its exit code, and with one that is not 0 nothing is established."""
    for code, words in command_lines.lines_and_codes(tmp_path):
        found, printed, _, _ = command_lines.outcome(words)
        assert found == code, words
        assert printed.startswith("established:") == (code == 0 and "--json" not in words), words


def test_a_side_of_a_box_is_closed_unless_it_is_said_to_be_open(tmp_path):
    """Whatever else is said of it demands no less."""
    box = tools.CHECKER.main.box_in(tools.grounded(tools.NAVIGATION), {"to_ridge": {"lower": "1", "upper": "2"}})
    said = {"to_ridge": {"lower": "1", "lower_closed": "no", "upper": "2", "upper_closed": 0}}
    assert tools.CHECKER.main.box_in(tools.grounded(tools.NAVIGATION), said) == box
    assert (box["to_ridge"].lower_closed, box["to_ridge"].upper_closed) == (True, True)
    assert box["to_crater"].lower == box["to_crater"].upper == 40
    with pytest.raises(Unsupported):
        tools.CHECKER.main.box_in(tools.grounded(tools.NAVIGATION), {"to_ridge": {"lower": 1, "upper": 2}})


def test_the_program_as_a_whole():
    assert command_lines.reports_errors(tools.CHECKER)
    assert command_lines.keeps_limits(tools.CHECKER)
    assert command_lines.starts(tools.CHECKER)
