"""Behavior trees of PlanSys2's executor: does every execution of a tree keep to the plan? And trees for proved plans.

What a tree allows is a network again. Its *executions* are all schedules of the plan's steps in which

- a step starts when its `ExecuteAction` is begun and ends when that succeeds; `ApplyAtStartEffect` and
  `ApplyAtEndEffect` belong to these two moments, and nothing may wait in between;
- what a node waits for is earlier, by at least the gap (ε of the plan): the child before it in a `Sequence`, the
  actions of `WaitAction` and `CheckAction` before it, all children of a `Parallel` that a `Sequence` goes on from;
- a step begins any time after that, or with a `lag` at most so much later;
- steps last as long as the plan's network says, or else the domain.

Everything else is assumed to take no time and to hold nothing up: `WaitAtStartReq` and `CheckOverAllReq` watch what the
executor believes, which cannot mend a wrong order, and a tree in which a check fails has failed, and is no execution of
the plan. So a proof says that they never have to wait or to fail. A `Parallel` whose children are not ordered lets them
coincide. Names of actions are `(move r a b):5000`, where 5000 is the start in the executor's plan in thousandths; steps
with one name are told from each other by the order of these times.

The obligations of :mod:`robust.encode` are then decided over the tree's own network, as those of any plan are.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from graphlib import CycleError, TopologicalSorter
from os import PathLike, fspath
from typing import NoReturn, cast
from xml.parsers import expat

from robust.encode import interface
from robust.encode.encoding import RelationalEncoding
from robust.encode.network import TemporalNetwork, Writes, duration_rules
from robust.errors import InputError, Location, RefutedError, SolverError, UnsupportedError, did_you_mean
from robust.irr import check
from robust.irr.questions import CheckQuestion, Manner
from robust.network.differences import Distances
from robust.numbers import plural, shorten
from robust.plan import model
from robust.plan.pddl.forms import read_text
from robust.plan.polynomial import Polynomial
from robust.plan.simulate import Violation, simulate
from robust.qe.box import Box
from robust.smt.limits import NEVER, Deadline
from robust.smt.session import Formula, Session, Statistics

LARGEST_TREE = 2**24
"""Bytes of a tree."""
MOST_ORDERS = 10**6
_SEQUENCES = ("Sequence", "SequenceStar", "SequenceWithMemory", "ReactiveSequence")
_CONTROLS = (*_SEQUENCES, "Parallel")
_WAITS = ("WaitAction", "CheckAction")
_STEPS = ("ApplyAtStartEffect", "ExecuteAction", "ApplyAtEndEffect")
_LEAVES = (*_WAITS, *_STEPS, "WaitAtStartReq", "CheckOverAllReq", "CheckAtEndReq", "CheckTimeout")
_GENERIC = ("Action", "Condition", "Control")
_NAME = re.compile(r"\(\s*([^\s():{}]+(?:\s+[^\s():{}]+)*)\s*\)\s*(?::\s*(\d+))?")


@dataclass(frozen=True, slots=True)
class StepMoment:
    """The start or the end of what a name of an action in a tree stands for."""

    name: str
    is_end: bool


@dataclass(frozen=True, slots=True)
class TreeOrder:
    """A tree lets `after` happen only when `before` has happened, because of the node in `line`."""

    before: model.TimePoint
    after: model.TimePoint
    line: int


@dataclass(frozen=True)
class BehaviorTree:
    """What a tree does with the steps of a plan.

    `steps` are the names that the tree has for them, by identifier. `faults` say, with file and line, why the tree is
    none of this plan: steps that are missing or executed twice, and what waits for ever or does not wait at all.
    """

    file: str
    steps: Mapping[str, str]
    orders: tuple[TreeOrder, ...]
    faults: tuple[str, ...]

    def network(
        self, plan: model.ParametrizedPlan, gap: Fraction, lag: Fraction | None = None
    ) -> model.ParametrizedPlan:
        """The plan with the network of the tree in place of its own: orders at least `gap` apart, and durations.

        Gap and lag are in the plan's unit of time.

        With a `lag` it has steps that wait for one thing only start in time; :class:`TreeEncoding` does so for others.

        Raises:
            RefutedError: for a tree with faults.
            UnsupportedError: if the gap is 0: no network says "later, however little".
            InputError: for a lag below the gap.
        """
        if self.faults:
            raise RefutedError("; ".join(self.faults))
        if not gap:
            raise UnsupportedError("found ε = 0, expected a number above 0, by which a tree keeps happenings apart")
        if lag is not None and lag < gap:
            raise InputError(f"found a lag of {lag}, expected at least ε = {gap}, by which happenings are apart")
        apart: model.Bound = Polynomial.constant(gap)
        latest: model.Bound | None = None if lag is None else Polynomial.constant(lag)
        bounds = []
        for point, orders in self.waits(plan).items():
            alone = latest if len(orders) < 2 and point.kind is not model.TimePointKind.END else None
            if not orders and alone is not None:
                bounds.append(model.TemporalConstraint(model.ZERO, point, Polynomial.constant(0), alone))
            bounds += (
                model.TemporalConstraint(order.before, point, apart, alone, Location(self.file, order.line))
                for order in orders
            )
        return replace(plan, constraints=(*_durations(plan), *bounds))

    def waits(self, plan: model.ParametrizedPlan) -> dict[model.TimePoint, list[TreeOrder]]:
        """What each time point of the steps waits for."""
        waits: dict[model.TimePoint, list[TreeOrder]] = {
            point: [] for instance in plan.instances for point in instance.time_points
        }
        for order in self.orders:
            waits[order.after].append(order)
        return waits


class TreeEncoding(RelationalEncoding):
    """The obligations of a tree's network, with starts that come within a lag after the last thing waited for."""

    def __init__(
        self, tree: BehaviorTree, allowed: model.ParametrizedPlan, epsilon: Fraction, lag: Fraction | None, box: Box
    ) -> None:
        super().__init__(allowed, epsilon, box.ranges)
        self._prompt = [
            self.terms.disjunction(
                [self.terms.at_least(self.network.distance(point, order.before) + lag) for order in orders]
            )
            for point, orders in tree.waits(allowed).items()
            if lag is not None and len(orders) > 1 and point.kind is not model.TimePointKind.END
        ]

    def network_formulas(self) -> list[Formula]:
        return [*super().network_formulas(), *self._prompt]

    def query(self, obligation: interface.Obligation) -> list[Formula]:
        return self.full_query(obligation) if self._prompt else super().query(obligation)


def _durations(plan: model.ParametrizedPlan) -> Iterator[model.TemporalConstraint]:
    """How long steps last: as the plan's network says, else as the domain does."""
    pairs = {frozenset(instance.time_points): instance.identifier for instance in plan.instances if instance.durative}
    said = set()
    for item in plan.constraints:
        identifier = pairs.get(frozenset((item.source, item.target)))
        if identifier is not None:
            said.add(identifier)
            yield item
    for rule in duration_rules(plan, Writes(plan)):
        if rule.instance.identifier not in said:
            for bound in rule.bounds:  # over parameters only
                yield model.TemporalConstraint(bound.source, bound.target, cast("model.Bound", bound.weight), None)


# -- reading -----------------------------------------------------------------------------------------------------------


def read_tree(path: str | PathLike[str], plan: model.ParametrizedPlan | model.HasPlan) -> BehaviorTree:
    """The tree in a file, as one of a plan.

    Args:
        path: an XML file of PlanSys2's executor.
        plan: the plan whose steps it executes, or a conversion.

    Returns:
        What waits for what, by the steps of the plan; `faults` say why it is no tree of this plan, where it is none.

    Raises:
        InputError: with file and line, if it cannot be read or is no tree.
        UnsupportedError: with file and line, for a node with another meaning than those of PlanSys2's own trees.
    """
    return parse_tree(read_text(path, LARGEST_TREE), model.plan_itself(plan), fspath(path))


def parse_tree(text: str, plan: model.ParametrizedPlan, file: str = "<tree>") -> BehaviorTree:
    """The tree in a text, see :func:`read_tree`."""
    reader = _TreeReader(file)
    reader.read(text)
    names, faults = _matched(reader, plan)
    faults += [*reader.faults, *reader.never_executed()]
    if not faults:
        faults += reader.circle()
    orders: list[TreeOrder] = []
    if not faults:
        points = {name: plan.instance[identifier] for name, identifier in names.items()}
        for (before, after), line in reader.orders.items():
            first, second = points[before.name], points[after.name]
            source, target = (first.end if before.is_end else first.start, second.end if after.is_end else second.start)
            orders.append(TreeOrder(source, target, line))
    steps = {identifier: name for name, identifier in names.items()}
    return BehaviorTree(file, steps, tuple(orders), tuple(faults))


def _matched(reader: _TreeReader, plan: model.ParametrizedPlan) -> tuple[dict[str, str], list[str]]:
    """The identifiers of steps by the tree's names for them; and what is missing, or too many."""
    named, steps = defaultdict[str, list[str]](list), _by_action(plan)
    for name in sorted(reader.executed, key=_time_of):
        named[name.partition(":")[0]].append(name)
    names: dict[str, str] = {}
    faults: list[str] = []
    for action in dict.fromkeys((*steps, *named)):
        given, expected = named[action], steps.get(action, [])
        if not expected:
            place = Location(reader.file, reader.executed[given[0]])
            faults.append(f"{place}: {action} is executed, but is no step of the plan{did_you_mean(action, steps)}")
        elif len(given) != len(expected):
            found = f"is executed {plural(len(given), 'time')}" if given else "is not executed"
            steps_of_plan = f"{plural(len(expected), 'step')} of the plan"
            faults.append(f"{reader.file}: {action} {found}, but is {steps_of_plan} ({', '.join(expected)})")
        names |= dict(zip(given, expected, strict=False))
    return names, faults


def _by_action(plan: model.ParametrizedPlan) -> dict[str, list[str]]:
    """The steps with each ground action in the order of their earliest starts."""
    starts = earliest_starts(plan)
    steps = defaultdict[str, list[str]](list)
    for instance in sorted(plan.instances, key=lambda instance: starts[instance.identifier]):
        steps[str(instance)].append(instance.identifier)
    return steps


def earliest_starts(plan: model.ParametrizedPlan) -> dict[str, Fraction]:
    """When steps start at the earliest with nominal values, by identifier; InputError if there is no schedule."""
    distances = distances_within(plan, {name: (value, value) for name, value in plan.nominal.items()})
    if distances.network.schedule is None:
        raise InputError("found a network without schedule at nominal values, expected one that a tree can keep")
    times = distances.times
    return {instance.identifier: times[instance.start] - times[model.ZERO] for instance in plan.instances}


def distances_within(
    plan: model.ParametrizedPlan, ranges: Mapping[str, tuple[Fraction | None, Fraction | None]]
) -> Distances[model.TimePoint]:
    network = TemporalNetwork(model.within(plan, ranges))
    return Distances(plan.time_points, network.bounds(network.differences))


def _time_of(name: str) -> int:
    return int(name.partition(":")[2] or 0)


@dataclass(slots=True)
class _OpenNode:
    """A node that is open: what has happened when its next child begins, and when the children are done so far."""

    kind: str
    line: int
    before: frozenset[StepMoment]
    after: frozenset[StepMoment]
    threshold: int = -1
    children: int = 0
    acts: bool = False
    """Whether something below does more than look."""


class _TreeReader:
    """Walks through the main tree, and collects what has to have happened before what.

    `orders` have the line of the later one; `executed` has the lines of names.
    """

    def __init__(self, file: str) -> None:
        self.file = file
        self.orders: dict[tuple[StepMoment, StepMoment], int] = {}
        self.executed: dict[str, int] = {}
        self.faults: list[str] = []
        self._waits: dict[str, int] = {}
        self._applied: dict[str, dict[str, int]] = {kind: {} for kind in _STEPS}
        self._holding = ("", "")
        self._open: list[_OpenNode] = []
        self._depth = 0
        self._root_line = 1
        self._main: str | None = None
        self._trees: list[str] = []
        self._parser = expat.ParserCreate()
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.StartDoctypeDeclHandler = self._doctype

    def read(self, text: str) -> None:
        try:
            self._parser.Parse(text, True)
        except expat.ExpatError as error:
            place = Location(self.file, error.lineno, error.offset + 1)
            reason = expat.ErrorString(error.code)
            raise InputError(f"found broken XML ({reason}), expected a behavior tree", place) from None
        if self._main not in self._trees:
            found = "no BehaviorTree in <root>" if self._main is None else f"main tree {shorten(self._main)}"
            expected = f"one of {', '.join(map(shorten, self._trees))}" if self._trees else "<BehaviorTree ID=...>"
            raise InputError(f"found {found}, expected {expected}", Location(self.file, self._root_line))

    @property
    def _place(self) -> Location:
        return Location(self.file, self._parser.CurrentLineNumber)

    def _doctype(self, *_: object) -> NoReturn:
        raise InputError("found a document type, expected a behavior tree without one", self._place)

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        self._depth += 1
        if self._depth == 1:
            if tag != "root":
                raise InputError(f"found element {shorten(tag)}, expected <root> with a BehaviorTree", self._place)
            self._root_line = self._parser.CurrentLineNumber
            self._main = attributes.get("main_tree_to_execute")
        elif self._depth == 2 and tag == "BehaviorTree":
            name = attributes.get("ID", "")
            if name in self._trees or (self._main is None and self._trees):
                found = f"found a second tree {shorten(name)} " if name in self._trees else "found several trees "
                raise InputError(f"{found}, expected different IDs and main_tree_to_execute in <root>", self._place)
            self._main = name if self._main is None else self._main
            self._trees.append(name)
            if name == self._main:
                self._open.append(_OpenNode("BehaviorTree", self._place.line or 0, frozenset(), frozenset()))
        elif self._open:
            self._begin(attributes.get("ID", "") if tag in _GENERIC else tag, attributes)

    def _begin(self, kind: str, attributes: Mapping[str, str]) -> None:
        parent, line = self._open[-1], self._parser.CurrentLineNumber
        if kind not in _CONTROLS and kind not in _LEAVES:
            expected = f"one of {', '.join((*_CONTROLS, *_LEAVES))}"
            raise UnsupportedError(f"found node {shorten(kind)}, expected {expected}", self._place)
        if parent.kind in _LEAVES or (parent.kind == "BehaviorTree" and parent.children):
            most = "one child" if parent.kind == "BehaviorTree" else "no children"
            raise InputError(f"found {kind} in {parent.kind} of line {parent.line}, expected {most}", self._place)
        if parent.kind == "ReactiveSequence" and parent.acts:
            found = f"found {kind} behind what acts in the ReactiveSequence of line {parent.line}"
            raise UnsupportedError(f"{found}, expected it last: what comes first is run with every tick", self._place)
        before = parent.before if parent.kind == "Parallel" else parent.after
        parent.children += 1
        node = _OpenNode(kind, line, before, frozenset() if kind == "Parallel" else before)
        if kind == "Parallel":
            node.threshold = self._number(attributes, "success_threshold", "success_count", "threshold")
        elif kind in _LEAVES:
            self._leaf(node, self._action(kind, attributes))
        self._open.append(node)

    def _end(self, _tag: str) -> None:
        self._depth -= 1
        if not self._open or self._depth < 1:
            return
        node = self._open.pop()
        if node.kind not in _LEAVES and not node.children:
            raise InputError(f"found {node.kind} without children, expected some", Location(self.file, node.line))
        if node.kind == "Parallel":
            self._check_threshold(node)
        if self._open:
            parent = self._open[-1]
            parent.acts |= node.acts
            parent.after = parent.after | node.after if parent.kind == "Parallel" else node.after

    def _check_threshold(self, node: _OpenNode) -> None:
        """A fault unless all children have to succeed: others are halted."""
        needed = node.threshold if node.threshold >= 0 else node.children + 1 + node.threshold
        if needed != node.children:
            place, found = Location(self.file, node.line), f"succeeds when {needed} of {node.children} children have"
            why = "the others are halted" if needed < node.children else "that is never"
            self.faults.append(f"{place}: Parallel {found}: {why}")

    def _number(self, attributes: Mapping[str, str], *names: str) -> int:
        """The first of these attributes, -1 if there is none."""
        for name in names:
            if name in attributes:
                if not re.fullmatch(r"-?\d{1,9}", attributes[name].strip()):
                    found = f"found {name} {shorten(attributes[name])}"
                    raise InputError(f"{found}, expected a whole number", self._place)
                return int(attributes[name])
        return -1

    def _action(self, kind: str, attributes: Mapping[str, str]) -> str:
        given = attributes.get("action")
        match = None if given is None else _NAME.fullmatch(given.strip())
        if match is None:
            found = "no action" if given is None else f"action {shorten(given)}"
            raise InputError(f"found {found} of {kind}, expected one such as '(move r a b):5000'", self._place)
        return f"({' '.join(match[1].lower().split())}):{int(match[2] or 0)}"

    def _leaf(self, node: _OpenNode, name: str) -> None:
        start, end = StepMoment(name, is_end=False), StepMoment(name, is_end=True)
        if node.kind in _WAITS:
            self._waits.setdefault(name, node.line)
            node.after = node.before | {end}
        elif node.kind in _STEPS:
            node.acts = True
            first = self._applied[node.kind].get(name)
            self._applied[node.kind].setdefault(name, node.line)
            if first is not None:
                self.faults.append(f"{self._place}: {node.kind} of {name} a second time (first in line {first})")
                node.after = frozenset({start if node.kind == "ApplyAtStartEffect" else end})
            elif node.kind == "ApplyAtStartEffect" and name in self.executed:
                self.faults.append(f"{self._place}: {node.kind} of {name} after its execution")
            elif node.kind == "ApplyAtStartEffect":
                self._happens(start, node)
            elif node.kind == "ExecuteAction":
                self.executed[name] = node.line
                if name not in self._applied["ApplyAtStartEffect"]:
                    self._happens(start, node)
                elif node.before != {start}:
                    self._refuse(node, name, "ApplyAtStartEffect")
                node.after = frozenset({end})
            else:
                if self._holding != ("ExecuteAction", name) or end not in node.before:
                    self._refuse(node, name, "ExecuteAction")
                self._happens(end, replace(node, before=node.before - {end}))
                node.after = frozenset({end})
        if node.kind not in ("CheckAction", "CheckOverAllReq", "CheckAtEndReq", "CheckTimeout"):
            self._holding = node.kind, name

    def _happens(self, moment: StepMoment, node: _OpenNode) -> None:
        for before in node.before:
            self.orders.setdefault((before, moment), node.line)
        if len(self.orders) > MOST_ORDERS:
            raise UnsupportedError(f"found more than {MOST_ORDERS} orders, expected a smaller tree", self._place)
        node.after = frozenset({moment})

    def _refuse(self, node: _OpenNode, name: str, earlier: str) -> NoReturn:
        expected = (
            f"it right behind {earlier} of that action, in one Sequence: with what waits in between, or elsewhere, "
        )
        found = f"found {node.kind} of {name} apart from {earlier}"
        raise UnsupportedError(f"{found}, expected {expected}they are different moments", self._place)

    def never_executed(self) -> Iterator[str]:
        """Faults: what waits for ever."""
        for name, line in self._waits.items():
            if name not in self.executed:
                known = did_you_mean(name, self.executed)
                yield f"{Location(self.file, line)}: waits for {name}, which is never executed{known}"
        begun, done = self._applied["ApplyAtStartEffect"], self._applied["ApplyAtEndEffect"]
        if begun or done:  # a tree without any leaves effects to others
            for name, line in self.executed.items():
                for kind, applied in (("ApplyAtStartEffect", begun), ("ApplyAtEndEffect", done)):
                    if name not in applied:
                        place = Location(self.file, line)
                        yield f"{place}: executes {name} without {kind}: its effects are never applied"
        for name, line in (begun | done).items():
            if name not in self.executed:
                yield f"{Location(self.file, line)}: applies effects of {name}, which is never executed"

    def circle(self) -> list[str]:
        """A fault if moments wait for each other."""
        earlier = defaultdict[StepMoment, list[StepMoment]](list)
        for name in self.executed:
            earlier[StepMoment(name, is_end=True)].append(StepMoment(name, is_end=False))
        for before, after in self.orders:
            earlier[after].append(before)
        try:
            TopologicalSorter(earlier).prepare()
        except CycleError as error:
            names = list(dict.fromkeys(moment.name for moment in error.args[1]))
            line = next(
                (line for (before, after), line in self.orders.items() if {before.name, after.name} <= set(names)), None
            )
            return [f"{Location(self.file, line)}: for ever wait for each other: {', '.join(reversed(names))}"]
        return []


# -- the plan's network ------------------------------------------------------------------------------------------------


def sides_of(item: model.TemporalConstraint) -> Iterator[tuple[model.TimePoint, model.TimePoint, interface.Linear]]:
    """(a, b, w) for t_b − t_a ≥ w: what a constraint demands."""
    if item.lower is not None:
        yield item.source, item.target, interface.over_parameters(item.lower)
    if item.upper is not None:
        yield item.target, item.source, -interface.over_parameters(item.upper)


def unkept(
    plan: model.ParametrizedPlan, allowed: model.ParametrizedPlan, box: Box
) -> list[tuple[model.TemporalConstraint, list[tuple[model.TimePoint, model.TimePoint, interface.Linear]]]]:
    """The constraints of a plan that shortest paths do not find kept in another network of its steps, all over a box.

    With each are its sides that are not. Where the box is a point, some schedule of the other network is outside.
    """
    distances = distances_within(allowed, box.ranges)

    def kept(source: model.TimePoint, target: model.TimePoint, weight: interface.Linear) -> bool:
        least, worst = distances.least(source, target), interface.least(-weight, box.ranges)
        return least is not None and worst is not None and least >= -worst

    if distances.network.schedule is None:
        return []
    same = set(allowed.constraints)
    broken = [(item, [side for side in sides_of(item) if not kept(*side)]) for item in plan.constraints]
    return [(item, sides) for item, sides in broken if sides and item not in same]


# -- the question ------------------------------------------------------------------------------------------------------


class TreeQuestion(CheckQuestion):
    """Is the plan valid for every execution of a tree and all values in a box?

    Args:
        plan: the plan.
        manner: how it is asked about.
        box: the parameter values.
        tree: the tree.
        lag: how late nodes of the tree begin at most; None if there is no limit.
        within: whether it is also asked if executions are schedules of the plan's own network.
        every: whether all obligations are examined.
        on_obligation: called with the number of obligations examined, their total, and the name of the next.
    """

    def __init__(
        self,
        plan: model.ParametrizedPlan,
        manner: Manner,
        box: Box,
        *,
        tree: BehaviorTree,
        lag: Fraction | None = None,
        within: bool = False,
        every: bool = False,
        on_obligation: Callable[[int, int, str], None] | None = None,
    ) -> None:
        super().__init__(plan, manner, box, every=every, on_obligation=on_obligation)
        self._tree = tree
        self._lag = lag
        self._within = within

    @cached_property
    def examined(self) -> model.ParametrizedPlan:
        return self._tree.network(self.plan, self.manner.epsilon, self._lag)

    def encoded(self, plan: model.ParametrizedPlan, box: Box) -> TreeEncoding:
        return TreeEncoding(self._tree, plan, self.manner.epsilon, self._lag, box)

    @cached_property
    def _formulas(self) -> TreeEncoding:
        return self.encoded(self.examined, self.box)

    def run(self) -> check.CheckResult:
        if not self._tree.faults:
            return super().run()
        nothing = self.nothing(timed_out=False)
        reason = "; ".join(self._tree.faults)
        return replace(
            nothing, answer=check.Answer.REFUTED, reason=reason, tree=self._tree.file, seconds=0.0, interrupted=False
        )

    def formulas(self) -> TreeEncoding:
        return self._formulas

    def completed(self, result: check.CheckResult) -> check.CheckResult:
        decided = not result.cut_short and (self.every or result.answer is check.Answer.PROVED)
        if self._within and decided:
            result = stays_within(self.plan, self.formulas(), result, self.manner.deadline)
        return replace(result, tree=self._tree.file)


def stays_within(
    plan: model.ParametrizedPlan, encoding: interface.Encoding, result: check.CheckResult, deadline: Deadline = NEVER
) -> check.CheckResult:
    """The verdict about another network of a plan's steps, with those on whether its schedules are the plan's as well.

    Each constraint of the plan is one more obligation. A counterexample is a schedule of the other network, as
    simulation confirms, that the constraint forbids.
    """
    answers = {f"plan: {item}": check.Answer.PROVED for item in plan.constraints}
    found: dict[str, check.Counterexample] = {}
    session = Session(encoding.terms, solver=result.solver, statistics=Statistics())
    session.add(*encoding.network_formulas(), *check.within(encoding, result.box.intervals))
    places = encoding.places
    for item, sides in unkept(plan, encoding.plan, result.box):
        name = f"plan: {item}"
        slacks = (places[target] - places[source] - weight for source, target, weight in sides)
        with session.frame(encoding.terms.disjunction(encoding.terms.greater(-slack) for slack in slacks)):
            verdict = check.ANSWERS[session.check(name, deadline)]
            if verdict is check.Answer.REFUTED:
                values = {known: Fraction(value) for known, value in session.values(encoding.unknowns()).items()}
                found[name] = _outside(encoding, result, name, item, values)
        answers[name] = verdict
        if found and not result.every:
            break
    every = {**result.obligations, **answers}
    open_ = result.answer is check.Answer.UNKNOWN or check.Answer.UNKNOWN in answers.values()
    answer = check.Answer.REFUTED if found else check.Answer.UNKNOWN if open_ else result.answer
    return replace(result, answer=answer, obligations=every, counterexamples={**result.counterexamples, **found})


def _outside(
    encoding: interface.Encoding,
    result: check.CheckResult,
    name: str,
    item: model.TemporalConstraint,
    values: Mapping[str, Fraction],
) -> check.Counterexample:
    """The schedule of a model, executed in both networks; SolverError if one of them disagrees."""
    parameters = {known: values.get(known, interval.some_value()) for known, interval in result.box.intervals.items()}
    schedule = encoding.schedule({**values, **parameters})
    own = simulate(encoding.plan, parameters, schedule, epsilon=result.epsilon)
    alone = simulate(replace(encoding.plan, constraints=(item,)), parameters, schedule, epsilon=result.epsilon)
    if own.network_violations or not alone.network_violations:
        raise SolverError(f"the simulator does not confirm that {name!r} breaks; please report this plan as a bug")
    violation = Violation(name, max(schedule[item.source], schedule[item.target]), alone.network_violations[0])
    return check.Counterexample(name, parameters, schedule, replace(own, violations=(*own.violations, violation)))
