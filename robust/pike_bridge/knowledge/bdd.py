"""A theory as one binary decision diagram: its order of variables, its prime implicants, and what is asked of it."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import reduce
from operator import and_, invert, methodcaller, or_
from typing import Any, TypeAlias

from robust.errors import from_extra
from robust.pike_bridge import model
from robust.pike_bridge import theory as logic
from robust.pike_bridge.knowledge.goal import NOTHING, UNIT, Families, count_models
from robust.pike_bridge.theory import Formula, Theory, assignments_of, interpret, is_consistent, race
from robust.smt.limits import NEVER, Deadline

LARGEST_DIAGRAM = 5_000_000
"""Nodes; conjunction with one more constraint of this size takes seconds, which no deadline can cut short."""
GLANCE = 32
"""Conflicts of a question between two looks at the number of nodes, which takes longer than most conjunctions."""

Node: TypeAlias = Any
"""A function in `dd`, which has no types."""
_Item: TypeAlias = tuple[Collection[str], int, "Callable[[BinaryDiagrams], Node]"]
"""The variables of a constraint, of a conflict or of digits that must be a value, its rank among equals, and how its
diagram is made."""


def create_manager() -> Any:
    """A manager of decision diagrams without dynamic reordering, which may take longer than any deadline."""
    try:
        from dd import cudd as module  # noqa: PLC0415 - a binding that is not built everywhere
    except ImportError:
        try:
            from dd import autoref as module  # noqa: PLC0415
        except ModuleNotFoundError as error:
            raise from_extra(error) or error from error
    manager = module.BDD()
    manager.configure(reordering=False)
    return manager


class BinaryDiagrams:
    """Diagrams of formulas about finite-domain variables, whose values are numbered in binary."""

    def __init__(self, domains: Mapping[str, tuple[str, ...]], order: Sequence[str]) -> None:
        self.manager = create_manager()
        self.order = tuple(order)
        self._domains = domains
        self.digits: dict[str, tuple[str, ...]] = {}
        """The binary variables of each variable; none if it has only one value."""
        self._values: dict[model.Assignment, Node] = {}
        self._places: dict[str, int] = {}
        position = 0
        for place, variable in enumerate(order):
            count = (len(domains[variable]) - 1).bit_length()
            self.digits[variable] = tuple(f"b{position + at}" for at in range(count))
            self._places |= dict.fromkeys(self.digits[variable], place)
            position += count
            self.manager.declare(*self.digits[variable])
            for number, value in enumerate(domains[variable]):
                self._values[model.Assignment(variable, value)] = self.manager.cube(self._code(variable, number))

    def valid(self, variable: str) -> Node:
        """The formula that the digits are the number of some value."""
        values = (self._values[model.Assignment(variable, value)] for value in self._domains[variable])
        return reduce(or_, values, self.manager.false)

    def environment(self, assignments: Iterable[model.Assignment]) -> Node:
        """The conjunction of assignments."""
        return reduce(and_, map(self._values.__getitem__, assignments), self.manager.true)

    def excluded(self, conflict: model.Guard) -> Node:
        """The formula that not all assignments of a conflict hold."""
        return ~self.environment(conflict)

    def formula(self, formula: Formula) -> Node:
        """The diagram of a formula."""
        return interpret(
            formula,
            self._values.__getitem__,
            invert,
            lambda parts: reduce(and_, parts, self.manager.true),
            lambda parts: reduce(or_, parts, self.manager.false),
        )

    def cofactors(self, node: Node, place: int) -> list[Node]:
        """What is left of a diagram for each value of the variable at that place of the order."""
        variable = self.order[place]
        if not self.digits[variable]:
            return [node]
        numbers = range(len(self._domains[variable]))
        return [self._child(node, self._code(variable, number)) for number in numbers]

    def _child(self, node: Node, code: Mapping[str, bool]) -> Node:
        """What is left of a diagram for one value of its first variable: nodes are followed, none is made."""
        while node.var in code:
            # Edges to where the digit is 0 may be complemented, and so may the one that led here.
            child = node.high if code[node.var] else node.low
            node = ~child if node.negated else child
        return node

    def depth(self, node: Node) -> int:
        """The place of the first variable that a diagram depends on; after all of them for constants."""
        return len(self.order) if node in (self.manager.true, self.manager.false) else self._places[node.var]

    def _code(self, variable: str, number: int) -> dict[str, bool]:
        return {digit: bool(number >> at & 1) for at, digit in enumerate(self.digits[variable])}

    def primes(self, root: Node, families: Families, deadline: Deadline) -> int:
        """The prime implicants of a diagram, as one of the families.

        Raises:
            OutOfTimeError: if the deadline passes.
        """

        def split(node: Node) -> tuple[int, list[Node], Node]:
            parts = self.cofactors(node, self.depth(node))
            return self.depth(node), parts, reduce(and_, parts)

        return families.primes(root, {self.manager.false: NOTHING, self.manager.true: UNIT}, split, deadline)


class BddKnowledgeBase(logic.KnowledgeBase):
    """One decision diagram, into which constraints are conjoined one at a time; questions conjoin a few more.

    Args:
        theory: what is compiled.
        deadline: for compiling; looked at between constraints.
        statistics: counters to add to.
        largest_diagram: the number of nodes that the manager may hold.

    Raises:
        InputError: if the theory mentions an unknown variable or value, or a variable without values.
        OutOfTimeError: if the deadline passes, or the diagram gets too large.
    """

    name = "bdd"

    def __init__(
        self,
        theory: Theory,
        *,
        deadline: Deadline = NEVER,
        statistics: logic.KnowledgeStatistics | None = None,
        largest_diagram: int = LARGEST_DIAGRAM,
    ) -> None:
        super().__init__(theory, statistics)
        self._largest_diagram = largest_diagram
        with self._compiling(deadline):
            self._root = self._compile(deadline)

    def _narrow(self, asked: logic.Narrowing, deadline: Deadline) -> None:
        self._root = self._narrowed(asked, deadline)
        self.statistics.sizes["diagram nodes"] = len(self._root)

    def _possible(self, asked: logic.Narrowing, deadline: Deadline) -> bool:
        return bool(self._narrowed(asked, deadline) != self._diagrams.manager.false)

    def _count(self, deadline: Deadline) -> int:
        """Exact: CUDD's own count is a floating-point number."""
        diagrams = self._diagrams
        return count_models(
            self._root,
            {diagrams.manager.false: 0, diagrams.manager.true: 1},
            diagrams.depth,
            lambda node: diagrams.cofactors(node, diagrams.depth(node)),
            sizes=[len(self.theory.domains[variable]) for variable in diagrams.order],
            deadline=deadline,
        )

    def implicant_count(self, deadline: Deadline = NEVER) -> int:
        """How many prime implicants what is left of the theory has, computed without listing them.

        Raises:
            OutOfTimeError: if the deadline passes.
        """
        families, implicants = self._primes(deadline)
        return families.count(implicants, deadline)

    def prime_implicants(self, deadline: Deadline = NEVER) -> Iterator[model.Guard]:
        """Every prime implicant of what is left of the theory, once; there may be very many.

        Raises:
            OutOfTimeError: if the deadline passes before they are found.
        """
        families, implicants = self._primes(deadline)
        order, domains = self._diagrams.order, self.theory.domains
        for environment in families.environments([implicants]):
            yield frozenset(model.Assignment(order[at], domains[order[at]][number]) for at, number in environment)

    def _primes(self, deadline: Deadline) -> tuple[Families, int]:
        deadline.enforce()
        families = Families()
        implicants = self._diagrams.primes(self._root, families, deadline)
        self.statistics.sizes["implicant diagram nodes"] = len(families)
        return families, implicants

    def _compile(self, deadline: Deadline) -> Node:
        parts: list[_Item] = [
            ({one.variable for one in assignments_of(constraint)}, 2, methodcaller("formula", constraint))
            for constraint in self.theory.constraints
        ]
        conflicts = [each for each in dict.fromkeys(self.theory.conflicts) if is_consistent(each)]
        parts += [({one.variable for one in conflict}, 1, methodcaller("excluded", conflict)) for conflict in conflicts]
        domains: list[_Item] = [({variable}, 0, methodcaller("valid", variable)) for variable in self.theory.domains]

        def conjoined(order: Sequence[str], space: int) -> Node:
            """From the last variables to the first, so that what is built already stays as it is below what is new."""
            self._diagrams = BinaryDiagrams(self.theory.domains, order)
            place = {variable: at for at, variable in enumerate(order)}
            root = self._diagrams.manager.true

            def turn(item: _Item) -> tuple[int, int]:
                return -min((place[variable] for variable in item[0]), default=len(place)), item[1]

            for _, _, diagram in sorted([*parts, *domains], key=turn):
                root &= diagram(self._diagrams)
                self._look(deadline, space)
                self.statistics.sizes["diagram nodes"] = len(root)
            return root

        groups = [variables for variables, _, _ in parts]
        return race(tuple(self.theory.domains), groups, self._largest_diagram, conjoined)

    def _narrowed(self, asked: logic.Narrowing, deadline: Deadline) -> Node:
        if not asked.consistent:
            return self._diagrams.manager.false
        root = self._root & self._diagrams.environment(model.Assignment(*item) for item in asked.required.items())
        for number, conflict in enumerate(asked.conflicts):
            deadline.enforce()
            if number % GLANCE == GLANCE - 1:
                self._look(deadline, self._largest_diagram)
            root &= self._diagrams.excluded(conflict)
        return root

    def _look(self, deadline: Deadline, space: int) -> None:
        deadline.enforce()
        if len(self._diagrams.manager) > space:
            raise logic.OutOfSpaceError
