"""Durations learnt from logs: what is read of each kind of log, what is promised, and whether promises are kept."""

import csv
import json
import os
import re
import statistics
import tomllib
import warnings
from datetime import datetime, timedelta
from fractions import Fraction
from itertools import combinations
from math import ceil, comb
from pathlib import Path
from random import Random

import pytest
from scipy.stats import binom

import robust
from robust.errors import InputError, InputWarning
from robust.execute.learned import _drift, _order_statistic, runs_needed
from tests.cli.running import EXAMPLES, answer_of, assert_one_line, command, example

MEASURED = Path(
    os.environ.get("ROBUST_DURATIONS") or EXAMPLES.parents[2] / "shared" / "durations" / "robot-navigation.csv"
)
DELIVERY = example("steps.plan", EXAMPLES / "delivery")
COVER = Fraction("0.95")


def written(folder, text, name="log.csv"):
    file = folder / name
    file.write_text(text)
    return file


def table(*rows, header="action,duration"):
    return "\n".join([header, *rows]) + "\n"


def repeated(action, durations):
    """Rows in a random order."""
    return [f"{action},{duration}" for duration in Random(0).sample([*durations], len(durations))]  # noqa: S311


# -- promises ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("cover", "confidence", "needed"), [("0.95", "0.95", 59), ("0.9", "0.95", 29), ("0.99", "0.99", 459)]
)
def test_known_sample_sizes(cover, confidence, needed):
    assert runs_needed(Fraction(cover), Fraction(confidence)) == needed


def test_limits_are_the_least_order_statistics_that_cover():
    for runs in (*range(1, 130), 500, 2000):
        for cover, confidence in ((".95", ".95"), (".5", ".9"), (".9", ".6")):
            limit, longest, both = _order_statistic(runs, Fraction(cover), Fraction(confidence))
            sure = (
                order for order in range(1, runs + 1) if binom.cdf(order - 1, runs, float(cover)) >= float(confidence)
            )
            assert limit == next(sure, None), (runs, cover)
            assert float(longest) == pytest.approx(1 - float(cover) ** runs)
            assert both is None or float(both) == pytest.approx(binom.cdf(limit - 2, runs, float(cover)), abs=1e-12)


def test_confidence_is_never_overstated():
    """In exact arithmetic, of few runs."""
    for runs in range(1, 80):
        limit, longest, _ = _order_statistic(runs, COVER, Fraction("0.9"))
        assert longest <= 1 - COVER**runs
        if limit is not None:
            parts = (comb(runs, at) * COVER**at * (1 - COVER) ** (runs - at) for at in range(limit))
            assert sum(parts) >= Fraction("0.9")


def test_drift_has_the_probability_of_all_divisions():
    """Of 2n different values each half may be any: those that differ as much are counted."""
    draw = Random(1)  # noqa: S311
    for half in range(1, 6):
        values = [Fraction(value) for value in draw.sample(range(100), 2 * half)]

        def differs(earlier, values=values):
            ranked = sorted(range(len(values)), key=values.__getitem__)
            steps = [1 if at in earlier else -1 for at in ranked]
            return max(abs(sum(steps[: at + 1])) for at in range(len(steps)))

        least = differs(set(range(half)))
        ways = [differs(set(earlier)) >= least for earlier in combinations(range(2 * half), half)]
        drift = _drift(values, sorted(range(2 * half), key=values.__getitem__))
        assert drift.p_value == pytest.approx(sum(ways) / len(ways)), half
    assert _drift([Fraction(1)], [0]) is None


def test_promises_are_kept_as_often_as_is_said(tmp_path):
    """Of 300 logs of 80 exponential durations, at least 95 % of the limits cover 95 %, within four deviations."""
    draw, kept, logs = Random(5), 0, 300  # noqa: S311
    rows = [row for log in range(logs) for row in repeated(f"a{log}", [draw.expovariate(1) for _ in range(80)])]
    learned = robust.learn(written(tmp_path, table(*rows)))
    for action in learned.actions.values():
        if action.upper is not None:  # about 5 in 100 seem to drift, and need more runs
            kept += 1 - 2.718281828 ** -float(action.upper) >= 0.95
    promised = sum(action.upper is not None for action in learned.actions.values())
    assert promised > 0.9 * logs
    assert kept >= 0.95 * promised - 4 * (0.95 * 0.05 * promised) ** 0.5


def test_later_runs_count_where_they_differ(tmp_path):
    learned = robust.learn(written(tmp_path, table(*repeated("a", range(100, 200)), *repeated("a", range(300, 400)))))
    action = learned.actions["a"]
    assert action.drift.found
    assert (action.drift.earlier, action.drift.later) == (149, 349)
    assert (action.runs, len(action.values), action.upper) == (200, 100, 398)
    improved = robust.learn(
        written(tmp_path, table(*repeated("a", [9] * 60), *repeated("a", [5] * 30), *repeated("a", [5] * 30)))
    )
    assert (improved.actions["a"].lower, improved.actions["a"].upper) == (5, 9)
    assert (
        robust.learn(written(tmp_path, table(*repeated("a", [9] * 50), *repeated("a", [5] * 50)))).actions["a"].upper
        is None
    )


def test_too_few_runs_promise_nothing(tmp_path):
    action = robust.learn(written(tmp_path, table(*repeated("a", range(20))))).actions["a"]
    assert (action.lower, action.upper, action.needed, action.longest) == (0, None, 59, 19)
    assert action.longest_confidence == pytest.approx(1 - 0.95**20, abs=1e-5)
    some = robust.learn(written(tmp_path, table(*repeated("a", range(20)))), confidence="0.6").actions["a"]
    assert (some.lower, some.upper) == (0, 19)


@pytest.mark.skipif(not MEASURED.exists(), reason=f"no durations at {MEASURED}; set ROBUST_DURATIONS to run this test")
@pytest.mark.parametrize(("confidence", "least"), [("0.95", 1), ("0.6", 30)])
def test_first_weeks_of_a_robot_promise_the_later_ones(confidence, least, tmp_path):
    """Stretches with 20 runs in each half: 95 % of later runs covered, limits at most 1.5 times their quantile."""
    with MEASURED.open() as file:
        rows = sorted((row for row in csv.DictReader(file) if row["status"] == "success"), key=lambda row: row["start"])
    runs: dict[str, list[dict[str, str]]] = {}
    for row in rows:
        runs.setdefault(row["action"], []).append(row)
    halves = {name: (part[: len(part) // 2], part[len(part) // 2 :]) for name, part in runs.items()}
    first = [f"{name},{row['duration']}" for name, (part, _) in halves.items() for row in part]
    learned = robust.learn(written(tmp_path, table(*first)), cover="0.95", confidence=confidence)
    covered, ratios = [], []
    for name, (part, later) in halves.items():
        upper = learned.actions[name].upper if part else None
        if len(part) >= 20 and upper is not None:
            ends = sorted(float(row["duration"]) for row in later)
            covered += [end <= upper for end in ends]
            ratios.append(float(upper) / ends[ceil(0.95 * len(ends)) - 1])
    assert len(ratios) >= least
    assert sum(covered) >= 0.95 * len(covered)
    assert statistics.median(ratios) <= 1.5


# -- logs --------------------------------------------------------------------------------------------------------------


def test_csv_by_names_of_columns(tmp_path):
    text = "Task;Started;Ended;Outcome;Robot\n(Drive  r1 A);2024-05-01 10:00:00;2024-05-01 10:00:12.5;Success;x\n"
    text += (
        "(drive r1 a);2024-05-01 11:00:00;2024-05-01 11:00:13.5;aborted;x\n(drive r1 a);2024-05-01 12:00;;running;x\n"
    )
    (name, action), *rest = robust.learn(written(tmp_path, text)).actions.items()
    assert (name, rest) == ("(drive r1 a)", [])
    assert (action.values, action.runs, action.failed, action.unfinished) == ([Fraction("12.5")], 1, 1, 1)


def test_units_that_are_named_are_seconds(tmp_path):
    for text in (
        table("a,1500", header="action,duration_ms"),
        table("a,1.5", header="action,duration [s]"),
        table("a,1500 ms"),
        table("a,0.025min"),
        table("a,3/2 s"),
    ):
        assert robust.learn(written(tmp_path, text)).actions["a"].longest == Fraction("1.5"), text


def message(start, stamp, status, name="(move r a B):0"):
    def time(number):
        return {"sec": 1700000000 + int(number), "nanosec": round(number % 1 * 10**9)}

    return {"start_stamp": time(start), "status_stamp": time(stamp), "status": status, "action_full_name": name,
            "action": "move", "arguments": ["r", "a", "B"], "duration": {"sec": 5, "nanosec": 0}, "completion": 0.5,
            "message_status": "on: the way"}  # fmt: skip


MESSAGES = [
    message(0, 0, 0),
    message(0.5, 1, 1),
    message(0.5, 13.25, 3),
    message(0.5, 14, 3),  # said again
    message(20, 25, 2),
    message(30, 31, 4),
    message(40, 42, 1),
    message(60, 50, 3),  # during which the clock was set back
]


def echoed(messages):
    def lines(fields, indent=""):
        for name, value in fields.items():
            if isinstance(value, dict):
                yield f"{indent}{name}:"
                yield from lines(value, indent + "  ")
            elif isinstance(value, list):
                yield f"{indent}{name}:"
                yield from (f"{indent}- {item}" for item in value)
            else:
                yield f"{indent}{name}: {repr(value) if ': ' in str(value) else value}"

    return "".join("\n".join(lines(fields)) + "\n---\n" for fields in messages)


def flat(fields):
    for value in fields.values():
        if isinstance(value, dict):
            yield from flat(value)
        elif isinstance(value, list):
            yield from value
        else:
            yield value


FORMS = {
    "echo": "A message was lost!!!\n\ttotal count change:1\n\ttotal count: 1---\n" + echoed(MESSAGES),
    "echo --csv": "".join(",".join(map(str, flat(fields))) + "\n" for fields in MESSAGES),
    "JSON": "".join(json.dumps({"topic": "/x", "log_time": 1, "data": fields}) + "\n" for fields in MESSAGES),
    "CSV of a bag": "start_stamp.sec,start_stamp.nanosec,status_stamp.sec,status_stamp.nanosec,status,"
    "action_full_name\n" + "".join(",".join(map(str, list(flat(fields))[:6])) + "\n" for fields in MESSAGES),
}


@pytest.mark.parametrize("form", FORMS)
def test_messages_of_plansys2(form, tmp_path):
    with pytest.warns(InputWarning, match=r"log:\d+: .* ends before it starts: a clock was set back"):
        learned = robust.learn(written(tmp_path, FORMS[form], "log"))
    action = learned.actions["(move r a b)"]
    assert (action.runs, action.failed, action.unfinished, action.clock_resets) == (1, 2, 1, 1)
    assert action.values == [Fraction("12.75")]


@pytest.mark.parametrize("form", FORMS)
def test_a_log_may_be_cut_off_anywhere(form, tmp_path):
    """What is cut off is left out, or said to be wrong: durations are never other ones."""
    text = FORMS[form][: FORMS[form].index("on: the way") * 4] if form != "CSV of a bag" else FORMS[form]
    errors: list[str] = []
    for end in range(0, len(text), 7):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", InputWarning)
            try:
                learned = robust.learn(written(tmp_path, text[:end], "log"))
            except InputError as error:
                errors.append(str(error))
                continue
        for name, action in learned.actions.items():
            assert name == "(move r a b)"
            assert list(action.values) in ([], [Fraction("12.75")])
    assert all(re.match(r".*/log(:\d+)*: found ", error) for error in errors)


def test_executions_and_journals(tmp_path):
    executed = command("execute", *example("plan.stn", EXAMPLES / "delivery"), "--runs", 2, "--json", "-q").out
    learned = robust.learn([written(tmp_path, executed, "run.json")] * 2, pool=True)
    assert (learned.actions["move"].runs, learned.actions["collect"].longest) == (16, 15)
    steps = [
        {"schema": "robust/pike-journal/1", "plan": "kitchen", "digest": "0", "epsilon": "1/1000"},
        {"time": "0", "messages": [], "decisions": [
            {"kind": "dispatched", "action": "(get human mug)", "agent": None, "time": "1/4", "end": "e4"},
            {"kind": "dispatched", "action": "(get robot cup)", "agent": None, "time": "1/4", "end": "e5"}]},
        {"time": "2", "messages": [{"kind": "completion", "action": "(get human mug)"}], "decisions": [
            {"kind": "executed", "event": "e4", "time": "7/3", "reported": True}]},
    ]  # fmt: skip
    text = "".join(json.dumps(step) + "\n" for step in steps) + '{"time": '
    with pytest.warns(InputWarning, match="4: the last line is cut off"):
        learned = robust.learn(written(tmp_path, text))
    assert learned.actions["(get human mug)"].values == [Fraction(25, 12)]
    assert learned.actions["(get robot cup)"].unfinished == 1


BAD = {
    "negative": (table("a,3", "a,-3"), "3: found duration '-3', expected at least 0"),
    "no number": (table("a,3", "a,soon"), "3: found duration 'soon', expected a number"),
    "not finite": (table("a,nan"), "2: found duration 'nan', expected a number"),
    "time that is not finite": (
        table("a,nan,3", header="action,start,duration"),
        "2: found time 'nan', expected a date and time",
    ),
    "no columns": (table("a,3", header="name,time"), "1: found no column 'duration' in 'name,time', expected a header"),
    "no action": (table("a,3", header="what,duration"), "1: found no column 'action'"),
    "no log": (
        "\n# Notes\n\ntook 3 s\n",
        "2: found '# Notes', expected a log: CSV with a header (action; duration, or",
    ),
    "a plan": ("0.000: (drive r1 a b) [3]\n", "1: found '0.000: (drive r1 a b) [3]', expected a log: CSV"),
    "no start": (table("a,3", header="action,end"), "1: found column 'end' without 'start'"),
    "status": (table("a,3,fine", header="action,duration,status"), "2: found status 'fine', expected one of success"),
    "no end": (table("a,3,", header="action,start,end"), "2: found no end of a run that succeeded"),
    "short row": (
        table("a,3,ok", "a", "a,3,ok", header="action,duration,status"),
        "3: found 1 column, expected at least 3",
    ),
    "no name": (table(" ,3"), "2: found action ' '"),
    "quotes": (table('a,"3'), "2: found a row that is no CSV"),
    "units in a file": (table("a,3 s", "b,3"), "3: found a duration without a unit, but one with a unit in line 2"),
    "units by size": (table("a,14", "a,15", "a,15", "a,14500"), "5: found duration 14500 of 'a', but 15 in line"),
    "units of stamps": (table("a,0,14,14000", header="action,start,end,duration"), "2: found duration 14000 of a run"),
    "forms of times": (
        table("a,2024-05-01,3", "a,7,3", header="action,start,duration"),
        "found starts of 'a' of two forms",
    ),
    "times": (table("a,2024-05-01,7", header="action,start,end"), "2: found times of two forms"),
    "a time": (table("a,noon,7", header="action,start,duration"), "2: found time 'noon'"),
    "empty": ("", "found an empty file"),
    "no rows": (table(), "found no run of an action"),
    "JSON": ('{"schema": "robust/check/1"}', "1: found 'robust/check/1', expected a log: CSV"),
    "no message": ('{"data": {"x": 1}}\n{"data": {"x": 1}}\n', "1: found a message without start_stamp_sec"),
    "a status": (json.dumps(message(0, 1, 7)), "1: found status 7, expected 0 to 4"),
    "a stamp": (json.dumps({**message(0, 1, 3), "status": "3.5"}), "1: found no whole number for a stamp or status"),
    "no execution": ('{"schema": "robust/execute/1", "runs": [{}]}', "found a document that is not robust/execute/1"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_logs_are_errors_with_their_line(name, tmp_path):
    text, says = BAD[name]
    file = written(tmp_path, text)
    assert_one_line(command("learn", file, "-q"), says=f"{file}:{says}" if says[0].isdigit() else says)


def test_units_that_are_named_are_believed(tmp_path):
    rows = ["a,14", "a,15", "a,15", "a,14500"]
    assert robust.learn(written(tmp_path, table(*rows, header="action,duration_s"))).actions["a"].longest == 14500


def test_actions_that_the_domain_does_not_have(tmp_path):
    file = written(tmp_path, table("move,3", "(collect robot1 x),4", "colect,4"))
    assert_one_line(command("learn", file, "--domain", DELIVERY[0]), says=f"{file}:4: found action 'colect', expected")
    assert set(robust.learn(written(tmp_path, table("Move,3")), domain=DELIVERY[0]).actions) == {"Move"}


def test_starts_that_go_back(tmp_path):
    day = datetime(2024, 5, 1)
    rows = [f"a,{day + timedelta(days=at)},{at}" for at in (3, 4, 1, 2)]
    with pytest.warns(InputWarning, match="csv:4: a starts before the run before it: a clock was set back"):
        learned = robust.learn(written(tmp_path, table(*rows, header="action,start,duration")))
    assert learned.actions["a"].values == [1, 2, 3, 4]
    with pytest.warns(InputWarning, match="the order of the log counts"):
        learned = robust.learn(written(tmp_path, table("a,9,5", "a,1,4", header="action,start,duration")))
    assert learned.actions["a"].values == [5, 4]


# -- what comes of it --------------------------------------------------------------------------------------------------


def test_from_logs_to_a_promise(tmp_path):
    """A world, and a box that a plan is checked for, in which the most precise name counts."""
    rows = [*repeated("move", range(10, 70))] + [f"(move robot1 shelf base_station),{9 + at % 2}" for at in range(60)]
    log, world, box = written(tmp_path, table(*rows, "fly,3")), tmp_path / "world.toml", tmp_path / "box.txt"
    ended = command("learn", log, "-o", world, "--as-box", "-q")
    box.write_text(ended.out)
    assert ended.out.splitlines() == [
        "duration:(move robot1 shelf base_station)=9:10", "duration:fly=0:inf", "duration:move=10:69",
    ]  # fmt: skip
    first, second, third = tomllib.loads(world.read_text())["draw"]
    assert first == {
        "duration": "(move robot1 shelf base_station)",
        "distribution": "empirical",
        "values": [9, 10],
        "weights": [30, 30],
    }
    assert (second["duration"], third["values"]) == ("fly", list(range(10, 70)))
    plan = robust.load_plan(*DELIVERY, parameters=["duration:*"])
    with pytest.warns(InputWarning, match="skipped 1 of 3 lines"):
        checked = robust.check(plan, at=f"@{box}")
    intervals = checked.box.intervals
    assert (intervals["dur_n2"].lower, intervals["dur_n2"].upper) == (9, 10)
    assert (intervals["dur_n0"].lower, intervals["dur_n0"].upper) == (10, 69)
    assert intervals["dur_n1"].lower == intervals["dur_n1"].upper == 15
    learned = robust.learn(written(tmp_path, table(*rows)))
    assert robust.check(plan, at=learned.box).box == checked.box
    empty = written(tmp_path, "duration:fly=0:3\n", "none.txt")
    with pytest.raises(InputError, match=r"none\.txt: found nothing about a parameter of the plan, .*'duration:\*"):
        robust.repair(plan, require=f"@{empty}")
    with pytest.raises(InputError, match="found no file behind @, expected @FILE"):
        robust.check(plan, at="@")


def test_json_and_options(tmp_path):
    log = written(tmp_path, table(*repeated("a", range(1, 60)), "b,1"))
    answer = answer_of(command("learn", log, "--json"), "robust/learn/1")
    assert answer["actions"]["a"]["upper"] == "59"
    assert answer["actions"]["b"] | {"upper": None, "needed": 59} == answer["actions"]["b"]
    assert_one_line(
        command("learn", log, "--cover", "1"), says="--cover: found '1', expected a number above 0 and below 1"
    )
    assert command("learn", log, "--json", "--as-box").code == 2
