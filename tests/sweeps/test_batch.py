"""Many plans at once: what is asked of each is what is asked of one; stores, limits, Ctrl-C, clusters, tables."""

import csv
import json
import os
import signal
import subprocess
import sys
import warnings
from dataclasses import replace
from fractions import Fraction
from html.parser import HTMLParser
from io import StringIO
from pathlib import Path

import jsonschema
import pytest

import robust
from benchmarks.generators.delivery import scaling_instance
from benchmarks.generators.sizes import unordered_instance
from robust.draw.interactive import batch_page
from robust.errors import InputError, UnsupportedError
from robust.qe.box import Box, Interval
from robust.show.batch import batch_document as document
from robust.show.batch import csv_text, exact_box, print_batch
from robust.show.console import console
from robust.show.schemas import schema
from robust.sweeps import batch as batches
from robust.sweeps.batch import Asked, Batch, BatchRow, PlanRun, box_of, run_batch, volume_ratio, worst
from robust.sweeps.suites import SuitePlan
from tests.children import eventually, is_running
from tests.draw.browser import browser

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "robust" / "examples"
NAVIGATION = EXAMPLES / "two_sample_navigation"
COSTS = {"seconds": 0.0, "cpu_s": 0.0, "memory_mb": 0.0, "search_s": None, "first_widening_s": None}


def write(folder, name, texts, plan="plan.stn"):
    """An instance in a folder of its own."""
    directory = folder / name
    directory.mkdir(parents=True)
    for file, text in zip(("domain.pddl", "problem.pddl", plan), texts, strict=True):
        (directory / file).write_text(text, encoding="utf-8")
    return directory


def deliveries(folder, count):
    """Delivery plans with one to three parameters."""
    for seed in range(count):
        *texts, specs = scaling_instance(1 + seed % 3, seed)
        directory = write(folder, f"{seed:02}", texts, "steps.plan")
        actions = (spec.removeprefix("duration:") for spec in specs)
        tables = [f'[parameters."{action}"]\nduration = "{action}"\n' for action in actions]
        (directory / "steps.toml").write_text("\n".join(tables), encoding="utf-8")
    return folder


def costless(found):
    """What was answered, without what it cost."""
    return [(row.instance, {name: replace(run, **COSTS) for name, run in row.runs.items()}) for row in found.plans]


@pytest.fixture
def suite(tmp_path):
    """A valid plan, one that is not, one that cannot be read, and one that is not there."""
    files = "domain.pddl problem.pddl"
    (tmp_path / "bad.stn").write_text("parameter a default 1;\nnonsense\n")
    path = tmp_path / "suite.txt"
    path.write_text(
        "".join(
            f"{' '.join(str(NAVIGATION / name) for name in files.split())} {plan}\n"
            for plan in (NAVIGATION / "plan.stn", NAVIGATION / "plan-flexible-wait.stn", "bad.stn", "none.stn")
        )
    )
    return path


# -- what is asked of each is what is asked of one ---------------------------------------------------------------------


def test_check_of_plans_some_of_which_are_wrong(suite):
    lines = []
    found = robust.batch("check", suite, jobs=2, on_result=lambda *line: lines.append(line))
    runs = [row.runs["check"] for row in found.plans]
    assert [run.status for run in runs] == ["proved", "refuted", "error", "error"]
    assert [run.exit_code for run in runs] == [0, 1, 2, 2]
    assert runs[1].message == "drive_3 drive: over all (daylight): (daylight) is false"
    assert runs[2].message.startswith("bad.stn:2:")  # and not where the text was written for the process
    assert runs[3].message == "none.stn: found no such file, expected a readable text file"
    assert (found.status, found.total, found.exit_code) == ("complete", 4, 1)
    assert [line[:2] for line in lines] == [(1, 3), (2, 3), (3, 3)]
    assert runs[0].seconds > 0 < runs[0].memory_mb


def test_envelope_and_region_are_those_of_single_plans(tmp_path):
    write(tmp_path, "jobs", unordered_instance(2, 2))
    plan = robust.load_plan(*(tmp_path / "jobs" / name for name in ("domain.pddl", "problem.pddl", "plan.stn")))
    (run,) = robust.batch("envelope", tmp_path, method="irr", beta="1/2", doubling=True).plans[0].runs.values()
    assert box_of(run.box) == robust.envelope(plan, method="irr", beta="1/2", doubling=True).box
    assert run.first_widening_s is not None
    (run,) = robust.batch("region", tmp_path).plans[0].runs.values()
    assert robust.Region.from_dict(run.region).equals(robust.region(plan).region)


def test_options_reach_every_plan(tmp_path):
    write(tmp_path, "jobs", unordered_instance(2, 1))
    (tmp_path / "more.toml").write_text('[parameters."d1"]\nupper = 12\n')
    (first,) = robust.batch("envelope", tmp_path, parameter=["duration:work_2"]).plans
    assert set(first.runs["envelope"].box) == {"d1", "dur_work_2"}
    (second,) = robust.batch("envelope", tmp_path, parameters=tmp_path / "more.toml").plans
    assert second.runs["envelope"].box == {"d1": ("0", "12")}
    (third,) = robust.batch("check", tmp_path, parameter=["duration:none"]).plans
    assert third.exit_code == 2
    assert "'none'" in third.runs["check"].message


def test_parameters_beside_a_plan_count(tmp_path):
    write(tmp_path, "jobs", unordered_instance(2, 1))
    (tmp_path / "jobs" / "plan.toml").write_text('[parameters."d1"]\nupper = 11\n')
    (row,) = robust.batch("envelope", tmp_path).plans
    assert row.runs["envelope"].box == {"d1": ("0", "11")}


# -- CCMMZ against IRR -------------------------------------------------------------------------------------------------


def test_comparison(tmp_path):
    deliveries(tmp_path, 2)
    found = robust.batch("compare", tmp_path, region="project", jobs=2)
    assert [one.name for one in found.asked] == ["irr", "ccmmz", "region"]
    for row in found.plans:
        files = (row.instance.domain, row.instance.problem, row.instance.plan)
        plan = robust.load_plan(*(tmp_path / name for name in files))
        irr = robust.envelope(plan, method="irr", doubling=True).box
        ccmmz = robust.envelope(plan, method="optimal").box
        assert box_of(row.runs["irr"].box) == irr
        assert box_of(row.runs["ccmmz"].box).total_width == ccmmz.total_width
        assert row.width_ratio == irr.total_width / ccmmz.total_width <= 1
        assert row.volume_ratio is not None
        assert row.runs["region"].region is not None
    assert [found.solved(name).plans for name in ("irr", "ccmmz", "region")] == [2, 2, 2]
    assert found.exit_code == 0


def interval(lower, upper):
    return Interval(
        None if lower is None else Fraction(lower),
        None if upper is None else Fraction(upper),
        lower_closed=lower is not None,
        upper_closed=upper is not None,
    )


@pytest.mark.parametrize(
    ("box", "other", "expected"),
    [
        ({"a": (0, 1), "b": (0, 3)}, {"a": (0, 2), "b": (1, 4)}, Fraction(1, 2)),
        ({"a": (0, 1), "b": (3, 3)}, {"a": (0, 2), "b": (1, 1)}, Fraction(1, 2)),  # the plane of a
        ({"a": (0, 1), "b": (3, 3)}, {"a": (0, 2), "b": (1, 2)}, Fraction(0)),
        ({"a": (0, 1), "b": (1, 2)}, {"a": (0, 2), "b": (1, 1)}, None),
        ({"a": (0, None)}, {"a": (0, 2)}, None),
        ({"a": (0, 1)}, {"a": (None, 2)}, None),
        ({"a": (1, 1)}, {"a": (1, 1)}, None),
        ({}, {}, None),
    ],
)
def test_shares_of_volumes(box, other, expected):
    first, second = (Box({name: interval(*ends) for name, ends in one.items()}) for one in (box, other))
    assert volume_ratio(first, second) == expected


def test_a_refutation_counts_more_than_what_is_not_known():
    assert [worst(codes) for codes in ([], [0, 0], [0, 3], [3, 4], [3, 4, 2], [3, 4, 2, 1, 0])] == [0, 0, 3, 4, 2, 1]


# -- stores, limits, Ctrl-C --------------------------------------------------------------------------------------------


def test_a_store_keeps_what_is_known_until_a_plan_changes(tmp_path):
    plans = deliveries(tmp_path / "plans", 2)
    store = tmp_path / "store"
    first = robust.batch("check", plans, store=store)
    lines = []
    changed = plans / "00" / "steps.plan"
    changed.write_text(f"; a comment\n{changed.read_text()}")
    again = robust.batch("check", plans, store=store, on_result=lambda *line: lines.append(line))
    assert [line[2].split(":")[0] for line in lines] == ["00/steps.plan"]
    assert again.notes == (f"1 of 2 results are from {store}",)
    assert costless(again) == costless(first)
    assert len(store.read_text().splitlines()) == 4


def test_a_killed_process_is_an_error_that_a_later_run_tries_again(tmp_path, monkeypatch):
    plans, store = deliveries(tmp_path / "plans", 1), tmp_path / "store"
    monkeypatch.setattr(batches, "COMMAND", ("sh", "-c", "kill -9 $$"))
    (row,) = robust.batch("check", plans, store=store).plans
    assert (row.exit_code, row.runs["check"].status) == (3, "error")
    assert "exit code -9" in row.runs["check"].message
    monkeypatch.undo()
    (row,) = robust.batch("check", plans, store=store).plans
    assert row.runs["check"].status == "proved"


def test_limits_of_single_plans_give_sound_boxes_or_none(tmp_path):
    write(tmp_path, "jobs", unordered_instance(7, 7))
    (row,) = robust.batch("envelope", tmp_path, encoding="positions", limit=2).plans
    run = row.runs["envelope"]
    assert (run.status, run.exit_code) == ("timeout", 3)
    assert run.seconds < 2 + batches.GRACE + 1
    for name, one in box_of(run.box or {}).intervals.items():
        assert (name[0], one.lower >= 0) == ("d", True)
    assert row.volume_ratio is None


def test_regions_that_take_longer_than_their_limit(tmp_path):
    write(tmp_path, "jobs", unordered_instance(8, 8))
    (row,) = robust.batch("region", tmp_path, encoding="positions", limit=2).plans
    run = row.runs["region"]
    assert (run.status, run.exit_code, run.region) == ("timeout", 3, None)
    assert run.message


SLEEPER = """
import os, sys, time
sys.argv[2].endswith("domain.pddl") or sys.exit(5)
if "quick" in open(sys.argv[4]).read():
    print('{"verdict": "proved", "counterexample": null, "reason": null, "seconds": 0.1}'); sys.exit(0)
open(os.environ["PIDS"] + f"/{os.getpid()}", "w").close()
time.sleep(60)
"""


def sleeping(tmp_path, monkeypatch):
    """A suite of one plan that is checked at once and others that never are; and where processes say that they are."""
    pids, plans = tmp_path / "pids", tmp_path / "plans"
    pids.mkdir()
    for name in ("a quick", "b", "c", "d"):
        write(plans, name, (f"(define (domain x)) ; {name}", "(define (problem x))", name))
    (tmp_path / "sleeper.py").write_text(SLEEPER)
    monkeypatch.setenv("PIDS", str(pids))
    return plans, pids


def test_out_of_time(tmp_path, monkeypatch):
    plans, pids = sleeping(tmp_path, monkeypatch)
    monkeypatch.setattr(batches, "COMMAND", (sys.executable, str(tmp_path / "sleeper.py")))
    found = robust.batch("check", plans, timeout=3, jobs=2, store=tmp_path / "store")
    assert [row.instance.name for row in found.plans] == ["a quick/plan.stn"]
    assert (found.status, found.exit_code, found.total) == ("timeout", 3, 4)
    (note,) = found.notes
    assert note.startswith("incomplete: 1 of 4 tasks done; run the same command again, with --store ")
    assert len(list(pids.iterdir())) == 2
    for path in pids.iterdir():
        assert eventually(lambda pid=int(path.name): not is_running(pid))


INTERRUPTED = """
import sys
from robust.sweeps import batch
batch.COMMAND = (sys.executable, sys.argv[1])
from robust.cli import main
sys.argv[1:2] = ["batch", "check"]
main()
"""


def test_interrupted(tmp_path, monkeypatch):
    plans, pids = sleeping(tmp_path, monkeypatch)
    words = [str(tmp_path / "sleeper.py"), str(plans), "--json", "--jobs", "2", "--store", str(tmp_path / "store")]
    with subprocess.Popen(
        [sys.executable, "-c", INTERRUPTED, *words],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        assert eventually(lambda: len(list(pids.iterdir())) == 2, 60)
        os.killpg(process.pid, signal.SIGINT)
        output, errors = process.communicate(timeout=30)
    assert (process.returncode, errors) == (3, "")
    answer = json.loads(output)
    assert (answer["status"], answer["total"], len(answer["plans"])) == ("interrupted", 4, 1)
    assert "to resume" in answer["notes"][0]
    for path in pids.iterdir():
        assert eventually(lambda pid=int(path.name): not is_running(pid))


# -- on a cluster ------------------------------------------------------------------------------------------------------


@pytest.fixture
def cluster():
    distributed = pytest.importorskip("distributed")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
        ) as local:
            yield local


def compared_with_a_killed_worker(tmp_path, cluster, count):
    """CCMMZ against IRR on two workers, one of which is killed half-way: as on this machine, nothing twice."""
    plans, store = deliveries(tmp_path / "plans", count), tmp_path / "store"
    workers = [worker.pid for worker in cluster.workers.values()]
    assert len(workers) == 2
    killed = []

    def kill(done, _total, _line):
        if done == count // 2:
            os.kill(workers[0], signal.SIGKILL)
            killed.append(workers[0])

    found = robust.batch("compare", plans, cluster=cluster.scheduler_address, store=store, on_result=kill)
    assert killed == workers[:1]
    assert (found.status, len(found.plans), found.exit_code) == ("complete", count, 0)
    assert all(set(row.runs) == {"irr", "ccmmz"} for row in found.plans)
    labels = [json.loads(line)["task"] for line in store.read_text().splitlines()[1:]]
    assert len(labels) == len(set(labels)) == 2 * count
    serial = robust.batch("compare", plans)
    assert costless(found) == costless(serial)
    again = robust.batch("compare", plans, store=store, on_result=lambda *_: pytest.fail("asked again"))
    assert costless(again) == costless(serial)


def test_two_workers_one_of_which_is_killed(tmp_path, cluster):
    compared_with_a_killed_worker(tmp_path, cluster, 3)


@pytest.mark.slow
def test_sixty_plans_on_two_workers_one_of_which_is_killed(tmp_path, cluster):
    compared_with_a_killed_worker(tmp_path, cluster, 60)


def test_without_dask(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(UnsupportedError, match=r"found no Dask.*robust-plans\[cluster\]"):
        robust.batch("check", deliveries(tmp_path, 1), cluster="tcp://127.0.0.1:9")


def test_several_processes_need_no_extra(monkeypatch, tmp_path):
    for name in ("distributed", "dask"):
        monkeypatch.setitem(sys.modules, name, None)
    assert robust.batch("check", deliveries(tmp_path, 2), jobs=2).exit_code == 0


# -- what is wrong with options ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("verb", "given", "message"),
    [
        ("chekc", {}, "unknown verb 'chekc'; did you mean 'check'"),
        ("check", {"jobs": 0}, "jobs: found '0', expected a whole number from 1"),
        ("check", {"jobs": 2, "cluster": "x"}, "jobs: cannot be combined with cluster; choose one"),
        ("check", {"limit": "x"}, "limit: found 'x', expected a number"),
        ("envelope", {"method": "best"}, "unknown method 'best'"),
        ("envelope", {"beta": 1}, "beta: found it with method='widen', expected method='irr', or no beta"),
        ("compare", {"region": "none"}, "unknown region 'none'"),
    ],
)
def test_wrong_options(tmp_path, verb, given, message):
    with pytest.raises(InputError) as caught:
        robust.batch(verb, tmp_path, **given)
    assert str(caught.value).startswith(message)


# -- tables ------------------------------------------------------------------------------------------------------------

HOSTILE = "<script>alert('1')</script>&\"x\" ]]>\n=cmd"


def made(verb, *runs):
    """A batch of plans with hostile names, without anything being run."""
    asked = [Asked(name, "envelope") for name in (("irr", "ccmmz") if verb == "compare" else (verb,))]
    rows = [
        BatchRow(SuitePlan(f"{number} {HOSTILE}", HOSTILE, HOSTILE, HOSTILE), {one.name: run for one in asked})
        for number, run in enumerate(runs)
    ]
    return Batch(verb, HOSTILE, tuple(asked), tuple(rows), len(runs), "complete", (HOSTILE,), 1.5)


RUNS = (
    PlanRun("complete", 0, 1.0, 0.5, 70.0, box={"a": ("1/3", "7/2 (open)"), HOSTILE: ("-inf", "inf")}),
    PlanRun("error", 2, message=HOSTILE),
    PlanRun("timeout", 3, 10.0),
)


class Page(HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.tags, self.attributes, self.words = [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.attributes += attributes

    def handle_data(self, data):
        self.words.append(data)


@pytest.mark.parametrize("verb", ["check", "envelope", "compare"])
def test_pages_escape_everything_and_need_no_network(verb):
    text = batch_page(made(verb, *RUNS))
    page = Page(text)
    assert page.tags.count("script") == 1
    assert page.tags.count("tr") == 4
    assert HOSTILE in "".join(page.words)
    assert not [name for name, _ in page.attributes if name in {"src", "href"} or name.startswith("on")]
    assert "http:" not in text
    assert "https:" not in text


def test_headings_sort_the_table_by_keyboard(tmp_path):
    timed = [replace(RUNS[0], seconds=seconds) for seconds in (9.5, 10.25, 0.5)]
    path = tmp_path / "page.html"
    path.write_text(batch_page(made("envelope", *timed)), encoding="utf-8")
    with browser(width=360) as window:
        window.get(path.as_uri())

        def shown():
            return [cell.text for cell in window.find_elements("css selector", "tbody td:nth-child(3)")]

        assert shown() == ["9.50", "10.25", "0.50"]
        button = window.find_elements("css selector", "th button")[2]
        button.send_keys("\n")
        assert shown() == ["0.50", "9.50", "10.25"]
        button.send_keys("\n")
        assert shown() == ["10.25", "9.50", "0.50"]
        assert button.find_element("xpath", "..").get_attribute("aria-sort") == "descending"
        assert not window.get_log("browser")
        assert window.execute_script("return document.documentElement.scrollWidth <= window.innerWidth")


@pytest.mark.parametrize("verb", ["envelope", "compare"])
def test_csv_is_read_back(verb):
    found = made(verb, *RUNS)
    head, *rows = csv.reader(StringIO(csv_text(found)))
    assert len({len(head), *map(len, rows)}) == 1
    first = dict(zip(head, rows[0], strict=True))
    box = "irr_box" if verb == "compare" else "box"
    assert first["instance"] == f"0 {HOSTILE}"
    assert first[box] == exact_box(RUNS[0]) == f"a [1/3, 7/2); {HOSTILE} (-inf, inf)"
    assert dict(zip(head, rows[1], strict=True))[box] == ""


@pytest.mark.parametrize("verb", ["check", "envelope", "region", "compare"])
def test_documents_are_as_published(verb):
    answer = document(made(verb, *RUNS))
    jsonschema.validate(answer, schema(answer["schema"]))
    assert answer["exit_code"] == 2
    if verb != "compare":
        assert answer["counts"] == {"complete": 1, "error": 1, "timeout": 1}


def test_what_people_see(capsys):
    print_batch(console(), made("compare", *RUNS), quiet=False)
    shown = capsys.readouterr().out
    assert "IRR answers 1 of 3 in 1.00 s" in shown
    assert "CCMMZ answers 1 of 3" in shown


@pytest.mark.parametrize("option", ["csv", "html"])
def test_files_that_cannot_be_written_are_noticed_before_anything_runs(option, tmp_path):
    words = ["batch", "check", str(EXAMPLES), f"--{option}", str(tmp_path / "none" / "a")]
    run = subprocess.run(
        [sys.executable, "-m", "robust", *words], capture_output=True, text=True, check=False, cwd=ROOT
    )
    assert run.returncode == 2
    assert run.stderr.startswith(f"robust: error: --{option}: found no directory")


def test_a_store_that_is_none(tmp_path):
    (tmp_path / "store").write_text("x\n")
    with pytest.raises(InputError, match="store"):
        run_batch("check", [("check", "check", ())], deliveries(tmp_path / "plans", 1), store=tmp_path / "store")
