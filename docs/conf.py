"""Sphinx settings: `make docs` builds the site from the pages of this folder, without network and without warnings."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from importlib.metadata import version as installed_version
from pathlib import Path, PurePosixPath
from posixpath import normpath

from sphinx.application import Sphinx
from sphinx.pycode import ModuleAnalyzer

HERE = Path(__file__).resolve().parent
# The checkout's code is what is described, whatever is installed.
sys.path[:0] = [str(HERE.parent), str(HERE)]

import generated  # noqa: E402

project = "env2mjcf"
author = "the authors of env2mjcf"
copyright = author
release = version = installed_version("env2mjcf")

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["_build", "figures"]
source_suffix = {".md": "markdown"}
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
myst_url_schemes = ["http", "https"]

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_type_aliases = {
    name: name for name in ("ArrayLike", "Array", "Collision", "Semantics", "PathArgument", "DialectName", "Engine")
}
python_use_unqualified_type_names = True
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
# In docstrings, `name` means the object of that name where there is one.
default_role = "py:obj"
add_module_names = False
toc_object_entries_show_parents = "hide"

html_theme = "furo"
html_title = "env2mjcf"
html_copy_source = False
html_show_sourcelink = False
html_show_copyright = False
html_theme_options = {"top_of_page_buttons": []}

# Markdown files beside this folder, and the pages that include them.
PAGES = {
    "README.md": "/index.md",
    "CHANGELOG.md": "/changelog.md",
    "CONTRIBUTING.md": "/contributing.md",
    "SECURITY.md": "/security.md",
    "benchmarks/RESULTS.md": "/benchmarks/results.md",
    "benchmarks/corpus.md": "/benchmarks/corpus.md",
    "benchmarks/speed.md": "/benchmarks/speed.md",
    "benchmarks/truth.md": "/benchmarks/truth.md",
    "benchmarks/truth-exact.md": "/benchmarks/truth-exact.md",
}


def with_site_links(text: str, folder: PurePosixPath) -> str:
    """Return Markdown whose links between files of the checkout lead to pages of the site.

    Args:
        text: The Markdown.
        folder: Folder of the file that holds it, relative to the checkout.
    """

    def target(match: re.Match[str]) -> str:
        file, anchor = match["file"], match["anchor"] or ""
        path = normpath(folder / file)
        page = PAGES.get(path) or (f"/{path.removeprefix('docs/')}" if path.startswith("docs/") else file)
        return f"]({page}{anchor})"

    return re.sub(r"\]\((?P<file>[\w./-]+\.(?:md|png|svg))(?P<anchor>#[\w-]+)?\)", target, text)


def on_source(app: Sphinx, docname: str, content: list[str]) -> None:
    """Put in what is generated, and turn links to files of the checkout into links to pages."""
    text = with_site_links(content[0], PurePosixPath("docs", docname).parent)
    content[0] = re.sub(r"^<!-- generated: (\w+) -->$", lambda m: generated.PARTS[m[1]](), text, flags=re.MULTILINE)


def on_include(app: Sphinx, relative_path: Path, parent_docname: str, content: list[str]) -> None:
    """Turn links of a file of the checkout into links to pages."""
    path = (HERE / relative_path).resolve().relative_to(HERE.parent)
    content[0] = with_site_links(content[0], PurePosixPath(path.as_posix()).parent)


# What the docstrings of properties say, before napoleon takes all up to a colon for a type.
WORDS: dict[str, list[str]] = {}


def on_docstring(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    """Keep what properties say from napoleon."""
    if what in ("attribute", "property"):
        WORDS[name] = list(lines)


def on_fields(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    """Keep docutils from taking for links, or for bold, what is neither.

    Names of types that end in an underscore, endings of files such as `.xml`, and keyword arguments (`**options`).
    """
    lines[:] = WORDS.pop(name, lines)
    lines[:] = [re.sub(r"\bnp\.bool_(?=\W|$)", "bool", line) if ":vartype" in line else line for line in lines]
    lines[:] = [re.sub(r"(?<!`)`(\.\w+)`(?!`)", r"``\1``", line) for line in lines]
    lines[:] = [re.sub(r"(?<!\S)\*\*(?=\w+ )(?!.*\*\*)", r"\\*\\*", line) for line in lines]


def on_signature(
    app: Sphinx, what: str, name: str, obj: object, options: object, signature: str | None, returns: str | None
) -> tuple[str | None, str | None]:
    """Let an alias in a union be its name."""
    alias = re.compile(r"TypeAliasForwardRef\('(\w+)'\)")
    return signature and alias.sub(r"\1", signature), returns and alias.sub(r"\1", returns)


def without_overloads(
    analyzer: ModuleAnalyzer, analyze: Callable[[ModuleAnalyzer], None] = ModuleAnalyzer.analyze
) -> None:
    """Let a method have one signature, that of its code: overloads are for type checkers."""
    analyze(analyzer)
    analyzer.overloads.clear()


def setup(app: Sphinx) -> None:
    """Connect these."""
    ModuleAnalyzer.analyze = without_overloads
    app.connect("source-read", on_source)
    app.connect("include-read", on_include)
    app.connect("autodoc-process-signature", on_signature)
    app.connect("autodoc-process-docstring", on_docstring, priority=400)
    app.connect("autodoc-process-docstring", on_fields, priority=600)
