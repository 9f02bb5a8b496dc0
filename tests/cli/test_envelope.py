"""`robust envelope`: boxes as text and JSON."""

from fractions import Fraction

import pytest

from tests.cli import inputs
from tests.cli.running import EXAMPLES, answer_of, command, example


def cells(text):
    return [[cell.strip() for cell in line.split("   ") if cell.strip()] for line in text.splitlines()]


def test_table():
    ended = command("envelope", *example(), "--method", "irr", "--beta", "1/10")
    assert (ended.code, ended.err) == (0, "")
    head, rule, *rows, blank, status = cells(ended.out)
    assert head == ["parameter", "nominal", "lower", "upper", "may fall by", "may rise by"]
    assert set(rule[0]) == {"─"}
    assert rows == [["to_ridge", "30", "30", "45", "0", "15"], ["to_crater", "40", "30", "40", "10", "0"]]
    assert blank == []
    assert status[0].startswith("complete: no end can move outwards by 0.1 or more; ")
    assert "first widening after" in status[0]


def test_quiet_is_the_table():
    ended = command("envelope", *example(), "--quiet")
    assert len(ended.out.splitlines()) == 4


def test_json_is_what_scripts_rely_on():
    ended = command("envelope", *example(), "--method", "irr", "--json")
    assert (ended.code, ended.err) == (0, "")
    answer = answer_of(ended)
    fixed = {"schema": "robust/envelope/1", "status": "complete", "method": "irr", "encoding": "relational"}
    assert {name: answer[name] for name in fixed} == fixed
    assert (answer["solver"], answer["beta"], answer["verified"]) == ("z3", "1", True)
    assert list(answer["parameters"]) == ["to_ridge", "to_crater"]
    assert answer["parameters"]["to_ridge"] == {
        "nominal": "30", "lower": "30", "upper": "45", "lower_closed": True, "upper_closed": True,
    }  # fmt: skip
    assert answer["checks"] > 0
    assert 0 < answer["first_widening_s"] <= answer["seconds"]
    assert answer["reason"] is None
    assert answer["convergence"][-1]["share"] == 1
    assert len(answer["convergence"]) == answer["checks"]


@pytest.mark.parametrize("options", [["--doubling"], ["--solver", "cvc5"], ["--beta", "0.5"]])
def test_options_reach_the_search(options):
    answer = answer_of(command("envelope", *example(), "--method", "irr", "--json", *options))
    assert answer["status"] == "complete"
    assert answer["beta"] == ("1/2" if "--beta" in options else "1")
    assert answer["solver"] == ("cvc5" if "--solver" in options else "z3")


def test_order_of_turns():
    ended = command("envelope", *example(), "--method", "irr", "--verbose", "--order", "to_crater")
    assert "check 1: to_crater upper" in ended.err


def test_doubling_promises_less():
    assert (
        "no end can move outwards by 2 or more" in command("envelope", *example(), "--method", "irr", "--doubling").out
    )


def test_rationals_stay_exact():
    answer = answer_of(
        command("envelope", *example(directory=EXAMPLES / "generator"), "--method", "irr", "--json", "--beta", "1/7")
    )
    ends = [Fraction(one[side]) for one in answer["parameters"].values() for side in ("lower", "upper")]
    assert any(end.denominator > 1 for end in ends)
    assert answer["beta"] == "1/7"


def test_unbounded_ends(tmp_path):
    plan = inputs.PLAN.replace(" lb 0 ub 9", "")
    files = inputs.write(tmp_path, plan=plan).files
    answer = answer_of(command("envelope", *files, "--json"))
    assert answer["parameters"]["leave"] == {
        "nominal": "2", "lower": "0", "upper": "inf", "lower_closed": True, "upper_closed": False,
    }  # fmt: skip
    assert answer["convergence"] == []
    row = cells(command("envelope", *files).out)[2]
    assert row == ["leave", "2", "0", "∞", "2", "∞"]


def test_invalid_shows_why():
    ended = command("envelope", *example("plan-flexible-wait.stn"))
    assert (ended.code, ended.err) == (1, "")
    assert ended.out.startswith(
        "invalid: the plan can fail at the nominal values: drive_3 drive: over all (daylight)\n"
        "broken: drive_3 drive: over all (daylight)\n  at time 129: (daylight) is false\n"
    )
    quiet = command("envelope", *example("plan-flexible-wait.stn"), "--quiet")
    assert len(quiet.out.splitlines()) == 1


def test_invalid_in_json():
    ended = command("envelope", *example("plan-flexible-wait.stn"), "--json")
    answer = answer_of(ended)
    assert (ended.code, answer["status"], answer["verified"]) == (1, "invalid", False)
    assert answer["reason"] == answer["counterexample"]["obligation"] == "drive_3 drive: over all (daylight)"
    assert answer["values"] == {"to_ridge": "30", "to_crater": "40"}


def test_plan_without_parameters(tmp_path):
    plan = inputs.PLAN.replace("parameter leave default 2 lb 0 ub 9;\n", "").replace("leave", "2")
    files = inputs.write(tmp_path, plan=plan).files
    assert "has no parameters that could vary" in command("envelope", *files).out
    answer = answer_of(command("envelope", *files, "--json"))
    assert (answer["status"], answer["parameters"]) == ("complete", {})
    drawn = command("envelope", *files, "--plot", tmp_path / "box.svg")
    assert drawn.code == 0


def test_parameters_beside_the_plan():
    answer = answer_of(command("envelope", *example(), "--json", "--parameter", "home=duration:drive_3,ub=21"))
    assert list(answer["parameters"]) == ["to_ridge", "to_crater", "home"]
    assert Fraction(answer["parameters"]["home"]["upper"]) <= 21


def test_error_as_json(tmp_path):
    domain, problem, _ = inputs.write(tmp_path).files
    for verb in ("check", "envelope"):
        ended = command(verb, domain, problem, tmp_path / "none.stn", "--json")
        answer = answer_of(ended, "robust/error/1")
        error = answer["error"]
        assert (ended.code, error["kind"], error["exit_code"], error["line"]) == (2, "input", 2, None)
        assert error["file"].endswith("none.stn")
        assert ended.err.count("\n") == 1


def test_place_of_an_error_as_json(tmp_path):
    files = inputs.write(tmp_path, plan=inputs.PLAN.replace("[5, 5]", "[6, 5]")).files
    error = answer_of(command("check", *files, "--json"))["error"]
    assert (error["file"], error["line"], error["column"]) == (str(files[2]), 4, 24)
    assert error["message"].startswith("found lower bound 6")


def test_wrong_usage_as_json():
    ended = command("check", "--json")
    answer = answer_of(ended, "robust/error/1")
    assert (ended.code, answer["error"]["kind"]) == (2, "usage")


# -- the exact methods -----------------------------------------------------------------------------------------------


def ends_of(answer):
    return {name: (one["lower"], one["upper"]) for name, one in answer["parameters"].items()}


def test_widening_is_the_default():
    ended = command("envelope", *example())
    assert (ended.code, ended.err) == (0, "")
    _, _, *rows, _, status = cells(ended.out)
    assert rows == [["to_ridge", "30", "25", "36", "5", "6"], ["to_crater", "40", "35", "46", "5", "6"]]
    assert status[0].startswith("complete: no valid box contains this one; ")
    answer = answer_of(command("envelope", *example(), "--json"))
    assert (answer["method"], answer["beta"], answer["bound"]) == ("widen", None, None)
    assert ends_of(answer) == {"to_ridge": ("25", "36"), "to_crater": ("35", "46")}


@pytest.mark.parametrize("options", [[], ["--contain-nominal"]])
def test_optimal(options):
    answer = answer_of(command("envelope", *example(), "--method", "optimal", "--json", *options))
    assert (answer["status"], answer["beta"], answer["bound"]) == ("complete", None, "25")
    ended = command("envelope", *example(), "--method", "optimal", *options)
    where = "around the nominal values" if options else "in the envelope"
    assert f"complete: no box {where} is wider: total width 25; " in ended.out


def test_order_of_widening():
    answer = answer_of(command("envelope", *example(), "--order", "to_crater", "--json"))
    assert ends_of(answer) == {"to_ridge": ("30", "30"), "to_crater": ("30", "49")}


def test_encodings_agree():
    found = [answer_of(command("envelope", *example(), "--json", "--encoding", e)) for e in ("relational", "positions")]
    assert [one["encoding"] for one in found] == ["relational", "positions"]
    assert ends_of(found[0]) == ends_of(found[1])


def test_open_ends_are_shown(tmp_path):
    domain = inputs.DOMAIN.replace("(>= (fuel) 1)", "(> (fuel) 1)")
    files = inputs.write(tmp_path, domain=domain).files
    options = ["--parameter", "fluent:(fuel)"]
    row = cells(command("envelope", *files, *options).out)[3]
    assert row == ["fuel", "3", "> 1", "∞", "< 2", "∞"]
    answer = answer_of(command("envelope", *files, *options, "--json"))
    assert answer["parameters"]["fuel"] == {
        "nominal": "3", "lower": "1", "upper": "inf", "lower_closed": False, "upper_closed": False,
    }  # fmt: skip
