"""Behavior trees of PlanSys2's executor for plans: as many of the network's orders as a tree can have, and a proof.

A tree is chains of steps in parallel. Each chain is a sequence, whose steps wait for the ends of steps in other chains;
a step that has to begin after the start of another is in a chain beside that step's execution. What is proved is what
:mod:`robust.execute.trees` reads.
"""

from __future__ import annotations

import struct
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from graphlib import TopologicalSorter

from robust.encode import interface
from robust.errors import RefutedError, SolverError, UnsupportedError
from robust.execute import trees
from robust.execute.trees import BehaviorTree, StepMoment, TreeEncoding, earliest_starts, parse_tree, sides_of, unkept
from robust.irr import check
from robust.numbers import format_number
from robust.plan import model
from robust.presented import OneLine
from robust.qe.box import Box
from robust.smt.limits import NEVER, Deadline


@dataclass(frozen=True)
class MadeTree(OneLine, ask="check"):
    """A tree for a plan, as text; what reading it back proves; and what of the plan's network it cannot keep.

    Constraints in `unkept`, such as least distances and deadlines, are kept by no order; the proof does without them.
    """

    text: str
    check: check.CheckResult
    unkept: tuple[model.TemporalConstraint, ...]
    tree: BehaviorTree


def make_tree(
    plan: model.ParametrizedPlan | model.HasPlan,
    *,
    epsilon: Fraction = interface.EPSILON,
    lag: Fraction | None = None,
    starts: Mapping[str, Fraction] | None = None,
    solver: str = "z3",
    deadline: Deadline = NEVER,
) -> MadeTree:
    """A tree that puts steps in the orders of a plan's network, proved by reading it back.

    Orders that no tree has are replaced by more waiting: for the end of a step instead of its start, or before the
    start of a step instead of its end. Where the orders that the network states are not enough, all that follow from
    it are taken.

    Args:
        plan: the plan, or a conversion; what is proved is about its nominal values.
        epsilon: ε, the separation of mutex time points.
        lag: how late nodes may begin at most; None is any time.
        starts: when steps start in the executor's plan, which is part of their names; earliest starts if not given.
        solver: `z3` or `cvc5`.
        deadline: when to give up.

    Returns:
        The tree as a text, its proof, and what constraints of the network it cannot keep.

    Raises:
        InputError: if `plan` is none.
        RefutedError: if no tree was found all of whose executions are valid; the message says what breaks.
        SolverError: if that could not be decided.
        UnsupportedError: if two steps of the executor's plan would have one name.
    """
    plan = model.plan_itself(plan)
    names = executor_names(plan, starts or earliest_starts(plan))
    for following in (False, True):
        text = _TreeWriter(plan, names, following=following).text()
        tree = parse_tree(text, plan)
        allowed = tree.network(plan, epsilon, lag)
        box = Box.nominal(plan.parameters)
        encoding = TreeEncoding(tree, allowed, epsilon, lag, box)
        result = check.Checker(encoding, box, solver=solver, deadline=deadline).run()
        if result.answer is check.Answer.PROVED:
            return MadeTree(text, result, tuple(item for item, _ in unkept(plan, allowed, box)), tree)
        if result.answer is check.Answer.UNKNOWN:
            raise SolverError("found no verdict on the tree, expected a proof or a counterexample; allow more time")
    broken = next(iter(result.counterexamples), result.reason)
    late = "whenever nodes begin" if lag is None else f"when nodes begin up to {format_number(lag)} late"
    raise RefutedError(
        f"found no tree that keeps the plan valid {late}: trees know orders, no distances in time, and with "
        f"all that one can have {broken!r} breaks in some execution"
    )


def executor_names(plan: model.ParametrizedPlan, starts: Mapping[str, Fraction]) -> dict[str, str]:
    """The names that PlanSys2's executor has for steps that start then; it computes with single precision.

    Raises:
        UnsupportedError: if two steps would have one name.
    """
    names: dict[str, str] = {}
    for instance in plan.instances:
        time = int(_single(_single(float(starts[instance.identifier])) * 1000))
        name = f"{instance}:{time}"
        if name in names.values():
            raise UnsupportedError(f"found two steps {name}, expected different times: the executor takes them for one")
        names[instance.identifier] = name
    return names


def _single(value: float) -> float:
    single: float = struct.unpack("f", struct.pack("f", value))[0]
    return single


class _TreeWriter:
    """Chooses orders that a tree can have, and writes it: chains of steps, each a sequence, in parallel.

    A step that has to wait for the start of another is in a chain inside of that step, beside its execution. Moments
    are those of identifiers here.
    """

    def __init__(self, plan: model.ParametrizedPlan, names: Mapping[str, str], *, following: bool) -> None:
        self._names = names
        self._later: dict[StepMoment, set[StepMoment]] = {}
        for instance in plan.instances:
            start, end = (StepMoment(instance.identifier, is_end) for is_end in (False, True))
            self._later |= {start: {end}, end: set()}
        self._choose(_orders(plan, following=following))
        self._reduce()
        self._nest()
        self._reduce()
        self._make_chains()

    def _choose(self, orders: Iterable[tuple[model.TimePoint, model.TimePoint]]) -> None:
        """Take orders of starts as they are, and orders of ends as orders of starts where these leave a choice."""
        of_ends = []
        for before, after in orders:
            first = StepMoment(before.instance or "", before.kind is not model.TimePointKind.START)
            second = StepMoment(after.instance or "", after.kind is model.TimePointKind.END)
            if second.is_end:
                of_ends.append((first, second))
            else:
                self._later[first].add(second)
        self._reduce()
        for first, second in of_ends:
            if not self._leads(first, second):
                self._add(first, StepMoment(second.name, is_end=False))

    def _leads(self, first: StepMoment, second: StepMoment) -> bool:
        return bool(self._reached[first] >> self._rank[second] & 1)

    def _add(self, first: StepMoment, second: StepMoment) -> None:
        """One more order, unless it contradicts others."""
        if not self._leads(second, first):
            self._later[first].add(second)
            for moment, known in self._reached.items():
                if known >> self._rank[first] & 1:
                    self._reached[moment] = known | self._reached[second]

    def _reduce(self) -> None:
        """Leave out what other orders imply.

        `_rank` is where moments are in an order of all of them, `_reached` has the ranks of all that each one leads to.
        """
        earlier = defaultdict[StepMoment, list[StepMoment]](list)
        for first, later in self._later.items():
            for second in later:
                earlier[second].append(first)
        order = list(TopologicalSorter({moment: earlier[moment] for moment in self._later}).static_order())
        self._rank = {moment: number for number, moment in enumerate(order)}
        self._reached = reached = dict[StepMoment, int]()
        for first in reversed(order):
            known = 0
            for second in sorted(self._later[first], key=self._rank.__getitem__):
                if known >> self._rank[second] & 1:
                    self._later[first].discard(second)
                known |= reached[second]
            reached[first] = known | 1 << self._rank[first]

    def _waits(self, *, for_end: bool) -> dict[str, list[str]]:
        """The steps whose ends, or starts, each step has to wait for, the latest first."""
        waits: dict[str, list[str]] = {name: [] for name in self._names}
        for first in sorted(self._later, key=self._rank.__getitem__, reverse=True):
            for second in self._later[first] if first.is_end is for_end else ():
                if not second.is_end:
                    waits[second.name].append(first.name)
        return waits

    def _nest(self) -> None:
        """Leave each step one other to be inside of: it waits for the ends of the others, if it can."""
        for name, others in self._waits(for_end=False).items():
            for other in others[1:]:
                self._later[StepMoment(other, is_end=False)].discard(StepMoment(name, is_end=False))
                self._add(StepMoment(other, is_end=True), StepMoment(name, is_end=False))

    def _make_chains(self) -> None:
        self._inside: dict[str, list[str]] = {name: [] for name in self._names}
        self._next: dict[str, str] = {}
        self._heads = []
        self._for_ends = self._waits(for_end=True)
        starts = self._waits(for_end=False)
        for name in sorted(self._names, key=lambda name: self._rank[StepMoment(name, is_end=False)]):
            if starts[name]:
                self._inside[starts[name][0]].append(name)
                continue
            last = next((other for other in self._for_ends[name] if other not in self._next), None)
            if last is None:
                self._heads.append(name)
            else:
                self._next[last] = name
                self._for_ends[name].remove(last)

    def text(self) -> str:
        lines: list[str] = []
        pending = _in_parallel(2, [_TreePart(3, name) for name in self._heads])[::-1]
        while pending:
            part = pending.pop()
            if part.is_line:
                lines.append(f"{'  ' * part.level}{part.text}\n")
            else:
                pending += reversed(self._chain(part))
        head = '<root main_tree_to_execute="MainTree">\n  <BehaviorTree ID="MainTree">\n'
        return f"{head}{''.join(lines)}  </BehaviorTree>\n</root>\n"

    def _chain(self, part: _TreePart) -> list[_TreePart]:
        """The steps from one on, or from behind its start, up to the one that has others inside, in one sequence."""
        level, name, begun = part.level, part.text, part.begun
        parts = [_TreePart(level, f'<Sequence name="{self._names[name]}">', is_line=True)]
        while True:
            if not begun:
                waits = [("WaitAction", other) for other in self._for_ends[name]]
                parts += self._leaves(level + 1, [*waits, ("WaitAtStartReq", name), ("ApplyAtStartEffect", name)])
            if not begun and self._inside[name]:
                inside = [_TreePart(level + 2, other) for other in self._inside[name]]
                parts += _in_parallel(level + 1, [_TreePart(level + 2, name, begun=True), *inside])
                break
            parts.append(_TreePart(level + 1, f'<ReactiveSequence name="{self._names[name]}">', is_line=True))
            parts += self._leaves(level + 2, [("CheckOverAllReq", name), ("ExecuteAction", name)])
            parts.append(_TreePart(level + 1, "</ReactiveSequence>", is_line=True))
            parts += self._leaves(level + 1, [("CheckAtEndReq", name), ("ApplyAtEndEffect", name)])
            if name not in self._next:
                break
            name, begun = self._next[name], False
        return [*parts, _TreePart(level, "</Sequence>", is_line=True)]

    def _leaves(self, level: int, leaves: Iterable[tuple[str, str]]) -> list[_TreePart]:
        return [_TreePart(level, f'<{kind} action="{self._names[name]}"/>', is_line=True) for kind, name in leaves]


@dataclass(frozen=True, slots=True)
class _TreePart:
    """A line of a tree, or a chain still to be written, of which the first step may have begun."""

    level: int
    text: str
    is_line: bool = False
    begun: bool = False


def _in_parallel(level: int, chains: list[_TreePart]) -> list[_TreePart]:
    """Chains beside each other, each a level further in; one alone needs nothing around it."""
    if len(chains) == 1:
        return [replace(chains[0], level=level)]
    first = f'<Parallel success_threshold="{len(chains)}" failure_threshold="1">'
    return [_TreePart(level, first, is_line=True), *chains, _TreePart(level, "</Parallel>", is_line=True)]


def _orders(plan: model.ParametrizedPlan, *, following: bool) -> Iterator[tuple[model.TimePoint, model.TimePoint]]:
    """The pairs of time points of different steps that a network orders at nominal values: as it states, or all."""
    nominal = {name: (value, value) for name, value in plan.nominal.items()}
    distances = trees.distances_within(plan, nominal)
    if following:
        points = plan.time_points
        closure = distances.network.closure()
        bounds = [(points[source], points[target], Fraction(weight)) for source, target, weight in closure]
    else:
        sides = [side for item in plan.constraints for side in sides_of(item)]
        bounds = [(side[0], side[1], interface.least(side[2], nominal) or Fraction(0)) for side in sides]
    for source, target, weight in bounds:
        if source.instance is not None and target.instance is not None and source.instance != target.instance:
            back = distances.least(target, source) if weight == 0 else None
            if weight > 0 or (weight == 0 and (back is None or back < 0)):
                yield source, target
