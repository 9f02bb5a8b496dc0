"""A monitor says the same as a solver that is told all facts anew, whatever order messages come in."""

from fractions import Fraction
from heapq import heappop, heappush
from random import Random

import pytest

from robust import ParametrizedPlan
from robust.encode.encoding import RelationalEncoding
from robust.encode.interface import constant
from robust.execute.forecast import PathForecaster, Prospect
from robust.execute.messages import MessageKind, MonitorMessage
from robust.execute.monitor import Monitor, Outlook
from robust.plan.model import ZERO, TimePoint
from robust.smt.limits import NEVER
from robust.smt.session import Satisfiability, Session
from tests.cli.running import example
from tests.irr.test_proposals import drawn_plan
from tests.qe.test_lifted import job_shop
from tests.sampling import often

START, END, TICK = MessageKind.START, MessageKind.END, MessageKind.TICK
OPEN = {Prospect.ON_TRACK, Prospect.AT_RISK}


class Oracle:
    """Some continuation keeps network and obligations, as a solver says."""

    def __init__(self, plan: ParametrizedPlan) -> None:
        self.plan, self.encoding = plan, RelationalEncoding(plan)
        terms = self.encoding.terms
        violations = [known.violation for known in self.encoding.obligations if known.violation is not None]
        kept = [terms.negation(violation) for violation in violations]
        self.session = Session(terms)
        self.session.add(*self.encoding.network_formulas(), *kept, *self.encoding._states.definitions.needed_by(kept))

    def is_possible(self, times: dict[TimePoint, Fraction], now: Fraction) -> bool:
        terms, places = self.encoding.terms, self.encoding.places
        facts = [
            terms.equal(places[point] - constant(times[point]))
            if point in times
            else terms.at_least(places[point] - constant(now))
            for point in self.plan.time_points
            if point != ZERO and (point in times or point.time is None)
        ]
        with self.session.frame(*facts):
            return self.session.check("possible", NEVER) is Satisfiability.SATISFIABLE


def replay(monitor: Monitor, random: Random, spread: float) -> list[MonitorMessage]:
    """An execution as a robot might report it: durations that vary, starts that are late, until it is over."""
    said: list[MonitorMessage] = []
    ends: list[tuple[Fraction, str]] = []
    now, outlook = Fraction(0), monitor.outlook()
    while outlook.prospect in OPEN:
        ready = [look for look in outlook.startable if not look.start[0] > now]
        if ready and random.random() < 0.9:
            look = random.choice(ready)
            now += Fraction(random.choice([0, 0, 0, 1]), 8)
            message = MonitorMessage(START, random.choice([look.step, look.name]), now)
            length = monitor.planned[look.step] * Fraction(random.uniform(1 - spread, 1 + spread)).limit_denominator(64)
            heappush(ends, (now + length, look.step))
        elif ends:
            now, step = max(now, ends[0][0]), ends[0][1]
            heappop(ends)
            message = MonitorMessage(END, step, now)
        else:
            now = max(now + Fraction(1, 16), min((look.start[0] for look in outlook.coming), default=now))
            message = MonitorMessage(TICK, at=now)
        outlook = monitor.tell(message)
        assert outlook.refused is None
        said.append(message)
    return said


def happened(plan: ParametrizedPlan, messages: list[MonitorMessage]) -> dict[TimePoint, Fraction]:
    """The times of points, from messages by identifier."""
    ends = {START: lambda step: step.start, END: lambda step: step.end}
    return {ends[m.kind](plan.instance[m.step]): m.at for m in messages if m.kind in ends}


def plans(seed: int) -> Monitor | None:
    plan = job_shop(3, 3, seed) if seed % 5 == 0 else drawn_plan(seed)
    monitor = Monitor(plan, reorder=False)
    return monitor if isinstance(monitor._own, PathForecaster) else None


@pytest.mark.parametrize("first", range(0, often(30, 600), 30))
def test_nothing_is_left_when_a_solver_says_so(first):
    ended: dict[Prospect, int] = dict.fromkeys(Prospect, 0)
    for seed in range(first, first + 30):
        monitor, random = plans(seed), Random(seed)  # noqa: S311 - reproducible
        if monitor is None:
            continue
        oracle = Oracle(monitor.plan)
        said = list(replay(monitor, random, random.choice([0, 0.1, 0.3, 0.9])))
        fresh = Monitor(monitor.plan, reorder=False)
        for count, message in enumerate(said, start=1):
            outlook = fresh.tell(message)
            now = max(each.at for each in said[:count])
            known = [fresh.taken[number] for number in range(1, count + 1)]
            possible = oracle.is_possible(happened(fresh.plan, known), now)
            assert (outlook.prospect is not Prospect.BROKEN) is possible, (seed, count)
            assert outlook.prospect is not Prospect.BROKEN or outlook.reasons
        ended[outlook.prospect] += 1
    assert ended[Prospect.DONE] > 3
    assert ended[Prospect.BROKEN] > 3


@pytest.mark.parametrize("first", range(0, often(10, 200), 10))
def test_messages_late_repeated_and_in_any_order_mean_the_same(first):
    count = 0
    for seed in range(first, first + 10):
        monitor, random = plans(seed), Random(seed)  # noqa: S311 - reproducible
        if monitor is None:
            continue
        replay(monitor, random, 0.4)
        heard = list(monitor.taken.values())
        shuffled = [*heard, *random.sample(heard, len(heard) // 3)]
        random.shuffle(shuffled)
        other = Monitor(monitor.plan, reorder=False)
        for message in shuffled:
            outlook = other.tell(message)
            assert outlook.refused is None
        wrong = other.tell(MonitorMessage(START, monitor.plan.instances[0].identifier, other.time + 1))
        assert wrong.refused is not None
        assert same(other.outlook(), monitor.outlook())
        count += 1
    assert count > 3


def same(one: Outlook, other: Outlook) -> bool:
    return (one.time, one.prospect, one.running, one.startable, one.coming) == (
        *(other.time, other.prospect, other.running, other.startable),
        other.coming,
    )


def workshop() -> Monitor:
    return Monitor(example("workshop", parameters=["duration:*"], deadline="90"))
