"""What a compilation is said to consist of, against the plans of the paper, and as text and JSON."""

from itertools import permutations

import pytest

from benchmarks.generators.team_plans import blocks
from robust import pike
from robust.errors import InputError
from robust.pike_bridge import compile
from robust.pike_bridge.knowledge.propagation import PropagatedLabels
from robust.pike_bridge.model import Assignment
from robust.pike_bridge.theory import All, Is, Not, Some, Theory
from tests.cli.running import answer_of, command
from tests.pike_bridge import stories
from tests.pike_bridge.brute_force import candidate_subplan, scenarios
from tests.pike_bridge.stories import figure


@pytest.mark.parametrize(
    ("number", "expected"),
    [
        ("6b", {"(p1)": ({"x": "1"}, False, []), "(p2)": ({"y": "1"}, False, [])}),
        ("9", {"(p1)": ({}, False, [("(t1)", {}, "either")])}),
        (
            "11",
            {
                f"(p{at})": ({of: "1"}, True, [("(t1)", {"x": "1"}, "either"), ("(t2)", {"y": "1"}, "either")])
                for at, of in ((1, "u"), (2, "v"))
            },
        ),
        (
            "13",
            {
                "(p1)": ({"y": "1"}, False, [("(t1)", {"x": "1"}, "either")]),
                "(p2)": ({}, False, [("(t1)", {"x": "1"}, "after")]),
            },
        ),
    ],
)
def test_links_and_threats_of_the_figures(number, expected):
    """Labels, orderings that had to be added, and how each threat is kept away [PIKE §4.2 to §4.4]."""
    sizes = pike.compile(figure(number).plan(), show="links")
    [needed] = sizes.causal_links
    assert (needed.condition, needed.actions, sizes.labels, sizes.distances) == ("(p)", ["(c)"], None, None)
    told = {
        link.actions[0]: (
            link.label,
            link.ordered,
            [(each.actions[0], each.label, each.resolution) for each in link.threats],
        )
        for link in needed.producers
    }
    assert told == expected
    variables = pike.knowledge_base(figure(number).plan()).knowledge.theory.domains
    for link in needed.producers:
        assert link.value in variables[needed.variable]
        for threat in link.threats:
            assert (threat.resolution == "either") == (variables.get(threat.variable) == ("before", "after"))


def test_conditions_without_support_and_what_threatens_for_certain():
    formula = [[1], [], [-1]]  # the second clause has no literal
    links = pike.compile(stories.sat_plan(formula).plan(), show="links").causal_links
    assert [[link.label for link in each.producers] for each in links] == [[{"v1": "true"}], [], [{"v1": "false"}]]
    assert [each.variable is None for each in links] == [False, True, False]
    text = str(pike.compile(stories.sat_plan(formula).plan(), show="links"))
    assert "(clause-holds-2) at e" in text
    assert "  from nothing" in text


def test_labels_of_figure_14():
    """Formulas of nodes as text, and their labels, short environments first."""
    z1, p2, p1, y1 = (Is(Assignment(*each)) for each in (("z", "1"), ("s", "eP2"), ("s", "eP1"), ("y", "1")))
    domains = {"z": ("1", "2"), "y": ("1", "2"), "s": ("eP1", "eP2", "none")}
    theory = Theory(domains, (Some((Not(z1), p2, All((p1, y1)))),), (frozenset({Assignment("y", "2")}),))
    told = {(each.kind, each.formula): each.environments for each in compile.labels_of(PropagatedLabels(theory))}
    both = {"s": "eP1", "y": "1"}
    assert told["derived", "(s = eP1 and y = 1)"] == [both]
    goal = [both, {"s": "eP2", "y": "1"}, {"y": "1", "z": "2"}]
    assert told["derived", "(z = 2 or s = eP2 or (s = eP1 and y = 1))"] == goal
    assert told["assumption", "y = 2"] == told["contradiction", "y = 2"] == []
    assert compile.formula_text(Not(All((Some(()), All(()), Some((y1,)))))) == "not (false and true and y = 1)"


def test_distances_are_those_of_every_scenario():
    """Without conditions the augmented plan is the plan; with completions one bound goes from start to end."""
    plan = stories.figure_23(2).plan()
    distances = pike.compile(plan, show=["distances"]).distances
    assert distances.conflicts == []
    by_pair = {(pair.source, pair.target): pair.values for pair in distances.pairs}
    for scenario in scenarios(plan.network.domains):
        bounds = candidate_subplan(plan.network, scenario).bounds
        active = [name for name, guard in plan.network.guards.items() if guard <= set(scenario.items())]
        for pair in permutations(active, 2):
            holding = [v.bound for v in by_pair.get(pair, ()) if v.label.items() <= scenario.items()]
            assert min(holding, default=None) == (bounds[pair][0] if pair in bounds else None)
    assert [value.label for value in by_pair["e_goal", "e_initial"]] == [{}]


def test_listings_as_text_and_json(tmp_path):
    file = figure("13").write(tmp_path)
    words = ("pike", "compile", file, "--backend", "pitms-labels", "--show", "links,labels,distances")
    answer = answer_of(command(*words, "--json"), "robust/pike-compile/1")
    assert [producer["value"] for each in answer["causal_links"] for producer in each["producers"]] == ["e2", "e11"]
    assert {each["kind"] for each in answer["labels"]} == {"assumption", "derived"}
    assert answer["distances"]["pairs"][0].keys() == {"source", "target", "values"}
    text = command(*words).out
    for line in (
        "(p) at e15, (c) if z = 1:",
        "  from e11, (p1) if y = 1",
        "    e6, (t1) if x = 1 is before it or after its consumer: o[(p) @ e15, e11, e6]",
        "assumption y = 1: {y = 1}",
        "e2 to e1: at most −1",
    ):
        assert line in text.splitlines()
    for words, message in (
        (("--show", "label"), "found 'label', expected one of links, labels, distances; did you mean 'labels'"),
        (("--show", "labels", "--backend", "bdd"), "back end bdd has no labels; expected --backend pitms or"),
    ):
        assert message in command("pike", "compile", file, *words).err


def test_models_are_listed_by_a_solver_only_where_they_are_asked_for():
    """Of a plan with 10**44 models, a back end that lists them says at once that a correct execution exists."""
    plan = blocks(16).plan()
    sizes = pike.compile(plan, "sat")
    assert (sizes.status, sizes.satisfiable, sizes.models) == ("complete", True, None)
    assert "models: not counted: a solver lists them one by one (--models)" in str(sizes)
    sizes = pike.compile(plan, "sat", models=True, timeout=sum(sizes.seconds.values()) + 3)
    assert (sizes.status, sizes.satisfiable, sizes.models) == ("timeout", True, None)
    assert str(sizes).startswith("Compiled: a correct execution exists; out of time before all was counted")
    story = stories.sat_plan([[1, 2]]).plan()
    assert pike.compile(story, "sat", models=True).models == pike.compile(story).models is not None
    assert pike.compile(story, models=False).models is None
    with pytest.raises(InputError, match="models: found '3', expected True or False"):
        pike.compile(story, models=3)
