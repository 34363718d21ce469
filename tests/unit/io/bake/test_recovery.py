"""After a kill at any step of writing, the next command restores the complete old or complete new bake."""

from __future__ import annotations

import json
import os
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from baker.core.errors import InputError
from baker.io.bake import mounts, output_folder
from baker.io.bake.lock import held
from baker.io.bake.output_folder import OutputFolder, check_out, own_files
from baker.io.bake.read_manifest import read_manifest
from baker.io.bake.recovery import abandoned, recover
from baker.io.inspect import inspect_path
from baker.io.temporary import TemporaryFolder, temporaries

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="kills forked processes")

# Audit events that Python raises before a system call that changes a folder.
CHANGES = ("os.rename", "os.mkdir", "os.rmdir", "os.remove", "os.link", "os.chmod", "os.utime")
OURS = {"bake.json", "a.exr", "old.exr", "new.exr", "unity/a.txt", "godot/a.txt"}


def write(out: Path, word: str, names: tuple[str, ...]) -> None:
    """Write a bake of text files that contain `word`, in the same steps as `write_bake`."""
    check_out(out)
    with held(out), OutputFolder(out) as folder:
        for name in names:
            path = folder.path / name
            path.parent.mkdir(exist_ok=True)
            path.write_text(word)
        files = [{"file": name} for name in names]
        (folder.path / "bake.json").write_text(
            json.dumps({"word": word, "files": files, "versions": {"baker": "1"}})
        )
        folder.commit()


def write_old(out: Path) -> None:
    write(out, "old", ("a.exr", "old.exr", "unity/a.txt"))


def write_new(out: Path) -> None:
    write(out, "new", ("a.exr", "new.exr", "godot/a.txt"))


def tree(folder: Path) -> dict[str, str]:
    return {p.relative_to(folder).as_posix(): p.read_text() for p in folder.rglob("*") if p.is_file()}


def ends_by_kill(work: Callable[[], object], step: int) -> bool:
    """Run `work` in a forked process and kill it before its change number `step`, counted from 0.

    Return False if the process ended without being killed.
    """
    child = os.fork()
    if child:
        _, status = os.waitpid(child, 0)
        assert os.WIFSIGNALED(status) or status == 0
        return os.WIFSIGNALED(status)
    code = 1
    try:
        seen = 0

        def count(event: str, arguments: tuple[object, ...]) -> None:
            nonlocal seen
            if event in CHANGES or (event == "open" and arguments[1] not in (None, "r", "rb")):
                seen += 1
                if seen > step:
                    os.kill(os.getpid(), signal.SIGKILL)

        sys.addaudithook(count)
        work()
        code = 0
    finally:
        os._exit(code)


@pytest.fixture(params=["exchange", "no exchange", "current folder"])
def out(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Yield an output folder with an old bake and files of the user.

    The parameter selects how a new bake replaces the old one. Either the two folders are exchanged in one
    step, or the files are moved one by one. Files are moved one by one if the file system cannot exchange
    folders, or if the output folder is the working directory.
    """
    out = tmp_path / "parent" / "out"
    out.mkdir(parents=True)
    if request.param == "no exchange":
        monkeypatch.setattr(output_folder, "exchange_paths", lambda one, two: False)
    if request.param == "current folder":
        monkeypatch.chdir(out)
    write_old(out)
    (out / "unity" / "mine.txt").write_text("mine")
    (out / "notes.txt").write_text("mine")
    yield out
    assert (out / "unity" / "mine.txt").read_text() == "mine"
    assert (out / "notes.txt").read_text() == "mine"


def whole(out: Path) -> str:
    """Return "old" or "new", the bake in a folder. Fails if files are missing or both bakes are mixed."""
    own, files = own_files(out), tree(out)
    assert own is not None
    assert own == set(files) & OURS
    words = {files[name] for name in own - {"bake.json"}} | {json.loads(files["bake.json"])["word"]}
    assert len(words) == 1
    return words.pop()


def test_recovery_after_a_kill_at_any_step(out: Path) -> None:
    seen, step = [], 0
    while ends_by_kill(lambda: write_new(out), step):
        recover(out)
        seen.append(whole(out))
        assert [p.name for p in out.parent.iterdir()] == ["out"], "nothing temporary stays"
        assert sorted(p.name for p in out.iterdir() if ".baker" in p.name) == []
        write_old(out)
        step += 1
    assert seen == ["old"] * seen.count("old") + ["new"] * seen.count("new")
    assert seen.count("old") > 8
    assert seen.count("new") > 3, "while the old files are removed"


def test_a_recovery_that_is_killed_is_repeated(out: Path) -> None:
    recoveries, step = 0, 0
    while ends_by_kill(lambda: write_new(out), step):
        half = step % 3
        while ends_by_kill(lambda: recover(out), half):
            half += 3
            recoveries += 1
        whole(out)
        write_old(out)
        step += 4
    assert recoveries > 5


def test_the_next_bake_restores_the_folder_first(out: Path) -> None:
    step = 0
    while ends_by_kill(lambda: write_new(out), step):
        write_old(out)
        assert whole(out) == "old"
        assert [p.name for p in out.parent.iterdir()] == ["out"]
        step += 3


@pytest.mark.parametrize("read", [read_manifest, inspect_path, lambda out: inspect_path(out / "bake.json")])
def test_commands_that_only_read_restore_the_folder_first(out: Path, read: Callable[[Path], object]) -> None:
    """`verify`, `diff` and `view` restore a bake before they read its manifest, which here is invalid."""
    step = 0
    while ends_by_kill(lambda: write_new(out), step):
        with pytest.raises(InputError, match="manifest is damaged"):
            read(out)
        whole(out)
        write_old(out)
        step += 5


def test_a_folder_that_was_not_there(tmp_path: Path) -> None:
    out, step = tmp_path / "out", 0
    while ends_by_kill(lambda: write_new(out), step):
        recover(out)
        assert not out.exists() or whole(out) == "new"
        assert {p.name for p in tmp_path.iterdir()} <= {"out"}
        if out.exists():
            for path in sorted(out.rglob("*"), reverse=True):
                path.rmdir() if path.is_dir() else path.unlink()
            out.rmdir()
        step += 1
    assert step > 8


def test_what_a_living_process_writes_stays(tmp_path: Path) -> None:
    out = tmp_path / "out"
    (tmp_path / f".out.baker-{os.getpid()}-0123abcd").mkdir()
    other = tmp_path / ".out2.baker-999999999-0123abcd"
    other.mkdir()
    living = TemporaryFolder(out)
    living.create()
    assert abandoned(out), "the number in the name is that of a living process, but nothing is locked"
    recover(out)
    assert sorted(tmp_path.iterdir()) == sorted([living.path, other])
    assert not abandoned(out)
    living.remove()


@pytest.mark.parametrize(
    "journal", ['{"old": ["link/v.txt"], "new": ["bake.json"], "folders": []}', "[", "{}"]
)
def test_a_journal_that_names_files_outside_is_not_followed(tmp_path: Path, journal: str) -> None:
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    elsewhere.mkdir()
    home = out / ".baker-1-00000000"
    for name in ("old/link/v.txt", "new/bake.json"):
        (home / name).parent.mkdir(parents=True, exist_ok=True)
        (home / name).write_text("theirs")
    (home / "journal.json").write_text(journal)
    (elsewhere / "v.txt").write_text("mine")
    (out / "link").symlink_to(elsewhere)
    recover(out)
    assert (elsewhere / "v.txt").read_text() == "mine"
    assert len(temporaries(out)) == 1, "what is not understood is not deleted"


def test_a_folder_of_the_user_is_never_replaced_by_a_file(out: Path) -> None:
    (out / "new.exr").mkdir()
    (out / "new.exr" / "x").write_text("mine")
    with pytest.raises(OSError, match=r"exists|directory"):
        write_new(out)
    assert (out / "new.exr" / "x").read_text() == "mine"
    (out / "new.exr" / "x").unlink()
    (out / "new.exr").rmdir()
    assert whole(out) == "old"


def test_bind_mounts_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    table = tmp_path / "mountinfo"
    table.write_text(f"36 35 98:0 / {tmp_path}/my\\040out/textures rw - ext4 /dev/sda rw\n")
    monkeypatch.setattr(mounts, "_MOUNT_TABLE", table)
    for name, fixed in {"my out": True, "my out/textures": True, "my": False}.items():
        (tmp_path / name).mkdir(exist_ok=True)
        assert mounts.cannot_move(tmp_path / name) == fixed
    out = tmp_path / "my out"
    (out / "textures").rmdir()
    inode = out.stat().st_ino
    write_new(out)
    assert whole(out) == "new"
    assert out.stat().st_ino == inode, "it stays where it is"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["mountinfo", "my", "my out"]
