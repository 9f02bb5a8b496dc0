"""What is wrong with a text is said at the place where it is wrong; `@` marks that place."""

import pytest

from robust.errors import InputError, RobustError, UnsupportedError
from robust.plan.pddl.reader import parse_domain, parse_problem

HEAD = """(define (domain d)
 (:types truck ship - vehicle place vehicle - object)
 (:constants hub - place big - truck)
 (:predicates (at ?v - vehicle ?p - place) (open ?p - place) (idle))
 (:functions (fuel ?v - vehicle) (total))
 """


def position(text: str) -> tuple[str, int, int]:
    """The text without its mark, and line and column of the mark."""
    assert text.count("@") == 1
    before = text[: text.index("@")]
    return text.replace("@", ""), before.count("\n") + 1, len(before) - (before.rfind("\n") + 1) + 1


def check(error: RobustError, file: str, line: int, column: int, message: str) -> None:
    assert str(error).startswith(f"{file}:{line}:{column}: "), str(error)
    assert message in str(error)
    assert "\n" not in str(error)
    assert "expected" in str(error)


def refused_domain(text: str, message: str, kind: type[RobustError] = InputError) -> None:
    text, line, column = position(text)
    with pytest.raises(kind) as caught:
        parse_domain(text, "d.pddl")
    check(caught.value, "d.pddl", line, column, message)
    assert caught.value.exit_code == (4 if kind is UnsupportedError else 2)


STRUCTURE = {
    "empty": ("@", "found an empty file, expected (define (domain ...) ...)"),
    "comment only": ("@;(define (domain d))", "found an empty file"),
    "a word": ("@hello", "found 'hello', expected (define (domain ...) ...)"),
    "another form": ("@(foo (domain d))", "found '(foo (domain …))'"),
    "nothing defined": ("@(define)", "found '(define)', expected (domain ...) after 'define'"),
    "a problem": ("(define @(problem p))", "found a problem, expected a domain; are the files in the right order?"),
    "no name": ("(define @(domain))", "expected (domain NAME)"),
    "two names": ("(define @(domain a b))", "expected (domain NAME)"),
    "variable as name": ("(define @(domain ?a))", "expected (domain NAME)"),
    "two definitions": ("(define (domain d)) @(define (domain e))", "expected the end of the file after the domain"),
    "unclosed": (
        "@(define (domain d)",
        "found the end of the file, expected ')' to close the '(define' that is opened",
    ),
    "unclosed inside": ("(define (domain d) (:predicates @(p", "expected ')' to close the '(p'"),
    "unclosed section": (
        "(define (domain d)\n @(:predicates (p)\n (:action a :effect (p)))",
        "found '(:action' in line 3, column 2, expected ')' to close the '(:predicates' that is opened here",
    ),
    "surplus": ("(define (domain d))\n @)", "found a surplus ')', expected the end of the file; the form before it"),
    "surplus first": ("@) (define (domain d))", "found a surplus ')'"),
    "bare word as section": ("(define (domain d) @strips)", "found 'strips', expected a section"),
    "empty section": ("(define (domain d) @())", "found '()', expected a section"),
    "unknown section": ("(define (domain d) (@:predicate (p)))", "did you mean ':predicates'"),
    "problem's section": ("(define (domain d) (@:goal (p)))", "found ':goal', expected a section"),
    "second section": ("(define (domain d) (:types a)\n @(:types b))", "expected one; the first is at d.pddl:1:20"),
    "strange word": ("(define (domain d) (:predicates (@p$q)))", "found 'p$q', expected a name"),
    "string": ('(define (domain @"d"))', "expected a name (of letters, digits, '-' and '_')"),
    "control character": ("(define (domain @\x07))", "found '\\x07'"),
    "not ASCII": ("(define (domain @café))", "found 'café', expected a name (of letters"),
    "dash without blank": ("(define (domain d) (:constants a @-place))", "a '-' before a type is followed by a blank"),
    "deep": ("(define " * 120 + "@(" + "(" * 30 + ")" * 151, "found too many nested forms, expected at most 120"),
}

DECLARATIONS = {
    "requirement": (
        "(define (domain d) (:requirements :strips @:durative-action))",
        "did you mean ':durative-actions'",
    ),
    "requirement word": (
        "(define (domain d) (:requirements @strips))",
        "found 'strips', expected a requirement such as",
    ),
    "type is no name": ("(define (domain d) (:types @?t))", "found '?t', expected the name of a type"),
    "type cycle": (
        "(define (domain d) (:types @a - b b - c c - a))",
        "found 'a' above itself, expected a type hierarchy",
    ),
    "type above itself": ("(define (domain d) (:types @a - a))", "without cycles"),
    "object below": ("(define (domain d) (:types @object - a))", "expected no type above it"),
    "type twice": ("(define (domain d) (:types a - b c @a - c))", "found a second, different type 'a'"),
    "dash first": ("(define (domain d) (:types @- b))", "expected the name of a type before '-'"),
    "dash last": ("(define (domain d) (:types a @-))", "found nothing after '-', expected a type after '-'"),
    "no type after dash": ("(define (domain d) (:types a - @(a b)))", "expected a type, as in '- truck'"),
    "empty either": ("(define (domain d) (:types a - @(either)))", "expected a type, as in '- truck'"),
    "unknown type of constant": ("(define (domain d) (:types truck) (:constants a - @truk))", "did you mean 'truck'?"),
    "constant is a form": ("(define (domain d) (:constants @(a)))", "expected the name of an object"),
    "constant with two types": (
        "(define (domain d) (:types t u) (:constants a - t @a - u))",
        "found object 'a' with another type, expected the type of the declaration at d.pddl:1:45",
    ),
    "unknown type of variable": (
        "(define (domain d) (:predicates (p ?x - @t)))",
        "found 't', expected a declared type",
    ),
    "predicate is a word": ("(define (domain d) (:predicates @p))", "expected a predicate with its parameters"),
    "predicate without name": ("(define (domain d) (:predicates @()))", "expected the name of a predicate"),
    "predicate named variable": ("(define (domain d) (:predicates (@?x)))", "expected the name of a predicate"),
    "reserved predicate": ("(define (domain d) (:predicates (@forall)))", "this word has a meaning of its own"),
    "parameter is a name": (
        "(define (domain d) (:predicates (p @x)))",
        "expected a variable (a name that begins with ?)",
    ),
    "predicate twice": ("(define (domain d) (:predicates (p) (@P ?x)))", "found a second predicate 'p'"),
    "variable twice": ("(define (domain d) (:predicates (p ?x @?x)))", "found a second variable '?x'"),
    "function twice": ("(define (domain d) (:functions (f) (@f)))", "found a second function 'f', expected one declar"),
    "function and predicate": (
        "(define (domain d) (:predicates (f)) (:functions (@f)))",
        "it is a predicate at d.pddl",
    ),
    "function type missing": ("(define (domain d) (:functions (f) @-))", "'number' after it"),
    "function type first": ("(define (domain d) (:functions @- number))", "a function before '-'"),
    "parameter twice": (
        "(define (domain d) (:synth-parameters ?s @?s))",
        "parameters and variables of different names",
    ),
    "parameter of a type": ("(define (domain d) (:synth-parameters ?s - @t))", "parameters to synthesise are numbers"),
    "parameter is a word": ("(define (domain d) (:synth-parameters @s))", "found 's', expected a parameter"),
    "parameter named duration": ("(define (domain d) (:synth-parameters @?duration))", "different names"),
}

UNSUPPORTED = {
    "process": ("(define (domain d) @(:process p))", "found a process, expected PDDL 2.1 level 3 without it: make it"),
    "event": ("(define (domain d) @(:event p))", "found an event"),
    "derived": ("(define (domain d) @(:derived (p) (q)))", "found a derived predicate"),
    "constraints": ("(define (domain d) @(:constraints (always (p))))", "found trajectory constraints"),
    "object function": (
        "(define (domain d) (:types t) (:functions (f) - @t))",
        "found a function that returns objects",
    ),
    "preference": (HEAD + "(:action a :precondition @(preference x (idle))))", "found a preference"),
    "timed preference": (
        HEAD + "(:durative-action a :duration () :condition @(preference x (at start (idle)))))",
        "found a preference",
    ),
    "mixed when": (
        HEAD + "(:durative-action a :duration () :effect @(when (at start (idle)) (at end (not (idle))))))",
        "found a conditional effect that mixes 'at end' and 'at start'",
    ),
    "when over all": (
        HEAD + "(:durative-action a :duration () :effect @(when (over all (idle)) (at end (not (idle))))))",
        "mixes 'at end' and 'over all'",
    ),
    "conditional continuous": (
        HEAD + "(:durative-action a :duration () :effect @(when (at start (idle)) (increase (total) (* #t 1)))))",
        "found a conditional continuous effect",
    ),
}

ACTIONS = {
    "no name": ("@(:action)", "expected the name of an action after ':action'"),
    "variable as name": ("(:action @?a)", "expected the name of an action"),
    "twice": ("(:action a :effect ()) @(:action A :effect ())", "found a second action 'a', expected one declaration"),
    "unknown keyword": (
        "(:action a @:efect (idle))",
        "found ':efect', expected a keyword of this kind of action; did you",
    ),
    "wrong keyword": ("(:action a @:condition (idle))", "did you mean ':precondition'?"),
    "keyword twice": ("(:action a :effect () @:effect ())", "found a second ':effect', expected each keyword once"),
    "keyword without form": ("(:action a @:effect)", "found the end of the action, expected a form in parentheses"),
    "keyword before keyword": (
        "(:action a @:precondition :effect ())",
        "found ':effect', expected a form in parentheses",
    ),
    "two forms": ("(:action a :effect () @())", "found '()', expected a keyword"),
    "parameters bare": ("(:action a :parameters @?x)", "expected a list in parentheses after ':parameters'"),
    "parameter called duration": ("(:action a :parameters (@?duration))", "it is the duration of the action"),
    "no duration": ("@(:durative-action a :effect ())", "expected ':duration' in a durative action"),
    "section inside": ("(:action a :effect () @(:predicates (q)))", "found '(:predicates (q))', expected a keyword"),
    "synth clash": ("(:action a :parameters (?x) :synth-parameters (@?x))", "variables of different names"),
}

CONDITIONS = {
    "word": ("@idle", "found 'idle', expected a condition in parentheses"),
    "unknown predicate": ("(@opn hub)", "found 'opn', expected the name of a declared predicate; did you mean 'open'?"),
    "misspelt connective": ("(@an (idle))", "did you mean 'and'"),
    "function as predicate": ("(@total)", "expected a predicate; it is a numeric function, so compare it"),
    "too few arguments": ("@(open)", "found 'open' with no arguments, expected 1 argument as in (open ?p)"),
    "too many arguments": ("@(idle hub)", "found 'idle' with 1 argument, expected no arguments as in (idle)"),
    "unknown object": ("(open @hubb)", "found 'hubb', expected the name of a declared object; did you mean 'hub'?"),
    "unknown variable": ("(open @?pp)", "found '?pp', expected a declared variable; did you mean '?p'"),
    "wrong type": ("(open @big)", "found 'big' of type truck, expected type place for ?p of (open ?p)"),
    "wrong type of variable": ("(at @?p hub)", "found '?p' of type place, expected type vehicle for ?v of (at ?v ?p)"),
    "argument is a form": ("(open @(idle))", "expected a variable or an object"),
    "argument is an operator": ("(open @+)", "found '+', expected a variable or an object"),
    "argument is a number": ("(open @3)", "found '3', expected the name of a declared object"),
    "argument is a parameter": ("(open @?s)", "expected an object; it is a synthesis parameter"),
    "form as head": ("(@(idle))", "expected a predicate after '('"),
    "arithmetic as condition": ("(@+ 1 2)", "found '+', expected a condition: a predicate, a comparison"),
    "not without operand": ("@(not)", "found 'not' with no operands, expected one condition"),
    "not with two": ("@(not (idle) (idle))", "found 'not' with 2 operands"),
    "imply with one": ("@(imply (idle))", "found 'imply' with 1 operand, expected 2 conditions"),
    "forall without variables": (
        "@(forall (idle))",
        "found 'forall' with 1 operand, expected variables in parentheses",
    ),
    "exists of a word": ("(exists @?x (idle))", "expected variables in parentheses, as in (?x - type)"),
    "exists of unknown type": ("(exists (?x - @plce) (idle))", "did you mean 'place'?"),
    "comparison with one": ("@(>= (total))", "found '>=' with 1 operand, expected two operands"),
    "unknown function": ("(>= (@totl) 1)", "expected the name of a declared numeric function; did you mean 'total'?"),
    "predicate as function": ("(>= (@idle) 1)", "expected a numeric function; it is a predicate"),
    "function of a wrong type": ("(>= (fuel @hub) 1)", "found 'hub' of type place, expected type vehicle"),
    "bare function with parameters": ("(>= @fuel 1)", "found 'fuel' with no arguments, expected 1 argument"),
    "empty expression": ("(>= @() 1)", "found '()', expected a numeric expression"),
    "comparison as number": ("(>= (@< 1 2) 1)", "expected an arithmetic operator"),
    "keyword as number": ("(>= @:x 1)", "found ':x', expected a numeric expression"),
    "operator as number": ("(>= @+ 1)", "found '+', expected a numeric expression"),
    "object as number": ("(>= @hub 1)", "expected the name of a declared numeric function"),
    "object variable as number": ("(>= @?p 1)", "expected a number; it is a variable for objects"),
    "equality": ("(= @hubb hub)", "expected the name of a declared object or numeric function; did you mean 'hub'?"),
    "equality of number and object": (
        "(= (total) @hub)",
        "found 'hub', expected the name of a declared numeric function",
    ),
    "equality of object and number": ("(= hub @(total))", "expected a variable or an object"),
    "nan": ("(>= (total) @nan)", "found 'nan', expected a finite number"),
    "inf": ("(>= (total) @inf)", "found 'inf', expected a finite number"),
    "huge number": ("(>= (total) @1e999999999)", "expected a number of at most 400 digits"),
    "long number": (f"(>= (total) @{'9' * 5000})", "expected a number of at most 400 digits"),
    "fraction": ("(>= (total) @1/3)", "found '1/3', expected a name (of letters, digits, '-' and '_'), a ?variable"),
    "three minus": ("(>= @(- 1 2 3) 1)", "found '-' with 3 operands, expected one or two"),
    "one division": ("(>= @(/ 1) 1)", "found '/' with 1 operand, expected two"),
    "empty sum": ("(>= @(+) 1)", "found '+' with no operands, expected at least one"),
    "zero division": ("(>= (/ 1 @0.0) 1)", "found a division by zero, expected a divisor other than zero"),
    "#t": ("(>= (total) @#t)", "#t belongs into continuous effects"),
}

DURATIVE = {
    "no time": (
        ":duration () :condition @(idle)",
        "found '(idle)', expected a timed condition: (at start ...), (over all",
    ),
    "predicate at": (":duration () :condition @(at big hub)", "expected a timed condition"),
    "misspelt time": (":duration () :condition @(at strat (idle))", "did you mean 'at start'?"),
    "or outside": (":duration () :condition @(or (at start (idle)))", "put 'or' inside it, as in (at start (or ...))"),
    "word": (":duration () :condition @idle", "found 'idle', expected a timed condition"),
    "nested time": (
        ":duration () :condition (at start @(at end (idle)))",
        "expected a condition without a time specifier",
    ),
    "two operands": (
        ":duration () :condition (at start (idle) @(idle))",
        "expected ')' after the operand of 'at start'",
    ),
    "duration word": (":duration @5", "found '5', expected a duration such as (= ?duration 5)"),
    "duration predicate": (":duration @(idle)", "expected a duration such as"),
    "duration reversed": (":duration (>= @5 ?duration)", "expected '?duration' as the left side of '>='"),
    "duration over all": (":duration @(over all (= ?duration 5))", "expected a duration at start or at end"),
    "effect without time": (":duration () :effect @(idle)", "expected a timed effect: (at start ...) or (at end ...)"),
    "effect over all": (
        ":duration () :effect @(over all (idle))",
        "expected a timed effect: (at start ...) or (at end",
    ),
    "effect nested time": (
        ":duration () :effect (at start @(at end (idle)))",
        "expected an effect without a time specif",
    ),
    "update without time": (":duration () :effect @(increase (total) 1)", "or a continuous one that mentions #t"),
    "continuous at end": (
        ":duration () :effect (at end (increase (total) @(* #t 1)))",
        "expected no #t in an effect at end",
    ),
    "continuous assign": (":duration () :effect @(assign (total) (* #t 1))", "expected increase or decrease"),
    "squared time": (":duration () :effect (increase (total) @(* #t #t))", "expected a rate times #t, as in (* #t 2)"),
    "time plus": (":duration () :effect (increase (total) @(+ #t 1))", "expected a rate times #t"),
    "time divides": (":duration () :effect (increase (total) @(/ 1 #t))", "expected a rate times #t"),
    "rate over zero": (":duration () :effect (increase (total) (/ #t @0))", "found a division by zero"),
    "rate of duration": (
        ":duration () :effect (increase (total) (* #t @?duration))",
        "does not depend on the duration",
    ),
    "effect is a word": (":duration () :effect @idle", "found 'idle', expected an effect in parentheses"),
    "disjunctive effect": (":duration () :effect @(or (at start (idle)))", "effects are deterministic"),
    "negated update": (
        ":duration () :effect (at start (not (@increase (total) 1)))",
        "expected the name of a declared pred",
    ),
    "when with one": (
        ":duration () :effect @(when (at start (idle)))",
        "found 'when' with 1 operand, expected 2 parts",
    ),
    "update of a number": (":duration () :effect (at end (increase @5 1))", "expected a numeric function to change"),
    "update of a predicate": (":duration () :effect (at end (increase (@idle) 1))", "it is a predicate"),
    "update without value": (":duration () :effect (at end @(increase (total)))", "found 'increase' with 1 operand"),
    "negated word": (":duration () :effect (at end (not @idle))", "expected a proposition in parentheses"),
}


@pytest.mark.parametrize("case", [*STRUCTURE, *DECLARATIONS])
def test_domain_is_refused(case: str) -> None:
    text, message = {**STRUCTURE, **DECLARATIONS}[case]
    refused_domain(text, message)


@pytest.mark.parametrize("case", UNSUPPORTED)
def test_unsupported_domain(case: str) -> None:
    text, message = UNSUPPORTED[case]
    refused_domain(text, message, UnsupportedError)


@pytest.mark.parametrize("case", ACTIONS)
def test_action_is_refused(case: str) -> None:
    text, message = ACTIONS[case]
    refused_domain(f"{HEAD}{text})", message)


@pytest.mark.parametrize("case", CONDITIONS)
def test_condition_is_refused(case: str) -> None:
    text, message = CONDITIONS[case]
    declared = ":parameters (?p - place) :synth-parameters (?s)"
    refused_domain(f"{HEAD}(:action a {declared} :precondition (and (idle)\n {text})))", message)


@pytest.mark.parametrize("case", DURATIVE)
def test_durative_action_is_refused(case: str) -> None:
    text, message = DURATIVE[case]
    refused_domain(f"{HEAD}(:durative-action a\n {text}))", message)


def test_duration_and_time_have_no_meaning_in_an_instantaneous_action() -> None:
    refused_domain(HEAD + "(:action a :precondition (> @?duration 1)))", "only durative actions have a duration")
    refused_domain(HEAD + "(:action a :effect (increase (total) @#t)))", "an instantaneous action has no continuous")


def test_variable_may_not_have_the_name_of_a_domain_parameter() -> None:
    text = "(define (domain d) (:synth-parameters ?s) (:action a :parameters (@?s)))"
    refused_domain(text, "expected a name that is no synthesis parameter of the domain")


DOMAIN = parse_domain(HEAD + "(:synth-parameters ?s))", "d.pddl")
BODY = "(:domain d) (:objects small - truck) (:init) (:goal (idle))"
PROBLEMS = {
    "domain": ("(define @(domain d))", "found a domain, expected a problem; are the files in the right order?"),
    "empty": ("@", "found an empty file, expected (define (problem ...) ...)"),
    "no goal": ("(define (problem @p) (:domain d) (:init))", "expected a section (:goal ...) in the problem"),
    "no init": ("(define (problem @p) (:domain d) (:goal ()))", "expected a section (:init ...)"),
    "no domain": ("(define (problem @p) (:init) (:goal ()))", "expected a section (:domain ...)"),
    "other domain": (
        "(define (problem p) (:domain @e) (:init) (:goal ()))",
        "found a problem for domain 'e', expected 'd', the domain of d.pddl",
    ),
    "empty domain": ("(define (problem p) @(:domain) (:init) (:goal ()))", "expected (:domain NAME)"),
    "unknown section": ("(define (problem p) (@:gaol ()))", "did you mean ':goal'?"),
    "object type": (
        "(define (problem p) (:domain d) (:objects a - @trck) (:init) (:goal ()))",
        "did you mean 'truck'?",
    ),
    "conflict with constant": (
        "(define (problem p) (:domain d) (:objects @hub - truck) (:init) (:goal ()))",
        "found object 'hub' with another type, expected the type of the declaration at d.pddl:3:14",
    ),
    "two goals": (
        "(define (problem p) (:domain d) (:init) (:goal (idle) @(idle)))",
        "expected one condition in (:goal",
    ),
    "empty goal": ("(define (problem p) (:domain d) (:init) @(:goal))", "expected one condition in (:goal"),
    "goal": ("(define (problem p) (:domain d) (:init) (:goal (@idel)))", "did you mean 'idle'?"),
    "goal duration": ("(define (problem p) (:domain d) (:init) (:goal (> @?duration 1)))", "only durative actions"),
    "metric": (f"(define (problem p) {BODY} (:metric @least (total)))", "expected 'minimize' or 'maximize'"),
    "metric alone": (f"(define (problem p) {BODY} @(:metric minimize))", "expected (:metric minimize EXPRESSION)"),
    "metric name": (f"(define (problem p) {BODY} (:metric minimize (@totl)))", "did you mean 'total"),
}

FACTS = {
    "word": ("@idle", "found 'idle', expected an initial fact in parentheses"),
    "empty": ("@()", "found '()', expected a predicate after '('"),
    "unknown": ("(@idel)", "did you mean 'idle'?"),
    "unknown object": ("(open @hbu)", "did you mean 'hub'?"),
    "variable": ("(open @?x)", "found '?x', expected a declared variable"),
    "wrong type": ("(at @hub hub)", "found 'hub' of type place, expected type vehicle"),
    "number without value": ("@(= (total))", "expected a numeric function and its value, as in (= (f) 3)"),
    "number first": ("(= @3 (total))", "expected a numeric function, as in (= (f) 3)"),
    "no number": ("(= (total) @hub)", "found 'hub', expected a number"),
    "parameter": ("(= (total) @?s)", "found '?s', expected a number"),
    "nan": ("(= (total) @NaN)", "found 'nan', expected a finite number"),
    "expression": ("(= (total) @(+ 1 2))", "found '(+ 1 2)', expected a number"),
    "twice": ("(= (total) 1) @(= total 2)", "found (total) = 2, expected the value given before, 1"),
    "contradiction": ("(idle) @(not (idle))", "found (idle) = false, expected the value given before, true"),
    "not a word": ("(not @idle)", "expected a proposition in parentheses"),
    "negative time": ("(at @-1 (idle))", "found '-1', expected a time of at least zero"),
    "time without fact": ("@(at 5)", "expected one fact in parentheses after the time"),
    "time and word": ("@(at 5 idle)", "expected one fact in parentheses after the time"),
    "timed contradiction": ("(at 5 (idle)) @(at 5.0 (not (idle)))", "found (idle) = false, expected the value given"),
    "timed number": ("(at 5 (= (total) @x))", "found 'x', expected a number"),
    "timed unknown": ("(at 5 (@idel))", "did you mean 'idle'?"),
}


def refused_problem(text: str, message: str) -> None:
    text, line, column = position(text)
    with pytest.raises(InputError) as caught:
        parse_problem(text, DOMAIN, "p.pddl")
    check(caught.value, "p.pddl", line, column, message)


@pytest.mark.parametrize("case", PROBLEMS)
def test_problem_is_refused(case: str) -> None:
    refused_problem(*PROBLEMS[case])


@pytest.mark.parametrize("case", FACTS)
def test_initial_state_is_refused(case: str) -> None:
    text, message = FACTS[case]
    refused_problem(f"(define (problem p) (:domain d) (:init (open hub)\n {text}) (:goal ()))", message)


def test_preference_in_the_metric_is_unsupported() -> None:
    text = f"(define (problem p) {BODY} (:metric minimize (is-violated x)))"
    with pytest.raises(UnsupportedError, match="found a preference"):
        parse_problem(text, DOMAIN)


@pytest.mark.parametrize("text", ["(" * 20_000, ")" * 20_000, "(" * 20_000 + ")" * 20_000, "(not " * 20_000 + "(p)"])
def test_absurd_nesting_is_an_input_error(text: str) -> None:
    with pytest.raises(InputError, match="expected"):
        parse_domain(text)


def test_nesting_within_the_limit_is_read() -> None:
    text = f"(>= {'(- ' * 110}(total){')' * 110} 1)"
    domain = parse_domain(f"{HEAD}(:action a :precondition {text}))")
    assert "a" in domain.actions
