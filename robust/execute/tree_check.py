"""The question whether every execution of a behavior tree keeps to a plan, and whether it is one of the plan's own."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from fractions import Fraction

from robust.encode import interface
from robust.errors import SolverError
from robust.execute.trees import BehaviorTree, TreeEncoding, unkept
from robust.irr import check
from robust.irr.questions import CheckQuestion, Manner
from robust.plan import model
from robust.plan.simulate import Violation, simulate
from robust.qe.box import Box
from robust.smt.limits import NEVER, Deadline
from robust.smt.session import Session, Statistics


class TreeQuestion(CheckQuestion):
    """Is the plan valid for every execution of a tree and all values in a box?

    Args:
        plan: the plan.
        manner: how it is asked about.
        box: the parameter values.
        tree: the tree.
        lag: how late nodes of the tree begin at most; None if there is no limit.
        within: whether it is also asked if executions are schedules of the plan's own network.
        every: whether all obligations are examined.
        on_obligation: called with the number of obligations examined, their total, and the name of the next.
    """

    def __init__(
        self,
        plan: model.ParametrizedPlan,
        manner: Manner,
        box: Box,
        *,
        tree: BehaviorTree,
        lag: Fraction | None = None,
        within: bool = False,
        every: bool = False,
        on_obligation: Callable[[int, int, str], None] | None = None,
    ) -> None:
        super().__init__(plan, manner, box, every=every, on_obligation=on_obligation)
        self._tree = tree
        self._lag = lag
        self._within = within
        self._formulas = None if tree.faults else self._encoded()

    def _encoded(self) -> TreeEncoding:
        allowed = self._tree.network(self.plan, self.manner.epsilon, self._lag)
        return self._tree.encoding(allowed, self.manner.epsilon, self._lag, self.box.ranges)

    def run(self) -> check.CheckResult:
        if self._formulas is not None:
            return super().run()
        nothing = self.nothing(timed_out=False)
        reason = "; ".join(self._tree.faults)
        return replace(
            nothing, answer=check.Answer.REFUTED, reason=reason, tree=self._tree.file, seconds=0.0, interrupted=False
        )

    def formulas(self) -> TreeEncoding:
        return self._formulas or self._encoded()

    def completed(self, result: check.CheckResult) -> check.CheckResult:
        decided = not result.cut_short and (self.every or result.answer is check.Answer.PROVED)
        if self._within and decided:
            result = stays_within(self.plan, self.formulas(), result, self.manner.deadline)
        return replace(result, tree=self._tree.file)


def stays_within(
    plan: model.ParametrizedPlan, encoding: interface.Encoding, result: check.CheckResult, deadline: Deadline = NEVER
) -> check.CheckResult:
    """The verdict about another network of a plan's steps, with those on whether its schedules are the plan's as well.

    Each constraint of the plan is one more obligation. A counterexample is a schedule of the other network, as
    simulation confirms, that the constraint forbids.
    """
    answers = {f"plan: {item}": check.Answer.PROVED for item in plan.constraints}
    found: dict[str, check.Counterexample] = {}
    session = Session(encoding.terms, solver=result.solver, statistics=Statistics())
    session.add(*encoding.network_formulas(), *check.within(encoding, result.box.intervals))
    places = encoding.places
    for item, sides in unkept(plan, encoding.plan, result.box):
        name = f"plan: {item}"
        slacks = (places[target] - places[source] - weight for source, target, weight in sides)
        with session.frame(encoding.terms.disjunction(encoding.terms.greater(-slack) for slack in slacks)):
            verdict = check.ANSWERS[session.check(name, deadline)]
            if verdict is check.Answer.REFUTED:
                values = {known: Fraction(value) for known, value in session.values(encoding.unknowns()).items()}
                found[name] = _outside(encoding, result, name, item, values)
        answers[name] = verdict
        if found and not result.every:
            break
    every = {**result.obligations, **answers}
    open_ = result.answer is check.Answer.UNKNOWN or check.Answer.UNKNOWN in answers.values()
    answer = check.Answer.REFUTED if found else check.Answer.UNKNOWN if open_ else result.answer
    return replace(result, answer=answer, obligations=every, counterexamples={**result.counterexamples, **found})


def _outside(
    encoding: interface.Encoding,
    result: check.CheckResult,
    name: str,
    item: model.TemporalConstraint,
    values: Mapping[str, Fraction],
) -> check.Counterexample:
    """The schedule of a model, executed in both networks; SolverError if one of them disagrees."""
    parameters = {known: values.get(known, interval.some_value()) for known, interval in result.box.intervals.items()}
    schedule = encoding.schedule({**values, **parameters})
    own = simulate(encoding.plan, parameters, schedule, epsilon=result.epsilon)
    alone = simulate(replace(encoding.plan, constraints=(item,)), parameters, schedule, epsilon=result.epsilon)
    if own.network_violations or not alone.network_violations:
        raise SolverError(f"the simulator does not confirm that {name!r} breaks; please report this plan as a bug")
    violation = Violation(name, max(schedule[item.source], schedule[item.target]), alone.network_violations[0])
    return check.Counterexample(name, parameters, schedule, replace(own, violations=(*own.violations, violation)))
