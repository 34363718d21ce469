"""Kernels are in the right packages, and each package lists the packages whose kernels its kernels use."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
KERNEL = re.compile(r"^@(kernel|inner|pasted)$|njit|cfunc\(|^\w.* = scratch\(|intrinsic", re.MULTILINE)
KEEPS = re.compile(r"^keep_kernels\(__file__(.*?)\)$", re.MULTILINE | re.DOTALL)


def dotted(path):
    parts = list(path.relative_to(ROOT).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def package_of(module):
    return module.rpartition(".")[0]


@pytest.fixture(scope="module")
def texts():
    """Return {module name: source text}."""
    paths = sorted((ROOT / "baker").rglob("*.py"))
    return {dotted(path): path.read_text("utf-8") for path in paths if "templates" not in path.parts}


@pytest.fixture(scope="module")
def imports(texts):
    """Return {module name: modules of `baker` that it imports}, including imports in functions."""
    found = {name: set() for name in texts}
    for name, text in texts.items():
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.ImportFrom) and node.module in texts:
                inner = {f"{node.module}.{alias.name}" for alias in node.names} & set(texts)
                found[name] |= inner or {node.module}
    return found


def test_packages_name_what_their_kernels_are_made_of(texts, imports):
    """If a package were not listed, a change of its kernels would not recompile the kernels that use them."""
    kernels = {name for name, text in texts.items() if KERNEL.search(text)}
    assert {
        "baker.radiosity.kernels.gather",
        "baker.pathtracer.paths",
        "baker.lights.shadow_rays",
    } <= kernels
    named = {}
    for name, text in texts.items():
        for call in KEEPS.findall(text):
            package = name if (ROOT / name.replace(".", "/")).is_dir() else package_of(name)
            named[package] = set(re.findall(r'"([\w.]+)"', call))
    missing = set()
    for name in kernels:
        package, made_of, todo = package_of(name), set(), [name]
        while todo:
            fresh = (imports[todo.pop()] & kernels) - made_of
            made_of |= fresh
            todo += fresh
        missing |= {(package, p) for p in map(package_of, made_of) if p not in {package, *named[package]}}
    assert missing == set()


def test_shared_kernels_are_shared(imports):
    """A kernel in `baker.kernels` is used by several packages; others are in the package that uses them."""
    users = {name: set() for name in imports if name.startswith("baker.kernels.")}
    assert len(users) > 10
    for name, targets in imports.items():
        for target in targets & set(users):
            users[target].add(".".join(name.split(".")[:2]))
    assert {name for name, packages in users.items() if len(packages) < 2} == set()
