"""unified-planning objects in and out, with exact numbers."""

import sys
from fractions import Fraction

import pytest

from robust.errors import InputError, UnsupportedError
from robust.execute.convert import convert
from robust.execute.distances import InvalidPlanError
from robust.irr.check import Answer
from robust.plan.model import Atom, Fluent, TimedLiteral
from robust.plan.parameters import parse_specs
from robust.reading import validate
from robust.unified_planning.convert import from_unified_planning, to_unified_planning

up = pytest.importorskip("unified_planning.shortcuts")
model = pytest.importorskip("unified_planning.model")
plans = pytest.importorskip("unified_planning.plans")
pytestmark = pytest.mark.filterwarnings("ignore")

THIRD = Fraction(1, 3)


def deliveries(deadline=Fraction(20)):
    """A van drives and honks; driving takes a third of a minute a mile and burns fuel all the while."""
    place = up.UserType("Place")
    at = up.Fluent("at", up.BoolType(), p=place)
    lit, heard = (up.Fluent(name, up.BoolType()) for name in ("lit", "heard"))
    fuel, miles = up.Fluent("fuel", up.RealType()), up.Fluent("miles", up.RealType(), a=place, b=place)
    drive = up.DurativeAction("Drive", a=place, b=place)
    a, b = drive.parameter("a"), drive.parameter("b")
    drive.set_closed_duration_interval(up.Times(THIRD, miles(a, b)), up.Times(2, miles(a, b)))
    drive.add_condition(up.StartTiming(), at(a))
    drive.add_condition(up.OpenTimeInterval(up.StartTiming(), up.EndTiming()), lit)
    drive.add_condition(up.OpenTimeInterval(up.StartTiming(), up.EndTiming()), up.GE(fuel, THIRD))
    drive.add_effect(up.StartTiming(), at(a), False)
    drive.add_effect(up.EndTiming(), at(b), True)
    drive.add_decrease_continuous_effect(up.ClosedTimeInterval(up.StartTiming(), up.EndTiming()), fuel, 1)
    honk = up.InstantaneousAction("honk", a=place)
    honk.add_precondition(at(honk.parameter("a")))
    honk.add_precondition(up.Not(heard))
    honk.add_effect(heard, True)
    problem = up.Problem("deliveries", initial_defaults={up.BoolType(): False})
    problem.add_fluents([at, lit, heard, fuel, miles])
    problem.add_actions([drive, honk])
    home, shop = problem.add_objects([up.Object("home", place), up.Object("Shop", place)]) or problem.all_objects
    initial = {at(home): True, lit: True, fuel: Fraction(22, 3)}
    initial |= {miles(x, y): 3 for x in (home, shop) for y in (home, shop)}
    for fluent, value in initial.items():
        problem.set_initial_value(fluent, value)
    problem.add_timed_effect(up.GlobalStartTiming(deadline), lit, False)
    problem.add_goal(heard)
    problem.add_goal(at(shop))
    return problem


def plan_of(problem, start=THIRD, duration=Fraction(7, 3)):
    home, shop = (up.ObjectExp(one) for one in problem.all_objects)
    steps = [
        (start, plans.ActionInstance(problem.action("Drive"), (home, shop)), duration),
        (start + duration + THIRD, plans.ActionInstance(problem.action("honk"), (shop,)), None),
    ]
    return plans.TimeTriggeredPlan(steps)


def test_numbers_stay_exact():
    problem = deliveries(deadline=Fraction(61, 3))
    domain, read, timed = from_unified_planning(problem, plan_of(problem))
    assert [(one.time, one.duration) for one in timed.steps] == [(THIRD, Fraction(7, 3)), (Fraction(3), None)]
    assert [(one.action, one.arguments) for one in timed.steps] == [("drive", ("home", "shop")), ("honk", ("shop",))]
    assert read.atoms == {Atom("at", ("home",)), Atom("lit")}
    assert read.fluents[Fluent("fuel")] == Fraction(22, 3)
    assert read.timed_literals == (TimedLiteral(Fraction(61, 3), Atom("lit"), False),)
    assert set(domain.actions) == {"drive", "honk"}


def test_conversion_there_and_back():
    problem = deliveries()
    found = convert(*from_unified_planning(problem, plan_of(problem)))
    assert validate(*from_unified_planning(problem, plan_of(problem))).valid
    assert found.check.answer is Answer.PROVED
    returned = to_unified_planning(found.stn, problem)
    kinds = model.TimepointKind
    bounds = {}
    for source, others in returned.get_constraints().items():
        for lower, upper, target in others:
            names = [
                "zero" if node.kind is kinds.GLOBAL_START else f"{node.action_instance.action.name} {node.kind.name}"
                for node in (source, target)
                if node.kind is not kinds.GLOBAL_END
            ]
            if len(names) == 2:
                bounds[tuple(names)] = (lower, upper)
    # From above, fuel: 22/3 - d >= 1/3; the domain allows 1 to 6.
    assert bounds["Drive START", "Drive END"] == (Fraction(1), Fraction(6))
    assert bounds["Drive END", "honk START"][0] == Fraction(1, 1000)
    assert returned.is_consistent()


def test_parameters_stand_for_their_values():
    problem = deliveries()
    found = convert(*from_unified_planning(problem, plan_of(problem)), specs=parse_specs(["duration:drive"]))
    assert [one.name for one in found.stn.parameters] == ["dur_n0"]
    exact = to_unified_planning(found.stn, problem, {"dur_n0": Fraction(10, 7)})
    values = {bound for others in exact.get_constraints().values() for one in others for bound in one[:2]}
    assert Fraction(10, 7) in values


def test_what_cannot_be_converted_is_refused():
    problem, soon = deliveries(), deliveries(deadline=Fraction(2))
    plan = plan_of(problem)
    # which unified-planning finds valid
    with pytest.raises(InvalidPlanError, match=r"invalid plan: found 'n0 drive: over all \(lit\)' broken at time 2"):
        convert(*from_unified_planning(soon, plan_of(soon)))
    with pytest.raises(InputError, match="found a PartialOrderPlan, expected a sequential, "):
        from_unified_planning(problem, plans.PartialOrderPlan({}, problem.environment))
    with pytest.raises(InputError, match="empty plan: found no step"):
        convert(*from_unified_planning(problem, plans.TimeTriggeredPlan([], problem.environment)))
    with pytest.raises(InputError, match="found action 'drive', expected one of the problem"):
        to_unified_planning(convert(*from_unified_planning(problem, plan)).stn, up.Problem("empty"))
    problem.add_timed_goal(up.GlobalStartTiming(5), problem.fluent("lit")())
    with pytest.raises(UnsupportedError, match="found timed goals"):
        from_unified_planning(problem, plan)


def test_a_missing_extra_is_said(monkeypatch):
    monkeypatch.setitem(sys.modules, "unified_planning.plans", None)
    with pytest.raises(UnsupportedError, match=r"pip install 'robust-plans\[up\]'"):
        from_unified_planning(None, None)
