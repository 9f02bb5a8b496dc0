"""Parts of the results page that are measured on their own."""

from pathlib import Path

from benchmarks.parts import MARK, PARTS, RESULTS, joined, team_plans, team_report

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
