"""`robust envelope`: from options to a box on the terminal, whenever the search ends."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path

from robust.errors import InputError, Location
from robust.irr.box import Box, EnvelopeResult, Status, Step
from robust.irr.check import Answer, Counterexample
from robust.plan.model import ParametrizedPlan
from robust.report import options
from robust.report.answers import envelope_answer
from robust.report.controlling import ControllabilityReport, assess, controllability_answer, print_controllability
from robust.report.guard import Cause, GivenUpError, Guard
from robust.report.numbers import readable
from robust.report.output import answering, print_json
from robust.report.progress import Display
from robust.report.terminal import console, print_envelope

_CODES = {Status.COMPLETE: 0, Status.INVALID: 1, Status.TIMEOUT: 3, Status.INTERRUPTED: 3}
_STATUS = {Cause.TIMEOUT: Status.TIMEOUT, Cause.INTERRUPTED: Status.INTERRUPTED}


@dataclass(frozen=True)
class EnvelopeRequest:
    """The options as they were typed."""

    files: tuple[Path, Path, Path]
    method: str = "widen"
    encoding: str = "relational"
    beta: str | None = None
    doubling: bool = False
    contain_nominal: bool = False
    order: str | None = None
    controllability: str | None = None
    specs: tuple[str, ...] = ()
    parameter_file: Path | None = None
    epsilon: str = "1/1000"
    solver: str = "z3"
    timeout: str | None = None
    plot: Path | None = None
    smt2: Path | None = None
    json: bool = False
    quiet: bool = False
    progress: bool = False

    def promise(self, beta: Fraction | None) -> str:
        """What a complete box of this method is, for people."""
        if self.method == "irr" and beta is not None:
            return f"no end can move outwards by {readable(beta * 2 if self.doubling else beta)} or more"
        if self.method == "optimal":
            where = "around the nominal values" if self.contain_nominal else "in the envelope"
            return f"no box {where} is wider"
        return "no valid box contains this one"


@dataclass
class _Search:
    """One run: the checked options, and what is known if the search has to be given up."""

    request: EnvelopeRequest
    guard: Guard
    display: Display
    beta: Fraction | None
    epsilon: Fraction
    limit: float | None
    order: tuple[str, ...]
    plan: ParametrizedPlan | None = None
    step: Step | None = None
    first_widening: float | None = field(default=None)

    def run(self) -> EnvelopeResult:
        from robust.api import envelope  # noqa: PLC0415 - imports solvers, which Ctrl-C is to be able to end
        from robust.plan.load import load_plan  # noqa: PLC0415 - imports the grammar

        request = self.request
        self.plan = load_plan(*request.files, parameters=request.specs, parameter_file=request.parameter_file)
        self.display.say("encoding, then checking the nominal values")
        return envelope(
            self.plan,
            method=request.method,
            beta=self.beta,
            doubling=request.doubling,
            order=self.order,
            contain_nominal=request.contain_nominal,
            encoding=request.encoding,
            epsilon=self.epsilon,
            solver=request.solver,
            timeout=self.guard.remaining(self.limit),
            smt2=request.smt2,
            on_step=self._on_step,
        )

    def _on_step(self, step: Step) -> None:
        self.step = step
        if step.accepted and self.first_widening is None:
            self.first_widening = step.seconds
        self.display.step(step)

    def so_far(self) -> EnvelopeResult | None:
        """The best box, given up while the search was not able to return it itself; None before there was a plan."""
        if self.plan is None:
            return None
        step = self.step
        return EnvelopeResult(
            status=_STATUS[self.guard.cause or Cause.INTERRUPTED],
            method=self.request.method,
            encoding=self.request.encoding,
            solver=self.request.solver,
            beta=self.beta,
            parameters=self.plan.parameters,
            box=step.box if step else Box.nominal(self.plan.parameters),
            checks=step.check if step else 0,
            unbounded_checks=0,
            first_widening_seconds=self.first_widening,
            seconds=step.seconds if step else self.guard.age,
            verified=step is not None,
        )

    def counterexample(self, result: EnvelopeResult) -> Counterexample | None:
        """What happens at the nominal point of an invalid plan; None if there is no schedule, or no time left."""
        from robust.api import check  # noqa: PLC0415 - imported already

        if result.status is not Status.INVALID or self.plan is None:
            return None
        try:
            with self.guard.working(self.limit):
                checked = check(
                    self.plan,
                    epsilon=self.epsilon,
                    encoding=self.request.encoding,
                    solver=self.request.solver,
                    timeout=self.guard.remaining(self.limit),
                )
        except KeyboardInterrupt:
            return None
        found = checked.counterexamples.values() if checked.answer is Answer.REFUTED else ()
        return next(iter(found), None)

    def controllability(self, result: EnvelopeResult) -> ControllabilityReport | None:
        """What a dispatcher may not know; None if that is not asked, there is no box, or it was interrupted."""
        request, plan = self.request, self.plan
        if request.controllability is None or plan is None or not result.verified:
            return None
        remaining = self.guard.remaining(self.limit)
        try:
            with self.guard.working(self.limit):
                return assess(plan, result.box, request.controllability, solver=request.solver, timeout=remaining)
        except KeyboardInterrupt:
            return None

    def print(
        self,
        result: EnvelopeResult,
        counterexample: Counterexample | None = None,
        controllability: ControllabilityReport | None = None,
    ) -> None:
        if self.request.json:
            answer = envelope_answer(result, counterexample)
            if self.request.controllability is not None:
                answer["controllability"] = controllability and controllability_answer(controllability)
            print_json(answer)
            return
        with answering():
            out, quiet = console(), self.request.quiet
            promise = self.request.promise(self.beta)
            print_envelope(out, result, promise=promise, quiet=quiet, counterexample=counterexample)
            if controllability is not None:
                print_controllability(out, controllability, quiet=quiet)


def run_envelope(request: EnvelopeRequest, guard: Guard) -> int:
    """Search and print.

    Raises:
        RobustError: wrong input, or input that is not supported.
        GivenUpError: if interrupted while files were being read.
    """
    with Display(shown=request.progress, what="reading") as display:
        search = _Search(
            request,
            guard,
            display,
            beta=_precision(request),
            epsilon=options.not_negative(request.epsilon, "--epsilon"),
            limit=options.seconds(request.timeout, "--timeout"),
            order=options.names(request.order, "--order"),
        )
        plot = options.plot_file(request.plot)
        result = _search(search)
        display.say("looking for a schedule that fails")
        counterexample = search.counterexample(result)
        display.say("asking whether the box is controllable")
        controllability = search.controllability(result)
    search.print(result, counterexample, controllability)
    if plot is not None and result.verified:
        from robust.report.plots import plot_envelope  # noqa: PLC0415 - imports matplotlib

        plot_envelope(result, plot)
    return _CODES[result.status]


def _precision(request: EnvelopeRequest) -> Fraction | None:
    """InputError if options are given that do not belong to the method."""
    strange = {
        "--beta": request.beta is not None and request.method != "irr",
        "--doubling": request.doubling and request.method != "irr",
        "--contain-nominal": request.contain_nominal and request.method != "optimal",
        "--order": request.order is not None and request.method == "optimal",
    }
    for option, is_strange in strange.items():
        if is_strange:
            owner = {"--contain-nominal": "optimal", "--order": "widen or irr"}.get(option, "irr")
            raise InputError(
                f"found it with --method {request.method}, expected --method {owner}, or no {option}", Location(option)
            )
    return options.positive(request.beta or "1", "--beta") if request.method == "irr" else None


def _search(search: _Search) -> EnvelopeResult:
    def on_stuck() -> bool:
        search.display.stop()
        known = search.so_far()
        if known is not None:
            search.print(known)
        return known is not None

    try:
        with search.guard.working(search.limit, on_stuck):
            result = search.run()
    except KeyboardInterrupt:
        known = search.so_far()
        if known is None:
            raise GivenUpError from None
        return known
    if search.guard.cause is not None and result.status in {Status.TIMEOUT, Status.INTERRUPTED}:
        # A solver that was interrupted may look like one that ran out of time.
        return replace(result, status=_STATUS[search.guard.cause])
    return result
