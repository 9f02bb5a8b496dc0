"""Commands say what was recorded: the quick ones here, all by the command of `tests.recordings.recordings`.

What they print with `--json` is also valid by its schema.
"""

import re

import pytest

from tests.cli.running import Ended, answer_of
from tests.recordings.recordings import CHECKOUT, DATA, SLOW, Place, cases, difference, in_process

OTHER = re.compile(
    r"convert-(causal-steps|parameters|json-causal-steps)|envelope-verbose|demo-tour|region-(latex|form-.*)|check-at"
    r"|pike-check-(all-text|text-kitchen)"
)
"""Several answers are right, and which one is given depends on what the solver was asked before."""
QUICK = [case for case in cases() if not (SLOW.match(case.name) or case.needs_process or OTHER.fullmatch(case.name))]


@pytest.fixture(scope="module")
def place():
    def run(words, directory, given):
        code, out, err = in_process(words, directory, given)
        if "--json" in words:
            answer_of(Ended(code, out, err))
        return code, out, err

    return Place(CHECKOUT, run)


@pytest.mark.parametrize("case", QUICK, ids=lambda case: case.name)
def test_commands_say_what_was_recorded(case, place):
    assert difference(case, place, DATA, loose=True) == ""
