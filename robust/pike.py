"""Plans with choices in Python: written as programs, read from files, asked, compiled and carried out.

from robust import pike

plan = pike.load("kitchen.tpnu.json")
print(pike.check(plan, all_scenarios=True))
print(pike.run(plan, seed=1))
coffee = ["coffee=duration:make-coffee", "limit=at-most:e1:e44"]
print(pike.region(plan, coffee).possible({"coffee": Fraction(3), "limit": Fraction(7)}))
print(pike.envelope(plan, coffee, for_all=["xA1"]).box)

A plan is what :func:`load` returns, an :class:`Instance` of a generator, or the path of a `.tpnu.json` file. Times are
in the plan's own unit. Ctrl-C and time limits end a question with what is known by then; its result says so.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import TypeAlias

from robust.backends import DRAKE, REASONERS, SMT, deciding
from robust.errors import InputError, did_you_mean
from robust.execute.drive import WallClock, drive, run_in_world
from robust.numbers import Number, exact, shorten
from robust.options.declare import named_values, names, not_negative, ordinal, place_of, seconds, texts
from robust.pike_bridge.action_model import Instance, load_team_plan
from robust.pike_bridge.builder import act, build, choose, parallel, sequence, within
from robust.pike_bridge.compile import (
    Checking,
    Compilation,
    Compiling,
    Measuring,
    PikeCheck,
    PlanVerdict,
    Sizes,
    Temporal,
    checked_assumptions,
)
from robust.pike_bridge.cross_check import CrossCheck, Crossed, Crossing, Disagreement
from robust.pike_bridge.cross_random import SHAPES, RandomCrossed, RandomCrossing
from robust.pike_bridge.envelopes.parameters import ParametricPlan, parametrize, specifications
from robust.pike_bridge.envelopes.search import LabeledRegion, LabeledRegionSearch, TeamEnvelope, TeamEnvelopeSearch
from robust.pike_bridge.files import read_tpnu, write_tpnu
from robust.pike_bridge.k_intents import k_intents
from robust.pike_bridge.knowledge import knowledge_bases
from robust.pike_bridge.knowledge.interface import KnowledgeBase
from robust.pike_bridge.model import EPSILON, Guard, Literal, TeamPlan, Tpnu
from robust.pike_bridge.online.executive import PlanExecutive
from robust.pike_bridge.online.inquiry import why, why_failed, why_not
from robust.pike_bridge.online.journal import Journal, JournalStep, read_journal, resume
from robust.pike_bridge.online.moments import LatestMoments, Moment, Moments
from robust.pike_bridge.online.progress import Completion, Decision, Estimate, Message, Outcome, parse_atom
from robust.pike_bridge.online.reasoners import make_reasoner, reasoner_names
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
from robust.pike_bridge.random_plans import random_plan
from robust.pike_bridge.semantics import Execution, Oracle
from robust.smt.limits import Deadline, OutOfTimeError, noticing_interrupts

__all__ = [
    "EPSILON",
    "Compilation",
    "Completion",
    "CrossCheck",
    "Crossed",
    "Decision",
    "Disagreement",
    "Disturbance",
    "Ending",
    "Estimate",
    "Execution",
    "ExecutionRecord",
    "ExecutionStep",
    "Human",
    "Instance",
    "Journal",
    "JournalStep",
    "KnowledgeBase",
    "LabeledRegion",
    "Message",
    "Moment",
    "Moments",
    "Oracle",
    "OutOfTimeError",
    "Outcome",
    "Pace",
    "ParametricPlan",
    "PikeCheck",
    "PlanExecutive",
    "PlanVerdict",
    "RandomCrossed",
    "Sizes",
    "Story",
    "TeamEnvelope",
    "TeamPlan",
    "Tpnu",
    "WallClock",
    "act",
    "build",
    "check",
    "choose",
    "compile",
    "cross_check",
    "cross_check_random",
    "drive",
    "envelope",
    "k_intents",
    "knowledge_base",
    "knowledge_bases",
    "load",
    "make_reasoner",
    "moments",
    "parallel",
    "parametrize",
    "random_plan",
    "read_journal",
    "read_tpnu",
    "reasoner_names",
    "region",
    "resume",
    "run",
    "run_in_world",
    "sequence",
    "story",
    "why",
    "why_failed",
    "why_not",
    "within",
    "write_tpnu",
]

Plan: TypeAlias = TeamPlan | Instance | str | os.PathLike[str]
"""A plan with choices, one of a builder or generator, or the path of a `.tpnu.json` file."""
Assumed: TypeAlias = Mapping[str, str] | str | Sequence[str]
"""Values of choices that are made already, by name or as texts `NAME=VALUE`."""


def load(path: str | os.PathLike[str], *, epsilon: Number = EPSILON) -> TeamPlan:
    """Read a `.tpnu.json` file, its domain and its problem.

    Args:
        path: the file; those of PDDL are beside it.
        epsilon: how much earlier is "before", for producers, consumers and threats; 0: strictly.

    Raises:
        InputError: with the place, if a file cannot be read, is wrong, or does not fit the others.
        UnsupportedError: if the actions or the goal need more than conjunctions of literals.
    """
    return load_team_plan(path, epsilon=not_negative(epsilon, place_of("epsilon")))


def _plan(plan: Plan) -> TeamPlan:
    if isinstance(plan, Instance):
        return plan.plan()
    if isinstance(plan, str | os.PathLike):
        return load(plan)
    if not isinstance(plan, TeamPlan):
        expected = "a plan of load(), of build() with its PDDL, or a path"
        raise InputError(f"found {shorten(repr(plan))}, expected {expected}", place_of("plan"))
    return plan


def _assumed(plan: TeamPlan, assume: Assumed) -> Guard:
    return checked_assumptions(plan, named_values(assume, "assume"))


def _deadline(timeout: Number | None) -> Deadline:
    return Deadline.after(None if timeout is None else seconds(timeout, place_of("timeout")))


def _one_of(name: str, found: str, known: Sequence[str]) -> str:
    if found not in known:
        raise InputError(f"unknown {name} {found!r}{did_you_mean(str(found), known)}", place_of(name))
    return found


def _temporal(name: str) -> Temporal:
    return Temporal(_one_of("temporal", name, [one.value for one in Temporal]))


# -- questions ---------------------------------------------------------------------------------------------------------


def check(
    plan: Plan,
    *,
    backend: str = "oracle",
    assume: Assumed = (),
    all_scenarios: bool = False,
    temporal: str = "lazy",
    solver: str = "z3",
    timeout: Number | None = None,
) -> PikeCheck:
    """Whether a correct execution of the plan exists, given some of the choices [PIKE].

    Args:
        plan: the plan.
        backend: `oracle`, which asks a solver about the semantics themselves, or one of :func:`knowledge_bases`.
        assume: choices that are made already.
        all_scenarios: find every team scenario that admits a correct execution.
        temporal: how knowledge bases come to temporal conflicts: `lazy`, or `apsp` as in the paper.
        solver: `z3` or `cvc5`.
        timeout: seconds after which what is known is returned.

    Returns:
        PROVED with an execution, which a referee has confirmed, REFUTED or UNKNOWN.

    Raises:
        InputError: if a choice, a value, a back end or a file is unknown or wrong.
        SolverError: if the solver is not installed, or an answer is not confirmed.
    """
    known = _plan(plan)
    checking = Checking(
        known,
        backend=_one_of("backend", backend, ("oracle", *knowledge_bases())),
        assume=_assumed(known, assume),
        all_scenarios=all_scenarios,
        temporal=_temporal(temporal),
        solver=solver,
        deadline=_deadline(timeout),
    )
    with noticing_interrupts():
        return checking.run()


def compile(
    plan: Plan,
    backend: str = "pitms",
    *,
    temporal: str = "lazy",
    shortcut: bool = True,
    implicants: bool = False,
    models: bool = True,
    solver: str = "z3",
    timeout: Number | None = None,
) -> Sizes:
    """Compile a knowledge base of all correct executions, and measure it; :func:`knowledge_base` returns it.

    Args:
        plan: the plan.
        backend: one of :func:`knowledge_bases`.
        temporal: `lazy`, or `apsp` as in the paper.
        shortcut: whether a solver may find that there is no correct execution at all.
        implicants: list the prime implicants (`pitms` and `bdd`).
        models: count models.
        solver: `z3` or `cvc5`.
        timeout: seconds after which what is known is returned.

    Raises:
        InputError: if a back end or a file is unknown or wrong.
        UnsupportedError: more prime implicants are to be listed than anybody can read.
    """
    measuring = Measuring(
        _plan(plan),
        _one_of("backend", backend, tuple(knowledge_bases())),
        temporal=_temporal(temporal),
        shortcut=shortcut,
        implicants=implicants,
        models=models,
        solver=solver,
        deadline=_deadline(timeout),
    )
    with noticing_interrupts():
        return measuring.run()


def knowledge_base(
    plan: Plan,
    backend: str = "pitms",
    *,
    temporal: str = "lazy",
    shortcut: bool = True,
    solver: str = "z3",
    timeout: Number | None = None,
) -> Compilation:
    """The knowledge base of all correct executions, with what it was compiled from: labeled links and conflicts.

    Its `knowledge` answers whether one could still commit to choices, orders and times, and commits to them.

    Raises:
        InputError: if a back end or a file is unknown or wrong.
        OutOfTimeError: if the time is over before it is there.
    """
    compiling = Compiling(
        _plan(plan),
        _one_of("backend", backend, tuple(knowledge_bases())),
        temporal=_temporal(temporal),
        shortcut=shortcut,
        solver=solver,
        deadline=_deadline(timeout),
    )
    with noticing_interrupts():
        return compiling.compile()


def moments(plan: Plan, *, assume: Assumed = (), solver: str = "z3", timeout: Number | None = None) -> Moments:
    """Until when people can make each choice, with each value, if all else suits it.

    Raises:
        InputError: if a choice, a value or a file is unknown or wrong.
        SolverError: if the solver is unknown or not installed.
    """
    known = _plan(plan)
    with noticing_interrupts():
        return LatestMoments(known, _assumed(known, assume), solver, deadline=_deadline(timeout)).run()


# -- executions --------------------------------------------------------------------------------------------------------

_NEGATION = re.compile(r"\(\s*not\s*(\(.*\))\s*\)", re.IGNORECASE)


def run(
    plan: Plan,
    *,
    human: str = "rational",
    pace: str = "cooperative",
    outcome: Mapping[str, str | tuple[str, Number]] | str | Sequence[str] = (),
    disturb: str | Sequence[str | Disturbance] = (),
    delay: Number = 0,
    seed: int = 0,
    reasoner: str | None = None,
    backend: str | None = None,
    patience: Number | None = 0,
    infer: bool = True,
    explain: bool = False,
    solver: str = "z3",
    timeout: Number | None = None,
    on_step: Callable[[ExecutionStep], None] | None = None,
) -> ExecutionRecord:
    """Carry a plan out with a simulated team: dispatch, recognise intent, adapt, notice what goes wrong.

    Args:
        plan: the plan.
        human: how uncontrollable choices are made: `rational`, among what remains correct, or `careless`.
        pace: how long activities take: `cooperative`, `least` or `random`.
        outcome: what is chosen and when it is known: a value, or a value and a time, by choice; or texts
            `NAME=VALUE[@TIME]`.
        disturb: what goes wrong: texts `(not (atom))@TIME`, or :class:`Disturbance`.
        delay: humans hesitate this long at most.
        seed: decides what is left open.
        reasoner: who decides: `smt`, `windows` (labeled execution windows and a knowledge base, as in the paper) or
            `drake` (the same without what activities need and do).
        backend: the knowledge base of the latter two; `pitms` if not given.
        patience: how long before the last moment to stop waiting for what people may still choose; None: do not wait.
        infer: find out which values open choices may still have.
        explain: find out the reasons of each step.
        solver: `z3` or `cvc5`.
        timeout: seconds after which what has happened is returned.
        on_step: called after each step.

    Raises:
        InputError: if a choice, a value, an atom, a time, a back end or a file is unknown or wrong.
        OutOfTimeError: if the time is over before the first step.
        SolverError: if an execution that ended well is not correct.
    """
    known = _plan(plan)
    if reasoner is not None:
        _one_of("reasoner", reasoner, REASONERS)
    name = _one_of("backend", deciding(reasoner, backend), reasoner_names())
    if reasoner is not None and (reasoner == SMT) != (name == SMT):
        raise InputError(f"found {name} with reasoner {reasoner!r}, expected one that fits", place_of("backend"))
    rehearsal = Rehearsal(
        known,
        story(known, human=human, pace=pace, outcome=outcome, disturb=disturb, delay=delay),
        seed=seed,
        infer=infer,
        explain=explain,
        solver=solver,
        backend=name,
        drake=reasoner == DRAKE,
        patience=None if patience is None else not_negative(patience, place_of("patience")),
        deadline=_deadline(timeout),
        on_step=on_step,
    )
    with noticing_interrupts():
        return rehearsal.run()


def story(
    plan: TeamPlan,
    *,
    human: str = "rational",
    pace: str = "cooperative",
    outcome: Mapping[str, str | tuple[str, Number]] | str | Sequence[str] = (),
    disturb: str | Sequence[str | Disturbance] = (),
    delay: Number = 0,
) -> Story:
    """What is known beforehand of a simulated execution; the arguments are those of :func:`run`.

    Raises:
        InputError: if a choice, a value, an atom or a time is not what it should be.
    """
    if isinstance(outcome, Mapping):
        outcomes = dict(_outcome(plan, name, value) for name, value in outcome.items())
    else:
        outcomes = dict(_told_outcome(plan, text) for text in texts(outcome, place_of("outcome")))
    wrong = [disturb] if isinstance(disturb, str | Disturbance) else disturb
    return Story(
        human=Human(_one_of("human", human, [one.value for one in Human])),
        pace=Pace(_one_of("pace", pace, [one.value for one in Pace])),
        outcomes=outcomes,
        disturbances=tuple(one if isinstance(one, Disturbance) else _disturbance(plan, one) for one in wrong),
        delay=not_negative(delay, place_of("delay")),
    )


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
    checked_assumptions(plan, {name: chosen})
    if next(each.controllable for each in plan.network.choices if each.name == name):
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


# -- cross-checks ------------------------------------------------------------------------------------------------------


def cross_check(
    plan: Plan,
    *,
    witness: str | os.PathLike[str] | None = None,
    seed: int = 0,
    solver: str = "z3",
    timeout: Number | None = None,
) -> Crossed:
    """Ask all knowledge bases and the oracle the same questions about a plan, and compare.

    Args:
        plan: the plan.
        witness: the directory to write a small plan to on which they differ, if they do.
        seed: which sets of choices are tried.
        solver: `z3` or `cvc5`.
        timeout: seconds after which what is known is returned.

    Raises:
        InputError: if a file is wrong.
    """
    crossing = Crossing(_plan(plan), None if witness is None else Path(witness), seed, solver, _deadline(timeout))
    with noticing_interrupts():
        return crossing.run()


def cross_check_random(
    number: int,
    *,
    sizes: str = "small",
    seed: int = 0,
    witness: str | os.PathLike[str] | None = None,
    epsilon: Number = EPSILON,
    solver: str = "z3",
    timeout: Number | None = None,
) -> RandomCrossed:
    """The same on so many random plans.

    Args:
        number: how many plans.
        sizes: how large they are: `small`, `medium` or `paper`.
        seed: which plans they are.
        witness: the directory to write a small plan to on which the first back end that differs still does.
        epsilon: how much earlier is "before".
        solver: `z3` or `cvc5`.
        timeout: seconds after which what is known is returned.

    Raises:
        InputError: if an argument is wrong.
    """
    crossing = RandomCrossing(
        ordinal(number, place_of("number")),
        seed,
        _one_of("sizes", sizes, tuple(SHAPES)),
        witness=None if witness is None else Path(witness),
        epsilon=not_negative(epsilon, place_of("epsilon")),
        solver=solver,
        deadline=_deadline(timeout),
    )
    with noticing_interrupts():
        return crossing.run()


# -- envelopes ---------------------------------------------------------------------------------------------------------


def region(
    plan: Plan | ParametricPlan,
    parameters: str | Sequence[str] = (),
    *,
    parameter_file: str | os.PathLike[str] | None = None,
    choices: str | Sequence[str] | None = None,
    assume: Assumed = (),
    solver: str = "z3",
    timeout: Number | None = None,
) -> LabeledRegion:
    """For which parameter values which choices lead to a correct execution.

    Args:
        plan: the plan; one that has parameters already is taken as it is.
        parameters: what is a parameter, as :mod:`robust.pike_bridge.envelopes.parameters` describes it.
        parameter_file: more of them, in a TOML file.
        choices: those that are told apart; those of people and nature, if not given.
        assume: values of choices that are made already.
        solver: `z3` or `cvc5`.
        timeout: seconds after which what is known is returned.

    Raises:
        InputError: if a parameter, a choice or a value is unknown or wrong.
        SolverError: if the solver is unknown, not installed, or fails.
    """
    varied = _parametric(plan, parameters, parameter_file)
    search = LabeledRegionSearch(
        varied,
        None if choices is None else names(choices, place_of("choices")),
        assume=_assumed(varied.plan, assume),
        solver=solver,
        deadline=_deadline(timeout),
    )
    with noticing_interrupts():
        return search.run()


def envelope(
    plan: Plan | ParametricPlan,
    parameters: str | Sequence[str] = (),
    *,
    parameter_file: str | os.PathLike[str] | None = None,
    assume: Assumed = (),
    for_all: str | Sequence[str] = (),
    patience: bool = False,
    solver: str = "z3",
    timeout: Number | None = None,
) -> TeamEnvelope:
    """A box of parameter values around the nominal ones that no other such box contains.

    Args:
        plan, parameters, parameter_file, assume, solver, timeout: as of :func:`region`.
        for_all: choices of which every combination of values must lead to a correct execution.
        patience: with `for_all`: what is chosen becomes known only then, and the team waits for it.

    Raises:
        InputError: if a parameter, a choice or a value is unknown or wrong.
        SolverError: if the solver is unknown, not installed, or fails.
    """
    varied = _parametric(plan, parameters, parameter_file)
    search = TeamEnvelopeSearch(
        varied,
        assume=_assumed(varied.plan, assume),
        for_all=names(for_all, place_of("for_all")) if for_all else (),
        waiting=patience,
        solver=solver,
        deadline=_deadline(timeout),
    )
    with noticing_interrupts():
        return search.run()


def _parametric(
    plan: Plan | ParametricPlan, parameters: str | Sequence[str], file: str | os.PathLike[str] | None
) -> ParametricPlan:
    if isinstance(plan, ParametricPlan):
        return plan
    own = read_tpnu(plan).parameters if isinstance(plan, str | os.PathLike) else ()
    specs = specifications(texts(parameters, place_of("parameters")), file, own)
    return parametrize(_plan(plan), specs)
