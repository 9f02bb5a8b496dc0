"""The checker's text is changed on purpose: what it believes then is noticed."""

from __future__ import annotations

import ast

import pytest

from tests.certify import tools
from tests.certify.bank import leaf_changes, named, probes, within
from tests.certify.mutants import ASKED, MODULES, TEXTS, Probe, accepted, load, mutants, noticed_by

BELIEVES_MORE = [
    ("proofs", "Facts.imply", "value > -1"),
    ("proofs", "lemma", "value < 1 or"),
    ("proofs", "hinted", "demand(whole(gate, len(formulas.circuit.nodes)) > 0, "),
    ("proofs", "Tape.finish", "pass  # instead of: demand"),
    ("claims", "check_faces", "demand(away > 0, "),
    ("reader", "Ground.read", "pass  # instead of: self.edges +="),
    ("formulas", "mutex", "pass  # instead of: done +="),
    ("choices", "Choices.constrain", "pass  # instead of: need(implied"),
    ("choices", "Choices.met", "(producer.activity, producer.first) == (condition.activity, condition.first)"),
    ("__main__", "require", "pass  # instead of: demand(enough"),
    ("__main__", "main", "pass  # instead of: return code"),
]


def test_changes_are_of_the_checkers_text():
    """Each makes one line something else, and the tree is as before after all of them."""
    found = list(mutants("proofs"))
    assert len(found) > 400
    assert sum(each.before != each.after for each in found) > 0.95 * len(found)
    assert ast.unparse(found[0].tree) == ast.unparse(ast.parse(TEXTS["proofs"]))
    assert load().proofs.Rejected is not tools.CHECKER.proofs.Rejected


@pytest.mark.parametrize("kind", ["maximal", "region"])
def test_refutations_that_somebody_might_try(kind):
    """Comparisons as gates, literals that are none, clauses that are not there, contradictions out of nothing."""
    lines, ground = tools.made(tools.NAVIGATION, kind), tools.grounded(tools.NAVIGATION)
    count = 0
    for forged in named(lines):
        changed = [new for new, old in zip(forged, lines, strict=True) if new != old]
        if changed and changed[0][0] == "refute":
            assert isinstance(tools.judged(forged, ground), str), changed
            count += 1
    assert count > 300
    assert sum(1 for _ in leaf_changes(lines)) > 300


def test_a_box_without_one_of_its_faces_is_not_maximal():
    """What is shown beyond the face of the larger box says nothing of the face itself, which could be added."""
    found = list(within())
    assert len(found) == 4
    assert all(holds(tools.CHECKER) for _, holds in found)
    for mutant in mutants("claims"):
        if mutant.after.startswith("demand(away > 0, "):
            assert not all(holds(load("claims", compile(mutant.tree, "claims", "exec"))) for _, holds in found)
            break
    else:
        raise AssertionError("the change of check_faces is not made")


@pytest.mark.slow
@pytest.mark.parametrize(("module", "function", "line"), BELIEVES_MORE)
def test_a_checker_that_believes_more_is_noticed(module, function, line):
    (mutant,) = [each.after for each in mutants(module) if each.function == function and line in each.after][:1]
    bank = [Probe(*each) for each in probes(ASKED[module])]
    for each in mutants(module):
        if each.function == function and each.after == mutant:
            assert noticed_by(each, bank, 60) is not None
            break


@pytest.mark.slow
def test_what_is_accepted_has_a_reason_and_is_a_change_of_the_present_text():
    assert all(reason for reason in accepted().values())
    assert accepted().keys() <= {mutant.key for module in MODULES for mutant in mutants(module)}
