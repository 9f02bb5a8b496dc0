"""Random plans as texts: domains with types, quantifiers, conditional and continuous effects, and networks for them."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

OBJECTS = {"a": "t1", "b": "t1", "c": "t2"}
SUBTYPES = {"t0": ("a", "b", "c"), "t1": ("a", "b"), "t2": ("c",), "object": ("a", "b", "c")}
HALF = Fraction(1, 2)


class Texts(NamedTuple):
    """Domain, problem and plan."""

    domain: str
    problem: str
    plan: str


def random_texts(seed: int, *, instances: int = 3, easy: bool = False) -> Texts:
    """A small random plan; an easy one has few conditions, so that it is often valid."""
    return _Drawing(Random(seed), instances, easy).texts()


class _Drawing:
    def __init__(self, random: Random, instances: int, easy: bool) -> None:
        self.random = random
        self.easy = easy
        self.count = random.randint(1, instances)
        self.parameters = [f"k{index}" for index in range(random.randint(0, 2))]
        self.shared = "s" if random.random() < 0.15 else None

    def chance(self, probability: float) -> bool:
        return self.random.random() < probability

    def number(self) -> str:
        return self.random.choice(["0", "1", "2", "3", "0.5", "1.5", "(- 1)", "(/ 1 3)", "-2", "5e-1"])

    # -- expressions and conditions --------------------------------------------------------------------------------

    def fluent(self, objects: list[str]) -> str:
        return self.random.choice(["(f)", "f", f"(g {self.random.choice(objects)})", "(h)"])

    def written(self, objects: list[str]) -> str:
        return self.random.choice(["(f)", f"(g {self.random.choice(objects)})"])

    def expression(self, objects: list[str], *, duration: bool, own: bool = False) -> str:
        kind = self.random.randrange(9)
        if kind < 3:
            return self.number()
        if kind < 5:
            return self.fluent(objects)
        if kind == 5 and duration:
            return "?duration"
        if kind == 6 and (own or self.shared):
            return "?own" if own else f"?{self.shared}"
        if kind == 7:
            return f"(- {self.fluent(objects)} {self.fluent(objects)})"
        operator = self.random.choice(["+", "-", "* 2", "* (h)"])
        rest = self.expression(objects, duration=duration, own=own)
        return f"({operator} {rest})" if operator[0] == "*" else f"({operator} {self.number()} {rest})"

    def atom(self, objects: list[str]) -> str:
        pick = self.random.choice
        return pick([f"(p {pick(objects)})", "(q)", f"(r {pick(objects)} {pick(objects)})"])

    def condition(  # noqa: PLR0911 - one return for each way
        self, objects: list[str], *, duration: bool = False, depth: int = 0
    ) -> str:
        kind = self.random.randrange(12 if depth < 2 else 7)
        inner = [self.condition(objects, duration=duration, depth=depth + 1) for _ in range(2)] if kind > 6 else []
        if kind < 3:
            return self.atom(objects)
        if kind == 3:
            return f"(not {self.atom(objects)})"
        if kind < 6:
            relation = self.random.choice(["<", "<=", ">", ">=", "="])
            right = self.expression(objects, duration=duration)
            return f"({relation} {self.fluent(objects)} {right})"
        if kind == 6:
            return f"(= {self.random.choice(objects)} {self.random.choice(objects)})"
        if kind < 9:
            return f"({self.random.choice(['and', 'or', 'imply'])} {inner[0]} {inner[1]})"
        if kind == 9:
            return f"(not (and {inner[0]} {inner[1]}))"
        variable, chosen = f"?v{depth}", self.random.choice([*SUBTYPES])
        body = self.condition([*objects, variable], duration=duration, depth=depth + 1)
        return f"({self.random.choice(['forall', 'exists'])} ({variable} - {chosen}) {body})"

    # -- actions -----------------------------------------------------------------------------------------------------

    def effect(self, objects: list[str], *, duration: bool, depth: int = 0) -> str:
        kind = self.random.randrange(10 if depth < 2 else 7)
        if kind < 3:
            return self.atom(objects)
        if kind == 3:
            return f"(not {self.atom(objects)})"
        if kind < 7:
            operator = self.random.choice(["increase", "decrease", "assign", "increase", "scale-up"])
            amount = "2" if operator == "scale-up" else self.expression(objects, duration=duration)
            return f"({operator} {self.written(objects)} {amount})"
        inner = self.effect([*objects, f"?w{depth}"] if kind == 9 else objects, duration=duration, depth=depth + 1)
        if kind == 7:
            return f"(and {inner} {self.atom(objects)})"
        if kind == 8:
            return f"(when {self.condition(objects, depth=1)} {inner})"
        return f"(forall (?w{depth} - {self.random.choice(['t1', 't2'])}) {inner})"

    def action(self, index: int) -> str:
        durative, own = self.chance(0.75), self.chance(0.2)
        variables = {f"?x{i}": self.random.choice(["t1", "t2", "t0"]) for i in range(self.random.randint(0, 2))}
        self.signatures.append((durative, own, list(variables.values())))
        objects = [*variables, "a", "c"]
        listed = " ".join(f"{name} - {kind}" for name, kind in variables.items())
        synth = "(:synth-parameters ?own)" if own else ""
        few = 1 if self.easy else 3
        if not durative:
            effects = " ".join(self.effect(objects, duration=False) for _ in range(self.random.randint(0, 2)))
            condition = self.condition(objects) if self.chance(0.3 if self.easy else 0.7) else "()"
            return (
                f"(:action act{index} :parameters ({listed}) {synth} :precondition {condition} :effect (and {effects}))"
            )
        bound = self.random.choice(
            ["(= ?duration (h))", "(and (>= ?duration 1) (<= ?duration 4))", "(>= ?duration 1/2)"]
        )
        bound = bound.replace("1/2", "?own" if own else "0.5")
        timing = ["(at start {})", "(at end {})", "(over all {})"]
        conditions = [
            self.random.choice(timing).format(self.condition(objects, duration=True))
            for _ in range(self.random.randint(0, few))
        ]
        effects = [
            self.random.choice(timing[:2]).format(self.effect(objects, duration=True))
            for _ in range(self.random.randint(0, 3))
        ]
        if self.chance(0.3):
            rate = self.random.choice(["1", "(h)", "(- 2)", "?own" if own else "0.5"])
            update = self.random.choice(["increase", "decrease"])
            effects.append(f"({update} {self.written(objects)} (* #t {rate}))")
        return (
            f"(:durative-action act{index} :parameters ({listed}) {synth} :duration {bound}\n"
            f"  :condition (and {' '.join(conditions)}) :effect (and {' '.join(effects)}))"
        )

    # -- files -------------------------------------------------------------------------------------------------------

    def texts(self) -> Texts:
        self.signatures: list[tuple[bool, bool, list[str]]] = []
        actions = [self.action(index) for index in range(self.random.randint(1, 2))]
        shared = f"(:synth-parameters ?{self.shared})" if self.shared else ""
        domain = (
            "(define (domain d) (:requirements :typing :fluents :durative-actions)\n"
            f"(:types t1 t2 - t0 t0) (:constants a - t1 c - t2) {shared}\n"
            "(:predicates (p ?x - t0) (q) (r ?x ?y - object))\n(:functions (f) (g ?x - t0) (h) - number)\n"
            + "\n".join(actions)
            + ")\n"
        )
        facts = [f"(p {name})" for name in OBJECTS if self.chance(0.5)] + (["(q)"] if self.chance(0.5) else [])
        facts += [f"(= (f) {self.number_or_plain()})", f"(= (h) {self.random.choice(['1', '2', '3/2'[:1]])})"]
        facts += [f"(= (g {name}) {self.number_or_plain()})" for name in OBJECTS]
        for _ in range(self.random.choice([0, 0, 1, 2])):
            what = self.random.choice(["(p b)", "(not (q))", "(q)", "(= (f) 2)"])
            facts.append(f"(at {self.random.choice(['1', '2.5', '4'])} {what})")
        facts = list(dict.fromkeys(facts))
        goal = self.condition(["a", "c"]) if self.chance(0.3 if self.easy else 0.7) else "(and)"
        problem = (
            "(define (problem x) (:domain d) (:objects b - t1)\n"
            f"(:init {' '.join(facts)})\n(:goal {goal}) (:metric minimize (total-time)))\n"
        )
        return Texts(domain, problem, self.plan())

    def number_or_plain(self) -> str:
        return self.random.choice(["0", "1", "2", "(- 1)", "0.25"])

    def plan(self) -> str:
        declared, lines, points = list(self.parameters), list[str](), dict[str, Fraction]()
        names: list[tuple[str, bool]] = []
        for index in range(self.count):
            number = self.random.randrange(len(self.signatures))
            durative, own, kinds = self.signatures[number]
            name = f"i{index}"
            declared += [f"{name}.own"] if own else []
            arguments = " ".join([f"act{number}", *(self.random.choice(SUBTYPES[kind]) for kind in kinds)])
            lines.append(f"{'durative-action' if durative else 'action'} instance {name} : ({arguments});")
            start = Fraction(self.random.randint(0, 10), 2)
            points[f"{name}.start" if durative else name] = start
            if durative:
                points[f"{name}.end"] = start + Fraction(self.random.randint(2, 6), 2)
            names.append((name, durative))
        declared += [self.shared] if self.shared else []
        heads = []
        for name in declared:
            nominal = self.random.choice(["1", "2", "3/2"])
            bounds = self.random.choice(["", " lb 0", " lb 0 ub 4", " ub 3"])
            heads.append(f"parameter {name} weight {self.random.choice(['1', '2'])} default {nominal}{bounds};")
        lines += [self.bounded(".zero", Fraction(0), point, time) for point, time in points.items() if self.chance(0.9)]
        for name, durative in names:
            if durative and self.chance(0.9):
                lines.append(
                    self.bounded(f"{name}.start", points[f"{name}.start"], f"{name}.end", points[f"{name}.end"])
                )
        for source, target in zip(points, list(points)[1:], strict=False):
            if self.chance(0.4):
                lines.append(self.bounded(source, points[source], target, points[target]))
        used = " ".join(lines)
        for name in self.parameters:
            if name not in used:
                source, target = self.random.choice([*points]), self.random.choice([*points])
                lines.append(f"c: {target} - {source} in [-inf, inf]; c: {target} - .zero in [-inf, 9];")
                lines.append(
                    f"c: {next(iter(points))} - .zero in [0, {name}];"
                    if self.chance(0.5)
                    else f"c: .zero - {next(iter(points))} in [-inf, {name}];"
                )
        return "\n".join([*heads, *lines]) + "\n"

    def bounded(self, source: str, start: Fraction, target: str, end: Fraction) -> str:
        distance = end - start
        kind = self.random.randrange(4)
        low, high = (distance, distance) if kind < 2 else (distance - HALF, distance + self.random.choice([0, 1, 2]))
        texts = [str(low), str(high)]
        if self.parameters and self.chance(0.4):
            chosen = self.random.choice(self.parameters)
            texts = [chosen, chosen] if kind < 2 else [texts[0], chosen] if self.chance(0.5) else [chosen, "inf"]
        return f"c: {target} - {source} in [{texts[0]}, {texts[1]}];"


def tangled_texts(seed: int) -> Texts:
    """A plan whose effects act on the same few things in an order that its network mostly leaves open.

    What changes only if something holds depends on what changes without conditions, so that nothing goes in a circle.
    """
    random = Random(seed)
    pick, number = random.choice, lambda: random.choice(["0", "1", "2", "-1", "0.5"])

    def condition() -> str:
        relation = f"({pick(['<', '<=', '>', '>=', '='])} {pick(['(f)', '(g)'])} {number()})"
        return pick(["(a)", "(p)", "(not (p))", relation, relation, f"(or (p) {relation})", f"(and (a) {relation})"])

    def effect() -> str:
        amount = pick([number(), number(), "(g)", "?duration", "(+ (g) 1)", "(* 2 (g))", "(- (g))", "(/ (g) 2)"])
        change = pick([pick(["(p)", "(not (p))"]), f"({pick(['assign', 'increase', 'decrease'])} (f) {amount})"])
        guard = pick(["(a)", "(not (a))", f"(>= (g) {number()})", f"(and (a) (< (g) {number()}))"])
        plain = pick(["(a)", "(not (a))", f"({pick(['assign', 'increase'])} (g) {number()})"])
        return pick([plain, change, f"(when {guard} {change})"])

    actions, lines, starts = [], [], list[str]()
    for index in range(random.randint(2, 3)):
        effects = [f"(at {pick(['start', 'end'])} {effect()})" for _ in range(random.randint(2, 4))]
        rate = f"({pick(['increase', 'decrease'])} {pick(['(f)', '(f)', '(g)'])} (* #t {pick(['1', '2', '(h)'])}))"
        effects += [rate] if random.random() < 0.4 else []
        asked = f"({pick(['at start', 'at end', 'over all', 'over all'])} {condition()})"
        actions.append(
            f"(:durative-action d{index} :parameters () :duration (<= ?duration {pick(['2', '3', '(h)'])})"
            f" :condition (and {asked}) :effect (and {' '.join(effects)}))"
        )
        lines.append(f"durative-action instance i{index} : (d{index});")
        lines.append(f"c: i{index}.end - i{index}.start in [{pick(['0.5', '1'])}, {pick(['3', 'k'])}];")
        starts += [f"i{index}.start", f"i{index}.end"]
    for index in range(2):
        actions.append(f"(:action w{index} :parameters () :precondition {condition()} :effect ())")
        lines.append(f"action instance v{index} : (w{index});")
        starts.append(f"v{index}")
    lines += [f"c: {point} - .zero in [0, {pick(['4', '6'])}];" for point in starts]
    for _ in range(random.randint(0, 3)):
        target, source = random.sample(starts, 2)
        lines.append(f"c: {target} - {source} in [{pick(['0.001', '-1', '-2'])}, {pick(['4', 'inf'])}];")
    facts = [each for each in ("(a)", "(p)") if random.random() < 0.5]
    facts += [f"(= (f) {number()})", f"(= (g) {number()})", f"(= (h) {pick(['1', '2'])})"]
    return Texts(
        "(define (domain d) (:predicates (a) (p)) (:functions (f) (g) (h))\n" + "\n".join(actions) + ")\n",
        f"(define (problem x) (:domain d) (:init {' '.join(facts)}) (:goal {condition()}))\n",
        "\n".join(["parameter k default 2 lb 1 ub 4;", *lines]) + "\n",
    )


# -- changes that make texts wrong, or mean something else -------------------------------------------------------------

Forms = Any
"""Words, and lists of forms."""
PARTS: dict[str, Any] = json.loads(Path(__file__).with_name("data").joinpath("texts.json").read_text(encoding="utf-8"))
"""Words and forms that stand where they have no meaning, or another one (`odd`), sections, statements of plans, lines
beside a plan, bounds; and what looks or sorts like a character, or becomes it in lower case (`letters`)."""


def forms(text: str) -> Forms:
    """The forms of a text without comments."""
    stack: list[Forms] = [[]]
    for word in re.findall(r";[^\n]*|[()]|[^\s();]+", text):
        if word == "(":
            stack.append([])
        elif word == ")" and len(stack) > 1:
            done = stack.pop()
            stack[-1].append(done)
        elif word[0] not in ";)":
            stack[-1].append(word)
    return stack[0]


def printed(form: Forms) -> str:
    return form if isinstance(form, str) else f"({' '.join(map(printed, form))})"


def changed(texts: Sequence[str], random: Random) -> tuple[str, list[str]]:
    """The name of a change, and domain, problem, plan, and the parameters beside it, with one such change."""
    ways: list[Callable[[Sequence[str], Random], list[str]]]
    ways = [_renamed, _lettered, _joined, _cut, _section, _plan, _plan, _beside, *[_form] * 7]
    way = random.choice(ways)
    return way.__name__[1:], way(texts, random)


def _instead(texts: Sequence[str], place: int, text: str) -> list[str]:
    return [text if number == place else each for number, each in enumerate(texts)]


def _renamed(texts: Sequence[str], random: Random) -> list[str]:
    """Something is called by another name, everywhere."""
    old, new = (
        random.choice(re.findall(r"\??[A-Za-z]\w*", texts[random.randrange(3)])),
        random.choice(PARTS["odd"].split()),
    )
    return [re.sub(rf"(?<![\w?:#-]){re.escape(old)}(?![\w-])", lambda _: new, text) for text in texts]


def _lettered(texts: Sequence[str], random: Random) -> list[str]:
    """One character, or all of a kind in one file, are others."""
    place, old = random.choice([0, 0, 1, 2]), random.choice([*PARTS["letters"]])
    new, text = random.choice(PARTS["letters"][old]), texts[place]
    where = [match.start() for match in re.finditer(re.escape(old), text)]
    if not where or random.random() < 0.3:
        return _instead(texts, place, text.replace(old, new))
    at = random.choice(where)
    return _instead(texts, place, text[:at] + new + text[at + random.randrange(2) :])


def _joined(texts: Sequence[str], random: Random) -> list[str]:
    """Words without the blank between them, or parts of a word with one."""
    place = random.choice([0, 0, 1, 2])
    old, new = random.choice([("- ", "-"), (" -", "-"), (" ", ""), ("-", "- "), ("?", "? "), ("(", " (( "), (")", "")])
    where = [match.start() for match in re.finditer(re.escape(old), texts[place])] or [0]
    at = random.choice(where)
    return _instead(texts, place, texts[place][:at] + new + texts[place][at + len(old) :])


def _cut(texts: Sequence[str], random: Random) -> list[str]:
    """Some characters are missing, or something is said after the end."""
    place, text = random.choice([0, 0, 1, 2]), random.choice(PARTS["odd"].split())
    at = random.randrange(len(texts[place]) + 1)
    more = texts[place][at + random.randint(1, 5) :] if random.random() < 0.8 else f"{texts[place][at:]} {text}"
    return _instead(texts, place, texts[place][:at] + more)


def _section(texts: Sequence[str], random: Random) -> list[str]:
    """A section more, one twice, or one in the other file."""
    place = random.randrange(2)
    top = forms(texts[place]) or [[]]
    others = [form for form in forms(texts[random.randrange(2)]) if isinstance(form, list)] or [[[]]]
    new = random.choice([forms(random.choice(PARTS["sections"])), random.choice(others)])
    if isinstance(top[0], list):
        top[0].insert(random.randint(2, max(2, len(top[0]))), random.choice(new or [[]]))
    return _instead(texts, place, "\n".join(map(printed, top)))


def _form(texts: Sequence[str], random: Random) -> list[str]:
    """A form or word is missing, twice, elsewhere, another one, inside something, or what is inside of it."""
    place = random.choice([0, 0, 1])
    top, other = forms(texts[place]), forms(texts[random.randrange(2)])
    inner = random.choice(_parents(top))
    if not inner:
        return list(texts)
    at = random.randrange(len(inner))
    new = random.choice(forms(PARTS["odd"]) if random.random() < 0.5 else random.choice(_parents(other)) or [[]])
    word = inner[at]
    if isinstance(word, str) and random.random() < 0.4:  # another word of its class
        words = [each for form in _parents(top) for each in form if isinstance(each, str)]
        new = random.choice(
            [each for each in words if each[0].isalpha() == word[0].isalpha() and each[0] != ":"] or [word]
        )
    way = random.randrange(8)
    if way < 3:
        inner[at] = new
    elif way == 3:
        inner.insert(at, new)
    elif way == 4:
        inner.insert(random.randint(0, len(inner)), word)
    elif way == 5:
        del inner[at]
    elif way == 6:
        wraps = "(and X)|(not X)|(or X X)|(at start X)|(at end X)|(over all X)|(forall (?n - t1) X)|(X)|(imply X X)"
        inner[at : at + 1] = forms(random.choice(wraps.split("|")).replace("X", printed(word)))
    else:
        inner[at : at + 1] = word if isinstance(word, list) else [word[::-1]]
    return _instead(texts, place, "\n".join(map(printed, top)))


def _parents(form: Forms) -> list[Forms]:
    return [form, *(each for inner in form if isinstance(inner, list) for each in _parents(inner))]


def _plan(texts: Sequence[str], random: Random) -> list[str]:
    """A word of the plan is missing, twice or another one, or a statement is, or there is another one."""
    if random.random() < 0.4:
        statements = [each for each in texts[2].split(";") if each.strip()] or [""]
        more = random.choice(PARTS["statements"]).rstrip(";")
        at = random.randrange(len(statements))
        statements[at : at + random.randrange(2)] = [random.choice([more, random.choice(statements)])]
        return _instead(texts, 2, "".join(f"{each};\n" for each in statements))
    words = re.findall(r"\s+|[\w.-]+|[^\w.\s-]", texts[2]) or [""]
    at = random.randrange(len(words))
    words[at : at + random.randrange(2)] = [random.choice([random.choice(PARTS["bounds"]), random.choice(words), ""])]
    return _instead(texts, 2, "".join(words))


def _beside(texts: Sequence[str], random: Random) -> list[str]:
    """Other parameters beside the plan."""
    lines = PARTS["beside"]
    return [
        *texts[:3],
        "\n".join([random.choice(lines[:1] * 3 + lines), *random.choices(lines, k=random.randint(0, 3))]),
    ]
