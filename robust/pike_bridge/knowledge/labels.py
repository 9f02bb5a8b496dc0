"""Labels, and how a theory becomes the labels of a network of nodes [PIKE §5.3 to §5.6, Algorithms 6 and 7].

A label is a minimal set of environments. An environment is kept by the bits of the assignments that it makes (see
:class:`AssignmentVocabulary`), and filed under its *scope*: the bits of all assignments to the variables that it
assigns. One environment entails another if the scope of the second is contained in that of the first and both agree on
it, which is a look-up in a set: subsumption costs one look-up per scope, not per environment, and conjunctions are hash
joins.

Before a theory is encoded, what follows from single assignments is put into effect. Values that cannot hold stay in the
domains and become conflicts of one assignment, so that models and prime implicants remain those of the given theory.

In the network [PIKE, Figure 14] assumptions are single assignments. A conjunction is a node with one justification,
whose antecedents are its conjuncts; a disjunction has one justification for each disjunct; the negation of an
assignment is the disjunction of the other values. Each conflict justifies a contradiction node. Equal subformulas share
a node.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from enum import Enum
from itertools import chain
from typing import TypeAlias

from robust.pike_bridge import theory as logic
from robust.pike_bridge.model import Assignment, AssignmentVocabulary, Environment, Guard, bits, union
from robust.pike_bridge.theory import Effort
from robust.smt.limits import Deadline

Scope: TypeAlias = int
"""The bits of all assignments to some variables."""
Label: TypeAlias = dict[Scope, set[Environment]]
"""A disjunction of environments by scope; none entails another, and no scope is without environments."""

BATCH = 100_000
"""Candidates that a conjunction collects before it drops those that entail others."""


def true_label() -> Label:
    """The label that holds everywhere: the empty environment."""
    return {0: {0}}


def size(label: Label) -> int:
    """How many environments a label has."""
    return sum(map(len, label.values()))


def environments(label: Label) -> Iterator[Environment]:
    """All environments of a label."""
    return chain.from_iterable(label.values())


@dataclass(frozen=True, slots=True)
class LabelConflict:
    """An environment that must not hold, with what resolves it: any other assignment to one of its variables."""

    environment: Environment
    scope: Scope
    resolutions: tuple[tuple[Scope, tuple[Environment, ...]], ...]
    """For each variable, its scope and the assignments that differ."""


def conflict_of(environment: Environment, vocabulary: AssignmentVocabulary) -> LabelConflict:
    """The conflict of an environment of a vocabulary."""
    made = environment & vocabulary.made
    fields = [vocabulary.field(variable) for variable in vocabulary.assigned(made)]
    resolutions = tuple((field, tuple(1 << at for at in bits(field & ~made))) for field in fields)
    return LabelConflict(made, sum(fields), resolutions)


def weave(first: Label, second: Label, effort: Effort) -> Label:
    """The minimal consistent conjunctions of an environment of each label (ATMS WEAVE).

    Of two labels with all prime implicants of their constraints, these are all prime implicants of the conjunction: a
    prime implicant of the conjunction contains one of each, and their union is an implicant already.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    result: Label = {}
    first_rest = _take_absorbed(first, second, result, effort)
    second_rest = _take_absorbed(second, first, result, effort)
    candidates: Label = {}
    waiting, batch = 0, BATCH
    reach = union(second_rest)
    for scope, members in first_rest.items():
        for projection, ones in _index(members, scope & reach).items():
            for other, rests in _residuals(second_rest, projection, scope, effort).items():
                target = candidates.setdefault(scope | other, set())
                before = len(target)
                for rest in rests:
                    target.update([one | rest for one in ones])
                    effort.create(len(ones))
                    effort.hold(len(target))
                waiting += len(target) - before
            if waiting > batch:
                candidates = minimal(candidates, result, effort)
                waiting = size(candidates)
                effort.hold(waiting)
                batch = waiting + BATCH
    for scope, found in minimal(candidates, result, effort).items():
        result[scope] = result.get(scope, set()) | found
    effort.hold(size(result))
    return result


def _take_absorbed(label: Label, other: Label, absorbed: Label, effort: Effort) -> Label:
    """Move environments that entail some environment of the other label; what is left."""
    remaining: Label = {}
    for scope, members in label.items():
        rest = _apart(members, scope, other.items(), effort)
        if len(rest) < len(members):
            absorbed.setdefault(scope, set()).update(members - rest)
        if rest:
            remaining[scope] = rest
    return remaining


def _apart(
    members: set[Environment], scope: Scope, known: Iterable[tuple[Scope, set[Environment]]], effort: Effort
) -> set[Environment]:
    """The environments of a scope that entail none of those that are known."""
    for smaller, others in known:
        if smaller & scope == smaller:
            if not members:
                break
            effort.pass_by(len(members))
            members = {member for member in members if member & smaller not in others}
    return members


def _residuals(label: Label, environment: Environment, scope: Scope, effort: Effort) -> Label:
    """What an environment of some scope lacks of those of a label that it is consistent with, minimally."""
    residuals: Label = {}
    for other, others in label.items():
        shared = other & scope
        part = environment & shared
        effort.pass_by(len(others))
        rests = {one ^ part for one in others if one & shared == part}
        if rests:
            missing = other ^ shared
            residuals[missing] = residuals.get(missing, set()) | rests
    return minimal(residuals, {}, effort) if len(residuals) > 1 else residuals


def _index(members: set[Environment], shared: Scope) -> dict[Environment, list[Environment]]:
    index: dict[Environment, list[Environment]] = {}
    for member in members:
        index.setdefault(member & shared, []).append(member)
    return index


def minimal(candidates: Label, base: Label, effort: Effort) -> Label:
    """The candidates that entail neither an environment of the base nor another candidate.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    kept: Label = {}
    for scope in sorted(candidates, key=int.bit_count):
        known = [item for label in (base, kept) for item in label.items() if item[0] & scope == item[0]]
        # What drops most comes first.
        known.sort(key=lambda item: -len(item[1]))
        rest = _apart(candidates[scope], scope, known, effort)
        effort.subsume(len(candidates[scope]) - len(rest))
        if rest:
            kept[scope] = rest
        effort.pass_by(len(kept))
    return kept


def split(label: Label, conflict: LabelConflict, effort: Effort) -> Label:
    """The minimal environments that entail the label and resolve the conflict [PIKE §5.6].

    New environments can entail only such as resolved the conflict before: two that did not are extended in the same
    ways, so that what was incomparable remains so.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    kept: Label = {}
    extended: Label = {}
    for scope, members in label.items():
        shared = scope & conflict.scope
        part = conflict.environment & shared
        open_ones = [member for member in members if member & shared == part]
        effort.pass_by(len(members))
        if len(open_ones) < len(members):
            kept[scope] = members.difference(open_ones) if open_ones else members
        if not open_ones:
            continue
        for chosen, resolutions in conflict.resolutions:
            if chosen & scope == 0:
                for resolution in resolutions:
                    new = [one | resolution for one in open_ones]
                    extended.setdefault(scope | chosen, set()).update(new)
                    effort.create(len(new))
    result = dict(kept)
    for scope, candidates in extended.items():
        rest = _apart(candidates, scope, kept.items(), effort)
        effort.subsume(len(candidates) - len(rest))
        if rest:
            result[scope] = result.get(scope, set()) | rest
    effort.hold(size(result))
    return result


def without_manifest(label: Label, conflict: LabelConflict, effort: Effort) -> Label:
    """The environments that do not manifest the conflict, though more specific ones may: what the ATMS keeps."""
    result: Label = {}
    for scope, members in label.items():
        rest = members
        if conflict.scope & scope == conflict.scope:
            effort.pass_by(len(members))
            rest = {member for member in members if member & conflict.scope != conflict.environment}
        if rest:
            result[scope] = rest
    return result


def insert(label: Label, environment: Environment, scope: Scope) -> bool:
    """Add an environment minimally; False if it entails one that is there already."""
    for smaller, known in label.items():
        if smaller & scope == smaller and environment & smaller in known:
            return False
    for larger in [other for other in label if other & scope == scope]:
        rest = {member for member in label[larger] if member & scope != environment}
        if rest:
            label[larger] = rest
        else:
            del label[larger]
    label.setdefault(scope, set()).add(environment)
    return True


def add_minimally(label: Label, new: Label, effort: Effort) -> Label:
    """Add environments to a label minimally; those that were added and stayed."""
    added: Label = {}
    for scope, members in new.items():
        for member in members:
            effort.pass_by(1 + len(label))
            if insert(label, member, scope):
                insert(added, member, scope)
            else:
                effort.subsume(1)
    return added


def add_and_generate_prime_implicants(label: Label, new: Label, fields: Iterable[Scope], effort: Effort) -> Label:
    """Add environments to a label, and all consensuses [PIKE, Algorithm 7]; what was added and is still needed.

    Args:
        fields: the scope of each variable.

    Raises:
        OutOfTimeError: if the deadline passes; the label is not to be used after that.
    """
    known_fields = tuple(fields)
    added = add_minimally(label, new, effort)
    queue = deque(field for field in known_fields if field & union(added))
    while queue:
        field = queue.popleft()
        generated = add_minimally(label, consensus(label, field, effort), effort)
        add_minimally(added, generated, effort)
        touched = union(generated)
        queue.extend(each for each in known_fields if each & touched and each not in queue)
    return added


def consensus(label: Label, field: Scope, effort: Effort) -> Label:
    """The conjunctions of one environment for each value of a variable, with the variable removed [PIKE §5.6]."""
    result = true_label()
    for at in bits(field):
        satellites = _satellites(label, field, 1 << at)
        if not satellites:
            return {}
        result = weave(result, satellites, effort)
    return result


def _satellites(label: Label, field: Scope, assignment: Environment) -> Label:
    """The environments that make an assignment, without it: none entails another, because all made it."""
    satellites: Label = {}
    for scope, members in label.items():
        if scope & field:
            stripped = {member ^ assignment for member in members if member & assignment}
            if stripped:
                satellites[scope ^ field] = stripped
    return satellites


def consistent_with(label: Label, environment: Environment, scope: Scope) -> Iterator[tuple[Environment, Scope]]:
    """The environments of a label that do not contradict an environment of the given scope, with their scopes."""
    for each, members in label.items():
        shared = each & scope
        part = environment & shared
        if not shared:
            yield from ((member, each) for member in members)
        elif shared == each:
            if part in members:
                yield part, each
        else:
            yield from ((member, each) for member in members if member & shared == part)


def simplify(theory: logic.Theory, deadline: Deadline) -> logic.Theory:
    """An equivalent theory over the same domains, by unit propagation to a fixed point.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    reduction = _Reduction({variable: set(values) for variable, values in theory.domains.items()})
    possible = reduction.possible
    constraints: list[logic.Formula] = list(theory.constraints)
    conflicts = [each for each in dict.fromkeys(theory.conflicts) if logic.is_consistent(each)]
    before = -1
    while before != (count := sum(map(len, possible.values()))):
        before = count
        deadline.enforce()
        constraints = list(_top_level(logic.normal_form(constraint, reduction.literal) for constraint in constraints))
        conflicts = list(reduction.conflicts(conflicts))
        constraints = reduction.learn(constraints, conflicts)
        if not all(possible.values()) or logic.FALSE in constraints or frozenset() in conflicts:
            return logic.Theory(theory.domains, (logic.FALSE,))
    removed = [
        frozenset({Assignment(variable, value)})
        for variable, values in theory.domains.items()
        for value in values
        if value not in possible[variable]
    ]
    return logic.Theory(theory.domains, tuple(constraints), (*removed, *dict.fromkeys(conflicts)))


@dataclass(slots=True)
class _Reduction:
    possible: dict[str, set[str]]

    def conflicts(self, conflicts: Iterable[Guard]) -> Iterator[Guard]:
        """The conflicts that are not resolved, without assignments that hold anyway."""
        for environment in conflicts:
            if all(value in self.possible[variable] for variable, value in environment):
                yield frozenset(assignment for assignment in environment if len(self.possible[assignment.variable]) > 1)

    def learn(self, constraints: Iterable[logic.Formula], conflicts: Iterable[Guard]) -> list[logic.Formula]:
        """Remove the values that a single constraint or conflict excludes; the constraints that say more than that."""
        for environment in conflicts:
            if len(environment) == 1:
                ((variable, value),) = environment
                self.possible[variable].discard(value)
        return [constraint for constraint in constraints if not self._restricts(constraint)]

    def _restricts(self, constraint: logic.Formula) -> bool:
        """If a constraint is about one variable alone, as a disjunction of literals, only those values are left."""
        literals = constraint.operands if isinstance(constraint, logic.Some) else (constraint,)
        allowed: set[str] = set()
        variable: str | None = None
        for literal in literals:
            match literal:
                case logic.Is(assignment):
                    values = {assignment.value}
                case logic.Not(logic.Is(assignment)):
                    values = self.possible[assignment.variable] - {assignment.value}
                case _:
                    return False
            if variable not in {None, assignment.variable}:
                return False
            variable = assignment.variable
            allowed |= values
        if variable is None:
            return False
        self.possible[variable] &= allowed
        return True

    def literal(self, assignment: Assignment, positive: bool) -> logic.Formula:
        """What is known of an assignment or its negation."""
        values = self.possible[assignment.variable]
        if assignment.value not in values:
            return logic.FALSE if positive else logic.TRUE
        if len(values) == 1:
            return logic.TRUE if positive else logic.FALSE
        return logic.Is(assignment) if positive else logic.Not(logic.Is(assignment))


def _top_level(constraints: Iterable[logic.Formula]) -> Iterator[logic.Formula]:
    for constraint in constraints:
        yield from constraint.operands if isinstance(constraint, logic.All) else (constraint,)


class NodeKind(Enum):
    """What a node stands for."""

    ASSUMPTION = "assumption"
    DERIVED = "derived"
    CONTRADICTION = "contradiction"


@dataclass(frozen=True, slots=True)
class Node:
    """A proposition: that its formula holds. For a contradiction, the formula is what is contradictory."""

    index: int
    kind: NodeKind
    formula: logic.Formula


@dataclass(slots=True)
class JustificationNetwork:
    """Nodes, each after its antecedents, and their justifications."""

    theory: logic.Theory
    nodes: list[Node] = field(default_factory=list)
    justifications: list[list[tuple[int, ...]]] = field(default_factory=list)
    """By node: the antecedents of each; their conjunction implies the node."""
    constraints: list[int] = field(default_factory=list)
    """The nodes of the theory's constraints, each once."""
    _known: dict[tuple[type[logic.All | logic.Some], frozenset[int]], int] = field(default_factory=dict)
    _assumptions: dict[Assignment, int] = field(default_factory=dict)

    def assumption(self, assignment: Assignment) -> int:
        """The node of an assignment."""
        if assignment not in self._assumptions:
            self._assumptions[assignment] = self._node(NodeKind.ASSUMPTION, logic.Is(assignment))
        return self._assumptions[assignment]

    def encode(self, formula: logic.Formula) -> int:
        """The node of a formula, which holds if and only if the formula does."""
        normal = logic.normal_form(formula, self._literal)
        return logic.interpret(normal, self.assumption, self._negated, self._conjoined, self._disjoined)

    def contradict(self, conflict: Guard) -> int:
        """A new contradiction node, justified by the conflict's assignments."""
        antecedents = tuple(self.assumption(assignment) for assignment in sorted(conflict))
        return self._node(NodeKind.CONTRADICTION, logic.conjunction(conflict), antecedents)

    def _literal(self, assignment: Assignment, positive: bool) -> logic.Formula:
        if positive:
            return logic.Is(assignment)
        variable, excluded = assignment
        others = [logic.Is(Assignment(variable, value)) for value in self.theory.domains[variable] if value != excluded]
        return others[0] if len(others) == 1 else logic.Some(tuple(others))

    def _negated(self, node: int) -> int:
        raise ValueError(f"negation in normal form: of {self.nodes[node].formula}")

    def _conjoined(self, parts: list[int]) -> int:
        return self._junction(logic.All, parts, [tuple(dict.fromkeys(parts))])

    def _disjoined(self, parts: list[int]) -> int:
        return self._junction(logic.Some, parts, [(part,) for part in dict.fromkeys(parts)])

    def _junction(self, kind: type[logic.All | logic.Some], parts: list[int], tails: list[tuple[int, ...]]) -> int:
        key = (kind, frozenset(parts))
        if len(key[1]) == 1:
            return parts[0]
        if key not in self._known:
            formula = kind(tuple(self.nodes[part].formula for part in parts))
            self._known[key] = self._node(NodeKind.DERIVED, formula, *tails)
        return self._known[key]

    def _node(self, kind: NodeKind, formula: logic.Formula, *justifications: tuple[int, ...]) -> int:
        self.nodes.append(Node(len(self.nodes), kind, formula))
        self.justifications.append(list(justifications))
        return len(self.nodes) - 1


def encode(theory: logic.Theory) -> JustificationNetwork:
    """The nodes of a theory's constraints, and contradiction nodes of its conflicts.

    Conflicts that assign two values to a variable never hold, and get no node.
    """
    network = JustificationNetwork(theory)
    network.constraints = list(dict.fromkeys(network.encode(constraint) for constraint in theory.constraints))
    for forbidden in dict.fromkeys(theory.conflicts):
        if logic.is_consistent(forbidden):
            network.contradict(forbidden)
    return network


Resolve: TypeAlias = Callable[[Label, LabelConflict, Effort], Label]
"""What a conflict does to a label: :func:`split` for the πTMS, :func:`without_manifest` for the ATMS."""


class TruthMaintenance:
    """Labels of the nodes of one network.

    Args:
        consensus: whether labels are closed under consensus (πTMS) or only minimal (ATMS).
        resolve: what conflicts do to labels.
    """

    def __init__(
        self, network: JustificationNetwork, vocabulary: AssignmentVocabulary, *, consensus: bool, resolve: Resolve
    ) -> None:
        self.network = network
        self.vocabulary = vocabulary
        self.nogoods: Label = {}
        """The minimal environments that hold no more, as the label of falsity."""
        self._consensus = consensus
        self._resolve = resolve
        self._fields = tuple(vocabulary.field(variable) for variable in vocabulary.variables)
        self.labels: list[Label] = []
        """Of the nodes, as their justifications give them, before conflicts are resolved."""

    def run(self, effort: Effort) -> None:
        """Propagate from assumptions, and from what needs none, to all nodes.

        Raises:
            OutOfTimeError: if the deadline passes; labels are incomplete then.
        """
        self.labels = [{} for _ in self.network.nodes]
        for node, justifications in zip(self.network.nodes, self.network.justifications, strict=True):
            effort.deadline.enforce()
            if node.kind is NodeKind.ASSUMPTION:
                self._update(node.index, self._assumed(node.index), effort)
            for antecedents in justifications:
                self._update(node.index, self._conjoined(antecedents, effort), effort)

    def label(self, node: int, effort: Effort) -> Label:
        """The label of a node: all prime implicants of its formula and all conflicts [PIKE, Invariant 5.2].

        Without consensus, minimal environments that manifest no conflict.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        label = self.labels[node]
        for conflict in self.conflicts():
            label = self._resolve(label, conflict, effort)
        return label

    def conflicts(self) -> list[LabelConflict]:
        """The nogoods."""
        return [conflict_of(environment, self.vocabulary) for environment in environments(self.nogoods)]

    def _assumed(self, node: int) -> Label:
        """The environment of the assignment; the empty one if the variable has no other value."""
        ((variable, value),) = logic.assignments_of(self.network.nodes[node].formula)
        if len(self.vocabulary.domains[variable]) == 1:
            return true_label()
        return {self.vocabulary.field(variable): {self.vocabulary.assign(variable, value) & self.vocabulary.made}}

    def _conjoined(self, antecedents: tuple[int, ...], effort: Effort) -> Label:
        """The label of a conjunction of nodes, from the last one, which is the most specific."""
        last = max(antecedents, default=None)
        result = true_label() if last is None else self.labels[last]
        for antecedent in antecedents:
            if antecedent != last and result:
                result = weave(result, self.labels[antecedent], effort)
        return result

    def _update(self, node: int, new: Label, effort: Effort) -> None:
        """UPDATE [PIKE, Algorithm 6]; nodes come after their antecedents, so that each label is propagated once."""
        if not new:
            return
        effort.statistics.propagations += 1
        label = self.labels[node]
        if self._consensus and len(self.network.justifications[node]) > 1:
            mentioned = union(label) | union(new)
            fields = [field for field in self._fields if field & mentioned]
            add_and_generate_prime_implicants(label, new, fields, effort)
        else:
            add_minimally(label, new, effort)
        if self.network.nodes[node].kind is NodeKind.CONTRADICTION:
            for scope, members in new.items():
                for environment in members:
                    insert(self.nogoods, environment, scope)
