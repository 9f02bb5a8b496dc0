"""What a temporal network says about the order of its time points whatever the parameters are.

All-pairs longest paths over exact integers [Dechter, Meiri and Pearl 1991, STN]: `t_b − t_a ≥ least(a, b)` holds for
every schedule and every parameter value within declared bounds.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction

from robust.plan.model import TimePoint

# Only ever compared and added: Python compares integers with infinities exactly.
NO_BOUND = -math.inf

Edge = tuple[TimePoint, TimePoint, Fraction]
"""(a, b, w): t_b − t_a ≥ w."""


class Orders:
    """Greatest known lower bounds between time points; more edges may be learnt.

    `consistent` is False if the edges contradict each other; the bounds mean nothing then.
    """

    def __init__(self, points: Sequence[TimePoint], edges: Iterable[Edge], scale: int) -> None:
        """`scale` must make every weight, of these edges and of later ones, an integer."""
        self._index = {point: index for index, point in enumerate(points)}
        self._scale = scale
        size = len(points)
        self._least: list[list[int | float]] = [[NO_BOUND] * size for _ in range(size)]
        for index in range(size):
            self._least[index][index] = 0
        for source, target, weight in edges:
            row, column = self._least[self._index[source]], self._index[target]
            row[column] = max(row[column], self._scaled(weight))
        self._close()
        self.consistent = all(self._least[index][index] == 0 for index in range(size))

    def _scaled(self, weight: Fraction) -> int:
        scaled = weight * self._scale
        return scaled.numerator // scaled.denominator

    def _close(self) -> None:
        least = self._least
        for middle, via in enumerate(least):
            for index, row in enumerate(least):
                first = row[middle]
                if first != NO_BOUND and index != middle:
                    least[index] = [
                        known if known >= first + rest else first + rest for known, rest in zip(row, via, strict=True)
                    ]

    def least(self, source: TimePoint, target: TimePoint) -> Fraction | None:
        """The greatest known w with t_target − t_source ≥ w; None if nothing is known."""
        value = self._least[self._index[source]][self._index[target]]
        return None if value == NO_BOUND else Fraction(int(value), self._scale)

    def learn(self, source: TimePoint, target: TimePoint, weight: Fraction) -> bool:
        """Add t_target − t_source ≥ weight and its consequences.

        Returns False, and changes nothing, if that was known or contradicts what is known.
        """
        a, b, scaled = self._index[source], self._index[target], self._scaled(weight)
        if self._least[a][b] >= scaled or self._least[b][a] + scaled > 0:
            return False
        tail = list(self._least[b])
        for index, row in enumerate(self._least):
            first = row[a]
            if first != NO_BOUND and first + scaled > row[b]:
                first += scaled
                self._least[index] = [
                    known if known >= first + rest else first + rest for known, rest in zip(row, tail, strict=True)
                ]
        return True

    def surely_before(self, first: TimePoint, second: TimePoint) -> bool:
        """Whether t_first < t_second in every schedule."""
        return self._least[self._index[first]][self._index[second]] > 0

    def surely_not_after(self, first: TimePoint, second: TimePoint) -> bool:
        """Whether t_first ≤ t_second in every schedule."""
        return self._least[self._index[first]][self._index[second]] >= 0


def common_scale(numbers: Iterable[Fraction]) -> int:
    """The least integer that makes every number an integer."""
    return math.lcm(*(number.denominator for number in numbers))
