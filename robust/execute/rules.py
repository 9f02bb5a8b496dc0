"""Rules of what is drawn: durations, consumption and parameters, from world files and options.

World files say which quantities are drawn from which distributions. They are TOML with one table for each rule; of
several rules that fit, the first counts. Numbers are exact, and may be written as texts such as "1/3". Without a rule,
nature does what the plan expects::

    [[draw]]
    duration = "prepare"          # an action, a ground action "(prepare first cap)", an instance of the plan, or "*"
    distribution = "normal"       # or constant, uniform, half-normal, truncated-normal, triangular, exponential
    mean = 150                    # the planned value if left out
    deviation = 70                # or "15%" of the planned value
    minimum = 20                  # none if left out
    below = "fold"                # what becomes of draws below the minimum; or "clip"

    [[draw]]
    consumption = "use"           # ground fluents that nothing changes, such as (use a b): anew for each instance
    distribution = "uniform"
    lower = 0.8
    upper = "4/3"
    relative = true               # numbers are multiples of the planned value

    [[draw]]
    parameter = "handling"        # a parameter of the plan, or "*": once for each run
    distribution = "half-normal"
    origin = 5                    # the planned value if left out
    deviation = 1

    [[draw]]
    duration = "carry"
    distribution = "empirical"    # what was observed
    values = [41, 43.5, 60]
    weights = [7, 2, 1]           # how often; once each if left out

What durations share is said beside these. A factor is drawn once for each run; durations it scales are their own draw,
or as planned, times the factor, and those it shifts that plus the factor. Durations with a covariance matrix are
jointly normal around their planned values, or `means`::

    [[factor]]
    name = "weather"
    scales = ["drive", "(fly d1 a b)"]  # or shifts
    distribution = "triangular"
    lower = 0.9
    mode = 1
    upper = 1.4

    [[covariance]]
    durations = ["(drive a b)", "(drive b c)"]  # each one step
    matrix = [[4, 2], [2, 9]]
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from os import PathLike
from typing import Final

from robust.errors import InputError, Location, closest, did_you_mean
from robust.numbers import shorten
from robust.plan import model, parameters
from robust.plan.pddl.forms import read_text
from robust.probability import distributions
from robust.probability.sharing import Matrix, require_covariance, root


class Subject(Enum):
    """Quantities that rules are about."""

    DURATION = "duration"
    CONSUMPTION = "consumption"
    PARAMETER = "parameter"


@dataclass(frozen=True, slots=True)
class Rule:
    """A distribution as the file says it, and of which quantities."""

    subject: Subject
    name: str
    form: distributions.DistributionForm

    def about(self, planned: Fraction) -> distributions.Distribution:
        """The distribution of a quantity with this planned value."""
        return self.form.at(planned, Location(self.name))


@dataclass(frozen=True)
class FactorRule:
    """A factor that durations of these names share; it multiplies them, or is added."""

    name: str
    distribution: distributions.Distribution
    subjects: tuple[str, ...]
    scales: bool


@dataclass(frozen=True)
class JointPart:
    """A duration as its mean plus multiples of standard normal values; None for a mean as planned."""

    mean: Fraction | None
    shares: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class CovarianceRule:
    """Jointly normal durations, by what they are called."""

    subjects: tuple[str, ...]
    matrix: Matrix
    means: tuple[Fraction, ...] | None = None

    def parts(self, names: Collection[str]) -> Iterator[JointPart]:
        """What it says about a duration with these names."""
        for number, subject in enumerate(self.subjects):
            if subject in names:
                shares = tuple(
                    (f"normal {self.subjects[column]}", share) for column, share in enumerate(root(self.matrix)[number])
                )
                yield JointPart(None if self.means is None else self.means[number], shares)


@dataclass(frozen=True)
class Rules:
    """All rules of a world."""

    rules: tuple[Rule, ...] = ()
    factors: tuple[FactorRule, ...] = ()
    covariances: tuple[CovarianceRule, ...] = ()

    def is_random(self, instance: model.ActionInstance) -> bool:
        """Whether something is said about the duration of an instance."""
        subjects = {name for rule in self.factors for name in rule.subjects}
        subjects |= {name for rule in self.covariances for name in rule.subjects}
        return self.duration(instance) is not None or not subjects.isdisjoint(named(instance))

    def duration(self, instance: model.ActionInstance) -> Rule | None:
        """The rule for the duration of an instance."""
        return self._first(Subject.DURATION, named(instance))

    def consumption(self, fluent: model.Fluent) -> Rule | None:
        """The rule for the value of a fluent that nothing changes."""
        return self._first(Subject.CONSUMPTION, {fluent.function, str(fluent)})

    def parameter(self, name: str) -> Rule | None:
        return self._first(Subject.PARAMETER, {name, "*"})

    def _first(self, subject: Subject, names: set[str]) -> Rule | None:
        return next((rule for rule in self.rules if rule.subject is subject and rule.name in names), None)


def named(instance: model.ActionInstance) -> set[str]:
    """What rules may call an instance."""
    return {*parameters.names_of(instance), "*"}


def read_rules(path: str | PathLike[str]) -> Rules:
    """The rules in a world file; InputError if it cannot be read or is wrong."""
    return parse_rules(read_text(path), str(path))


def parse_rules(text: str, file: str = "<world>") -> Rules:
    """The rules in a text; InputError names the rule and the key that is wrong."""
    document = parameters.toml_document(text, file, "tables [[draw]]")
    kinds = ("draw", "factor", "covariance")
    for key in document.keys() - set(kinds):
        expected = "expected only tables [[draw]], [[factor]] and [[covariance]]"
        raise InputError(f"found key {shorten(key)}, {expected}{did_you_mean(key, kinds)}", Location(file))
    found: dict[str, list[tuple[Mapping[str, object], str]]] = {}
    for kind in kinds:
        tables = document.get(kind, [])
        if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
            raise InputError(f"found a value for {kind!r}, expected tables [[{kind}]]", Location(file))
        found[kind] = [(table, f"{file}, {kind} {number}") for number, table in enumerate(tables, start=1)]
    rules, factors, covariances = (found[kind] for kind in kinds)
    return Rules(
        tuple(_rule(*one) for one in rules),
        tuple(_factor_rule(*one) for one in factors),
        tuple(_covariance_rule(*one) for one in covariances),
    )


def _rule(table: Mapping[str, object], place: str) -> Rule:
    location = Location(place)
    subjects = [subject for subject in Subject if subject.value in table]
    if len(subjects) != 1:
        named = "none" if not subjects else " and ".join(subject.value for subject in subjects)
        raise InputError(f"found {named}, expected one of duration, consumption and parameter", location)
    subject = subjects[0]
    name = _name(table, subject.value, location)
    rule = Rule(subject, _normal_name(subject, name), _form(table, {subject.value, "relative"}, location))
    _check_numbers(rule, location)
    return rule


def _factor_rule(table: Mapping[str, object], place: str) -> FactorRule:
    location = Location(place)
    effects = [key for key in ("scales", "shifts") if key in table]
    if len(effects) != 1:
        raise InputError(f"found {' and '.join(effects) or 'none'}, expected one of scales and shifts", location)
    form = _form(table, {"name", *effects}, location)
    name = _name(table, "name", location)
    return factor_rule(name, _subjects(table, effects[0], location), form, scales=effects == ["scales"], place=location)


def factor_rule(
    name: str, subjects: Sequence[str], form: distributions.DistributionForm, *, scales: bool, place: Location
) -> FactorRule:
    """A factor; InputError if it cannot be one."""
    for key in distributions.KEYS[form.kind]:
        if key not in form.amounts and key not in distributions.OPTIONAL - distributions.PLANNED:
            raise InputError(f"found no {key!r}, expected a number for a {form.kind} distribution", place)
    distribution = form.at(None, place)
    distributions.require_possible(form.kind, distribution.numbers, place)
    least = distribution.support[0]
    if scales and (least is None or least <= 0):
        found = "no minimum" if least is None else f"least value {least}"
        raise InputError(f"found {found} of a factor that scales durations, expected one above 0", place)
    return FactorRule(name.strip(), distribution.settled, tuple(map(normal_name, subjects)), scales)


def _name(table: Mapping[str, object], key: str, location: Location) -> str:
    name = table.get(key)
    if not isinstance(name, str) or not name.strip():
        raise InputError(f"found {shorten(str(name))} for {key!r}, expected a name", location)
    return name


def _subjects(table: Mapping[str, object], key: str, location: Location) -> list[str]:
    names = table.get(key)
    if not isinstance(names, list) or not names or not all(isinstance(name, str) and name.strip() for name in names):
        raise InputError(f"found {shorten(str(names))} for {key!r}, expected a list of names", location)
    return names


def _covariance_rule(table: Mapping[str, object], place: str) -> CovarianceRule:
    location = Location(place)
    keys = {"durations", "matrix", "means"}
    for key in (key for key in table if key not in keys):
        raise InputError(f"found key {shorten(key)}, expected another{did_you_mean(key, keys)}", location)
    subjects = tuple(map(normal_name, _subjects(table, "durations", location)))
    rows = table.get("matrix")
    if not isinstance(rows, list) or [len(row) if isinstance(row, list) else 0 for row in rows] != [
        len(subjects)
    ] * len(subjects):
        raise InputError(f"found no matrix with {len(subjects)} rows and columns, expected one", location)
    matrix = tuple(tuple(_amount(one, "matrix", location, relative=False).value for one in row) for row in rows)
    require_covariance(matrix, location)
    means = table.get("means")
    if means is not None and (not isinstance(means, list) or len(means) != len(subjects)):
        raise InputError(f"found {shorten(str(means))} for 'means', expected {len(subjects)} numbers", location)
    centres = None if means is None else tuple(_amount(one, "means", location, relative=False).value for one in means)
    return CovarianceRule(subjects, matrix, centres)


def _form(table: Mapping[str, object], others: Collection[str], location: Location) -> distributions.DistributionForm:
    """The distribution of a table with some other keys."""
    kind = table.get("distribution")
    if not isinstance(kind, str) or kind not in distributions.KEYS:
        hint = closest(str(kind), distributions.KEYS)
        raise InputError(
            f"found distribution {shorten(str(kind))}, expected one of {', '.join(distributions.KEYS)}{hint}", location
        )
    known = {"distribution", *others, *distributions.KEYS[kind]}
    for key in (key for key in table if key not in known):
        raise InputError(f"found key {shorten(key)}, expected another{did_you_mean(key, known)}", location)
    below, relative = table.get("below", "fold"), table.get("relative", False)
    if not isinstance(relative, bool):
        raise InputError(f"found {shorten(str(relative))} for 'relative', expected true or false", location)
    if below not in {"fold", "clip"}:
        raise InputError(f"found {shorten(str(below))} for 'below', expected fold or clip", location)
    amounts: dict[str, tuple[distributions.Amount, ...]] = {}
    for key in (key for key in distributions.KEYS[kind] if key != "below" and key in table):
        given = table[key] if key in distributions.LISTS else [table[key]]
        if not isinstance(given, list):
            raise InputError(f"found {shorten(str(given))} for {key!r}, expected a list of numbers", location)
        amounts[key] = tuple(_amount(one, key, location, relative=relative and key != "weights") for one in given)
    return distributions.DistributionForm(kind, amounts, distributions.Below(below))


def _normal_name(subject: Subject, name: str) -> str:
    """Ground actions and fluents as they are written elsewhere; identifiers keep their case."""
    text = normal_name(name)
    return text.lower() if subject is Subject.CONSUMPTION else text


def normal_name(name: str) -> str:
    """`( Drive  r1 A )` as `(drive r1 a)`; other names as they are."""
    text = name.strip()
    return f"({' '.join(text[1:-1].lower().split())})" if text.startswith("(") and text.endswith(")") else text


def _amount(value: object, key: str, location: Location, *, relative: bool) -> distributions.Amount:
    if isinstance(value, int) and not isinstance(value, bool):
        return distributions.Amount(Fraction(value), relative)
    if isinstance(value, str | parameters.DecimalText):
        amount = distributions.parse_amount(str(value), location)
        return distributions.Amount(amount.value, amount.relative or relative)
    raise InputError(f"found {shorten(str(value))} for {key!r}, expected a number", location)


_LEAST: Final = {
    "uniform": "lower",
    "constant": "value",
    "half-normal": "origin",
    "triangular": "lower",
    "exponential": "minimum",
}
"""The key of the least value that is drawn, by distribution."""


def _check_numbers(rule: Rule, location: Location) -> None:
    kind, amounts = rule.form.kind, rule.form.amounts
    for key in distributions.KEYS[kind]:
        if key not in amounts and key not in distributions.OPTIONAL:
            raise InputError(f"found no {key!r}, expected a number for a {kind} distribution", location)
    numbers = {key: given.value for key, (given, *_) in amounts.items() if key not in distributions.LISTS}
    if kind == "empirical":
        rule.form.at(Fraction(1), location)
    if len({given.relative for (given, *_) in amounts.values()}) == 1:  # others can be compared with a planned value
        distributions.require_possible(kind, numbers, location)
    if rule.subject is Subject.DURATION:
        least = numbers.get(_LEAST.get(kind, ""), Fraction(0))
        least = min((least, *(given.value for given in amounts.get("values", ()))))
        if least < 0:
            raise InputError(f"found {_LEAST.get(kind, 'value')} {least} of a duration, expected at least 0", location)
        if kind in {"normal", "truncated-normal"} and numbers.get("minimum", Fraction(-1)) < 0:
            minimum = "no minimum" if "minimum" not in numbers else f"minimum {numbers['minimum']}"
            raise InputError(f"found {minimum} of a duration, expected one of at least 0", location)
