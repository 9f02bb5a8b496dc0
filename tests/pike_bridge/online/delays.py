"""People who hesitate, and a check of continuations that shares no reasoning with executives."""

from itertools import product

from robust.execute.drive import run_in_world
from robust.pike_bridge.model import guard
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.semantic import SemanticReasoner
from robust.pike_bridge.online.world import Pace, SimulatedTeam, Story
from robust.pike_bridge.semantics import ExecutionExistence, Oracle, Semantics
from robust.smt.session import Satisfiability, Session


class Hesitant(SimulatedTeam):
    """Makes every choice the same time after it is possible."""

    def _drawn(self, greatest):
        return greatest


def joint_values(plan):
    """What people may choose, all choices together."""
    choices = [each for each in plan.network.choices if not each.controllable]
    for values in product(*(each.domain for each in choices)):
        yield dict(zip((each.name for each in choices), values, strict=True))


def possible_intents(plan):
    """The joint values of the choices of people with which a correct execution exists."""
    oracle = Oracle(plan)
    return [each for each in joint_values(plan) if oracle.decide(guard(each)).verdict is ExecutionExistence.EXISTS]


def execute(plan, intent, delay, *, patience, reasoner=SemanticReasoner, observe=lambda *_: None, pace=Pace.LEAST):
    """Carry a plan out with people who mean `intent`; `observe` is told of each step: the executive and decisions."""
    executive = PlanExecutive(plan, reasoner, patience=patience)
    decide = executive.step

    def step(now, messages=()):
        found = decide(now, messages)
        observe(executive, found)
        return found

    executive.step = step
    judge = SemanticReasoner(executive.progress)
    outcomes = {name: (value, None) for name, value in intent.items()}
    run_in_world(executive, Hesitant(plan, executive, judge, Story(pace=pace, outcomes=outcomes, delay=delay)))
    return executive


class Continuations:
    """Whether something correct is left, by the definition of correct executions alone [PIKE, Definition 2.8]."""

    def __init__(self, plan):
        self._plan, self._semantics = plan, Semantics(plan)
        self._session = Session(self._semantics.terms)
        self._session.add(*self._semantics.formulas)
        self._observed = {each.name for each in plan.network.choices if not each.controllable}

    def possible(self, intent, chosen, times, now):
        """Whether a correct execution has the intent, what was chosen and executed, and what others do after now."""
        semantics, network = self._semantics, self._plan.network
        if any(chosen.get(name, value) != value for name, value in intent.items()):
            return False
        asked = [semantics.guard(guard(intent)), semantics.guard(guard(chosen))]
        for event, label in network.guards.items():
            if event in times:
                asked += [semantics.guard(label), semantics.at(event, times[event])]
                continue
            asked.append(semantics.not_earlier(event, now))
            late = now + self._plan.epsilon
            made = {each.name for each in network.choices if each.event == event} | {each.variable for each in label}
            if made & self._observed - chosen.keys():
                asked.append(semantics.not_earlier(event, late))
            for activity in network.activities:
                if activity.target == event:
                    asked.append(semantics.not_earlier(event, late, activity.guard))
        with self._session.frame(*asked):
            return self._session.check("an intent") is Satisfiability.SATISFIABLE
