"""`robust repair`: exit codes, the plan that is written; and the repair that a refutation ends with."""

from pathlib import Path

from robust.cli import plans
from robust.irr.repair import RepairSearch
from robust.plan.stn import read_stn
from robust.smt.limits import OutOfTimeError
from tests.cli import inputs
from tests.cli.running import answer_of, assert_one_line, command, example

FLEXIBLE = example("plan-flexible-wait.stn")
WORDS = "drive_2.start at most 16 after sample_1.end instead of 20"
STEPS = "0: (drive scout base ridge) [30]\n"
LATE = """\
parameter leave default 2 lb 0 ub 9;  # c: g.start - .zero in [7, 8];
durative-action instance g : (go a b);
c: g.start - .zero in [leave, leave]; c: g.end - g.start in
  [5 # [1, 2]
   , 7 ];
"""


def test_the_repaired_plan_is_the_text_with_another_number(tmp_path):
    target = tmp_path / "repaired.stn"
    ended = command("repair", *FLEXIBLE, "-o", target)
    assert ended.code == 0
    assert ended.out.splitlines()[:2] == ["optimal: 1 change at cost 4, the least", f"  {WORDS}"]
    assert ended.out.endswith(f"plan: {target}\n")
    before, after = (Path(file).read_text(encoding="utf-8") for file in (FLEXIBLE[2], target))
    assert after == before.replace("[1, 20]", "[1, 16]")
    assert command("check", *FLEXIBLE[:2], target).code == 0
    again = command("repair", *FLEXIBLE[:2], target, "--quiet")
    assert (again.code, again.out) == (0, "unneeded: the plan is proved as it is\n")


def test_comments_and_layout_stay(tmp_path):
    files = inputs.write(tmp_path, plan=LATE).files
    target = tmp_path / "repaired.stn"
    assert command("repair", *files, "-o", target).code == 0
    assert target.read_text(encoding="utf-8") == LATE.replace(", 7 ]", ", 5 ]")
    assert read_stn(target).constraints[1].upper == 5
    late = LATE.replace("5 # [1, 2]\n   , 7", "5, 5") + "c: g.end - .zero in [0, 6];\n"
    files = inputs.write(tmp_path, plan=late).files
    assert command("repair", *files, "--change", "nominal", "-o", target).code == 0
    assert target.read_text(encoding="utf-8") == late.replace("default 2", "default 1")


def test_json():
    ended = command("repair", *FLEXIBLE, "--require", "to_crater=38:44", "--json")
    answer = answer_of(ended, "robust/repair/1")
    assert ended.code == 0
    assert answer["required"] == {
        "to_crater": {"lower": "38", "upper": "44", "lower_closed": True, "upper_closed": True}
    }
    (change,) = answer["changes"]
    assert (change["line"], change["part"], change["old"], change["new"]) == (17, "upper", "20", "12")
    assert (answer["cost"], answer["gap"], answer["written"]) == ({"counted": 0, "total": "8"}, "0", None)


def test_what_cannot_be_repaired():
    ended = command("repair", *FLEXIBLE, "--require", "to_crater=38:900", "--json")
    answer = answer_of(ended, "robust/repair/1")
    assert (ended.code, answer["repair"], answer["cost"]) == (1, "impossible", None)
    assert answer["contradiction"]


def test_out_of_time(monkeypatch):
    def late(*_):
        raise OutOfTimeError

    monkeypatch.setattr(RepairSearch, "best_known", late)
    ended = command("repair", *FLEXIBLE)
    assert ended.code == 3
    assert ended.out.startswith("unknown: out of time, no repair found; none costs less than cost 0")
    answer = answer_of(command("repair", *FLEXIBLE, "--json"), "robust/repair/1")
    assert (answer["status"], answer["repair"], answer["bound"]) == ("timeout", "unknown", {"counted": 0, "total": "0"})


def test_only_a_network_in_a_file_can_be_written(tmp_path):
    steps = tmp_path / "steps.plan"
    steps.write_text(STEPS, encoding="utf-8")
    ended = command("repair", *FLEXIBLE[:2], steps, "-o", tmp_path / "out.stn")
    assert "expected a network (.stn): convert them first by robust convert" in ended.err
    assert_one_line(ended)
    assert_one_line(command("repair", *FLEXIBLE[:2], "-", "-o", tmp_path / "out.stn"))


def test_a_refutation_ends_with_its_repair_and_nothing_else_does(monkeypatch):
    ended = command("check", *FLEXIBLE)
    assert (ended.code, ended.out.splitlines()[-1]) == (1, f"repair: {WORDS} (line 17)")
    (change,) = answer_of(command("check", *FLEXIBLE, "--json"))["repair"]
    assert (change["words"], change["new"]) == (WORDS, "16")
    assert "repair" not in command("check", *FLEXIBLE, "--quiet").out
    monkeypatch.setattr(plans, "_repair", None)
    assert answer_of(command("check", *example(), "--json"))["repair"] is None


def test_a_refutation_without_a_repair_in_time_stands(monkeypatch):
    monkeypatch.setattr(plans, "HINT_PATIENCE", 0.0)
    ended = command("check", *FLEXIBLE, "--json")
    assert (ended.code, answer_of(ended)["repair"]) == (1, None)
