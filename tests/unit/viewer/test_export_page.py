"""The exported viewer page is complete, contains no local paths, and replaces no files of the user."""

from __future__ import annotations

import errno
import html
import json
import re
from io import StringIO

import pytest
from view_bake import make_bake

import baker
from baker.cli.app import run
from baker.core.errors import ResourceError, SettingsError
from baker.io.bake.read_bake import read_bake
from baker.viewer import export
from baker.viewer.answers import POLICY, page_answers
from baker.viewer.export import export_page
from baker.viewer.script import find_three


@pytest.fixture(scope="module")
def bake(tmp_path_factory):
    return read_bake(make_bake(tmp_path_factory.mktemp("secret place"), name="hall <b>ü"))


def content(folder):
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_all_that_the_page_asks_for_is_there_with_the_same_bytes(bake, tmp_path):
    three = find_three(None)
    names = export_page(bake, three, tmp_path / "a" / "page")
    files = content(tmp_path / "a" / "page")
    assert sorted(names) == sorted(files)
    maps = {f"out/{page['file']}" for page in bake.manifest["pages"]}
    for address, (_, answer) in page_answers(bake, three).items():
        if address in ("", "scene.json"):
            continue
        if address.startswith("out/") and address not in maps:
            assert address not in files
        else:
            assert files[address] == answer()
    assert set(json.loads(files["files.json"])["files"]) == set(files) - {"files.json"}


def test_the_page_has_the_rules_of_the_server_and_only_relative_addresses(bake, tmp_path):
    export_page(bake, find_three(None), tmp_path / "page")
    files = content(tmp_path / "page")
    page = files["index.html"].decode()
    found = re.findall(r'<meta http-equiv="Content-Security-Policy" content="([^"]*)">', page)
    assert [html.unescape(rules) for rules in found] == [POLICY]
    assert page.index("Content-Security-Policy") < page.index("<link")
    assert not re.search(r"<script(?![^>]*\bsrc=)|\bon\w+=|\bstyle=|<style", page)
    for address in re.findall(r'(?:src|href)="([^"]*)"', page):
        assert address in files
    for name, text in files.items():
        if name.startswith("static/"):
            assert not re.search(rb"""(?:src=|href=|fetch\(|ask\(|from )["'`]/""", text), name


def test_no_path_of_this_machine_is_in_the_page(bake, tmp_path):
    export_page(bake, find_three(None), tmp_path / "page")
    for name, data in content(tmp_path / "page").items():
        assert b"secret place" not in data, name
        assert str(tmp_path).encode() not in data, name
    header = json.loads((tmp_path / "page" / "scene.json").read_text())
    assert (header["name"], header["folder"], header["input"]) == ("hall <b>ü", "out", "hall <b>ü.glb")


def test_an_earlier_page_is_replaced_by_equal_bytes(bake, tmp_path):
    folder = tmp_path / "page"
    folder.mkdir()
    export_page(bake, find_three(None), folder)
    first = content(folder)
    listed = json.loads((folder / "files.json").read_text())
    listed["files"].append("old/gone.bin")
    (folder / "files.json").write_text(json.dumps(listed))
    (folder / "old").mkdir()
    (folder / "old" / "gone.bin").write_text("of an earlier bake")
    export_page(bake, find_three(None), folder)
    assert content(folder) == first
    assert list(tmp_path.iterdir()) == [folder]


def make_link(folder):
    (folder / "static" / "link").symlink_to(folder)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda folder: (folder / "notes.txt").write_text("mine"),
        lambda folder: (folder / "out" / "mine.exr").write_text("mine"),
        lambda folder: (folder / "files.json").unlink(),
        lambda folder: (folder / "files.json").write_text('{"files": ["../../x", 3, null]}'),
        lambda folder: (folder / "files.json").write_text("[" * 100_000),
        make_link,
    ],
)
def test_files_of_others_are_never_replaced(bake, tmp_path, spoil):
    folder = tmp_path / "page"
    export_page(bake, find_three(None), folder)
    spoil(folder)
    before = content(folder)
    with pytest.raises(SettingsError, match="is no file of an exported page; name another folder"):
        export_page(bake, find_three(None), folder)
    assert content(folder) == before


def test_the_folder_of_a_bake_and_the_current_folder_are_refused(bake, tmp_path, monkeypatch):
    with pytest.raises(SettingsError, match="no file of an exported page"):
        export_page(bake, find_three(None), bake.folder)
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    with pytest.raises(SettingsError, match="cannot be replaced as a whole"):
        export_page(bake, find_three(None), tmp_path / "here")


@pytest.mark.parametrize("old", [True, False])
def test_a_full_disk_leaves_the_folder_as_it_was(bake, tmp_path, monkeypatch, old):
    folder = tmp_path / "page"
    if old:
        export_page(bake, find_three(None), folder)
    before = content(tmp_path)

    def full(folder, names):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(export, "_write_list", full)
    with pytest.raises(ResourceError, match="No space left"):
        export_page(bake, find_three(None), folder)
    assert content(tmp_path) == before
    assert len(list(tmp_path.iterdir())) == old


def test_a_file_system_without_exchange_gets_the_new_page(bake, tmp_path, monkeypatch):
    folder = tmp_path / "page"
    export_page(bake, find_three(None), folder)
    first = content(folder)
    monkeypatch.setattr(export, "exchange_paths", lambda one, two: False)
    export_page(bake, find_three(None), folder)
    assert content(folder) == first
    assert list(tmp_path.iterdir()) == [folder]


def test_the_command_writes_the_page_and_ends(bake, tmp_path):
    stream = StringIO()
    words = ["view", str(bake.folder), "--export", str(tmp_path / "page"), "--json"]
    assert run(words, out=stream) == 0
    told = json.loads(stream.getvalue())
    files = content(tmp_path / "page")
    assert (told["files"], told["bytes"]) == (len(files), sum(map(len, files.values())))
    (tmp_path / "file").write_text("")
    assert run(["view", str(bake.folder), "--export", str(tmp_path / "file"), "--json"], out=StringIO()) == 2


def test_python_exports_the_same_page(bake, tmp_path):
    assert baker.view(bake.folder, export=tmp_path / "page") == tmp_path / "page" / "index.html"
    export_page(bake, find_three(None), tmp_path / "same")
    assert content(tmp_path / "page") == content(tmp_path / "same")
    (tmp_path / "page" / "mine.txt").write_text("mine")
    with pytest.raises(SettingsError, match=r"mine\.txt"):
        baker.view(bake.folder, export=tmp_path / "page")
    with pytest.raises(SettingsError, match="export"):
        baker.view(bake.folder, export=3)
