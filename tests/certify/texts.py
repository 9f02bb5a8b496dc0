"""Random plans as texts: domains with types, quantifiers, conditional and continuous effects, and networks for them."""

from __future__ import annotations

import json
import re
from fractions import Fraction
from pathlib import Path
from random import Random
from typing import NamedTuple

PARTS = json.loads(Path(__file__).with_name("data").joinpath("texts.json").read_text(encoding="utf-8"))
"""Words and forms that stand where they have no meaning, or another one (`odd`), sections, statements of plans, lines
beside a plan, bounds; what looks or sorts like a character, or becomes it in lower case (`letters`); and the grammar of
random texts: `{name}` stands for something of that name, and inside of deep forms `name_inside` is what is left."""
OBJECTS = ["a", "b", "c"]
SUBTYPES = {"t0": OBJECTS, "t1": ["a", "b"], "t2": ["c"]}
HALF = Fraction(1, 2)


class Texts(NamedTuple):
    """Domain, problem and plan."""

    domain: str
    problem: str
    plan: str


class Grammar:
    """Draws from the grammar; own and shared parameters, and durations, are those of the action that is drawn."""

    def __init__(self, random):
        self.random, self.pick = random, random.choice
        self.timed, self.own, self.shared = False, False, ""

    def chance(self, probability):
        return self.random.random() < probability

    def draw(self, name, objects=("a", "c"), depth=0):
        inside = f"{name}_inside"
        template = self.pick(PARTS["grammar"][inside if depth > 1 and inside in PARTS["grammar"] else name])
        variable = f"?{name[0]}{depth}"
        known = [*objects, variable] if "{variable}" in template else objects

        def drawn(match):
            part = match[1]
            fixed = {"variable": variable, "own": "?own" if self.own else "0.5", "duration": "?duration"}
            fixed |= {"shared": f"?{self.shared}"}
            if part in ("duration", "shared") and not (self.timed if part == "duration" else self.shared):
                return self.draw("sum", known, depth)
            if part == "untimed":
                timed, self.timed = self.timed, False
                condition = self.draw("condition", known, 1)
                self.timed = timed
                return condition
            if part == "object":
                return self.pick(known)
            return fixed.get(part) or self.draw(part, known, depth + (part == name))

        return re.sub(r"\{(\w+)\}", drawn, template)

    def some(self, name, most, objects):
        return [self.draw(name, objects) for _ in range(self.random.randint(0, most))]


def random_texts(seed, *, instances=3, easy=False):
    """A small random plan; an easy one has few conditions, so that it is often valid."""
    return _Drawing(Random(seed), instances, easy).texts()


class _Drawing(Grammar):
    def __init__(self, random, instances, easy):
        super().__init__(random)
        self.easy = easy
        self.count = random.randint(1, instances)
        self.parameters = [f"k{index}" for index in range(random.randint(0, 2))]
        self.shared = "s" if self.chance(0.15) else ""
        self.signatures = []

    def action(self, index):
        self.timed, self.own = self.chance(0.75), self.chance(0.2)
        variables = {f"?x{i}": self.pick([*SUBTYPES]) for i in range(self.random.randint(0, 2))}
        self.signatures.append((self.timed, self.own, list(variables.values())))
        objects = [*variables, "a", "c"]
        listed = " ".join(f"{name} - {kind}" for name, kind in variables.items())
        synth = "(:synth-parameters ?own)" if self.own else ""
        if not self.timed:
            condition = self.draw("condition", objects) if self.chance(0.3 if self.easy else 0.7) else "()"
            head, rest = ":action", f":precondition {condition}"
            effects = self.some("effect", 2, objects)
        else:
            conditions = self.some("timed_condition", 1 if self.easy else 3, objects)
            head = ":durative-action"
            rest = f":duration {self.draw('bound')}\n  :condition (and {' '.join(conditions)})"
            effects = self.some("timed_effect", 3, objects)
            effects += [self.draw("rate", objects)] if self.chance(0.3) else []
        return f"({head} act{index} :parameters ({listed}) {synth} {rest} :effect (and {' '.join(effects)}))"

    def texts(self):
        actions = [self.action(index) for index in range(self.random.randint(1, 2))]
        self.timed = False
        shared = f"(:synth-parameters ?{self.shared})" if self.shared else ""
        domain = (
            "(define (domain d) (:requirements :typing :fluents :durative-actions)\n"
            f"(:types t1 t2 - t0 t0) (:constants a - t1 c - t2) {shared}\n"
            "(:predicates (p ?x - t0) (q) (r ?x ?y - object))\n(:functions (f) (g ?x - t0) (h) - number)\n"
            + "\n".join(actions)
            + ")\n"
        )
        facts = [fact for fact in ("(p a)", "(p b)", "(p c)", "(q)") if self.chance(0.5)]
        facts += [f"(= {fluent} {self.draw('initial')})" for fluent in ("(f)", "(g a)", "(g b)", "(g c)")]
        facts += [f"(= (h) {self.pick('123')})", *(self.draw("later") for _ in range(self.pick([0, 0, 1, 2])))]
        goal = self.draw("condition") if self.chance(0.3 if self.easy else 0.7) else "(and)"
        problem = (
            "(define (problem x) (:domain d) (:objects b - t1)\n"
            f"(:init {' '.join(dict.fromkeys(facts))})\n(:goal {goal}) (:metric minimize (total-time)))\n"
        )
        return Texts(domain, problem, self.plan())

    def plan(self):
        """Instances at times that are drawn first, and constraints around these."""
        declared, lines, points, spans = list(self.parameters), [], {}, []
        for name in (f"i{index}" for index in range(self.count)):
            number = self.random.randrange(len(self.signatures))
            durative, own, kinds = self.signatures[number]
            declared += [f"{name}.own"] if own else []
            arguments = " ".join([f"act{number}", *(self.pick(SUBTYPES[kind]) for kind in kinds)])
            lines.append(f"{'durative-action' if durative else 'action'} instance {name} : ({arguments});")
            start = Fraction(self.random.randint(0, 10), 2)
            points[f"{name}.start" if durative else name] = start
            if durative:
                points[f"{name}.end"] = start + Fraction(self.random.randint(2, 6), 2)
                spans += [(f"{name}.start", f"{name}.end")]
        heads = []
        for name in [*declared, *self.shared]:
            bounds = self.pick(["", " lb 0", " lb 0 ub 4", " ub 3"])
            heads.append(f"parameter {name} weight {self.pick('12')} default {self.pick(['1', '2', '3/2'])}{bounds};")
        pairs = [(".zero", point) for point in points if self.chance(0.9)]
        pairs += [pair for pair in spans if self.chance(0.9)]
        pairs += [pair for pair in zip(points, list(points)[1:], strict=False) if self.chance(0.4)]
        times = {".zero": Fraction(0), **points}
        lines += [self.bounded(source, target, times[target] - times[source]) for source, target in pairs]
        first = next(iter(points))
        for name in (name for name in self.parameters if name not in " ".join(lines)):
            source, target = self.pick([*points]), self.pick([*points])
            lines.append(f"c: {target} - {source} in [-inf, inf]; c: {target} - .zero in [-inf, 9];")
            lines.append(self.pick([f"c: {first} - .zero in [0, {name}];", f"c: .zero - {first} in [-inf, {name}];"]))
        return "\n".join([*heads, *lines]) + "\n"

    def bounded(self, source, target, distance):
        exact = self.chance(0.5)
        low, high = (distance, distance) if exact else (distance - HALF, distance + self.pick([0, 1, 2]))
        texts = [str(low), str(high)]
        if self.parameters and self.chance(0.4):
            chosen = self.pick(self.parameters)
            texts = [chosen, chosen] if exact else self.pick([[texts[0], chosen], [chosen, "inf"]])
        return f"c: {target} - {source} in [{texts[0]}, {texts[1]}];"


def tangled_texts(seed):
    """A plan whose effects act on the same few things in an order that its network mostly leaves open.

    What changes only if something holds depends on what changes without conditions, so that nothing goes in a circle.
    """
    grammar = Grammar(Random(seed))
    draw, random = grammar.draw, grammar.random
    acts = range(random.randint(2, 3))
    actions = [draw("tangled_action").replace("N", str(index)) for index in acts]
    actions += [draw("tangled_watch").replace("N", str(index)) for index in range(2)]
    lines = [draw("tangled_instance").replace("N", str(index)) for index in acts]
    lines += [draw("watch_instance").replace("N", str(index)) for index in range(2)]
    points = [f"i{index}.{end}" for index in acts for end in ("start", "end")] + ["v0", "v1"]
    pairs = (random.sample(points, 2) for _ in range(random.randint(0, 3)))
    lines += [f"c: {target} - {source} in {draw('tangled_bound')};" for target, source in pairs]
    return Texts(
        "(define (domain d) (:predicates (a) (p)) (:functions (f) (g) (h))\n" + "\n".join(actions) + ")\n",
        f"(define (problem x) (:domain d) (:init {draw('tangled_initial')}) (:goal {draw('some_condition')}))\n",
        "\n".join(["parameter k default 2 lb 1 ub 4;", *lines]) + "\n",
    )


def forms(text):
    """The forms of a text without comments."""
    stack = [[]]
    for word in re.findall(r";[^\n]*|[()]|[^\s();]+", text):
        if word == "(":
            stack.append([])
        elif word == ")" and len(stack) > 1:
            done = stack.pop()
            stack[-1].append(done)
        elif word[0] not in ";)":
            stack[-1].append(word)
    return stack[0]


def printed(form):
    return form if isinstance(form, str) else f"({' '.join(map(printed, form))})"


def changed(texts, random):
    """The name of a change, and domain, problem, plan, and the parameters beside it, with one such change."""
    change = _Change(texts, random)
    way = random.choice([*change.ways, change.plan, *[change.form] * 6])
    return way.__name__, list(way() or change.texts)


class _Change:
    """Ways to change a text in one of the files, most often the domain."""

    def __init__(self, texts, random):
        self.texts, self.random, self.pick = [*texts], random, random.choice
        self.place = self.pick([0, 0, 1, 2])
        self.ways = [self.renamed, self.lettered, self.joined, self.cut, self.section]
        self.ways += [self.plan, self.beside, self.form]

    def chance(self, probability):
        return self.random.random() < probability

    def instead(self, old, new, more):
        """One occurrence, if there is any, is another text."""
        text = self.texts[self.place]
        at = self.pick([match.start() for match in re.finditer(re.escape(old), text)] or [0])
        self.texts[self.place] = text[:at] + new + text[at + more :]

    def renamed(self):
        """Something is called by another name, everywhere."""
        old, new = self.pick(re.findall(r"\??[A-Za-z]\w*", self.pick(self.texts[:3]))), self.pick(PARTS["odd"].split())
        return [re.sub(rf"(?<![\w?:#-]){re.escape(old)}(?![\w-])", lambda _: new, text) for text in self.texts]

    def lettered(self):
        """One character, or all of a kind in one file, are others."""
        old = self.pick([*PARTS["letters"]])
        new, text = self.pick(PARTS["letters"][old]), self.texts[self.place]
        if old not in text or self.chance(0.3):
            self.texts[self.place] = text.replace(old, new)
        else:
            self.instead(old, new, self.random.randrange(2))

    def joined(self):
        """Words without the blank between them, or parts of a word with one."""
        old, new = self.pick(PARTS["joined"])
        self.instead(old, new, len(old))

    def cut(self):
        """Some characters are missing, or something is said after the end."""
        text = self.texts[self.place]
        at = self.random.randrange(len(text) + 1)
        more = text[at + self.random.randint(1, 5) :] if self.chance(0.8) else f"{text[at:]} {self.odd_word()}"
        self.texts[self.place] = text[:at] + more

    def odd_word(self):
        return self.pick(PARTS["odd"].split())

    def forms(self):
        """Those of the domain or the problem."""
        return forms(self.pick(self.texts[:2]))

    def section(self):
        """A section more, one twice, or one in the other file."""
        self.place = self.random.randrange(2)
        top = forms(self.texts[self.place]) or [[]]
        others = [form for form in self.forms() if isinstance(form, list)] or [[[]]]
        new = self.pick([forms(self.pick(PARTS["sections"])), self.pick(others)])
        if isinstance(top[0], list):
            top[0].insert(self.random.randint(2, max(2, len(top[0]))), self.pick(new or [[]]))
        self.texts[self.place] = "\n".join(map(printed, top))

    def form(self):
        """A form or word is missing, twice, elsewhere, another one, inside something, or what is inside of it."""
        self.place = self.pick([0, 0, 1])
        top = forms(self.texts[self.place])
        inner = self.pick(_parents(top))
        if not inner:
            return
        at, way = self.random.randrange(len(inner)), self.random.randrange(8)
        word = inner[at]
        new = self.pick(forms(PARTS["odd"]) if self.chance(0.5) else self.pick(_parents(self.forms())) or [[]])
        if isinstance(word, str) and self.chance(0.4):  # another word of its class
            words = [each for form in _parents(top) for each in form if isinstance(each, str) and each[0] != ":"]
            new = self.pick([each for each in words if each[0].isalpha() == word[0].isalpha()] or [word])
        if way < 6:
            inner[at : at + 1] = [[new], [new], [new], [new, word], [], [word]][way]
            again = self.random.randint(0, len(inner))
            inner[again:again] = [word] * (way == 5)
        elif way == 6:
            inner[at : at + 1] = forms(self.pick(PARTS["wraps"]).replace("X", printed(word)))
        else:
            inner[at : at + 1] = word if isinstance(word, list) else [word[::-1]]
        self.texts[self.place] = "\n".join(map(printed, top))

    def plan(self):
        """A word of the plan is missing, twice or another one, or a statement is, or there is another one."""
        if self.chance(0.4):
            parts = [f"{each};\n" for each in self.texts[2].split(";") if each.strip()] or [""]
            new = self.pick([self.pick(PARTS["statements"]).rstrip(";") + ";\n", self.pick(parts)])
        else:
            parts = re.findall(r"\s+|[\w.-]+|[^\w.\s-]", self.texts[2]) or [""]
            new = self.pick([self.pick(PARTS["bounds"]), self.pick(parts), ""])
        at = self.random.randrange(len(parts))
        parts[at : at + self.random.randrange(2)] = [new]
        self.texts[2] = "".join(parts)

    def beside(self):
        """Other parameters beside the plan."""
        lines = PARTS["beside"]
        first = self.pick(lines[:1] * 3 + lines)
        return [*self.texts[:3], "\n".join([first, *self.random.choices(lines, k=self.random.randint(0, 3))])]


def _parents(form):
    return [form, *(each for inner in form if isinstance(inner, list) for each in _parents(inner))]
