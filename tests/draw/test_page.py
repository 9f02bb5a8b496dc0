"""The page of a comparison: its decisions against Python's, its sentences against checks, and itself in a browser.

Decisions are made by `robust/draw/web/exact.js` and sentences by `compare.js`, which node runs here (`page.js` is as
much of a browser as they need); tests are skipped without node, or without a browser where they need one.
"""

import json
import re
import shutil
import subprocess
from collections import Counter
from dataclasses import replace
from fractions import Fraction
from itertools import combinations
from pathlib import Path
from random import Random
from types import SimpleNamespace

import pytest
from hypothesis import HealthCheck, given, settings

from robust import Answer, Box, InputError, Interval, Region, UnsupportedError, check, compare, load_plan
from robust.draw.interactive import comparison_data, comparison_page, part, self_contained, shown_region
from robust.encode import create_encoding
from robust.numbers import format_number, parse_number
from robust.qe.compute import Breaks, what_breaks
from robust.qe.constraint import LinearConstraint, Sense
from robust.qe.polyhedron import Polyhedron
from robust.show.regions import METHOD_NAMES
from robust.show.text import Words
from tests.cli import inputs
from tests.cli.running import EXAMPLES, command, example
from tests.draw.browser import browser, press, settle
from tests.irr.building import both_ways, earliest, schedule_of
from tests.strategies import plans

WEB = Path(__file__).parents[2] / "robust" / "draw" / "web"
TRIPS = Path(__file__).with_name("data") / "trips"
TINY = Fraction(1, 10**6)
MILLI = Fraction(1, 1000)
NAMES = ("x", "y", "z")


def node(expression, **values):
    """What an expression of JavaScript is, of values and of `Exact`; fractions come back as texts."""
    if shutil.which("node") is None:
        pytest.skip("no node on this machine, which runs the page's decisions")
    code = f"""
    const Exact = require({json.dumps(str(WEB / "exact.js"))});
    const given = JSON.parse(require("fs").readFileSync(0, "utf-8"));
    const text = (_, value) => (value && typeof value.n === "bigint" ? `${{value.n}}/${{value.d}}` : value);
    console.log(JSON.stringify(({expression})(given), text));
    """
    done = subprocess.run(["node", "-e", code], input=json.dumps(values), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def written(data, points):
    return [[str(point[parameter["name"]]) for parameter in data["parameters"]] for point in points]


def said_by_the_page(data, points):
    """What a page of these data says at each point."""
    page, script = json.dumps(str(Path(__file__).with_name("page.js"))), json.dumps(str(WEB / "compare.js"))
    ask = f"""({{data, points}}) =>
      require({page})(Exact, require("fs").readFileSync({script}, "utf-8"), data, points)"""
    return node(ask, data=data, points=written(data, points))


def contradictory(statements, point):
    """Whether statements of a page's network have no common schedule from time 0 on."""

    def value(bound):
        return Fraction(bound["constant"]) + sum(
            Fraction(by) * point[name] for name, by in bound["coefficients"].items()
        )

    bounds = [
        bound
        for one in statements
        for bound in both_ways((one["lower"], one["upper"]), one["source"], one["target"], value)
    ]
    return earliest(bounds, {end: Fraction(0) for one in bounds for end in one[:2]}, 0) is None


@pytest.fixture(scope="module", params=["two_sample_navigation", "generator", "delivery"])
def compared(request):
    """A comparison, where each obligation breaks, and what a page of them holds."""
    plan = load_plan(*example(directory=EXAMPLES / request.param))
    result, breaks = compare(plan), what_breaks(plan)
    data = comparison_data(result, breaks, Words(plan))
    return SimpleNamespace(name=request.param, plan=plan, result=result, breaks=breaks, data=data)


def points_of(compared, count):
    """Random points around the plan's values, and points on faces and corners of boxes, where strictness decides."""
    random = Random(3)  # noqa: S311 - reproducible
    boxes = [entry.result.box for entry in compared.result.entries]
    for _ in range(count):
        point = dict(compared.plan.nominal)
        for name, value in point.items():
            if random.random() < 0.8:
                near = value + Fraction(random.randint(-700, 700), random.choice([1, 7, 10]))
                ends = [end for box in boxes for end in box.ranges[name] if end is not None]
                point[name] = random.choice([*ends, near])
        yield point


def test_the_page_decides_as_python_does(compared):
    plan, data, points = compared.plan, compared.data, list(points_of(compared, 250))
    ask = """({data, points}) => {
      const model = Exact.read(data);
      return points.map((point) => Exact.judge(model, point.map(Exact.parse))); }"""
    validity = create_encoding("relational", plan, MILLI).validity
    met = Counter()
    for point, judged in zip(points, node(ask, data=data, points=written(data, points)), strict=True):
        assert judged["valid"] is (point in compared.result.region.region)
        assert judged["boxes"] == [point in entry.result.box for entry in compared.result.entries]
        times = schedule_of(plan, point)
        if times is None:
            assert judged["times"] is None
            assert validity.contradiction(point) is not None
            assert contradictory([data["network"][at] for at in judged["contradiction"]], point)
        else:
            assert [Fraction(time) for time in judged["times"]] == [times[at] for at in plan.time_points]
        met["valid" if judged["valid"] else judged["why"]] += 1
        named = {data["obligations"][one["at"]]["name"] for one in judged["broken"]}
        if judged["why"] == "obligations" and not judged["valid"]:
            broken = [one for one in compared.breaks.obligations if any(point in piece for piece in one.pieces)]
            demands = {one.obligation for one in broken if one.demand}
            assert named == (demands or {one.obligation for one in broken}) != set()
        else:
            assert not named
    assert met["valid"] > 10
    assert met["network" if compared.name == "delivery" else "obligations"] > 5


def random_polyhedron(random):
    senses = [Sense.AT_MOST, Sense.AT_MOST, Sense.LESS, Sense.EQUAL]
    return Polyhedron(NAMES, tuple(
        LinearConstraint.of({name: random.randint(-3, 3) for name in NAMES}, random.choice(senses).value,
                            Fraction(random.randint(-12, 20), random.choice([1, 2, 3])))
        for _ in range(random.randint(0, 4))
    ))  # fmt: skip


def document(region):
    """A page's document with a region only."""
    parameter = {"nominal": "0", "lower": None, "upper": None, "first": "0", "step": "1", "steps": 1}
    constraints = {
        "base": None if region.base is None else [one.as_dict() for one in region.base.constraints],
        "pieces": [[one.as_dict() for one in piece.constraints] for piece in region.pieces],
    }
    empty = {"boxes": [], "network": [], "obligations": [], "points": 1}
    return {"parameters": [{"name": name, **parameter} for name in NAMES], "region": constraints, **empty}


@pytest.mark.parametrize("form", ["union", "difference"])
def test_membership_of_random_regions(form):
    random = Random(1)  # noqa: S311 - reproducible
    asked, expected = [], []
    for _ in range(12):
        pieces = tuple(random_polyhedron(random) for _ in range(4))
        region = Region(NAMES, pieces, random_polyhedron(random) if form == "difference" else None)
        points = [{name: Fraction(random.randint(-12, 12), 3) for name in NAMES} for _ in range(150)]
        asked.append([document(region), written(document(region), points)])
        expected.append([point in region for point in points])
    ask = """({asked}) => asked.map(([data, points]) => {
      const {region} = Exact.read(data);
      return points.map((point) => Exact.isInRegion(region, point.map(Exact.parse))); })"""
    assert node(ask, asked=asked) == expected
    assert {answer for answers in expected for answer in answers} == {True, False}


def test_slices_are_exact():
    """Corners of what is drawn are the vertices of the closure, cut to the view."""
    random = Random(2)  # noqa: S311 - reproducible
    plane = NAMES[:2]
    view = Polyhedron.of_box(plane, Box({name: Interval(Fraction(-4), Fraction(5)) for name in plane}))
    pieces = [(random_polyhedron(random), Fraction(random.randint(-4, 4), 2)) for _ in range(60)]
    ask = """({asked}) => asked.map(([data, at]) => {
      const m = Exact.read(data); const q = (n) => Exact.fraction(BigInt(n));
      const view = [[-4, -4], [5, -4], [5, 5], [-4, 5]].map((corner) => corner.map(q));
      return Exact.slice(m.region.pieces[0], [q(0), q(0), Exact.parse(at)], [0, 1], view); })"""
    answers = node(ask, asked=[[document(Region.union_of(NAMES, [piece])), str(at)] for piece, at in pieces])
    for (piece, at), answer in zip(pieces, answers, strict=True):
        corners = {tuple(map(Fraction, corner)) for corner in answer}
        closed = tuple(one.closed() if one.parameters != ("z",) else one for one in piece.constraints)
        expected = Polyhedron(NAMES, closed).slice({"z": at}).intersection(view)
        assert {(vertex["x"], vertex["y"]) for vertex in expected.vertices()} <= corners
        assert all(dict(zip("xy", corner, strict=True)) in expected for corner in corners)
    assert sum(map(bool, answers)) > 20


def test_numbers_are_read_and_written_as_in_python():
    random = Random(6)  # noqa: S311 - reproducible
    values = [Fraction(random.randint(-(10**6), 10**6), random.choice([1, 3, 8, 10**4, 7**9])) for _ in range(200)]
    texts = {**dict(zip(map(format_number, values), values, strict=True)), "1e-3": MILLI, "-.5": Fraction(-1, 2),
             "3.": Fraction(3), "+4": Fraction(4), "1/3": Fraction(1, 3), " 2 ": Fraction(2)}  # fmt: skip
    answers = node("({texts}) => texts.map((t) => [Exact.parse(t), Exact.text(Exact.parse(t))])", texts=list(texts))
    assert [Fraction(value) for value, _ in answers] == [parse_number(text) for _, text in answers] == [*texts.values()]
    assert [text for _, text in answers[:-6]] == list(texts)[:-6]
    wrong = ["", "1/0", "x", "1/2/3", "--1", "0x10", ".", "1e9999", "1.2.3", "1" * 301, "∞", "NaN"]
    assert node("({texts}) => texts.map(Exact.parse)", texts=wrong) == [None] * len(wrong)


def test_contradictions_of_random_networks_are_contradictions():
    random = Random(7)  # noqa: S311 - reproducible

    def bound(chance):
        return {"constant": str(random.randint(-4, 6)), "coefficients": {}} if random.random() < chance else None

    def statement():
        return {"source": random.randrange(6), "target": random.randrange(6), "lower": bound(0.7), "upper": bound(0.4)}

    networks = [[statement() for _ in range(random.randint(4, 10))] for _ in range(400)]
    empty = {"parameters": [], "region": None, "boxes": [], "obligations": [], "points": 6}
    ask = """({empty, networks}) => networks.map((network) => Exact.earliest(Exact.read({ ...empty, network }), []))"""
    met = Counter()
    for network, answer in zip(networks, node(ask, empty=empty, networks=networks), strict=True):
        met[answer["times"] is None] += 1
        assert contradictory(network, {}) is (answer["times"] is None)
        if answer["times"] is None:
            assert contradictory([network[at] for at in answer["contradiction"]], {})
    assert min(met[True], met[False]) > 50


def test_what_is_written_into_a_page(compared):
    """Sliders hold the plan's values and all ends; nothing is asked of a network."""
    for slider, parameter in zip(compared.data["parameters"], compared.plan.parameters, strict=True):
        first, step, steps = Fraction(slider["first"]), Fraction(slider["step"]), slider["steps"]
        assert (parameter.nominal - first) % step == 0
        assert 200 <= steps <= 1100
        ends = [end for entry in compared.result.entries for end in entry.result.box.ranges[parameter.name]]
        assert all(first < end < first + steps * step for end in ends if end is not None)
    page = comparison_page(compared.result, compared.breaks, name="plan.stn", epsilon=MILLI)
    assert "default-src 'none'" in page
    assert not [text for text in ("http:", "https:", "src=") if text in page.replace("http://www.w3.org/2000/svg", "")]


def test_a_page_without_a_region_says_so():
    result = compare(load_plan(*example()), timeout=0.0)
    assert shown_region(result)[0] is None
    page = comparison_page(result, None, name="plan", epsilon=MILLI)
    assert "The exact envelope is not in this page: the time limit ended its computation" in page


def test_nothing_in_a_name_ends_the_script_or_becomes_an_element():
    name = "</script><img src=x onerror=alert(1)><!-- & $title"
    page = self_contained(name, "<p>body</p>", data={"name": name})
    assert "<img" not in page
    assert "<!--" not in page
    assert json.loads(page.split('id="data">')[1].split("</script>")[0]) == {"name": name}


VERDICTS, OTHER = (
    set(Path(__file__).with_name("data").joinpath(name).read_text(encoding="utf-8").splitlines())
    for name in ("verdicts.txt", "other.txt")
)
"""What the page can say of a point, which has its oracle in :class:`Reader`; parts of that, and what is no verdict."""


def test_every_text_of_the_script_is_in_the_table():
    """What the page says is what the table lists: strings of more than one word."""
    source = part("compare.js")
    source = "\n".join(line for line in source.splitlines() if not line.strip().startswith(("//", "/**")))
    strings, flat = set(re.findall(r'"([^"\n`]*)"', source)), ""
    while flat != source:
        source = flat or source
        inner = re.sub(r"\$\{[^{}`]*\}", "{}", source)
        strings |= set(re.findall(r"`([^`\n$]*)`", inner))
        flat = re.sub(r"`([^`\n$]*)`", "_", inner)
    texts = {text for text in strings if re.search(r"[a-z’?] [(a-z{]|[A-Z][a-z]+ ", text)}
    assert texts - VERDICTS - OTHER == set()


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
        return [one for one in self.plan.parameters if point[one.name] not in Interval(one.lower, one.upper)]


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
        mark, *_ = answer["mark"].split(" (at")
        self.hear(mark)
        assert answer["mark"].endswith(" (at the plan’s values)") is (point == self.plan.nominal)
        self.met[" (at the plan’s values)"] += point == self.plan.nominal
        if mark.startswith("?"):
            assert self.data["region"] is None
            assert not any(point in box for box in self.boxes.values())
        else:
            valid = not self.oracle.beyond(point) and self.broken_at(point) == set()
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
        paragraphs = []
        for name, content in reason:
            if name == "ul":
                paragraphs[-1][1].extend(content)
            else:
                paragraphs.append((content, []))
        return paragraphs

    def reason(self, point, text, items, said):
        broken = self.broken_at(point)
        if text.startswith("In the box of: "):
            self.hear("In the box of:")
            within = [METHOD_NAMES[name] for name, box in self.boxes.items() if point in box]
            assert text == f"In the box of: {', '.join(within) or 'no method'}."
            assert not within or broken == set()
            return
        if text.startswith(("It breaks at", "At the plan’s own", "Nothing else")):
            self.way(point, text, dict(said))
            return
        self.hear(text)
        match text:
            case "Outside the declared bounds:":
                words = {name: text for text, name in self.names.items()}
                expected = []
                for one in self.oracle.beyond(point):
                    ends = (("at least", one.lower), ("at most", one.upper))
                    declared = " and ".join(f"{word} {format_number(end)}" for word, end in ends if end is not None)
                    expected.append(f"{words[one.name]} is declared as {declared}")
                assert items == expected != []
            case "There is no schedule: these cannot all hold, nor begin before time 0.":
                assert broken is None
                assert contradictory([one for one in self.data["network"] if one["words"] in items], point)
            case "Breaks first:" | "Can break as well:" | "Can break:":
                names = {self.obligations[one] for one in items}
                assert names
                assert names <= broken, (point, text, names, broken)
                if self.data["complete"] and not any(one["demand"] for one in self.data["obligations"]):
                    assert {self.obligations[one] for _, some in said for one in some} == broken
                assert text != "Can break:" or "Breaks first:" not in dict(said)
            case "Not all obligations were examined; others may break, too.":
                assert not self.data["complete"]
                assert "Breaks first:" not in dict(said)
            case "Some schedule of the plan breaks an obligation; which one was not found out.":
                assert broken
                assert not self.data["complete"]
            case "In none of the boxes; the exact envelope is not in this page.":
                assert self.data["region"] is None
                assert not any(point in box for box in self.boxes.values())
            case _:
                pytest.fail(text)

    def way(self, point, text, said):
        """Where what breaks first does, on the way from the plan's values."""
        first = {self.obligations[one] for one in said["Breaks first:"]}
        named = first | {self.obligations[one] for one in said.get("Can break as well:", ())}
        nominal = self.plan.nominal
        kind, colon, values = text.partition(": it breaks ")
        if not colon:
            self.hear(text)
            place, is_open = nominal, text.startswith("At the plan’s own values it holds;")
        else:
            where = re.match("at|just beyond", values)[0]
            self.hear(f"{kind}: it breaks {where}")
            is_open = where == "just beyond"
            if "≈" in values:
                return
            place = nominal | self.values(values.removeprefix(where + " ").removesuffix("."))
            assert all((place[name] != nominal[name]) is (point[name] != nominal[name]) for name in nominal)
        assert not self.oracle.beyond(place)
        self.met["places"] += 1
        if is_open:
            assert not named & self.oracle.at(place)
        assert first <= self.oracle.at(between(place, point, TINY) if is_open else place)
        if place != nominal:
            assert not any(
                named & self.oracle.at(between(nominal, place, share)) for share in (0, TINY * 500000, 1 - TINY)
            )

    def values(self, text):
        """`drive a b = 45, …` by the names of parameters."""
        pairs = (one.rpartition(" = ") for one in text.split(", "))
        return {self.names[words]: as_number(value) for words, _, value in pairs}

    def chart(self, point, answer, said):
        self.hear(answer["chart"])
        times = schedule_of(self.plan, point)
        assert (answer["chart"] == "There is none at these values.") is (times is None)
        if times is None:
            assert self.broken_at(point) is None
            return
        assert ("need not" in answer["chart"]) is answer["mark"].startswith("✗")
        for one, text in zip(self.plan.instances, answer["times"], strict=True):
            ends = [times[moment] for moment in dict.fromkeys([one.start, one.end])]
            assert close(map(as_number, text.removeprefix("at ").split(" to ")), ends)
        words = Words(self.plan)
        named = [self.obligations[one] for text, items in said if "reak" in text for one in items]
        assert set(answer["broken"]) == {part for name in named for part in words.concerned(name)}

    def slice(self, point, answer):
        hidden = [one["name"] for one in self.data["parameters"]][2:]
        if hidden:
            self.hear("Slice at")
            shown = self.values(answer["slice"].removeprefix("Slice at ").removesuffix("."))
            assert list(shown) == hidden
            assert close(shown.values(), [point[name] for name in shown])
        first, second, *boxes, own, here = answer["legend"]
        self.hear(first)
        self.hear(second)
        no_region = self.data["region"] is None
        assert first == ("valid: in a box" if no_region else "valid: the exact envelope")
        assert second == ("not known" if no_region else "not valid")
        assert (own, here) == ("the plan’s values", "the values above")
        names = [METHOD_NAMES[name] for name in self.boxes]
        for at, (text, box) in enumerate(zip(boxes, self.boxes.values(), strict=True)):
            first_with_it = list(self.boxes.values()).index(box)
            twin = f" (the same as {names[first_with_it]})" if first_with_it < at else ""
            away = "" if all(point[one] in box[one] for one in hidden) else " (not in this slice)"
            assert text == f"box: {names[at]}{twin}{away}"
            self.met[" (the same as"] += bool(twin)
            self.met[" (not in this slice)"] += bool(away)


def as_number(text):
    return Fraction(text.removeprefix("≈").replace("−", "-"))


def close(values, others):
    return all(abs(one - other) <= abs(other) / 10**5 for one, other in zip(values, others, strict=True))


def between(one, other, share):
    return {name: value + share * (other[name] - value) for name, value in one.items()}


def faces(result, breaks, random, count):
    """Points on, just inside and just outside of faces of the region, boxes and what breaks, and further from them."""
    region = result.region.region
    pieces = [*region.pieces, *((region.base,) if region.base is not None else ())]
    if pieces:
        pieces += [
            Polyhedron.of_box(region.parameters, one.result.box) for one in result.entries if one.result.verified
        ]
    pieces += [piece for one in breaks.obligations for piece in one.pieces]
    sides = {}
    for piece in pieces:
        for one in piece.constraints:
            if one.coefficients:
                sides.setdefault((one.coefficients, one.constant), piece)
    for (coefficients, constant), piece in random.sample(list(sides.items()), min(count, len(sides))):
        closed = Polyhedron(piece.parameters, tuple(one.closed() for one in piece.constraints))
        point = closed.restricted([LinearConstraint(coefficients, Sense.EQUAL, constant)]).some_point()
        if point is not None:
            for step in (-1, -TINY, 0, TINY, 1):
                yield point | {name: point[name] + step * factor for name, factor in coefficients}


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


def test_every_sentence_is_what_checks_say():
    """Strict and weak obligations, demands on durations, declared bounds and a deadline, whose faces are met."""
    met: Counter[str] = Counter()
    broken = {"back": Fraction(3), "leave": Fraction(2), "ride": Fraction(7)}
    hunt(load_plan(*example(directory=TRIPS)), met, seed=3, count=9, own=[broken])
    assert met["places"] > 10
    assert VERDICTS - set(+met) == set()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["two_sample_navigation", "generator", "delivery"])
def test_every_sentence_about_an_example_is_what_checks_say(name):
    met = Counter()
    hunt(load_plan(*example(directory=EXAMPLES / name)), met, count=12, nominals=5)
    assert met["points"] > 50


@pytest.mark.slow
@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(plans(linear=True, continuous=False, instances=3))
def test_every_sentence_about_random_plans_is_what_checks_say(plan):
    try:
        hunt(plan, Counter(), count=6, nominals=2, timeout=10.0)
    except (InputError, UnsupportedError):  # no schedule at all, or not linear
        return


def test_a_closed_face_on_which_the_plans_own_values_lie_holds():
    """A step of the size of a hair outwards breaks it; that is not to say that the plan is broken as it is."""
    plan = load_plan(*example())
    face = {"to_ridge": Fraction(45), "to_crater": Fraction(40)}
    own = replace(plan, parameters=tuple(replace(one, nominal=face[one.name]) for one in plan.parameters))
    data = comparison_data(compare(own), what_breaks(own), Words(own))
    here, outside = said_by_the_page(data, [face, face | {"to_ridge": face["to_ridge"] + TINY}])["answers"]
    assert here["mark"] == "✓ Valid: every schedule that the plan allows works (at the plan’s values)"
    assert outside["mark"].startswith("✗")
    holds = "At the plan’s own values it holds; in this direction it breaks with any change."
    assert [content for name, content in outside["reason"] if name == "p"][:2] == ["Breaks first:", holds]


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """The page of the navigation example, whose plan has a name that would be an element, were it not escaped."""
    folder = tmp_path_factory.mktemp("page")
    plan = folder / "<img src=x onerror=alert(1)>.stn"
    domain, problem, text = example()
    shutil.copy(text, plan)
    assert command("compare", domain, problem, plan, "--html", folder / "page.html", "--quiet").code == 0
    return (folder / "page.html").as_uri()


def test_the_page_follows_the_keyboard(page):
    with browser(width=1600) as window:
        window.get(page)
        said = lambda: window.find_element("id", "verdict").text  # noqa: E731
        assert "Valid" in said()
        assert "(at the plan’s values)" in said()
        press(window, "\t")
        focused = window.switch_to.active_element
        assert focused.get_attribute("type") == "range"
        assert window.execute_script("return getComputedStyle(document.activeElement).outlineStyle") == "solid"
        label = window.find_element("css selector", f"label[for='{focused.get_attribute('id')}']").text
        assert label == "drive scout base ridge to_ridge"
        bars = lambda: [one.get_attribute("style") for one in window.find_elements("css selector", ".track .bar")]  # noqa: E731
        before = bars()
        press(window, "\ue014" * 160)  # arrow right, by a tenth each
        assert window.find_element("id", "value-0").get_attribute("value") == "46"
        assert "Not valid" in said()
        assert "drive scout crater base needs (daylight) all the time" in said()
        assert "drive scout base ridge = 45" in said()
        assert bars() != before
        assert len(window.find_elements("css selector", ".track .bar.broken")) == 1
        press(window, "\t")  # to the exact value
        press(window, "\ue009a" + "\ue000" + "135/3")
        assert "Valid" in said()
        assert "In the box of: IRR" in said()
        press(window, "/")
        assert "Expected a number such as" in window.find_element("id", "error-0").text
        assert window.find_element("id", "value-0").get_attribute("aria-invalid") == "true"
        press(window, "\t\t\t\n")  # past the other parameter to the button
        assert "(at the plan’s values)" in said()


@pytest.mark.parametrize("width", [360, 1600])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_fits_can_be_read_and_asks_nobody(page, width, scheme):
    with browser(width=width, scheme=scheme) as window:
        window.get(page)
        assert window.get_log("browser") == []
        assert window.execute_script("return performance.getEntriesByType('resource').length") == 0
        assert window.find_element("tag name", "h1").text == "How far may “<img src=x onerror=alert(1)>.stn” deviate?"
        assert window.find_elements("tag name", "img") == []
        named = "[...document.querySelectorAll('input,select,button')].map((one) => one.labels?.length || one.ariaLabel"
        assert all(window.execute_script(f"return {named} || one.textContent)"))
        assert window.execute_script("return document.documentElement.scrollWidth") <= width
        # Every text of the picture is inside of it, and none is over another.
        boxes = window.execute_script("""
            const svg = document.getElementById("slice").getBoundingClientRect();
            const texts = [...document.querySelectorAll("#slice text")].map((one) => one.getBoundingClientRect());
            return {svg, texts};""")
        svg, texts = boxes["svg"], boxes["texts"]
        assert len(texts) >= 6
        assert all(svg["left"] <= one["left"] and one["right"] <= svg["right"] for one in texts)
        assert all(svg["top"] <= one["top"] and one["bottom"] <= svg["bottom"] for one in texts)
        for one, other in combinations(texts, 2):
            aside = one["right"] <= other["left"] or other["right"] <= one["left"]
            assert aside or one["bottom"] <= other["top"] or other["bottom"] <= one["top"]
        colours = window.execute_script("""return [...document.querySelectorAll("h1,h2,p,label,li,code,.when,summary")]
            .filter((one) => one.offsetParent && one.textContent).map((one) => {
              const colour = (each) => getComputedStyle(each).backgroundColor;
              let ground = one;
              while (colour(ground) === "rgba(0, 0, 0, 0)") ground = ground.parentElement;
              return [getComputedStyle(one).color, colour(ground)]; });""")
        assert min(contrast(*pair) for pair in colours) >= 4.5


def contrast(one, other):
    """The ratio of contrast of the Web Content Accessibility Guidelines."""

    def luminance(colour):
        parts = [int(part) / 255 for part in colour.removeprefix("rgb(").removesuffix(")").split(",")]
        linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
        return sum(factor * part for factor, part in zip((0.2126, 0.7152, 0.0722), linear, strict=True))

    dark, light = sorted([luminance(one), luminance(other)])
    return (light + 0.05) / (dark + 0.05)


def test_a_page_without_a_region_decides_by_boxes(tmp_path):
    without = replace(compare(load_plan(*example())), region=None)
    file = tmp_path / "boxes.html"
    file.write_text(comparison_page(without, None, name="plan", epsilon=MILLI), encoding="utf-8")
    with browser(width=360) as window:
        window.get(file.as_uri())
        assert "Valid" in window.find_element("id", "verdict").text
        field = "document.getElementById('value-0')"
        window.execute_script(f"{field}.value = '47'; {field}.dispatchEvent(new Event('input'))")
        settle(window)
        assert "Not known" in window.find_element("id", "verdict").text
        assert "The exact envelope is not in this page" in window.find_element("id", "missing").text


@pytest.mark.parametrize("parameters", [1, 0])
def test_a_page_of_one_parameter_or_none(tmp_path, parameters):
    """What is drawn holds together for one parameter, and for none."""
    _, *statements = inputs.PLAN.splitlines(keepends=True)
    plan = inputs.PLAN if parameters else "".join(statements).replace("leave", "2")
    files = inputs.write(tmp_path, plan=plan)
    assert command("compare", *files, "--quiet", "--html", tmp_path / "page.html").code == 0
    with browser(width=360) as window:
        window.get((tmp_path / "page.html").as_uri())
        assert window.get_log("browser") == []
        assert len(window.find_elements("css selector", ".slider")) == parameters
        assert "Valid" in window.find_element("id", "verdict").text
        assert window.find_element("id", "picture").is_displayed() is bool(parameters)
