"""Grounding by the verified kernel, from syntax trees (`proofs/kernel/coq/Pddl.v`), and by the reader of the checker in
Python: the same ground plans."""

import subprocess
from fractions import Fraction

import pytest

from benchmarks.suite import read_deliveries, read_suite
from robust.certify.checker import reader
from robust.certify.kernel.terms import PlanTerms, listed
from robust.plan.timed import read_timed_plan
from tests.certify import tools
from tests.certify.test_reader import OTHERS, SAME, TEXTS, changed_texts
from tests.certify.test_specification import KERNEL
from tests.certify.texts import random_texts, tangled_texts
from tests.execute.test_planner_plans import FOLDER, LOGS, named

pytestmark = pytest.mark.skipif(KERNEL is None, reason="the kernel is not built (make -C proofs/kernel)")


class Printed:
    """A ground plan of the reader, as `robust-kernel --ground` prints one."""

    def __init__(self, ground):
        self.ground = ground
        self.numbers = {name: f"#{number}" for number, name in enumerate(ground.parameters)}

    def lines(self):
        ground = self.ground
        initial, varied = ground.model.initial, ground.varied
        values = sorted(
            (name, self.numbers[varied["fluent", name]] if ("fluent", name) in varied else str(value))
            for name, value in initial.items()
            if type(value) is Fraction
        )
        parts = {
            "true": sorted(name for name, value in initial.items() if value is True),
            "values": map(listed, values),
            "effects": [self.effect(point, each) for point, all_ in enumerate(ground.effects) for each in all_],
            "flows": [listed((s, e, f, self.term(rate, (s, e)))) for s, e, f, rate in ground.flows],
            "constraints": [listed((a, b, self.bound(w))) for a, b, w in ground.edges],
            "obligations": map(self.duty, ground.duties),
            "timed": sorted(ground.timed),
        }
        return [listed((name, *items)) for name, items in parts.items()]

    def bound(self, form):
        for name, factor in form.items():
            if name:
                return self.numbers[name] if factor == 1 else listed(("*", factor, self.numbers[name]))
        return str(form.get("", 0))

    def term(self, tree, owner):
        kind, *rest = tree
        if kind == "number":
            return str(rest[0])
        if kind == "parameter":
            return self.numbers[rest[0]]
        if kind == "duration":
            return f"(- @{owner[1]} @{owner[0]})"
        if kind == "fluent":
            return rest[0]
        first, *others = (self.term(each, owner) for each in rest)
        if kind == "-" and not others:
            return f"(- 0 {first})"
        for each in others:
            first = f"({kind} {first} {each})"
        return first

    def condition(self, tree, owner):
        if type(tree) is bool:
            return "always" if tree else "(not always)"
        kind, *rest = tree
        if kind == "atom":
            return rest[0]
        if kind == "not":
            return f"(not {self.condition(rest[0], owner)})"
        if kind in ("and", "or"):
            shown = "always" if kind == "and" else "(not always)"
            for each in reversed(rest):
                shown = f"({kind} {self.condition(each, owner)} {shown})"
            return shown
        left, right = rest if kind[0] != "<" else rest[::-1]
        if kind == "=":
            return f"(and {self.compared('>=', left, right, owner)} {self.compared('>=', right, left, owner)})"
        return self.compared(">" * (len(kind) == 1) or ">=", left, right, owner)

    def compared(self, sign, left, right, owner):
        return f"({sign} (- {self.term(left, owner)} {self.term(right, owner)}))"

    def guard(self, when, owner):
        """An effect's condition in the conditions around it."""
        if when is True:
            return "always"
        _, around, condition = when
        return f"(and {self.guard(around, owner)} {self.condition(condition, owner)})"

    def effect(self, point, effect):
        amount = [] if effect.kind in ("add", "delete") else [self.term(effect.amount, effect.owner)]
        return listed((point, self.guard(effect.when, effect.owner), effect.kind, effect.target, *amount))

    def duty(self, duty):
        condition = self.condition(duty.condition, duty.owner)
        if duty.first is None:
            return f"(goal {condition})"
        if duty.last is None:
            return f"(at {duty.first} {condition})"
        return f"(over {duty.first} {duty.last} {condition})"


def by_the_kernel(ground, folder):
    path = folder / "trees.kernel"
    path.write_text("\n".join(["(texts)", *PlanTerms(ground).sections(), "(epsilon 1/1000)"]))
    answer = subprocess.run([KERNEL, "--ground", path], capture_output=True, text=True, timeout=60, check=False)
    assert answer.returncode == 0, answer.stderr
    return answer.stdout.splitlines()


def assert_the_same(texts, folder, *beside):
    ground = reader.ground(*texts, *beside)
    assert by_the_kernel(ground, folder) == Printed(ground).lines()


@pytest.mark.parametrize(
    ("make", "seeds"),
    [
        (random_texts, range(20)),
        (tangled_texts, range(10)),
        pytest.param(random_texts, range(1000, 1600), marks=pytest.mark.slow),
        pytest.param(tangled_texts, range(1000, 1400), marks=pytest.mark.slow),
    ],
)
def test_random_plans(make, seeds, tmp_path):
    count = 0
    for seed in seeds:
        try:
            reader.ground(*(texts := make(seed)))
        except reader.Unsupported:
            continue
        assert_the_same(texts, tmp_path)
        count += 1
    assert count > len(seeds) / 2


def test_texts_with_everything(tmp_path):
    for texts in (TEXTS, *OTHERS.values(), *(texts for _, texts in changed_texts(SAME))):
        assert_the_same(texts, tmp_path)


@pytest.mark.parametrize("every", [10, pytest.param(1, marks=pytest.mark.slow)])
def test_recorded_plans(dataset, every, tmp_path):
    plans = [one.files for one in read_suite(dataset)] + [files for _, files in read_deliveries(dataset)]
    for files in (*sorted_examples(), *plans[::every]):
        assert_the_same([path.read_text(encoding="utf-8") for path in files], tmp_path)


def sorted_examples():
    for path in sorted(tools.EXAMPLES.rglob("*.stn")):
        yield path.parent / "domain.pddl", path.parent / "problem.pddl", path


@pytest.mark.parametrize("name", named("valid", "refused", "invalid"))
def test_planner_logs(name, tmp_path):
    """Each step at its time."""
    domain, problem, log = (FOLDER / LOGS[name][kind] for kind in ("domain", "problem", "log"))
    statements = []
    for number, step in enumerate(read_timed_plan(log).steps):
        ends = [f"s{number}.start", f"s{number}.end"] if step.duration is not None else [f"s{number}"] * 2
        kind = "action" if step.duration is None else "durative-action"
        statements.append(f"{kind} instance s{number} : ({' '.join([step.action, *step.arguments])});")
        statements.append(f"c: {ends[0]} - .zero in [{step.time}, {step.time}];")
        statements.append(f"c: {ends[1]} - {ends[0]} in [{step.duration or 0}, {step.duration or 0}];")
    texts = [path.read_text(encoding="utf-8") for path in (domain, problem)]
    assert_the_same([*texts, "\n".join(statements)], tmp_path)
