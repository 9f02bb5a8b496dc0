"""Quantifier elimination by virtual substitution [Loos and Weispfenning 1993].

∃x. φ is the disjunction of φ at −∞, at every value that a non-strict lower bound of x gives, and infinitesimally above
every value that a strict one gives (or all of that upside down, whichever has fewer cases). No disjunctive normal form
of φ is needed. What keeps the results small:

- Quantifiers move inwards as far as they can: over disjunctions, and to the conjuncts that share quantified symbols. A
  disjunction is multiplied out only if that takes apart what nothing else holds together.
- Where an equality determines x, its value alone is substituted [Weispfenning 1988, §3].
- A case assumes what must hold for its bound to matter at its place in φ: the conjuncts beside it, and none of the
  disjuncts beside it ["structural" elimination sets; Dolzmann, Sturm and Weispfenning 1998; Košta 2016, ch. 3].
- Cases are simplified by what surrounds them; large ones are dropped if a solver finds them contradictory.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from operator import or_

from robust.qe import nnf
from robust.qe.conjunctions import Conjunction, half_space
from robust.qe.constraint import Coefficients, LinearConstraint, Sense, substitute_equality
from robust.qe.eliminate.enumerate import polyhedra_of, satisfiable
from robust.qe.eliminate.interface import Eliminator, Query, without
from robust.qe.nnf import FALSE, TRUE, BoolLeaf, Junction, Leaf, Nnf, conjunction, disjunction
from robust.smt.limits import Deadline

LARGE = 30
"""How many leaves make it worth asking a solver whether a case is contradictory."""
TWICE = 2
SMALL = 8
"""How many leaves a neighbour of a bound may have for it to be assumed, and how many neighbours are."""


@dataclass(frozen=True, slots=True)
class VirtualValue:
    """A virtual value of x: what an equality over x says (moved up or down infinitesimally), or infinity if None."""

    equality: LinearConstraint | None
    direction: int
    """−1: just below, or −∞; 0: exactly; 1: just above, or +∞."""


Value = VirtualValue | bool
Cases = dict[Value, Nnf]
"""Values of a real symbol or of a Boolean one, each with a condition without which it need not be looked at."""


class LoosWeispfenning(Eliminator):
    """Virtual substitution."""

    name = "loos-weispfenning"

    def eliminate(self, query: Query, known: Iterable[Conjunction], deadline: Deadline) -> Iterator[Conjunction]:
        context, known = self.context, list(known)
        session = context.session()
        session.add(context.reader.write(without(TRUE, known)))

        def possible(formula: Nnf) -> bool:
            with session.frame(context.reader.write(formula)):
                return satisfiable(session, f"{query.name}: a case", deadline)

        # Nothing needs to be said about points of what is known.
        assumed = [half.negation()[0] for piece in known if (half := half_space(piece)) is not None]
        result = eliminate(query.formula, query.eliminated, possible, deadline, assumed)
        yield from polyhedra_of(result, context, deadline, known)


def eliminate(
    formula: Nnf,
    names: Iterable[str],
    possible: Callable[[Nnf], bool],
    deadline: Deadline,
    assumed: Iterable[LinearConstraint] = (),
) -> Nnf:
    """∃ names. formula, without quantifiers.

    Args:
        formula: any formula.
        names: symbols to eliminate, real or Boolean.
        possible: whether a case need be looked at; asked for large ones, which may still mention some of the names.
        deadline: when to stop.
        assumed: constraints without these names; where they do not hold the result means nothing.

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    return _Run(formula, names, possible, deadline, assumed).result()


@dataclass(eq=False)
class _Run:
    """One elimination. Sets of the symbols that are eliminated are integers, a bit for each of them."""

    formula: Nnf
    names: Iterable[str]
    possible: Callable[[Nnf], bool]
    deadline: Deadline
    assumed: Iterable[LinearConstraint]

    def __post_init__(self) -> None:
        self._names = sorted(self.names)
        self._bit = {name: 1 << index for index, name in enumerate(self._names)}
        self._booleans = nnf.booleans_in(self.formula)
        self._assumed = tuple(self.assumed)
        self._found: dict[Nnf, tuple[int, int]] = {}
        self._results: dict[tuple[frozenset[Nnf], int], Nnf] = {}

    def result(self) -> Nnf:
        formula = self._simplified(self.formula)
        return self._simplified(perform(self._exists(formula, (1 << len(self._names)) - 1), self.deadline))

    def _simplified(self, formula: Nnf, assumed: Iterable[Leaf] = ()) -> Nnf:
        return simplified(formula, (*self._assumed, *assumed), self.deadline)

    def _mask(self, *roots: Nnf) -> int:
        """The symbols in formulas that are eliminated."""
        return reduce(or_, (self._facts(root)[0] for root in roots), 0)

    def _leaves(self, root: Nnf) -> int:
        """How many leaves the formula has, written out."""
        return self._facts(root)[1]

    def _facts(self, root: Nnf) -> tuple[int, int]:
        def leaf(node: Leaf) -> tuple[int, int]:
            return reduce(or_, (self._bit.get(name, 0) for name in node.parameters), 0), 1

        def junction(_node: Junction, parts: list[tuple[int, int]]) -> tuple[int, int]:
            return reduce(or_, (mask for mask, _ in parts), 0), sum(leaves for _, leaves in parts)

        known = self._found.get(root)
        return nnf.fold(root, leaf, junction, self._found) if known is None else known

    def _listed(self, mask: int) -> list[str]:
        return [name for name in self._names if self._bit[name] & mask]

    def _exists(self, node: Nnf, mask: int) -> Task:
        """∃ mask. node: to the operands of a disjunction, and to groups of operands of a conjunction."""
        mask &= self._mask(node)
        if not mask:
            return node
        if not isinstance(node, Junction):
            return TRUE
        parts: list[Nnf] = []
        if not node.conjunctive:
            for operand in node.operands:
                parts.append((yield self._exists(operand, mask)))
                if parts[-1] is TRUE:
                    return TRUE
            return disjunction(parts)
        parts += (operand for operand in node.operands if not self._mask(operand) & mask)
        for group in self._groups([operand for operand in node.operands if self._mask(operand) & mask], mask):
            parts.append((yield self._group(group, mask)))
            if parts[-1] is FALSE:
                return FALSE
        return conjunction(parts)

    def _groups(self, operands: Iterable[Nnf], mask: int) -> list[list[Nnf]]:
        """The operands in groups that share no symbols of the mask."""
        groups: list[tuple[int, list[Nnf]]] = []
        for operand in operands:
            shared, members = self._mask(operand) & mask, [operand]
            apart = []
            for other, others in groups:
                if other & shared:
                    shared, members = shared | other, others + members
                else:
                    apart.append((other, others))
            groups = [*apart, (shared, members)]
        return [members for _, members in groups]

    def _group(self, operands: Sequence[Nnf], mask: int) -> Task:
        """∃ mask. of a conjunction that cannot be taken apart; the same ones come up again and again."""
        if len(operands) == 1:
            return (yield self._exists(operands[0], mask))
        inside = self._mask(*operands) & mask
        key = frozenset(operands), inside
        if key not in self._results:
            self._results[key] = yield self._connected(operands, inside)
        return self._results[key]

    def _connected(self, operands: Sequence[Nnf], mask: int) -> Task:
        for operand in operands:
            value = _determined(operand)
            if value is not None:
                name = self._listed(self._mask(operand) & mask)[0]
                others = (substitute(other, name, value) for other in operands if other is not operand)
                image = self._simplified(conjunction(others))
                return (yield self._exists(image, mask & ~self._bit[name]))
        divided = self._divided(operands, mask)
        if divided is not None:
            return (yield self._exists(divided, mask))
        name, cases = self._easiest(operands, mask)
        rest = [operand for operand in operands if not self._mask(operand) & self._bit[name]]
        body = conjunction(operand for operand in operands if self._mask(operand) & self._bit[name])
        known = [operand for operand in rest if not isinstance(operand, Junction)]
        images = []
        for case, condition in cases.items():
            self.deadline.enforce()
            image = self._simplified(conjunction((condition, substitute(body, name, case))), known)
            if image is not FALSE and (self._leaves(image) < LARGE or self.possible(image)):
                images.append(image)
        united = self._simplified(conjunction((*rest, disjunction(images))))
        return (yield self._exists(united, mask & ~self._bit[name]))

    def _divided(self, operands: Sequence[Nnf], mask: int) -> Nnf | None:
        """The conjunction with one disjunction multiplied out, if that takes apart what only it holds together."""
        best: tuple[int, Nnf] | None = None
        for operand in operands:
            if not isinstance(operand, Junction):
                continue
            self.deadline.enforce()
            others = [other for other in operands if other is not operand]
            masks = [self._mask(part) & mask for part in operand.operands]
            if all(part == self._mask(operand) & mask for part in masks):
                continue
            groups = [self._mask(*group) & mask for group in self._groups(others, mask)]
            touched = max(sum(1 for group in groups if group & part) for part in masks)
            spared = sum(1 for group in groups if group & self._mask(operand)) - touched
            if spared > 0 and (best is None or spared > best[0]):
                best = spared, disjunction(conjunction((part, *others)) for part in operand.operands)
        return None if best is None else best[1]

    def _easiest(self, operands: Sequence[Nnf], mask: int) -> tuple[str, Cases]:
        """The symbol whose elimination makes the least formula, and its cases."""
        best: tuple[int, str, Cases] | None = None
        for name in self._listed(mask):
            bit = self._bit[name]
            body = [operand for operand in operands if self._mask(operand) & bit]
            if name in self._booleans:
                return name, {False: TRUE, True: TRUE}
            cases = self._cases(body, name)
            size = len(cases) * sum(map(self._leaves, body))
            if best is None or size < best[0]:
                best = size, name, cases
        if best is None:
            raise AssertionError("a group of operands without a symbol to eliminate")
        return best[1:]

    def _cases(self, operands: Sequence[Nnf], name: str) -> Cases:
        """Virtual values of which one satisfies the conjunction if any value does: from below or from above."""
        bit = self._bit[name]
        below: dict[VirtualValue, list[Nnf]] = {}
        above: dict[VirtualValue, list[Nnf]] = {}
        visits: dict[Nnf, int] = {}
        stack: list[tuple[Nnf, tuple[Nnf, ...]]] = [(operand, ()) for operand in operands]
        while stack:
            node, around = stack.pop()
            if not self._mask(node) & bit:
                continue
            # At another place again, its bounds are taken once more, whatever is around them; then all is said.
            visits[node] = visits.get(node, 0) + 1
            if visits[node] > TWICE:
                continue
            if visits[node] == TWICE:
                around = ()
            if isinstance(node, Junction):
                beside = (o for o in node.operands if not self._mask(o) & bit and self._leaves(o) <= SMALL)
                holding = beside if node.conjunctive else (nnf.negation(o) for o in beside)
                inside = (*around, *holding)[-SMALL:]
                stack.extend((operand, inside) for operand in node.operands)
            elif isinstance(node, LinearConstraint):
                condition = conjunction(around)
                at = node.with_relation(Sense.EQUAL)
                if node.is_equality:
                    below.setdefault(VirtualValue(at, 0), []).append(condition)
                    above.setdefault(VirtualValue(at, 0), []).append(condition)
                elif dict(node.coefficients)[name] < 0:
                    below.setdefault(VirtualValue(at, int(node.is_strict)), []).append(condition)
                else:
                    above.setdefault(VirtualValue(at, -int(node.is_strict)), []).append(condition)
        end, chosen = (-1, below) if len(below) <= len(above) else (1, above)
        cases: Cases = {VirtualValue(None, end): TRUE}
        for value, conditions in chosen.items():
            condition = self._simplified(disjunction(conditions))
            if condition is not FALSE:
                cases[value] = condition
        return cases


def _determined(node: Nnf) -> Value | None:
    """The value that a literal or an equality leaves any symbol in it; None if it is neither."""
    if isinstance(node, BoolLeaf):
        return node.value
    return VirtualValue(node, 0) if isinstance(node, LinearConstraint) and node.is_equality else None


def substitute(formula: Nnf, name: str, value: Value) -> Nnf:
    """The formula with a virtual value for a real symbol, or with a truth value for a Boolean one."""

    def leaf(node: Leaf) -> Nnf:
        if isinstance(node, BoolLeaf):
            if node.name != name:
                return node
            return TRUE if node.value is value else FALSE
        if name not in node.parameters or isinstance(value, bool):
            return node
        factor = dict(node.coefficients)[name]
        if value.equality is None:
            # At infinity the sign of the coefficient decides.
            return TRUE if not node.is_equality and factor * value.direction < 0 else FALSE
        if node.is_equality and value.direction:
            return FALSE
        if value.direction:
            # a·(x ± ε) + … ≤ c: the infinitesimal makes it strict, or makes it hold on the boundary.
            node = node.with_relation(Sense.LESS if factor * value.direction > 0 else Sense.AT_MOST)
        return substitute_equality(node, value.equality, name)

    return nnf.rebuild(formula, leaf)


# -- simplification by what surrounds a part ---------------------------------------------------------------------------

Bound = tuple[Fraction, bool]
"""An upper bound of a linear form, and whether it is strict."""

Task = Generator["Task", Nnf, Nnf]
"""A computation of a formula that yields the tasks whose results it needs; see :func:`perform`."""


def perform(task: Task, deadline: Deadline) -> Nnf:
    """The result of a task: recursion that the interpreter's stack does not limit [Ganz, Friedman and Wand 1999].

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    stack = [task]
    result: Nnf | None = None
    while stack:
        deadline.enforce()
        try:
            needed = next(stack[-1]) if result is None else stack[-1].send(result)
        except StopIteration as stop:
            stack.pop()
            result = stop.value
        else:
            stack.append(needed)
            result = None
    if result is None:
        raise AssertionError("a task ended without a result")
    return result


class KnownBounds:
    """Upper bounds of linear forms and values of Booleans that hold where a subformula is looked at.

    What has been learnt since a mark can be taken back.
    """

    def __init__(self, leaves: Iterable[Leaf] = ()) -> None:
        self._bounds: dict[Coefficients, Bound] = {}
        self._booleans: dict[str, bool] = {}
        self._before: list[tuple[Coefficients | str, Bound | bool | None]] = []
        for leaf in leaves:
            self.learn(leaf)

    @property
    def mark(self) -> int:
        return len(self._before)

    def learn(self, leaf: Leaf) -> None:
        if isinstance(leaf, BoolLeaf):
            self._before.append((leaf.name, self._booleans.get(leaf.name)))
            self._booleans[leaf.name] = leaf.value
            return
        for half in leaf.halves():
            known = self._bounds.get(half.coefficients)
            if known is None or (half.constant, not half.is_strict) < (known[0], not known[1]):
                self._before.append((half.coefficients, known))
                self._bounds[half.coefficients] = (half.constant, half.is_strict)

    def forget(self, mark: int) -> None:
        """Take back what has been learnt since the mark."""
        while len(self._before) > mark:
            key, before = self._before.pop()
            if isinstance(key, str):
                del self._booleans[key]
                if isinstance(before, bool):
                    self._booleans[key] = before
            else:
                del self._bounds[key]
                if isinstance(before, tuple):
                    self._bounds[key] = before

    def apply(self, leaf: Leaf) -> Nnf:
        """The leaf, or its truth where the facts decide it."""
        if isinstance(leaf, BoolLeaf):
            known = self._booleans.get(leaf.name)
            return leaf if known is None else (TRUE if known is leaf.value else FALSE)
        if not self._bounds:
            return leaf
        halves = [self._half(half) for half in leaf.halves()]
        if any(half is FALSE for half in halves):
            return FALSE
        if all(half is TRUE for half in halves):
            return TRUE
        return leaf

    def _half(self, half: LinearConstraint) -> Nnf:
        above = self._bounds.get(half.coefficients)
        # Lexicographically: a smaller bound is tighter, and of equal ones a strict one is.
        if above is not None and (above[0], not above[1]) <= (half.constant, not half.is_strict):
            return TRUE
        below = self._bounds.get(tuple((name, -factor) for name, factor in half.coefficients))
        if below is not None:
            # form ≥ −bound contradicts form ≤ constant
            floor = -below[0]
            if floor > half.constant or (floor == half.constant and (below[1] or half.is_strict)):
                return FALSE
        return half


def simplified(root: Nnf, assumed: Iterable[Leaf] = (), deadline: Deadline | None = None) -> Nnf:
    """A formula that is equivalent wherever what is assumed holds, simplified by what surrounds each of its parts.

    In a conjunction the other operands may assume a constraint, in a disjunction they may assume its negation [Dolzmann
    and Sturm 1997, "Simplification of quantifier-free formulae over ordered fields"].

    Raises:
        OutOfTimeError: if the deadline passes.
    """
    return perform(_simplify(root, KnownBounds(assumed)), deadline or Deadline.after(None))


def _simplify(node: Nnf, facts: KnownBounds) -> Task:
    if not isinstance(node, Junction):
        return facts.apply(node)
    conjunctive, mark = node.conjunctive, facts.mark
    absorbing = FALSE if conjunctive else TRUE
    while isinstance(node, Junction) and node.conjunctive is conjunctive:
        nested = [operand for operand in node.operands if isinstance(operand, Junction)]
        leaves = [operand for operand in node.operands if not isinstance(operand, Junction)]
        # Equalities say most in a conjunction, and nothing that can be used in a disjunction.
        leaves.sort(key=lambda leaf: _is_equality(leaf) is not conjunctive)
        parts: list[Nnf] = []
        for leaf in leaves:
            parts.append(facts.apply(leaf))
            _assume(parts[-1], conjunctive, facts)
        count = 0
        for operand in nested:
            if absorbing in parts:
                break
            parts.append((yield _simplify(operand, facts)))
            count += _assume(parts[-1], conjunctive, facts)
        facts.forget(mark)
        node = conjunction(parts) if conjunctive else disjunction(parts)
        # Constraints that came to light may say something of the operands before them.
        if not count or len(nested) == 1:
            break
    return node


def _is_equality(leaf: Leaf) -> bool:
    return isinstance(leaf, LinearConstraint) and leaf.is_equality


def _assume(node: Nnf, conjunctive: bool, facts: KnownBounds) -> int:
    """Learn what other operands may assume of one that is a leaf or consists of leaves; how many leaves there were.

    That is the leaf itself in a conjunction; in a disjunction its negation, if that is one leaf.
    """
    if isinstance(node, Junction):
        leaves = [o for o in node.operands if not isinstance(o, Junction)] if node.conjunctive is conjunctive else []
    else:
        leaves = [node]
    for leaf in leaves:
        if conjunctive:
            facts.learn(leaf)
        elif isinstance(leaf, BoolLeaf):
            facts.learn(BoolLeaf(leaf.name, not leaf.value))
        elif not leaf.is_equality:
            facts.learn(leaf.negation()[0])
    return len(leaves)
