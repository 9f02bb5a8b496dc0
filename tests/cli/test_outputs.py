"""No file that cannot be written costs an answer, and none that is too large is read; others are recorded."""

import json
import os
import resource
from pathlib import Path

import pytest

from robust.errors import InputError
from robust.records import RecordFile
from robust.sweeps.sweep import SCHEMA
from tests.cli import inputs
from tests.cli.running import EXAMPLES, NAVIGATION, answer_of, assert_one_line, command, example

KITCHEN = EXAMPLES / "kitchen" / "kitchen.tpnu.json"
DELIVERY = example(directory=EXAMPLES / "delivery")
STEPS = example("steps.plan", EXAMPLES / "delivery")
PARAMETERS = ("--parameter", "coffee=duration:make-coffee", "--parameter", "limit=at-most:e1:e44")
SMALL, OFF = ([f"{folder}/{file}" for file in inputs.RIGHT] for folder in ("small", "off"))
"""A small plan, and one with a wrong duration; `small` is also a folder of plans."""
LATE = inputs.INPUTS / "networks" / "late.json"

OUTPUTS = {
    "check --smt2": ("check", *example(), "--smt2", ""),
    "envelope --smt2": ("envelope", *example(), "--smt2", ""),
    "envelope -o": ("envelope", *SMALL, "--export", "csv", "-o", ".csv"),
    "envelope --plot": ("envelope", *SMALL, "--plot", ".svg"),
    "region --plot": ("region", *SMALL, "--plot", ".svg"),
    "compare --plot": ("compare", *SMALL, "--plot", ".svg"),
    "compare --html": ("compare", *SMALL, "--html", ".html"),
    "risk --plot": ("risk", *SMALL, "--distribution", "leave=uniform:0:9", "--plot", ".svg"),
    "repair -o": ("repair", *OFF, "-o", ".stn"),
    "batch --csv": ("batch", "check", "small", "--csv", ".csv"),
    "batch --html": ("batch", "check", "small", "--html", ".html"),
    "certify -o": ("certify", *SMALL, "-o", ".cert"),
    "certify --alethe": ("certify", *example(), "-o", os.devnull, "--alethe", ""),
    "convert -o": ("convert", *STEPS, "-o", ".stn"),
    "convert --stnu": ("convert", *SMALL, "--stnu", ".json"),
    "convert --tree": ("convert", *SMALL, "--tree", ".xml"),
    "execute --plot": ("execute", *DELIVERY, "--plot", ".svg"),
    "learn -o": ("learn", "runs.csv", "-o", ".toml"),
    "stnu repair -o": ("stnu", "repair", LATE, "-o", ".json"),
    "pike plot -o": ("pike", "plot", KITCHEN, "-o", ".svg"),
    "pike run --plot": ("pike", "run", KITCHEN, "--plot", ".svg"),
    "pike region --plot": ("pike", "region", KITCHEN, *PARAMETERS, "--plot", ".svg"),
    "pike envelope --plot": ("pike", "envelope", KITCHEN, *PARAMETERS, "--plot", ".svg"),
}
"""Commands whose last word is the suffix of what they write; none is a folder."""
FOLDERS = [name for name, words in OUTPUTS.items() if not words[-1]]
FILES = [name for name in OUTPUTS if name not in FOLDERS]


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A directory with inputs, which is the working directory."""
    monkeypatch.chdir(tmp_path)
    for name, plan in (("small", inputs.PLAN), ("off", inputs.PLAN.replace("[5, 5]", "[5, 6]"))):
        Path(name).mkdir()
        inputs.write(Path(name), plan=plan)
    Path("runs.csv").write_text("action,duration\nleave,5\n", encoding="utf-8")
    return tmp_path


def full(name):
    """A command line whose output is a file that is there and takes nothing, and that file."""
    *words, suffix = OUTPUTS[name]
    os.symlink("/dev/full", f"full{suffix}")
    return [*words, f"full{suffix}"], f"full{suffix}"


@pytest.mark.parametrize("name", FILES)
def test_an_answer_is_not_lost_with_a_file(here, name):
    words, target = full(name)
    ended = command(*words, "--json")
    assert ended.code == 2
    assert "error" not in answer_of(ended)
    assert f"cannot write '{target}': no space left on device" in ended.err
    assert ended.err.count("robust: error: ") == 1


@pytest.mark.parametrize("name", FOLDERS)
def test_an_answer_is_not_lost_with_files_in_a_folder(here, name, monkeypatch):
    original = Path.write_text

    def write_text(path, *what, **how):
        if path.parent.name == "queries":
            raise OSError(28, "No space left on device")
        return original(path, *what, **how)

    monkeypatch.setattr(Path, "write_text", write_text)
    ended = command(*OUTPUTS[name][:-1], "queries", "--json", *(["--quiet"] if name == FOLDERS[0] else []))
    assert ended.code == 2
    assert "error" not in answer_of(ended)
    assert "queries: cannot write " in ended.err
    assert ended.err.count("no space left on device\n") == 1


@pytest.mark.parametrize("name", ["repair -o", "stnu repair -o", "convert -o", "batch --csv"])
def test_people_see_the_answer_first(here, name):
    ended = command(*full(name)[0])
    assert (ended.code, ended.out != "") == (2, True)
    assert ended.err.endswith("no space left on device\n")
    assert name != "convert -o" or "durative-action instance" in ended.out  # what else would be lost


@pytest.mark.parametrize("name", OUTPUTS)
def test_what_can_be_known_is_known_before_anything_is_computed(here, name):
    """No such folder, and a folder in place of a file, or a file in that of a folder."""
    *words, suffix = OUTPUTS[name]
    Path(f"folder{suffix}").mkdir()
    Path("file").touch()
    for target in (f"nowhere/a{suffix}", f"folder{suffix}") if suffix else ("file", "file/folder"):
        assert_one_line(command(*words, target), 2, Path(target).parts[0])


@pytest.mark.parametrize("name", [name for name in FILES if "plot" not in name and "html" not in name])
def test_no_file_is_called_like_standard_output_by_mistake_or_takes_the_place_of_what_is_read(here, name):
    words = OUTPUTS[name][:-1]
    read = next(word for word in map(str, words[1:]) if Path(word).is_file() or Path(word).is_dir())
    before = Path(read).read_bytes() if Path(read).is_file() else None
    for target in ("-", read):
        assert_one_line(command(*words, target), 2, target)
    assert not Path("-").exists()
    assert before is None or Path(read).read_bytes() == before


def test_the_other_files_are_written_and_answers_of_a_batch_outlive_their_store(here, monkeypatch):
    words, _ = full("batch --csv")
    assert command(*words, "--html", "page.html").code == 2
    assert Path("page.html").read_text(encoding="utf-8").startswith("<!DOCTYPE")
    words, _ = full("envelope --plot")
    assert command(*words, "-o", "box.csv", "--export", "csv").code == 2
    assert Path("box.csv").read_text(encoding="utf-8").startswith("name,")
    original, count = RecordFile.append, iter(range(9))

    def append(self, record):
        if next(count) > 0:
            raise InputError("cannot be written: No space left on device")
        original(self, record)

    monkeypatch.setattr(RecordFile, "append", append)
    ended = command("batch", "check", "small", "--store", "night.store", "--json")
    assert (ended.code, ended.err) == (2, "robust: error: cannot be written: No space left on device\n")
    assert "proved" in json.dumps(answer_of(ended)["plans"])
    for device in ("/dev/zero", "/dev/full"):  # a store is no device, which may have no end
        ended = command("batch", "check", "small", "--store", device)
        assert_one_line(ended, 2, SCHEMA)
        assert ended.err.startswith(f"robust: error: {device}: found no regular file, expected a ")


READERS = {
    "domain": ["check", "FILE", *example()[1:]],
    "problem": ["check", example()[0], "FILE", example()[2]],
    "plan": ["check", *example()[:2], "FILE"],
    "log": ["convert", *example()[:2], "FILE"],
    "schedule": ["validate", *example()[:2], "FILE"],
    "parameters": ["envelope", *example(), "--parameters", "FILE"],
    "box": ["certify", *example(), "-o", os.devnull, "--kind", "box", "--box", "FILE"],
    "world": ["execute", *example(), "--world", "FILE"],
    "choices": ["pike", "check", "FILE"],
    "network": ["stnu", "check", "FILE"],
    "certificate": ["verify", "FILE", *example()],
    "suite": ["batch", "check", "FILE"],
}


@pytest.mark.parametrize("name", READERS)
def test_files_that_are_too_large_or_have_no_end_are_refused(tmp_path, name):
    large = tmp_path / "large"
    with large.open("wb") as file:
        file.truncate(100 * 2**20)  # in one line, without taking place on the disk
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for path in (large, "/dev/zero") if name != "certificate" else ("/dev/zero",):
        ended = command(*[path if word == "FILE" else word for word in READERS[name]])
        assert_one_line(ended, 2, f"{path}: found more than ")
        assert ended.err.endswith(" MB, expected a smaller file\n")
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200 * 2**10


def test_a_long_line_of_a_plan_is_refused_and_a_long_log_is_read(tmp_path):
    path = tmp_path / "plan"
    path.write_bytes(b"; planner\r" + b"x" * (2**20 + 1))
    assert_one_line(command("check", *example()[:2], path), 2, f"{path}:1: found a line of more than 1 MB")
    steps = (NAVIGATION / "steps.plan").read_bytes()
    path.write_bytes((b"; " + b"x" * 2**19 + b"\n") * 20 + steps)
    assert command("validate", *example()[:2], path, "--quiet").code == 0
    path.write_bytes(b"c: a\n" * 2**21)
    ended = command("check", *example()[:2], path.rename(tmp_path / "plan.stn"))
    assert ended.err.endswith("plan.stn: found more than 8 MB, expected a smaller file\n")
