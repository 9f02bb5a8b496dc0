"""Another plan for `robust watch` while the run goes on: asked for in the background, proved, kept in the journal."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from robust.errors import InputError, RobustError
from robust.smt.limits import Deadline, OutOfTimeError, from_copy

if TYPE_CHECKING:
    from robust.execute.convert import Settings
    from robust.execute.monitor import Monitor
    from robust.execute.planners.interface import Planner
    from robust.execute.situation import NewPlan, OpenProblem
    from robust.json_text import Object
    from robust.options.batch import WatchCommand
    from robust.plan.model import ParametrizedPlan
    from robust.plan.parameters import ParameterSpec
    from robust.plan.pddl.syntax import Domain, Problem

REPLANS = 10
"""Plans that are asked for before something happens again."""
ASK = "replan"
"""The key of the message that asks for another plan, and of its record."""


def asks_for_plan(text: bytes) -> bool:
    """Whether a line of the input is `{"replan": true}`."""
    try:
        return ASK.encode() in text and json.loads(text) == {ASK: True}
    except ValueError:
        return False


class Replanning:
    """Asks a planner from where a run is, in a copy of this process; one question at a time.

    Args:
        options: of the command.
        plan: the first plan, whose deadline holds for all.
    """

    def __init__(self, options: WatchCommand, plan: ParametrizedPlan) -> None:
        from robust.execute.planners import create_planner
        from robust.execute.situation import deadline_of
        from robust.plan.parameters import specifications
        from robust.plan.pddl.reader import read_domain, read_problem

        self.seconds = float(options.planner_limit)
        rate = Fraction(options.rate or 1)
        given = options.planning_time
        self._time = Fraction(self.seconds) / rate if given is None else Fraction(given)
        self._domain: Domain = read_domain(options.domain)
        self._problem: Problem = read_problem(options.problem, self._domain)
        self._planner: Planner | None = None
        if options.planner is not None:
            self._planner = create_planner(options.planner, epsilon=options.separation)
        specs, _ = specifications(options.parameter or ("duration:*",), options.parameters)
        self._deadline = deadline_of(plan)
        self._settings = _settings(options, specs, self._deadline)
        self._epsilon = options.separation
        self._thread: threading.Thread | None = None
        self._open = False
        self._asked: OpenProblem | None = None
        """What is left where a plan was asked for last."""
        self.after = 0
        """The number of the last message before that."""
        self.tries = 0

    @property
    def possible(self) -> bool:
        """Whether there is someone to ask."""
        return self._planner is not None

    @property
    def busy(self) -> bool:
        """Whether a plan has been asked for and there is no answer yet."""
        return self._open

    def over(self) -> None:
        """The answer has come."""
        self._open = False

    def wait(self, seconds: float) -> None:
        """Let the answer come."""
        if self._thread is not None:
            self._thread.join(seconds)

    def note(self, monitor: Monitor) -> OpenProblem:
        """What is left where the run is now."""
        from robust.execute.situation import OpenProblem, run_state

        self.after = monitor.count
        known = (self._domain, self._problem, run_state(monitor), self._time, self._epsilon, self._deadline)
        self._asked = OpenProblem(*known)
        return self._asked

    def ask(self, monitor: Monitor, done: Callable[[NewPlan | str], None]) -> Fraction:
        """Ask, and return when a plan would begin; `done` gets it, or why there is none, in another thread.

        Raises:
            RobustError: if no planner can be asked about where the run is.
        """
        remainder = self.note(monitor)
        begins = remainder.origin
        self.tries += 1
        self._open = True
        self._thread = threading.Thread(target=lambda: done(self._answer(remainder)), daemon=True)
        self._thread.start()
        return begins

    def _answer(self, remainder: OpenProblem) -> NewPlan | str:
        from robust.execute.situation import new_plan

        def plan() -> NewPlan | str:
            try:
                found = new_plan(remainder, self._planner, self.seconds, **self._settings)
            except RobustError as error:
                return " ".join(str(error).split())
            return found if found.texts else ""  # which are written there, not here

        try:
            return from_copy(plan, Deadline.after(self.seconds + 1), "planning")
        except OutOfTimeError:
            return f"no plan that is proved within {self.seconds:g} s"
        except RobustError as error:
            return str(error)

    def resumed(self, line: Object, monitor: Monitor) -> Monitor | None:
        """The monitor after a record about plans; None if it is about something else."""
        from robust.execute.situation import read_again
        from robust.json_text import JsonTypes
        from robust.plan.parameters import parse_parameter_file
        from robust.plan.stn import parse_stn

        if ASK in line.members:
            self.note(monitor)
            return monitor
        if "plan" not in line.members or self._asked is None:
            return None
        types, asked, self._asked = JsonTypes({}), self._asked, None
        network = types.member(str | None, line, "plan")
        if network is None:
            return monitor
        specs = parse_parameter_file(types.member(str, line, "parameters"))
        plan = read_again(*asked.true, parse_stn(network), specs)
        continued = monitor.continued(plan, self.after)
        if continued is None:
            raise InputError("found a plan that does not fit what happened before, expected one that does")
        return continued

    @property
    def is_unanswered(self) -> bool:
        """Whether a journal ends where a plan had been asked for."""
        return self._asked is not None and self._thread is None


def record(found: NewPlan | None) -> Mapping[str, Any]:
    """What a journal says of a plan; None: there is none."""
    return {"plan": None} if found is None else {key: found.texts[key] for key in ("plan", "parameters")}


def _settings(options: WatchCommand, specs: Sequence[ParameterSpec], deadline: Fraction | None) -> Settings:
    """How another plan becomes a network: as the first."""
    from robust.execute.convert import Mode

    return {
        "mode": Mode(options.mode),
        "free_durations": options.free_durations,
        "specs": specs,
        "deadline": deadline,
        "relative": options.relative,
        "epsilon": options.separation,
        "solver": options.solver,
    }
