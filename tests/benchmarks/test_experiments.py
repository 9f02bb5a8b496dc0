"""Every experiment at a size that is quick, by the real command; the command line of all of them."""

import gc
import json
import subprocess
import sys
import tomllib
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from benchmarks.catalogue import EXPERIMENTS, Entry
from benchmarks.engine.show import Table
from benchmarks.irr.contenders import IRR, OPTIMAL, RECORDED_BOX, REGIONS, WIDEN
from benchmarks.irr.growth import ALL_REFUELS, DELIVERIES, MORE_PARAMETERS, MORE_REFUELS, PARAMETERS, POINTS
from benchmarks.pike.hesitation import STORIES
from robust import InputError, Region, RobustError
from tests.benchmarks.conftest import EXAMPLES, checked, example, navigation, promised_region, rendered, run
from tests.cli.running import command, environment
from tests.val import BINARY

ROOT = Path(__file__).parents[2]
SMALL = (replace(MORE_REFUELS, sizes=(2,)), replace(MORE_PARAMETERS, sizes=(1,)))
ALL_INSIDE = (
    "`robust check`: 1 of 1; recorded IRR boxes inside the exact region: 1 of 1; our IRR boxes inside it: 1 of 1; "
    "boxes of exact widening inside it: 1 of 1; optimal boxes inside it: 1 of 1"
)
TINY: dict[str, tuple[dict[str, Any], int, str]] = {
    "recorded": ({"suite": ...}, 1, "1 of 1 with a recorded box"),
    "scaling": ({"series": SMALL, "jobs": 2}, 2, "More parameters"),
    "figure3": ({"suite": ..., "contenders": (IRR, WIDEN, OPTIMAL, REGIONS[0], RECORDED_BOX)}, 5, ALL_INSIDE),
    "figure5": ({"suite": ...}, 2, "poorest"),
    "backends": ({"series": (replace(PARAMETERS, sizes=(1, 2)),), "contenders": REGIONS[:2]}, 4, "project"),
    "encodings": ({"series": (replace(POINTS, sizes=(2,)),)}, 2, "relational"),
    "widening": ({"series": (replace(DELIVERIES, sizes=(2,)), replace(ALL_REFUELS, sizes=(2,)))}, 4, "widen, solver"),
    "figure4": ({"suite": ..., "sizes": (1,), "baseline_limit": 120, "contenders": (WIDEN, OPTIMAL)}, 6, "0 + 0 of 4"),
    "conversions": ({"drawn": 2, "delivery": 1, "planned": 0}, 3, "over-all condition"),
    "risk": ({"sizes": (1, 2), "plans": 1, "parts": (2,), "suite": ..., "draws": 200}, 4, "kept by the octagon"),
    "stnu": ({"sizes": (10, 20), "networks": 2}, 4, "Schedules of teams"),
    "envelopes": ({"plans": 2, "points": 2, "every": 6}, 5, "Random plans with up to three parameters"),
    "logs": ({"suite": ..., "validator": BINARY}, 2, "1 of 1 that VAL calls valid, 1 of 1 that VAL calls invalid"),
    "table1": ({"problems": 1, "columns": (1,), "executors": ("dreex", "blex:0")}, 1, "BLEX(0)"),
    "figure20a": ({"instances": 1, "backends": ("pitms",)}, 1, "1 plan of seed 0"),
    "hesitation": ({"problems": 1, "stories": ("kitchen",)}, 6, "kitchen"),
    "steps": ({"blocks": (1,)}, 6, "blocks-1-shared"),
    "strategies": ({"plans": ("kitchen", "blocks-1"), "runs": 2}, 5, "Whether plans with choices are controllable"),
    "rates": ({"plans": ("kitchen", "k-intents 3,3"), "runs": 2}, 4, "PIKE, eager as in the paper"),
    "figure21": ({"instances": 2}, 2, "more implicants than models"),
    "figure17": ({"problems": 3, "largest": 20}, 3, "3 problems of seed 0"),
    "figure18": ({"problems": 2, "largest": 20}, 2, "of the sum of all of Kirk's times PIKE saves"),
}
READ = {
    "figure4",
    "conversions",
    "logs",
    "table1",
    "figure20a",
    "hesitation",
    "steps",
    "rates",
    "strategies",
    "figure21",
    "figure17",
    "figure18",
}
"""Those whose reports are made again of what was printed."""


def logged(directory: Path, late: str = "") -> dict[str, Any]:
    """What a planner prints of the shipped example; not a valid plan if its last step is late."""
    files = example()
    steps = Path(files["plan"]).with_name("steps.plan").read_text(encoding="utf-8")
    first, last = steps.rstrip().rsplit("\n", 1)
    log = directory / f"planner{late}.log"
    log.write_text(f"Solution found.\n{first}\n{late}{last}\n", encoding="utf-8")
    names = {"name": log.stem, "domain": files["domain"], "problem": files["problem"], "log": str(log)}
    return {**names, "steps": steps.count("["), "val": "invalid" if late else "valid"}


@pytest.fixture
def _small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two of the delays of a story; and what is frozen of other tests stays so."""
    monkeypatch.setitem(STORIES, "kitchen", STORIES["kitchen"][::6])
    for name in ("freeze", "unfreeze"):
        monkeypatch.setattr(gc, name, lambda: None)


@pytest.mark.usefixtures("_small")
@pytest.mark.parametrize("name", TINY)
def test_a_small_run(name, make_suite, tmp_path):
    options, count, text = TINY[name]
    delivery = [{"instance": "n", "parameters": 2, **example()}]
    suite = make_suite(navigation(), delivery=delivery, logs=[logged(tmp_path), logged(tmp_path, late="1")])
    given = {key: suite if value is ... else value for key, value in options.items()}
    if name != "table1":
        given["limit"] = 120
    fields = EXPERIMENTS[name].options.declarations
    if "plot" in fields:
        given["plot"] = tmp_path / "plot.svg"
    if "store" in fields:
        given["store"] = tmp_path / "store"
    seen: list[tuple[int, int, str]] = []
    report = run(name, **given, on_result=lambda *progress: seen.append(progress))
    assert report.agrees, rendered(report.tables)
    assert (report.complete, report.failures) == (True, ())
    assert [(done, total) for done, total, _ in seen] == [(place + 1, count) for place in range(count)]
    value = checked(report)
    assert value["complete"] is True
    disturbed = "2 processes ran at a time and disturbed each other's timings"
    assert (disturbed in report.notes) == (given.get("jobs") == 2)
    assert text in " ".join(rendered(report.tables).split())
    if name == "backends":  # the envelope that the generator of unordered jobs promises
        for row in report.rows:
            assert Region.from_dict(row.run.region).equals(promised_region(row.size))
    report.plot()
    assert "plot" not in given or given["plot"].read_text(encoding="utf-8").startswith("<?xml")
    if name in READ:
        again = report.experiment.read(value)
        assert again.rows == report.rows
        assert rendered(again.tables)
        assert {**checked(again), "notes": 0} == {**value, "notes": 0}
    if "store" in fields:
        resumed = run(name, **given)
        assert resumed.rows == report.rows
        assert f"{count} of {count} results are from {tmp_path / 'store'}" in resumed.notes


def test_risk_of_what_planners_printed(tmp_path):
    """A log with all durations random: bounds, draws and their distance over time in the row and in the tables."""
    workshop = EXAMPLES / "workshop"
    files = {"domain": "domain.pddl", "problem": "problem.pddl", "log": "plan.log"}
    entry = {"name": "workshop", "steps": 9} | {key: str(workshop / name) for key, name in files.items()}
    (tmp_path / "plans.json").write_text(json.dumps([entry]), encoding="utf-8")
    report = run("risk", plans=0, shops=0, logs=tmp_path, within="1/100", limit=120)
    (row,) = report.rows
    assert (report.agrees, row.kind, row.name, row.status) == (True, "planner", "workshop", "complete")
    assert 0 < row.lower <= row.upper < 1
    assert row.width <= 0.01
    assert row.points_lower <= row.successes / row.draws <= row.points_upper
    assert row.progress[-1][1] == pytest.approx(row.width)
    assert "workshop" in rendered(report.tables)
    assert checked(report)["agrees"] is True
    absent = {**entry, "log": "absent.log"}
    (tmp_path / "plans.json").write_text(json.dumps([absent]), encoding="utf-8")
    with pytest.raises(RobustError, match=r"workshop: .*absent\.log: found no such file"):
        run("risk", plans=0, shops=0, logs=tmp_path)
    with pytest.raises(InputError, match=r"plans\.json"):
        run("risk", plans=0, shops=0, logs=tmp_path / "absent")


def test_every_experiment_is_tried():
    """The planner of table 2 is slow, so that a stand-in is asked elsewhere; figure 20b has a file of its own."""
    assert set(EXPERIMENTS) - set(TINY) == {"table2", "monitored", "figure20b"}


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("figure3", {"own_limits": {"irr": 0}}, "found '0', expected a number above 0"),
        ("figure5", {"limit": float("nan")}, "found 'nan', expected a number"),
        ("encodings", {"plot": "absent/plot.svg"}, "there is no directory 'absent'"),
        ("figure4", {"sizes": ()}, "found no plan"),
        ("figure4", {"sizes": (0,)}, "found 0 parameters"),
        ("conversions", {"drawn": 0, "delivery": 0, "planned": 0}, "expected at least one plan"),
        ("conversions", {"planner": "nobody"}, "found planner 'nobody'"),
        ("table1", {"problems": 101}, "problems is 101"),
        ("table1", {"runs": 0}, "runs is 0"),
        ("table1", {"columns": (7,)}, "found column 7, expected 1 to 6"),
        ("table1", {"executors": ("blex:0",)}, "expected dreex and then"),
        ("table1", {"executors": ("dreex", "blex:5")}, "expected dreex and then"),
        ("monitored", {"problems": 0}, "problems is 0"),
        ("figure21", {"instances": 0}, "instances is 0"),
        ("figure20b", {"backends": ("bbd",)}, "unknown back end 'bbd'; did you mean 'bdd'"),
        ("figure20b", {"problems": 0}, "problems is 0"),
        ("figure17", {"problems": 0}, "problems is 0"),
        ("figure17", {"largest": 1}, "expected at least 2"),
        ("figure18", {"reasoner": "smtt"}, "unknown reasoner 'smtt'"),
    ],
)
def test_wrong_options(name, options, message, make_suite):
    suite = {"suite": make_suite(navigation())} if name in {"recorded", "figure3", "figure5"} else {}
    with pytest.raises(InputError, match=message):
        run(name, **suite, **options)


class StandIn:
    """An experiment that is not run: its jobs say what came of it."""

    def __init__(self, seen: dict[str, Any]) -> None:
        self.seen = seen

    def run(self, options: Any, on_result: Any) -> SimpleNamespace:
        on_result(1, 2, "one: complete")
        self.seen.update(vars(options))
        agrees = options.jobs != 3
        table = Table("A table", ("method", "box"), [("exact widening", "equal")], styles=["green"])
        printed = {"schema": "test", "agrees": agrees}
        complete = options.jobs != 4
        return SimpleNamespace(
            agrees=agrees, complete=complete, tables=[table], as_dict=lambda: printed, plot=lambda: None
        )


@pytest.fixture
def seen(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    given: dict[str, Any] = {}
    monkeypatch.setattr(Entry, "load", lambda _: StandIn(given))
    return given


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("recorded --suite . --limit 1/2 --plot plot.svg", {"suite": Path(), "limit": 0.5, "plot": Path("plot.svg")}),
        ("recorded --suite .", {"limit": None, "plot": None, "jobs": 1}),
        ("figure3 --suite . --jobs 2 --instances 3", {"limit": 10.0, "jobs": 2, "instances": 3}),
        ("figure4 --baseline-limit 1/2 --store s", {"baseline_limit": 0.5, "limit": 10.0, "sizes": None}),
        ("figure4 --parameters 2 --parameters 8", {"baseline_limit": 10.0, "sizes": (2, 8), "store": None}),
        ("conversions --drawn 3", {"drawn": 3, "delivery": 50, "planned": 100, "limit": 60.0, "planner": "aries"}),
        ("table1 --parameters 2 --parameters 3 --stop", {"columns": (2, 3), "drain": False, "planner_limit": 7.0}),
        ("table2 --battery 400.5 --cluster tcp://h:1", {"battery": Fraction(801, 2), "cluster": "tcp://h:1"}),
        ("table2 --drain --planner-limit 9", {"battery": None, "drain": True, "planner_limit": 9.0}),
        ("monitored --battery 420", {"battery": Fraction(420), "problems": 4, "planner_limit": 7.0}),
        ("figure20a --backend sat --backend bdd", {"backends": ("sat", "bdd"), "instances": 500, "seed": 0}),
        ("figure20b --timeout 3", {"backends": (), "problems": 500, "limit": 3.0}),
        ("figure20b --limit 4", {"limit": 4.0}),
        ("figure21 --instances 3 --seed 2", {"backends": ("pitms",), "instances": 3, "seed": 2, "limit": 60.0}),
        ("figure17 --largest 6 --backend bdd", {"largest": 6, "reasoner": "bdd", "problems": 2000}),
    ],
)
def test_options_of_the_command(words, expected, seen):
    assert command("bench", *words.split()).code == 0
    assert expected.items() <= seen.items()


@pytest.mark.usefixtures("seen")
def test_output_and_exit_codes():
    ended = command("bench", "scaling")
    assert (ended.code, ended.err) == (0, "")
    assert "exact widening" in ended.out
    assert "green" not in ended.out
    assert json.loads(command("bench", "scaling", "--json").out) == {"schema": "test", "agrees": True}
    assert [command("bench", "scaling", "--jobs", jobs).code for jobs in ("3", "4")] == [1, 3]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("table1 --parameters some", "found 'some', expected a whole number"),
        ("figure5 --suite . --instances 0", "--instances: found '0', expected a whole number from 1"),
        ("table2 --battery much", "--battery: found 'much', expected a number"),
    ],
)
def test_bad_command_lines(words, says):
    ended = command("bench", *words.split())
    assert (ended.code, ended.out, ended.err.count("\n")) == (2, "", 1)
    assert says in ended.err


def test_the_package_is_a_command_as_well(tmp_path):
    words = [sys.executable, "-m", "benchmarks", "figure17", "--problems", "1", "--largest", "4", "--json"]
    done = subprocess.run(words, check=True, capture_output=True, text=True, env=environment(), cwd=tmp_path)
    assert json.loads(done.stdout)["schema"] == "robust/bench-figure17/1"


def test_only_what_is_asked_is_loaded():
    script = "import sys; from benchmarks.catalogue import EXPERIMENTS; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True, env=environment())
    loaded = done.stdout.split()
    assert not {"z3", "pysmt", "cvc5", "scipy", "matplotlib", "rich"} & set(loaded)
    assert [name for name in loaded if name.startswith("benchmarks.")] == ["benchmarks.catalogue"]


def test_a_wheel_holds_the_experiments():
    included = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["hatch"]["build"]["targets"]
    forced = included["wheel"]["force-include"]
    assert all(f"robust_{name}" == place for name, place in forced.items() if name.startswith("benchmarks/"))
    parts = {path.name for path in (ROOT / "benchmarks").iterdir() if path.name != "__pycache__"}
    outside = {"conformance", "domains", "parts", "RESULTS.md", "results.py", "certificates.py"}
    assert {Path(name).name for name in forced if name.startswith("benchmarks/")} == parts - outside
