"""A bake that does not fit into memory is refused. The limit of a Linux control group applies, too."""

from __future__ import annotations

from pathlib import Path

import pytest

from baker.channels.channel import chosen_channels
from baker.core import processes as memory
from baker.core.errors import ResourceError
from baker.core.settings import make_settings
from baker.io.load import load_scene
from baker.pipeline import memory_check
from baker.pipeline.bake import bake

CORNELL = Path(__file__).parents[3] / "assets" / "cornell.glb"
MIB = 2**20


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(memory_check, "free_memory", lambda: 300 * MIB)
    monkeypatch.setattr(memory_check, "used_memory", lambda: 100 * MIB)


@pytest.mark.parametrize(
    ("settings", "advice"),
    [
        ({"resolution": 8192}, "lower `resolution` to 256"),
        ({"resolution": 512, "density": 200.0, "max_pages": 256}, "lower `density` to 50"),
    ],
)
def test_the_message_names_a_setting_that_fits(small, tmp_path, settings, advice):
    settings = make_settings(settings)
    with pytest.raises(ResourceError, match=r"and 0\.39 GiB are free for it") as caught:
        bake(CORNELL, settings=settings, out=tmp_path / "out")
    assert advice in caught.value.message
    assert "`force`" in caught.value.message
    assert list(tmp_path.iterdir()) == []
    name, value = advice.split("`")[1], float(advice.split()[-1])
    scene, channels = load_scene(CORNELL), chosen_channels(settings.channels)
    memory_check.check_memory(
        scene, settings.changed(**{name: type(getattr(settings, name))(value)}), channels
    )


def test_a_scene_that_never_fits(monkeypatch):
    monkeypatch.setattr(memory_check, "free_memory", lambda: MIB)
    monkeypatch.setattr(memory_check, "used_memory", lambda: MIB)
    settings = make_settings({"resolution": 128})
    with pytest.raises(ResourceError, match="lower `resolution`, turn `denoise` off or use smaller textures"):
        memory_check.check_memory(load_scene(CORNELL), settings, chosen_channels(settings.channels))


def test_force_bakes_anyway(small, monkeypatch):
    monkeypatch.setattr(memory_check, "estimate_peak_of", lambda *_: 1 << 50)
    settings = make_settings({"resolution": 16, "samples": 1, "denoise": False, "channels": "ao"})
    assert bake(CORNELL, settings=settings, force=True).lightmaps


def groups(tmp_path, line, files):
    (tmp_path / "proc" / "self").mkdir(parents=True)
    (tmp_path / "proc" / "self" / "cgroup").write_text(line)
    for name, text in files.items():
        path = tmp_path / "groups" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return list(memory._left_in_groups(tmp_path / "proc", tmp_path / "groups"))


def test_limits_of_version_2_count_up_to_the_root(tmp_path):
    files = {
        "a/b/memory.max": "max\n",
        "a/b/memory.current": "5\n",
        "a/memory.max": "1000\n",
        "a/memory.current": "700\n",
        "a/memory.stat": "anon 400\ninactive_file 100\n",
        "memory.max": "5000\n",
        "memory.current": "6000\n",
    }
    assert groups(tmp_path, "0::/a/b\n", files) == [400, 0]


def test_limits_of_version_1(tmp_path):
    files = {
        "memory/job/memory.limit_in_bytes": "2000",
        "memory/job/memory.usage_in_bytes": "500",
        "memory/job/memory.stat": "total_inactive_file 100",
        "memory/memory.limit_in_bytes": "9223372036854771712",
        "memory/memory.usage_in_bytes": "800",
    }
    assert groups(tmp_path, "5:cpu,cpuacct:/x\n4:memory:/job\n", files) == [1600]


def test_a_machine_without_control_groups(tmp_path):
    assert groups(tmp_path, "nonsense\n\n", {}) == []
    assert memory.used_memory() > 0
    assert memory.free_memory() > 0
