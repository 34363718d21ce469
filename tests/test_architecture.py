"""The source keeps its rules: layers, file sizes, one importer per heavy library, types, no local paths."""

from __future__ import annotations

import ast
import importlib
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections import Counter
from functools import cache
from pathlib import Path

import pytest
from kernel_marks import is_kernel

from baker.core.stage import Stage

ROOT = Path(__file__).parents[1]
PACKAGES = ("baker", "cli")
# Libraries that only one file may import, because they are slow to import or hidden behind an interface.
HEAVY = ("embreex", "xatlas", "trimesh", "tinyobjloader", "OpenEXR", "pyoidn", "pydantic", "pymeshlab")
HEAVY += ("distributed", "psutil")
NOT_SOURCE = {
    ".git",
    ".venv",
    "node_modules",
    "build",
    "dist",
    ".mypy_cache",
    ".ruff_cache",
    ".pytest_cache",
    "__pycache__",
}


def sources(*folders):
    for folder in folders:
        yield from sorted((ROOT / folder).rglob("*.py"))


@cache
def tree_of(path):
    return ast.parse(path.read_text("utf-8"), str(path))


def name_of(path):
    return path.relative_to(ROOT).as_posix()


@cache
def imported(path):
    """Return the top-level package names of all imports in a file, including imports in functions."""
    names = set()
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names.add(node.module.split(".")[0])
    return names


def run(*command, cwd=ROOT, **env):
    done = subprocess.run(command, cwd=cwd, env={**os.environ, **env}, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def installed_layout(tmp_path_factory):
    """Return a copy of the packages in their installed layout, where cli/ is baker/cli/."""
    folder = tmp_path_factory.mktemp("layout")
    ignore = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "baker", folder / "baker", ignore=ignore)
    shutil.copytree(ROOT / "cli", folder / "baker" / "cli", ignore=ignore)
    shutil.copy(ROOT / "pyproject.toml", folder)
    return folder


def test_imports_point_down(installed_layout):
    tool = Path(sys.executable).with_name("lint-imports")
    run(str(tool), "--no-cache", cwd=installed_layout, PYTHONPATH=str(installed_layout))


def test_types(installed_layout):
    # The cache is stored in the checkout, so that later runs are fast.
    cache = str(ROOT / ".mypy_cache" / "layout")
    run(sys.executable, "-m", "mypy", "-p", "baker", "--cache-dir", cache, cwd=installed_layout)


def test_lint():
    run(sys.executable, "-m", "ruff", "check", ".")


def test_format():
    run(sys.executable, "-m", "ruff", "format", "--check", ".")


def test_no_file_is_long():
    found = {
        name_of(path): len(path.read_text("utf-8").splitlines())
        for path in sources(*PACKAGES, "tests", "assets")
    }
    found |= {
        name_of(path): len(path.read_text("utf-8").splitlines()) for path in sources("benchmarks", "docs")
    }
    assert {name: lines for name, lines in found.items() if lines > 500} == {}
    assert len(found) > 60


def test_no_two_classes_have_one_name():
    found = Counter(
        node.name
        for path in sources("baker")
        for node in tree_of(path).body
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_")
    )
    assert {name: count for name, count in found.items() if count > 1} == {}
    assert len(found) > 100


def test_no_two_tests_have_one_name():
    """pytest imports test files by file name, so two files with one name cannot be collected."""
    names = [path.name for path in sources("tests") if path.name.startswith("test_")]
    assert sorted({name for name in names if names.count(name) > 1}) == []
    assert len(names) > 150


def long_functions(tree):
    """Yield (name, lines without docstring, parameters without self) of all functions except kernels."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.FunctionDef) or is_kernel(node):
            continue
        first = node.body[0]
        text = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
        docstring = first.end_lineno - first.lineno + 1 if text else 0
        arguments = [a.arg for a in node.args.posonlyargs + node.args.args + node.args.kwonlyargs]
        lines = node.end_lineno - node.lineno + 1 - docstring
        yield node.name, lines, len([name for name in arguments if name not in ("self", "cls")])


def test_no_function_is_long():
    found = [
        (name_of(path), *function)
        for path in sources(*PACKAGES)
        for function in long_functions(tree_of(path))
    ]
    assert [f for f in found if f[2] > 60 or f[3] > 8] == []
    assert len(found) > 1000


@pytest.mark.parametrize("library", HEAVY)
def test_a_heavy_library_has_one_home(library):
    homes = [name_of(path) for path in sources(*PACKAGES) if library in imported(path)]
    assert len(homes) <= 1, homes


def test_pillow_is_imported_by_readers_and_writers_of_pictures_only():
    homes = [name_of(path) for path in sources(*PACKAGES) if "PIL" in imported(path)]
    assert set(homes) <= {
        "baker/io/images.py",
        "baker/io/picture_file.py",
        "baker/io/png.py",
        "baker/io/webp.py",
    }


def test_only_low_layers_import_numba():
    homes = {path.parent.name for path in sources(*PACKAGES) if "numba" in imported(path)}
    # The path tracer has separate kernels, because it is the reference with which bakes are compared.
    assert homes <= {"kernels", "lights", "trace", "pathtracer"}


def test_printing_is_for_the_command_line():
    found = []
    for path in sources("baker"):
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "print":
                found.append(f"{name_of(path)}:{node.lineno}")
    assert found == []


def test_uninitialised_arrays_are_for_kernels():
    found = []
    for path in sources(*PACKAGES):
        if path.parent.name == "kernels":
            continue
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.Attribute) and node.attr in {"empty", "empty_like"}:
                found.append(f"{name_of(path)}:{node.lineno}")
    assert found == []


def stage_literals(tree):
    """Yield string literals that name a stage where stages are passed, looked up, compared or listed."""
    stages = {str(stage) for stage in Stage}

    def text(node):
        return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else None

    for node in ast.walk(tree):
        found = []
        if isinstance(node, ast.Call):
            name = getattr(node.func, "attr", getattr(node.func, "id", ""))
            # `report(progress, stage, ...)`, `progress(stage, ...)`, `record.stage(stage)`.
            if name in {
                "report",
                "tell_progress",
                "report_progress",
                "progress",
                "reporter",
                "stage",
                "runner",
            }:
                found += node.args[:2]
            if name == "get" and getattr(node.func, "attr", "") == "get":
                owner = ast.unparse(node.func.value)
                found += node.args[:1] if re.search(r"timings|rays", owner) else []
            found += [word.value for word in node.keywords if word.arg == "stage"]
        elif isinstance(node, ast.Subscript) and re.search(r"timings|rays", ast.unparse(node.value)):
            found.append(node.slice)
        elif isinstance(node, ast.Compare) and "stage" in ast.unparse(node).lower():
            found += [node.left, *node.comparators]
        elif isinstance(node, ast.Assign) and "STAGE" in ast.unparse(node.targets[0]):
            found += [node.value, *getattr(node.value, "elts", [])]
        elif isinstance(node, ast.List | ast.Tuple | ast.Set | ast.Dict):
            parts = node.keys if isinstance(node, ast.Dict) else node.elts
            # Yield names in a list only if all its items name stages. A single name may be another kind of
            # key.
            if len(parts) > 1 and all(part is not None and text(part) in stages for part in parts):
                found += parts
        elif text(node) in stages and " " in node.value and node.value != Stage.AMBIENT_OCCLUSION:
            # Yield these names anywhere, because they name only stages. "ambient occlusion" is also a
            # quantity.
            found.append(node)
        yield from (part for part in found if part is not None and text(part) in stages)


def test_names_of_stages_have_one_home():
    found = {
        f"{name_of(path)}:{part.lineno} {part.value}"
        for path in sources("baker", "cli", "benchmarks")
        if path != ROOT / "baker" / "core" / "stage.py"
        for part in stage_literals(tree_of(path))
    }
    assert found == set()


@pytest.mark.parametrize(
    "line",
    [
        'report(progress, "solve", 0.5)',
        'progress("load", 0.0)',
        'with record.stage("texels"): pass',
        'run_tiles(n, 8, work, stage="unwrap", progress=silent)',
        'seconds = best["timings"]["finish"]',
        'seconds = timings.get("write", 0.0)',
        'STAGE = "finish"',
        'BY_TEXEL = ("texels", "finish")',
        'cost = {"direct light": 1}',
        'if stage == "solve": pass',
    ],
)
def test_a_stage_literal_is_found(line):
    assert [part.value for part in stage_literals(ast.parse(line))]
    assert not list(stage_literals(ast.parse(re.sub(r'"[a-z ]+"', "Stage.SOLVE", line))))


def test_no_variable_of_the_environment_is_read():
    # Code may pass the whole environment to a helper process, but not read variables.
    found = []
    for path in sources(*PACKAGES):
        for node in ast.walk(tree_of(path)):
            looked = node.value if isinstance(node, ast.Subscript | ast.Attribute) else None
            name = getattr(looked, "attr", None)
            if name == "environ" or getattr(node, "attr", None) in {"getenv", "putenv"}:
                found.append(f"{name_of(path)}:{node.lineno}")
    assert found == []


def registrations(path):
    """Return (variable of the registry, name, AST node of the plugin) for each registration in a file."""
    tree = tree_of(path)
    calls = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            calls |= dict.fromkeys(node.decorator_list, node)
        elif isinstance(node, ast.Call):
            calls[node.func] = node
    return [
        (call.func.value.id, call.args[0].value, plugin)
        for call, plugin in calls.items()
        if isinstance(call, ast.Call)
        and isinstance(call.func, ast.Attribute)
        and call.func.attr == "register"
        and isinstance(call.args[0], ast.Constant)
    ]


def is_plugin(path, registry):
    """Return whether a file registers a plugin in a registry; checks use the decorator `check`."""
    if registry == "CHECKS":
        return re.search(r"^@check\(", path.read_text("utf-8"), re.MULTILINE) is not None
    return any(variable == registry for variable, _, _ in registrations(path))


def registries():
    """Return {variable name in the source: registry}."""
    found = {}
    for path in sources("baker"):
        module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        for node in ast.walk(tree_of(path)):
            made = node.value if isinstance(node, ast.AnnAssign) else None
            if isinstance(made, ast.Call) and getattr(made.func, "id", None) == "Registry":
                found[node.target.id] = getattr(importlib.import_module(module), node.target.id)
    return found


def test_a_plugin_file_registers_one_thing():
    count, seen = {}, {}
    for path in sources("baker"):
        found = registrations(path)
        # Count plugins and not names, because an importer may be registered for several suffixes.
        count[name_of(path)] = len({plugin for _, _, plugin in found})
        for registry, name, _ in found:
            seen.setdefault(registry, []).append(name)
    assert {name: plugins for name, plugins in count.items() if plugins > 1} == {}
    # All registered names were found in the source. Checks use the decorator `check` instead.
    names = {variable: registry.names() for variable, registry in registries().items()}
    assert names.pop("CHECKS")
    assert {variable: sorted(found) for variable, found in seen.items()} == names


def test_registries_are_constants_and_find_only_plugins():
    """Each module in the package of a registry is a plugin, or is imported by a plugin of the package."""
    found = registries()
    assert len(found) >= 6
    assert [variable for variable in found if not variable.isupper()] == []
    idle = []
    for variable, registry in found.items():
        folder = ROOT.joinpath(*registry.package.split("."))
        modules = {path.stem: path for path in folder.glob("*.py") if path.stem != "__init__"}
        used = {name for name, path in modules.items() if is_plugin(path, variable)}
        todo = list(used)
        while todo:
            tree = tree_of(modules[todo.pop()])
            named = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
            fresh = {name for name in modules if f"{registry.package}.{name}" in named} - used
            used |= fresh
            todo += fresh
        idle += [name_of(path) for name, path in modules.items() if name not in used]
    assert idle == []


def test_no_path_of_one_machine():
    # The words are split so that the pattern does not match this line.
    leak = re.compile(r"(?:^|[^\w.\-/])/(?:wo" + r"rk|ro" + r"ot|ho" + r"me|Us" + r"ers|tm" + r"p)/\w")
    found = []
    for path in sorted(ROOT.rglob("*")):
        relative = path.relative_to(ROOT)
        if not path.is_file() or NOT_SOURCE & set(relative.parts) or relative.parts[0].startswith("out"):
            continue
        if path.suffix in {".py", ".md", ".toml", ".yml", ".yaml", ".txt", ".json"} or path.name == "run":
            for number, line in enumerate(path.read_text("utf-8").splitlines(), 1):
                if leak.search(line):
                    found.append(f"{relative}:{number}")
    assert found == []


def test_checks_page_is_current():
    page = run(sys.executable, str(ROOT / "docs" / "make_checks_page.py"), "--print")
    assert (ROOT / "docs" / "CHECKS.md").read_text("utf-8") == page


def test_formats_page_is_current():
    page = run(sys.executable, str(ROOT / "docs" / "make_formats_page.py"), "--print")
    assert (ROOT / "docs" / "FORMATS.md").read_text("utf-8") == page


def test_settings_page_is_current():
    page = run(sys.executable, str(ROOT / "docs" / "make_settings_page.py"), "--print")
    assert (ROOT / "docs" / "SETTINGS.md").read_text("utf-8") == page


def test_table_of_figures_is_current():
    page = run(sys.executable, str(ROOT / "docs" / "make_figures_table.py"), "--print")
    assert (ROOT / "docs" / "ACCURACY.md").read_text("utf-8") == page


def test_code_map_is_current():
    page = run(sys.executable, str(ROOT / "docs" / "make_code_map.py"), "--print")
    assert (ROOT / "docs" / "ARCHITECTURE.md").read_text("utf-8") == page
    packages = {name_of(path.parent) + "/" for path in (ROOT / "baker").rglob("__init__.py")} - {"baker/"}
    for package in {*packages, "cli/"}:
        assert re.search(rf"^\| `{package}` \| \w.+ \|$", page, re.MULTILINE), package


def test_every_package_is_installed():
    with (ROOT / "pyproject.toml").open("rb") as file:
        listed = tomllib.load(file)["tool"]["setuptools"]["packages"]
    found = {name_of(path.parent).replace("/", ".") for path in (ROOT / "baker").rglob("__init__.py")}
    assert set(listed) == found | {"baker.cli"}
