"""All environments over a few finite-domain variables, as names of truth values: for bounded problems."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TypeAlias

from proofs.theorems._library.terms import Command, Term, any_of, const

Environment: TypeAlias = tuple[int, ...]
"""For each variable its value, 0 if it is not assigned."""


@dataclass(frozen=True, slots=True)
class Universe:
    """Variables with domains 1 … n."""

    domains: tuple[int, ...]

    @property
    def environments(self) -> list[Environment]:
        return list(product(*(range(size + 1) for size in self.domains)))

    @property
    def scenarios(self) -> list[Environment]:
        return list(product(*(range(1, size + 1) for size in self.domains)))

    def set_of(self, name: str) -> tuple[Command, ...]:
        """An arbitrary set of environments: one truth value each."""
        return tuple(const(member(name, environment), "Bool") for environment in self.environments)

    def holds_some(self, name: str, environment: Environment) -> Term:
        """Some member of the set is part of the environment."""
        return any_of(member(name, part) for part in self.environments if entails(environment, part))


def member(name: str, environment: Environment) -> Term:
    """The truth value that says that a set has an environment."""
    return f"{name}-{''.join(map(str, environment))}"


def entails(environment: Environment, part: Environment) -> bool:
    """Each assignment of the part is one of the environment."""
    return all(there in (0, here) for here, there in zip(environment, part, strict=True))


def union(first: Environment, second: Environment) -> Environment | None:
    """Both together; None if they assign different values to a variable."""
    if any(a and b and a != b for a, b in zip(first, second, strict=True)):
        return None
    return tuple(a or b for a, b in zip(first, second, strict=True))


def assign(environment: Environment, variable: int, value: int) -> Environment:
    """The environment with another value of one variable; 0 takes its assignment away."""
    return (*environment[:variable], value, *environment[variable + 1 :])


def text(environment: Environment) -> str:
    assigned = [f"{'xyz'[index]}={value}" for index, value in enumerate(environment) if value]
    return "{" + ", ".join(assigned) + "}"
