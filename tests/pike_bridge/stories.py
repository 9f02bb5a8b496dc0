"""The plans that the paper shows: its figures, the kitchen and the wing."""

from robust.pike_bridge.figures import (
    figure_6a,
    figure_6b,
    figure_7a,
    figure_7b,
    figure_8,
    figure_9,
    figure_11,
    figure_13,
    figure_23,
    shipped,
)

__all__ = [
    "figure_6a",
    "figure_6b",
    "figure_7a",
    "figure_7b",
    "figure_8",
    "figure_9",
    "figure_11",
    "figure_13",
    "figure_23",
    "kitchen",
    "wing",
]


def kitchen():
    """The breakfast plan. Choices: Alice's xA1 to xA4 (uncontrollable), the robot's xR1 and xR2."""
    return shipped("kitchen")


def wing():
    """The wing of an aeroplane. Choices: the human's h1 and h2 (uncontrollable), Baxter's b1 and b2."""
    return shipped("wing")
