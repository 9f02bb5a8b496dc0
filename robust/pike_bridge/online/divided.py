"""Answers about plans that are cut into parts: formulas are about the part that is under way, not about the whole plan.

A *window* is a part, seldom several, as a plan of its own. What comes after it demands bounds between its nodes:
shortest paths over the nodes, on which each part to come has its least duration. That depends on what people choose
there. Values that lead to the same bounds are a *class*, and the classes are the values of one more uncontrollable
choice after the window, so that patience needs to know of nothing else. The correct executions of the window's plan are
those of the whole one, as far as they are in the window; so all answers are the same.
"""

from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from math import lcm, prod
from typing import TYPE_CHECKING, TypeAlias

from robust.pike_bridge import model
from robust.pike_bridge.model import ALWAYS, Assignment, Condition, Constraint, Effect, Guard, contradicts, guard
from robust.pike_bridge.online.parts import LATER, SOON, Division
from robust.pike_bridge.online.patience import JOINT, intents, openings, values_of
from robust.pike_bridge.online.progress import Progress
from robust.pike_bridge.online.semantic import News, Reasoner, SemanticReasoner
from robust.smt.limits import NEVER, Deadline
from robust.smt.session import Terms

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    Distances: TypeAlias = npt.NDArray[np.int64]

FAR = 1 << 60
"""No bound, among sums of scaled times."""
Table: TypeAlias = dict[tuple[int, int], int]
"""For pairs of nodes by their places how much later the second is at most; −1 is what comes soon after a window."""


class DividedReasoner(Reasoner):
    """Asks one solver session about the parts that are under way.

    Args:
        division: of the plan, with more than one part.
        deadline: for the least durations of all parts, which are found at once.

    Raises:
        OutOfTimeError: if the deadline passes.
        SolverError: if the solver is unknown or not installed.
    """

    name = "smt"

    def __init__(
        self,
        progress: Progress,
        division: Division,
        *,
        solver: str = "z3",
        terms: Terms | None = None,
        deadline: Deadline = NEVER,
    ) -> None:
        super().__init__(progress)
        self.division = division
        self._solver, self._terms = solver, terms or Terms()
        self._alone: dict[int, _Alone] = {}
        """The reasoning about single parts."""
        self._at = self._end = 0
        for part in range(1, len(division.nodes) - 1):
            inside = [each for each in openings(progress) if division.choice_in[each.name] == part]
            for environment in (ALWAYS, *(each.guard for each in values_of(inside, progress))):
                deadline.enforce()
                self._duration(part, environment, late=False)
                self._duration(part, environment, late=True)
        self._view = self._open()

    @property
    def view(self) -> SemanticReasoner:
        return self._view

    # -- what has happened -------------------------------------------------------------------------------------------

    def _learn(self, news: News) -> None:
        known, nodes = self.view.progress, self.division.nodes
        while self._at + 1 < len(nodes) - 1 and nodes[self._at + 1] in self.progress.times:
            self._at += 1
        elsewhere = {each.variable for each in news.chosen} - known.plan.network.domains.keys()
        if news.void or elsewhere or nodes[self._end] in news.times:
            for part in self._alone.values():
                part.learn(self.progress)
            self._view = self._open()
        else:
            self._tell(self.view.progress)

    def _tell(self, known: Progress) -> None:
        """Bring what has happened in a window up to date."""
        guards, progress, own = known.structure.guards, self.progress, self.division.guards
        known.now = progress.now
        known.times.update((e, time) for e, time in progress.times.items() if e in guards and e not in known.times)
        domains = known.plan.network.domains
        known.chosen.update((name, value) for name, value in progress.chosen.items() if name in domains)
        known.reported.update(event for event in progress.reported if event in guards)
        for event in [e for e in known.pending if e in own and e not in progress.pending]:
            del known.pending[event]

    def _open(self) -> SemanticReasoner:
        """Reasoning about the parts that are under way."""
        division, nodes, separation = self.division, self.division.nodes, self.progress.plan.separation
        last = len(nodes) - 1
        self._end = min(self._at + 1, last)
        # What is after the part to come has to be after the present, even if that part begins now.
        while self._end < last and (self._duration(self._end, ALWAYS, late=False) or 0) < separation:
            self._end += 1
        self._close()
        nothing = (((0, self._end), -1), ((self._end, 0), 0))
        classes = self._classes() or {nothing: ()}
        names = [f"{number}" for number in range(len(classes))]
        self._meaning = {Assignment(LATER, name): found for name, found in zip(names, classes.values(), strict=True)}
        labels = [ALWAYS] if len(names) == 1 else [frozenset({Assignment(LATER, name)}) for name in names]
        more = [
            self._bound(pair, bound, label)
            for label, table in zip(labels, classes, strict=True)
            for pair, bound in table
            if any(self._named(place) not in self.progress.times for place in pair)
        ]
        plan, effects, conditions = division.window(self._at, self._end, more, names)
        progress = Progress(plan)
        progress.void.update(_translated(self.progress, effects, conditions))
        self._tell(progress)
        return SemanticReasoner(progress, solver=self._solver, terms=self._terms)

    def _named(self, place: int) -> str:
        return SOON if place < 0 else self.division.nodes[place]

    def _bound(self, pair: tuple[int, int], bound: int, label: Guard = ALWAYS) -> Constraint:
        """An entry of a table as a constraint."""
        source, target = map(self._named, pair)
        return Constraint(source, target, None, Fraction(bound, self._scale), label)

    def meaning(self, values: Guard) -> list[Guard]:
        """What people may mean by values of choices in the window and after it."""
        after = [each for each in values if each.variable == LATER]
        if not after:
            return [values]
        return [values.difference(after) | each for each in self._meaning[after[0]] or (ALWAYS,)]

    # -- questions ---------------------------------------------------------------------------------------------------

    def executable(self, event: str, deadline: Deadline) -> bool:
        view = self.under_way()
        return event in view.progress.pending and view.executable(event, deadline)

    def could(self, environment: Guard, deadline: Deadline) -> bool:
        view = self.under_way()
        if not self.progress.compatible(environment):
            return False
        fresh = frozenset(each for each in environment if each.variable not in self.progress.chosen)
        here = frozenset(each for each in fresh if each.variable in view.progress.plan.network.domains)
        if here == fresh:
            return view.could(here, deadline)
        # A choice in a part to come is made only if the event at which it is made is executed.
        table = None if contradicts(fresh, fresh) else self._table(fresh - here)
        if table is None:
            return False
        more = [self._bound(pair, bound) for pair, bound in table.items() if min(pair) >= 0]
        return view.could(here, deadline, more)

    def next_time(self, deadline: Deadline) -> Fraction | None:
        return self.under_way().next_time(deadline)

    # -- what comes after the window ---------------------------------------------------------------------------------

    def _duration(self, part: int, environment: Guard, *, late: bool) -> Fraction | None:
        """The least duration of a part in an environment; None if it is impossible there.

        If `late`, whatever is not the executive's comes after the part's first node, as it does after the present.
        """
        if part not in self._alone:
            self._alone[part] = _Alone(self.progress, self.division, part, self._reasoning)
        return self._alone[part].duration(environment | guard(self.progress.chosen), late=late)

    def _reasoning(self, progress: Progress) -> SemanticReasoner:
        return SemanticReasoner(progress, solver=self._solver, terms=self._terms)

    def _close(self) -> None:
        """Shortest paths between the initial event and all nodes from that of the window on.

        Nodes of the past are the initial event, so much later.
        """
        import numpy as np  # noqa: PLC0415 - takes a tenth of a second to import

        division, progress, first = self.division, self.progress, self._at
        last = len(division.nodes) - 1
        fixed = {division.rank[e]: time for e, time in progress.times.items() if e in division.rank}
        self._scale = lcm(progress.grid.denominator, *(time.denominator for time in fixed.values()))
        edges = (edge for each in division.between for edge in each.upper_bounds)
        bounds = [(division.rank[one], division.rank[other], bound) for one, other, bound in edges]
        least = [self._duration(part, ALWAYS, late=False) for part in range(self._end, last)]
        self._hopeless = None in least
        bounds += [(at + 1, at, -each) for at, each in enumerate(least, self._end) if each is not None]
        bounds += [(0, at, time - fixed[0]) for at, time in fixed.items()]
        bounds += [(at, 0, fixed[0] - time) for at, time in fixed.items()]
        past = {at: time - fixed[0] for at, time in fixed.items() if at < first}
        size = last - first + 2
        large = sum(abs(bound) for _, _, bound in bounds) * self._scale * 4 >= FAR
        distances = np.full((size, size), FAR, dtype=object if large else np.int64)
        np.fill_diagonal(distances, 0)
        for one, other, bound in bounds:
            scaled = int((bound + past.get(one, 0) - past.get(other, 0)) * self._scale)
            row, column = self._row(one), self._row(other)
            distances[row, column] = min(distances[row, column], scaled)
        if first == 0:  # the initial event is a node of the window
            distances[0, 1] = distances[1, 0] = 0
        for middle in range(size):
            distances = _shortened(distances, middle, middle, 0)
        self._hopeless = self._hopeless or bool((distances.diagonal() < 0).any())
        self._distances: Distances = distances

    def _row(self, node: int) -> int:
        """The place of a node in the matrix; the initial event, and with it the past, is first."""
        return 0 if node < self._at else node - self._at + 1

    def _classes(self) -> Mapping[tuple[tuple[tuple[int, int], int], ...], tuple[Guard, ...]]:
        """What the rest of the plan demands, each with what people may choose there that leads to it."""
        if self._hopeless:
            return {}
        progress = self.progress
        coming = [each for each in openings(progress) if self.division.choice_in[each.name] >= self._end]
        few = prod(len(each.domain) for each in openings(progress)) <= JOINT
        single = values_of(coming, progress)
        found: dict[tuple[tuple[tuple[int, int], int], ...], tuple[Guard, ...]] = {}
        covered: list[Guard] = []
        for intent in [*(intents(coming, progress) if few else single), *single]:
            if not any(intent.values <= each for each in covered):
                table = self._table(intent.guard)
                if table is not None:
                    covered.append(intent.values)
                    key = tuple(sorted(table.items()))
                    found[key] = (*found.get(key, ()), intent.values)
        anything = self._table(ALWAYS)
        if anything is None:
            return {}
        found.setdefault(tuple(sorted(anything.items())), ())
        return found

    def _table(self, environment: Guard) -> Table | None:
        """The bounds between the window's nodes in an environment of parts to come; None if it is impossible."""
        if self._hopeless:
            return None
        distances = self._distances
        for part in sorted({self.division.choice_in[each.variable] for each in environment}):
            if part >= self._end:
                least = self._duration(part, environment, late=False)
                if least is None:
                    return None
                row, bound = self._row(part), -int(least * self._scale)
                if distances[row, row + 1] + bound < 0:
                    return None
                distances = _shortened(distances, row + 1, row, bound)
        places = [0, *range(max(self._at, 1), self._end + 1)]
        rows = {place: self._row(place) if place else 0 for place in places}
        table = {
            (one, other): int(distances[rows[one], rows[other]])
            for one in places
            for other in places
            if one != other and distances[rows[one], rows[other]] < FAR // 2
        }
        if self._end < len(self.division.nodes) - 1:
            table |= self._soon(distances, rows)
        return table

    def _soon(self, distances: "Distances", rows: Mapping[int, int]) -> Table:
        """Bounds on the first that is not the executive's in the part after the window: that is after the present, even
        if the part begins now, and so long before its end.
        """
        plain, late = (self._duration(self._end, ALWAYS, late=late) for late in (False, True))
        if late is None:
            return {(self._end, -1): 0}
        if plain is None or late <= plain:
            return {}
        rest = int((late - self.progress.plan.separation) * self._scale)
        end = self._row(self._end + 1)
        return {
            (one, -1): int(distances[row, end]) - rest for one, row in rows.items() if distances[row, end] < FAR // 2
        }


def _shortened(distances: "Distances", source: int, target: int, bound: int) -> "Distances":
    """Distances with one more bound: how much later than the source the target is at most."""
    import numpy as np  # noqa: PLC0415 - likewise

    shorter: Distances = np.minimum(distances, distances[:, [source]] + bound + distances[[target], :])
    shorter[shorter > FAR // 2] = FAR
    return shorter


def _translated(
    progress: Progress, effects: Mapping[Effect, Effect], conditions: Mapping[Condition, Condition]
) -> Iterable[tuple[Effect, Condition]]:
    """The broken links of a plan in that of some of its parts."""
    return [(effects[one], conditions[other]) for one, other in progress.void if one in effects and other in conditions]


class _Alone:
    """How long a part takes at least, if it begins now.

    Args:
        reasoning: makes the reasoning.
    """

    def __init__(
        self, progress: Progress, division: Division, part: int, reasoning: Callable[[Progress], SemanticReasoner]
    ) -> None:
        self._choices = {name for name, place in division.choice_in.items() if place == part}
        self._start, self._end = division.nodes[part : part + 2]
        plan: model.TeamPlan
        plan, self._effects, self._conditions = division.window(part, part + 1)
        known = Progress(plan)
        known.now = plan.separation if part else Fraction(0)
        for event, time in {model.INITIAL: Fraction(0), self._start: known.now}.items():
            known.times[event] = time
            known.pending.pop(event, None)
        self._reasoner = reasoning(known)
        self._least: dict[tuple[Guard, bool], Fraction | None] = {}
        self.learn(progress)

    def learn(self, progress: Progress) -> None:
        """Take note of broken links."""
        void = set(_translated(progress, self._effects, self._conditions))
        if void != self._reasoner.progress.void:
            self._reasoner.progress.void.update(void)
            self._least.clear()

    def duration(self, environment: Guard, *, late: bool) -> Fraction | None:
        """In what the environment says of the part's choices; None if the part is impossible then."""
        own = frozenset(each for each in environment if each.variable in self._choices)
        if (own, late) not in self._least:
            least = None
            if not contradicts(own, own):
                least = self._reasoner.soonest(self._end, own, NEVER, late=late)
            self._least[own, late] = None if least is None else least - self._reasoner.progress.now
        return self._least[own, late]
