"""Options: what is said of wrong ones in Python, and that commands and Python functions agree."""

import inspect
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import robust
from robust.backends import KNOWLEDGE_BASES
from robust.cli.build import Group, application, read
from robust.cli.guard import Action
from robust.cli.main import COMMANDS
from robust.errors import InputError
from robust.irr.check import Answer
from robust.options.declare import as_typed, declared, names_of
from robust.options.verbs import CheckOptions, EnvelopeOptions, RegionOptions
from robust.pike_bridge.knowledge import knowledge_bases
from tests.cli import inputs
from tests.cli.running import assert_one_line, command, example

# -- Python ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "given", "says"),
    [
        (EnvelopeOptions, {"beta": 1}, "beta: found it with method='widen', expected method='irr', or no beta"),
        (EnvelopeOptions, {"method": "optimal", "order": ["a"]}, "expected method='widen' or 'irr', or no order"),
        (EnvelopeOptions, {"method": "irr", "beta": 0}, "beta: found '0', expected a number above 0"),
        (EnvelopeOptions, {"method": "irr", "beta": [1]}, r"beta: found '\[1\]', expected a number"),
        (EnvelopeOptions, {"method": "widn"}, "unknown method 'widn'; did you mean 'widen'"),
        (CheckOptions, {"epsilon": True}, "epsilon: found 'True', expected a number"),
        (CheckOptions, {"epsilon": -1}, "epsilon: found '-1', expected a number of at least 0"),
        (CheckOptions, {"timeout": -1}, "timeout: found '-1', expected a number of at least 0"),
        (RegionOptions, {"backend": "projekt"}, "unknown back end 'projekt'; did you mean 'project'"),
        (RegionOptions, {"splitting": "fully"}, "unknown splitting 'fully'; did you mean 'full'"),
    ],
)
def test_messages_name_parameters_in_python(options, given, says):
    with pytest.raises(InputError, match=says):
        options(**given)


@pytest.mark.parametrize("value", [Fraction(1, 8), "1/8", "0.125", Decimal("0.125"), 0.125])
def test_numbers_are_exact(value):
    assert CheckOptions(epsilon=value).separation == Fraction(1, 8)
    assert CheckOptions(epsilon=0.1).separation == Fraction(1, 10)
    assert EnvelopeOptions(method="irr", beta=value).precision == Fraction(1, 8)


def test_options_cannot_be_changed_and_have_no_others():
    options = CheckOptions(timeout=3)
    assert (options.limit, options.changed(timeout=4).limit, options.limit) == (3.0, 4.0, 3.0)
    assert CheckOptions(timeout=0).limit == 0
    with pytest.raises(AttributeError, match="cannot assign to option 'timeout'"):
        options.timeout = 4
    with pytest.raises(TypeError, match="unexpected keyword argument 'timout'"):
        CheckOptions(timout=4)
    with pytest.raises(TypeError, match="no keyword argument 'domain'"):
        COMMANDS["check"].load().options(problem="p", plan="q")


@pytest.mark.parametrize("name", ["check", "envelope", "region", "compare"])
def test_functions_take_what_commands_take(name):
    signature = inspect.signature(getattr(robust, name))
    assert next(iter(signature.parameters)) == "plan"
    typed = declared(COMMANDS[name].load().options)
    for parameter in list(signature.parameters.values())[1:]:
        assert parameter.kind is inspect.Parameter.KEYWORD_ONLY
        assert parameter.name.startswith("on_") or typed[parameter.name].default == parameter.default
        assert f"\n    {parameter.name}: " in inspect.getdoc(getattr(robust, name))


def test_names_come_from_registries():
    assert set(KNOWLEDGE_BASES) == set(knowledge_bases())


# -- the range of --at -------------------------------------------------------------------------------------------------


def test_closed_ends_of_ranges_count(tmp_path):
    """Only at an end of the range does the plan break: whoever leaves the end out proves what is false."""
    domain = inputs.DOMAIN.replace("(>= (fuel) 1)", "(> (fuel) 1)")
    files = inputs.write(tmp_path, domain=domain).files
    for text, code in (("1:2", 1), ("1.001:2", 0), ("0:1", 1), ("1:inf", 1), ("1:1", 1)):
        assert command("check", *files, "--parameter", "fluent:(fuel)", "--at", f"fuel={text}").code == code, text
    high = inputs.DOMAIN.replace("(>= (fuel) 1)", "(< (fuel) 5)")
    files = inputs.write(tmp_path, domain=high).files
    for text, code in (("4:5", 1), ("4:4.999", 0), ("-inf:5", 1)):
        assert command("check", *files, "--parameter", "fluent:(fuel)", "--at", f"fuel={text}").code == code, text
    plan = robust.load_plan(*files, parameters=["fluent:(fuel)"])
    open_above = robust.Interval(Fraction(4), Fraction(5), lower_closed=True, upper_closed=False)
    assert robust.check(plan, at={"fuel": open_above}).answer is Answer.PROVED
    assert robust.check(plan, at={"fuel": robust.Interval(Fraction(4), Fraction(5))}).answer is Answer.REFUTED
    assert robust.check(plan, at={"fuel": 5}).answer is Answer.REFUTED


# -- two readers of command lines --------------------------------------------------------------------------------------

LEAVES = [
    ((name, *more), entry)
    for name, group in COMMANDS.items()
    if name != "bench"
    for more, entry in ([((), group)] if not isinstance(group, Group) else [((n,), e) for n, e in group.load().items()])
]
VALUES = ("z3", "cvc5", "a b", "-1", "--json", "1/2", "x=1", "", "--", "-o", "irr", "7", "00", "γ", "=")


def by_typer(words):
    found = []

    def note(action: Action, given: dict) -> int:
        found.append((action, given))
        return 0

    app = application(COMMANDS, words, "help", "version", note)
    try:
        app(args=list(words), prog_name="robust", standalone_mode=False)
    except Exception:
        return None
    return found[0] if found else None


@given(st.data())
def test_both_readers_agree(data):
    """What is read at once, typer reads likewise; what it refuses is not in order."""
    path, entry = data.draw(st.sampled_from(LEAVES))
    names = [
        word
        for name, one in declared(entry.load().options).items()
        if not one.argument
        for typed in names_of(name, one)
        for word in typed.split("/")
    ]
    word = st.one_of(
        st.sampled_from([*names, *VALUES]),
        st.builds("{}={}".format, st.sampled_from(names or ["x"]), st.sampled_from(VALUES)),
    )
    words = [*path, *data.draw(st.lists(word, max_size=7))]
    at_once = read(COMMANDS, words)
    if at_once is not None:
        assert by_typer(words) == at_once


def test_messages_name_options_as_typed():
    with as_typed({"beta"}), pytest.raises(InputError, match="--beta: found it with --method widen"):
        EnvelopeOptions(beta="1")


@pytest.mark.parametrize(
    ("verb", "option", "which"),
    [
        (("repair",), "--output", 2),
        (("convert",), "--output", 2),
        (("certify",), "--output", 0),
        (("compare",), "--html", 1),
    ],
)
def test_what_is_read_is_not_written_over(verb, option, which, tmp_path):
    files = []
    for name in example("plan-flexible-wait.stn"):
        files.append(tmp_path / name.rpartition("/")[2])
        files[-1].write_bytes(Path(name).read_bytes())
    before = [file.read_bytes() for file in files]
    link = tmp_path / "link"
    link.symlink_to(files[which])
    for target in (files[which], link):
        ended = command(*verb, *files, option, target)
        assert_one_line(ended)
        assert f"{option}: found" in ended.err
        assert "expected another file" in ended.err
    assert [file.read_bytes() for file in files] == before
