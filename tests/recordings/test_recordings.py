"""Commands say what was recorded: the quick ones here, all by the command of `tests.recordings.recordings`."""

from pathlib import Path

import pytest

from tests.recordings.recordings import CHECKOUT, Place, cases, difference, in_process

DATA = Path(__file__).parent / "data"
GROUPS = ("help-", "check-", "convert-", "envelope-", "region-", "execute-")
OTHER_WITNESSES = {
    "check-all-positions-z3",
    "envelope-optimal-generator",
    "envelope-optimal-pour2",
    "envelope-verbose",
    "region-latex",
    "region-latex-difference",
    "region-latex-generator",
}
"""Several answers are right, and which one is given depends on what the solver was asked before."""
QUICK = [
    case
    for case in cases()
    if case.name.startswith(GROUPS) and not (case.slow or case.needs_process or case.name in OTHER_WITNESSES)
]


@pytest.fixture(scope="module")
def place() -> Place:
    return Place(CHECKOUT, in_process)


@pytest.mark.parametrize("case", QUICK, ids=lambda case: case.name)
def test_commands_say_what_was_recorded(case, place):
    if not place.can(case):
        pytest.skip("the data set is not there")
    assert difference(case, place, DATA, loose=True) == ""


def test_every_recording_is_of_a_case():
    assert {path.stem for path in DATA.iterdir()} == {case.name for case in cases()}
