"""Plans with choices of k intents, which the package makes itself."""

from robust.pike_bridge.k_intents import KIntents, closest_factors, k_intents, random_k_intents

__all__ = ["KIntents", "closest_factors", "k_intents", "random_k_intents"]
