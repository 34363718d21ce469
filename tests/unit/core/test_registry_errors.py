"""Plugin registries find the plugins of a package, and error messages name the plugins that exist."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from baker.core.errors import BakerError, Cancelled, InputError, ResourceError, SettingsError
from baker.core.names import unknown_name
from baker.core.registry import Registry


@pytest.fixture
def plugins(tmp_path, monkeypatch):
    """Make a package `some_plugins` importable: the plugins `alpha` and `zeta`, and their registry."""
    folder = tmp_path / "some_plugins"
    folder.mkdir()
    (folder / "__init__.py").write_text("")
    (folder / "base.py").write_text(
        "from baker.core.registry import Registry\nTHINGS = Registry('some_plugins')\nloaded = []\n"
    )
    for name in ("zeta", "alpha"):
        (folder / f"{name}.py").write_text(
            f"from some_plugins.base import THINGS, loaded\nloaded.append('{name}')\n"
            f"@THINGS.register('{name}')\ndef thing():\n    return '{name}!'\n"
        )
    monkeypatch.syspath_prepend(str(tmp_path))
    yield
    for name in [m for m in sys.modules if m.startswith("some_plugins")]:
        del sys.modules[name]


def test_files_register_themselves(plugins):
    from some_plugins.base import THINGS, loaded

    assert loaded == []
    assert THINGS.names() == ["alpha", "zeta"]
    assert THINGS.get("zeta")() == "zeta!"
    assert THINGS.get("beta") is None
    THINGS.names()
    assert loaded == ["alpha", "zeta"]


def test_a_name_is_taken_once():
    registry = Registry("baker.lights.kinds")
    assert registry.register("mine")(len) is len
    with pytest.raises(ValueError, match=r"'mine' is registered twice in baker\.lights\.kinds"):
        registry.register("mine")(max)
    assert registry.get("mine") is len


@pytest.mark.parametrize(
    ("name", "hidden", "message"),
    [
        ("zeat", (), "there is no thing 'zeat'; did you mean 'zeta'? (known are alpha, zeta)"),
        ("ALPHA", (), "there is no thing 'ALPHA'; did you mean 'alpha'? (known are alpha, zeta)"),
        ("xyz", (), "there is no thing 'xyz'; known are alpha, zeta"),
        ("zeat", ("zeta",), "there is no thing 'zeat'; known are alpha"),
    ],
)
def test_a_required_plugin_that_is_missing(plugins, name, hidden, message):
    from some_plugins.base import THINGS

    assert THINGS.require("zeta", "thing", hidden=hidden)() == "zeta!"
    with pytest.raises(SettingsError) as caught:
        THINGS.require(name, "thing", setting="things", hidden=hidden)
    assert (caught.value.message, caught.value.object) == (message, "things")


def test_a_name_that_is_no_plugin():
    error = unknown_name("setting", "Ao-Smaples", ["seed", "ao_samples"], file="a.toml", object="job 1")
    assert error.message == (
        "there is no setting 'Ao-Smaples'; did you mean 'ao_samples'? (known are seed, ao_samples)"
    )
    assert (error.file, error.object) == ("a.toml", "job 1")
    error = unknown_name("code", "xyz", ["a"], listed="see there")
    assert error.message == "there is no code 'xyz'; see there"
    assert unknown_name("code", "aaa", ["aab"], listed="see there").message.endswith("'aab'? (see there)")


def test_only_one_file_looks_for_the_nearest_name():
    root = Path(__file__).parents[3]
    homes = [
        path.name
        for folder in ("baker", "cli")
        for path in (root / folder).rglob("*.py")
        if "get_close_matches" in path.read_text("utf-8")
    ]
    assert homes == ["names.py"]


@pytest.mark.parametrize(
    ("kind", "code", "name"),
    [
        (SettingsError, 2, "settings"),
        (InputError, 3, "input"),
        (ResourceError, 4, "resource"),
        (Cancelled, 130, "cancelled"),
    ],
)
def test_errors_have_kind_exit_code_file_and_object(kind, code, name):
    error = kind("it is so; do this", file="a.glb", object="mesh 3")
    assert isinstance(error, BakerError)
    assert (error.exit_code, error.kind) == (code, name)
    assert str(error) == "a.glb: mesh 3: it is so; do this"
    assert str(kind("it is so", file="a.glb")) == "a.glb: it is so"
    assert str(kind("it is so", object="mesh 3")) == "mesh 3: it is so"
    assert str(kind("it is so")) == kind("it is so").message == "it is so"
    assert len(BakerError.__subclasses__()) == 4
