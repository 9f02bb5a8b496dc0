"""Files that cannot be read are errors that name the file."""

import os
import re
from pathlib import Path

import pytest

from robust.errors import InputError
from robust.plan.pddl.forms import read_text


def test_text_is_normalised(tmp_path: Path) -> None:
    path = tmp_path / "text"
    path.write_bytes("\ufeffa\r\nb\rc\né".encode())
    assert read_text(path) == read_text(str(path)) == "a\nb\nc\né"


def test_missing_file_suggests_a_similar_one(tmp_path: Path) -> None:
    (tmp_path / "domain.pddl").touch()
    with pytest.raises(InputError, match=r"domian\.pddl: found no such file.*did you mean 'domain\.pddl'\?"):
        read_text(tmp_path / "domian.pddl")
    with pytest.raises(InputError, match=r"found no such file, expected a readable text file$"):
        read_text(tmp_path / "zzz")
    with pytest.raises(InputError, match=r"the directory .*nowhere does not exist either"):
        read_text(tmp_path / "nowhere" / "zzz")


def test_directory(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=f"{re.escape(str(tmp_path))}: found a directory"):
        read_text(tmp_path)


@pytest.mark.parametrize(("data", "found"), [(b"a\0b", "binary data"), (b"a\nb\xff", "byte 0xff in line 2")])
def test_binary(tmp_path: Path, data: bytes, found: str) -> None:
    path = tmp_path / "binary"
    path.write_bytes(data)
    with pytest.raises(InputError, match=f"binary: found {found}, expected a UTF-8 text file"):
        read_text(path)


def test_no_permission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "secret"
    path.touch()

    def refuse(self: Path) -> bytes:  # the superuser may read everything
        raise PermissionError(13, os.strerror(13))

    monkeypatch.setattr(Path, "read_bytes", refuse)
    with pytest.raises(InputError, match="secret: found a file that you may not read"):
        read_text(path)


@pytest.mark.parametrize("name", ["x" * 5000, "a\0b", "file/inside"])
def test_impossible_names(tmp_path: Path, name: str) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="expected a readable text file"):
        read_text(tmp_path / name)
