"""What a PDDL file declares, and what names mean at a place: lookups that check existence, arity and type."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from robust.errors import InputError, InputWarning, Location, UnsupportedError, did_you_mean
from robust.plan.pddl.forms import Form, Item, Kind, Word, fault, is_word, quote
from robust.plan.pddl.syntax import OBJECT, FunctionTerm, Proposition, Signature, Term, TypedName
from robust.plan.pddl.write import type_text

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
        """The scope inside an action or a quantifier; its variables hide those of the same name outside."""
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
        if scope.variables and not scope.vocabulary.objects:
            hint = "; actions name objects that the domain declares, as in (:constants hub - place)"
        raise fault(item, "the name of a declared object", hint=hint)
    return Term(item.text, variable=False, location=item.location)


def declaration(of: Term, scope: Scope) -> TypedName:
    """Where the variable or object of a term was declared."""
    return scope.variables[of.name] if of.variable else scope.vocabulary.objects[of.name]


def proposition(form: Form, scope: Scope) -> Proposition:
    """The use of a predicate."""
    head = _name(form, "a predicate")
    signature = scope.vocabulary.predicates.get(head.text) or _of_one_type(head, scope.vocabulary)
    if signature is None:
        raise _unknown_predicate(head, scope)
    return Proposition(signature.name, _arguments(form, signature, scope), form.location)


def _of_one_type(head: Word, vocabulary: Vocabulary) -> Signature | None:
    """`in_crate` for `(in ?x - (either crate area) …)`: so some problems of the competitions split predicates."""
    name, _, type_name = head.text.rpartition("_")
    signature = vocabulary.predicates.get(name)
    if signature is None or not any(type_name in p.types and len(p.types) > 1 for p in signature.parameters):
        return None
    place = Location(head.location.file)  # once for a file: warnings of equal texts are shown once
    warn(f"found undeclared predicate '{head.text}', took it for '{name}' of type '{type_name}'", place)
    return signature


def function(item: Item, scope: Scope) -> FunctionTerm:
    """The use of a numeric function; one without arguments may be written without parentheses."""
    form = Form((item,), item.location) if isinstance(item, Word) else item
    head = _name(form, "a numeric function")
    signature = scope.vocabulary.functions.get(head.text)
    if signature is None:
        if item is head and head.text in ("nan", "inf", "infinity"):
            raise fault(head, "a finite number")
        raise _unknown_function(head, scope)
    return FunctionTerm(signature.name, _arguments(form, signature, scope), form.location)


def _name(form: Form, kind: str) -> Word:
    head = form.items[0] if form.items else form
    if not is_word(head, Kind.NAME):
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


def choices(
    variables: Iterable[TypedName], objects: Mapping[str, TypedName], hierarchy: Mapping[str, frozenset[str]]
) -> list[list[str]]:
    """The names of the objects that each variable may stand for."""
    return [
        [name for name, known in objects.items() if fits(known.types, variable.types, hierarchy)]
        for variable in variables
    ]


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


_REQUIREMENTS = (
    # PDDL 1.2
    "strips typing negative-preconditions disjunctive-preconditions equality existential-preconditions "
    "universal-preconditions quantified-preconditions conditional-effects adl ucpop action-expansions "
    "foreach-expansions dag-expansions domain-axioms subgoal-through-axioms subgoals-through-axioms "
    "safety-constraints expression-evaluation fluents open-world true-negation "
    # PDDL 2.1 to 3.1
    "durative-actions duration-inequalities continuous-effects timed-initial-literals timed-initial-fluents "
    "timed-effects derived-predicates preferences constraints goal-utilities action-costs numeric-fluents "
    "object-fluents "
    # PDDL+, and parameters to synthesise
    "time processes events synth-parameters"
)
REQUIREMENTS = frozenset(f":{name}" for name in _REQUIREMENTS.split())


def check_requirements(items: Iterable[Item]) -> None:
    """InputError for an unknown requirement; a domain may use more than it requires."""
    for item in items:
        if not is_word(item, Kind.KEYWORD):
            raise fault(item, "a requirement such as :durative-actions")
        if item.text not in REQUIREMENTS:
            raise fault(item, "a requirement of PDDL", hint=did_you_mean(item.text, REQUIREMENTS))


def typed_list(items: Sequence[Item], kind: Kind, what: str) -> list[tuple[Word, tuple[Word, ...]]]:
    """The words of `a b - t c - (either u v)` with the names of their types (none: not given)."""
    result: list[tuple[Word, tuple[Word, ...]]] = []
    pending: list[Word] = []
    remaining = _with_blanks(items)
    for item in remaining:
        if _is_dash(item):
            if not pending:
                raise fault(item, f"{what} before '-'")
            following = next(remaining, None)
            if following is None:
                raise fault(item, "a type after '-'", found="nothing after '-'")
            types = _type_names(following)
            result.extend((word, types) for word in pending)
            pending = []
        elif is_word(item, kind):
            pending.append(item)
        else:
            raise fault(item, f"{what}{' (a name that begins with ?)' if kind is Kind.VARIABLE else ''}")
    return result + [(word, ()) for word in pending]


def _with_blanks(items: Iterable[Item]) -> Iterator[Item]:
    """The items, with `- t` for every `-t`."""
    for item in items:
        if is_word(item, Kind.DASHED):
            name = item.text[1:]
            warn(f"found '{item.text}', took it for '- {name}'", item.location)
            yield Word(Kind.OPERATOR, "-", item.location)
            yield Word(Kind.NAME, name, item.location)
        else:
            yield item


def _is_dash(item: Item) -> bool:
    return is_word(item, Kind.OPERATOR) and item.text == "-"


def _type_names(item: Item) -> tuple[Word, ...]:
    items = item.rest if isinstance(item, Form) and item.head == "either" else (item,)
    names = tuple(word for word in items if is_word(word, Kind.NAME))
    if names and len(names) == len(items):
        return names
    raise fault(item, "a type, as in '- truck' or '- (either truck ship)'")


def types(items: Sequence[Item]) -> dict[str, frozenset[str]]:
    """The hierarchy as every type with all its ancestors and itself."""
    parents: dict[str, set[str]] = {OBJECT: set()}
    places: dict[str, Word] = {}
    for word, above in typed_list(items, Kind.NAME, "the name of a type"):
        names = {parent.text for parent in above} or {OBJECT}
        if (first := places.get(word.text)) is not None and parents[word.text] != names:
            found = f"found a second, different type '{word.text}', took both; the first is at {first.location}"
            warn(found, word.location)
            names |= parents[word.text]
        if word.text == OBJECT and above and names != {OBJECT}:
            raise fault(word, "no type above it: every type is below 'object'")
        places[word.text] = word
        parents[word.text] = names if word.text != OBJECT else set()
        for parent in above:  # a type that only appears above others is declared by that
            parents.setdefault(parent.text, {OBJECT})
    return {name: _ancestors(name, parents, places) for name in parents}


def _ancestors(name: str, parents: Mapping[str, set[str]], places: Mapping[str, Word]) -> frozenset[str]:
    above = {OBJECT}
    todo = [*parents[name]]
    while todo:
        parent = todo.pop()
        if parent == name:
            raise fault(places[name], "a type hierarchy without cycles", found=f"{quote(name)} above itself")
        if parent not in above:
            above.add(parent)
            todo.extend(parents[parent])
    return frozenset({*above, name})


def typed_names(
    items: Sequence[Item], kind: Kind, what: str, hierarchy: Mapping[str, frozenset[str]]
) -> list[TypedName]:
    """Declared variables or objects with types that exist."""
    result = []
    for word, above in typed_list(items, kind, what):
        for name in above:
            if name.text not in hierarchy:
                raise fault(name, "a declared type", hint=did_you_mean(name.text, hierarchy))
        alternatives = tuple(dict.fromkeys(name.text for name in above)) or (OBJECT,)
        text = word.text[1:] if kind is Kind.VARIABLE else word.text
        result.append(TypedName(text, alternatives, word.location))
    return result


def variables(items: Sequence[Item], hierarchy: Mapping[str, frozenset[str]]) -> tuple[TypedName, ...]:
    """The variables of an action, a predicate, a function or a quantifier; their names differ."""
    result = tuple(typed_names(items, Kind.VARIABLE, "a variable", hierarchy))
    seen: set[str] = set()
    for variable in result:
        if variable.name == "duration":
            raise fault(variable.location, "another name: it is the duration of the action", found="'?duration'")
        if variable.name in seen:
            found = f"a second variable '?{variable.name}'"
            raise fault(variable.location, "variables of different names", found=found)
        seen.add(variable.name)
    return result


def objects(
    items: Sequence[Item], hierarchy: Mapping[str, frozenset[str]], known: Mapping[str, TypedName]
) -> dict[str, TypedName]:
    """The `known` objects and those that `items` declares."""
    result = dict(known)
    for declared in typed_names(items, Kind.NAME, "the name of an object", hierarchy):
        other = result.setdefault(declared.name, declared)
        if set(other.types) != set(declared.types):
            found = f"found object '{declared.name}' with another type, took both; the first is at {other.location}"
            warn(found, declared.location)
            result[declared.name] = replace(other, types=tuple(dict.fromkeys((*other.types, *declared.types))))
    return result


def warn(message: str, place: Location | None) -> None:
    """Warn of input that other tools accept, though PDDL does not define its meaning."""
    warnings.warn(f"{place}: {message}", InputWarning, stacklevel=2)


def functions(
    items: Sequence[Item], hierarchy: Mapping[str, frozenset[str]], predicates: Mapping[str, Signature]
) -> dict[str, Signature]:
    """Numeric functions; `- number` may follow them."""
    forms: list[Item] = []
    remaining = _with_blanks(items)
    for item in remaining:
        if not _is_dash(item):
            forms.append(item)
            continue
        kind = next(remaining, None)
        if not forms or kind is None:
            raise fault(item, "a function before '-' and 'number' after it")
        if isinstance(kind, Form) and kind.head != "either":
            raise fault(kind, "'number' after '-'")
        if not isinstance(kind, Word) or kind.text != "number":
            raise unsupported(kind, "a function that returns objects", "use a predicate with one more argument")
    result = signatures(forms, "function", hierarchy)
    for name, signature in result.items():
        if name in predicates:
            expected = f"another name; it is a predicate at {predicates[name].location}"
            raise fault(signature.location, expected, found=f"function '{name}'")
    return result


def signatures(items: Sequence[Item], what: str, hierarchy: Mapping[str, frozenset[str]]) -> dict[str, Signature]:
    """The declarations of a kind of name, `what`, each name once, or twice alike."""
    known: dict[str, Signature] = {}
    for signature in (_signature(item, what, hierarchy) for item in items):
        other = known.setdefault(signature.name, signature)
        if [variable.types for variable in other.parameters] != [variable.types for variable in signature.parameters]:
            expected = f"one declaration; the first is at {other.location}"
            raise fault(signature.location, expected, found=f"a second {what} '{signature.name}'")
    return known


def _signature(item: Item, what: str, hierarchy: Mapping[str, frozenset[str]]) -> Signature:
    if not isinstance(item, Form):
        raise fault(item, f"a {what} with its parameters, as in (name ?x - type)")
    head = item.items[0] if item.items else item
    if not is_word(head, Kind.NAME):
        raise fault(head, f"the name of a {what}")
    if head.text in RESERVED:
        raise fault(head, f"the name of a {what}; this word has a meaning of its own")
    return Signature(head.text, variables(item.rest, hierarchy), head.location)


def synth_parameters(items: Sequence[Item], taken: Iterable[str]) -> tuple[str, ...]:
    """Parameters to synthesise: `?s` or `?s - number`, with names that are not `taken`."""
    if len(items) == 1 and isinstance(items[0], Form):
        items = items[0].items
    used = {*taken}
    result = []
    for word, kinds in typed_list(items, Kind.VARIABLE, "a parameter"):
        if kinds and [kind.text for kind in kinds] != ["number"]:
            raise fault(kinds[0], "'number': parameters to synthesise are numbers")
        name = word.text[1:]
        if name in used or name == "duration":
            raise fault(word, "parameters and variables of different names")
        used.add(name)
        result.append(name)
    return tuple(result)
