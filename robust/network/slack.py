"""The slack graph: how far the ends of intervals in a network may move before a requirement breaks, by shortest paths.

Some bounds of a network are not numbers but *faces*: ends of intervals that move outwards, all at once, each at its own
speed. With one feasible schedule, that of the network before anything moves, each bound has a slack, and a face adds to
the slack of its bound how far it has moved. A requirement t_b − t_a ≥ w holds in all schedules, whatever lies between
the faces, if and only if a shortest path from a to b in the graph of slacks is no longer than the requirement's own
slack. For existence of schedules faces count the other way: the adversary chooses the ends that are hardest to satisfy,
and a circle must not have a negative sum of slacks; a circle turns back on no interval, since its two ends are not
chosen together.

The stretch λ says how far faces have moved that still move: λ times their speed. The length of a path is linear in λ,
so that the stretch at which a requirement becomes tight is found by Newton's method: the shortest path at some stretch
says how far it surely holds, and the least of these stretches is examined next. Circles are found in the same way from
above, each as a linear form. Searches are made in floats; whatever they find is summed in fractions, among all paths
that floats cannot tell apart.
"""

from collections import defaultdict, deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from heapq import heappop, heappush
from math import inf

from robust.network.differences import forward_only, reachable, strong_components

FaceNumber = int
"""2i is the lower end of interval i, 2i + 1 its upper end."""
Step = tuple[int, int, FaceNumber | None]
"""In the slack graph: the point that it leads to, the slack before anything moves, and the face that adds to it."""
FAR = 2.0**44
"""A stretch that is tried first for circles."""
MANY = 64
"""Ways to choose the direction in which circles lead along some distances, before that is given up."""


class OutsideFragmentError(Exception):
    """Shortest paths do not decide the question; internal, the message says why."""


@dataclass(frozen=True, slots=True)
class FaceBound:
    """A bound of the network: t_target − t_source ≥ weight, and the face that loosens it, if any."""

    source: int
    target: int
    weight: int
    face: FaceNumber | None
    origin: str


@dataclass(slots=True)
class SlackRequirement:
    """t_target − t_source ≥ weight, under the names of what demands it; `exact` if it is needed and not only enough."""

    source: int
    target: int
    weight: int
    names: list[str]
    exact: bool = True


@dataclass(frozen=True, slots=True)
class LinearForm:
    """Σ factor · (how far the face has moved) ≤ budget, and what says so.

    Of a circle, `chain` are the points in order, and `statements` the origins of its bounds.
    """

    factors: Mapping[FaceNumber, Fraction]
    budget: Fraction
    name: str
    chain: tuple[int, ...] = ()
    statements: tuple[str, ...] = ()

    @property
    def names(self) -> list[str]:
        return [self.name]


Tie = LinearForm | SlackRequirement


@dataclass(frozen=True, slots=True)
class FaceStop:
    """What ends a face: linear forms, or requirements; `chain` are the points along the shortest path or the circle."""

    ties: tuple[Tie, ...]
    chain: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class _Shortest:
    """All shortest paths of a requirement at a stretch: their length, that of least slope, and the steps on any."""

    length: Fraction
    slope: Fraction
    points: tuple[int, ...]
    steps: tuple[tuple[int, int, FaceNumber | None], ...]


@dataclass(eq=False)
class SlackGraph:
    """Moves faces outwards until nothing can move any more.

    Args:
        size: points are 0 … size − 1.
        times: a schedule of the network before anything moves.
        bounds: the network.
        requirements: what has to hold in all schedules; it does before anything moves.
        forms: linear conditions on how far faces have moved.
        speeds: of each face, in units of the network.
    """

    size: int
    times: Sequence[int]
    bounds: Sequence[FaceBound]
    requirements: Sequence[SlackRequirement]
    forms: Sequence[LinearForm]
    speeds: Sequence[Fraction]
    moved: dict[FaceNumber, Fraction] = field(default_factory=dict, init=False)
    """Faces that have stopped, and how far from where they began."""
    stops: dict[FaceNumber, FaceStop] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        self.moved |= {face: Fraction(0) for face, speed in enumerate(self.speeds) if not speed}
        self._speed = [float(speed) for speed in self.speeds]
        self._still: list[float | None] = [None if speed else 0.0 for speed in self.speeds]
        self._steps = self._slack_steps()
        self._circles = _Circles(self)

    def _slack_steps(self) -> list[list[Step]]:
        """The steps from each point; of parallel ones without a face the least slack."""
        steps: list[list[Step]] = [[] for _ in range(self.size)]
        plain: dict[tuple[int, int], int] = {}
        for bound in self.bounds:
            if bound.source != bound.target:
                slack = self.slack(bound.source, bound.target, bound.weight)
                if bound.face is not None:
                    steps[bound.source].append((bound.target, slack, bound.face))
                elif slack < plain.get((bound.source, bound.target), slack + 1):
                    plain[bound.source, bound.target] = slack
        for (source, target), slack in plain.items():
            steps[source].append((target, slack, None))
        return steps

    def slack(self, source: int, target: int, weight: int) -> int:
        """By how much the schedule exceeds a bound."""
        return self.times[target] - self.times[source] - weight

    # -- the search ----------------------------------------------------------------------------------------------------

    def events(self) -> Iterator[tuple[Fraction, FaceStop]]:
        """Each stretch at which something becomes tight, in order; what it stops has stopped before the next.

        At the end the box is max–min fair: all faces have moved as far as they go, or are without end.

        Raises:
            OutsideFragmentError: if paths do not decide it.
        """
        items: list[Tie] = [*self.requirements, *self.forms]
        heap = [(0.0, Fraction(0), number) for number in range(len(items))]
        while True:
            circle = self._circles.below(heap[0][1] if heap else None, items)
            if circle is not None:
                items.append(circle)
                heappush(heap, (0.0, Fraction(0), len(items) - 1))
                continue
            if not heap:
                return
            stretch = heap[0][1]
            tight: list[tuple[Tie, _Shortest | None]] = []
            numbers: list[int] = []
            while heap and heap[0][1] == stretch:
                number = heappop(heap)[2]
                item = items[number]
                root, shortest = self._root(item, stretch)
                if root is not None and root > stretch:
                    heappush(heap, (float(root), root, number))
                elif root is not None:
                    tight.append((item, shortest))
                    numbers.append(number)
            if tight:
                if any(isinstance(item, SlackRequirement) and not item.exact for item, _ in tight):
                    raise OutsideFragmentError(f"several ways to keep {tight[0][0].names[0]!r}")
                item, shortest = tight[0]
                yield stretch, FaceStop(tuple(item for item, _ in tight), self._chain(item, shortest))
                self._stop(stretch, tight)
                for number in numbers:
                    heappush(heap, (float(stretch), stretch, number))

    def _root(self, item: Tie, stretch: Fraction) -> tuple[Fraction | None, _Shortest | None]:
        """A stretch up to which an item surely holds, the given one if it is tight there; None if it holds for ever."""
        if isinstance(item, LinearForm):
            return self.root_of(item), None
        budget = self.slack(item.source, item.target, item.weight)
        shortest = self._shortest(item.source, item.target, stretch, budget)
        if shortest.length > budget:
            raise OutsideFragmentError(f"{item.names[0]!r} was passed over")
        if not shortest.slope:
            return None, shortest
        return stretch + (budget - shortest.length) / shortest.slope, shortest

    def root_of(self, form: LinearForm) -> Fraction | None:
        """The stretch at which a linear form is tight; None if nothing in it moves."""
        rest, speed = form.budget, Fraction(0)
        for face, factor in form.factors.items():
            if face in self.moved:
                rest -= factor * self.moved[face]
            else:
                speed += factor * self.speeds[face]
        return rest / speed if speed else None

    # -- shortest paths ------------------------------------------------------------------------------------------------

    def _shortest(self, source: int, target: int, stretch: Fraction, budget: int) -> _Shortest:
        """Shortest paths: by floats, then exactly among all that floats cannot tell apart."""
        length = self._lengths(source, target, float(stretch), budget)
        if target not in length:
            raise OutsideFragmentError("a path was lost")
        near = 1e-9 * (1 + budget)
        leading: dict[int, list[tuple[int, int, FaceNumber | None]]] = defaultdict(list)
        waiting, seen = [target], {target}
        while waiting:
            point = waiting.pop()
            for origin, slack, face in self._arrivals[point]:
                far = length.get(origin)
                if far is not None and far + self._length_of(slack, face, float(stretch)) <= length[point] + near:
                    leading[origin].append((point, slack, face))
                    if origin not in seen:
                        seen.add(origin)
                        waiting.append(origin)
        return self._exactly(source, target, leading, stretch)

    def _length_of(self, slack: int, face: FaceNumber | None, stretch: float) -> float:
        if face is None:
            return slack
        still = self._still[face]
        return slack + (stretch * self._speed[face] if still is None else still)

    def _lengths(self, source: int, target: int, stretch: float, budget: int) -> dict[int, float]:
        """Dijkstra's algorithm in floats, up to the target."""
        reach = budget * (1 + 1e-9) + 1e-6
        steps, speed, still = self._steps, self._speed, self._still
        length, done = {source: 0.0}, set[int]()
        heap = [(0.0, source)]
        end = reach
        while heap:
            far, point = heappop(heap)
            if point in done:
                continue
            if far > end:
                break
            done.add(point)
            if point == target:
                end = far + 1e-9 * (1 + budget)  # ties behind it count as well
            for other, slack, face in steps[point]:
                if face is None:
                    there = far + slack
                else:
                    rest = still[face]
                    there = far + slack + (stretch * speed[face] if rest is None else rest)
                if there <= reach and other not in done and there < length.get(other, reach + 1):
                    length[other] = there
                    heappush(heap, (there, other))
        return length

    @cached_property
    def _arrivals(self) -> list[list[Step]]:
        """The steps to each point, with the point that they come from."""
        arriving: list[list[Step]] = [[] for _ in range(self.size)]
        for source, steps in enumerate(self._steps):
            for target, slack, face in steps:
                arriving[target].append((source, slack, face))
        return arriving

    def _exactly(self, source: int, target: int, leading: Mapping[int, Sequence[Step]], stretch: Fraction) -> _Shortest:
        """Dijkstra's algorithm in fractions, by length and then by slope, over a few steps."""
        nothing = Fraction(0)
        best: dict[int, tuple[Fraction, Fraction]] = {source: (nothing, nothing)}
        before: dict[int, int] = {}
        heap = [(nothing, nothing, source)]
        done: set[int] = set()
        while heap:
            far, slope, point = heappop(heap)
            if point in done:
                continue
            done.add(point)
            for other, slack, face in leading.get(point, ()):
                there = (far + slack + self._place(face, stretch), slope + self._slope(face))
                if other not in best or there < best[other]:
                    best[other], before[other] = there, point
                    heappush(heap, (*there, other))
        points = [target]
        while points[-1] != source:
            points.append(before[points[-1]])
        on_any: list[tuple[int, int, FaceNumber | None]] = []
        waiting, seen = [target], {target}
        arriving: dict[int, list[tuple[int, int, FaceNumber | None]]] = defaultdict(list)
        for point, steps in leading.items():
            for other, slack, face in steps:
                if point in best and best[point][0] + slack + self._place(face, stretch) == best[other][0]:
                    arriving[other].append((point, other, face))
        while waiting:
            for step in arriving[waiting.pop()]:
                on_any.append(step)
                if step[0] not in seen:
                    seen.add(step[0])
                    waiting.append(step[0])
        return _Shortest(*best[target], tuple(reversed(points)), tuple(on_any))

    def _place(self, face: FaceNumber | None, stretch: Fraction) -> Fraction | int:
        if face is None:
            return 0
        return self.moved[face] if face in self.moved else stretch * self.speeds[face]

    def _slope(self, face: FaceNumber | None) -> Fraction | int:
        return 0 if face is None or face in self.moved else self.speeds[face]

    # -- what stops ----------------------------------------------------------------------------------------------------

    def _stop(self, stretch: Fraction, tight: Sequence[tuple[Tie, _Shortest | None]]) -> None:
        """Stop the faces that cannot move on while the others do: upper faces first, interval by interval."""
        stuck: set[FaceNumber] = set()
        paths = [shortest for _, shortest in tight if shortest is not None]
        for item, _ in tight:
            if isinstance(item, LinearForm):
                stuck |= {face for face, factor in item.factors.items() if factor and face not in self.moved}
        concerned = (
            {face for path in paths for _, _, face in path.steps if face is not None} - self.moved.keys() - stuck
        )
        going: set[FaceNumber] = set()
        for face in sorted(concerned, key=lambda number: number ^ 1):
            if any(_blocks(path, going | {face}) for path in paths):
                stuck.add(face)
            else:
                going.add(face)
        for face in stuck:
            self.moved[face] = place = stretch * self.speeds[face]
            self._still[face] = float(place)
            ties = [(item, path) for item, path in tight if _concerns(item, path, going | {face}, face)]
            self.stops[face] = FaceStop(tuple(item for item, _ in ties), self._chain(*ties[0]))

    def _chain(self, item: Tie, shortest: _Shortest | None) -> tuple[int, ...]:
        if isinstance(item, LinearForm):
            return item.chain
        return shortest.points if shortest is not None else ()


def _concerns(item: Tie, path: _Shortest | None, faces: set[FaceNumber], face: FaceNumber) -> bool:
    if isinstance(item, LinearForm):
        return bool(item.factors.get(face))
    return path is not None and any(step[2] == face for step in path.steps) and _blocks(path, faces)


def _blocks(path: _Shortest, faces: set[FaceNumber]) -> bool:
    """Whether each shortest path has one of the faces: it becomes longer as soon as they move."""
    leading: dict[int, list[int]] = defaultdict(list)
    for source, target, face in path.steps:
        if face not in faces:
            leading[source].append(target)
    return path.points[-1] not in reachable(leading, path.points[0])


class _Circles:
    """Circles of bounds that leave no schedule for some choice of values between the faces.

    A node is a point, and the interval on which it was reached: no circle turns back on it. A schedule for the hardest
    values at one stretch is where the search at the next begins.
    """

    def __init__(self, graph: SlackGraph) -> None:
        self._graph = graph
        bounds = [bound for bound in graph.bounds if bound.source != bound.target]
        ends = [(bound.source, bound.target, None if bound.face is None else bound.face >> 1) for bound in bounds]
        steps: list[list[tuple[int, int, FaceNumber | None, FaceBound]]] = []
        least: dict[tuple[int, int], int] = {}
        for source, target, number in forward_only(graph.size, ends):
            steps += [[] for _ in range(len(steps), max(source, target) + 1)]
            bound = bounds[number]
            slack = graph.slack(bound.source, bound.target, bound.weight)
            if bound.face is None:
                if least.get((source, target), slack + 1) <= slack:
                    continue
                least[source, target] = slack
            steps[source].append((target, slack, None if bound.face is None else bound.face ^ 1, bound))
        component = strong_components([[step[0] for step in leaving] for leaving in steps])
        self._steps = [
            [step for step in leaving if component[step[0]] == component[node]] for node, leaving in enumerate(steps)
        ]
        self._nodes = [node for node, leaving in enumerate(self._steps) if leaving]
        self._potential: dict[frozenset[FaceNumber], list[float]] = {}
        self._branches: list[frozenset[FaceNumber]] = [frozenset()]
        """No circle leads to and fro on a distance, so it is among those without the one way or without the other."""
        self._heap: list[tuple[Fraction, int, LinearForm]] = []
        """Known circles, and stretches up to which they leave a schedule."""
        self._checked: Fraction | None = Fraction(-1) if self._nodes else None
        """The stretch up to which there are schedules; None is infinite."""

    def below(self, stretch: Fraction | None, items: Sequence[Tie]) -> LinearForm | None:
        """A new circle that may have no schedule up to a stretch, None being without end; None if there is none."""
        if self._checked is None or (stretch is not None and stretch <= self._checked):
            return None
        goal = self._least_root()
        if goal is not None and stretch is not None:
            goal = max(goal, stretch)
        waiting = list(self._branches)
        while waiting:
            walk = self._negative(FAR if goal is None else float(goal), waiting[-1])
            if walk is not None:
                rooted = [(self._graph.root_of(circle), circle) for circle in _circles(self._graph, walk)]
                nearest = min((root for root, _ in rooted if root is not None), default=None)
                if nearest is not None and (goal is None or nearest < goal):
                    circle = next(circle for root, circle in rooted if root == nearest)
                    heappush(self._heap, (nearest, len(items), circle))
                    return circle
            branch = waiting.pop()
            if walk is not None and (interval := _to_and_fro(walk)) is not None:
                self._branches.remove(branch)
                parts = [branch | {2 * interval}, branch | {2 * interval + 1}]
                self._branches += parts
                waiting += parts
                if len(self._branches) > MANY:
                    raise OutsideFragmentError("circles of the network lead to and fro on many distances")
        self._checked = goal
        return None

    def _least_root(self) -> Fraction | None:
        while self._heap:
            known, number, circle = self._heap[0]
            root = self._graph.root_of(circle)
            if root == known:
                return root
            heappop(self._heap)
            if root is not None:
                heappush(self._heap, (root, number, circle))
        return None

    def _negative(self, stretch: float, without: frozenset[FaceNumber]) -> list[FaceBound] | None:
        """A closed walk whose slack is negative at a stretch [Bellman and Ford, by a queue], by floats."""
        still, speed = self._graph._still, self._graph._speed
        near = 1e-9 * (1 + stretch * max(speed, default=0.0) if stretch == FAR else 1) + 1e-6
        lengths: list[list[tuple[int, float]]] = [[] for _ in self._steps]
        distance = list(self._potential.get(without) or [0.0] * len(self._steps))
        late = []
        for node in self._nodes:
            here = distance[node]
            row = lengths[node]
            for other, slack, face, _ in self._steps[node]:
                length = float(slack)
                if face is not None:
                    if face in without:
                        length = inf
                    else:
                        rest = still[face]
                        length -= stretch * speed[face] if rest is None else rest
                row.append((other, length))
                if here + length < distance[other] - near:
                    late.append(node)
        before: dict[int, tuple[int, int]] = {}
        waiting = deque(dict.fromkeys(late))
        waits = set(waiting)
        patience = len(self._nodes)
        while waiting:
            node = waiting.popleft()
            waits.discard(node)
            here = distance[node]
            for index, (other, length) in enumerate(lengths[node]):
                if here + length < distance[other] - near:
                    distance[other], before[other] = here + length, (node, index)
                    if other not in waits:
                        waits.add(other)
                        waiting.append(other)
            patience -= 1
            if not patience:
                circle = self._circle(before)
                if circle is not None:
                    return circle
                patience = len(self._nodes)
        self._potential[without] = distance
        return None

    def _circle(self, before: Mapping[int, tuple[int, int]]) -> list[FaceBound] | None:
        """A circle among the steps that lowered each node last."""
        visited: dict[int, int] = {}
        for start in before:
            node = start
            while node in before and node not in visited:
                visited[node] = start
                node = before[node][0]
            if node in before and visited[node] == start:
                steps, first = [], node
                while True:
                    origin, index = before[node]
                    steps.append(self._steps[origin][index][3])
                    node = origin
                    if node == first:
                        return steps[::-1]
        return None


def _to_and_fro(walk: Sequence[FaceBound]) -> int | None:
    """An interval on which a walk leads both ways."""
    faces = {bound.face for bound in walk if bound.face is not None}
    return next((face >> 1 for face in faces if face ^ 1 in faces), None)


def _circles(graph: SlackGraph, walk: Sequence[FaceBound]) -> Iterator[LinearForm]:
    """The simple circles of a closed walk, without those that go to and fro on one interval."""
    path: list[FaceBound] = []
    for bound in walk:
        path.append(bound)
        first = next((index for index, known in enumerate(path) if known.source == bound.target), None)
        if first is not None:
            circle, path = path[first:], path[:first]
            faces = [known.face ^ 1 for known in circle if known.face is not None]
            if len(circle) > 2 or len({face >> 1 for face in faces}) == len(faces):
                yield _form(graph, circle)


def _form(graph: SlackGraph, steps: Sequence[FaceBound]) -> LinearForm:
    """What a circle says about faces."""
    factors: dict[FaceNumber, Fraction] = defaultdict(Fraction)
    for bound in steps:
        if bound.face is not None:
            factors[bound.face ^ 1] += 1
    first = min(range(len(steps)), key=lambda index: steps[index].source)
    ordered = [*steps[first:], *steps[:first]]
    budget = sum(graph.slack(bound.source, bound.target, bound.weight) for bound in ordered)
    chain = tuple(bound.source for bound in ordered)
    return LinearForm(factors, Fraction(budget), "no schedule", chain, tuple(bound.origin for bound in ordered))
