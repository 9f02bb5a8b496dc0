"""Writes a ground plan with concrete parameter values and one schedule as PDDL that VAL reads.

Atoms and fluents become nullary predicates and functions, each action instance an action without parameters that is
named after it, and parameters their values. Temporal constraints have no place in PDDL and are left out.
"""

from fractions import Fraction
from functools import reduce
from typing import NamedTuple, assert_never

from robust.numbers import format_number
from robust.plan import model
from robust.plan.pddl.write import action_text, conjunction_text, define, section
from robust.plan.polynomial import Polynomial

_REQUIREMENTS = (
    ":typing :fluents :durative-actions :duration-inequalities :negative-preconditions "
    ":disjunctive-preconditions :conditional-effects :timed-initial-literals :continuous-effects"
)
_ALWAYS, _NEVER = "(top)", "(not (top))"


class PddlText(NamedTuple):
    """The contents of the three files that a validator reads."""

    domain: str
    problem: str
    plan: str


def pddl_text(plan, parameters, schedule):
    """Domain, problem and time-triggered plan of one schedule under `parameters`."""
    sections = [
        section(":requirements", [_REQUIREMENTS]),
        section(":predicates", sorted({_symbol(atom) for atom in _atoms(plan)} | {_ALWAYS})),
        section(":functions", sorted(_symbol(fluent) for fluent in plan.initial_fluents)),
        *(_Writer(parameters, i, schedule[i.end] - schedule[i.start]).action() for i in plan.instances),
    ]
    steps = ""
    for instance in plan.instances:
        start = schedule[instance.start]
        duration = f" [{number(schedule[instance.end] - start)}]" if instance.durative else ""
        steps += f"{number(start)}: ({instance.identifier}){duration}\n"
    return PddlText(define("domain", "d", sections), _problem(plan, parameters), steps)


def _problem(plan, parameters):
    values = {model.ParameterReference(name): value for name, value in parameters.items()}
    facts = [_ALWAYS, *(_symbol(atom) for atom in sorted(plan.initial_atoms))]
    facts += [f"(= {_symbol(fluent)} {number(e.evaluate(values))})" for fluent, e in plan.initial_fluents.items()]
    for literal in plan.timed_literals:
        fact = _symbol(literal.target)
        if isinstance(literal.target, model.Fluent):
            fact = f"(= {fact} {number(Fraction(literal.value))})"
        elif not literal.value:
            fact = f"(not {fact})"
        facts.append(f"(at {number(literal.time)} {fact})")
    goals = [_ALWAYS, *(_Writer(parameters).condition(goal.condition) for goal in plan.goal)]
    return define("problem", "x", ["(:domain d)", section(":init", facts), section(":goal", [conjunction_text(goals)])])


def _atoms(plan):
    yield from plan.initial_atoms
    for literal in plan.timed_literals:
        if isinstance(literal.target, model.Atom):
            yield literal.target
    conditions = [goal.condition for goal in plan.goal]
    for instance in plan.instances:
        effects = (*instance.atom_effects, *instance.numeric_effects)
        conditions += [part.condition for part in (*instance.conditions, *effects)]
        yield from (effect.atom for effect in instance.atom_effects)
    while conditions:
        condition = conditions.pop()
        if isinstance(condition, model.And | model.Or):
            conditions += condition.operands
        elif isinstance(condition, model.Holds):
            yield condition.atom


def number(value):
    """A number in PDDL: a decimal where it is finite, a quotient otherwise (which a plan's times cannot be)."""
    text = format_number(value)
    return f"(/ {text.replace('/', ' ')})" if "/" in text else text


def _symbol(name):
    head = name.predicate if isinstance(name, model.Atom) else name.function
    return f"({'_'.join((head, *name.arguments))})"


def condition_text(condition):
    """A condition in PDDL, parameters and `?duration` by name: what the plan model keeps as its `text`."""
    return _Writer(None).condition(condition)


class _Writer:
    """Writes the parts of one instance; `parameters` None keeps parameters and `?duration` by name."""

    def __init__(self, parameters, instance=None, duration=None):
        self.parameters, self.instance, self.duration = parameters, instance, duration
        self.exact = parameters is not None

    def expression(self, expression):
        terms = sorted(expression.terms.items(), key=lambda term: (not term[0], [str(v) for v in term[0]]))
        products = []
        for monomial, coefficient in terms:
            factors = [] if coefficient == 1 and monomial else [number(coefficient)]
            products.append(reduce("(* {} {})".format, [*factors, *map(self._variable, monomial)]))
        return reduce("(+ {} {})".format, products) if products else "0"

    def _variable(self, variable):
        match variable:
            case model.Fluent():
                return str(variable) if self.parameters is None else _symbol(variable)
            case model.ParameterReference(name):
                return name if self.parameters is None else number(self.parameters[name])
            case model.Duration():
                return "?duration"
        assert_never(variable)

    def fixed(self, expression):
        """As `expression`, with the value of `?duration`: VAL reads it in numeric effects and :duration only."""
        duration = (
            Polynomial.constant(self.duration) if self.duration is not None else Polynomial.variable(model.Duration())
        )
        return self.expression(
            expression.substitute(lambda v: duration if isinstance(v, model.Duration) else Polynomial.variable(v))
        )

    def timed(self, part):
        """A condition with its timing.

        VAL grants its tolerance to strict comparisons too, so that x > x holds; the negation of <= is exact at time
        points, but VAL does not see it fail between two happenings.
        """
        self.exact = part.timing is not model.Timing.OVER_ALL
        text = f"({part.timing.value} {self.condition(part.condition)})"
        self.exact = True
        return text

    def condition(self, condition):
        match condition:
            case model.Truth(value):
                return _ALWAYS if value else _NEVER
            case model.Holds(atom, value):
                text = str(atom) if self.parameters is None else _symbol(atom)
                return text if value else f"(not {text})"
            case model.NumericCondition(expression, relation):
                return self._comparison(self.fixed(expression), relation)
            case model.And(operands):
                return conjunction_text(map(self.condition, operands))
            case model.Or(operands):
                return f"(or {' '.join(self.condition(operand) for operand in operands)})" if operands else _NEVER
        assert_never(condition)

    def _comparison(self, text, relation):
        if relation is model.Relation.DIFFERENT:
            return f"(not (= {text} 0))"
        if relation is model.Relation.GREATER and self.exact:
            return f"(not (<= {text} 0))"
        return f"({relation.value} {text} 0)"

    def action(self):
        instance = self.instance
        assert instance is not None
        effects = [self._effect(effect) for effect in (*instance.atom_effects, *instance.numeric_effects)]
        if not instance.durative:
            conditions = [_ALWAYS, *(self.condition(part.condition) for part in instance.conditions)]
            return action_text(instance.identifier, conjunction_text(conditions), effects)
        conditions = [f"(at start {_ALWAYS})", *map(self.timed, instance.conditions)]
        durations = ["(at start (>= ?duration 0))", *map(self._duration, instance.durations)]
        effects += [f"(increase {_symbol(e.fluent)} (* #t {self.fixed(e.rate)}))" for e in instance.continuous_effects]
        duration = conjunction_text(durations)
        return action_text(instance.identifier, conjunction_text(conditions), effects, duration=duration)

    def _duration(self, part):
        """`?duration` on the left: the comparison divided by its coefficient."""
        polynomial, equal = part.condition.expression, part.condition.relation is model.Relation.EQUAL
        factor = polynomial.terms[(model.Duration(),)]
        bound = (Polynomial({(model.Duration(),): factor}) - polynomial).scaled(1 / factor)
        relation = "=" if equal else ">=" if factor > 0 else "<="
        return f"({part.timing.value} ({relation} ?duration {self.expression(bound)}))"

    def _effect(self, effect):
        if isinstance(effect, model.AtomEffect):
            text = _symbol(effect.atom) if effect.value else f"(not {_symbol(effect.atom)})"
        else:
            operator = "assign" if effect.operator is model.AssignmentKind.ASSIGN else "increase"
            text = f"({operator} {_symbol(effect.fluent)} {self.expression(effect.expression)})"
        assert self.instance is not None
        frame = f"({effect.timing.value} {{}})" if self.instance.durative else "{}"
        if effect.condition == model.Truth(True):
            return frame.format(text)
        return f"(when {frame.format(self.condition(effect.condition))} {frame.format(text)})"
