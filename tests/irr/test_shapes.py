"""Shapes between boxes and regions: inside, around the box, no face can move: random regions, and plans."""

from fractions import Fraction
from random import Random

import pytest

import robust
from robust.errors import InputError
from robust.irr.templates import Shape, standing, template_of, widened
from robust.plan.model import Parameter
from robust.qe.box import Box, Interval, Side
from robust.qe.constraint import LinearConstraint
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region
from robust.smt.limits import NEVER
from tests.cli.running import answer_of, assert_one_line, command, example
from tests.irr.test_compare import instances

TINY = Fraction(1, 10**6)


def check(shape: Shape, region: Region, box: Box) -> int:
    """Inside the region, around the box, and no finite face can move alone; how many such faces there are."""
    names, faces = shape.parameters, 0
    own = Region.union_of(names, [shape.polyhedron])
    assert own.is_subset_of(region)
    assert Region.of_box(names, box).is_subset_of(own)
    for label, interval in shape.bounds.intervals.items():
        for side in Side:
            if (end := interval.end(side)) is not None:
                farther = shape.bounds.moved((label, side), end + side.sign * TINY)
                constraints = tuple(standing(shape.directions, farther).values())
                assert not Region.union_of(names, [Polyhedron(names, constraints)]).is_subset_of(region), (label, side)
                faces += 1
    return faces


@pytest.mark.parametrize("seed", [*range(15), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(15, 150))])
def test_shapes_in_random_regions(seed):
    """Regions are polyhedra without others around a small box at zero, with strict sides too."""
    draw = Random(seed)  # noqa: S311 - reproducible
    names = ("a", "b", "c")[: draw.choice((2, 2, 3))]
    box = Box({name: Interval(Fraction(-draw.randint(0, 1)), Fraction(draw.randint(0, 1))) for name in names})

    def half(least: int) -> LinearConstraint:
        form = {name: draw.randint(-3, 3) for name in names}
        reach = box.values_of([(name, Fraction(factor)) for name, factor in form.items()], 0).upper
        return LinearConstraint.of(form, draw.choice(("<=", "<")), reach + draw.randint(least, 6))

    base = Polyhedron(names, tuple(half(1) for _ in range(draw.randint(1, 4))))
    removed = []
    for _ in range(draw.randint(0, 2)):  # beyond a half-space that the box keeps, and within others
        (beyond,) = half(1).negation()
        removed.append(Polyhedron(names, (beyond, *(half(2) for _ in range(draw.randint(0, 2))))))
    region = Region.difference(base, removed)
    parameters = [Parameter(name, Fraction(0), Fraction(draw.randint(1, 3))) for name in names]
    shape = widened(template_of("octagon", names), parameters, region, box, name="octagon", deadline=NEVER)
    check(shape, region, box)
    point = {name: Fraction(draw.randint(-9, 9)) for name in names}
    assert (point in shape) is (point in shape.polyhedron)


@pytest.mark.parametrize(
    ("names", "least"), [(("auv_mission_10_0_2", "solar_rover_02_3"), 4), pytest.param((), 150, marks=pytest.mark.slow)]
)
def test_octagons_of_recorded_instances(dataset, names, least):
    faces = 0
    for instance, plan in instances(dataset):
        if (not names and len(plan.parameters) <= 4) or instance["instance"] in names:
            result = robust.envelope(plan, shape="octagon")
            faces += check(result.shape, robust.region(plan).region, result.box)
    assert faces >= least


def test_octagon_of_the_example(tmp_path):
    result = robust.envelope(example(), shape="octagon")
    bounds = {name: str(interval) for name, interval in result.shape.bounded.items()}
    assert bounds == {"to_ridge": "[20, 50]", "to_crater": "[10, 46]", "to_ridge + to_crater": "[60, 82]"}
    assert {"to_ridge": Fraction(20), "to_crater": Fraction(40)} in result.shape
    assert {"to_ridge": Fraction(20), "to_crater": Fraction(39)} not in result.shape
    picture = tmp_path / "octagon.svg"
    answer = answer_of(command("envelope", *example(), "--shape", "octagon", "--json", "--plot", picture))
    assert [face["coefficients"] for face in answer["shape"]["faces"]] == [
        {"to_ridge": "1"},
        {"to_crater": "1"},
        {"to_ridge": "1", "to_crater": "1"},
    ]
    assert "octagon" in picture.read_text()
    assert "shape" not in robust.envelope(example()).as_dict()


def test_templates_from_files(tmp_path):
    file = tmp_path / "template.txt"
    file.write_text(
        "# what the battery bears\n\nto_ridge + 2 to_crater\n- to_ridge + 1/2 to_crater + to_ridge + to_ridge\n"
    )
    result = robust.envelope(example(), shape=str(file))
    assert list(result.shape.directions)[2:] == ["to_ridge + 2 to_crater", "to_ridge + 1/2 to_crater"]
    check(result.shape, robust.region(example()).region, result.box)
    for text, says in (
        ("to_ridge\nto_ridge + noon\n", "2: found 'noon', expected parameters such as a + 2 b, with blanks"),
        ("to_ridge - to_ridge\n", "1: found 'to_ridge - to_ridge', expected a form such as a + 2 b"),
        ("2\n", "1: found '2', expected a form"),
    ):
        file.write_text(text)
        assert_one_line(command("envelope", *example(), "--shape", file), says=f"{file}:{says}")
    expected = "hexagon: found no such file, expected octagon, or a readable file of linear forms"
    with pytest.raises(InputError, match=expected):
        robust.envelope(example(), shape="hexagon")
