"""The checker's command for the bank: what it prints and its exit code, for files and demands of all kinds.

What a command line has to come to is written here; what exactly is printed is compared with the checker that is meant.
"""

from __future__ import annotations

import gzip
import io
import json
import sys
import zlib
from argparse import Namespace
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from fractions import Fraction
from functools import partial
from itertools import chain
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

from robust.certify.tape import write
from robust.pike_bridge.action_model import load_team_plan
from robust.pike_bridge.semantics import Oracle
from robust.qe.box import Box, Interval
from tests.certify import adversary, networks, tools
from tests.certify.adversary import BESIDE, PLAIN

FILES = tuple(map(str, tools.NAVIGATION))
TABLES = json.loads(Path(__file__).with_name("data").joinpath("command_lines.json").read_text(encoding="utf-8"))
"""Groups of command lines after their exit codes, where `./` is the folder of certificates and names in braces stand
for the files of a plan; and first lines of certificates."""


def command_lines(folder):
    """Each ends with its exit code, and with one that is not 0 nothing is established."""
    place = folder / "lines"
    place.mkdir()
    stand_for = prepared(place)

    def words(row):
        paths = [stand_for.get(word, [str(place / word[2:]) if word.startswith("./") else word]) for word in row]
        return tuple(chain(*paths))

    groups = {name: [(code, words(row)) for code, *row in rows] for name, rows in TABLES["groups"].items()}
    for group, lines in {**groups, "of_bytes": of_bytes(place), "of_texts": of_texts(place)}.items():
        for number, (code, line) in enumerate(lines):
            outcome = ended(line)
            assert outcome[0] == code, (line, outcome)
            assert outcome[1].startswith("established:") == (code == 0 and "--json" not in line), line
            yield f"main {group} {number} {line}", partial(_ends, words=line, expected=outcome)
    yield from (("main errors", reports_errors), ("main limits", keeps_limits), ("main at start", starts))


def prepared(place):
    """Certificates of plans, of boxes without the nominal values or without ends, and of a network with choices."""
    unbounded = tools.written(PLAIN._replace(plan=TABLES["unbounded plan"]), place / "unbounded")
    without_nominal = tools.written(PLAIN._replace(plan=PLAIN.plan.replace(" default 5", "")), place / "open")
    inside, outside = Interval(Fraction(29), Fraction(31)), Interval(Fraction(31), Fraction(32))
    beyond, nominal = Interval(Fraction(41), Fraction(42)), Interval(Fraction(40), Fraction(40))
    certificates = {kind: tools.made(tools.NAVIGATION, kind) for kind in ("plan", "box", "maximal", "shape", "region")}
    for number, ends in enumerate(((inside, beyond), (outside, nominal), (outside, beyond))):
        away = Box(dict(zip(("to_ridge", "to_crater"), ends, strict=True)))
        certificates[f"away-{number}"] = tools.made(tools.NAVIGATION, "box", box=away)
    certificates["every"] = tools.made(unbounded, "maximal")
    certificates["open"] = next(lines for name, _, lines in adversary.TABLES["honest"] if name == "box")
    path = networks.files(place / "small")
    certificates |= networks.certificates(path, Oracle(load_team_plan(path)).decide().witness, {"x": "b=c"})
    for name, lines in certificates.items():
        write(lines, place / f"{name}.cert")
    ends = {"k": {"lower": "-inf", "upper": "2"}, "m": {"lower": "1", "upper": "inf"}}
    tools.kept(place / "wanted.json", json.dumps(ends).encode())
    plans = {"files": tools.NAVIGATION, "unbounded": unbounded, "open": without_nominal}
    plans |= {name: (file,) for name, file in zip(("domain", "problem", "plan"), tools.NAVIGATION, strict=True)}
    return {f"{{{name}}}": tuple(map(str, files)) for name, files in plans.items()}


def _ends(by, words, expected):
    return by is tools.CHECKER or ended(words, by) == expected


def ended(words, by=tools.CHECKER):
    """Exit code, what is printed, and what limits are set."""
    printed, errors, limits = io.StringIO(), io.StringIO(), list[Any]()
    least = {"memory": (0, -1), "time": (0, 1000)}
    with (
        limited(by, least.get, lambda *limit: limits.append(limit), limits.append),
        patch.object(sys, "argv", ["program", *words]),
        redirect_stdout(printed),
        redirect_stderr(errors),
    ):
        try:
            code = by.main.main()
        except SystemExit as error:
            code = f"ended with {error.code}"
    return code, printed.getvalue(), errors.getvalue(), limits


def limited(by, get, put, say):
    """The checker's command sets limits, and this process keeps its own."""
    usage = SimpleNamespace(RLIMIT_AS="memory", RLIMIT_CPU="time", RLIM_INFINITY=-1, getrlimit=get, setrlimit=put)
    signal = SimpleNamespace(SIGXCPU="time", signal=lambda *_: say("signal"))
    return patch.multiple(by.main, resource=usage, signal=signal, sys=SimpleNamespace(setrecursionlimit=say))


def of_bytes(place):
    """Certificates that are none: first lines of all kinds, and files that are cut off or something else."""
    honest = gzip.decompress((place / "plan.cert").read_bytes())
    rest = honest[honest.index(b"\n") + 1 :]
    contents = [json.dumps(first).encode() + b"\n" + rest for first in TABLES["first lines"]]
    contents += [b"", b"\n", b"[\n", b"[" * 100_000 + b"\n", honest[:-1], honest + b"\n", honest + b"[]\n", rest]
    contents += [honest.replace(b"plan", "plän".encode(), 1)]
    for number, content in enumerate(contents):
        code = 2 if content.startswith(b"[") and b"\xc3" in content[:60] else 1
        yield code, (tools.kept(place / f"first-{number}.cert", gzip.compress(content, mtime=0)), *FILES)
    whole = gzip.compress(honest, mtime=0)
    half = len(whole) // 2
    damaged = whole[:half] + bytes(255 - byte for byte in whole[half:])
    for number, content in enumerate((honest, whole[:half], damaged, b"", b"\x1f\x8b")):
        yield 2 if content else 1, (tools.kept(place / f"other-{number}.cert", content), *FILES)
    yield 2, (str(place), *FILES)


def of_texts(place):
    """The same plan in files with other ends of lines, with a mark at the start, or that are no texts; other plans."""
    texts = [path.read_bytes() for path in tools.NAVIGATION]
    ways: list[tuple[int, str, Callable[[bytes], bytes]]] = [
        (0, "plan", lambda text: text.replace(b"\n", b"\r\n")),
        (0, "plan", lambda text: text.replace(b"\n", b"\r")),
        (0, "plan", lambda text: b"\xef\xbb\xbf" + text),
        (4, "plan", lambda text: text + b"\0"),
        (2, "plan", lambda text: text + b"\xff"),
        (1, "maximal", lambda text: text.replace(b"(at 21 (lit ridge))", b"(at 31 (lit ridge))")),
        (4, "maximal", lambda text: text.replace(b"parameter to_ridge", b"parameter to_valley")),
        (4, "maximal", lambda text: text.replace(b"(:goal", b"(:goal (and) (:goal")),
    ]
    for number, (code, kind, change) in enumerate(ways):
        for some in ((0,), (1,), (2,), (0, 1, 2)):
            changed = [change(text) if index in some else text for index, text in enumerate(texts)]
            names = [f"{number}-{len(some)}{some[0]}-{path.name}" for path in tools.NAVIGATION]
            paths = (tools.kept(place / name, text) for name, text in zip(names, changed, strict=True))
            if changed != texts:
                yield code, (str(place / f"{kind}.cert"), *paths, "--json")
    beside = tools.written(BESIDE[0], place / "beside")
    for code, text in ((1, BESIDE[1]), (4, "[parameters.y]\n"), (2, "= \n"), (4, "[parameter.k]\n")):
        beside[2].with_suffix(".toml").write_text(text, encoding="utf-8")
        yield code, (str(place / "plan.cert"), *map(str, beside), "--json")


MALFORMED = (ZeroDivisionError, AttributeError, KeyError, RecursionError, TypeError, ValueError)


def reports_errors(by):
    """Whatever goes wrong, nothing is established; the exit code and the verdict say what it was."""
    wanted = [(error("text"), 1, "rejected", f"malformed ({error.__name__})") for error in MALFORMED]
    wanted += [(by.proofs.Rejected("text"), 1, "rejected", "text"), (MemoryError(), 3, "unknown", "out of memory")]
    wanted += [(by.reader.Unsupported("text"), 4, "unsupported", "text")]
    wanted += [(error("text"), 2, "unreadable", "text") for error in (OSError, EOFError, zlib.error, UnicodeError)]
    for error, code, verdict, reason in wanted:

        def checked(*_, error=error):
            raise error

        with patch.object(by.main, "checked", checked):
            arguments = Namespace(certificate="", files=[], epsilon="1")
            if by.main.report(arguments, None) != (code, {"verdict": verdict, "reason": reason}):
                return False
    return True


class Long(bytes):
    """A line that is as long as it says."""

    size: int

    def __len__(self):
        return self.size


def keeps_limits(by):
    """What a certificate may be when it is unpacked depends on its size; time and memory on the sizes of all files."""
    most = (1 << 20) + 32 * Path().stat().st_size
    for sizes, fits in (([most - 1], True), ([most], False), ([1, most - 2], True), ([2, most - 2], False)):
        lines, asked = [Long(b"[]\n") for _ in sizes], list[int]()
        for line, size in zip(lines, sizes, strict=True):
            line.size = size
        file, source = io.BytesIO(), iter([*lines, b""])

        def readline(limit, asked=asked, source=source):
            asked.append(limit)
            return next(source)

        file.readline = readline  # type: ignore[method-assign, assignment]
        with patch.object(by.main, "gzip", SimpleNamespace(open=lambda _, file=file: file)):
            try:
                passed = len(list(by.main.lines_of(Path()))) == len(sizes)
            except by.proofs.Rejected:
                passed = False
        if passed != fits or asked[0] != most or max(asked) != most:
            return False
    return all(limits_of(by, *sizes) == limits for sizes, limits in SIZES.items())


def limits_of(by, size, seconds):
    limits = {}
    path = SimpleNamespace(is_file=lambda: True, stat=lambda: SimpleNamespace(st_size=size))
    with (
        limited(by, lambda _: (0, -1), limits.setdefault, lambda _: None),
        patch.object(by.main, "Path", lambda _: path),
    ):
        by.main.limit(Namespace(certificate="", files=["", ""], seconds=seconds))
    return limits["time"][0], limits["memory"][0]


SIZES = {
    (40_000, None): (4, 280 << 20),
    (40_001, 7): (7, (280 << 20) + 12_000),
    (50_000, None): (7, (280 << 20) + 120_000_000),
}
"""Bytes of each of three files and what is asked for, and the seconds and bytes that the checker takes at most."""


def starts(by):
    """As a program it ends with the exit code of its main function."""
    package = by.main.__package__
    modules = {f"{package}.{name}": getattr(by, name) for name in ("reader", "formulas", "proofs", "claims", "choices")}
    code = getattr(by.main, "CODE", None) or compile(Path(tools.main.__file__).read_bytes(), "main", "exec")
    with (
        patch.dict(sys.modules, {package: SimpleNamespace(__path__=[]), **modules}),
        patch.object(sys, "argv", ["program"]),
        redirect_stderr(io.StringIO()),
    ):
        try:
            exec(code, {"__name__": "__main__", "__package__": package})  # noqa: S102 - this is the checker
        except SystemExit as error:
            return error.code == 2
    return False
