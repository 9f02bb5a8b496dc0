"""What is wrong with a text is said at the place where it is wrong; `@` marks that place.

In the tables each row is a text and, after `=>`, a part of the message.
"""

import pytest

from robust.errors import InputError
from robust.plan.pddl.reader import parse_domain, parse_problem
from tests.plan.building import refused as check

HEAD = """(define (domain d)
 (:types truck ship - vehicle place vehicle - object)
 (:constants hub - place big - truck)
 (:predicates (at ?v - vehicle ?p - place) (open ?p - place) (idle))
 (:functions (fuel ?v - vehicle) (total))
 """
DOMAIN = parse_domain(HEAD + "(:synth-parameters ?s))", "d.pddl")


def refused(text: str, message: str, *, unsupported: bool = False, problem: bool = False) -> None:
    """The text is refused with that message in one line, at its mark."""
    assert text.count("@") == 1
    before, file = text[: text.index("@")], "p.pddl" if problem else "d.pddl"
    place = f"{file}:{before.count(chr(10)) + 1}:{len(before) - before.rfind(chr(10))}: "
    clean = text.replace("@", "")
    code = 4 if unsupported else 2
    check(lambda: parse_problem(clean, DOMAIN, file) if problem else parse_domain(clean, file), place, [message], code)


STRUCTURE = """
@ => found an empty file, expected (define (domain ...) ...)
@(foo (domain d)) => found '(foo (domain …))'
@(define) => found '(define)', expected (domain ...) after 'define'
(define @(problem p)) => found a problem, expected a domain; are the files in the right order?
(define @(domain)) => expected (domain NAME)
(define (domain d)) @(define (domain e)) => expected the end of the file after the domain
@(define (domain d) => found the end of the file, expected ')' to close the '(define' that is opened
(define (domain d) @strips) => found 'strips', expected a section
(define (domain d) (@:predicate (p))) => did you mean ':predicates'
(define (domain d) (:predicates (@p$q))) => found 'p$q', expected a name
"""

DECLARATIONS = """
(:requirements :strips @:durative-action) => did you mean ':durative-actions'
(:requirements @strips) => found 'strips', expected a requirement such as
(:types @?t) => found '?t', expected the name of a type
(:types @a - b b - c c - a) => found 'a' above itself, expected a type hierarchy
(:types @object - a) => expected no type above it
(:types @- b) => expected the name of a type before '-'
(:types a @-) => found nothing after '-', expected a type after '-'
(:types a - @(a b)) => expected a type, as in '- truck'
(:types truck) (:constants a - @truk) => did you mean 'truck'?
(:constants @(a)) => expected the name of an object
(:predicates (p ?x - @t)) => found 't', expected a declared type
(:predicates @p) => expected a predicate with its parameters
(:predicates @()) => expected the name of a predicate
(:predicates (@forall)) => this word has a meaning of its own
(:predicates (p @x)) => expected a variable (a name that begins with ?)
(:predicates (p) (@P ?x)) => found a second predicate 'p'
(:predicates (p ?x @?x)) => found a second variable '?x'
(:functions (f) (@f)) => found a second function 'f', expected one declar
(:predicates (f)) (:functions (@f)) => it is a predicate at d.pddl
(:functions (f) @-) => 'number' after it
(:functions @- number) => a function before '-'
(:synth-parameters ?s @?s) => parameters and variables of different names
(:synth-parameters ?s - @t) => parameters to synthesise are numbers
(:synth-parameters @s) => found 's', expected a parameter
"""

ACTIONS = """
@(:action) => expected the name of an action after ':action'
(:action a :effect ()) @(:action A :effect ()) => found a second action 'a', expected one declaration
(:action a @:condition (idle)) => did you mean ':precondition'?
(:action a :effect () @:effect ()) => found a second ':effect', expected each keyword once
(:action a @:effect) => found the end of the action, expected a form in parentheses
(:action a @:precondition :effect ()) => found ':effect', expected a form in parentheses
(:action a :parameters @?x) => expected a list in parentheses after ':parameters'
(:action a :parameters (@?duration)) => it is the duration of the action
@(:durative-action a :effect ()) => expected ':duration' in a durative action
(:action a :parameters (?x) :synth-parameters (@?x)) => variables of different names
"""

CONDITIONS = """
@idle => found 'idle', expected a condition in parentheses
(@opn hub) => found 'opn', expected the name of a declared predicate; did you mean 'open'?
(@an (idle)) => did you mean 'and'
(@total) => expected a predicate; it is a numeric function, so compare it
@(open) => found 'open' with no arguments, expected 1 argument as in (open ?p)
@(idle hub) => found 'idle' with 1 argument, expected no arguments as in (idle)
(open @hubb) => found 'hubb', expected the name of a declared object; did you mean 'hub'?
(open @?pp) => found '?pp', expected a declared variable; did you mean '?p'
(at @?p hub) => found '?p' of type place, expected type vehicle for ?v of (at ?v ?p)
(open @(idle)) => expected a variable or an object
(open @+) => found '+', expected a variable or an object
(open @?s) => expected an object; it is a synthesis parameter
(@(idle)) => expected a predicate after '('
(@+ 1 2) => found '+', expected a condition: a predicate, a comparison
@(not) => found 'not' with no operands, expected one condition
@(not (idle) (idle)) => found 'not' with 2 operands
@(forall (idle)) => found 'forall' with 1 operand, expected variables in parentheses
(exists @?x (idle)) => expected variables in parentheses, as in (?x - type)
@(>= (total)) => found '>=' with 1 operand, expected two operands
(>= (@idle) 1) => expected a numeric function; it is a predicate
(>= (fuel @hub) 1) => found 'hub' of type place, expected type vehicle
(>= @fuel 1) => found 'fuel' with no arguments, expected 1 argument
(>= @() 1) => found '()', expected a numeric expression
(>= (@< 1 2) 1) => expected an arithmetic operator
(>= @:x 1) => found ':x', expected a numeric expression
(>= @hub 1) => expected the name of a declared numeric function
(>= @?p 1) => expected a number; it is a variable for objects
(= @hubb hub) => expected the name of a declared object or numeric function; did you mean 'hub'?
(= hub @(total)) => expected a variable or an object
(>= (total) @nan) => found 'nan', expected a finite number
(>= (total) @1e999999999) => expected a number of at most 400 digits
(>= (total) @1/3) => found '1/3', expected a name (of letters, digits, '-' and '_'), a ?variable
(>= @(- 1 2 3) 1) => found '-' with 3 operands, expected one or two
(>= @(/ 1) 1) => found '/' with 1 operand, expected two
(>= (/ 1 @0.0) 1) => found a division by zero, expected a divisor other than zero
(>= (total) @#t) => #t belongs into continuous effects
"""

DURATIVE = """
:condition @(idle) => found '(idle)', expected a timed condition: (at start ...), (over all
:condition @(at strat (idle)) => did you mean 'at start'?
:condition @(or (at start (idle))) => put 'or' inside it, as in (at start (or ...))
:condition @idle => found 'idle', expected a timed condition
:condition (at start @(at end (idle))) => expected a condition without a time specifier
:condition (at start (idle) @(idle)) => expected ')' after the operand of 'at start'
:duration @5 => found '5', expected a duration such as (= ?duration 5)
:duration @(idle) => expected a duration such as
:duration (>= @5 ?duration) => expected '?duration' as the left side of '>='
:duration @(over all (= ?duration 5)) => expected a duration at start or at end
:effect @(idle) => expected a timed effect: (at start ...) or (at end ...)
:effect @(over all (idle)) => expected a timed effect: (at start ...) or (at end
:effect (at start @(at end (idle))) => expected an effect without a time specif
:effect @(increase (total) 1) => or a continuous one that mentions #t
:effect (at end (increase (total) @(* #t 1))) => expected no #t in an effect at end
:effect @(assign (total) (* #t 1)) => expected increase or decrease
:effect (increase (total) @(* #t #t)) => expected a rate times #t, as in (* #t 2)
:effect (increase (total) (/ #t @0)) => found a division by zero
:effect (increase (total) (* #t @?duration)) => does not depend on the duration
:effect @idle => found 'idle', expected an effect in parentheses
:effect @(or (at start (idle))) => effects are deterministic
:effect @(when (at start (idle))) => found 'when' with 1 operand, expected 2 parts
:effect (at end (increase @5 1)) => expected a numeric function to change
:effect (at end @(increase (total))) => found 'increase' with 1 operand
:effect (at end (not @idle)) => expected a proposition in parentheses
"""

UNSUPPORTED = """
@(:derived (p) (q)) => found a derived predicate
@(:constraints (always (p))) => found trajectory constraints
(:action a :precondition @(preference x (idle))) => found a preference
(:durative-action a :duration () :condition @(preference x (at start (idle)))) => found a preference
(:durative-action a :duration () :effect @(when (at start (idle)) (at end (not (idle))))) =>
    found a conditional effect that mixes 'at end' and 'at start'
(:durative-action a :duration () :effect @(when (over all (idle)) (at end (not (idle))))) =>
    mixes 'at end' and 'over all'
(:durative-action a :duration () :effect @(when (at start (idle)) (increase (total) (* #t 1)))) =>
    found a conditional continuous effect
"""

PROBLEMS = """
(:domain @e) (:init) (:goal ()) => found a problem for domain 'e', expected 'd', the domain of d.pddl
@(:domain) (:init) (:goal ()) => expected (:domain NAME)
(@:gaol ()) => did you mean ':goal'?
(:domain d) (:init) (:goal (idle) @(idle)) => expected one condition in (:goal
(:domain d) (:objects small - truck) (:init) (:goal (idle)) (:metric @least (total)) =>
    expected 'minimize' or 'maximize'
(:domain d) (:objects small - truck) (:init) (:goal (idle)) @(:metric minimize) =>
    expected (:metric minimize EXPRESSION)
(:domain d) (:objects small - truck) (:init) (:goal (idle)) (:metric minimize (@totl)) => did you mean 'total
"""

FACTS = """
@idle => found 'idle', expected an initial fact in parentheses
@() => found '()', expected a predicate after '('
(@idel) => did you mean 'idle'?
@(= (total)) => expected a numeric function and its value, as in (= (f) 3)
(= @3 (total)) => expected a numeric function, as in (= (f) 3)
(= (total) @NaN) => found 'nan', expected a finite number
(= (total) @(+ 1 2)) => found '(+ 1 2)', expected a number
(= (total) 1) @(= total 2) => found (total) = 2, expected the value given before, 1
(idle) @(not (idle)) => found (idle) = false, expected the value given before, true
(not @idle) => expected a proposition in parentheses
(at @-1 (idle)) => found '-1', expected a time of at least zero
@(at 5) => expected one fact in parentheses after the time
(at 5 (idle)) @(at 5.0 (not (idle))) => found (idle) = false, expected the value given
"""

PROBLEM_STRUCTURE = """
(define @(domain d)) => found a domain, expected a problem; are the files in the right order?
@ => found an empty file, expected (define (problem ...) ...)
(define (problem @p) (:domain d) (:init)) => expected a section (:goal ...) in the problem
(define (problem @p) (:domain d) (:goal ())) => expected a section (:init ...)
(define (problem @p) (:init) (:goal ())) => expected a section (:domain ...)
"""


GROUPS = {
    "structure": ("{}", STRUCTURE),
    "declaration": ("(define (domain d) {})", DECLARATIONS),
    "action": (f"{HEAD}{{}})", ACTIONS),
    "condition": (
        f"{HEAD}(:action a :parameters (?p - place) :synth-parameters (?s) :precondition (and (idle)\n {{}})))",
        CONDITIONS,
    ),
    "durative": (f"{HEAD}(:durative-action a {{}}))", DURATIVE),
    "unsupported": (f"{HEAD}{{}})", UNSUPPORTED),
    "problem": ("(define (problem p) {})", PROBLEMS),
    "fact": ("(define (problem p) (:domain d) (:init (open hub)\n {}) (:goal ()))", FACTS),
    "problem's structure": ("{}", PROBLEM_STRUCTURE),
}


def cases() -> list[object]:
    found = []
    for group, (frame, table) in GROUPS.items():
        for row in table.strip().replace(" =>\n   ", " =>").splitlines():
            text, message = row.split(" => ")
            if group == "durative" and not text.startswith(":duration"):
                text = f":duration () {text}"
            found.append(pytest.param(group, frame.replace("{}", text), message, id=f"{group}: {text}"))
    return found


@pytest.mark.parametrize(("group", "text", "message"), cases())
def test_text_is_refused(group: str, text: str, message: str) -> None:
    problem = group in ("problem", "problem's structure", "fact")
    refused(text, message, unsupported=group == "unsupported", problem=problem)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "(define (domain d)\n @(:predicates (p)\n (:action a :effect (p)))",
            "found '(:action' in line 3, column 2, expected ')' to close the '(:predicates' that is opened here",
        ),
        ("(define (domain d))\n @)", "found a surplus ')', expected the end of the file; the form before it"),
        ("(define (domain d) (:types a)\n @(:types b))", "expected one; the first is at d.pddl:1:20"),
        ("(define (domain @\x07))", "found '\\x07'"),
        ("(define " * 120 + "@(" + "(" * 30 + ")" * 151, "found too many nested forms, expected at most 120"),
        (HEAD + "(:action a :precondition (> @?duration 1)))", "only durative actions have a duration"),
        (HEAD + "(:action a :effect (increase (total) @#t)))", "an instantaneous action has no continuous"),
        (HEAD + "(:action a :effect (increase (total) @-total)))", "found '-total', expected a numeric expression"),
    ],
)
def test_domain_is_refused(text: str, message: str) -> None:
    refused(text, message)


def test_what_is_unsupported_elsewhere() -> None:
    metric = "(:init) (:goal (idle)) (:metric minimize @(is-violated x))"
    refused(f"(define (problem p) (:domain d) {metric})", "found a preference", unsupported=True, problem=True)
    function = "(define (domain d) (:types t) (:functions (f) - @t))"
    refused(function, "found a function that returns objects", unsupported=True)


@pytest.mark.parametrize("text", ["(" * 20_000, ")" * 20_000, "(" * 20_000 + ")" * 20_000, "(not " * 20_000 + "(p)"])
def test_absurd_nesting_is_an_input_error(text: str) -> None:
    with pytest.raises(InputError, match="expected"):
        parse_domain(text)


def test_nesting_within_the_limit_is_read() -> None:
    text = f"(>= {'(- ' * 110}(total){')' * 110} 1)"
    assert "a" in parse_domain(f"{HEAD}(:action a :precondition {text}))").actions
