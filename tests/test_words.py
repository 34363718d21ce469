"""Words that docs/CONVENTIONS.md retires occur in no source file and no docs page."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
GLOSSARY = ROOT / "docs" / "CONVENTIONS.md"
SUFFIXES = {".py", ".md", ".js", ".html", ".toml"}
# Quoted names of objects in scenes are allowed, such as "lamp", "lamp 3" or f"lamp {k}".
OBJECT_NAME = re.compile(r"""(["'])(?:(?:floor_)?lamp(?: (?:\d+|\{\w+\}))?|(?:\{name\} )?glow)\1""")
WITH_OBJECTS = ("assets", "benchmarks", "tests")
# Names of glTF extensions are allowed.
EXTENSION = re.compile(r"\b(?:ADOBE|EXT|KHR|MSFT)_\w+")


def table_cells(heading, end):
    """Return the last cell of each table row between the lines `heading` and `end` of the glossary."""
    text = GLOSSARY.read_text("utf-8")
    text = text[text.index(heading) :]
    text = text[: text.index(end)]
    return [line.split("|")[-2] for line in text.splitlines() if line.startswith("|")]


def quoted(cells):
    return sorted({word for cell in cells for word in re.findall(r"`([^`]+)`", cell)})


def retired_words():
    text = GLOSSARY.read_text("utf-8")
    phrases = re.search(r"Phrases that .*?:(.*?)\n\n", text, re.DOTALL)[1]
    return quoted([*table_cells("## Words", "The next table"), phrases])


def retired_names():
    return quoted(cell for cell in table_cells("The next table", "Phrases that"))


def pattern_of(word):
    """Return a pattern that finds a word alone or as part of a name; `*` matches any letters."""
    body = re.escape(word).replace(r"\*", "[A-Za-z]*").replace(r"\ ", r"\s+")
    before = "" if word.startswith("*") else "(?<![A-Za-z])"
    capital = re.escape(word[0].upper() + word[1:]).replace(r"\*", "[A-Za-z]*").replace(r"\ ", r"\s+")
    return re.compile(rf"{before}{body}(?![a-z])|{capital}(?![a-z])|\b{re.escape(word.upper().strip('*'))}\b")


def names_in(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.Name):
            yield node.lineno, node.id
        elif isinstance(node, ast.arg | ast.keyword):
            yield node.lineno, node.arg
        elif isinstance(node, ast.Attribute):
            yield node.lineno, node.attr
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.lineno, node.name


def places():
    """Return {part of the project: its files and folders}; each package of `baker` is a part."""
    parts = {
        path.name: [path]
        for path in (ROOT / "baker").iterdir()
        if path.is_dir() and path.name != "__pycache__"
    }
    parts |= {
        name: [ROOT / name] for name in ("cli", "docs", "tests", "benchmarks", "assets", "CHANGELOG.md")
    }
    parts["top"] = [
        ROOT / name for name in ("README.md", "CONTRIBUTING.md", "pyproject.toml", "baker/__init__.py")
    ]
    return parts


def files_of(part):
    for path in places()[part]:
        inside = [path] if path.is_file() else sorted(path.rglob("*"))
        for file in inside:
            if (
                file.suffix in SUFFIXES
                and "node_modules" not in file.parts
                and file not in (GLOSSARY, Path(__file__))
            ):
                yield file


def faults(part):
    lines = []
    words = [(word, pattern_of(word)) for word in retired_words()]
    names = set(retired_names())
    for path in files_of(part):
        text = EXTENSION.sub(lambda name: "_" * len(name[0]), path.read_text("utf-8"))
        if part in WITH_OBJECTS:
            text = OBJECT_NAME.sub(lambda name: "_" * len(name[0]), text)
        where = path.relative_to(ROOT).as_posix()
        for word, pattern in words:
            lines += [
                f"{where}:{text.count(chr(10), 0, hit.start()) + 1} {word}: {hit[0]!r}"
                for hit in pattern.finditer(text)
            ]
        if path.suffix == ".py" and part not in ("tests", "benchmarks", "assets", "docs"):
            lines += [
                f"{where}:{line} name {name}" for line, name in names_in(ast.parse(text)) if name in names
            ]
    return lines


@pytest.mark.parametrize("part", sorted(places()))
def test_retired_words_are_gone(part):
    found = faults(part)
    assert not found, "\n" + "\n".join(found)


def test_only_quoted_names_of_objects_are_exempt():
    for text in ('"lamp"', "'lamp'", '"floor_lamp"', 'f"lamp {k}"', '"lamp 12"'):
        assert OBJECT_NAME.search(text), text
    for text in ("lamp", '"lamps"', '"the lamp is off"', '"lamp_table"', "\"lamp'"):
        assert not OBJECT_NAME.search(text), text


def test_the_search_sees_words_in_names():
    assert {"lamp*", "buried", "farm*", "so many"} <= set(retired_words())
    assert {"way", "Subject", "plain"} <= set(retired_names())
    for text in ("lamp", "n_lamps", "LampTable", "LAMP", "cast_to_lamps", "Lamps"):
        assert pattern_of("lamp*").search(text), text
    for text in ("clamp", "stamp", "Clamp"):
        assert not pattern_of("lamp*").search(text), text
    assert pattern_of("*bakery").search("ClusterBakery") or pattern_of("*bakery").search("clusterbakery")
    assert not pattern_of("matt").search("matter")
    assert pattern_of("so many").search("so\nmany")
