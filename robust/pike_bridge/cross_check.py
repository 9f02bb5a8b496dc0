"""All back ends asked the same questions as the semantic oracle, and the smallest plan about which one still disagrees.

A plan that shows a disagreement is shrunk greedily, and written as files that reproduce it.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import count, starmap
from pathlib import Path
from random import Random
from typing import TypeVar

from robust import errors, presented, records
from robust.pike_bridge import action_model, files, semantics
from robust.pike_bridge.compile import Compilation, Compiling, Temporal, scenarios
from robust.pike_bridge.knowledge import bdd, labels, propagation, reasons_about_time, tms
from robust.pike_bridge.model import GOAL, INITIAL, Activity, Assignment, Guard, Literal, TeamPlan
from robust.pike_bridge.theory import Commitment, Exclude, KnowledgeBase, Require, Theory
from robust.plan.model import Atom
from robust.plan.pddl.write import ActionText, sketched_domain, sketched_problem
from robust.searching import Announce, Searching, Status, Stoppable, unheard
from robust.smt.limits import NEVER, Deadline, OutOfTimeError

T = TypeVar("T")
BACKENDS = ("bdd", "pitms", "pitms-labels", "atms", "sat")
SUBJECT_LIMIT = 60.0
"""Seconds for each back end, unless the whole has fewer."""
SHRINK_LIMIT = 120.0


SAMPLES = 20
"""Sets of commitments that are tried."""
LISTED = 2_000
"""Models and implicants that are compared one by one; of more, only the numbers are."""
LABELS = 60
"""Nodes of the πTMS whose labels are examined, drawn at random."""
STEPS = 6
"""Commitments that are made one after the other."""


@dataclass(frozen=True, slots=True)
class Disagreement:
    """One question that a back end answered differently from the oracle."""

    backend: str
    question: str
    expected: str
    found: str

    def __str__(self) -> str:
        return f"{self.backend}: {self.question}: expected {self.expected}, found {self.found}"


@dataclass
class CrossCheck(presented.NoTruthValue, ask="agree"):
    """The outcome: how many questions each back end was asked, and where it disagreed."""

    scenarios: int = 0
    """How many team scenarios admit a correct execution, by the oracle."""
    questions: dict[str, int] = field(default_factory=dict)
    out_of_time: list[str] = field(default_factory=list)
    """Back ends that did not answer everything in time."""
    disagreements: list[Disagreement] = field(default_factory=list)

    @property
    def agree(self) -> bool:
        """Whether there is no disagreement."""
        return not self.disagreements

    @property
    def smallest(self) -> Disagreement | None:
        """The one that takes least to tell; most others follow from it."""
        return min(self.disagreements, key=lambda disagreement: len(str(disagreement)), default=None)


@dataclass(frozen=True, slots=True)
class ExaminedBackend:
    """A back end to be examined, with the way in which time is reasoned about."""

    backend: str
    temporal: Temporal

    @property
    def name(self) -> str:
        return f"{self.backend} ({self.temporal.value})"


def subjects(backends: Sequence[str]) -> Iterator[ExaminedBackend]:
    """Each back end with each way of temporal reasoning."""
    return (ExaminedBackend(backend, temporal) for temporal in Temporal for backend in backends)


def cross_check(
    plan: TeamPlan,
    subjects: Sequence[ExaminedBackend],
    *,
    solver: str = "z3",
    seed: int = 0,
    samples: int = SAMPLES,
    deadline: Deadline = NEVER,
    limit: float | None = None,
    on_subject: Announce = unheard,
) -> CrossCheck:
    """Ask the oracle and each subject the same questions.

    Args:
        limit: seconds for each subject, which is then left out of what remains.

    Raises:
        OutOfTimeError: if the deadline passes before the oracle has found every scenario.
    """
    outcome = CrossCheck()
    on_subject("oracle")
    truth = [
        dict(execution.scenario) for execution in semantics.Oracle(plan, solver=solver).scenarios(deadline=deadline)
    ]
    outcome.scenarios = len(truth)
    counts: dict[Temporal, tuple[str, int]] = {}
    for subject in subjects:
        on_subject(subject.name)
        limits = [each for each in (limit, deadline.remaining) if each is not None]
        limited = Deadline.after(min(limits, default=None))
        random = Random(seed)  # noqa: S311 - reproducible, not secret
        examination = _Examination(plan, subject, solver, random, limited, truth, outcome)
        try:
            examination.run(samples, counts)
        except OutOfTimeError:
            outcome.out_of_time.append(subject.name)
        outcome.questions[subject.name] = examination.asked
    return outcome


@dataclass
class Crossed(Stoppable, ask="outcome"):
    """The outcome of a cross-check, None if not even the oracle has finished, and the plan written that shows it."""

    outcome: CrossCheck | None = None
    status: str = "complete"
    written: Path | None = None


@dataclass
class Crossing(Searching[Crossed]):
    """A cross-check of all back ends; where they differ, a small plan that shows it is written to a directory."""

    plan: TeamPlan
    witness: Path | None = None
    seed: int = 0
    solver: str = "z3"
    deadline: Deadline = NEVER
    on_stage: Announce = unheard

    def __post_init__(self) -> None:
        self._crossed = Crossed()

    @property
    def _begun(self) -> bool:
        return self._crossed.outcome is not None

    def _result(self, status: Status, reason: str | None = None) -> Crossed:
        if status is not Status.COMPLETE:
            self._crossed.status = status.value
        return self._crossed

    def _search(self) -> None:
        """Ask, compare, and shrink."""
        outcome = self._crossed.outcome = cross_check(
            self.plan,
            tuple(subjects(BACKENDS)),
            solver=self.solver,
            seed=self.seed,
            deadline=self.deadline,
            limit=SUBJECT_LIMIT,
            on_subject=self.on_stage,
        )
        if outcome.out_of_time:
            self._crossed.status = "timeout"
        if not outcome.agree and self.witness is not None:
            self.on_stage("shrinking")
            self._crossed.written = self._shrunk(outcome, self.witness)

    def _shrunk(self, outcome: CrossCheck, witness: Path) -> Path | None:
        """The smallest plan found on which the first subject still differs from the oracle, as files if possible."""
        [subject] = [subject for subject in subjects(BACKENDS) if subject.name == outcome.disagreements[0].backend]

        def shows(smaller: TeamPlan) -> bool:
            return differing(smaller, subject, solver=self.solver, seed=self.seed, limit=10)

        smallest = propositional(shrink(self.plan, shows, Deadline.after(SHRINK_LIMIT)))
        try:
            return smallest.write(witness)
        except errors.InputError as error:
            records.unwritten(error)
            return None


@dataclass
class _Examination:
    """One back end against the scenarios that the oracle found."""

    plan: TeamPlan
    subject: ExaminedBackend
    solver: str
    random: Random
    deadline: Deadline
    truth: list[dict[str, str]]
    """What is left of the scenarios after what was committed to."""
    outcome: CrossCheck
    asked: int = 0
    history: str = ""
    """What was committed to."""

    def run(self, samples: int, counts: dict[Temporal, tuple[str, int]]) -> None:
        """Ask everything; `counts` are the numbers of models that others found, by the augmented plan."""
        domains = self.plan.network.domains
        compilation = self._compile()
        knowledge = compilation.knowledge
        self._state(knowledge)
        for name, values in domains.items():
            for value in values:
                self._could(knowledge, [Require(frozenset({Assignment(name, value)}))])
        for _ in range(samples):
            self._could(knowledge, commitments(domains, self.random))
        whole = self.truth
        self._one_after_the_other(self._compile().knowledge)
        self.truth, self.history = whole, ""
        if isinstance(knowledge, tms.PiTms | propagation.PropagatedLabels):
            self._labels(compilation, knowledge)
        self._count(knowledge, counts)

    def _count(self, knowledge: KnowledgeBase, counts: dict[Temporal, tuple[str, int]]) -> None:
        """Models of one augmented plan are as many for each back end."""
        _, known = counts.get(self.subject.temporal, ("", 0))
        if known > LISTED and reasons_about_time(self.subject.backend):
            return  # a solver counts by listing
        models = knowledge.count_models(self.deadline)
        name, expected = counts.setdefault(self.subject.temporal, (self.subject.name, models))
        self._compare(f"number of models, as {name} has it", expected, models)

    def _one_after_the_other(self, knowledge: KnowledgeBase) -> None:
        """Commit to one thing after the other, and ask in between."""
        for _ in range(STEPS):
            step = commitments(self.plan.network.domains, self.random)
            self.history = f"{self.history} after {_text(step)}"
            self._could(knowledge, step)
            knowledge.commit(step, self.deadline)
            self.truth = [scenario for scenario in self.truth if allows(scenario, step)]
            self._state(knowledge)
            if not self.truth:
                break

    def _labels(self, compilation: Compilation, knowledge: tms.PiTms | propagation.PropagatedLabels) -> None:
        """The goal's prime implicants, and labels of nodes, as a decision diagram has them [PIKE, Invariant 5.2]."""
        theory, deadline = compilation.augmented.theory, self.deadline
        theory = replace(theory, conflicts=(*theory.conflicts, *compilation.conflicts))
        goal = bdd.BddKnowledgeBase(theory, deadline=deadline)
        count = goal.implicant_count(deadline)
        self._compare("number of prime implicants", count, knowledge.implicant_count())
        if count <= LISTED:
            implicants = frozenset(knowledge.prime_implicants())
            self._compare("prime implicants", True, implicants == frozenset(goal.prime_implicants(deadline)))
        if count == 0:
            return  # nothing was compiled
        nodes = [label for label in knowledge.labels(deadline) if label.node.kind is labels.NodeKind.DERIVED]
        for label in self.random.sample(nodes, min(LABELS, len(nodes))):
            alone = Theory(theory.domains, (label.node.formula,), knowledge.encoded.conflicts)
            diagram = bdd.BddKnowledgeBase(alone, deadline=deadline)
            if diagram.implicant_count(deadline) <= LISTED:
                same = label.environments == frozenset(diagram.prime_implicants(deadline))
                self._compare(f"label of {label.node.formula}", True, same)

    def _compile(self) -> Compilation:
        backend, temporal = self.subject.backend, self.subject.temporal
        return Compiling(self.plan, backend, temporal, self.solver, deadline=self.deadline).compile()

    def _state(self, knowledge: KnowledgeBase) -> None:
        """Whether an execution is left, and which scenarios are."""
        self._compare("a correct execution exists", bool(self.truth), knowledge.satisfiable(self.deadline))
        domains = self.plan.network.domains
        listed = {tuple(sorted(scenario)) for scenario in scenarios(knowledge, domains, self.deadline)}
        expected = {tuple(sorted(Assignment(*item) for item in scenario.items())) for scenario in self.truth}
        self._compare("scenarios that are missing", _listed(set()), _listed(expected - listed))
        self._compare("scenarios that are wrong", _listed(set()), _listed(listed - expected))

    def _could(self, knowledge: KnowledgeBase, step: Sequence[Commitment]) -> None:
        expected = any(allows(scenario, step) for scenario in self.truth)
        self._compare(f"could commit to {_text(step)}", expected, knowledge.could_commit(step, self.deadline))

    def _compare(self, question: str, expected: object, answer: object) -> None:
        self.asked += 1
        if expected != answer:
            question += self.history
            self.outcome.disagreements.append(Disagreement(self.subject.name, question, str(expected), str(answer)))


def commitments(domains: Mapping[str, tuple[str, ...]], random: Random) -> list[Commitment]:
    """A random set of assignments and conflicts, each over a few variables."""

    def some() -> Guard:
        names = random.sample(list(domains), random.randint(0, min(3, len(domains))))
        return frozenset(Assignment(name, random.choice(domains[name])) for name in names)

    required = [Require(some()) for _ in range(random.randint(0, 1))]
    excluded = [Exclude(environment) for environment in (some() for _ in range(random.randint(0, 2))) if environment]
    return [*required, *excluded]


def allows(scenario: Mapping[str, str], step: Sequence[Commitment]) -> bool:
    """Whether a scenario satisfies commitments."""
    return all(
        semantics.holds(commitment.environment, scenario) is isinstance(commitment, Require) for commitment in step
    )


def _text(step: Sequence[Commitment]) -> str:
    def one_text(one: Commitment) -> str:
        inner = ", ".join(str(assignment) for assignment in sorted(one.environment)) or "nothing"
        return inner if isinstance(one, Require) else f"not ({inner})"

    return "; ".join(map(one_text, step)) or "nothing"


def _listed(scenarios: set[tuple[Assignment, ...]]) -> str:
    shown = ["{" + ", ".join(map(str, scenario)) + "}" for scenario in sorted(scenarios)[:3]]
    return ", ".join([*shown, *(["…"] if len(scenarios) > 3 else [])]) or "none"


def differing(plan: TeamPlan, subject: ExaminedBackend, *, solver: str, seed: int, limit: float) -> bool:
    """Whether the subject disagrees with the oracle about a plan; for shrinking, so within a limit of seconds."""
    deadline = Deadline.after(limit)
    try:
        return not cross_check(plan, [subject], solver=solver, seed=seed, deadline=deadline).agree
    except OutOfTimeError:
        return False


def shrink(plan: TeamPlan, shows: Callable[[TeamPlan], bool], deadline: Deadline) -> TeamPlan:
    """The plan with as much left out as possible such that `shows` still holds of it, found greedily.

    What is tried: making one choice in advance, and leaving out one activity, condition, effect or constraint. It ends
    when nothing more can go, or at the deadline.
    """
    smaller: TeamPlan | None = plan
    while smaller is not None:
        plan = smaller
        smaller = next((less for less in _smaller(plan) if not deadline.passed and _holds(shows, less)), None)
    return plan


def _holds(shows: Callable[[TeamPlan], bool], plan: TeamPlan) -> bool:
    try:
        files.validate(plan.network)  # it will be written to a file
        return shows(plan)
    except errors.RobustError:
        return False  # not a plan any more: another one has to do


def _smaller(plan: TeamPlan) -> Iterator[TeamPlan]:
    for choice in plan.network.choices:
        for value in choice.domain:
            yield semantics.restrict(plan, frozenset({Assignment(choice.name, value)}))
    for place in range(len(plan.network.activities)):
        yield _without_activity(plan, place)
    yield from (replace(plan, conditions=rest) for rest in _without_one(plan.conditions))
    yield from (replace(plan, effects=rest) for rest in _without_one(plan.effects))
    for rest in _without_one(plan.network.constraints):
        yield replace(plan, network=replace(plan.network, constraints=rest))


def _without_one(items: tuple[T, ...]) -> Iterator[tuple[T, ...]]:
    """What is left of the items without the first, without the second and so on."""
    return (items[:at] + items[at + 1 :] for at in range(len(items)))


def _without_activity(plan: TeamPlan, place: int) -> TeamPlan:
    """The plan without an activity; its events, and the constraint between them, stay."""
    activities, activity = plan.network.activities, plan.network.activities[place]
    network = replace(
        plan.network,
        activities=activities[:place] + activities[place + 1 :],
        constraints=(*plan.network.constraints, activity.duration),
    )

    kept = [at for at in range(len(activities)) if at != place]
    return replace(
        plan,
        network=network,
        conditions=semantics.moved(plan.conditions, kept),
        effects=semantics.moved(plan.effects, kept),
    )


_LEGAL = re.compile(r"[^a-z0-9_-]+")


def propositional(plan: TeamPlan) -> action_model.Instance:
    """The network with its actions renamed, and a domain and a problem that mean the same plan."""
    names = _names(plan)
    activities = [replace(each, action=f"(act-{at})") for at, each in enumerate(plan.network.activities)]

    def texts(literals: Iterable[Literal]) -> tuple[str, ...]:
        written = ((f"({names[literal.atom]})", literal.positive) for literal in literals)
        return tuple(atom if positive else f"(not {atom})" for atom, positive in written)

    def action(at: int, activity: Activity) -> ActionText:
        needs = [condition for condition in plan.conditions if condition.activity == at]
        does = [effect for effect in plan.effects if effect.activity == at]
        moments = [need for need in needs if need.first == need.last]
        return ActionText(
            f"act-{at}",
            at_start=texts(moment.literal for moment in moments if moment.first == activity.source),
            over_all=texts(need.literal for need in needs if need.first != need.last),
            at_end=texts(moment.literal for moment in moments if moment.first != activity.source),
            start_effects=texts(effect.literal for effect in does if effect.event == activity.source),
            end_effects=texts(effect.literal for effect in does if effect.event != activity.source),
        )

    initial = [each.literal for each in plan.effects if each.activity is None and each.event == INITIAL]
    goal = [each.literal for each in plan.conditions if each.activity is None and each.first == GOAL]
    return action_model.Instance(
        replace(plan.network, activities=tuple(activities)),
        sketched_domain("team", texts(map(Literal, names)), list(starmap(action, enumerate(activities)))),
        sketched_problem("team", "team", texts(literal for literal in initial if literal.positive), texts(goal)),
    )


def _names(plan: TeamPlan) -> dict[Atom, str]:
    """A predicate without arguments for each atom."""
    atoms = {condition.literal.atom for condition in plan.conditions} | {effect.literal.atom for effect in plan.effects}
    names: dict[Atom, str] = {}
    for atom in sorted(atoms, key=str):
        base = "p-" + _LEGAL.sub("-", str(atom).lower()).strip("-")
        numbered = (base if number == 1 else f"{base}-{number}" for number in count(1))
        names[atom] = next(name for name in numbered if name not in names.values())
    return names
