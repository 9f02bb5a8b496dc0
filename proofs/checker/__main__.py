"""`python -m checker CERT DOMAIN PROBLEM PLAN` or `CERT NETWORK`: check a certificate, and say what it establishes.

Exit codes: 0 established, 1 rejected, 2 a file cannot be read, 3 out of time, 4 the files hold what it does not
know. The answer is one line of ASCII, whatever names the files hold, and a few lines of digests below it.
"""

import argparse
import gzip
import hashlib
import json
import resource
import signal
import sys
import zlib
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from tomllib import TOMLDecodeError
from typing import Any

from .choices import Files, check_choices, members, network_of
from .claims import Box, Claim, Range, check, nominal
from .proofs import Rejected, Tape, demand
from .reader import Ground, Unsupported, ground, need, number

FORMAT, LATE = "robust/certificate/2", (3, "unknown")
KINDS = ("plan", "box", "maximal", "shape", "region", *(CHOICES := ("knowledge", "execution")))
MALFORMED = (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError)
LONGEST, EXPANDED = 1 << 20, 32  # bytes of a certificate that is unpacked: these, and as many for each of its own
SMALL = 120_000
"""Bytes of all files; what is above that may take time and memory of its own."""


class Inputs(dict[str, str]):
    """The files, each read once: digests of what has been read."""

    def text(self, kind: str, path: Path) -> str:
        data = path.read_bytes()
        self[kind] = hashlib.sha256(data).hexdigest()
        need(b"\0" not in data, f"{path}: found binary data, expected text")
        return data.decode("utf-8-sig").replace("\r", "\n")


def lines_of(path: Path) -> Iterator[str]:
    left = LONGEST + EXPANDED * path.stat().st_size
    with gzip.open(path) as file:
        while line := file.readline(left):
            left -= len(line)
            demand(left > 0 and line.endswith(b"\n"), "the certificate is cut off, or too long for a file of its size")
            yield line.decode("ascii")


def checked(certificate: Path, files: list[Path], epsilon: Fraction, inputs: Inputs, demanded: Any) -> Claim:
    """What the certificate establishes of the files."""
    lines = lines_of(certificate)
    first = json.loads(next(lines, "null"))
    demand(type(first) is list and len(first) == 3 and first[0] == FORMAT, f"expected a certificate of format {FORMAT}")
    demand((kind := first[1]) in (*KINDS, "corners"), "the certificate is of an unknown kind")
    demand(len(files) == (1 if kind in CHOICES else 3), f"a certificate of kind {kind} is about other files")
    if kind in CHOICES:
        claim = check_choices(Tape(lines), network_files(inputs, files[0]), kind, first[2], epsilon)
        require_choices(claim, demanded)
        return claim
    domain, problem, text = (inputs.text(each, path) for each, path in zip(("domain", "problem", "plan"), files))
    beside = files[2].with_suffix(".toml")
    plan = ground(domain, problem, text, inputs.text("parameters", beside) if beside.is_file() else "")
    claim = check(Tape(lines), plan, kind, first[2], epsilon)
    require(plan, claim, demanded)
    return claim


def network_files(inputs: Inputs, path: Path) -> Files:
    network = network_of(inputs.text("network", path))
    domain, problem = (inputs.text(each, path.parent / network[each]) for each in ("domain", "problem"))
    return network, domain, problem


def require_choices(claim: Claim, demanded: Any) -> None:
    """An execution has the choices that are demanded, at least; that there is none assumes these, at most."""
    demand(demanded.kind in (None, claim.kind), f"expected {demanded.kind}, the certificate establishes {claim.kind}")
    demand(demanded.box is None, "a plan with choices has no box")
    wanted, found = {tuple(text.split("=", 1)) for text in demanded.assume}, claim.choices.items()
    if demanded.kind is not None or wanted:
        enough = wanted <= found if claim.kind == "execution" else found <= wanted
        demand(enough, "the choices that are demanded are others")


def require(plan: Ground, claim: Claim, demanded: Any) -> None:
    """What is demanded, or more, is what has been established."""
    demand(not demanded.assume, "a plan without choices has no assumptions")
    said = f"the certificate establishes {claim.kind}"
    if demanded.kind == "plan" and claim.box is not None:
        inside = (values.within(claim.box[name]) for name, values in nominal(plan).items())
        demand(all(inside), f"expected plan, but the nominal values are outside of the box: {said}")
    elif demanded.kind is not None:
        enough = claim.kind == demanded.kind or (claim.kind, demanded.kind) == ("maximal", "box")
        demand(enough, f"expected {demanded.kind}, {said}")
    if demanded.box is not None:
        text = demanded.box if demanded.box[:1] == "{" else Path(demanded.box).read_bytes()
        wanted = box_in(plan, json.loads(text, object_pairs_hook=members))
        demand(claim.box is not None, f"expected a box, {said}")
        within = (values.within((claim.box or {})[name]) for name, values in wanted.items())
        enough = claim.box == wanted if demanded.kind == "maximal" else all(within)
        demand(enough, "the box that is demanded is another one")


def box_in(plan: Ground, document: Any) -> Box:
    """A box as `robust envelope --json` prints it; parameters that it leaves out have their nominal values."""
    demand(document.get("verified") is not False, "the box that is demanded was not verified")
    ends = document.get("parameters", document)
    known = plan.parameters.keys()
    demand(ends.keys() <= known, f"the box that is demanded has other parameters than {', '.join(known)}")
    found: Box = {} if ends.keys() == known else nominal(plan)
    for name, each in ends.items():
        low, high = (None if each[key] in ("inf", "-inf", "+inf") else number(each[key]) for key in ("lower", "upper"))
        closed = [each.get(f"{key}_closed") is not False for key in ("lower", "upper")]
        found[name] = Range(low, closed[0] and low is not None, high, closed[1] and high is not None)
        demand(found[name].within(found[name]), "the box that is demanded is empty")
    return {name: found[name] for name in known}


def report(arguments: Any, inputs: Inputs) -> tuple[int, dict[str, Any]]:
    try:
        epsilon = number(arguments.epsilon)
        need(epsilon >= 0, "epsilon has to be 0 or more")
        claim = checked(Path(arguments.certificate), [*map(Path, arguments.files)], epsilon, inputs, arguments)
    except (Rejected, OSError, EOFError, zlib.error, UnicodeError, MemoryError, Unsupported, TOMLDecodeError) as error:
        known = {Rejected: (1, "rejected"), TimeoutError: LATE, MemoryError: LATE, Unsupported: (4, "unsupported")}
        code, verdict = known.get(type(error), (2, "unreadable"))
        return code, {"verdict": verdict, "reason": plain(str(error) or "out of memory")}
    except MALFORMED as error:
        return 1, {"verdict": "rejected", "reason": f"malformed ({type(error).__name__})"}
    answer: dict[str, Any] = {"verdict": "established", "kind": claim.kind, "epsilon": str(epsilon)}
    answer["claim"] = plain(f"{claim.text}, epsilon = {epsilon}")
    box = None if claim.box is None else {name: ends_of(each) for name, each in claim.box.items()}
    return 0, answer | {"box": box, "obligations": claim.obligations, "refuted": claim.refuted}


def plain(text: str) -> str:
    """What a terminal shows as it is: control characters and all that is not ASCII are escaped."""
    return text.encode("unicode_escape").decode("ascii")


def ends_of(each: Range) -> dict[str, Any]:
    texts = ("-inf" if each.lower is None else str(each.lower), "inf" if each.upper is None else str(each.upper))
    return dict(zip(("lower", "upper", "lower_closed", "upper_closed"), (*texts, each.lower_closed, each.upper_closed)))


def limit(arguments: Any) -> None:
    """Processor time and memory, by the sizes of the files: small ones take 4 s and 280 MB at most."""
    paths = [Path(each) for each in (arguments.certificate, *arguments.files)]
    more = max(sum(path.stat().st_size for path in paths if path.is_file()) - SMALL, 0)
    seconds, memory = arguments.seconds or 4 + more // 10_000, min((280 << 20) + 4000 * more, 4 << 30)
    for kind, most in ((resource.RLIMIT_AS, memory), (resource.RLIMIT_CPU, max(seconds, 1))):
        hard = resource.getrlimit(kind)[1]
        resource.setrlimit(kind, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))
    signal.signal(signal.SIGXCPU, out_of_time)
    sys.setrecursionlimit(20_000)


def out_of_time(*_: object) -> None:
    raise TimeoutError("found no answer within the processor time for files of this size: give it more --seconds")


def main() -> int:
    parser = argparse.ArgumentParser(prog="checker", description="Check a certificate of `robust`.")
    parser.add_argument("certificate")
    parser.add_argument("files", nargs="+", help="DOMAIN PROBLEM PLAN, or NETWORK")
    parser.add_argument("--kind", choices=KINDS, help="fail unless this, or more, is established")
    parser.add_argument("--box", help="fail unless all of this box is established: JSON, or a file of it")
    parser.add_argument("--assume", action="append", default=[], help="NAME=VALUE: the choices of a plan with choices")
    parser.add_argument("--epsilon", default="1/1000", help="how far apart mutex time points have to be")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--seconds", type=int, help="of processor time that it may take (by the sizes of the files)")
    arguments = parser.parse_args()
    limit(arguments)
    code, answer = report(arguments, inputs := Inputs())
    if arguments.json:
        print(json.dumps(answer | {"files": inputs}))
    else:
        print(f"{answer['verdict']}: {answer.get('claim') or answer['reason']}")
        if not code:
            print(*(f"of {kind}: sha256 {digest}" for kind, digest in inputs.items()), sep="\n")
            print(f"checked: {answer['obligations']} obligations, {answer['refuted']} of them not constant")
    return code


if __name__ == "__main__":
    sys.exit(main())
