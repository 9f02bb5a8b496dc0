"""How values of options are read and options are spelled, without the command line around them."""

from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import pytest

from robust.errors import InputError, Location
from robust.numbers import EXPECTED_NUMBER, exact
from robust.options.batch import CertifyCommand, ExecuteCommand, plan_file
from robust.options.declare import (
    as_typed,
    names,
    not_negative,
    place_of,
    plot_file,
    positive,
    seconds,
    settings,
    spelled,
    writable,
)
from robust.options.verbs import EnvelopeOptions, RegionCommand
from robust.qe.box import Interval

PLACE = Location("beta")


def test_messages_spell_options_as_they_were_typed():
    assert spelled("time_limit") == "time_limit"
    with as_typed(["time_limit"]):
        assert spelled("time_limit") == "--time-limit"
        assert place_of("time_limit") == Location("--time-limit")
        assert place_of("time_limit", "soon") == Location("--time-limit 'soon'")
    assert spelled("time_limit") == "time_limit"


@pytest.mark.parametrize(
    ("value", "number"),
    [(3, 3), (Fraction(1, 3), Fraction(1, 3)), ("0.1", Fraction(1, 10)), (0.1, Fraction(1, 10)), (Decimal("1E2"), 100)],
)
def test_numbers_are_exact(value, number):
    assert exact(value, PLACE) == number
    assert isinstance(exact(value, PLACE), Fraction)
    assert positive(value, PLACE) == number


@pytest.mark.parametrize("value", [True, None, [1], "one"])
def test_what_is_no_number_is_refused(value):
    with pytest.raises(InputError, match=r"^beta: found .*, expected"):
        exact(value, PLACE)


@pytest.mark.parametrize("value", [0, -1, "-1/2"])
def test_not_positive(value):
    with pytest.raises(InputError, match=f"^beta: found '{value}', expected a number above 0"):
        positive(value, PLACE)


def test_plot_files(tmp_path):
    for name in ("a.svg", "a.PNG", "a.pdf"):
        assert plot_file(str(tmp_path / name), PLACE) == tmp_path / name
    with pytest.raises(InputError, match=r"^beta: found .*, expected a name that ends in \.svg, \.png, \.pdf"):
        plot_file(tmp_path / "a.txt", PLACE)
    with pytest.raises(InputError, match=r"^beta: found no directory .*, expected one to write the plot to"):
        plot_file(tmp_path / "none" / "a.svg", PLACE)
    (tmp_path / "d.svg").mkdir()
    with pytest.raises(InputError, match=r"^beta: cannot write .*, expected a file that can be written"):
        plot_file(tmp_path / "d.svg", PLACE)


def test_settings_of_parameters():
    both = {"k": Interval(Fraction(1), None, upper_closed=False), "m": Fraction(1, 2)}
    expected = {**both, "m": Interval(Fraction(1, 2), Fraction(1, 2))}
    assert settings(both, ["k", "m"]) == settings({**both, "m": "0.5"}, ["k", "m"]) == expected
    assert settings([" k = 1 : +inf ", "m=1/2"], ["k", "m"]) == settings(["m=1/2", "k=1:inf"], ["k", "m"]) == expected
    assert settings(["k=-inf:2"], ["k"]) == {"k": Interval(None, Fraction(2), lower_closed=False)}
    assert settings(["k=2:2"], ["k"]) == {"k": Interval(Fraction(2), Fraction(2))}


def region(**options):
    return RegionCommand(domain=Path(), problem=Path(), plan=Path(), **options)


def execute(**options):
    return ExecuteCommand(domain=Path(), problem=Path(), **options)


def certify(files, **options):
    return CertifyCommand(files=[Path()] * files, output=Path("plan.cert"), **options)


ORDER = "expected LOW:HIGH with LOW not above HIGH"


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: exact([1], PLACE), f"beta: found '[1]', expected {EXPECTED_NUMBER}"),
        (lambda: not_negative(Fraction(-1, 2), PLACE), "beta: found '-1/2', expected a number of at least 0"),
        (lambda: not_negative("x", PLACE), f"beta: found 'x', expected {EXPECTED_NUMBER}"),
        (lambda: seconds("0", PLACE), "beta: found '0', expected a number above 0"),
        (lambda: names("a,,b", PLACE), "beta: found 'a,,b', expected names such as a,b,c"),
        (lambda: settings({"k": "x"}, ["k"]), f"at 'k': found 'x', expected {EXPECTED_NUMBER}"),
        (lambda: settings({"kk": 1}, ["k"]), "unknown parameter 'kk'; did you mean 'k'?"),
        (lambda: settings(["k"], ["k"]), "at 'k': found 'k', expected NAME=VALUE or NAME=LOW:HIGH"),
        (lambda: settings(["kk=1"], ["k"]), "at 'kk=1': found unknown parameter 'kk'; did you mean 'k'?"),
        (lambda: settings(["k=1", "k=2"], ["k"]), "at 'k=2': found a second value for 'k', expected one"),
        (lambda: settings(["k=x"], ["k"]), f"at 'k=x': found 'x', expected {EXPECTED_NUMBER}"),
        (lambda: settings(["k=x:1"], ["k"]), f"at 'k=x:1': found 'x', expected {EXPECTED_NUMBER}"),
        (lambda: settings(["k=1:x"], ["k"]), f"at 'k=1:x': found 'x', expected {EXPECTED_NUMBER}"),
        (
            lambda: settings(["k=:1"], ["k"]),
            f"at 'k=:1': found an empty end of an interval, expected {EXPECTED_NUMBER}, inf or -inf",
        ),
        (lambda: settings(["k=2:1"], ["k"]), f"at 'k=2:1': found '2:1', {ORDER}"),
        (lambda: settings(["k=inf:1"], ["k"]), f"at 'k=inf:1': found 'inf:1', {ORDER}"),
        (lambda: settings(["k=+inf:1"], ["k"]), f"at 'k=+inf:1': found '+inf:1', {ORDER}"),
        (lambda: settings(["k=1:-inf"], ["k"]), f"at 'k=1:-inf': found '1:-inf', {ORDER}"),
        (
            lambda: plan_file(Path("a.toml"), PLACE),
            "beta: found 'a.toml', expected a plan's name: parameters go to .toml files",
        ),
        (
            lambda: plan_file(Path("none/a.stn"), PLACE),
            "beta: found no directory 'none', expected one to write the plan to",
        ),
        (lambda: writable(Path("/"), PLACE, "it"), "beta: cannot write '/', expected a file that can be written"),
        (lambda: region(latex=True, json=True), "--latex: cannot be combined with --json; choose one"),
        (lambda: execute(plan=Path(), runs=0), "runs: found 0, expected at least 1 run"),
        (lambda: execute(plan=Path(), replans=-1), "replans: found -1, expected at least 0 re-plans"),
        (execute, "give PLAN or --planner: without either there is no plan to execute"),
        (
            lambda: certify(1, alethe=Path()),
            "found --alethe with a plan with choices; expected it with DOMAIN PROBLEM PLAN",
        ),
        (lambda: certify(1, kind="box"), "found --kind box with a plan with choices; expected execution or knowledge"),
        (
            lambda: certify(3, assume=("a=b",)),
            "found --assume with DOMAIN PROBLEM PLAN; expected it with a plan with choices",
        ),
        (
            lambda: certify(3, kind="knowledge"),
            "found --kind knowledge with DOMAIN PROBLEM PLAN; expected it with a plan with choices",
        ),
        (lambda: certify(3, box=Path()), "found --box with --kind plan; expected it with box or maximal"),
        (
            lambda: certify(2, box=Path(), kind="region"),
            "found --box with --kind region; expected it with box or maximal",
        ),
        (
            lambda: certify(3, alethe=Path(), kind="region"),
            "found --alethe with --kind region; expected it with plan, box or maximal",
        ),
        (
            lambda: EnvelopeOptions(method="optimal", order=["k"]),
            "order: found it with method='optimal', expected method='widen' or 'irr', or no order",
        ),
        (lambda: EnvelopeOptions(solver="z4"), "unknown solver 'z4'; known are cvc5, z3"),
        (lambda: EnvelopeOptions(timeout=-1), "timeout: found '-1', expected a number of at least 0"),
    ],
)
def test_what_is_wrong_is_said_in_full(make, message):
    with pytest.raises(InputError) as error:
        make()
    assert str(error.value) == message


def test_what_belongs_together_is_accepted():
    assert region(latex=True).latex
    assert region(json=True, timeout=0).limit == 0
    assert (execute(planner="aries", runs=1, replans=0).runs, execute(plan=Path()).plan) == (1, Path())
    assert certify(1, kind="execution").kind == "execution"
    assert certify(3, box=Path(), kind="maximal").box == Path()
    assert certify(3, alethe=Path(), kind="maximal").alethe == Path()
    assert EnvelopeOptions(method="irr", order="a, b", beta="1/2", timeout=2e9).order == ("a", "b")


def test_files_can_be_written_in_place_of_old_ones(tmp_path):
    old = tmp_path / "old.stn"
    old.touch()
    assert [plan_file(path, PLACE) for path in (old, tmp_path / "new.stn")] == [old, tmp_path / "new.stn"]
    assert writable(old, PLACE, "the page") == old
