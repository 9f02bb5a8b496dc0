"""What a user's script may say about the package; `tests/test_package.py` has mypy read it, strictly. It is not run."""

from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import robust
from robust import pike, stnu

FILES = ["domain.pddl", "problem.pddl", "plan.stn"]

plan: robust.ParametrizedPlan = robust.load_plan(
    *FILES, parameters=["duration:drive"], epsilon=0.001, timeout=Decimal(3)
)
checked: robust.CheckResult = robust.check(plan, at={"a": 3, "b": "1/3", "c": 0.5, "d": (1, None)}, every=True)
again: robust.CheckResult = robust.check(FILES, at=["a=3"], solver="cvc5", timeout=10)
box: robust.EnvelopeResult = robust.envelope((Path("d"), Path("p"), "plan.stn"), method="irr", beta=Fraction(1, 2))
inside: robust.CheckResult = robust.check(plan, at=box)
region: robust.RegionResult = robust.region(plan, backend="project")
compared: robust.Comparison = robust.compare(plan, beta="0.5")
repaired: robust.Repair = robust.repair(plan, require={"a": (1, 2.5)}, change="both")
found: robust.NewPlan = robust.replan(robust.Monitor(plan), "domain.pddl", "problem.pddl", planner="aries", limit=3)
best: robust.Ranking = robust.rank("domain.pddl", "problem.pddl", ["a.plan"], deadline=90)
learnt: robust.Learned = robust.learn(["monday.csv", Path("tuesday.csv")], cover=0.9, confidence="0.95", pool=True)
within: robust.CheckResult = robust.check(plan, at=learnt.box)
likely: robust.RiskResult = robust.risk(plan, {"a": "normal:30:4"}, within=0.01)
alike: robust.RiskResult = robust.risk(FILES, distributions=["a=normal:30:4"], solver="cvc5", draws=100)
verdict: robust.Verdict = robust.validate("domain.pddl", "problem.pddl", "steps.plan", epsilon=Decimal("0.001"))
made: robust.Conversion = robust.convert("domain.pddl", "problem.pddl", "steps.plan", mode="causal", epsilon=0.001)
remade: robust.Conversion = robust.convert("d.pddl", "p.pddl", "steps.plan", mode=robust.Mode.ESTEREL)
tree: robust.BehaviorTree = robust.read_tree("tree.xml", plan)
made_tree: robust.MadeTree = robust.make_tree(plan, lag=Fraction(1, 10))
kept: robust.CheckResult = robust.check(plan, tree="tree.xml", lag="1/10", within="plan")
exported: str = robust.export(plan, box, "csv")
many_plans: robust.Batch = robust.batch("check", "suite", jobs=2)
both: robust.Batch = robust.batch("compare", Path("suite"), beta="1/2", doubling=False, region="project", limit=60)

answer: robust.Answer = checked.answer
ends: dict[str, tuple[Fraction | None, Fraction | None]] = box.box.ranges
first: robust.Counterexample = next(iter(checked.counterexamples.values()))
values: dict[str, Fraction] = dict(first.parameters)
proved: bool = region.is_proved({"a": Fraction(3)})
gaps: list[Fraction | None] = [face.gap for entry in compared.entries for face in entry.faces]
changes: list[str] = [change.words for change in repaired.changes]
bounds: robust.Bounds = likely.probability

shown: robust.Presented
for shown in (checked, box, region, compared, repaired, likely, verdict, made):
    text: str = str(shown)
    answer_as_data: dict[str, Any] = shown.as_dict()
    rows: list[dict[str, Any]] = shown.rows()
    shown.plot("picture.svg", axes=("a", "b")).savefig("again.png")

try:
    robust.check(plan, epsilon="a little")
except (robust.InputError, robust.UnsupportedError, robust.SolverError) as error:
    code: int = error.exit_code
except robust.InvalidPlanError as error:
    broken: list[str] = [violation.obligation for violation in error.violations]
except robust.RobustError as error:
    where: robust.Location | None = error.location

network: stnu.Network = stnu.load("network.stnu")
controllable: bool = stnu.check(network, timeout=5).is_controllable
execution: stnu.Execution = stnu.dispatch("network.stnu").execute(seed=3)
cost: Fraction | None = stnu.repair(network, requirement=2, contingent=None, weights={("a", "b"): 0.5}).cost

drink = pike.choose("drink", {"tea": pike.act("(tea)", 3, 5), "milk": pike.act("(milk)", Decimal(1), 2.5)})
written: pike.Tpnu = pike.build("breakfast", pike.within(pike.sequence(drink), upper="7"))
team: pike.TeamPlan = pike.load("kitchen.tpnu.json", epsilon=0.001)
exists: pike.PikeCheck = pike.check(team, assume={"xA1": "mug"}, all_scenarios=True)
sizes: pike.Sizes = pike.compile("kitchen.tpnu.json", "bdd", implicants=True)
base: pike.KnowledgeBase = pike.knowledge_base(team).knowledge
record: pike.ExecutionRecord = pike.run(team, outcome={"xA1": ("mug", 2.5)}, disturb="(not (clean mug))@3", seed=2)
until: list[pike.Moment] = pike.moments(team).moments
crossed: pike.Crossed = pike.cross_check(team, witness="found")
labeled: pike.LabeledRegion = pike.region(team, "coffee=duration:make-coffee", choices=["xA1"])
promised: pike.TeamEnvelope = pike.envelope(team, ["coffee=duration:make-coffee"], for_all="xA1")
drawn: pike.Instance = pike.k_intents((2, 2)).instance
oracle = pike.Oracle(team, solver="z3")
executive = pike.PlanExecutive(team, pike.make_reasoner("smt"))
decisions: list[pike.Decision] = executive.step(Fraction(0), [pike.Outcome("xA1", "mug")])
