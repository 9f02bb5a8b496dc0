"""Plans with choices in Python: written as programs, read from files, asked, compiled and carried out::

    from robust import pike

    plan = pike.load("kitchen.tpnu.json")
    print(pike.check(plan, all_scenarios=True))
    print(pike.run(plan, seed=1))
    coffee = ["coffee=duration:make-coffee", "limit=at-most:e1:e44"]
    print(pike.region(plan, coffee).possible({"coffee": 3, "limit": 7}))
    print(pike.envelope(plan, coffee, for_all=["xA1"]).box)

A plan is what :func:`load` returns, an :class:`Instance` of a generator, or the path of a `.tpnu.json` file. Times are
in the plan's own unit. Ctrl-C and time limits end a question with what is known by then; its result says so. Where
nothing is, Ctrl-C raises KeyboardInterrupt.
"""

import inspect
import os
import re
from collections.abc import Callable, Mapping
from fractions import Fraction
from pathlib import Path
from typing import TypeAlias, TypeVar, cast

from robust.backends import DRAKE, KIRK
from robust.errors import InputError, UnsupportedError, did_you_mean
from robust.execute.drive import WallClock, drive, run_in_world
from robust.numbers import Number, exact, shorten
from robust.options import pike as asking
from robust.options.declare import Options, Verb, named_values, not_negative, place_of, setting, spelled, texts
from robust.options.shared import Solving
from robust.pike_bridge import compile as compiling
from robust.pike_bridge.action_model import Instance
from robust.pike_bridge.builder import act, build, choose, k_intents, parallel, sequence, within
from robust.pike_bridge.compile import Checking, Compilation, Measuring, PikeCheck, PlanVerdict, Sizes, Temporal
from robust.pike_bridge.conditional import read_any
from robust.pike_bridge.cross_check import CrossCheck, Crossed, Crossing, Disagreement
from robust.pike_bridge.envelopes.parameters import ParametricPlan, parametrize, specifications
from robust.pike_bridge.envelopes.search import LabeledRegion, LabeledRegionSearch, TeamEnvelope, TeamEnvelopeSearch
from robust.pike_bridge.files import read_tpnu, write_tpnu
from robust.pike_bridge.game.controllability import TeamControllability
from robust.pike_bridge.game.deciding import ControllabilityVerdict
from robust.pike_bridge.game.following import StrategyRehearsal
from robust.pike_bridge.game.moving import FindingLimits
from robust.pike_bridge.game.rules import GameRules
from robust.pike_bridge.knowledge import knowledge_bases
from robust.pike_bridge.likelihood import ChanceBounds, ChanceSearch, IntentChance, TeamChance, learnt
from robust.pike_bridge.model import EPSILON, Guard, Literal, TeamPlan, Tpnu, check_choice
from robust.pike_bridge.online.executive import LatestMoments, Moment, Moments, PlanExecutive
from robust.pike_bridge.online.field import FieldExecutive, FieldState
from robust.pike_bridge.online.inquiry import why, why_failed, why_none, why_not
from robust.pike_bridge.online.kirk_world import KirkRehearsal
from robust.pike_bridge.online.progress import (
    ActivityAborted,
    ActivityCancelled,
    ActivityFailed,
    Began,
    Chosen,
    Completion,
    Decision,
    Estimate,
    Message,
    Outcome,
    Retract,
    parse_atom,
)
from robust.pike_bridge.online.reasoners import make_reasoner, reasoner_names
from robust.pike_bridge.online.service import Journal, JournalStep, read_journal, resume
from robust.pike_bridge.online.world import (
    Disturbance,
    Ending,
    ExecutionRecord,
    ExecutionStep,
    Human,
    Pace,
    Rehearsal,
    Story,
)
from robust.pike_bridge.semantics import Execution, Oracle
from robust.pike_bridge.theory import KnowledgeBase
from robust.smt.limits import Deadline, OutOfTimeError

__all__ = [
    "EPSILON", "ActivityAborted", "ActivityCancelled", "ActivityFailed", "Began", "ChanceBounds", "Compilation",
    "Completion", "ControllabilityVerdict", "CrossCheck", "Crossed", "Decision", "Disagreement", "Disturbance",
    "Ending", "Estimate", "Execution", "ExecutionRecord", "ExecutionStep", "FieldExecutive", "FieldState", "Human",
    "Instance", "IntentChance", "Journal", "JournalStep", "KnowledgeBase", "LabeledRegion", "Message", "Moment",
    "Moments", "Oracle", "OutOfTimeError", "Outcome", "Pace", "ParametricPlan", "PikeCheck", "PlanExecutive",
    "PlanVerdict", "Retract", "Sizes", "Story", "TeamChance", "TeamControllability", "TeamEnvelope", "TeamPlan",
    "Tpnu", "WallClock", "act", "build", "chance", "check", "choose", "compile", "controllable", "cross_check",
    "drive", "envelope", "k_intents", "knowledge_base", "knowledge_bases", "learnt", "load", "make_reasoner",
    "moments", "parallel", "parametrize", "read_journal", "read_tpnu", "reasoner_names", "region", "resume", "run",
    "run_in_world", "sequence", "story", "why", "why_failed", "why_not", "within", "write_tpnu",
]  # fmt: skip


def __dir__() -> list[str]:
    """What users call, for completion."""
    return __all__


Plan: TypeAlias = TeamPlan | Instance | str | os.PathLike[str]
"""A plan with choices, one of a builder or generator, or the path of a `.tpnu.json` file."""


def load(path: str | os.PathLike[str], *, epsilon: Number = EPSILON) -> TeamPlan:
    """Read a `.tpnu.json` file, its domain and its problem; or a conditional network (CSTN, CSTNU, CCTP).

    Args:
        path: the file; those of PDDL are beside it. Conditional networks are GraphML of the CSTNU tool or `.cctp`.
        epsilon: how much earlier is "before", for producers, consumers and threats; 0: strictly.

    Returns:
        The network, with the actions, the initial state and the goal that it is about, in the file's unit of time.

    Raises:
        InputError: with the place, if a file cannot be read, is wrong, or does not fit the others.
        UnsupportedError: if the actions or the goal need more than conjunctions of literals.
    """
    return read_any(path, epsilon=not_negative(epsilon, place_of("epsilon")))


def _team_plan(plan: Plan, options: Options) -> TeamPlan:
    if isinstance(plan, Instance):
        return plan.plan()
    if isinstance(plan, str | os.PathLike):
        return load(plan, epsilon=getattr(options, "separation", EPSILON))
    if not isinstance(plan, TeamPlan):
        expected = "a plan of load(), of build() with its PDDL, or a path"
        raise InputError(f"found {shorten(repr(plan))}, expected {expected}", place_of("plan"))
    return plan


_verb = Verb(_team_plan, "what :func:`load` returns, an :class:`Instance`, or the path of a `.tpnu.json` file")


def assumed(plan: TeamPlan, given: asking.Assumptions) -> Guard:
    """Values of choices that are made already, each at most once.

    Raises:
        InputError: for an unknown choice or value, and for two different values of one choice.
    """
    return compiling.checked_assumptions(plan, named_values(given, "assume"), place_of("assume"))


Searching = TypeVar("Searching")


def _searching(
    search: Callable[..., Searching], plan: TeamPlan | ParametricPlan, options: Solving, **given: object
) -> Searching:
    """A search with those of the options that it takes by their names, unless they are given otherwise.

    Raises:
        InputError: if an option is wrong for the plan.
    """
    for name in inspect.signature(search).parameters.keys() & options.declarations.keys() - given.keys():
        value = getattr(options, name)
        if name == "assume":
            value = assumed(plan.plan if isinstance(plan, ParametricPlan) else plan, value)
        if value is not None:
            given[name] = value
    try:
        return search(plan, deadline=Deadline.after(options.limit), **given)
    except InputError as error:
        if error.location is None or error.location.file not in options.declarations:
            raise
        raise InputError(error.message, place_of(error.location.file)) from None


# -- questions ---------------------------------------------------------------------------------------------------------


def searching_check(plan: TeamPlan, options: asking.PikeCheckOptions) -> Checking:
    """The search behind :func:`check`."""

    def explain(assumed: Guard, deadline: Deadline) -> tuple[str, ...]:
        found = why_none(plan, assumed, solver=options.solver, deadline=deadline)
        return () if found.conflict is None else found.lines

    return _searching(Checking, plan, options, temporal=Temporal(options.temporal), explain=explain)


@_verb(asking.PikeCheckOptions)
def check(plan: TeamPlan, options: asking.PikeCheckOptions) -> PikeCheck:
    """Decide whether a correct execution of the plan exists, given some of the choices [PIKE].

    Returns:
        PROVED with an execution, which a referee has confirmed; REFUTED, with what contradicts itself; or UNKNOWN.

    Raises:
        InputError: if a choice, a value, a back end or a file is unknown or wrong.
        SolverError: if the solver is not installed, or an answer is not confirmed.
    """
    return searching_check(plan, options).run()


def searching_sizes(plan: TeamPlan, options: asking.PikeCompileOptions) -> Measuring:
    """The computation behind :func:`compile`.

    Raises:
        UnsupportedError: if prime implicants or labels are wanted of a back end that has none.
    """
    for wanted, option, having, what in (
        (options.implicants, "implicants", "knows_implicants", "prime implicants"),
        ("labels" in options.show, "show", "labels", "labels"),
    ):
        able = [name for name, registration in knowledge_bases().items() if getattr(registration, having)]
        if wanted and options.backend not in able:
            expected = setting("backend", *able)
            raise UnsupportedError(f"{spelled(option)}: back end {options.backend} has no {what}; expected {expected}")
    return _searching(Measuring, plan, options, temporal=Temporal(options.temporal))


@_verb.with_first(asking.PikeCompileOptions, "backend")
def compile(plan: TeamPlan, options: asking.PikeCompileOptions) -> Sizes:
    """Compile a knowledge base of all correct executions, and measure it; :func:`knowledge_base` returns it.

    Labeled links and conflicts are those of [PIKE, Algorithms 4 and 5], labels those of Algorithms 6 and 7.

    Returns:
        How many links, conflicts, implicants and models there are, and the seconds of each stage.

    Raises:
        InputError: if a back end or a file is unknown or wrong.
        UnsupportedError: more prime implicants are to be listed than anybody can read, or of a back end without any.
    """
    return searching_sizes(plan, options).run()


@_verb.with_first(asking.KnowledgeBaseOptions, "backend")
def knowledge_base(plan: TeamPlan, options: asking.KnowledgeBaseOptions) -> Compilation:
    """The knowledge base of all correct executions, with what it was compiled from: labeled links and conflicts.

    It is what [PIKE, Algorithms 4 and 5] make of a plan.

    Its `knowledge` answers whether one could still commit to choices, orders and times, and commits to them.

    Returns:
        The plan, its labeled causal links and conflicts, and the knowledge base.

    Raises:
        InputError: if a back end or a file is unknown or wrong.
        OutOfTimeError: if the time is over before it is there.
    """
    return _searching(compiling.Compiling, plan, options, temporal=Temporal(options.temporal)).compile()


def searching_chance(plan: TeamPlan, options: asking.ChanceOptions) -> ChanceSearch:
    """The search behind :func:`chance`."""
    journals = [options.learn] if isinstance(options.learn, str | os.PathLike) else options.learn
    if journals:
        steps = [read_journal(journal, plan) for journal in journals]
        chosen = (
            [each for step in journal for each in step.decisions if isinstance(each, Chosen)] for journal in steps
        )
        plan = learnt(plan, [{each.choice: each.value for each in choices} for choices in chosen])
    return _searching(ChanceSearch, plan, options, temporal=Temporal(options.temporal))


@_verb(asking.ChanceOptions)
def chance(plan: TeamPlan, options: asking.ChanceOptions) -> TeamChance:
    """How likely it is that people's choices leave a correct execution, by the probabilities in the plan.

    People choose by the tables of the plan, independently of each other as far as these say nothing else; the team
    chooses what makes success most likely by what was decided before.

    Returns:
        Bounds of the probability, and the probability of each value that people may choose, as fractions.

    Raises:
        InputError: if a choice, a value, a probability or a file is unknown or wrong.
        SolverError: if the solver is not installed, or an answer is not confirmed.
    """
    return searching_chance(plan, options).run()


def searching_moments(plan: TeamPlan, options: asking.MomentsOptions) -> LatestMoments:
    """The search behind :func:`moments`."""
    return _searching(LatestMoments, plan, options)


@_verb(asking.MomentsOptions)
def moments(plan: TeamPlan, options: asking.MomentsOptions) -> Moments:
    """The latest moment at which people can make each choice, with each value, if everything else is in its favour.

    Returns:
        For each choice and value the latest time, in the plan's unit of time, and what comes too late after it.

    Raises:
        InputError: if a choice, a value or a file is unknown or wrong.
        SolverError: if the solver is unknown or not installed.
    """
    return searching_moments(plan, options).run()


def searching_differences(plan: TeamPlan, options: asking.CrossOptions) -> Crossing:
    """The comparison behind :func:`cross_check`."""
    return _searching(Crossing, plan, options, witness=None if options.witness is None else Path(options.witness))


@_verb(asking.CrossOptions)
def cross_check(plan: TeamPlan, options: asking.CrossOptions) -> Crossed:
    """Ask all knowledge bases and the oracle the same questions about a plan, and compare.

    Returns:
        What each of them answered, and every disagreement.

    Raises:
        InputError: if a file is wrong.
    """
    return searching_differences(plan, options).run()


# -- executions --------------------------------------------------------------------------------------------------------


def searching_execution(plan: TeamPlan, options: asking.PikeRunOptions) -> Rehearsal:
    """The simulated execution behind :func:`run`."""
    if options.reasoner == KIRK:
        recovery = Fraction(options.recovery)
        return _searching(
            KirkRehearsal, plan, options, story=_story(plan, options), backend=options.deciding, recovery=recovery
        )
    deciding = {
        "backend": options.deciding,
        "drake": options.reasoner == DRAKE,
        "patience": options.margin,
        "flexible": options.rank == "flexible",
        "budget": options.thinking,
    }
    rehearsal = StrategyRehearsal if options.strategy else Rehearsal
    return _searching(rehearsal, plan, options, story=_story(plan, options), **deciding)


@_verb(asking.PikeRunOptions)
def run(plan: TeamPlan, options: asking.PikeRunOptions) -> ExecutionRecord:
    """Carry a plan out with a simulated team: dispatch, recognise intent, adapt, notice what goes wrong.

    In Python an outcome may also be a value, or a value and a time, by choice, and a disturbance a
    :class:`Disturbance`; `patience=None` does not wait.

    Returns:
        How it ended, and its steps with what was reported and decided; times are in the plan's unit.

    Raises:
        InputError: if a choice, a value, an atom, a time, a back end or a file is unknown or wrong.
        OutOfTimeError: if the time is over before the first step.
        SolverError: if an execution that ended well is not correct.
    """
    return searching_execution(plan, options).run()


@_verb(asking.StoryOptions)
def story(plan: TeamPlan, options: asking.StoryOptions) -> Story:
    """Facts known in advance of a simulated execution; the arguments are those of :func:`run`.

    Returns:
        What :func:`run` takes as the facts of the execution.

    Raises:
        InputError: if a choice, a value, an atom or a time is not what it should be.
    """
    return _story(plan, options)


def _story(plan: TeamPlan, options: asking.StoryOptions) -> Story:
    outcome, disturb = options.outcome, options.disturb
    if isinstance(outcome, Mapping):
        outcomes = dict(_outcome(plan, name, value) for name, value in outcome.items())
    else:
        outcomes = {}
        for text in texts(outcome, place_of("outcome")):
            name, told = _told_outcome(plan, text)
            if outcomes.setdefault(name, told) != told:
                raise InputError(f"found a second outcome of {name}, expected one", place_of("outcome", text))
    wrong = [disturb] if isinstance(disturb, str | Disturbance) else disturb
    return Story(
        human=Human(options.human),
        pace=Pace(options.pace),
        outcomes=outcomes,
        disturbances=tuple(item if isinstance(item, Disturbance) else _disturbance(plan, item) for item in wrong),
        delay=Fraction(options.delay),
    )


_NEGATION = re.compile(r"\(\s*not\s*(\(.*\))\s*\)", re.IGNORECASE)


def _told_outcome(plan: TeamPlan, text: str) -> tuple[str, tuple[str, Fraction | None]]:
    """`NAME=VALUE`, or `NAME=VALUE@TIME`."""
    assignment, at, time = text.partition("@")
    name, equals, value = (part.strip() for part in assignment.partition("="))
    if not (equals and name and value):
        expected = "NAME=VALUE or NAME=VALUE@TIME"
        raise InputError(f"found {shorten(text)}, expected {expected}", place_of("outcome", text))
    return _outcome(plan, name, (value, time.strip()) if at else value, text)


def _outcome(
    plan: TeamPlan, name: str, value: object, text: str | None = None
) -> tuple[str, tuple[str, Fraction | None]]:
    place = place_of("outcome", text or name)
    chosen, time = value if isinstance(value, tuple) and len(value) == 2 else (value, None)
    if not isinstance(chosen, str):
        raise InputError(f"found {shorten(repr(value))}, expected a value, or a value and a time", place)
    check_choice(plan.network.domains, name, chosen, place)
    if next(choice.controllable for choice in plan.network.choices if choice.name == name):
        raise InputError(f"{name} is for the executive to choose; expected an uncontrollable choice", place)
    return name, (chosen, None if time is None else _time(time, text or name, "outcome"))


def _disturbance(plan: TeamPlan, text: str) -> Disturbance:
    """`(atom)@TIME` or `(not (atom))@TIME`."""
    place = place_of("disturb", str(text))
    literal, _, time = (part.strip() for part in str(text).rpartition("@"))
    negated = _NEGATION.fullmatch(literal)
    try:
        atom = parse_atom(negated.group(1) if negated else literal)
    except InputError:
        time = ""
    if not time:
        raise InputError(f"found {shorten(str(text))}, expected '(atom)@TIME' or '(not (atom))@TIME'", place)
    known = {str(effect.literal.atom) for effect in plan.effects}
    if str(atom) not in known:
        raise InputError(f"nothing in the plan is about {atom}{did_you_mean(str(atom), known)}", place)
    return Disturbance(_time(time, text, "disturb"), Literal(atom, negated is None))


def _time(value: Number, text: str, option: str) -> Fraction:
    time = exact(value, place_of(option, text))
    if time < 0:
        raise InputError(f"found time {shorten(str(value))}, expected 0 or later", place_of(option, text))
    return time


# -- envelopes ---------------------------------------------------------------------------------------------------------


def parametric(plan: Plan | ParametricPlan, options: Options) -> ParametricPlan:
    """A plan with its parameters: those in its own file, in the TOML file, and of options.

    Raises:
        InputError: if one is wrong.
    """
    if isinstance(plan, ParametricPlan) or not isinstance(options, asking.ParametricOptions):
        return cast("ParametricPlan", plan)
    own = isinstance(plan, str | os.PathLike) and not isinstance(options, asking.ControllableOptions)
    parameters = read_tpnu(cast("str", plan)).parameters if own else ()
    specs = specifications(texts(options.parameters, place_of("parameters")), options.parameter_file, parameters)
    return parametrize(_team_plan(plan, options), specs)


_parametric_verb = Verb(parametric, "as of :func:`check`; one that has parameters already is taken as it is")


def searching_region(plan: ParametricPlan, options: asking.PikeRegionOptions) -> LabeledRegionSearch:
    """The search behind :func:`region`."""
    return _searching(LabeledRegionSearch, plan, options, key=options.choices)


@_parametric_verb.with_first(asking.PikeRegionOptions, "parameters")
def region(plan: ParametricPlan, options: asking.PikeRegionOptions) -> LabeledRegion:
    """For which parameter values which choices lead to a correct execution.

    Returns:
        Polyhedra over the parameters, in the plan's unit of time, each with the choices that it belongs to.

    Raises:
        InputError: if a parameter, a choice or a value is unknown or wrong.
        SolverError: if the solver is unknown, not installed, or fails.
    """
    return searching_region(plan, options).run()


def searching_envelope(plan: ParametricPlan, options: asking.PikeEnvelopeOptions) -> TeamEnvelopeSearch:
    """The search behind :func:`envelope`."""
    return _searching(TeamEnvelopeSearch, plan, options, waiting=options.patience)


@_parametric_verb.with_first(asking.PikeEnvelopeOptions, "parameters")
def envelope(plan: ParametricPlan, options: asking.PikeEnvelopeOptions) -> TeamEnvelope:
    """A box of parameter values around the nominal ones that no other such box contains.

    The exact widening of :func:`robust.envelope`, over the polyhedra of :func:`region`.

    Returns:
        The box, with exact ends in the plan's unit of time, what ends each side, and how the search ended.

    Raises:
        InputError: if a parameter, a choice or a value is unknown or wrong.
        SolverError: if the solver is unknown, not installed, or fails.
    """
    return searching_envelope(plan, options).run()


# -- strategies --------------------------------------------------------------------------------------------------------


def rules(options: asking.GameOptions) -> GameRules:
    """Who decides what."""
    hesitate = None if options.hesitate is None else Fraction(options.hesitate)
    return GameRules(tuple(options.free), options.rational, hesitate)


def searching_controllability(plan: ParametricPlan, options: asking.ControllableOptions) -> FindingLimits:
    """The search behind :func:`controllable`."""
    return _searching(FindingLimits, plan, options, rules=rules(options))


@_parametric_verb.with_first(asking.ControllableOptions, "parameters")
def controllable(plan: ParametricPlan, options: asking.ControllableOptions) -> TeamControllability:
    """Decide whether some strategy succeeds whatever people choose and however long activities take.

    Choices and lengths are seen only as they happen; :mod:`robust.pike_bridge.game.rules` has the definition.
    Parameters are single bounds (at-least or at-most): also find how far each can move, the others as they are; or,
    with `repair`, the least change of all together after which the plan is controllable.

    Returns:
        PROVED with a strategy, REFUTED with schedules that no strategy serves, or UNKNOWN.

    Raises:
        InputError: if a parameter, a choice, a value or an agent is unknown or wrong.
        SolverError: if the solver is unknown, not installed, or fails.
    """
    return searching_controllability(plan, options).run()
