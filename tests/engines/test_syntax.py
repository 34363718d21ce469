"""Source files for engines that the tests do not run parse without syntax errors."""

from __future__ import annotations

import subprocess

import pytest
from browser import need_program

from baker.exporters.common import template
from baker.exporters.godot import FILES

pytestmark = pytest.mark.engines


def errors(module, source):
    """Return the numbers of the lines with syntax errors, by the grammar in a tree-sitter module."""
    from tree_sitter import Language, Parser

    parser = Parser(Language(module.language()))
    found, waiting = [], [parser.parse(source.encode()).root_node]
    while waiting:
        node = waiting.pop()
        if node.is_error or node.is_missing:
            found.append(node.start_point[0] + 1)
        waiting.extend(node.children)
    return found


@pytest.mark.parametrize("name", [name for name in FILES if name.endswith(".gd")])
def test_gdscript(name):
    import tree_sitter_gdscript

    source = template("godot", name)
    assert errors(tree_sitter_gdscript, source) == []
    assert errors(
        tree_sitter_gdscript, source.replace("():", "(:", 1).replace("(scene: Node", "(scene: (", 1)
    )


def test_rust(probe):
    import tree_sitter_rust

    source = (probe / "bevy" / "baker_lightmaps.rs").read_text("utf-8")
    assert errors(tree_sitter_rust, source) == []
    assert errors(tree_sitter_rust, source.rstrip()[:-1]), "the check sees what is wrong"


@pytest.mark.parametrize("name", ["three", "babylon", "playcanvas"])
def test_javascript(tmp_path, name):
    path = tmp_path / "lightmap.mjs"
    path.write_text(template(name, "lightmap.js"), "utf-8")
    done = subprocess.run(
        [need_program("node", "nodejs"), "--check", path], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
