"""Smaller plans that still show something: what a disagreement is reported with, as files that reproduce it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from random import Random
from typing import TypeVar

from robust.errors import RobustError
from robust.pike_bridge.compile import Compilation, Temporal, compile_plan, scenarios
from robust.pike_bridge.knowledge import reasons_about_time
from robust.pike_bridge.knowledge.bdd import BddKnowledgeBase
from robust.pike_bridge.knowledge.interface import Commitment, Exclude, KnowledgeBase, Require
from robust.pike_bridge.knowledge.network import Kind
from robust.pike_bridge.knowledge.tms import PiTms
from robust.pike_bridge.model import Assignment, Condition, Effect, Guard, TeamPlan
from robust.pike_bridge.scenarios import restrict
from robust.pike_bridge.semantics import Oracle
from robust.pike_bridge.theory import Theory
from robust.pike_bridge.validate import validate
from robust.smt.limits import Deadline, OutOfTimeError

T = TypeVar("T")


def shrink(plan: TeamPlan, shows: Callable[[TeamPlan], bool], deadline: Deadline) -> TeamPlan:
    """The plan with as much left out as possible such that `shows` still holds of it, found greedily.

    What is tried: making one choice in advance, and leaving out one activity, condition, effect or constraint. It ends
    when nothing more can go, or at the deadline.
    """
    smaller: TeamPlan | None = plan
    while smaller is not None:
        plan = smaller
        smaller = next((one for one in _smaller(plan) if not deadline.passed and _holds(shows, one)), None)
    return plan


def _holds(shows: Callable[[TeamPlan], bool], plan: TeamPlan) -> bool:
    try:
        validate(plan.network)  # it will be written to a file
        return shows(plan)
    except RobustError:
        return False  # not a plan any more: another one has to do


def _smaller(plan: TeamPlan) -> Iterator[TeamPlan]:
    for choice in plan.network.choices:
        for value in choice.domain:
            yield restrict(plan, frozenset({Assignment(choice.name, value)}))
    for place in range(len(plan.network.activities)):
        yield without_activity(plan, place)
    for at in range(len(plan.conditions)):
        yield replace(plan, conditions=_without(plan.conditions, at))
    for at in range(len(plan.effects)):
        yield replace(plan, effects=_without(plan.effects, at))
    constraints = plan.network.constraints
    for at in range(len(constraints)):
        yield replace(plan, network=replace(plan.network, constraints=_without(constraints, at)))


def _without(items: tuple[T, ...], at: int) -> tuple[T, ...]:
    return items[:at] + items[at + 1 :]


def without_activity(plan: TeamPlan, place: int) -> TeamPlan:
    """The plan without an activity; its events, and the constraint between them, stay."""
    activity = plan.network.activities[place]
    network = replace(
        plan.network,
        activities=_without(plan.network.activities, place),
        constraints=(*plan.network.constraints, activity.duration),
    )

    def renumbered(owner: int | None) -> int | None:
        return owner - 1 if owner is not None and owner > place else owner

    conditions: tuple[Condition, ...] = tuple(
        replace(one, activity=renumbered(one.activity)) for one in plan.conditions if one.activity != place
    )
    effects: tuple[Effect, ...] = tuple(
        replace(one, activity=renumbered(one.activity)) for one in plan.effects if one.activity != place
    )
    return replace(plan, network=network, conditions=conditions, effects=effects)


SAMPLES = 20
"""Sets of commitments that are tried."""
LISTED = 2_000
"""Models and implicants that are compared one by one; of more, only the numbers are."""
LABELS = 60
"""Nodes of the πTMS whose labels are examined, drawn at random."""
STEPS = 6
"""Commitments that are made one after the other."""
Scenario = Mapping[str, str]


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
class CrossCheck:
    """The outcome: how many questions each back end was asked, and where it disagreed."""

    scenarios: int = 0
    """How many team scenarios admit a correct execution, by the oracle."""
    questions: dict[str, int] = field(default_factory=dict)
    out_of_time: list[str] = field(default_factory=list)
    """Back ends that did not answer everything in time."""
    disagreements: list[Disagreement] = field(default_factory=list)

    @property
    def agree(self) -> bool:
        return not self.disagreements


@dataclass(frozen=True)
class Subject:
    """A back end to be examined, with the way in which time is reasoned about."""

    backend: str
    temporal: Temporal

    @property
    def name(self) -> str:
        return f"{self.backend} ({self.temporal.value})"


def cross_check(
    plan: TeamPlan,
    subjects: Sequence[Subject],
    *,
    solver: str = "z3",
    seed: int = 0,
    samples: int = SAMPLES,
    deadline: Deadline = Deadline(),  # noqa: B008 - immutable
    limit: float | None = None,
    on_subject: Callable[[str], None] | None = None,
) -> CrossCheck:
    """Ask the oracle and each subject the same questions.

    Args:
        limit: seconds for each subject, which is then left out of what remains.

    Raises:
        OutOfTimeError: if the deadline passes before the oracle has found every scenario.
    """
    outcome = CrossCheck()
    if on_subject is not None:
        on_subject("oracle")
    truth = [dict(one.scenario) for one in Oracle(plan, solver=solver).scenarios(deadline=deadline)]
    outcome.scenarios = len(truth)
    counts: dict[Temporal, tuple[str, int]] = {}
    for subject in subjects:
        if on_subject is not None:
            on_subject(subject.name)
        examination = _Examination(plan, subject, truth, outcome)
        own = Deadline.after(_least(limit, deadline.remaining))
        try:
            examination.run(solver, Random(seed), samples, own)  # noqa: S311 - reproducible, not secret
            examination.count(counts, own)
        except OutOfTimeError:
            outcome.out_of_time.append(subject.name)
        outcome.questions[subject.name] = examination.asked
    return outcome


def _least(*limits: float | None) -> float | None:
    return min((limit for limit in limits if limit is not None), default=None)


@dataclass
class _Examination:
    """One back end against the scenarios that the oracle found."""

    plan: TeamPlan
    subject: Subject
    truth: list[dict[str, str]]
    outcome: CrossCheck
    asked: int = 0
    compilation: Compilation | None = None

    def run(self, solver: str, random: Random, samples: int, deadline: Deadline) -> None:
        domains = self.plan.network.domains
        self.compilation = self._compile(solver, deadline)
        knowledge = self.compilation.knowledge
        self._state(knowledge, self.truth, "", deadline)
        for name, values in domains.items():
            for value in values:
                self._could(knowledge, self.truth, [Require(frozenset({Assignment(name, value)}))], "", deadline)
        for _ in range(samples):
            self._could(knowledge, self.truth, commitments(domains, random), "", deadline)
        self._sequence(solver, random, deadline)
        if isinstance(knowledge, PiTms):
            self._labels(knowledge, random, deadline)

    def count(self, counts: dict[Temporal, tuple[str, int]], deadline: Deadline) -> None:
        """Models of one augmented plan are as many for each back end."""
        if self.compilation is None:
            return
        _, known = counts.get(self.subject.temporal, ("", 0))
        if known > LISTED and reasons_about_time(self.subject.backend):
            return  # a solver counts by listing
        found = self.compilation.knowledge.count_models(deadline)
        name, expected = counts.setdefault(self.subject.temporal, (self.subject.name, found))
        self._compare(f"number of models, as {name} has it", expected, found)

    def _sequence(self, solver: str, random: Random, deadline: Deadline) -> None:
        """Commit to one thing after the other, and ask in between."""
        knowledge = self._compile(solver, deadline).knowledge
        left, history = self.truth, ""
        for _ in range(STEPS):
            step = commitments(self.plan.network.domains, random)
            kept = [one for one in left if allows(one, step)]
            history = f"{history} after {_text(step)}"
            self._could(knowledge, left, step, history, deadline)
            knowledge.commit(step, deadline)
            left = kept
            self._state(knowledge, left, history, deadline)
            if not left:
                break

    def _labels(self, knowledge: PiTms, random: Random, deadline: Deadline) -> None:
        """The goal's prime implicants, and labels of nodes, as a decision diagram has them [PIKE, Invariant 5.2]."""
        theory = self._theory()
        goal = BddKnowledgeBase(theory, deadline=deadline)
        count = goal.implicant_count(deadline)
        self._compare("number of prime implicants", count, knowledge.implicant_count())
        if count <= LISTED:
            found = frozenset(knowledge.prime_implicants())
            self._compare("prime implicants", True, found == frozenset(goal.prime_implicants(deadline)))
        if count == 0:
            return  # nothing was compiled
        nodes = [label for label in knowledge.labels(deadline) if label.node.kind is Kind.DERIVED]
        for label in random.sample(nodes, min(LABELS, len(nodes))):
            alone = Theory(theory.domains, (label.node.formula,), knowledge.simplified.conflicts)
            diagram = BddKnowledgeBase(alone, deadline=deadline)
            if diagram.implicant_count(deadline) <= LISTED:
                same = label.environments == frozenset(diagram.prime_implicants(deadline))
                self._compare(f"label of {label.node.formula}", True, same)

    def _theory(self) -> Theory:
        if self.compilation is None:
            raise ValueError("nothing was compiled")
        theory = self.compilation.augmented.theory
        return replace(theory, conflicts=(*theory.conflicts, *self.compilation.conflicts))

    def _compile(self, solver: str, deadline: Deadline) -> Compilation:
        return compile_plan(
            self.plan,
            backend=self.subject.backend,
            temporal=self.subject.temporal,
            solver=solver,
            deadline=deadline,
        )

    def _state(self, knowledge: KnowledgeBase, truth: list[dict[str, str]], history: str, deadline: Deadline) -> None:
        self._compare(f"a correct execution exists{history}", bool(truth), knowledge.satisfiable(deadline))
        found = {tuple(sorted(one)) for one in scenarios(knowledge, self.plan.network.domains, deadline)}
        expected = {tuple(sorted(Assignment(*item) for item in one.items())) for one in truth}
        self._compare(f"scenarios that are missing{history}", _listed(set()), _listed(expected - found))
        self._compare(f"scenarios that are wrong{history}", _listed(set()), _listed(found - expected))

    def _could(
        self,
        knowledge: KnowledgeBase,
        truth: list[dict[str, str]],
        step: Sequence[Commitment],
        history: str,
        deadline: Deadline,
    ) -> None:
        expected = any(allows(one, step) for one in truth)
        self._compare(f"could commit to {_text(step)}{history}", expected, knowledge.could_commit(step, deadline))

    def _compare(self, question: str, expected: object, found: object) -> None:
        self.asked += 1
        if expected != found:
            self.outcome.disagreements.append(Disagreement(self.subject.name, question, str(expected), str(found)))


def commitments(domains: Mapping[str, tuple[str, ...]], random: Random) -> list[Commitment]:
    """A random set of assignments and conflicts, each over a few variables."""

    def some() -> Guard:
        names = random.sample(list(domains), random.randint(0, min(3, len(domains))))
        return frozenset(Assignment(name, random.choice(domains[name])) for name in names)

    required = [Require(some()) for _ in range(random.randint(0, 1))]
    excluded = [Exclude(environment) for environment in (some() for _ in range(random.randint(0, 2))) if environment]
    return [*required, *excluded]


def allows(scenario: Scenario, step: Sequence[Commitment]) -> bool:
    """Whether a scenario satisfies commitments."""

    def holds(environment: Guard) -> bool:
        return all(scenario[variable] == value for variable, value in environment)

    return all(holds(one.environment) is isinstance(one, Require) for one in step)


def _text(step: Sequence[Commitment]) -> str:
    def one_text(one: Commitment) -> str:
        inner = ", ".join(str(assignment) for assignment in sorted(one.environment)) or "nothing"
        return inner if isinstance(one, Require) else f"not ({inner})"

    return "; ".join(map(one_text, step)) or "nothing"


def _listed(found: set[tuple[Assignment, ...]]) -> str:
    shown = ["{" + ", ".join(map(str, one)) + "}" for one in sorted(found)[:3]]
    return ", ".join([*shown, *(["…"] if len(found) > 3 else [])]) or "none"


def differing(
    plan: TeamPlan, subject: Subject, *, solver: str, seed: int, limit: float, samples: int = SAMPLES
) -> bool:
    """Whether the subject disagrees with the oracle about a plan; for shrinking, so within a limit of seconds."""
    try:
        outcome = cross_check(
            plan, [subject], solver=solver, seed=seed, samples=samples, deadline=Deadline.after(limit)
        )
    except OutOfTimeError:
        return False
    return not outcome.agree


def subjects(backends: Sequence[str]) -> Iterator[Subject]:
    """Each back end with each way of temporal reasoning."""
    for temporal in Temporal:
        for backend in backends:
            yield Subject(backend, temporal)
