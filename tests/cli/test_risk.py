"""`robust risk` and `robust envelope --method risk`: exit codes, answers for people and programs, pictures, limits."""

from tests.cli.running import answer_of, command, example

KINDS = ("--distribution", "to_ridge=normal::5", "--distribution", "to_crater=normal:40:5")
PLAN = example()


def test_bounds_for_programs_and_a_picture(tmp_path):
    ended = command("risk", *PLAN, *KINDS, "--json", "--draws", "500", "--plot", str(tmp_path / "risk.svg"))
    assert ended.code == 0
    answer = answer_of(ended, "robust/risk/1")
    assert (answer["status"], answer["within"]) == ("complete", "1/1000")
    low, high = (float(answer["probability"][end]) for end in ("lower", "upper"))
    assert low <= 0.85888 <= high <= low + 0.001
    assert answer["distributions"] == {"to_ridge": "normal:30:5", "to_crater": "normal:40:5"}
    assert answer["box"] == answer["boxes"][1]
    assert [one["method"] for one in answer["boxes"]] == ["irr", "widen", "optimal"]
    assert answer["estimate"]["draws"] == 500
    assert answer["estimate"]["confidence"] == "999/1000"
    assert any("lit crater" in one["obligation"] for one in answer["by_obligation"])
    assert "take-sample scout crater needs" in (tmp_path / "risk.svg").read_text(encoding="utf-8")


def test_one_random_parameter_is_drawn_as_bars_alone(tmp_path):
    kinds = ("--distribution", "to_ridge=constant", "--distribution", "to_crater=uniform:20:60")
    ended = command("risk", *PLAN, *kinds, "--plot", str(tmp_path / "risk.png"), "-q")
    assert (ended.code, ended.out) == (0, "probability of success: 0.4750\n")
    assert (tmp_path / "risk.png").stat().st_size > 1000


def test_the_most_probable_box():
    ended = command("envelope", *PLAN, *KINDS, "--method", "risk", "--json")
    assert ended.code == 0
    answer = answer_of(ended, "robust/envelope/1")
    numerator, denominator = map(int, answer["bound"].split("/"))
    assert 0.5383 < float(answer["probability"]["lower"]) <= numerator / denominator < 0.5434
    assert all("take-sample" in one["stopped_below"] for one in answer["parameters"].values())


def test_out_of_time_bounds_are_sound():
    ended = command("risk", *PLAN, *KINDS, "--timeout", "0.01", "--within", "1e-9", "--json")
    assert ended.code == 3
    answer = answer_of(ended)
    if "probability" in answer:
        assert float(answer["probability"]["lower"]) <= 0.85888 <= float(answer["probability"]["upper"])
