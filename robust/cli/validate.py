"""`robust validate`: schedules as they stand, one plan after the other."""

from __future__ import annotations

import logging
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from robust.cli.build import action
from robust.cli.guard import Cause, GivenUpError
from robust.errors import UNDECIDED, RobustError
from robust.numbers import plural
from robust.options.verbs import ValidateCommand

if TYPE_CHECKING:
    from robust.cli.guard import Run
    from robust.execute.validate import Verdict
    from robust.plan.pddl.syntax import Domain, Problem
    from robust.show.validation import Judged

log = logging.getLogger(__name__)
_Files = tuple[Path, Path, Path]


@action(ValidateCommand)
def validate(options: ValidateCommand, run: Run) -> int:
    """Is a plan valid as it stands, at the times that it says? If not: what breaks, when, by how much, what would help.

    Any number of plans of one problem, or those of a list. robust check judges all schedules of a network.
    """
    from robust.show import validation

    judged: list[Judged] = []
    cause: Cause | None = None
    try:
        run.only(lambda: _judge_all(options, run, judged))
    except GivenUpError as error:
        if not judged:
            raise
        cause = run.guard.why(error)
    status = "complete" if cause is None else cause.value
    run.answer(
        lambda: validation.validate(judged, status, options.separation, options.rounding),
        lambda out: validation.print_verdicts(out, judged, quiet=options.quiet),
    )
    if cause is not None:
        print(f"robust: {cause.message} after {plural(len(judged), 'plan')}", file=sys.stderr)
    return max([*(one.exit_code for one in judged), 0 if cause is None else UNDECIDED])


def _judge_all(options: ValidateCommand, run: Run, judged: list[Judged]) -> None:
    from robust.show.validation import Judged
    from robust.sweeps.suites import listed_files

    problems = _Problems()
    every: list[_Files] = []
    if options.domain is not None and options.problem is not None:
        problems.read(options.domain, options.problem)  # what is wrong with these is said once
        every = [(options.domain, options.problem, plan) for plan in options.plans]
    elif options.suite is not None:
        every = listed_files(options.suite)
    for number, (domain, problem, plan) in enumerate(every, start=1):
        doing = f"plan {number} of {len(every)}: {plan}"
        run.display.say(doing)
        log.debug(doing)
        try:
            verdict = _judged(options, *problems.read(domain, problem), plan)
        except RobustError as error:
            if len(every) == 1:
                raise
            judged.append(Judged(domain, problem, plan, error=error))
        else:
            judged.append(Judged(domain, problem, plan, verdict))
            if verdict.note:
                run.note(f"{verdict.plan}: {verdict.note}")


def _judged(options: ValidateCommand, domain: Domain, problem: Problem, plan: Path) -> Verdict:
    from robust.execute.validate import read_plan, validate
    from robust.plan.pddl.forms import read_plan_text

    timed = read_plan(*read_plan_text(plan), options.plan_number)
    return validate(domain, problem, timed, epsilon=options.separation, tolerance=options.rounding)


class _Problems:
    """Reads domains and problems; the last ones are kept, because plans of one problem come together."""

    def __init__(self) -> None:
        self._domain: tuple[Path, Domain] | None = None
        self._problem: tuple[tuple[Path, Path], Problem] | None = None

    def read(self, domain: Path, problem: Path) -> tuple[Domain, Problem]:
        from robust.plan.pddl.reader import read_domain, read_problem

        if self._domain is None or self._domain[0] != domain:
            self._domain = domain, read_domain(domain)
        if self._problem is None or self._problem[0] != (domain, problem):
            self._problem = (domain, problem), read_problem(problem, self._domain[1])
        return self._domain[1], self._problem[1]
