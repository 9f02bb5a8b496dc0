"""Every sentence of a comparison's page, held against checks of the very point about which it is said.

The script of the page runs in node (`page.js` is as much of a browser as it needs); points are on, just inside and just
outside of faces, and so are the plan's own values.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections import Counter
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from random import Random

import pytest
from hypothesis import HealthCheck, given, settings

from robust.api import check, compare
from robust.draw.interactive import comparison_data, part
from robust.errors import InputError, UnsupportedError
from robust.irr.check import Answer
from robust.numbers import format_number
from robust.qe.compute import Breaks, what_breaks
from robust.qe.constraint import LinearConstraint, Sense
from robust.reading import load_plan
from robust.show.regions import METHOD_NAMES
from robust.show.text import Words
from tests.cli import inputs
from tests.cli.running import EXAMPLES, example
from tests.draw.test_interactive import earliest, node
from tests.strategies import plans

TINY = Fraction(1, 10**6)
WEB = Path(__file__).parents[2] / "robust" / "draw" / "web"

VERDICTS = {
    "✓ Valid: every schedule that the plan allows works",
    "✗ Not valid: the plan can fail",
    "? Not known",
    " (at the plan’s values)",
    "Outside the declared bounds:",
    "There is no schedule: these cannot all hold, nor begin before time 0.",
    "Breaks first:",
    "It breaks at the plan’s own values already.",
    "At the plan’s own values it holds; in this direction it breaks with any change.",
    "Nothing else that breaks here breaks earlier on the straight way from the plan’s values: it breaks at",
    "Nothing else that breaks here breaks earlier on the straight way from the plan’s values: it breaks just beyond",
    "Can break as well:",
    "Can break:",
    "Not all obligations were examined; others may break, too.",
    "Some schedule of the plan breaks an obligation; which one was not found out.",
    "In none of the boxes; the exact envelope is not in this page.",
    "In the box of:",
    "There is none at these values.",
    "The earliest of the schedules that the network allows; it need not be the one that fails.",
    "The earliest of the schedules that the network allows.",
    "Slice at",
    " (not in this slice)",
    " (the same as",
    "valid: the exact envelope",
    "not valid",
    "valid: in a box",
    "not known",
}
"""What the page can say of a point; each has its oracle in :class:`Reader`."""
OTHER = {
    "use strict",
    "exact value of {}",
    "Expected a number such as 5, -0.25, 1e-3 or 1/3; still at {}.",
    "at least {}",
    "at most {}",
    "{} is declared as {}",
    " and ",
    "In the box of: {}.",
    "no method",
    "Nothing else that breaks here breaks earlier on the straight way from the plan’s values:",
    "it breaks just beyond",
    "it breaks at",
    "{} {} {}.",
    "Slice at {}.",
    " (the same as {})",
    " (across) and {} (up)",
    "bar varies",
    "box box-{}",
    "at {}",
    "{}; the point is at {}. A click moves it; so do the sliders.",
    "the plan’s values",
    "the values above",
    "{} to {}",
}
"""Parts of those, and what is no verdict."""


def said_by_the_page(data, points):
    """What a page of these data says at each point."""
    if shutil.which("node") is None:
        pytest.skip("no node on this machine, which runs the page")
    code = f"""
    const page = require({json.dumps(str(Path(__file__).with_name("page.js")))});
    const Exact = require({json.dumps(str(WEB / "exact.js"))});
    const script = require("fs").readFileSync({json.dumps(str(WEB / "compare.js"))}, "utf-8");
    const given = JSON.parse(require("fs").readFileSync(0, "utf-8"));
    console.log(JSON.stringify(page(Exact, script, given.data, given.points)));
    """
    written = [[str(point[one["name"]]) for one in data["parameters"]] for point in points]
    text = json.dumps({"data": data, "points": written})
    done = subprocess.run(["node", "-e", code], input=text, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


class Oracle:
    """A plan at single points, by `robust.check`."""

    def __init__(self, plan):
        self.plan = plan
        self._known = {}

    def at(self, point):
        """Obligations that some schedule breaks; None where there is no schedule."""
        key = tuple(point[one.name] for one in self.plan.parameters)
        if key not in self._known:
            self._known[key] = self._checked(point)
        return self._known[key]

    def _checked(self, point):
        try:
            result = check(self.plan, at=point, every=True)
        except InputError:  # whatever the parameters: no schedule
            return None
        assert result.answer is not Answer.UNKNOWN
        refuted = {name for name, answer in result.obligations.items() if answer is Answer.REFUTED}
        kept = re.fullmatch(r"no schedule keeps '(.*)' with .*", result.reason or "")
        if result.reason is not None and kept is None:
            return None
        assert (result.answer is Answer.REFUTED) is bool(refuted or kept)
        return refuted | ({kept[1]} if kept else set())

    def beyond(self, point):
        return [
            one
            for one in self.plan.parameters
            if (one.lower is not None and point[one.name] < one.lower)
            or (one.upper is not None and point[one.name] > one.upper)
        ]


class Reader:
    """Reads what one page says of points, and holds each sentence against the oracle."""

    def __init__(self, plan, data, boxes, oracle, met):
        self.plan, self.data, self.boxes, self.oracle, self.met = plan, data, boxes, oracle, met
        self.names = {one["words"]: one["name"] for one in data["parameters"]}
        self.obligations = {one["words"]: one["name"] for one in data["obligations"]}

    def hear(self, text):
        assert text in VERDICTS, text
        self.met[text] += 1

    def read(self, point, answer):
        beyond = self.oracle.beyond(point)
        refuted = self.broken_at(point)
        within = [name for name, box in self.boxes.items() if point in box]
        mark, *_ = answer["mark"].split(" (at")
        self.hear(mark)
        assert answer["mark"].endswith(" (at the plan’s values)") is (point == self.plan.nominal)
        self.met[" (at the plan’s values)"] += point == self.plan.nominal
        valid = not beyond and refuted == set()
        if mark.startswith("?"):
            assert self.data["region"] is None
            assert not within
        else:
            assert mark.startswith("✓") is valid
        said = self.paragraphs(answer["reason"])
        for text, items in said:
            self.reason(point, text, items, said)
        assert any(text.startswith("In the box of:") for text, _ in said) is bool(self.boxes)
        self.chart(point, answer, said)
        self.slice(point, answer)

    def broken_at(self, point):
        """As by checks; None without any schedule, where a check may name an obligation that no schedule keeps."""
        broken = self.oracle.at(point)
        if contradictory(self.data["network"], point):
            assert broken != set()
            return None
        return broken

    @staticmethod
    def paragraphs(reason):
        """Each paragraph with the list that follows it."""
        found = []
        for name, content in reason:
            if name == "ul":
                found[-1][1].extend(content)
            else:
                found.append((content, []))
        return found

    def reason(self, point, text, items, said):
        broken = self.broken_at(point)
        match text:
            case "Outside the declared bounds:":
                self.hear(text)
                expected = []
                for one in self.oracle.beyond(point):
                    ends = (("at least", one.lower), ("at most", one.upper))
                    declared = " and ".join(f"{word} {format_number(end)}" for word, end in ends if end is not None)
                    words = next(words for words, name in self.names.items() if name == one.name)
                    expected.append(f"{words} is declared as {declared}")
                assert items == expected != []
            case "There is no schedule: these cannot all hold, nor begin before time 0.":
                self.hear(text)
                assert broken is None
                assert contradictory([one for one in self.data["network"] if one["words"] in items], point)
            case "Breaks first:" | "Can break as well:" | "Can break:":
                self.hear(text)
                names = {self.obligations[one] for one in items}
                assert names
                assert names <= broken, (point, text, names, broken)
                complete = self.data["complete"] and not any(one["demand"] for one in self.data["obligations"])
                if complete:
                    assert {self.obligations[one] for _, some in said for one in some} == broken
                assert (text == "Can break:") <= (not any(other == "Breaks first:" for other, _ in said))
            case "Not all obligations were examined; others may break, too.":
                self.hear(text)
                assert not self.data["complete"]
                assert not any(other == "Breaks first:" for other, _ in said)
            case "Some schedule of the plan breaks an obligation; which one was not found out.":
                self.hear(text)
                assert broken
                assert not self.data["complete"]
            case "In none of the boxes; the exact envelope is not in this page.":
                self.hear(text)
                assert self.data["region"] is None
                assert not any(point in box for box in self.boxes.values())
            case _ if text.startswith("In the box of: "):
                self.hear("In the box of:")
                names = text.removeprefix("In the box of: ").removesuffix(".")
                within = [METHOD_NAMES[name] for name, box in self.boxes.items() if point in box]
                assert names == (", ".join(within) or "no method")
                assert not within or broken == set()
            case _:
                self.way(point, text, dict(said))

    def way(self, point, text, said):
        """Where what breaks first does, on the way from the plan's values."""
        first = {self.obligations[one] for one in said["Breaks first:"]}
        named = first | {self.obligations[one] for one in said.get("Can break as well:", ())}
        nominal = self.plan.nominal
        kind, colon, values = text.partition(": it breaks ")
        if not colon:
            self.hear(text)
            place, open_there = nominal, text.startswith("At the plan’s own values it holds;")
        else:
            where = re.match("at|just beyond", values)[0]
            self.hear(f"{kind}: it breaks {where}")
            open_there = where == "just beyond"
            if "≈" in values:
                return
            listed = values.removeprefix(where + " ").removesuffix(".")
            place = nominal | self.values(listed)
            assert all((place[name] != nominal[name]) is (point[name] != nominal[name]) for name in nominal)
        assert not self.oracle.beyond(place)
        self.met["places"] += 1
        if open_there:
            assert not named & self.oracle.at(place)
            assert first <= self.oracle.at(between(place, point, TINY))
        else:
            assert first <= self.oracle.at(place)
        if place != nominal:
            assert not any(
                named & self.oracle.at(between(nominal, place, part)) for part in (0, Fraction(1, 2), 1 - TINY)
            )

    def values(self, text):
        """`drive a b = 45, …` by the names of parameters."""
        pairs = (one.rpartition(" = ") for one in text.split(", "))
        return {self.names[words]: as_number(value) for words, _, value in pairs}

    def chart(self, point, answer, said):
        self.hear(answer["chart"])
        times = earliest(self.plan, point)
        if times is None or times[self.plan.time_points[0]] != 0:
            assert answer["chart"] == "There is none at these values."
            assert self.broken_at(point) is None
            return
        assert answer["chart"] != "There is none at these values."
        assert ("need not" in answer["chart"]) is answer["mark"].startswith("✗")
        for one, text in zip(self.plan.instances, answer["times"], strict=True):
            written = [as_number(each) for each in text.removeprefix("at ").split(" to ")]
            expected = list(dict.fromkeys([one.start, one.end]))
            for value, moment in zip(written, expected, strict=True):
                assert abs(value - times[moment]) <= abs(times[moment]) / 10**5
        words = Words(self.plan)
        named = [self.obligations[one] for text, items in said if "reak" in text for one in items]
        assert set(answer["broken"]) == {each for name in named for each in words.concerned(name)}

    def slice(self, point, answer):
        hidden = [one["name"] for one in self.data["parameters"]][2:]
        if hidden:
            self.hear("Slice at")
            shown = self.values(answer["slice"].removeprefix("Slice at ").removesuffix("."))
            assert list(shown) == hidden
            assert all(abs(value - point[name]) <= abs(point[name]) / 10**5 for name, value in shown.items())
        first, second, *boxes, own, here = answer["legend"]
        self.hear(first)
        self.hear(second)
        assert first == ("valid: in a box" if self.data["region"] is None else "valid: the exact envelope")
        assert second == ("not known" if self.data["region"] is None else "not valid")
        assert (own, here) == ("the plan’s values", "the values above")
        for text, (name, box) in zip(boxes, self.boxes.items(), strict=True):
            begun = text.startswith(f"box: {METHOD_NAMES[name]}")
            assert begun
            twin = re.search(r" \(the same as (.*?)\)", text)
            earlier = dict(list(self.boxes.items())[: list(self.boxes).index(name)])
            assert (twin and twin[1]) == next(
                (METHOD_NAMES[one] for one, other in earlier.items() if other == box), None
            )
            self.met[" (the same as"] += twin is not None
            away = text.endswith(" (not in this slice)")
            assert away is not all(point[one] in box[one] for one in hidden)
            self.met[" (not in this slice)"] += away


def as_number(text):
    return Fraction(text.removeprefix("≈").replace("−", "-"))


def between(one, other, share):
    return {name: value + share * (other[name] - value) for name, value in one.items()}


def contradictory(statements, point):
    """Whether statements of a page's network have no common schedule from time 0 on, by plain iteration."""
    edges = []
    for one in statements:
        for bound, source, target, sign in (
            (one["lower"], one["source"], one["target"], 1),
            (one["upper"], one["target"], one["source"], -1),
        ):
            if bound is not None:
                value = Fraction(bound["constant"])
                value += sum(Fraction(factor) * point[name] for name, factor in bound["coefficients"].items())
                edges.append((source, target, sign * value))
    times = dict.fromkeys({place for source, target, _ in edges for place in (source, target)}, Fraction(0))
    for _ in range(len(times) + 1):
        before = dict(times)
        for source, target, least in edges:
            times[target] = max(times[target], times[source] + least)
    return times != before or times.get(0, 0) > 0


def faces(result, breaks, random, count):
    """Points on, just inside and just outside of faces of the region, boxes and what breaks, and further from them."""
    region = result.region.region
    pieces = [*region.pieces, *((region.base,) if region.base is not None else ())]
    pieces += [
        type(pieces[0])(region.parameters, tuple(entry.result.box.constraints()))
        for entry in result.entries
        if pieces and entry.result.verified
    ]
    pieces += [piece for one in breaks.obligations for piece in one.pieces]
    found = [(piece, one) for piece in pieces for one in piece.constraints if one.coefficients]
    seen = {}
    for piece, one in found:
        seen.setdefault((one.coefficients, one.constant), (piece, one))
    found = list(seen.values())
    for piece, one in random.sample(found, min(count, len(found))):
        closed = type(piece)(piece.parameters, tuple(each.closed() for each in piece.constraints))
        level = LinearConstraint(one.coefficients, Sense.EQUAL, one.constant)
        point = closed.restricted([level]).some_point()
        if point is None:
            continue
        for step in (-1, -TINY, 0, TINY, 1):
            yield point | {name: point[name] + step * factor for name, factor in one.coefficients}


def hunt(plan, met, *, seed=0, count=6, nominals=3, own=(), timeout=None):
    """All kinds of pages of a plan, also with its own values on and beside faces, at points there."""
    random = Random(seed)  # noqa: S311 - reproducible
    result = compare(plan, timeout=timeout)
    if result.region is None or not result.region.is_exact:
        return
    breaks = what_breaks(plan, timeout=timeout)
    oracle = Oracle(plan)
    points = [plan.nominal, *faces(result, breaks, random, count)]
    moved = [one for one in points if not oracle.beyond(one)]
    for values in [plan.nominal, *own, *random.sample(moved, min(nominals, len(moved)))]:
        there = replace(plan, parameters=tuple(replace(one, nominal=values[one.name]) for one in plan.parameters))
        pages = [(result, breaks)]
        if values == plan.nominal:
            twins = tuple(replace(one, result=result.entries[0].result) for one in result.entries)
            pages += [(result, Breaks(breaks.obligations[:-1], complete=False)), (result, None)]
            pages += [(replace(result, region=None), None), (replace(result, region=None, entries=twins), None)]
        for shown, known in pages:
            boxes = {one.method: one.result.box for one in shown.entries if one.result.verified}
            data = comparison_data(replace(shown, plan=there), known, Words(there))
            asked = [*points, values]
            said = said_by_the_page(data, asked)
            assert (said["missing"] == "") is (shown.region is not None)
            reader = Reader(there, data, boxes, oracle, met)
            for point, answer in zip(asked, said["answers"], strict=True):
                reader.read(point, answer)
                met["points"] += 1


def test_every_text_of_the_script_is_in_the_table():
    """What the page says is what the table lists: strings of more than one word."""
    source = part("compare.js")
    source = "\n".join(line for line in source.splitlines() if not line.strip().startswith(("//", "/**")))
    found = set(re.findall(r'"([^"\n`]*)"', source))
    while True:
        inner = re.sub(r"\$\{[^{}`]*\}", "{}", source)
        found |= set(re.findall(r"`([^`\n$]*)`", inner))
        flat = re.sub(r"`([^`\n$]*)`", "_", inner)
        if flat == source:
            break
        source = flat
    texts = {text for text in found if re.search(r"[a-z’?] [(a-z{]|[A-Z][a-z]+ ", text)}
    assert texts - VERDICTS - OTHER == set()


DOMAIN = """\
(define (domain trips)
  (:requirements :typing :durative-actions :fluents :duration-inequalities)
  (:types place)
  (:predicates (at ?p - place))
  (:functions (fuel))
  (:durative-action go
    :parameters (?from ?to - place)
    :duration (and (>= ?duration 2) (<= ?duration 8))
    :condition (and (at start (at ?from)) (at start (>= (fuel) 2)))
    :effect (and (at start (not (at ?from))) (at end (at ?to)) (at end (decrease (fuel) ?duration)))))
"""
PROBLEM = """\
(define (problem there_and_back)
  (:domain trips)
  (:objects a b - place)
  (:init (at a) (= (fuel) 9))
  (:goal (and (at a) (> (fuel) 0))))
"""
PLAN = """\
parameter back default 3;
parameter leave default 2 lb 0 ub 9;
parameter ride default 4;
durative-action instance g : (go a b);
durative-action instance h : (go b a);
c: g.start - .zero in [leave, leave];
c: g.end - g.start in [ride, ride];
c: h.start - g.end in [1, inf];
c: h.end - h.start in [back, back];
c: h.end - .zero in [0, 16];
"""


def test_every_sentence_is_what_checks_say(tmp_path):
    """Strict and weak obligations, demands on durations, declared bounds and a deadline, whose faces are met."""
    met: Counter[str] = Counter()
    broken = {"back": Fraction(3), "leave": Fraction(2), "ride": Fraction(7)}
    hunt(load_plan(*inputs.write(tmp_path, DOMAIN, PROBLEM, PLAN).files), met, seed=3, count=9, own=[broken])
    assert met["places"] > 10
    assert VERDICTS - set(+met) == set()


def test_contradictions_of_random_networks_are_contradictions():
    random = Random(7)  # noqa: S311 - reproducible

    def bound(chance):
        return {"constant": str(random.randint(-4, 6)), "coefficients": {}} if random.random() < chance else None

    networks = [
        [
            {"source": random.randrange(6), "target": random.randrange(6), "lower": bound(0.7), "upper": bound(0.4)}
            for _ in range(random.randint(4, 10))
        ]
        for _ in range(400)
    ]
    empty = {"parameters": [], "region": None, "boxes": [], "obligations": [], "points": 6}
    ask = """({empty, networks}) => networks.map((network) => Exact.earliest(Exact.read({ ...empty, network }), []))"""
    met = Counter()
    for network, found in zip(networks, node(ask, empty=empty, networks=networks), strict=True):
        met[found["times"] is None] += 1
        assert contradictory(network, {}) is (found["times"] is None)
        if found["times"] is None:
            assert contradictory([network[at] for at in found["contradiction"]], {})
    assert min(met[True], met[False]) > 50


@pytest.mark.slow
@pytest.mark.parametrize("name", ["two_sample_navigation", "generator", "delivery"])
def test_every_sentence_about_an_example_is_what_checks_say(name):
    met = Counter()
    hunt(load_plan(*example(directory=EXAMPLES / name)), met, count=12, nominals=5)
    assert met["points"] > 50


MET: Counter[str] = Counter()
"""What random plans have met so far."""


@pytest.mark.slow
@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(plans(linear=True, continuous=False, instances=3))
def test_every_sentence_about_random_plans_is_what_checks_say(plan):
    try:
        hunt(plan, MET, count=6, nominals=2, timeout=10.0)
    except (InputError, UnsupportedError):  # no schedule at all, or not linear
        MET["no page"] += 1


def test_a_closed_face_on_which_the_plans_own_values_lie_holds(tmp_path):
    """A step of the size of a hair outwards breaks it; that is not to say that the plan is broken as it is."""
    plan = load_plan(*example())
    face = {"to_ridge": Fraction(45), "to_crater": Fraction(40)}
    own = replace(plan, parameters=tuple(replace(one, nominal=face[one.name]) for one in plan.parameters))
    data = comparison_data(compare(own), what_breaks(own), Words(own))
    here, outside = said_by_the_page(data, [face, face | {"to_ridge": face["to_ridge"] + TINY}])["answers"]
    assert here["mark"] == "✓ Valid: every schedule that the plan allows works (at the plan’s values)"
    assert outside["mark"].startswith("✗")
    texts = [content for name, content in outside["reason"] if name == "p"]
    assert texts[:2] == [
        "Breaks first:",
        "At the plan’s own values it holds; in this direction it breaks with any change.",
    ]
