"""One table of wrong inputs: what is changed in which file, the exit code, and what the message must say."""

from dataclasses import dataclass


@dataclass(frozen=True)
class BadInput:
    """`old` in one of the three texts becomes `new`; the one line on stderr names `place` and says `says`."""

    name: str
    file: str
    old: str
    new: str
    place: str
    says: str
    code: int = 2


def _domain(name: str, old: str, new: str, line: int, says: str, *, code: int = 2) -> BadInput:
    return BadInput(name, "domain", old, new, f"domain.pddl:{line}:", says, code)


def _problem(name: str, old: str, new: str, line: int, says: str) -> BadInput:
    return BadInput(name, "problem", old, new, f"problem.pddl:{line}:", says)


def _plan(name: str, old: str, new: str, line: int, says: str) -> BadInput:
    return BadInput(name, "plan", old, new, f"plan.stn:{line}:", says)


_ACTION = "(:durative-action go"
_LATE = "c: g.end - g.start in [5, 5];\nc: g.end - .zero in [0, 1];"

BAD_INPUTS = (
    _domain("unbalanced parenthesis", "(ready))", "(ready)", 4, "found '(:functions' in line 5"),
    _problem("too many parentheses", "(:goal (at b)))", "(:goal (at b))))", 5, "found a surplus ')'"),
    _domain("unknown requirement", ":fluents)", ":fluents :magic)", 2, "found ':magic'"),
    _domain("unknown type", "?to - place", "?to - plaice", 7, "found 'plaice'"),
    _domain("unknown predicate", "(at start (at ?from))", "(at start (att ?from))", 9, "found 'att'"),
    _problem("unknown predicate in the goal", "(:goal (at b))", "(:goal (on b))", 5, "found 'on'"),
    _domain("unknown function", "(decrease (fuel) 1)", "(decrease (feul) 1)", 10, "found 'feul'"),
    _problem("unknown object", "(:goal (at b))", "(:goal (at c))", 5, "found 'c'"),
    _plan("unknown object in the plan", "(go a b)", "(go a c)", 2, "found 'c'"),
    _plan("unknown action", "(go a b)", "(fly a b)", 2, "found action 'fly'"),
    _domain("arity of a predicate", "(at end (at ?to))", "(at end (at ?to ?to))", 10, "found 'at' with 2 arguments"),
    _plan("arity of an action", "(go a b)", "(go a)", 2, "found 'go' with 1 argument"),
    _plan("undeclared time point", "g.end - g.start", "h.end - g.start", 4, "found time point 'h.end'"),
    _plan("undeclared parameter", "in [leave, leave]", "in [leave, late]", 3, "found 'late'"),
    _plan("a parameter named inf", "parameter leave", "parameter inf", 1, "found 'inf'"),
    _plan("lower above upper", "in [5, 5]", "in [6, 5]", 4, "found lower bound 6 above upper bound 5"),
    _plan("crossed bounds", "lb 0 ub 9", "lb 9 ub 0", 1, "found lower bound 9 above upper bound 0"),
    _plan("nominal value outside", "default 2", "default 20", 1, "found default 20"),
    _plan("no nominal value", " default 2", "", 1, "found parameter 'leave' without a nominal value"),
    _plan("not a number", "in [5, 5]", "in [5, 5x]", 4, "found '5x'"),
    _plan("missing semicolon", "(go a b);", "(go a b)", 3, "expected ';'"),
    _plan("instantaneous", "durative-action instance", "action instance", 3, "found time point 'g.start'"),
    BadInput("no initial value", "problem", " (= (fuel) 3)", "", "plan.stn:2:", "found no initial value of (fuel)"),
    _problem("another domain", "(:domain delivery)", "(:domain taxi)", 2, "found a problem for domain 'taxi'"),
    BadInput("no schedule", "plan", "c: g.end - g.start in [5, 5];", _LATE, "plan.stn:", "network has no schedule"),
    _domain("process", _ACTION, f"(:process burn)\n  {_ACTION}", 6, "found a process", code=4),
    _domain("event", _ACTION, f"(:event burn)\n  {_ACTION}", 6, "found an event", code=4),
    BadInput(
        "non-linear effect",
        "domain",
        "(at end (decrease (fuel) 1))",
        "(decrease (fuel) (* #t (fuel)))",
        "g go",
        "non-linear continuous effect on (fuel)",
        code=4,
    ),
)
