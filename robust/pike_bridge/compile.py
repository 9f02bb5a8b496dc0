"""Compiling a plan offline, and checking whether it admits a correct execution [PIKE, Algorithm 4].

Compilation goes from a team plan to a knowledge base of all its correct executions, by stages that are timed. A check
asks the semantic oracle or such a knowledge base; every execution that it shows was confirmed by the referee.

What a compilation consists of is shown to people: labeled causal links with what keeps threats away, labels, distances.
"""

import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field, replace
from enum import Enum
from fractions import Fraction
from itertools import permutations
from typing import Any

from robust.errors import InputError, Location, SolverError, UnsupportedError
from robust.pike_bridge import causal, distance_graph, labeled_apsp, semantics
from robust.pike_bridge import theory as logic
from robust.pike_bridge.knowledge import create_knowledge_base, goal, reasons_about_time, tms
from robust.pike_bridge.model import ALWAYS, Assignment, Guard, Literal, TeamPlan, Tpnu, check_choice, circular
from robust.pike_bridge.model import guard as conjunction
from robust.presented import OneLine, Presented, VerdictEnum
from robust.searching import Announce, Searching, Status, Stoppable, unheard
from robust.smt.limits import NEVER, Deadline, OutOfTimeError

Values = Mapping[str, str]
"""A conjunction of assignments: the value of each choice."""


@dataclass(frozen=True, slots=True)
class LinkThreat:
    """an effect that would break a causal link

    Attributes:
        event: at which it is
        actions: that begin or end there and have the effect; none: the initial state
        label: when it is activated
        resolution: before: it is ordered before the producer; after: after the consumer; either: one of the two, as
            `variable` says; never: the link is not used where the effect is activated
        variable: of knowledge bases, with the values before and after
    """

    event: str
    actions: list[str]
    label: Values
    resolution: str
    variable: str | None


@dataclass(frozen=True, slots=True)
class LinkProducer:
    """a labeled causal link of a condition

    Attributes:
        event: that produces what is needed
        actions: that begin or end there and have the effect; none: the initial state
        label: when the event is activated
        value: of the condition's variable that selects the link
        ordered: whether it had to be ordered before the consumer
    """

    event: str
    actions: list[str]
    label: Values
    value: str
    ordered: bool
    threats: list[LinkThreat]


@dataclass(frozen=True, slots=True)
class ConditionLinks:
    """a condition of activities or of the goal, and all labeled causal links that may support it

    Attributes:
        condition: the literal that is needed
        first: the event before which it is needed
        last: the event until which it is needed
        label: when it is needed
        actions: that need it; none: the goal
        variable: of knowledge bases, which says what supports it; null: nothing can
    """

    condition: str
    first: str
    last: str
    label: Values
    actions: list[str]
    variable: str | None
    producers: list[LinkProducer]


@dataclass(frozen=True, slots=True)
class FormulaLabel:
    """the label of a node: the environments in which its formula holds

    Attributes:
        kind: assumption, derived, or contradiction, whose formula must not hold
    """

    formula: str
    kind: str
    environments: list[Values]


@dataclass(frozen=True, slots=True)
class LabeledBound:
    """the time from one event to another is at most `bound` where the label holds"""

    bound: Fraction
    label: Values


@dataclass(frozen=True, slots=True)
class DistancePair:
    """the labeled value set of two events: all shortest paths that no other one dominates"""

    source: str
    target: str
    values: list[LabeledBound]


@dataclass(frozen=True, slots=True)
class PlanDistances:
    """labeled shortest paths of the augmented plan

    Attributes:
        conflicts: environments in which no scenario has a schedule
        pairs: of events with some bound; where both are activated
    """

    conflicts: list[Values]
    pairs: list[DistancePair]


def links_of(augmented: causal.AugmentedPlan) -> Iterator[ConditionLinks]:
    """Every condition with its links, and how the threats of each are kept away [PIKE §4.2 to §4.4, Figure 12]."""
    plan = augmented.plan
    threats: dict[int, list[LinkThreat]] = {}
    for link, threat, resolution, variable in augmented.threats:
        actions = _doing(plan, threat, link.consumer.literal.negation)
        kept_away = LinkThreat(threat.event, actions, dict(sorted(threat.guard)), resolution, variable)
        threats.setdefault(id(link), []).append(kept_away)
    producers: dict[int, list[LinkProducer]] = {}
    variables: dict[int, str] = {}
    ordered = {(each.source, each.target, each.guard) for each in augmented.added}
    for link in augmented.links:
        question, (event, guard) = link.consumer, link.producer
        [(variables[id(question)], value)] = link.selection
        actions = _doing(plan, link.producer, question.literal)
        added = (event, question.first, link.selection | guard | question.guard) in ordered
        shown = LinkProducer(event, actions, dict(sorted(guard)), value, added, threats.get(id(link), []))
        producers.setdefault(id(question), []).append(shown)
    for question in augmented.conditions:
        needed = _actions(plan, (condition.activity for condition in question.conditions))
        yield ConditionLinks(
            str(question.literal),
            question.first,
            question.last,
            dict(sorted(question.guard)),
            needed,
            variables.get(id(question)),
            producers.get(id(question), []),
        )


def _doing(plan: TeamPlan, happening: causal.LabeledHappening, literal: Literal) -> list[str]:
    """The actions whose effect it is."""
    effects = (each for each in plan.effects if (each.event, each.guard, each.literal) == (*happening, literal))
    return _actions(plan, (effect.activity for effect in effects))


def _actions(plan: TeamPlan, places: Iterable[int | None]) -> list[str]:
    return list(dict.fromkeys(plan.network.activities[place].action for place in places if place is not None))


def labels_of(knowledge: tms.LabelKnowledgeBase, deadline: Deadline = NEVER) -> list[FormulaLabel]:
    """The label of each node [PIKE §5.3, Invariant 5.2].

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    return [
        FormulaLabel(formula_text(label.node.formula), label.node.kind.value, _sorted(label.environments))
        for label in knowledge.labels(deadline)
    ]


def _sorted(environments: Iterable[Guard]) -> list[Values]:
    """Short ones first."""
    ordered = sorted((tuple(sorted(each)) for each in environments), key=lambda each: (len(each), each))
    return [dict(each) for each in ordered]


def formula_text(formula: logic.Formula) -> str:
    """A formula for people; parts of more than one word are in brackets."""

    def junction(word: str, nothing: str, parts: list[str]) -> str:
        return word.join(parts) if len(parts) == 1 else f"({word.join(parts)})" if parts else nothing

    return logic.interpret(
        formula,
        str,
        lambda part: f"not {part}",
        lambda parts: junction(" and ", "true", parts),
        lambda parts: junction(" or ", "false", parts),
    )


def distances_of(network: Tpnu, distances: labeled_apsp.LabeledDistances, deadline: Deadline = NEVER) -> PlanDistances:
    """All labeled shortest paths of a network [PIKE, Algorithm 9].

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    decode = distances.vocabulary.decode
    pairs = []
    for source, target in permutations(network.guards, 2):
        deadline.enforce()
        known = distances.labeled(source, target)
        values = [LabeledBound(bound, dict(sorted(decode(label)))) for bound, label in known]
        if values:
            pairs.append(DistancePair(source, target, values))
    return PlanDistances(_sorted(map(decode, distances.conflicts)), pairs)


class Temporal(Enum):
    """How events are ordered, and temporal conflicts found.

    APSP is the paper's way: labeled all-pairs shortest paths of the plan, and again of the augmented plan. LAZY orders
    events by the structure of the plan and finds only such conflicts as the other constraints leave open.
    """

    LAZY = "lazy"
    APSP = "apsp"


@dataclass(frozen=True)
class Compilation(OneLine, ask="backend"):
    """What offline compilation leaves for execution."""

    backend: str
    augmented: causal.AugmentedPlan
    conflicts: tuple[Guard, ...]
    """Temporal conflicts of the augmented plan; none if the back end reasons about time itself."""
    knowledge: logic.KnowledgeBase
    distances: labeled_apsp.LabeledDistances | None = None
    """Of the augmented plan, where they were computed to find the conflicts."""


@dataclass
class Compiling:
    """One compilation; what has been found stays readable when a deadline or Ctrl-C ends it.

    Args:
        plan: the plan.
        backend: the name of a knowledge base.
        temporal: how events are ordered and temporal conflicts found.
        solver: `z3` or `cvc5`, for what is asked of solvers.
        shortcut: whether a theory without models may be recognised by a solver instead of being compiled.
    """

    plan: TeamPlan
    backend: str
    temporal: Temporal = Temporal.LAZY
    solver: str = "z3"
    shortcut: bool = True
    deadline: Deadline = NEVER
    on_stage: Announce = unheard
    seconds: dict[str, float] = field(default_factory=dict)
    """By stage: precedence, links, conflicts, knowledge."""
    counts: dict[str, int] = field(default_factory=dict)
    """The sizes of what the stages that ended have made."""
    statistics: logic.KnowledgeStatistics = field(default_factory=logic.KnowledgeStatistics)

    def compile(self) -> Compilation:
        """Compile.

        Raises:
            OutOfTimeError: if the deadline passes first.
            InputError: an unknown back end or solver.
        """
        timed = reasons_about_time(self.backend)
        with self.stage("precedence"):
            precedence = self._precedence()
        with self.stage("links"):
            augmented = causal.augment(self.plan, precedence)
            self.counts |= {
                "choice_variables": len(augmented.theory.domains),
                "links": len(augmented.links),
                "added_orderings": len(augmented.network.constraints) - len(self.plan.network.constraints),
                "propositional_constraints": len(augmented.theory.constraints) + len(augmented.theory.conflicts),
            }
        with self.stage("conflicts"):
            conflicts, distances = ((), None) if timed else self._conflicts(augmented)
            self.counts["temporal_conflicts"] = len(conflicts)
        with self.stage("knowledge"):
            knowledge = create_knowledge_base(
                self.backend,
                replace(augmented.theory, conflicts=(*augmented.theory.conflicts, *conflicts)),
                network=augmented.network if timed else None,
                solver=self.solver,
                shortcut=self.shortcut,
                deadline=self.deadline,
                statistics=self.statistics,
            )
        return Compilation(self.backend, augmented, conflicts, knowledge, distances)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Announce a stage, and note how long it takes."""
        self.on_stage(name)
        started = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = time.perf_counter() - started

    def _precedence(self) -> distance_graph.Precedence:
        precedence = (
            labeled_apsp.LabeledDistances if self.temporal is Temporal.APSP else distance_graph.StructuralPrecedence
        )
        return precedence(self.plan.network, self.deadline, epsilon=self.plan.separation)

    def _conflicts(
        self, augmented: causal.AugmentedPlan
    ) -> tuple[tuple[Guard, ...], labeled_apsp.LabeledDistances | None]:
        network = augmented.network
        if self.temporal is Temporal.APSP:
            distances = labeled_apsp.LabeledDistances(network, self.deadline)
            return tuple(map(distances.vocabulary.decode, distances.conflicts)), distances
        return labeled_apsp.temporal_conflicts(network, augmented.theory, self.deadline, solver=self.solver), None


ORACLE = "oracle"


class PlanVerdict(VerdictEnum):
    """Whether a correct execution exists under the assumptions: PROVED says yes, and shows one."""

    PROVED = "proved"
    REFUTED = "refuted"
    UNKNOWN = "unknown"


@dataclass
class PikeCheck(Presented, ask="verdict"):
    """The answer. `scenarios` is None unless all were asked for; `complete` says whether none is missing.

    `because`: where it is refuted, lines that say what contradicts itself, none of which could be left out.
    """

    backend: str
    verdict: PlanVerdict
    execution: semantics.Execution | None
    scenarios: list[Mapping[str, str]] | None
    complete: bool
    seconds: Mapping[str, float]
    """By stage."""
    because: tuple[str, ...] = ()
    interrupted: bool = False
    reason: str | None = None
    """Why the check ended early, where neither time nor Ctrl-C ended it."""
    plan: TeamPlan | None = field(default=None, repr=False, compare=False)

    @property
    def cut_short(self) -> bool:
        """Whether something ended the check before it was done."""
        return self.interrupted or not self.complete or self.verdict is PlanVerdict.UNKNOWN


PITMS = "pitms"
LONGEST_LISTING = 1_000_000
"""Prime implicants are counted exactly, but not listed beyond this."""


@dataclass
class Sizes(Stoppable, ask="satisfiable"):
    """What is known of a compilation; None where it did not get so far. `status` and `reason` say what ended it."""

    backend: str
    temporal: str
    solver: str
    status: str = "complete"
    reason: str | None = None
    candidate_subplans: int | None = None
    counts: dict[str, int] = field(default_factory=dict)
    satisfiable: bool | None = None
    prime_implicants: int | None = None
    models: int | None = None
    seconds: dict[str, float] = field(default_factory=dict)
    statistics: dict[str, Any] = field(default_factory=dict)
    implicants: list[dict[str, str]] | None = None
    causal_links: list[ConditionLinks] | None = None
    labels: list[FormulaLabel] | None = None
    distances: PlanDistances | None = None


UNDECIDED = ""
"""In place of the value of a choice that is not active."""


def candidate_subplans(network: Tpnu) -> int:
    """How many different sets of decisions there are: assignments to the choices that are active under them.

    For plans that are built from sequences, parallel branches and choices it is the number that [PIKE §6.2.2] defines
    by recursion. Decision diagrams count them.

    Raises:
        InputError: if choices depend on one another in a cycle.
    """
    if cycle := circular(network):
        raise InputError(f"found choices that depend on one another in a cycle: {', '.join(cycle)}; expected none")
    guards = network.guards
    needs = {choice.name: ALWAYS if choice.event is None else guards[choice.event] for choice in network.choices}
    domains = {name: (*values, UNDECIDED) for name, values in network.domains.items()}
    labels = []
    for name, guard in needs.items():
        # What the choices that it depends on need themselves goes without saying.
        direct = guard.difference(*(needs[variable] for variable, _ in guard))
        active = [direct | {Assignment(name, value)} for value in network.domains[name]]
        others = [Assignment(of, each) for of, value in direct for each in domains[of] if each != value]
        labels.append([*active, *(frozenset({other, Assignment(name, UNDECIDED)}) for other in others)])
    return goal.compile_goal(domains, labels, (), NEVER).count(NEVER)


@dataclass
class Measuring(Compiling, Searching[Sizes]):
    """Compiles a plan, and asks how large the parts are.

    Args:
        implicants: whether the prime implicants are listed.
        models: whether models are counted; None: unless the back end, which asks a solver, would list them.
        show: what else is listed: `links`, `labels` of nodes, `distances`.
    """

    implicants: bool = False
    models: bool | None = None
    show: Collection[str] = ()

    def __post_init__(self) -> None:
        network = self.plan.network
        self.counts |= {
            "choices": len(network.choices),
            "events": len(network.events),
            "activities": len(network.activities),
            "conditions": len(self.plan.conditions),
        }
        self._sizes = Sizes(self.backend, self.temporal.value, self.solver, counts=self.counts, seconds=self.seconds)

    def _result(self, status: Status, reason: str | None = None) -> Sizes:
        self._sizes.status, self._sizes.reason = status.value, reason
        self._sizes.statistics = asdict(self.statistics)
        return self._sizes

    def _search(self) -> None:
        self._sizes.candidate_subplans = candidate_subplans(self.plan.network)
        compilation = self.compile()
        knowledge, augmented = compilation.knowledge, compilation.augmented
        self._sizes.satisfiable = knowledge.satisfiable(self.deadline)
        if "links" in self.show:
            self._sizes.causal_links = list(links_of(augmented))
        if "labels" in self.show and isinstance(knowledge, tms.LabelKnowledgeBase):
            self._sizes.labels = labels_of(knowledge, self.deadline)
        if "distances" in self.show:
            self.on_stage("distances")
            distances = compilation.distances or labeled_apsp.LabeledDistances(augmented.network, self.deadline)
            self._sizes.distances = distances_of(augmented.network, distances, self.deadline)
        questions = (self._ask_models, self._ask_implicants)
        # Labels hold the prime implicants already, so that these are known even if there is no time to count models.
        for question in reversed(questions) if self.backend == PITMS else questions:
            question(knowledge)

    def _ask_models(self, knowledge: logic.KnowledgeBase) -> None:
        if self.models or (self.models is None and not reasons_about_time(self.backend)):
            self.on_stage("counting models")
            self._sizes.models = knowledge.count_models(self.deadline)

    def _ask_implicants(self, knowledge: logic.KnowledgeBase) -> None:
        if not isinstance(knowledge, logic.HasImplicants):
            return
        self.on_stage("counting prime implicants")
        count = self._sizes.prime_implicants = knowledge.implicant_count(self.deadline)
        if self.implicants and count > LONGEST_LISTING:
            raise UnsupportedError(
                f"--implicants: found {count:,} to list, expected at most {LONGEST_LISTING:,}; "
                "without the option they are counted only"
            )
        if self.implicants:
            self._sizes.implicants = [
                dict(sorted(implicant)) for implicant in knowledge.prime_implicants(self.deadline)
            ]


def checked_assumptions(plan: TeamPlan, assume: Mapping[str, str], place: Location | None = None) -> Guard:
    """The environment of assumptions.

    Raises:
        InputError: if there is no such choice or value.
    """
    domains = plan.network.domains
    for name, value in assume.items():
        check_choice(domains, name, value, place)
    return conjunction(assume)


EXPLAINED = 5.0
"""Seconds that an explanation may take beside the answer."""


@dataclass
class Checking(Compiling, Searching[PikeCheck]):
    """Decides whether a correct execution exists.

    Args:
        backend: `oracle`, or the name of a knowledge base; how time is reasoned about is of no concern to the oracle.
        assume: choices that are made already.
        all_scenarios: whether every team scenario is wanted.
        explain: says why there is no correct execution under the assumptions, which may take `EXPLAINED`.
    """

    backend: str = ORACLE
    assume: Guard = ALWAYS
    all_scenarios: bool = False
    explain: Callable[[Guard, Deadline], tuple[str, ...]] | None = None

    def __post_init__(self) -> None:
        scenarios: list[Mapping[str, str]] | None = [] if self.all_scenarios else None
        unknown = PlanVerdict.UNKNOWN
        complete = not self.all_scenarios
        self._known = PikeCheck(self.backend, unknown, None, scenarios, complete, self.seconds, plan=self.plan)

    def _result(self, status: Status, reason: str | None = None) -> PikeCheck:
        self._known.interrupted, self._known.reason = status is Status.INTERRUPTED, reason
        return self._known

    def _search(self) -> None:
        known = self._known
        for execution in self._by_oracle() if self.backend == ORACLE else self._by_knowledge():
            known.verdict = PlanVerdict.PROVED
            known.execution = known.execution or execution
            if known.scenarios is not None:
                known.scenarios.append(execution.scenario)
        known.complete = True
        if known.execution is None:
            known.verdict = PlanVerdict.REFUTED
            if self.explain is not None:
                with suppress(OutOfTimeError), self.stage("explanation"):
                    known.because = self.explain(self.assume, self.deadline.within(EXPLAINED))

    def _by_oracle(self) -> Iterator[semantics.Execution]:
        """One execution, or one of each scenario."""
        with self.stage("formula"):
            oracle = semantics.Oracle(self.plan, solver=self.solver)
        with self.stage("search"):
            if self.all_scenarios:
                yield from oracle.scenarios(self.assume, deadline=self.deadline)
                return
            answer = oracle.decide(self.assume, deadline=self.deadline)
            if answer.verdict is semantics.ExecutionExistence.UNKNOWN:
                raise OutOfTimeError
            if answer.witness is not None:
                yield answer.witness

    def _by_knowledge(self) -> Iterator[semantics.Execution]:
        """One execution, or one of each scenario."""
        compilation = self.compile()
        with self.stage("search"):
            knowledge = compilation.knowledge
            knowledge.commit([logic.Require(self.assume)], self.deadline)
            if self.all_scenarios:
                for scenario in scenarios(knowledge, self.plan.network.domains, self.deadline):
                    yield execution_in(compilation, scenario, self.deadline)
            elif knowledge.satisfiable(self.deadline):
                yield execution_in(compilation, ALWAYS, self.deadline)


def scenarios(
    knowledge: logic.KnowledgeBase,
    domains: Mapping[str, tuple[str, ...]],
    deadline: Deadline,
    environment: Guard = ALWAYS,
) -> Iterator[Guard]:
    """Every assignment to the given variables, in an environment, that some model of the knowledge base extends.

    Variable by variable, never entering an environment that could not be committed to: at most as many queries per
    scenario as there are values.

    Raises:
        OutOfTimeError: if the deadline passes first.
    """
    names = [name for name in domains if name not in dict(environment)]
    # Last in, first out: the next environment is the one with most assignments and the earliest values.
    open_environments = [(0, environment)]
    while open_environments:
        depth, environment = open_environments.pop()
        if not knowledge.could_commit([logic.Require(environment)], deadline):
            continue
        if depth == len(names):
            yield environment
            continue
        name = names[depth]
        extended = (environment | {Assignment(name, value)} for value in reversed(domains[name]))
        open_environments += ((depth + 1, each) for each in extended)


def execution_in(compilation: Compilation, environment: Guard, deadline: Deadline) -> semantics.Execution:
    """A correct execution in an environment that could be committed to, confirmed by the referee.

    Raises:
        SolverError: if there is none after all, so that the back end or the augmented plan is wrong.
        OutOfTimeError: if the deadline passes first.
    """
    knowledge, augmented = compilation.knowledge, compilation.augmented
    model = next(scenarios(knowledge, augmented.theory.domains, deadline, environment), None)
    if model is None:
        raise SolverError(f"{knowledge.name} allows an environment, but no model in it; please report this")
    times_or_conflict = labeled_apsp.schedule(augmented.network, model)
    if isinstance(times_or_conflict, frozenset):
        message = f"{compilation.backend} allows choices that have no schedule: {sorted(times_or_conflict)}"
        raise SolverError(f"{message}; please report this")
    start = min(times_or_conflict.values(), default=Fraction(0))
    plan, chosen = augmented.plan, dict(model)
    scenario = {name: chosen[name] for name in plan.network.domains}
    times = {event: when - start for event, when in times_or_conflict.items()}
    return semantics.confirmed(plan, semantics.Execution(scenario, times), compilation.backend)
