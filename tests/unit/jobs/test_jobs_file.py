"""JOBS.toml: jobs are merged with defaults, mistakes are refused, and patterns are expanded to files."""

from __future__ import annotations

import json

import pytest

from baker.core.errors import InputError, SettingsError
from baker.core.settings import BakeSettings
from baker.jobs.jobs_file import read_jobs


@pytest.fixture
def tree(tmp_path):
    for name in ("a/room.glb", "a/hut.obj", "b/room.glb", "b/notes.txt", "b/.hidden.glb"):
        path = tmp_path / "levels" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"x")
    return tmp_path


def jobs(tree, text, **overrides):
    (tree / "JOBS.toml").write_text(text)
    return read_jobs(tree / "JOBS.toml", overrides)


def test_defaults_jobs_and_command_line_in_this_order(tree):
    text = """
    [defaults]
    out = "baked/{parent}/{stem}"
    resolution = 64
    samples = 4
    seed = 1
    [[job]]
    scene = "levels/a/room.glb"
    [[job]]
    scene = ["levels/b/room.glb", "levels/a/hut.obj"]
    out = "other-{stem}"
    samples = 8
    channels = "ao"
    """
    found = jobs(tree, text, seed=7)
    assert [(j.scene, j.out) for j in found] == [
        (tree / "levels/a/room.glb", tree / "baked/a/room"),
        (tree / "levels/b/room.glb", tree / "other-room"),
        (tree / "levels/a/hut.obj", tree / "other-hut"),
    ]
    assert found[0].settings == BakeSettings(resolution=64, samples=4, seed=7)
    assert found[1].settings == BakeSettings(resolution=64, samples=8, seed=7, channels=("ao",))


@pytest.mark.parametrize("key", ["glob", "scene"])
def test_a_pattern_finds_scene_files_in_order(tree, key):
    text = f'[defaults]\nout = "out/{{parent}}-{{stem}}"\n[[job]]\n{key} = "levels/**/*"\n'
    assert [j.out.name for j in jobs(tree, text)] == ["a-hut", "a-room", "b-room"]
    absolute = text.replace("levels", str(tree / "levels"))
    assert [j.out.name for j in jobs(tree, absolute)] == ["a-hut", "a-room", "b-room"]


def test_a_pattern_does_not_find_what_a_bake_wrote(tree):
    baked = tree / "levels" / "a" / "baked"
    (baked / "engine").mkdir(parents=True)
    files = [{"file": "scene.glb"}, {"file": "engine/level.glb"}]
    (baked / "bake.json").write_text(json.dumps({"versions": {"baker": "0"}, "files": files}))
    for name in ("scene.glb", "engine/level.glb", "mine.glb"):
        (baked / name).write_bytes(b"x")
    text = '[[job]]\nglob = "levels/a/**/*.glb"\nout = "out/{stem}"\n'
    assert [j.scene.name for j in jobs(tree, text)] == ["mine.glb", "room.glb"]


def test_a_pattern_without_a_match_is_a_job_that_fails(tree):
    (job,) = jobs(tree, '[[job]]\nglob = "levls/*.glb"\nout = "out/{stem}"\n')
    assert job.out is None
    assert "no scene file matches" in job.problem


BAD = {
    "unknown setting": ('[[job]]\nscene = "a.glb"\nout = "o"\nresolutoin = 8', "did you mean 'resolution'"),
    "unknown in defaults": (
        '[defaults]\nsampels = 1\n[[job]]\nscene="a"\nout="o"',
        "did you mean 'samples'",
    ),
    "output": ('[[job]]\nscene = "a.glb"\nouts = "o"', "did you mean 'out'"),
    "unknown table": ('[[jobs]]\nscene = "a.glb"\nout = "o"', "did you mean 'job'"),
    "scene in defaults": ('[defaults]\nscene = "a"\n[[job]]\nout = "o"', "there is no setting 'scene'"),
    "both": ('[[job]]\nscene = "a.glb"\nglob = "*"\nout = "o"', "not both"),
    "neither": ('[[job]]\nout = "o"', "either a scene or a glob"),
    "no out": ('[[job]]\nscene = "a.glb"', "out is missing"),
    "number as scene": ('[[job]]\nscene = 3\nout = "o"', "path in quotes"),
    "placeholder": ('[[job]]\nscene = "a.glb"\nout = "{stam}"', "did you mean 'stem'"),
    "range": ('[[job]]\nscene = "a.glb"\nout = "o"\nresolution = 1', "resolution"),
    "twice": ('[[job]]\nscene = "a.glb"\nout = "o"\nao-samples = 1\nao_samples = 2', "twice"),
    "no jobs": ("[defaults]\nresolution = 64", "no jobs"),
    "job is no list": ('[job]\nscene = "a.glb"', "[[job]]"),
    "no TOML": ("[[job]", "not valid TOML"),
    "one output": ('[defaults]\nout = "o"\n[[job]]\nscene = "a.glb"\n[[job]]\nscene = "b.glb"', "'b.glb'"),
    "same by another name": (
        '[[job]]\nscene = "a.glb"\nout = "o/x"\n[[job]]\nscene = "b.glb"\nout = "o/../o/x"',
        "both be baked",
    ),
    "inside another": ('[[job]]\nscene="a.glb"\nout="o"\n[[job]]\nscene="b.glb"\nout="o/b"', "lies inside"),
    "glob into one": ('[[job]]\nglob = "levels/*/room.glb"\nout = "o/{stem}"', "{parent}"),
}


@pytest.mark.parametrize("name", BAD)
def test_mistakes_are_refused_in_a_sentence(tree, name, monkeypatch):
    text, words = BAD[name]
    monkeypatch.chdir(tree)
    (tree / "JOBS.toml").write_text(text)
    with pytest.raises(SettingsError) as caught:
        read_jobs(tree.__class__("JOBS.toml"), {})
    assert words in str(caught.value)
    assert str(caught.value).startswith("JOBS.toml")


def test_a_missing_file_is_bad_input(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_jobs(tmp_path / "JOBS.toml", {})
