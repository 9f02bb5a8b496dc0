"""A planner that always has the same plan: the file beside it in which the shipped rover visits both sites."""

import sys
from pathlib import Path

sys.stdout.write((Path(__file__).parent / "navigation-steps.plan").read_text(encoding="utf-8"))
