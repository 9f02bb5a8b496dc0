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
from collections.abc import Callable, Iterator, Sequence
from contextlib import redirect_stderr, redirect_stdout
from fractions import Fraction
from functools import cache, partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

from robust.certify.hints import Line
from robust.certify.produce import execution, knowledge
from robust.certify.tape import write
from robust.pike_bridge.action_model import load_team_plan
from robust.pike_bridge.semantics import Oracle
from robust.qe.box import Box, Interval
from robust.smt.limits import Deadline
from tests.certify import forgeries, networks, tools
from tests.certify.texts import Texts
from tests.certify.tools import Checker

Holds = Callable[[Checker], bool]
Words = tuple[str, ...]
UNBOUNDED = Texts(
    forgeries.PLAIN.domain,
    forgeries.PLAIN.problem,
    "parameter k default 1; parameter m default 5 lb 0;\n"
    "durative-action instance i : (d); c: i.end - i.start in [1, 2]; c: i.end - i.start in [-inf, m];\n"
    "durative-action instance j : (d); c: j.end - j.start in [1, 2]; c: j.end - j.start in [k, inf];",
)
"""Valid are all k up to 2, with all m from 1 on."""


def command_lines(folder: Path) -> Iterator[tuple[str, Holds]]:
    for number, (code, words) in enumerate(lines_and_codes(folder)):
        assert outcome(words)[0] == code, (words, outcome(words))
        yield f"main {number} {words}", partial(_ends, words=words)
    yield "main errors", reports_errors
    yield "main limits", keeps_limits
    yield "main at start", starts


def _ends(by: Checker, words: Words) -> bool:
    return outcome(words, by) == expected(words)


@cache
def expected(words: Words) -> tuple[Any, ...]:
    return outcome(words)


def outcome(words: Sequence[str], by: Checker = tools.CHECKER) -> tuple[Any, ...]:
    """Exit code, what is printed, and what limits are set."""
    printed, errors, limits = io.StringIO(), io.StringIO(), list[Any]()
    least = {"memory": (0, -1), "time": (0, 1000)}
    usage = SimpleNamespace(
        RLIMIT_AS="memory",
        RLIMIT_CPU="time",
        RLIM_INFINITY=-1,
        getrlimit=least.get,
        setrlimit=lambda *limit: limits.append(limit),
    )
    system = SimpleNamespace(setrecursionlimit=limits.append)
    with (
        patch.object(by.main, "resource", usage),
        patch.object(by.main, "signal", SimpleNamespace(SIGXCPU="time", signal=lambda *_: limits.append("signal"))),
        patch.object(by.main, "sys", system),
        patch.object(sys, "argv", ["program", *words]),
        redirect_stdout(printed),
        redirect_stderr(errors),
    ):
        try:
            code = by.main.main()
        except SystemExit as ended:
            code = f"ended with {ended.code}"
    return code, printed.getvalue(), errors.getvalue(), limits


# -- command lines -----------------------------------------------------------------------------------------------------


def lines_and_codes(folder: Path) -> Iterator[tuple[Any, Words]]:
    """Command lines, with the exit code that each has to end with."""
    place = folder / "lines"
    place.mkdir()
    yield "ended with 2", ()
    yield "ended with 0", ("--help",)
    yield "ended with 2", ("cert",)
    yield "ended with 2", ("cert", "network", "--kind", "nothing")
    yield 2, ("cert", "network")
    yield from of_plans(place)
    yield from of_boxes(place)
    yield from of_choices(place)
    yield from of_bytes(place)
    yield from of_texts(place)


def of_plans(place: Path) -> Iterator[tuple[Any, Words]]:
    files = tuple(map(str, tools.NAVIGATION))
    for kind in ("plan", "box", "maximal", "region"):
        path = str(place / f"{kind}.cert")
        write(tools.made(tools.NAVIGATION, kind), Path(path))
        for more in ((), ("--json",), ("--epsilon=1/1000",), ("--epsilon=1/10000",)):
            yield 0, (path, *files, *more)
        for epsilon in ("-1", "x", "1/0", "", "(- 1)"):
            yield 4, (path, *files, "--epsilon", epsilon)
        implied = {"box": {"plan"}, "maximal": {"box", "plan"}}.get(kind, set())
        for wanted in ("plan", "box", "maximal", "region", "knowledge", "execution"):
            yield int(wanted not in {kind, *implied}), (path, *files, "--kind", wanted)
        yield 1, (path, *files, "--assume", "x=a")
        yield 1, (path, *files[:1])
        yield 1, (path, *files[:2])
        yield 1, (path, *files, files[0])
    yield 0, (str(place / "plan.cert"), *files, "--epsilon", "0")


def of_boxes(place: Path) -> Iterator[tuple[Any, Words]]:
    """Boxes that are demanded, of certificates of other boxes, some without the nominal values or without ends."""
    files = tuple(map(str, tools.NAVIGATION))
    names = ("to_ridge", "to_crater")
    inside, outside = Interval(Fraction(29), Fraction(31)), Interval(Fraction(31), Fraction(32))
    beyond = Interval(Fraction(41), Fraction(42))
    for number, ends in enumerate(
        ((inside, beyond), (outside, Interval(Fraction(40), Fraction(40))), (outside, beyond))
    ):
        path = place / f"away-{number}.cert"
        write(tools.made(tools.NAVIGATION, "box", box=Box(dict(zip(names, ends, strict=True)))), path)
        yield 0, (str(path), *files, "--kind", "box")
        yield 1, (str(path), *files, "--kind", "plan")
    unbounded = tools.written(UNBOUNDED, folder_in(place, "unbounded"))
    every = place / "every.cert"
    write(tools.made(unbounded, "maximal"), every)
    yield 0, (str(every), *map(str, unbounded), "--json")
    ends = {"k": {"lower": "-inf", "upper": "2"}, "m": {"lower": "1", "upper": "inf"}}
    for kind in ((), ("--kind", "maximal"), ("--kind", "box")):
        maximal = kind[-1:] == ("maximal",)
        for code, box in (
            (0, ends), (0, {"parameters": ends}), (1, {"parameters": ends, "verified": False}),
            (0, {"parameters": ends, "verified": True}), (int(maximal), {"parameters": {}, **ends}),
            (1, {**ends, "other": ends["k"]}), (1, {"other": ends["k"]}),
            (int(maximal), {**ends, "k": {"lower": "1", "upper": "2"}}),
            (1, {**ends, "m": {"lower": "0", "upper": "2"}}), (1, {**ends, "m": {"lower": "-inf", "upper": "2"}}),
            (int(maximal), {**ends, "m": {**ends["m"], "lower_closed": False, "upper": "+inf"}}),
            (0, {**ends, "k": {**ends["k"], "lower_closed": False}, "m": {**ends["m"], "upper": "+inf"}}),
            (int(maximal), {**ends, "k": {**ends["k"], "upper_closed": False}}),
            (0, {**ends, "m": {**ends["m"], "lower_closed": "text", "upper_closed": True}}),
            (int(maximal), {"k": ends["k"]}), (int(maximal), {}), (1, {"k": {"lower": "1"}}), (2, []), (1, {"k": 1}),
            (4, {**ends, "k": {"lower": "x", "upper": "2"}}), (4, {**ends, "k": {"lower": 1, "upper": 2}}),
        ):  # fmt: skip
            yield code, (str(every), *map(str, unbounded), "--box", json.dumps(box), *kind)
    yield from of_no_nominal_value(place)
    wanted = place / "wanted.json"
    wanted.write_text(json.dumps(ends), encoding="utf-8")
    yield 0, (str(every), *map(str, unbounded), "--box", str(wanted))
    yield 2, (str(every), *map(str, unbounded), "--box", str(place / "nowhere.json"))
    point = json.dumps(
        {name: {"lower": value, "upper": value} for name, value in zip(names, ("30", "40"), strict=True)}
    )
    for kind, code in (("plan", 0), ("box", 0), ("maximal", 0), ("region", 1)):
        yield code, (str(place / f"{kind}.cert"), *files, "--box", point)


def of_no_nominal_value(place: Path) -> Iterator[tuple[Any, Words]]:
    """A parameter needs no nominal value, unless a box that is demanded leaves it out."""
    paths = tools.written(
        forgeries.PLAIN._replace(plan=forgeries.PLAIN.plan.replace(" default 5", "")), folder_in(place, "open")
    )
    (lines,) = (lines for name, _, lines in forgeries.honest() if name == "box")
    path = place / "open.cert"
    write(lines, path)
    yield 0, (str(path), *map(str, paths), "--kind", "box", "--box", '{"k": {"lower": "0", "upper": "9"}}')
    yield 4, (str(path), *map(str, paths), "--box", "{}")
    yield 4, (str(path), *map(str, paths), "--kind", "plan")


def folder_in(place: Path, name: str) -> Path:
    (place / name).mkdir()
    return place / name


def of_choices(place: Path) -> Iterator[tuple[Any, Words]]:
    """Certificates of plans with choices, and what choices are demanded."""
    path = networks.files(place / "small", networks.document(), networks.DOMAIN, networks.PROBLEM)
    witness = Oracle(load_team_plan(path)).decide().witness
    assert witness is not None
    certificates: dict[str, list[Line]] = {
        "execution": execution(path, tools.EPSILON, witness.scenario, witness.schedule),
        "knowledge": knowledge(path, tools.EPSILON, Deadline.after(60), {"x": "b=c"}),
    }
    for kind, lines in certificates.items():
        certificate = str(place / f"{kind}.cert")
        write(lines, Path(certificate))
        other = "knowledge" if kind == "execution" else "execution"
        for assumed, code in (
            ((), None), (("x=a",), kind == "knowledge"), (("x=b=c",), kind == "execution"), (("x",), True),
            (("x=b",), True), (("x=a", "x=b=c"), kind == "execution"), (("y=a",), True),
        ):  # fmt: skip
            words = tuple(word for text in assumed for word in ("--assume", text))
            yield int(code or False), (certificate, str(path), *words)
            missing = kind == "knowledge" if code is None else code
            yield int(missing), (certificate, str(path), *words, "--kind", kind, "--json")
            yield 1, (certificate, str(path), *words, "--kind", other)
        yield 1, (certificate, str(path), "--box", "{}")
        yield 4, (certificate, str(path), "--epsilon", "0")
        yield 1, (certificate, *map(str, tools.NAVIGATION))


# -- files -------------------------------------------------------------------------------------------------------------


def of_bytes(place: Path) -> Iterator[tuple[Any, Words]]:
    """Certificates that are none: first lines of all kinds, and files that are cut off or something else."""
    honest = gzip.decompress((place / "plan.cert").read_bytes())
    rest = honest[honest.index(b"\n") + 1 :]
    ours = "robust/certificate/2"
    files = tuple(map(str, tools.NAVIGATION))
    firsts: list[Any] = [
        None, 1, "abc", True, [], {}, [ours], [ours, "plan"], [ours, "plan", None, None], ["plan", ours, None],
        ["robust/certificate/3", "plan", None], ["robust/certificate/1", "plan", None], [ours, "nothing", None],
        [ours, ["plan"], None], [ours, None, None], [ours, {}, None], [ours, "plan", []], [[ours], "plan", None],
        {"format": "robust/certificate/1"}, {"format": "robust/certificate/2"}, {"version": "robust/certificate/1"},
        {"format": "robust/certificate/1", "kind": "plan"}, ours, {"0": ours},
    ]  # fmt: skip
    contents = [json.dumps(first).encode() + b"\n" + rest for first in firsts]
    contents += [b"", b"\n", b"[\n", b"[" * 100_000 + b"\n", honest[:-1], honest + b"\n", honest + b"[]\n", rest]
    contents += [honest.replace(b"plan", "plän".encode(), 1)]
    for number, content in enumerate(contents):
        code = 2 if content.startswith(b"[") and b"\xc3" in content[:60] else 1
        yield code, (_kept(place / f"first-{number}.cert", gzip.compress(content, mtime=0)), *files)
    whole = gzip.compress(honest, mtime=0)
    damaged = bytearray(whole)
    damaged[len(whole) // 2 :] = bytes(255 - each for each in whole[len(whole) // 2 :])
    for number, content in enumerate((honest, whole[: len(whole) // 2], bytes(damaged), b"", b"\x1f\x8b")):
        words = (_kept(place / f"other-{number}.cert", content), *files)
        yield 1 if not content else 2, words
    yield 2, (str(place), *files)


def _kept(path: Path, content: bytes) -> str:
    path.write_bytes(content)
    return str(path)


def of_texts(place: Path) -> Iterator[tuple[Any, Words]]:
    """The same plan in files with other ends of lines, with a mark at the start, or that are no texts."""
    texts = [path.read_bytes() for path in tools.NAVIGATION]
    for number, (code, change) in enumerate((
        (0, lambda text: text.replace(b"\n", b"\r\n")),
        (0, lambda text: text.replace(b"\n", b"\r")),
        (0, lambda text: b"\xef\xbb\xbf" + text),
        (4, lambda text: text + b"\0"),
        (2, lambda text: text + b"\xff"),
    )):  # fmt: skip
        there = folder_in(place, f"texts-{number}")
        for changed in ((0,), (1,), (2,), (0, 1, 2)):
            names = [
                _kept(there / f"{len(changed)}{changed[0]}-{path.name}", change(text) if index in changed else text)
                for index, (path, text) in enumerate(zip(tools.NAVIGATION, texts, strict=True))
            ]
            yield code, (str(place / "plan.cert"), *names, "--json")
    texts_beside, beside = forgeries.BESIDE
    paths = tools.written(texts_beside, folder_in(place, "beside"))
    for code, text in ((1, beside), (4, "[parameters.y]\n"), (2, "= \n"), (4, "[parameter.k]\n")):
        paths[2].with_suffix(".toml").write_text(text, encoding="utf-8")
        yield code, (str(place / "plan.cert"), *map(str, paths), "--json")


# -- what no file brings about -----------------------------------------------------------------------------------------

MALFORMED = (ZeroDivisionError, AttributeError, KeyError, RecursionError, TypeError, ValueError)


def reports_errors(by: Checker) -> bool:
    """Whatever goes wrong, nothing is established; the exit code and the verdict say what it was."""
    wanted = [(error("text"), 1, "rejected", f"malformed ({error.__name__})") for error in MALFORMED]
    for error, code, verdict in (
        (by.proofs.Rejected, 1, "rejected"), (by.reader.Unsupported, 4, "unsupported"), (OSError, 2, "unreadable"),
        (EOFError, 2, "unreadable"), (zlib.error, 2, "unreadable"), (UnicodeError, 2, "unreadable"),
    ):  # fmt: skip
        wanted.append((error("text"), code, verdict, "text"))
    wanted.append((MemoryError(), 3, "unknown", "out of memory"))
    for error, code, verdict, reason in wanted:

        def checked(*_: object, error: Exception = error) -> None:
            raise error

        with patch.object(by.main, "checked", checked):
            arguments = Namespace(certificate="", files=[], epsilon="1")
            if by.main.report(arguments, None) != (code, {"verdict": verdict, "reason": reason}):
                return False
    return True


class Long(bytes):
    """A line that is as long as it says."""

    size: int

    def __len__(self) -> int:
        return self.size


def keeps_limits(by: Checker) -> bool:
    """What a certificate may be when it is unpacked depends on its size; time and memory on the sizes of all files."""
    most = (1 << 20) + 32 * Path().stat().st_size
    for sizes, fits in (([most - 1], True), ([most], False), ([1, most - 2], True), ([2, most - 2], False)):
        lines = []
        for size in sizes:
            lines.append(Long(b"[]\n"))
            lines[-1].size = size
        asked = list[int]()
        source = iter([*lines, b""])

        def readline(limit: int, asked: list[int] = asked, source: Iterator[bytes] = source) -> bytes:
            asked.append(limit)
            return next(source)

        file = io.BytesIO()
        with patch.object(by.main, "gzip", SimpleNamespace(open=lambda _, file=file: file)):
            file.readline = readline  # type: ignore[method-assign, assignment]
            try:
                found = len(list(by.main.lines_of(Path()))) == len(sizes)
            except by.proofs.Rejected:
                found = False
        if found != fits or asked[0] != most or max(asked) != most:
            return False
    return all(limits_of(by, *each) == most for each, most in SIZES.items())


def limits_of(by: Checker, size: int, seconds: int | None) -> tuple[int, ...]:
    found = {}
    usage = SimpleNamespace(
        RLIMIT_AS="memory", RLIMIT_CPU="time", RLIM_INFINITY=-1, getrlimit=lambda _: (0, -1), setrlimit=found.setdefault
    )
    path = SimpleNamespace(is_file=lambda: True, stat=lambda: SimpleNamespace(st_size=size))
    with (
        patch.object(by.main, "resource", usage),
        patch.object(by.main, "signal", SimpleNamespace(SIGXCPU=0, signal=lambda *_: None)),
        patch.object(by.main, "sys", SimpleNamespace(setrecursionlimit=lambda _: None)),
        patch.object(by.main, "Path", lambda _: path),
    ):
        by.main.limit(Namespace(certificate="", files=["", ""], seconds=seconds))
    return found["time"][0], found["memory"][0]


SIZES = {
    (40_000, None): (4, 280 << 20),
    (40_001, 7): (7, (280 << 20) + 12_000),
    (50_000, None): (7, (280 << 20) + 120_000_000),
}
"""Bytes of each of three files and what is asked for, and the seconds and bytes that the checker takes at most."""


def starts(by: Checker) -> bool:
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
        except SystemExit as ended:
            return ended.code == 2
    return False
