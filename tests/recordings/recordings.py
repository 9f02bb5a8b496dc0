"""What every command says, recorded, so that it can be compared after a change of the code behind it.

A recording is a text file that is named after its case: command lines (`$ robust ...`, with `< FILE` for what is on
stdin), their exit codes, what they print on stdout and stderr, and the files they make. For a new case, write a file of
command lines into `data` and record it. `record DIR` runs the cases of `data` and writes what they come to into DIR.
`compare DIR` runs them again, prints a unified diff for each that differs, and ends with 1 if there is one.
`--only PATTERN` (a shell pattern, or a part of the name) selects cases. `--command` names the command line to run
instead of `robust` of this interpreter; with `PYTHONPATH`, that of another checkout:

    PYTHONPATH=../main python -m tests.recordings.recordings compare tests/recordings/data --command 'python -m robust'

There is one recording for each shape of an answer: a command, as text or JSON, and a kind of ending. That answers are
right is tested by oracles, and that back ends, solvers and encodings agree by tests that cross them.

Each case runs in a new directory with `examples` and `domains` (links to robust/examples and benchmarks/domains of
`--checkout`) and `inputs` (a copy of the directory beside this file), and with what `changes.toml` says of it.

Numbers of checks, queries, boxes and polyhedra, and the order in which parts of a region are found, follow from the
models that a solver happens to find. They are the same in each process, but a change of the order in which formulas are
made changes them, and so do commands that ran before in the same process. `compare --loose` lets these differ. Where
even the answer differs from run to run, there is no case. What help says of options is compared with the manual
instead, see `tests/test_documentation.py`.

What varies from run to run is masked by `#`:

- in JSON, numbers below keys that measure: `seconds`, `..._s`, `..._mb`, `bytes`, `stages`, ... (see `MEASURED`). null
  stays null, so whether there is a measurement is compared. JSON is laid out anew: what fits stands on one line;
- in text, numbers with a unit that measures: `0.12 s`, `3 ms`, `88 MiB`, `2017 bytes`, with the blanks before them;
- in cases of `MASKED` (tables of measurements, logs), all numbers of the text, and what lays out tables; the numbers
  that do not vary are in the JSON of the same command;
- the working directory, the checkout, and the version of the program.

Of drawings, certificates, HTML and SMT-LIB, only that they are made and of what kind is compared, of other files the
content.
"""

# ruff: noqa: T201 - a command that prints

import argparse
import difflib
import fnmatch
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import chdir
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

HERE = Path(__file__).resolve().parent
INPUTS, DATA, CHECKOUT = HERE / "inputs", HERE / "data", HERE.parents[1]
CHANGES = tomllib.loads((HERE / "changes.toml").read_text(encoding="utf-8"))
"""Of which files some recordings are: a folder, and what is changed in it."""
COLUMNS = 100
LIMIT = 900.0
"""Seconds after which a command is killed; no case comes near."""
SLOW = re.compile(
    r"bench|batch|compare-(?!flexible)|certify-(json|box-file|alethe$)|execute-planners|pike-check-cross"
    r"|pike-run-(disturb-explained|fails|patience-margin|windows-explain)"
)
"""Names of cases, from the beginning, that take more than about 1.5 s."""
MASKED = re.compile(r"(bench|batch)-.*-text|(check|envelope)-verbose")
"""Names of cases in which all numbers of text are masked."""


@dataclass(frozen=True)
class Case:
    """Command lines that run one after the other in one directory, and what is compared of them."""

    name: str
    lines: tuple[str, ...]

    @property
    def needs_process(self):
        """Whether what it says depends on the process: on how long a start takes, on the memory of cvc5."""
        # What is wrong ends before anything is computed, but some commands change the process.
        words = ("bench", "batch") if self.name.startswith("bad-") else ("--timeout", "cvc5", "bench", "batch")
        return self.name != "help" and any(word in line for line in self.lines for word in words)


_LINE = re.compile(r"^\$ robust ?(.*)\n(?=exit |killed |\$ robust |\Z)", re.MULTILINE)
"""A command line that is run, not one that is printed."""


def cases():
    """What is recorded, by name."""
    recordings = ((path.stem, path.read_text(encoding="utf-8")) for path in sorted(DATA.glob("*.txt")))
    return [Case(name, tuple(_LINE.findall(text))) for name, text in recordings]


def _changed(folder, changes, unreadable=False):
    """A directory for each change of the files in a folder; if asked also for each file as no text and as no byte."""
    right = {path.name: path.read_bytes() for path in (CHECKOUT / folder).iterdir() if path.is_file()}
    made = {}
    for name, words in changes.items():
        made[name] = dict(right)
        for file, old, new in zip(words[::3], words[1::3], words[2::3], strict=True):
            text = made[name].get(file, b"").decode()
            assert old in text, name
            made[name][file] = (text.replace(old, new, 1) if old else new).encode()
    for file in right if unreadable else ():
        stem = Path(file).stem
        made |= {f"{stem} binary": {**right, file: bytes(range(256)) * 8}, f"{stem} empty": {**right, file: b""}}
    slugs = {name: re.sub(r"[^a-z0-9]+", "-", name.lower()) for name in made}
    return {f"{slugs[name]}/{file}": text for name, files in made.items() for file, text in files.items()}


Ended = tuple[int, str, str]
Runner = Callable[[Sequence[str], Path, bytes], Ended]
"""Runs words in a directory, with something on stdin: the exit code, and what was printed on stdout and stderr."""


def processes(command):
    """Each command line as a process of its own."""

    def run(words, directory, given):
        options = {"cwd": directory, "env": _environment(), "timeout": LIMIT}
        done = subprocess.run([*command, *words], input=given, capture_output=True, check=False, **options)
        out, err = (stream.decode("utf-8", errors="backslashreplace") for stream in (done.stdout, done.stderr))
        return done.returncode, out, err

    return run


def in_process(words, directory, given):
    """In this process and its main thread, without the seconds that a start takes."""
    from tests.cli.running import command  # noqa: PLC0415 - which imports the package, that of this checkout

    with tempfile.TemporaryFile("w+", encoding="utf-8", newline="") as stdin:
        stdin.buffer.write(given)
        stdin.seek(0)
        variables, reading = patch.dict(os.environ, _environment(), clear=True), patch.object(sys, "stdin", stdin)
        with chdir(directory), variables, reading:
            ended = command(*words)
    return ended.code, ended.out, ended.err


@dataclass(frozen=True)
class Place:
    """Where the files of cases come from, and what runs them."""

    checkout: Path
    run: Runner

    def prepare(self, case, directory):
        """Put into an empty directory what a case reads."""
        shutil.copytree(INPUTS, directory / "inputs")
        (directory / "examples").symlink_to(self.checkout / "robust" / "examples")
        (directory / "domains").symlink_to(self.checkout / "benchmarks" / "domains")
        for name, content in _changed(**CHANGES[case.name]).items() if case.name in CHANGES else ():
            (directory / name).parent.mkdir(exist_ok=True)
            (directory / name).write_bytes(content)

    def recorded(self, case):
        """Run a case; everything that is compared of it."""
        with tempfile.TemporaryDirectory(prefix="recording-") as name:
            directory = Path(name).resolve()
            self.prepare(case, directory)
            before = {path: path.read_bytes() for path in _files(directory)}
            parts = [part for line in case.lines for part in self._ran(line, directory, case)]
            after = [path for path in _files(directory) if before.get(path) != path.read_bytes()]
            made = [f"{path.relative_to(directory)}:{_kept(path)}" for path in after]
            parts += ["-- files", *(self._unplaced(text, directory) for text in made)] if made else []
        return "\n".join(parts) + "\n"

    def _ran(self, line, directory, case):
        command, _, source = line.partition(" < ")
        words = [word.replace("@work@", str(directory)) for word in shlex.split(command)]
        given = (directory / source.strip()).read_bytes() if source else b""
        yield f"$ robust {' '.join(line.split())}"
        try:
            code, *streams = self.run(words, directory, given)
        except subprocess.TimeoutExpired:
            yield f"killed after {LIMIT:g} s"
            return
        yield f"exit {code}"
        for name, stream in zip(("stdout", "stderr"), streams, strict=True):
            if stream:
                kind, text = _masked(stream, MASKED.match(case.name) is not None)
                yield f"-- {name}{kind}"
                yield self._unplaced(text, directory).rstrip("\n")

    def _unplaced(self, text, directory):
        text = text.replace(str(directory), "@work@").replace(str(self.checkout), "@checkout@")
        return re.sub(r"/\S*(?=/robust/examples\b)", "@checkout@", text)


def _environment():
    """Of commands: a terminal of fixed width without colours; nothing about hashes."""
    dropped = {"PYTHONHASHSEED", "NO_COLOR", "FORCE_COLOR", "TERM", "COLORTERM"}
    kept = {name: value for name, value in os.environ.items() if name not in dropped}
    return {**kept, "COLUMNS": str(COLUMNS), "LINES": "40", "LC_ALL": "C.UTF-8", "TERM": "dumb", "MPLBACKEND": "agg"}


def _files(directory):
    """The files below a directory, but not below links."""
    return sorted(
        Path(top) / name for top, _, names in os.walk(directory) for name in names if not name.endswith(".pyc")
    )


_KINDS = {b"<?xml": "svg", b"\x89PNG": "png", b"%PDF": "pdf", b"<!DOC": "html", b"\x1f\x8b": "gzip"}
_NAMED = {".smt2", ".alethe", ".store"}


def _kept(path):
    """What is compared of a file that a command made."""
    content = path.read_bytes()
    for head, kind in _KINDS.items():
        if content.startswith(head):
            return f" {kind}"
    if path.suffix in _NAMED or b"\0" in content:
        return " something" if content else " empty"
    return "\n" + _masked(content.decode("utf-8"), everything=False)[1].rstrip("\n")


MEASURED = re.compile(
    r"^(?!(baseline_)?limit)(.*_)?"
    r"(seconds|s|ms|mb|bytes|stages|memory|latency|latencies|with_computing|with_free_recovery)$"
)
"""Keys of JSON below which numbers are measured."""
_UNIT = re.compile(r" *(?<![\w.])\d[\d,]*(?:\.\d+)?(?:e-?\d+)? (s|ms|MiB|MB|bytes)\b")
_VERSION = re.compile(r"\brobust \d+\.\d+\S*")
_LAYOUT = re.compile(r"[┏┓┗┛┡┩┠┨┳┻╇┷┴┬┼├┤└┘┌┐━─╸╺]+")
_NUMBER = re.compile(r"(?<![A-Za-z_])[+-]?\d[\d,]*(\.\d+)?(e[+-]?\d+)?")


def _masked(text, everything):
    """Of what a command printed: a word about its layout, and it without what varies."""
    try:
        value = json.loads(text)
    except ValueError:
        return "", _masked_text(text, everything)
    if not isinstance(value, dict | list):
        return "", _masked_text(text, everything)
    layouts = ((None, " (one line)"), (2, " (indented)"))
    written = {json.dumps(value, ensure_ascii=False, indent=indent) + "\n": layout for indent, layout in layouts}
    return written.get(text, " (JSON)"), _folded(_masked_value(value, measured=False))


def _masked_text(text, everything):
    text = _VERSION.sub("robust #", text)
    text = _UNIT.sub(r" # \1", text)
    if everything:
        text = _LAYOUT.sub("─", _NUMBER.sub("#", text))
        text = re.sub(r"[ \t]+", " ", text)
    return "\n".join(line.rstrip() for line in text.splitlines())


def _masked_value(value, *, measured):
    match value:
        case dict():
            below = {key: measured or MEASURED.search(key) is not None for key in value}
            return {key: _masked_value(item, measured=below[key]) for key, item in value.items()}
        case list():
            return [_masked_value(item, measured=measured) for item in value]
        case bool():
            return value
        case int() | float():
            return "#" if measured else value
        case _:
            return _UNIT.sub(r" # \1", value) if isinstance(value, str) else value


def _folded(value, depth=0):
    """JSON in which what fits stands on one line."""
    line = json.dumps(value, ensure_ascii=False)
    if not isinstance(value, dict | list) or len(line) + depth <= 110:
        return line
    deeper = depth + 1
    if isinstance(value, dict):
        items = [f"{json.dumps(key)}: {_folded(item, deeper)}" for key, item in value.items()]
    else:
        items = [_folded(item, deeper) for item in value]
    inner = ",\n".join(f"{' ' * deeper}{item}" for item in items)
    return f"{line[0]}\n{inner}\n{' ' * depth}{line[-1]}"


def difference(case, place, data, *, loose=False):
    """A unified diff of what is recorded and what a case comes to now; empty if nothing differs."""
    path = data / f"{case.name}.txt"
    old = path.read_text(encoding="utf-8") if path.exists() else ""
    new = place.recorded(case)
    if loose and _loosened(old) == _loosened(new):
        return ""
    names = (f"recorded/{path.name}", f"now/{path.name}")
    return "\n".join(difflib.unified_diff(old.splitlines(), new.splitlines(), *names, lineterm=""))


_EFFORT = re.compile(
    r'(?<="checks": )\d+|(?<="pieces": )\d+|(?<="queries": )\d+|(?<="satisfiable": )\d+|(?<="unsatisfiable": )\d+'
    r'|(?<="boxes": )\d+|(?<="unknown": )\d+|(?<="nodes": )\d+|\b\d+(?= checks\b| polyhedra of bad values)'
)
_STEP = re.compile(r'\{"check": .*|"convergence": .*|queries/\d+-.*|[][{}]*')


def _loosened(text):
    """Without what depends on which models a solver happens to find: counts of its work, and the order of lines."""
    answers = re.split(r"^(?=\$ robust)", text, flags=re.MULTILINE)
    lines = [[_EFFORT.sub("#", line).strip().rstrip(",") for line in answer.splitlines()] for answer in answers]
    return [sorted(line for line in answer if not _STEP.fullmatch(line)) for answer in lines]


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("action", choices=["record", "compare"])
    parser.add_argument("directory", nargs="?", type=Path, default=DATA)
    parser.add_argument("--only", metavar="PATTERN", default="", help="a shell pattern for names, or a part of them")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="commands at a time")
    parser.add_argument("--command", default=f"{sys.executable} -m robust", help="default: robust of this interpreter")
    parser.add_argument("--loose", action="store_true", help="whatever the order of lines and the work of solvers")
    parser.add_argument("--checkout", type=Path, default=CHECKOUT, metavar="DIR", help="where examples are found")
    options = parser.parse_args(arguments)
    place = Place(options.checkout.resolve(), processes(shlex.split(options.command)))
    chosen = [case for case in cases() if options.only in case.name or fnmatch.fnmatch(case.name, options.only)]
    options.directory.mkdir(parents=True, exist_ok=True)
    started = time.monotonic()

    def work(case):
        if options.action == "compare":
            return difference(case, place, options.directory, loose=options.loose)
        (options.directory / f"{case.name}.txt").write_text(place.recorded(case), encoding="utf-8")
        return ""

    differing = []
    with ThreadPoolExecutor(options.jobs) as pool:
        for case, text in zip(chosen, pool.map(work, chosen), strict=True):
            if text:
                differing.append(case.name)
                print(text, flush=True)
    summary = f"{len(chosen)} cases in {time.monotonic() - started:.0f} s, {len(differing)} differ"
    print(summary, *differing, file=sys.stderr)
    return 1 if differing else 0


if __name__ == "__main__":
    raise SystemExit(main())
