"""Labeled execution windows [PIKE §3, Equation 1]: when events may be executed, as functions of choices.

The mathematics: fix the times of the executed events E, and let every pending event be now or later. With D the labeled
distances of the augmented plan, a scenario that has a schedule at all has a continuation if and only if in it

- t(j) − t(i) ≤ D(i, j) for all i, j in E, and
- t(i) + D(i, k) ≥ now for all i in E and pending k,

since any negative cycle through these times is made of one such path, or of several. So each labeled distance that is
violated makes its label a conflict. What may be asked besides ("the event is now, and what is not ours is later") adds
an event to E, and raises the times of some k.
"""

from __future__ import annotations

import operator
from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import NamedTuple

from robust.pike_bridge.environment import Environment, Vocabulary
from robust.pike_bridge.model import Tpnu
from robust.pike_bridge.temporal.labeled_apsp import LabeledDistances
from robust.pike_bridge.temporal.labeled_values import LabeledValueSet
from robust.smt.limits import Deadline


class Reach(NamedTuple):
    """A labeled distance to or from an event; the label is without the guards of both ends."""

    event: str
    distance: Fraction
    label: Environment


class DistanceTable:
    """All labeled distances of a network, so that none has to be found while it is executed.

    Raises:
        OutOfTimeError: if the deadline passes first.
    """

    def __init__(self, network: Tpnu, distances: LabeledDistances, deadline: Deadline) -> None:
        self.vocabulary: Vocabulary = distances.vocabulary
        self.guards: Mapping[str, Environment] = {
            event.name: self.vocabulary.encode(event.guard) for event in network.events
        }
        self.after: dict[str, list[Reach]] = {event: [] for event in self.guards}
        """D(event, other) for every other event."""
        self.before: dict[str, list[Reach]] = {event: [] for event in self.guards}
        """D(other, event) for every other event."""
        for source in self.guards:
            deadline.enforce()
            for target in self.guards:
                if source != target:
                    for distance, label in distances.labeled(source, target):
                        self.after[source].append(Reach(target, distance, label))
                        self.before[target].append(Reach(source, distance, label))


class Windows:
    """Execution windows of pending events: labeled value sets that each execution tightens.

    Bounds are absolute times; labels are without the guard of the event itself.
    """

    def __init__(self, table: DistanceTable) -> None:
        self._table = table
        self.lower: dict[str, LabeledValueSet[Fraction]] = {}
        """(l, φ): in φ, the event is at l or later."""
        self.upper: dict[str, LabeledValueSet[Fraction]] = {}
        """(u, φ): in φ, the event is at u or earlier."""
        for event in table.guards:
            self.lower[event] = LabeledValueSet(table.vocabulary, operator.gt)
            self.upper[event] = LabeledValueSet(table.vocabulary, operator.lt)

    def executed(self, event: str, time: Fraction, known: Environment) -> None:
        """Propagate a time to the windows of all other events [PIKE, Equation 1]; what is known not to be is left out.

        `known` says which assignments hold for certain; labels are kept without them.
        """
        del self.lower[event], self.upper[event]
        for windows, reaches, sign in ((self.upper, self._table.after, 1), (self.lower, self._table.before, -1)):
            for other, distance, label in reaches[event]:
                window = windows.get(other)
                if window is not None and self._table.vocabulary.consistent(label | known):
                    window.add(time + sign * distance, label & ~known)

    def drop(self, event: str) -> None:
        """The event is not activated."""
        self.lower.pop(event, None)
        self.upper.pop(event, None)

    def missed(self, event: str, now: Fraction) -> Iterator[Environment]:
        """Where the event would have had to be executed before now [PIKE, Algorithm 1, line 6]."""
        guard = self._table.guards[event]
        for bound, label in self.upper.get(event, ()):
            if bound < now:
                yield label | guard

    def early(self, event: str, now: Fraction) -> Iterator[Environment]:
        """Where the event must not be executed yet [PIKE §3, constraint 3]."""
        guard = self._table.guards[event]
        for bound, label in self.lower.get(event, ()):
            if bound > now:
                yield label | guard
