"""Output files: whole or as they were."""

import os
import stat

import pytest

from robust.errors import InputError, Location
from robust.files import atomic_write

PLACE = Location("--output")


def test_writes_texts_bytes_and_what_functions_write(tmp_path):
    path = tmp_path / "file.txt"
    for content in ("γ", "γ".encode(), lambda beside: beside.write_text("γ", encoding="utf-8")):
        atomic_write(path, content, PLACE)
        assert path.read_text(encoding="utf-8") == "γ"
    assert list(tmp_path.iterdir()) == [path]


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
    atomic_write("/dev/null", "nothing", PLACE)


def test_without_a_place_errors_name_the_file(tmp_path):
    with pytest.raises(OSError, match=r"plan\.cert") as raised:
        atomic_write(tmp_path / "none" / "plan.cert", b"", None)
    assert raised.value.filename == str(tmp_path / "none" / "plan.cert")
