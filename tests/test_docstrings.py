"""Docstrings are complete: numpydoc for public functions, array arguments for kernels.

A function is public if a file of another package of `baker`, or of `cli`, imports it by name. Its docstring
must pass the checks of numpydoc that `CHECKS` lists, and its Raises section must name each error that its
body raises. The docstring of a kernel must name each argument that its body indexes.
"""

from __future__ import annotations

import ast
import functools
import re
from pathlib import Path

import pytest
from kernel_marks import is_kernel
from numpydoc.hooks.validate_docstrings import AstValidator
from numpydoc.validate import validate

ROOT = Path(__file__).parents[1]
# The checks of numpydoc 1.11: https://numpydoc.readthedocs.io/en/latest/validation.html
CHECKS = {
    "GL08": "there is a docstring",
    "SS03": "the summary ends with a full stop",
    "PR01": "each parameter is documented",
    "PR02": "each documented parameter exists",
    "PR03": "in the order of the signature",
    "PR04": "with its type",
    "PR07": "and a description",
    "RT01": "what is returned is documented",
    "RT03": "with a description",
    "YD01": "what is yielded is documented",
}
PACKAGES = sorted(
    {path.stem for path in (ROOT / "baker").iterdir() if (path / "__init__.py").exists()}
    | {"__init__", "cli"}
)


def package_of(path):
    """Return the package of a file: its folder below `baker`, `__init__` for baker/__init__.py, or `cli`."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return parts[1] if parts[0] == "baker" else "cli"


def files():
    return sorted([*(ROOT / "baker").rglob("*.py"), *(ROOT / "cli").rglob("*.py")])


@functools.cache
def trees():
    return {path: ast.parse(path.read_text("utf-8")) for path in files()}


@functools.cache
def public_names():
    """Return {(module, name)} of all names that a file of another package imports."""
    names = set()
    for path, tree in trees().items():
        for node in ast.walk(tree):
            if not isinstance(node, ast.ImportFrom) or not (node.module or "").startswith("baker."):
                continue
            owner = node.module.split(".")[1]
            if owner != package_of(path):
                names |= {(node.module, alias.name) for alias in node.names}
    return names


def is_overload(node):
    """Return whether a function only declares types for a checker; its implementation has the docstring."""
    return any(isinstance(each, ast.Name) and each.id == "overload" for each in node.decorator_list)


def indexed_arguments(node):
    """Return the arguments of a kernel that its body indexes, in the order of the signature."""
    indexed = {
        part.value.id
        for part in ast.walk(node)
        if isinstance(part, ast.Subscript) and isinstance(part.value, ast.Name)
    }
    return [argument.arg for argument in node.args.args if argument.arg in indexed]


def raised(node):
    """Return the names of the errors that a function raises, without those of nested functions."""
    names, queue = set(), list(node.body)
    while queue:
        part = queue.pop()
        if isinstance(part, ast.FunctionDef | ast.Lambda | ast.ClassDef):
            continue
        if (
            isinstance(part, ast.Raise)
            and isinstance(part.exc, ast.Call)
            and isinstance(part.exc.func, ast.Name)
        ):
            names.add(part.exc.func.id)
        queue.extend(ast.iter_child_nodes(part))
    return {name for name in names if name[0].isupper()}


def faults_of_function(path, node, ancestry):
    result = validate(node.name, AstValidator, ast_node=node, filename=str(path), ancestry=ancestry)
    for code, message in result["errors"]:
        if code in CHECKS:
            yield f"{code} {message}"
    docstring = ast.get_docstring(node) or ""
    raises = docstring.partition("\nRaises\n")[2]
    for error in sorted(raised(node)):
        if not re.search(rf"\b{error}\b", raises):
            yield f"raises {error}, which its Raises section does not name"


def faults(package):
    """Return one line for each broken rule in a package's docstrings."""
    lines = []
    public = public_names()
    for path, tree in trees().items():
        if package_of(path) != package:
            continue
        module = ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
        where = path.relative_to(ROOT).as_posix()
        for node in tree.body:
            if not isinstance(node, ast.FunctionDef) or is_overload(node):
                continue
            if is_kernel(node):
                words = set(re.findall(r"\w+", ast.get_docstring(node) or ""))
                missing = [name for name in indexed_arguments(node) if name not in words]
                if missing:
                    lines.append(f"{where}:{node.lineno} {node.name}: does not describe {', '.join(missing)}")
            elif (module, node.name) in public or (package == "__init__" and not node.name.startswith("_")):
                found = faults_of_function(path, node, [tree])
                lines.extend(f"{where}:{node.lineno} {node.name}: {fault}" for fault in found)
    return lines


@pytest.mark.parametrize("package", PACKAGES)
def test_docstrings_are_complete(package):
    found = faults(package)
    assert not found, "\n" + "\n".join(found)


def test_each_kind_of_fault_is_seen(tmp_path):
    """Each rule reports a function that breaks it."""
    source = '''
def bare(a):
    pass

def partly(a, b):
    """Add two numbers

    Parameters
    ----------
    a : int
        First.
    """
    if a:
        raise InputError("no")
    return a + b
'''
    tree = ast.parse(source)
    bare, partly = tree.body
    path = tmp_path / "x.py"
    path.write_text(source)
    assert {line[:4] for line in faults_of_function(path, bare, [tree])} >= {"GL08"}
    found = "\n".join(faults_of_function(path, partly, [tree]))
    for code in ("SS03", "PR01", "RT01", "InputError"):
        assert code in found
    kernel = ast.parse("@kernel(parallel=True)\ndef f(a, n):\n    a[n] = 1\n").body[0]
    assert is_kernel(kernel)
    assert indexed_arguments(kernel) == ["a"]
