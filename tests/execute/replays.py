"""Replays of plans with durations of a real robot: a monitor against what is worked out from scratch at each message.

`python -m tests.execute.replays 10000` draws as many, of all plans, and prints what became of them, each difference and
the processor time of answers by plan; Ctrl-C ends it with what is known.
There are two oracles. `PathOracle` reads nothing but the constraints of the plan's network, all schedules of which are
known to be valid, and what has been said; it relaxes all of them until nothing changes. `SolverOracle` asks a solver
for times that keep the network, all obligations, and what has been said.
"""

import csv
import json
import sys
from argparse import ArgumentParser
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache, partial
from heapq import heappop, heappush
from itertools import count, islice
from math import lcm
from pathlib import Path
from random import Random
from statistics import median
from time import process_time

from robust import Monitor, ParametrizedPlan, load_plan
from robust.encode.encoding import RelationalEncoding
from robust.encode.interface import constant
from robust.execute.forecast import PathForecaster, Prospect
from robust.execute.messages import MessageKind, MonitorMessage
from robust.execute.monitor import Outlook
from robust.plan.model import ZERO, TemporalConstraint, TimePoint
from robust.plan.simulate import mutex_pairs
from robust.smt.limits import NEVER
from robust.smt.session import Satisfiability, Session

SHARED = Path(__file__).parents[3] / "shared"
EXAMPLES = Path(__file__).parents[2] / "robust" / "examples"
START, END, TICK = MessageKind.START, MessageKind.END, MessageKind.TICK
OPEN = {Prospect.ON_TRACK, Prospect.AT_RISK}
DEADLINES = "+5%", "+20%", "+60%"
Times = Mapping[TimePoint, Fraction]


@dataclass(frozen=True)
class Case:
    """A plan of some planner, or one of the examples."""

    name: str
    files: tuple[Path, Path, Path]
    steps: int

    @property
    def is_converted(self) -> bool:
        """Whether the plan became a network here, all schedules of which are valid."""
        return self.files[2].suffix != ".stn"

    @cache  # noqa: B019 - what planners wrote is converted and proved once for all replays
    def plan(self, deadline: str) -> ParametrizedPlan:
        return load_plan(*self.files, parameters=["duration:*"], deadline=deadline)

    def monitor(self, deadline: str, **options) -> Monitor:
        return Monitor(self.plan(deadline), **options)


def cases() -> list[Case]:
    """Plans that are valid: those of the examples, and of the data where it is there."""
    found = []
    for name, plan, steps in (("workshop", "plan.log", 8), ("delivery", "plan.stn", 14), ("generator", "plan.stn", 4)):
        files = tuple(EXAMPLES / name / file for file in ("domain.pddl", "problem.pddl", plan))
        found.append(Case(name, files, steps))
    for folder in ("pstn-plans", "planner-logs"):
        index = SHARED / folder / "plans.json"
        for plan in json.loads(index.read_text()) if index.exists() else ():
            if plan.get("val", "valid") == "valid":
                files = plan["domain"], plan["problem"], plan.get("log") or plan.get("plan")
                found.append(Case(plan["name"], tuple(SHARED / folder / file for file in files), plan["steps"]))
    return found


@cache
def ratios() -> list[Fraction]:
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


# -- oracles -----------------------------------------------------------------------------------------------------------


class SolverOracle:
    """Some continuation keeps network and obligations, as a solver says."""

    def __init__(self, plan: ParametrizedPlan) -> None:
        self.plan, self.encoding = plan, RelationalEncoding(plan)
        terms = self.encoding.terms
        violations = [known.violation for known in self.encoding.obligations if known.violation is not None]
        kept = [terms.negation(violation) for violation in violations]
        self.session = Session(terms)
        self.session.add(*self.encoding.network_formulas(), *kept, *self.encoding._states.definitions.needed_by(kept))

    def is_possible(self, times: Times, now: Fraction, least: Mapping[str, Fraction] | None = None) -> bool:
        """Whether something succeeds; `least`: how long steps take that have not ended, at least."""
        terms, places = self.encoding.terms, self.encoding.places
        facts = [
            terms.equal(places[point] - constant(times[point]))
            if point in times
            else terms.at_least(places[point] - constant(now))
            for point in self.plan.time_points
            if point != ZERO and (point in times or point.time is None)
        ]
        for step, length in (least or {}).items():
            instance = self.plan.instance[step]
            if instance.end not in times:
                facts.append(terms.at_least(places[instance.end] - places[instance.start] - constant(length)))
        with self.session.frame(*facts):
            return self.session.check("possible", NEVER) is Satisfiability.SATISFIABLE


class PathOracle:
    """Bounds of the plan's own constraints; durations are at least what keeps their ends apart, or as planned."""

    def __init__(self, plan: ParametrizedPlan) -> None:
        self.points = [p for p in plan.time_points if p.time is None]
        self.place = {point: place for place, point in enumerate(self.points)}
        self.bounds = []
        self.links = {}
        for item in plan.constraints:
            names = {str(v) for b in (item.lower, item.upper) if b is not None for v in b.variables}
            source, target = self.place[item.source], self.place[item.target]
            if names:
                assert item.lower == item.upper
                self.links[plan.lasting[names.pop()]] = source, target
            else:
                if item.lower is not None:
                    self.bounds.append((source, target, item.lower.constant_term))
                if item.upper is not None:
                    self.bounds.append((target, source, -item.upper.constant_term))
        apart = {frozenset(self.place.get(point) for point in pair) for pair in mutex_pairs(plan)}
        self.least = {step: Fraction(frozenset(ends) in apart, 1000) for step, ends in self.links.items()}
        self.scale, self.scaled = 0, []
        self.order = [0] * len(self.points)  # in which a few rounds suffice

    def windows(self, times: Times, now: Fraction, least: Mapping[str, Fraction]):
        """Earliest and latest times, or None; `least`: of the durations of steps that have not ended."""
        known = {self.place[ZERO]: Fraction(0)} | {self.place[p]: t for p, t in times.items()}
        links = [
            (source, target, max(least.get(step, Fraction(0)), self.least[step]))
            for step, (source, target) in self.links.items()
            if target not in known
        ]
        weights = [w for _, _, w in (links if self.scale else [*self.bounds, *links])]
        scale = lcm(self.scale or 1, *(value.denominator for value in (*weights, *known.values(), now)))
        if scale != self.scale:
            self.scale, self.scaled = scale, [(a, b, int(w * scale)) for a, b, w in self.bounds]
        forward = [*self.scaled, *((a, b, int(w * scale)) for a, b, w in links)]
        forward.sort(key=lambda bound: self.order[bound[0]])
        known = {place: int(time * scale) for place, time in known.items()}
        low = [int(now * scale)] * len(self.points)
        never = (sum(abs(w) for _, _, w in forward) + max(low[0], *known.values())) * 2 + 1
        high = [never] * len(self.points)
        for place, time in known.items():
            low[place] = high[place] = time
        for _ in range(2 * len(self.points) + 2):
            changed = False
            for a, b, w in forward:
                if low[a] + w > low[b]:
                    low[b], changed = low[a] + w, True
            for a, b, w in reversed(forward):
                if high[b] != never and high[b] - w < high[a]:
                    high[a], changed = high[b] - w, True
            if any(low[place] > time or high[place] < time for place, time in known.items()):
                return None
            if not changed:
                break
        self.order = low
        if any(early > late for early, late in zip(low, high, strict=True)):
            return None
        return {
            point: (Fraction(early, scale), None if late == never else Fraction(late, scale))
            for point, early, late in zip(self.points, low, high, strict=True)
        }


def is_about_orders(monitor: Monitor) -> bool:
    """Whether conditions demand of single durations at most that they keep both ends apart."""
    own = monitor._own
    if not isinstance(own, PathForecaster):
        return False
    return all(low * 1000 <= own._scale and high is None for low, high in own._bounds_of_lengths.values())


def bare(plan: ParametrizedPlan) -> tuple[TemporalConstraint, ...]:
    """Durations and deadlines without orders."""
    return tuple(c for c in plan.constraints if c.name is not None or c.source.instance == c.target.instance)


def happened(monitor: Monitor) -> dict[TimePoint, Fraction]:
    """The times of points, from messages by identifier; a step whose start was not heard of has not begun."""
    said = [message for message in monitor.taken.values() if message.kind in {START, END}]
    begun = {message.step for message in said if message.kind is START}
    steps = monitor.plan.instance
    known = [message for message in said if message.step in begun]
    return {steps[m.step].start if m.kind is START else steps[m.step].end: m.at for m in known}


# -- replays -----------------------------------------------------------------------------------------------------------

Answers = Iterator[tuple[MonitorMessage, Outlook]]


def drawn_length(monitor: Monitor, step: str, random: Random, spread: Fraction) -> Fraction:
    return monitor.planned[step] * (1 + (random.choice(ratios()) - 1) * spread)


def replayed(monitor: Monitor, random: Random, spread: Fraction) -> Answers:
    """Messages of a robot that starts what it may, and takes as long as robots do; with the answers."""
    ends, now, outlook = [], Fraction(0), monitor.outlook()
    while outlook.prospect in OPEN:
        ready = [look for look in outlook.startable if not look.start[0] > now]
        if ready and random.random() < 0.95:
            look = random.choice(ready)
            message = MonitorMessage(START, look.step, now)
            if monitor.plan.instance[look.step].durative:
                end = now + drawn_length(monitor, look.step, random, spread)
                heappush(ends, (max(now, Fraction(round(end * 1000), 1000)), look.step))
        elif ends:
            now, step = max(now, ends[0][0]), heappop(ends)[1]
            message = MonitorMessage(END, step, now)
        else:
            now = max(now + Fraction(1, 16), min((look.start[0] for look in outlook.coming), default=now))
            message = MonitorMessage(TICK, at=now)
        outlook = monitor.tell(message)
        yield message, outlook


def disordered(monitor: Monitor, solver: SolverOracle, random: Random, spread: Fraction) -> Answers:
    """Messages of a robot that also starts what is not yet to start, if some order succeeds; with the answers.

    Messages arrive as late as the monitor says that they may, in any order.
    """
    plan, lateness = monitor.plan, monitor.lateness
    ends: list[tuple[Fraction, str]] = []
    sent: list[tuple[Fraction, int, MonitorMessage]] = []
    true: dict[TimePoint, Fraction] = {}
    now, outlook, begun = Fraction(0), monitor.outlook(), set[str]()

    def say(kind: MessageKind, step: str, at: Fraction) -> None:
        instance = plan.instance[step]
        true[instance.start if kind is START else instance.end] = at
        arrives = at + lateness * random.choice([0, 0, Fraction(random.randint(0, 8), 8)])
        heappush(sent, (arrives, len(true), MonitorMessage(kind, step, at, arrives)))

    while outlook.prospect in OPEN:
        draw, latest = random.random(), [look.end[1] for look in outlook.running if look.end[1] is not None]
        chosen = [look.step for look in outlook.startable if look.start[0] <= now and look.step not in begun]
        if draw < 0.3 and outlook.coming:
            step = random.choice(outlook.coming).step
            if step not in begun and solver.is_possible({**true, plan.instance[step].start: now}, now):
                chosen = [step]
        if chosen and draw < 0.8:
            now += random.choice([0, 0, Fraction(1, 2000), Fraction(1, 1000), Fraction(1, 8)])
        elif ends and draw < 0.95:
            chosen, now = [], max(now, ends[0][0])
        else:
            chosen, now = [], now + random.choice([Fraction(1, 16), lateness / 4, lateness])
            if latest and random.random() < 0.5:  # just before it is too late, and at that very moment
                now = max(now, min(latest) + lateness - random.choice([0, Fraction(1, 2000), Fraction(1, 500)]))
        while ends and ends[0][0] <= now:
            at, step = heappop(ends)
            say(END, step, at)
        for step in chosen[:1]:
            begun.add(step)
            say(START, step, now)
            if plan.instance[step].durative:
                end = now + drawn_length(monitor, step, random, spread)
                heappush(ends, (max(now, Fraction(round(end * 1000), 1000)), step))
        heard = [heappop(sent)[2] for _ in range(sum(at <= now for at, _, _ in sent))]
        for message in (*heard, MonitorMessage(TICK, at=now)):
            if outlook.prospect in OPEN:
                outlook = monitor.tell(message)
                yield message, outlook


# -- differences -------------------------------------------------------------------------------------------------------


def wanted_prospect(outlook: Outlook, *, possible: bool, expected: bool) -> Prospect:
    if not possible:
        return Prospect.BROKEN
    if outlook.prospect is Prospect.DONE:
        return Prospect.DONE
    return Prospect.ON_TRACK if expected else Prospect.AT_RISK


def path_differences(monitor: Monitor, oracle: PathOracle, outlook: Outlook, random: Random) -> Iterator[str]:
    """What is not as the oracle says: prospect, windows, the promise, the slack of some step."""
    times, planned = happened(monitor), monitor.planned
    possible = oracle.windows(times, monitor.time, {})
    expected = oracle.windows(times, monitor.time, planned)
    wanted = wanted_prospect(outlook, possible=possible is not None, expected=expected is not None)
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


def solver_differences(monitor: Monitor, oracle: SolverOracle, outlook: Outlook) -> Iterator[str]:
    """Whether the prospect is not as the oracle says."""
    times = happened(monitor)
    lasting = {step: monitor.planned[step] for step in monitor.plan.lasting.values()}
    possible = oracle.is_possible(times, monitor.time)
    expected = possible and oracle.is_possible(times, monitor.time, lasting)
    wanted = wanted_prospect(outlook, possible=possible, expected=expected)
    if outlook.prospect is not wanted:
        yield f"prospect {outlook.prospect}, expected {wanted}"


def reordered_differences(monitor: Monitor, oracle: SolverOracle, outlook: Outlook) -> Iterator[str]:
    """Whether a plan that left its order is broken while some order succeeds, or not broken while none does."""
    if outlook.reordered or outlook.prospect not in {*OPEN, Prospect.DONE}:
        possible = oracle.is_possible(happened(monitor), max(monitor.time - monitor.lateness, Fraction(0)))
        if outlook.prospect is not Prospect.BROKEN and not (possible and outlook.prospect in {*OPEN, Prospect.DONE}):
            yield f"prospect {outlook.prospect}, while {'an' if possible else 'no'} order succeeds"
        elif outlook.prospect is Prospect.BROKEN and possible:
            yield "prospect broken, while an order succeeds"


@dataclass(frozen=True)
class Replay:
    """What became of a replay: by what it was judged, processor times of answers, how it ended, and differences."""

    kind: str
    seconds: Sequence[float]
    ended: Prospect
    differences: tuple[str, ...]


def timed(answers: Answers, seconds: list[float]) -> Answers:
    """The answers, with the processor time of each after the first, in which the robot's own is contained."""
    started = process_time()
    for number, each in enumerate(answers):
        if number:
            seconds.append(process_time() - started)
        yield each
        started = process_time()


def replay_in_order(case: Case, seed: int, *, solver: bool = False) -> Replay:
    """A replay in the plan's own order; where paths decide, also against a `solver` if asked."""
    random = Random(f"{case.name} {seed}")
    monitor = case.monitor(random.choice(DEADLINES), reorder=False, seconds=None)
    is_by_paths = case.is_converted and is_about_orders(monitor)
    kind = "shortest paths" if is_by_paths else "conditions on times"
    kind = kind if isinstance(monitor._own, PathForecaster) else "conditions on numbers"
    paths = PathOracle(monitor.plan) if is_by_paths else None
    asked = SolverOracle(monitor.plan) if solver or paths is None else None
    outlook, seconds, differences = monitor.outlook(), list[float](), list[str]()
    told = replayed(monitor, random, random.choice([Fraction(1, 4), Fraction(1)]))
    for message, outlook in timed(told, seconds):
        found = [] if outlook.refused is None else [outlook.refused]
        found += [] if paths is None else path_differences(monitor, paths, outlook, random)
        found += [] if asked is None else solver_differences(monitor, asked, outlook)
        differences += [f"{case.name} {seed}, {message.as_dict()}: {text}" for text in found]
    kind = kind if paths is None or asked is None else f"{kind}, and a solver"
    return Replay(kind, seconds, outlook.prospect, tuple(differences))


def replay_in_any_order(case: Case, seed: int) -> Replay:
    """A replay that leaves the plan's order, with messages that come late."""
    random = Random(f"{case.name} {seed} in any order")
    lateness = Fraction(random.choice([0, 0, 1, 5, 20]))
    monitor = case.monitor(random.choice(DEADLINES), seconds=None, lateness=lateness)
    solver = SolverOracle(replace(monitor.plan, constraints=bare(monitor.plan)))
    outlook, seconds, differences = monitor.outlook(), list[float](), list[str]()
    told = disordered(monitor, solver, random, random.choice([Fraction(1, 4), Fraction(1)]))
    for message, outlook in timed(told, seconds):
        found = [] if outlook.refused is None else [outlook.refused]
        found += reordered_differences(monitor, solver, outlook)
        differences += [f"{case.name} {seed} in any order, {message.as_dict()}: {text}" for text in found]
    return Replay("any order, late" if lateness else "any order", seconds, outlook.prospect, tuple(differences))


LARGE = 60
"""Steps from which on a plan is replayed without a solver."""
SMALL = 20
"""Steps up to which other orders are looked for."""
STEPS = 30
"""A plan of more steps is replayed less often, as if all plans had this many."""
NUMBERS = 40
"""How much less often plans are replayed of which only a solver knows whether anything is left."""


def replays(known: Iterable[Case]) -> Iterator[partial[Replay]]:
    """Replays of all plans in turn, without an end, each to be called."""
    often = {case: max(1, case.steps // STEPS) for case in known}
    for case in often:
        if not isinstance(case.monitor("+20%")._own, PathForecaster):
            often[case] *= NUMBERS
    for seed in count():
        for case, rounds in often.items():
            if seed % rounds == 0:
                asks = case.steps < LARGE and seed // rounds % 10 == 0
                yield partial(replay_in_order, case, seed, solver=asks)
            if case.steps <= SMALL and case.is_converted:
                yield partial(replay_in_any_order, case, seed)


def main(arguments: list[str] | None = None) -> int:
    parser = ArgumentParser(prog="python -m tests.execute.replays", description=__doc__.splitlines()[0])
    parser.add_argument("count", type=int, nargs="?", default=10_000, help="how many replays")
    parser.add_argument("--part", default="1/1", metavar="K/N", help="every Nth of them, from the Kth on")
    parser.add_argument("--plans", metavar="WORD", default="", help="only of plans whose name has this in it")
    options = parser.parse_args(arguments)
    part, parts = map(int, options.part.split("/"))
    started = process_time()
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    seconds: dict[str, list[float]] = defaultdict(list)
    every = replays(case for case in cases() if options.plans in case.name)
    with suppress(KeyboardInterrupt):
        for done, run in enumerate(islice(every, part - 1, options.count, parts), start=1):
            replay = run()
            counted = counts[replay.kind]
            counted.update({"replays": 1, "messages": len(replay.seconds) + 1, replay.ended.value: 1})
            counted["differences"] += len(replay.differences)
            case = run.args[0]
            seconds[f"{case.name}, {case.steps} steps, {replay.kind}"] += replay.seconds
            for text in replay.differences[:1]:
                print(text, flush=True)
            if done % 100 == 0:
                print(f"{done} replays, {process_time() - started:.0f} s", file=sys.stderr, flush=True)
    for name, known in seconds.items():
        known.sort()
        if known:
            middle, last = (1000 * known[int(len(known) * share)] for share in (0.5, 0.99))
            print(f"{name}: {len(known)} answers, median {middle:.1f} ms, 99 % {last:.1f} ms")
    for kind, counted in sorted(counts.items()):
        print(f"{kind}: {', '.join(f'{number} {what}' for what, number in sorted(counted.items()))}")
    print(f"{process_time() - started:.0f} s of processor time")
    return int(any(counted["differences"] for counted in counts.values()))


if __name__ == "__main__":
    sys.exit(main())
