"""What causal reasoning asks of temporal reasoning [PIKE, Definitions 4.1 to 4.3]."""

from __future__ import annotations

from typing import Protocol

from robust.pike_bridge.environment import Environment, Vocabulary


class Precedence(Protocol):
    """Which events precede which, as far as some method of temporal reasoning can tell.

    Sound, not necessarily complete: True is a proof, False may be ignorance. Environments are of `vocabulary`, which
    holds the choice variables of the network that was analysed; variables that an augmented plan adds do not matter
    here, so callers leave them out.
    """

    vocabulary: Vocabulary

    def precedes(self, first: str, second: str, context: Environment) -> bool:
        """first ≺ second in the context: in every temporally consistent execution in which both events and the context
        hold, `first` is strictly before `second`. The guards of both events are added to the context here."""

    def conflicting(self, environment: Environment) -> bool:
        """Whether the environment is known to be a temporal conflict: no scenario in it has a schedule."""
