"""Boxes certified at the corners of rates that multiply times that vary: made, accepted, only where corners decide."""

from fractions import Fraction
from random import Random

import pytest

import robust
from robust import Interval, RefutedError, UnsupportedError
from robust.certify.produce import PlanCertificate
from robust.reading import load_plan
from tests.certify import tools
from tests.irr import rovers
from tests.irr.test_rates import drawn_point, is_valid
from tests.sampling import often

PLAN = """parameter d0 default 4 lb 0.01;
parameter drain default 2 lb 0;
parameter load default 1 lb 0;
durative-action instance s0 : (drive);
durative-action instance s1 : (work);
c: s0.start - .zero in [0.001, 2];
c: s0.end - s0.start in [d0, d0];
c: s1.start - s0.end in [0.001, 2];
c: s1.end - s1.start in [1, 3];
"""
BESIDE = '[parameters.drain]\nfluent = "(drain)"\n[parameters.load]\nfluent = "(load)"\n'
VALUES = {"charge": 60, "drain": 2, "gain": 3, "load": 1, "reserve": 5, "capacity": 100}


def written(folder, changes=(), values=VALUES):
    """The files of a plan that drives and works, with texts of the domain that are others."""
    domain = rovers.DOMAIN
    for old, new in changes:
        assert old in domain
        domain = domain.replace(old, new)
    (folder / "plan.toml").write_text(BESIDE, encoding="utf-8")
    return tools.written((domain, rovers.PROBLEM.format(**values), PLAN), folder)


def grounded(files):
    return tools.grounded([*files, files[2].with_suffix(".toml")])


def certificate(files):
    plan = load_plan(*files, parameter_file=files[2].with_suffix(".toml"))
    return plan, PlanCertificate(files, plan)


def test_random_boxes_against_executions(tmp_path):
    """What is certified is valid in drawn executions, and a box that a step more of a side makes false is refused."""
    refused = 0
    for seed in often(range(2), range(100, 160)):
        random = Random(seed)
        values = {**VALUES, **{name: random.randint(1, 4) for name in ("drain", "load")}}
        files = written(tmp_path, values=values)
        plan, certifying = certificate(files)
        found = robust.envelope(plan)
        if not found.verified:
            continue
        lines = certifying.of_box(found.box)
        claim = tools.judged(lines, grounded(files))
        assert (claim.kind, claim.box.keys()) == ("box", found.box.keys())
        for _ in range(10):
            assert is_valid(plan, drawn_point(random, plan, found.box), random), seed
        for point in found.inner.outer:
            shown = point.counterexample
            if shown is None:
                continue
            ends = found.box[point.parameter]
            value = shown.parameters[point.parameter]
            wider = found.box.replace(point.parameter, ends.with_end(point.side, value))
            with pytest.raises(RefutedError):
                certifying.of_box(wider)
            forged = [[*lines[0][:2], [lines[0][2][0], certifying_box(wider)]], *lines[1:]]
            assert isinstance(tools.judged(forged, grounded(files)), str), seed
            refused += 1
    assert refused > 2


def certifying_box(box):
    return [[str(ends.lower), True, str(ends.upper), True] for ends in box.intervals.values()]


def test_the_plan_at_its_nominal_values(tmp_path):
    files = written(tmp_path)
    _, certifying = certificate(files)
    claim = tools.judged(certifying.of_plan(), grounded(files))
    assert claim.kind == "box"
    assert all(values.lower == values.upper for values in claim.box.values())


def test_what_corners_do_not_decide_is_rejected(tmp_path):
    """Each premise of the theorem is checked: honest lines for corners are no certificate where one does not hold."""
    files = written(tmp_path)
    plan, certifying = certificate(files)
    box = robust.envelope(plan).box
    lines = certifying.of_box(box)

    def verdict(*changes, rates=None):
        named = [*lines] if rates is None else [[*lines[0][:2], [rates, lines[0][2][1]]], *lines[1:]]
        return tools.judged(named, grounded(written(tmp_path, changes)))

    assert verdict().kind == "box"
    assert "multiplied by itself" in verdict(("(* #t (* (drain) (factor)))", "(* #t (* (drain) (drain)))"))
    assert "several alternatives" in verdict(
        ("(over all (>= (charge) (reserve)))", "(over all (or (idle) (>= (charge) (reserve))))")
    )
    assert "several alternatives" in verdict(
        ("(over all (>= (charge) (reserve)))", "(over all (not (< (charge) (reserve))))")
    )
    conditional = "(when (at end (>= (charge) 1)) (at end (done)))"
    assert "decides whether" in verdict(
        ("(at end (decrease (charge) (* (load) ?duration)))\n      (at end (done))", conditional)
    )
    assert "bounds a time" in verdict(rates=["d0"])
    for rates in ([], ["drain"], ["load", "drain", "load"], ["other"], ["drain", 1]):
        assert isinstance(verdict(rates=rates), str), rates
    assert isinstance(tools.judged([*lines[:-1]], grounded(written(tmp_path))), str)
    assert isinstance(tools.judged([*lines, lines[-1]], grounded(written(tmp_path))), str)


def test_other_kinds_and_boxes_say_what_to_do(tmp_path):
    _, certifying = certificate(written(tmp_path))
    box = robust.envelope(certifying.plan).box
    with pytest.raises(UnsupportedError, match="use --kind box"):
        certifying.of_box(box, maximal=True)
    with pytest.raises(UnsupportedError, match="has no end, expected `lb=` and `ub=`"):
        certifying.of_box(box.replace("drain", Interval(Fraction(0), None)))
