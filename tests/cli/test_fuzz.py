"""Whatever is in the files: the library raises nothing but its own errors."""

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from robust import RobustError, load_plan
from tests.cli import inputs
from tests.cli.running import NAVIGATION

TEXTS = [
    (inputs.DOMAIN, inputs.PROBLEM, inputs.PLAN),
    tuple((NAVIGATION / name).read_text() for name in ("domain.pddl", "problem.pddl", "plan.stn")),
]
QUICK = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
TOKENS = [
    "(",
    ")",
    ";",
    "and",
    "not",
    "?x",
    "- a",
    "1e999",
    "1/0",
    "in [",
    "inf",
    "#t",
    ":",
    "default",
    "\0",
    "é",
    "c:",
]


def load(directory: Path, files: list[bytes]) -> None:
    paths = [directory / name for name in ("domain.pddl", "problem.pddl", "plan.stn")]
    for path, content in zip(paths, files, strict=True):
        path.write_bytes(content)
    try:
        load_plan(*paths)
    except RobustError as error:
        message = str(error)
    else:
        return
    assert message
    assert "\n" not in message


def encoded(texts: tuple[str, ...]) -> list[bytes]:
    return [text.encode() for text in texts]


@pytest.mark.parametrize("which", [0, 1, 2])
@given(noise=st.binary(max_size=200))
@QUICK
def test_random_bytes(tmp_path, which, noise):
    files = encoded(TEXTS[0])
    files[which] = noise
    load(tmp_path, files)


@pytest.mark.parametrize("which", [0, 1, 2])
@given(data=st.data())
@QUICK
def test_truncated(tmp_path, which, data):
    files = encoded(data.draw(st.sampled_from(TEXTS)))
    files[which] = files[which][: data.draw(st.integers(0, len(files[which])))]
    load(tmp_path, files)


@pytest.mark.parametrize("which", [0, 1, 2])
@given(data=st.data())
@QUICK
def test_words_replaced(tmp_path, which, data):
    texts = list(data.draw(st.sampled_from(TEXTS)))
    words = texts[which].split(" ")
    for _ in range(data.draw(st.integers(1, 3))):
        place = data.draw(st.integers(0, len(words) - 1))
        words[place] = data.draw(st.sampled_from([*TOKENS, *words]))
    texts[which] = " ".join(words)
    load(tmp_path, encoded(tuple(texts)))
