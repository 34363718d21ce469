"""`baker batch` on the command line: bakes, moved folders, killed runs, two runs at the same time."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from gltf_builder import quad_builder, write

BAKER = [sys.executable, "-m", "baker.cli"]
JOBS = """
[defaults]
out = "baked/{stem}"
resolution = 16
samples = 1
denoise = false
sky = [1, 1, 1]

[[job]]
glob = "levels/*.glb"
"""


@pytest.fixture
def tree(tmp_path):
    folder = tmp_path / "game"
    (folder / "levels").mkdir(parents=True)
    for name in ("hall", "room", "shed"):
        builder = quad_builder()
        builder.json["extras"] = {"name": name}
        write(folder / "levels" / f"{name}.glb", builder)
    (folder / "JOBS.toml").write_text(JOBS)
    return folder


def batch(folder, *flags):
    command = [*BAKER, "batch", "JOBS.toml", "--json", *flags]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120)
    assert "Traceback" not in done.stderr
    return done.returncode, json.loads(done.stdout), done.stderr


def states(found):
    return [job["state"] for job in found["jobs"]]


def content(folder):
    """Return {path: hash} of every file of all bakes; times are removed from manifests first."""
    found = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            data = path.read_bytes()
            if path.name == "bake.json":
                manifest = json.loads(data)
                for name in ("created", "timings"):
                    del manifest[name]
                data = json.dumps(manifest).encode()
            found[path.relative_to(folder).as_posix()] = hashlib.sha256(data).hexdigest()
    return found


def hidden(folder):
    return list(folder.rglob(".*"))


def test_a_second_run_bakes_only_what_changed(tree, tmp_path):
    code, found, text = batch(tree, "--jobs", "2", "--junit", "junit.xml")
    assert (code, states(found)) == (0, ["baked"] * 3), text
    assert [job["out"] for job in found["jobs"]] == ["baked/hall", "baked/room", "baked/shed"]
    assert 'tests="3" failures="0"' in (tree / "junit.xml").read_text()
    assert hidden(tree) == []
    # In a moved folder, baking everything again with one process gives the same bytes.
    before = content(tree / "baked")
    moved = tree.rename(tmp_path / "moved")
    for path in moved.rglob("*"):
        path.touch()
    assert states(batch(moved)[1]) == ["unchanged"] * 3
    code, found, _ = batch(moved, "--force")
    assert states(found) == ["baked"] * 3
    assert content(moved / "baked") == before
    # Replace one scene and delete one map.
    builder = quad_builder()
    builder.json["extras"] = {"name": "another"}
    write(moved / "levels" / "room.glb", builder)
    (moved / "baked" / "shed" / "ao_0.exr").unlink()
    code, found, _ = batch(moved, "--dry-run")
    assert states(found) == ["unchanged", "baked", "baked"]
    assert "the scene" in found["jobs"][1]["why"]
    assert found["jobs"][2]["why"] == "ao_0.exr is missing"
    assert not (moved / "baked" / "shed" / "ao_0.exr").exists()
    assert states(batch(moved)[1]) == ["unchanged", "baked", "baked"]
    assert states(batch(moved)[1]) == ["unchanged"] * 3


def test_a_broken_scene_fails_alone_and_foreign_folders_stay(tree):
    (tree / "levels" / "hall.glb").write_bytes(b"glTF")
    (tree / "baked" / "room").mkdir(parents=True)
    (tree / "baked" / "room" / "thesis.txt").write_text("mine")
    code, found, text = batch(tree)
    assert (code, states(found)) == (3, ["failed", "failed", "baked"])
    assert "hall.glb" in found["jobs"][0]["why"]
    assert "--force" in found["jobs"][1]["why"]
    assert "1 baked, 0 unchanged, 2 failed" in text
    assert [p.name for p in (tree / "baked" / "room").iterdir()] == ["thesis.txt"]


def test_wrong_use_and_missing_files(tree):
    code, found, _ = batch(tree, "--memory", "lots")
    assert (code, found["error"]["kind"]) == (2, "settings")
    (tree / "JOBS.toml").write_text('[[job]]\nscene = "x.glb"\nout = "o"\nqualty = "high"')
    code, found, _ = batch(tree)
    assert (code, "did you mean 'quality'" in found["error"]["message"]) == (2, True)
    (tree / "JOBS.toml").write_text('[[job]]\nscene = "x.glb"\nout = "o"')
    code, found, _ = batch(tree)
    assert (code, states(found)) == (3, ["failed"])
    (tree / "JOBS.toml").unlink()
    assert batch(tree)[0] == 3


def slow(tree):
    """Write a job file with two jobs. The second bake takes long enough to be interrupted."""
    text = JOBS.replace('glob = "levels/*.glb"', 'scene = "levels/hall.glb"')
    more = "resolution = 1024\nsamples = 4096\nao_samples = 65536\n"
    (tree / "JOBS.toml").write_text(f'{text}\n[[job]]\nscene = "levels/room.glb"\n{more}')


def start(tree, *flags):
    return subprocess.Popen(
        [*BAKER, "batch", "JOBS.toml", "-q", *flags], cwd=tree, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


def wait_for(condition, process):
    end = time.monotonic() + 60
    while not condition():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end
        time.sleep(0.02)


def children(process):
    found = subprocess.run(["ps", "-eo", "pid,ppid"], capture_output=True, text=True).stdout.split("\n")[1:]
    parent = {int(a): int(b) for a, b in (line.split() for line in found if line)}
    mine = {process}
    while True:
        more = {p for p, q in parent.items() if q in mine} | mine
        if more == mine:
            return mine - {process}
        mine = more


@pytest.mark.timed
@pytest.mark.parametrize("how", ["ctrl-c", "kill the command", "kill everything"])
def test_stopped_in_the_middle(tree, how):
    slow(tree)
    process = start(tree)
    wait_for(lambda: (tree / "baked" / ".room.baker.lock").exists(), process)
    time.sleep(1.0)
    family = children(process.pid)
    assert len(family) >= 2, "the worker works"
    began = time.monotonic()
    if how == "ctrl-c":
        process.send_signal(signal.SIGINT)
        assert process.wait(10) == 130
        assert time.monotonic() - began < 1.0
    else:
        for number in [process.pid, *(family if how == "kill everything" else ())]:
            os.kill(number, signal.SIGKILL)
        process.wait(10)
    process.communicate()
    wait_for_end(family)
    assert [path.name for path in (tree / "baked").iterdir() if not path.name.endswith(".lock")] == ["hall"]
    if how == "ctrl-c":
        # After Ctrl-C, the batch removes its temporary files. After a kill, the next batch removes them.
        assert hidden(tree) == []
    text = (tree / "JOBS.toml").read_text()
    (tree / "JOBS.toml").write_text(text.replace("4096", "1").replace("65536", "1").replace("1024", "16"))
    assert states(batch(tree)[1]) == ["unchanged", "baked"]
    assert hidden(tree) == []


def wait_for_end(family):
    end = time.monotonic() + 3
    while any(Path(f"/proc/{p}").exists() and state_of(p) != "Z" for p in family):
        assert time.monotonic() < end, "a worker outlives the batch"
        time.sleep(0.02)


def state_of(process):
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return "Z"


def test_a_job_whose_worker_dies_twice_fails_alone(tree):
    slow(tree)
    text = (tree / "JOBS.toml").read_text()
    (tree / "JOBS.toml").write_text(f'{text}\n[[job]]\nscene = "levels/shed.glb"\n')
    process = start(tree, "--json")
    wait_for(lambda: (tree / "baked" / ".room.baker.lock").exists(), process)
    killed = set()
    for _ in range(2):
        wait_for(lambda: workers(process) - killed, process)
        (work,) = workers(process) - killed
        os.kill(work, signal.SIGKILL)
        killed.add(work)
    out, _ = process.communicate(timeout=60)
    found = json.loads(out)
    assert states(found) == ["baked", "failed", "baked"]
    assert "its process was killed twice" in found["jobs"][1]["why"]
    assert process.returncode == 4
    assert hidden(tree) == []


def workers(process):
    """Return the worker processes of a batch; the batch itself is a child of `process`."""
    return children(process.pid) - children_depth_one(process.pid)


def children_depth_one(process):
    found = subprocess.run(["ps", "--ppid", str(process), "-o", "pid="], capture_output=True, text=True)
    return {int(word) for word in found.stdout.split()}


def test_two_runs_over_one_folder(tree):
    runs = [start(tree, "--json", "--jobs", "2") for _ in range(2)]
    found = [json.loads(run.communicate(timeout=120)[0]) for run in runs]
    assert [run.returncode for run in runs] == [0, 0]
    pairs = list(zip(*map(states, found), strict=True))
    assert [sorted(pair) for pair in pairs] == [["baked", "unchanged"]] * 3, "each is baked once"
    assert states(batch(tree)[1]) == ["unchanged"] * 3
    assert hidden(tree) == []
