"""The factory of encodings, and what both have in common."""

from __future__ import annotations

import pytest

from robust.api import check, envelope
from robust.backends import ENCODINGS
from robust.encode import create_encoding
from robust.errors import InputError
from robust.irr.check import Answer
from robust.irr.search import Status
from robust.plan.model import Holds
from tests.plan.building import ALL, START, P, Q, action, add, plan_of

PLAN = plan_of(action("a", (START, Holds(P)), (ALL, Holds(P)), add(Q)), atoms=(P,), goal=Holds(Q))


@pytest.mark.parametrize("name", ENCODINGS)
def test_creates_the_encoding_of_that_name(name: str) -> None:
    encoding = create_encoding(name, PLAN)
    assert encoding.name == name
    assert [o.name for o in encoding.obligations] == [
        "a act: non-negative duration",
        "a act: at start c0",
        "a act: over all c1",
        "goal: goal",
    ]


def test_unknown_encodings_are_rejected() -> None:
    with pytest.raises(InputError, match="unknown encoding 'position'; did you mean 'positions'"):
        create_encoding("position", PLAN)


@pytest.mark.parametrize("name", ENCODINGS)
def test_verbs_take_the_encoding(name: str) -> None:
    assert check(PLAN, encoding=name).answer is Answer.REFUTED
    result = envelope(PLAN, encoding=name)
    assert result.encoding == name
    assert result.status is Status.INVALID
