"""Questions about plans, executions and the tour: what the recorded answers do not show; and files of any kind."""

import re
import shlex
import sys
import time
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import robust
from benchmarks.generators.sizes import write_instance
from robust import Box, Interval, Region, stnu
from robust.irr.repair import RepairSearch
from robust.qe.inner import FactorSearch
from robust.qe.polyhedron import Polyhedron
from robust.smt.limits import OutOfTimeError
from tests.cli import inputs
from tests.cli.running import EXAMPLES, NAVIGATION, answer_of, command, example
from tests.sampling import often

FINE, LATE = (inputs.INPUTS / "networks" / f"{name}.json" for name in ("fine", "late"))
FLEXIBLE = example("plan-flexible-wait.stn")
GENERATOR = example(directory=EXAMPLES / "generator")
KINDS = ("--distribution", "to_ridge=normal::5", "--distribution", "to_crater=normal:40:5")


def late(*_arguments, **_options):
    raise OutOfTimeError


@pytest.mark.parametrize("solver", ["z3", "cvc5"])
def test_a_counterexample_breaks_the_plan_and_leaves_out_constants(solver):
    ended = command("check", *FLEXIBLE, "--json", "--solver", solver, "--all")
    answer = answer_of(ended)
    assert (ended.code, ended.err, answer["verdict"], answer["solver"]) == (1, "", "refuted", solver)
    counterexample = answer["counterexample"]
    assert counterexample == answer["counterexamples"][0]
    refuted = {entry["name"] for entry in answer["obligations"] if entry["verdict"] == "refuted"}
    assert counterexample["obligation"] in refuted & {entry["obligation"] for entry in counterexample["violations"]}
    schedule = {point: Fraction(time) for point, time in counterexample["schedule"].items()}
    drives = ("drive_1", "drive_2", "drive_3", "sample_1", "sample_2")
    assert schedule.keys() == {f"{name}.{end}" for name in drives for end in ("start", "end")}
    assert schedule["drive_1.end"] - schedule["drive_1.start"] == 30
    assert schedule["drive_2.start"] - schedule["sample_1.end"] > 16
    assert {*counterexample["schedule"].values()} <= {step["time"] for step in counterexample["trace"]}
    assert {fluent for step in counterexample["trace"] for fluent in step["fluents"]} == {"(charge scout)"}


def test_a_repair_out_of_time_costs_no_refutation(monkeypatch):
    monkeypatch.setattr(RepairSearch, "best_known", late)
    ended = command("repair", *FLEXIBLE)
    assert ended.code == 3
    assert ended.out.startswith("unknown: out of time, no repair found; none costs less than cost 0")
    answer = answer_of(command("repair", *FLEXIBLE, "--json"), "robust/repair/1")
    assert (answer["status"], answer["repair"], answer["bound"]) == ("timeout", "unknown", {"counted": 0, "total": "0"})
    ended = command("check", *FLEXIBLE, "--json")
    assert (ended.code, answer_of(ended)["repair"]) == (1, None)


def test_searches_in_python_need_a_nominal_value_where_commands_do(tmp_path):
    right = inputs.write(tmp_path)
    exact = robust.region(right).region
    bare = inputs.write(tmp_path, plan=inputs.PLAN.replace(" default 2", ""))
    plan = robust.load_plan(*bare, nominal_needed=False)
    assert str(robust.region(plan).region) == str(exact)
    assert robust.envelope(plan, method="optimal").box["leave"] == Interval(Fraction(0), Fraction(9))
    for ask in (robust.check, robust.envelope, robust.compare):
        with pytest.raises(robust.InputError, match="--parameter leave,default=VALUE"):
            ask(plan)


def test_convergence_ends_at_the_final_box_and_the_most_probable_one():
    answer = answer_of(command("envelope", *example(), "--method", "irr", "--json"))
    assert 0 < answer["first_widening_s"] <= answer["seconds"]
    assert (answer["convergence"][-1]["share"], len(answer["convergence"])) == (1, answer["checks"])
    answer = answer_of(command("envelope", *example(), *KINDS, "--method", "risk", "--json"), "robust/envelope/1")
    assert 0.5383 < float(answer["probability"]["lower"]) <= Fraction(answer["bound"]) < 0.5434
    assert all("take-sample" in ends["stopped_below"] for ends in answer["parameters"].values())


def test_bounds_of_the_risk_and_its_picture(tmp_path):
    """0.85888 is the integral of the two densities over the envelope."""
    answer = answer_of(command("risk", *example(), *KINDS, "--json", "--draws", "500", "--plot", tmp_path / "risk.svg"))
    low, high = (float(answer["probability"][end]) for end in ("lower", "upper"))
    assert low <= 0.85888 <= high <= low + 0.001
    assert answer["distributions"] == {"to_ridge": "normal:30:5", "to_crater": "normal:40:5"}
    assert answer["box"] == answer["boxes"][1]
    assert [box["method"] for box in answer["boxes"]] == ["irr", "widen", "optimal"]
    assert (answer["estimate"]["draws"], answer["estimate"]["confidence"]) == (500, "999/1000")
    assert any("lit crater" in entry["obligation"] for entry in answer["by_obligation"])
    assert "take-sample scout crater needs" in (tmp_path / "risk.svg").read_text(encoding="utf-8")
    kinds = ("--distribution", "to_ridge=constant", "--distribution", "to_crater=uniform:20:60")
    ended = command("risk", *example(), *kinds, "--plot", tmp_path / "bars.png", "-q")
    assert (ended.code, ended.out) == (0, "probability of success: 0.4750\n")
    assert (tmp_path / "bars.png").stat().st_size > 1000
    ended = command("risk", *example(), *KINDS, "--timeout", "0.01", "--within", "1e-9", "--json")
    probability = answer_of(ended).get("probability", {"lower": "0", "upper": "1"})
    assert float(probability["lower"]) <= 0.85888 <= float(probability["upper"])
    assert ended.code == 3


def test_outer_bounds_are_said_to_be_bounds_and_many_pieces_stay_a_difference():
    answer, interval = robust.region(example()), Interval(Fraction(1), Fraction(2))
    none, all_values, box = Region.nothing, Region.universe, Region.of_box(("a",), Box({"a": interval}))
    for region, exact, outer in (
        (none(("a",)), "The plan is valid for no parameter values.", ""),
        (all_values(("a",)), "The plan is valid for all parameter values.", "No parameter values are known by now for"),
        (all_values(()), "The plan is valid; it has no parameters.", "Whether the plan is valid is not known; it has"),
        (none(()), "The plan is not valid; it has no parameters.", ""),
        (box, "The plan is valid if and only if\n  1 ≤ a ≤ 2\n", "The plan can be valid only if\n  1 ≤ a ≤ 2\n"),
    ):
        other = replace(answer, region=region, factors=(), plan=None)
        assert str(other).startswith(exact)
        assert str(replace(other, status=robust.Status.TIMEOUT)).startswith(outer)
    for count, form in (1, "union"), (40, "difference"):
        ends = [Interval(Fraction(i), Fraction(i)) for i in range(count)]
        holes = [Polyhedron.of_box(("a", "b"), Box({"a": end, "b": end})) for end in ends]
        region = Region.difference(Polyhedron.universe(("a", "b")), holes)
        assert replace(answer, region=region, factors=(), plan=None).as_dict()["form"] == form


@pytest.mark.parametrize(
    ("name", "ascending"), [("generator", [["start_1", "start_2"]]), ("two_sample_navigation", [])]
)
def test_both_bounds_are_shown_where_a_search_is_cut(monkeypatch, tmp_path, name, ascending):
    """After one good cell and the bad pieces that were found on the way."""

    def run(self):
        if not self.done:
            self.grow()
        raise OutOfTimeError

    monkeypatch.setattr(FactorSearch, "run", run)
    files, plot = example(directory=EXAMPLES / name), tmp_path / "region.svg"
    ended = command("region", *files, "--json", "--plot", plot)
    answer = answer_of(ended)
    assert (ended.code, answer["status"]) == (3, "timeout")
    assert answer["meaning"].startswith("an outer bound of the robustness envelope")
    (factor,) = answer["factors"]
    assert (factor["ascending"], len(factor["inner"])) == (ascending, 1)
    share = answer["open_share"]
    assert share["lower"] == share["value"] == share["upper"]
    assert share["confidence"] is None
    assert 0 <= Fraction(share["value"]) < 1
    assert "proved valid" in plot.read_text()
    text = command("region", *files).out
    assert "The plan is certain to be valid if all lines of one of these groups hold" in text
    assert "proved valid: 1 polyhedron; open: " in text
    assert ("which are interchangeable" in text) == bool(ascending)


def test_long_regions_are_told_in_ascending_order(tmp_path):
    files = write_instance(tmp_path, 4, 4)
    text = command("region", *files).out
    assert text.startswith("In ascending order of start_1, start_2, start_3, start_4, which are interchangeable:\n")
    assert "  40 ≤ start_2 ≤ 86\n" in text
    answer = answer_of(command("region", *files, "--json"))
    assert len(answer["minus"]) == 22
    (factor,) = answer["factors"]
    assert (factor["inner"], factor["outer"]["minus"], answer["open_share"]) == (None, [], None)


@pytest.mark.parametrize("files", [example(), GENERATOR], ids=["navigation", "generator"])
def test_gaps_and_witnesses(files):
    plan = robust.load_plan(*files)
    for box in answer_of(command("compare", *files, "--json", "--beta", "2"))["boxes"]:
        assert len(box["faces"]) == 4
        for face in box["faces"]:
            gap = Fraction(face["gap"])
            assert gap < 2 if box["method"] == "irr" else gap == 0
            point = {name: Fraction(value) for name, value in face["witness"]["parameters"].items()}
            beyond = point[face["parameter"]] - Fraction(face["end"])
            assert 0 < (beyond if face["side"] == "upper" else -beyond) <= gap + Fraction(1, 1000)
            result = robust.check(plan, at=point, every=True)
            assert result.answer is robust.Answer.REFUTED
            assert result.obligations[face["witness"]["obligation"]] is robust.Answer.REFUTED


def test_pages_and_pictures_of_comparisons(tmp_path):
    html, plot = tmp_path / "report.html", tmp_path / "boxes.svg"
    assert command("compare", *GENERATOR, "--quiet", "--html", html, "--plot", plot).code == 0
    text = html.read_text(encoding="utf-8")
    assert (text[:15], text.count("<svg ")) == ("<!DOCTYPE html>", 1)
    assert "optimal around the nominal values" in text
    assert command("compare", *inputs.write(tmp_path), "--plot", tmp_path / "one.svg").code == 0
    three = ["--parameter", "home=duration:drive_3", "--plot", tmp_path / "three.svg", "--axes", "to_ridge,home"]
    assert command("compare", *example(), *three).code == 0
    assert command("compare", *example(), "--timeout", "0.01", "--json").code == 3


def test_executions_of_networks_follow_from_their_seeds():
    ended = command("stnu", "dispatch", FINE, LATE, "--runs", "20", "--seed", "7", "--json")
    fine, late = answer_of(ended, "robust/stnu-dispatch/1")["results"]
    assert (ended.code, late["executions"]) == (1, [])
    assert [run["seed"] for run in fine["executions"]] == list(range(7, 27))
    assert not any(run["violated"] for run in fine["executions"])
    (again,) = answer_of(command("stnu", "dispatch", FINE, "--seed", "9", "--json"))["results"]
    assert again["executions"] == [fine["executions"][2]]


@pytest.mark.parametrize("words", [(example(), "plan.json"), (example("steps.plan"), "plan.stnu")])
def test_the_network_of_a_plan_is_controllable(tmp_path, words):
    files, name = words
    box = tmp_path / "box.json"
    box.write_text(command("envelope", *example(), "--json").out, encoding="utf-8")
    options = ("--box", box) if name == "plan.json" else ("-o", tmp_path / "plan.stn")
    assert command("convert", *files, "--stnu", tmp_path / name, *options).code == 0
    network = stnu.load(tmp_path / name)
    assert stnu.check(network).is_controllable
    if name == "plan.json":
        drive = next(link for link in network.contingents if link.source == "drive_1.start")
        assert (drive.lower, drive.upper, network.origin) == (25, 36, "0")


def test_a_plan_that_the_planner_repeats_in_vain_is_given_up(tmp_path):
    (tmp_path / "planner.py").write_text("import sys; sys.stdout.write(open(sys.argv[1]).read())", encoding="utf-8")
    planner = f"command:{sys.executable} {tmp_path / 'planner.py'} {NAVIGATION / 'steps.plan'} {{domain}} {{problem}}"
    world = tmp_path / "world.toml"
    world.write_text('[[draw]]\nduration = "drive"\ndistribution = "constant"\nvalue = 37\n', encoding="utf-8")
    ended = command("execute", *example(), "--world", world, "--planner", planner)
    assert (ended.code, "nonsense" in ended.out) == (1, True)


def sides(line):
    """The sides in a line that says what ends them, such as `a ≥ 4, b ≥ 40: because`."""
    ended = re.fullmatch(r"  (\w[\w -]* [<≤=≥>] \S+(?:, \w[\w -]* [<≤=≥>] \S+)*): .*", line)
    return ended[1].split(", ") if ended else []


def untimed(line):
    return re.sub(r"\d+ checks", "CHECKS", re.sub(r"\d+\.\d+ s", "TIME", line))


def test_commands_of_the_tour_work_as_shown(monkeypatch):
    """What the tour says is what the commands print, up to what solvers decide.

    That is times, the number of checks, and which obligation is named where several end the same side.
    """
    before, started = Path.cwd(), time.process_time()
    lines = command("demo").out.splitlines()
    assert (Path.cwd(), time.process_time() - started < 3) == (before, True)
    shown = [shlex.split(line.removeprefix("$ ")) for line in lines if line.startswith("$ ")]
    assert [words[0] for words in shown] == ["cd", "robust", "robust", "robust", "cd", "robust"]
    tour = {untimed(line) for line in lines}
    ends = {side for line in lines for side in sides(line)}
    for program, *arguments in shown:
        if program == "cd":
            monkeypatch.chdir(arguments[0])
        else:
            printed = command(*arguments).out.splitlines()
            assert [line for line in printed if not sides(line) and untimed(line) not in tour] == []
            assert {side for line in printed for side in sides(line)} <= ends
    assert ends


TEXTS = [tuple(inputs.RIGHT.values()), tuple((NAVIGATION / name).read_text() for name in inputs.RIGHT)]
WORDS = ["(", ")", ";", "and", "not", "?x", "1e999", "1/0", "inf", "#t", "default", "é", "c:", "- a", "in [", "\0"]


@st.composite
def damaged(draw, text):
    """Other bytes, a part of the text, or the text with some words replaced."""
    match draw(st.integers(0, 2)):
        case 0:
            return draw(st.binary(max_size=200))
        case 1:
            return text[: draw(st.integers(0, len(text)))].encode()
    words = text.split(" ")
    for _ in range(draw(st.integers(1, 3))):
        words[draw(st.integers(0, len(words) - 1))] = draw(st.sampled_from([*WORDS, *words]))
    return " ".join(words).encode()


@pytest.mark.parametrize("which", [0, 1, 2])
@given(data=st.data())
@settings(max_examples=often(60, 120), suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_damaged_files(tmp_path, which, data):
    texts = data.draw(st.sampled_from(TEXTS))
    paths = inputs.write(tmp_path, *texts)
    paths[which].write_bytes(data.draw(damaged(texts[which])))
    message = "one line"
    try:
        robust.load_plan(*paths)
    except robust.RobustError as error:
        message = str(error)
    assert message
    assert "\n" not in message


HARMLESS = {
    "carriage returns": lambda log: log.replace("\n", "\r\n"),
    "byte order mark": lambda log: f"\ufeff{log}",
    "tabs": lambda log: log.replace(" ", "\t"),
    "in reverse": lambda log: "\n".join(reversed(log.splitlines())) + "\n",
    "late": lambda log: log.replace("10.002", "1e9"),
    "upper case": str.upper,
    "status": lambda log: f"Time: (none) so far\n{log}",
    "search states": lambda log: f"b (10.0 | 0.5)b (9.0 | 5.5)\nStates: 12 [10%] [20%]\n{log}",
}


@pytest.mark.parametrize("change", HARMLESS.values(), ids=HARMLESS)
def test_what_is_no_damage_to_a_log(change, tmp_path):
    path, folder = tmp_path / "planner.log", inputs.INPUTS / "log"
    path.write_bytes(change((folder / "planner.log").read_text(encoding="utf-8")).encode())
    words = ("check", folder / "domain.pddl", folder / "problem.pddl", path)
    assert command(*words).code == 0
    hurried = command(*words, "--timeout", "0.001")  # which is enough on most machines
    assert hurried.code == (3 if "out of time" in hurried.out + hurried.err else 0)
