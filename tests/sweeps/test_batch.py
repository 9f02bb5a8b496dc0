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
from robust import Box, InputError, Interval
from robust.draw.interactive import batch_page
from robust.show.batch import batch_document, csv_text, exact_box, print_batch
from robust.show.console import console
from robust.sweeps import batch as batches
from robust.sweeps.batch import Asked, Batch, BatchRow, PlanRun, SuitePlan, box_of, run_batch, volume_ratio, worst
from tests.children import eventually, is_running
from tests.cli.running import command
from tests.draw.browser import browser
from tests.schemas import schema
from tests.tables import tables, text_in_data

TABLES = tables(__file__)

ROOT = Path(__file__).parents[2]
NAVIGATION = ROOT / "robust" / "examples" / "two_sample_navigation"
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


def costless(batch):
    """What was answered, without what it cost."""
    return [(row.instance, {name: replace(run, **COSTS) for name, run in row.runs.items()}) for row in batch.plans]


def only_run(verb, folder, **options):
    """The run of a batch of one plan."""
    ((run,),) = (row.runs.values() for row in robust.batch(verb, folder, **options).plans)
    return run


def test_check_of_plans_some_of_which_are_wrong(tmp_path):
    """A valid plan, one that is not, one that cannot be read, and one that is not there."""
    (tmp_path / "bad.stn").write_text("parameter a default 1;\nnonsense\n")
    plans = (NAVIGATION / "plan.stn", NAVIGATION / "plan-flexible-wait.stn", "bad.stn", "none.stn")
    listed = (f"{NAVIGATION / 'domain.pddl'} {NAVIGATION / 'problem.pddl'} {plan}\n" for plan in plans)
    (tmp_path / "suite.txt").write_text("".join(listed))
    lines = []
    batch = robust.batch("check", tmp_path / "suite.txt", jobs=2, on_result=lambda *line: lines.append(line))
    runs = [row.runs["check"] for row in batch.plans]
    assert [(run.status, run.exit_code) for run in runs] == [("proved", 0), ("refuted", 1), ("error", 2), ("error", 2)]
    assert runs[1].message == "drive_3 drive: over all (daylight): (daylight) is false"
    assert runs[2].message.startswith("bad.stn:2:")  # and not where the text was written for the process
    assert runs[3].message == "none.stn: found no such file, expected a readable text file"
    assert (batch.status, batch.total, batch.exit_code) == ("complete", 4, 1)
    assert [line[:2] for line in lines] == [(1, 3), (2, 3), (3, 3)]
    assert runs[0].seconds > 0 < runs[0].memory_mb


def test_answers_and_options_are_those_of_single_plans(tmp_path, monkeypatch):
    jobs = write(tmp_path, "jobs", unordered_instance(3, 2))
    plan = robust.load_plan(*(jobs / name for name in ("domain.pddl", "problem.pddl", "plan.stn")))
    options = {"method": "irr", "beta": "1/2", "doubling": True}
    run = only_run("envelope", tmp_path, **options)
    assert box_of(run.box) == robust.envelope(plan, **options).box
    assert run.first_widening_s is not None
    for name in ("distributed", "dask"):  # which several processes do not need
        monkeypatch.setitem(sys.modules, name, None)
    region = robust.Region.from_dict(only_run("region", tmp_path, jobs=2).region)
    assert region.equals(robust.region(plan).region)
    assert set(only_run("envelope", tmp_path, parameter=["duration:work_3"]).box) == {"d1", "d2", "dur_work_3"}
    (tmp_path / "more.toml").write_text('[parameters."d1"]\nupper = 12\n')
    assert only_run("envelope", tmp_path, parameters=tmp_path / "more.toml").box["d1"][1] == "12"
    (jobs / "plan.toml").write_text('[parameters."d1"]\nupper = 11\n')  # beside a plan it counts
    assert only_run("envelope", tmp_path).box["d1"][1] == "11"
    wrong = only_run("check", tmp_path, parameter=["duration:none"])
    assert (wrong.exit_code, "'none'" in wrong.message) == (2, True)


def test_comparison(tmp_path):
    deliveries(tmp_path, 1)
    batch = robust.batch("compare", tmp_path, region="project", jobs=2)
    assert [one.name for one in batch.asked] == ["irr", "ccmmz", "region"]
    (row,) = batch.plans
    files = (row.instance.domain, row.instance.problem, row.instance.plan)
    plan = robust.load_plan(*(tmp_path / name for name in files))
    irr = robust.envelope(plan, method="irr", doubling=True).box
    ccmmz = robust.envelope(plan, method="optimal").box
    assert (box_of(row.runs["irr"].box), box_of(row.runs["ccmmz"].box).total_width) == (irr, ccmmz.total_width)
    assert row.width_ratio == irr.total_width / ccmmz.total_width <= 1
    assert row.volume_ratio is not None
    assert row.runs["region"].region is not None
    assert [batch.solved(name).plans for name in ("irr", "ccmmz", "region")] == [1, 1, 1]
    assert batch.exit_code == 0


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
    def interval(ends):
        return Interval(*(None if end is None else Fraction(end) for end in ends), *(end is not None for end in ends))

    first, second = (Box({name: interval(ends) for name, ends in one.items()}) for one in (box, other))
    assert volume_ratio(first, second) == expected


def test_a_refutation_counts_more_than_what_is_not_known():
    assert [worst(codes) for codes in ([], [0, 0], [0, 3], [3, 4], [3, 4, 2], [3, 4, 2, 1, 0])] == [0, 0, 3, 4, 2, 1]


def test_a_store_keeps_what_is_known_until_a_plan_changes(tmp_path, monkeypatch):
    plans, store = deliveries(tmp_path / "plans", 2), tmp_path / "store"
    with monkeypatch.context() as patched:
        patched.setattr(batches, "COMMAND", ("sh", "-c", "kill -9 $$"))
        for row in robust.batch("check", plans, store=store).plans:  # which a later run tries again
            assert (row.exit_code, row.runs["check"].status) == (3, "error")
            assert "exit code -9" in row.runs["check"].message
    first = robust.batch("check", plans, store=store)
    assert [row.runs["check"].status for row in first.plans] == ["proved"] * 2
    known = len(store.read_text().splitlines())
    lines = []
    changed = plans / "00" / "steps.plan"
    changed.write_text(f"; a comment\n{changed.read_text()}")
    again = robust.batch("check", plans, store=store, on_result=lambda *line: lines.append(line))
    assert [line[2].split(":")[0] for line in lines] == ["00/steps.plan"]
    assert (again.notes, costless(again)) == ((f"1 of 2 results are from {store}",), costless(first))
    assert len(store.read_text().splitlines()) == known + 1


@pytest.mark.parametrize(("verb", "jobs"), [("envelope", 7), ("region", 8)])
def test_limits_of_single_plans_give_sound_answers_or_none(tmp_path, verb, jobs):
    write(tmp_path, "jobs", unordered_instance(jobs, jobs))
    run = only_run(verb, tmp_path, encoding="positions", limit=1)
    assert (run.status, run.exit_code, run.region) == ("timeout", 3, None)
    assert run.seconds < 1 + batches.GRACE + 1
    assert verb == "envelope" or run.message
    assert all((name[0], one.lower >= 0) == ("d", True) for name, one in box_of(run.box or {}).intervals.items())


SLEEPER = text_in_data(__file__, "sleeper.txt")


@pytest.fixture
def sleeping(tmp_path, monkeypatch):
    """A suite of one plan that is checked at once and others that never are; and where processes say that they are."""
    pids, plans = tmp_path / "pids", tmp_path / "plans"
    pids.mkdir()
    for name in ("a quick", "b", "c", "d"):
        write(plans, name, (f"(define (domain x)) ; {name}", "(define (problem x))", name))
    (tmp_path / "sleeper.py").write_text(SLEEPER)
    monkeypatch.setenv("PIDS", str(pids))
    yield plans, pids
    assert len(list(pids.iterdir())) == 2
    for path in pids.iterdir():
        assert eventually(lambda pid=int(path.name): not is_running(pid))


def test_out_of_time(tmp_path, monkeypatch, sleeping):
    monkeypatch.setattr(batches, "COMMAND", (sys.executable, str(tmp_path / "sleeper.py")))
    batch = robust.batch("check", sleeping[0], timeout=3, jobs=2, store=tmp_path / "store")
    assert [row.instance.name for row in batch.plans] == ["a quick/plan.stn"]
    assert (batch.status, batch.exit_code, batch.total) == ("timeout", 3, 4)
    (note,) = batch.notes
    assert note.startswith("incomplete: 1 of 4 tasks done; run the same command again, with --store ")


INTERRUPTED = text_in_data(__file__, "interrupted.txt")


def test_interrupted(tmp_path, sleeping):
    plans, pids = sleeping
    words = [str(tmp_path / "sleeper.py"), str(plans), "--json", "--jobs", "2", "--store", str(tmp_path / "store")]
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "start_new_session": True}
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen([sys.executable, "-c", INTERRUPTED, *words], env=environment, **streams) as process:
        assert eventually(lambda: len(list(pids.iterdir())) == 2, 60)
        os.killpg(process.pid, signal.SIGINT)
        output, errors = process.communicate(timeout=30)
    assert (process.returncode, errors) == (3, "")
    answer = json.loads(output)
    assert (answer["status"], answer["total"], len(answer["plans"])) == ("interrupted", 4, 1)
    assert "to resume" in answer["notes"][0]


@pytest.mark.parametrize("count", [2, pytest.param(60, marks=pytest.mark.slow)])
def test_two_workers_one_of_which_is_killed(tmp_path, count):
    """CCMMZ against IRR on a cluster, where a worker is killed half-way: as on this machine, nothing twice."""
    distributed = pytest.importorskip("distributed")
    plans, store, killed = deliveries(tmp_path / "plans", count), tmp_path / "store", []
    shape = {"n_workers": 2, "threads_per_worker": 1, "processes": True, "dashboard_address": None}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with distributed.LocalCluster(**shape, silence_logs=50) as cluster:
            (first, _) = (worker.pid for worker in cluster.workers.values())

            def kill(done, _total, _line):
                if done == count // 2:
                    os.kill(first, signal.SIGKILL)
                    killed.append(first)

            batch = robust.batch("compare", plans, cluster=cluster.scheduler_address, store=store, on_result=kill)
    assert (killed, batch.status, len(batch.plans), batch.exit_code) == ([first], "complete", count, 0)
    assert all(set(row.runs) == {"irr", "ccmmz"} for row in batch.plans)
    labels = [json.loads(line)["task"] for line in store.read_text().splitlines()[1:]]
    assert len(labels) == len(set(labels)) == 2 * count
    serial = robust.batch("compare", plans)
    again = robust.batch("compare", plans, store=store, on_result=lambda *_: pytest.fail("asked again"))
    assert costless(again) == costless(serial) == costless(batch)


@pytest.mark.parametrize(("verb", "given", "message"), TABLES["wrong options"])
def test_wrong_options(tmp_path, verb, given, message):
    with pytest.raises(InputError) as caught:
        robust.batch(verb, tmp_path, **given)
    assert str(caught.value).startswith(message)


def test_files_that_cannot_be_used_are_noticed_before_anything_runs(tmp_path):
    for option in ("csv", "html"):
        ended = command("batch", "check", NAVIGATION, f"--{option}", tmp_path / "none" / "a")
        assert ended.code == 2
        assert ended.err.startswith(f"robust: error: --{option}: there is no directory")
    (tmp_path / "store").write_text("x\n")
    with pytest.raises(InputError, match="store"):
        run_batch("check", [("check", "check", ())], deliveries(tmp_path / "plans", 1), store=tmp_path / "store")


HOSTILE = "<script>alert('1')</script>&\"x\" ]]>\n=cmd"
RUNS = (
    PlanRun("complete", 0, 1.0, 0.5, 70.0, box={"a": ("1/3", "7/2 (open)"), HOSTILE: ("-inf", "inf")}),
    PlanRun("error", 2, message=HOSTILE),
    PlanRun("timeout", 3, 10.0),
)
every_verb = pytest.mark.parametrize("verb", ["check", "envelope", "region", "compare"])


def batch_of(verb, *runs):
    """A batch of plans with hostile names, without anything being run."""
    asked = [Asked(name, "envelope") for name in (("irr", "ccmmz") if verb == "compare" else (verb,))]
    rows = [
        BatchRow(SuitePlan(f"{number} {HOSTILE}", HOSTILE, HOSTILE, HOSTILE), {one.name: run for one in asked})
        for number, run in enumerate(runs)
    ]
    return Batch(verb, HOSTILE, tuple(asked), tuple(rows), len(runs), "complete", (HOSTILE,), 1.5)


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


@every_verb
def test_pages_escape_everything_and_need_no_network(verb):
    text = batch_page(batch_of(verb, *RUNS))
    page = Page(text)
    assert (page.tags.count("script"), page.tags.count("tr")) == (1, 4)
    assert HOSTILE in "".join(page.words)
    assert not [name for name, _ in page.attributes if name in {"src", "href"} or name.startswith("on")]
    assert not any(scheme in text for scheme in ("http:", "https:"))


def test_headings_sort_the_table_by_keyboard(tmp_path):
    timed = [replace(RUNS[0], seconds=seconds) for seconds in (9.5, 10.25, 0.5)]
    path = tmp_path / "page.html"
    path.write_text(batch_page(batch_of("envelope", *timed)), encoding="utf-8")
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


@every_verb
def test_tables_and_documents(verb, capsys):
    batch = batch_of(verb, *RUNS)
    answer = batch_document(batch)
    jsonschema.validate(answer, schema(answer["schema"]))
    assert answer["exit_code"] == 2
    head, *rows = csv.reader(StringIO(csv_text(batch)))
    assert (len({len(head), *map(len, rows)}), rows[0][head.index("instance")]) == (1, f"0 {HOSTILE}")
    print_batch(console(), batch, quiet=False)
    shown = capsys.readouterr().out
    if verb == "compare":
        assert "IRR answers 1 of 3 in 1.00 s" in shown
        assert "CCMMZ answers 1 of 3" in shown
    else:
        assert answer["counts"] == {"complete": 1, "error": 1, "timeout": 1}
    if verb in {"envelope", "compare"}:
        box = head.index("irr_box" if verb == "compare" else "box")
        assert rows[0][box] == exact_box(RUNS[0]) == f"a [1/3, 7/2); {HOSTILE} (-inf, inf)"
        assert rows[1][box] == ""
