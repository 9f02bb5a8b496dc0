"""Random networks as files hold them, and slow ways to judge them that share no code with the package."""

from fractions import Fraction
from itertools import product

from robust.stnu import Link, Network


def network(*links, origin=None):
    """Of (source, target, lower, upper), and a fifth item for a contingent link; None is infinite."""
    made = []
    for source, target, lower, upper, *contingent in links:
        low, high = (None if bound is None else Fraction(bound) for bound in (lower, upper))
        made.append(Link(source, target, low, high, bool(contingent)))
    nodes = dict.fromkeys(name for link in made for name in (link.source, link.target))
    return Network("test", tuple(nodes), tuple(made), origin)


def random_network(rng, executable=3, contingents=2, requirements=5, size=5, *, negative=True, chained=True):
    """The links of a random network with integer bounds; a contingent link may end before it starts."""
    names = [f"x{i}" for i in range(executable)]
    ends = [f"c{i}" for i in range(contingents)]
    links = []
    for number, end in enumerate(ends):
        low = rng.randint(-size // 2 if negative and rng.random() < 0.4 else 0, size)
        links.append(
            (
                rng.choice([*names, *(ends[:number] if chained else [])]),
                end,
                low,
                low + rng.randint(0, size),
                "contingent",
            )
        )
    for _ in range(requirements):
        source, target = rng.sample([*names, *ends], 2)
        low = rng.choice([None, rng.randint(-size, size)])
        high = None if low is not None and rng.random() < 0.4 else (low or 0) + rng.randint(0, size)
        links.append((source, target, low, high))
    return links


def explicit(links):
    """The same with the decision of the source of a contingent link that may end before it starts."""
    requirements, contingents = [], []
    for source, target, low, high, *contingent in links:
        if not contingent:
            requirements.append((source, target, low, high))
        elif low < 0:
            decision = f"commit({source},{target})"
            requirements.append((decision, source, -low, -low))
            contingents.append((decision, target, 0, high - low))
        else:
            contingents.append((source, target, low, high))
    return requirements, contingents


def corners(lengths):
    """Each combination of least and greatest lengths of contingent links, by their ends."""
    for chosen in product(*lengths.values()):
        yield dict(zip(lengths, chosen, strict=True))
