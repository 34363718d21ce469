"""Temporary folders are found by their names, and files are written completely or not at all."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from baker.core.errors import ResourceError
from baker.io.temporary import (
    TemporaryFolder,
    atomic_path,
    claim,
    temporaries,
    temporary_path,
    write_atomically,
)


def test_temporary_folders_are_found_by_their_names(tmp_path: Path) -> None:
    out = tmp_path / "a[b].c"
    out.mkdir()
    beside, inside = temporary_path(out), temporary_path(out, inside=True)
    assert beside != temporary_path(out), "names are random"
    assert (beside.parent, inside.parent) == (tmp_path, out)
    assert temporaries(out) == []
    for path in (beside, inside, tmp_path / ".other.baker-1-0a", out / ".baker-1-no"):
        path.mkdir()
    beside.with_name(".a[b].c.baker-1-0b").symlink_to(tmp_path)
    found = temporaries(out)
    assert [left.path for left in found] == [beside, inside]
    assert {left.process for left in found} == {os.getpid()}


def test_no_temporary_folders_where_nothing_is(tmp_path: Path) -> None:
    assert temporaries(tmp_path / "no" / "out") == []
    (tmp_path / "file").write_bytes(b"")
    assert temporaries(tmp_path / "file") == []


def test_the_lock_decides_whether_a_writer_lives(tmp_path: Path) -> None:
    """A folder without a lock is abandoned, even if its name contains the id of a running process."""
    out = tmp_path / "out"
    written = TemporaryFolder(out)
    written.create()
    abandoned = tmp_path / f".out.baker-{os.getpid()}-00"
    abandoned.mkdir()
    reused = tmp_path / ".out.baker-999999999-01"
    written.path.rename(reused)
    free = {}
    for found in temporaries(out):
        with claim(found) as ended:
            free[found.path] = ended
    assert free == {abandoned: True, reused: False}
    written.leave()
    with claim(temporaries(out)[1]) as ended:
        assert ended


def test_what_a_killed_process_left_of_a_file_is_removed(tmp_path: Path) -> None:
    (tmp_path / ".a.png.baker-1-0a").mkdir()
    (tmp_path / ".a.png.baker-1-0a" / "a.png").write_bytes(b"half")
    writing = TemporaryFolder(tmp_path / "a.png")
    writing.create()
    write_atomically(tmp_path / "a.png", b"whole", "picture")
    assert sorted(entry.name for entry in tmp_path.iterdir()) == [writing.path.name, "a.png"]
    writing.remove()


def write_half(path: Path, error: BaseException) -> None:
    with atomic_path(path, "picture") as temporary:
        assert temporary.suffix == ".png"
        temporary.write_bytes(b"half")
        raise error


def test_a_file_is_whole_or_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "new" / "picture.png"
    write_atomically(path, b"first", "picture")
    for error in (KeyboardInterrupt(), ValueError(), ResourceError("the disk is full", file="temporary")):
        with pytest.raises(type(error)) as caught:
            write_half(path, error)
        assert path.read_bytes() == b"first"
    assert isinstance(caught.value, ResourceError)
    assert caught.value.message == "the disk is full"
    assert caught.value.file == str(path)
    write_atomically(path, b"second", "picture")
    assert path.read_bytes() == b"second"
    assert [entry.name for entry in path.parent.iterdir()] == ["picture.png"]


def test_a_link_is_written_through(tmp_path: Path) -> None:
    (tmp_path / "real.xml").write_bytes(b"old")
    (tmp_path / "link").symlink_to(tmp_path / "real.xml")
    write_atomically(tmp_path / "link", b"new", "report")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real.xml").read_bytes() == b"new"


def test_what_cannot_be_written_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(ResourceError, match="the report cannot be written") as caught:
        write_atomically(tmp_path / "file" / "r.xml", b"1", "report")
    assert caught.value.file == str(tmp_path / "file" / "r.xml")


@pytest.mark.skipif(os.name != "posix", reason="a device that is a path")
def test_a_device_is_written_to_not_replaced() -> None:
    write_atomically(Path(os.devnull), b"report", "report")
    assert Path(os.devnull).is_char_device()
