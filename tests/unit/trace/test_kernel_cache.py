"""The kernel cache: a warning without a writable folder, and compilation after changes of source files."""

from __future__ import annotations

import os
import subprocess
import sys
import time

import pytest

from baker.trace import kernel_cache

# Script that makes all folders unwritable, as in a read-only installation without a home folder.
NOWHERE = """
import os
from numba.core import caching
caching.CacheImpl._locator_classes = []
os.access = lambda *a, **k: False
"""
KERNELS = """
import pkgutil, importlib
for package in (
    "kernels", "trace", "lights", "pathtracer", "radiosity.kernels", "shading.kernels", "finish.kernels",
    "metrics.kernels", "uv.kernels", "checks.kernels",
):
    for found in pkgutil.iter_modules(importlib.import_module(f"baker.{package}").__path__):
        importlib.import_module(f"baker.{package}.{found.name}")
from baker.pathtracer.camera import camera_rays, look_at
import numpy as np
way = camera_rays(look_at((0, 0, 0), (0, 0, 1), 30.0), 2, 2, np.arange(4), 1, 0, 0)
np.testing.assert_allclose((way * way).sum(axis=2), 1)
"""
WARNED = """
from baker.kernels.not_kept import cache_warnings
from baker.pipeline.precompile import start
assert start() is None
print(*(w.code for w in cache_warnings()))
"""
THEIRS = """
import sys
from numba import njit
def other(x):
    return x
import baker.kernels
try:
    njit(cache=True)(other)
except RuntimeError:
    print("refused")
"""


def said(script):
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=120)
    assert found.returncode == 0, found.stderr
    return found.stdout.strip()


def test_kernels_work_where_nothing_can_be_kept():
    assert said(NOWHERE + KERNELS + WARNED) == "kernels-not-kept"


def test_nothing_is_said_where_they_can():
    assert said("from baker.kernels.not_kept import cache_warnings\nprint(cache_warnings())") == "[]"


def test_other_programs_are_left_alone():
    script = NOWHERE + THEIRS
    assert said(script) == "refused"


@pytest.mark.parametrize(
    ("made", "writable", "changed"), [("", "package", 0), ("__pycache__", "package", 2), ("", "", 2)]
)
def test_a_package_that_was_never_compiled_counts_as_writable(tmp_path, monkeypatch, made, writable, changed):
    package = tmp_path / "package"
    (package / made).mkdir(parents=True)
    monkeypatch.setattr(os, "access", lambda path, mode: path.name == writable)
    kinds = []
    monkeypatch.setattr(kernel_cache, "_suppress_error", lambda kind, function: kinds.append(kind))
    kernel_cache.allow_no_cache(package)
    assert len(kinds) == changed


KERNEL = """
from numba import njit
from part.inner import number
@njit(cache=True)
def kernel():
    return number()
print(kernel(), sum(kernel.stats.cache_hits.values()))
"""


# Imports `outer.kernel` of the folder argv[1] in a forked process for each line of the input. Loading Numba's
# compiler takes longer than all else, so it is loaded once.
FORKS = """
import os, sys
from numba import njit
njit(lambda: 0)()
sys.path.insert(0, sys.argv[1])
sys.dont_write_bytecode = True
for _ in sys.stdin:
    if os.fork() == 0:
        import outer.kernel
        sys.stdout.flush()
        os._exit(0)
    os.wait()
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_kernel_is_compiled_again_when_a_file_it_is_made_of_has_changed(tmp_path):
    part, outer = tmp_path / "part", tmp_path / "outer"
    for folder in (part, outer):
        folder.mkdir()
    (outer / "__init__.py").write_text(
        'from baker.trace.kernel_cache import keep_kernels\nkeep_kernels(__file__, "part")\n'
    )
    (outer / "kernel.py").write_text(KERNEL)

    process = subprocess.Popen(
        [sys.executable, "-c", FORKS, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )

    def run(number=None):
        if number is not None:
            code = f"from numba import njit\n@njit\ndef number():\n    return {number}\n"
            (part / "inner.py").write_text(code)
        process.stdin.write("\n")
        process.stdin.flush()
        return process.stdout.readline().split()

    assert run(1) == ["1", "0"]
    assert run() == ["1", "1"]
    # A source file with a time in the future must not cause a compilation in each run.
    ahead = time.time() + 1000
    os.utime(outer / "kernel.py", (ahead, ahead))
    assert run()[0] == "1"
    assert run() == ["1", "1"]
    now = time.time()
    os.utime(outer / "kernel.py", (now - 100, now - 100))
    assert run()[0] == "1"
    assert run(2) == ["2", "0"]
    assert run() == ["2", "1"]
    process.communicate()
    assert process.returncode == 0
