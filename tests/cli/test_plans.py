"""`robust check`, `envelope`, `region` and `compare`: what the recorded answers do not show; and files of any kind."""

from fractions import Fraction

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from benchmarks.generators.sizes import write_instance
from robust import RobustError
from robust.api import check, compare, envelope, region
from robust.errors import InputError
from robust.irr.check import Answer
from robust.plan.load import load_plan
from robust.qe.box import Box, Interval
from robust.qe.inner import FactorSearch
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region
from robust.show.regions import MANY, in_form, polyhedron_lines, region_lines
from robust.smt.limits import OutOfTimeError
from tests.cli import inputs
from tests.cli.running import EXAMPLES, NAVIGATION, answer_of, assert_one_line, command, example

FIXED = inputs.PLAN.replace("parameter leave default 2 lb 0 ub 9;\n", "").replace("leave", "2")
GENERATOR = example(directory=EXAMPLES / "generator")


# -- check -----------------------------------------------------------------------------------------------------------


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
    assert {*found["schedule"].values()} <= {step["time"] for step in found["trace"]}


def test_counterexamples_leave_out_constants():
    ended = command("check", *example("plan-flexible-wait.stn"), "--json")
    found = answer_of(ended)["counterexample"]
    drives = ("drive_1", "drive_2", "drive_3", "sample_1", "sample_2")
    assert set(found["schedule"]) == {f"{name}.{end}" for name in drives for end in ("start", "end")}
    assert {fluent for step in found["trace"] for fluent in step["fluents"]} == {"(charge scout)"}
    text = command("check", *example("plan-flexible-wait.stn")).out
    assert "(charge scout) = 170" in text
    assert "(drain base ridge)" not in text
    assert "(reserve scout) =" not in text


def test_epsilon_is_exact(tmp_path):
    files = inputs.write(tmp_path).files  # start and end of its action are five apart, and must not coincide
    answer = answer_of(command("check", *files, "--json", "--epsilon", "5"))
    assert (answer["verdict"], answer["epsilon"]) == ("proved", "5")
    assert command("check", *files, "--epsilon", "5.0000001").code == 1


# -- envelope --------------------------------------------------------------------------------------------------------


def cells(text):
    return [[cell.strip() for cell in line.split("   ") if cell.strip()] for line in text.splitlines()]


def test_convergence_ends_at_the_final_box():
    answer = answer_of(command("envelope", *example(), "--method", "irr", "--json"))
    assert 0 < answer["first_widening_s"] <= answer["seconds"]
    assert answer["convergence"][-1]["share"] == 1
    assert len(answer["convergence"]) == answer["checks"]


def test_unbounded_ends(tmp_path):
    plan = inputs.PLAN.replace(" lb 0 ub 9", "")
    files = inputs.write(tmp_path, plan=plan).files
    answer = answer_of(command("envelope", *files, "--json"))
    assert answer["parameters"]["leave"] == {
        "nominal": "2", "lower": "0", "upper": "inf", "lower_closed": True, "upper_closed": False,
        "percent_below": "-100", "percent_above": None, "stopped_below": "no schedule: g.start ≥ 0; "
        "c: g.start - .zero in [leave, leave] (line 3)", "stopped_above": None,
        "all_stopped_below": ["no schedule: g.start ≥ 0; c: g.start - .zero in [leave, leave] (line 3)"],
        "all_stopped_above": [],
    }  # fmt: skip
    assert answer["convergence"] == []
    row = cells(command("envelope", *files).out)[2]
    assert row == ["leave", "2", "0", "∞", "2", "∞", "−100 %, +∞"]


def test_plan_without_parameters(tmp_path):
    files = inputs.write(tmp_path, plan=FIXED).files
    assert "has no parameters that could vary" in command("envelope", *files).out
    answer = answer_of(command("envelope", *files, "--json"))
    assert (answer["status"], answer["parameters"]) == ("complete", {})
    drawn = command("envelope", *files, "--plot", tmp_path / "box.svg")
    assert drawn.code == 0


def test_place_of_an_error_as_json(tmp_path):
    files = inputs.write(tmp_path, plan=inputs.PLAN.replace("[5, 5]", "[6, 5]")).files
    error = answer_of(command("check", *files, "--json"))["error"]
    assert (error["file"], error["line"], error["column"]) == (str(files[2]), 4, 24)
    assert error["message"].startswith("found lower bound 6")


def test_wrong_usage_as_json():
    ended = command("check", "--json")
    answer = answer_of(ended, "robust/error/1")
    assert (ended.code, answer["error"]["kind"]) == (2, "usage")


def test_open_ends_are_shown(tmp_path):
    domain = inputs.DOMAIN.replace("(>= (fuel) 1)", "(> (fuel) 1)")
    files = inputs.write(tmp_path, domain=domain).files
    options = ["--parameter", "fluent:(fuel)"]
    row = cells(command("envelope", *files, *options).out)[3]
    assert row == ["fuel", "3", "> 1", "∞", "< 2", "∞", "−66.7 %, +∞"]
    answer = answer_of(command("envelope", *files, *options, "--json"))
    assert answer["parameters"]["fuel"] == {
        "nominal": "3", "lower": "1", "upper": "inf", "lower_closed": False, "upper_closed": False,
        "percent_below": "-200/3", "percent_above": None, "stopped_below": "g go: at start (> (fuel) 1)",
        "stopped_above": None, "all_stopped_below": ["g go: at start (> (fuel) 1)"], "all_stopped_above": [],
    }  # fmt: skip


# -- what parameters are -----------------------------------------------------------------------------------------------

VARIED = inputs.PLAN.replace("parameter leave", "parameter length default 5;\nparameter leave").replace(
    "[5, 5]", "[length, length]"
)


def test_a_parameter_without_room_says_what_to_type(tmp_path):
    files = inputs.write(tmp_path, plan=VARIED).files
    ended = command("envelope", *files)
    (said,) = [line for line in ended.out.splitlines() if line.startswith("length: no room, because ")]
    assert said.endswith("type: --parameter duration:g")
    assert "(= ?duration 5) of g" in said
    assert "no room" not in command("envelope", *files, "--quiet").out
    assert "What ends" not in command("envelope", *files, "--quiet").out
    answer = answer_of(command("envelope", *files, "--json"))
    assert answer["parameters"]["length"]["stopped_above"] == "g go: duration (= ?duration 5)"
    assert answer["parameters"]["leave"]["stopped_above"] == "declared bound: ub 9"
    (advice,) = answer["advice"]
    assert (advice["parameters"], advice["options"]) == (["length"], ["duration:g"])
    typed = answer_of(command("envelope", *files, "--json", "--parameter", *advice["options"]))
    assert typed["advice"] == []
    assert (typed["parameters"]["length"]["lower"], typed["parameters"]["length"]["upper"]) == ("1/1000", "inf")
    assert said in command("compare", *files).out


def test_a_nominal_value_of_the_plan_that_the_domain_excludes(tmp_path):
    files = inputs.write(tmp_path, plan=VARIED.replace("default 5", "default 6")).files
    ended = command("envelope", *files)
    assert ended.code == 1
    assert "type: --parameter duration:g" in ended.out
    assert command("envelope", *files, "--parameter", "duration:g").code == 0


@pytest.mark.parametrize("word", ["--parameter", "--parametrize"])
def test_durations_are_parameters_of_executed_plans_as_well(tmp_path, word):
    files = inputs.write(tmp_path, plan=VARIED).files
    assert "length: no room" in command("execute", *files).out
    ended = command("execute", *files, word, "duration:g")
    assert "length in [0.001, inf) (−100 %, +∞)" in ended.out
    assert "no room" not in ended.out


OPEN = inputs.PLAN.replace(" default 2", "")


def test_regions_and_optimal_boxes_need_no_nominal_values(tmp_path):
    files = inputs.write(tmp_path, plan=OPEN).files
    assert "  0 ≤ leave ≤ 9" in command("region", *files).out
    assert command("region", *files, "--plot", tmp_path / "region.svg").code == 0
    assert cells(command("envelope", *files, "--method", "optimal").out)[2] == ["leave", "–", "0", "9"]
    answer = answer_of(command("envelope", *files, "--method", "optimal", "--json"))["parameters"]["leave"]
    assert (answer["nominal"], answer["lower"], answer["upper"]) == (None, "0", "9")
    assert (answer["percent_below"], answer["percent_above"]) == (None, None)
    other = ["--parameter", "fluent:(fuel)", "--parameter", "start:g"]
    assert command("region", *files, *other[:2], "--axes", "fuel", "--plot", tmp_path / "region.svg").code == 2


@pytest.mark.parametrize(
    "words",
    [
        ["check"],
        ["envelope"],
        ["envelope", "--method", "irr"],
        ["envelope", "--method", "optimal", "--contain-nominal"],
        ["envelope", "--method", "optimal", "--controllability", "weak"],
        ["compare"],
        ["execute"],
    ],
)
def test_where_a_nominal_value_is_needed_the_message_says_what_to_type(tmp_path, words):
    files = inputs.write(tmp_path, plan=OPEN).files
    verb, *options = words
    ended = command(verb, *files, *options)
    assert_one_line(ended)
    assert "found parameter 'leave' without a nominal value" in ended.err
    assert ended.err.endswith("or the option --parameter leave,default=VALUE\n")
    typed = command(verb, *files, *options, "--parameter", "leave,default=2")
    assert typed.code == 0


def test_searches_in_python_say_the_same(tmp_path):
    plan = load_plan(*inputs.write(tmp_path, plan=OPEN).files, nominal_needed=False)
    assert str(region(plan).region) == str(region(load_plan(*inputs.write(tmp_path).files)).region)
    assert envelope(plan, method="optimal").box["leave"] == Interval(Fraction(0), Fraction(9))
    for ask in (check, envelope, compare):
        with pytest.raises(InputError, match="--parameter leave,default=VALUE"):
            ask(plan)


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("(:goal (at b))", "(:goal (at b)) (:constraints (always (at a)))", "problem.pddl:5:18: found trajectory"),
        ("(:goal (at b))", "(:goal (preference soon (at b)))", "problem.pddl:5:10: found a preference"),
    ],
)
def test_what_is_not_supported_is_said_in_one_line(tmp_path, old, new, place):
    ended = command("check", *inputs.write(tmp_path, problem=inputs.PROBLEM.replace(old, new)).files)
    assert_one_line(ended, 4)
    assert place in ended.err


# -- region ----------------------------------------------------------------------------------------------------------


def test_many_pieces_stay_a_difference():
    names = ("a", "b")
    base = Polyhedron.universe(names)
    holes = [
        Polyhedron.of_box(names, Box({name: Interval(Fraction(i), Fraction(i)) for name in names}))
        for i in range(MANY + 1)
    ]
    assert in_form(Region.difference(base, holes), None).form == "difference"
    assert in_form(Region.difference(base, holes[:1]), None).form == "union"


def test_out_of_time_is_an_outer_bound():
    ended = command("region", *example(), "--timeout", "0.0001", "--json")
    assert ended.code == 3
    answer = answer_of(ended)
    if answer["schema"] == "robust/region/1":
        assert answer["status"] == "timeout"
        assert answer["meaning"].startswith("an outer bound of the robustness envelope")


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
    (factor,) = answer["factors"]
    assert factor["ascending"] == ascending
    assert len(factor["inner"]) == 1
    share = answer["open_share"]
    assert share["lower"] == share["value"] == share["upper"]
    assert share["confidence"] is None
    assert 0 <= Fraction(share["value"]) < 1
    assert "proved valid" in plot.read_text()
    told = command("region", *files).out
    assert "The plan is certain to be valid if all lines of one of these groups hold" in told
    assert "proved valid: 1 polyhedron; open: " in told
    assert ("which are interchangeable" in told) == bool(ascending)


def test_long_regions_are_told_in_ascending_order(tmp_path):
    files = write_instance(tmp_path, 4, 4)
    told = command("region", *files).out
    assert told.startswith("In ascending order of start_1, start_2, start_3, start_4, which are interchangeable:\n")
    assert "  40 ≤ start_2 ≤ 86\n" in told
    answer = answer_of(command("region", *files, "--json"))
    assert len(answer["minus"]) == 22
    (factor,) = answer["factors"]
    assert (factor["inner"], factor["outer"]["minus"], answer["open_share"]) == (None, [], None)


def test_outer_bounds_are_said_to_be_bounds():
    lines = list(region_lines(Region.universe(("a",)), exact=False))
    assert lines == ["No parameter values are known by now for which the plan can fail."]
    assert list(region_lines(Region.universe(()), exact=False)) == [
        "Whether the plan is valid is not known; it has no parameters."
    ]
    half = Region.of_box(("a",), Box({"a": Interval(Fraction(1), Fraction(2))}))
    assert list(region_lines(half, exact=False)) == ["The plan can be valid only if", "  1 ≤ a ≤ 2"]


def test_sentences_for_special_regions():
    assert list(region_lines(Region.nothing(("a",)), exact=True)) == ["The plan is valid for no parameter values."]
    assert list(region_lines(Region.universe(("a",)), exact=True)) == ["The plan is valid for all parameter values."]
    assert list(region_lines(Region.universe(()), exact=True)) == ["The plan is valid; it has no parameters."]
    assert list(region_lines(Region.nothing(()), exact=True)) == ["The plan is not valid; it has no parameters."]


def test_lines_of_a_polyhedron(tmp_path):
    files = inputs.write(tmp_path, domain=inputs.DOMAIN.replace("(>= (fuel) 1)", "(> (fuel) 1)")).files
    answer = answer_of(command("region", *files, "--parameter", "fluent:(fuel)", "--json"))
    assert polyhedron_lines(Region.from_dict(answer).pieces[0]) == ["0 ≤ leave ≤ 9", "fuel > 1"]


def test_invalid_plan_and_plan_without_parameters(tmp_path):
    files = inputs.write(tmp_path, plan=FIXED).files
    ended = command("region", *files)
    assert ended.out.startswith("The plan is valid; it has no parameters.\n")
    assert command("region", *files, "--plot", tmp_path / "r.svg").code == 2


# -- compare ---------------------------------------------------------------------------------------------------------


def boxes_of(answer):
    return {one["method"]: one for one in answer["boxes"]}


@pytest.mark.parametrize("files", [example(), GENERATOR], ids=["navigation", "generator"])
def test_gaps_and_witnesses(files):
    plan = load_plan(*files)
    answer = answer_of(command("compare", *files, "--json", "--beta", "2"))
    for method, one in boxes_of(answer).items():
        assert len(one["faces"]) == 4
        for face in one["faces"]:
            gap = Fraction(face["gap"])
            assert gap < 2 if method == "irr" else gap == 0
            point = {name: Fraction(value) for name, value in face["witness"]["parameters"].items()}
            beyond = point[face["parameter"]] - Fraction(face["end"])
            assert 0 < (beyond if face["side"] == "upper" else -beyond) <= gap + Fraction(1, 1000)
            result = check(plan, at=point, every=True)
            assert result.answer is Answer.REFUTED
            assert result.obligations[face["witness"]["obligation"]] is Answer.REFUTED


def test_report_is_one_file(tmp_path):
    html, plot = tmp_path / "report.html", tmp_path / "boxes.svg"
    assert command("compare", *GENERATOR, "--quiet", "--html", html, "--plot", plot).code == 0
    text = html.read_text(encoding="utf-8")
    assert text.startswith("<!DOCTYPE html>")
    assert text.count("<svg ") == 1
    assert "optimal around the nominal values" in text
    assert plot.read_text(encoding="utf-8").startswith("<?xml")
    assert command("compare", *GENERATOR, "--html", tmp_path / "none" / "report.html").code == 2


def test_unbounded_and_no_parameters(tmp_path):
    files = inputs.write(tmp_path, plan=inputs.PLAN.replace(" ub 9", "")).files
    one = boxes_of(answer_of(command("compare", *files, "--json")))["widen"]
    assert (one["volume_ratio"], one["width_ratio"], len(one["faces"])) == (None, None, 1)
    nothing = inputs.write(tmp_path, plan=FIXED).files
    answer = answer_of(command("compare", *nothing, "--json"))
    assert [one["faces"] for one in answer["boxes"]] == [[]] * 4


def test_one_and_three_parameters(tmp_path):
    files = inputs.write(tmp_path).files
    assert command("compare", *files, "--plot", tmp_path / "one.svg").code == 0
    more = ["--parameter", "home=duration:drive_3", "--plot", tmp_path / "three.svg", "--axes", "to_ridge,home"]
    assert command("compare", *example(), *more).code == 0


def test_comparison_out_of_time():
    ended = command("compare", *example(), "--timeout", "0.01", "--json")
    assert ended.code == 3


# -- whatever is in the files: no errors but our own -----------------------------------------------------------------


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
@settings(max_examples=180, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_damaged_files(tmp_path, which, data):
    texts = data.draw(st.sampled_from(TEXTS))
    paths = [tmp_path / name for name in inputs.RIGHT]
    for path, text in zip(paths, texts, strict=True):
        path.write_text(text, encoding="utf-8")
    paths[which].write_bytes(data.draw(damaged(texts[which])))
    message = "one line"
    try:
        load_plan(*paths)
    except RobustError as error:
        message = str(error)
    assert message
    assert "\n" not in message
