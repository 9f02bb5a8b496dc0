"""`robust region`: the exact envelope as text, LaTeX, JSON and drawing."""

from fractions import Fraction

import pytest

from robust.qe.box import Box, Interval
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region
from robust.show.regions import MANY, in_form, polyhedron_lines, region_lines
from tests.cli import inputs
from tests.cli.running import EXAMPLES, answer_of, command, example

GENERATOR = example(directory=EXAMPLES / "generator")


def test_text():
    ended = command("region", *example())
    assert (ended.code, ended.err) == (0, "")
    *lines, blank, status = ended.out.splitlines()
    assert lines == [
        "The plan is valid if and only if",
        "  20 ≤ to_ridge ≤ 50",
        "  60 ≤ to_crater + to_ridge ≤ 85",
        "  2 to_crater + to_ridge ≤ 128",
    ]
    assert blank == ""
    assert status.startswith("complete: the exact envelope; ")


@pytest.mark.parametrize("backend", ["project", "fourier-motzkin", "z3", "cvc5"])
def test_back_ends_agree(backend):
    answer = answer_of(command("region", *example(), "--json", "--backend", backend))
    assert (answer["status"], answer["backend"], answer["form"]) == ("complete", backend, "union")
    found = Region.from_dict(answer)
    names = ("to_ridge", "to_crater")
    assert found.volume() == Fraction(629)
    assert {n: Fraction(v) for n, v in zip(names, (20, 54), strict=True)} in found
    assert {n: Fraction(v) for n, v in zip(names, (20, 39), strict=True)} not in found


@pytest.mark.parametrize("options", [["--splitting", "monolithic"], ["--splitting", "partial"], ["--no-learning"]])
def test_ways_of_splitting(options):
    answer = answer_of(command("region", *example(), "--json", *options))
    assert Region.from_dict(answer).volume() == Fraction(629)
    assert answer["learning"] is ("--no-learning" not in options)


def test_forms():
    union = answer_of(command("region", *GENERATOR, "--json"))
    assert (union["form"], len(union["polyhedra"])) == ("union", 2)
    difference = answer_of(command("region", *GENERATOR, "--json", "--form", "difference"))
    assert difference["form"] == "difference"
    assert "polyhedra" not in difference
    assert Region.from_dict(union).equals(Region.from_dict(difference))
    text = command("region", *GENERATOR).out
    assert text.startswith("The plan is valid if and only if all lines of one of these 2 groups hold\n  1.\n     ")
    assert "and not all lines of one of these groups hold" in command("region", *GENERATOR, "--form", "difference").out


def test_many_pieces_stay_a_difference():
    names = ("a", "b")
    base = Polyhedron.universe(names)
    holes = [
        Polyhedron.of_box(names, Box({name: Interval(Fraction(i), Fraction(i)) for name in names}))
        for i in range(MANY + 1)
    ]
    assert in_form(Region.difference(base, holes), None).form == "difference"
    assert in_form(Region.difference(base, holes[:1]), None).form == "union"


def test_latex():
    ended = command("region", *example(), "--latex")
    assert ended.code == 0
    assert r"\mathit{to\_ridge} \le 50" in ended.out
    assert ended.out.count("\n") == 1
    assert command("region", *example(), "--latex", "--json").code == 2


def test_out_of_time_is_an_outer_bound():
    ended = command("region", *example(), "--timeout", "0.0001", "--json")
    assert ended.code == 3
    answer = answer_of(ended)
    if answer["schema"] == "robust/region/1":
        assert answer["status"] == "timeout"
        assert answer["meaning"].startswith("an outer bound of the robustness envelope")


def test_outer_bounds_are_said_to_be_bounds():
    lines = list(region_lines(Region.universe(("a",)), exact=False))
    assert lines == ["The plan can be valid for all parameter values."]
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
    plan = inputs.PLAN.replace("parameter leave default 2 lb 0 ub 9;\n", "").replace("leave", "2")
    files = inputs.write(tmp_path, plan=plan).files
    ended = command("region", *files)
    assert ended.out.startswith("The plan is valid; it has no parameters.\n")
    assert command("region", *files, "--plot", tmp_path / "r.svg").code == 2


@pytest.mark.parametrize("more", [[], ["--parameter", "home=duration:drive_3"], ["--axes", "to_crater"]])
def test_plot(tmp_path, more):
    path = tmp_path / "region.svg"
    ended = command("region", *example(), "--quiet", "--plot", path, *more)
    assert (ended.code, ended.err) == (0, "")
    assert "to_crater" in path.read_text(encoding="utf-8")
