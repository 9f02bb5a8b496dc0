"""The engine: keys, the store, resuming, measured and killed processes here and on a cluster, Ctrl-C, statistics."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
import warnings
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from itertools import product
from pathlib import Path
from statistics import correlation, linear_regression

import pytest
from scipy import stats

import robust
from benchmarks.engine import pool
from benchmarks.engine.codec import key_of
from benchmarks.engine.measure import measured
from benchmarks.engine.pool import ATTEMPTS
from benchmarks.engine.show import quantile
from benchmarks.engine.stats import LineFit, Mean, Pairing, Proportion
from benchmarks.engine.store import SCHEMA, Store
from benchmarks.engine.sweep import run_sweep
from robust.errors import InputError, RobustError, UnsupportedError
from robust.smt.limits import Deadline
from tests.benchmarks.conftest import MakeSuite, Stand, navigation

ROOT = Path(__file__).parents[2]


def eventually(holds, seconds=10.0):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if holds():
            return True
        time.sleep(0.02)
    return holds()


def is_running(pid):
    """Whether the process exists and is not only waiting to be collected."""
    with suppress(OSError, IndexError):
        return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()[0] != "Z"
    return False


class Colour(Enum):
    RED = "red"


@dataclass(frozen=True)
class Square:
    """Squares a number; leaves a line in a file for each attempt."""

    number: int
    log: Path
    seconds: float = 0.0
    half: Fraction = Fraction(1, 2)
    colour: Colour = Colour.RED

    @property
    def label(self):
        return f"square {self.number}"


@dataclass(frozen=True)
class Squared:
    square: int


def square(task):
    with task.log.open("a") as log:
        log.write(f"{task.number} {os.getpid()}\n")
    time.sleep(task.seconds)
    if task.number < 0:
        raise ValueError("negative\nsecond line")
    return Squared(task.number**2)


def deadly(task):
    """Kills its own process for some numbers: always for 3, the first time for 5."""
    attempts = Counter(line.split()[0] for line in (task.log.read_text().splitlines() if task.log.exists() else []))
    result = square(task)
    if task.number == 3 or (task.number == 5 and not attempts["5"]):
        os.kill(os.getpid(), signal.SIGKILL)
    return result


def sweep_of(some, work=square, **options):
    return run_sweep(some, work, record=Squared, **options)


def tasks(log, count, seconds=0.0):
    return [Square(number, log, seconds) for number in range(count)]


def attempts(log):
    return Counter(int(line.split()[0]) for line in log.read_text().splitlines())


def squares(count):
    return [number**2 for number in range(count)]


def values(sweep):
    return [record.square for _, record in sweep.results]


# -- keys and the store ------------------------------------------------------------------------------------------------


def test_keys_are_stable_and_tell_tasks_apart():
    task = Square(1, Path("log"))
    assert key_of(task) == key_of(Square(1, Path("log"))) == "7a52981ab65669cafddedfc2bc35b940"
    others = [Square(2, Path("log")), Square(1, Path("l")), Square(1, Path("log"), half=Fraction(1, 3))]
    assert len({key_of(one) for one in (task, *others)}) == 4


@pytest.mark.parametrize("value", [object(), float("nan")])
def test_what_has_no_stable_form_is_no_task(value):
    with pytest.raises(TypeError, match="no stable form"):
        key_of(Square(value, Path("log")))


def test_a_store_keeps_results_once(tmp_path):
    path = tmp_path / "store.jsonl"
    with Store(path) as store:
        assert store.add("a", "first", {"x": 1})
        assert not store.add("a", "again", {"x": 2})
    with Store(path) as store:
        assert store.results == {"a": {"x": 1}}
    header, line = path.read_text().splitlines()
    assert json.loads(header) == {"schema": SCHEMA, "robust": robust.__version__}
    assert json.loads(line) == {"key": "a", "task": "first", "result": {"x": 1}}


def test_every_torn_end_is_dropped_and_written_over(tmp_path):
    path = tmp_path / "store.jsonl"
    with Store(path) as store:
        store.add("a", "first", 1)
        store.add("b", "second", "ü")
    whole = path.read_bytes()
    second = whole.index(b'{"key": "b"')
    for length in range(len(whole)):
        path.write_bytes(whole[:length])
        with Store(path) as store:
            kept = dict(store.results)
            store.add("c", "third", 3)
        with Store(path) as store:
            assert store.results == {**kept, "c": 3}
        assert ("a" in kept) == (length >= second)
        assert "b" not in kept


def test_what_is_no_store_is_left_alone(tmp_path):
    path = tmp_path / "plan.stn"
    header = json.dumps({"schema": SCHEMA, "robust": robust.__version__})
    for text, place in (
        ("parameter a;", ":1"),
        ("parameter a;\n", ":1"),
        ("[]\n", ":1"),
        ('{"schema": "other"}\n', ":1"),
        (f'{header}\n{{"key": 1, "result": 2}}\n', ":2"),
        (f"{header}\nnonsense\n{{}}\n", ":2"),
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=rf"plan.stn{place}: found .*, expected a store"):
            Store(path)
        assert path.read_text() == text


def test_stores_of_other_versions_in_use_or_nowhere(tmp_path):
    path = tmp_path / "store.jsonl"
    path.write_text(f'{{"schema": "{SCHEMA}", "robust": "0.0.0"}}\n')
    with pytest.raises(InputError, match=r"found results of robust 0\.0\.0"):
        Store(path)
    path.unlink()
    with Store(path), pytest.raises(InputError, match="in use by another run"):
        Store(path)
    with pytest.raises(InputError, match="cannot open the store: no such file or directory"):
        Store(tmp_path / "nowhere" / "store.jsonl")


# -- sweeps on this machine --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("jobs", [1, 2])
def test_every_task_once_in_order(tmp_path, jobs):
    seen = []
    again = [Square(2, tmp_path / "log")]
    sweep = sweep_of(
        [*tasks(tmp_path / "log", 6), *again],
        jobs=jobs,
        describe=lambda task, record: f"{task.number}: {record.square}",
        on_result=lambda done, total, line: seen.append((done, total, line)),
    )
    assert values(sweep) == squares(6)
    assert (sweep.complete, sweep.failures, sweep.notes, sweep.total) == (True, (), (), 6)
    assert attempts(tmp_path / "log") == Counter(range(6))
    assert [one[:2] for one in seen] == [(n, 6) for n in range(1, 7)]
    assert {one[2] for one in seen} == {f"{n}: {n * n}" for n in range(6)}


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_rerun_resumes(tmp_path, jobs):
    store, log = tmp_path / "store", tmp_path / "log"
    assert sweep_of(tasks(log, 3), store=store, jobs=jobs).resumed == 0
    sweep = sweep_of(tasks(log, 5), store=store, jobs=jobs)
    assert values(sweep) == squares(5)
    assert (sweep.resumed, sweep.notes) == (3, (f"3 of 5 results are from {store}",))
    assert attempts(log) == Counter(range(5))
    assert sweep_of(tasks(log, 2), store=store, jobs=jobs).resumed == 2


@pytest.mark.parametrize("jobs", [1, 2])
def test_errors_are_failures_that_a_rerun_tries_again(tmp_path, jobs):
    store, log = tmp_path / "store", tmp_path / "log"
    some = [Square(2, log), Square(-1, log), Square(3, log)]
    for count in (1, 2):
        sweep = sweep_of(some, store=store, jobs=jobs)
        assert values(sweep) == [4, 9]
        assert [(one.task, one.reason) for one in sweep.failures] == [("square -1", "ValueError: negative")]
        assert sweep.complete
        assert "1 of 3 tasks failed; square -1: ValueError: negative" in sweep.notes
        assert attempts(log) == Counter({2: 1, -1: count, 3: 1})


@pytest.mark.parametrize("jobs", [1, 2])
def test_what_earlier_records_settle_is_not_started(tmp_path, jobs):
    def settled(task, records):
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
    assert made[3] in {ATTEMPTS, ATTEMPTS + 1}  # the first time it may still have been waiting when 5 was killed
    assert made[5] >= 2
    assert len(Store(store).results) == 7


def test_nothing_starts_after_the_deadline(tmp_path):
    for jobs in (1, 2):
        sweep = sweep_of(tasks(tmp_path / "log", 3), jobs=jobs, deadline=Deadline.after(0))
        assert (sweep.results, sweep.complete) == ((), False)
        assert sweep.notes == ("incomplete: 0 of 3 tasks done; with --store FILE an interrupted run can be resumed",)
    assert not (tmp_path / "log").exists()


def test_wrong_options():
    with pytest.raises(InputError, match="jobs is 0"):
        sweep_of([], jobs=0)
    with pytest.raises(InputError, match="expected one of them"):
        sweep_of([], jobs=2, cluster="tcp://127.0.0.1:1")
    assert sweep_of([]).complete


DRIVER = """
import json, sys
from pathlib import Path
from tests.benchmarks.test_engine import sweep_of, Square
log, store, jobs = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
some = [Square(number, log, 0 if number < 2 else 60) for number in range(6)]
sweep = sweep_of(some, store=store, jobs=jobs)
print(json.dumps([[task.number for task, _ in sweep.results], sweep.complete, sweep.notes]))
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
def test_the_children_end_when_only_their_parent_is_interrupted(
    make_suite: MakeSuite, stand: Stand, tmp_path: Path, jobs: int
) -> None:
    stand(
        f"""
if sys.argv[-2] == "--order=quick": print(json.dumps(ANSWER)); sys.exit()
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


def test_cluster_failures_and_deadline(cluster, tmp_path):
    log = tmp_path / "log"
    sweep = sweep_of([Square(2, log), Square(-1, log)], cluster=cluster.scheduler_address)
    assert values(sweep) == [4]
    assert [one.reason for one in sweep.failures] == ["ValueError: negative"]
    started = time.monotonic()
    slow = sweep_of(tasks(log, 6, 3), cluster=cluster.scheduler_address, deadline=Deadline.after(1))
    assert time.monotonic() - started < 2.5
    assert (slow.complete, slow.results) == (False, ())


def test_a_cluster_gives_up_on_a_task_that_kills_its_workers(cluster, tmp_path):
    sweep = sweep_of(tasks(tmp_path / "log", 5), deadly, cluster=cluster.scheduler_address)
    assert values(sweep) == [0, 1, 4, 16]
    assert [one.task for one in sweep.failures] == ["square 3"]
    assert "its worker died again and again" in sweep.failures[0].reason


def test_no_cluster(monkeypatch, tmp_path):
    pytest.importorskip("distributed")
    monkeypatch.setattr(pool, "PATIENCE", 0.3)
    for address in ("tcp://127.0.0.1:9", "nonsense://x", "x y"):
        with pytest.raises(InputError, match="found no Dask scheduler at") as caught:
            sweep_of(tasks(tmp_path / "log", 1), cluster=address)
        assert "\n" not in str(caught.value)


def test_without_dask(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(UnsupportedError, match=r"robust\[cluster\]"):
        sweep_of(tasks(tmp_path / "log", 1), cluster="tcp://127.0.0.1:9")


# -- measured processes ------------------------------------------------------------------------------------------------


def python(code):
    return [sys.executable, "-S", "-c", code]


def sleeper(tmp_path):
    return f"import os, time; open({str(tmp_path / 'pid')!r}, 'w').write(str(os.getpid())); time.sleep(60)"


def test_output_exit_code_and_time():
    code = "import sys, time; print('out'); print('first\\nlast', file=sys.stderr); time.sleep(0.2); sys.exit(3)"
    found = measured(python(code))
    assert (found.stdout, found.exit_code, found.timed_out, found.last_error) == ("out\n", 3, False, "last")
    assert 0.2 <= found.seconds < 5
    assert measured(python("import os; os._exit(7)")).last_error == "exit code 7 without a message"
    found = measured(python("import sys; print('x' * 10**6); print('y' * 10**6, file=sys.stderr)"))
    assert (len(found.stdout), len(found.stderr)) == (10**6 + 1, 10**6 + 1)


def test_memory_is_that_of_the_process_and_not_of_its_parent():
    ballast = bytearray(300 * 2**20)
    assert measured(python("pass")).memory_mb < 100
    assert 200 < measured(python("x = bytearray(200 * 2**20)")).memory_mb < 300
    assert measured(python("pass")).memory_mb < 100  # the maximum over earlier ones does not count
    assert len(ballast) > 0


def test_the_limit_kills(tmp_path):
    started = time.monotonic()
    found = measured(python("import time; print('early', flush=True); time.sleep(60)"), limit=0.5)
    assert (found.timed_out, found.exit_code < 0, found.stdout) == (True, True, "early\n")
    assert 0.5 <= found.seconds < 10
    assert time.monotonic() - started < 20
    assert found.memory_mb > 1
    code = f"import subprocess, sys; subprocess.run([sys.executable, '-S', '-c', {sleeper(tmp_path)!r}])"
    assert measured(python(code), limit=2).timed_out  # and what it has started as well
    assert eventually(lambda: not is_running(int((tmp_path / "pid").read_text())))


def test_a_command_that_does_not_exist(tmp_path):
    with pytest.raises(RobustError, match=r"cannot run.*absent"):
        measured([str(tmp_path / "absent")])


def test_children_end_with_their_parent(tmp_path):
    code = "import sys; from benchmarks.engine.measure import measured; measured([sys.executable, '-c', sys.argv[1]])"
    with driver(code, sleeper(tmp_path)) as parent:
        assert eventually(lambda: (tmp_path / "pid").exists() and (tmp_path / "pid").read_text() != "", 30)
        parent.kill()
    assert eventually(lambda: not is_running(int((tmp_path / "pid").read_text())))


def test_no_descriptor_is_left_open():
    measured(python("pass"))
    before = len(os.listdir("/proc/self/fd"))
    for _ in range(3):
        measured(python("pass"))
    assert len(os.listdir("/proc/self/fd")) <= before


# -- statistics --------------------------------------------------------------------------------------------------------


def test_wilson_intervals():
    # Newcombe (1998), Table I, method 3: 81/263, 15/148, 0/20, 1/29.
    for successes, trials, lower, upper in (
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ):
        assert Proportion(successes, trials).interval == pytest.approx((lower, upper), abs=5e-5)
        low, high = Proportion(trials - successes, trials).interval
        assert (1 - high, 1 - low) == pytest.approx((lower, upper), abs=5e-5)
    assert Proportion(92, 100).share == Fraction(23, 25)
    assert (Proportion(5, 5).interval[1], Proportion(0, 5).interval[0]) == (1, 0)
    for successes, trials in ((0, 0), (-1, 3), (4, 3)):
        with pytest.raises(ValueError, match="no proportion"):
            Proportion(successes, trials)


def test_mcnemar_by_brute_force():
    assert Pairing.of([(True, False)] * 6 + [(False, True)] + [(True, True), (False, False)]) == Pairing(6, 1, 1, 1)
    for first, second in product(range(7), repeat=2):
        count = first + second
        observed = abs(first - second)
        as_uneven = sum(abs(2 * sum(wins) - count) >= observed for wins in product((0, 1), repeat=count))
        assert Pairing(first, second, 3, 4).p_value == pytest.approx(as_uneven / 2**count)
    assert Pairing(121, 59, 0, 0).p_value == pytest.approx(4.434e-06, rel=2e-2)


def test_means():
    assert Mean.of([]) is None
    assert Mean.of([2.0]) == Mean(2.0, None)
    mean = Mean.of([1.0, 2.0, 3.0])
    assert mean.value == 2
    assert mean.interval == pytest.approx((2 - 4.3027 / 3**0.5, 2 + 4.3027 / 3**0.5), abs=1e-4)
    some = [0.5, 1.5, 4.0, 2.5]
    assert Mean.of(some).interval == pytest.approx(stats.t.interval(0.95, 3, 2.125, stats.sem(some)))


def test_a_line():
    points = [(1, 0), (1, 1), (2, 1), (3, 2), (4, 2), (5, 4)]
    fit = LineFit.of(points)
    slope, intercept = linear_regression(*zip(*points, strict=True))
    assert fit.slope == pytest.approx(slope)
    assert fit.intercept == pytest.approx(intercept)
    assert fit.r_squared == pytest.approx(correlation(*zip(*points, strict=True)) ** 2)
    # Student's t for four degrees of freedom is 2.776; the residual deviation over the spread is 0.5 / √(40/3) here.
    residual = sum((y - intercept - slope * x) ** 2 for x, y in points)
    spread = sum((x - 16 / 6) ** 2 for x, _ in points)
    assert fit.interval[1] - slope == pytest.approx(2.7764 * (residual / 4 / spread) ** 0.5, rel=1e-4)
    assert LineFit.of([(1, 2), (1, 3)]) is None
    two = LineFit.of([(1, 2), (2, 4)])
    assert (two.slope, two.intercept, two.r_squared, two.interval) == (2, 0, 1, None)
    assert LineFit.of([(1, 2), (2, 2), (3, 2)]).r_squared == 1


# -- tables ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("size", "share", "expected"), [(10, 0.9, 9), (11, 0.9, 10), (1, 0.9, 1), (100, 0.9, 90)])
def test_a_quantile_is_the_least_that_enough_values_do_not_exceed(size, share, expected):
    values = list(range(1, size + 1))
    assert quantile(values, share) == expected
    assert expected == min(each for each in values if sum(other <= each for other in values) >= share * size)
    assert quantile([], share) is None
