"""Writes API.md from the docstrings of the Python API.

python docs/make_api_page.py            writes the page
python docs/make_api_page.py --print    prints it instead
"""

from __future__ import annotations

import dataclasses
import inspect
import re
import sys
import textwrap
from enum import Enum
from pathlib import Path
from typing import Any

import baker
from baker.core.settings_model import Settings

HEAD = """\
# Python API

The Python API has a function for each command except `inspect`, and functions for single stages of a bake:

```python
import baker

scene = baker.load("level.glb")
report = baker.check(scene)
atlas = baker.unwrap(scene, baker.UnwrapSettings(resolution=1024))
bake = baker.bake(scene, atlas=atlas, settings=baker.BakeSettings(quality="high"))
baker.save(bake, "out", export=["godot"])
baker.verify("out").channels["irradiance"].figures["median"]
```

Pass settings as keywords, as an object of the class that the signature names, or as both. A keyword replaces
the value in the object. Values are validated when the settings object is made. All errors are subclasses of
`BakerError`. Results have a one-line `repr`, a table with a small picture in notebooks, and `to_dict()`,
which returns plain values for JSON. Results can be pickled. Two results are equal only if they are the same
object.

`docs/make_api_page.py` generates this page from docstrings. The examples run as tests, in the order of this
page. [SETTINGS.md](SETTINGS.md) has tables of the settings of all functions.
"""
# In the order of the examples, which use results of earlier examples.
FUNCTIONS = (
    "load", "check", "repair", "unwrap", "bake", "ao", "save", "export", "verify", "diff", "render", "view",
    "batch",
)  # fmt: skip
SECTION = re.compile(r"^(\w[\w ]*)\n-+$", re.MULTILINE)


def sections(text: str) -> dict[str, str]:
    """Return {title: text} of the sections of a numpydoc docstring; the text before them has title ''."""
    parts = SECTION.split(text)
    return {"": parts[0].strip()} | {
        title: body.strip("\n") for title, body in zip(parts[1::2], parts[2::2], strict=True)
    }


def entries(body: str) -> list[tuple[str, str]]:
    """Return (head, text) of each entry of a section; lines without indentation are heads."""
    found: list[tuple[str, list[str]]] = []
    for line in body.splitlines():
        if line and not line.startswith(" "):
            found.append((line, []))
        elif found:
            found[-1][1].append(line)
    return [(head, textwrap.dedent("\n".join(lines)).strip()) for head, lines in found]


def parameters(body: str) -> list[str]:
    """Return a list item for each parameter; the settings of `**keywords` are nested items."""
    lines = []
    for head, text in entries(body):
        name, _, kind = head.partition(" : ")
        if not name.startswith("**"):
            lines.append(f"- `{name}` ({kind}): {' '.join(text.split())}" if kind else f"- `{name}`")
            continue
        lead, _, rest = text.partition("\n\n")
        lines.append(f"- `{name}`: {' '.join(lead.split())}")
        for setting, meaning in entries(rest):
            key, _, facts = setting.partition(" : ")
            lines.append(f"  - `{key}` (`{facts}`): {' '.join(meaning.split())}")
    return lines


def function(name: str) -> str:
    """Return the Markdown section of a function."""
    found = getattr(baker, name)
    parts = sections(inspect.getdoc(found) or "")
    lines = [f"### {name}", "", "```python", signature(name, found), "```", "", parts[""], ""]
    lines += [*parameters(parts["Parameters"]), ""]
    for head, text in entries(parts["Returns"]):
        lines += [f"Returns `{head}`: {' '.join(text.split())}", ""]
    for head, text in entries(parts.get("Raises", "")):
        lines.append(f"- raises `{head}`: {' '.join(text.split())}")
    lines += ["", *examples(parts.get("Examples", ""))]
    return "\n".join(lines).rstrip() + "\n"


def signature(name: str, found: Any) -> str:
    """Return a function's signature; if it exceeds 100 characters, with one parameter on each line."""
    shown = inspect.signature(found)
    words: list[str] = []
    for parameter in shown.parameters.values():
        if parameter.kind is parameter.KEYWORD_ONLY and "*" not in words:
            words.append("*")
        words.append(shown_parameter(parameter))
    text = f"baker.{name}({', '.join(words)}) -> {shown.return_annotation}"
    if len(text) <= 100:
        return text
    body = ",\n    ".join(words)
    return f"baker.{name}(\n    {body},\n) -> {shown.return_annotation}"


def shown_parameter(parameter: inspect.Parameter) -> str:
    """Return the text of a parameter in a signature: name, annotation and default."""
    stars = "**" if parameter.kind is parameter.VAR_KEYWORD else ""
    text = f"{stars}{parameter.name}: {parameter.annotation}"
    if parameter.default is parameter.empty:
        return text
    default = parameter.default
    return f"{text} = {default.__name__ if inspect.isfunction(default) else repr(default)}"


def examples(text: str) -> list[str]:
    """Return the lines of the section "Examples": code blocks, and paragraphs for the text between them."""
    lines: list[str] = []
    for block in re.split(r"\n\n+", text):
        if block.startswith(">>>"):
            lines += ["```python", block, "```", ""]
        elif block:
            lines += [block, ""]
    return lines


def type_section(name: str) -> str:
    """Return the Markdown section of a class: first paragraph of its docstring, and fields or members."""
    found = getattr(baker, name)
    parts = sections(inspect.getdoc(found) or "")
    lines = [f"### {name}", "", " ".join(parts[""].split("\n\n")[0].split()), ""]
    if issubclass(found, Settings):
        lines.append(f"Fields: {', '.join(f'`{field}`' for field in found.model_fields)}.")
    elif issubclass(found, Enum):
        lines.append(f"Members: {', '.join(f'`{member.name}` = {member.value}' for member in found)}.")
    elif "Attributes" in parts:
        for head, text in entries(parts["Attributes"]):
            names, _, kind = head.partition(" : ")
            words = ": " + " ".join(text.split()) if text else ""
            lines.append(f"- `{names}` ({kind}){words}" if kind else f"- `{names}`{words}")
    elif dataclasses.is_dataclass(found):
        lines.append(f"Fields: {', '.join(f'`{field.name}`' for field in dataclasses.fields(found))}.")
    return "\n".join(lines).rstrip() + "\n"


def page() -> str:
    """Return the text of the page."""
    types = [name for name in baker.__all__ if name[0].isupper()]
    parts = [HEAD, "## Functions\n", *(function(name) for name in FUNCTIONS)]
    parts += ["## Types\n", *(type_section(name) for name in types)]
    return "\n".join(parts)


if __name__ == "__main__":
    if "--print" in sys.argv[1:]:
        sys.stdout.write(page())
    else:
        Path(__file__).with_name("API.md").write_text(page(), "utf-8")
