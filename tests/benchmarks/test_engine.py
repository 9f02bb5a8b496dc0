"""The engine: keys, the store, resuming, measured and killed processes here and on a cluster, Ctrl-C, statistics."""

import json
import os
import re
import signal
import subprocess
import sys
import warnings
from collections import Counter
from enum import Enum
from fractions import Fraction
from itertools import product
from pathlib import Path
from statistics import correlation, linear_regression, stdev

import pytest

import robust
from benchmarks.engine.show import Panel, Series, draw, quantile
from benchmarks.engine.stats import LineFit, Mean, Pairing, Proportion
from robust.errors import InputError, UnsupportedError
from robust.sweeps import sweep as pool
from robust.sweeps.sweep import ATTEMPTS, SCHEMA, Store, Task, key_of
from tests.benchmarks.conftest import Squared, attempts, deadly, navigation, square, sweep_of, task
from tests.children import eventually, is_running
from tests.tables import text_in_data

ROOT = Path(__file__).parents[2]
HEADER = json.dumps({"schema": SCHEMA, "robust": robust.__version__})
Colour = Enum("Colour", {"RED": "red"})
either_way = pytest.mark.parametrize("jobs", [1, 2])


@pytest.fixture
def files(tmp_path):
    """Where a store and a log of attempts are."""
    return tmp_path / "store", tmp_path / "log"


def tasks(log, count, seconds=0.0):
    return [task(number, log, seconds) for number in range(count)]


def values(sweep):
    return [record.square for _, record in sweep.results]


def reasons(sweep):
    return {failure.task: failure.reason for failure in sweep.failures}


def test_keys_are_stable_and_tell_tasks_apart():
    given = (1, Path("log"), 0.0, Fraction(1, 2), Colour.RED)
    assert key_of(square, task(*given)) == key_of(square, Task("other", given)) == "4f8e06daa3284f85e684412e249ba6c5"
    others = [task(2, *given[1:]), task(1, Path("l"), *given[2:]), task(*given[:3], Fraction(1, 3), Colour.RED)]
    assert len({key_of(square, one) for one in (task(*given), *others)} | {key_of(deadly, task(*given))}) == 5
    for value, error in ((object(), NotImplementedError), (float("nan"), ValueError)):
        with pytest.raises(error):
            key_of(square, task(value, Path("log")))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f'{HEADER}\n{{"key": 1, "result": 2}}\n', ":2: found no result, expected those of a store"),
        ('{"schema": "x"}\n', ":1: found schema 'x', expected a store of results"),
        (f'{{"schema": "{SCHEMA}", "robust": "0.0.0"}}\n', r":1: found results of robust 0\.0\.0"),
    ],
)
def test_what_is_no_store_is_left_alone(text, message, tmp_path):
    path = tmp_path / "plan.stn"
    path.write_text(text)
    with pytest.raises(InputError, match="plan.stn" + message):
        Store(path)
    assert path.read_text() == text


@either_way
def test_every_task_once_in_order_and_not_again(files, jobs):
    store, log = files
    seen = []
    options = {"store": store, "jobs": jobs, "on_result": lambda *progress: seen.append(progress)}
    sweep = sweep_of([*tasks(log, 4), task(2, log, 0.0)], describe=lambda record: str(record.square), **options)
    assert values(sweep) == [0, 1, 4, 9]
    assert (sweep.complete, sweep.failures, sweep.notes, sweep.total, sweep.resumed) == (True, (), (), 4, 0)
    assert [one[:2] for one in seen] == [(n, 4) for n in range(1, 5)]
    assert {one[2] for one in seen} == {f"square {n}: {n * n}" for n in range(4)}
    again = sweep_of(tasks(log, 6), store=store, jobs=jobs)
    assert values(again) == [0, 1, 4, 9, 16, 25]
    assert (again.resumed, again.notes) == (4, (f"4 of 6 results are from {store}",))
    assert (attempts(log), sweep_of(tasks(log, 2), store=store, jobs=jobs).resumed) == (Counter(range(6)), 2)


@either_way
def test_errors_are_failures_that_a_rerun_tries_again(files, jobs):
    store, log = files
    for count in (1, 2):
        sweep = sweep_of([task(2, log), task(-1, log), task(3, log)], store=store, jobs=jobs)
        assert (values(sweep), sweep.complete) == ([4, 9], True)
        assert reasons(sweep) == {"square -1": "ValueError: negative"}
        assert "1 of 3 tasks failed; square -1: ValueError: negative" in sweep.notes
        assert attempts(log) == Counter({2: 1, -1: count, 3: 1})


@either_way
def test_what_earlier_records_settle_is_not_started(files, jobs):
    def settled(_, records):
        return Squared(0) if any(one.square >= 4 for one in records) else None

    sweep = sweep_of(tasks(files[1], 6, 0.05), jobs=jobs, settled=settled)
    started = set(attempts(files[1]))
    assert started in ({0, 1, 2}, {0, 1, 2, 3}) if jobs == 2 else started == {0, 1, 2}
    assert values(sweep) == [number**2 if number in started else 0 for number in range(6)]


def test_killed_processes(files):
    store, log = files
    sweep = sweep_of(tasks(log, 8, 0.02), deadly, store=store, jobs=2)
    assert values(sweep) == [number**2 for number in range(8) if number != 3]
    assert reasons(sweep) == {"square 3": "its process was killed 3 times"}
    # What others do is not lost with it.
    assert attempts(log) == Counter(range(8)) + Counter({3: ATTEMPTS - 1, 5: 1})
    assert len(Store(store).results) == 7


DRIVER = text_in_data(__file__, "driver.txt")
RECORDED = text_in_data(__file__, "recorded.txt")


def driver(script, *words):
    """A process with a session of its own, as one that was started in a terminal."""
    return subprocess.Popen(
        [sys.executable, "-P", "-c", script, *map(str, words)],  # what stands in for `robust` is for its children
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


@either_way
def test_interrupted(files, jobs):
    """As a terminal does it: the signal goes to all processes of the group."""
    store, log = files
    with driver(DRIVER, log, store, jobs) as process:
        assert eventually(lambda: log.exists() and len(log.read_text().splitlines()) == 2 + jobs, 60)
        os.killpg(process.pid, signal.SIGINT)
        output, errors = process.communicate(timeout=30)
    assert (process.returncode, errors) == (0, "")
    note = f"incomplete: 2 of 6 tasks done; run the same command again, with --store {store}, to resume"
    assert json.loads(output) == [[0, 1], False, [note]]
    for pid in {int(line.split()[1]) for line in log.read_text().splitlines()}:
        assert eventually(lambda pid=pid: not is_running(pid))
    with Store(store) as opened:
        assert len(opened.results) == 2


@either_way
def test_the_children_end_when_only_their_parent_is_interrupted(make_suite, stand, tmp_path, jobs):
    noted = f"open({str(tmp_path)!r} + f'/pid{{os.getpid()}}', 'w').close(); time.sleep(60)"
    stand(f"if sys.argv[-2] != '--order=quick': {noted}")
    slow = (navigation(f"slow{i}", irr_order=["slow"]) for i in range(4))
    with driver(RECORDED, make_suite(navigation("quick", irr_order=["quick"]), *slow), jobs) as process:
        assert eventually(lambda: len(list(tmp_path.glob("pid*"))) == jobs, 60)
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=30)
    assert (process.returncode, errors) == (0, "")
    report = json.loads(output)
    assert (report["complete"], [row["instance"] for row in report["rows"]]) == (False, ["quick"])
    assert report["notes"][-1] == "incomplete: interrupted after 1 of 5 instances"
    for path in tmp_path.glob("pid*"):
        assert eventually(lambda pid=int(path.name[3:]): not is_running(pid))


@pytest.fixture(scope="module")
def cluster():
    distributed = pytest.importorskip("distributed")
    shape = {"n_workers": 3, "threads_per_worker": 1, "processes": True, "dashboard_address": None}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with distributed.LocalCluster(**shape, silence_logs=50) as local:
            yield local


def test_cluster_with_a_killed_worker(cluster, files):
    store, log = files
    before = [worker.pid for worker in cluster.workers.values()]
    killed = []

    def kill(done, _total, _line):
        if done == 6:
            killed.append(int(log.read_text().splitlines()[-1].split()[1]))  # a busy one
            os.kill(killed[0], signal.SIGKILL)

    sweep = sweep_of(tasks(log, 30, 0.1), store=store, cluster=cluster.scheduler_address, on_result=kill)
    assert killed[0] in before
    assert (values(sweep), sweep.complete, sweep.failures) == ([number**2 for number in range(30)], True, ())
    tried = attempts(log)
    assert set(tried) == set(range(30))
    assert tried.total() > 30  # what the killed worker was doing was done again
    assert len(store.read_text().splitlines()) == 31  # and counted once
    again = sweep_of(tasks(log, 32, 0.1), store=store, cluster=cluster.scheduler_address)
    assert (values(again), again.resumed) == ([number**2 for number in range(32)], 30)
    assert attempts(log) - tried == Counter({30: 1, 31: 1})


def test_failures_on_a_cluster(cluster, files):
    log = files[1]
    sweep = sweep_of([*tasks(log, 5, 0.1), task(-1, log)], deadly, cluster=cluster.scheduler_address)
    assert (values(sweep), reasons(sweep).keys()) == ([0, 1, 4, 16], {"square 3", "square -1"})
    assert "its worker died again and again" in reasons(sweep)["square 3"]
    assert reasons(sweep)["square -1"] == "ValueError: negative"


def test_workers_with_another_version_or_none(cluster, monkeypatch, files):
    with monkeypatch.context() as patched:
        patched.setattr(robust, "__version__", "9.0")
        with pytest.raises(InputError, match=r"found robust 0\..* on worker tcp:.*, expected 9\.0 as here"):
            sweep_of(tasks(files[1], 1), cluster=cluster.scheduler_address)
    monkeypatch.setattr(pool, "_version", lambda: 1 / 0)
    with pytest.raises(InputError, match=r"found no such robust \(.*division by zero.*\) on worker tcp:"):
        sweep_of(tasks(files[1], 1), cluster=cluster.scheduler_address)


def test_no_cluster(monkeypatch, files):
    with pytest.raises(InputError, match="choose one"):
        sweep_of([], jobs=2, cluster="tcp://127.0.0.1:1")
    pytest.importorskip("distributed")
    monkeypatch.setattr(pool, "PATIENCE", 0.3)
    for address in ("tcp://127.0.0.1:9", "tls://127.0.0.1:9", "nonsense://x", "x y"):
        with pytest.raises(InputError, match="found no Dask scheduler at") as caught:
            sweep_of(tasks(files[1], 1), cluster=address)
        assert "\n" not in str(caught.value)
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(UnsupportedError, match=r"found no Dask.*robust-plans\[cluster\]"):
        sweep_of(tasks(files[1], 1), cluster="tcp://127.0.0.1:9")


@pytest.mark.parametrize(
    ("successes", "trials", "bounds"),
    [(81, 263, (0.2553, 0.3662)), (15, 148, (0.0624, 0.1605)), (0, 20, (0.0, 0.1611)), (1, 29, (0.0061, 0.1718))],
)
def test_wilson_intervals(successes, trials, bounds):
    """Newcombe (1998), Table I, method 3."""
    assert Proportion(successes, trials).interval == pytest.approx(bounds, abs=5e-5)
    low, high = Proportion(trials - successes, trials).interval
    assert (1 - high, 1 - low) == pytest.approx(bounds, abs=5e-5)
    for wrong in ((0, 0), (-1, 3), (4, 3)):
        with pytest.raises(ValueError, match="no proportion"):
            Proportion(*wrong)


def test_mcnemar_by_brute_force():
    assert Pairing.of([(True, False)] * 6 + [(False, True)] + [(True, True), (False, False)]) == Pairing(6, 1, 1, 1)
    for first, second in product(range(7), repeat=2):
        count, observed = first + second, abs(first - second)
        as_uneven = sum(abs(2 * sum(wins) - count) >= observed for wins in product((0, 1), repeat=count))
        assert Pairing(first, second, 3, 4).p_value == pytest.approx(as_uneven / 2**count)


def test_means():
    assert (Mean.of([]), Mean.of([2.0])) == (None, Mean(2.0, None))
    numbers = [0.5, 1.5, 4.0, 2.5]
    mean = Mean.of(numbers)
    assert mean.value == 2.125
    # Student's t for three degrees of freedom is 3.1824.
    assert mean.interval[1] - 2.125 == pytest.approx(3.1824 * stdev(numbers) / 2, rel=1e-4)


def test_a_line():
    points = [(1, 0), (1, 1), (2, 1), (3, 2), (4, 2), (5, 4)]
    fit = LineFit.of(points)
    xs, ys = zip(*points, strict=True)
    assert (fit.slope, fit.intercept) == pytest.approx(tuple(linear_regression(xs, ys)))
    assert fit.r_squared == pytest.approx(correlation(xs, ys) ** 2)
    # Student's t for four degrees of freedom is 2.7764; the spread of the abscissas is 40 / 3.
    residual = sum((y - fit.intercept - fit.slope * x) ** 2 for x, y in points)
    assert fit.interval[1] - fit.slope == pytest.approx(2.7764 * (residual / 4 / (40 / 3)) ** 0.5, rel=1e-4)
    assert LineFit.of([(1, 2), (1, 3)]) is None
    assert LineFit.of([(1, 2), (2, 4)]) == LineFit(2, None, 0, 1)
    assert LineFit.of([(1, 2), (2, 2), (3, 2)]).r_squared == 1


@pytest.mark.parametrize(("size", "expected"), [(10, 9), (11, 10), (1, 1), (0, None)])
def test_a_quantile_is_the_least_that_enough_values_do_not_exceed(size, expected):
    assert quantile(list(range(1, size + 1)), 0.9) == expected


def test_axes_of_times_have_numbers_and_legends_room(tmp_path):
    method = "region, loos-weispfenning: 1 of 1"
    lines = [Series([(2, 0.33), (3, 0.57)], f"{method} {number}", marker="o") for number in range(8)]
    draw(tmp_path / "plot.svg", [Panel("", lines, "parameters", "time", seconds="y")], 5.2, 5, legend="below")
    text = (tmp_path / "plot.svg").read_text(encoding="utf-8")
    assert "<!-- 0.4 s -->" in text, "between two powers of ten"
    (frame,) = re.findall(
        r'<g id="legend_1">\s*<g id="patch_\d+">\s*<path d="M (-?[\d.]+) [\d.]+ \s*L (-?[\d.]+) ', text
    )
    assert 0 <= min(map(float, frame)) < max(map(float, frame)) <= 5.5 * 72
