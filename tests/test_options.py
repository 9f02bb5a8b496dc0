"""Options: what is said of wrong ones in Python, and that commands, Python functions and both readers agree."""

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
from robust.cli.main import COMMANDS
from robust.errors import InputError
from robust.numbers import EXPECTED_NUMBER
from robust.options.declare import as_typed, declared, names_of
from robust.options.verbs import CheckOptions, EnvelopeOptions, RegionOptions
from robust.pike_bridge.knowledge import knowledge_bases
from tests.cli.running import assert_one_line, command, example


def irr(beta):
    return EnvelopeOptions(method="irr", beta=beta)


@pytest.mark.parametrize(
    ("ask", "says"),
    [
        *(
            (lambda beta=beta: irr(beta), f"beta: found '{beta}', expected a number above 0")
            for beta in (0, -1, "-1/2")
        ),
        *(
            (lambda beta=beta: irr(beta), f"beta: found '{beta}', expected {EXPECTED_NUMBER}")
            for beta in ([1], "one", True)
        ),
        (lambda: EnvelopeOptions(beta=1), "beta: found it with method='widen', expected method='irr', or no beta"),
        (
            lambda: EnvelopeOptions(method="optimal", order=["a"]),
            "order: found it with method='optimal', expected method='widen' or 'irr', or no order",
        ),
        (lambda: EnvelopeOptions(order="a,,b"), "order: found 'a,,b', expected names such as a,b,c"),
        (lambda: EnvelopeOptions(method="widn"), "unknown method 'widn'; did you mean 'widen'?"),
        (lambda: EnvelopeOptions(solver="z4"), "unknown solver 'z4'; known are cvc5, z3"),
        (lambda: CheckOptions(epsilon=True), f"epsilon: found 'True', expected {EXPECTED_NUMBER}"),
        (lambda: CheckOptions(epsilon="x"), f"epsilon: found 'x', expected {EXPECTED_NUMBER}"),
        (lambda: CheckOptions(epsilon=Fraction(-1, 2)), "epsilon: found '-1/2', expected a number of at least 0"),
        (lambda: CheckOptions(timeout=-1), "timeout: found '-1', expected a number of at least 0"),
        (lambda: RegionOptions(backend="projekt"), "unknown back end 'projekt'; did you mean 'project'?"),
        (lambda: RegionOptions(splitting="fully"), "unknown splitting 'fully'; did you mean 'full'?"),
    ],
)
def test_what_is_wrong_is_said_of_the_parameter(ask, says):
    with pytest.raises(InputError) as caught:
        ask()
    assert str(caught.value) == says


@pytest.mark.parametrize("value", [Fraction(1, 8), "1/8", "0.125", Decimal("0.125"), 0.125])
def test_numbers_are_exact(value):
    assert CheckOptions(epsilon=value).separation == irr(value).precision == Fraction(1, 8)
    assert CheckOptions(epsilon=0.1).separation == Fraction(1, 10)
    assert EnvelopeOptions(order="a, b").order == ("a", "b")


def test_options_cannot_be_changed_and_have_no_others():
    options = CheckOptions(timeout=3)
    assert (options.limit, options.changed(timeout=4).limit, options.limit) == (3.0, 4.0, 3.0)
    assert (CheckOptions(timeout=0).limit, CheckOptions(timeout=2e9).limit) == (0, 1e9)
    with pytest.raises(AttributeError, match="cannot assign to option 'timeout'"):
        options.timeout = 4
    with pytest.raises(TypeError, match="unexpected keyword argument 'timout'"):
        CheckOptions(timout=4)
    with pytest.raises(TypeError, match="no keyword argument 'domain'"):
        COMMANDS["check"].load().options(problem="p", plan="q")


def test_messages_name_options_as_typed():
    with as_typed({"beta"}), pytest.raises(InputError, match="--beta: found it with --method widen"):
        EnvelopeOptions(beta="1")
    with pytest.raises(InputError, match=r"^beta: found it with method='widen'"):
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


def test_names_come_from_registries():
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
    app = application(
        COMMANDS, words, "help", "version", lambda action, options: actions.append((action, options)) or 0
    )
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
