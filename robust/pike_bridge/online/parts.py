"""Plans with choices, cut at joins into parts that can be decided apart.

A *node* is an event without guard that every other event is ordered with: all is before it or after it. Between two
nodes is a *part*. Nodes are given up until no activity, choice or bound is in two parts, except bounds without guard
between nodes; until every atom that is used in two parts has a value at the nodes between them that is the same in all
correct executions; and until each node can be put off, with some of what is in the part before it and nothing else. Of
a part that is still to come then only its least duration matters, for each value of the choices in it.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import product

from robust.network.differences import reachable
from robust.pike_bridge import model
from robust.pike_bridge.distance_graph import KnownOrders
from robust.pike_bridge.model import GOAL, INITIAL, Choice, Condition, Constraint, Effect, Event, TeamPlan, Tpnu
from robust.pike_bridge.online.progress import Structure
from robust.plan.model import Atom

SOON = "e_soon"
"""Stands for what is not the executive's in the part after those of a window."""
LATER = "later"
"""The choice that stands for what people may decide after a window."""


class Division:
    """The nodes of a plan, and what is in which part: part j is from node j to node j + 1, which it includes.

    If there are only two nodes, the plan is one part, which is of no use.
    """

    def __init__(self, plan: TeamPlan, structure: Structure) -> None:
        self.plan, self._structure = plan, structure
        self.guards = structure.guards
        self.nodes: list[str] = []
        if INITIAL not in self.guards or GOAL not in self.guards:
            return
        self.orders = KnownOrders(plan.network, plan.separation)
        self._effects: dict[Atom, list[Effect]] = defaultdict(list)
        self._used_at: dict[Atom, set[str]] = defaultdict(set)
        for effect in plan.effects:
            self._effects[effect.literal.atom].append(effect)
            self._used_at[effect.literal.atom].add(effect.event)
        for condition in plan.conditions:
            self._used_at[condition.literal.atom] |= {condition.first, condition.last}
        self._cut(self._candidates())

    def _candidates(self) -> list[str]:
        network, ordered = self.plan.network, self.orders.ordered
        taken = {each.source for each in network.activities} | {each.event for each in network.choices}
        free = [e for e, guard in self.guards.items() if not guard and e not in taken and e not in {INITIAL, GOAL}]
        found = [e for e in free if all(ordered(other, e) or ordered(e, other) for other in self.guards)]
        found.sort(key=lambda event: sum(ordered(other, event) for other in self.guards))
        return [INITIAL, *found, GOAL]

    def _cut(self, nodes: list[str]) -> None:
        """Give nodes up until what is between them is independent, and those that no activity ends before."""
        while dependent := self._dependent(nodes):
            nodes = [event for event in nodes if event not in dependent]
        bound = {event for each in self.between for event in (each.source, each.target)}
        busy = {self.part_of[each.source] for each in self.plan.network.activities}
        kept = [e for at, e in enumerate(nodes) if at in {0, len(nodes) - 1} or e in bound or at - 1 in busy]
        if self._dependent(kept):
            self._dependent(nodes)

    def _dependent(self, nodes: list[str]) -> set[str]:
        """Divide at some nodes; those of them that are in the way."""
        network = self.plan.network
        self.nodes, self.rank = nodes, {event: rank for rank, event in enumerate(nodes)}
        self.part_of = {event: self._part(event) for event in self.guards}
        self.between: list[Constraint] = []
        """Bounds between nodes, but for those on how long a part takes at least."""
        self.inner: dict[int, list[Constraint]] = defaultdict(list)
        uses: dict[str, set[int]] = defaultdict(set)
        for event, guard in self.guards.items():
            for variable, _ in guard:
                uses[variable].add(self.part_of[event])
        for choice in network.choices:
            if choice.event is not None:
                uses[choice.name].add(self.part_of[choice.event])
        spans = [{self.part_of[each.source], self.part_of[each.target]} for each in network.activities]
        for each in network.constraints:
            spans.append(self._place_constraint(each))
            for variable, _ in each.guard:
                uses[variable] |= spans[-1]
        items = [({each.first, each.last}, each.guard) for each in self.plan.conditions]
        items += [({each.event}, each.guard) for each in self.plan.effects]
        for events, guard in items:
            spans.append({self.part_of[event] for event in events - {INITIAL, GOAL}})
            for variable, _ in guard:
                uses[variable] |= spans[-1]
        self.choice_in = {choice.name: min(uses[choice.name], default=0) for choice in network.choices}
        self._atom_in = {
            atom: {self.part_of[event] for event in events - {INITIAL, GOAL}} for atom, events in self._used_at.items()
        }
        across = [range(min(parts, default=0) + 1, max(parts, default=0) + 1) for parts in (*spans, *uses.values())]
        bad = {nodes[at] for each in across for at in each}
        for atom, parts in self._atom_in.items():
            inside = range(min(parts, default=0) + 1, max(parts, default=0) + 1)
            bad |= {nodes[at] for at in inside if self._entering(atom, at) is None}
        return (bad - {INITIAL, GOAL}) or {event for event in nodes[1:-1] if not self._can_wait(event)}

    def _part(self, event: str) -> int:
        """The part of an event; a node is in the part that it ends."""
        if event in self.rank:
            return max(0, self.rank[event] - 1)
        after = (rank for node, rank in self.rank.items() if node != GOAL and self.orders.ordered(node, event))
        return max(after)  # of the last part also if, by contradicting bounds, it comes after the goal

    def _place_constraint(self, constraint: Constraint) -> set[int]:
        """Put a bound where it belongs; the parts that it is in."""
        source, target = constraint.source, constraint.target
        first, second = self.part_of[source], self.part_of[target]
        if source in self.rank and target in self.rank and not constraint.guard:
            if constraint.upper is None and self.rank[target] == self.rank[source] + 1:
                self.inner[self.rank[source]].append(constraint)
            else:
                self.between.append(constraint)
            return set()
        if self.rank.get(source) == second:
            first = second
        elif self.rank.get(target) == first:
            second = first
        self.inner[min(first, second)].append(constraint)
        return {first, second}

    def _entering(self, atom: Atom, part: int) -> tuple[Effect, ...] | None:
        """The effect that decides about an atom before a part, if it is always the same one and all is apart from it.

        None if that cannot be said; nothing if no effect is before.
        """
        effects = self._effects[atom]
        before = [each for each in effects if each.event == INITIAL or self.part_of[each.event] < part]
        if all(place >= part for place in self._atom_in[atom]):
            return tuple(before)
        apart = self.orders.apart
        after = {event for event in self._used_at[atom] if self.part_of[event] >= part} - {INITIAL}
        if not all(apart(self.nodes[part], event) for event in after):
            return None
        for last in before:
            contrary = [each.event for each in before if each.literal != last.literal]
            if not last.guard and all(apart(event, last.event) for event in contrary):
                return (last,)
        return None if before else ()

    def _can_wait(self, node: str) -> bool:
        """Whether the node can be put off by any time, with some events of its part and nothing else."""
        part = self.part_of[node]
        activities = [each for each in self.plan.network.activities if self.part_of[each.source] == part]
        pushed: dict[str, list[str]] = defaultdict(list)
        for each in (*self.inner[part], *(activity.duration for activity in activities)):
            for one, other, _ in each.upper_bounds:
                pushed[other].append(one)
        moved = reachable(pushed, node)
        return moved & self.rank.keys() == {node} and not any(
            earlier in moved and later not in moved and not self._settled(earlier, later)
            for earlier, later in self._supporting(part)
        )

    def _settled(self, earlier: str, later: str) -> bool:
        """Whether it is known that an event is before another, or that it is not."""
        return self.orders.apart(earlier, later) or self.orders.ordered(later, earlier)

    def _supporting(self, part: int) -> Iterator[tuple[str, str]]:
        """The pairs of events in a part of which the first may have to come first, so that a condition is met."""
        for condition in self.plan.conditions:
            atom, first = condition.literal.atom, condition.first
            if part not in self._atom_in[atom] or (first != GOAL and self.part_of[first] != part):
                continue
            effects = [x for x in self._effects[atom] if x.event != INITIAL and self.part_of[x.event] == part]
            producers = [each.event for each in effects if each.literal == condition.literal]
            threats = [each.event for each in effects if each.literal != condition.literal]
            yield from ((producer, first) for producer in producers)
            yield from ((condition.last, threat) for threat in threats)
            yield from product(threats, producers)

    # -- plans of parts ----------------------------------------------------------------------------------------------

    def window(
        self,
        first: int,
        last: int,
        more: Sequence[Constraint] = (),
        classes: Sequence[str] = (),
        *,
        gridded: bool = True,
    ) -> tuple[TeamPlan, dict[Effect, Effect], dict[Condition, Condition]]:
        """The parts from one up to another as a plan of their own, and what their effects and conditions are in it.

        All nodes before are the initial event.

        Args:
            more: further bounds.
            classes: the values of the choice after the parts, if there are several.
            gridded: whether a bound tells that times are on the grid of the whole plan, which no other has to be on.
        """
        network, inside = self.plan.network, range(first, last)
        nodes = {INITIAL, *self.nodes[first : last + 1]}
        names = [e for e in self.guards if e in nodes or (self.part_of[e] in inside and e not in self.rank)]
        activities = [at for at, each in enumerate(network.activities) if self.part_of[each.source] in inside]
        place: dict[int | None, int | None] = {None: None, **{at: number for number, at in enumerate(activities)}}
        events = [Event(event, self.guards[event]) for event in names]
        constraints = [*(each for part in inside for each in self.inner[part]), *more]
        choices = [each for each in network.choices if self.choice_in[each.name] in inside]
        known = [network.activities[at] for at in activities]
        if GOAL not in names:
            end = self.nodes[last]
            if any(each.target == SOON for each in more):
                events.append(Event(SOON))
                known.append(model.Activity("(soon)", end, SOON, Fraction(0), None))
            if len(classes) > 1:
                events.append(Event(f"e_{LATER}"))
                choices.append(Choice(LATER, tuple(classes), False, f"e_{LATER}"))
                constraints.append(Constraint(end, f"e_{LATER}", self.plan.separation, None))
                end = f"e_{LATER}"
            events.append(Event(GOAL))
            constraints.append(Constraint(end, GOAL, self.plan.separation, None))
        constraints += [Constraint(INITIAL, GOAL, self._structure.grid, None)] if gridded else []
        own = (each for each in self.plan.effects if each.event != INITIAL and self.part_of[each.event] in inside)
        effects = {each: replace(each, activity=place[each.activity]) for each in own}
        for atom, parts in self._atom_in.items():
            if not parts.isdisjoint(inside) or (not parts and not first):
                entering = self._entering(atom, first) or ()
                effects |= {each: Effect(each.literal, INITIAL, model.ALWAYS, None) for each in entering}
        conditions = {
            each: replace(each, activity=place[each.activity])
            for each in self.plan.conditions
            if self._in(each, inside)
        }
        part = Tpnu(network.name, tuple(choices), tuple(events), tuple(constraints), tuple(known))
        plan = TeamPlan(part, tuple(conditions.values()), tuple(effects.values()), self.plan.epsilon)
        return plan, effects, conditions

    def _in(self, condition: Condition, inside: range) -> bool:
        """Whether a condition is one of some parts; the goal's are where their atom is used last."""
        if condition.first != GOAL:
            return self.part_of[condition.first] in inside
        return max(self._atom_in[condition.literal.atom], default=0) in inside
