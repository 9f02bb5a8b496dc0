"""Random durations: learnt from logs, without assuming a distribution, or as options and rules of worlds say.

Promised limits are order statistics. Of n independent runs with one continuous distribution, at least a share p of all
future runs is at most the k-th shortest, with confidence P(Binomial(n, p) < k) [Wilks 1941]; with any other
distribution the confidence is at least that. It is computed in decimals that are rounded against the promise. The
lower limit is the shortest run. With too few runs there is no upper limit, and the lower one is 0, because durations
are not negative.

The assumption is tested: earlier runs against later ones, by the exact distribution of the greatest difference
between the empirical distribution functions of two samples of equal size [Gnedenko, Korolyuk 1951]. Where these differ,
limits must hold for the later runs by themselves too.
"""

import json
import os
import re
import time
import warnings
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal, localcontext
from fractions import Fraction
from functools import lru_cache
from math import exp, floor, lgamma, log
from operator import attrgetter
from typing import Any, Final, NamedTuple

from robust.errors import InputError, InputWarning, Location, closest, did_you_mean
from robust.execute.logs import ActionRun, Amount, RunEnding, read_runs
from robust.execute.rules import CovarianceRule, FactorRule, Rule, Rules, factor_rule, normal_name
from robust.numbers import format_number, plural, shorten
from robust.plan.model import Parameter, ParametrizedPlan
from robust.plan.parameters import names_of
from robust.presented import Presented
from robust.probability.distributions import Distribution, parse_distribution, parse_form, require_possible
from robust.probability.sharing import Joint, SharedFactor, deviation, one_factor

_PRECISION: Final = 40
"""Digits."""
SIGNIFICANT: Final = 0.05
"""A drift less probable than this without one is said."""
_ANOTHER_UNIT: Final = (500, 2000)
"""Durations of an action are in s and in ms if they are about one length or another, with this ratio."""
_ALIKE: Final = 10
"""Least ratio of the gap between two lengths to that of the ends of either."""


@dataclass(frozen=True, slots=True)
class Drift:
    """Whether later runs take another time than earlier ones.

    Attributes:
        p_value: how probable halves that differ as much as these are, if nothing has changed
        found: whether that is at most 0.05
        earlier: the median of the earlier half of the runs
        later: the median of the later half
    """

    p_value: float
    found: bool
    earlier: Fraction
    later: Fraction


@dataclass(frozen=True)
class LearntAction:
    """The durations of an action, and what they promise.

    Attributes:
        values: the durations of runs that succeeded, in the order of their starts; of the later half where it drifts.
        runs: that succeeded.
        failed: runs that did not; they are in no limit.
        unfinished: runs whose end is not in the log.
        clock_resets: runs during which the clock was set back.
        lower: the shortest run; 0 with too few for an upper limit, because no duration is negative.
        upper: at least the asked share of future runs takes no longer, with the asked confidence; None with too few.
        needed: the number of runs that an upper limit takes, of the later half alone where it drifts.
        longest: the longest run; None without runs.
        longest_confidence: of the longest run as an upper limit, rounded down.
        both_confidence: that at least the asked share is between both limits, rounded down; None without an upper one.
        drift: None with fewer than two runs.
    """

    values: Sequence[Amount]
    runs: int
    failed: int
    unfinished: int
    clock_resets: int
    lower: Fraction
    upper: Fraction | None
    needed: int
    longest: Fraction | None
    longest_confidence: float
    both_confidence: float | None
    drift: Drift | None


@dataclass(frozen=True)
class Learned(Presented, ask="actions"):
    """Durations of actions, by their names; see :func:`robust.learn`. Limits are order statistics [Wilks 1941].

    They are in the unit of the logs: seconds where these have dates, or a unit of their own.
    """

    cover: Fraction
    confidence: Fraction
    actions: Mapping[str, LearntAction]
    seconds: float

    @property
    def box(self) -> dict[str, tuple[Fraction, Fraction | None]]:
        """The promised intervals, as `at` of :func:`robust.check` and `require` of :func:`robust.repair` take them."""
        return {f"duration:{name}": (action.lower, action.upper) for name, action in self.actions.items()}

    def box_text(self) -> str:
        """The promised intervals, a line `NAME=LOW:HIGH` for each, as `--at @FILE` and `--require @FILE` read them."""
        return "".join(f"{name}={format_number(low)}:{_end(high)}\n" for name, (low, high) in self.box.items())

    def world(self) -> str:
        """A world file, see [docs/formats.md]: observed durations as empirical distributions, ground actions first."""
        return "\n".join(self._rules())

    def _rules(self) -> Iterator[str]:
        yield "# Durations that were observed: which values, and how often each."
        for name, action in sorted(self.actions.items(), key=lambda item: not item[0].startswith("(")):
            yield f"\n# {name}: {plural(action.runs, 'run')}, {action.failed} failed; promised {_promise(action)}"
            if action.drift is not None and action.drift.found:
                yield f"# later runs differ from earlier ones: the values of the later {len(action.values)}"
            if action.values:
                counts = sorted(Counter(action.values).items())
                yield f'[[draw]]\nduration = {json.dumps(name, ensure_ascii=False)}\ndistribution = "empirical"'
                yield f"values = [{', '.join(_toml(value) for value, _ in counts)}]"
                yield f"weights = [{', '.join(str(count) for _, count in counts)}]"
        yield ""


def _end(value: Fraction | None) -> str:
    return "inf" if value is None else format_number(value)


def _promise(action: LearntAction) -> str:
    return f"[{format_number(action.lower)}, {_end(action.upper)}]"


def _toml(value: Amount) -> str:
    text = format_number(Fraction(value))
    return f'"{text}"' if "/" in text else text


# -- promises ----------------------------------------------------------------------------------------------------------


@lru_cache(maxsize=16)
def runs_needed(cover: Fraction, confidence: Fraction) -> int:
    """The least number of runs whose longest covers that share of future ones with that confidence."""
    count = max(1, int(log(1 - confidence) / log(cover)) - 2)
    while _order_statistic(count, cover, confidence).limit is None:
        count += 1
    return count


class _OrderStatistic(NamedTuple):
    """Which run is the upper limit, from 1, the shortest; None for too few runs.

    `longest` is the confidence of the longest run as a limit, `both` that of the interval from the shortest run to the
    limit; neither is more than it should be.
    """

    limit: int | None
    longest: Fraction
    both: Fraction | None


@lru_cache(maxsize=1024)
def _order_statistic(runs: int, cover: Fraction, confidence: Fraction) -> _OrderStatistic:
    """The least order statistic of a number of runs that covers a share of future ones with some confidence."""
    with localcontext() as context:
        context.prec, context.rounding = _PRECISION, ROUND_FLOOR
        doubt = Decimal(confidence.denominator - confidence.numerator) / confidence.denominator
        context.rounding = ROUND_CEILING
        risks = _risks(runs, cover)
        longest = risk = next(risks)
        exceeding = -1
        while risk <= doubt:
            risk, exceeding = next(risks), exceeding + 1
        if exceeding < 0:
            return _OrderStatistic(None, 1 - Fraction(longest), None)
    return _OrderStatistic(runs - exceeding, 1 - Fraction(longest), max(1 - Fraction(risk), Fraction(0)))


def _risks(runs: int, cover: Fraction) -> Iterator[Decimal]:
    """At least P(Binomial(runs, cover) >= runs - i) for i from 0: the risk of the limit that i runs exceed.

    The context of decimals has to round up.
    """
    share = Decimal(cover.numerator) / cover.denominator
    odds = Decimal(cover.denominator - cover.numerator) / cover.numerator
    term = risk = share**runs * (1 + Decimal("1e-30"))  # a power may be rounded either way
    yield risk
    for at in range(runs):
        term = term * (runs - at) / (at + 1) * odds
        risk += term
        yield risk


# -- drift -------------------------------------------------------------------------------------------------------------


def _drift(values: Sequence[Amount], order: Sequence[int]) -> Drift | None:
    """Whether the later half of some durations differs from the earlier one; `order` is that of their lengths."""
    half = len(values) // 2
    if not half:
        return None
    earlier, later = [at for at in order if at < half], [at for at in order if at >= len(values) - half]
    balance = greatest = 0
    for at, following in zip(order, [*order[1:], None], strict=True):
        balance += (at < half) - (at >= len(values) - half)
        if abs(balance) > greatest and (following is None or values[following] != values[at]):
            greatest = abs(balance)
    medians = (Fraction(values[part[(half - 1) // 2]]) for part in (earlier, later))
    p_value = _same(half, greatest)
    return Drift(p_value, p_value <= SIGNIFICANT, *medians)


def _same(size: int, difference: int) -> float:
    """How probable so great a difference is, at least, of two samples of one distribution of this size."""
    if not difference:
        return 1.0
    whole = 2 * lgamma(size + 1)
    terms = (
        (-1) ** (at + 1) * exp(whole - lgamma(size - at * difference + 1) - lgamma(size + at * difference + 1))
        for at in range(1, size // difference + 1)
    )
    return float(min(1, 2 * sum(terms)))


# -- learning ----------------------------------------------------------------------------------------------------------


def learn(
    logs: Sequence[str | os.PathLike[str]], *, cover: Fraction, confidence: Fraction, pool: bool, known: Collection[str]
) -> Learned:
    """What logs say about the durations of actions; see :func:`robust.learn`.

    Args:
        logs: files, in the order of time.
        cover: the share of future runs that a limit covers, between 0 and 1.
        confidence: of that, between 0 and 1.
        pool: take all ground instances of an action together.
        known: the actions that there may be; all if there are none.

    Raises:
        InputError: at the line of whatever is wrong in a log, or if an action is not known.
    """
    started = time.perf_counter()
    runs: dict[str, list[ActionRun]] = {}
    for file in logs:
        for run in read_runs(file):
            name = run.action[1:-1].partition(" ")[0] if pool and run.action.startswith("(") else run.action
            runs.setdefault(name, []).append(run)
    for name, (first, *_) in runs.items():
        word = name.strip("()").partition(" ")[0].lower()
        if known and word not in known:
            expected = f"one of the domain{did_you_mean(word, known)}"
            raise InputError(f"found action {shorten(name)}, expected {expected}", Location(first.file, first.line))
    _note_order(runs)
    if reset := next((run for part in runs.values() for run in part if run.ending is RunEnding.CLOCK_RESET), None):
        message = f"{reset.action} ends before it starts: a clock was set back; the duration does not count"
        warnings.warn(InputWarning(f"{Location(reset.file, reset.line)}: {message}"), stacklevel=3)
    actions = {name: _learnt(name, part, cover, confidence) for name, part in sorted(runs.items())}
    return Learned(cover, confidence, actions, time.perf_counter() - started)


def _note_order(runs: dict[str, list[ActionRun]]) -> None:
    """Put the runs of each action in the order of their dates; warn where starts go back."""
    back: list[ActionRun] = []
    for name, part in runs.items():
        starts: list[Any] = [start for start in map(_start, part) if start is not None]
        try:
            late = [at for at in range(1, len(starts)) if starts[at] < starts[at - 1]]
        except TypeError:
            found = f"found starts of {shorten(name)} of two forms"
            expected = "expected one: dates with zones, dates without, or numbers"
            raise InputError(f"{found}, {expected}", Location(part[0].file, part[0].line)) from None
        if late and len(starts) == len(part):
            back += [part[at] for at in late]
            if isinstance(starts[0], datetime):
                runs[name] = sorted(part, key=_start)
    if back:
        first, *more = back
        order = "dates" if isinstance(first.start, datetime) else "the log"
        others = f", and so do {len(more)} more runs" if more else ""
        message = f"{first.action} starts before the run before it{others}"
        remedy = f"a clock was set back, or logs are not in their order; the order of {order} counts"
        warnings.warn(InputWarning(f"{Location(first.file, first.line)}: {message}: {remedy}"), stacklevel=4)


_start = attrgetter("start")


def _learnt(name: str, runs: Sequence[ActionRun], cover: Fraction, confidence: Fraction) -> LearntAction:
    endings = [run.ending for run in runs]
    good = [run for run in runs if run.ending is RunEnding.SUCCEEDED]
    values: Sequence[Amount] = [run.duration for run in good]
    order = sorted(range(len(good)), key=values.__getitem__)
    _refuse_two_units(name, [good[at] for at in order])
    drift = _drift(values, order)
    count = len(values)
    limits = [_limits([values[at] for at in order], cover, confidence)]
    if drift is not None and drift.found:
        count //= 2
        values = values[-count:]
        limits.append(_limits(sorted(values), cover, confidence))
    uppers = [upper for _, upper in limits if upper is not None]
    statistic = _order_statistic(count, cover, confidence)
    return LearntAction(
        values=values,
        runs=len(good),
        failed=endings.count(RunEnding.FAILED),
        unfinished=endings.count(RunEnding.UNFINISHED),
        clock_resets=endings.count(RunEnding.CLOCK_RESET),
        lower=min(lower for lower, _ in limits),
        upper=max(uppers) if len(uppers) == len(limits) else None,
        needed=runs_needed(cover, confidence),
        longest=Fraction(good[order[-1]].duration) if order else None,
        longest_confidence=_rounded_down(statistic.longest),
        both_confidence=None if statistic.both is None else _rounded_down(statistic.both),
        drift=drift,
    )


def _limits(ordered: Sequence[Amount], cover: Fraction, confidence: Fraction) -> tuple[Fraction, Fraction | None]:
    """The promised limits by durations in their order."""
    limit = _order_statistic(len(ordered), cover, confidence).limit
    if limit is None:
        return Fraction(0), None
    return Fraction(ordered[0]), Fraction(ordered[limit - 1])


def _rounded_down(share: Fraction) -> float:
    return floor(share * 10**6) / 10**6


def _refuse_two_units(name: str, ordered: Sequence[ActionRun]) -> None:
    """InputError if the durations of an action, which no log gives a unit, seem to be in two."""
    lengths = [float(run.duration) for run in ordered]
    least = bisect_right(lengths, 0)
    if least == len(lengths) or lengths[-1] < _ANOTHER_UNIT[0] * lengths[least]:
        return
    jump = max(range(least + 1, len(lengths)), key=lambda at: lengths[at] / lengths[at - 1])
    ratio = lengths[(jump + len(lengths)) // 2] / lengths[(least + jump) // 2]
    spread = max(lengths[-1] / lengths[jump], lengths[jump - 1] / lengths[least])
    gap = lengths[jump] / lengths[jump - 1]
    if gap < _ALIKE * spread or not _ANOTHER_UNIT[0] <= ratio <= _ANOTHER_UNIT[1]:
        return
    short, long = ordered[least:jump], ordered[jump:]
    one, other = (long[0], short[-1]) if len(long) <= len(short) else (short[-1], long[0])
    if not one.in_seconds:
        found = f"found duration {float(one.duration):g} of {shorten(name)}, but {float(other.duration):g} in "
        where = "line" if one.file == other.file else f"{other.file}, line"
        remedy = "expected one unit; if it is one, name it in the header, such as duration_s"
        raise InputError(f"{found}{where} {other.line}: {remedy}", Location(one.file, one.line))


Given = Mapping[str, str | Distribution] | Sequence[str]
"""Distributions by parameter, or texts `NAME=normal:30:5`."""
Places = Callable[[str, str | None], Location]
"""The place that an error names, from the name of an option and a text in it."""


def _plainly(name: str, text: str | None) -> Location:
    return Location(name if text is None else f"{name} {shorten(text)}")


def distributions_of(
    plan: ParametrizedPlan, given: Given, world: Rules | None = None, place_of: Places = _plainly
) -> dict[str, Distribution]:
    """The distribution of each parameter: what is given, else what the first rule of the world that fits says.

    What is given names a parameter, or durations as `duration:drive`, `drive`, `(drive r1 a b)`, the identifier of a
    step, `duration:*` or, for all parameters, `*`; of several that fit, the one that says most precisely what it is
    about counts. A rule of a world fits that is about the parameter, or about the duration of an instance that the
    parameter is. A parameter without either is as planned.

    Raises:
        InputError: wrong distributions, or names that fit nothing; or nothing is said about any parameter.
    """
    known = _given(given, plan, place_of)
    rules = world or Rules()
    ruled = bool(known)
    for parameter in plan.parameters:
        name = parameter.name
        if name in known:
            continue
        rule = rules.parameter(name)
        if rule is None and name in plan.lasting:
            rule = rules.duration(plan.instance[plan.lasting[name]])
        ruled = ruled or rule is not None
        known[name] = _ruled(rule, parameter, place_of, "distribution" if world is None else "world")
    if not ruled and (plan.parameters or world is not None):
        names = ", ".join(parameter.name for parameter in plan.parameters) or "none"
        message = f"found no distribution of a parameter, expected one such as normal::10%; known are {names}"
        raise InputError(message, place_of("distribution" if world is None else "world", None))
    return {parameter.name: known[parameter.name] for parameter in plan.parameters}


class Randomness(NamedTuple):
    """Distributions of all parameters by themselves; what they share, as factors or as covariances."""

    distributions: dict[str, Distribution]
    factors: tuple[SharedFactor, ...] = ()
    joints: tuple[Joint, ...] = ()


def randomness_of(
    plan: ParametrizedPlan,
    given: Given,
    factors: Sequence[str] = (),
    world: Rules | None = None,
    place_of: Places = _plainly,
) -> Randomness:
    """The distributions of parameters, see :func:`distributions_of`, and factors and covariances of those of durations.

    Factors are given as `weather*drive,fly=KIND:…`, which scales durations, or `weather+drive=KIND:…`, which adds to
    them. Covariances of one factor and noise become factors.

    Raises:
        InputError: also if a factor is about no parameter, or a name of a covariance about none or several.
    """
    rules = world or Rules()
    shared = [*(_factor_of(text, place_of("factor", text)) for text in factors), *rules.factors]
    about: dict[FactorRule | CovarianceRule, list[str]] = {
        rule: _shared(rule.subjects, plan, place_of("factor", rule.name), all_of=True) for rule in shared
    }
    about |= {rule: _shared(rule.subjects, plan, place_of("world", "covariance")) for rule in rules.covariances}
    chosen = {name: rule for rule, names in about.items() for name in names}
    try:
        distributions = distributions_of(plan, given, world, place_of)
    except InputError:
        if not chosen or given or rules.rules:
            raise
        nominal = {parameter.name: _planned(parameter) for parameter in plan.parameters}
        if None in nominal.values():
            raise
        distributions = {
            name: Distribution("constant", {"value": value or Fraction(0)}) for name, value in nominal.items()
        }
    for names in about.values():
        for name in names:
            least = distributions[name].support[0]
            if least is not None and least < 0:
                raise InputError(f"found values below 0 of {name}, expected durations", place_of("factor", name))
    joint: list[Joint] = []
    known = [_factor(rule, names) for rule, names in about.items() if isinstance(rule, FactorRule)]
    for rule, names in about.items():
        if isinstance(rule, CovarianceRule):
            known += _jointly(rule, names, plan, distributions, joint)
    return Randomness(distributions, tuple(known), tuple(joint))


def _factor_of(text: str, place: Location) -> FactorRule:
    head, equals, kind = text.partition("=")
    match = re.fullmatch(r"\s*([\w -]+?)\s*([*+])\s*(.+?)\s*", head)
    if match is None or not equals:
        expected = "NAME*ACTION,ACTION=KIND:… or NAME+ACTION=KIND:…, such as weather*drive=triangular:0.9:1:1.4"
        raise InputError(f"found {shorten(text)}, expected {expected}", place)
    return factor_rule(match[1], match[3].split(","), parse_form(kind, place), scales=match[2] == "*", place=place)


def _shared(subjects: Sequence[str], plan: ParametrizedPlan, place: Location, *, all_of: bool = False) -> list[str]:
    """The parameters that names are about: all, or one for each name."""
    found: list[str] = []
    for subject in subjects:
        names = [name for _, name in _subjects(subject, plan, place)]
        if subject == "*":
            names = [name for _, name in _subjects("duration:*", plan, place)]
        if not all_of and len(names) != 1:
            raise InputError(f"found {len(names)} parameters that {shorten(subject)} is about, expected one", place)
        found += [name for name in names if name not in found]
    return found


def _factor(rule: FactorRule, names: Sequence[str]) -> SharedFactor:
    shifts = {} if rule.scales else dict.fromkeys(names, Fraction(1))
    return SharedFactor(rule.name, rule.distribution, frozenset(names if rule.scales else ()), shifts)


def _jointly(
    rule: CovarianceRule,
    names: Sequence[str],
    plan: ParametrizedPlan,
    distributions: dict[str, Distribution],
    joint: list[Joint],
) -> list[SharedFactor]:
    """The factors of a covariance matrix, if it has them; and normal distributions of its parameters."""
    planned = {parameter.name: parameter.nominal for parameter in plan.parameters}
    factors = one_factor(rule.matrix)
    made = []
    own = [row[number] for number, row in enumerate(rule.matrix)]
    for number, (loadings, variance) in enumerate(factors or ()):
        normal = Distribution("normal", {"mean": Fraction(0), "deviation": deviation(variance)}).settled
        made.append(
            SharedFactor(
                f"covariance {number + 1}", normal, shifts={names[at]: share for at, share in loadings.items()}
            )
        )
        for at, share in loadings.items():
            own[at] -= share * share * variance
    if factors is None:
        joint.append(Joint(tuple(names), rule.matrix))
    for number, name in enumerate(names):
        mean = planned[name] if rule.means is None else rule.means[number]
        distributions[name] = Distribution("normal", {"mean": mean, "deviation": deviation(own[number])}).settled
    return made


def _given(given: Given, plan: ParametrizedPlan, place_of: Places) -> dict[str, Distribution]:
    """The distributions of the parameters that what was given is about."""
    parameters = {parameter.name: parameter for parameter in plan.parameters}
    said: dict[str, tuple[int, str | Distribution, Location]] = {}
    subjects: set[str] = set()
    for text, value in given.items() if isinstance(given, Mapping) else ((text, "") for text in given):
        name, kind, place = text, value, place_of("distribution", str(text))
        if not isinstance(given, Mapping):
            name, equals, kind = (part.strip() for part in text.partition("="))
            if not equals or not name:
                raise InputError(f"found {shorten(text)}, expected NAME=DISTRIBUTION such as a=normal:30:5", place)
        if not isinstance(kind, str | Distribution):
            raise InputError(f"found {shorten(repr(kind))}, expected a distribution such as 'normal:30:5'", place)
        if name in subjects:
            raise InputError(f"found a second distribution of {shorten(name)}, expected one", place)
        subjects.add(name)
        for width, parameter in _subjects(str(name), plan, place):
            if parameter not in said or width < said[parameter][0]:
                said[parameter] = width, kind, place
    distributions = {}
    for name, (_, kind, place) in said.items():
        planned = _planned(parameters[name])
        distributions[name] = kind if isinstance(kind, Distribution) else parse_distribution(kind, planned, place)
    return distributions


def _subjects(name: str, plan: ParametrizedPlan, place: Location) -> Iterator[tuple[int, str]]:
    """The parameters that a name is about, and how little it says about which.

    Raises:
        InputError: if there is none.
    """
    names = [parameter.name for parameter in plan.parameters]
    subject = normal_name(name.removeprefix("duration:"))
    if name in names:
        yield 0, name
        return
    found = [
        (width, parameter)
        for parameter, identifier in plan.lasting.items()
        for width, known in enumerate((*names_of(plan.instance[identifier]), "*"))
        if known == subject and name != "*"
    ]
    found = found or ([(4, one) for one in names] if name == "*" else [])
    if not found:
        steps = {name for step in plan.instances for name in (*names_of(step), "*")}
        close = closest(name, {*names, *steps}) or did_you_mean(name, names)
        remedy = close if names else "; the plan has none, and --parameter 'duration:*' makes some"
        if subject in steps and name != "*":
            message = f"found no parameter that is a duration of {shorten(subject)}, expected one; "
            raise InputError(f"{message}'duration:{subject}' as a parameter makes some", place)
        message = f"found unknown parameter {shorten(name)}, expected a parameter, an action, a step or *{remedy}"
        raise InputError(message, place)
    yield from found


def _planned(parameter: Parameter) -> Fraction | None:
    return parameter.nominal if parameter.has_nominal else None


def _ruled(rule: Rule | None, parameter: Parameter, place_of: Places, option: str) -> Distribution:
    """The distribution of a parameter by a rule; without a rule, it has its planned value."""
    planned = _planned(parameter)
    if planned is None:
        message = f"found neither a distribution nor a nominal value of parameter {shorten(parameter.name)}"
        raise InputError(f"{message}, expected one of them", place_of(option, None))
    if rule is None:
        return Distribution("constant", {"value": planned})
    distribution = rule.about(planned)
    require_possible(distribution.kind, distribution.numbers, place_of(option, parameter.name))
    return distribution
