"""Networks of plans under boxes, written and read again: as controllable as the boxes are."""

from robust import stnu
from robust.errors import InputError
from robust.execute.controllability import Control, Controllability, ControlVerdict
from robust.stnu.files import graphml, network_json, parse_graphml, parse_network_json
from robust.stnu.network import network_of_plan
from tests.execute.plans import box_of
from tests.execute.test_controllability_boxes import MEET, random_box


def test_the_network_of_a_plan_is_as_controllable_as_the_box():
    seen = {True: 0, False: 0}
    for seed in range(150):
        _, plan, box = random_box(seed, 2)
        verdict = Controllability(plan, box).finding(Control.DYNAMIC).verdict
        try:
            found = network_of_plan(plan, box, "plan")
        except InputError as error:
            assert "contradiction" in error.message  # noqa: PT017 - the others are judged
            assert verdict is not ControlVerdict.CONTROLLABLE
            continue
        for again in (found, parse_graphml(graphml(found)[0], "plan"), parse_network_json(network_json(found), "plan")):
            assert stnu.check(again).is_controllable is (verdict is ControlVerdict.CONTROLLABLE), seed
        seen[verdict is ControlVerdict.CONTROLLABLE] += 1
    assert min(seen.values()) > 20


def test_durations_are_contingent_links_and_zero_is_the_origin():
    found = network_of_plan(MEET, box_of(p=(1, 3), q=(2, 2)), "plan")
    links = {link.ends: (link.lower, link.upper) for link in found.links}
    assert found.origin == found.nodes[0] == "Z"
    assert links["a.start => a.end"] == (1, 3)
    assert links["b.start => b.end"] == (2, 2)
    assert links["a.end -> b.start"] == (-1, 2)
