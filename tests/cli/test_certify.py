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
    late = command("certify", *example(), "-o", tmp_path / "plan.cert", "--timeout", "0.000001")
    assert (late.code, late.err) == (3, "robust: out of time\n")


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
