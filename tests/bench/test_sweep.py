"""Sweeps: the store, resuming, killed workers here and on a cluster, Ctrl-C."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
import warnings
from collections import Counter
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from hashlib import sha256
from pathlib import Path

import pytest

import robust
from robust.bench.sweep import cluster as clusters
from robust.bench.sweep import key_of, run_sweep
from robust.bench.sweep.local import ATTEMPTS
from robust.bench.sweep.store import Store
from robust.errors import InputError, UnsupportedError
from robust.smt.limits import Deadline
from tests.bench.test_process import eventually, is_running


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
    def label(self) -> str:
        return f"square {self.number}"


def square(task: Square) -> dict[str, int]:
    with task.log.open("a") as log:
        log.write(f"{task.number} {os.getpid()}\n")
    time.sleep(task.seconds)
    if task.number < 0:
        raise ValueError("negative\nsecond line")
    return {"square": task.number**2}


def deadly(task: Square) -> dict[str, int]:
    """Kills its own process for some numbers: always for 3, the first time for 5."""
    attempts = Counter(line.split()[0] for line in (task.log.read_text().splitlines() if task.log.exists() else []))
    result = square(task)
    if task.number == 3 or (task.number == 5 and not attempts["5"]):
        os.kill(os.getpid(), signal.SIGKILL)
    return result


def tasks(log: Path, count: int, seconds: float = 0.0) -> list[Square]:
    return [Square(number, log, seconds) for number in range(count)]


def attempts(log: Path) -> Counter[int]:
    return Counter(int(line.split()[0]) for line in log.read_text().splitlines())


def squares(count: int) -> list[int]:
    return [number**2 for number in range(count)]


def values(sweep) -> list[int]:
    return [result["square"] for _, result in sweep.results]


# -- keys and the store ------------------------------------------------------------------------------------------------


def test_keys_are_stable_and_tell_tasks_apart():
    task = Square(1, Path("log"))
    text = '{"":"Square","colour":{"Colour":"red"},"half":{"fraction":"1/2"},"log":{"path":"log"},"number":1,'
    text += '"seconds":0.0}'
    assert key_of(task) == key_of(Square(1, Path("log"))) == sha256(text.encode()).hexdigest()[:32]
    others = [Square(2, Path("log")), Square(1, Path("l")), Square(1, Path("log"), half=Fraction(1, 3))]
    assert len({key_of(one) for one in (task, *others)}) == 4


@pytest.mark.parametrize("value", [object(), float("nan"), {1: 2}])
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
    assert json.loads(header) == {"schema": "robust/sweep-store/1", "robust": robust.__version__}
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
    header = json.dumps({"schema": "robust/sweep-store/1", "robust": robust.__version__})
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
    path.write_text('{"schema": "robust/sweep-store/1", "robust": "0.0.0"}\n')
    with pytest.raises(InputError, match=r"found results of robust 0\.0\.0"):
        Store(path)
    path.unlink()
    with Store(path), pytest.raises(InputError, match="in use by another run"):
        Store(path)
    with pytest.raises(InputError, match="cannot open the store: no such file or directory"):
        Store(tmp_path / "nowhere" / "store.jsonl")


# -- on this machine ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("jobs", [1, 2])
def test_every_task_once_in_order(tmp_path, jobs):
    seen = []
    again = [Square(2, tmp_path / "log")]
    sweep = run_sweep(
        [*tasks(tmp_path / "log", 6), *again],
        square,
        jobs=jobs,
        describe=lambda task, result: f"{task.number}: {result['square']}",
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
    first = run_sweep(tasks(log, 3), square, store=store, jobs=jobs)
    assert first.resumed == 0
    sweep = run_sweep(tasks(log, 5), square, store=store, jobs=jobs)
    assert values(sweep) == squares(5)
    assert (sweep.resumed, sweep.notes) == (3, (f"3 of 5 results are from {store}",))
    assert attempts(log) == Counter(range(5))
    assert run_sweep(tasks(log, 2), square, store=store, jobs=jobs).resumed == 2


@pytest.mark.parametrize("jobs", [1, 2])
def test_errors_are_failures_that_a_rerun_tries_again(tmp_path, jobs):
    store, log = tmp_path / "store", tmp_path / "log"
    some = [Square(2, log), Square(-1, log), Square(3, log)]
    for count in (1, 2):
        sweep = run_sweep(some, square, store=store, jobs=jobs)
        assert values(sweep) == [4, 9]
        assert [(one.task.number, one.reason) for one in sweep.failures] == [(-1, "ValueError: negative")]
        assert sweep.complete
        assert "1 of 3 tasks failed; square -1: ValueError: negative" in sweep.notes
        assert attempts(log) == Counter({2: 1, -1: count, 3: 1})


def test_killed_processes(tmp_path):
    store, log = tmp_path / "store", tmp_path / "log"
    sweep = run_sweep(tasks(log, 8, 0.02), deadly, store=store, jobs=2)
    assert values(sweep) == [number**2 for number in range(8) if number != 3]
    assert [(one.task.number, one.reason) for one in sweep.failures] == [(3, "its process was killed 3 times")]
    made = attempts(log)
    assert made[3] in {ATTEMPTS, ATTEMPTS + 1}  # the first time it may still have been waiting when 5 was killed
    assert made[5] >= 2
    assert len(Store(store).results) == 7


def test_nothing_starts_after_the_deadline(tmp_path):
    for jobs in (1, 2):
        sweep = run_sweep(tasks(tmp_path / "log", 3), square, jobs=jobs, deadline=Deadline.after(0))
        assert (sweep.results, sweep.complete) == ((), False)
        assert sweep.notes == ("incomplete: 0 of 3 tasks done; with --store FILE an interrupted run can be resumed",)
    assert not (tmp_path / "log").exists()


def test_wrong_options(tmp_path):
    with pytest.raises(InputError, match="jobs is 0"):
        run_sweep([], square, jobs=0)
    with pytest.raises(InputError, match="expected one of them"):
        run_sweep([], square, jobs=2, cluster="tcp://127.0.0.1:1")
    assert run_sweep([], square).complete


DRIVER = """
import json, sys
from pathlib import Path
from robust.bench.sweep import run_sweep
from tests.bench.test_sweep import square, Square
log, store, jobs = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
some = [Square(number, log, 0 if number < 2 else 60) for number in range(6)]
sweep = run_sweep(some, square, store=store, jobs=jobs)
print(json.dumps([[task.number for task, _ in sweep.results], sweep.complete, sweep.notes]))
"""


@pytest.mark.parametrize("jobs", [1, 2])
def test_interrupted(tmp_path, jobs):
    """As a terminal does it: the signal goes to all processes of the group."""
    store, log = tmp_path / "store", tmp_path / "log"
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    command = [sys.executable, "-c", DRIVER, str(log), str(store), str(jobs)]
    with subprocess.Popen(
        command,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as driver:
        assert eventually(lambda: log.exists() and len(log.read_text().splitlines()) == 2 + jobs, 60)
        os.killpg(driver.pid, signal.SIGINT)
        output, errors = driver.communicate(timeout=30)
    assert (driver.returncode, errors) == (0, "")
    done, complete, notes = json.loads(output)
    assert (done, complete) == ([0, 1], False)
    assert notes == [f"incomplete: 2 of 6 tasks done; run the same command again, with --store {store}, to resume"]
    for pid in {int(line.split()[1]) for line in log.read_text().splitlines()}:
        assert eventually(lambda pid=pid: not is_running(pid))
    with Store(store) as opened:
        assert len(opened.results) == 2


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


def pids(cluster) -> list[int]:
    return [worker.pid for worker in cluster.workers.values()]


def test_cluster_with_a_killed_worker(cluster, tmp_path):
    store, log = tmp_path / "store", tmp_path / "log"
    before = pids(cluster)
    killed = []

    def kill(done: int, _total: int, _line: str) -> None:
        if done == 6:
            busy = int(log.read_text().splitlines()[-1].split()[1])
            os.kill(busy, signal.SIGKILL)
            killed.append(busy)

    some = tasks(log, 30, 0.1)
    sweep = run_sweep(some, square, store=store, cluster=cluster.scheduler_address, on_result=kill)
    assert killed[0] in before
    assert values(sweep) == squares(30)
    assert (sweep.complete, sweep.failures) == (True, ())
    made = attempts(log)
    assert set(made) == set(range(30))
    assert made.total() > 30  # what the killed worker was doing was done again
    assert len(store.read_text().splitlines()) == 31  # and counted once
    again = run_sweep(tasks(log, 32, 0.1), square, store=store, cluster=cluster.scheduler_address)
    assert values(again) == squares(32)
    assert again.resumed == 30
    assert attempts(log) - made == Counter({30: 1, 31: 1})


def test_cluster_failures_and_deadline(cluster, tmp_path):
    log = tmp_path / "log"
    sweep = run_sweep([Square(2, log), Square(-1, log)], square, cluster=cluster.scheduler_address)
    assert values(sweep) == [4]
    assert [one.reason for one in sweep.failures] == ["ValueError: negative"]
    started = time.monotonic()
    slow = run_sweep(tasks(log, 6, 3), square, cluster=cluster.scheduler_address, deadline=Deadline.after(1))
    assert time.monotonic() - started < 2.5
    assert (slow.complete, slow.results) == (False, ())


def test_a_cluster_gives_up_on_a_task_that_kills_its_workers(cluster, tmp_path):
    log = tmp_path / "log"
    sweep = run_sweep(tasks(log, 5), deadly, cluster=cluster.scheduler_address)
    assert values(sweep) == [0, 1, 4, 16]
    assert [one.task.number for one in sweep.failures] == [3]
    assert "its worker died again and again" in sweep.failures[0].reason


def test_no_cluster(monkeypatch, tmp_path):
    pytest.importorskip("distributed")
    monkeypatch.setattr(clusters, "PATIENCE", 0.3)
    for address in ("tcp://127.0.0.1:9", "nonsense://x", "x y"):
        with pytest.raises(InputError, match="found no Dask scheduler at") as caught:
            run_sweep(tasks(tmp_path / "log", 1), square, cluster=address)
        assert "\n" not in str(caught.value)


def test_without_dask(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(UnsupportedError, match=r"robust\[cluster\]"):
        run_sweep(tasks(tmp_path / "log", 1), square, cluster="tcp://127.0.0.1:9")
