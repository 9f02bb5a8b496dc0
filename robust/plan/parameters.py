"""Parameters declared beside the plan: which quantity becomes a parameter, by option or TOML file.

An option is `SPEC[,weight=W][,lb=L][,ub=U][,default=D]` with one of these SPECs:

====================================  ================================================================================
`[NAME=]duration:ID`                  the duration of instance ID, whatever the domain says it is; the parameter is
                                      called `dur_ID` unless named
`[NAME=]duration:ACTION`              one such parameter for each instance of the action (a NAME only if there is one)
`[NAME=]duration:(drive r1 a b)`      one for each instance of the ground action
`duration:*`                          one for each instance that takes time, unless others say so already
`[NAME=]shared:ACTION`                one parameter that is the duration of all instances of the action (`dur_ACTION`)
`[NAME=]start:ID`                     the start time of instance ID, from zero (`start_ID`)
`[NAME=]fluent:(charge auv)`          the initial value of a ground numeric fluent (`charge_auv`)
`NAME`                                new weight, bounds or nominal value for an existing parameter
====================================  ================================================================================

Numbers are exact; `lb=-inf` and `ub=inf` remove a bound. An identifier of an instance goes before an action of the same
name. A NAME that the plan declares and does not use yet is taken with its attributes; any other NAME must be new.

In TOML, the same is one table for each parameter (floats are read from their text, so they are exact too)::

    [parameters.endurance]
    fluent = "(charge auv)"      # or duration = "n3", or start = "n3", or none of them for an existing parameter
    weight = 2
    lower = "1/3"                # also: lb
    upper = 1500.5               # also: ub
    default = 1000
"""

import os
import re
import shlex
import warnings
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from fractions import Fraction
from os import PathLike
from pathlib import Path
from typing import Any, assert_never

from robust.errors import InputError, InputWarning, Location, did_you_mean
from robust.numbers import shorten
from robust.plan import stn
from robust.plan.model import ZERO, ActionInstance, Expression, Fluent, ParameterReference, ParametrizedPlan, TimePoint
from robust.plan.pddl.forms import read_text

_SPEC = re.compile(r"\s*(?:(?P<name>[^=:]*)=)?\s*(?P<target>[^=:()\s]*)\s*:(?P<subject>.*)", re.DOTALL)
_FLUENT = re.compile(r"\(\s*[A-Za-z0-9_-]+(?:\s+[A-Za-z0-9_-]+)*\s*\)")
ATTRIBUTES: Mapping[str, str] = {
    "weight": "weight",
    "default": "default",
    "lb": "lower",
    "lower": "lower",
    "ub": "upper",
    "upper": "upper",
}


class Target(Enum):
    """What a specification makes a parameter of."""

    DURATION = "duration"
    SHARED = "shared"
    START = "start"
    FLUENT = "fluent"
    EXISTING = "existing parameter"


_TARGETS: Mapping[str, Target] = {target.value: target for target in Target if target is not Target.EXISTING}


@dataclass(frozen=True, slots=True)
class ParameterSpec:
    """One specification, not yet looked up in a plan.

    `subject` is an instance, an action, a ground fluent `(f a b)` in lower case, or an existing parameter. `attributes`
    has the given ones of weight, default, lower and upper; a bound of None is the infinite one.
    """

    target: Target
    subject: str
    name: str | None = None
    attributes: Mapping[str, Fraction | None] = field(default_factory=dict)
    location: Location | None = field(default=None, compare=False)


def attributes_of(settings: Iterable[str], location: Location) -> dict[str, Fraction | None]:
    """What texts such as `weight=2` and `lb=1/3` say of a parameter; InputError for any other text."""
    attributes: dict[str, Fraction | None] = {}
    for setting in settings:
        word, equals, value = (part.strip() for part in setting.partition("="))
        if word not in ATTRIBUTES or not equals:
            hint = did_you_mean(word, ("weight", "lb", "ub", "default"))
            message = f"found {shorten(setting.strip())}, expected weight=W, lb=L, ub=U or default=D{hint}"
            raise InputError(message, location)
        set_attribute(attributes, word, value, location)
    return attributes


def parse_spec(text: str) -> ParameterSpec:
    """The specification in an option's text; InputError says what is wrong in which option."""
    location = Location(f"--parameter {shorten(text)}")
    head, *settings = text.split(",")
    attributes = attributes_of(settings, location)
    match = _SPEC.fullmatch(head)
    if match is None:
        name = head.strip()
        if "=" in name:
            expected = "[NAME=]duration:ID, [NAME=]start:ID, [NAME=]fluent:(F ARG ...) or a parameter's name"
            raise InputError(f"found {shorten(name)}, expected {expected}", location)
        return ParameterSpec(Target.EXISTING, _checked_name(name, location), None, attributes, location)
    target = _TARGETS.get(match["target"].lower())
    if target is None:
        hint = did_you_mean(match["target"], _TARGETS)
        expected = "'duration', 'shared', 'start' or 'fluent'"
        raise InputError(f"found {shorten(match['target'])}, expected {expected}{hint}", location)
    given = match["name"]
    parameter = None if given is None else _checked_name(given.strip(), location)
    return ParameterSpec(target, _checked_subject(target, match["subject"], location), parameter, attributes, location)


def parse_specs(texts: Sequence[str]) -> tuple[ParameterSpec, ...]:
    """The specifications of several options."""
    return tuple(parse_spec(text) for text in texts)


def parse_parameter_file(text: str, file: str = "<parameters>") -> tuple[ParameterSpec, ...]:
    """The specifications in a TOML text; InputError names the parameter and the key that is wrong."""
    return tuple(_spec_of_table(name, table, file) for name, table in parameter_tables(text, file).items())


def parameter_tables(text: str, file: str) -> dict[str, object]:
    """What a TOML text says of each parameter, tables if it is right; InputError if it holds anything else."""
    document = toml_document(text, file)
    for key in document:
        if key != "parameters":
            hint = did_you_mean(key, ["parameters"])
            raise InputError(f"found key {shorten(key)}, expected only tables [parameters.NAME]{hint}", Location(file))
    tables = document.get("parameters", {})
    if not isinstance(tables, dict):
        raise InputError("found a value for 'parameters', expected tables [parameters.NAME]", Location(file))
    return tables


def read_parameter_file(path: str | PathLike[str]) -> tuple[ParameterSpec, ...]:
    """The specifications in a TOML file; InputError if it cannot be read or is wrong."""
    return parse_parameter_file(read_text(path), str(path))


def specifications(
    texts: Sequence[str], file: str | PathLike[str] | None, plan: str | PathLike[str] | None = None
) -> tuple[tuple[ParameterSpec, ...], Path | None]:
    """The specifications of options and of a TOML file, and the file beside the plan if they come from that.

    If no file is given, one of the plan's name with tables of parameters counts, but for what options say as well.

    Raises:
        InputError: if a file cannot be read or is wrong.
    """
    given = parse_specs(texts)
    if file is not None:
        return (*read_parameter_file(file), *given), None
    beside = None if plan is None or not Path(plan).name else Path(plan).with_suffix(".toml")
    if beside is None or not os.path.isfile(beside):  # of no name at all, however long, does this raise
        return given, None
    document = toml_document(read_text(beside), str(beside))
    for key in document.keys() - {"parameters"}:
        if key[:5].lower() == "param":
            message = f"{beside}: found table {shorten(key)}, which is not read; expected [parameters.NAME]"
            warnings.warn(message, InputWarning, stacklevel=2)
    if "parameters" not in document:
        return given, None
    varied = {(spec.target, spec.subject) for spec in given}
    others = (spec for spec in read_parameter_file(beside) if (spec.target, spec.subject) not in varied)
    return (*others, *given), beside


@dataclass(frozen=True, slots=True)
class DecimalText:
    """The text of a TOML float: its exact value counts."""

    text: str

    def __str__(self) -> str:
        return self.text


def toml_document(text: str, file: str, expected: str = "tables [parameters.NAME]") -> dict[str, object]:
    """The document, its floats as their texts; InputError with the place if it is not TOML."""
    import tomllib  # noqa: PLC0415 - only for parameter files

    as_text: Callable[[str], DecimalText] = DecimalText
    try:
        return tomllib.loads(text, parse_float=as_text)
    except (ValueError, RecursionError) as error:
        reason = " ".join(str(error).split())
        place = re.search(r" \(at line (\d+), column (\d+)\)$", reason)
        location = Location(file, int(place[1]), int(place[2])) if place else Location(file)
        reason = reason[: place.start()] if place else reason
        raise InputError(f"found text that is not TOML ({reason}), expected {expected}", location) from None


def _spec_of_table(name: str, table: object, file: str) -> ParameterSpec:
    location = Location(f"{file}: [parameters.{name if name.isprintable() else repr(name)}]")
    if not isinstance(table, dict):
        raise InputError(f"found {kind_of(table)}, expected a table with keys such as duration and weight", location)
    _checked_name(name, location)
    targets: list[tuple[Target, str]] = []
    attributes: dict[str, Fraction | None] = {}
    for key, value in table.items():
        if key in _TARGETS:
            if not isinstance(value, str):
                raise InputError(f"found {kind_of(value)} as {key!r}, expected a text in quotes", location)
            targets.append((_TARGETS[key], value))
        elif key in ATTRIBUTES:
            set_attribute(attributes, key, number_text(key, value, location), location)
        elif isinstance(value, dict):
            quoted = shorten(f"{name}.{key}")
            message = f"found table {shorten(key)}, expected a key; a name with a dot is quoted: [parameters.{quoted}]"
            raise InputError(message, location)
        else:
            known = (*_TARGETS, "weight", "lower", "upper", "default")
            message = f"found key {shorten(key)}, expected one of {', '.join(known)}"
            raise InputError(message + (did_you_mean(key, known) if len(known) > 8 else ""), location)
    if len(targets) > 1:
        keys = " and ".join(target.value for target, _ in targets)
        raise InputError(f"found {keys}, expected one of them: a parameter stands for one quantity", location)
    if not targets:
        return ParameterSpec(Target.EXISTING, name, None, attributes, location)
    target, subject = targets[0]
    return ParameterSpec(target, _checked_subject(target, subject, location), name, attributes, location)


def number_text(key: str, value: object, location: Location) -> str:
    """The text of a number in a TOML document; InputError if it is anything else."""
    match value:
        case bool():
            pass
        case int():
            return str(value)
        case str():
            return value
        case DecimalText(text):
            return text.replace("_", "")
    raise InputError(f'found {kind_of(value)} as {key!r}, expected a number, or one in quotes such as "1/3"', location)


def kind_of(value: object) -> str:
    """What a value of a TOML document is, for messages."""
    match value:
        case bool():
            return str(value).lower()
        case DecimalText(text):
            return text
        case int() | str():
            return shorten(str(value))
        case dict():
            return "a table"
        case list():
            return "a list"
    return f"a {type(value).__name__}"


def set_attribute(attributes: dict[str, Fraction | None], word: str, text: str, location: Location) -> None:
    """Note the value of one of :data:`ATTRIBUTES`; InputError for a second value, or a wrong one."""
    if ATTRIBUTES[word] in attributes:
        raise InputError(f"found a second value for {word!r}, expected each attribute at most once", location)
    attributes[ATTRIBUTES[word]] = stn.attribute_value(word, text, location)


def _checked_name(name: str, location: Location) -> str:
    if not stn.is_parameter_name(name):
        kinds = f"; write 'fluent:{name}' for an initial value, 'duration:{name}' for durations of an action"
        hint = kinds if _FLUENT.fullmatch(name) else ""
        raise InputError(stn.bad_parameter_name(name) + hint, location)
    return name


def _checked_subject(target: Target, text: str, location: Location) -> str:
    subject = text.strip()
    if _FLUENT.fullmatch(subject):
        return f"({' '.join(subject[1:-1].lower().split())})"
    if target is Target.FLUENT:
        message = f"found {shorten(subject)}, expected a fluent with its objects in parentheses, such as '(charge auv)'"
        raise InputError(message, location)
    if not subject:
        raise InputError(f"found nothing after '{target.value}', expected an instance identifier", location)
    return subject


@dataclass(frozen=True, slots=True)
class Wiring:
    """What specifications make of a plan: declarations, constraints, and where else their parameters stand.

    `durations` maps instances to the parameter that is their duration, `fluents` maps fluents to the parameter that is
    their initial value.
    """

    parameters: tuple[stn.ParameterDeclaration, ...]
    constraints: tuple[stn.STNConstraint, ...]
    durations: Mapping[str, str]
    fluents: Mapping[Fluent, str]


def wire(
    plan: stn.STNPlan,
    specs: Iterable[ParameterSpec],
    initial_fluents: Mapping[Fluent, Expression],
    domain_parameters: Collection[str] = (),
    *,
    nominal_needed: bool = True,
) -> Wiring:
    """Apply specifications to a plan; InputError for unknown names, doubles and missing or impossible nominal values.

    - A duration or start time whose constraints fix it at d becomes `[γ, γ]` with nominal value d (unless a default is
      given); one that is not fixed needs a default if nominal values are needed, and all its constraints are replaced
      by `[γ, γ]`.
    - The initial value of a fluent becomes γ with that value as nominal one (unless a default is given).
    - A duration that is `[γ, γ]` in the plan already keeps its parameter, named again as in `γ=duration:ID` or not: the
      plan file says that the distance is γ, and the specification that the model's duration is.
    - Existing parameters, and those that other specifications introduce, get the attributes that are given.
    """
    work = _Work(plan, initial_fluents, domain_parameters, nominal_needed=nominal_needed)
    # Stable: "all others" come after those that are named, and overrides see what others create.
    ordered = sorted(specs, key=lambda spec: (spec.target is Target.EXISTING, spec.subject == "*"))
    for spec in ordered:
        work.apply(spec)
    return Wiring(tuple(work.parameters.values()), tuple(work.constraints.values()), work.durations, work.fluents)


def referenced_parameters(constraints: Iterable[stn.STNConstraint], expressions: Iterable[Expression]) -> set[str]:
    """The names of the parameters that constraints and expressions mention."""
    bounds = (bound for constraint in constraints for bound in (constraint.lower, constraint.upper))
    names = {bound.name for bound in bounds if isinstance(bound, ParameterReference)}
    variables = (variable for expression in expressions for variable in expression.variables)
    return names | {variable.name for variable in variables if isinstance(variable, ParameterReference)}


class _Work:
    """The plan while specifications are applied one by one."""

    def __init__(
        self,
        plan: stn.STNPlan,
        initial_fluents: Mapping[Fluent, Expression],
        domain_parameters: Collection[str],
        *,
        nominal_needed: bool,
    ) -> None:
        self.plan = plan
        self.nominal_needed = nominal_needed
        self.instances = {instance.identifier: instance for instance in plan.instances}
        self.initial_fluents = initial_fluents
        self.domain_parameters = domain_parameters
        self.parameters = {parameter.name: parameter for parameter in plan.parameters}
        self.constraints: dict[int, stn.STNConstraint] = dict(enumerate(plan.constraints))
        """By number, in order; those of each pair of time points by number beside them."""
        self.between: dict[frozenset[TimePoint], list[int]] = defaultdict(list)
        for number, constraint in self.constraints.items():
            self.between[frozenset((constraint.source, constraint.target))].append(number)
        self.durations: dict[str, str] = {}
        self.fluents: dict[Fluent, str] = {}
        self.overridden: set[str] = set()
        self.introduced: set[str] = set()
        used = referenced_parameters(plan.constraints, initial_fluents.values())
        self.unused = set(self.parameters) - used - set(domain_parameters)

    def apply(self, spec: ParameterSpec) -> None:
        match spec.target:
            case Target.DURATION:
                for instance in self.timed_instances(spec):
                    self.vary_duration(instance, spec)
            case Target.SHARED:
                self.share_duration(spec)
            case Target.START:
                start = self.instance(spec).start
                self.vary_time(f"start_{spec.subject}", f"the start of {spec.subject}", ZERO, start, spec)
            case Target.FLUENT:
                self.vary_fluent(spec)
            case Target.EXISTING:
                self.override(spec)
            case _:
                assert_never(spec.target)

    def instance(self, spec: ParameterSpec) -> stn.InstanceDeclaration:
        if spec.subject not in self.instances:
            hint = did_you_mean(spec.subject, self.instances)
            raise InputError(f"found {spec.subject!r}, expected an instance of the plan{hint}", spec.location)
        return self.instances[spec.subject]

    def timed_instances(self, spec: ParameterSpec) -> list[stn.InstanceDeclaration]:
        """The instance of that identifier, else all that take time, of that action or ground action, or else of any."""
        if spec.subject in self.instances:
            return [self.instances[spec.subject]]
        if spec.subject == "*":
            others = (instance for instance in self.plan.instances if instance.identifier not in self.durations)
            return [instance for instance in others if instance.durative]
        wanted = spec.subject.lower()
        chosen = [instance for instance in self.plan.instances if wanted in (instance.action, str(instance))]
        if not chosen:
            actions = (instance.action for instance in self.plan.instances)
            hint = did_you_mean(spec.subject, [*self.instances, *actions])
            message = f"found {spec.subject!r}, expected an instance of the plan or an action that it uses{hint}"
            raise InputError(message, spec.location)
        if not any(instance.durative for instance in chosen):
            message = f"{spec.location}: passed over; no instance of {spec.subject} takes time"
            warnings.warn(message, InputWarning, stacklevel=2)
        chosen = [instance for instance in chosen if instance.durative]
        if spec.name is not None and len(chosen) > 1:
            several = ", ".join(instance.identifier for instance in chosen)
            expected = "one instance for the name (without a name, each instance gets a parameter of its own)"
            found = f"one name for {len(chosen)} instances of {spec.subject!r} ({several})"
            raise InputError(f"found {found}, expected {expected}", spec.location)
        return chosen

    def vary_duration(self, instance: stn.InstanceDeclaration, spec: ParameterSpec) -> None:
        identifier = instance.identifier
        if not instance.durative:
            found = f"{identifier!r}, which is instantaneous"
            raise InputError(f"found {found}, expected an instance of a durative action", spec.location)
        name = self.vary_time(f"dur_{identifier}", f"the duration of {identifier}", instance.start, instance.end, spec)
        self.durations[identifier] = name

    def share_duration(self, spec: ParameterSpec) -> None:
        """One parameter for the durations of all instances of an action, which must be the same."""
        chosen = self.timed_instances(replace(spec, name=None))
        if not chosen:
            return
        first, *others = chosen
        named = replace(spec, name=spec.name or f"dur_{first.action}")
        fixed = {other.identifier: _fixed(self.bounds_between(other.start, other.end)) for other in chosen}
        if len(set(fixed.values())) > 1:
            lengths = ", ".join(f"{length} ({name})" for name, length in fixed.items())
            raise InputError(f"found durations {lengths}, expected one for {spec.subject!r}", spec.location)
        self.vary_duration(first, named)
        for other in others:
            known = ParameterReference(self.durations[first.identifier])
            self.fix_between(other.start, other.end, known, spec)
            self.durations[other.identifier] = known.name

    def vary_time(self, generated: str, what: str, source: TimePoint, target: TimePoint, spec: ParameterSpec) -> str:
        """Replace all constraints between two time points by [γ, γ]; the name of γ."""
        between = self.bounds_between(source, target)
        bounds = [bound for pair in between for bound in pair]
        taken = next((bound.name for bound in bounds if isinstance(bound, ParameterReference)), None)
        known = taken == spec.name or (spec.name is None and taken not in self.introduced)
        if taken is not None and known and set(bounds) == {ParameterReference(taken)}:
            self.parameters[taken] = _merged(self.parameters[taken], spec)
            return taken
        if taken is not None:
            remedy = f"give its attributes as {taken!r},weight=W,lb=L,ub=U,default=D"
            raise InputError(f"found {what} with parameter {taken!r}, expected one without: {remedy}", spec.location)
        fixed = _fixed(between)
        name = self.introduce(generated, what, fixed, spec, f"c: {target} - {source} in [D, D] in the plan")
        self.fix_between(source, target, ParameterReference(name), spec)
        return name

    def bounds_between(self, source: TimePoint, target: TimePoint) -> list[tuple[stn.STNBound, stn.STNBound]]:
        """The bounds of all constraints between two time points, as seen from the first one."""
        return [_oriented(self.constraints[number], source) for number in self.between[frozenset((source, target))]]

    def fix_between(
        self, source: TimePoint, target: TimePoint, reference: ParameterReference, spec: ParameterSpec
    ) -> None:
        """Replace all constraints between two time points by one that makes the distance a parameter."""
        numbers = self.between[frozenset((source, target))] or [max(self.constraints, default=-1) + 1]
        for number in numbers[1:]:
            del self.constraints[number]
        self.constraints[numbers[0]] = stn.STNConstraint(target, source, reference, reference, spec.location)
        self.between[frozenset((source, target))] = numbers[:1]

    def vary_fluent(self, spec: ParameterSpec) -> None:
        function, *arguments = spec.subject[1:-1].split()
        fluent = Fluent(function, tuple(arguments))
        value = self.initial_fluents.get(fluent)
        if value is None:
            hint = did_you_mean(str(fluent), map(str, self.initial_fluents))
            message = f"found {fluent}, expected a ground fluent with an initial value in the problem{hint}"
            raise InputError(message, spec.location)
        taken = self.fluents.get(fluent) or next(iter(referenced_parameters((), [value])), None)
        if taken is not None:
            message = f"found {fluent} with parameter {taken!r}, expected a fluent whose initial value is a number"
            raise InputError(message, spec.location)
        what = f"the initial value of {fluent}"
        name = "_".join((fluent.function, *fluent.arguments))
        self.fluents[fluent] = self.introduce(name, what, value.constant_term, spec, "a number in the problem")

    def introduce(self, generated: str, what: str, fixed: Fraction | None, spec: ParameterSpec, remedy: str) -> str:
        """Declare the parameter that a specification stands for; its name."""
        name = spec.name or generated
        if not stn.is_parameter_name(name):
            raise InputError(stn.bad_parameter_name(name), spec.location)
        if (name in self.parameters and (spec.name is None or name not in self.unused)) or (
            name in self.domain_parameters
        ):
            origin = "" if spec.name else "generated "
            remedy = f"write NAME={spec.target.value}:{spec.subject} with another name"
            raise InputError(f"found {origin}name {name!r} twice, expected a new one: {remedy}", spec.location)
        self.unused.discard(name)
        base = self.parameters.get(name, stn.ParameterDeclaration(name, location=spec.location))
        merged = _merged(replace(base, default=fixed if base.default is None else base.default), spec)
        if merged.default is None and self.nominal_needed:
            option = shlex.quote(f"{spec.name + '=' if spec.name else ''}{spec.target.value}:{spec.subject},default=D")
            message = f"found no fixed value for {what}, expected a nominal value: --parameter {option}, or {remedy}"
            raise InputError(message, spec.location)
        self.parameters[name] = merged
        self.introduced.add(name)
        return name

    def override(self, spec: ParameterSpec) -> None:
        name = spec.subject
        if name not in self.parameters and name not in self.domain_parameters:
            hint = did_you_mean(name, [*self.parameters, *self.domain_parameters])
            if name in self.instances:
                hint = f"; to vary the duration of instance {name} write duration:{name}"
            elif name.lower() in {instance.action for instance in self.plan.instances}:
                hint = f"; to vary the durations of action {name} write duration:{name}"
            elif ground := [fluent for fluent in self.initial_fluents if fluent.function == name.lower()]:
                hint = f"; to vary an initial value write 'fluent:{ground[0]}'"
            raise InputError(f"found {name!r}, expected a parameter of the plan or the domain{hint}", spec.location)
        if name in self.overridden:
            raise InputError(f"found parameter {name!r} twice, expected all its attributes in one place", spec.location)
        self.overridden.add(name)
        base = self.parameters.get(name, stn.ParameterDeclaration(name, location=spec.location))
        self.parameters[name] = _merged(base, spec)


def _merged(base: stn.ParameterDeclaration, spec: ParameterSpec) -> stn.ParameterDeclaration:
    attributes: Mapping[str, Any] = spec.attributes
    merged = replace(base, **attributes)
    stn.check_range(merged, spec.location)
    return merged


def _oriented(constraint: stn.STNConstraint, source: TimePoint) -> tuple[stn.STNBound, stn.STNBound]:
    """The bounds of the constraint as seen from `source`."""
    if constraint.source == source:
        return constraint.lower, constraint.upper
    return _negated(constraint.upper), _negated(constraint.lower)


def _negated(bound: stn.STNBound) -> stn.STNBound:
    return -bound if isinstance(bound, Fraction) else bound


def _fixed(intervals: Iterable[tuple[stn.STNBound, stn.STNBound]]) -> Fraction | None:
    """The only value in the intersection of intervals, if there is exactly one."""
    pairs = list(intervals)
    lowers = [lower for lower, _ in pairs if isinstance(lower, Fraction)]
    uppers = [upper for _, upper in pairs if isinstance(upper, Fraction)]
    if lowers and uppers and max(lowers) == min(uppers):
        return max(lowers)
    return None


# -- parameters by what they are about ---------------------------------------------------------------------------------


def names_of(instance: ActionInstance) -> tuple[str, ...]:
    """What an instance is called, the name that says most precisely which first."""
    return instance.identifier, str(instance), instance.action


def parameters_by_action(plan: ParametrizedPlan) -> dict[str, list[str]]:
    """The parameters that are durations, by `duration:` and an action, a ground action, or an instance."""
    groups: dict[str, list[str]] = {}
    for parameter, identifier in plan.lasting.items():
        instance = plan.instance[identifier]
        for name in dict.fromkeys(names_of(instance)):
            groups.setdefault(f"duration:{name}", []).append(parameter)
    return groups
