"""Parts of the results page that are measured on their own."""

from pathlib import Path

from benchmarks.parts import MARK, PARTS, RESULTS, joined, k_intents, latencies, latency_report, team_plans, team_report
from robust.bench.k_intents import report_of
from robust.bench.latency import measure_latencies

PRINTED = {
    "complete": True,
    "limit": 60.0,
    "seed": 0,
    "jobs": 1,
    "plans": [{"instance": "a", "activities": 3, "candidate_subplans": 4}],
    "runs": [
        {
            "contender": "oracle",
            "instance": "a",
            "seconds": 0.5,
            "memory_mb": 80.0,
            "satisfiable": True,
            "candidate_subplans": None,
            "prime_implicants": None,
            "models": None,
            "stages": {"formula": 0.1, "search": 0.05},
            "message": None,
        },
        {
            "contender": "pitms",
            "instance": "a",
            "seconds": 0.7,
            "memory_mb": 90.0,
            "satisfiable": True,
            "candidate_subplans": 4,
            "prime_implicants": 3,
            "models": 2,
            "stages": {"links": 0.1},
            "message": None,
        },
    ],
}


def test_the_page_shows_the_parts_as_they_are():
    text = RESULTS.read_text(encoding="utf-8")
    assert text == joined(text)
    for path in PARTS.glob("*.md"):
        assert Path(path).read_text(encoding="utf-8").strip() in text


def test_joining_replaces_older_parts():
    assert joined(f"# Own\n\n{MARK}\n\n## Old\n").startswith(f"# Own\n\n{MARK}\n\n## ")
    assert "## Old" not in joined(f"# Own\n\n{MARK}\n\n## Old\n")


def test_team_plans_from_what_was_printed():
    text = team_plans(team_report(PRINTED), "2026-01-01")
    assert "| oracle | 1 | 1 | 0.50 | 0.50 | 0.50 | 0 | 80 |" in text
    assert "0.15 s median, 0.15 s at most" in text
    assert "More implicants than models: 1 of 1 plans" in text


def test_latencies_of_executions():
    (measured,) = measure_latencies([53])
    assert measured.outcome == "succeeded"
    assert measured.steps
    assert measured.wakes
    assert min(*measured.steps, *measured.wakes, measured.preparation) > 0


def test_the_part_about_latencies():
    def execution(backend, instance, outcome, steps):
        return {
            "backend": backend,
            "instance": instance,
            "outcome": outcome,
            "preparation_seconds": 0.25,
            "step_seconds": steps,
            "wake_seconds": [0.002],
            "decisions": 2,
            "message": None,
        }

    printed = {
        "complete": True,
        "seed": 0,
        "limit": 60.0,
        "jobs": 1,
        "problems": 3,
        "decided": 3,
        "admitting": ["a", "b"],
        "executions": [
            execution("smt", "a", "succeeded", [0.001, 0.004]),
            execution("smt", "b", "failed", [0.003, 0.2]),
            execution("bdd", "a", "succeeded", [0.001]),
            execution("bdd", "b", "timeout", [0.5]),
        ],
    }
    text = latencies(latency_report(printed), [], "2026-01-01")
    assert "| smt | 2 | 2 | 1 | 0 | 250.0 | 250.0 | 2.0 |" in text
    assert "| bdd | 1 | 2 | 1 | 1 | 250.0 | 250.0 | 2.0 |" in text
    assert "| smt | 4 | 3.5 | 102.0 | 200.0 | 200.0 | 1 (50.0%) | 2 (100.0%) |" in text
    assert "same decisions" in text
    assert "differ between back ends: 1." in latencies(latency_report(printed), ["b: smt and bdd"], "2026-01-01")


def test_the_part_about_guessed_intents():
    pike = {"outcome": "succeeded", "time": "15/2", "replans": 0, "recovery": "0", "seconds": 0.5}
    kirk = pike | {"time": "10", "replans": 2, "recovery": "5/2", "seconds": 1.0}
    printed = {
        "schema": "robust/bench-figure18/1",
        "complete": True,
        "seed": 0,
        "problems": 1,
        "largest": 10,
        "reasoner": "smt",
        "limit": 60.0,
        "jobs": 1,
        "notes": [],
        "runs": [{"index": 0, "structure": [2, 2], "intents": 4, "pike": pike, "kirk": kirk}],
    }
    text = k_intents(report_of(printed), "2026-01-01")
    assert "| 2 | 1 | 2.00 | – | 2 | 1.00 | 0 |" in text
    assert "| 2 | 1 | 7.50 | 10.00 | 25.0 | – | 25.0 | 25.0 | 0.500 | 1.000 |" in text
    assert "| of Kirk's time, with computing | 27.3 | – | 13.4 |" in text
    # Half of the guesses are wrong: 0.3125 of recovery to 3.5 of activities.
    assert "0.500 of the guesses are wrong" in " ".join(text.split())
    assert "save 8.2% of Kirk's time" in " ".join(text.split())
    assert max(len(line) for line in text.splitlines() if not line.startswith("|")) <= 120
