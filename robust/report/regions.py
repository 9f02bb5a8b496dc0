"""`robust region`: from options to the exact envelope on the terminal, or an outer bound of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.text import Text

from robust.errors import InputError, Location, did_you_mean
from robust.plan.model import ParametrizedPlan
from robust.qe.compute import RegionResult, RegionStatus
from robust.qe.constraint import LinearConstraint, Sense
from robust.qe.polyhedron import Polyhedron
from robust.qe.region import Region, absorb
from robust.qe.render import oriented
from robust.report import options
from robust.report.guard import Cause, GivenUpError, Guard
from robust.report.numbers import duration, readable
from robust.report.output import answering, print_json
from robust.report.progress import Display
from robust.report.terminal import console

MANY = 20
"""Pieces up to which a region is shown as a union by default."""
_STATUS = {Cause.TIMEOUT: RegionStatus.TIMEOUT, Cause.INTERRUPTED: RegionStatus.INTERRUPTED}
_STOPPED = {RegionStatus.TIMEOUT: "out of time", RegionStatus.INTERRUPTED: "interrupted"}


@dataclass(frozen=True)
class RegionRequest:
    """The options as they were typed."""

    files: tuple[Path, Path, Path]
    backend: str = "project"
    splitting: str = "full"
    learning: bool = True
    form: str | None = None
    latex: bool = False
    specs: tuple[str, ...] = ()
    parameter_file: Path | None = None
    epsilon: str = "1/1000"
    encoding: str = "relational"
    solver: str = "z3"
    timeout: str | None = None
    plot: Path | None = None
    axes: str | None = None
    json: bool = False
    quiet: bool = False
    progress: bool = False


@dataclass
class _Run:
    """One run: the checked options, and what is known if it has to be given up."""

    request: RegionRequest
    guard: Guard
    display: Display
    epsilon: Fraction
    limit: float | None
    axes: tuple[str, ...]
    plan: ParametrizedPlan | None = None
    pieces: list[Polyhedron] = field(default_factory=list)

    def compute(self) -> RegionResult:
        from robust.api import region  # noqa: PLC0415 - imports solvers, which Ctrl-C is to be able to end
        from robust.plan.load import load_plan  # noqa: PLC0415 - imports the grammar

        request = self.request
        plan = load_plan(*request.files, parameters=request.specs, parameter_file=request.parameter_file)
        if request.plot is not None:
            shown_axes(plan, self.axes)
        self.plan = plan
        self.display.say("encoding")
        return region(
            plan,
            backend=request.backend,
            splitting=request.splitting,
            learning=request.learning,
            epsilon=self.epsilon,
            encoding=request.encoding,
            solver=request.solver,
            timeout=self.guard.remaining(self.limit),
            on_piece=self._on_piece,
        )

    def _on_piece(self, piece: Polyhedron) -> None:
        self.pieces.append(piece)
        self.display.say(f"polyhedra of bad values: {len(self.pieces)}")

    def so_far(self) -> RegionResult | None:
        """What the pieces leave, given up while the enumeration was not able to return it; None without a plan."""
        if self.plan is None:
            return None
        request = self.request
        names = tuple(parameter.name for parameter in self.plan.parameters)
        sides = []
        for parameter in self.plan.parameters:
            if parameter.lower is not None:
                sides.append(LinearConstraint.of({parameter.name: 1}, ">=", parameter.lower))
            if parameter.upper is not None:
                sides.append(LinearConstraint.of({parameter.name: 1}, "<=", parameter.upper))
        return RegionResult(
            _STATUS[self.guard.cause or Cause.INTERRUPTED],
            Region.difference(Polyhedron(names, tuple(sides)), list(self.pieces)),
            request.backend,
            request.splitting,
            request.learning,
            request.encoding,
            request.solver,
            self.guard.age,
            len(self.pieces),
        )

    def print(self, result: RegionResult) -> None:
        request = self.request
        if request.json:
            print_json(region_answer(result, self.epsilon))
            return
        with answering():
            if request.latex:
                print_latex(console(), result)
            else:
                print_region(console(), result, quiet=request.quiet)


def run_region(request: RegionRequest, guard: Guard) -> int:
    """Compute and print.

    Raises:
        RobustError: wrong input, or input that is not supported.
        GivenUpError: if interrupted while files were being read.
    """
    with Display(shown=request.progress, what="reading") as display:
        run = _Run(
            request,
            guard,
            display,
            epsilon=options.not_negative(request.epsilon, "--epsilon"),
            limit=options.seconds(request.timeout, "--timeout"),
            axes=options.names(request.axes, "--axes"),
        )
        plot = options.plot_file(request.plot)
        if request.latex and request.json:
            raise InputError("found it with --json, expected one of the two", Location("--latex"))
        result = _given_form(run, _compute(run))
    run.print(result)
    if plot is not None and run.plan is not None:
        plot_slice(result.region, run.plan, plot, run.axes)
    return 0 if result.is_exact else 3


def _compute(run: _Run) -> RegionResult:
    def on_stuck() -> bool:
        run.display.stop()
        known = run.so_far()
        if known is not None:
            run.print(known)
        return known is not None

    try:
        with run.guard.working(run.limit, on_stuck):
            result = run.compute()
    except KeyboardInterrupt:
        known = run.so_far()
        if known is None:
            raise GivenUpError from None
        return known
    if run.guard.cause is not None and not result.is_exact:
        return replace(result, status=_STATUS[run.guard.cause])
    return result


def _given_form(run: _Run, result: RegionResult) -> RegionResult:
    """In the form that was asked for, or in the shorter one; as it is where there is no time left."""
    if run.guard.cause is not None:
        return result
    run.display.say("simplifying")
    try:
        with run.guard.working():
            return replace(result, region=in_form(result.region, run.request.form))
    except KeyboardInterrupt:
        return result


# -- forms -----------------------------------------------------------------------------------------------------------


def in_form(region: Region, form: str | None) -> Region:
    """The region simplified, as a `union` or a `difference`; None: a union if that takes no more than a few pieces."""
    match form:
        case "union":
            return region.as_union().simplified()
        case "difference":
            return tidied(region.as_difference())
        case _:
            return short_union(region) or tidied(region)


def tidied(region: Region) -> Region:
    """The region simplified; of many pieces only those that others contain are left out, which is quick."""
    if len(region.pieces) <= MANY or region.base is None:
        return region.simplified()
    return Region.difference(region.base, absorb(region.pieces))


def short_union(region: Region, most: int = MANY) -> Region | None:
    """The region as a simplified union if at no moment of the conversion there are more pieces than `most`."""
    if len(region.pieces) > 3 * most:
        return None
    current: list[Polyhedron] = []
    for base, removed in region.parts():
        rest = [base]
        for piece in removed:
            parts = [Region.difference(old, (piece,)).as_union().pieces for old in rest]
            rest = list(absorb(part for pieces in parts for part in pieces))
            if len(rest) > most:
                return None
        current += rest
    return Region.union_of(region.parameters, current).simplified() if len(current) <= most else None


# -- output ----------------------------------------------------------------------------------------------------------


def region_answer(result: RegionResult, epsilon: Fraction) -> dict[str, Any]:
    """`robust/region/1`."""
    document = result.region.as_dict()
    return {
        "schema": document.pop("schema"),
        "status": result.status.value,
        "meaning": result.meaning,
        **document,
        "backend": result.backend,
        "splitting": result.splitting,
        "learning": result.learning,
        "encoding": result.encoding,
        "solver": result.solver,
        "epsilon": str(epsilon),
        "pieces": result.pieces,
        "seconds": round(result.seconds, 6),
        "statistics": result.statistics.as_dict(),
    }


def print_latex(out: Console, result: RegionResult) -> None:
    """A formula; what it is, if not the envelope, in a comment."""
    if not result.is_exact:
        out.print(Text(f"% {_STOPPED[result.status]}: {result.meaning}"), soft_wrap=True)
    out.print(Text(result.region.to_latex()), soft_wrap=True)


def print_region(out: Console, result: RegionResult, *, quiet: bool) -> None:
    """Inequalities, and what they mean; unless `quiet` also how they were found."""
    for line in region_lines(result.region, exact=result.is_exact):
        out.print(Text(line), soft_wrap=True)
    if not quiet:
        out.print()
    if not result.is_exact:
        text = f"{_STOPPED[result.status]}: an outer bound of the envelope; outside the plan can fail, inside it may"
        out.print(Text(text, style="yellow"), soft_wrap=True)
    if not quiet:
        out.print(_summary(result), soft_wrap=True)


def _summary(result: RegionResult) -> Text:
    text = Text()
    if result.is_exact:
        text.append("complete", style="green")
        text.append(": the exact envelope; ")
    found = "1 polyhedron" if result.pieces == 1 else f"{result.pieces} polyhedra"
    text.append(f"{found} of bad values, {result.backend}, {duration(result.seconds)}.")
    return text


def region_lines(region: Region, *, exact: bool) -> Iterator[str]:
    """The region as sentences over lines of inequalities."""
    valid = "The plan is valid if and only if" if exact else "The plan can be valid only if"
    region = region if region.base is None or region.pieces else Region.union_of(region.parameters, (region.base,))
    if not region.parameters:
        holds = "is valid" if exact else "can be valid"
        yield f"The plan {holds if region.some_point() is not None else 'is not valid'}; it has no parameters."
        return
    if region.base is None and not region.pieces:
        yield "The plan is valid for no parameter values."
    elif region.base is None and len(region.pieces) == 1:
        lines = polyhedron_lines(region.pieces[0])
        if lines:
            yield valid
            yield from (f"  {line}" for line in lines)
        else:
            yield f"The plan {'is' if exact else 'can be'} valid for all parameter values."
    elif region.base is None:
        yield f"{valid} all lines of one of these {len(region.pieces)} groups hold"
        for index, piece in enumerate(region.pieces, start=1):
            yield f"  {index}."
            yield from (f"     {line}" for line in polyhedron_lines(piece) or ["no condition"])
    else:
        yield valid
        yield from (f"  {line}" for line in polyhedron_lines(region.base) or ["(no condition)"])
        yield f"and not all lines of {'this group' if len(region.pieces) == 1 else 'one of these groups'} hold"
        for index, piece in enumerate(region.pieces, start=1):
            yield f"  {index}."
            yield from (f"     {line}" for line in polyhedron_lines(piece) or ["no condition"])


def polyhedron_lines(piece: Polyhedron) -> list[str]:
    """One line for each linear form: `2 ≤ a + b < 5`."""
    lower: dict[str, str] = {}
    upper: dict[str, str] = {}
    for constraint in piece.constraints:
        if not constraint.coefficients:
            if constraint.is_false:
                return ["0 = 1"]
            continue
        terms, sign, constant = oriented(constraint)
        form, number = _form(terms), readable(constant)
        if constraint.relation is Sense.EQUAL:
            upper[form], lower[form] = f" = {number}", ""
        elif sign in "≤<":
            lower.setdefault(form, "")
            upper[form] = f" {sign} {number}"
        else:
            lower[form] = f"{number} {'≤' if sign == '≥' else '<'} "
    return [_line(form, before, upper.get(form, "")) for form, before in lower.items()]


def _line(form: str, before: str, after: str) -> str:
    if before and not after:
        number, sign = before.split()
        return f"{form} {'≥' if sign == '≤' else '>'} {number}"
    return f"{before}{form}{after}"


def _form(terms: Sequence[tuple[str, Fraction]]) -> str:
    text = ""
    for name, factor in terms:
        sign = ("−" if factor < 0 else "") if not text else (" − " if factor < 0 else " + ")
        text += f"{sign}{'' if abs(factor) == 1 else f'{readable(abs(factor))} '}{name}"
    return text


# -- drawings --------------------------------------------------------------------------------------------------------


def shown_axes(plan: ParametrizedPlan, axes: Sequence[str]) -> tuple[str, ...]:
    """The one or two parameters that are drawn: those that were asked for, or the first two.

    Raises:
        InputError: if there is nothing to draw, or the axes are none.
    """
    known = [parameter.name for parameter in plan.parameters]
    if not known:
        raise InputError("found a plan without parameters, expected one or more to draw", Location("--plot"))
    for name in axes:
        if name not in known:
            raise InputError(f"found unknown parameter {name!r}{did_you_mean(name, known)}", Location("--axes"))
    if len(axes) > 2 or len(set(axes)) < len(axes):
        raise InputError(f"found {','.join(axes)}, expected one or two different parameters", Location("--axes"))
    return tuple(axes) or tuple(known[:2])


def plot_slice(
    region: Region,
    plan: ParametrizedPlan,
    path: Path,
    axes: Sequence[str],
    draw: Callable[..., None] | None = None,
    **overlays: Any,
) -> None:
    """Draw one or two parameters, the others at their nominal values."""
    from robust.qe.plot import plot_region  # noqa: PLC0415 - late, as all that leads to matplotlib

    shown = shown_axes(plan, axes)
    nominal = {name: value for name, value in plan.nominal.items() if name in region.parameters}
    rest = {name: value for name, value in nominal.items() if name not in shown}
    (draw or plot_region)(region, path, axes=shown, at=rest or None, points={"nominal values": nominal}, **overlays)
