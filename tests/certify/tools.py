"""Certificates for tests: made once, taken apart, changed, put together again, and judged by a solver."""

from __future__ import annotations

import gzip
import importlib.util
import json
import zlib
from pathlib import Path

from robust.api import envelope, region
from robust.certify.produce import FormulaCertificate, PlanCertificate, digests
from robust.certify.verify import checker_path
from robust.encode import create_encoding
from robust.pike_bridge.action_model import load_team_plan
from robust.pike_bridge.semantics import Semantics
from robust.plan.load import load_plan
from robust.qe.box import Box
from robust.smt.limits import Deadline
from tests.pike_bridge.satisfiability import sat_plan

EXAMPLES = Path(__file__).parents[2] / "robust" / "examples"
NAVIGATION = tuple(EXAMPLES / "two_sample_navigation" / name for name in ("domain.pddl", "problem.pddl", "plan.stn"))
GENERATOR = tuple(EXAMPLES / "generator" / name for name in ("domain.pddl", "problem.pddl", "plan.stn"))


_SPEC = importlib.util.spec_from_file_location("certificate_checker", checker_path())
CHECKER = importlib.util.module_from_spec(_SPEC)
"""The checker as a module, which knows nothing of this package."""
_SPEC.loader.exec_module(CHECKER)


def rejection(path, files=None):
    """Why the checker does not accept a certificate; None if it does. Any other exception is a fault of the checker."""
    try:
        CHECKER.check(str(path), files or {})
    except (CHECKER.Rejected, OSError, zlib.error) as error:
        return str(error) or "unreadable"
    return None


def by_name(files):
    """Input files by what they are."""
    return dict(zip(("domain", "problem", "plan"), files, strict=True))


def certificate(files, path, *, kind="box", encoding="relational", box=None):
    """A certificate of the plan in `files`, written to `path`; the plan, and the box or the region."""
    plan = load_plan(*files)
    if kind == "region":
        found = region(plan, encoding=encoding).region
    else:
        found = box or (Box.nominal(plan.parameters) if kind == "plan" else envelope(plan).box)
    stated = {} if kind == "region" else {"box": found}
    made = PlanCertificate(create_encoding(encoding, plan), kind=kind, inputs=digests(by_name(files)), **stated)
    if kind == "region":
        made.add_region(found)
    else:
        made.add_box()
    if kind == "maximal":
        made.add_witnesses()
    made.writer.save(path)
    return plan, found


def knowledge_certificate(path):
    """A certificate that a plan with choices has no correct execution; its input files by what they are."""
    network = sat_plan([[1, 2], [-1, 2], [1, -2], [-1, -2]]).write(path.with_name("choices"))
    semantics = Semantics(load_team_plan(network))
    files = {"network": network, "domain": network.parent / "domain.pddl", "problem": network.parent / "problem.pddl"}
    made = FormulaCertificate(semantics.terms, name="correct execution", inputs=digests(files))
    made.add(semantics.formulas, Deadline())
    made.writer.save(path)
    return files


def lines_of(path):
    return [json.loads(line) for line in gzip.decompress(path.read_bytes()).split(b"\n") if line]


def write_lines(path, lines):
    text = "".join(json.dumps(line, separators=(",", ":")) + "\n" for line in lines)
    path.write_bytes(gzip.compress(text.encode(), compresslevel=1, mtime=0))
