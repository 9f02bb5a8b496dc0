"""Random networks as files hold them, and slow ways to judge them that share no code with the package."""

from contextlib import suppress
from fractions import Fraction
from itertools import product
from random import Random

import pytest

from robust.errors import InputError
from robust.stnu import Link, Network
from tests.network import oracles


def network(*links, origin=None):
    """Of (source, target, lower, upper), and a fifth item for a contingent link; None is infinite."""
    made = []
    for source, target, lower, upper, *contingent in links:
        low, high = (None if bound is None else Fraction(bound) for bound in (lower, upper))
        made.append(Link(source, target, low, high, bool(contingent)))
    nodes = dict.fromkeys(name for link in made for name in (link.source, link.target))
    return Network("test", tuple(nodes), tuple(made), origin)


def random_network(rng, executable=3, contingents=2, requirements=5, size=5):
    """The links of a random network with integer bounds; a contingent link may end before it starts."""
    names = [f"x{i}" for i in range(executable)]
    ends = [f"c{i}" for i in range(contingents)]
    links = []
    for number, end in enumerate(ends):
        low = rng.randint(-size // 2 if rng.random() < 0.4 else 0, size)
        source = rng.choice([*names, *ends[:number]])
        links.append((source, end, low, low + rng.randint(0, size), "contingent"))
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


def drawn(seeds, *shape):
    """Random networks that do not contradict themselves, with their seeds and the generators that go on."""
    for seed in seeds:
        rng = Random(seed)  # noqa: S311
        with suppress(InputError):
            yield seed, rng, network(*random_network(rng, *shape))


def dynamic_by_reductions(found):
    """Whether a network is controllable by the rules of the literature."""
    links = [(x.source, x.target, x.lower, x.upper, *(["contingent"] if x.is_contingent else [])) for x in found.links]
    return oracles.dynamic_by_reductions(oracles.network(*explicit(links)))


def short_and_long(short, long):
    """Seeds for all runs and for slow ones, each with how many networks there are at least."""
    values = [(range(short[0]), *short[1:]), pytest.param(range(1000, long[0]), *long[1:], marks=pytest.mark.slow)]
    return pytest.mark.parametrize(("seeds", "least"), values, ids=["short", "long"])


def corners(lengths):
    """Each combination of least and greatest lengths of contingent links, by their ends."""
    for chosen in product(*lengths.values()):
        yield dict(zip(lengths, chosen, strict=True))
