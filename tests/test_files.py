"""Output files: whole or as they were; and files of records: what is read is what was written, whatever is cut off."""

import json
import os
import stat
from contextlib import nullcontext

import pytest

from robust.errors import InputError, Location
from robust.records import RecordFile, RecordFormat, atomic_write, read_records

PLACE = Location("--output")


def test_writes_texts_bytes_and_what_functions_write(tmp_path):
    path = tmp_path / "file.txt"
    for content in ("γ", "γ".encode(), lambda beside: beside.write_text("γ", encoding="utf-8")):
        atomic_write(path, content, PLACE)
        assert path.read_text(encoding="utf-8") == "γ"
    assert list(tmp_path.iterdir()) == [path]
    atomic_write("/dev/null", "nothing", PLACE)


def test_what_was_there_survives_failures(tmp_path):
    path = tmp_path / "box.svg"
    path.write_text("before")

    def half(beside):
        beside.write_text("half")
        assert beside.suffix == ".svg"
        raise OSError(28, "No space left on device")

    with pytest.raises(InputError, match=r"--output: cannot write '.*': no space left on device"):
        atomic_write(path, half, PLACE)
    with pytest.raises(KeyboardInterrupt):
        atomic_write(path, lambda _: (_ for _ in ()).throw(KeyboardInterrupt), PLACE)
    assert (path.read_text(), list(tmp_path.iterdir())) == ("before", [path])
    with pytest.raises(OSError, match=r"plan\.cert") as raised:  # without a place
        atomic_write(tmp_path / "none" / "plan.cert", b"", None)
    assert raised.value.filename == str(tmp_path / "none" / "plan.cert")


def test_modes_and_links_stay(tmp_path):
    path, link = tmp_path / "plan.stn", tmp_path / "link.stn"
    atomic_write(path, "new", PLACE)
    mask = os.umask(0)
    os.umask(mask)
    assert stat.S_IMODE(path.stat().st_mode) == 0o666 & ~mask
    path.chmod(0o600)
    link.symlink_to(path)
    atomic_write(link, "through", PLACE)
    assert (link.is_symlink(), path.read_text(), stat.S_IMODE(path.stat().st_mode)) == (True, "through", 0o600)


PLAIN = RecordFormat("store of results", {"schema": "robust/some-store/1", "robust": "1.0"})
CHAINED = RecordFormat("journal", {"schema": "robust/some-journal/1", "plan": "küche"}, chained=True)
RECORDS = ({"key": "a", "result": 1}, {"key": "ü", "result": [{"x": "1/3"}]}, {"n": None}, {"text": '\n"}'})
formats = pytest.mark.parametrize("form", [PLAIN, CHAINED], ids=["plain", "chained"])


class Kept(list):
    """The records of a file, which begins with the header that is expected."""

    def __init__(self, form):
        super().__init__()
        self.form = form

    def __call__(self, number, text):
        record = json.loads(text)
        if number == 1:
            assert not self
            if record != self.form.header:
                raise InputError(f"found header {text}, expected another")
        elif "bad" in record:
            raise InputError("found something bad, expected something good")
        else:
            assert len(self) == number - 2
            self.append(record)


def read(path, form):
    kept = Kept(form)
    read_records(path, form, kept)
    return kept


def written(path, form, records=RECORDS):
    with RecordFile(path, form, Kept(form)) as file:
        for record in records:
            file.append(record)
    return path.read_bytes()


@pytest.fixture
def path(tmp_path):
    return tmp_path / "records"


def test_lines_are_json_objects_with_or_without_a_checksum(path):
    header, first = written(path, PLAIN, RECORDS[:1]).splitlines()
    assert (json.loads(header), json.loads(first)) == (PLAIN.header, RECORDS[0])
    path.unlink()
    lines = [json.loads(line) for line in written(path, CHAINED, ({"x": 0}, {"x": 1}, {"x": 1})).splitlines()]
    checksums = [line.pop("checksum") for line in lines]
    assert lines == [CHAINED.header, {"x": 0}, {"x": 1}, {"x": 1}]
    assert len(set(checksums)) == 4
    assert {len(each) for each in checksums} == {16}


@formats
def test_what_is_read_is_what_was_written(path, form):
    content = written(path, form)
    assert read(path, form) == list(RECORDS)
    kept = Kept(form)
    with RecordFile(path, form, kept) as file:
        assert kept == list(RECORDS)
        file.append({"more": True})
    assert path.read_bytes().startswith(content)
    assert read(path, form) == [*RECORDS, {"more": True}]


@formats
def test_each_record_is_on_disk_when_append_returns(path, form, monkeypatch):
    synchronized = []
    original = os.fsync
    monkeypatch.setattr(os, "fsync", lambda file: (original(file), synchronized.append(os.fstat(file))))
    with RecordFile(path, form, Kept(form)) as file:
        header, directory = synchronized
        assert header.st_size == path.stat().st_size
        assert directory.st_ino == path.parent.stat().st_ino
        for number, record in enumerate(RECORDS, 1):
            file.append(record)
            assert len(synchronized) == 2 + number
            assert synchronized[-1].st_size == path.stat().st_size
            assert read(path, form) == list(RECORDS[:number])


@formats
def test_a_file_cut_off_at_any_byte(path, form, monkeypatch):
    monkeypatch.setattr(os, "fsync", lambda file: None)  # only what is in the file matters here
    content = written(path, form)
    header = content.index(b"\n") + 1
    for end in range(len(content)):
        path.write_bytes(content[:end])
        whole = list(RECORDS[: max(content[:end].count(b"\n") - 1, 0)])
        if end >= header:
            assert read(path, form) == whole
        kept = Kept(form)
        with RecordFile(path, form, kept) as file:
            assert kept == whole
            assert path.read_bytes() == content[: max(content[:end].rfind(b"\n") + 1, header)]
            for record in RECORDS[len(kept) :]:
                file.append(record)
        assert path.read_bytes() == content


def test_damage_and_lines_that_are_missing_or_twice_are_named(path):
    """Any one byte of a chained file that is another: nothing but an error with the line."""
    content = written(path, CHAINED)
    for at in range(len(content) - 1):
        damaged = bytearray(content)
        damaged[at] ^= 1
        path.write_bytes(damaged)
        with pytest.raises(InputError) as caught:
            RecordFile(path, CHAINED, Kept(CHAINED))
        line = content.count(b"\n", 0, at) + 1
        assert str(caught.value).startswith(f"{path}:{line}:"), at
        assert "\n" not in str(caught.value)
        assert path.read_bytes() == damaged
    first, second, third, fourth, *rest = content.splitlines(keepends=True)
    for lines in ((first, second, fourth), (first, second, third, third, fourth), (first, second, fourth, third)):
        path.write_bytes(b"".join([*lines, *rest]))
        with pytest.raises(InputError, match=r"found checksum .*, expected .*: the journal was changed here") as caught:
            RecordFile(path, CHAINED, Kept(CHAINED))
        assert caught.value.location.line in {3, 4}


HEADER = json.dumps(PLAIN.header).encode()


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"parameter a;", "1: found something else, expected a store of results (robust/some-store/1); choose a new"),
        (b"parameter a;\n", "1: found a line that is not JSON, expected a store of results"),
        (b"[" * 100_000 + b"\n", "1: found a line that is not JSON, expected a store of results"),
        (b"\xff\n", "1: found bytes that are no UTF-8, expected a JSON object"),
        (b"[]\n", "1: found no schema, expected a store of results"),
        (b'{"schema": "other"}\n', "1: found schema 'other', expected a store of results"),
        (b'{"schema": "robust/some-store/1", "robust": "0.9"}\n', "1: found header "),
        (HEADER + b'\n{}\n{"bad": 1}\n{"torn', "3: found something bad, expected something good"),
    ],
)
def test_other_files_are_left_alone(path, content, expected):
    path.write_bytes(content)
    for attempt in (lambda: RecordFile(path, PLAIN, Kept(PLAIN)), lambda: read(path, PLAIN)):
        with pytest.raises(InputError) as caught:
            attempt()
        assert str(caught.value).startswith(f"{path}:{expected}")
        assert path.read_bytes() == content


@formats
def test_a_file_in_use_or_nowhere_and_one_that_was_refused(path, form):
    with RecordFile(path, form, Kept(form)):
        with pytest.raises(InputError, match=f"found a {form.name} that another process writes, expected one that"):
            RecordFile(path, form, Kept(form))
        assert read(path, form) == []
    RecordFile(path, form, Kept(form)).close()
    with pytest.raises(InputError, match=f"nowhere/file: cannot open the {form.name}: no such file or directory"):
        RecordFile(path.parent / "nowhere" / "file", form, Kept(form))
    for content, refused in ((b"[]\n", True), (b"", False)):
        path.write_bytes(content)
        with pytest.raises(InputError, match="found no schema") if refused else nullcontext():
            RecordFile(path, form, Kept(form)).close()


@formats
def test_a_full_disk_leaves_the_file_as_it_was(path, form, monkeypatch):
    with RecordFile(path, form, Kept(form)) as file:
        before = path.read_bytes()
        original, left = os.write, [10]

        def write(descriptor, data):
            if not left[0]:
                raise OSError(28, "No space left on device")
            count = original(descriptor, data[: left[0]])
            left[0] -= count
            return count

        monkeypatch.setattr(os, "write", write)
        with pytest.raises(InputError, match="cannot be written: No space left on device"):
            file.append(RECORDS[0])
        assert path.read_bytes() == before
        left[0] = 10_000
        file.append(RECORDS[0])
        file.append(RECORDS[1])
    assert read(path, form) == list(RECORDS[:2])
