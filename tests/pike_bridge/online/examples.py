"""Plans with choices that admit a correct execution."""

from pathlib import Path

KITCHEN = Path(__file__).parents[3] / "robust" / "examples" / "kitchen" / "kitchen.tpnu.json"
SOLVABLE = (0, 4, 5, 16, 17, 19, 26, 34, 42, 53, 70, 71, 83, 87, 92, 94, 103, 108, 119, 121)
"""Of the random plans of seed 0."""
