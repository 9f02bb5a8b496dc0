"""Networks of other groups: each format says what it says, and verdicts are those of games in whole numbers."""

import json
from collections import Counter
from dataclasses import replace
from fractions import Fraction
from random import Random
from statistics import NormalDist

import pytest

from robust import InputError, InputWarning, UnsupportedError, pike, stnu
from robust.pike_bridge.conditional import plan_of_network
from robust.pike_bridge.game.controllability import DecidingControllability
from robust.pike_bridge.game.deciding import ControllabilityVerdict
from robust.stnu.files import read
from robust.stnu.network import with_quantile
from tests.cli.running import command
from tests.network import oracles
from tests.sampling import often
from tests.stnu.foreign import FORMATS, WholeNumbers, cctp_constraint, graphml_of, random_conditional, rooted, written
from tests.stnu.networks import explicit


def read_text(tmp_path, text, name="network"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return read(path)


def test_verdicts_are_those_of_reductions(tmp_path):
    """The rules of Morris and Muscettola (2005) on the network that was written, which share no code with readers."""
    seen = Counter()
    for seed in often(range(72), range(1000, 1900)):
        rng = Random(seed)  # noqa: S311
        links = rooted(rng, 3, 2, 3, 5)
        form = FORMATS[seed % len(FORMATS)]
        found = read_text(tmp_path, written(form, links, rng))
        expected = oracles.dynamic_by_reductions(oracles.network(*explicit(links)))
        assert stnu.check(found).is_controllable is expected, (seed, form, links)
        seen[form, expected] += 1
    assert len(seen) == 2 * len(FORMATS), seen


def test_verdicts_about_observations_are_those_of_games(tmp_path):
    seen = Counter()
    for seed in often(range(20), range(1000, 1150)):
        rng = Random(seed)  # noqa: S311
        nodes, links, observed, horizon = random_conditional(rng)
        found = read_text(tmp_path, graphml_of(nodes, links, observed, rng))
        verdict = DecidingControllability(plan_of_network(found)).run().verdict
        assert verdict is not ControllabilityVerdict.UNKNOWN
        expected = WholeNumbers(nodes, links, observed, horizon).controllable()
        assert (verdict is ControllabilityVerdict.CONTROLLABLE) is expected, seed
        seen[expected] += 1
    assert min(seen[True], seen[False]) > seen.total() // 6, seen


def test_decisions_are_the_executives(tmp_path):
    """A problem with decision variables is controllable if the network of some of their values is."""
    seen = Counter()
    for seed in often(range(1000, 1012), range(1000, 1060)):
        rng = Random(seed)  # noqa: S311
        links = [link for link in rooted(rng, 3, 1, 6, 4) if not link[4:] or link[2] >= 0]
        guards = [None if rng.random() < (0.7 if link[4:] else 0.4) else rng.choice(["a", "b"]) for link in links]
        names = {name: name for name in dict.fromkeys(name for link in links for name in link[:2])}
        events = "".join(f"<EVENT><ID>{name}</ID></EVENT>" for name in names)
        variable = "<DECISION-VARIABLE><ID>v1</ID><NAME>way</NAME>{}</DECISION-VARIABLE>".format(
            "".join(f"<VALUE><VALUE-NAME>{value}</VALUE-NAME><UTILITY>1</UTILITY></VALUE>" for value in "ab")
        )
        written_guard = "<GUARD><VARIABLE>way</VARIABLE><VALUE>{}</VALUE></GUARD>"
        parts = [
            cctp_constraint(names, link, written_guard.format(guard) if guard else "")
            for link, guard in zip(links, guards, strict=True)
        ]
        start = "<START-EVENT>Z</START-EVENT>" if "Z" in names else ""
        found = read_text(tmp_path, f"<CCTP>{start}{events}{variable}{''.join(parts)}</CCTP>")
        expected = any(
            oracles.dynamic_by_reductions(
                oracles.network(
                    *explicit([x for x, guard in zip(links, guards, strict=True) if guard in {None, value}])
                )
            )
            for value in "ab"
        )
        verdict = DecidingControllability(plan_of_network(found)).run().verdict
        assert (verdict is ControllabilityVerdict.CONTROLLABLE) is expected, seed
        seen[expected] += 1
    assert min(seen[True], seen[False]) > 0, seen


# -- what formats say --------------------------------------------------------------------------------------------------

SOME = Random(0)  # noqa: S311
DREAM = """{"num_agents": 2, "nodes": [{"node_id": 1, "owner_id": 0, "colour": "red"}, {"node_id": 2, "owner_id": 1}],
"constraints": [
 {"first_node": 0, "second_node": 1, "type": "stc", "min_duration": 0, "max_duration": Infinity, "weight": 1},
 {"first_node": 1, "second_node": 2, "type": "pstc", "min_duration": 0, "max_duration": Infinity,
  "distribution": {"name": "N_10_2", "type": "Empirical"}},
 {"first_node": 0, "second_node": 2, "type": "stc", "min_duration": -Infinity, "max_duration": 15, "weight": 1}]}"""


def test_random_lengths_by_their_quantiles_and_probabilities(tmp_path):
    passed = "passed over what has no meaning for networks: 'colour' of nodes, 'weight' of constraints$"
    with pytest.warns(InputWarning, match=passed) as caught:
        found = read_text(tmp_path, DREAM)
    assert len(caught) == 1
    assert (found.nodes, found.origin) == (("0", "1", "2"), "0")
    assert stnu.check(found).reason == "1 => 2 is unbounded cannot be met with 0 -> 1 in [0, inf]; 0 -> 2 in [-inf, 15]"
    for quantile in (Fraction(1, 1000), Fraction(1, 20), Fraction(49, 100)):
        (link,) = stnu.with_quantile(found, quantile).contingents
        law = NormalDist(10, 2)
        assert -1e-9 < float(quantile) - law.cdf(float(link.lower)) < 1e-5
        assert -1e-9 < float(quantile) - (1 - law.cdf(float(link.upper))) < 1e-5
        assert stnu.check(stnu.with_quantile(found, quantile)).is_controllable is (link.upper <= 15)
    with pytest.raises(InputError, match=r"^quantile: found 1/2, expected a quantile of at least 0 and below 1/2$"):
        stnu.with_quantile(found, Fraction(1, 2))
    success = stnu.risk(found).probability
    assert success.lower - Fraction(1, 10**12) <= NormalDist().cdf(2.5) <= success.upper + Fraction(1, 10**12)
    assert success.upper - success.lower <= Fraction(1, 1000)
    bounded = replace(found, links=tuple(replace(link, distribution=None) for link in found.links))
    with pytest.raises(UnsupportedError, match=r"found contingent link 1 => 2 in \[0, inf\] without a distribution"):
        stnu.risk(bounded)


@pytest.mark.parametrize(
    ("distribution", "kind"),
    [
        ({"mean": 10, "sd": 2}, "normal"),
        ({"type": "gaussian", "mu": 10, "variance": "4"}, "normal"),
        ({"type": "Gaussian", "loc": 10, "std_dev": 2}, "normal"),
        ({"type": "Uniform", "lb": 10, "ub": 12}, "uniform"),
        ({"name": "uniform", "a": 10, "b": 12}, "uniform"),
        ("U_10_12", "uniform"),
    ],
)
def test_spellings_of_distributions(distribution, kind, tmp_path):
    points = [{"id": 7, "label": "a", "controllable": True}, {"id": 8, "label": "b", "controllable": False}]
    link = {"source": 7, "sink": 8, "label": "ab", "distribution": distribution, "type": "pstc"}
    (found,) = read_text(tmp_path, json.dumps({"name": "n", "timepoints": points, "constraints": [link]})).links
    assert found.is_contingent
    assert found.distribution.kind == kind
    assert list(found.distribution.numbers.values())[:2] == ([10, 2] if kind == "normal" else [10, 12])


def test_ends_that_are_infinite_and_domains_alone(tmp_path):
    greatest = "1.7976931348623157e+308"
    java = greatest.replace("e+", "E")
    ends = [
        ('"-inf"', '"inf"'),
        ("-Infinity", "Infinity"),
        ("null", "null"),
        (f"-{greatest}", greatest),
        (f"-{java}", java),
    ]
    for low, high in ends:
        first = f'{{"node_id": 1, "min_domain": {low}, "max_domain": 9}}'
        second = f'{{"node_id": 2, "min_domain": 3, "max_domain": {high}}}'
        found = read_text(tmp_path, f'{{"nodes": [{first}, {second}], "constraints": []}}')
        assert [(link.target, link.lower, link.upper) for link in found.links] == [("1", None, 9), ("2", 3, None)]
        assert found.origin == "0"


@pytest.mark.parametrize("form", ["json", "cctp"])
def test_a_normal_length_without_deviation_is_one_length(form, tmp_path):
    link = {"first_node": 1, "second_node": 2, "type": "pstc", "distribution": {"mean": 10, "sd": 0}}
    text = json.dumps({"nodes": [1, 2], "constraints": [link]})
    if form == "cctp":
        numbers = (
            "<LOWERBOUND>10</LOWERBOUND><UPPERBOUND>1.7976931348623157E308</UPPERBOUND><MEAN>10</MEAN><VAR>0</VAR>"
        )
        kind = "<TYPE>Uncontrollable;Probabilistic</TYPE>"
        ends = "<EVENT><ID>1</ID></EVENT><EVENT><ID>2</ID></EVENT>"
        text = f"<CCTP>{ends}<CONSTRAINT><START>1</START><END>2</END>{numbers}{kind}</CONSTRAINT></CCTP>"
    network = read_text(tmp_path, text)
    assert (network.links[0].lower, network.links[0].upper) == (10, 10 if form == "json" else None)
    (narrow,) = with_quantile(network, Fraction(1, 100)).links
    assert (narrow.lower, narrow.upper) == (10, 10)
    assert stnu.risk(network).probability.lower == 1
    with pytest.raises(InputError, match=r"found (variance|deviation) -1, expected at least 0"):
        read_text(tmp_path, text.replace('"sd": 0', '"sd": -1').replace("<VAR>0<", "<VAR>-1<"))


def test_a_contingent_link_of_some_choices_between_events_of_all(tmp_path):
    """As problems of this kind are usually written: another way for each choice, between the same events."""
    guard = "<GUARD><GUARD-VARIABLE>way</GUARD-VARIABLE><GUARD-VALUE>{}</GUARD-VALUE></GUARD>"
    events = "".join(f"<EVENT><ID>{number}</ID></EVENT>" for number in (1, 2))
    variable = "<DECISION-VARIABLE><NAME>way</NAME><VALUE>car</VALUE><VALUE>walk</VALUE></DECISION-VARIABLE>"
    names = {"1": "1", "2": "2"}
    ways = [
        cctp_constraint(names, ("1", "2", 10, high, "ctg"), guard.format(way))
        for high, way in ((40, "car"), (20, "walk"))
    ]
    path = tmp_path / "n.cctp"
    for most, verdict in ((30, "controllable"), (15, "uncontrollable")):
        limit = cctp_constraint(names, ("1", "2", 0, most), "")
        path.write_text(f"<CCTP>{events}{variable}{''.join(ways)}{limit}</CCTP>", encoding="utf-8")
        done = command("stnu", "check", path)
        assert (done.code, done.out.partition(":")[0]) == (int(verdict != "controllable"), verdict)


def test_observations_in_either_command(tmp_path):
    """X is at most 5 if p is true, and at least 8 if not: p has to be observed by 5."""
    label = {"p": True}
    for moment, controllable in ((5, True), (6, False)):
        links = [(("Z", "X", None, 5), label), (("Z", "X", 8, 10), {"p": False}), (("Z", "P", moment, None), {})]
        path = tmp_path / ("served.cstn" if controllable else "n.cstn")
        path.write_text(graphml_of({"Z": {}, "P": {}, "X": {}}, links, {"p": "P"}, SOME), encoding="utf-8")
        assert (pike.controllable(path).verdict is ControllabilityVerdict.CONTROLLABLE) is controllable
        done = command("stnu", "check", path)
        assert (done.code, done.out.startswith("controllable")) == (int(not controllable), controllable)
    both = "uncontrollable: no strategy serves all of these, whose differences are not seen in time: with p = "
    assert done.out.startswith(both)
    for words in ("stnu dispatch", "stnu repair", "stnu risk"):
        done = command(*words.split(), path)
        assert done.code == 4
        assert "choices or observations (p), expected an STNU; robust stnu check" in done.err
    assert "succeeded at " in command("pike", "run", "--strategy", path.with_name("served.cstn")).out
    assert command("pike", "chance", path.with_name("served.cstn")).out.startswith("Success is 100.00% likely.")


WRONG = {
    "kind": ("STPU\n3\n", "^n:1: found 'STPU', expected a network as GraphML, CCTP, JSON, or text that begins with"),
    "nothing": ("# nothing\n", "^n:1: found only comments, expected a network"),
    "fewer edges": ("STN\n2\n2\nA B\nA 5 B\n", "^n:3: found 1 edge, expected 2 as the file says$"),
    "no edge": ("STN\nA B\nA five B\n", "^n:3: found 'A five B', expected A NUMBER B for an edge, or"),
    "unknown name": ("STN\nA B\nA 5 C\n", "^n:3: found unknown time point 'C', expected one of the names$"),
    "name twice": ("STN\nA A\n", "^n:2: found a second time point 'A', expected one$"),
    "too many names": (
        "STNU\n5\n2\n1\nA B C D\nA 5 B\n",
        "^n:6: found .* 'A', expected one; line 2 says 5 time points$",
    ),
    "no lists": ("{}", "^n:1:1: found no 'nodes', expected lists 'nodes' and 'constraints'$"),
    "no root": ("<svg/>", "^n:1:1: found no graph, expected GraphML with one$"),
    "broken": ("<CCTP>\n<EVENT>", "^n:2:8: found broken XML .*, expected GraphML or CCTP$"),
    "a list": ("\ufeff[1,\r\n2]", "^n:1:1: found a list, expected an object$"),
    "no constraint": ("<CCTP><EVENT><ID>1</ID></EVENT></CCTP>", "^n:1:1: found no constraints, expected a network"),
    "unknown event": (
        "<CCTP><EVENT><ID>1</ID></EVENT>\n<CONSTRAINT><START>1</START><END>2</END></CONSTRAINT></CCTP>",
        "^n:2:.*: found unknown event '2', expected one of the events",
    ),
    "unknown variable": (
        "<CCTP><EVENT><ID>1</ID></EVENT>\n<CONSTRAINT><START>1</START><END>1</END><UPPERBOUND>3</UPPERBOUND>"
        "<GUARD><VARIABLE>way</VARIABLE><VALUE>a</VALUE></GUARD></CONSTRAINT></CCTP>",
        "^n:2:.*: found unknown variable 'way', expected a declared one",
    ),
    "unknown distribution": (
        DREAM.replace("N_10_2", "gamma_3"),
        r"^n:5:.*: found distribution 'gamma_3', expected a normal one \(N_MEAN_DEVIATION, or mean and sd\) or",
    ),
    "node of its own": (DREAM.replace('"second_node": 2', '"second_node": 3'), "^n:4:.*: found unknown node '3'"),
    "observed twice": (
        graphml_of({"A": {}, "B": {}}, [(("A", "B", 0, 1), {})], {"p": "A", "q": "B"}, SOME).replace(">q<", ">p<"),
        "^n:.*: found 'p' observed at A and at B, expected one observation$",
    ),
    "unobserved": (
        graphml_of({"A": {}, "B": {}}, [(("A", "B", 0, 1), {"q": True})], {"p": "A"}, SOME),
        "^n:.*: found label 'q', expected propositions that are observed",
    ),
}


@pytest.mark.filterwarnings("ignore::robust.InputWarning")
@pytest.mark.parametrize(("text", "says"), WRONG.values(), ids=WRONG)
def test_what_is_wrong(text, says, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "n").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=says) as caught:
        read("n")
    assert "\n" not in str(caught.value)
