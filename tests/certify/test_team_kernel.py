"""Certificates of plans with choices by the checker that Coq proves right, where it is built."""

import re
import subprocess
from argparse import Namespace
from collections import Counter
from pathlib import Path
from random import Random

import pytest

from benchmarks.generators.team_plans import Shape, random_plan
from robust.certify import CheckerOutcome, Demanded
from robust.certify.checker.__main__ import Inputs, report
from robust.certify.checker.choices import network_of
from robust.certify.checker.proofs import Tape
from robust.certify.kernel.run import opinions, verify_by_kernel
from robust.certify.kernel.team import TeamTranslation
from robust.certify.produce import execution, knowledge, stated_choices
from robust.certify.tape import header, write
from robust.errors import RefutedError, UnsupportedError
from robust.pike_bridge.action_model import load_team_plan
from robust.pike_bridge.semantics import ExecutionExistence, Oracle
from robust.smt.limits import NEVER, Deadline
from tests.certify import networks, tools
from tests.certify.test_kernel import KERNEL, built
from tests.sampling import often

EXAMPLES = Path(__file__).parents[2] / "robust" / "examples"
ESTABLISHED, REJECTED, UNSUPPORTED = (CheckerOutcome[name] for name in ("ESTABLISHED", "REJECTED", "UNSUPPORTED"))


@pytest.fixture(autouse=True)
def on_path(monkeypatch):
    monkeypatch.setenv("PATH", str(KERNEL.parent), prepend=":")


def outcomes(lines, path, kind=None):
    """What both checkers say of a certificate, the one in Python in this process: outcome, and claim or reason."""
    certificate = path.parent / "plan.cert"
    write(lines, certificate)
    demanded = Namespace(
        certificate=certificate, files=[path], epsilon=str(tools.EPSILON), kind=kind, box=None, assume=[]
    )
    code, python = report(demanded, Inputs())
    kernel = verify_by_kernel(certificate, [path], Demanded(tools.EPSILON, kind))
    return (CheckerOutcome(code), python.get("reason")), (kernel.outcome, kernel.answer.get("reason"))


@built
@pytest.mark.parametrize(("name", "assumed"), [("kitchen", {"xA1": "mug", "xA2": "juice"}), ("wing", {})])
def test_examples(name, assumed, tmp_path):
    path = EXAMPLES / name / f"{name}.tpnu.json"
    found = Oracle(load_team_plan(path)).decide().witness
    certificate = tmp_path / "plan.cert"
    write(execution(path, tools.EPSILON, found.scenario, found.schedule), certificate)
    python, kernel = (each.verification for each in opinions(None, certificate, [path], Demanded(tools.EPSILON)))
    assert (python.outcome, kernel.outcome) == (ESTABLISHED, ESTABLISHED)
    assert all(python.answer[key] == kernel.answer[key] for key in ("claim", "box", "kind", "files", "epsilon"))
    if not assumed:
        with pytest.raises(RefutedError):
            knowledge(path, tools.EPSILON, Deadline.after(60))
        return
    write(knowledge(path, tools.EPSILON, Deadline.after(60), assumed), certificate)
    wanted = [f"{name}={value}" for name, value in assumed.items()]
    for demanded, outcome in ((wanted, ESTABLISHED), (wanted[:1], REJECTED)):
        said = opinions("both", certificate, [path], Demanded(tools.EPSILON, "knowledge", assume=demanded))
        assert {each.verification.outcome for each in said} == {outcome}
    assert said[1].verification.answer["reason"] == said[0].verification.answer["reason"]


def drawn(seed, folder):
    """Plans as they are drawn for checkers, and as the paper draws them."""
    if seed % 3:
        return networks.random_network(seed, folder / str(seed))
    return random_plan(seed, 0, Shape(top=4, inner=2)).write(folder / str(seed))


@built
def test_random_plans_against_oracle_and_referee(tmp_path):
    """Executions are correct as the referee says, and there is none if and only if the oracle finds none."""
    seen = Counter()
    for seed in range(often(12, 400)):
        path = drawn(seed, tmp_path)
        try:
            plan, stated = load_team_plan(path), stated_choices(path, tools.EPSILON)
            decision = Oracle(plan).decide()
        except (UnsupportedError, networks.RobustError):
            continue
        exists = decision.verdict is ExecutionExistence.EXISTS
        known = networks.executions(plan, decision.witness, Random(seed)) if exists else []
        for one, correct in known:
            values = [values.index(one.scenario[name]) for name, values in stated.domains.items()]
            times = [str(one.schedule[event]) if event in one.schedule else None for event in stated.guards]
            (python, _), (kernel, reason) = outcomes([header("execution"), ["execution", values, times]], path)
            if kernel is UNSUPPORTED:
                assert "durations" in reason
                seen["unsupported"] += 1
                continue
            wanted = ESTABLISHED if correct else REJECTED
            assert (python, kernel) == (wanted, wanted), (seed, one)
            seen[correct] += 1
        certificate = networks.OUT_OF_NOTHING
        if not exists:
            certificate = knowledge(path, tools.EPSILON, Deadline.after(60))
        (python, _), (kernel, _) = outcomes(certificate, path)
        if kernel is not UNSUPPORTED:
            assert (kernel is ESTABLISHED) is not exists, seed
            assert exists or python is ESTABLISHED
            seen["exists" if exists else "none"] += 1
    assert min(seen[key] for key in (True, False, "exists", "none")) >= 3, seen
    assert seen["unsupported"] < seen[True]


@built
def test_wrong_networks_and_certificates_are_not_established(tmp_path):
    """As far as the certificates of executions go, both say the same; a refutation is found anew or there is none."""
    counted = Counter()
    for number, (_, path, certificates, epsilon) in enumerate(networks.small(tmp_path)):
        if epsilon != "1/1000" or number % often(4, 1):
            continue
        for lines in certificates:
            (python, _), (kernel, _) = outcomes(lines, path)
            assert kernel is not ESTABLISHED or networks.is_true(path, lines), (path, lines)
            if lines[0][1] == "execution":
                assert kernel in (python, UNSUPPORTED), (path, lines)
            counted[kernel] += 1
    assert counted[ESTABLISHED] > 3
    assert counted[REJECTED] > 3


@built
def test_claims_and_files_have_to_fit(tmp_path):
    path = networks.files(tmp_path)
    certificate = path.parent / "plan.cert"
    write(networks.EXECUTION, certificate)
    for files in ([path, path, path], [path, path]):
        (said,) = opinions("kernel", certificate, files, Demanded(tools.EPSILON))
        assert said.verification.outcome is REJECTED
        assert said.verification.answer["reason"] == "a certificate of kind execution is about other files"
    said = {reason for _, reason in outcomes(networks.EXECUTION, path, kind="knowledge")}
    assert said == {"expected knowledge, the certificate establishes execution"}
    unknown = [["robust/certificate/2", "knowledge", [["x", "nosuch"]]], ["refute"]]
    assert [outcome for outcome, _ in outcomes(unknown, path)] == [UNSUPPORTED, UNSUPPORTED]


@built
def test_a_refutation_is_of_what_is_claimed(tmp_path):
    """With x = b=c there is no correct execution; its refutation shows nothing of x = a, with which there is one."""
    path = networks.files(tmp_path)
    document = network_of(path.read_text())
    texts = ((path.parent / document[name]).read_text() for name in ("domain", "problem"))
    team = TeamTranslation((document, *texts), tools.EPSILON, NEVER)

    def kernel(text, *words):
        (tmp_path / "file.kernel").write_text(text)
        ran = subprocess.run([KERNEL, *words, tmp_path / "file.kernel"], capture_output=True, text=True, check=False)
        return ran.stdout

    _, words = team.claim(Tape(['["refute"]']), "knowledge", [["x", "b=c"]])
    whole = team.file(words, "knowledge", [], lambda text: kernel(text, "--formulas"))
    assert kernel(whole).startswith(
        "established: no execution is correct with the values ((0 1)) of choices, epsilon = 1/1000"
    )
    for other in ("(none ((0 0)) ", "(none () "):
        assert kernel(whole.replace("(none ((0 1)) ", other)) == "rejected\n"
    head, proof = whole.split("(none ((0 1)) ")
    numbers = [match.span() for match in re.finditer(r"\d+", proof)]
    accepted = 0
    for (
        start,
        end,
    ) in numbers:  # what is claimed stays true; the proof no longer shows it, unless a number is not needed
        accepted += kernel(f"{head}(none ((0 1)) {proof[:start]}{int(proof[start:end]) + 1}{proof[end:]}").startswith(
            "est"
        )
    assert accepted < len(numbers) / 4
