"""Ctrl-C, SIGTERM, time limits, readers and terminals that leave: an answer within a second, and nothing is left."""

import os
import pty
import random
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from fractions import Fraction
from pathlib import Path

import pytest

from benchmarks.generators.sizes import write_instance
from benchmarks.irr.stnu import team_network
from robust.cli.guard import _TICK, STOPS, Cause, Guard
from robust.stnu.network_json import network_json
from tests.children import eventually, is_running
from tests.cli import inputs
from tests.cli.running import COMMAND, LOAD, answer_of, command, environment, example, process, ran, started, stopped
from tests.tables import text_in_data

SIGNALS = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]
WITHIN, STARTED = 3 * LOAD, 1.5 * LOAD
"""Seconds, generously, until a process has ended, or has read a small plan and decided its nominal point."""
FINE = inputs.INPUTS / "networks" / "fine.json"
ENDLESS = ("--method", "irr", "--beta", f"1/{10**299}")
linux = pytest.mark.skipif(sys.platform != "linux", reason="terminals end differently elsewhere, and there is no /proc")


@pytest.fixture(scope="module")
def long(tmp_path_factory):
    """A plan whose box takes much longer than any of these tests."""
    return write_instance(tmp_path_factory.mktemp("long"), 4, 4)


@pytest.fixture(scope="module")
def slow_to_encode(tmp_path_factory):
    """A plan that takes long before its first query is even asked."""
    return write_instance(tmp_path_factory.mktemp("slow"), 60, 60)


@pytest.fixture
def fifo(tmp_path):
    """A file that never comes."""
    os.mkfifo(tmp_path / "fifo")
    return tmp_path / "fifo"


def prompt(ended):
    """The command has ended early, at once."""
    assert ended.code == 3, ended
    assert "Traceback" not in ended.err
    assert "Exception ignored" not in ended.err
    assert ended.seconds < WITHIN
    return ended


def in_time(limit, *words):
    """The answer of a command with that limit, which it keeps."""
    begun = time.perf_counter()
    ended = prompt(process(*words, "--timeout", limit, "--json"))
    assert time.perf_counter() - begun < limit + WITHIN
    return answer_of(ended)


@pytest.mark.parametrize(
    ("number", "solver"), [*((number, "z3") for number in SIGNALS), (signal.SIGINT, "cvc5")], ids=str
)
def test_the_best_box_so_far(long, number, solver):
    words = ("envelope", *long, *ENDLESS, "--json", "--solver", solver, "--verbose")
    answer = answer_of(prompt(stopped(*words, after="check 3:", number=number)), "robust/envelope/1")
    assert (answer["status"], answer["verified"]) == ("interrupted", True)
    assert answer["checks"] >= 3
    assert any(Fraction(ends["upper"]) > Fraction(ends["lower"]) for ends in answer["parameters"].values())
    if number is SIGNALS[0] and solver == "z3":
        people = prompt(stopped("envelope", *long, *ENDLESS, "--verbose", after="check 9:"))
        assert "start_4" in people.out
        assert "interrupted: the best box so far; sound, not maximal" in people.out


@pytest.mark.parametrize(("verb", "after"), [("check", 0.3), ("check", 0.6), ("envelope", 1.0)])
def test_interrupted_while_starting_or_encoding(slow_to_encode, verb, after):
    ended = prompt(stopped(verb, *slow_to_encode, "--json", after=after * LOAD))
    if not ended.out:  # so early that nobody knew yet of --json
        assert ended.err == "robust: interrupted\n"
        return
    answer = answer_of(ended)
    if "error" in answer:
        assert answer["error"]["kind"] == "interrupted"
    elif verb == "check":
        assert (answer["verdict"], answer["interrupted"]) == ("unknown", True)
    else:
        assert (answer["status"], answer["verified"]) == ("interrupted", False)
        assert answer["checks"] <= 1


def test_time_limits(long, slow_to_encode, fifo):
    answer = in_time(STARTED, "envelope", *long, *ENDLESS)
    assert (answer["status"], answer["verified"]) == ("timeout", True)
    answer = in_time(0.7, "check", *slow_to_encode)
    if answer["schema"] == "robust/check/1":
        assert (answer["verdict"], answer["timeout"], answer["interrupted"]) == ("unknown", True, False)
    assert in_time(0.5, "verify", fifo, *example())["error"]["kind"] == "timeout"
    answer = in_time(1e-9, "check", *example())
    assert answer["schema"] == "robust/error/1" or answer["timeout"]
    ended = process("check", *example(), "--timeout", "1e-9")
    assert (ended.code, ended.err in {"robust: out of time\n", ""}) == (3, True)
    answer = in_time(STARTED, "execute", *example(), "--runs", 10**6)
    assert answer["status"] in {"timeout", "interrupted"}
    assert 0 < len(answer["runs"]) < 10**6


def test_plans_that_were_judged(tmp_path):
    """A list that nobody has the time for, of plans that are refuted."""
    domain, problem, _ = inputs.write(tmp_path)
    (tmp_path / "all.txt").write_text(f"{domain} {problem} {inputs.INPUTS / 'plans' / 'long.txt'}\n" * 20_000)
    words = ("validate", "--list", tmp_path / "all.txt", "--json", "--verbose")
    ended = stopped(*words, after="plan 9 of 20000")
    answer = answer_of(ended)
    assert (ended.code, answer["status"], answer["valid"]) == (1, "interrupted", 0)
    assert 8 <= len(answer["plans"]) < 20_000
    assert f"robust: interrupted after {len(answer['plans'])} plans" in ended.err


@pytest.fixture(scope="module")
def team(tmp_path_factory):
    """A schedule of a team that takes long to repair."""
    file = tmp_path_factory.mktemp("team") / "team.json"
    file.write_text(network_json(team_network(1200, 1)), encoding="utf-8")
    return file


def test_the_best_repair_of_a_network_so_far(team):
    """What is known is a repair, or at least a bound."""
    ended = stopped("stnu", "repair", team, "--json", after=3 * LOAD)
    answer = answer_of(ended, "robust/stnu-repair/1")
    (repair,) = answer["results"]
    assert (ended.code, answer["status"], repair["error"]) == (3, "interrupted", None)
    assert ended.seconds < 2 * LOAD
    assert repair["repair"] == ("unknown" if repair["cost"] is None else "feasible")
    assert repair["cost"] is None or Fraction(repair["cost"]) - Fraction(repair["bound"]) == Fraction(repair["gap"]) > 0


@pytest.mark.parametrize(("verb", "key"), [("check", "verdict"), ("repair", "repair")])
def test_networks_out_of_time(team, verb, key):
    """The limit passes while the file is read, or when nothing is known."""
    ended = command("stnu", verb, team, "--timeout", "0.000001", "--json")
    answer = answer_of(ended)
    assert (ended.code, answer["error"]["kind"] if "error" in answer else answer["status"]) == (3, "timeout")
    assert "error" in answer or answer["results"][0][key] == "unknown"


def test_verdicts_on_networks_and_executions_so_far(fifo):
    """The second network never comes."""
    ended = stopped("execute", *example(), "--runs", 10**6, "--quiet", after=1.0)
    assert (ended.code, ended.seconds < 30) == (3, True)
    ended = stopped("stnu", "check", FINE, fifo, "--json", after=2 * LOAD)
    answer = answer_of(ended, "robust/stnu-check/1")
    assert (ended.code, answer["status"]) == (3, "interrupted")
    assert [result["verdict"] for result in answer["results"]] == ["controllable"]


def test_the_first_signal_ends_verify_of_a_file_that_never_comes(fifo):
    runs = [started("verify", fifo, *example()) for _ in SIGNALS]
    with pytest.raises(subprocess.TimeoutExpired):
        runs[0].wait(3 * LOAD)
    for run, number in zip(runs, SIGNALS, strict=True):
        run.send_signal(number)
        assert (*run.communicate(timeout=3 * LOAD), run.returncode) == ("", "robust: interrupted\n", 3)


@pytest.mark.parametrize(
    "words",
    [
        ("check", *example("plan-flexible-wait.stn")),
        ("envelope", *example("plan-flexible-wait.stn")),
        ("stnu", "check", FINE, "-q"),
        ("demo",),
        ("--help",),
    ],
    ids=lambda words: words[0],
)
def test_an_answer_that_nobody_reads_is_no_success(words):
    """As of other tools, which SIGPIPE ends without a word."""
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "wb") as gone:
        ended = process(*words, stdout=gone)
    assert (ended.code, ended.err) == (141, "")


def on_terminal(*arguments):
    """Run with stderr on a terminal, as in `robust ... > file`; exit code, stdout and what the terminal got."""
    ours, theirs = pty.openpty()
    with started(*arguments, stderr=theirs, env=environment(TERM="xterm-256color")) as running:
        os.close(theirs)
        shown = b""
        with suppress(OSError):
            while chunk := os.read(ours, 65536):
                shown += chunk
        out, _ = running.communicate(timeout=30)
    os.close(ours)
    return running.returncode, out, shown.decode("utf-8", "replace")


@linux
def test_progress_on_a_terminal_only(long):
    code, out, shown = on_terminal("envelope", *long, *ENDLESS, "--timeout", STARTED)
    assert code == 3
    for text in ("start_1", "Δ = ", "Ctrl-C keeps this box"):
        assert text in shown
    assert "\x1b" not in out
    assert "out of time: the best box so far" in out
    assert on_terminal("check", *long, "--quiet")[2] == ""


PLANNER = text_in_data(__file__, "planner.txt")
"""A planner whose work goes on in a process that has left it, while it prints without end (some MB a second)."""


class Run:
    """`robust execute` with that planner; its temporary files are below `temporary`."""

    def __init__(self, folder):
        self.number, self.temporary = folder / "number", folder / "temporary"
        self.temporary.mkdir()
        planner = folder / "planner.py"
        planner.write_text(PLANNER, encoding="utf-8")
        template = f"command:{sys.executable} -S {planner} {self.number} {{domain}} {{problem}}"
        self.words = ["execute", *example()[:2], "--planner", template, "--planner-limit", "200"]
        self.environment = environment(TMPDIR=str(self.temporary))

    def is_planning(self):
        return eventually(self.number.exists, 60) and any(self.temporary.iterdir())

    def leaves_nothing(self):
        planner = int(self.number.read_text(encoding="utf-8"))
        return eventually(lambda: not is_running(planner)) and eventually(lambda: not any(self.temporary.iterdir()))


@pytest.mark.parametrize("number", [*SIGNALS, signal.SIGKILL, None], ids=str)
def test_signals_and_limits_end_the_planner_and_all_that_it_has_started(tmp_path, number):
    run = Run(tmp_path)
    options = ("--timeout", 4 * LOAD) if number is None else ()
    with started(*run.words, *options, env=run.environment) as execution:
        assert run.is_planning()
        if number is not None:
            execution.send_signal(number)
        _, errors = execution.communicate(timeout=60)
    assert execution.returncode == (-signal.SIGKILL if number is signal.SIGKILL else 3)
    assert "Traceback" not in errors
    assert run.leaves_nothing()


@linux
def test_a_terminal_that_closes_ends_the_run(tmp_path):
    """The run gets SIGHUP, and has nowhere to print."""
    run = Run(tmp_path)
    child, terminal = os.forkpty()
    if not child:
        os.execvpe(COMMAND[0], [*COMMAND, *run.words], run.environment)  # noqa: S606
    assert run.is_planning()
    os.close(terminal)
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == 3
    assert run.leaves_nothing()


def test_sighup_stays_ignored_where_it_was(tmp_path):
    run = Run(tmp_path)
    streams = dict.fromkeys(("stdout", "stderr"), subprocess.DEVNULL)
    with subprocess.Popen(["nohup", *COMMAND, *run.words], env=run.environment, **streams) as execution:
        assert run.is_planning()
        execution.send_signal(signal.SIGHUP)
        with pytest.raises(subprocess.TimeoutExpired):
            execution.wait(2)
        execution.send_signal(signal.SIGTERM)
        assert execution.wait(60) == 3
    assert run.leaves_nothing()


MARK = "ROBUST_TEST_RUN"
SPINNING = f"command:{sys.executable} -S -c while(1):pass {{domain}} {{problem}}"
COMMANDS = {
    "check cvc5": ("check", *example("plan-flexible-wait.stn"), "--solver", "cvc5"),
    "envelope cvc5": ("envelope", *example(), "--solver", "cvc5"),
    "region z3": ("region", *example(), "--backend", "z3"),
    "batch": ("batch", "check", inputs.INPUTS / "delivery", "--jobs", 2),
    "bench": ("bench", "scaling", "--limit", 5, "--jobs", 2),
    "execute": ("execute", *example()[:2], "--planner", SPINNING),
    "certify": ("certify", *example(), "-o", os.devnull),
}
"""Commands that start processes: copies, watchers, whole commands, planners, the checker."""


def marked(mark):
    """The processes that were started with the variable of that value, or are descendants of one."""
    numbers = []
    for folder in Path("/proc").iterdir():
        with suppress(OSError, ValueError):
            if f"{MARK}={mark}\0".encode() in (folder / "environ").read_bytes():
                numbers.append(int(folder.name))
    return numbers


@linux
@pytest.mark.parametrize(
    ("seed", "number", "longest"),
    [(1, 3, 3.0), *(pytest.param(n, 100, 6.0, marks=pytest.mark.slow) for n in range(2, 7))],
)
def test_nothing_outlives_interrupts(seed, number, longest):
    """So many interrupts, at instants and by signals that are drawn; every third comes twice."""
    draw = random.Random(seed)  # noqa: S311 - no secret
    for count in range(number):
        name, after, mark = draw.choice(list(COMMANDS)), draw.uniform(0.1, longest), f"{os.getpid()}-{seed}-{count}"
        signals = [draw.choice(SIGNALS) for _ in range(1 + (count % 3 == 0))]
        with started(*COMMANDS[name], env=environment(**{MARK: mark})) as run:
            time.sleep(after)
            for each in signals:
                run.send_signal(each)
                time.sleep(0.05)
            run.communicate(timeout=60)
        eventually(lambda mark=mark: not marked(mark), 2)  # who was sent SIGKILL needs a moment
        survivors = [Path(f"/proc/{each}/cmdline").read_bytes() for each in marked(mark)]
        assert not survivors, (name, after, signals)


def send(guard, number=signal.SIGINT):
    """A signal to the process, as its watcher gets it; here, threads of the test runner might take it instead."""
    signal.pthread_kill(guard._watcher.ident, number)


def test_its_thread_lives_until_it_has_been_woken(monkeypatch):
    """However late the signal that wakes it is sent: one to a thread that has ended may end the process."""
    kill, alive = signal.pthread_kill, []

    def late(thread, number):
        time.sleep(4 * _TICK)
        alive.append(thread in {each.ident for each in threading.enumerate()})
        if alive[-1]:
            kill(thread, number)

    monkeypatch.setattr(signal, "pthread_kill", late)
    with Guard():
        pass
    assert alive == [True]


def test_puts_everything_back_and_does_nothing_in_another_thread():
    def now():
        handlers = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGALRM)]
        return handlers, signal.pthread_sigmask(0, []), threading.active_count()

    before = now()
    with Guard():
        assert signal.pthread_sigmask(signal.SIG_BLOCK, []) >= STOPS
    assert now() == before
    errors = []

    def work():
        try:
            with Guard() as guard, guard.working(0.01):
                time.sleep(0.5)
        except BaseException as error:
            errors.append(error)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert errors == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupts_work_that_waits_and_leaves_what_follows_alone(number):
    def work():
        send(guard, number)
        time.sleep(10)

    with Guard() as guard:
        started = time.monotonic()
        with pytest.raises(KeyboardInterrupt), guard.working():
            work()
        assert time.monotonic() - started < 10
        assert guard.cause is Cause.INTERRUPTED
        time.sleep(0.5)


def test_interrupts_again_what_swallowed_the_first():
    swallowed = []

    def swallow_two():
        send(guard)
        while len(swallowed) < 2:
            try:
                time.sleep(10)
            except KeyboardInterrupt as error:
                swallowed.append(error)
        time.sleep(10)

    with Guard() as guard, pytest.raises(KeyboardInterrupt), guard.working():
        swallow_two()
    assert len(swallowed) == 2


def test_ends_work_at_the_limit_and_remembers_a_signal_before_work():
    with Guard() as guard:
        with pytest.raises(KeyboardInterrupt), guard.working(0.1):
            time.sleep(10)
        assert guard.cause is Cause.TIMEOUT
        assert 0.1 < guard.age < 1
        assert guard.remaining(None) is None
        assert 8 < guard.remaining(10) <= 10
        assert 0 < guard.remaining(1e-9) <= 1e-3
    with Guard() as guard:
        send(guard)
        assert eventually(lambda: guard.cause is not None, 5)
        with pytest.raises(KeyboardInterrupt), guard.working():
            pytest.fail("work began")


STUCK = text_in_data(__file__, "stuck.txt")


@pytest.mark.parametrize("limit", [None, 0.1])
def test_answers_for_work_that_does_not_end(limit):
    started = time.monotonic()
    ended = ran(sys.executable, "-c", STUCK.format(limit=limit))
    assert time.monotonic() - started < 15
    assert (ended.code, ended.out, ended.err) == (3, "best so far\n", "")
