"""Small plans with choices, and whether they are controllable by trying everything in whole units of time.

At each moment nature moves first: which running contingent activities end; they must at their upper bound. Then the
executive executes events, one after the other, sees people's choices at once, and lets a unit of time pass. It shares
no code with strategies: only the referee of finished executions, and which effects may support what.
"""

from dataclasses import replace
from fractions import Fraction
from itertools import product

from robust.pike_bridge import builder
from robust.pike_bridge.action_model import with_ends
from robust.pike_bridge.model import (
    ALWAYS,
    INITIAL,
    Activity,
    Choice,
    Condition,
    Constraint,
    Effect,
    Event,
    Literal,
    TeamPlan,
    Tpnu,
    contradicts,
    guard,
    may_produce,
    starts_with,
)
from robust.pike_bridge.semantics import Execution, faults
from robust.plan.model import Atom

PLACEHOLDER = 99
"""The limit of a plan that is to get another one."""


class TooLargeError(Exception):
    """More positions than there is time for."""


class Minimax:
    """A game, given by a plan with integer bounds and ε, agents whose activities end when they are told to, and the
    joint values that people keep to (None: any).
    """

    def __init__(self, plan, free=(), kept=None, budget=30_000):
        self.plan, self.kept, self.budget, self.memo = plan, kept, budget, {}
        network = plan.network
        self.guards = network.guards
        self.running = [a for a in network.activities if a.lower != a.upper and a.agent not in free]
        self.ends = {a.target for a in self.running}
        rest = [a.duration for a in network.activities if a not in self.running]
        self.constraints = [*network.constraints, *rest]
        self.horizon = 1 + max(c.upper for c in network.constraints if c.upper is not None and c.source == INITIAL)
        self.ours = [c for c in network.choices if c.controllable]
        self.theirs = [c for c in network.choices if not c.controllable]

    def controllable(self):
        return self._act({INITIAL: 0}, {}, 0)

    def _holds(self, label, values):
        """True, False, or None: not known yet."""
        if any(values.get(variable, value) != value for variable, value in label):
            return False
        return True if all(variable in values for variable, _ in label) else None

    def _broken(self, times, values, now):
        """Whether something is wrong already, whatever comes."""
        for c in self.constraints:
            if self._holds(c.guard, values):
                if c.source in times and c.target in times:
                    apart = times[c.target] - times[c.source]
                    if (c.lower is not None and apart < c.lower) or (c.upper is not None and apart > c.upper):
                        return True
                elif now > min(
                    times[c.source] + c.upper if c.source in times and c.upper is not None else now,
                    times[c.target] - c.lower if c.target in times and c.lower is not None else now,
                ):
                    return True
        for condition in self.plan.conditions:
            if condition.first in times and self._holds(condition.guard, values):
                at = times[condition.first]
                if not any(
                    may_produce(effect, condition)
                    and effect.event in times
                    and self._holds(effect.guard, values)
                    and (starts_with(effect, condition) or times[effect.event] + self.plan.epsilon <= at)
                    for effect in self.plan.effects
                ):
                    return True
        return False

    def _nature(self, times, values, now):
        """Whether the executive wins whatever ends now."""
        if now > self.horizon:
            return False
        may = [
            (a.target, a.upper is not None and now - times[a.source] >= a.upper)
            for a in self.running
            if a.source in times and a.target not in times and now - times[a.source] >= a.lower
        ]
        return all(
            self._occur([end for (end, _), ended in zip(may, ends, strict=True) if ended], times, values, now)
            for ends in product(*((True,) if must else (True, False) for _, must in may))
        )

    def _act(self, times, values, now):
        if self._broken(times, values, now):
            return False
        key = (frozenset((e, now - t) for e, t in times.items()), frozenset(values.items()))
        if key not in self.memo:
            if len(self.memo) > self.budget:
                raise TooLargeError
            self.memo[key] = self._moves(times, values, now)
        return self.memo[key]

    def _moves(self, times, values, now):
        coming = [e for e, label in self.guards.items() if e not in times and self._holds(label, values) is not False]
        if not coming:
            return self._judged(times, values)
        for event in coming:
            ours = event not in self.ends and self._holds(self.guards[event], values)
            if ours and self._occur([event], times, values, now):
                return True
        return self._nature(times, values, now + 1)

    def _occur(self, events, times, values, now):
        """Whether the executive wins once events happen: for some values of its choices there, and all of others."""
        mine = [choice for choice in self.ours if choice.event in events]
        names = [choice.name for choice in mine]
        return any(
            self._answered(events, times, values | dict(zip(names, given, strict=True)), now)
            for given in product(*(choice.domain for choice in mine))
        )

    def _answered(self, events, times, values, now):
        asked = [choice for choice in self.theirs if choice.event in events]
        at_once = [each.target for each in self.running if each.source in events and each.lower == 0]
        for given in product(*(choice.domain for choice in asked)):
            known = values | dict(zip([choice.name for choice in asked], given, strict=True))
            if self.kept is not None and not any(_agree(known, each) for each in self.kept):
                continue
            for subset in product((False, True), repeat=len(at_once)):
                ended = [end for end, is_so in zip(at_once, subset, strict=True) if is_so]
                happened = times | dict.fromkeys(events, now)
                if not (self._occur(ended, happened, known, now) if ended else self._act(happened, known, now)):
                    return False
        return True

    def _judged(self, times, values):
        scenario = {c.name: values.get(c.name, c.domain[0]) for c in self.plan.network.choices}
        active = {e for e, label in self.guards.items() if all(scenario[v] == x for v, x in label)}
        return not faults(self.plan, Execution(scenario, {e: Fraction(times[e]) for e in active}))


def _agree(known, kept):
    return all(known.get(name, value) == value for name, value in kept.items())


# -- plans -------------------------------------------------------------------------------------------------------------


def small_plan(random):
    """A few activities of whole lengths, in sequences, parallels and choices, with conditions, windows and a limit."""
    names = iter("uvw")

    def element(depth):
        kind = random.choices(("act", "choose", "parallel"), (0.4, 0.4, 0.3) if depth < 2 else (1, 0, 0))[0]
        if kind == "choose" and (name := next(names, None)) is not None:
            branches = {value: inner(depth + 1) for value in "ab"}
            return builder.choose(name, branches, controllable=random.random() < 0.5)
        if kind == "parallel":
            return builder.parallel(inner(depth + 1), inner(depth + 1))
        lower = random.choice((1, 1, 2))
        return builder.act("(do)", lower, lower + random.choice((0, 1, 2)), agent=random.choice(("ann", "robot")))

    def inner(depth):
        return builder.sequence(*(element(depth) for _ in range(random.choice((1, 1, 2)))))

    whole = builder.within(builder.sequence(*(element(0) for _ in range(random.choice((2, 2, 3))))), upper=PLACEHOLDER)
    network = with_ends(builder.build("small", whole, epsilon=0), Fraction(0))
    windows = []
    for _ in range(random.choice((0, 1, 1, 2, 3))):
        one, other = random.choice(network.events), random.choice(network.events)
        if random.random() < 0.6 and network.activities:
            end = random.choice(network.activities).target
            other = next(event for event in network.events if event.name == end)
        if one != other and not contradicts(one.guard, other.guard):
            lower = random.choice((None, 0, 1, 2))
            upper = (lower or 0) + random.randint(0, 3)
            least = None if lower is None else Fraction(lower)
            windows.append(Constraint(one.name, other.name, least, Fraction(upper), one.guard | other.guard))
    network = replace(network, constraints=(*network.constraints, *windows))
    if len(network.choices) > 1 and random.random() < 0.6:  # values that do not go together
        pairs = [random.sample(network.choices, 2) for _ in range(random.choice((1, 1, 2)))]
        wrong = [guard({each.name: random.choice("ab") for each in pair}) for pair in pairs]
        labels = network.guards  # of choices that are made together at all
        wrong = [
            each.union(*(labels[choice.event] for choice in pair))
            for each, pair in zip(wrong, pairs, strict=True)
            if not any(contradicts(each, labels[choice.event]) for choice in pair)
            and not contradicts(labels[pair[0].event], labels[pair[1].event])
        ]
        never = [Constraint(INITIAL, "e1", Fraction(9), None, each) for each in wrong]
        never += [Constraint(INITIAL, "e1", None, Fraction(8), each) for each in wrong]
        network = replace(network, constraints=(*network.constraints, *never))
    effects, conditions = [], []
    for at, each in enumerate(network.activities):
        literal = Literal(Atom(random.choice("pq")))
        if random.random() < 0.4:
            first, last = random.choice(((each.source,) * 2, (each.source, each.target), (each.target,) * 2))
            conditions.append(Condition(literal, first, last, each.guard, at))
        if random.random() < 0.4:
            made = literal if random.random() < 0.7 else literal.negation
            effects.append(Effect(made, random.choice((each.source, each.target)), each.guard, at))
    effects += [Effect(Literal(Atom(name)), INITIAL, frozenset(), None) for name in "pq" if random.random() < 0.8]
    return TeamPlan(network, tuple(conditions), tuple(effects), Fraction(1))


def tight_plan(random):
    """People's and the executive's choices that have to match, lengths that decide which value is right, windows."""
    choices = [Choice("h", ("a", "b"), False, "ask"), Choice("r", ("a", "b"), True, "act")]
    if random.random() < 0.3:
        choices.append(Choice("s", ("a", "b"), random.random() < 0.7, "late"))
    activities = [
        Activity(f"(work {at})", f"b{at}", f"e{at}", Fraction(low), Fraction(low + random.choice((0, 1, 2))), "ann")
        for at in range(random.choice((1, 1, 2)))
        for low in (random.choice((1, 2)),)
    ]
    names = [
        *(choice.event for choice in choices),
        *(name for each in activities for name in (each.source, each.target)),
    ]
    constraints = []
    for _ in range(random.choice((1, 2, 3))):
        one, other = random.sample(names, 2)
        low = random.choice((0, 0, 1))
        constraints.append(
            Constraint(one, other, Fraction(low), random.choice((None, Fraction(low + random.randint(0, 2)))), ALWAYS)
        )
    for _ in range(random.choice((1, 1, 2))):
        one, other = random.sample(choices, 2)
        for values in random.choice(("ab", "aa")), random.choice(("ba", "bb")):
            label = guard(dict(zip((one.name, other.name), values, strict=True)))
            constraints += [
                Constraint(INITIAL, "ask", Fraction(9), None, label),
                Constraint(INITIAL, "ask", None, Fraction(8), label),
            ]
    if random.random() < 0.6:
        each, ours = random.choice(activities), random.choice([choice for choice in choices if choice.controllable])
        most = each.lower + random.choice((0, 1))
        least = most + random.choice((-1, 0, 0, 2))  # whole lengths must decide: no gap is less than two
        constraints.append(Constraint(each.source, each.target, None, most, guard({ours.name: "a"})))
        constraints.append(Constraint(each.source, each.target, least, None, guard({ours.name: "b"})))
    network = Tpnu("tight", tuple(choices), tuple(map(Event, names)), tuple(constraints), tuple(activities))
    return TeamPlan(with_ends(network, Fraction(0)), (), (), Fraction(1))


def limited(plan, limit):
    """The plan with another limit on the whole, from its beginning."""
    constraints = [c for c in plan.network.constraints if c.upper != PLACEHOLDER]
    constraints.append(Constraint(INITIAL, "e_goal", None, Fraction(limit)))
    return replace(plan, network=replace(plan.network, constraints=tuple(constraints)))


def longest(plan):
    """More than enough time."""
    return int(sum((a.upper or a.lower) for a in plan.network.activities)) + 2
