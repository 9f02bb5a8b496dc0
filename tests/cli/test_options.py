"""Options: one table of wrong ones and what is said of them, and that commands and Python functions agree."""

import inspect
from decimal import Decimal
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

import robust
from robust.backends import ELIMINATORS, KNOWLEDGE_BASES, OFFERED
from robust.cli.build import Action, Group, application, read
from robust.cli.main import COMMANDS
from robust.errors import InputError
from robust.irr.check import Answer
from robust.options import CheckOptions, EnvelopeOptions, RegionOptions, as_typed, declared, names_of
from robust.pike_bridge.knowledge import knowledge_bases
from tests.cli import inputs
from tests.cli.running import EXAMPLES, assert_one_line, command, example

KITCHEN = str(EXAMPLES / "kitchen" / "kitchen.tpnu.json")
PLAN = example()
ANY = ("check", "envelope")
METHOD = "expected --method irr, or no --beta"

WRONG = [
    (ANY, PLAN, "--epsilon tiny", "--epsilon: found 'tiny', expected a number"),
    (ANY, PLAN, "--epsilon -1/1000", "--epsilon: found '-1/1000', expected a number of at least 0"),
    (ANY, PLAN, "--epsilon 1/0", "--epsilon: found '1/0', expected a fraction whose denominator is not 0"),
    (ANY, PLAN, "--timeout 0", "--timeout: found '0', expected a number above 0"),
    (ANY, PLAN, "--timeout nan", "--timeout: found 'nan', expected a number"),
    (ANY, PLAN, "--solver z4", "'z4' is not one of 'z3', 'cvc5'"),
    (ANY, PLAN, "--parameters nowhere.toml", "nowhere.toml: found no such file"),
    (ANY, PLAN, "--parameter duration:nothing", "nothing"),
    (ANY, PLAN, "--parameter ==", "--parameter"),
    (ANY, PLAN, "--nothing", "No such option: --nothing"),
    (ANY, PLAN, "surplus", "Got unexpected extra argument"),
    ("check", PLAN, "--at to_rigde=3", "found unknown parameter 'to_rigde'; did you mean 'to_ridge'?"),
    ("check", PLAN, "--at to_ridge", "--at 'to_ridge': found 'to_ridge', expected NAME=VALUE or NAME=LOW:HIGH"),
    ("check", PLAN, "--at =3", "expected NAME=VALUE or NAME=LOW:HIGH"),
    ("check", PLAN, "--at to_ridge=x", "found 'x', expected a number"),
    ("check", PLAN, "--at to_ridge=5:4", "expected LOW:HIGH with LOW not above HIGH"),
    ("check", PLAN, "--at to_ridge=5:", "found an empty end of an interval"),
    ("check", PLAN, "--at to_ridge=inf:5", "expected LOW:HIGH with LOW not above HIGH"),
    ("check", PLAN, "--at to_ridge=5 --at to_ridge=6", "found a second value for 'to_ridge'"),
    ("envelope", PLAN, "--method irr --beta 0", "--beta: found '0', expected a number above 0"),
    ("envelope", PLAN, "--method irr --beta -1", "--beta: found '-1', expected a number above 0"),
    ("envelope", PLAN, "--method irr --beta one", "--beta: found 'one', expected a number"),
    ("envelope", PLAN, "--beta 1", f"--beta: found it with --method widen, {METHOD}"),
    (
        "envelope",
        PLAN,
        "--doubling",
        "--doubling: found it with --method widen, expected --method irr, or no --doubling",
    ),
    ("envelope", PLAN, "--method optimal --beta 1", "--beta: found it with --method optimal"),
    (
        "envelope",
        PLAN,
        "--contain-nominal",
        "--contain-nominal: found it with --method widen, expected --method optimal",
    ),
    ("envelope", PLAN, "--method optimal --order to_ridge", "expected --method widen or irr, or no --order"),
    ("envelope", PLAN, "--method magic", "'magic' is not"),
    ("envelope", PLAN, "--encoding positional", "'positional' is not"),
    (
        "envelope",
        PLAN,
        "--order to_ridge,,to_crater",
        "--order: found 'to_ridge,,to_crater', expected names such as a,b,c",
    ),
    ("envelope", PLAN, "--order to_rigde", "did you mean 'to_ridge'?"),
    ("envelope", PLAN, "--order to_ridge,to_ridge", "more than once"),
    ("envelope", PLAN, "--plot box.gif", "--plot: found 'box.gif', expected a name that ends in .svg, .png, .pdf"),
    ("envelope", PLAN, "--plot nowhere/box.svg", "--plot: found no directory 'nowhere'"),
    ("envelope", ("no", "no", "no"), "--plot box.gif", "--plot"),
    ("region", PLAN, "--backend z4", "--backend"),
    ("region", PLAN, "--backend z3-qe", "--backend"),
    ("region", PLAN, "--splitting half", "--splitting"),
    ("region", PLAN, "--form list", "--form"),
    ("region", PLAN, "--plot r.svg --axes to_rigde", "to_ridge"),
    ("region", PLAN, "--plot r.svg --axes to_ridge,to_ridge", "two different parameters"),
    ("compare", PLAN, "--beta 0", "--beta: found '0', expected a number above 0"),
    ("compare", PLAN, "--html none/report.html", "--html: found no directory 'none', expected one to write to"),
    (
        "certify",
        PLAN,
        "-o x.cert --kind plan --box b.json",
        "found --box with --kind plan; expected it with box or maximal",
    ),
    ("certify", PLAN, "-o x.cert --kind region --alethe d", "found --alethe with --kind region"),
    ("certify", (KITCHEN,), "-o x.cert --alethe d", "found --alethe with a plan with choices"),
    ("certify", PLAN[:2], "-o x.cert", "found 2 files, expected DOMAIN PROBLEM PLAN or one NETWORK"),
    ("certify", PLAN, "", "Missing option '--output'"),
    ("execute", PLAN, "--executor drex", "expected dreex or blex:PER_CENT; did you mean 'dreex'"),
    ("execute", PLAN, "--executor blex:x", "--executor: found 'blex:x', expected a number of per cent"),
    ("execute", PLAN, "--runs 0", "--runs: found 0, expected at least 1 run"),
    ("execute", PLAN, "--runs some", "--runs"),
    ("execute", PLAN, "--replans -1", "--replans: found -1"),
    ("execute", PLAN, "--planner arees", "found planner 'arees'"),
    ("execute", PLAN, "--planner-limit 0", "--planner-limit"),
    ("execute", PLAN, "--planning-time -3", "--planning-time"),
    ("execute", PLAN, "--plot run.jpg", "--plot: found 'run.jpg'"),
    ("execute", PLAN, "--world absent.toml", "absent.toml"),
    ("execute", PLAN, "--parametrize duration:fly", "expected an instance of the plan or an action"),
    ("execute", PLAN[:2], "", "found neither PLAN nor --planner"),
    ("pike check", ("none.tpnu.json",), "", "none.tpnu.json"),
    ("pike check", (KITCHEN,), "--assume xA1", "expected NAME=VALUE"),
    ("pike check", (KITCHEN,), "--assume xA1=jug", "'jug' is not a value of xA1"),
    ("pike check", (KITCHEN,), "--assume xA1=mug --assume xA1=glass", "found a second value for 'xA1', expected one"),
    ("pike check", (KITCHEN,), "--epsilon 0", "--epsilon: found '0', expected a number above 0"),
    ("pike check", (KITCHEN,), f"--witness {KITCHEN}", "expected a directory"),
    ("pike run", (KITCHEN,), "--outcome xA1", "expected NAME=VALUE or NAME=VALUE@TIME"),
    ("pike run", (KITCHEN,), "--outcome xA1=bucket", "'bucket' is not a value of xA1"),
    ("pike run", (KITCHEN,), "--outcome xB=mug", "there is no choice 'xB'"),
    ("pike run", (KITCHEN,), "--outcome xR1=juice", "xR1 is for the executive to choose"),
    ("pike run", (KITCHEN,), "--outcome xA1=mug@soon", "soon"),
    ("pike run", (KITCHEN,), "--outcome xA1=mug@-1", "expected 0 or later"),
    ("pike run", (KITCHEN,), ["--disturb", "working toaster@1"], "expected '(atom)@TIME' or '(not (atom))@TIME'"),
    ("pike run", (KITCHEN,), ["--disturb", "(not (working toaster))"], "expected '(atom)@TIME' or '(not (atom))@TIME'"),
    ("pike run", (KITCHEN,), ["--disturb", "(working toster)@1"], "is about (working toster); did you mean"),
    ("pike run", (KITCHEN,), "--delay x", "--delay"),
    ("pike run", (KITCHEN,), "--backend smtt", "--backend: found unknown back end 'smtt'; did you mean 'smt'?"),
    ("pike run", (KITCHEN,), "--plot run.txt", "expected a name that ends in"),
    ("pike run", (KITCHEN,), "--outcome xA1=mug --stdio", "--outcome: found together with --stdio, expected without"),
    ("pike run", (KITCHEN,), "--seed 0 --stdio", "--seed: found together with --stdio"),
    ("pike run", (KITCHEN,), "--no-infer --stdio", "--infer: found together with --stdio"),
    ("pike run", (KITCHEN,), "--journal j", "--journal: expected only together with --stdio"),
    ("pike run", (KITCHEN,), "--clock given", "--clock: expected only together with --stdio"),
    ("pike run", (KITCHEN,), "--stdio --rate 2", "--rate: found a rate, expected none unless with --clock real"),
    ("pike run", (KITCHEN,), "--stdio --clock real --rate 0", "--rate: found '0', expected a number above 0"),
    ("pike run", (KITCHEN,), "--stdio --backend smtt", "--backend: found unknown back end 'smtt'; did you mean 'smt'?"),
    ("pike run", (KITCHEN,), "--stdio --timeout soon", "--timeout: found 'soon'"),
    ("pike plot", (KITCHEN,), "-o plan.gif", "--plot: found 'plan.gif', expected a name that ends in"),
]
"""Commands, arguments, options, and a part of the one line that is said. Wrong files are in `bad_inputs.py`."""

CASES = [
    (verb.split(), [*arguments, *(options.split() if isinstance(options, str) else options)], says)
    for verbs, arguments, options, says in WRONG
    for verb in ([verbs] if isinstance(verbs, str) else verbs)
]


@pytest.mark.parametrize(
    ("verb", "words", "says"), CASES, ids=lambda value: (value if isinstance(value, str) else " ".join(value))[-40:]
)
def test_wrong_options_are_one_line(verb, words, says, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ended = command(*verb, *words)
    assert_one_line(ended)
    assert says in ended.err
    assert not list(tmp_path.iterdir())


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
    assert set(OFFERED) < set(ELIMINATORS)


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
