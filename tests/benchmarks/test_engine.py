"""The engine: keys, the store, resuming, measured and killed processes here and on a cluster, Ctrl-C, statistics."""

from __future__ import annotations

import json
import os
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
from benchmarks.engine.show import quantile
from benchmarks.engine.stats import LineFit, Mean, Pairing, Proportion
from robust.errors import InputError, UnsupportedError
from robust.sweeps import sweep as pool
from robust.sweeps.sweep import ATTEMPTS, SCHEMA, Store, Task, key_of
from tests.benchmarks.conftest import navigation
from tests.benchmarks.squares import Squared, attempts, deadly, square, sweep_of, task
from tests.children import eventually, is_running

ROOT = Path(__file__).parents[2]


class Colour(Enum):
    RED = "red"


def tasks(log, count, seconds=0.0):
    return [task(number, log, seconds) for number in range(count)]


def squares(count):
    return [number**2 for number in range(count)]


def values(sweep):
    return [record.square for _, record in sweep.results]


# -- keys and the store ------------------------------------------------------------------------------------------------


def test_keys_are_stable_and_tell_tasks_apart():
    given = (1, Path("log"), 0.0, Fraction(1, 2), Colour.RED)
    assert key_of(square, task(*given)) == key_of(square, Task("other", given)) == "4f8e06daa3284f85e684412e249ba6c5"
    others = [task(2, *given[1:]), task(1, Path("l"), *given[2:]), task(*given[:3], Fraction(1, 3), Colour.RED)]
    assert len({key_of(square, one) for one in (task(*given), *others)} | {key_of(deadly, task(*given))}) == 5
    for value, error in ((object(), NotImplementedError), (float("nan"), ValueError)):
        with pytest.raises(error):
            key_of(square, task(value, Path("log")))


HEADER = json.dumps({"schema": SCHEMA, "robust": robust.__version__})


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


# -- sweeps on this machine --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("jobs", [1, 2])
def test_every_task_once_in_order_and_not_again(tmp_path, jobs):
    store, log = tmp_path / "store", tmp_path / "log"
    seen = []
    sweep = sweep_of(
        [*tasks(log, 4), task(2, log, 0.0)],
        store=store,
        jobs=jobs,
        describe=lambda record: str(record.square),
        on_result=lambda done, total, line: seen.append((done, total, line)),
    )
    assert values(sweep) == squares(4)
    assert (sweep.complete, sweep.failures, sweep.notes, sweep.total, sweep.resumed) == (True, (), (), 4, 0)
    assert [one[:2] for one in seen] == [(n, 4) for n in range(1, 5)]
    assert {one[2] for one in seen} == {f"square {n}: {n * n}" for n in range(4)}
    again = sweep_of(tasks(log, 6), store=store, jobs=jobs)
    assert values(again) == squares(6)
    assert (again.resumed, again.notes) == (4, (f"4 of 6 results are from {store}",))
    assert attempts(log) == Counter(range(6))
    assert sweep_of(tasks(log, 2), store=store, jobs=jobs).resumed == 2


@pytest.mark.parametrize("jobs", [1, 2])
def test_errors_are_failures_that_a_rerun_tries_again(tmp_path, jobs):
    store, log = tmp_path / "store", tmp_path / "log"
    some = [task(2, log), task(-1, log), task(3, log)]
    for count in (1, 2):
        sweep = sweep_of(some, store=store, jobs=jobs)
        assert values(sweep) == [4, 9]
        assert [(one.task, one.reason) for one in sweep.failures] == [("square -1", "ValueError: negative")]
        assert sweep.complete
        assert "1 of 3 tasks failed; square -1: ValueError: negative" in sweep.notes
        assert attempts(log) == Counter({2: 1, -1: count, 3: 1})


@pytest.mark.parametrize("jobs", [1, 2])
def test_what_earlier_records_settle_is_not_started(tmp_path, jobs):
    def settled(_, records):
        return Squared(0) if any(one.square >= 4 for one in records) else None

    sweep = sweep_of(tasks(tmp_path / "log", 6, 0.05), jobs=jobs, settled=settled)
    started = set(attempts(tmp_path / "log"))
    assert started in ({0, 1, 2}, {0, 1, 2, 3}) if jobs == 2 else started == {0, 1, 2}
    assert values(sweep) == [number**2 if number in started else 0 for number in range(6)]


def test_killed_processes(tmp_path):
    store, log = tmp_path / "store", tmp_path / "log"
    sweep = sweep_of(tasks(log, 8, 0.02), deadly, store=store, jobs=2)
    assert values(sweep) == [number**2 for number in range(8) if number != 3]
    assert [(one.task, one.reason) for one in sweep.failures] == [("square 3", "its process was killed 3 times")]
    made = attempts(log)
    assert made == Counter(range(8)) + Counter({3: ATTEMPTS - 1, 5: 1})  # what others do is not lost with it
    assert len(Store(store).results) == 7


def test_jobs_and_a_cluster_exclude_each_other():
    with pytest.raises(InputError, match="expected one of them"):
        sweep_of([], jobs=2, cluster="tcp://127.0.0.1:1")
    assert sweep_of([]).complete


DRIVER = """
import json, sys
from pathlib import Path
from tests.benchmarks.squares import sweep_of, task
log, store, jobs = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
some = [task(number, log, 0 if number < 2 else 60) for number in range(6)]
sweep = sweep_of(some, store=store, jobs=jobs)
print(json.dumps([[task.given[0] for task, _ in sweep.results], sweep.complete, sweep.notes]))
"""


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


@pytest.mark.parametrize("jobs", [1, 2])
def test_interrupted(tmp_path, jobs):
    """As a terminal does it: the signal goes to all processes of the group."""
    store, log = tmp_path / "store", tmp_path / "log"
    with driver(DRIVER, log, store, jobs) as process:
        assert eventually(lambda: log.exists() and len(log.read_text().splitlines()) == 2 + jobs, 60)
        os.killpg(process.pid, signal.SIGINT)
        output, errors = process.communicate(timeout=30)
    assert (process.returncode, errors) == (0, "")
    done, complete, notes = json.loads(output)
    assert (done, complete) == ([0, 1], False)
    assert notes == [f"incomplete: 2 of 6 tasks done; run the same command again, with --store {store}, to resume"]
    for pid in {int(line.split()[1]) for line in log.read_text().splitlines()}:
        assert eventually(lambda pid=pid: not is_running(pid))
    with Store(store) as opened:
        assert len(opened.results) == 2


RECORDED = """
import json, sys
from benchmarks.irr.recorded import RECORDED
print(json.dumps(RECORDED.run(suite=sys.argv[1], jobs=int(sys.argv[2])).as_dict()))
"""


@pytest.mark.parametrize("jobs", [1, 2])
def test_the_children_end_when_only_their_parent_is_interrupted(make_suite, stand, tmp_path, jobs):
    stand(
        f"""
if sys.argv[-2] != "--order=quick":
    open({str(tmp_path)!r} + f"/pid{{os.getpid()}}", "w").close()
    time.sleep(60)
"""
    )
    slow = (navigation(f"slow{i}", irr_order=["slow"]) for i in range(4))
    with driver(RECORDED, make_suite(navigation("quick", irr_order=["quick"]), *slow), jobs) as process:
        assert eventually(lambda: len(list(tmp_path.glob("pid*"))) == jobs, 60)
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=30)
    assert (process.returncode, errors) == (0, "")
    report = json.loads(output)
    assert report["complete"] is False
    assert [row["instance"] for row in report["rows"]] == ["quick"]
    assert report["notes"][-1] == "incomplete: interrupted after 1 of 5 instances"
    for path in tmp_path.glob("pid*"):
        assert eventually(lambda pid=int(path.name[3:]): not is_running(pid))


# -- on a cluster ------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def cluster():
    distributed = pytest.importorskip("distributed")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with distributed.LocalCluster(
            n_workers=3, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
        ) as local:
            yield local


def test_cluster_with_a_killed_worker(cluster, tmp_path):
    store, log = tmp_path / "store", tmp_path / "log"
    before = [worker.pid for worker in cluster.workers.values()]
    killed = []

    def kill(done, _total, _line):
        if done == 6:
            busy = int(log.read_text().splitlines()[-1].split()[1])
            os.kill(busy, signal.SIGKILL)
            killed.append(busy)

    sweep = sweep_of(tasks(log, 30, 0.1), store=store, cluster=cluster.scheduler_address, on_result=kill)
    assert killed[0] in before
    assert values(sweep) == squares(30)
    assert (sweep.complete, sweep.failures) == (True, ())
    made = attempts(log)
    assert set(made) == set(range(30))
    assert made.total() > 30  # what the killed worker was doing was done again
    assert len(store.read_text().splitlines()) == 31  # and counted once
    again = sweep_of(tasks(log, 32, 0.1), store=store, cluster=cluster.scheduler_address)
    assert values(again) == squares(32)
    assert again.resumed == 30
    assert attempts(log) - made == Counter({30: 1, 31: 1})


def test_failures_on_a_cluster(cluster, tmp_path):
    some = [*tasks(tmp_path / "log", 5, 0.1), task(-1, tmp_path / "log")]
    sweep = sweep_of(some, deadly, cluster=cluster.scheduler_address)
    assert values(sweep) == [0, 1, 4, 16]
    reasons = {one.task: one.reason for one in sweep.failures}
    assert reasons.keys() == {"square 3", "square -1"}
    assert "its worker died again and again" in reasons["square 3"]
    assert reasons["square -1"] == "ValueError: negative"


def test_workers_with_another_version_or_none(cluster, monkeypatch, tmp_path):
    with monkeypatch.context() as patched:
        patched.setattr(robust, "__version__", "9.0")
        with pytest.raises(InputError, match=r"found robust 0\..* on worker tcp:.*, expected 9\.0 as here"):
            sweep_of(tasks(tmp_path / "log", 1), cluster=cluster.scheduler_address)
    monkeypatch.setattr(pool, "_version", lambda: 1 / 0)
    with pytest.raises(InputError, match=r"found no such robust \(.*division by zero.*\) on worker tcp:"):
        sweep_of(tasks(tmp_path / "log", 1), cluster=cluster.scheduler_address)


def test_no_cluster(monkeypatch, tmp_path):
    pytest.importorskip("distributed")
    monkeypatch.setattr(pool, "PATIENCE", 0.3)
    for address in ("tcp://127.0.0.1:9", "tls://127.0.0.1:9", "nonsense://x", "x y"):
        with pytest.raises(InputError, match="found no Dask scheduler at") as caught:
            sweep_of(tasks(tmp_path / "log", 1), cluster=address)
        assert "\n" not in str(caught.value)


def test_without_dask(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(UnsupportedError, match=r"robust-plans\[cluster\]"):
        sweep_of(tasks(tmp_path / "log", 1), cluster="tcp://127.0.0.1:9")


# -- statistics --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("successes", "trials", "bounds"),
    [(81, 263, (0.2553, 0.3662)), (15, 148, (0.0624, 0.1605)), (0, 20, (0.0, 0.1611)), (1, 29, (0.0061, 0.1718))],
)
def test_wilson_intervals(successes, trials, bounds):
    """Newcombe (1998), Table I, method 3."""
    assert Proportion(successes, trials).interval == pytest.approx(bounds, abs=5e-5)
    low, high = Proportion(trials - successes, trials).interval
    assert (1 - high, 1 - low) == pytest.approx(bounds, abs=5e-5)


@pytest.mark.parametrize(("successes", "trials"), [(0, 0), (-1, 3), (4, 3)])
def test_what_is_no_proportion(successes, trials):
    with pytest.raises(ValueError, match="no proportion"):
        Proportion(successes, trials)


def test_mcnemar_by_brute_force():
    assert Pairing.of([(True, False)] * 6 + [(False, True)] + [(True, True), (False, False)]) == Pairing(6, 1, 1, 1)
    for first, second in product(range(7), repeat=2):
        count = first + second
        observed = abs(first - second)
        as_uneven = sum(abs(2 * sum(wins) - count) >= observed for wins in product((0, 1), repeat=count))
        assert Pairing(first, second, 3, 4).p_value == pytest.approx(as_uneven / 2**count)


def test_means():
    assert Mean.of([]) is None
    assert Mean.of([2.0]) == Mean(2.0, None)
    found = Mean.of([0.5, 1.5, 4.0, 2.5])
    assert found.value == 2.125
    # Student's t for three degrees of freedom is 3.1824.
    assert found.interval[1] - 2.125 == pytest.approx(3.1824 * stdev([0.5, 1.5, 4.0, 2.5]) / 2, rel=1e-4)


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
