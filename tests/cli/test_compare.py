"""`robust compare`: shares, gaps and witnesses of all methods."""

from fractions import Fraction

import pytest

from robust.api import check
from robust.irr.check import Answer
from robust.plan.load import load_plan
from tests.cli import inputs
from tests.cli.running import EXAMPLES, answer_of, command, example

GENERATOR = example(directory=EXAMPLES / "generator")


def boxes_of(answer):
    return {one["method"]: one for one in answer["boxes"]}


def test_shares_are_exact():
    ended = command("compare", *example(), "--json")
    assert (ended.code, ended.err) == (0, "")
    answer = answer_of(ended)
    assert answer["region"]["volume"] == {"lower": "629", "upper": "629"}
    boxes = boxes_of(answer)
    assert list(boxes) == ["irr", "widen", "optimal", "optimal-nominal"]
    share = Fraction(121, 629)
    assert boxes["widen"]["volume_ratio"] == {"lower": str(share), "upper": str(share)}
    # The region's bounding box: 20 to 50, and 10 to 54.
    assert boxes["widen"]["width_ratio"] == {"lower": str(Fraction(22, 74)), "upper": str(Fraction(22, 74))}
    assert boxes["optimal"]["width_ratio"]["lower"] == str(Fraction(25, 74))


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


def test_text():
    ended = command("compare", *example())
    assert (ended.code, ended.err) == (0, "")
    assert ended.out.startswith("The plan is valid if and only if\n")
    assert "widening: to_ridge ∈ [25, 36], to_crater ∈ [35, 46]\n" in ended.out
    assert "breaks just outside" in ended.out
    assert "complete: shares are of the exact envelope, and of its bounding box; " in ended.out
    quiet = command("compare", *example(), "--quiet")
    assert "breaks just outside" not in quiet.out


def test_report_is_one_file(tmp_path):
    html, plot = tmp_path / "report.html", tmp_path / "boxes.svg"
    assert command("compare", *GENERATOR, "--quiet", "--html", html, "--plot", plot).code == 0
    text = html.read_text(encoding="utf-8")
    assert text.startswith("<!DOCTYPE html>")
    assert text.count("<svg ") == 1
    assert "optimal around the nominal values" in text
    assert plot.read_text(encoding="utf-8").startswith("<?xml")
    assert command("compare", *GENERATOR, "--html", tmp_path / "none" / "report.html").code == 2


def test_invalid_plan_is_still_compared():
    ended = command("compare", *example("plan-flexible-wait.stn"), "--json")
    answer = answer_of(ended)
    assert (ended.code, answer["status"]) == (1, "invalid")
    assert boxes_of(answer)["widen"]["verified"] is False
    assert boxes_of(answer)["optimal"]["verified"] is True


def test_unbounded_and_no_parameters(tmp_path):
    files = inputs.write(tmp_path, plan=inputs.PLAN.replace(" ub 9", "")).files
    one = boxes_of(answer_of(command("compare", *files, "--json")))["widen"]
    assert (one["volume_ratio"], one["width_ratio"], len(one["faces"])) == (None, None, 1)
    plan = inputs.PLAN.replace("parameter leave default 2 lb 0 ub 9;\n", "").replace("leave", "2")
    nothing = inputs.write(tmp_path, plan=plan).files
    answer = answer_of(command("compare", *nothing, "--json"))
    assert [one["faces"] for one in answer["boxes"]] == [[]] * 4


def test_one_and_three_parameters(tmp_path):
    files = inputs.write(tmp_path).files
    assert command("compare", *files, "--plot", tmp_path / "one.svg").code == 0
    more = ["--parameter", "home=duration:drive_3", "--plot", tmp_path / "three.svg", "--axes", "to_ridge,home"]
    assert command("compare", *example(), *more).code == 0


def test_out_of_time():
    ended = command("compare", *example(), "--timeout", "0.01", "--json")
    assert ended.code == 3
