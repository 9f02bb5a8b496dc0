"""World files: which quantities nature draws, and from which distributions.

A TOML file with one table for each rule; of several that fit, the first counts. Numbers are exact, and may be written
as texts such as "1/3". Without a rule, nature does what the plan expects::

    [[draw]]
    duration = "prepare"          # an action, a ground action "(prepare first cap)", or an instance of the plan
    distribution = "normal"       # or constant, uniform, half-normal
    mean = 150                    # the planned value if left out
    deviation = 70
    minimum = 20                  # none if left out
    below = "fold"                # what becomes of draws below the minimum; or "clip"

    [[draw]]
    consumption = "use"           # ground fluents that nothing changes, such as (use a b): anew for each instance
    distribution = "uniform"
    lower = 0.8
    upper = "4/3"
    relative = true               # numbers are multiples of the planned value

    [[draw]]
    parameter = "handling"        # a parameter of the plan: once for each run
    distribution = "half-normal"
    origin = 5                    # the planned value if left out
    deviation = 1

Draws are multiples of 1/1000, constants excepted. Every draw has a random number of its own, made of the run's seed,
what is drawn, and how often that has been drawn before. So two executors that meet in the same world with the same seed
have the same luck, whatever order they do things in: results can be compared pair by pair.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from os import PathLike
from random import Random
from typing import Final

from robust.errors import InputError, Location, did_you_mean
from robust.numbers import parse_number, shorten
from robust.plan.model import ActionInstance, Fluent

GRID = 1000
"""How many values there are from one integer to the next."""


class Below(Enum):
    """What becomes of draws below the minimum: folded up, to as far above it as they were below, or clipped to it."""

    FOLD = "fold"
    CLIP = "clip"


def on_grid(value: float) -> Fraction:
    """The nearest multiple of 1/1000."""
    return Fraction(round(value * GRID), GRID)


class Luck:
    """The draws of one run; durations are never below 0."""

    def __init__(self, rules: Rules, seed: int | str) -> None:
        self.rules = rules
        self._seed = seed
        self._count: Counter[str] = Counter()
        self._kept: dict[str, Fraction] = {}

    def duration(self, instance: ActionInstance, planned: Fraction) -> Fraction | None:
        """How long an instance takes this time; None without a rule."""
        rule = self.rules.duration(instance)
        return None if rule is None else max(self._draw(rule, f"duration {instance}", planned), Fraction(0))

    def consumption(self, instance: ActionInstance, fluent: Fluent, planned: Fraction) -> Fraction | None:
        """The value of a fluent for an instance; None without a rule."""
        rule = self.rules.consumption(fluent)
        return None if rule is None else self._draw(rule, f"{fluent} of {instance}", planned)

    def parameter(self, name: str, planned: Fraction, *, once: bool) -> Fraction | None:
        """The value of a parameter; None without a rule. With `once` it stays what it was when it was drawn first."""
        rule = self.rules.parameter(name)
        if rule is None:
            return None
        if not once:
            return self._draw(rule, f"parameter {name}", planned)
        if name not in self._kept:
            self._kept[name] = self._draw(rule, f"parameter {name}", planned)
        return self._kept[name]

    def _draw(self, rule: Rule, what: str, planned: Fraction) -> Fraction:
        number = self._count[what]
        self._count[what] += 1
        return rule.draw(planned, Random(f"{self._seed}/{what}/{number}"))  # noqa: S311 - no secrets here


class Subject(Enum):
    """What a rule is about."""

    DURATION = "duration"
    CONSUMPTION = "consumption"
    PARAMETER = "parameter"


_KEYS: Final[Mapping[str, tuple[str, ...]]] = {
    "constant": ("value",),
    "uniform": ("lower", "upper"),
    "normal": ("mean", "deviation", "minimum", "below"),
    "half-normal": ("origin", "deviation"),
}
_PLANNED: Final = {"value", "mean", "origin"}
"""Keys that mean the planned value if they are left out."""


@dataclass(frozen=True, slots=True)
class Rule:
    """`numbers` are those of the file; `of` puts in the planned value."""

    subject: Subject
    name: str
    distribution: str
    numbers: Mapping[str, Fraction]
    below: Below = Below.FOLD
    relative: bool = False

    def of(self, planned: Fraction) -> Mapping[str, Fraction]:
        """The numbers of the distribution for a quantity with this planned value."""
        unit = planned if self.relative else Fraction(1)
        numbers = dict.fromkeys(_PLANNED.intersection(_KEYS[self.distribution]), planned)
        numbers |= {key: value * unit for key, value in self.numbers.items()}
        if self.distribution == "uniform":  # a negative unit turns the ends round
            numbers["lower"], numbers["upper"] = sorted((numbers["lower"], numbers["upper"]))
        if "deviation" in numbers:
            numbers["deviation"] = abs(numbers["deviation"])
        return numbers

    def draw(self, planned: Fraction, random: Random) -> Fraction:
        """One value.

        A normal distribution may have a minimum [IRR §5, "described by a normal distribution with a minimum value"]; a
        half-normal one is its origin plus the absolute value of a normal variable with mean 0.
        """
        numbers = self.of(planned)
        match self.distribution:
            case "constant":
                return numbers["value"]
            case "uniform":
                drawn = on_grid(random.uniform(float(numbers["lower"]), float(numbers["upper"])))
                return min(max(drawn, numbers["lower"]), numbers["upper"])
            case "half-normal":
                return numbers["origin"] + abs(on_grid(random.gauss(0.0, float(numbers["deviation"]))))
        drawn = on_grid(random.gauss(float(numbers["mean"]), float(numbers["deviation"])))
        minimum = numbers.get("minimum", drawn)
        if drawn >= minimum:
            return drawn
        return minimum if self.below is Below.CLIP else 2 * minimum - drawn


@dataclass(frozen=True)
class Rules:
    """All rules of a world."""

    rules: tuple[Rule, ...] = ()

    def duration(self, instance: ActionInstance) -> Rule | None:
        """The rule for the duration of an instance."""
        names = {instance.identifier, instance.action, str(instance)}
        return self._first(Subject.DURATION, names)

    def consumption(self, fluent: Fluent) -> Rule | None:
        """The rule for the value of a fluent that nothing changes."""
        return self._first(Subject.CONSUMPTION, {fluent.function, str(fluent)})

    def parameter(self, name: str) -> Rule | None:
        return self._first(Subject.PARAMETER, {name})

    def _first(self, subject: Subject, names: set[str]) -> Rule | None:
        return next((one for one in self.rules if one.subject is subject and one.name in names), None)


def read_rules(path: str | PathLike[str]) -> Rules:
    """The rules in a world file; InputError if it cannot be read or is wrong."""
    from robust.plan.pddl.forms import read_text  # noqa: PLC0415 - keeps the grammar of PDDL out of this import

    return parse_rules(read_text(path), str(path))


def parse_rules(text: str, file: str = "<world>") -> Rules:
    """The rules in a text; InputError names the rule and the key that is wrong."""
    import tomllib  # noqa: PLC0415 - only needed here

    try:
        document = tomllib.loads(text, parse_float=_Decimal)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"found no TOML: {error}", Location(file)) from None
    for key in document:
        if key != "draw":
            message = f"found key {shorten(key)}, expected only tables [[draw]]{did_you_mean(key, ['draw'])}"
            raise InputError(message, Location(file))
    tables = document.get("draw", [])
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise InputError("found a value for 'draw', expected tables [[draw]]", Location(file))
    return Rules(tuple(_rule(table, f"{file}, draw {number}") for number, table in enumerate(tables, start=1)))


class _Decimal(str):
    """The text of a TOML float: its exact value counts."""

    __slots__ = ()


def _rule(table: Mapping[str, object], place: str) -> Rule:
    location = Location(place)
    subjects = [subject for subject in Subject if subject.value in table]
    if len(subjects) != 1:
        found = "none" if not subjects else " and ".join(subject.value for subject in subjects)
        raise InputError(f"found {found}, expected one of duration, consumption and parameter", location)
    subject = subjects[0]
    name = table[subject.value]
    if not isinstance(name, str) or not name.strip() or isinstance(name, _Decimal):
        raise InputError(f"found {shorten(str(name))} for {subject.value!r}, expected a name", location)
    kind = table.get("distribution")
    if not isinstance(kind, str) or kind not in _KEYS:
        hint = did_you_mean(str(kind), _KEYS)
        raise InputError(f"found distribution {shorten(str(kind))}, expected one of {', '.join(_KEYS)}{hint}", location)
    known = {subject.value, "distribution", "relative", *_KEYS[kind]}
    for key in table:
        if key not in known:
            raise InputError(f"found key {shorten(key)}, expected another{did_you_mean(key, known)}", location)
    below, relative = table.get("below", "fold"), table.get("relative", False)
    if not isinstance(relative, bool):
        raise InputError(f"found {shorten(str(relative))} for 'relative', expected true or false", location)
    if below not in {"fold", "clip"}:
        raise InputError(f"found {shorten(str(below))} for 'below', expected fold or clip", location)
    numbers = {key: _number(table[key], key, location) for key in _KEYS[kind] if key != "below" and key in table}
    rule = Rule(subject, _normal_name(subject, name), kind, numbers, Below(below), relative)
    _check_numbers(rule, location)
    return rule


def _normal_name(subject: Subject, name: str) -> str:
    """Ground actions and fluents as they are written elsewhere; identifiers keep their case."""
    text = name.strip()
    if text.startswith("(") and text.endswith(")"):
        return f"({' '.join(text[1:-1].lower().split())})"
    return text.lower() if subject is Subject.CONSUMPTION else text


def _number(value: object, key: str, location: Location) -> Fraction:
    if isinstance(value, int) and not isinstance(value, bool):
        return Fraction(value)
    if isinstance(value, str):
        return parse_number(value.strip(), location)
    raise InputError(f"found {shorten(str(value))} for {key!r}, expected a number", location)


def _check_numbers(rule: Rule, location: Location) -> None:
    for key in _KEYS[rule.distribution]:
        if key not in rule.numbers and key not in {*_PLANNED, "minimum", "below"}:
            raise InputError(f"found no {key!r}, expected a number for a {rule.distribution} distribution", location)
    numbers = rule.numbers
    if numbers.get("deviation", Fraction(0)) < 0:
        raise InputError(f"found deviation {numbers['deviation']}, expected at least 0", location)
    if rule.distribution == "uniform" and numbers["lower"] > numbers["upper"]:
        raise InputError("found lower above upper, expected lower ≤ upper", location)
    if rule.subject is Subject.DURATION:
        least = {"uniform": "lower", "constant": "value", "half-normal": "origin"}.get(rule.distribution)
        if least is not None and numbers.get(least, Fraction(0)) < 0:
            raise InputError(f"found {least} {numbers[least]} of a duration, expected at least 0", location)
        if rule.distribution == "normal" and numbers.get("minimum", Fraction(-1)) < 0:
            found = "no minimum" if "minimum" not in numbers else f"minimum {numbers['minimum']}"
            raise InputError(f"found {found} of a duration, expected one of at least 0", location)
