"""Replays of planners' plans with durations of a real robot: a monitor says the same as shortest paths from scratch.

The oracle reads nothing but the constraints of the plan's network, all schedules of which are known to be valid, and
what has been said; it relaxes all of them until nothing changes. Drawn often and very often: see tests/sampling.py.
"""

import csv
import json
from collections import defaultdict
from dataclasses import replace
from fractions import Fraction
from functools import cache
from heapq import heappop, heappush
from math import lcm
from pathlib import Path
from random import Random
from statistics import median

import pytest

from robust import Monitor, load_plan
from robust.execute.forecast import PathForecaster, Prospect
from robust.execute.messages import MessageKind, MonitorMessage
from robust.plan.model import ZERO
from robust.plan.simulate import mutex_pairs
from tests.execute.test_monitor import Oracle as SolverOracle
from tests.execute.test_monitor import bare
from tests.sampling import often

SHARED = Path(__file__).parents[3] / "shared"
EXAMPLES = Path(__file__).parents[2] / "robust" / "examples"
START, END, TICK = MessageKind.START, MessageKind.END, MessageKind.TICK
OPEN = {Prospect.ON_TRACK, Prospect.AT_RISK}


def files():
    """Name, domain, problem and plan, and how many steps it has."""
    found = [("workshop", *(EXAMPLES / "workshop" / name for name in ("domain.pddl", "problem.pddl", "plan.log")), 8)]
    for folder in ("pstn-plans", "planner-logs"):
        index = SHARED / folder / "plans.json"
        for plan in json.loads(index.read_text()) if index.exists() else ():
            if plan.get("val", "valid") == "valid":
                log = plan.get("log") or plan.get("plan")
                paths = (SHARED / folder / plan[key] for key in ("domain", "problem"))
                found.append((plan["name"], *paths, SHARED / folder / log, plan["steps"]))
    return found


@cache
def ratios():
    """How long a robot took, as shares of the median of the same action."""
    path = SHARED / "durations" / "robot-navigation.csv"
    if not path.exists():
        return [Fraction(number, 100) for number in (70, 85, 95, 100, 100, 105, 120, 160, 300)]
    groups = defaultdict(list)
    with path.open() as lines:
        for row in csv.DictReader(lines):
            if row["status"] == "success":
                groups[row["action"]].append(float(row["duration"]))
    every = (length / median(group) for group in groups.values() if len(group) > 4 for length in group)
    return [Fraction(ratio).limit_denominator(100) for ratio in every]


def is_about_orders(monitor):
    """Whether conditions demand of single durations at most that they keep both ends apart."""
    own = monitor._own
    if not isinstance(own, PathForecaster):
        return False
    return all(low * 1000 <= own._scale and high is None for low, high in own._bounds_of_lengths.values())


class Oracle:
    """Bounds of the plan's own constraints; durations are at least what keeps their ends apart, or as planned."""

    def __init__(self, plan):
        self.plan = plan
        self.bounds = []
        self.links = {}
        for item in plan.constraints:
            names = {str(v) for b in (item.lower, item.upper) if b is not None for v in b.variables}
            if names:
                assert item.lower == item.upper
                self.links[plan.lasting[names.pop()]] = item.source, item.target
            else:
                if item.lower is not None:
                    self.bounds.append((item.source, item.target, item.lower.constant_term))
                if item.upper is not None:
                    self.bounds.append((item.target, item.source, -item.upper.constant_term))
        apart = {frozenset(pair) for pair in mutex_pairs(plan)}
        self.least = {step: Fraction(frozenset(ends) in apart, 1000) for step, ends in self.links.items()}
        self.points = [p for p in plan.time_points if p.time is None]

    def windows(self, times, now, least):
        """Earliest and latest times, or None; `least`: of the durations of steps that have not ended."""
        bounds = [*self.bounds]
        for step, (source, target) in self.links.items():
            if target not in times:
                bounds.append((source, target, max(least.get(step, Fraction(0)), self.least[step])))
        fractions = [*(w for _, _, w in bounds), *times.values(), Fraction(now)]
        scale = lcm(*(value.denominator for value in fractions))
        bounds = [(a, b, int(w * scale)) for a, b, w in bounds]
        known = {ZERO: 0} | {p: int(t * scale) for p, t in times.items()}
        low = {p: known.get(p, int(now * scale)) for p in self.points}
        high = {p: known.get(p) for p in self.points}
        for _ in range(2 * len(self.points) + 2):
            changed = False
            for a, b, w in bounds:
                if low[a] + w > low[b]:
                    low[b], changed = low[a] + w, True
                if high[b] is not None and (high[a] is None or high[b] - w < high[a]):
                    high[a], changed = high[b] - w, True
            if any(low[p] > t or high[p] < t for p, t in known.items()):
                return None
            if not changed:
                break
        if any(high[p] is not None and low[p] > high[p] for p in self.points):
            return None
        return {
            p: (Fraction(low[p], scale), None if high[p] is None else Fraction(high[p], scale)) for p in self.points
        }


def replayed(monitor, random, spread):
    """Messages of a robot that starts what it may, and takes as long as robots do; with the answers."""
    ends, now, outlook = [], Fraction(0), monitor.outlook()
    while outlook.prospect in OPEN:
        ready = [look for look in outlook.startable if not look.start[0] > now]
        if ready and random.random() < 0.95:
            look = random.choice(ready)
            message = MonitorMessage(START, look.step, now)
            if monitor.plan.instance[look.step].durative:
                length = monitor.planned[look.step] * (1 + (random.choice(ratios()) - 1) * spread)
                heappush(ends, (max(now, Fraction(round((now + length) * 1000), 1000)), look.step))
        elif ends:
            now, step = max(now, ends[0][0]), heappop(ends)[1]
            message = MonitorMessage(END, step, now)
        else:
            now = max(now + Fraction(1, 16), min((look.start[0] for look in outlook.coming), default=now))
            message = MonitorMessage(TICK, at=now)
        outlook = monitor.tell(message)
        yield message, outlook


def happened(monitor):
    """The times of points, from messages by identifier."""
    times = {}
    for message in monitor.taken.values():
        if message.kind is not TICK:
            instance = monitor.plan.instance[message.step]
            times[instance.start if message.kind is START else instance.end] = message.at
    return times


def differences(monitor, oracle, outlook, random):
    """What is not as the oracle says: prospect, windows, the promise, the slack of some step."""
    times, planned = happened(monitor), monitor.planned
    possible = oracle.windows(times, monitor.time, {})
    expected = oracle.windows(times, monitor.time, planned)
    wanted = Prospect.BROKEN if possible is None else Prospect.AT_RISK if expected is None else Prospect.ON_TRACK
    if outlook.prospect is Prospect.DONE:
        wanted = Prospect.BROKEN if possible is None else Prospect.DONE
    if outlook.prospect is not wanted:
        yield f"prospect {outlook.prospect}, expected {wanted}"
    if wanted not in OPEN:
        return
    looks = [*outlook.running, *outlook.startable, *outlook.coming]
    windows = expected or possible
    for look in looks:
        instance = monitor.plan.instance[look.step]
        if (look.start, look.end) != (windows[instance.start], windows[instance.end]):
            yield f"windows of {look.step}"
    if expected and outlook.promise is not None:
        longest = {step: high for step, (_, high) in outlook.promise.items()}
        if oracle.windows(times, monitor.time, longest) is None:
            yield "promise"
    look = random.choice(looks)
    if expected and look.step in oracle.links:
        longest = planned[look.step] + (10**6 if look.slack is None else look.slack)
        if oracle.windows(times, monitor.time, {**planned, look.step: longest}) is None:
            yield f"slack of {look.step} is too much"
        longest += Fraction(1, 10**6)
        if look.slack is not None and oracle.windows(times, monitor.time, {**planned, look.step: longest}) is not None:
            yield f"slack of {look.step} is not all"


@pytest.mark.parametrize("case", [case for case in files() if case[-1] <= often(20, 75)], ids=lambda case: case[0])
def test_answers_are_those_of_shortest_paths_from_scratch(case):
    name, domain, problem, log, _ = case
    ended = dict.fromkeys(Prospect, 0)
    random = Random(name)  # noqa: S311 - reproducible
    for number in range(often(1, 20)):
        deadline = random.choice(["+5%", "+20%", "+60%"])
        monitor = Monitor(load_plan(domain, problem, log, parameters=["duration:*"], deadline=deadline), reorder=False)
        if not is_about_orders(monitor):
            pytest.skip("its obligations say more about durations than its network")
        oracle = Oracle(monitor.plan)
        outlook = monitor.outlook()
        for message, outlook in replayed(monitor, random, random.choice([Fraction(1, 4), 1])):
            assert outlook.refused is None
            assert list(differences(monitor, oracle, outlook, random)) == [], (number, message)
        ended[outlook.prospect] += 1
    assert sum(ended.values()) == often(1, 20)


def disordered(monitor, solver, random, spread):
    """Messages of a robot that also starts what is not yet to start, if some order succeeds; with the answers."""
    ends, now, outlook = [], Fraction(0), monitor.outlook()
    while outlook.prospect in OPEN:
        draw, latest = random.random(), [look.end[1] for look in outlook.running if look.end[1] is not None]
        chosen = [look.step for look in outlook.startable if not look.start[0] > now]
        if draw < 0.3 and outlook.coming:
            step = random.choice(outlook.coming).step
            begun = {**happened(monitor), monitor.plan.instance[step].start: now}
            chosen = [step] if solver.is_possible(begun, now) else chosen
        if chosen and draw < 0.8:
            now += random.choice([0, 0, Fraction(1, 2000), Fraction(1, 1000), Fraction(1, 8)])
            message = MonitorMessage(START, random.choice(chosen), now)
            if monitor.plan.instance[message.step].durative:
                length = monitor.planned[message.step] * (1 + (random.choice(ratios()) - 1) * spread)
                heappush(ends, (max(now, Fraction(round((now + length) * 1000), 1000)), message.step))
        elif ends and draw < 0.95:
            now, step = max(now, ends[0][0]), heappop(ends)[1]
            message = MonitorMessage(END, step, now)
        else:
            now += Fraction(1, 16)
            if latest and random.random() < 0.5:  # just before it is too late, and at that very moment
                now = max(now, min(latest) - random.choice([0, Fraction(1, 2000), Fraction(1, 500)]))
            message = MonitorMessage(TICK, at=now)
        outlook = monitor.tell(message)
        yield message, outlook


@pytest.mark.parametrize("first", range(4, often(12, 204), 4))
def test_nothing_is_left_in_any_order_when_a_solver_says_so(first):
    cases = [case for case in files() if case[-1] <= 20]
    judged = 0
    for seed in range(first, first + 4):
        random = Random(seed)  # noqa: S311 - reproducible
        name, *paths, _ = cases[0] if seed % 4 < 2 else random.choice(cases)
        deadline = random.choice(["+5%", "+20%", "+60%"])
        monitor = Monitor(load_plan(*paths, parameters=["duration:*"], deadline=deadline), seconds=None)
        solver = SolverOracle(replace(monitor.plan, constraints=bare(monitor.plan)))
        for message, outlook in disordered(monitor, solver, random, random.choice([Fraction(1, 4), 1])):
            if outlook.reordered or outlook.prospect is Prospect.BROKEN:
                possible = solver.is_possible(happened(monitor), monitor.time)
                assert possible is (outlook.prospect is not Prospect.BROKEN), (seed, name, message)
                judged += 1
    assert judged > 0
