"""Options and arguments: what people have is taken, what is wrong is said of it, commands and Python agree."""

import inspect
import pydoc
import re
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from functools import partial
from math import inf, nan
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import robust
from robust import InputError, Interval, pike, stnu
from robust.backends import KNOWLEDGE_BASES
from robust.cli.build import Group, application, read
from robust.cli.main import COMMANDS
from robust.numbers import EXPECTED_NUMBER, approximate, duration, end, exact, exact_end, plural, readable
from robust.options.declare import as_typed, declared, names_of
from robust.options.pike import PikeRunOptions
from robust.options.shared import Paged
from robust.options.verbs import (
    CheckOptions,
    EnvelopeOptions,
    LearnCommand,
    LearnOptions,
    RegionOptions,
    ValidateOptions,
)
from robust.pike_bridge.knowledge import knowledge_bases
from robust.plan.pddl.reader import parse_domain, parse_problem
from robust.reading import plan_in
from tests.cli import inputs
from tests.cli.running import EXAMPLES, assert_one_line, command, example
from tests.stnu.networks import network

irr, ORDERED = partial(EnvelopeOptions, method="irr"), "expected method='widen' or 'irr', or no order"
AS_BOX = {"as_box": True, "json": True}


@pytest.mark.parametrize(
    ("ask", "says"),
    [
        *((partial(irr, beta=beta), f"beta: found '{beta}', expected a number above 0") for beta in (0, -1, "-1/2")),
        *(
            (partial(irr, beta=beta), f"beta: found '{beta}', expected {EXPECTED_NUMBER}")
            for beta in ([1], "one", True)
        ),
        (lambda: EnvelopeOptions(beta=1), "beta: found it with method='widen', expected method='irr', or no beta"),
        (lambda: EnvelopeOptions(method="optimal", order=["a"]), f"order: found it with method='optimal', {ORDERED}"),
        (lambda: EnvelopeOptions(order="a,,b"), "order: found 'a,,b', expected names such as a,b,c"),
        (lambda: EnvelopeOptions(method="widn"), "unknown method 'widn'; did you mean 'widen'?"),
        (lambda: EnvelopeOptions(solver="z4"), "unknown solver 'z4'; known are cvc5, z3"),
        (lambda: EnvelopeOptions(solver=3), "unknown solver 3; did you mean 'z3'?"),
        (lambda: CheckOptions(epsilon=True), f"epsilon: found 'True', expected {EXPECTED_NUMBER}"),
        (lambda: CheckOptions(epsilon="x"), f"epsilon: found 'x', expected {EXPECTED_NUMBER}"),
        (lambda: CheckOptions(epsilon=Fraction(-1, 2)), "epsilon: found '-1/2', expected a number of at least 0"),
        (lambda: CheckOptions(timeout=-1), "timeout: found '-1', expected a number of at least 0"),
        (lambda: RegionOptions(backend="projekt"), "unknown back end 'projekt'; did you mean 'project'?"),
        (lambda: RegionOptions(splitting="fully"), "unknown splitting 'fully'; did you mean 'full'?"),
        *(
            (partial(LearnOptions, cover=cover), f"cover: found '{cover}', expected a number above 0 and below 1")
            for cover in (0, 1)
        ),
        *(
            (partial(PikeRunOptions, chance=chance), f"chance: found '{chance}', expected a number from 0 to 1")
            for chance in ("-1/9", "10/9")
        ),
        *(
            (
                partial(ValidateOptions, plan_number=number),
                f"plan_number: found '{number}', expected a whole number from 1",
            )
            for number in (0, "3/2")
        ),
        *(
            (partial(Paged, page=page), f"page: found '{page}', expected a port from 0 to 65535")
            for page in (-1, 65536, "1/2")
        ),
        (
            partial(LearnCommand, logs=(), as_box=True, json=True),
            "--as-box: cannot be combined with --json; choose one",
        ),
    ],
)
def test_what_is_wrong_is_said_of_the_parameter(ask, says):
    with pytest.raises(InputError) as caught:
        ask()
    assert str(caught.value) == says


def test_the_ends_of_permitted_numbers_are_permitted():
    assert [PikeRunOptions(chance=chance).chance for chance in (0, 1)] == [0, 1]
    assert [ValidateOptions(plan_number=1).plan_number, Paged(page=0).page, Paged(page="65535").page] == [1, 0, 65535]


@pytest.mark.parametrize("value", [Fraction(1, 8), "1/8", "0.125", Decimal("0.125"), 0.125])
def test_numbers_are_exact(value):
    assert CheckOptions(epsilon=value).separation == irr(beta=value).precision == Fraction(1, 8)
    assert CheckOptions(epsilon=0.1).separation == Fraction(1, 10)
    assert EnvelopeOptions(order="a, b").order == ("a", "b")


def test_options_cannot_be_changed_have_no_others_and_are_named_as_typed():
    options = CheckOptions(timeout=3)
    assert (options.limit, options.changed(timeout=4).limit, options.limit) == (3.0, 4.0, 3.0)
    assert (CheckOptions(timeout=0).limit, CheckOptions(timeout=2e9).limit) == (0, 1e9)
    with pytest.raises(AttributeError, match="cannot assign to option 'timeout'"):
        options.timeout = 4
    with pytest.raises(TypeError, match="unexpected keyword argument 'timout'"):
        CheckOptions(timout=4)
    with pytest.raises(TypeError, match="no keyword argument 'domain'"):
        COMMANDS["check"].load().options(problem="p", plan="q")
    with as_typed({"beta"}), pytest.raises(InputError, match="--beta: found it with --method widen"):
        EnvelopeOptions(beta="1")


@pytest.mark.parametrize("name", ["check", "envelope", "region", "compare"])
def test_functions_take_what_commands_take(name):
    signature = inspect.signature(getattr(robust, name))
    assert next(iter(signature.parameters)) == "plan"
    typed = declared(COMMANDS[name].load().options)
    for parameter in list(signature.parameters.values())[1:]:
        assert parameter.kind is inspect.Parameter.KEYWORD_ONLY
        assert parameter.name.startswith("on_") or typed[parameter.name].default == parameter.default
        assert f"\n    {parameter.name}: " in inspect.getdoc(getattr(robust, name))
    assert set(KNOWLEDGE_BASES) == set(knowledge_bases())


LEAVES = [
    ((name, *more), entry)
    for name, group in COMMANDS.items()
    if name != "bench"
    for more, entry in ([((), group)] if not isinstance(group, Group) else [((n,), e) for n, e in group.load().items()])
]
VALUES = ("z3", "cvc5", "a b", "-1", "--json", "1/2", "x=1", "", "--", "-o", "irr", "7", "00", "γ", "=")


def by_typer(words):
    actions = []
    app = application(COMMANDS, words, "help", "version", lambda *asked: actions.append(asked) or 0)
    try:
        app(args=list(words), prog_name="robust", standalone_mode=False)
    except Exception:
        return None
    return actions[0] if actions else None


@given(st.data())
def test_both_readers_agree(data):
    """What is read at once, typer reads likewise; what it refuses is not in order."""
    path, entry = data.draw(st.sampled_from(LEAVES))
    options = declared(entry.load().options).items()
    typed = [typed for name, option in options if not option.argument for typed in names_of(name, option)]
    names = [word for each in typed for word in each.split("/")]
    word = st.one_of(
        st.sampled_from([*names, *VALUES]),
        st.builds("{}={}".format, st.sampled_from(names or ["x"]), st.sampled_from(VALUES)),
    )
    words = [*path, *data.draw(st.lists(word, max_size=7))]
    at_once = read(COMMANDS, words)
    if at_once is not None:
        assert by_typer(words) == at_once


@pytest.mark.parametrize(
    ("verb", "option", "which"),
    [("repair", "--output", 2), ("convert", "--output", 2), ("certify", "--output", 0), ("compare", "--html", 1)],
)
def test_what_is_read_is_not_written_over(verb, option, which, tmp_path):
    files = [tmp_path / Path(name).name for name in example("plan-flexible-wait.stn")]
    before = [Path(name).read_bytes() for name in example("plan-flexible-wait.stn")]
    for file, content in zip(files, before, strict=True):
        file.write_bytes(content)
    link = tmp_path / "link"
    link.symlink_to(files[which])
    for target in (files[which], link):
        ended = command(verb, *files, option, target)
        assert_one_line(ended, 2, f"{option}: found")
        assert "expected another file" in ended.err
    assert [file.read_bytes() for file in files] == before


FILES = example()
TEXTS = [Path(file).read_text(encoding="utf-8") for file in FILES]
KITCHEN = EXAMPLES / "kitchen" / "kitchen.tpnu.json"
HANDOVER = EXAMPLES / "handover" / "handover.stnu"
STEPS = example("steps.plan")
LIMIT = "limit=at-most:e1:e44"
INVALID = robust.envelope(example("plan-flexible-wait.stn"))


@pytest.fixture(scope="module")
def plan():
    return robust.load_plan(*FILES)


@given(st.fractions().filter(lambda value: value.denominator < 10**6), st.floats(-1e200, 1e200))
def test_numbers_of_all_kinds_are_exact(value, number):
    """Floats are their decimal reading."""
    assert exact(value) == exact(str(value)) == value
    assert exact(int(value)) == int(value)
    decimal = Decimal(value.numerator) / 8
    assert exact(decimal) == Fraction(decimal)
    if number == 0 or abs(number) > 1e-200:
        assert exact(number) == Fraction(repr(number))
    assert isinstance(exact(value), Fraction)


def test_one_tenth_is_one_tenth_and_boxes_are_what_people_have(plan):
    for tenth in (0.1, "0.1", "1/10", Decimal("0.1"), Fraction(1, 10), np.float64(0.1)):
        assert exact(tenth) == robust.check(plan, epsilon=tenth).epsilon == Fraction(1, 10)
    for asked in (
        robust.validate(*STEPS, epsilon=0.1),
        robust.convert(*STEPS, epsilon=0.1),
        robust.repair(plan, epsilon=0.1),
        robust.region(plan, epsilon=0.1),
        pike.load(KITCHEN, epsilon=0.1),
    ):
        assert asked.epsilon == Fraction(1, 10)
    box = robust.envelope(plan)
    intervals = box.box.intervals
    for same in (
        box,
        box.box,
        {name: (each.lower, each.upper) for name, each in intervals.items()},
        {name: [float(each.lower), str(each.upper)] for name, each in intervals.items()},
        dict(intervals),
        [f"{name}={each.lower}:{each.upper}" for name, each in intervals.items()],
    ):
        checked = robust.check(plan, at=same)
        assert (checked.box, checked.answer) == (box.box, robust.Answer.PROVED)
        assert robust.repair(plan, require=same).status is robust.RepairStatus.UNNEEDED


@pytest.mark.parametrize("wrong", [nan, inf, True, False, np.bool_(True), Decimal("NaN"), None, [1], "soon", 1j])
def test_what_is_no_number_is_refused(plan, wrong):
    for ask, name in (
        (lambda: robust.check(plan, at={"to_ridge": wrong}), "at 'to_ridge'"),
        (lambda: robust.check(plan, epsilon=wrong), "epsilon"),
        (lambda: robust.envelope(plan, method="irr", beta=wrong), "beta"),
        (lambda: robust.load_plan(*FILES, epsilon=wrong), "epsilon"),
        (lambda: pike.load(KITCHEN, epsilon=wrong), "epsilon"),
        (lambda: stnu.repair(HANDOVER, requirement=wrong), "requirement"),
    )[: 1 if wrong is None else None]:  # elsewhere None is not given
        with pytest.raises(InputError) as caught:
            ask()
        assert str(caught.value).startswith(f"{name}: found "), caught.value
        assert "expected" in str(caught.value)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ("7/4", "1.75"),
        ("-3", "−3"),
        ("1/3", "1/3"),
        ("1/1000", "0.001"),
        ("123456789", "123456789"),
        ("100000/3", "100000/3"),
        ("1000000/7", "1000000/7"),
        ("10000000/7", "≈1.42857e+06"),
        ("-12345678901/1000", "≈−1.23457e+07"),
        ("1/3000000000", "≈3.33333e−10"),
        (f"{10**400}", "≈inf"),
    ],
)
def test_numbers_for_people(value, text):
    assert readable(Fraction(value)) == text


def test_ends_lengths_of_time_and_counts_for_people():
    assert (end(None, upper=True), end(None, upper=False)) == ("∞", "−∞")
    assert end(Fraction(2), upper=True, closed=False) == "< 2"
    assert (exact_end(None, upper=True), exact_end(None, upper=False)) == ("inf", "-inf")
    assert exact_end(Fraction(7, 4), upper=False) == "7/4"
    assert approximate(Fraction(-(10**400))) == -inf
    assert [duration(seconds) for seconds in (0.123, 61, 7300)] == ["0.12 s", "1 min 1 s", "2 h 1 min"]
    assert [plural(count, "check") for count in (0, 1, 2)] == ["0 checks", "1 check", "2 checks"]
    assert [plural(count, "activity") for count in (0, 1)] == ["0 activities", "1 activity"]


BELOW, ABOVE = Interval(None, Fraction(3), lower_closed=False), Interval(Fraction(3), None, upper_closed=False)
POINT = Interval(Fraction(1, 2), Fraction(1, 2))


@pytest.mark.parametrize(
    ("at", "interval"),
    [
        *((value, BELOW) for value in ((None, 3), (-inf, 3), ("-inf", "3"), BELOW, ["to_ridge=-inf:3"])),
        *((value, ABOVE) for value in ((3, None), (3, inf), ("3", "inf"), ABOVE, [" to_ridge = 3 : +inf "])),
        *((value, POINT) for value in (Fraction(1, 2), "0.5", 0.5, POINT, ["to_ridge=1/2"], ["to_ridge=0.5:1/2"])),
        (Interval(Fraction(1), Fraction(2), upper_closed=False),) * 2,
    ],
)
def test_intervals_are_what_people_have(plan, at, interval):
    given_as_text = isinstance(at, list)
    assert robust.check(plan, at=at if given_as_text else {"to_ridge": at}).box["to_ridge"] == interval


def test_closed_ends_of_intervals_count(tmp_path):
    """Only at an end of the interval does the plan break."""
    files = inputs.write(tmp_path, domain=inputs.DOMAIN.replace("(>= (fuel) 1)", "(< (fuel) 5)"))
    plan = robust.load_plan(*files, parameters=["fluent:(fuel)"])
    for closed, answer in ((False, robust.Answer.PROVED), (True, robust.Answer.REFUTED)):
        fuel = Interval(Fraction(4), Fraction(5), upper_closed=closed)
        assert robust.check(plan, at={"fuel": fuel}).answer is answer
    assert robust.check(plan, at={"fuel": 5}).answer is robust.Answer.REFUTED


@pytest.mark.parametrize(
    ("at", "says"),
    [
        (5, "at: found '5', expected a box, an envelope, or values"),
        ({"to_moon": 5}, "unknown parameter 'to_moon'"),
        ({"to_rigde": 5}, "unknown parameter 'to_rigde'; did you mean 'to_ridge'?"),
        ({"to_ridge": (2, 1)}, "at 'to_ridge': found 2 and 1, expected a lower end"),
        ({"to_ridge": (1, 2, 3)}, "at 'to_ridge': found 3 numbers, expected a lower and an upper end"),
        ({"to_ridge": (nan, 2)}, "at 'to_ridge': found 'nan', expected a number"),
        ({"to_ridge": (inf, 2)}, "at 'to_ridge': found 'inf', expected a number"),
        ([5], "at: found '5', expected a text"),
        (b"to_ridge=5", "at: found"),
        (INVALID, "at: the envelope has no verified box"),
    ],
)
def test_wrong_boxes_are_refused(plan, at, says):
    with pytest.raises(InputError) as caught:
        robust.check(plan, at=at)
    assert says in str(caught.value)


def test_plans_are_loaded_or_paths_and_one_text_is_enough():
    for files in (FILES, tuple(FILES), [Path(file) for file in FILES]):
        assert robust.check(files).answer is robust.Answer.PROVED
    assert robust.load_plan(*FILES, parameters="start:drive_1").parameters[-1].name == "start_drive_1"
    assert pike.region(KITCHEN, "coffee=duration:make-coffee", choices="xA1").key == ("xA1",)
    assert robust.risk(FILES, ["to_ridge=constant:30", "to_crater=constant:40"]).probability.lower == 1


@pytest.mark.parametrize("steps", ["plan.stn", "steps.plan"])
def test_domains_problems_and_plans_are_paths_texts_or_what_reading_gives(steps, tmp_path):
    files = [
        Path(file).with_name(name) for file, name in zip(FILES, ("domain.pddl", "problem.pddl", steps), strict=True)
    ]
    texts = [file.read_text(encoding="utf-8") for file in files]
    domain = parse_domain(texts[0])
    parsed = [domain, parse_problem(texts[1], domain), plan_in(texts[2])]
    known = robust.load_plan(*files)
    for three in (texts, parsed, [files[0], texts[1], parsed[2]]):
        read = robust.load_plan(*three)
        assert (read.parameters, read.instances, read.goal) == (known.parameters, known.instances, known.goal)
        assert robust.check(three).answer is robust.Answer.PROVED
    ranking = robust.rank(*texts[:2], [texts[2], files[2], parsed[2]], deadline=1000)
    assert [plan.name for plan in ranking.plans] == ["plan 1", steps, "plan 3"]
    assert {text.partition(": ")[2] for text in ranking.deciding} == {"as given, they are equal"}
    (tmp_path / "log.csv").write_text("action,duration\nfly,3\n", encoding="utf-8")
    with pytest.raises(InputError, match="found action 'fly', expected one of the domain"):
        robust.learn(tmp_path / "log.csv", domain=texts[0])


def test_the_parameters_beside_a_plan_are_those_of_a_file_only(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("<plan>.toml").write_text("[parameters.x]\nduration = 'drive_3'\n", encoding="utf-8")
    Path("plan (1).stn").write_text(TEXTS[2], encoding="utf-8")
    Path("plan (1).toml").write_text("[parameters.x]\nduration = 'drive_3'\n", encoding="utf-8")
    assert [len(robust.load_plan(*TEXTS[:2], plan).parameters) for plan in (TEXTS[2], "plan (1).stn")] == [2, 3]
    with pytest.raises(InputError, match=r"plan \(2\).stn: found no such file"):
        robust.load_plan(*TEXTS[:2], "plan (2).stn")


@pytest.mark.parametrize(
    ("ask", "says"),
    [
        (lambda: robust.rank(*FILES[:2], 3), "plans: found '3', expected plans: paths or texts"),
        (lambda: robust.rank(*FILES[:2], []), "plans: found '[]', expected plans: paths or texts"),
        (lambda: robust.rank(*FILES[:2], [3]), "found no plan that can be read: found '3', expected the path"),
        (lambda: robust.learn(3), "logs: found '3', expected paths of logs"),
        (lambda: robust.learn([3]), "found '3', expected the path of a readable text file"),
        (lambda: robust.batch("check", "(define\n" * 200), "found no such file or folder"),
    ],
)
def test_what_is_no_list_of_files_is_refused(ask, says):
    with pytest.raises(InputError) as caught:
        ask()
    assert says in str(caught.value)


@pytest.mark.parametrize("wrong", ["plan.stn", FILES[:2], 3, None, [*FILES, "more"], [1, 2, 3]])
@pytest.mark.parametrize("ask", [robust.check, robust.envelope, robust.region, robust.compare, robust.repair])
def test_what_is_no_plan_is_refused(ask, wrong):
    with pytest.raises(InputError, match=r"^(plan|domain): found .*, expected "):
        ask(wrong)


WRONG = [
    (lambda plan: robust.check(plan, every="yes"), "every: found \"'yes'\", expected True or False"),
    (lambda plan: robust.check(plan, smt2=3), "smt2: found '3', expected a path"),
    (lambda plan: robust.check(plan, on_obligation=3), "on_obligation: found '3', expected a function"),
    (lambda plan: robust.envelope(plan, order=3), "order: found '3', expected texts"),
    (lambda plan: robust.risk(plan, 3), "distribution: found '3', expected texts"),
    (lambda plan: robust.risk(plan, {"to_ridge": 30}), "distribution 'to_ridge': found '30', expected a dist"),
    (lambda _: robust.load_plan(*FILES, parameters=3), "parameters: found '3', expected texts"),
    (lambda _: robust.load_plan(3, *FILES[1:]), "domain: found '3', expected a path"),
    (lambda _: robust.validate(*STEPS[:2], 3), "plan: found '3', expected a path"),
    (lambda _: robust.convert(*STEPS, mode="lazy"), "unknown mode 'lazy'"),
    (lambda _: stnu.load(None), "found 'None', expected the path of a readable text file"),
    (lambda _: stnu.dispatch(HANDOVER, timeout="soon"), "timeout: found 'soon', expected a number"),
    (lambda _: pike.load(3), "found '3', expected the path of a readable text file"),
    (lambda _: robust.load_plan(*FILES[:2], "x" * 5000), "cannot read (file name too long), expected a readable"),
    (lambda _: robust.load_plan("(define\n(domain d))", *FILES[1:]), "expected 'd', the domain of <domain>"),
    (lambda plan: robust.risk(plan, {3: "normal:1:1"}), "distribution '3': found unknown parameter '3'"),
    (lambda _: robust.risk(STEPS, {"dur": "normal:1:1"}), "the plan has none, and --parameter 'duration:*' makes some"),
    (lambda _: pike.region(KITCHEN, LIMIT).possible({}), "found no values, expected one of each parameter: limit"),
    (lambda _: pike.region(KITCHEN, LIMIT).possible({"limit": "x"}), "value of limit: found 'x', expected"),
    (lambda _: stnu.check(3), "network: found '3', expected a network, a path or a text"),
    (lambda _: stnu.repair(HANDOVER, weights={("x", "y"): 1}), "weights: found no link ('x', 'y')"),
    (lambda _: stnu.repair(HANDOVER, contingent=0), "contingent: found 0, expected a number above 0"),
    (lambda _: pike.check(3), "plan: found '3', expected a plan"),
    (lambda _: pike.check(KITCHEN, backend="pims"), "unknown back end 'pims'; did you mean 'pitms'"),
    (lambda _: pike.check(KITCHEN, assume={"xB": "mug"}), "assume: found unknown choice 'xB'"),
    (lambda _: pike.check(KITCHEN, assume="xA1"), "assume 'xA1': found 'xA1', expected NAME=VALUE"),
    (lambda _: pike.check(KITCHEN, assume={"xA1": 3}), "assume: found '3', expected a text"),
    (lambda _: pike.run(KITCHEN, outcome={"xA1": 3}), "outcome 'xA1': found '3', expected a value"),
    (lambda _: pike.run(KITCHEN, outcome={"xA1": ("mug", -1)}), "outcome 'xA1': found time '-1', expected 0"),
    (lambda _: pike.run(KITCHEN, disturb="no"), "disturb 'no': found 'no', expected '(atom)@TIME'"),
    (lambda _: pike.run(KITCHEN, reasoner="smt", backend="pitms"), "backend: found pitms with reasoner='smt'"),
    (lambda _: pike.run(KITCHEN, pace="slow"), "unknown pace 'slow'; known are"),
    (lambda _: pike.region(KITCHEN, 3), "parameters: found '3', expected texts"),
    (lambda _: pike.act("(wait)", "soon", 3), "lower: found 'soon', expected a number"),
]


@pytest.mark.parametrize(("ask", "says"), WRONG)
def test_wrong_arguments_are_named(plan, ask, says):
    with pytest.raises(InputError) as caught:
        ask(plan)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_there_is_to_catch_and_an_invalid_plan_says_what_breaks(tmp_path):
    steps = Path(STEPS[2]).read_text(encoding="utf-8").splitlines()
    path = tmp_path / "late.plan"
    path.write_text("\n".join(line for line in steps if "sample" not in line), encoding="utf-8")
    with pytest.raises(robust.InvalidPlanError) as caught:
        robust.convert(*STEPS[:2], path)
    assert caught.value.violations
    assert not robust.validate(*STEPS[:2], path).valid
    assert issubclass(robust.InvalidPlanError, robust.RefutedError)
    for name, code in (("InputError", 2), ("InvalidPlanError", 1), ("UnsupportedError", 4), ("SolverError", 3)):
        error = getattr(robust, name)
        assert issubclass(error, robust.RobustError)
        assert error.exit_code == code
        assert error.__doc__


def test_lengths_of_contingent_links_are_given_by_name():
    links = (("A", "C", 1, 10, "contingent"), ("C", "D", 1, 2))
    dispatched = stnu.dispatch(network(*links))
    assert dispatched.execute_with({"C": Fraction(7)}).lengths == {"C": 7}
    for wrong in ({}, {"D": Fraction(1)}, {"C": Fraction(7), "A": Fraction(0)}):
        with pytest.raises(InputError, match=r"^found lengths of .*, expected those of the contingent links: C$"):
            dispatched.execute_with(wrong)
    late = stnu.dispatch(network(*links, ("A", "D", None, 8)))
    assert not late.checked.is_controllable
    with pytest.raises(robust.RefutedError, match="is not controllable"):
        late.execute()


def test_boxes_are_mappings_and_points_are_in_them_with_all_their_values(plan):
    box = robust.envelope(plan).box
    assert dict(box) == box.intervals == {"to_ridge": robust.Interval(25, 36), "to_crater": robust.Interval(35, 46)}
    assert (list(box), len(box), "to_ridge" in box, "to_moon" in box) == (["to_ridge", "to_crater"], 2, True, False)
    assert {"to_ridge": 25, "to_crater": 46} in box
    assert {"to_ridge": 25, "to_crater": 47} not in box
    assert bool(robust.Box({}))
    for found in (box, robust.region(plan).region):
        with pytest.raises(InputError, match="point without a value of to_crater, expected one of each parameter"):
            _ = {"to_ridge": 30} in found


def test_plans_are_said_on_a_screen(plan):
    long = replace(plan, instances=plan.instances * 20)
    assert "  drive_1: (drive scout base ridge)" in str(long).splitlines()
    assert len(str(long).splitlines()) < 60
    assert "  … and 85 more" in str(long)


LOG = *FILES[:2], EXAMPLES / "two_sample_navigation" / "steps.plan"
NEWCOMER = {
    "What can I ask?": (
        lambda _: [name for name in dir(robust) if name.islower()],
        r"'check', .*'envelope', .*'region'",
    ),
    "How do I begin?": (
        lambda _: pydoc.render_doc(robust),
        r"plan = robust\.load_plan\(.*Questions about one: check, env",
    ),
    "What is this plan?": (lambda plan: plan, r"^<plan 'plan': 2 parameters, 5 steps, 10 constraints>$"),
    "What came of it?": (robust.check, r"^<CheckResult: answer 'proved'; print\(\) shows it>$"),
    "How far may each parameter go?": (
        lambda plan: robust.envelope(plan).box,
        r"^Box\(to_ridge ∈ \[25, 36\], to_crater ∈ \[35, 46\]\)$",
    ),
    "How do I go on with that?": (lambda plan: [*dict(robust.envelope(plan).box)], r"^\['to_ridge', 'to_crater'\]$"),
    "Is this still all right?": (
        lambda plan: {"to_ridge": 30, "to_crater": 40} in robust.region(plan).region,
        "^True$",
    ),
    "And if I forget a value?": (
        lambda plan: {"to_ridge": 30} in robust.envelope(plan).box,
        "^InputError: found a point without a value of to_crater, expected one of each parameter$",
    ),
    "Where do I say what may vary?": (
        lambda plan: robust.envelope(plan, parameters=["duration:*"]),
        r"'parameters'; it is chosen when the plan is read: load_plan\(domain, problem, plan, parameters=\.\.\.\)$",
    ),
    "How wide is each interval?": (
        lambda plan: {name: interval.width for name, interval in robust.envelope(plan).box.items()},
        r"^{'to_ridge': Fraction\(11, 1\), 'to_crater': Fraction\(11, 1\)}$",
    ),
    "What is in the box?": (
        lambda plan: dict(robust.envelope(plan).box),
        r"^{'to_ridge': Interval\(\[25, 36\]\), 'to_crater': Interval\(\[35, 46\]\)}$",
    ),
    "What is it called?": (
        lambda plan: robust.envelope(plan).box["to_rigde"],
        "unknown parameter 'to_rigde'; did you mean 'to_ridge'",
    ),
    "Is this point in the box?": (
        lambda plan: (31, 44) in robust.envelope(plan).box,
        r"^InputError: found '\(31, 44\)', expected a name, or a point as {'NAME': VALUE, \.\.\.}$",
    ),
    "Why is it not robust?": (
        lambda _: robust.check([*FILES[:2], LOG[2].with_name("plan-flexible-wait.stn")]).counterexamples,
        r"<Counterexample: obligation 'drive_3 drive: over all \(daylight\)'; also parameters, schedule, simulation>",
    ),
    "What is a conversion?": (
        lambda _: robust.convert(*LOG),
        r"^<Conversion: 5 steps, \d+ constraints, proved; taken where a plan is; print\(\) shows it>$",
    ),
    "And how likely?": (
        lambda plan: robust.risk(plan, {"*": "normal::10%"}, within=0.1),
        r"^<RiskResult: probability Bounds\(≈0.9\d+, ≈0.9\d+\); print\(\) shows it>$",
    ),
    "Which distribution?": (robust.risk, "expected one such as normal::10%; known are to_ridge, to_crater$"),
    "Does it take three files?": (
        lambda _: robust.check(*FILES),
        r"^TypeError: check\(\) takes one plan, such as \[domain, problem, plan\], and options by name$",
    ),
    "Does it take texts?": (lambda _: robust.check(TEXTS), "answer 'proved'"),
    "What is this option called?": (lambda plan: robust.envelope(plan, metod="irr"), "'metod'; did you mean 'method'"),
    "Does it take a planner's log?": (lambda _: robust.check(robust.convert(*LOG)), "answer 'proved'"),
    "Is the plan valid?": (lambda plan: bool(robust.check(plan)), "^TypeError: .* has no truth value: ask .answer"),
}
"""What newcomers ask in Python before they read the manual, and what the answers have to say."""


@pytest.mark.parametrize(("ask", "says"), NEWCOMER.values(), ids=NEWCOMER)
def test_what_newcomers_ask(plan, ask, says):
    try:
        answer = ask(plan)
        said = answer if isinstance(answer, str) else repr(answer)
    except (InputError, KeyError, TypeError) as error:
        said = f"{type(error).__name__}: {error}"
    assert re.search(says, said, re.DOTALL), said


def test_conversions_are_plans(tmp_path):
    made = robust.convert(*LOG, parameters="duration:*")
    found = robust.envelope(made)
    assert robust.export(made, found, "csv") == robust.export(made.plan, found, "csv")
    assert robust.Monitor(made, epsilon="1/1000").plan is made.plan
    for ask in (robust.check, robust.Monitor, partial(robust.export, result=found, form="csv")):
        with pytest.raises(InputError, match=r"plan: found .*, expected a plan"):
            ask(plan=3)


def test_wrong_options_of_batch_are_named():
    with pytest.raises(TypeError, match=r"batch\(\) got .* 'limt'; did you mean 'limit'"):
        robust.batch("check", "suite", limt=3)


@pytest.mark.parametrize("module", [robust, robust.pike, robust.stnu])
def test_completion_and_help_show_what_users_call(module):
    assert sorted(dir(module)) == sorted(module.__all__)
    for name in module.__all__:
        function = getattr(module, name)
        if inspect.isfunction(function):
            kinds = {parameter.kind for parameter in inspect.signature(function).parameters.values()}
            assert inspect.Parameter.VAR_KEYWORD not in kinds, name
