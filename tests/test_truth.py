"""No answer has a truth value: `assert robust.validate(...)` would pass whatever comes of it."""

import inspect
import pkgutil
from enum import Enum
from functools import cache
from importlib import import_module

import pytest

import robust
from robust import pike, stnu
from robust.presented import NoTruthValue, VerdictEnum
from tests.cli.running import example

TELLING = {
    "agree",
    "answer",
    "ending",
    "exit_code",
    "is_controllable",
    "obstacle",
    "outcome",
    "status",
    "valid",
    "verdict",
}
"""What attributes are called that say what came of a question."""
NO_ANSWERS = """About AssignmentKind Below Case Cause Changeable Comparator Control Guarantee Human Kind Means Mode
MomentSide NodeKind Operator Pace Phase Relation Role Sense Side Stage Subject Target TeamParameterKind Temporal
TimePointKind Timing Update Way"""
"""Enumerations that answer no question."""


@cache
def classes(kind: type) -> list[type]:
    """All of that kind that the package declares, but for the checker, which imports nothing of it."""
    names = [module.name for module in pkgutil.walk_packages(robust.__path__, "robust.")]
    wanted = [name for name in names if "__main__" not in name and not name.startswith("robust.certify.checker")]
    found = {value for name in wanted for _, value in inspect.getmembers(import_module(name), inspect.isclass)}
    return sorted((each for each in found if each.__module__.startswith("robust.") and issubclass(each, kind)), key=str)


@pytest.mark.parametrize("result", classes(NoTruthValue), ids=lambda result: result.__qualname__)
def test_results_have_no_truth_value_and_name_what_has(result):
    if inspect.isabstract(result) or "_ask" not in dir(result):  # what results inherit from
        return
    assert hasattr(result, result._ask) or result._ask in result.__annotations__
    with pytest.raises(TypeError, match=rf"^{result.__name__} has no truth value: ask \.{result._ask}, or "):
        bool(object.__new__(result))


@pytest.mark.parametrize("kind", classes(Enum), ids=lambda kind: kind.__qualname__)
def test_answers_have_no_truth_value(kind):
    assert issubclass(kind, VerdictEnum) is (kind.__name__ not in NO_ANSWERS.split())
    for member in kind if issubclass(kind, VerdictEnum) else ():
        with pytest.raises(TypeError, match=rf"^{member} has no truth value: ask whether it `is {kind.__name__}\."):
            bool(member)


def test_whatever_says_what_came_of_a_question_is_a_result():
    values = [getattr(package, name) for package in (robust, pike, stnu) for name in package.__all__]
    public = {value for value in values if isinstance(value, type)}
    telling = {kind for kind in public if TELLING & {*vars(kind), *vars(kind).get("__annotations__", ())}}
    assert {kind for kind in telling if not issubclass(kind, NoTruthValue | Exception)} == set()
    assert len(telling) > 15


def test_what_is_no_answer_has_a_truth_value():
    checked = robust.check(example())
    assert checked.box
    assert list(filter(None, checked.obligations)) == list(checked.obligations)
    with pytest.raises(TypeError, match=r"^CheckResult has no truth value: ask \.answer, or whether it `is None`$"):
        assert checked
