"""A monitor says the same as a solver that is told all facts anew, whatever order messages come in."""

import asyncio
import threading
from dataclasses import replace
from fractions import Fraction
from heapq import heappop, heappush
from itertools import pairwise
from random import Random

import pytest

from robust import ParametrizedPlan, load_plan
from robust.execute import reorder, slice_forecast
from robust.execute.forecast import PathForecaster, Prospect
from robust.execute.messages import MessageKind, MonitorMessage
from robust.execute.monitor import Monitor, Outlook
from robust.plan.model import Atom, TimePoint
from robust.probability.distributions import Distribution
from robust.smt.limits import Deadline
from tests.execute.replays import EXAMPLES, OPEN, PathOracle, SolverOracle, bare
from tests.irr.test_proposals import drawn_plan
from tests.qe.test_lifted import job_shop
from tests.sampling import often

START, END, TICK = MessageKind.START, MessageKind.END, MessageKind.TICK


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
        oracle = SolverOracle(monitor.plan)
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
            assert outlook.refused is None or message.kind is TICK
        wrong = other.tell(MonitorMessage(START, monitor.plan.instances[0].identifier, other.time + 1))
        assert wrong.refused is not None
        assert same(other.outlook(), monitor.outlook())
        count += 1
    assert count > 3


@pytest.mark.parametrize("first", range(0, often(2, 40), 2))
def test_whatever_is_said_in_whatever_order_the_answer_is_that_of_what_was_taken(first):
    """In thorough runs 10,000 messages: shuffled, repeated, contradicting and taken back, by steps and observations."""
    count = 0
    for seed in range(first, first + 2):
        random = Random(seed)  # noqa: S311 - reproducible
        said = replay(workshop(), random, 0.4)
        said += [replace(m, at=m.at + random.choice([Fraction(-1, 3), Fraction(1, 7)])) for m in random.sample(said, 5)]
        said += [MonitorMessage(MessageKind.FAILED, random.choice(said).step or "n1", Fraction(20)) for _ in range(2)]
        said += [MonitorMessage(MessageKind.FACT, "raw shelf", Fraction(at, 3), observed=at < 9) for at in (1, 2, 30)]
        monitor = workshop()
        while monitor.count < often(60, 250):
            retracted = str(random.randint(1, monitor.count + 1))
            message = random.choice([*said, *said, MonitorMessage(MessageKind.RETRACT, retracted)])
            before, taken = (monitor.outlook() if random.random() < 0.1 else None), dict(monitor.taken)
            refused = monitor.take(message)
            count += 1
            assert refused is None or (monitor.taken == taken and "\n" not in refused)
            if before is not None and refused is not None:
                assert same(before, monitor.outlook())
            if random.random() < 0.1:
                kept = sorted(monitor.taken.values(), key=lambda message: (message.at, message.kind is END))
                again = workshop()
                assert [again.take(message) for message in kept if message.kind is not TICK] == [None] * sum(
                    message.kind is not TICK for message in kept
                )
                again.take(MonitorMessage(TICK, at=monitor.time))
                one, other = again.outlook(), monitor.outlook()
                if one.reordered or other.reordered:  # whichever order was found first is followed
                    assert (one.prospect in OPEN) is (other.prospect in OPEN), (seed, monitor.count)
                else:
                    assert same(one, other), (seed, monitor.count)
    assert count == 2 * often(60, 250)


def same(one: Outlook, other: Outlook) -> bool:
    return (one.time, one.prospect, one.running, one.startable, one.coming) == (
        *(other.time, other.prospect, other.running, other.startable),
        other.coming,
    )


def workshop(**options) -> Monitor:
    files = (EXAMPLES / "workshop" / name for name in ("domain.pddl", "problem.pddl", "plan.log"))
    return Monitor(load_plan(*files, parameters=["duration:*"], deadline="90"), **{"seconds": None, **options})


def test_another_order_of_the_steps_is_followed_and_orders_that_are_statements_are_not_left():
    assert workshop(reorder=False).say("start", "saw ann shelf", at=0).prospect is Prospect.BROKEN
    monitor = workshop()
    outlook = monitor.say("start", "saw ann shelf", at=0)
    assert outlook.prospect in OPEN
    assert outlook.reordered
    assert not outlook.replan
    assert [look.step for look in outlook.running] == ["n3"]


@pytest.mark.parametrize("lateness", [0, 20])
def test_another_order_is_left_only_once_messages_of_it_would_have_come(lateness):
    monitor = workshop(lateness=Fraction(lateness))
    monitor.say("start", "saw ann shelf", at=0)
    outlook = monitor.say("end", "n3", at=9)
    oracle = SolverOracle(replace(monitor.plan, constraints=bare(monitor.plan)))
    times = happened(monitor.plan, list(monitor.taken.values()))
    while outlook.prospect in OPEN:  # nothing is ever started, or has been heard of
        assert oracle.is_possible(times, max(monitor.time - lateness, Fraction(0)))
        outlook = monitor.say("tick", at=monitor.time + 10)
    assert not oracle.is_possible(times, monitor.time - lateness)
    assert outlook.replan


def test_another_order_is_judged_from_when_messages_of_it_may_be_late():
    oracle, possible, time = None, True, 10
    while possible:
        monitor = workshop(lateness=Fraction(20))
        monitor.say("tick", at=time)
        monitor.say("start", "saw ann shelf", at=0)
        outlook = monitor.say("end", "n3", at=9)
        oracle = oracle or SolverOracle(replace(monitor.plan, constraints=bare(monitor.plan)))
        possible = oracle.is_possible(
            happened(monitor.plan, list(monitor.taken.values())), max(monitor.time - 20, Fraction(0))
        )
        assert (outlook.prospect in OPEN) is possible, time
        time += 5
    assert time > 25


def test_attempts_and_observations_are_undecided_until_nothing_more_can_be_heard_of_before_them():
    monitor = workshop(lateness=Fraction(5))
    monitor.say("start", "n0", at=0)
    monitor.say("end", "n0", at=12)
    outlook = monitor.say("fact", "raw table", at=13, observed=False)
    assert outlook.prospect is Prospect.UNDECIDED
    assert monitor.say("tick", at=outlook.wake).prospect is Prospect.BROKEN


def test_what_is_over_is_repeated_once_another_order_is_followed():
    monitor = workshop()
    for kind, step, at in (("start", "n0", 0), ("end", "n0", 12), ("start", "n3", 13)):
        before = monitor.say(kind, step, at=at)
    assert before.reordered
    again = monitor.say("end", "n0", at=12)
    assert replace(again, message=before.message) == before


def test_what_is_observed_replaces_what_the_plan_predicts():
    monitor = workshop()
    monitor.say("end", "n0", at=12)
    before = monitor.say("start", "n0", at=0)
    assert monitor.say("fact", "raw table", at=12, observed=True).prospect is before.prospect is Prospect.ON_TRACK
    assert Atom("cut", ("chair",)) in monitor.state.atoms
    assert "two values of (raw table)" in str(monitor.say("fact", "(raw table)", at=12, observed=False).refused)
    outlook = monitor.say("fact", "(raw table)", at=13, observed=False)
    assert (outlook.prospect, outlook.replan) == (Prospect.BROKEN, True)
    assert any("(raw table) is false and not true" in reason for reason in outlook.reasons)
    assert monitor.say("retract", str(monitor.count)).prospect is Prospect.ON_TRACK
    assert "expected an atom of the plan" in str(monitor.say("fact", "raw moon", at=12, observed=True).refused)
    assert "expected true or false" in str(monitor.say("fact", "raw table", at=12, observed=1).refused)


def test_a_message_that_others_rest_on_is_not_taken_back_before_them():
    monitor = workshop()
    for kind, at in (("start", 0), ("failed", 3), ("start", 4)):
        before = monitor.say(kind, "n0", at=at)
    refused = monitor.say("retract", "2")
    assert str(refused.refused).startswith("found n0 start at 4 and at 0, expected one time: without message 2 ")
    assert replace(refused, refused=None, message=3) == before
    assert monitor.say("retract", "3").refused is None
    assert monitor.say("retract", "2").prospect is Prospect.ON_TRACK


def test_what_is_said_again_is_not_judged_again(monkeypatch):
    judged, real = [], reorder.reordered
    monkeypatch.setattr(reorder, "reordered", lambda *known, **options: judged.append(1) or real(*known, **options))
    monitor = workshop()
    monitor.say("start", "n0", at=0)
    monitor.say("fact", "cut table", at=1, observed=True)
    count = len(judged)
    assert count > 0
    monitor.say("fact", "(cut table)", at=1, observed=True)
    monitor.say("start", "n0", at=0)
    assert len(judged) == count
    outlook = monitor.say("tick", at=100)
    assert outlook.prospect is Prospect.BROKEN
    count = len(judged)
    again = [monitor.say("tick", at=101), monitor.say("end", "n0", at=101), monitor.say("end", "n0", at=101)]
    assert [each.reasons for each in again] == [outlook.reasons] * 3
    assert len(judged) == count
    assert monitor.say("retract", str(outlook.message)).prospect is Prospect.BROKEN
    assert len(judged) > count, "what is taken back may have been the reason"


def test_slices_ask_a_solver_only_what_is_new():
    files = (EXAMPLES / "generator" / name for name in ("domain.pddl", "problem.pddl", "plan.stn"))
    monitor = Monitor(load_plan(*files, parameters=["duration:*"]), reorder=False, seconds=None)
    monitor.say("start", "shift", at=0)
    before = monitor.say("start", "pour_1", at=20)
    session = monitor._own._session
    checks = session.statistics.queries
    assert replace(monitor.say("start", "pour_1", at=20), message=before.message) == before
    assert session.statistics.queries == checks
    monitor.say("tick", at=21)
    assert monitor._own._session is session
    assert session.statistics.queries > checks
    for number in "23":
        monitor.say("retract", number)
    assert monitor._own._session is not session, "what it was told is wrong"
    same_again = Monitor(monitor.plan, reorder=False, seconds=None)
    same_again.say("start", "shift", at=0)
    assert same_again.say("tick", at=21).prospect is monitor.outlook().prospect


def test_an_end_without_a_start_is_said_to_wait_for_it():
    monitor, other = workshop(), workshop()
    waiting = monitor.say("end", "n0", at=12)
    assert waiting.assumed == ("n0 has not started: its end at 12 was said, its start was not",)
    assert monitor.say("tick", at=13).assumed == waiting.assumed
    begun = monitor.say("start", "n0", at=0)
    for kind, at in (("start", 0), ("end", 12)):
        other.say(kind, "n0", at=at)
    assert begun == other.say("tick", at=13)
    assert begun.assumed == ()


@pytest.mark.parametrize(
    ("lateness", "refused"), [(0, [False, True, True, False, False]), (3, [False, False, True, False, False])]
)
def test_a_clock_goes_back_only_as_far_as_messages_may_be_late(lateness, refused):
    monitor = workshop(lateness=Fraction(lateness))
    said = [("tick", 9), ("tick", 6), ("tick", 5), ("tick", 9), ("tick", 10)]
    assert [monitor.say(kind, at=at).refused is not None for kind, at in said] == refused
    assert monitor.time == 10
    assert monitor.say("start", "n0", at=2).refused is None, "events may come late"
    assert monitor.say("retract", "5").refused is None
    assert "after tick 9" in monitor.say("tick", at=1).refused


def test_an_observation_is_taken_back():
    monitor = workshop()
    monitor.say("start", "n0", at=0)
    before = monitor.say("value", "cutting chair", at=1, observed=12)
    assert "two values of (cutting chair) at 1" in str(monitor.say("value", "cutting chair", at=1, observed=7).refused)
    monitor.say("retract", "2")
    assert monitor.say("value", "cutting chair", at=1, observed=7).refused is None
    assert "expected the number of one that was taken" in str(monitor.say("retract", "2").refused)
    monitor.say("retract", "5")
    again = monitor.say("value", "cutting chair", at=1, observed=12)
    assert replace(again, message=before.message) == before


def test_times_without_a_common_unit_of_sixty_digits_are_refused():
    monitor = workshop()
    before = monitor.say("start", "n0", at=1 + Fraction(1, 1 << 199))
    assert before.refused is None
    refused = monitor.say("end", "n0", at=Fraction(14) + Fraction(1, 3**100))
    assert "no common unit of 60 digits" in str(refused.refused)
    assert replace(refused, refused=None, message=1) == before
    monitor.say("retract", "1")
    assert monitor.say("start", "n0", at=Fraction(1, 3**100)).refused is None


def test_a_step_that_failed_breaks_the_plan_until_it_is_attempted_again():
    monitor = workshop()
    monitor.say("start", "n0", at=0)
    assert monitor.say("failed", "n0", at=3).replan
    outlook = monitor.say("start", "n0", at=4)
    assert outlook.prospect is Prospect.BROKEN, "it took the raw chair, and does so once"


def random_durations(plan: ParametrizedPlan) -> dict[str, Distribution]:
    laws = (
        lambda nominal: Distribution("uniform", {"lower": nominal / 2, "upper": nominal * 2}),
        lambda nominal: Distribution("normal", {"mean": nominal, "deviation": nominal / 4, "minimum": nominal / 3}),
        lambda nominal: Distribution("exponential", {"mean": nominal, "minimum": nominal / 2}),
    )
    return {p.name: laws[number % 3](p.nominal) for number, p in enumerate(plan.parameters)}


def success_in_draws(monitor: Monitor, random: Random, count: int) -> float:
    """How often a schedule in the plan's order is left for durations that last on from where they are."""
    oracle, times, wins = PathOracle(monitor.plan), happened(monitor.plan, list(monitor.taken.values())), 0
    for _ in range(count):
        lengths = {}
        for name, law in monitor.distributions.items():
            step = monitor.plan.lasting[name]
            begun = times.get(monitor.plan.instance[step].start, monitor.time)
            lengths[step] = law.draw(random)
            while monitor.plan.instance[step].end not in times and lengths[step] < monitor.time - begun:
                lengths[step] = law.draw(random)
        wins += oracle.windows(times, monitor.time, lengths) is not None
    return wins / count


def test_bounds_of_the_probability_of_success_hold_in_draws():
    plan, random, count = workshop().plan, Random(4), often(300, 3_000)  # noqa: S311 - reproducible
    monitor = workshop(reorder=False, distributions=random_durations(plan))
    told = [("tick", "", 0), ("start", "n0", 0), ("tick", "", 10), ("end", "n0", 14), ("start", "n1", 15)]
    told += [("tick", "", 20), ("end", "n1", 27), ("tick", "", 40)]
    seen = []
    for kind, step, at in told:
        outlook = monitor.say(kind, step, at=at)
        if kind == "tick":
            known, share = outlook.success, success_in_draws(monitor, random, count)
            error = 4 * (share * (1 - share) / count) ** 0.5 + 0.001
            assert known.lower - error <= share <= known.upper + error, (at, known, share)
            assert known.upper - known.lower < 0.1
            assert max(known.lower.denominator, known.upper.denominator) <= 10**6
            seen.append(known)
    assert any(0.05 < known.lower < known.upper < 0.95 for known in seen)
    assert monitor.say("tick", at=100).success.upper == 0


def test_success_is_certain_from_above_only_of_durations_whose_distribution_is_known():
    plan = workshop().plan
    known = random_durations(plan)
    every = workshop(distributions=known).outlook().success
    known.popitem()
    some = workshop(distributions=known).outlook().success
    assert some.lower == 0
    assert every.upper <= some.upper < 1


def test_answers_need_not_wait_for_the_probability_of_success():
    plan = workshop().plan
    eager, lazy = (workshop(distributions=random_durations(plan), eager=eager) for eager in (True, False))
    assert lazy.outlook().success is None
    first = lazy.assess().success
    assert first == eager.outlook().success
    after = lazy.say("start", "n0", at=0)
    assert after.success == first
    assert lazy.assess(Deadline(idle=lambda: False)).success == first
    assert lazy.say("end", "n0", at=20).success == first
    eager.say("start", "n0", at=0)
    assert lazy.assess() == eager.say("end", "n0", at=20)
    assert lazy.outlook().success != first
    assert lazy.outlook().success.time == 20


def test_answers_need_not_wait_for_other_orders():
    reordered = 0
    for step in workshop().plan.instance:
        eager, lazy = (workshop(eager=eager) for eager in (True, False))
        first = lazy.say("start", step, at=0)
        wanted = eager.say("start", step, at=0)
        then = lazy.assess()
        assert lazy.outlook() == then  # not that of the other one: a solver chooses the order
        assert (then.prospect, then.reordered, then.replan) == (wanted.prospect, wanted.reordered, wanted.replan)
        if first != then:
            assert (first.prospect, first.replan) == (Prospect.UNDECIDED, False)
            reordered += wanted.reordered
    assert reordered


def test_answers_are_shown_as_other_results_are():
    monitor = workshop()
    outlook = monitor.say("start", "n0", at=0)
    looks = (*outlook.running, *outlook.startable, *outlook.coming)
    lines = str(outlook).splitlines()
    assert lines[0] == "on track at 0"
    assert [line.split()[0] for line in lines[-len(looks) :]] == [look.step for look in looks]
    assert "0, runs" in lines[-len(looks)]
    assert [(row["step"], row["state"]) for row in outlook.rows()[:2]] == [("n0", "running"), ("n1", "coming")]
    assert outlook.as_dict()["schema"] == "robust/watch/1"
    assert len(outlook.as_dict()["coming"]) == len(outlook.coming)
    assert str(monitor.say("failed", "n0", at=3)) == "broken at 3\nn0 failed at 3"
    assert str(monitor.say("end", "nosuch", at=3)).startswith("broken at 3\nrefused: found 'nosuch'")


def waking(monitor: Monitor) -> list[Outlook]:
    """The answers of a run in which a clock does nothing but wake, and nobody says anything more."""
    answers = [monitor.assess()]
    while answers[-1].wake is not None:
        assert len(answers) < 100
        assert monitor.say("tick", at=answers[-1].wake).refused is None
        answers.append(monitor.assess())
        assert answers[-1].time == answers[-2].wake > answers[-2].time
    return answers


@pytest.mark.parametrize("lateness", [0, 5])
@pytest.mark.parametrize("started", [False, True])
def test_a_clock_wakes_only_where_time_opens_or_closes_a_window(lateness, started):
    monitor = workshop(lateness=Fraction(lateness))
    if started:
        monitor.say("start", "n0", at=0)
    answers = waking(monitor)
    assert [answer.prospect for answer in answers] == [Prospect.ON_TRACK, Prospect.AT_RISK, Prospect.BROKEN]
    for before, after in pairwise(answers):
        again = Monitor(monitor.plan, lateness=monitor.lateness)
        for message in [each for each in monitor.taken.values() if each.kind is START]:
            again.tell(message)
        assert again.say("tick", at=after.time - Fraction(1, 500)).prospect is before.prospect


def test_a_clock_wakes_where_a_start_waits_for_time_alone():
    monitor = workshop()
    monitor.say("start", "n0", at=0)
    answer = monitor.say("end", "n0", at=12)
    while answer.wake is not None and not answer.startable:
        answer = monitor.say("tick", at=answer.wake)
    assert answer.time < Fraction(1201, 100), "after the separation from what has just happened"


def test_promises_by_slices_wake_a_clock_a_few_times(monkeypatch):
    monkeypatch.setattr(slice_forecast, "SLICE_SECONDS", None)  # whatever else this machine does
    monkeypatch.setattr(slice_forecast, "REGION_SECONDS", None)
    files = (EXAMPLES / "generator" / name for name in ("domain.pddl", "problem.pddl", "plan.stn"))
    monitor = Monitor(load_plan(*files, parameters=["duration:*"]), reorder=False, seconds=None)
    monitor.say("start", "shift", at=0)
    monitor.say("start", "pour_1", at=20)
    answers = waking(monitor)
    assert len(answers) < 40
    assert answers[-1].prospect is Prospect.BROKEN


def test_a_box_is_promised_where_there_is_no_time_for_the_envelope(monkeypatch):
    for limit in ("SLICE_SECONDS", "REGION_SECONDS", "GROWTH_SECONDS"):
        monkeypatch.setattr(slice_forecast, limit, None)
    search = slice_forecast.RegionSearch
    monkeypatch.setattr(
        slice_forecast, "RegionSearch", lambda *plan, epsilon, timeout: search(*plan, epsilon=epsilon, timeout=0)
    )
    files = (EXAMPLES / "generator" / name for name in ("domain.pddl", "problem.pddl", "plan.stn"))
    promise = Monitor(load_plan(*files, parameters=["duration:*"]), reorder=False, seconds=None).outlook().promise
    assert any(least < most for least, most in promise.values())


def test_an_event_loop_goes_on_while_answers_are_worked_out(monkeypatch):
    """An answer that is only worked out once the loop has turned: if it waited, nobody would say so."""
    turned, real = threading.Event(), Monitor.outlook
    monkeypatch.setattr(Monitor, "outlook", lambda *known: turned.wait(60) and real(*known))

    async def run() -> list[int]:
        monitor = workshop()
        messages = [MonitorMessage(TICK, at=Fraction(number)) for number in range(5)]
        answers = asyncio.gather(*map(monitor.told, messages))
        for _ in range(100):
            await asyncio.sleep(0)
        assert not answers.done()
        turned.set()
        return [outlook.message for outlook in await answers]

    assert asyncio.run(run()) == [1, 2, 3, 4, 5]
