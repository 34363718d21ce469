"""Kernels where Numba can keep nothing: they are defined and run, and a bake says what that costs."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from baker.trace import kernel_cache

# No folder can be written, as in a read-only install without a home.
NOWHERE = """
import os
from numba.core import caching
caching.CacheImpl._locator_classes = []
os.access = lambda *a, **k: False
"""
KERNELS = """
import pkgutil, importlib
for package in ("kernels", "trace", "lights", "reference"):
    for found in pkgutil.iter_modules(importlib.import_module(f"baker.{package}").__path__):
        importlib.import_module(f"baker.{package}.{found.name}")
from baker.reference.camera import camera_rays, look_at
import numpy as np
way = camera_rays(look_at((0, 0, 0), (0, 0, 1), 30.0), 2, 2, np.arange(4), 1, 0, 0)
np.testing.assert_allclose((way * way).sum(axis=2), 1)
"""
WARNED = """
from baker.warm import cache_warnings, start
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
    assert said("from baker.warm import cache_warnings\nprint(cache_warnings())") == "[]"


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
    monkeypatch.setattr(kernel_cache, "_go_on", lambda kind, function: kinds.append(kind))
    kernel_cache.allow_no_cache(str(package / "__init__.py"))
    assert len(kinds) == changed
