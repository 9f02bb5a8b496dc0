"""What nature draws in one run.

Every draw has a random number of its own, made of the run's seed, what is drawn, and how often that has been drawn
before. So two executors that meet in the same world with the same seed have the same luck, whatever order they do
things in: results can be compared pair by pair.
"""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
from random import Random

from robust.execute.worlds.distributions import draw
from robust.execute.worlds.rules import Rule, Rules
from robust.plan.model import ActionInstance, Fluent


class Luck:
    """The draws of one run; durations are never below 0."""

    def __init__(self, rules: Rules, seed: int | str) -> None:
        self.rules = rules
        self._seed = seed
        self._count: Counter[str] = Counter()
        self._kept: dict[str, Fraction] = {}

    def duration(self, instance: ActionInstance, planned: Fraction) -> Fraction | None:
        """How long an instance takes this time; None without a rule."""
        rule = self.rules.duration(instance)
        return None if rule is None else max(self._draw(rule, f"duration {instance}", planned), Fraction(0))

    def consumption(self, instance: ActionInstance, fluent: Fluent, planned: Fraction) -> Fraction | None:
        """The value of a fluent for an instance; None without a rule."""
        rule = self.rules.consumption(fluent)
        return None if rule is None else self._draw(rule, f"{fluent} of {instance}", planned)

    def parameter(self, name: str, planned: Fraction, *, once: bool) -> Fraction | None:
        """The value of a parameter; None without a rule. With `once` it stays what it was when it was drawn first."""
        rule = self.rules.parameter(name)
        if rule is None:
            return None
        if not once:
            return self._draw(rule, f"parameter {name}", planned)
        if name not in self._kept:
            self._kept[name] = self._draw(rule, f"parameter {name}", planned)
        return self._kept[name]

    def _draw(self, rule: Rule, what: str, planned: Fraction) -> Fraction:
        number = self._count[what]
        self._count[what] += 1
        return draw(rule.of(planned), Random(f"{self._seed}/{what}/{number}"))  # noqa: S311 - no secrets here
