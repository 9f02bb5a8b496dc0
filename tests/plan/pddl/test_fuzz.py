"""Whatever the text, the reader answers with a domain, a problem or an error with a place; never with a traceback."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robust.errors import RobustError
from robust.plan.pddl.forms import read_text
from robust.plan.pddl.grounding import ground_action, ground_goal
from robust.plan.pddl.reader import parse_domain, parse_problem
from tests.plan.pddl.sources import DOMAIN, PROBLEM

TOKENS = re.compile(r"[()]|[^\s()]+")
VALID = parse_domain(DOMAIN)


def read(domain_text: str, problem_text: str) -> None:
    """Read and ground; an error of the package, in one line, is an answer too."""
    message = "expected"
    try:
        domain = parse_domain(domain_text)
        problem = parse_problem(problem_text, domain)
        for name, schema in domain.actions.items():
            arguments = ["r1", "a", "b"] if name == "move" else ["a"]
            ground_action(domain, problem, "n0", name, arguments, schema.durative, None)
        ground_goal(domain, problem)
    except RobustError as error:
        message = str(error)
    assert "expected" in message
    assert "\n" not in message


def words(text: str) -> list[str]:
    return TOKENS.findall(re.sub(";.*", "", text))


@st.composite
def mutations(draw: st.DrawFn, text: str) -> str:
    """The text with a few words deleted, doubled, exchanged or replaced by others of it."""
    tokens = words(text)
    for _ in range(draw(st.integers(1, 3))):
        first = draw(st.integers(0, len(tokens) - 2))
        second = draw(st.integers(0, len(tokens) - 2))
        kind = draw(st.sampled_from(["delete", "double", "swap", "replace"]))
        if kind == "delete":
            del tokens[first]
        elif kind == "double":
            tokens.insert(first, tokens[first])
        elif kind == "swap":
            tokens[first], tokens[second] = tokens[second], tokens[first]
        else:
            tokens[first] = tokens[second]
    return " ".join(tokens)


def test_the_unchanged_texts_are_valid() -> None:
    domain = parse_domain(" ".join(words(DOMAIN)))
    problem = parse_problem(" ".join(words(PROBLEM)), domain)
    instance = ground_action(domain, problem, "n0", "move", ["r1", "a", "b"], True, None)
    assert instance.conditions
    assert ground_goal(domain, problem)


@given(mutations(DOMAIN))
def test_mutated_domain(text: str) -> None:
    read(text, PROBLEM)


@given(mutations(PROBLEM))
def test_mutated_problem(text: str) -> None:
    read(DOMAIN, text)


@given(st.integers(0, len(DOMAIN)), st.integers(0, len(PROBLEM)))
def test_truncated(domain_length: int, problem_length: int) -> None:
    read(DOMAIN[:domain_length], PROBLEM)
    read(DOMAIN, PROBLEM[:problem_length])


@given(st.text())
def test_random_text(text: str) -> None:
    read(text, text)
    read(DOMAIN, text)


@given(st.lists(st.sampled_from(sorted(set(words(DOMAIN + PROBLEM)))), max_size=40))
def test_random_words(tokens: list[str]) -> None:
    text = " ".join(tokens)
    read(f"(define (domain everything) {text})", PROBLEM)
    read(DOMAIN, f"(define (problem p) (:domain everything) (:init {text}) (:goal {text}))")


@given(data=st.binary())
def test_random_bytes(tmp_path_factory, data: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "random.pddl"
    path.write_bytes(data)
    with pytest.raises(RobustError) as caught:  # no random bytes are a domain
        parse_domain(read_text(path), str(path))
    assert str(caught.value).startswith(str(path))
