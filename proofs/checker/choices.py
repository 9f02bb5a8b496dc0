"""Plans with choices: `execution`, a correct execution of a `.tpnu.json` network with its PDDL; `knowledge`, that there
is none, perhaps with some choices as assumed.

An execution gives every choice one of its values, and every event whose guard then holds a time [PIKE, Definitions 2.5
to 2.8]. It is correct if the constraints and durations whose guards hold are kept, everything is between `e_initial`
and `e_goal`, and each condition whose guard holds has a producer: an effect before it that makes it true, such that
each effect that makes it false is before that or after the condition. Before is at least epsilon before.
"""

import json
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from .claims import Claim
from .formulas import FALSE, TRUE, Formulas, constant, names_in, plus
from .proofs import Facts, Tape, demand, listed, rational, refute, whole
from .reader import Ground, Linear, Model, Scope, Tree, conjuncts, need, number

Guard = dict[str, str]
NONE = type(None)
SPAN: dict[str, set[type]] = {"from": {str}, "to": {str}, "lower": {str, NONE}, "upper": {str, NONE}, "guard": {dict}}
KEYS: dict[str, dict[str, set[type]]] = {
    "choices": {"name": {str}, "domain": {list}, "controllable": {bool}, "at": {str}},
    "events": {"name": {str}, "guard": {dict}},
    "constraints": SPAN,
    "activities": {**SPAN, "lower": {str}, "action": {str}, "agent": {str, NONE}},
}
OPTIONAL = {"guard", "agent"}


def members(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    need(len(dict(pairs)) == len(pairs), "found a key twice")
    return dict(pairs)


def network_of(text: str) -> dict[str, Any]:
    """The network, each of its lists there, numbers as text."""
    found = json.loads(text, parse_int=str, parse_float=str, object_pairs_hook=members)
    need(type(found) is dict and found.get("format") == "tpnu/1", "expected a network of format tpnu/1")
    need(found.keys() <= {"format", "name", "domain", "problem", "parameters", *KEYS}, "found an unknown key")
    need(type(found.get("domain")) is type(found.get("problem")) is str, "expected the names of domain and problem")
    for kind, types in KEYS.items():
        need(type(found.setdefault(kind, [])) is list, f"expected a list of {kind}")
        for each in found[kind]:
            complete = type(each) is dict and types.keys() - OPTIONAL <= each.keys() <= types.keys()
            need(complete and all(type(each[key]) in types[key] for key in each), f"found {kind} malformed")
    return dict(found)


@dataclass(frozen=True)
class Condition:
    """An atom that is to be true, or false, just before `first` and until just before `last`."""

    atom: str
    value: bool
    first: str
    last: str
    guard: Guard
    activity: int | None


@dataclass(frozen=True)
class Effect:
    atom: str
    value: bool
    event: str
    guard: Guard
    activity: int | None


class Choices:
    """The formula that says what a correct execution is: `parts` are what has to hold.

    If an execution is given, by the number of each choice's value and by each event's time or None, they are constant.
    """

    def __init__(
        self, network: dict[str, Any], domain: str, problem: str, epsilon: Fraction, execution: list[Any] | None = None
    ) -> None:
        self.model = Model(domain, problem)
        need(not self.model.timed, "found timed initial literals in a plan with choices")
        need(epsilon > 0, "epsilon has to be above 0 in a plan with choices")
        ground = Ground(self.model)
        ground.point("start")
        self.domains = {each["name"]: each["domain"] for each in network["choices"]}
        self.guards: dict[str, Guard] = {each["name"]: each.get("guard", {}) for each in network["events"]}
        for kind, names in (("choices", self.domains), ("events", self.guards)):
            need(len(names) == len(network[kind]), f"found two {kind} of one name")
        for end in ("e_initial", "e_goal"):
            need(self.guards.setdefault(end, {}) == {}, f"found a guard of {end}")
        self.chosen: Guard = {}
        self.times = {event: {f"@{index}": Fraction(1)} for index, event in enumerate(self.guards, start=1)}
        if execution is not None:
            numbers, texts = listed(execution[0], len(self.domains)), listed(execution[1], len(self.guards))
            for place, (name, values) in zip(numbers, self.domains.items()):
                self.chosen[name] = values[whole(place, len(values))]
            for text, (event, guard) in zip(texts, self.guards.items()):
                happens = guard.items() <= self.chosen.items()
                demand((text is not None) == happens, f"found a time, or none, of {event}")
                self.times[event] = {} if text is None else constant(rational(text))
        self.ends: dict[int | None, str] = {}  # the event of each time point of an activity
        parameters = {*self.model.synth}
        for place, activity in enumerate(network["activities"]):
            call = activity["action"].lower().replace("(", " ").replace(")", " ").split()
            parameters |= ground.instance(str(place), True, call)
            self.ends |= {2 * place + 1: activity["from"], 2 * place + 2: activity["to"]}
        need(not ground.flows and not parameters, "found continuous effects or parameters")
        self.formulas = Formulas(ground, epsilon, {f"@{point}": self.time(event) for point, event in self.ends.items()})
        self.circuit = self.formulas.circuit
        self.values = {
            (name, value): self.circuit.compare(
                {"": Fraction(self.chosen[name] == value)} if self.chosen else {f"?{i}.{j}": Fraction(1)}, True
            )
            for i, (name, values) in enumerate(self.domains.items())
            for j, value in enumerate(values)
        }
        self.parts: list[int] = []
        for name, values in self.domains.items():
            need(values and len({*values}) == len(values), f"found {name} without values, or with one twice")
            each = [self.values[name, value] for value in values]
            self.parts.append(self.circuit.any(each))
            self.parts += [-self.circuit.all([a, b]) for i, a in enumerate(each) for b in each[:i]]
        for event, guard in self.guards.items():
            for a, b in (("e_initial", event), (event, "e_goal")):
                if a != b:
                    self.constrain(guard, a, b, epsilon, None)
        for edge in (*network["constraints"], *network["activities"]):
            low, high = (None if edge[key] is None else number(edge[key]) for key in ("lower", "upper"))
            self.constrain(edge.get("guard", {}), edge["from"], edge["to"], low, high)
        self.conditions: list[Condition] = []
        self.effects: list[Effect] = []
        for place, activity in enumerate(network["activities"]):
            self.activity(place, activity.get("guard", {}))
        self.require(self.model.condition(self.model.goal, Scope({}, {})), None, ("e_goal", "e_goal", {}, None))
        atoms = sorted({each.atom for each in self.conditions})
        self.effects += [Effect(atom, bool(self.model.initial.get(atom)), "e_initial", {}, None) for atom in atoms]
        self.parts += [self.met(condition) for condition in self.conditions]

    def time(self, event: str) -> Linear:
        need(event in self.times, f"found {event}, expected a declared event")
        return self.times[event]

    def holds(self, guard: Guard) -> int:
        need(all((name, value) in self.values for name, value in guard.items()), f"found an unknown value in {guard}")
        return self.circuit.all([self.values[name, value] for name, value in guard.items()])

    def unless(self, guard: Guard, literal: int) -> int:
        return self.circuit.any([-self.holds(guard), literal])

    def before(self, a: str, b: str) -> int:
        return self.circuit.compare(plus(plus(self.time(b), self.time(a), -1), constant(self.formulas.epsilon), -1))

    def constrain(self, guard: Guard, a: str, b: str, low: Fraction | None, high: Fraction | None) -> None:
        gap = plus(self.time(b), self.time(a), -1)
        implied = {*self.guards[a].items(), *self.guards[b].items()}
        need(implied <= {*guard.items()}, f"found {a} and {b} related where they do not happen")
        if low is not None:
            self.parts.append(self.unless(guard, self.circuit.compare(plus(gap, constant(low), -1))))
        if high is not None:
            self.parts.append(self.unless(guard, self.circuit.compare(plus(constant(high), gap, -1))))

    # -- activities ----------------------------------------------------------------------------------------------------

    def activity(self, place: int, guard: Guard) -> None:
        """Its durations, conditions and effects."""
        ends = {point: self.ends[point] for point in (2 * place + 1, 2 * place + 2)}
        for duty in self.formulas.ground.duties:
            if duty.first in ends:
                where = ends[duty.first], ends[duty.last or duty.first], guard, place
                self.require(duty.condition, duty.owner, where)
        for point, event in ends.items():
            happens = dict[str, bool]()
            for effect in self.formulas.ground.effects[point]:
                need(effect.kind in ("add", "delete"), "found a change of a number")
                if_so = self.settled(effect.when, effect.owner)
                need(if_so in (TRUE, FALSE), "found a condition on durations of an effect")
                if if_so == TRUE:
                    happens[effect.target] = happens.get(effect.target, False) or effect.kind == "add"
            self.effects += [Effect(atom, value, event, guard, place) for atom, value in happens.items()]

    def settled(self, tree: Tree, owner: Any) -> int:
        """A condition that nothing in the plan changes; it is the same at all moments."""
        need(not self.formulas.writes.keys() & {*names_in(tree)}, "found a condition that is no conjunction")
        return self.formulas.truth(tree, ("final", None), owner)

    def require(self, tree: Tree, owner: Any, where: tuple[str, str, Guard, int | None]) -> None:
        """The literals of a conjunction, and what is said of durations and of what never changes."""
        for part in conjuncts(tree):
            match part:
                case ("atom", atom):
                    self.conditions.append(Condition(atom, True, *where))
                case ("not", ("atom", atom)):
                    self.conditions.append(Condition(atom, False, *where))
                case _:
                    self.parts.append(self.unless(where[2], self.settled(part, owner)))

    def met(self, condition: Condition) -> int:
        """Some producer is in time, and no threat is between it and the end of the condition.

        What an activity does at its start is in time for its own condition over all, and what it does where a condition
        of its own ends comes after that.
        """
        supports = []
        threats = [each for each in self.effects if each.atom == condition.atom and each.value != condition.value]
        own = condition.activity, condition.last
        threats = [each for each in threats if (each.activity, each.event) != own]
        for producer in self.effects:
            if producer.atom == condition.atom and producer.value == condition.value:
                begins = (producer.activity, producer.event) == (condition.activity, condition.first) != own
                in_time = TRUE if begins else self.before(producer.event, condition.first)
                apart = [[self.before(t.event, producer.event), self.before(condition.last, t.event)] for t in threats]
                away = [self.unless(t.guard, self.circuit.any(each)) for t, each in zip(threats, apart)]
                supports.append(self.circuit.all([self.holds(producer.guard), in_time, *away]))
        return self.unless(condition.guard, self.circuit.any(supports))


def check_choices(
    tape: Tape, files: tuple[dict[str, Any], str, str], kind: str, stated: object, epsilon: Fraction
) -> Claim:
    """Of a network and its PDDL: that some execution is correct, or that none is with the choices that are stated."""
    if kind == "execution":
        demand(stated is None, "the certificate of an execution has no assumptions")
        choices = Choices(*files, epsilon, listed(tape.next("execution"), 2))
        demand(all(part == TRUE for part in choices.parts), "the execution is not correct")
        times = {event: choices.time(event).get("", Fraction(0)) for event in choices.guards}
        happens = {event: time for event, time in times.items() if choices.holds(choices.guards[event]) == TRUE}
        shown_times = ", ".join(f"{event} at {time}" for event, time in happens.items())
        text = f"correct execution of the plan with choices: {shown(choices.chosen)}; {shown_times}"
    else:
        choices = Choices(*files, epsilon)
        choices.chosen = dict(listed(stated))
        parts = [*choices.parts, choices.holds(choices.chosen)]
        refute(tape, choices.formulas, Facts(choices.formulas, []), choices.circuit.all(parts))
        given = f" with {shown(choices.chosen)}" if choices.chosen else ""
        text = f"no choices and times{given} are a correct execution of the plan with choices"
    tape.finish()
    refuted = int(kind == "knowledge")
    return Claim(kind, epsilon, text, choices=choices.chosen, obligations=len(choices.parts), refuted=refuted)


def shown(chosen: Guard) -> str:
    return ", ".join(f"{name} = {value}" for name, value in chosen.items())
