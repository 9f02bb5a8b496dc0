"""Small random theories, and what is true of them by trying every assignment."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product

from hypothesis import strategies as st

from robust.pike_bridge.knowledge.interface import Commitment, Exclude, Require
from robust.pike_bridge.model import Assignment, Guard, guard
from robust.pike_bridge.theory import All, Formula, Is, Not, Some, Theory, is_model

Model = Mapping[str, str]
Domains = Mapping[str, tuple[str, ...]]


@st.composite
def domains(draw: st.DrawFn, most: int = 5) -> dict[str, tuple[str, ...]]:
    sizes = draw(st.lists(st.sampled_from((2, 3, 2, 1)), min_size=1, max_size=most))
    return {f"v{at}": ("1", "2", "3")[:size] for at, size in enumerate(sizes)}


@st.composite
def environments(draw: st.DrawFn, of: Domains, most: int = 3) -> Guard:
    names = draw(st.lists(st.sampled_from(sorted(of)), max_size=most, unique=True))
    return guard({name: draw(st.sampled_from(of[name])) for name in names})


def formulas(of: Domains) -> st.SearchStrategy[Formula]:
    literals = st.sampled_from([Is(Assignment(name, value)) for name, values in of.items() for value in values])
    return st.recursive(
        literals,
        lambda inner: st.one_of(
            inner.map(Not),
            st.lists(inner, max_size=3).map(lambda parts: All(tuple(parts))),
            st.lists(inner, min_size=1, max_size=3).map(lambda parts: Some(tuple(parts))),
        ),
        max_leaves=6,
    )


@st.composite
def theories(draw: st.DrawFn, most: int = 5) -> Theory:
    found = draw(domains(most))
    constraints = draw(st.lists(formulas(found), max_size=3))
    conflicts = draw(st.lists(environments(found).filter(bool), max_size=4))
    return Theory(found, tuple(constraints), tuple(conflicts))


def commitments(of: Domains) -> st.SearchStrategy[list[Commitment]]:
    one = st.one_of(environments(of).map(Require), environments(of).map(Exclude))
    return st.lists(one, max_size=3)


def scenarios(of: Domains) -> Iterator[dict[str, str]]:
    for values in product(*of.values()):
        yield dict(zip(of, values, strict=True))


def models(theory: Theory) -> list[Model]:
    return [scenario for scenario in scenarios(theory.domains) if is_model(scenario, theory)]


def listed(found: Iterable[Model]) -> list[tuple[tuple[str, str], ...]]:
    return sorted(tuple(sorted(model.items())) for model in found)


def allowed(model: Model, step: Sequence[Commitment]) -> bool:
    for commitment in step:
        holds = all(model[name] == value for name, value in commitment.environment)
        if holds != isinstance(commitment, Require):
            return False
    return True


def prime_implicants(of: Domains, found: Iterable[Model]) -> set[Guard]:
    """The minimal environments that only models extend, among all partial assignments."""
    known = set(listed(found))
    partial = [
        guard({name: value for name, value in zip(of, values, strict=True) if value is not None})
        for values in product(*((None, *values) for values in of.values()))
    ]
    result: set[Guard] = set()
    for environment in sorted(partial, key=len):
        if any(smaller <= environment for smaller in result):
            continue
        fixed = dict(environment)
        extensions = scenarios({name: (fixed[name],) if name in fixed else values for name, values in of.items()})
        if all(tuple(sorted(each.items())) in known for each in extensions):
            result.add(environment)
    return result
