"""docs/recipes/trim-oidn.sh removes only files that the denoiser does not need; platforms.yml is complete."""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

import yaml

RECIPES = Path(__file__).parents[2] / "docs" / "recipes"
DENOISE = """
import hashlib
import numpy as np
import pyoidn
from baker.finish.oidn import filter_picture
image = np.random.default_rng(0).random((32, 32, 3), np.float32)
done = filter_picture(image, albedo=image, normal=image, threads=1)
print(pyoidn.__file__, hashlib.sha256(done.tobytes()).hexdigest())
"""


def denoise(environment):
    done = subprocess.run(
        [sys.executable, "-c", DENOISE],
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    return done.stdout.split()


def size(folder):
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def test_the_denoiser_gives_the_same_bytes_without_the_removed_files(tmp_path):
    installed = Path(importlib.util.find_spec("pyoidn").origin).parent
    copy = tmp_path / "pyoidn"
    shutil.copytree(
        installed, copy, copy_function=os.link if same_disk(installed, tmp_path) else shutil.copy2
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    _, before = denoise(os.environ)
    full = size(copy)
    subprocess.run(["sh", RECIPES / "trim-oidn.sh", sys.executable], env=environment, timeout=120, check=True)
    assert size(copy) < 0.5 * full
    assert size(installed) >= full
    used, after = denoise(environment)
    assert Path(used).parent == copy
    assert after == before


def same_disk(one, two):
    return one.stat().st_dev == two.stat().st_dev


def test_the_workflow_names_three_systems_and_only_known_steps():
    job = yaml.safe_load((RECIPES / "platforms.yml").read_text("utf-8"))["jobs"]["bake"]
    systems = job["strategy"]["matrix"]["os"]
    assert {name.partition("-")[0] for name in systems} == {"ubuntu", "windows", "macos"}
    words = [step["run"].split()[:2] for step in job["steps"] if "run" in step]
    assert words == [["pip", "install"], ["baker", "bake"], ["baker", "verify"], ["baker", "view"]]
