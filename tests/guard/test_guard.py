"""Records of the guard are compared and their differences described, without running `baker`."""

from __future__ import annotations

import copy
import json

import pytest
from guard_compare import compare, json_differences
from guard_normal import file_entry, layout, normal_json, normal_text, text_entry
from guard_runs import FIRST, RUNS
from guard_scenes import write_scenes
from outputs import read, write

PLACES = {"/somewhere/run": "<run>"}
MANIFEST = {
    "created": "2026-01-02T03:04:05Z",
    "input": {"path": "/somewhere/run/level.glb"},
    "pages": [{"page": 0, "width": 64}, {"page": 1, "width": 64}],
    "timings": {"load": 0.25},
}


def recorded(manifest, *, code=0, picture=b"\x00\x01", errors="", indent=2):
    """Return a record of one run of one command that wrote a manifest and a picture."""
    step = {"command": "bake level.glb -o out", "exit": code}
    step["stderr"] = text_entry(errors, PLACES)
    text = json.dumps(manifest, indent=indent)
    files = {
        "out/bake.json": text_entry(text, PLACES),
        "out/ao_0.exr": {"kind": "bytes", "sha256": str(picture)},
    }
    return {"format": 1, "runs": {"one": {"steps": [step], "files": files, "left": []}}}


def test_times_and_places_do_not_count():
    later = copy.deepcopy(MANIFEST)
    later |= {"created": "2027-01-02T03:04:05Z", "timings": {"load": 12.5, "unwrap": 1.0}}
    old = "texels:  40 %  1.2 Mrays/s  3 s left\nwrote\n  bake.json    6.4 kB\n1.25 s: load 0.25, bake 1.00\n"
    new = "wrote\n  bake.json    6.5 kB\n10.50 s: load 8.50, bake 2.00\n"
    assert compare(recorded(MANIFEST, errors=old), recorded(later, errors=new)) == []
    assert normal_json(MANIFEST, PLACES) == {"input": {"path": "<run>/level.glb"}, "pages": MANIFEST["pages"]}


def test_numbers_in_texts_are_compared():
    # Numbers with other units, and names that contain digits, are not replaced.
    text = "E = 12.5 lx, 3 texels, ao_0.exr 5.3 kB, 0.5 m"
    assert normal_text(text, {}) == text
    assert normal_text("32 x 24, 4 samples a pixel, 0.2 s, 1.5 Mrays/s", {}) == (
        "32 x 24, 4 samples a pixel, <number> s, <number> Mrays/s"
    )


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda m: m["pages"][1].update(width=65), "out/bake.json: $.pages[1].width: 64 -> 65"),
        (lambda m: m["pages"].pop(), "out/bake.json: $.pages: 2 items -> 1 items"),
        (lambda m: m.pop("input"), 'out/bake.json: $.input: {"path": "<run>/level.glb"} -> nothing'),
        (lambda m: m.update(input=m.pop("input")), "out/bake.json: $: keys in another order"),
        (lambda m: m["pages"][0].update(page=0.0), "out/bake.json: $.pages[0].page: 0 -> 0.0"),
    ],
)
def test_the_place_in_a_json_file_is_told(change, said):
    manifest = copy.deepcopy(MANIFEST)
    change(manifest)
    assert compare(recorded(MANIFEST), recorded(manifest)) == [f"one: {said}"]


def test_other_differences_are_told():
    old = recorded(MANIFEST, errors="warning: a\n")
    assert compare(old, recorded(MANIFEST, code=3, errors="warning: a\n")) == [
        "one: `bake level.glb -o out`: exit code 0 -> 3"
    ]
    assert compare(old, recorded(MANIFEST, errors="warning: b\n")) == [
        "one: `bake level.glb -o out`: stderr: -warning: a",
        "one: `bake level.glb -o out`: stderr: +warning: b",
    ]
    assert compare(old, recorded(MANIFEST, errors="warning: a\n", picture=b"")) == [
        "one: out/ao_0.exr: bytes differ"
    ]
    (line,) = compare(old, recorded(MANIFEST, errors="warning: a\n", indent=1))
    assert line.startswith("one: out/bake.json: laid out as {'indent': 2")
    fewer = copy.deepcopy(old)
    del fewer["runs"]["one"]["files"]["out/ao_0.exr"]
    assert compare(old, fewer) == ["one: out/ao_0.exr is missing"]
    assert compare(fewer, old) == ["one: out/ao_0.exr is new"]
    assert compare(old, {"format": 1, "runs": {}}) == ["one: only in the old record"]


def test_a_record_is_read_as_it_was_written(tmp_path):
    old = recorded(MANIFEST)
    write(tmp_path / "folder" / "record", old)
    assert read(tmp_path / "folder" / "record") == old


def test_the_binary_chunk_of_a_glb_is_compared(tmp_path):
    write_scenes(tmp_path / "scenes")
    path = tmp_path / "scenes" / "cornell.glb"
    old = file_entry(path, {})
    assert json.loads(old["text"])["asset"]["version"] == "2.0"
    path.write_bytes(path.read_bytes()[:-1] + b"\x07")
    new = file_entry(path, {})
    assert old["text"] == new["text"]
    assert old["sha256"] != new["sha256"]
    assert old["rest"] != new["rest"]


def test_layouts_are_told_apart():
    texts = [json.dumps({"a": [1, "ü"]}, **how) for how in ({}, {"indent": 1}, {"ensure_ascii": False})]
    assert len({layout(text) for text in (*texts, texts[0] + "\n")}) == 4
    assert layout(' {"a":1}') == "other"
    assert list(json_differences({"a": [1]}, {"a": [1]})) == []


def test_runs_are_known():
    assert set(FIRST) <= set(RUNS)
    for lines in RUNS.values():
        assert len(set(lines)) == len(lines) or "batch JOBS.toml --json" in lines
