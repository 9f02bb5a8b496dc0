"""What names mean at a place of a PDDL file: lookups that check existence, arity and type."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from robust.errors import InputError, UnsupportedError, did_you_mean
from robust.plan.pddl.forms import Form, Item, Kind, Word, fault, quote
from robust.plan.pddl.syntax import FunctionTerm, Proposition, Signature, Term, TypedName

RESERVED = frozenset(
    "and or not imply forall exists when preference assign increase decrease scale-up scale-down define either".split()  # noqa: SIM905 (a list of words reads better as one text)
)
"""Words that cannot name a predicate or function, because a form that they head means something else."""


@dataclass(frozen=True, slots=True)
class Vocabulary:
    """The declared names of a domain, or of a problem with its domain; `types` as in :class:`Domain`."""

    types: Mapping[str, frozenset[str]]
    objects: Mapping[str, TypedName]
    predicates: Mapping[str, Signature]
    functions: Mapping[str, Signature]


@dataclass(frozen=True, slots=True)
class Scope:
    """The vocabulary with the variables at a place.

    `parameters` are the synthesis parameters, each with whether it belongs to the action. `durative`: `?duration` has
    a meaning.
    """

    vocabulary: Vocabulary
    variables: Mapping[str, TypedName]
    parameters: Mapping[str, bool]
    durative: bool = False

    def bind(self, variables: Iterable[TypedName]) -> Scope:
        """The scope inside a quantifier; its variables hide those of the same name outside."""
        bound = {variable.name: variable for variable in variables}
        visible = {name: local for name, local in self.parameters.items() if name not in bound}
        return replace(self, variables={**self.variables, **bound}, parameters=visible)

    def knows_object(self, item: Item) -> bool:
        """Whether `item` is a word that denotes an object here."""
        if not isinstance(item, Word):
            return False
        if item.kind is Kind.VARIABLE:
            return item.text[1:] in self.variables
        return item.text in self.vocabulary.objects


def unknown_variable(word: Word, scope: Scope) -> InputError:
    """The error for a variable that nothing declares."""
    if word.text == "?duration":
        return fault(word, "a declared variable; only durative actions have a duration")
    known = [f"?{name}" for name in (*scope.variables, *scope.parameters)]
    return fault(word, "a declared variable", hint=did_you_mean(word.text, known))


def term(item: Item, scope: Scope) -> Term:
    """A variable or object."""
    if isinstance(item, Form):
        raise fault(item, "a variable or an object (object-valued functions are not PDDL 2.1)")
    if item.kind is Kind.VARIABLE:
        name = item.text[1:]
        if name in scope.variables:
            return Term(name, variable=True, location=item.location)
        if name in scope.parameters:
            raise fault(item, "an object; it is a synthesis parameter, that is, a number")
        raise unknown_variable(item, scope)
    if item.kind not in (Kind.NAME, Kind.NUMBER):
        raise fault(item, "a variable or an object")
    if item.text not in scope.vocabulary.objects:
        hint = did_you_mean(item.text, scope.vocabulary.objects)
        raise fault(item, "the name of a declared object", hint=hint)
    return Term(item.text, variable=False, location=item.location)


def declaration(of: Term, scope: Scope) -> TypedName:
    """Where the variable or object of a term was declared."""
    return scope.variables[of.name] if of.variable else scope.vocabulary.objects[of.name]


def proposition(form: Form, scope: Scope) -> Proposition:
    """The use of a predicate."""
    head = _name(form, "a predicate")
    signature = scope.vocabulary.predicates.get(head.text)
    if signature is None:
        raise _unknown_predicate(head, scope)
    return Proposition(signature.name, _arguments(form, signature, scope), form.location)


def function(form: Form, scope: Scope) -> FunctionTerm:
    """The use of a numeric function."""
    head = _name(form, "a numeric function")
    signature = scope.vocabulary.functions.get(head.text)
    if signature is None:
        raise _unknown_function(head, scope)
    return FunctionTerm(signature.name, _arguments(form, signature, scope), form.location)


def bare_function(word: Word, scope: Scope) -> FunctionTerm:
    """A function without arguments may be written without parentheses."""
    signature = scope.vocabulary.functions.get(word.text)
    if signature is None:
        if word.text in ("nan", "inf", "infinity"):
            raise fault(word, "a finite number")
        raise _unknown_function(word, scope)
    return FunctionTerm(signature.name, _arguments(Form((word,), word.location), signature, scope), word.location)


def _name(form: Form, kind: str) -> Word:
    if not form.items:
        raise fault(form, f"{kind} after '('")
    head = form.items[0]
    if not isinstance(head, Word) or head.kind is not Kind.NAME:
        raise fault(head, f"{kind} after '('")
    return head


def _unknown_predicate(head: Word, scope: Scope) -> InputError:
    if head.text in scope.vocabulary.functions:
        return fault(head, "a predicate; it is a numeric function, so compare it, as in (>= (f) 0)")
    known = [*scope.vocabulary.predicates, *sorted(RESERVED)]
    return fault(head, "the name of a declared predicate", hint=_suggest(head.text, known, scope.vocabulary.predicates))


def _unknown_function(head: Word, scope: Scope) -> InputError:
    if head.text in scope.vocabulary.predicates:
        return fault(head, "a numeric function; it is a predicate")
    hint = did_you_mean(head.text, scope.vocabulary.functions)
    return fault(head, "the name of a declared numeric function", hint=hint)


def _suggest(name: str, known: Iterable[str], declared: Iterable[str]) -> str:
    """Suggest key words too, but list only the declared names."""
    close = did_you_mean(name, known)
    return close if close.startswith("; did you mean") else did_you_mean(name, declared)


def _arguments(form: Form, signature: Signature, scope: Scope) -> tuple[Term, ...]:
    items, parameters = form.rest, signature.parameters
    if len(items) != len(parameters):
        expected = f"{count(len(parameters), 'argument')} as in {signature}"
        raise fault(form, expected, found=f"{quote(form.head)} with {count(len(items), 'argument')}")
    terms = tuple(term(item, scope) for item in items)
    for used, parameter in zip(terms, parameters, strict=True):
        declared = declaration(used, scope)
        if not may_fit(declared.types, parameter.types, scope.vocabulary.types):
            what = f"{quote(f'?{used.name}' if used.variable else used.name)} of type {type_text(declared.types)}"
            expected = f"type {type_text(parameter.types)} for ?{parameter.name} of {signature}"
            raise fault(used.location, expected, found=what)
    return terms


def count(number: int, noun: str) -> str:
    return f"{number or 'no'} {noun}{'' if number == 1 else 's'}"


def type_text(types: Sequence[str]) -> str:
    return types[0] if len(types) == 1 else f"(either {' '.join(types)})"


def fits(types: Iterable[str], expected: Iterable[str], hierarchy: Mapping[str, frozenset[str]]) -> bool:
    """Whether an object of one of `types` is one of the `expected` types."""
    wanted = set(expected)
    return any(not wanted.isdisjoint(hierarchy[name]) for name in types)


def may_fit(types: Iterable[str], expected: Iterable[str], hierarchy: Mapping[str, frozenset[str]]) -> bool:
    """Whether something declared with `types` can be one of the `expected` types: they have a common subtype.

    Domains do pass a variable of a general type where a special one is expected, so only what can never fit is wrong.
    """
    given, wanted = set(types), set(expected)
    return any(given & ancestors and wanted & ancestors for ancestors in hierarchy.values())


def unsupported(item: Item, what: str, remedy: str) -> UnsupportedError:
    """The error for legal PDDL that this package does not decide."""
    return UnsupportedError(f"found {what}, expected PDDL 2.1 level 3 without it: {remedy}", item.location)
