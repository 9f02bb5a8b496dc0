"""Risk of networks in which some contingent lengths are random, and of others only an interval is known."""

from fractions import Fraction
from itertools import product
from random import Random

import pytest

from robust import UnsupportedError, stnu
from robust.errors import Location
from robust.probability.distributions import parse_distribution
from robust.stnu.chances import OPEN
from robust.stnu.network import Link, Network
from tests.cli.running import command
from tests.sampling import often

NODES = ("Z", "A", "B", "C")
ENDS = (("Z", "A"), ("A", "B"), ("B", "C"))


def uniform(low, high):
    return parse_distribution(f"uniform:{low}:{high}", None, Location("test"))


def random_network(random, kinds):
    """A chain of contingent links, random, in an interval, or of one length, and requirements across it."""
    links = []
    for (source, target), kind in zip(ENDS, kinds, strict=True):
        low = random.randint(1, 4)
        high = low if kind == "fixed" else low + random.randint(1, 4)
        known = uniform(low, high) if kind == "random" else None
        links.append(Link(source, target, Fraction(low), Fraction(high), is_contingent=True, distribution=known))
    for source, target in (("Z", "C"), ("A", "C"), ("Z", "B")):
        if random.random() < 0.7:
            low = random.randint(0, 6)
            links.append(Link(source, target, Fraction(low), Fraction(low + random.randint(2, 10))))
    return Network("chain", NODES, tuple(links), "Z")


def share_of_draws(network, random, draws):
    """How many drawn lengths suit all corners of the intervals; times follow from the lengths, as all of a chain do."""
    chain = [next(link for link in network.links if link.is_contingent and link.target == end) for _, end in ENDS]
    rules = [link for link in network.links if not link.is_contingent]
    count = 0
    for _ in range(draws):
        drawn = []
        for link in chain:
            place = Fraction(random.random())
            width = link.upper - link.lower
            drawn.append([link.lower, link.upper] if link.distribution is None else [link.lower + place * width])
        count += all(
            all(rule.lower <= times[rule.target] - times[rule.source] <= rule.upper for rule in rules)
            for lengths in product(*drawn)
            for times in [dict(zip(NODES, (sum(lengths[:number], Fraction(0)) for number in range(4)), strict=True))]
        )
    return Fraction(count, draws)


def test_the_worst_length_counts():
    middle = 0
    for seed in often(range(4), range(100, 160)):
        random = Random(seed)  # noqa: S311
        kinds = random.sample(["random", "interval", random.choice(["random", "fixed", "interval"])], 3)
        network = random_network(random, kinds)
        found = stnu.risk(network, within=Fraction(1, 50))
        share = share_of_draws(network, random, 400)
        assert found.probability.lower - Fraction(1, 10) < share < found.probability.upper + Fraction(1, 10), seed
        assert found.probabilities is None or "interval" not in kinds
        middle += 0 < share < 1
    assert middle


def test_what_is_not_random_is_named(tmp_path):
    file = tmp_path / "one.cctp"
    interval = Network("x", NODES, (Link("Z", "A", Fraction(1), Fraction(2), is_contingent=True),), "Z")
    with pytest.raises(UnsupportedError, match="found no random length"):
        stnu.risk(interval)
    many = [Link("Z", f"N{number}", Fraction(1), Fraction(2), is_contingent=True) for number in range(OPEN + 1)]
    random = Link("Z", "A", Fraction(1), Fraction(2), is_contingent=True, distribution=uniform(1, 2))
    nodes = ("Z", "A", *(link.target for link in many))
    with pytest.raises(UnsupportedError, match=f"found {OPEN + 1} contingent links without distributions, like"):
        stnu.risk(Network("x", nodes, (random, *many), "Z"))
    for text, found in (("", "an empty file"), (" \n\n", "only blank lines"), ("# a\n\n# b\n", "only comments")):
        file.write_text(text, encoding="utf-8")
        for word in ("check", "risk", "dispatch", "repair"):
            ended = command("stnu", word, file)
            assert (ended.code, f"found {found}, expected a network" in ended.err) == (2, True), (word, ended.err)
