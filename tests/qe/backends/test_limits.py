"""Time limits and interruption: what is returned is an outer bound, and nothing is left running."""

import time
from pathlib import Path

import pytest

import robust.examples
from robust.plan.load import load_plan
from robust.plan.model import ParametrizedPlan
from robust.qe.compute import RegionStatus
from robust.qe.polyhedron import Polyhedron
from tests.children import interrupted_after
from tests.qe.backends.formulas import region

BACKENDS = ("project", "fourier-motzkin", "loos-weispfenning", "z3", "z3-qe", "cvc5", "cvc5-whole")


@pytest.fixture(scope="module")
def navigation() -> ParametrizedPlan:
    folder = Path(robust.examples.__file__).parent / "two_sample_navigation"
    return load_plan(folder / "domain.pddl", folder / "problem.pddl", folder / "plan.stn")


@pytest.mark.parametrize("backend", BACKENDS)
def test_no_time_at_all(navigation: ParametrizedPlan, backend: str) -> None:
    result = region(navigation, backend=backend, timeout=0)
    assert result.status is RegionStatus.TIMEOUT
    assert not result.is_exact
    assert "outer bound" in result.meaning
    assert result.pieces == 0
    assert navigation.nominal in result.region


def test_interruption_between_pieces_keeps_what_was_found(navigation: ParametrizedPlan) -> None:
    """Each piece takes something away; the region of an interrupted run contains the envelope."""
    pieces: list[Polyhedron] = []

    def stop(piece: Polyhedron) -> None:
        pieces.append(piece)
        if len(pieces) == 2:
            raise KeyboardInterrupt

    result = region(navigation, on_piece=stop)
    envelope = region(navigation)
    assert result.status is RegionStatus.INTERRUPTED
    assert result.pieces == len(pieces) == 2
    assert envelope.status is RegionStatus.COMPLETE
    assert envelope.meaning == "the robustness envelope"
    assert envelope.region.is_subset_of(result.region)
    assert not result.region.is_subset_of(envelope.region)
    assert all(piece.some_point() not in result.region for piece in pieces)


@pytest.mark.parametrize("backend", ["project", "fourier-motzkin", "z3-qe", "cvc5-whole", "loos-weispfenning"])
def test_time_limits_are_kept(dataset: Path, backend: str) -> None:
    folder = dataset / "generator-linear"
    plan = load_plan(folder / "domain.pddl", folder / "problem_07.pddl", folder / "plan_07_4.stn")
    started = time.monotonic()
    result = region(plan, backend=backend, splitting="partial", timeout=0.4)
    assert result.status is RegionStatus.TIMEOUT
    assert time.monotonic() - started < 10


# Python may drop the exception in a finaliser of a solver's objects; that it is noticed all the same is the point.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("backend", ["project", "fourier-motzkin", "loos-weispfenning", "cvc5-whole"])
def test_ctrl_c(dataset: Path, backend: str) -> None:
    folder = dataset / "generator-linear"
    plan = load_plan(folder / "domain.pddl", folder / "problem_07.pddl", folder / "plan_07_4.stn")
    started = time.monotonic()
    with interrupted_after(0.4):
        result = robust.region(plan, backend=backend, splitting="partial")
    assert result.status is RegionStatus.INTERRUPTED
    assert time.monotonic() - started < 10
