"""The live page of `robust watch` and `robust pike run --stdio`: what is sent, to whom, and nobody waits for it."""

import http.client
import json
import socket
import subprocess
import threading
import time
from contextlib import contextmanager
from fractions import Fraction

import pytest

from robust import pike
from robust.cli.page import PageServer
from robust.draw.live import LANES, event_windows, live_page
from robust.errors import InputError
from tests.cli.running import EXAMPLES, assert_one_line, command, process, started
from tests.draw.browser import browser

WORKSHOP = [str(EXAMPLES / "workshop" / name) for name in ("domain.pddl", "problem.pddl", "plan.log")]
KITCHEN = str(EXAMPLES / "kitchen" / "kitchen.tpnu.json")


def free_port():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        return taken.getsockname()[1]


@contextmanager
def stream(port, host="127.0.0.1"):
    """The states that a client is sent; a response of another kind as it is."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
    connection.request("GET", "/events", headers={"Host": f"{host}:{port}"})
    try:
        yield connection.getresponse()
    finally:
        connection.close()


def next_state(response):
    while True:
        line = response.readline()
        assert line, "the stream goes on"
        if line.startswith(b"data: "):
            return json.loads(line[6:])


def state_with(response, wanted):
    """The first state for which something holds."""
    while not wanted(state := next_state(response)):
        pass
    return state


@contextmanager
def watching(*options, files=("watch", *WORKSHOP, "--deadline", "90")):
    port = free_port()
    with started(*files, "-q", "--page", port, *options, stdin=subprocess.PIPE) as running:
        answers = [json.loads(running.stdout.readline())]

        def say(*lines):
            for line in lines:
                running.stdin.write(line + "\n")
                running.stdin.flush()
                answers.append(json.loads(running.stdout.readline()))
            return answers[-1]

        yield port, say
        running.stdin.close()
        running.wait(20)


def test_everybody_is_sent_what_is_answered():
    with watching() as (port, say), stream(port) as first, stream(port) as second:
        for line in (
            '{"start": "n0", "at": 0.001}',
            '{"end": "n0", "at": 13}',
            '{"start": "n1", "at": 13.5}',
            '{"tick": 20}',
        ):
            answer = say(line)
            for client in (first, second):
                state = state_with(client, lambda state, now=answer["time"]: state["now"] == float(Fraction(now)))
                assert (state["status"], state["rate"]) == (answer["prospect"], None)
                by_state = {lane["id"]: lane for lane in state["lanes"]}
                for kind, keys in (("running", ("running",)), ("ready", ("startable",)), ("coming", ("coming",))):
                    known = [look["step"] for key in keys for look in answer[key]]
                    assert [each for each, lane in by_state.items() if lane["state"] == kind] == known
                for look in (*answer["running"], *answer["startable"], *answer["coming"]):
                    end = look["end"][1]
                    assert by_state[look["step"]]["window"][2] == (None if end is None else float(Fraction(end)))
        assert by_state["n0"] == {
            "id": "n0",
            "name": "saw ann chair",
            "state": "done",
            "bar": [0.001, 13],
            "window": None,
        }
        say('{"end": "n0", "at": 12}', "no <message>")
        state = state_with(first, lambda state: len(state["said"]) == 2)
        assert [kind for _, _, kind in state["said"]] == ["bad", "open"], "the newest first"
        say('{"tick": 95}')
        state = state_with(first, lambda state: state["status"] == "broken")
        assert state["reasons"]
        assert state["ends"] == [], "ends of what ran decide nothing any more"
        assert {lane["state"] for lane in state["lanes"]} == {"done", "running", "ready", "coming"}, (
            "what was ahead before"
        )


def test_what_is_promised_and_how_likely_success_is():
    chances = [word for number in range(9) for word in ("--distribution", f"dur_n{number}=normal::2")]
    with watching(*chances) as (port, say), stream(port) as client:
        answer = say('{"start": "n0", "at": 0}')
        state = state_with(client, lambda state: any(lane["state"] == "running" for lane in state["lanes"]))
        assert state["success"] == [float(Fraction(answer["success"][end])) for end in ("lower", "upper")]
        assert 0 < state["success"][0] < 1
        assert {step: [low, high] for step, _, low, high in state["promised"]} == {
            step: [float(Fraction(end)) for end in lengths] for step, lengths in answer["promise"].items()
        }
        say('{"tick": 95}')
        state = state_with(client, lambda state: state["status"] == "broken")
        assert (state["success"], state["promised"]) == ([0, 0], [])


def test_nobody_waits_for_a_client_that_does_not_read_or_is_gone():
    with watching() as (port, say):
        idle = socket.create_connection(("127.0.0.1", port))
        idle.sendall(b"GET /events HTTP/1.0\r\nHost: localhost\r\n\r\n")
        silent = socket.create_connection(("127.0.0.1", port))
        nonsense = socket.create_connection(("127.0.0.1", port))
        nonsense.sendall(b"\x00\xff\r\n\r\n")
        with stream(port) as gone:
            next_state(gone)
        for number in range(200):
            say(f'{{"tick": {number / 100}}}')
        with stream(port) as late:
            assert next_state(late)["now"] >= 1.98, "only the newest"
        for each in (idle, silent, nonsense):
            each.close()


def answer_to(port, path, host=None, method="GET"):
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
    connection.request(method, path, headers={"Host": host or f"127.0.0.1:{port}"})
    response = connection.getresponse()
    content = response.read().decode()
    connection.close()
    return response, content


def test_one_file_for_this_machine_only():
    with watching() as (port, _):
        response, page = answer_to(port, "/")
        assert (response.status, response.headers["Content-Type"]) == (200, "text/html; charset=utf-8")
        assert (response.headers["Cache-Control"], response.headers["X-Content-Type-Options"]) == (
            "no-store",
            "nosniff",
        )
        assert "default-src 'none'" in page
        assert "connect-src 'self'" in page
        assert not [word for word in ("http://", "https://", "src=", "@import", "url(") if word in page]
        assert answer_to(port, "/", f"localhost:{port}")[0].status == 200
        assert answer_to(port, "/", "attacker.example")[0].status == 403
        assert answer_to(port, "/../../etc/passwd")[0].status == 404
        assert answer_to(port, "/", method="HEAD")[1] == ""
        with stream(port, "attacker.example") as refused:
            assert refused.status == 403


def test_names_cannot_break_the_page():
    page = live_page('<script>alert("&")</script>')
    assert "<script>alert" not in page
    assert "&lt;script&gt;alert" in page
    server = PageServer(page, "127.0.0.1", 0)
    server.show(lambda: {"name": "</script>\n\ndata: {}\x00\x1b[31m\u2028"})
    with stream(server.port) as client:
        assert next_state(client) == {"name": "</script>\n\ndata: {}\x00\x1b[31m\u2028"}
    server.close()


@pytest.mark.parametrize("width", [360, 1600])
def test_what_a_browser_shows_of_a_plan_that_is_broken(width):
    with (
        watching("--distribution", "*=normal::10%", "--parameter", "duration:*") as (port, say),
        browser(width=width) as w,
    ):
        say('{"start": "n0", "at": 0}')
        w.get(f"http://127.0.0.1:{port}")
        w.find_element("css selector", ".lane.running")
        assert not w.find_element("id", "saying").is_displayed(), "nothing has been said yet"
        say('{"start": "n7", "at": 1}', '{"tick": 60}')
        w.find_element("xpath", "//*[@id='now'][text()='60']")
        assert w.find_element("id", "saying").is_displayed()
        assert w.find_element("id", "chance").text == "succeeds with probability 0 %"
        said = w.execute_script("return [...document.querySelectorAll('.when')].map(each => each.textContent)")
        assert said[:2] == ["too late", "too late"], "n1 had to begin before"
        assert not w.find_element("id", "ending").is_displayed()
        assert w.execute_script("return document.documentElement.scrollWidth") == width


def test_a_port_that_is_taken_is_said_in_one_line():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        ended = command("watch", *WORKSHOP, "-q", "--page", port)
        assert_one_line(ended, says=f"--page: cannot serve at '127.0.0.1', port {port}: address already in use")
        assert_one_line(
            process("pike", "run", KITCHEN, "--stdio", "--page", port, input=""), says="address already in use"
        )
    assert_one_line(command("watch", *WORKSHOP, "-q", "--page", 70000), says="expected a port from 0 to 65535")
    assert_one_line(command("watch", *WORKSHOP, "-q", "--page-host", "::1"), says="expected only together with --page")
    assert_one_line(command("pike", "run", KITCHEN, "--page", 0), says="expected only together with --stdio")
    with pytest.raises(InputError, match="cannot serve at '203"):
        PageServer("", "203.0.113.7", 0)


def test_the_last_state_is_sent_before_the_end():
    server = PageServer("", "127.0.0.1", 0)
    with stream(server.port) as client:
        for number in range(50):
            server.show(lambda number=number: {"number": number})
        begun = time.monotonic()
        server.close()
        assert time.monotonic() - begun < 5
        states = [json.loads(line[6:]) for line in client.read().splitlines() if line.startswith(b"data: ")]
    assert states[-1] == {"number": 49}
    assert len(states) < 10


def test_nothing_goes_on_when_it_is_closed():
    """A thread that waits for a descriptor would keep the file open that gets its number next."""
    before = {*threading.enumerate()}
    server = PageServer("", "127.0.0.1", 0)
    assert {*threading.enumerate()} > before
    server.close()
    assert {*threading.enumerate()} <= before


def test_choices_and_what_is_still_possible():
    files = ("pike", "run", KITCHEN, "--stdio")
    port = free_port()
    with started(*files, "--page", port, "-q", stdin=subprocess.PIPE) as running:
        running.stdout.readline()
        with stream(port) as client:
            for line in (
                '{"kind": "tick", "time": 0}',
                '{"kind": "outcome", "choice": "xA1", "value": "mug", "time": 0.2}',
            ):
                running.stdin.write(line + "\n")
                running.stdin.flush()
            state = state_with(
                client,
                lambda state: state["now"] == 0.2 and all(c["possible"] or c["chosen"] for c in state["choices"]),
            )
        running.stdin.write('{"kind": "possible"}\n')
        running.stdin.close()
        answers = [json.loads(line) for line in running.stdout.read().splitlines()]
    (possible,) = [answer["values"] for answer in answers if answer["kind"] == "possible"]
    assert {c["name"]: c["possible"] for c in state["choices"] if c["chosen"] is None} == possible
    assert ["0.2", "xA1 = mug", ""] in state["said"]
    assert {lane["state"] for lane in state["lanes"]} <= {"running", "coming", "open"}
    assert len(state["lanes"]) <= LANES


@pytest.mark.parametrize("seed", range(2))
def test_events_come_within_their_windows(seed, monkeypatch):
    seen, executives = [], set()
    step = pike.PlanExecutive.step

    def watched(executive, now, messages=()):
        decisions = step(executive, now, messages)
        executives.add(executive)
        seen.append((now, event_windows(executive.progress)))
        return decisions

    monkeypatch.setattr(pike.PlanExecutive, "step", watched)
    pike.run(KITCHEN, seed=seed, pace="random", delay=2)
    (executive,) = executives
    assert len(seen) > 10
    for now, windows in seen:
        for event, when in executive.progress.times.items():
            low, high = windows[event]
            assert low <= when, (now, event)
            assert high is None or when <= high, (now, event)
        if "e1" in windows and windows["e1"][0] == windows["e1"][1]:  # from which the limit counts
            assert windows["e36"][1] <= windows["e37"][1] - Fraction("0.001") < windows["e44"][1], now
