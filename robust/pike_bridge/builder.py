"""Plans with choices written as programs: sequences, parallel branches, choices and activities::

    coffee = sequence(act("(make-coffee human)", 3, 5, agent="human"), act("(pour-coffee human)", 1, 2, agent="human"))
    plan = build("breakfast", within(sequence(choose("drink", {"coffee": coffee, "juice": juice}), serve), upper=7))

Every element becomes a pair of events; consecutive ones are [ε, ∞] apart, as in [PIKE, Figure 1].
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import pairwise
from math import prod
from random import Random
from typing import NamedTuple, TypeAlias, assert_never

from robust.errors import InputError, Location
from robust.numbers import Number, exact, plural, shorten
from robust.pike_bridge import action_model, model
from robust.plan.pddl.write import ActionText, sketched_domain, sketched_problem

LOWER, UPPER, PROBABILITY = Location("lower"), Location("upper"), Location("probability")
"""What errors about arguments name."""


@dataclass(frozen=True, slots=True)
class Act:
    action: str
    lower: Fraction
    upper: Fraction | None
    agent: str | None


@dataclass(frozen=True, slots=True)
class InSequence:
    elements: tuple[Element, ...]


@dataclass(frozen=True, slots=True)
class InParallel:
    elements: tuple[Element, ...]


@dataclass(frozen=True, slots=True)
class Choose:
    name: str
    branches: tuple[tuple[str, Element], ...]
    controllable: bool
    probability: tuple[model.Likelihood, ...] = ()


@dataclass(frozen=True, slots=True)
class Within:
    element: Element
    lower: Fraction | None
    upper: Fraction | None


Element: TypeAlias = Act | InSequence | InParallel | Choose | Within


def act(action: str, lower: Number, upper: Number | None, *, agent: str | None = None) -> Act:
    """An activity: a ground PDDL action that takes some time [PIKE, Definition 2.2].

    Args:
        action: `(name arguments ...)`.
        lower: the least time that it takes, in the plan's unit.
        upper: the greatest; None: as long as it likes.
        agent: who does it, such as `human`; None: nobody in particular.

    Returns:
        An element of a program, for :func:`build`.

    Raises:
        InputError: if `action` is no ground action, or a bound is no number.
    """
    ground = model.as_ground_action(action) if isinstance(action, str) else None
    if ground is None:
        raise InputError(f"found {shorten(str(action))}, expected {model.PROPER_ACTION}", Location("action"))
    return Act(ground, exact(lower, LOWER), _bound(upper, UPPER), agent)


def sequence(*elements: Element) -> InSequence:
    """One after the other; without elements, nothing but a moment.

    Args:
        elements: what :func:`act`, :func:`sequence`, :func:`parallel`, :func:`choose` and :func:`within` return.

    Returns:
        An element, in which each begins at least `epsilon` of :func:`build` after the one before has ended.

    Raises:
        InputError: if something is no element.
    """
    return InSequence(_elements(elements))


def parallel(*elements: Element) -> InParallel:
    """All at the same time, in any order.

    Args:
        elements: as of :func:`sequence`.

    Returns:
        An element that ends when the last of them has ended.

    Raises:
        InputError: if something is no element.
    """
    return InParallel(_elements(elements))


def choose(
    name: str,
    branches: Mapping[str, Element],
    *,
    controllable: bool = True,
    probability: Mapping[str, Number] | None = None,
) -> Choose:
    """Exactly one of the branches, by the value of a choice variable that is decided when the element starts.

    Args:
        name: the variable.
        branches: for each of its values the element that is carried out.
        controllable: whether the executive decides, and not people or nature.
        probability: how likely each value is, of a choice that is not controllable.

    Returns:
        An element, for :func:`build`.

    Raises:
        InputError: if a name, a branch or a probability is none.
    """
    if not isinstance(branches, Mapping):
        raise InputError(f"found {shorten(repr(branches))}, expected an element for each value", Location("branches"))
    for text in (name, *branches):
        _named(text, Location(f"choice {name!r}"))
    shares = {} if probability is None else {value: exact(share, PROBABILITY) for value, share in probability.items()}
    table = (model.Likelihood(tuple(shares.items())),) if shares else ()
    return Choose(name, tuple(zip(branches, _elements(branches.values()), strict=True)), controllable, table)


def within(element: Element, *, lower: Number | None = None, upper: Number | None = None) -> Within:
    """The element, with bounds on the time from its start to its end.

    Args:
        element: as of :func:`sequence`.
        lower: the least time, in the plan's unit; None: any.
        upper: the greatest; None: any.

    Returns:
        An element, for :func:`build`.

    Raises:
        InputError: if `element` is none, or a bound is no number.
    """
    _elements([element])
    return Within(element, _bound(lower, LOWER), _bound(upper, UPPER))


def _bound(bound: Number | None, place: Location) -> Fraction | None:
    return None if bound is None else exact(bound, place)


def _named(text: object, place: Location) -> None:
    """InputError unless it is a name."""
    if not isinstance(text, str) or not model.is_name(text):
        raise InputError(f"found {shorten(repr(text))}, expected {model.PROPER_NAME}", place)


def _elements(given: Iterable[Element]) -> tuple[Element, ...]:
    """What is found, all of which are elements."""
    elements = tuple(given)
    for element in elements:
        if not isinstance(element, Element):
            raise InputError(
                f"found {shorten(repr(element))}, expected act, sequence, parallel, choose or within of them"
            )
    return elements


def build(name: str, element: Element, *, epsilon: Number = model.EPSILON) -> model.Tpnu:
    """The network of a program.

    Args:
        name: what the plan is called.
        element: the whole program.
        epsilon: how long after what comes before it an element begins, at least, in the plan's unit of time.

    Returns:
        A plan as [PIKE, Definitions 2.1 to 2.4] describe it, with events for the start and the end of each element.

    Raises:
        InputError: if two choices have the same name, a choice has no branch, or something is no element.
    """
    _named(name, Location("name"))
    separation = exact(epsilon, Location("epsilon"))
    if separation < 0:
        raise InputError(f"found {shorten(str(epsilon))}, expected a number of at least 0", Location("epsilon"))
    network = _NetworkBuilder(separation)
    [whole] = _elements([element])
    network.add(whole, model.ALWAYS)
    return model.Tpnu(
        name=name,
        choices=tuple(network.choices.values()),
        events=tuple(network.events),
        constraints=tuple(network.constraints),
        activities=tuple(network.activities),
    )


@dataclass(slots=True)
class _NetworkBuilder:
    epsilon: Fraction
    choices: dict[str, model.Choice] = field(default_factory=dict)
    events: list[model.Event] = field(default_factory=list)
    constraints: list[model.Constraint] = field(default_factory=list)
    activities: list[model.Activity] = field(default_factory=list)

    def add(self, element: Element, guard: model.Guard) -> tuple[str, str]:
        """Add an element; the events at which it starts and ends."""
        match element:
            case Act(action, lower, upper, agent):
                start, end = self._event(guard), self._event(guard)
                self.activities.append(model.Activity(action, start, end, lower, upper, agent, guard))
            case InSequence(elements):
                return self._sequence(elements, guard)
            case InParallel(elements):
                start, end = self._around([(branch, guard) for branch in elements], guard)
            case Choose():
                start, end = self._choice(element, guard)
            case Within(inner, lower_bound, upper_bound):
                start, end = self.add(inner, guard)
                self.constraints.append(model.Constraint(start, end, lower_bound, upper_bound, guard))
            case _:
                assert_never(element)
        return start, end

    def _sequence(self, elements: Iterable[Element], guard: model.Guard) -> tuple[str, str]:
        ends = [self.add(element, guard) for element in elements]
        if not ends:
            moment = self._event(guard)
            return moment, moment
        for (_, before), (after, _) in pairwise(ends):
            self._link(before, after, guard)
        return ends[0][0], ends[-1][1]

    def _choice(self, choice: Choose, guard: model.Guard) -> tuple[str, str]:
        name, branches = choice.name, choice.branches
        if name in self.choices:
            raise InputError(f"choice {name!r} is made twice; expected each choice once")
        if not branches:
            raise InputError(f"choice {name!r} has no branches; expected at least one")
        event = f"e{len(self.events) + 1}"
        domain = tuple(value for value, _ in branches)
        self.choices[name] = model.Choice(name, domain, choice.controllable, event, choice.probability)
        return self._around([(branch, guard | {model.Assignment(name, value)}) for value, branch in branches], guard)

    def _around(self, branches: list[tuple[Element, model.Guard]], guard: model.Guard) -> tuple[str, str]:
        start = self._event(guard)
        inner = [(self.add(branch, branch_guard), branch_guard) for branch, branch_guard in branches]
        end = self._event(guard)
        for (first, last), branch_guard in inner:
            self._link(start, first, branch_guard)
            self._link(last, end, branch_guard)
        # Implied by each branch; said outright, it spares temporal reasoning a distinction of cases.
        self._link(start, end, guard)
        return start, end

    def _event(self, guard: model.Guard) -> str:
        self.events.append(model.Event(f"e{len(self.events) + 1}", guard))
        return self.events[-1].name

    def _link(self, before: str, after: str, guard: model.Guard) -> None:
        self.constraints.append(model.Constraint(before, after, self.epsilon, None, guard))


# -- plans of k intents [PIKE §6.2.1, Figure 16] -----------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class KIntents:
    """A plan with N_i options for the i-th pair of choices: a human chooses, and a robot must choose the same."""

    structure: tuple[int, ...]
    instance: action_model.Instance

    @property
    def intents(self) -> int:
        """k: the number of intent scenarios."""
        return prod(self.structure)

    @property
    def recovery(self) -> dict[str, Fraction]:
        """How long it takes to undo each action that was begun by mistake: half of its least duration."""
        return {activity.action: activity.lower / 2 for activity in self.instance.network.activities}


def k_intents(structure: Sequence[int], seed: int = 0) -> KIntents:
    """The problem of a structure; the seed decides the durations [1 + w, 2 + w], 0 ≤ w ≤ 1/2, one w for each pair.

    Args:
        structure: how many options each pair of choices has.
        seed: of the durations.

    Returns:
        Alternating choices of a human and the robot, of the domain of [PIKE, §6.2.1].

    Raises:
        InputError: if the structure is empty or has an entry below 1.
    """
    if not structure or min(structure) < 1:
        raise InputError(f"the structure is {list(structure)}; expected numbers of at least 1")
    random = Random(f"{seed}/{list(structure)}")  # noqa: S311 - reproducible
    steps: list[Element] = []
    actions: list[ActionText] = []
    predicates: list[str] = []
    for place, count in enumerate(structure, 1):
        options = range(1, count + 1)
        lower = 1 + Fraction(random.randint(0, 500), 1000)
        upper = lower + 1
        human = {str(j): act(f"(h-{place}-{j})", lower, upper, agent="human") for j in options}
        robot = {str(j): act(f"(r-{place}-{j})", lower, upper, agent="robot") for j in options}
        steps += [choose(f"y{place}", human, controllable=False), choose(f"x{place}", robot)]
        for j in options:
            atom = f"(p-{place}-{j})"
            predicates.append(atom)
            actions += [
                ActionText(f"h-{place}-{j}", end_effects=(atom,)),
                ActionText(f"r-{place}-{j}", at_start=(atom,)),
            ]
    name = "k-intents-" + "-".join(map(str, structure))
    instance = action_model.Instance(
        build(name, sequence(*steps)), sketched_domain(name, predicates, actions), sketched_problem(name, name, (), ())
    )
    return KIntents(tuple(structure), instance)


# -- satisfiability as plans [PIKE, Appendix B, Figure 22] -------------------------------------------------------------


class ClauseFormula(NamedTuple):
    """A formula in conjunctive normal form, as in DIMACS files: variables are 1, 2, ..., and `-3` is not the third."""

    variables: int
    clauses: tuple[tuple[int, ...], ...]


def read_dimacs(text: str, file: str) -> ClauseFormula:
    """The formula of a DIMACS file: a line `p cnf VARIABLES CLAUSES`, then clauses, each ended by 0.

    Raises:
        InputError: with the line, for anything else.
    """
    variables, wanted = -1, -1
    clauses: list[tuple[int, ...]] = []
    clause: list[int] = []
    for line, words in enumerate(map(str.split, text.splitlines()), start=1):
        place = Location(file, line)
        if not words or words[0].startswith("c"):
            continue
        if words[0].startswith("%"):
            break  # what some collections end their files with
        if variables < 0:
            if words[:2] != ["p", "cnf"] or len(words) != 4 or not all(word.isdecimal() for word in words[2:]):
                raise InputError(f"found {shorten(' '.join(words))}, expected 'p cnf VARIABLES CLAUSES'", place)
            variables, wanted = map(int, words[2:])
            continue
        for word in words:
            if not word.removeprefix("-").isdecimal() or int(word.removeprefix("-")) > variables:
                expected = f"0, or a variable up to {variables}, with - for its negation"
                raise InputError(f"found {shorten(word)}, expected {expected}", place)
            if int(word):
                clause.append(int(word))
            else:
                clauses.append(tuple(clause))
                clause = []
    if variables < 0 or clause or len(clauses) != wanted:
        expected = "'p cnf VARIABLES CLAUSES'" if variables < 0 else f"{plural(wanted, 'clause')}, each ended by 0"
        found = f"{plural(len(clauses), 'clause')}{' and one that does not end' if clause else ''}"
        raise InputError(f"found {found}, expected {expected}", Location(file))
    return ClauseFormula(variables, tuple(clauses))


def random_clauses(variables: int, clauses: int, seed: int = 0) -> ClauseFormula:
    """Clauses of three different variables each, as far as there are so many, any of which may be negated."""
    random = Random(f"{seed}/{variables}/{clauses}")  # noqa: S311 - reproducible
    names = range(1, variables + 1)
    drawn = (random.sample(names, min(3, variables)) for _ in range(clauses))
    return ClauseFormula(variables, tuple(tuple(random.choice((1, -1)) * name for name in sorted(c)) for c in drawn))


def satisfiability(formula: ClauseFormula, name: str = "sat") -> action_model.Instance:
    """A plan whose correct team scenarios are the models of a formula [PIKE, Appendix B, Figure 22].

    A choice for each variable, in parallel, then an activity for each clause, which needs that one of its literals was
    assigned. All bounds are orderings, [ε, ∞].
    """
    choices, actions = [], []
    holds = {number: f"(clause-holds-{number})" for number in range(1, len(formula.clauses) + 1)}
    shown: dict[int, list[str]] = {}
    for number, clause in enumerate(formula.clauses, start=1):
        for literal in dict.fromkeys(clause):
            shown.setdefault(literal, []).append(holds[number])
    for variable in range(1, formula.variables + 1):
        names = {variable: f"assign-{variable}", -variable: f"assign-not-{variable}"}
        assign, assign_not = (act(f"({action})", model.EPSILON, None) for action in names.values())
        choices.append(choose(f"v{variable}", {"true": assign, "false": assign_not}))
        actions += [ActionText(names[each], end_effects=tuple(shown.get(each, ()))) for each in names]
    clauses = [act(f"(clause-{number})", model.EPSILON, None) for number in holds]
    actions += [ActionText(f"clause-{number}", at_start=(atom,)) for number, atom in holds.items()]
    program = sequence(*(parallel(*part) for part in (choices, clauses) if part))
    domain = sketched_domain(name, list(holds.values()), actions)
    return action_model.Instance(build(name, program), domain, sketched_problem(name, name, (), ()))
