"""The checker that Coq proves right (`proofs/kernel/`): what it is given, and what it says.

`terms` prints the ground plan in the terms of its specification, which is trusted. `claims` makes its input from a
certificate, with refutations that `questions` finds; nothing of that is trusted.
"""
