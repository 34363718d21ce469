"""Writes all settings as keyword types and docstrings of the Python API, for editors and `help`.

python docs/make_keywords.py            writes baker/api/keywords.py, and the lists of settings in docstrings
python docs/make_keywords.py --check    prints the files that differ; exit code 1 if there are any
"""

from __future__ import annotations

import re
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

from baker.checks.settings import CheckSettings
from baker.cli.fields import is_switch, kinds_of, range_of, unit_of
from baker.comparison.settings import DiffSettings
from baker.core.settings import BakeSettings
from baker.core.settings_model import Settings
from baker.io.settings import LoadSettings
from baker.jobs.settings import BatchSettings
from baker.rendering.settings import RenderSettings
from baker.repairs.settings import RepairSettings
from baker.uv.settings import UnwrapSettings
from baker.verification.settings import VerifySettings

API = Path(__file__).parents[1] / "baker" / "api"
MODELS: dict[str, type[Settings]] = {
    "BakeKeywords": BakeSettings,
    "BatchKeywords": BatchSettings,
    "CheckKeywords": CheckSettings,
    "DiffKeywords": DiffSettings,
    "LoadKeywords": LoadSettings,
    "RenderKeywords": RenderSettings,
    "RepairKeywords": RepairSettings,
    "UnwrapKeywords": UnwrapSettings,
    "VerifyKeywords": VerifySettings,
}
TYPES = {
    int: "int", float: "float", bool: "bool", str: "str", Path: "str | Path", tuple: "str | Sequence[str]"
}  # fmt: skip
HEAD = '''\
"""Settings as keywords of the functions of the Python API, for editors and type checkers.

Made by `docs/make_keywords.py` from the models of settings.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal, TypedDict
'''
# The list of settings in a docstring: it begins after these lines and ends at the section "Returns".
LISTED = re.compile(
    r"(    \*\*keywords : Unpack\[(\w+)\]\n        Settings by name, which replace those in `settings`:\n)"
    r".*?(?=\n\n    Returns\n)",
    re.DOTALL,
)


def type_of(field: Any) -> str:
    """Return the annotation of a setting's keyword: all types that the model accepts."""
    found = kinds_of(field)
    if isinstance(found[0], str):
        choices = ", ".join(f'"{choice}"' for choice in found)
        kinds = [f"Literal[{choices}]"]
    else:
        kinds = [TYPES[kind] for kind in found]
        if takes_numbers(field):
            kinds = ["str | float | Sequence[float]" if takes_lists(field) else "str | float"]
    if field.default is None:
        kinds.append("None")
    return " | ".join(kinds)


def takes_numbers(field: Any) -> bool:
    """Return whether a setting that is stored as text also accepts a number."""
    return "_as_text" in f"{field.annotation} {field.metadata}" or takes_lists(field)


def takes_lists(field: Any) -> bool:
    """Return whether a setting that is stored as text also accepts a list of numbers."""
    return "_as_list_text" in f"{field.annotation} {field.metadata}"


def meaning_of(name: str, field: Any) -> tuple[str, str]:
    """Return ("name : type, unit, range, default", description) of a setting."""
    facts = [type_of(field), unit_of(field), "" if is_switch(field) else range_of(field)]
    facts.append(f"default {field.default!r}")
    return f"{name} : {', '.join(filter(None, facts))}", str(field.description)


def class_head(name: str, docstring: str) -> str:
    """Return the first lines of a `TypedDict` class of keywords."""
    return f'\n\nclass {name}(TypedDict, total=False):\n    """{docstring}"""\n'


def keywords() -> str:
    """Return the text of keywords.py."""
    parts = [HEAD]
    for title, model in MODELS.items():
        parts.append(
            f'\n\nclass {title}(TypedDict, total=False):\n    """Keywords of `{model.__name__}`."""\n'
        )
        for name, field in model.model_fields.items():
            comment = textwrap.fill(
                str(field.description), 100, initial_indent="    # ", subsequent_indent="    # ",
                break_long_words=False, break_on_hyphens=False,
            )  # fmt: skip
            parts.append(f"\n{comment}\n    {name}: {type_of(field)}\n")
        if title == "BakeKeywords":
            parts.append(_ao_keywords())
    return "".join(parts)


def _ao_keywords() -> str:
    lines = [
        f"    {name}: {type_of(field)}\n"
        for name, field in BakeSettings.model_fields.items()
        if name != "channels"
    ]
    return class_head("AoKeywords", "Keywords of `BakeSettings` except `channels`.") + "\n" + "".join(lines)


def docstrings(text: str) -> str:
    """Return the source of an API file with new lists of settings in its docstrings."""

    def listed(found: re.Match[str]) -> str:
        lines = []
        for name, field in MODELS[found[2]].model_fields.items():
            head, meaning = meaning_of(name, field)
            wrap = {"width": 108, "break_long_words": False, "break_on_hyphens": False}
            lines += textwrap.wrap(head, initial_indent=" " * 8, subsequent_indent=" " * 16, **wrap)
            lines += textwrap.wrap(meaning, initial_indent=" " * 12, subsequent_indent=" " * 12, **wrap)
        return found[1] + "\n" + "\n".join(lines)

    return LISTED.sub(listed, text)


def formatted(text: str) -> str:
    """Return source as ruff formats it."""
    command = [sys.executable, "-m", "ruff", "format", "--stdin-filename", str(API / "x.py"), "-"]
    return subprocess.run(command, input=text, capture_output=True, text=True, check=True).stdout


def files() -> dict[Path, str]:
    """Return {path: up-to-date text} of keywords.py and of all API files with lists of settings."""
    found = {API / "keywords.py": formatted(keywords())}
    for path in sorted(API.glob("*.py")):
        text = path.read_text("utf-8")
        if LISTED.search(text):
            found[path] = formatted(docstrings(text))
    return found


if __name__ == "__main__":
    stale = [path for path, text in files().items() if not path.exists() or path.read_text("utf-8") != text]
    if "--check" in sys.argv[1:]:
        sys.stdout.write("".join(f"{path}\n" for path in stale))
        sys.exit(bool(stale))
    for path, text in files().items():
        path.write_text(text, "utf-8")
