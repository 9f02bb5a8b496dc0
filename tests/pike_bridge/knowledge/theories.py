"""Small random theories, and what is true of them by trying every assignment."""

from hypothesis import strategies as st

from robust.pike_bridge.model import Assignment, guard
from robust.pike_bridge.theory import All, Exclude, Is, Not, Require, Some, Theory
from tests.pike_bridge.brute_force import scenarios


@st.composite
def domains(draw, most=5):
    sizes = draw(st.lists(st.sampled_from((2, 3, 2, 1)), min_size=1, max_size=most))
    return {f"v{at}": ("1", "2", "3")[:size] for at, size in enumerate(sizes)}


@st.composite
def environments(draw, of, most=3):
    names = draw(st.lists(st.sampled_from(sorted(of)), max_size=most, unique=True)) if of else ()
    return guard({name: draw(st.sampled_from(of[name])) for name in names})


def formulas(of):
    literals = st.sampled_from([Is(Assignment(name, value)) for name, values in of.items() for value in values])

    def deeper(inner):
        several = st.lists(inner, min_size=1, max_size=3).map(tuple)
        return inner.map(Not) | st.lists(inner, max_size=3).map(tuple).map(All) | several.map(Some)

    return st.recursive(literals, deeper, max_leaves=6)


@st.composite
def theories(draw, most=5, of=None):
    of = of or draw(domains(most))
    constraints = draw(st.lists(formulas(of), max_size=3))
    conflicts = draw(st.lists(environments(of).filter(bool), max_size=4))
    return Theory(of, tuple(constraints), tuple(conflicts))


def commitments(of):
    return st.lists(environments(of).map(Require) | environments(of).map(Exclude), max_size=3)


def satisfies(scenario, formula):
    """Whether a full assignment satisfies a formula."""
    match formula:
        case Is((variable, value)):
            return scenario[variable] == value
        case Not(operand):
            return not satisfies(scenario, operand)
        case All(operands):
            return all(satisfies(scenario, each) for each in operands)
        case Some(operands):
            return any(satisfies(scenario, each) for each in operands)


def is_model(scenario, theory):
    """Whether a full assignment satisfies every constraint and resolves every conflict."""
    return all(satisfies(scenario, each) for each in theory.constraints) and not any(
        conflict <= guard(scenario) for conflict in theory.conflicts
    )


def models(theory):
    return [scenario for scenario in scenarios(theory.domains) if is_model(scenario, theory)]


def allowed(model, step):
    return all((each.environment <= guard(model)) == isinstance(each, Require) for each in step)


def prime_implicants(of, found):
    """The minimal environments that only models extend, among all partial assignments."""
    known = set(map(guard, found))
    partial = scenarios({name: (None, *values) for name, values in of.items()})
    result = set()
    for fixed in sorted(partial, key=lambda fixed: sum(value is not None for value in fixed.values())):
        environment = guard({name: value for name, value in fixed.items() if value is not None})
        extensions = scenarios({name: values if fixed[name] is None else (fixed[name],) for name, values in of.items()})
        if not any(smaller <= environment for smaller in result) and known.issuperset(map(guard, extensions)):
            result.add(environment)
    return result
