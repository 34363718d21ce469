"""Registers of plugins, and the words of errors."""

from __future__ import annotations

import sys

import pytest

from baker.core.errors import BakerError, Cancelled, InputError, ResourceError, SettingsError
from baker.core.registry import Registry


@pytest.fixture
def plugins(tmp_path, monkeypatch):
    """A package of two plugins and a file that registers nothing."""
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
    registry = Registry("baker.lights")
    assert registry.register("mine")(len) is len
    with pytest.raises(ValueError, match=r"'mine' is registered twice in baker\.lights"):
        registry.register("mine")(max)
    assert registry.get("mine") is len


@pytest.mark.parametrize(
    ("kind", "code", "name"),
    [
        (SettingsError, 2, "settings"),
        (InputError, 3, "input"),
        (ResourceError, 4, "resource"),
        (Cancelled, 130, "cancelled"),
    ],
)
def test_errors_know_their_place(kind, code, name):
    error = kind("it is so; do this", file="a.glb", object="mesh 3")
    assert isinstance(error, BakerError)
    assert (error.exit_code, error.kind) == (code, name)
    assert str(error) == "a.glb: mesh 3: it is so; do this"
    assert str(kind("it is so", file="a.glb")) == "a.glb: it is so"
    assert str(kind("it is so", object="mesh 3")) == "mesh 3: it is so"
    assert str(kind("it is so")) == kind("it is so").message == "it is so"
    assert len(BakerError.__subclasses__()) == 4
