"""Networks with uncertainty for tests, and slow ways to decide controllability that share no code with the package."""

from fractions import Fraction
from functools import cache
from itertools import chain, combinations, product

from robust.network.uncertain import Stnu, UncertainLink
from robust.plan.model import ZERO, TimePoint, TimePointKind


def point(name):
    return TimePoint(TimePointKind.INSTANT, name)


def network(requirements, contingents):
    """A network from (source, target, lower, upper) with names of time points; "Z" is zero. All follow zero."""
    names = dict.fromkeys(name for link in (*requirements, *contingents) for name in link[:2] if name != "Z")
    places = {"Z": ZERO} | {name: point(name) for name in names}

    def link(source, target, lower, upper, *contingent):
        bounds = (None if end is None else Fraction(end) for end in (lower, upper))
        return UncertainLink(places[source], places[target], *bounds, *contingent)

    links = [*(link(*bounds) for bounds in requirements), *(link("Z", name, 0, None) for name in names)]
    links += [link(*length, True, length[1]) for length in contingents]
    return Stnu(tuple(places.values()), tuple(links))


def satisfies(link, times):
    """Whether a schedule keeps to the bounds of a link."""
    distance = times[link.target] - times[link.source]
    return (link.lower is None or distance >= link.lower) and (link.upper is None or distance <= link.upper)


def random_network(rng, executable, contingents, requirements, size, *, unbounded=False):
    """A random network with integer bounds; each contingent link starts at a time point of the dispatcher's."""
    names = ["Z", *(f"x{i}" for i in range(executable))]
    ends = [f"c{i}" for i in range(contingents)]
    links = []
    for end in ends:
        low = rng.randint(0, size)
        high = None if unbounded and rng.random() < 0.3 else low + rng.randint(0, size)
        links.append((rng.choice(names), end, low, high))
    bounds = [("Z", name, 0, rng.choice([size, 2 * size, 3 * size])) for name in names[1:] if rng.random() < 0.6]
    for _ in range(requirements):
        source, target = rng.sample([*names, *ends], 2)
        low = rng.choice([None, rng.randint(-size, size)])
        high = None if low is not None and rng.random() < 0.5 else (low or 0) + rng.randint(0, size)
        bounds.append((source, target, low, high))
    return network(bounds, links)


def longest_paths(points, bounds, *sources):
    """Bellman and Ford: how late bounds (a, b, w), t_b − t_a ≥ w, make what follows sources at 0; None: for ever."""
    times = dict.fromkeys(sources, Fraction(0))
    for _ in range(len(points) + 1):
        before = dict(times)
        for first, second, weight in bounds:
            if first in times:
                times[second] = max(times[first] + weight, times.get(second, times[first] + weight))
        if times == before:
            return times
    return None


def closure(points, bounds):
    """The greatest lower bound of each pair that has one, by the textbook; a positive cycle shows at its points."""
    points = list(points)
    known = {(one, one): Fraction(0) for one in points}
    for source, target, weight in bounds:
        known[source, target] = max(weight, known.get((source, target), weight))
    for middle, source, target in product(points, repeat=3):
        if (source, middle) in known and (middle, target) in known:
            length = known[source, middle] + known[middle, target]
            known[source, target] = max(length, known.get((source, target), length))
    return known


def has_schedule(points, bounds):
    """Whether some times satisfy all bounds."""
    return longest_paths(points, bounds, *points) is not None


def bound(edges, source, target, lower, upper):
    """Add lower <= target - source <= upper to the edges of a distance graph."""
    for key, weight in (((source, target), upper), ((target, source), None if lower is None else -lower)):
        if weight is not None:
            edges[key] = min(weight, edges.get(key, weight))


def consistent(points, edges):
    """Whether a simple temporal network, whose points all follow zero, has a schedule."""
    bounds = [(target, source, -weight) for (source, target), weight in edges.items()]
    return has_schedule(points, [*bounds, *((ZERO, other, 0) for other in points)])


def lengths(stnu):
    """Edges of the distance graph as {(source, target): weight}, without cased ones, and the contingent links."""
    edges = {}
    for link in stnu.links:
        if not link.is_contingent or link.lower == link.upper:
            bound(edges, link.source, link.target, link.lower, link.upper)
    return edges, [link for link in stnu.contingents if link.lower != link.upper]


def weak_by_corners(stnu):
    """Weak controllability: the lengths that leave a schedule are a convex set, so corners decide."""
    edges, links = lengths(stnu)

    def is_consistent(corner):
        chosen = dict(edges)
        for link, length in zip(links, corner, strict=True):
            bound(chosen, link.source, link.target, length, length)
        return consistent(stnu.points, chosen)

    return all(map(is_consistent, product(*((link.lower, link.upper) for link in links))))


def dynamic_by_reductions(stnu):
    """Dynamic controllability by all reductions of Morris and Muscettola (2005), applied until nothing changes.

    With reaction at the moment of an observation: lower-case and cross-case reductions need a negative edge. After
    every round, the graph without lower-case edges has to be consistent.
    """
    ordinary, links = lengths(stnu)
    edges = {(*ends, None): weight for ends, weight in ordinary.items()}
    edges |= {(link.target, link.source, link): -link.upper for link in links}

    def put(source, target, label, weight):
        edges[source, target, label] = min(weight, edges.get((source, target, label), weight))

    while True:
        graph, before = {}, dict(edges)
        for (source, target, _), weight in edges.items():
            bound(graph, source, target, None, weight)
        if not consistent(stnu.points, graph):
            return False
        for (middle, target, label), weight in before.items():
            into = [
                (source, least) for (source, other, case), least in edges.items() if (other, case) == (middle, None)
            ]
            if weight < 0:  # of the lower case and across cases
                into += [(link.source, link.lower) for link in links if link.target == middle and link != label]
            for source, least in into:
                put(source, target, label, least + weight)
            if label is not None and weight >= -label.lower:
                put(middle, target, None, weight)  # the label goes
        if edges == before:
            return True


def dynamic_by_game(stnu, horizon):
    """Dynamic controllability of a network with integer bounds, by playing the game in integer time up to a horizon.

    At each moment nature says which contingent links end, then the dispatcher executes some time points, round after
    round until neither moves; then a unit of time passes. Requirements are checked as soon as both ends have happened.
    """
    order = {p: i for i, p in enumerate(stnu.points)}
    links = [(order[link.source], order[link.target], link.lower, link.upper) for link in stnu.contingents]
    executable, required = [order[p] for p in stnu.executable], [link for link in stnu.links if not link.is_contingent]
    most = [(order[r.source], order[r.target], r.upper) for r in required if r.upper is not None]  # t_b - t_a <= most
    most += [(order[r.target], order[r.source], -r.lower) for r in required if r.lower is not None]

    def fine(times, now):
        """What has not happened happens now or later."""
        known = [bound for bound in most if times[bound[0]] is not None]
        return all((now if times[b] is None else times[b]) - times[a] <= weight for a, b, weight in known)

    def moved(times, chosen, now):
        return tuple(now if i in chosen else time for i, time in enumerate(times))

    def subsets(items):
        return chain.from_iterable(combinations(items, size) for size in range(len(items) + 1))

    @cache
    def nature(times, now, asked):
        """Whether the dispatcher wins; `asked` are ends that nature has decided not to let happen now."""
        if not fine(times, now) or None not in times or now > horizon:
            return fine(times, now) and None not in times
        possible = [
            (end, now - times[begin] == upper)
            for begin, end, lower, upper in links
            if times[end] is None and times[begin] is not None and end not in asked and now - times[begin] >= lower
        ]
        may, must = ([end for end, forced in possible if forced is which] for which in (False, True))
        return all(
            dispatcher(moved(times, (*must, *some), now), now, asked | (frozenset(may) - frozenset(some)))
            for some in subsets(may)
        )

    @cache
    def dispatcher(times, now, asked):
        if fine(times, now) and (None not in times or nature(times, now + 1, frozenset())):
            return True
        chosen = filter(None, subsets([p for p in executable if times[p] is None]))
        return any(nature(moved(times, some, now), now, asked) for some in chosen)

    return nature(tuple(0 if p == ZERO else None for p in stnu.points), 0, frozenset())
