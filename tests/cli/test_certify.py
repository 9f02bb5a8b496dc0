"""`robust certify` and `robust verify`: every kind of certificate, made, checked, and held against what is demanded."""

import json

import pytest

from tests.cli.running import EXAMPLES, answer_of, assert_one_line, command, example, process
from tests.pike_bridge.stories import sat_plan

KITCHEN = EXAMPLES / "kitchen" / "kitchen.tpnu.json"
DELIVERY = example(directory=EXAMPLES / "delivery")


def certify(*words):
    return answer_of(command("certify", *words, "--json"), "robust/certify/1")


def verified(*words):
    """The exit code of the check, and its answer."""
    ended = command("verify", *words, "--json")
    return ended.code, answer_of(ended, "robust/verify/1")


def code_of(verb, *words):
    return command(verb, *words).code


@pytest.fixture
def path(tmp_path):
    return tmp_path / "plan.cert"


@pytest.fixture(scope="module")
def answer():
    """What `robust envelope` prints of the plan."""
    return json.loads(command("envelope", *example(), "--json").out)


@pytest.fixture
def box(tmp_path, answer):
    file = tmp_path / "box.json"
    file.write_text(json.dumps(answer), encoding="utf-8")
    return file


@pytest.mark.parametrize(
    ("kind", "encoding"),
    [*((kind, "relational") for kind in ("plan", "box", "maximal", "region")), ("plan", "positions")],
)
def test_plans(path, kind, encoding):
    ended = command("certify", *example(), "-o", path, "--kind", kind, "--encoding", encoding, "--json")
    made = answer_of(ended, "robust/certify/1")
    assert (ended.code, ended.err, made["kind"], made["bytes"]) == (0, "", kind, path.stat().st_size)
    code, checked = verified(path, *example(), "--kind", kind)
    assert (code, checked["verdict"], checked["reason"]) == (0, "established", None)
    same = ("kind", "claim", "epsilon", "files", "obligations", "refuted")
    assert [checked[key] for key in same] == [made[key] for key in same]
    assert checked["claim"].endswith(", epsilon = 1/1000")
    assert checked["files"].keys() == {"domain", "problem", "plan"}
    assert (checked["box"] is None) == (kind == "region")


def test_verify_is_a_process_of_its_own(path):
    assert process("certify", *example(), "-o", path, "--quiet").out.startswith(f"certificate: {path}, ")
    ended = process("verify", path, *example())
    assert (ended.code, ended.err) == (0, "")
    assert ended.out.startswith("established: valid for every schedule, for all (to_ridge, to_crater) in [30, 30] x ")
    assert "\nof domain: sha256 " in ended.out


def test_less_than_what_is_demanded_is_not_enough(path, box, answer):
    assert code_of("certify", *example(), "-o", path, "--kind", "box") == 0
    assert code_of("verify", path, *example(), "--kind", "box", "--box", box) == 0
    assert code_of("verify", path, *example(), "--kind", "plan") == 0
    more = command("verify", path, *example(), "--kind", "maximal")
    assert (more.code, more.out) == (1, "rejected: expected maximal, the certificate establishes box\n")
    ends = {**answer["parameters"]["to_ridge"], "upper": "37"}
    box.write_text(json.dumps({**answer, "parameters": {**answer["parameters"], "to_ridge": ends}}), encoding="utf-8")
    code, checked = verified(path, *example(), "--box", box)
    assert (code, checked["verdict"]) == (1, "rejected")
    assert checked["reason"] == "the box that is demanded is another one"
    assert code_of("verify", path, *example(), "--epsilon", "20") == 1


def test_a_box_from_a_file(path, box, answer):
    name, ends = next(iter(answer["parameters"].items()))

    def made(kind, **changed):
        parameters = {**answer["parameters"], name: {**ends, **changed}}
        box.write_text(json.dumps({**answer, "parameters": parameters}), encoding="utf-8")
        return command("certify", *example(), "-o", path, "--kind", kind, "--box", box)

    assert made("maximal").code == 0
    smaller = {"lower": ends["nominal"], "lower_closed": True}
    assert made("box", **smaller).code == 0
    refused = made("maximal", **smaller)
    assert (refused.code, "no bad values at the lower end of to_ridge: it can be moved" in refused.err) == (4, True)
    assert made("box", upper="1000000").code == 1


def test_alethe(tmp_path):
    proofs = tmp_path / "proofs"
    made = certify(*example(), "-o", tmp_path / "c", "--kind", "box", "--alethe", proofs)
    assert made["alethe_holes"] == 0
    written = sorted(file.suffix for file in proofs.iterdir())
    assert written.count(".alethe") == written.count(".smt2") > 0
    assert all(file.read_text(encoding="utf-8").startswith("(\n(assume") for file in proofs.glob("*.alethe"))


def test_parameters_beside_the_plan(tmp_path):
    """They are those of all commands; the claim is about the network with them, which is written down."""
    path = tmp_path / "box.cert"
    ended = command("certify", *DELIVERY, "-o", path, "--kind", "maximal", "--json")
    made = answer_of(ended, "robust/certify/1")
    assert "the certificate is about" in ended.err
    assert made["files"].keys() == {"domain", "problem", "plan", "parameters"}
    widest = json.loads(command("envelope", *DELIVERY, "--json").out)["parameters"]
    assert widest.keys() == {f"dur_n{number}" for number in range(3, 9)}
    for plan in (tmp_path / "box.stn", DELIVERY[2]):
        _, checked = verified(path, *DELIVERY[:2], plan)
        assert checked["claim"] == made["claim"]
        assert {name: ends["upper"] for name, ends in checked["box"].items()} == {
            name: ends["upper"] for name, ends in widest.items()
        }
    (tmp_path / "box.toml").unlink()  # then durations are those of the domain, which the network does not keep
    assert code_of("verify", path, *DELIVERY[:2], tmp_path / "box.stn") == 1


def test_parameters_that_are_asked_for(tmp_path):
    """A start, a duration, and an initial value, with attributes."""
    path = tmp_path / "box.cert"
    words = ["--parameter", "duration:n1,weight=2,ub=20", "--parameter", "start:n0,default=0,lb=0"]
    claim = certify(*DELIVERY, "-o", path, "--kind", "box", *words)["claim"]
    assert "dur_n1" in claim
    assert "start_n0" in claim
    generator = example(directory=EXAMPLES / "generator")
    words = ["-o", path, "--kind", "region", "--parameter", "cap=fluent:(tank-size gen)"]
    refused = command("certify", *generator, *words)
    assert (refused.code, "--force replaces them" in refused.err) == (2, True)
    made = command("certify", *generator, *words, "--force")
    assert (made.code, "without (cap < " in made.out) == (0, True)
    assert (tmp_path / "box.toml").read_text(encoding="utf-8") == '[parameters."cap"]\nfluent = "(tank-size gen)"\n'
    assert code_of("verify", path, *generator[:2], tmp_path / "box.stn", "--kind", "region") == 0
    assert code_of("verify", path, *generator) == 1


def test_knowledge_is_about_all_files(tmp_path, path):
    network = sat_plan([[1, 2], [-1, 2], [1, -2], [-1, -2]]).write(tmp_path / "wrong")
    assert code_of("certify", network, "-o", path) == 0
    _, checked = verified(path, network)
    assert (checked["kind"], checked["files"].keys()) == ("knowledge", {"network", "domain", "problem"})
    assert code_of("verify", path, KITCHEN) == 1
    assert code_of("verify", path, *example()) == 1
    problem = network.parent / json.loads(network.read_text(encoding="utf-8"))["problem"]
    problem.write_text(problem.read_text(encoding="utf-8").replace("(:goal", "(:gaol"), encoding="utf-8")
    assert code_of("verify", path, network) == 4


@pytest.mark.parametrize("name", ["kitchen", "wing"])
def test_correct_executions(path, name):
    """Plans with choices that have one get a certificate of one, and are verified with their files."""
    network = EXAMPLES / name / f"{name}.tpnu.json"
    made = certify(network, "-o", path)
    assert (made["kind"], made["refuted"]) == ("execution", 0)
    assert made["claim"].startswith("correct execution of the plan with choices: ")
    choices = json.loads(network.read_text(encoding="utf-8"))["choices"]
    values = {
        choice["name"]: [value for value in choice["domain"] if f"{choice['name']} = {value}" in made["claim"]]
        for choice in choices
    }
    assert {len(chosen) for chosen in values.values()} == {1}
    as_chosen = [word for choice, (value,) in values.items() for word in ("--assume", f"{choice}={value}")]
    assert code_of("verify", path, network, *as_chosen) == 0
    for choice in choices:
        for other in {choice["domain"][0], choice["domain"][-1]} - {*values[choice["name"]]}:
            assert code_of("verify", path, network, "--assume", f"{choice['name']}={other}") == 1
    assert code_of("verify", path, network, "--kind", "execution") == 0
    assert code_of("verify", path, network, "--kind", "knowledge") == 1
    assert code_of("certify", network, "-o", path, "--kind", "knowledge") == 1


def test_choices_that_leave_no_execution(path):
    both = ("--assume", "xA1=glass", "--assume", "xA2=coffee")
    made = command("certify", KITCHEN, "-o", path, *both)
    assert made.code == 0
    assert "no choices and times with xA1 = glass, xA2 = coffee are a correct execution" in made.out
    assert code_of("verify", path, KITCHEN) == 0
    assert code_of("verify", path, KITCHEN, "--kind", "knowledge", *both) == 0
    assert code_of("verify", path, KITCHEN, "--kind", "knowledge", *both, "--assume", "xA3=bagel") == 0
    for less in ((), both[:2]):
        ended = command("verify", path, KITCHEN, "--kind", "knowledge", *less)
        assert (ended.code, ended.out) == (1, "rejected: the choices that are demanded are others\n")
    ended = command("certify", KITCHEN, "-o", path, "--kind", "execution", *both)
    assert (ended.code, "there is no correct execution" in ended.err) == (1, True)


def test_a_maximal_box_is_demanded_with_all_its_values(path, box, tmp_path):
    assert code_of("certify", *example(), "-o", path, "--kind", "maximal") == 0
    words = ("verify", path, *example(), "--kind", "maximal")
    assert code_of(*words, "--box", "to_ridge=25:36") == 1
    assert code_of(*words, "--box", "to_ridge=25:36", "--box", " to_crater = 35:46") == 0
    named_like_a_value = box.rename(tmp_path / "to_ridge=1.json")
    assert code_of(*words, "--box", named_like_a_value) == 0


def test_a_certificate_of_steps_is_about_their_network(path, tmp_path):
    workshop = [EXAMPLES / "workshop" / name for name in ("domain.pddl", "problem.pddl", "plan.log")]
    steps = tmp_path / "plan.txt"
    steps.write_text(workshop[2].read_text(encoding="utf-8"), encoding="utf-8")
    assert command("certify", *workshop, "-o", path).code == 0
    assert command("verify", path, *workshop[:2], path.with_suffix(".stn")).code == 0
    ended = command("verify", path, *workshop[:2], steps)
    assert_one_line(ended, 2)
    assert f"found a plan of steps, expected the network of the certificate: {path.with_suffix('.stn')}" in ended.err
