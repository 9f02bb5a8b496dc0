"""Conditions, numeric expressions, durations and effects from their forms, with every name checked."""

from collections.abc import Sequence
from fractions import Fraction

from robust.errors import did_you_mean
from robust.plan.model import Timing
from robust.plan.pddl import declarations, syntax
from robust.plan.pddl.declarations import Scope, count, function, proposition, term
from robust.plan.pddl.forms import Form, Item, Kind, Word, fault, is_word, number, quote, walk

_TIMED_CONDITION = "a timed condition: (at start ...), (over all ...) or (at end ...)"


def expression(item: Item, scope: Scope) -> syntax.NumericExpression:
    """A numeric expression."""
    if isinstance(item, Word):
        return _numeric_word(item, scope)
    if not item.items:
        raise fault(item, "a numeric expression")
    if is_word(item.items[0], Kind.OPERATOR):
        return _arithmetic(item, scope)
    return function(item, scope)


def _numeric_word(word: Word, scope: Scope) -> syntax.NumericExpression:
    match word.kind:
        case Kind.NUMBER:
            return syntax.Number(number(word), word.text, word.location)
        case Kind.VARIABLE:
            return _numeric_variable(word, scope)
        case Kind.NAME:
            return function(word, scope)
        case Kind.TIME:
            raise fault(word, "a numeric expression; #t belongs into continuous effects, as in (increase (f) (* #t 2))")
        case _:
            raise fault(word, "a numeric expression")


def _numeric_variable(word: Word, scope: Scope) -> syntax.NumericExpression:
    name = word.text[1:]
    if name == "duration" and scope.durative:
        return syntax.DurationTerm(word.location)
    if name in scope.variables:
        raise fault(word, "a number; it is a variable for objects")
    if name in scope.parameters:
        return syntax.ParameterTerm(name, scope.parameters[name], word.location)
    raise declarations.unknown_variable(word, scope)


def _arithmetic(form: Form, scope: Scope) -> syntax.Arithmetic:
    if form.head not in ("+", "-", "*", "/"):
        raise fault(form.items[0], "an arithmetic operator (+ - * /) or a numeric function")
    operator = syntax.Operator(form.head)
    least, most = {"-": (1, 2), "/": (2, 2)}.get(form.head, (1, len(form.items)))
    if not least <= len(form.rest) <= most:
        expected = {"-": "one or two operands", "/": "two operands"}.get(form.head, "at least one operand")
        raise fault(form, expected, found=f"'{form.head}' with {count(len(form.rest), 'operand')}")
    return arithmetic(operator, [expression(item, scope) for item in form.rest], form)


def arithmetic(
    operator: syntax.Operator, operands: Sequence[syntax.NumericExpression], form: Form
) -> syntax.Arithmetic:
    """An operation whose number of operands has been checked."""
    divisor = operands[-1]
    if operator is syntax.Operator.DIVIDED and isinstance(divisor, syntax.Number) and not divisor.value:
        raise fault(divisor.location, "a divisor other than zero", found="a division by zero")
    return syntax.Arithmetic(operator, tuple(operands), form.location)


def condition(item: Item, scope: Scope) -> syntax.LiftedCondition:  # noqa: PLR0911 (one return for each kind of form)
    """A condition without time specifiers."""
    if not isinstance(item, Form):
        raise fault(item, "a condition in parentheses")
    if not item.items:
        return syntax.Conjunction((), item.location)
    if is_word(item.items[0], Kind.OPERATOR):
        return _comparison(item, scope)
    if specified_time(item) is not None:
        raise fault(item, "a condition without a time specifier here")
    match item.head:
        case "and" | "or":
            junction = syntax.Conjunction if item.head == "and" else syntax.Disjunction
            return junction(tuple([condition(inner, scope) for inner in item.rest]), item.location)
        case "not":
            check_operands(item, 1, "one condition")
            return syntax.Negation(condition(item.items[1], scope), item.location)
        case "imply":
            check_operands(item, 2, "2 conditions")
            return syntax.Implication(condition(item.items[1], scope), condition(item.items[2], scope), item.location)
        case "forall" | "exists":
            variables = quantified(item, scope, "a condition")
            operand = condition(item.items[2], scope.bind(variables))
            return syntax.Quantification(item.head == "forall", variables, operand, item.location)
        case "preference":
            raise preference(item)
        case _:
            return proposition(item, scope)


def preference(form: Form) -> Exception:
    return declarations.unsupported(form, "a preference", "remove it, or state it as a condition that must hold")


def check_operands(form: Form, number: int, expected: str) -> None:
    """The form has that many operands."""
    if len(form.rest) != number:
        raise fault(form, expected, found=f"{quote(form.head)} with {count(len(form.rest), 'operand')}")


def quantified(form: Form, scope: Scope, what: str) -> tuple[syntax.TypedName, ...]:
    """The variables of `(forall (variables) ...)`; afterwards the third item exists."""
    check_operands(form, 2, f"variables in parentheses and {what}")
    listed = form.items[1]
    if not isinstance(listed, Form):
        raise fault(listed, "variables in parentheses, as in (?x - type)")
    return declarations.variables(listed.items, scope.vocabulary.types)


def _comparison(form: Form, scope: Scope) -> syntax.LiftedCondition:
    if form.head not in ("<", "<=", "=", ">=", ">"):
        raise fault(form.items[0], "a condition: a predicate, a comparison (< <= = >= >), and, or, not, imply, ...")
    check_operands(form, 2, "two operands")
    left, right = form.rest
    if form.head == "=":
        _check_known(left, scope)
        is_function = isinstance(left, Word) and left.text in scope.vocabulary.functions
        # The left side decides what is compared, unless it is both an object and a function.
        if scope.knows_object(left) and (scope.knows_object(right) or not is_function):
            return syntax.Equality(term(left, scope), term(right, scope), form.location)
    numbers = syntax.NumericComparison(
        syntax.Comparator(form.head), expression(left, scope), expression(right, scope), form.location
    )
    if form.head == "=" and is_word(left, Kind.NAME) and is_word(right, Kind.NAME):
        first, second = (syntax.Term(word.text, variable=False, location=word.location) for word in (left, right))
        return syntax.NameEquality(syntax.Equality(first, second, form.location), numbers)
    return numbers


def _check_known(item: Item, scope: Scope) -> None:
    """A name on the left of `=` decides what is compared, so it is known."""
    known = {*scope.vocabulary.objects, *scope.vocabulary.functions}
    if is_word(item, Kind.NAME) and item.text not in known:
        hint = did_you_mean(item.text, known)
        raise fault(item, "the name of a declared object or numeric function", hint=hint)


def specified_time(form: Form) -> Timing | None:
    """The time specifier of `(at start (...))` and the like, if it is one; a predicate may also be called `at`."""
    words = " ".join([item.text for item in form.items[:2] if isinstance(item, Word)])
    if words not in ("at start", "at end", "over all") or len(form.items) < 3 or not isinstance(form.items[2], Form):
        return None
    if len(form.items) > 3:
        raise fault(form.items[3], f"')' after the operand of '{words}'")
    return Timing(words)


def timed_conditions(item: Item, scope: Scope) -> list[syntax.TimedLiftedCondition]:
    """The condition of a durative action, split by time specifier."""
    if not isinstance(item, Form):
        raise fault(item, _TIMED_CONDITION)
    when = specified_time(item)
    if when is not None:
        return [syntax.TimedLiftedCondition(when, condition(item.items[2], scope))]
    if not item.items:
        return []
    match item.head:
        case "and":
            return [timed for inner in item.rest for timed in timed_conditions(inner, scope)]
        case "forall":
            variables = quantified(item, scope, "a timed condition")
            inside = timed_conditions(item.items[2], scope.bind(variables))
            return [
                syntax.TimedLiftedCondition(
                    timed.timing, syntax.Quantification(True, variables, timed.condition, item.location)
                )
                for timed in inside
            ]
        case "preference":
            raise preference(item)
        case "or" | "not" | "imply" | "exists":
            hint = f"; put '{item.head}' inside it, as in (at start ({item.head} ...))"
            raise fault(item, _TIMED_CONDITION, hint=hint)
        case _:
            raise fault(item, _TIMED_CONDITION, hint=_time_hint(item))


def _time_hint(form: Form) -> str:
    """A suggestion where a time specifier was misspelt."""
    if form.head in ("at", "over") and len(form.items) == 3 and isinstance(form.items[2], Form):
        second = form.items[1]
        if isinstance(second, Word):
            return did_you_mean(f"{form.head} {second.text}", [specifier.value for specifier in Timing])
    return ""


def duration_bounds(item: Item, scope: Scope, specified: Timing = Timing.AT_START) -> list[syntax.DurationBound]:
    """The `:duration` of an action; bounds without a time specifier are evaluated at the start."""
    expected = "a duration such as (= ?duration 5), (<= ?duration (f)) or (and ...)"
    if not isinstance(item, Form):
        raise fault(item, expected)
    if not item.items:
        return []
    when = specified_time(item)
    if when is Timing.OVER_ALL:
        raise fault(item, "a duration at start or at end")
    if when is not None:
        return duration_bounds(item.items[2], scope, when)
    if item.head == "and":
        return [bound for inner in item.rest for bound in duration_bounds(inner, scope, specified)]
    if item.head not in ("<=", "=", ">=", "<", ">") or len(item.items) != 3:
        raise fault(item, expected)
    left = item.items[1]
    if not isinstance(left, Word) or left.text != "?duration":
        raise fault(left, f"'?duration' as the left side of '{item.head}'")
    bound = expression(item.items[2], scope)
    return [syntax.DurationBound(specified, syntax.Comparator(item.head), bound, item.location)]


_UPDATES = frozenset(update.value for update in syntax.Update)
_TIMED_EFFECT = "a timed effect: (at start ...) or (at end ...)"


def effects(  # noqa: PLR0911 (one return for each kind of form)
    item: Item, scope: Scope, when: Timing | None
) -> list[syntax.LiftedEffect]:
    """The effects in `item`; `when` is their time if it is known: it is not at the top of a durative action."""
    if not isinstance(item, Form):
        raise fault(item, "an effect in parentheses")
    if not item.items:
        return []
    specified = specified_time(item)
    if specified is not None:
        return _timed(item, scope, when, specified)
    match item.head:
        case "and":
            return [effect for inner in item.rest for effect in effects(inner, scope, when)]
        case "forall":
            variables = quantified(item, scope, "an effect")
            inside = effects(item.items[2], scope.bind(variables), when)
            return [syntax.ForallEffect(variables, tuple(inside), item.location)]
        case "when":
            return [_conditional(item, scope, when)]
        case "preference":
            raise preference(item)
        case "or" | "imply" | "exists":
            raise fault(item, "an effect; effects are deterministic: and, forall, when, not, assign, increase, ...")
        case head if head in _UPDATES:
            return [_update(item, scope, when)]
        case _:
            return [_literal(item, scope, when)]


def _timed(form: Form, scope: Scope, outside: Timing | None, when: Timing) -> list[syntax.LiftedEffect]:
    if outside is not None:
        raise fault(form, "an effect without a time specifier here")
    if when is Timing.OVER_ALL:
        hint = "; continuous effects are written without one, as in (increase (f) (* #t 2))"
        raise fault(form, _TIMED_EFFECT, hint=hint)
    return effects(form.items[2], scope, when)


def _literal(form: Form, scope: Scope, when: Timing | None) -> syntax.LiteralEffect:
    if when is None:
        raise fault(form, _TIMED_EFFECT)
    if form.head != "not":
        return syntax.LiteralEffect(when, proposition(form, scope), value=True)
    return syntax.LiteralEffect(when, negated(form, scope), value=False)


def negated(form: Form, scope: Scope) -> syntax.Proposition:
    """The proposition in `(not (proposition))`."""
    check_operands(form, 1, "one proposition")
    inner = form.items[1]
    if not isinstance(inner, Form):
        raise fault(inner, "a proposition in parentheses")
    return proposition(inner, scope)


def _update(form: Form, scope: Scope, when: Timing | None) -> syntax.NumericUpdate | syntax.ContinuousUpdate:
    check_operands(form, 2, "a numeric function and an expression")
    update = syntax.Update(form.head)
    _, changed, right = form.items
    if not isinstance(changed, Form) and changed.kind is not Kind.NAME:
        raise fault(changed, "a numeric function to change, as in (increase (f) 1)")
    target = function(changed, scope)
    if not _mentions_time(right):
        if when is None:
            raise fault(form, f"{_TIMED_EFFECT}, or a continuous one that mentions #t")
        return syntax.NumericUpdate(when, update, target, expression(right, scope), form.location)
    if not scope.durative:
        raise fault(right, "no #t: an instantaneous action has no continuous effects")
    if when is not None:
        expected = f"no #t in an effect {when.value}; continuous effects are written without a time specifier"
        raise fault(right, expected)
    if update not in (syntax.Update.INCREASE, syntax.Update.DECREASE):
        raise fault(form, "increase or decrease for a continuous effect")
    rate = _rate(right, scope)
    for used in syntax.subexpressions(rate):
        if isinstance(used, syntax.DurationTerm):
            raise fault(used.location, "a rate of change that does not depend on the duration", found="'?duration'")
    return syntax.ContinuousUpdate(update, target, rate, form.location)


def _mentions_time(item: Item) -> bool:
    return any(is_word(inner, Kind.TIME) for inner in walk(item))


def _rate(item: Item, scope: Scope) -> syntax.NumericExpression:
    """The factor of #t in an expression that is linear in it and zero without it."""
    if isinstance(item, Word):
        return syntax.Number(Fraction(1), "1", item.location)
    timed = [_mentions_time(inner) for inner in item.rest]
    rates = [
        _rate(inner, scope) if has else expression(inner, scope) for inner, has in zip(item.rest, timed, strict=True)
    ]
    match item.head:
        case "*" if timed.count(True) == 1:
            return _product(rates, timed, item)
        case "/" if timed == [True, False]:
            return arithmetic(syntax.Operator.DIVIDED, rates, item)
        case "+" | "-" if timed and all(timed) and (item.head == "+" or len(timed) <= 2):
            return arithmetic(syntax.Operator(item.head), rates, item)
        case _:
            raise fault(item, "a rate times #t, as in (* #t 2)")


def _product(factors: list[syntax.NumericExpression], timed: list[bool], form: Form) -> syntax.NumericExpression:
    kept = [
        factor
        for factor, has in zip(factors, timed, strict=True)
        if not (has and isinstance(factor, syntax.Number) and factor.value == 1)
    ]
    if not kept:
        return syntax.Number(Fraction(1), "1", form.location)
    return kept[0] if len(kept) == 1 else arithmetic(syntax.Operator.TIMES, kept, form)


def _conditional(form: Form, scope: Scope, when: Timing | None) -> syntax.WhenEffect:
    check_operands(form, 2, "2 parts, a condition and an effect")
    inside = effects(form.items[2], scope, when)
    for effect in syntax.primitive(inside):
        if isinstance(effect, syntax.ContinuousUpdate):
            remedy = "split the action in two, each with its own continuous effect"
            raise declarations.unsupported(form, "a conditional continuous effect", remedy)
    if when is not None:
        return syntax.WhenEffect(condition(form.items[1], scope), tuple(inside), form.location)
    now, before = _conditions_at(form, inside, scope)
    return syntax.WhenEffect(now, tuple(inside), form.location, before)


def _conditions_at(
    form: Form, inside: list[syntax.LiftedEffect], scope: Scope
) -> tuple[syntax.LiftedCondition, syntax.LiftedCondition | None]:
    """The condition of a `when` at the time of its effects; and of effects at the end, what must hold at the start."""
    timed = timed_conditions(form.items[1], scope)
    times = {effect.timing for effect in syntax.primitive(inside) if not isinstance(effect, syntax.ContinuousUpdate)}
    needed = {part.timing for part in timed}
    later = times == {Timing.AT_END} and needed <= {Timing.AT_START, Timing.AT_END}
    if Timing.OVER_ALL in needed or not (later or len(times | needed) <= 1):
        names = " and ".join(sorted(quote(part.value) for part in times | needed))
        remedy = "give effects one timing, and let their condition be at the same time or, for effects at end, at start"
        raise declarations.unsupported(form, f"a conditional effect that mixes {names}", remedy)

    def every(parts: list[syntax.LiftedCondition]) -> syntax.LiftedCondition:
        return parts[0] if len(parts) == 1 else syntax.Conjunction(tuple(parts), form.location)

    early = [part.condition for part in timed if later and part.timing is Timing.AT_START]
    rest = [part.condition for part in timed if not (later and part.timing is Timing.AT_START)]
    return every(rest), every(early) if early else None
