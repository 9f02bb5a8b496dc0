"""`robust check`: verdicts, counterexamples as text and JSON."""

from fractions import Fraction

import pytest

from tests.cli import inputs
from tests.cli.running import answer_of, command, example


def test_proved():
    ended = command("check", *example())
    assert ended.code == 0
    assert ended.err == ""
    verdict, summary = ended.out.splitlines()
    assert verdict == "proved: the plan is valid for every schedule that its network allows"
    assert summary.startswith("29 of 29 obligations proved; ")
    assert summary.endswith("; with to_ridge = 30, to_crater = 40.")


def test_refuted_with_a_trace():
    ended = command("check", *example("plan-flexible-wait.stn"))
    assert ended.code == 1
    assert ended.out.startswith("refuted: an allowed schedule breaks drive_3 drive: over all (daylight)\n")
    assert "broken: drive_3 drive: over all (daylight)\n  at time 129: (daylight) is false\n" in ended.out
    assert "  parameters: to_ridge = 30, to_crater = 40\n" in ended.out
    rows = [line.split("   ") for line in ended.out.splitlines()]
    happenings = [[cell.strip() for cell in row if cell.strip()] for row in rows]
    assert ["time", "happens", "changes", "fluents"] in happenings
    assert happenings[-3][:3] == ["129", "@129", "− (daylight)"]
    assert happenings[-2] == ["129", "✗ violated", "drive_3 drive: over all (daylight)", "(daylight) is false"]
    assert happenings[-1][1] == "drive_3.end"


def test_quiet_is_the_verdict():
    ended = command("check", *example("plan-flexible-wait.stn"), "--quiet")
    assert ended.out == "refuted: an allowed schedule breaks drive_3 drive: over all (daylight)\n"


def test_values_of_parameters():
    assert command("check", *example(), "--at", "to_ridge=50", "--at", "to_crater=35").code == 0
    late = command("check", *example(), "--at", "to_ridge=501/10", "--at", "to_crater=30")
    assert late.code == 1
    assert "to_ridge = 50.1" in late.out
    assert command("check", *example(), "--at", "to_ridge=30:45").code == 0
    assert command("check", *example(), "--at", "to_ridge=30:45.001").code == 1


def test_all_lists_what_can_break():
    ended = command("check", *example(), "--at", "to_ridge=20:60", "--all")
    assert ended.code == 1
    assert "26 of 29 obligations proved; " in ended.out
    rows = [line.split()[0] for line in ended.out.splitlines() if line.strip()]
    assert rows.count("refuted") == 3
    assert ended.out.count("broken: ") == 1


def test_json_proved():
    answer = answer_of(command("check", *example(), "--json"))
    assert answer["verdict"] == "proved"
    assert answer["counterexample"] is None
    assert answer["epsilon"] == "1/1000"
    assert {one["verdict"] for one in answer["obligations"]} == {"proved"}
    assert answer["parameters"]["to_ridge"] == {
        "lower": "30", "upper": "30", "lower_closed": True, "upper_closed": True,
    }  # fmt: skip
    assert answer["statistics"]["unsatisfiable"] > 0


@pytest.mark.parametrize("solver", ["z3", "cvc5"])
def test_json_refuted(solver):
    ended = command("check", *example("plan-flexible-wait.stn"), "--json", "--solver", solver, "--all")
    assert (ended.code, ended.err) == (1, "")
    answer = answer_of(ended)
    assert (answer["verdict"], answer["solver"]) == ("refuted", solver)
    found = answer["counterexample"]
    assert found == answer["counterexamples"][0]
    assert found["obligation"] in {one["name"] for one in answer["obligations"] if one["verdict"] == "refuted"}
    assert found["obligation"] in {one["obligation"] for one in found["violations"]}
    schedule = {point: Fraction(time) for point, time in found["schedule"].items()}
    assert schedule["drive_1.end"] - schedule["drive_1.start"] == 30
    assert schedule["drive_2.start"] - schedule["sample_1.end"] > 16
    assert [step["time"] for step in found["trace"]] == sorted({*found["schedule"].values()}, key=Fraction)


def test_values_without_a_schedule_are_refuted_with_a_reason():
    ended = command("check", *example(), "--parameter", "to_ridge,lb=25", "--at", "to_ridge=20", "--json")
    answer = answer_of(ended)
    assert (ended.code, answer["verdict"], answer["counterexamples"]) == (1, "refuted", [])
    assert "to_ridge" in answer["reason"]
    text = command("check", *example(), "--parameter", "to_ridge,lb=25", "--at", "to_ridge=20")
    assert text.out.startswith("refuted: no schedule")


def test_parameters_beside_the_plan(tmp_path):
    toml = tmp_path / "parameters.toml"
    toml.write_text('[parameters.endurance]\nfluent = "(charge scout)"\n')
    options = ["--parameters", toml, "--parameter", "home=duration:drive_3"]
    ended = command("check", *example(), *options, "--at", "endurance=100", "--at", "home=20")
    assert ended.code == 1
    assert "(charge scout) = 100" in ended.out


def test_epsilon_is_exact(tmp_path):
    files = inputs.write(tmp_path).files  # start and end of its action are five apart, and must not coincide
    answer = answer_of(command("check", *files, "--json", "--epsilon", "5"))
    assert (answer["verdict"], answer["epsilon"]) == ("proved", "5")
    assert command("check", *files, "--epsilon", "5.0000001").code == 1


def test_queries_are_written(tmp_path):
    assert command("check", *example(), "--smt2", tmp_path / "queries").code == 0
    written = sorted((tmp_path / "queries").iterdir())
    assert written
    assert all(path.suffix == ".smt2" and "(check-sat)" in path.read_text() for path in written)


def test_verbose_logs_on_stderr():
    ended = command("check", *example(), "--verbose")
    assert ended.code == 0
    assert "robust.smt.session: " in ended.err
    assert "robust.smt" not in ended.out
