"""Writes docs/diagnostics.md: what every code means. `--check` only compares."""

from __future__ import annotations

import sys
from pathlib import Path

from env2mjcf.diagnostics import CATALOGUE

PAGE = Path(__file__).with_suffix(".md")
FAMILIES = {
    "ENV": "Text files: scenes, robots, problems",
    "GEO": "Meshes",
    "KIN": "Bodies and connections",
    "MJC": "What is written for MuJoCo, and where",
    "CFG": "Configurations and queries",
}
HEAD = """# Diagnostics

Everything that env2mjcf finds has a code that stays, a severity, a message, and where there is one a place in the file
and a hint. Information is shown by `env2mjcf info`, `lint` and `--verbose`; warnings always; `strict=True` (`--strict`)
turns warnings into errors. Of each code the first thousand are kept, and one more that counts the others in `times`;
the program shows ten. Written by `docs/diagnostics.py` from `env2mjcf/diagnostics.py`.
"""


def page() -> str:
    """Return the page's text."""
    parts = [HEAD]
    for family, title in FAMILIES.items():
        rows = [f"| `{code}` | {text} |" for code, text in sorted(CATALOGUE.items()) if code.startswith(family)]
        parts.append("\n".join([f"\n## {family}: {title}\n", "| code | meaning |", "|---|---|", *rows, ""]))
    return "".join(parts)


def main() -> int:
    """Write the page, or compare it."""
    if "--check" in sys.argv[1:]:
        return int(not PAGE.exists() or PAGE.read_text(encoding="utf-8") != page())
    PAGE.write_text(page(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
