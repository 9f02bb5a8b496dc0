"""A text that has everything: what it says, read by the checker and by this package, and what both refuse."""

from __future__ import annotations

import pytest

from robust.certify.checker import reader
from robust.errors import RobustError
from tests.certify import elaborate, tools
from tests.certify.test_reader import compare

ONLY_HERE = {
    "(:objects t1 -truck", "(:objects t1 - ship t1 - truck",
    "(at start (exists (?slack) (busy)))", "(at start (exists (?limit) (busy)))",
    "(when (at start (busy)) (and (at start (busy))))", "(decrease (fuel ?v) (* #t))", "(decrease (fuel ?v) #t)",
    "(decrease (fuel ?v) (* #t (rate) (rate)))", "(?limit ?y)",
    "  :synth-parameters ?much ?limit",
}  # fmt: skip
"""What this package understands, and the checker need not."""


def test_what_is_written_is_read() -> None:
    assert elaborate.said(reader.ground(*elaborate.TEXTS)) == elaborate.SAYS


@pytest.mark.filterwarnings("ignore::robust.errors.InputWarning")
@pytest.mark.parametrize("texts", [elaborate.TEXTS, elaborate.PLAIN, *elaborate.same_texts()])
def test_both_readers_read_the_same(texts) -> None:
    compare(tools.assembled(texts), reader.ground(*texts))


@pytest.mark.parametrize(("name", "holds"), list(elaborate.probes()))
def test_other_ways_to_say_it_and_what_is_wrong(name, holds) -> None:
    assert holds(tools.CHECKER), name


@pytest.mark.filterwarnings("ignore::robust.errors.InputWarning")
def test_this_package_refuses_what_is_wrong_too() -> None:
    understood = set()
    for old, every in elaborate.WRONG.items():
        for new in every:
            try:
                tools.assembled(elaborate.texts_with(old, new))
            except RobustError:
                continue
            understood.add(new)
    assert understood == ONLY_HERE
