"""Actions of a plan, goals and initial values made ground: negation normal form, polynomials, effects one by one."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from itertools import product
from operator import add, mul
from typing import TypeVar, assert_never

from robust.errors import InputError, Location, UnsupportedError, did_you_mean
from robust.plan import model
from robust.plan.pddl import syntax
from robust.plan.pddl.declarations import choices, count, fits
from robust.plan.pddl.write import condition_text, duration_text, expression_text, type_text
from robust.plan.polynomial import Polynomial

Name = model.Atom | model.Fluent
_AT_BOTH_ENDS = (model.Timing.AT_START, model.Timing.AT_END)


@dataclass(frozen=True, slots=True)
class Context:
    """What variables stand for; `identifier` names the action instance whose parameters are meant.

    `parametrized` are the fluents that are made parameters, so that their initial value is not known.
    """

    domain: syntax.Domain
    problem: syntax.Problem
    identifier: str
    bindings: Mapping[str, str]
    parametrized: Collection[model.Fluent] = frozenset()

    def instances(self, variables: tuple[syntax.TypedName, ...]) -> Iterator[Context]:
        """One context for every choice of objects for quantified variables."""
        names = [variable.name for variable in variables]
        for chosen in product(*choices(variables, self.problem.objects, self.domain.types)):
            yield replace(self, bindings={**self.bindings, **dict(zip(names, chosen, strict=True))})


def atom(proposition: syntax.Proposition, context: Context) -> model.Atom:
    return model.Atom(proposition.predicate, _objects(proposition.arguments, context))


def fluent(term: syntax.FunctionTerm, context: Context) -> model.Fluent:
    return model.Fluent(term.function, _objects(term.arguments, context))


def _objects(terms: Iterable[syntax.Term], context: Context) -> tuple[str, ...]:
    return tuple([_object(term, context) for term in terms])


def _object(term: syntax.Term, context: Context) -> str:
    return context.bindings[term.name] if term.variable else term.name


def condition(lifted: syntax.LiftedCondition, context: Context, *, positive: bool = True) -> model.Condition:
    """The ground condition, or its negation, in negation normal form."""
    match lifted:
        case syntax.Proposition():
            return model.Holds(atom(lifted, context), positive)
        case syntax.Equality(left, right):
            return model.Truth((_object(left, context) == _object(right, context)) == positive)
        case syntax.NumericComparison(comparator, left, right):
            return _comparison(comparator, expression(left, context) - expression(right, context), positive)
        case syntax.NameEquality():
            return condition(lifted.meant(context.problem.objects), context, positive=positive)
        case syntax.Negation(operand):
            return condition(operand, context, positive=not positive)
        case syntax.Conjunction() | syntax.Disjunction() | syntax.Implication() | syntax.Quantification():
            every, operands = _operands(lifted, context)
            parts = [condition(operand, inner, positive=positive) for operand, inner in operands]
            return model.junction(parts, every=every == positive)
        case _:
            assert_never(lifted)


def _operands(
    lifted: syntax.Conjunction | syntax.Disjunction | syntax.Implication | syntax.Quantification, context: Context
) -> tuple[bool, list[tuple[syntax.LiftedCondition, Context]]]:
    """Whether all of the operands have to hold, or one of them; and the operands."""
    match lifted:
        case syntax.Conjunction(operands) | syntax.Disjunction(operands):
            return isinstance(lifted, syntax.Conjunction), [(operand, context) for operand in operands]
        case syntax.Implication(premise, conclusion, location):
            return False, [(syntax.Negation(premise, location), context), (conclusion, context)]
        case syntax.Quantification(universal, variables, operand):
            return universal, [(operand, inner) for inner in context.instances(variables)]
        case _:
            assert_never(lifted)


def _comparison(comparator: syntax.Comparator, difference: model.Expression, positive: bool) -> model.Condition:
    compared = comparison(comparator, difference)
    known = compared.expression.is_constant
    ground = model.Truth(compared.relation.holds(compared.expression.constant_term)) if known else compared
    return ground if positive else model.negation(ground)


def comparison(comparator: syntax.Comparator, difference: model.Expression) -> model.NumericCondition:
    """`difference comparator 0`."""
    positive, relation = _COMPARED[comparator]
    return model.NumericCondition(difference if positive else -difference, relation)


_COMPARED = {
    syntax.Comparator.AT_LEAST: (True, model.Relation.AT_LEAST),
    syntax.Comparator.GREATER: (True, model.Relation.GREATER),
    syntax.Comparator.AT_MOST: (False, model.Relation.AT_LEAST),
    syntax.Comparator.LESS: (False, model.Relation.GREATER),
    syntax.Comparator.EQUAL: (True, model.Relation.EQUAL),
}


def expression(lifted: syntax.NumericExpression, context: Context) -> model.Expression:
    """The ground expression."""
    match lifted:
        case syntax.Number(value):
            return Polynomial.constant(value)
        case syntax.FunctionTerm():
            return _variable(fluent(lifted, context))
        case syntax.DurationTerm():
            return _variable(model.Duration())
        case syntax.ParameterTerm(name, local):
            return _variable(model.ParameterReference(f"{context.identifier}.{name}" if local else name))
        case syntax.Arithmetic(operator, operands):
            return _arithmetic(operator, [expression(operand, context) for operand in operands], lifted, context)
        case _:
            assert_never(lifted)


def _variable(variable: model.NumericVariable) -> model.Expression:
    return Polynomial.variable(variable)


def _arithmetic(
    operator: syntax.Operator, values: list[model.Expression], lifted: syntax.Arithmetic, context: Context
) -> model.Expression:
    match operator:
        case syntax.Operator.PLUS:
            return reduce(add, values)
        case syntax.Operator.TIMES:
            return reduce(mul, values)
        case syntax.Operator.MINUS:
            return -values[0] if len(values) == 1 else values[0] - values[1]
        case syntax.Operator.DIVIDED:
            return quotient(values[0], values[1], lifted.operands[1], context)


def quotient(
    dividend: model.Expression, divisor: model.Expression, lifted: syntax.NumericExpression, context: Context
) -> model.Expression:
    """A division by an expression that is constant, at least once fluents that never change have their value."""
    value = divisor.substitute(lambda variable: _never_changing(variable, lifted, context))
    if value.is_constant:
        if not value.constant_term:
            text = expression_text(lifted, context.bindings)
            raise InputError(f"found a division by {text}, which is zero, expected another divisor", lifted.location)
        return dividend.scaled(1 / value.constant_term)
    varying = ", ".join(sorted(str(variable) for variable in value.variables))
    message = f"found a division by {expression_text(lifted, context.bindings)}, which is non-linear because {varying}"
    remedy = "may vary, expected a divisor that no action, timed literal or parameter changes"
    raise UnsupportedError(f"{message} {remedy}", lifted.location)


def _never_changing(
    variable: model.NumericVariable, lifted: syntax.NumericExpression, context: Context
) -> model.Expression:
    """The initial value of a fluent that nothing changes; anything else as it is."""
    if not isinstance(variable, model.Fluent) or variable.function in context.domain.written:
        return _variable(variable)
    if variable in context.parametrized or any(timed.target == variable for timed in context.problem.timed_literals):
        return _variable(variable)
    if variable not in context.problem.fluents:
        message = f"found a division by {variable}, expected (= {variable} VALUE) in the problem's :init"
        raise InputError(message, lifted.location)
    return Polynomial.constant(context.problem.fluents[variable])


T = TypeVar("T")


def ground_action(  # noqa: PLR0917 (all that a line of a plan says)
    domain: syntax.Domain,
    problem: syntax.Problem,
    identifier: str,
    action: str,
    arguments: Sequence[str],
    durative: bool,
    location: Location | None,
    *,
    parametrized: Collection[model.Fluent] = frozenset(),
    duration: str | None = None,
) -> model.ActionInstance:
    """The instance `identifier` of an action; InputError at `location` if name, kind or arguments do not fit.

    A fluent that nothing changes may be a divisor, and then its initial value is used, unless it is `parametrized`.
    The parameter `duration`, if given, takes the place of what fixes `?duration`.
    """
    schema = _schema(domain, action, durative, location)
    names = tuple(argument.lower() for argument in arguments)
    _check_arguments(domain, problem, schema, names, location)
    bindings = {parameter.name: name for parameter, name in zip(schema.parameters, names, strict=True)}
    context = Context(domain, problem, identifier, bindings, parametrized)
    effects = _Effects()
    effects.add(schema.effects, context, model.Truth(True))
    instance = model.ActionInstance(
        identifier=identifier,
        action=schema.name,
        arguments=names,
        durative=durative,
        durations=tuple([_duration(bound, context) for bound in schema.durations]),
        conditions=_distinct(
            model.TimedCondition(timed.timing, ground, text)
            for timed in schema.conditions
            for ground, text in _ground_conjuncts(timed.condition, context)
        ),
        atom_effects=_distinct(effects.atoms),
        numeric_effects=tuple(effects.numeric),
        continuous_effects=tuple(effects.continuous),
        location=location,
    )
    fixing = () if duration is None else instance.fixing
    pairs = zip(schema.durations, instance.durations, strict=True)
    kept = [bound for bound, constraint in pairs if constraint not in fixing]
    if duration is not None and fixing:
        instance = _with_duration(instance, duration)
    return replace(instance, mentions=_mentions(_texts(schema, kept, context), instance))


def _with_duration(instance: model.ActionInstance, parameter: str) -> model.ActionInstance:
    """The instance with `(= ?duration parameter)` in place of what fixes its duration."""
    first, *others = instance.fixing
    condition = model.NumericCondition(
        _variable(model.Duration()) - _variable(model.ParameterReference(parameter)), model.Relation.EQUAL
    )
    varied = replace(first, condition=condition, text=f"(= ?duration {parameter})")
    kept = tuple(varied if bound is first else bound for bound in instance.durations if bound not in others)
    return replace(instance, durations=kept)


def ground_goal(
    domain: syntax.Domain, problem: syntax.Problem, *, parametrized: Collection[model.Fluent] = frozenset()
) -> tuple[model.GoalCondition, ...]:
    """The conjuncts of the goal; `parametrized` as for :func:`ground_action`."""
    context = Context(domain, problem, "", {}, parametrized)
    return _distinct(model.GoalCondition(ground, text) for ground, text in _ground_conjuncts(problem.goal, context))


def _distinct(items: Iterable[T]) -> tuple[T, ...]:
    """Items without repetitions: a condition that is written twice is one obligation."""
    return tuple(dict.fromkeys(items))


def initial_fluents(problem: syntax.Problem) -> dict[model.Fluent, model.Expression]:
    """The numeric fluents that have a value at time zero, with that constant."""
    return {name: Polynomial.constant(value) for name, value in problem.fluents.items()}


def fluents_read(instance: model.ActionInstance) -> frozenset[model.Fluent]:
    """The fluents that the instance evaluates: all that its text mentions but the targets of assignments.

    What the equality of objects decides is not evaluated.
    """
    read = {name for _, name in _reads(instance) if isinstance(name, model.Fluent)}
    read |= {use.name for use in instance.mentions if use.needs_value and isinstance(use.name, model.Fluent)}
    read |= {effect.fluent for effect in instance.continuous_effects}
    numeric = instance.numeric_effects
    return frozenset(read) | {e.fluent for e in numeric if e.operator is model.AssignmentKind.INCREASE}


def fluents_in_goal(domain: syntax.Domain, problem: syntax.Problem) -> Iterator[tuple[str, frozenset[model.Fluent]]]:
    """The conjuncts of the goal, in PDDL, with the fluents that each evaluates, as :func:`fluents_read` says."""
    for lifted, context in _conjuncts(problem.goal, Context(domain, problem, "", {})):
        yield condition_text(lifted, context.bindings), _text(lifted, context).evaluated


# -- what is read ------------------------------------------------------------------------------------------------------


def _reads(instance: model.ActionInstance) -> Iterator[tuple[model.Timing, Name]]:
    """What the ground conditions and effects of an instance mention, and when."""
    for part in instance.parts:
        yield from ((part.timing, name) for name in model.names_in(part.condition))
    for effect in instance.numeric_effects:
        yield from ((effect.timing, fluent) for fluent in model.fluents_in(effect.expression))
    for continuous in instance.continuous_effects:
        yield from ((timing, fluent) for timing in _AT_BOTH_ENDS for fluent in model.fluents_in(continuous.rate))


@dataclass(frozen=True, slots=True)
class _Text:
    """What a text mentions, which fluents are evaluated, and its truth where the equality of objects decides it."""

    names: frozenset[Name] = frozenset()
    evaluated: frozenset[model.Fluent] = frozenset()
    decided: bool | None = None


def _mentions(texts: Iterable[tuple[model.Timing, _Text]], instance: model.ActionInstance) -> frozenset[model.Mention]:
    """What is mentioned by texts, each with the time that it belongs to, and not by the ground instance."""
    evaluated: dict[tuple[model.Timing, Name], bool] = {}
    for timing, text in texts:
        for name in text.names:
            evaluated[timing, name] = evaluated.get((timing, name), False) or name in text.evaluated
    lost = evaluated.keys() - set(_reads(instance))
    return frozenset(model.Mention(timing, name, evaluated[timing, name]) for timing, name in lost)


def _texts(
    schema: syntax.ActionSchema, durations: Iterable[syntax.DurationBound], context: Context
) -> Iterator[tuple[model.Timing, _Text]]:
    """All that an action reads, if these of its durations count."""
    for bound in durations:
        yield bound.timing, _numeric_text(context, bound.bound)
    for timed in schema.conditions:
        yield timed.timing, _text(timed.condition, context)
    yield from _texts_of_effects(schema.effects, context, _Text(decided=True))


def _texts_of_effects(
    effects: Iterable[syntax.LiftedEffect], context: Context, guard: _Text
) -> Iterator[tuple[model.Timing, _Text]]:
    """What effects read that happen if `guard` holds; those that the equality of objects excludes read nothing."""
    for effect in effects:
        match effect:
            case syntax.LiteralEffect():
                yield effect.timing, guard
            case syntax.NumericUpdate():
                yield effect.timing, guard
                yield effect.timing, _numeric_text(context, effect.expression)
            case syntax.ContinuousUpdate():
                yield from ((timing, _numeric_text(context, effect.rate)) for timing in _AT_BOTH_ENDS)
            case syntax.ForallEffect(variables, inside):
                for inner in context.instances(variables):
                    yield from _texts_of_effects(inside, inner, guard)
            case syntax.WhenEffect(condition_, inside, _, remembered):
                if remembered is not None:
                    yield model.Timing.AT_START, _text(remembered, context)
                both = _joined([guard, _text(condition_, context)], every=True)
                if both.decided is not False:
                    yield from _texts_of_effects(inside, context, both)
            case _:
                assert_never(effect)


def _text(lifted: syntax.LiftedCondition, context: Context) -> _Text:
    match lifted:
        case syntax.Proposition():
            return _Text(frozenset((atom(lifted, context),)))
        case syntax.Equality(left, right):
            return _Text(decided=_object(left, context) == _object(right, context))
        case syntax.NumericComparison(_, left, right):
            return _numeric_text(context, left, right)
        case syntax.NameEquality():
            return _text(lifted.meant(context.problem.objects), context)
        case syntax.Negation(operand):
            text = _text(operand, context)
            return text if text.decided is None else replace(text, decided=not text.decided)
        case syntax.Conjunction() | syntax.Disjunction() | syntax.Implication() | syntax.Quantification():
            every, operands = _operands(lifted, context)
            return _joined([_text(operand, inner) for operand, inner in operands], every=every)
        case _:
            assert_never(lifted)


def _numeric_text(context: Context, *lifted: syntax.NumericExpression) -> _Text:
    terms = (part for expression in lifted for part in syntax.subexpressions(expression))
    fluents = frozenset(fluent(term, context) for term in terms if isinstance(term, syntax.FunctionTerm))
    return _Text(frozenset[Name](fluents), fluents)


def _joined(texts: Sequence[_Text], *, every: bool) -> _Text:
    """The text of a conjunction (`every`) or a disjunction."""
    truths = {text.decided for text in texts}
    decided = (not every) if (not every) in truths else None if None in truths else every
    names = frozenset[Name]().union(*(text.names for text in texts))
    if decided is not None:
        return _Text(names, decided=decided)
    return _Text(names, frozenset[model.Fluent]().union(*(text.evaluated for text in texts)))


# -- parts of an instance ----------------------------------------------------------------------------------------------


def _schema(domain: syntax.Domain, action: str, durative: bool, location: Location | None) -> syntax.ActionSchema:
    schema = domain.actions.get(action.lower())
    if schema is None:
        hint = did_you_mean(action.lower(), domain.actions)
        raise InputError(f"found action '{action.lower()}', expected one of domain '{domain.name}'{hint}", location)
    if schema.durative != durative:
        kinds = {True: "a durative action", False: "an instantaneous action"}
        defined = f"{kinds[schema.durative]} as defined at {schema.location}"
        steps = schema.durative and location is not None and not location.file.endswith(".stn")
        lacking = "; does its line lack a duration, such as [12]?" if steps else ""
        raise InputError(f"found '{schema.name}' used as {kinds[durative]}, expected {defined}{lacking}", location)
    return schema


def _check_arguments(
    domain: syntax.Domain,
    problem: syntax.Problem,
    schema: syntax.ActionSchema,
    names: tuple[str, ...],
    location: Location | None,
) -> None:
    usage = syntax.Signature(schema.name, schema.parameters, schema.location)
    if len(names) != len(schema.parameters):
        found = f"'{schema.name}' with {count(len(names), 'argument')}"
        expected = f"{count(len(schema.parameters), 'argument')} as in {usage}"
        raise InputError(f"found {found}, expected {expected}", location)
    for name, parameter in zip(names, schema.parameters, strict=True):
        declared = problem.objects.get(name)
        if declared is None:
            hint = did_you_mean(name, problem.objects)
            raise InputError(f"found '{name}', expected an object of problem '{problem.name}'{hint}", location)
        if not fits(declared.types, parameter.types, domain.types):
            found = f"'{name}' of type {type_text(declared.types)}"
            expected = f"type {type_text(parameter.types)} for ?{parameter.name} of {usage}"
            raise InputError(f"found {found}, expected {expected}", location)


def _ground_conjuncts(lifted: syntax.LiftedCondition, context: Context) -> Iterator[tuple[model.Condition, str]]:
    """The conjuncts of a condition with their text; what is always true is left out."""
    for conjunct, inner in _conjuncts(lifted, context):
        ground = condition(conjunct, inner)
        if ground != model.Truth(True):
            yield ground, condition_text(conjunct, inner.bindings)


def _conjuncts(lifted: syntax.LiftedCondition, context: Context) -> Iterator[tuple[syntax.LiftedCondition, Context]]:
    """The conjuncts of a condition, those of a `forall` object by object."""
    match lifted:
        case syntax.Conjunction(operands):
            for operand in operands:
                yield from _conjuncts(operand, context)
        case syntax.Quantification(True, variables, operand):
            for inner in context.instances(variables):
                yield from _conjuncts(operand, inner)
        case _:
            yield lifted, context


def _duration(bound: syntax.DurationBound, context: Context) -> model.DurationConstraint:
    difference = _variable(model.Duration()) - expression(bound.bound, context)
    return model.DurationConstraint(
        bound.timing, comparison(bound.comparator, difference), duration_text(bound, context.bindings)
    )


REMEMBERED = "remembered-at-start"
"""The predicate of atoms that keep what held at the start of an instance for its effects at the end."""


@dataclass(slots=True)
class _Effects:
    """Collects the ground effects of one instance."""

    atoms: list[model.AtomEffect] = field(default_factory=list)
    numeric: list[model.NumericEffect] = field(default_factory=list)
    continuous: list[model.ContinuousEffect] = field(default_factory=list)

    def add(self, effects: Iterable[syntax.LiftedEffect], context: Context, when: model.Condition) -> None:
        """Add effects that happen if `when` holds."""
        for effect in effects:
            match effect:
                case syntax.LiteralEffect(timing, proposition, value):
                    self.atoms.append(model.AtomEffect(timing, atom(proposition, context), value, when))
                case syntax.NumericUpdate():
                    self._add_numeric(_numeric(effect, context, when), effect.location)
                case syntax.ContinuousUpdate(update, target, rate):
                    change = expression(rate, context)
                    signed = change if update is syntax.Update.INCREASE else -change
                    self.continuous.append(model.ContinuousEffect(fluent(target, context), signed))
                case syntax.ForallEffect(variables, inside):
                    for inner in context.instances(variables):
                        self.add(inside, inner, when)
                case syntax.WhenEffect(guard, inside, _, remembered):
                    memory = model.Truth(True) if remembered is None else self._memory(remembered, context)
                    both = model.junction([when, memory, condition(guard, context)], every=True)
                    if both != model.Truth(False):
                        self.add(inside, context, both)
                case _:
                    assert_never(effect)

    def _memory(self, remembered: syntax.LiftedCondition, context: Context) -> model.Condition:
        """That a condition held at the start: an atom of the instance's own keeps it."""
        held = condition(remembered, context)
        if isinstance(held, model.Truth):
            return held
        known = sum(effect.atom.predicate == REMEMBERED for effect in self.atoms)
        kept = model.Atom(REMEMBERED, (context.identifier, str(known)))
        self.atoms.append(model.AtomEffect(model.Timing.AT_START, kept, True, held))
        return model.Holds(kept)

    def _add_numeric(self, effect: model.NumericEffect, location: Location) -> None:
        """Equal increases add up; unconditional changes that cannot take place together are refused."""
        for other in self.numeric:
            if other.condition == effect.condition == model.Truth(True) and any(model.conflicts((other, effect))):
                message = f"found an assignment and another change of {effect.fluent} {effect.timing.value}"
                remedy = "expected at most one of them; remove one, or give both conditions that exclude each other"
                raise InputError(f"{message} in one action, {remedy}", location)
        self.numeric.append(effect)


def _numeric(effect: syntax.NumericUpdate, context: Context, when: model.Condition) -> model.NumericEffect:
    target = fluent(effect.target, context)
    value = expression(effect.expression, context)
    operator = model.AssignmentKind.ASSIGN
    match effect.update:
        case syntax.Update.ASSIGN:
            pass
        case syntax.Update.INCREASE:
            operator = model.AssignmentKind.INCREASE
        case syntax.Update.DECREASE:
            operator, value = model.AssignmentKind.INCREASE, -value
        case syntax.Update.SCALE_UP:
            value = _variable(target) * value
        case syntax.Update.SCALE_DOWN:
            value = quotient(_variable(target), value, effect.expression, context)
    return model.NumericEffect(effect.timing, target, operator, value, when)
