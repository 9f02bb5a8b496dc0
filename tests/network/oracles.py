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

    def number(bound):
        return None if bound is None else Fraction(bound)

    links = [UncertainLink(places[a], places[b], number(low), number(high)) for a, b, low, high in requirements]
    links += [UncertainLink(ZERO, places[name], Fraction(0), None) for name in names]
    links += [
        UncertainLink(places[a], places[c], number(low), number(high), True, c) for a, c, low, high in contingents
    ]
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


def bound(edges, source, target, lower, upper):
    """Add lower <= target - source <= upper to the edges of a distance graph."""
    for key, weight in (((source, target), upper), ((target, source), None if lower is None else -lower)):
        if weight is not None:
            edges[key] = min(weight, edges.get(key, weight))


def consistent(points, edges):
    """Whether a simple temporal network has a schedule: from zero on, all times are raised as far as edges demand."""
    times = dict.fromkeys(points, Fraction(0))
    for _ in range(len(points) + 1):
        before = dict(times)
        for (source, target), weight in edges.items():
            times[source] = max(times[source], times[target] - weight)  # target - source <= weight
        if times[ZERO] > 0 or times == before:
            break
    return times[ZERO] <= 0 and times == before


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
    for corner in product(*((link.lower, link.upper) for link in links)):
        chosen = dict(edges)
        for link, length in zip(links, corner, strict=True):
            bound(chosen, link.source, link.target, length, length)
        if not consistent(stnu.points, chosen):
            return False
    return True


def dynamic_by_reductions(stnu):
    """Dynamic controllability by all reductions of Morris and Muscettola (2005), applied until nothing changes.

    With reaction at the moment of an observation: lower-case and cross-case reductions need a negative edge. After
    every round, the graph without lower-case edges has to be consistent.
    """
    ordinary, links = lengths(stnu)
    upper = {(link.target, link.source, link): -link.upper for link in links}
    for _ in range(10_000):
        edges = dict(ordinary)
        for (source, target, _), weight in upper.items():
            bound(edges, source, target, None, weight)
        if not consistent(stnu.points, edges):
            return False
        if not _reduce(ordinary, upper, links):
            return True
    raise AssertionError("no fixpoint")


def _reduce(ordinary, upper, links):
    changed = False

    def put(table, key, weight):
        nonlocal changed
        if key not in table or weight < table[key]:
            table[key] = weight
            changed = True

    for (middle, target), weight in list(ordinary.items()):
        for (source, other), first in list(ordinary.items()):
            if other == middle:
                put(ordinary, (source, target), first + weight)  # no case
        for link in links:
            if link.target == middle and weight < 0:
                put(ordinary, (link.source, target), link.lower + weight)  # lower case
    for (middle, target, link), weight in list(upper.items()):
        for (source, other), first in list(ordinary.items()):
            if other == middle:
                put(upper, (source, target, link), first + weight)  # upper case
        for other in links:
            if other.target == middle and other != link and weight < 0:
                put(upper, (other.source, target, link), other.lower + weight)  # cross case
    for (source, target, link), weight in list(upper.items()):
        if weight >= -link.lower:
            put(ordinary, (source, target), weight)  # label removal
    return changed


def dynamic_by_game(stnu, horizon):
    """Dynamic controllability of a network with integer bounds, by playing the game in integer time up to a horizon.

    At each moment nature says which contingent links end, then the dispatcher executes some time points, round after
    round until neither moves; then a unit of time passes. Requirements are checked as soon as both ends have happened.
    """
    links = stnu.contingents
    ends = {link.target: link for link in links}
    requirements = [link for link in stnu.links if not link.is_contingent]
    order = {p: i for i, p in enumerate(stnu.points)}

    def fine(times, now):
        for link in requirements:
            source, target = times[order[link.source]], times[order[link.target]]
            if source is not None and target is not None:
                if link.lower is not None and target - source < link.lower:
                    return False
                if link.upper is not None and target - source > link.upper:
                    return False
            late = source is not None and target is None and link.upper is not None and now > source + link.upper
            if late or (target is not None and source is None and link.lower is not None and now > target - link.lower):
                return False
        return True

    def with_(times, chosen, now):
        changed = list(times)
        for p in chosen:
            changed[order[p]] = now
        return tuple(changed)

    def subsets(items):
        items = list(items)
        return chain.from_iterable(combinations(items, size) for size in range(len(items) + 1))

    @cache
    def nature(times, now, asked):
        """Whether the dispatcher wins; `asked` are ends that nature has decided not to let happen now."""
        if not fine(times, now):
            return False
        if all(time is not None for time in times):
            return True
        if now > horizon:
            return False
        may, must = [], []
        for end, link in ends.items():
            begun = times[order[link.source]]
            if times[order[end]] is None and begun is not None and end not in asked and now - begun >= link.lower:
                (must if now - begun == link.upper else may).append(end)
        return all(
            dispatcher(with_(times, (*must, *some), now), now, asked | (frozenset(may) - frozenset(some)))
            for some in subsets(may)
        )

    @cache
    def dispatcher(times, now, asked):
        ready = [p for p in stnu.points if p not in ends and times[order[p]] is None]
        for some in subsets(ready):
            if some:
                won = nature(with_(times, some, now), now, asked)
            elif all(t is not None for t in times):
                won = fine(times, now)
            else:
                won = fine(times, now) and nature(times, now + 1, frozenset())
            if won:
                return True
        return False

    start = tuple(0 if p == ZERO else None for p in stnu.points)
    return nature(start, 0, frozenset())


def longest_paths(points, edges, source):
    """Bellman and Ford: the longest paths from a time point to all that it reaches."""
    longest = {source: Fraction(0)}
    for _ in points:
        for one, other, weight in edges:
            if one in longest:
                longest[other] = max(longest[one] + weight, longest.get(other, longest[one] + weight))
    return longest
