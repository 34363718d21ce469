"""Required docs pages and sections exist, and all relative links in docs pages have targets."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from baker.core.export import EXPORTS

ROOT = Path(__file__).parents[1]
PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "CHANGELOG.md",
    *sorted(ROOT.glob("docs/**/*.md")),
]
LINK = re.compile(r"\]\(([^)\s]+)\)")
CODE = re.compile(r"^ *```.*?^ *```$|`[^`\n]*`", re.DOTALL | re.MULTILINE)


def anchors(path):
    """Return the anchors of a page's headings, formed by the rule of code hosts."""
    text = re.sub(r"^ *```.*?^ *```$", "", path.read_text("utf-8"), flags=re.DOTALL | re.MULTILINE)
    titles = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).strip().replace(" ", "-") for title in titles}


def broken(page):
    """Return the relative links of a page whose file or anchor does not exist."""
    # Replace code, in which brackets are no links; the text of a link may itself be code.
    text = CODE.sub("code", page.read_text("utf-8"))
    found = []
    for link in LINK.findall(text):
        if re.match(r"[a-z]+:", link):
            continue
        name, _, anchor = link.partition("#")
        target = page.parent / name if name else page
        if not target.exists() or (anchor and anchor not in anchors(target)):
            found.append(link)
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_somewhere(page):
    assert broken(page) == []


def test_a_broken_link_is_seen(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(
        "# One `two`\n[a](page.md) [`b`](gone.md) [c](#one-two) ![d](#three)\n"
        "[e](https://example.com/x) `[f](g)`\n"
    )
    assert broken(page) == ["gone.md", "#three"]


def test_every_export_has_its_page():
    assert {path.stem for path in (ROOT / "docs" / "engines").iterdir()} == set(EXPORTS.names())


@pytest.mark.parametrize("name", EXPORTS.names())
def test_the_page_of_an_export_answers_all_questions(name):
    text = (ROOT / "docs" / "engines" / f"{name}.md").read_text("utf-8")
    assert re.search(rf"^baker bake \S+ -o out --export {name}$", text, re.MULTILINE)
    titles = re.findall(r"^## (.+)$", text, re.MULTILINE)
    for title in ("Step by step", "What the numbers mean", "What was run", "When it looks wrong"):
        assert any(found.startswith(title) for found in titles), title
    assert f"(engines/{name}.md)" in (ROOT / "docs" / "ENGINES.md").read_text("utf-8")


def test_the_readme_names_every_command():
    from baker.cli.commands import COMMANDS

    text = (ROOT / "README.md").read_text("utf-8")
    assert set(COMMANDS) == set(re.findall(r"^\| `baker (\w+)", text, re.MULTILINE))
