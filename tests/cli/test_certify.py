"""`robust certify` and `robust verify`: every kind of certificate, made, checked, and held against what is demanded."""

import json

import pytest

from tests.cli.running import EXAMPLES, answer_of, command, example, process
from tests.pike_bridge.satisfiability import sat_plan

KITCHEN = EXAMPLES / "kitchen" / "kitchen.tpnu.json"


@pytest.mark.parametrize(
    ("kind", "encoding"),
    [*((kind, "relational") for kind in ("plan", "box", "maximal", "region")), ("plan", "positions")],
)
def test_plans(tmp_path, kind, encoding):
    path = tmp_path / "plan.cert"
    words = ("--kind", kind, "--encoding", encoding, "--json")
    made = command("certify", *example(), "-o", path, *words)
    answer = answer_of(made, "robust/certify/1")
    assert (made.code, made.err, answer["kind"], answer["bytes"]) == (0, "", kind, path.stat().st_size)
    checked = command("verify", path, *example(), "--kind", kind, "--json")
    verified = answer_of(checked, "robust/verify/1")
    assert (checked.code, verified["verdict"], verified["reason"]) == (0, "established", None)
    same = ("kind", "claim", "epsilon", "files", "obligations", "refuted")
    assert [verified[key] for key in same] == [answer[key] for key in same]
    assert verified["claim"].endswith(", epsilon = 1/1000")
    assert verified["files"].keys() == {"domain", "problem", "plan"}
    assert (verified["box"] is None) == (kind == "region")


def test_verify_is_a_process_of_its_own(tmp_path):
    path = tmp_path / "plan.cert"
    assert process("certify", *example(), "-o", path, "--quiet").out.startswith(f"certificate: {path}, ")
    ended = process("verify", path, *example())
    assert (ended.code, ended.err) == (0, "")
    assert ended.out.startswith("established: valid for every schedule, for all (to_ridge, to_crater) in [30, 30] x ")
    assert "\nof domain: sha256 " in ended.out


def test_less_than_what_is_demanded_is_not_enough(tmp_path):
    path, box = tmp_path / "box.cert", tmp_path / "box.json"
    assert command("certify", *example(), "-o", path, "--kind", "box").code == 0
    box.write_text(command("envelope", *example(), "--json").out, encoding="utf-8")
    assert command("verify", path, *example(), "--kind", "box", "--box", box).code == 0
    assert command("verify", path, *example(), "--kind", "plan").code == 0
    more = command("verify", path, *example(), "--kind", "maximal")
    assert (more.code, more.out) == (1, "rejected: expected maximal, the certificate establishes box\n")
    document = json.loads(box.read_text(encoding="utf-8"))
    document["parameters"]["to_ridge"]["upper"] = "37"
    box.write_text(json.dumps(document), encoding="utf-8")
    answer = answer_of(command("verify", path, *example(), "--box", box, "--json"), "robust/verify/1")
    assert (answer["verdict"], answer["reason"]) == ("rejected", "the box that is demanded is another one")
    assert command("verify", path, *example(), "--epsilon", "20").code == 1


def test_a_box_from_a_file(tmp_path):
    box, path = tmp_path / "box.json", tmp_path / "box.cert"
    box.write_text(command("envelope", *example(), "--json").out, encoding="utf-8")
    assert command("certify", *example(), "-o", path, "--kind", "maximal", "--box", box).code == 0
    answer = json.loads(box.read_text(encoding="utf-8"))
    name, ends = next(iter(answer["parameters"].items()))
    answer["parameters"][name] = {**ends, "lower": ends["nominal"], "lower_closed": True}
    box.write_text(json.dumps(answer), encoding="utf-8")
    assert command("certify", *example(), "-o", path, "--kind", "box", "--box", box).code == 0
    smaller = command("certify", *example(), "-o", path, "--kind", "maximal", "--box", box)
    assert smaller.code == 4
    assert "no bad values at the lower end of to_ridge: it can be moved" in smaller.err
    answer["parameters"][name] = {**ends, "upper": "1000000"}
    box.write_text(json.dumps(answer), encoding="utf-8")
    assert command("certify", *example(), "-o", path, "--kind", "box", "--box", box).code == 1


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"a": 1}', '{"parameters": 3}', "\x00", "[" * 100000])
def test_wrong_boxes(tmp_path, text):
    box = tmp_path / "box.json"
    box.write_text(text, encoding="utf-8")
    ended = command("certify", *example(), "-o", tmp_path / "x", "--kind", "box", "--box", box)
    assert (ended.code, ended.err.count("\n")) == (2, 1)


def test_out_of_time(tmp_path):
    output = tmp_path / "plan.cert"
    late = command("certify", *example(), "-o", output, "--timeout", "0.000001")
    unwritten = f"robust: {output} was not written: the answer has nothing for it\n"
    assert (late.code, late.err) == (3, f"{unwritten}robust: out of time\n")


@pytest.mark.parametrize(("content", "code"), [(b"", 2), (b"no gzip", 2), (b"\x1f\x8b\x08\x00", 2)])
def test_unreadable_certificates_and_missing_files(tmp_path, content, code):
    path, missing = tmp_path / "plan.cert", tmp_path / "none.stn"
    path.write_bytes(content)
    ended = command("verify", path, *example())
    assert ended.code == code
    assert f"{path}: " in ended.err
    if content.startswith(b"\x1f"):  # files are looked for first
        ended = command("verify", path, *example()[:2], missing)
        assert (ended.code, f"{missing}: found no such file" in ended.err) == (2, True)


def test_alethe(tmp_path):
    proofs = tmp_path / "proofs"
    made = command("certify", *example(), "-o", tmp_path / "c", "--kind", "box", "--alethe", proofs, "--json")
    assert answer_of(made, "robust/certify/1")["alethe_holes"] == 0
    written = sorted(path.suffix for path in proofs.iterdir())
    assert written.count(".alethe") == written.count(".smt2") > 0
    assert all(path.read_text(encoding="utf-8").startswith("(\n(assume") for path in proofs.glob("*.alethe"))


def test_knowledge_is_about_all_files(tmp_path):
    network = sat_plan([[1, 2], [-1, 2], [1, -2], [-1, -2]]).write(tmp_path / "wrong")
    path = tmp_path / "empty.cert"
    assert command("certify", network, "-o", path).code == 0
    answer = answer_of(command("verify", path, network, "--json"), "robust/verify/1")
    assert (answer["kind"], answer["files"].keys()) == ("knowledge", {"network", "domain", "problem"})
    assert command("verify", path, KITCHEN).code == 1
    assert command("verify", path, *example()).code == 1
    document = json.loads(network.read_text(encoding="utf-8"))
    problem = network.parent / document["problem"]
    problem.write_text(problem.read_text(encoding="utf-8").replace("(:goal", "(:gaol"), encoding="utf-8")
    assert command("verify", path, network).code == 4


DELIVERY = [EXAMPLES / "delivery" / name for name in ("domain.pddl", "problem.pddl", "plan.stn")]


def test_parameters_beside_the_plan(tmp_path):
    """They are those of all commands; the claim is about the network with them, which is written down."""
    path = tmp_path / "box.cert"
    made = command("certify", *DELIVERY, "-o", path, "--kind", "maximal", "--json")
    answer = answer_of(made, "robust/certify/1")
    assert "the certificate is about" in made.err
    assert answer["files"].keys() == {"domain", "problem", "plan", "parameters"}
    for plan in (tmp_path / "box.stn", DELIVERY[2]):
        verified = answer_of(command("verify", path, *DELIVERY[:2], plan, "--json"), "robust/verify/1")
        assert verified["claim"] == answer["claim"]
        assert verified["box"].keys() == {f"dur_n{number}" for number in range(3, 9)}
    widest = json.loads(command("envelope", *DELIVERY, "--json").out)["parameters"]
    assert {name: ends["upper"] for name, ends in verified["box"].items()} == {
        name: ends["upper"] for name, ends in widest.items()
    }
    (tmp_path / "box.toml").unlink()  # then durations are those of the domain, which the network does not keep
    assert command("verify", path, *DELIVERY[:2], tmp_path / "box.stn").code == 1


def test_parameters_that_are_asked_for(tmp_path):
    """A start, a duration, and an initial value, with attributes."""
    path = tmp_path / "box.cert"
    words = ["--parameter", "duration:n1,weight=2,ub=20", "--parameter", "start:n0,default=0,lb=0"]
    answer = answer_of(command("certify", *DELIVERY, "-o", path, "--kind", "box", *words, "--json"), "robust/certify/1")
    assert "dur_n1" in answer["claim"]
    assert "start_n0" in answer["claim"]
    generator = [EXAMPLES / "generator" / name for name in ("domain.pddl", "problem.pddl", "plan.stn")]
    words = ["--parameter", "cap=fluent:(tank-size gen)"]
    refused = command("certify", *generator, "-o", path, "--kind", "region", *words)
    assert (refused.code, "--force replaces them" in refused.err) == (2, True)
    made = command("certify", *generator, "-o", path, "--kind", "region", *words, "--force")
    assert made.code == 0
    assert "without (cap < " in made.out
    assert (tmp_path / "box.toml").read_text(encoding="utf-8") == '[parameters."cap"]\nfluent = "(tank-size gen)"\n'
    assert command("verify", path, *generator[:2], tmp_path / "box.stn", "--kind", "region").code == 0
    assert command("verify", path, *generator).code == 1


def test_files_of_another_plan_are_not_overwritten(tmp_path):
    for path in DELIVERY[2], DELIVERY[2].with_suffix(".toml"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    files = [*DELIVERY[:2], tmp_path / "plan.stn"]
    ended = command("certify", *files, "-o", tmp_path / "plan.cert")
    assert (ended.code, "belongs to another plan" in ended.err) == (2, True)
    assert (tmp_path / "plan.stn").read_bytes() == DELIVERY[2].read_bytes()
    steps = EXAMPLES / "delivery" / "steps.plan"
    ended = command("certify", *DELIVERY[:2], steps, "-o", tmp_path / "plan.cert")
    assert (ended.code, "plan.toml', expected no such files; --force replaces them" in ended.err) == (2, True)
    assert (tmp_path / "plan.stn").read_bytes() == DELIVERY[2].read_bytes()
    assert not (tmp_path / "plan.cert").exists()
    ended = command("certify", *DELIVERY[:2], steps, "-o", tmp_path / "plan.cert", "--force")
    assert ended.code == 0
    assert (tmp_path / "plan.toml").read_text() == ""  # the old one would be taken for that of the new plan
    ended = command("certify", *DELIVERY[:2], steps, "-o", tmp_path / "new.stn")
    assert (ended.code, "belongs to another plan" in ended.err) == (2, True)  # the network has that name


@pytest.mark.parametrize("name", ["kitchen", "wing"])
def test_correct_executions(tmp_path, name):
    """Plans with choices that have one get a certificate of one, and are verified with their files."""
    path, network = tmp_path / "plan.cert", EXAMPLES / name / f"{name}.tpnu.json"
    answer = answer_of(command("certify", network, "-o", path, "--json"), "robust/certify/1")
    assert (answer["kind"], answer["refuted"]) == ("execution", 0)
    assert answer["claim"].startswith("correct execution of the plan with choices: ")
    document = json.loads(network.read_text(encoding="utf-8"))
    for choice in document["choices"]:
        values = [value for value in choice["domain"] if f"{choice['name']} = {value}" in answer["claim"]]
        (value,) = values
        for other in {value, choice["domain"][0], choice["domain"][-1]}:
            ended = command("verify", path, network, "--assume", f"{choice['name']}={other}")
            assert ended.code == (other != value)
    assert command("verify", path, network, "--kind", "execution").code == 0
    assert command("verify", path, network, "--kind", "knowledge").code == 1
    assert command("certify", network, "-o", path, "--kind", "knowledge").code == 1


def test_choices_that_leave_no_execution(tmp_path):
    path, both = tmp_path / "none.cert", ("--assume", "xA1=glass", "--assume", "xA2=coffee")
    made = command("certify", KITCHEN, "-o", path, *both)
    assert made.code == 0
    assert "no choices and times with xA1 = glass, xA2 = coffee are a correct execution" in made.out
    assert command("verify", path, KITCHEN).code == 0
    assert command("verify", path, KITCHEN, "--kind", "knowledge", *both).code == 0
    assert command("verify", path, KITCHEN, "--kind", "knowledge", *both, "--assume", "xA3=bagel").code == 0
    for less in ((), both[:2]):
        ended = command("verify", path, KITCHEN, "--kind", "knowledge", *less)
        assert (ended.code, ended.out) == (1, "rejected: the choices that are demanded are others\n")
    ended = command("certify", KITCHEN, "-o", path, "--kind", "execution", *both)
    assert (ended.code, "found no correct execution" in ended.err) == (1, True)


@pytest.fixture(scope="module")
def box_certificate(tmp_path_factory):
    path = tmp_path_factory.mktemp("certificate") / "box.cert"
    assert command("certify", *example(), "-o", path, "--kind", "maximal").code == 0
    return path


@pytest.mark.parametrize(
    ("texts", "code"),
    [
        (["to_ridge=25:36", "to_crater=35:46"], 0),
        (["to_ridge=25:36", " to_crater = 40 "], 0),
        (["to_ridge=25:36"], 0),
        (["to_ridge=61/2"], 0),
        (["to_ridge=25:37"], 1),
        (["to_ridge=24.9:36"], 1),
        (["to_ridge=-inf:36"], 1),
        (["to_ridge=25:36", "to_crater=34"], 1),
    ],
)
def test_values_that_are_demanded(box_certificate, texts, code):
    """Of parameters that are not mentioned the nominal value is."""
    words = [word for text in texts for word in ("--box", text)]
    ended = command("verify", box_certificate, *example(), *words)
    assert (ended.code, ended.err) == (code, "")
    assert ended.out.startswith("established: " if code == 0 else "rejected: the box that is demanded is another one")


def test_a_maximal_box_is_demanded_with_all_its_values(box_certificate):
    words = ["--kind", "maximal", "--box", "to_ridge=25:36"]
    assert command("verify", box_certificate, *example(), *words).code == 1
    assert command("verify", box_certificate, *example(), *words, "--box", "to_crater=35:46").code == 0


def test_a_parameter_that_the_plan_does_not_have(box_certificate):
    ended = command("verify", box_certificate, *example(), "--box", "to_rigde=25:36")
    found = "rejected: the box that is demanded has other parameters than to_ridge, to_crater\n"
    assert (ended.code, ended.out) == (1, found)


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        (["to_ridge=36:25"], "found '36:25', expected LOW:HIGH with LOW not above HIGH"),
        (["to_ridge=x"], "found 'x', expected a number"),
        (["=1:2"], "found '=1:2', expected NAME=VALUE or NAME=LOW:HIGH"),
        (["to_ridge=30", "to_ridge=31"], "found a second value for 'to_ridge', expected one"),
        (["box.json", "to_ridge=30"], "found 'box.json' and something else, expected one FILE, or NAME=LOW:HIGH"),
        (["nowhere.json"], "nowhere.json: found no such file, expected a readable text file"),
    ],
)
def test_values_that_cannot_be_demanded(box_certificate, texts, message):
    words = [word for text in texts for word in ("--box", text)]
    ended = command("verify", box_certificate, *example(), *words)
    assert (ended.code, ended.err.count("\n")) == (2, 1)
    assert message in ended.err


def test_a_file_whose_name_has_an_equals_sign(box_certificate, tmp_path):
    box = tmp_path / "to_ridge=1.json"
    box.write_text(command("envelope", *example(), "--json").out, encoding="utf-8")
    assert command("verify", box_certificate, *example(), "--kind", "maximal", "--box", box).code == 0
