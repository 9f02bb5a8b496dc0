"""False claims are not accepted, and the checker's text is changed on purpose: what it believes then is noticed."""

from __future__ import annotations

import ast
from functools import partial
from itertools import chain

import pytest

from robust.certify.checker import proofs, reader
from robust.certify.checker.formulas import Formulas
from tests.certify import adversary, meaning, networks, tools
from tests.certify.adversary import TABLES, cases, run
from tests.certify.bank import SECTIONS, meanings, probes, small, small_networks, with_choices, within
from tests.certify.command_lines import command_lines
from tests.certify.mutants import ASKED, MODULES, TEXTS, accepted, load, mutants, noticed_by

QUICK = {
    "texts": lambda _: meaning.texts_probes(),
    "formulas over all times": lambda _: chain(meaning.free(1_000, 60), meanings()),
    "forgeries": lambda _: small(),
    "plans with choices": partial(with_choices, count=14),
    "random networks": partial(networks.random_networks, first=150, count=40),
    "small networks": small_networks,
    "command lines": command_lines,
}


@pytest.mark.parametrize(
    ("make", "least"),
    [
        *(pytest.param(make, 20, id=name) for name, make in QUICK.items()),
        *(pytest.param(make, 4, id=f"all {names}", marks=pytest.mark.slow) for names, make in SECTIONS),
    ],
)
def test_the_checker_does_right(make, least, tmp_path) -> None:
    """Making the probes judges what is accepted; most of them ask the checker again."""
    asked = list(make(tmp_path))
    assert len(asked) >= least
    assert [name for name, holds in asked if not holds(tools.CHECKER)] == []


# -- the adversary -----------------------------------------------------------------------------------------------------


def test_no_false_claim_is_accepted() -> None:
    """Honest certificates of the cases are, or nothing would follow from that."""
    kinds = {lines[0][1] for case in cases(20, 0) for lines in case.honest if not isinstance(case.attempt(lines), str)}
    assert kinds >= {"box", "maximal", "region"}
    outcome = run(1_000, plans=20)
    assert outcome.accepted == []
    assert sum(outcome.rejected.values()) > 950
    assert len(outcome.rejected) > 15, "the attempts fail for few reasons only"


@pytest.mark.slow
@pytest.mark.parametrize("first", range(1_000, 11_000, 1_000))
def test_no_false_claim_of_very_many_is_accepted(first) -> None:
    assert run(10_000, plans=40, first=first, seed=first).accepted == []


@pytest.mark.parametrize("check", ["imply", "lemma", "demand"])
def test_a_checker_that_believes_more_is_found_out(check, monkeypatch) -> None:
    """The adversary is no decoration: without one of the checks it gets false claims through."""
    monkeypatch.setattr(proofs.Facts if check == "imply" else proofs, check, lambda *_, **__: None)
    assert any(run(200, plans=20, seed=seed).accepted for seed in range(50))


@pytest.mark.parametrize(
    ("kind", "every"), [("maximal", 4), ("region", 1), pytest.param("maximal", 1, marks=pytest.mark.slow)]
)
def test_refutations_that_somebody_might_try(kind, every) -> None:
    """Comparisons as gates, literals that are none, clauses that are not there, contradictions out of nothing."""
    lines, ground = tools.made(tools.NAVIGATION, kind), tools.grounded(tools.NAVIGATION)
    tried = [forged for forged in adversary.named(lines) if len(forged) == len(lines)]
    changed = [next(new[0] for new, old in zip(forged, lines, strict=True) if new != old) for forged in tried]
    refuting = [forged for forged, place in zip(tried, changed, strict=True) if place == "refute"]
    assert len(refuting) > 300
    assert all(isinstance(tools.judged(forged, ground), str) for forged in refuting[::every])


def test_false_orders_leave_a_value_without_a_last_assignment() -> None:
    """All assignments come before others, by orders that contradict each other: no exception but a rejection."""
    ground = reader.ground(*TABLES["false orders"])
    formulas = Formulas(ground, tools.EPSILON)
    ends = [number for number, effects in enumerate(ground.effects) if effects]
    formulas.known.update({(a, b): tools.EPSILON for a in ends for b in ends if a != b})
    assert all(make() for _, make in formulas.obligations())


# -- changes of the checker's text -------------------------------------------------------------------------------------


def test_changes_are_of_the_checkers_text() -> None:
    """Each makes one line something else, and the tree is as before after all of them."""
    every = list(mutants("proofs"))
    assert len(every) > 400
    assert sum(mutant.before != mutant.after for mutant in every) > 0.95 * len(every)
    assert ast.unparse(every[0].tree) == ast.unparse(ast.parse(TEXTS["proofs"]))
    assert load().proofs.Rejected is not tools.CHECKER.proofs.Rejected


def test_what_is_accepted_has_a_reason_and_is_a_change_of_the_present_text() -> None:
    assert all(accepted().values())
    assert accepted().keys() <= {mutant.key for module in MODULES for mutant in mutants(module)}


def test_a_box_without_one_of_its_faces_is_not_maximal() -> None:
    """What is shown beyond the face of the larger box says nothing of the face itself, which could be added."""
    asked = list(within())
    assert len(asked) == 4
    assert all(holds(tools.CHECKER) for _, holds in asked)
    changes = (each for each in mutants("claims") if each.after.startswith("demand(away > 0, "))
    changed = next(changes).checker()
    assert not all(holds(changed) for _, holds in asked)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("module", "function", "line"),
    [
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
    ],
)
def test_a_checker_that_believes_more_is_noticed(module, function, line) -> None:
    changes = (each for each in mutants(module) if each.function == function and line in each.after)
    assert noticed_by(next(changes), probes(ASKED[module]), 60) is not None
