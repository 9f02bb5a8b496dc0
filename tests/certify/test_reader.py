"""What the checker reads, and what its formulas say of single schedules, against this package and its simulator.

They are evaluated where times and parameters are given before they are made, and, without any solver, where these are
free as in a certificate: conditions, cases and orders that are constant otherwise are in them only then.
"""

import json
import tomllib
import warnings
from collections import Counter
from fractions import Fraction
from functools import cache, partial
from itertools import pairwise
from pathlib import Path
from random import Random

import pytest

from benchmarks.suite import read_deliveries, read_suite
from robust.certify.checker import reader
from robust.certify.checker.formulas import FALSE, TRUE, mutex
from robust.certify.hints import KnownFacts, model
from robust.errors import RobustError
from robust.plan.model import ZERO, Atom, Bound
from robust.plan.pddl.reader import read_domain, read_problem
from robust.plan.polynomial import Polynomial
from robust.plan.simulate import mutex_pairs, simulate
from robust.reading import load_plan
from robust.smt.limits import NEVER
from tests.certify import adversary, tools
from tests.certify.texts import Texts, changed, random_texts, tangled_texts
from tests.sampling import Network, sample_parameters, sample_schedules

DATA = Path(__file__).with_name("data")
TABLES = json.loads((DATA / "elaborate.json").read_text(encoding="utf-8"))
TEXTS = Texts(*((DATA / name).read_text(encoding="utf-8") for name in ("domain.pddl", "problem.pddl", "plan.stn")))
"""A plan that has everything which the checker's reader knows; `data/elaborate.json` has what it says, other ways to
say it, and what is wrong."""


def compare(plan, ground, by=tools.CHECKER):
    """Time points, parameters, network, initial state, effects and mutex pairs are the same."""
    assert [str(point) for point in plan.time_points] == ground.points
    parameters = {name: (p.nominal, p.lower, p.upper) for name, p in ground.parameters.items()}
    nominal = {p.name: p.nominal if p.has_nominal else None for p in plan.parameters}
    assert parameters == {p.name: (nominal[p.name], p.lower, p.upper) for p in plan.parameters}
    assert network(plan) == {(ground.points[a], ground.points[b], frozenset(w.items())) for a, b, w in ground.edges}
    assert {str(atom) for atom in plan.initial_atoms} == {name for name, v in ground.model.initial.items() if v is True}
    values = {name: value for name, value in ground.model.initial.items() if isinstance(value, Fraction)}
    values |= {name: Fraction(0) for kind, name in ground.varied if kind == "fluent"}
    assert {str(fluent): value.constant_term for fluent, value in plan.initial_fluents.items()} == values
    effects = [(ground.points[point], effect) for point, every in enumerate(ground.effects) for effect in every]
    certain = {(point, effect.kind, effect.target) for point, effect in effects if effect.when is True}
    guarded = {(point, effect.kind, effect.target) for point, effect in effects}  # the checker knows no numbers yet
    flows = {(ground.points[start], "flow", fluent) for start, _, fluent, _ in ground.flows}
    assert certain | flows <= written(plan) <= guarded | flows
    ours = {frozenset(map(str, pair)) for pair in mutex_pairs(plan)}
    assert ours <= {frozenset((ground.points[a], ground.points[b])) for a, b in by.formulas.mutex(ground)}


def network(plan):
    """From where to where it takes at least how long: the coefficients of parameters, and the number by itself."""
    edges = [(one.source, one.target, one.lower) for one in plan.constraints if one.lower is not None]
    edges += [(one.target, one.source, -one.upper) for one in plan.constraints if one.upper is not None]
    for literal in plan.timed_literals:
        time: Bound = Polynomial.constant(literal.time)
        edges += [(ZERO, literal.point, time), (literal.point, ZERO, -time)]
    edges += [(ZERO, point, Polynomial.constant(Fraction(0))) for point in plan.time_points[1:]]
    return {
        (str(a), str(b), frozenset(("".join(map(str, names)), factor) for names, factor in length.terms.items()))
        for a, b, length in edges
    }


def written(plan):
    """What happens at which time point."""
    changes = set()
    for one in plan.instances:
        for effect in one.atom_effects:
            changes.add((str(one.at(effect.timing)), "add" if effect.value else "delete", str(effect.atom)))
        for change in one.numeric_effects:
            changes.add((str(one.at(change.timing)), change.operator.value, str(change.fluent)))
        changes |= {(str(one.start), "flow", str(flow.fluent)) for flow in one.continuous_effects}
    for literal in plan.timed_literals:
        kind = "assign" if not isinstance(literal.target, Atom) else "add" if literal.value else "delete"
        changes.add((str(literal.point), kind, str(literal.target)))
    return changes


def key(label):
    """What an obligation is about: the instance and the kind of duty, the goal, or the whole label."""
    if label.startswith(("separation", "goal", "effects of")):
        return "goal" if label.startswith("goal") else label
    about, _, duty = label.partition(": ")
    kinds = ("non-negative duration", "duration", "at start", "at end", "over all")
    return about.split(" ")[0], next((kind for kind in kinds if duty.startswith(kind)), "condition")


def separations(keys):
    return {key for key in keys if str(key).startswith("separation")}


def simulated(plan, parameters, schedule):
    """What the schedule breaks; None if flows of negative length leave it without a meaning."""
    keys = {key(violation.obligation) for violation in simulate(plan, parameters, schedule).violations}
    return None if any(isinstance(key, tuple) and key[1] == "non-negative duration" for key in keys) else keys


def times_of(plan, schedule):
    return {f"@{number}": schedule[point] for number, point in enumerate(plan.time_points) if number}


def broken(ground, plan, parameters, schedule, by=tools.CHECKER):
    """The obligations that one schedule breaks according to the checker."""
    given = {name: {"": value} if value else {} for name, value in {**parameters, **times_of(plan, schedule)}.items()}
    formulas = by.formulas.Formulas(ground, tools.EPSILON, given)
    literals = ((label, make()) for label, make in formulas.obligations())
    return {
        key(label)
        for label, literal in literals
        if literal == TRUE or (literal != FALSE and model(formulas, KnownFacts([]), literal, NEVER))
    }


def known_breaks(plan, ground, parameters, random, schedules):
    """Some schedules with what they break, about which checker and simulator agree; and how many of each kind."""
    known, counts = [], Counter()
    for schedule in sample_schedules(plan, parameters, random, schedules):
        try:
            want, keys = simulated(plan, parameters, schedule), broken(ground, plan, parameters, schedule)
        except (RobustError, reader.Unsupported):
            counts["unsupported"] += 1
            continue
        if want is None:
            counts["negative duration"] += 1
            continue
        # A text mentions what its polynomial cancels: then more time points are mutex.
        assert want - separations(keys) == keys - separations(keys)
        known.append((schedule, keys))
        counts["broken" if want else "valid"] += 1
    return known, counts


def readings(first=0, count=120):
    """What random texts mean: what this package reads, and what single schedules break according to the simulator."""
    for seed in range(first, first + count):
        texts, random = random_texts(seed), Random(seed)
        try:
            plan = tools.assembled(texts)
        except RobustError:
            continue
        parameters = sample_parameters(plan, random)
        known, _ = known_breaks(plan, reader.ground(*texts), parameters, random, 3)
        yield f"reading {seed}", partial(_reads, texts=texts, plan=plan, parameters=parameters, known=known)


def _reads(by, texts, plan, parameters, known):
    ground = by.reader.ground(*texts)
    compare(plan, ground, by)
    return all(broken(ground, plan, parameters, schedule, by) == keys for schedule, keys in known)


class UndefinedError(Exception):
    """No value of an auxiliary name is as its definition says."""


class Evaluation:
    """Truth of literals at values of the free names; those of auxiliary names follow from their definitions."""

    def __init__(self, formulas, values):
        self.formulas, self.circuit, self.values = formulas, formulas.circuit, dict(values)
        self.truths = {}

    def true(self, literal):
        number = abs(literal)
        if number not in self.truths:
            node = self.circuit.nodes[number]
            if self.circuit.is_gate(number):
                self.truths[number] = all(map(self.true, node))
            else:
                level = sum((factor * self.value(name) for name, factor in node[1]), Fraction(0))
                self.truths[number] = level > 0 or (level == 0 and not node[0])
        return self.truths[number] == (literal > 0)

    def value(self, name):
        if name and name not in self.values:
            trials = (Evaluation(self.formulas, {**self.values, name: number}) for number in self._candidates(name))
            fitting = (trial for trial in trials if all(map(trial.true, self.formulas.definitions[name])))
            if (trial := next(fitting, None)) is None:
                raise UndefinedError(name)
            self.values[name] = trial.values[name]
        return self.values[name] if name else Fraction(1)

    def _candidates(self, name):
        """What the name is if a comparison of its definition is an equation."""
        waiting, seen = [abs(literal) for literal in self.formulas.definitions[name]], set()
        while waiting:
            number = waiting.pop()
            node = self.circuit.nodes[number]
            if number in seen:
                continue
            seen.add(number)
            if self.circuit.is_gate(number):
                waiting += map(abs, node)
            elif name in dict(node[1]):
                rest = sum((factor * self.value(other) for other, factor in node[1] if other != name), Fraction(0))
                yield -rest / dict(node[1])[name]


def free(first=0, count=250):
    """Formulas over all times at once, at single schedules; half of them with the orders that the network implies."""
    for seed in range(first, first + count):
        texts, random = tangled_texts(seed), Random(seed)
        try:
            plan, ground = tools.assembled(texts), reader.ground(*texts)
            parameters = sample_parameters(plan, random)
            near = random.choice([1, Fraction(3, 4)]) * tools.EPSILON
            schedules = sample_schedules(plan, parameters, random, 5, epsilon=near)
            known = [(schedule, simulated(plan, parameters, schedule)) for schedule in schedules]
            holds = partial(_evaluates, ground=ground, plan=plan, parameters=parameters, known=known, orders=seed % 2)
            if known and all(keys is not None for _, keys in known):
                assert holds(tools.CHECKER), seed
                yield f"free {seed}", holds
        except (RobustError, reader.Unsupported):
            continue


def _evaluates(by, ground, plan, parameters, known, orders):
    formulas = by.formulas.Formulas(ground, tools.EPSILON)
    closed = Network(plan, parameters)
    for a, row in enumerate(closed.distances if orders else []):
        for b, most in enumerate(row):
            if most is not None and a != b:  # t_b - t_a is at most that
                formulas.known[b, a] = Fraction(-most, closed.scale)
    for schedule, keys in known:
        certain, unseen = (set(map(key, labels)) for labels in broken_freely(formulas, plan, parameters, schedule))
        apart, wanted = separations(certain), keys - separations(keys)
        if not certain - apart <= wanted <= certain | unseen or apart != too_near(formulas, plan, schedule):
            return False
    return True


def too_near(formulas, plan, schedule):
    """The separations that the schedule breaks, by the names of the time points in the labels."""
    times = {str(point): schedule[point] for point in plan.time_points}
    labels = [label for label, _ in formulas.obligations() if label.startswith("separation: ")]
    pairs = ((label, label.removeprefix("separation: ").split(", ")) for label in labels)
    return {label for label, (a, b) in pairs if abs(times[a] - times[b]) < tools.EPSILON}


def broken_freely(formulas, plan, parameters, schedule):
    """Labels of the obligations that the schedule breaks; and of those that it may break at instants not looked at."""
    times = times_of(plan, schedule)
    happenings = sorted({Fraction(0), *schedule.values()})
    between = [(low + high) / 2 for low, high in pairwise(happenings)]
    certain, possible = set(), set()
    for number, (label, make) in enumerate(formulas.obligations()):
        literal, instant = make(), f"!{number}"
        if instant in formulas.instants:
            possible.add(label)
        places = [*happenings, *between] if instant in formulas.instants else [Fraction(0)]
        evaluations = (Evaluation(formulas, {**parameters, **times, instant: place}) for place in places)
        if any(evaluation.true(literal) for evaluation in evaluations):
            certain.add(label)
    return certain, possible - certain


def meaningless(by, texts):
    """Whether the checker refuses to write down some obligation, or to evaluate some effect."""
    try:
        formulas = by.formulas.Formulas(by.reader.ground(*texts), tools.EPSILON)
        for _, make in formulas.obligations():
            make()
        formulas.evaluate()
    except by.reader.Unsupported:
        return True
    return False


def reads_beside(by):
    """A parameter that is an initial value, written beside a plan: the goal is broken at half of what is needed."""
    texts, beside = adversary.BESIDE
    for value, breaks in ((Fraction(1), False), (Fraction(1, 2), True)):
        for given in (None, {"x": {"": value}}):
            ground = by.reader.ground(*texts, beside)
            times = {f"@{point}": Fraction(point) for point in range(1, len(ground.points))}
            points = {name: {"": time} for name, time in times.items()}
            formulas = by.formulas.Formulas(ground, tools.EPSILON, None if given is None else {**given, **points})
            (goal,) = [make() for label, make in formulas.obligations() if label.startswith("goal")]
            if Evaluation(formulas, {"x": value, **times}).true(goal) != breaks:
                return False
    return True


SAYS, OTHERS = TABLES["says"], TABLES["texts"]
"""What each of the texts says, written by hand tree by tree, so that nothing which a reader drops, takes for something
else or reads twice goes unseen; numbers begin with `=`. The smaller texts: `plain` has no types and no parameters, one
action at one time, and what happens later than what is written after it; `unknown` a parameter without a nominal value;
`beside` parameters that are written beside a plan."""
SAME, WRONG = TABLES["same"], TABLES["wrong"]
"""Parts of the texts, and what may stand there instead: other ways to say the same, and what is refused because it
means nothing, or something that the checker does not know."""


def changed_texts(changes, texts=TEXTS):
    """What is new, and the texts that have it at the one place that says the old."""
    for old, every in changes.items():
        assert sum(text.count(old) for text in texts) == 1, old
        yield from ((new, [text.replace(old, new) for text in texts]) for new in every)


def said(ground):
    """What the checker has read, as `SAYS` writes it."""
    parameters = {name: (one.nominal, one.lower, one.upper) for name, one in ground.parameters.items()}
    duties = [(duty.condition, duty.first, duty.last, duty.owner) for duty in ground.duties]
    effects = {
        point: [(effect.kind, effect.target, effect.amount, effect.when, effect.owner) for effect in effects]
        for point, effects in enumerate(ground.effects)
    }
    known = {name: getattr(ground, name) for name in ("points", "edges", "flows", "timed")}
    known |= {"parameters": parameters, "duties": duties, "effects": effects, "initial": ground.model.initial}
    known |= {"guessed": ground.model.guessed, "labels": [duty.label for duty in ground.duties]}
    return plainly({**known, "varied": [(*what, name) for what, name in ground.varied.items()]})


def plainly(value):
    if isinstance(value, dict):
        return {str(key): plainly(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple | set):
        return [plainly(inner) for inner in (sorted(value) if isinstance(value, set) else value)]
    return f"={value}" if isinstance(value, Fraction) else value


def unordered(value):
    """The same, where lists have neither an order nor anything twice."""
    if isinstance(value, dict):
        return {name: unordered(inner) for name, inner in value.items() if name != "labels"}
    return {repr(inner) for inner in value} if isinstance(value, list) else value


def texts_probes():
    """What a reader has to get right."""
    for name, texts in {"elaborate": TEXTS, **OTHERS}.items():
        yield f"texts {name}", partial(_says, texts=texts, says=SAYS[name])

    def may_grow(ground):
        return any(effect.kind == "increase" for effect in ground.effects[3])

    for guard, known in TABLES["guards"].items():
        ((_, texts),) = changed_texts({"(when (busy) (decrease": [f"(when {guard} (decrease"]})
        yield f"texts guard {guard}", partial(_says, texts=texts, says=known, view=may_grow)
    for new, texts in changed_texts(SAME):
        says = unordered(SAYS["elaborate"])
        yield f"texts same {new}", partial(_says, texts=texts, says=says, view=lambda ground: unordered(said(ground)))
    wrong = [*changed_texts(WRONG), *changed_texts(TABLES["names"]), *changed_texts(TABLES["varied"], OTHERS["beside"])]
    wrong += changed_texts(TABLES["small"]["wrong"], TABLES["small"]["texts"])
    named = dict(zip(("DOMAIN", "PROBLEM", "PLAN"), TEXTS, strict=True))
    wrong += [(str(texts), [named.get(text, text) for text in texts]) for texts in TABLES["refused"]]
    wrong += [(beside, [*OTHERS["beside"][:3], beside]) for beside in TABLES["beside"]]
    yield from ((f"texts wrong {new}", partial(refuses, texts=texts)) for new, texts in wrong)


def _says(by, texts, says, view=said):
    return view(by.reader.ground(*texts)) == says


def refuses(by, texts):
    """Whether nothing is proved about what the texts say."""
    try:
        by.reader.ground(*texts)
    except by.reader.Unsupported:
        return True
    return False


PLANNERS = Path(__file__).resolve().parents[3] / "shared" / "planner-logs"
pytestmark = pytest.mark.filterwarnings("ignore::robust.errors.InputWarning")


def judged(plan, ground, random, schedules=4):
    """How many schedules are valid, and how many break something, according to the simulator and the checker."""
    compare(plan, ground)
    return known_breaks(plan, ground, sample_parameters(plan, random), random, schedules)[1]


@pytest.mark.parametrize(
    ("seeds", "broken", "valid"),
    [(range(75), 50, 10), pytest.param(range(1000, 4000), 2500, 800, marks=pytest.mark.slow)],
)
def test_random_texts(seeds, broken, valid):
    total = Counter()
    for seed in seeds:
        plan = read_here(texts := random_texts(seed))[0]
        total += Counter(["wrong"]) if isinstance(plan, str) else judged(plan, reader.ground(*texts), Random(seed))
    assert total["broken"] > broken
    assert total["valid"] > valid
    assert total["wrong"] < len(seeds) / 7


def test_examples():
    for path in sorted(tools.EXAMPLES.rglob("*.stn")):
        files = (path.parent / "domain.pddl", path.parent / "problem.pddl", path)
        beside = [path.with_suffix(".toml")] if path.with_suffix(".toml").is_file() else []
        judged(load_plan(*files), tools.grounded([*files, *beside]), Random(1), 2)


@pytest.mark.parametrize("every", [4, pytest.param(1, marks=pytest.mark.slow)])
def test_recorded_plans(dataset, every):
    plans = [one.files for one in read_suite(dataset)] + [files for _, files in read_deliveries(dataset)]
    total = sum((judged(load_plan(*files), tools.grounded(files), Random(2), 1) for files in plans[::every]), Counter())
    assert len(plans) == 61
    assert sum(total.values()) > 50 // every


@pytest.mark.skipif(not PLANNERS.is_dir(), reason=f"no logs of planners at {PLANNERS}")
def test_domains_of_planner_logs():
    pairs = {(one["domain"], one["problem"]) for one in json.loads((PLANNERS / "plans.json").read_text())}
    for domain, problem in ((PLANNERS / one, PLANNERS / other) for one, other in sorted(pairs)):
        texts = [path.read_text(encoding="utf-8") for path in (domain, problem)]
        model_of = reader.Model(*texts)
        guessed = {"in_crate as in", "in_storearea as in", "type area as below object and surface"}
        assert model_of.guessed == (guessed if "in_storearea" in texts[1] else set())
        ours = read_problem(problem, read_domain(domain))
        assert {str(atom) for atom in ours.atoms} == {name for name, v in model_of.initial.items() if v is True}
        assert set(map(str, ours.fluents)) == {name for name, v in model_of.initial.items() if type(v) is not bool}
        assert ours.objects.keys() == model_of.objects.keys()


def test_what_a_text_mentions_is_read():
    """Also where the polynomial cancels, and where objects decide the condition."""
    domain = """(define (domain d) (:predicates (p) (q)) (:functions (f) (g))
     (:action a :parameters () :precondition (and (>= (- (f) (f)) 0) (or (q) (>= 1 0))) :effect (p))
     (:action b :parameters () :precondition () :effect (and (increase (f) 1) (not (q)))))"""
    problem = "(define (problem x) (:domain d) (:init (= (f) 1)) (:goal (p)))"
    ground = reader.ground(domain, problem, "action instance i : (a); action instance j : (b);")
    assert mutex(ground) == [(1, 2)]


def test_both_readers_read_the_same():
    for texts in (TEXTS, *OTHERS.values(), *(texts for _, texts in changed_texts(SAME))):
        compare(tools.assembled(texts), reader.ground(*texts))


def test_this_package_refuses_what_is_wrong_too():
    """But for what it understands, and the checker need not."""
    assert {new for new, texts in changed_texts(WRONG) if not isinstance(read_here(texts)[0], str)} == set(
        TABLES["only here"]
    )


EVALUATED = ("no initial value", "division by", "assignment and another change")
"""What is found out where values are computed, not by what reads a text."""


def drawn(seed):
    """The first change, and texts that both readers know before they are changed once or twice."""
    random, texts = Random(seed), None
    while texts is None:
        texts = known_texts(random.choice([0, 0, 0, 1, 1, 1, 1, 2, 2, 3]), random.randrange(500))
    name, texts = changed(texts, random)
    return name, changed(texts, random)[1] if random.random() < 0.2 else texts


@cache
def known_texts(kind, number):
    """Texts of a kind, if both readers know them."""
    if kind > 1:
        return [[*TEXTS, ""], OTHERS["beside"]][kind - 2]
    texts = [*[random_texts, tangled_texts][kind](number), ""]
    return None if isinstance(read_here(texts)[0], str) or isinstance(read_there(texts)[0], str) else texts


def read_here(texts):
    """The plan, or why this package refuses the texts; and what it says of repairs."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            return tools.assembled(texts), [str(one.message) for one in said]
        except RobustError as error:
            return str(error), []


def read_there(texts):
    """What the checker reads, or why it does not; and whether all obligations and effects have a"""
    try:
        ground = reader.ground(*texts)
    except (reader.Unsupported, tomllib.TOMLDecodeError) as error:
        return str(error), False
    return ground, not meaningless(tools.CHECKER, texts)


def judged_change(seed):
    """The change, and what both readers make of it; AssertionError if the checker reads anything that it must not."""
    name, texts = drawn(seed)
    (plan, repairs), (ground, formulated) = read_here(texts), read_there(texts)
    if isinstance(plan, str):
        known = isinstance(ground, str) or (not formulated and any(reason in plan for reason in EVALUATED))
        assert known, (seed, name, plan)
        return name, "refused by both"
    state = "repaired, " if repairs else ""
    if isinstance(ground, str):
        return name, f"{state}refused by the checker"
    for repair in repairs:
        named = repair.split("'")[1]
        assert f"{named} as " in " ".join(ground.model.guessed), (seed, name, repair)
    compare(plan, ground)
    if formulated:
        judged(plan, ground, Random(seed), 2)
    return name, f"{state}read by both"


@pytest.mark.parametrize(
    ("first", "count"),
    [(0, 100), *(pytest.param(first, 2_500, marks=pytest.mark.slow) for first in range(10_000, 30_000, 2_500))],
)
def test_what_is_refused_or_repaired_here_proves_nothing(first, count):
    changes = [judged_change(seed) for seed in range(first, first + count)]
    states = Counter(state for _, state in changes)
    assert states["refused by both"] > 50
    assert states["read by both"] > 6
    assert states["repaired, read by both"] > 0
    assert len({name for name, state in changes if state == "refused by both"}) == 8
