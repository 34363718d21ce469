"""Locks end with their process; sizes as people write them; estimates grow with what they are made of."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import numpy as np
import pytest
from gltf_builder import quad_builder, write

from baker.batch.memory import estimate_peak, parse_size, size_words
from baker.core.errors import SettingsError
from baker.core.settings import make_settings
from baker.io.bake.lock import OutputLock, dead_writers, sweep

HOLDER = """
import sys, time
from pathlib import Path
from baker.io.bake.lock import OutputLock
lock = OutputLock(Path(sys.argv[1]))
print(lock.acquire(), flush=True)
time.sleep(60)
"""


def test_one_holds_it_and_leaves_nothing(tmp_path):
    out = tmp_path / "deep" / "out"
    first, second = OutputLock(out), OutputLock(out)
    assert first.acquire()
    assert not second.acquire()
    assert OutputLock(tmp_path / "deep" / "other").acquire()
    first.release()
    assert second.acquire()
    second.release()
    (tmp_path / "deep" / ".other.baker.lock").unlink()
    assert list((tmp_path / "deep").iterdir()) == []


def test_folders_made_for_nothing_are_removed(tmp_path):
    lock = OutputLock(tmp_path / "a" / "b" / "out")
    assert lock.acquire()
    lock.release()
    assert list(tmp_path.iterdir()) == []


def test_a_killed_holder_does_not_leave_it_locked(tmp_path):
    out = tmp_path / "out"
    command = [sys.executable, "-c", HOLDER, str(out)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "True\n"
    lock = OutputLock(out)
    assert not lock.acquire()
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert lock.acquire()
    lock.release()
    assert list(tmp_path.iterdir()) == []


def test_only_leavings_of_the_dead_are_swept(tmp_path):
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    out = tmp_path / "out"
    half, old = tmp_path / f".out.baker-{dead.pid}-0123abcd", tmp_path / f".out.baker-{dead.pid}-0123abcd-old"
    living = tmp_path / f".out.baker-{os.getpid()}-0123abcd"
    other = tmp_path / f".out2.baker-{dead.pid}-0123abcd"
    for folder in (half, old, living, other):
        folder.mkdir()
    (old / "bake.json").write_text("yesterday")
    assert dead_writers(out) == {dead.pid}
    sweep(out)
    assert sorted(tmp_path.iterdir()) == sorted([out, living, other])
    assert (out / "bake.json").read_text() == "yesterday", "it was moved aside and comes back"


@pytest.mark.parametrize(
    ("text", "size"),
    [
        ("8G", 8 * 2**30),
        ("512M", 2**29),
        ("1.5gib", 3 * 2**29),
        ("100", 100),
        ("2 GB", 2**31),
        ("64k", 2**16),
    ],
)
def test_sizes(text, size):
    assert parse_size(text) == size
    assert parse_size(size_words(size)) == size


@pytest.mark.parametrize("text", ["", "much", "-1G", "0", "8X", "G"])
def test_no_sizes(text):
    with pytest.raises(SettingsError, match="no size"):
        parse_size(text)


def test_the_estimate_follows_pages_samples_and_channels(tmp_path):
    scene = write(tmp_path / "a.glb", quad_builder())

    def peak(**settings):
        return estimate_peak(scene, make_settings(settings))

    small = peak(resolution=64)
    assert small < peak(resolution=1024) < peak(resolution=2048)
    plain = {"channels": "ao", "denoise": False}
    assert peak(resolution=1024, **plain) < peak(resolution=1024, denoise=False) < peak(resolution=1024)
    assert peak(resolution=1024) < peak(resolution=1024, samples=512)
    # A unit square at 100 texels a metre needs 20 000 texels of pages: five of 64 x 64.
    many = peak(resolution=64, density=100, **plain) - peak(resolution=64, **plain)
    one = peak(resolution=128, **plain) - peak(resolution=64, **plain)
    assert many == pytest.approx(one * 4 / 3)
    assert peak(resolution=64, density=100, max_pages=1) == small


def test_images_and_triangles_count(tmp_path):
    rng = np.random.default_rng(0)
    from baker.io.png import encode_png

    builder = quad_builder(pbrMetallicRoughness={"baseColorTexture": {"index": 0}})
    builder.image(encode_png(rng.integers(0, 255, (64, 64, 3), np.uint8)))
    plain, textured = write(tmp_path / "a.glb", quad_builder()), write(tmp_path / "b.glb", builder)
    settings = make_settings({"resolution": 64})
    assert estimate_peak(textured, settings) - estimate_peak(plain, settings) == 5 * 64 * 64 * 4
