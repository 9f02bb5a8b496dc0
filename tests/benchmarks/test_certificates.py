"""Certificates of recorded plans: accepted, checked quickly, and small."""

import json
from dataclasses import asdict, replace

import pytest

from benchmarks.certificates import KINDS, LARGEST, SLOWEST, Measured, main, measure, part, run
from tests.certify import tools


def test_one_plan_is_measured(tmp_path):
    found = list(measure("generator", tools.GENERATOR, tmp_path, processes=False))
    assert [each.kind for each in found] == list(KINDS)
    for each in found:
        assert each.rejected is None
        assert min(each.solve, each.produce, each.check) > 0
        assert each.size == (tmp_path / f"generator-{each.kind}.cert").stat().st_size


def test_the_part_tells_the_worst(tmp_path):
    quick = Measured("a", "plan", 2, solve=1.0, produce=2.0, check=0.5, size=1000, established=2, folded=0)
    slow = replace(quick, instance="b", check=2.5, size=2_000_000)
    wrong = replace(quick, instance="c", rejected="line 3: malformed")
    text = part([quick, slow, wrong], "2026-01-01")
    assert "2 of 3 certificates of 3 plans are accepted" in text
    assert "is 2.50 (b, plan)" in text
    assert "has 2.00 MB (b, plan)" in text
    assert "Not accepted: c, plan: line 3: malformed" in text
    assert "| b | 2 | 1.000, 2.000, 2.500; 2.50; 2000 kB | – | – |" in text
    figures, output = tmp_path / "figures.json", tmp_path / "part.md"
    figures.write_text(json.dumps([asdict(quick)]), encoding="utf-8")
    assert main(["--from", str(figures), "--output", str(output)]) == 0
    assert all(len(line) <= 120 for line in output.read_text(encoding="utf-8").splitlines() if line[:1] != "|")


@pytest.mark.slow
def test_all_recorded_plans_and_boxes(dataset):
    found = run(dataset, processes=False, on_result=lambda _: None)
    assert len(found) == 3 * 61
    assert [each for each in found if each.rejected] == []
    assert max(each.ratio for each in found) < SLOWEST
    assert max(each.size for each in found) < LARGEST
