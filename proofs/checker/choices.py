"""Plans with choices: `execution`, a correct execution of a `.tpnu.json` network with its PDDL; `knowledge`, that there
is none, perhaps with some choices as assumed.

An execution gives every choice one of its values, and every event whose guard then holds a time [PIKE, Definitions 2.5
to 2.8]. It is correct if the constraints and durations whose guards hold are kept, everything is between `e_initial`
and `e_goal`, and each condition whose guard holds has a producer: an effect before it that makes it true, such that
each effect that makes it false is before that or after the condition. Before is at least epsilon before.
"""

import json
import re
from fractions import Fraction
from typing import Any, NamedTuple

from .claims import Claim
from .formulas import FALSE, TRUE, Formulas, names_in, plus
from .proofs import Facts, Tape, demand, listed, rational, refute, whole
from .reader import Ground, Model, Scope, Tree, conjuncts, constant, need, number

Guard = dict[str, str]
Files = tuple[dict[str, Any], str, str]
"""A network, and the texts of domain and problem."""


class Numeral(str):
    """A number of a network, as its text has it."""


BOUND: set[type] = {type(None), str, Numeral}
VARIED = {"name", "duration", "at-least", "at-most", "hesitation"}
SPAN: dict[str, set[type]] = {"from": {str}, "to": {str}, "lower": BOUND, "upper": BOUND, "guard": {dict}}
KEYS: dict[str, dict[str, set[type]]] = {
    "choices": {"name": {str}, "domain": {list}, "controllable": {bool}, "at": {str}},
    "events": {"name": {str}, "guard": {dict}},
    "constraints": SPAN,
    "activities": {**SPAN, "lower": {str, Numeral}, "action": {str}, "agent": {str, type(None)}},
}


def members(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    need(len(dict(pairs)) == len(pairs), "found a key twice")
    return dict(pairs)


def is_name(text: Any) -> bool:
    return type(text) is str and re.fullmatch("[^\0-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]+", text) is not None


def network_of(text: str) -> dict[str, Any]:
    """The network, each of its lists there."""
    found = json.loads(text, parse_int=Numeral, parse_float=Numeral, object_pairs_hook=members)
    need(type(found) is dict and found.get("format") == "tpnu/1", "expected a network of format tpnu/1")
    need(found.keys() <= {"format", "name", "domain", "problem", "parameters", *KEYS}, "found an unknown key")
    need(all(is_name(found.get(key)) for key in ("name", "domain", "problem")), "expected a name and files")
    need(type(found.setdefault("parameters", [])) is list and "events" in found, "expected lists")
    for each in found["parameters"]:  # of envelopes; nothing here depends on them
        known = type(each) is dict and "name" in each and len(each) == 2 and each.keys() <= VARIED
        need(known and all(map(is_name, each.values())), "found a parameter with attributes, or malformed")
    for kind, types in KEYS.items():
        need(type(found.setdefault(kind, [])) is list, f"expected a list of {kind}")
        for each in found[kind]:
            complete = type(each) is dict and types.keys() - {"guard", "agent"} <= each.keys() <= types.keys()
            need(complete and all(type(each[key]) in types[key] for key in each), f"found {kind} malformed")
            texts = [value for value in each.values() if type(value) is str] + each.get("domain", [])
            texts += [text for pair in each.setdefault("guard", {}).items() for text in pair]
            need(all(map(is_name, texts)), f"found {kind} with something that is no name")
            each |= {key: number(str(each[key])) for key in ("lower", "upper") if each.get(key) is not None}
        names = [each["name"] for each in found[kind] if "name" in each]
        need(len({*names}) == len(names), f"found two {kind} of one name")
    return dict(found)


class Condition(NamedTuple):
    """An atom that is to be true, or false, just before `first` and until just before `last`; or becomes so there."""

    atom: str
    value: bool
    first: str
    last: str
    guard: Guard
    activity: int | None


class Choices:
    """The formula that says what a correct execution is: `parts` are what has to hold.

    If an execution is given, by the number of each choice's value and by each event's time or None, they are constant.
    """

    def __init__(self, files: Files, epsilon: Fraction, execution: list[Any] | None = None) -> None:
        network, domain, problem = files
        self.model = Model(domain, problem)
        need(not self.model.timed, "found timed initial literals in a plan with choices")
        need(epsilon > 0, "epsilon has to be above 0 in a plan with choices")
        ground = Ground(self.model)
        ground.point("start")
        self.domains = {each["name"]: each["domain"] for each in network["choices"]}
        self.guards: dict[str, Guard] = {each["name"]: each["guard"] for each in network["events"]}
        edges = [*network["constraints"], *network["activities"]]
        named = {each["at"] for each in network["choices"]} | {each[end] for each in edges for end in ("from", "to")}
        need(named <= self.guards.keys(), "found an event that is not declared")
        for end in ("e_initial", "e_goal"):
            need(self.guards.setdefault(end, {}) == {}, f"found a guard of {end}")
        self.chosen: Guard = {}
        self.times = {event: {f"@{index}": Fraction(1)} for index, event in enumerate(self.guards, start=1)}
        if execution is not None:
            numbers, texts = listed(execution[0], len(self.domains)), listed(execution[1], len(self.guards))
            places = zip(numbers, self.domains.items())
            self.chosen = {name: values[whole(place, len(values))] for place, (name, values) in places}
            for text, (event, guard) in zip(texts, self.guards.items()):
                happens = guard.items() <= self.chosen.items()
                demand((text is not None) == happens, f"found a time, or none, of {event}")
                self.times[event] = {} if text is None else constant(rational(text))
        self.ends: dict[int | None, str] = {}  # the event of each time point of an activity
        parameters = {*self.model.synth}
        for place, activity in enumerate(network["activities"]):
            need(re.fullmatch(r"\( *[^ ()]+( +[^ ()]+)* *\)", activity["action"]), "expected an action in brackets")
            call = activity["action"].lower().replace("(", " ").replace(")", " ").split()
            parameters |= ground.instance(str(place), True, call)
            self.ends |= {2 * place + 1: activity["from"], 2 * place + 2: activity["to"]}
        need(not ground.flows and not parameters, "found continuous effects or parameters")
        given = {f"@{point}": self.times[event] for point, event in self.ends.items()}
        self.formulas = Formulas(ground, epsilon, given)
        self.circuit = self.formulas.circuit
        self.parts, self.values = list[int](), dict[tuple[str, str], int]()
        for i, (name, values) in enumerate(self.domains.items()):
            need(values and len({*values}) == len(values), f"found {name} without values, or with one twice")
            for j, value in enumerate(values):
                known = {"": Fraction(self.chosen[name] == value)} if self.chosen else {f"?{i}.{j}": Fraction(1)}
                self.values[name, value] = self.circuit.compare(known, True)
            each = [self.values[name, value] for value in values]
            self.parts.append(self.circuit.any(each))
            self.parts += [-self.circuit.all([a, b]) for i, a in enumerate(each) for b in each[:i]]
        for event, guard in self.guards.items():
            for a, b in (("e_initial", event), (event, "e_goal")):
                if a != b:
                    self.constrain(guard, a, b, epsilon, None)
        for edge in edges:
            self.constrain(edge["guard"], edge["from"], edge["to"], edge["lower"], edge["upper"])
        self.ordered(network, edges)
        self.conditions, self.effects = list[Condition](), list[Condition]()
        for place, activity in enumerate(network["activities"]):
            self.activity(place, activity)
        self.require(self.model.condition(self.model.goal, Scope({}, {})), None, ("e_goal", "e_goal", {}, None))
        atoms = sorted({each.atom for each in self.conditions})
        start, first = "e_initial", self.model.initial
        self.effects += [Condition(atom, bool(first.get(atom)), start, start, {}, None) for atom in atoms]
        self.parts += [self.met(condition) for condition in self.conditions]

    def ordered(self, network: dict[str, Any], edges: list[dict[str, Any]]) -> None:
        """What depends on a choice depends on what the choice depends on, and comes after it [PIKE, Definition 2.1]."""
        where = {each["name"]: each["at"] for each in network["choices"]}
        steps = list[tuple[str, str, Guard]]()
        for edge in edges:
            low, high, ends = edge["lower"], edge["upper"], (edge["from"], edge["to"])
            steps += [(*ends, edge["guard"])] if low is not None and low >= 0 else []
            steps += [(*ends[::-1], edge["guard"])] if high is not None and high <= 0 else []
        for each in (*network["events"], *edges):
            guard, event = each["guard"], each["from"] if "action" in each else each.get("name")
            for choice, made in ((choice, where[choice]) for choice in guard):
                inside = self.guards[made].items() <= guard.items() and choice not in self.guards[made]
                need(inside, f"found {choice} in a guard where it is not made")
                reached, more = {made}, {made}
                while more:
                    more = {b for a, b, label in steps if a in more and guard | label == label | guard} - reached
                    reached |= more
                after = event in (None, *reached) or made == "e_initial"
                need(after, f"found {choice} in a guard of {event}, which may come before the choice")

    def holds(self, guard: Guard) -> int:
        need(all((name, value) in self.values for name, value in guard.items()), f"found an unknown value in {guard}")
        return self.circuit.all([self.values[name, value] for name, value in guard.items()])

    def unless(self, guard: Guard, literal: int) -> int:
        return self.circuit.any([-self.holds(guard), literal])

    def before(self, a: str, b: str) -> int:
        return self.circuit.compare(plus(plus(self.times[b], self.times[a], -1), constant(self.formulas.epsilon), -1))

    def constrain(self, guard: Guard, a: str, b: str, low: Fraction | None, high: Fraction | None) -> None:
        need(low is None or high is None or low <= high, "found bounds without a value between them")
        gap = plus(self.times[b], self.times[a], -1)
        implied = {*self.guards[a].items(), *self.guards[b].items()}
        need(implied <= {*guard.items()}, f"found {a} and {b} related where they do not happen")
        if low is not None:
            self.parts.append(self.unless(guard, self.circuit.compare(plus(gap, constant(low), -1))))
        if high is not None:
            self.parts.append(self.unless(guard, self.circuit.compare(plus(constant(high), gap, -1))))

    # -- activities ----------------------------------------------------------------------------------------------------

    def activity(self, place: int, activity: dict[str, Any]) -> None:
        """Its durations, conditions and effects."""
        ends, guard = {point: self.ends[point] for point in (2 * place + 1, 2 * place + 2)}, activity["guard"]
        lows, highs = ([activity[end]] * (activity[end] is not None) for end in ("lower", "upper"))
        need(lows[0] > 0 and len({*ends.values()} - {"e_initial", "e_goal"}) == 2, "found an activity without time")
        for duty in self.formulas.ground.duties:
            if duty.first in ends:
                where = ends[duty.first], ends[duty.last or duty.first], guard, place
                self.require(duty.condition, duty.owner, where)
                if duty.label.endswith(": duration"):
                    relation, _, limit = duty.condition
                    need(relation in ("=", ">=", "<="), "found a strict bound of a duration")
                    value = self.formulas.expression(limit, ("final", None), None).get("", Fraction(0))
                    lows += [value] * (relation != "<=")
                    highs += [value] * (relation != ">=")
        need(not highs or max(lows) <= min(highs), "found bounds of an activity that its action does not allow")
        for point, event in ends.items():
            happens = dict[str, bool]()
            for effect in self.formulas.ground.effects[point]:
                need(effect.kind in ("add", "delete"), "found a change of a number")
                if_so = self.settled(effect.when, effect.owner)
                need(if_so in (TRUE, FALSE), "found a condition on durations of an effect")
                if if_so == TRUE:
                    happens[effect.target] = happens.get(effect.target, False) or effect.kind == "add"
            self.effects += [Condition(atom, value, event, event, guard, place) for atom, value in happens.items()]

    def settled(self, tree: Tree, owner: Any) -> int:
        """A condition that nothing in the plan changes; it is the same at all moments."""
        need(not self.formulas.writes.keys() & {*names_in(tree)}, "found a condition that is no conjunction")
        return self.formulas.truth(tree, ("final", None), owner)

    def require(self, tree: Tree, owner: Any, where: tuple[str, str, Guard, int | None]) -> None:
        """The literals of a conjunction, and what is said of durations and of what never changes."""
        for part in conjuncts(tree):
            match part:
                case ("atom", atom) | ("not", ("atom", atom)):
                    self.conditions.append(Condition(atom, part[0] == "atom", *where))
                case _:
                    self.bound(where[2], self.settled(part, owner))

    def bound(self, guard: Guard, literal: int) -> None:
        """What is said of durations, or of what never changes, holds where the guard does."""
        self.parts.append(self.unless(guard, literal))

    def met(self, condition: Condition) -> int:
        """Some producer is in time, and no threat is between it and the end of the condition.

        What an activity does at its start is in time for its own condition over all, and what it does where a condition
        of its own ends comes after that.
        """
        supports = []
        threats = [each for each in self.effects if each.atom == condition.atom and each.value != condition.value]
        own = condition.activity, condition.last
        threats = [each for each in threats if (each.activity, each.first) != own]
        for producer in self.effects:
            if producer.atom == condition.atom and producer.value == condition.value:
                begins = (producer.activity, producer.first) == (condition.activity, condition.first) != own
                in_time = TRUE if begins else self.before(producer.first, condition.first)
                apart = [[self.before(t.first, producer.first), self.before(condition.last, t.first)] for t in threats]
                away = [self.unless(t.guard, self.circuit.any(each)) for t, each in zip(threats, apart)]
                supports.append(self.circuit.all([self.holds(producer.guard), in_time, *away]))
        return self.unless(condition.guard, self.circuit.any(supports))


def check_choices(tape: Tape, files: Files, kind: str, stated: object, epsilon: Fraction) -> Claim:
    """Of a network and its PDDL: that some execution is correct, or that none is with the choices that are stated."""
    if kind == "execution":
        demand(stated is None, "the certificate of an execution has no assumptions")
        choices = Choices(files, epsilon, listed(tape.next("execution"), 2))
        demand(all(part == TRUE for part in choices.parts), "the execution is not correct")
        text = execution_text(choices)
    else:
        choices = Choices(files, epsilon)
        choices.chosen = dict(listed(stated))
        parts = [*choices.parts, choices.holds(choices.chosen)]
        refute(tape, choices.formulas, Facts([]), choices.circuit.all(parts))
        text = knowledge_text(choices.chosen)
    tape.finish()
    refuted = int(kind == "knowledge")
    return Claim(
        kind, epsilon, text + of_files(files), choices=choices.chosen, obligations=len(choices.parts), refuted=refuted
    )


def execution_text(choices: Choices) -> str:
    happens = [event for event, guard in choices.guards.items() if choices.holds(guard) == TRUE]
    times = ", ".join(f"{quoted(event)} at {choices.times[event].get('', Fraction(0))}" for event in happens)
    return f"correct execution of the plan with choices: {shown(choices.chosen)}; {times}"


def knowledge_text(chosen: Guard) -> str:
    given = f" with {shown(chosen)}" if chosen else ""
    return f"no choices and times{given} are a correct execution of the plan with choices"


def of_files(files: Files) -> str:
    return f", of domain {files[0]['domain']!a} and problem {files[0]['problem']!a}"


def quoted(text: str) -> str:
    return text if re.fullmatch(r"[A-Za-z0-9_.-]+", text) else ascii(text)


def shown(chosen: Guard) -> str:
    return ", ".join(f"{quoted(name)} = {quoted(value)}" for name, value in chosen.items())
