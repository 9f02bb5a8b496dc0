"""What the files say: PDDL and `.stn` read with nothing but the standard library, and ground for the plan's instances.

Whatever is not understood is `Unsupported`, so that nothing is proved about it. Conditions are trees: `True`, `False`,
`("atom", a)`, `("not", c)`, `("and", ...)`, `("or", ...)` and comparisons `(">=", left, right)`; expressions are
`("number", n)`, `("parameter", name)`, `("duration",)`, `("fluent", f)` and operations `("+", ...)`. Atoms and fluents
are texts such as `(at rover base)`. All of a text stays in the trees, because what a text mentions counts as read.
"""

import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import product
from typing import Any

Tree = Any
Linear = dict[str, Fraction]
"""Coefficients by name; that of "" is the constant. No coefficient is zero."""
Fact = tuple[Linear, bool]
"""`expression >= 0`, or `> 0`."""


class Unsupported(Exception):
    """Nothing is proved, because this reader does not know what something means."""


def need(condition: object, message: str) -> None:
    if not condition:
        raise Unsupported(message)


NUMBER = re.compile(r"[+-]?(?:[0-9]+/[0-9]*[1-9][0-9]*|(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?)")


def number(text: Tree) -> Fraction:
    """A number as texts write it, exactly; PDDL may write `(- 3)`."""
    if type(text) is list and len(text) == 2 and text[0] == "-":
        return -number(text[1])
    need(type(text) is str and NUMBER.fullmatch(text), f"found {text!r}, expected a number")
    return Fraction(text)


WORD = re.compile(r"\s+|;[^\n]*|([()]|[^\s();]+)")


def parse(text: str, kind: str) -> list[Tree]:
    """The sections of one `(define (kind name) ...)` as lists of lists and lower-case words."""
    stack: list[list[Tree]] = [[]]
    for word in filter(None, WORD.findall(text.lower())):
        if word == "(":
            stack.append([])
            need(len(stack) < 150, "forms are nested too deeply")
        elif word == ")":
            done = stack.pop()
            need(stack, "found a ')' too many")
            stack[-1].append(done)
        else:
            stack[-1].append(word)
    need(len(stack) == 1 and len(stack[0]) == 1, f"expected one (define ({kind} ...) ...)")
    form = stack[0][0]
    need(form[:1] == ["define"], "expected (define ...)")
    sections = [words_of(each) for each in form[1:]]
    need(sections and len(sections[0]) == 2 and sections[0][0] == kind, f"expected a {kind}")
    return sections


def typed(words: list[Tree]) -> list[tuple[str, list[str]]]:
    """`a b - t c`: names, each with its types."""
    found: list[tuple[str, list[str]]] = []
    names: list[str] = []
    rest = iter(words)
    for word in rest:
        if word == "-":
            kind = next(rest, None)
            kinds = kind[1:] if type(kind) is list and kind[:1] == ["either"] else [kind]
            need(names and kinds and all(type(each) is str for each in kinds), "found a malformed type")
            found += [(name, list(map(str, kinds))) for name in names]
            names = []
        else:
            need(type(word) is str, "found a malformed list of names")
            names.append(word)
    return found + [(name, ["object"]) for name in names]


def words_of(tree: Tree, least: int = 0, most: int | None = None) -> list[Tree]:
    """A form with as many operands as that."""
    need(type(tree) is list and tree and type(tree[0]) is str, f"found {tree!r}, expected a form")
    need(least < len(tree) and (most is None or len(tree) <= most + 1), f"found {tree[0]} with other operands")
    return list(tree)


@dataclass(frozen=True)
class Action:
    """An action's text: `parameters` with their types, and `synth`, the envelope's parameters of each instance."""

    durative: bool
    parameters: list[tuple[str, list[str]]]
    synth: list[str]
    parts: Mapping[str, Tree]


@dataclass(frozen=True)
class Scope:
    """What variables stand for: objects, and parameters of the envelope."""

    bound: Mapping[str, str]
    synth: Mapping[str, str]
    durative: bool = False


PARTS = {
    ":durative-action": {":parameters", ":duration", ":condition", ":effect", ":synth-parameters"},
    ":action": {":parameters", ":precondition", ":effect", ":synth-parameters"},
}
KNOWN = {"domain", "problem", ":domain", ":types", ":constants", ":objects", ":predicates", ":functions", ":init"}
KNOWN |= {":goal", ":synth-parameters", ":requirements", ":metric", ":length"}
COMPARISONS = {"<", "<=", "=", ">=", ">"}
RESERVED = {"and", "or", "not", "imply", "forall", "exists", "when", "preference", "increase", "decrease", "assign"}
RESERVED |= {"scale-up", "scale-down", "either"}


class Model:
    """Domain and problem: declarations, actions, the initial state, timed initial literals, the goal."""

    def __init__(self, domain: str, problem: str) -> None:
        self.parents: dict[str, set[str]] = {"object": set()}
        self.objects, self.actions = dict[str, set[str]](), dict[str, Action]()
        self.predicates, self.functions = dict[str, int](), dict[str, int]()  # how many arguments they take
        self.split, self.guessed = dict[str, str](), set[str]()  # undeclared predicates of one type, and which are used
        self.initial, self.timed = dict[str, bool | Fraction](), dict[tuple[Fraction, str], bool | Fraction]()
        sections = [*parse(domain, "domain"), *parse(problem, "problem")]
        once = [each[0] for each in sections if each[0] not in (*PARTS, ":requirements")]
        twice = {each for each in once if once.count(each) > 1}
        need(not twice, f"found {twice} twice")
        parts = {each[0]: each[1:] for each in sections}
        need({":domain", ":init", ":goal"} <= parts.keys(), "expected :domain, :init and :goal in the problem")
        need(parts[":domain"] == parts["domain"], "the problem is of another domain")
        need(len(parts[":goal"]) == 1, "expected one goal")
        for name, kinds in typed(parts.get(":types", [])):
            need(name != "object" or kinds == ["object"], "found a type above 'object'")
            self.parents.setdefault(name, set()).update(kinds)
            for kind in kinds:
                self.parents.setdefault(kind, set())
        for name, kinds in typed([*parts.get(":constants", []), *parts.get(":objects", [])]):
            need(set(kinds) <= self.parents.keys(), f"found an unknown type of {name}")
            self.objects.setdefault(name, set()).update(*map(self.above, kinds))
        self.declare(self.predicates, parts.get(":predicates", []))
        functions = parts.get(":functions", [])
        need(all(type(each) is list or each in ("-", "number") for each in functions), "functions are numeric only")
        self.declare(self.functions, [each for each in functions if type(each) is list])
        need(not self.predicates.keys() & self.functions.keys(), "found a name that is predicate and function")
        self.synth = {each: each[1:] for each in self.parameters_in(parts.get(":synth-parameters", []))}
        self.goal = parts[":goal"][0]
        for kind, *rest in sections:
            need(kind in PARTS or kind in KNOWN, f"found {kind}, which is not supported")
            if kind in PARTS:
                self.action(kind, rest)
        for fact in parts[":init"]:
            self.fact(fact)

    def above(self, kind: str) -> set[str]:
        """A type and all types above it."""
        found, queue = {"object"}, [kind]
        while queue:
            each = queue.pop()
            if each not in found:
                found.add(each)
                queue += self.parents[each]
        return found

    def declare(self, table: dict[str, int], signatures: list[Tree]) -> None:
        """Predicates or functions; `(in ?x - (either a b))` may be written `(in_a ?x)` where it is used."""
        for signature in signatures:
            name, *parameters = words_of(signature)
            need(name not in table and name not in RESERVED, f"found a second or reserved {name}")
            table[name] = len(typed(parameters))
            several = (kinds for _, kinds in typed(parameters) if len(kinds) > 1)
            self.split.update((f"{name}_{kind}", name) for kinds in several for kind in kinds)

    @staticmethod
    def parameters_in(words: list[Tree]) -> list[str]:
        return [name for name, _ in typed(words[0] if len(words) == 1 and type(words[0]) is list else words)]

    def action(self, kind: str, rest: list[Tree]) -> None:
        need(rest and type(rest[0]) is str and rest[0] not in self.actions, "found an action without a name of its own")
        name, parts, keyword = rest[0], dict[str, list[Tree]](), ""
        for item in rest[1:]:
            section = item[:1] == [":synth-parameters"]
            if section or (type(item) is str and item[0] == ":"):
                keyword = item[0] if section else item
                need(keyword in PARTS[kind] and keyword not in parts, f"found {keyword} in {name}, or twice")
                parts[keyword] = item[1:] if section else []
            else:
                need(keyword, f"found {item!r} in {name}")
                parts[keyword].append(item)
        synth = self.parameters_in(parts.pop(":synth-parameters", []))
        need(all(len(part) == 1 and type(part[0]) is list for part in parts.values()), f"found {name} malformed")
        parameters = typed(parts.get(":parameters", [[]])[0])
        every = ["?duration", *(variable for variable, _ in parameters), *synth, *self.synth]
        need(len({*every}) == len(every), f"found a parameter of {name} twice")
        need(all(each[0] == "?" for each in every), f"found a parameter of {name} without '?'")
        need(kind == ":action" or ":duration" in parts, f"found no :duration in {name}")
        texts = {keyword: part[0] for keyword, part in parts.items()}
        self.actions[name] = Action(kind == ":durative-action", parameters, synth, texts)

    def fact(self, fact: Tree) -> None:
        words = words_of(fact)
        if words[0] == "at" and len(words) == 3 and type(words[2]) is list:
            time = number(words[1])
            target, value = self.stated(words[2])
            need(time >= 0, "found a timed initial literal before zero")
            need(self.timed.setdefault((time, target), value) == value, f"found two values of {target} at {time}")
        else:
            target, value = self.stated(fact)
            need(self.initial.setdefault(target, value) == value, f"found two initial values of {target}")

    def stated(self, fact: Tree) -> tuple[str, bool | Fraction]:
        words = words_of(fact)
        if words[0] == "=":
            words_of(fact, 2, 2)
            return self.ground(words[1], {}, self.functions), number(words[2])
        if words[0] == "not":
            return self.ground(words_of(fact, 1, 1)[1], {}, self.predicates), False
        return self.ground(fact, {}, self.predicates), True

    def ground(self, term: Tree, bound: Mapping[str, str], table: Mapping[str, int]) -> str:
        """A ground atom or fluent, as text."""
        name, *arguments = words_of([term] if type(term) is str and table is self.functions else term)
        if name not in table and name in self.split:
            self.guessed.add(f"{name} as {self.split[name]}")
            name = self.split[name]
        need(table.get(name) == len(arguments), f"found {name!r}, unknown or with other arguments")
        objects = [bound.get(each, each) for each in arguments if type(each) is str]
        need(len(objects) == len(arguments) and {*objects} <= self.objects.keys(), f"found no object in {term!r}")
        return f"({' '.join([name, *objects])})"

    def bindings(self, variables: Tree, scope: Scope) -> Iterator[Scope]:
        """Every choice of objects for variables."""
        need(type(variables) is list, "found a quantifier without variables")
        listed = typed(variables)
        names = [name for name, _ in listed]
        taken = {"?duration", *scope.synth}
        need(len({*names}) == len(names) and not taken & {*names}, "found a variable twice")
        need(all(kind in self.parents and name[0] == "?" for name, kinds in listed for kind in kinds), "unknown type")
        for chosen in product(*([one for one in self.objects if self.fits(one, kinds)] for _, kinds in listed)):
            yield Scope({**scope.bound, **dict(zip(names, chosen))}, scope.synth, scope.durative)

    def fits(self, one: str, kinds: list[str]) -> bool:
        return not self.objects[one].isdisjoint(kinds)

    def condition(self, tree: Tree, scope: Scope) -> Tree:
        if not tree:
            return True
        head, *rest = words_of(tree)
        if head in ("and", "or"):
            return (head, *(self.condition(each, scope) for each in rest))
        if head == "not":
            return ("not", self.condition(words_of(tree, 1, 1)[1], scope))
        if head == "imply":
            words_of(tree, 2, 2)
            return ("or", ("not", self.condition(rest[0], scope)), self.condition(rest[1], scope))
        if head in ("forall", "exists"):
            words_of(tree, 2, 2)
            parts = [self.condition(rest[1], inner) for inner in self.bindings(rest[0], scope)]
            return ("and" if head == "forall" else "or", *parts)
        if head in COMPARISONS:
            words_of(tree, 2, 2)
            names = [scope.bound.get(each, each) for each in rest if type(each) is str]
            if head == "=" and len(names) == 2 and {*names} <= self.objects.keys():
                return names[0] == names[1]
            return (head, self.expression(rest[0], scope), self.expression(rest[1], scope))
        return ("atom", self.ground(tree, scope.bound, self.predicates))

    def expression(self, tree: Tree, scope: Scope) -> Tree:
        if type(tree) is str and tree not in self.functions:
            if tree == "?duration":
                need(scope.durative, "found ?duration outside of a durative action")
                return ("duration",)
            if tree in scope.synth:
                return ("parameter", scope.synth[tree])
            need("/" not in tree, "found a fraction, expected (/ a b)")
            return ("number", number(tree))
        if type(tree) is list and tree and tree[0] in ("+", "-", "*", "/"):
            least, most = {"-": (1, 2), "/": (2, 2)}.get(tree[0], (1, None))
            words_of(tree, least, most)
            return (tree[0], *(self.expression(each, scope) for each in tree[1:]))
        return ("fluent", self.ground(tree, scope.bound, self.functions))


def decided(tree: Tree) -> bool | None:
    """Whether a condition is true or false by what it says of objects alone."""
    if type(tree) is bool or tree[0] not in ("not", "and", "or"):
        return tree if type(tree) is bool else None
    found, strong = {decided(each) for each in tree[1:]}, tree[0] == "or"
    if tree[0] == "not":
        return None if None in found else False in found
    return strong if strong in found else None if None in found else not strong


@dataclass(frozen=True)
class Effect:
    """At a time point: `add`, `delete`, `assign` or `increase`, if a condition holds in the state before it."""

    kind: str
    target: str
    amount: Tree
    when: Tree
    owner: tuple[int, int] | None


@dataclass(frozen=True)
class Duty:
    """A condition that has to hold just before the time point `first`, or all over (`first`, `last`), or at the end.

    `owner` are the ends of the action, for `?duration`.
    """

    label: str
    condition: Tree
    first: int | None = None
    last: int | None = None
    owner: tuple[int, int] | None = None


@dataclass
class Parameter:
    nominal: Fraction | None = None
    lower: Fraction | None = None
    upper: Fraction | None = None


NAME, IDENTIFIER = r"[A-Za-z_](?:[A-Za-z0-9_.-]*[A-Za-z0-9_])?", r"[A-Za-z0-9_]+(?:-+[A-Za-z0-9_]+)*"
POINT, BOUND = rf"(?>\.zero\b|{IDENTIFIER}(?:\.[A-Za-z0-9_]+)?)", r"[^\s\[\](),;:#]+"
STATEMENT = re.compile(
    rf"""\s*(?:
    parameter\s+(?P<parameter>{NAME})(?P<attributes>(?:\s+[a-z]+\s+{BOUND})*) |
    (?P<kind>durative-action|action)\s+instance\s+(?P<instance>{IDENTIFIER})\s*:\s*\((?P<call>[A-Za-z0-9_\s-]*)\) |
    c\s*:\s*(?P<target>{POINT})\s*-\s*(?P<source>{POINT})\s*in\s*\[\s*(?P<low>{BOUND})\s*,\s*(?P<high>{BOUND})\s*\]
    )\s*;\s*""",
    re.VERBOSE,
)


@dataclass(eq=False)
class Ground:
    """The plan: time points by number (0 is zero), the network, what has to hold, and what happens.

    `edges` are (a, b, w): t_b - t_a >= w, with w linear in the parameters. `flows` are (start, end, fluent, rate).
    """

    model: Model
    points: list[str] = field(default_factory=list)
    number: dict[str, int] = field(default_factory=dict)
    parameters: dict[str, Parameter] = field(default_factory=dict)
    edges: list[tuple[int, int, Linear]] = field(default_factory=list)
    duties: list[Duty] = field(default_factory=list)
    effects: list[list[Effect]] = field(default_factory=list)
    flows: list[tuple[int, int, str, Tree]] = field(default_factory=list)
    timed: set[int] = field(default_factory=set)
    varied: dict[tuple[str, str], str] = field(
        default_factory=dict
    )  # ("duration", instance) or ("fluent", f): parameter
    instead: dict[str, list[str]] = field(default_factory=dict)  # of these instances, the durations in the domain

    def point(self, name: str) -> int:
        need(name not in self.number, f"found time point {name} twice")
        self.number[name] = len(self.points)
        self.points.append(name)
        self.effects.append([])
        return self.number[name]

    def beside(self, text: str) -> None:
        """The TOML file beside a plan: which of its parameters are durations of actions, or initial values."""
        for name, table in tomllib.loads(text).get("parameters", {}).items():
            need(type(table) is dict and len(table) == 1, f"found parameter {name} beside the plan with attributes")
            [(kind, subject)] = table.items()
            known = type(subject) is str if kind == "duration" else type(self.model.initial.get(subject)) is Fraction
            need(kind in ("duration", "fluent") and known, f"found parameter {name} of something unknown")
            need(self.varied.setdefault((kind, subject), name) == name, f"found two parameters for {subject}")

    def read(self, plan: str) -> None:
        """The plan's statements, then timed initial literals and the goal."""
        self.point(".zero")
        text, place = re.sub(r"#[^\n]*", " ", plan), 0
        used = {*self.model.synth.values()}
        while place < len(text.rstrip()):
            match = STATEMENT.match(text, place)
            if match is None:
                raise Unsupported(f"found {text[place : place + 40].strip()!r}, expected a statement of a plan")
            place = match.end()
            if match["parameter"]:
                self.parameter(match["parameter"], match["attributes"].split())
            elif match["kind"]:
                durative = match["kind"] == "durative-action"
                used |= self.instance(match["instance"], durative, match["call"].lower().split())
            else:
                self.constraint(match["target"], match["source"], match["low"], match["high"])
        need(len(self.points) > 1, "found no action in the plan")
        used.update(self.varied.values())
        for name in (name for kind, name in self.varied if kind == "duration"):
            self.varied_duration(name, ("=", ("duration",), ("parameter", self.varied["duration", name])))
        need(used <= self.parameters.keys(), f"found no declaration of {used - self.parameters.keys()} in the plan")
        for time in sorted({time for time, _ in self.model.timed}):
            self.timed_literals(time)
        self.edges += [(0, point, {}) for point in range(1, len(self.points))]
        goal = self.model.condition(self.model.goal, Scope({}, self.model.synth))
        for index, part in enumerate(conjuncts(goal)):
            self.duties.append(Duty(f"goal {index + 1}", part))

    def varied_duration(self, name: str, condition: Tree) -> None:
        """The network, too, gives the instance this duration, and nothing else."""
        ends = self.number.get(f"{name}.start"), self.number.get(f"{name}.end")
        length = {condition[2][1]: Fraction(1)}
        between = [(a, b, w) for a, b, w in self.edges if {a, b} == {*ends}]
        both = [(*ends, length), (*ends[::-1], {condition[2][1]: Fraction(-1)})]
        need(between == both, f"expected the duration of {name} in the network to be its parameter")
        need(
            any(duty.owner == ends and duty.condition == condition for duty in self.duties), f"{name}: no (= ?duration)"
        )

    def timed_literals(self, time: Fraction) -> None:
        point = self.point(f"@{time}")
        self.timed.add(point)
        self.edges += [(0, point, {"": time} if time else {}), (point, 0, {"": -time} if time else {})]
        for (when, target), value in self.model.timed.items():
            if when == time:
                kind = "assign" if type(value) is Fraction else "add" if value else "delete"
                self.effects[point].append(Effect(kind, target, ("number", value), True, None))

    def parameter(self, name: str, words: list[str]) -> None:
        values = dict(zip(words[::2], words[1::2]))
        need(values.keys() <= {"weight", "default", "lb", "ub"} and len(values) * 2 == len(words), f"parameter {name}")
        need(not {name, name.lower()} & {*self.parameters, "inf", "infinity", "nan", "zero"}, f"parameter {name}")
        low, high, nominal = values.get("lb", "-inf"), values.get("ub", "inf"), values.get("default")
        self.parameters[name] = Parameter(
            None if nominal is None else number(nominal),
            None if low == "-inf" else number(low),
            None if high in ("inf", "+inf") else number(high),
        )

    def constraint(self, target: str, source: str, low: str, high: str) -> None:
        need({target, source} <= self.number.keys(), f"found {target} - {source}, expected declared time points")
        b, a = self.number[target], self.number[source]
        if low != "-inf":
            self.edges.append((a, b, self.bound(low)))
        if high not in ("inf", "+inf"):
            self.edges.append((b, a, {name: -value for name, value in self.bound(high).items()}))

    def bound(self, text: str) -> Linear:
        if text in self.parameters:
            return {text: Fraction(1)}
        value = number(text)
        return {"": value} if value else {}

    def instance(self, name: str, durative: bool, call: list[str]) -> set[str]:
        """Ground one action; the parameters that it has of its own."""
        need(call and call[0] in self.model.actions, f"found an unknown action in {name}")
        action = self.model.actions[call[0]]
        need(action.durative is durative and len(call) == len(action.parameters) + 1, f"{name} does not fit its action")
        for given, (_, kinds) in zip(call[1:], action.parameters):
            need(given in self.model.objects and self.model.fits(given, kinds), f"{given} does not fit action {name}")
        bound = {variable: given for given, (variable, _) in zip(call[1:], action.parameters)}
        own = {each: f"{name}.{each[1:]}" for each in action.synth}
        scope = Scope(bound, {**self.model.synth, **own}, durative)
        if durative:
            ends = (self.point(f"{name}.start"), self.point(f"{name}.end"))
            length = (">=", ("duration",), ("number", Fraction(0)))
            self.duties.append(Duty(f"{name}: non-negative duration", length, ends[0], owner=ends))
            self.durations(name, action.parts.get(":duration", []), scope, ends, ends[0])
            self.conditions(name, action.parts.get(":condition", []), scope, ends)
            self.add_effects(action.parts.get(":effect", []), scope, ends, True, None)
        else:
            ends = (self.point(name),) * 2
            condition = self.model.condition(action.parts.get(":precondition", []), scope)
            self.state(f"{name}: condition", condition, ends, ends[0])
            self.add_effects(action.parts.get(":effect", []), scope, ends, True, ends[0])
        return set(own.values())

    def state(self, label: str, condition: Tree, ends: tuple[int, int], first: int, last: int | None = None) -> None:
        self.duties += [Duty(label, part, first, last, ends) for part in conjuncts(condition)]

    def spread(self, tree: Tree, scope: Scope) -> Iterator[tuple[str, list[Tree], Scope]]:
        """The parts of conjunctions, those of `forall` object by object: head, operands, and what variables mean."""
        if tree:
            head, *rest = words_of(tree)
            if head == "and":
                for each in rest:
                    yield from self.spread(each, scope)
            elif head == "forall":
                words_of(tree, 2, 2)
                for inner in self.model.bindings(rest[0], scope):
                    yield from self.spread(rest[1], inner)
            else:
                yield head, rest, scope

    def durations(self, name: str, tree: Tree, scope: Scope, ends: tuple[int, int], point: int) -> None:
        for head, rest, inner in self.spread(tree, scope):
            if head == "at":
                need(len(rest) == 2 and rest[0] in ("start", "end"), f"{name}: a duration's time")
                self.durations(name, rest[1], inner, ends, ends[rest[0] == "end"])
            else:
                need(rest[:1] == ["?duration"], f"found a malformed duration in {name}")
                condition = self.model.condition([head, *rest], inner)
                if head == "=" and ("duration", name) in self.varied:
                    self.instead.setdefault(name, []).append(written(rest[1], inner.bound))
                    condition = (head, ("duration",), ("parameter", self.varied["duration", name]))
                self.state(f"{name}: duration", condition, ends, point)

    def conditions(self, name: str, tree: Tree, scope: Scope, ends: tuple[int, int]) -> None:
        where = {("at", "start"): ends[:1], ("at", "end"): ends[1:], ("over", "all"): ends}
        for head, rest, inner in self.spread(tree, scope):
            words = (head, *rest[:1])
            need(len(rest) == 2 and type(rest[0]) is str and words in where, f"{name}: a condition without a time")
            self.state(f"{name}: {' '.join(words)}", self.model.condition(rest[1], inner), ends, *where[words])

    def add_effects(self, tree: Tree, scope: Scope, ends: tuple[int, int], when: Tree, point: int | None) -> None:
        """The effects in a tree, if `when` holds; they happen at `point`, which is not known yet at the top."""
        for head, rest, inner in self.spread(tree, scope):
            if head == "at" and len(rest) == 2 and rest[0] in ("start", "end"):
                need(point is None, "found an effect with two times")
                self.add_effects(rest[1], inner, ends, when, ends[rest[0] == "end"])
            elif head == "when":
                condition, effect = words_of([head, *rest], 2, 2)[1:]
                if point is None:
                    at, time, condition = words_of(condition, 2, 2)
                    need(at == "at" and effect[:2] == [at, time], "found an effect between two times")
                guard = ("and", when, self.model.condition(condition, inner))
                if decided(guard) is not False:
                    self.add_effects(effect, inner, ends, guard, point)
            elif point is not None:
                self.effects[point].append(Effect(*self.effect([head, *rest], inner), when, ends))
            else:
                rate = words_of([head, *rest], 2, 2)[2]
                need(head in ("increase", "decrease"), "found an effect without a time")
                need(len(rate) == 3 and rate[0] == "*" and rate.count("#t") == 1, "a rate")
                slope = self.model.expression(rate[2] if rate[1] == "#t" else rate[1], Scope(inner.bound, inner.synth))
                slope = slope if head == "increase" else ("-", slope)
                self.flows.append((*ends, self.model.ground(rest[0], inner.bound, self.model.functions), slope))

    def effect(self, tree: Tree, scope: Scope) -> tuple[str, str, Tree]:
        head, *rest = words_of(tree)
        if head == "not":
            return "delete", self.model.ground(words_of(tree, 1, 1)[1], scope.bound, self.model.predicates), None
        if head not in ("assign", "increase", "decrease", "scale-up", "scale-down"):
            return "add", self.model.ground(tree, scope.bound, self.model.predicates), None
        words_of(tree, 2, 2)
        fluent = self.model.ground(rest[0], scope.bound, self.model.functions)
        amount = self.model.expression(rest[1], scope)
        if head in ("scale-up", "scale-down"):
            return "assign", fluent, ("*" if head == "scale-up" else "/", ("fluent", fluent), amount)
        if head == "decrease":
            return "increase", fluent, ("-", amount)
        return head, fluent, amount


def written(tree: Tree, bound: Mapping[str, str]) -> str:
    """A form as its text says it, with objects for variables."""
    if type(tree) is list:
        return f"({' '.join(written(each, bound) for each in tree)})"
    return bound.get(tree, tree)


def conjuncts(tree: Tree) -> Iterator[Tree]:
    """The parts of a conjunction, but those that say nothing."""
    if type(tree) is tuple and tree[0] == "and":
        for each in tree[1:]:
            yield from conjuncts(each)
    elif tree is not True:
        yield tree


def ground(domain: str, problem: str, plan: str, beside: str = "") -> Ground:
    """The ground plan that the texts describe; `beside` is the file of parameters beside the plan."""
    found = Ground(Model(domain, problem))
    found.beside(beside)
    found.read(plan)
    return found
