"""What the files say: PDDL and `.stn` read with nothing but the standard library, and ground for the plan's instances.

Whatever is not understood is `Unsupported`, so that nothing is proved about it. Conditions are trees: `True`, `False`,
`("atom", a)`, `("not", c)`, `("and", ...)`, `("or", ...)` and comparisons `(">=", left, right)`; expressions are
`("number", n)`, `("parameter", name)`, `("duration",)`, `("fluent", f)` and operations `("+", ...)`. Atoms and fluents
are texts such as `(at rover base)`. All of a text stays in the trees, because what a text mentions counts as read.
"""

import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction
from itertools import product
from typing import Any, NamedTuple

Tree = Any
Linear = dict[str, Fraction]
"""Coefficients by name; that of "" is the constant. No coefficient is zero."""
Names = list[tuple[str, list[str]]]
"""With the types of each."""
Signatures = dict[str, list[list[str]]]
"""Predicates, or functions: the types of each of their arguments."""
Fact = tuple[Linear, bool]
"""`expression >= 0`, or `> 0`."""


def constant(value: Fraction) -> Linear:
    return {"": value} if value else {}


class Unsupported(Exception):
    """Nothing is proved, because this reader does not know what something means."""


def need(condition: object, message: str) -> None:
    if not condition:
        raise Unsupported(message)


DECIMAL = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE]([+-]?[0-9]+))?"
NUMBER = re.compile(rf"[+-]?[0-9]+/[0-9]*[1-9][0-9]*|{DECIMAL}")


def number(text: Tree) -> Fraction:
    """A number as texts write it, exactly; PDDL may write `(- 3)`."""
    if type(text) is list and len(text) == 2 and text[0] == "-":
        return -number(text[1])
    match = NUMBER.fullmatch(text) if type(text) is str and len(text) <= 300 else None
    need(match and abs(int(match[1] or 0)) <= 300, f"found {text!r:.60}, expected a number of at most 300 digits")
    value = Fraction(text)
    need(max(abs(value.numerator), value.denominator) < 10**300, "found a number of more than 300 digits")
    return value


WORD = re.compile(r"\s+|;[^\n]*|([()]|[^\s();]+)")
CLASSES = re.compile(rf"[()]|{DECIMAL}|[<>]=|[-+*/=<>]|#[tT]|[?:]?[A-Za-z0-9_][A-Za-z0-9_-]*")


def is_word(tree: Tree, mark: str = "") -> bool:
    """Whether it is a name, or with a mark a ?variable or a :keyword; words that could be numbers are none of these."""
    start = tree[:1] if type(tree) is str and not NUMBER.fullmatch(tree) else " "
    return start == mark if mark else start == "_" or start.isalnum()


def parse(text: str, kind: str, known: set[str]) -> list[Tree]:
    """The sections of one `(define (kind name) ...)` as lists of lists and lower-case words."""
    stack: list[list[Tree]] = [[]]
    words = [word for word in WORD.findall(text) if word]
    wrong = [word for word in {*words} if not CLASSES.fullmatch(word)]
    need(not wrong, f"found {wrong}, expected names, ?variables, :keywords, numbers and operators")
    for word in words:
        if word == "(":
            stack.append([])
            need(len(stack) <= 120, "forms are nested too deeply")
        elif word == ")":
            done = stack.pop()
            need(stack, "found a ')' too many")
            stack[-1].append(done)
        else:
            stack[-1].append(word.lower())
    need(len(stack) == 1 and len(stack[0]) == 1 and stack[0][0][:1] == ["define"], "expected one (define ...)")
    sections = [words_of(each) for each in stack[0][0][1:]]
    need(sections and sections[0][0] == kind and len(sections[0]) == 2, f"expected a {kind}")
    need(re.match("[a-z0-9_]", str(sections[0][1])), f"expected the name of a {kind}")
    heads = [each[0] for each in sections[1:]]
    need({*heads} <= known, f"found a section that no {kind} has in {heads}")
    need(all(heads.count(each) == 1 for each in {*heads} - PARTS.keys()), f"found a section twice in {heads}")
    required = (word for head, *rest in sections for word in rest if head == ":requirements")
    need(all(type(word) is str and REQUIREMENT.fullmatch(word) for word in required), "found an unknown requirement")
    return sections


def typed(words: list[Tree], mark: str = "", default: str = "object") -> Names:
    """`a b - t c`: names, or with a mark variables, each with its types."""
    found = Names()
    names: list[str] = []
    rest = iter(words)
    for word in rest:
        if word == "-":
            kind = next(rest, None)
            kinds = kind[1:] if type(kind) is list and kind[:1] == ["either"] else [kind]
            need(names and kinds and all(map(is_word, kinds)), "found a malformed type")
            found += [(name, list(dict.fromkeys(map(str, kinds)))) for name in names]
            names = []
        else:
            need(is_word(word, mark), f"found {word!r} in a list of names")
            names.append(word)
    return found + [(name, [default]) for name in names]


def words_of(tree: Tree) -> list[Tree]:
    """A form with as many operands as its first word takes."""
    need(type(tree) is list and tree and type(tree[0]) is str, f"found {tree!r}, expected a form")
    least, most = OPERANDS.get(tree[0], (0, len(tree)))
    need(least < len(tree) <= most + 1, f"found {tree[0]} with other operands")
    return list(tree)


class Action(NamedTuple):
    """An action's text: `parameters` with their types, and `synth`, the envelope's parameters of each instance."""

    durative: bool
    parameters: Names
    synth: list[str]
    parts: Mapping[str, Tree]


class Scope(NamedTuple):
    """What variables stand for: objects, and parameters of the envelope.

    Where an action is read as such (`lifted`), each stands for something of its types.
    """

    bound: Mapping[str, str]
    synth: Mapping[str, str]
    durative: bool = False
    lifted: bool = False


LIFTED = Scope({}, {}, lifted=True)
PARTS = {":durative-action": {":duration", ":condition"}, ":action": {":precondition"}}
COMMON = {":parameters", ":effect", ":synth-parameters"}
DOMAIN = {":requirements", ":types", ":constants", ":predicates", ":functions", ":synth-parameters", *PARTS}
PROBLEM = {":domain", ":requirements", ":objects", ":init", ":goal", ":metric", ":length"}
LOGIC = "negative|disjunctive|existential|universal|quantified"
EFFECTS = "conditional-effects|continuous-effects|timed-effects|timed-initial-(literals|fluents)|(numeric-)?fluents"
OTHERS = "adl|time|durative-actions|duration-inequalities|action-costs|preferences|constraints|synth-parameters"
REQUIREMENT = re.compile(f":(strips|typing|equality|({LOGIC})-preconditions|{EFFECTS}|{OTHERS})")
COMPARISONS, CHANGES = {"<", "<=", "=", ">=", ">"}, {"increase", "decrease", "assign", "scale-up", "scale-down"}
TWO = COMPARISONS | CHANGES | {"imply", "forall", "exists", "when", "/"}
OPERANDS = {"not": (1, 1), "-": (1, 2), "+": (1, 1 << 60), "*": (1, 1 << 60)} | dict.fromkeys(TWO, (2, 2))
"""How many operands these take; any other form, as many as there are."""
RESERVED = {"and", "or", "preference", "either", "define", *OPERANDS}


class Model:
    """Domain and problem: declarations, actions, the initial state, timed initial literals, the goal."""

    def __init__(self, domain: str, problem: str) -> None:
        self.parents, self.types_above = dict[str, set[str]](), dict[str, set[str]]()
        self.objects, self.actions = dict[str, set[str]](), dict[str, Action]()
        self.kinds = dict[str, list[str]]()  # the types of objects, and of what variables of actions stand for
        self.predicates, self.functions = Signatures(), Signatures()
        self.split, self.guessed = dict[str, str](), set[str]()  # undeclared predicates of one type; what is read how
        self.initial, self.timed = dict[str, bool | Fraction](), dict[Fraction, dict[str, bool | Fraction]]()
        self.synth, self.written = dict[str, str](), set[str]()  # what actions and timed initial literals change
        self.sections = sections = [*parse(domain, "domain", DOMAIN), *parse(problem, "problem", PROBLEM)]
        parts = {each[0]: each[1:] for each in sections}
        need(parts.get(":domain") == parts["domain"], "the problem is of another domain")
        need(":init" in parts and len(parts.get(":goal", [])) == 1, "expected :init and one :goal in the problem")
        self.types(typed(parts.get(":types", [])))
        self.things(parts.get(":constants", []))
        self.declare(self.predicates, parts.get(":predicates", []))
        functions = parts.get(":functions", [])
        shape = "".join(f" {each}" if type(each) is str else " ()" for each in functions)
        need(re.fullmatch(r"( \(\)( - number)?)*", shape), "functions are numeric only")
        self.declare(self.functions, [each for each in functions if type(each) is list])
        self.synth |= {each: each[1:] for each in self.parameters_in(parts.get(":synth-parameters", []))}
        for kind, *rest in sections:
            if kind in PARTS:
                self.action(kind, rest)
        self.things(parts.get(":objects", []))
        twice = self.functions.keys() & (self.predicates.keys() | self.objects.keys())
        need(not twice, f"found functions that are predicates or objects, too: {sorted(twice)}")
        for fact in parts[":init"]:
            self.fact(fact)
        self.goal = parts[":goal"][0]
        self.condition(self.goal, Scope({}, self.synth, lifted=True))
        metric = parts.get(":metric", ["minimize", "0"])
        need(len(metric) == 2 and metric[0] in ("minimize", "maximize"), "found a malformed metric")
        self.functions.setdefault("total-time", [])  # which nothing else mentions: all has been read once
        self.expression(metric[1], LIFTED)

    def things(self, words: list[Tree]) -> None:
        """Constants, or objects."""
        for name, kinds in typed(words):
            need({*kinds} <= self.parents.keys(), f"found an unknown type of {name}")
            need({*self.kinds.setdefault(name, kinds)} == {*kinds}, f"found two types of {name}")
            self.objects[name] = {each for kind in kinds for each in self.types_above[kind]}

    def types(self, listed: Names) -> None:
        for name, kinds in listed:
            need(name != "object" or kinds == ["object"], "found a type above 'object'")
            if self.parents.setdefault(name, {*kinds}) != {*kinds}:
                self.parents[name].update(kinds)
                self.guessed.add(f"type {name} as below {' and '.join(sorted(self.parents[name]))}")
        self.parents = {kind: set[str]() for _, kinds in listed for kind in kinds} | self.parents | {"object": set()}
        need(len(self.parents) <= 500, "found more than 500 types")
        for kind in self.parents:
            self.above(kind)

    def above(self, kind: str) -> set[str]:
        """A type and all types above it; nothing while it is being looked for."""
        if kind not in self.types_above:
            self.types_above[kind] = set()
            self.types_above[kind] = {kind, "object"}.union(*map(self.above, self.parents[kind]))
        need(self.types_above[kind], f"found type {kind} above itself")
        return self.types_above[kind]

    def variables(self, words: list[Tree], taken: Iterable[str] = (), default: str = "object") -> Names:
        """Variables of different names, with types that are known; those whose types are numbers have no other one."""
        listed, taken = typed(words, "?", default), {"?duration", *taken}
        need(len(taken.union(name for name, _ in listed)) == len(listed) + len(taken), "found a variable twice")
        known = self.parents.keys() if default == "object" else {default}
        need({kind for _, kinds in listed for kind in kinds} <= known, "found an unknown type")
        return listed

    def declare(self, table: Signatures, signatures: list[Tree]) -> None:
        """Predicates or functions; `(in ?x - (either a b))` may be written `(in_a ?x)` where it is used."""
        for signature in signatures:
            name, *parameters = words_of(signature)
            need(is_word(name) and name not in table and name not in RESERVED, f"found a second or reserved {name}")
            table[name] = [kinds for _, kinds in self.variables(parameters)]
            several = (kinds for kinds in table[name] if len(kinds) > 1)
            self.split.update((f"{name}_{kind}", name) for kinds in several for kind in kinds if "_" not in kind)

    def parameters_in(self, words: list[Tree]) -> list[str]:
        words = words[0] if len(words) == 1 and type(words[0]) is list else words
        return [name for name, _ in self.variables(words, self.synth, "number")]

    def action(self, kind: str, rest: list[Tree]) -> None:
        need(rest and is_word(rest[0]) and rest[0] not in self.actions, "found an action without a name of its own")
        name, parts, keyword = rest[0], dict[str, list[Tree]](), ""
        for item in rest[1:]:
            head, *inside = item if item[:1] == [":synth-parameters"] else [item]
            if is_word(head, ":"):
                need(head in PARTS[kind] | COMMON and head not in parts, f"found {head} in {name}, or twice")
                keyword, parts[head] = head, inside
            else:
                need(keyword, f"found {item!r} in {name}")
                parts[keyword].append(item)
        synth = self.parameters_in(parts.pop(":synth-parameters", []))
        need(all(len(part) == 1 and type(part[0]) is list for part in parts.values()), f"found {name} malformed")
        need(kind == ":action" or ":duration" in parts, f"found no :duration in {name}")
        texts = {keyword: part[0] for keyword, part in parts.items()}
        parameters = self.variables(texts.get(":parameters", []))
        self.actions[name] = action = Action(kind == ":durative-action", parameters, synth, texts)
        scope = Scope({}, {**self.synth, **{each: each for each in synth}}, action.durative, lifted=True)
        for inner in self.bindings(texts.get(":parameters", []), scope):
            Ground(self).act(name, action, inner)

    def fact(self, fact: Tree) -> None:
        words = words_of(fact)
        timed = words[0] == "at" and len(words) == 3 and type(words[2]) is list
        target, value = self.stated(words_of(words[2] if timed else fact))
        if timed:
            time = number(str(words[1]))
            self.written.add(target.strip("()").split()[0])
            known = self.timed.setdefault(time, {}).setdefault(target, value)
            need(time >= 0 and known == value, f"found two values of {target} at {time}, or one before zero")
        else:
            need(self.initial.setdefault(target, value) == value, f"found two initial values of {target}")

    def stated(self, words: list[Tree]) -> tuple[str, bool | Fraction]:
        if words[0] == "=":
            return self.ground(words[1], LIFTED, self.functions), number(words[2])
        negated = words[0] == "not"
        return self.ground(words[1] if negated else words, LIFTED, self.predicates), not negated

    def ground(self, term: Tree, scope: Scope, table: Signatures) -> str:
        """A ground atom or fluent, as text."""
        name, *arguments = words_of([term] if type(term) is str and table is self.functions else term)
        if name not in table and name in self.split:
            self.guessed.add(f"{name} as {self.split[name]}")
            name = self.split[name]
        need(name in table and len(table[name]) == len(arguments), f"found {name!r}, unknown or with other arguments")
        objects = [scope.bound.get(each, each) for each in arguments if type(each) is str]
        need(len(objects) == len(arguments) and {*objects} <= self.kinds.keys(), f"found no object in {term!r}")
        need(not scope.lifted or all(map(self.may_fit, objects, table[name])), f"found another type in {term!r}")
        return f"({' '.join([name, *objects])})"

    def may_fit(self, given: str, kinds: list[str]) -> bool:
        """Whether some type is below one of an object, or of what a variable stands for, and below one of these."""
        below = (above for above in self.types_above.values() if not above.isdisjoint(kinds))
        return "object" in kinds or any(not above.isdisjoint(self.kinds[given]) for above in below)

    def bindings(self, variables: Tree, scope: Scope) -> Iterator[Scope]:
        """Every choice of objects for variables, or of one thing of its types for each."""
        need(type(variables) is list, "found a quantifier without variables")
        listed = self.variables(variables, scope.synth)
        names = [name for name, _ in listed]
        choices = [[f"{name} of {kinds}"] for name, kinds in listed]
        if scope.lifted:
            self.kinds |= {each: kinds for [each], (_, kinds) in zip(choices, listed)}
        else:
            choices = [[one for one in self.objects if self.fits(one, kinds)] for _, kinds in listed]
        for chosen in product(*choices):
            yield scope._replace(bound={**scope.bound, **dict(zip(names, chosen))})

    def fits(self, one: str, kinds: list[str]) -> bool:
        return not self.objects.get(one, set()).isdisjoint(kinds)

    def condition(self, tree: Tree, scope: Scope) -> Tree:
        if not tree:
            return True
        head, *rest = words_of(tree)
        if head in ("and", "or"):
            return (head, *(self.condition(each, scope) for each in rest))
        if head == "not":
            return ("not", self.condition(rest[0], scope))
        if head == "imply":
            return ("or", ("not", self.condition(rest[0], scope)), self.condition(rest[1], scope))
        if head in ("forall", "exists"):
            parts = [self.condition(rest[1], inner) for inner in self.bindings(rest[0], scope)]
            return ("and" if head == "forall" else "or", *parts)
        if head in COMPARISONS:
            names = [scope.bound.get(each, each) for each in rest if type(each) is str]
            if head == "=" and len(names) == 2 and {*names} <= self.kinds.keys():
                return names[0] == names[1]
            return (head, self.expression(rest[0], scope), self.expression(rest[1], scope))
        return ("atom", self.ground(tree, scope, self.predicates))

    def expression(self, tree: Tree, scope: Scope) -> Tree:
        if type(tree) is str and tree not in self.functions:
            if tree == "?duration" and scope.durative:
                return ("duration",)
            if tree in scope.synth:
                return ("parameter", scope.synth[tree])
            return ("number", number(tree))
        if type(tree) is list and tree and tree[0] in ("+", "-", "*", "/"):
            parts = [self.expression(each, scope) for each in words_of(tree)[1:]]
            return self.quotient(parts[0], parts[1], scope) if tree[0] == "/" else (tree[0], *parts)
        return ("fluent", self.ground(tree, scope, self.functions))

    def quotient(self, dividend: Tree, divisor: Tree, scope: Scope) -> Tree:
        need(divisor != ("number", 0), "found a division by zero")
        need(scope.lifted or not self.varies(divisor), "found a division by what may change")
        return ("/", dividend, divisor)

    def varies(self, tree: Tree) -> bool:
        """Whether the value of an expression may be another one at another time, or for other parameters."""
        kind, *rest = tree
        if kind == "fluent":
            return rest[0].strip("()").split()[0] in self.written
        return kind in ("parameter", "duration") or (kind != "number" and any(map(self.varies, rest)))


def decided(tree: Tree) -> bool | None:
    """Whether a condition is true or false by what it says of objects alone."""
    if type(tree) is bool or tree[0] not in ("not", "and", "or"):
        return tree if type(tree) is bool else None
    found, strong = {decided(each) for each in tree[1:]}, tree[0] == "or"
    if tree[0] == "not":
        return None if None in found else False in found
    return strong if strong in found else None if None in found else not strong


Ends = tuple[int, int]


class Effect(NamedTuple):
    """At a time point: `add`, `delete`, `assign` or `increase`, if a condition holds in the state before it."""

    kind: str
    target: str
    amount: Tree
    when: Tree
    owner: Ends | None


class Duty(NamedTuple):
    """A condition that has to hold just before the time point `first`, or all over (`first`, `last`), or at the end.

    `owner` are the ends of the action, for `?duration`.
    """

    label: str
    condition: Tree
    first: int | None = None
    last: int | None = None
    owner: Ends | None = None


class Parameter(NamedTuple):
    nominal: Fraction | None
    lower: Fraction | None
    upper: Fraction | None


NAME, IDENTIFIER = r"[A-Za-z_](?:[A-Za-z0-9_.-]*[A-Za-z0-9_])?", r"[A-Za-z0-9_]+(?:-+[A-Za-z0-9_]+)*"
POINT, BOUND = rf"(?>\.zero\b|{IDENTIFIER}(?:\.[A-Za-z0-9_]+)?)", r"[^\s\[\](),;:#]+"
STATEMENT = re.compile(rf"""(?x)\s*(?:
    parameter\s+(?P<parameter>{NAME})(?P<attributes>(?:\s+[a-z]+\s+{BOUND})*) |
    (?P<kind>durative-action|action)\s+instance\s+(?P<instance>{IDENTIFIER})\s*:\s*\((?P<call>[A-Za-z0-9_\s-]*)\) |
    c\s*:\s*(?P<target>{POINT})\s*-\s*(?P<source>{POINT})\s*in\s*\[\s*(?P<low>{BOUND})\s*,\s*(?P<high>{BOUND})\s*\]
    )\s*;\s*""")


class Ground:
    """The plan: time points by number (0 is zero), the network, what has to hold, and what happens.

    `edges` are (a, b, w): t_b - t_a >= w, with w linear in the parameters. `flows` are (start, end, fluent, rate).
    `varied` are the parameters of ("duration", instance) and ("fluent", f), `instead` those durations in the domain.
    """

    def __init__(self, model: Model) -> None:
        self.model, self.parameters = model, dict[str, Parameter]()
        self.points, self.number, self.timed = list[str](), dict[str, int](), set[int]()
        self.edges, self.duties = list[tuple[int, int, Linear]](), list[Duty]()
        self.effects, self.flows = list[list[Effect]](), list[tuple[int, int, str, Tree]]()
        self.varied, self.instead = dict[tuple[str, str], str](), dict[str, list[str]]()
        self.statements = list[re.Match[str]]()

    def point(self, name: str) -> int:
        need(name not in self.number, f"found time point {name} twice")
        self.number[name] = len(self.points)
        self.points.append(name)
        self.effects.append([])
        return self.number[name]

    def beside(self, text: str) -> None:
        """The TOML file beside a plan: which of its parameters are durations of actions, or initial values."""
        document = tomllib.loads(text)
        like = {key for key in document if key[:5].lower() == "param"}
        need(not like or document.keys() == {"parameters"}, "found other tables than parameters")
        for name, table in document.get("parameters", {}).items():
            need(type(table) is dict and len(table) == 1, f"found parameter {name!r} beside the plan with attributes")
            [(kind, subject)] = table.items()
            known = type(subject) is str if kind == "duration" else type(self.model.initial.get(subject)) is Fraction
            need(kind in ("duration", "fluent") and known, f"found parameter {name!r} of something unknown")
            need(self.varied.setdefault((kind, subject), name) == name, f"found two parameters for {subject!r}")

    def read(self, plan: str) -> None:
        """The plan's statements, then timed initial literals and the goal."""
        self.point(".zero")
        text, place = re.sub(r"#[^\n]*", " ", plan), 0
        used = {*self.model.synth.values()}
        while place < len(text.rstrip()):
            match: Any = STATEMENT.match(text, place)
            need(match, f"found {text[place : place + 40].strip()!r}, expected a statement of a plan")
            place = match.end()
            self.statements.append(match)
            if match["parameter"]:
                self.parameter(match["parameter"], match["attributes"].split())
            elif match["kind"]:
                durative = match["kind"] == "durative-action"
                used |= self.instance(match["instance"], durative, match["call"].lower().split())
            else:
                self.constraint(match["target"], match["source"], match["low"], match["high"])
        need(len(self.points) > 1, "found no action in the plan")
        used |= {name for _, _, length in self.edges for name in length if name}
        initial = [name for (kind, _), name in self.varied.items() if kind == "fluent"]
        need(not used & {*initial}, "found parameters for initial values that have other uses")
        used.update(self.varied.values())
        for name in (name for kind, name in self.varied if kind == "duration"):
            self.varied_duration(name, self.varied["duration", name])
        need(used == self.parameters.keys(), f"found {used ^ self.parameters.keys()} not declared, or not used")
        for time in sorted(self.model.timed):
            self.timed_literals(time)
        self.edges += [(0, point, {}) for point in range(1, len(self.points))]
        goal = self.model.condition(self.model.goal, Scope({}, self.model.synth))
        for index, part in enumerate(conjuncts(goal)):
            self.duties.append(Duty(f"goal {index + 1}", part))

    def varied_duration(self, name: str, parameter: str) -> None:
        """The network, too, gives the instance this duration, and nothing else."""
        ends = self.number.get(f"{name}.start"), self.number.get(f"{name}.end")
        both = [(*ends, {parameter: Fraction(1)}), (*ends[::-1], {parameter: Fraction(-1)})]
        between = [edge for edge in self.edges if {*edge[:2]} == {*ends}]
        need(between == both, f"expected the duration of {name} in the network to be its parameter")
        condition = ("=", ("duration",), ("parameter", parameter))
        said = any(each.owner == ends and each.condition == condition for each in self.duties)
        need(said, f"{name}: no (= ?duration)")

    def timed_literals(self, time: Fraction) -> None:
        point = self.point(f"@{time}")
        self.timed.add(point)
        self.edges += [(0, point, constant(time)), (point, 0, constant(-time))]
        for target, value in self.model.timed[time].items():
            kind = "assign" if type(value) is Fraction else "add" if value else "delete"
            self.effects[point].append(Effect(kind, target, ("number", value), True, None))

    def parameter(self, name: str, words: list[str]) -> None:
        values = dict(zip(words[::2], words[1::2]))
        known = values.keys() <= {"weight", "default", "lb", "ub"} and len(values) * 2 == len(words)
        reserved = name in self.parameters or name.lower() in ("inf", "infinity", "nan", "zero")
        need(known and not reserved, f"found parameter {name} twice, reserved, or with other attributes")
        texts = values.get("lb", "-inf"), values.get("default", ""), values.get("ub", "inf").removeprefix("+")
        given = [None if text == none else number(text) for text, none in zip(texts, ("-inf", "", "inf"))]
        self.parameters[name] = Parameter(given[1], given[0], given[2])
        ordered = [each for each in given if each is not None]
        need(ordered == sorted(ordered) and number(values.get("weight", "1")) > 0, f"found {name} out of its bounds")

    def constraint(self, target: str, source: str, low: str, high: str) -> None:
        need({target, source} <= self.number.keys(), f"found {target} - {source}, expected declared time points")
        b, a = self.number[target], self.number[source]
        ends = [number(each) for each in (low, "0" if a == b else low, high) if NUMBER.fullmatch(each)]
        need(ends == sorted(ends), f"found an interval [{low}, {high}] without values")
        if low != "-inf":
            self.edges.append((a, b, self.bound(low)))
        if high not in ("inf", "+inf"):
            self.edges.append((b, a, {name: -value for name, value in self.bound(high).items()}))

    def bound(self, text: str) -> Linear:
        return {text: Fraction(1)} if text in self.parameters else constant(number(text))

    def instance(self, name: str, durative: bool, call: list[str]) -> set[str]:
        """Ground one action; the parameters that it has of its own."""
        need(call and call[0] in self.model.actions, f"found an unknown action in {name}")
        action = self.model.actions[call[0]]
        need(not {name, f"{name}.start"} & self.number.keys(), f"found instance {name} twice")
        need(action.durative is durative and len(call) == len(action.parameters) + 1, f"{name} does not fit its action")
        need(all(map(self.model.fits, call[1:], (kinds for _, kinds in action.parameters))), f"{name}: of other types")
        bound = {variable: given for given, (variable, _) in zip(call[1:], action.parameters)}
        own = {each: f"{name}.{each[1:]}" for each in action.synth}
        self.act(name, action, Scope(bound, {**self.model.synth, **own}, durative))
        return set(own.values())

    def act(self, name: str, action: Action, scope: Scope) -> None:
        """The time points, conditions and effects of an action."""
        if action.durative:
            ends = (self.point(f"{name}.start"), self.point(f"{name}.end"))
            self.state(f"{name}: non-negative duration", (">=", ("duration",), ("number", Fraction(0))), ends, ends[0])
            self.durations(name, action.parts.get(":duration", []), scope, ends, ends[0])
            self.conditions(name, action.parts.get(":condition", []), scope, ends)
        else:
            ends = (self.point(name),) * 2
            condition = self.model.condition(action.parts.get(":precondition", []), scope)
            self.state(f"{name}: condition", condition, ends, ends[0])
        self.add_effects(action.parts.get(":effect", []), scope, ends, True, None if action.durative else ends[0])

    def state(self, label: str, condition: Tree, ends: Ends, first: int, last: int | None = None) -> None:
        self.duties += [Duty(label, part, first, last, ends) for part in conjuncts(condition)]

    def spread(self, tree: Tree, scope: Scope, ends: tuple[int, ...], at: int | None) -> Iterator[tuple[Any, ...]]:
        """The parts of conjunctions, those of `forall` object by object, those `at` one of the ends with its number."""
        head, *rest = words_of(tree) if tree else ["and"]
        if head == "and":
            for each in rest:
                yield from self.spread(each, scope, ends, at)
        elif head == "forall":
            for inner in self.model.bindings(rest[0], scope):
                yield from self.spread(rest[1], inner, ends, at)
        elif ends and head == "at" and len(rest) == 2 and rest[0] in ("start", "end"):
            need(at is None, "found something with two times")
            yield from self.spread(rest[1], scope, ends, ends[rest[0] == "end"])
        else:
            yield tree, scope, at

    def durations(self, name: str, tree: Tree, scope: Scope, ends: Ends, point: int) -> None:
        for part, inner, _ in self.spread(tree, scope, (), None):
            if part[0] == "at" and part[1:-1] in (["start"], ["end"]):
                self.durations(name, part[2], inner, ends, ends[part[1] == "end"])
                continue
            one = part[0] in COMPARISONS and part[1] == "?duration" and inner is scope
            need(one, f"found a malformed duration in {name}")
            condition = self.model.condition(part, inner)
            if part[0] == "=" and ("duration", name) in self.varied:
                self.instead.setdefault(name, []).append(written(part[2], inner.bound))
                condition = ("=", ("duration",), ("parameter", self.varied["duration", name]))
            self.state(f"{name}: duration", condition, ends, point)

    def conditions(self, name: str, tree: Tree, scope: Scope, ends: Ends) -> None:
        where = {"at start": ends[:1], "at end": ends[1:], "over all": ends}
        for part, inner, _ in self.spread(tree, scope, (), None):
            words = " ".join(map(str, part[:2]))
            need(len(part) == 3 and words in where, f"{name}: a condition without a time")
            self.state(f"{name}: {words}", self.model.condition(part[2], inner), ends, *where[words])

    def add_effects(self, tree: Tree, scope: Scope, ends: Ends, when: Tree, at: int | None) -> None:
        """The effects in a tree, if `when` holds; they happen at `at`, which is not known yet at the top."""
        for part, inner, point in self.spread(tree, scope, ends, at):
            head, *rest = part
            if head == "when":
                condition, effect = rest
                if point is None:
                    apart = len(condition) != 3 or condition[0] != "at" or effect[:2] != condition[:2]
                    need(not apart, "found an effect between two times")
                    condition = condition[2]
                guard = ("and", when, self.model.condition(condition, inner))
                if inner.lifted or decided(guard) is not False:
                    self.add_effects(effect, inner, ends, guard, point)
            elif point is not None:
                self.effects[point].append(Effect(*self.effect(head, rest, inner), when, ends))
            else:
                rate = rest[1] if head in ("increase", "decrease") else []
                known = len(rate) == 3 and rate[0] == "*" and rate.count("#t") == 1
                need(known, "found an effect without a time, or another rate than (* #t RATE)")
                slope = self.model.expression(rate[2] if rate[1] == "#t" else rate[1], inner._replace(durative=False))
                slope = slope if head == "increase" else ("-", slope)
                self.flows.append((*ends, self.changed(rest[0], inner), slope))

    def changed(self, tree: Tree, scope: Scope) -> str:
        fluent = self.model.ground(tree, scope, self.model.functions)
        self.model.written.add(fluent.strip("()").split()[0])
        return fluent

    def effect(self, head: str, rest: list[Tree], scope: Scope) -> tuple[str, str, Tree]:
        if head not in CHANGES:
            kind, atom = ("delete", rest[0]) if head == "not" else ("add", [head, *rest])
            return kind, self.model.ground(atom, scope, self.model.predicates), None
        fluent = self.changed(rest[0], scope)
        amount = self.model.expression(rest[1], scope)
        if head == "scale-down":
            return "assign", fluent, self.model.quotient(("fluent", fluent), amount, scope)
        if head == "scale-up":
            return "assign", fluent, ("*", ("fluent", fluent), amount)
        return ("increase", fluent, ("-", amount)) if head == "decrease" else (head, fluent, amount)


def written(tree: Tree, bound: Mapping[str, str]) -> str:
    """A form as its text says it, with objects for variables."""
    return f"({' '.join(written(each, bound) for each in tree)})" if type(tree) is list else bound.get(tree, tree)


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
