"""Is the plan valid for every schedule and every parameter value of a box? If not: which obligation breaks, and how."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING

from robust.encode.interface import EPSILON, Encoding, Facet, Obligation, variable
from robust.errors import InputError, Location, SolverError
from robust.plan.model import ParameterReference, ParametrizedPlan, TimePoint
from robust.presented import OneLine, Presented, VerdictEnum
from robust.qe.box import Box, Interval
from robust.searching import Searching, Status
from robust.smt.limits import NEVER, Deadline, OutOfTimeError
from robust.smt.session import Exporter, Formula, Satisfiability, Session, Statistics

if TYPE_CHECKING:
    from robust.irr.quantities import QuantityChange
    from robust.irr.stops import Tolerance
    from robust.plan.simulate import Simulation


class Answer(VerdictEnum):
    """The verdict on a plan or on one obligation; UNKNOWN is out of time, interrupted, or a solver that failed."""

    PROVED = "proved"
    REFUTED = "refuted"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Counterexample(OneLine, ask="obligation"):
    """Parameter values and a schedule that the network allows, in which an obligation breaks.

    Times are in the plan's unit; `simulation` executes that schedule with exact arithmetic and confirms it.
    """

    obligation: str
    parameters: Mapping[str, Fraction]
    schedule: Mapping[TimePoint, Fraction]
    simulation: Simulation


@dataclass(frozen=True)
class CheckResult(Presented, ask="answer"):
    """The verdict, that of each obligation examined, and a counterexample for each refuted one, by obligation.

    `settled` is how many of them shortest paths through the network prove, so that no solver is asked. Where the
    network has no schedule at all for some parameter values of the box, there is nothing to execute: `reason` names the
    statements that contradict each other, and those values. Where a solver failed and the answer is UNKNOWN, `reason`
    says how. `seconds` are by the clock.

    `plan` is what it is about; `encoding`, `solver`, `epsilon` and `every` are as they were asked for. `repair` is the
    least change of bounds after which a refuted plan is proved, where that was looked for and found. `tolerance` is how
    much all durations that are parameters may differ at once, where the verdict is about nominal values and shortest
    paths decide it. `tree` is the file of the behavior tree whose executions it is about, instead of all schedules that
    the plan's network allows; `plan` has the tree's network then.
    """

    answer: Answer
    box: Box
    obligations: Mapping[str, Answer]
    counterexamples: Mapping[str, Counterexample]
    seconds: float
    reason: str | None = None
    interrupted: bool = False
    statistics: Statistics = field(default_factory=Statistics)
    timed_out: bool = False
    settled: int = 0
    encoding: str = "relational"
    solver: str = "z3"
    epsilon: Fraction = EPSILON
    every: bool = False
    repair: tuple[QuantityChange, ...] | None = None
    plan: ParametrizedPlan | None = field(default=None, repr=False, compare=False)
    tolerance: Tolerance | None = None
    tree: str | None = None

    @property
    def cut_short(self) -> bool:
        """Whether something ended the check before it was done."""
        return self.interrupted or self.timed_out or self.answer is Answer.UNKNOWN


@dataclass(eq=False)
class Checker(Searching[CheckResult]):
    """Examines the obligations of a plan over a box of parameter values.

    Args:
        encoding: the plan's formulas.
        box: the parameter values that the verdict is about.
        solver: `z3` or `cvc5`.
        every: examine all obligations instead of stopping at the first that breaks. Each is examined over the schedules
            that respect the stages before it.
        deadline: when to stop; what was not examined by then is UNKNOWN.
        exporter: where queries are written, if anywhere.
        on_obligation: called with the number examined so far, of how many, and the obligation's name.
    """

    encoding: Encoding
    box: Box
    _: KW_ONLY
    solver: str = "z3"
    every: bool = False
    deadline: Deadline = NEVER
    exporter: Exporter | None = None
    on_obligation: Callable[[int, int, str], None] | None = None

    def __post_init__(self) -> None:
        super().__init__()
        self._statistics = Statistics()
        self._obligations: Sequence[Obligation] | None = None
        """None until their formulas are built, which may take longer than there is time."""
        self._answers: dict[str, Answer] = {}
        self._counterexamples: dict[str, Counterexample] = {}
        self._settled = 0
        self._existence_known = False
        self._broken: Facet | None = None
        self._reason: str | None = None

    def _search(self) -> None:
        """Decide.

        Raises:
            InputError: if the network has no schedule, whatever the parameter values.
            SolverError: if the simulator does not confirm a counterexample.
        """
        existing = self._has_schedule()
        self._obligations = self.encoding.obligations
        if existing:
            self._examine(self._obligations)

    def _result(self, status: Status, reason: str | None = None) -> CheckResult:
        answers = {o.name: self._answers.get(o.name, Answer.UNKNOWN) for o in self._obligations or ()}
        overall = self._overall(answers)
        # Each question ends by itself when time is out, or its solver fails.
        undecided = overall is Answer.UNKNOWN and status is not Status.INTERRUPTED
        failure = self._statistics.failure if undecided and status is not Status.TIMEOUT else None
        late = undecided and failure is None and self.deadline.moment is not None
        return CheckResult(
            overall,
            self.box,
            answers,
            self._counterexamples,
            self._seconds(),
            self._reason or failure,
            interrupted=status is Status.INTERRUPTED,
            statistics=self._statistics,
            timed_out=late or status is Status.TIMEOUT,
            settled=self._settled,
            encoding=self.encoding.name,
            solver=self.solver,
            epsilon=self.encoding.epsilon,
            every=self.every,
            plan=self.encoding.plan,
        )

    def _overall(self, answers: Mapping[str, Answer]) -> Answer:
        if self._counterexamples or self._reason:
            return Answer.REFUTED
        complete = self._obligations is not None and all(answer is Answer.PROVED for answer in answers.values())
        return Answer.PROVED if complete and self._existence_known else Answer.UNKNOWN

    def _has_schedule(self) -> bool:
        """Whether obligations can be examined: enc_valid holds throughout the box, or one of them breaks."""
        facet = self.encoding.validity.broken_facet(self.box.grid, self._session, self.deadline)
        match facet:
            case None:
                self._existence_known = True
            case Facet(obligation=None):
                require_some_schedule(self.encoding, self._session(), self.deadline)
                self._reason = no_schedule(facet, worst_point(facet, self.box))
                return False
            case Facet():
                self._broken = facet
            case Satisfiability():
                # Where it was not for lack of time, obligations may be refuted or proved all the same.
                return self._statistics.failure is not None
        return True

    def _examine(self, obligations: Sequence[Obligation]) -> None:
        for index, obligation in enumerate(obligations):
            if self.on_obligation is not None:
                self.on_obligation(index, len(obligations), obligation.name)
            try:
                answer = self._decide(obligation)
            except OutOfTimeError:
                # Formulas can take longer to build than the time that is left.
                answer = Answer.UNKNOWN
            self._answers[obligation.name] = answer
            if answer is Answer.REFUTED and not self.every:
                return
        if self._broken is not None and not self._counterexamples:
            # It breaks for parameter values that leave no schedule to show it with.
            require_some_schedule(self.encoding, self._session(), self.deadline)
            values = worst_point(self._broken, self.box)
            listed = ", ".join(f"{name} = {value}" for name, value in values.items())
            self._reason = f"no schedule keeps {self._broken.obligation!r} with {listed}"

    def _decide(self, obligation: Obligation) -> Answer:
        if obligation.violation is None:
            self._settled += 1
            return Answer.PROVED
        if not self._counterexamples:
            # Earlier stages hold throughout the box, so the part of the network that matters is enough for a proof.
            quick = self._within_box(self.encoding.query(obligation))
            verdict = quick.check(obligation.name, self.deadline)
            if verdict is not Satisfiability.SATISFIABLE:
                return ANSWERS[verdict]
        full = self._within_box(self.encoding.full_query(obligation))
        verdict = full.check(f"{obligation.name}: counterexample", self.deadline)
        if verdict is Satisfiability.SATISFIABLE:
            self._counterexamples[obligation.name] = self._counterexample(obligation, full)
        return ANSWERS[verdict]

    def _counterexample(self, obligation: Obligation, session: Session) -> Counterexample:
        encoding = self.encoding
        values = {name: Fraction(value) for name, value in session.values(encoding.unknowns()).items()}
        parameters = {name: values.get(name, self.box[name].some_value()) for name in self.box.intervals}
        schedule = encoding.schedule({**values, **parameters})
        from robust.plan.simulate import simulate  # noqa: PLC0415 - only what is refuted needs it

        simulation = simulate(encoding.plan, parameters, schedule, epsilon=encoding.epsilon)
        broken = {violation.obligation for violation in simulation.violations}
        if simulation.network_violations or obligation.name not in broken:
            raise SolverError(
                f"the simulator does not confirm that {obligation.name!r} breaks "
                f"({'; '.join(simulation.network_violations) or 'no such violation'}); please report this plan as a bug"
            )
        return Counterexample(obligation.name, parameters, schedule, simulation)

    def _within_box(self, query: Sequence[Formula]) -> Session:
        session = self._session()
        session.add_all(query, self.deadline)
        session.add(*within(self.encoding, self.box.intervals))
        return session

    def _session(self) -> Session:
        return Session(self.encoding.terms, solver=self.solver, statistics=self._statistics, exporter=self.exporter)


ANSWERS = {
    Satisfiability.SATISFIABLE: Answer.REFUTED,
    Satisfiability.UNSATISFIABLE: Answer.PROVED,
    Satisfiability.UNKNOWN: Answer.UNKNOWN,
}


# -- boxes in formulas, and what leaves no schedule --------------------------------------------------------------------


def within(encoding: Encoding, intervals: Mapping[str, Interval]) -> Iterator[Formula]:
    """enc_R: the parameters are within their intervals."""
    terms = encoding.terms
    for name, interval in intervals.items():
        value = variable(ParameterReference(name))
        if interval.lower is not None:
            above = value - interval.lower
            yield terms.at_least(above) if interval.lower_closed else terms.greater(above)
        if interval.upper is not None:
            below = -value + interval.upper
            yield terms.at_least(below) if interval.upper_closed else terms.greater(below)


def no_schedule(facet: Facet, values: Mapping[str, Fraction]) -> str:
    """The statements of the network that contradict each other, and with which parameter values."""
    names = sorted(str(unknown) for unknown in facet.expression.variables)
    where = f" with {', '.join(f'{name} = {values[name]}' for name in names)}" if names else ""
    return f"no schedule{where}: {_contradiction(facet)}"


def _contradiction(facet: Facet) -> str:
    return f"{'; '.join(facet.origins)} {'contradict each other' if len(facet.origins) > 1 else 'cannot hold'}"


class NoScheduleError(InputError):
    """No parameter values leave a schedule; `why` names statements that contradict each other."""

    def __init__(self, why: str, location: Location | None) -> None:
        message = f"the plan's network has no schedule: {why}; expected constraints that can hold together"
        super().__init__(message, location)
        self.why = why


def require_some_schedule(encoding: Encoding, session: Session, deadline: Deadline) -> None:
    """Tell a plan that can never be executed from parameter values that leave no schedule.

    Args:
        encoding: the plan's formulas.
        session: a new session over the encoding's terms.
        deadline: when to give up, as if there were a schedule.

    Raises:
        NoScheduleError: if no parameter values leave a schedule.
    """
    session.add(*encoding.network_formulas())
    if session.check("enc_tn", deadline) is Satisfiability.UNSATISFIABLE:
        facet = encoding.validity.contradiction(encoding.plan.nominal)
        place = next((item.location for item in encoding.plan.constraints if item.location), None)
        why = _contradiction(facet) if facet is not None else "its constraints contradict each other"
        raise NoScheduleError(why, Location(place.file) if place else None)


def worst_point(facet: Facet, box: Box) -> dict[str, Fraction]:
    """A point of the box at which the facet breaks, as far out as the box allows.

    An infinite end is replaced by a value far enough to break the facet whatever the other parameters are, and a point
    on an open end by one inside that still breaks it.
    """
    inside = {name: interval.some_value() for name, interval in box.intervals.items()}
    values = dict(inside)
    infinite: list[tuple[str, Fraction]] = []
    for unknown, factor in facet.expression.coefficients():
        name = str(unknown)
        end = box[name].lower if factor > 0 else box[name].upper
        if end is None:
            infinite.append((name, factor))
        else:
            values[name] = end
    for name, factor in infinite[:1]:
        values[name] -= (max(_value(facet, values), Fraction(0)) + 1) / factor
    if not box.includes(values):
        outer, inner = _value(facet, values), _value(facet, inside)
        share = Fraction(1, 2) if inner < 0 else outer / (outer - inner) / 2
        values = {name: value + (inside[name] - value) * share for name, value in values.items()}
    return values


def _value(facet: Facet, values: Mapping[str, Fraction]) -> Fraction:
    return facet.expression.evaluate({unknown: values[str(unknown)] for unknown in facet.expression.variables})
