"""The page of a comparison: its decisions against Python's, and the page itself in a browser.

Decisions are made by `robust/draw/web/exact.js`, which node runs here; without node, or without a browser, the tests
that need one are skipped.
"""

from __future__ import annotations

import json
import shutil
import subprocess
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from random import Random
from types import SimpleNamespace

import pytest

from robust.api import compare
from robust.draw import interactive as pages
from robust.draw.interactive import comparison_data, comparison_page, shown_region
from robust.encode import create_encoding
from robust.numbers import format_number, parse_number
from robust.qe.box import Box, Interval
from robust.qe.compute import what_breaks
from robust.qe.constraint import LinearConstraint, Sense
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region
from robust.reading import load_plan
from robust.show.text import Words
from tests.cli import inputs
from tests.cli.running import EXAMPLES, command, example
from tests.draw.browser import browser, press, settle

NAMES = ("navigation", "generator", "delivery")
FOLDERS = {"navigation": "two_sample_navigation", "generator": "generator", "delivery": "delivery"}


@pytest.fixture(scope="session", params=NAMES)
def compared(request):
    """A comparison, where each obligation breaks, and what a page of them holds."""
    return comparison(request.param)


def comparison(name):
    plan = load_plan(*example(directory=EXAMPLES / FOLDERS[name]))
    result = compare(plan)
    breaks = what_breaks(plan)
    return SimpleNamespace(
        name=name, plan=plan, result=result, breaks=breaks, data=comparison_data(result, breaks, Words(plan))
    )


# -- decisions, in node ------------------------------------------------------------------------------------------------


def node(expression, **values):
    """What an expression of JavaScript is, of values and of `Exact`; fractions come back as texts."""
    if shutil.which("node") is None:
        pytest.skip("no node on this machine, which runs the page's decisions")
    script = Path(__file__).parents[2] / "robust" / "draw" / "web" / "exact.js"
    code = f"""
    const Exact = require({json.dumps(str(script))});
    const given = JSON.parse(require("fs").readFileSync(0, "utf-8"));
    const text = (_, value) => (value && typeof value.n === "bigint" ? `${{value.n}}/${{value.d}}` : value);
    console.log(JSON.stringify(({expression})(given), text));
    """
    done = subprocess.run(["node", "-e", code], input=json.dumps(values), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def judged(data, points):
    written = [[str(point[one["name"]]) for one in data["parameters"]] for point in points]
    ask = """({data, points}) => {
      const model = Exact.read(data);
      return points.map((point) => Exact.judge(model, point.map(Exact.parse))); }"""
    return node(ask, data=data, points=written)


def points_of(compared, count, seed=3):
    """Random points around the plan's values, and points on faces and corners of boxes, where strictness decides."""
    random = Random(seed)  # noqa: S311 - reproducible
    nominal = compared.plan.nominal
    ends = {
        name: [end for entry in compared.result.entries for end in entry.result.box.ranges[name] if end is not None]
        for name in nominal
    }
    for _ in range(count):
        yield {
            name: random.choice([*ends[name], value + Fraction(random.randint(-700, 700), random.choice([1, 7, 10]))])
            if random.random() < 0.8
            else value
            for name, value in nominal.items()
        }


def earliest(plan, values):
    """The least fixed point of the network's lower bounds, by plain iteration; None if it does not settle."""
    edges = []
    for one in plan.constraints:
        for bound, source, target, sign in (
            (one.lower, one.source, one.target, 1),
            (one.upper, one.target, one.source, -1),
        ):
            if bound is not None:
                edges.append(
                    (source, target, sign * bound.evaluate({each: values[each.name] for each in bound.variables}))
                )
    times = {point: point.time or Fraction(0) for point in plan.time_points}
    for _ in range(len(times) + 1):
        late = [
            (target, times[source] + least) for source, target, least in edges if times[source] + least > times[target]
        ]
        if not late:
            return times
        for target, time in late:
            times[target] = max(time, times[target])
    return None


def test_the_page_decides_as_python_does(compared):
    points = list(points_of(compared, 250))
    region = compared.result.region.region
    encoding = create_encoding("relational", compared.plan, Fraction(1, 1000))
    met = {"valid": 0, "network": 0, "obligations": 0, "bounds": 0}
    for point, found in zip(points, judged(compared.data, points), strict=True):
        assert found["valid"] is (point in region)
        assert found["boxes"] == [point in entry.result.box for entry in compared.result.entries]
        times = earliest(compared.plan, point)
        if times is None or times[compared.plan.time_points[0]] != 0:
            assert found["times"] is None
            assert encoding.validity.contradiction(point) is not None
            assert found["contradiction"]
        else:
            assert [Fraction(time) for time in found["times"]] == [times[each] for each in compared.plan.time_points]
        met["valid" if found["valid"] else found["why"]] += 1
        named = {compared.data["obligations"][one["at"]]["name"] for one in found["broken"]}
        if found["why"] == "obligations" and not found["valid"]:
            broken = [one for one in compared.breaks.obligations if any(point in piece for piece in one.pieces)]
            demands = {one.obligation for one in broken if one.demand}
            assert named == (demands or {one.obligation for one in broken})
            assert named
        else:
            assert not named
    assert met["valid"] > 10
    assert met["network" if compared.name == "delivery" else "obligations"] > 5


def test_a_contradiction_names_statements_that_contradict(compared):
    """With these statements alone there is no schedule either."""
    points = list(points_of(compared, 120, seed=8))
    for point, found in zip(points, judged(compared.data, points), strict=True):
        if found["why"] == "network":
            named = [
                compared.plan.constraints[at] for at in found["contradiction"] if at < len(compared.plan.constraints)
            ]
            alone = SimpleNamespace(constraints=named, time_points=compared.plan.time_points)
            times = earliest(alone, point)
            assert times is None or times[compared.plan.time_points[0]] != 0


def test_what_breaks_first_gives_way_where_it_is_said(compared):
    """On the way before nothing breaks that breaks at its end; there, or just beyond, the first does."""
    plan, tiny = compared.plan, Fraction(1, 10**9)
    points = list(points_of(compared, 150, seed=4))
    count = 0
    for point, found in zip(points, judged(compared.data, points), strict=True):
        if not found["broken"]:
            continue
        count += 1
        first = found["broken"][0]
        share = Fraction(first["share"])
        pieces = compared.breaks.obligations[first["at"]].pieces
        every = [piece for one in found["broken"] for piece in compared.breaks.obligations[one["at"]].pieces]

        def on_the_way(part, point=point):
            return {name: value + part * (point[name] - value) for name, value in plan.nominal.items()}

        assert all(Fraction(one["share"]) >= share for one in found["broken"])
        assert any(on_the_way(each) in piece for piece in pieces for each in (share, min(share + tiny, Fraction(1))))
        before = [share * part for part in (Fraction(0), Fraction(1, 2), Fraction(9, 10), 1 - tiny)] if share else []
        assert not any(on_the_way(part) in piece for part in before for piece in every)
    assert count > 5


def random_polyhedron(random, names):
    senses = [Sense.AT_MOST, Sense.AT_MOST, Sense.LESS, Sense.EQUAL]
    return Polyhedron(names, tuple(
        LinearConstraint.of({name: random.randint(-3, 3) for name in names}, random.choice(senses).value,
                            Fraction(random.randint(-12, 20), random.choice([1, 2, 3])))
        for _ in range(random.randint(0, 4))
    ))  # fmt: skip


@pytest.mark.parametrize("form", ["union", "difference"])
def test_membership_of_random_regions(form):
    random = Random(1)  # noqa: S311 - reproducible
    names = ("x", "y", "z")
    seen = set()
    for _ in range(12):
        pieces = tuple(random_polyhedron(random, names) for _ in range(4))
        region = Region(names, pieces, random_polyhedron(random, names) if form == "difference" else None)
        grid = [Fraction(k, 3) for k in range(-12, 13)]
        points = [{name: random.choice(grid) for name in names} for _ in range(150)]
        data = document(names, region)
        ask = """({data, points}) => {
          const {region} = Exact.read(data);
          return points.map((point) => Exact.isInRegion(region, point.map(Exact.parse))); }"""
        answers = node(ask, data=data, points=[[str(one[name]) for name in names] for one in points])
        assert answers == [point in region for point in points]
        seen.update(answers)
    assert seen == {True, False}


def document(names, region):
    """A page's document with a region only."""
    parameter = {"nominal": "0", "lower": None, "upper": None, "first": "0", "step": "1", "steps": 1}
    constraints = {
        "base": None if region.base is None else [one.as_dict() for one in region.base.constraints],
        "pieces": [[one.as_dict() for one in piece.constraints] for piece in region.pieces],
    }
    return {"parameters": [{"name": name, **parameter} for name in names], "region": constraints,
            "boxes": [], "network": [], "obligations": [], "points": 1}  # fmt: skip


def test_slices_are_exact():
    """Corners of what is drawn are the vertices of the closure, cut to the view."""
    random = Random(2)  # noqa: S311 - reproducible
    names = ("x", "y", "z")
    view = Polyhedron(
        names[:2], tuple(Box({name: Interval(Fraction(-4), Fraction(5)) for name in names[:2]}).constraints())
    )
    drawn = 0
    for _ in range(60):
        piece = random_polyhedron(random, names)
        at = Fraction(random.randint(-4, 4), 2)
        data = document(names, Region.union_of(names, [piece]))
        ask = """({data, at}) => { const m = Exact.read(data); const q = (n) => Exact.fraction(BigInt(n));
          const view = [[-4, -4], [5, -4], [5, 5], [-4, 5]].map((corner) => corner.map(q));
          return Exact.slice(m.region.pieces[0], [q(0), q(0), Exact.parse(at)], [0, 1], view); }"""
        corners = {tuple(map(Fraction, corner)) for corner in node(ask, data=data, at=str(at))}
        closed = [one.closed() if one.parameters != ("z",) else one for one in piece.constraints]
        expected = Polyhedron(names, tuple(closed)).slice({"z": at}).intersection(view)
        vertices = {(vertex["x"], vertex["y"]) for vertex in expected.vertices()}
        assert vertices <= corners
        assert all(dict(zip("xy", corner, strict=True)) in expected for corner in corners)
        drawn += bool(corners)
    assert drawn > 20


def test_numbers_are_read_and_written_as_in_python():
    random = Random(6)  # noqa: S311 - reproducible
    values = [Fraction(random.randint(-(10**6), 10**6), random.choice([1, 3, 8, 10**4, 7**9])) for _ in range(200)]
    written = [*map(format_number, values), "1e-3", "-.5", "3.", "+4", "1/3", " 2 "]
    read = [*values, Fraction(1, 1000), Fraction(-1, 2), Fraction(3), Fraction(4), Fraction(1, 3), Fraction(2)]
    found = node("({texts}) => texts.map((t) => [Exact.parse(t), Exact.text(Exact.parse(t))])", texts=written)
    assert [Fraction(value) for value, _ in found] == read
    assert [parse_number(text) for _, text in found] == read
    assert [text for _, text in found[:200]] == written[:200]
    wrong = ["", "1/0", "x", "1/2/3", "--1", "0x10", ".", "1e9999", "1.2.3", "1" * 301, "∞", "NaN"]
    assert node("({texts}) => texts.map(Exact.parse)", texts=wrong) == [None] * len(wrong)


# -- what is written into a page ---------------------------------------------------------------------------------------


def test_sliders_hold_the_plans_values_and_all_ends(compared):
    for written, parameter in zip(compared.data["parameters"], compared.plan.parameters, strict=True):
        first, step, steps = Fraction(written["first"]), Fraction(written["step"]), written["steps"]
        assert (parameter.nominal - first) % step == 0
        assert 200 <= steps <= 1100
        for entry in compared.result.entries:
            interval = entry.result.box[parameter.name]
            assert all(
                first < end < first + steps * step for end in (interval.lower, interval.upper) if end is not None
            )


def test_a_page_without_a_region_says_so():
    plan = load_plan(*example())
    result = compare(plan, timeout=0.0)
    assert shown_region(result)[0] is None
    page = comparison_page(result, None, name="plan", epsilon=Fraction(1, 1000))
    assert "The exact envelope is not in this page: the time limit ended its computation" in page


def test_nothing_in_a_name_ends_the_script_or_becomes_an_element():
    name = "</script><img src=x onerror=alert(1)><!-- & $title"
    page = pages.self_contained(name, "<p>body</p>", data={"name": name})
    assert "<img" not in page
    assert "<!--" not in page
    text = page.split('id="data">')[1].split("</script>")[0]
    assert json.loads(text) == {"name": name}


def test_a_page_asks_for_nothing_of_a_network(compared):
    page = comparison_page(compared.result, compared.breaks, name="plan.stn", epsilon=Fraction(1, 1000))
    assert "default-src 'none'" in page
    assert "http:" not in page.replace("http://www.w3.org/2000/svg", "")
    assert "https:" not in page
    assert "src=" not in page


# -- the page, in a browser --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """The page of the navigation example, whose plan has a name that would be an element, were it not escaped."""
    folder = tmp_path_factory.mktemp("page")
    for file in (EXAMPLES / "two_sample_navigation").iterdir():
        if file.suffix in {".pddl", ".stn"}:
            shutil.copy(file, folder / file.name.replace("plan.stn", "<img src=x onerror=alert(1)>.stn"))
    plan = str(folder / "<img src=x onerror=alert(1)>.stn")
    files = [folder / "domain.pddl", folder / "problem.pddl", plan, "--html", folder / "page.html"]
    assert command("compare", *files, "--quiet").code == 0
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


def test_the_page_asks_nobody_and_has_no_errors(page):
    with browser(width=1600) as window:
        window.get(page)
        assert window.get_log("browser") == []
        assert window.execute_script("return performance.getEntriesByType('resource').length") == 0
        assert window.find_element("tag name", "h1").text == "How far may “<img src=x onerror=alert(1)>.stn” deviate?"
        assert window.find_elements("tag name", "img") == []
        named = "[...document.querySelectorAll('input,select,button')].map((one) => one.labels?.length || one.ariaLabel"
        assert all(window.execute_script(f"return {named} || one.textContent)"))


@pytest.mark.parametrize("width", [360, 1600])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_fits_and_can_be_read(page, width, scheme):
    with browser(width=width, scheme=scheme) as window:
        window.get(page)
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
        apart = [one["right"] <= other["left"] or other["right"] <= one["left"] or one["bottom"] <= other["top"]
                 or other["bottom"] <= one["top"] for at, one in enumerate(texts) for other in texts[:at]]  # fmt: skip
        assert all(apart)
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
    result = compare(load_plan(*example()), timeout=None)
    without = replace(result, region=None)
    file = tmp_path / "boxes.html"
    file.write_text(comparison_page(without, None, name="plan", epsilon=Fraction(1, 1000)), encoding="utf-8")
    with browser(width=360) as window:
        window.get(file.as_uri())
        assert "Valid" in window.find_element("id", "verdict").text
        window.execute_script(
            "const v = document.getElementById('value-0');v.value = '47'; v.dispatchEvent(new Event('input'))"
        )
        settle(window)
        assert "Not known" in window.find_element("id", "verdict").text
        assert "The exact envelope is not in this page" in window.find_element("id", "missing").text


def test_a_page_of_many_pieces_parameters_or_none(tmp_path):
    """What is drawn holds together for one parameter, and for none."""
    for plan, parameters in (
        (inputs.PLAN, 1),
        (inputs.PLAN.replace("parameter leave default 2 lb 0 ub 9;\n", "").replace("leave", "2"), 0),
    ):
        files = inputs.write(tmp_path, plan=plan).files
        assert command("compare", *files, "--quiet", "--html", tmp_path / "page.html").code == 0
        with browser(width=360) as window:
            window.get((tmp_path / "page.html").as_uri())
            assert window.get_log("browser") == []
            assert len(window.find_elements("css selector", ".slider")) == parameters
            assert "Valid" in window.find_element("id", "verdict").text
            assert window.find_element("id", "picture").is_displayed() is bool(parameters)
