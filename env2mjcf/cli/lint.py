"""`env2mjcf lint`."""

from __future__ import annotations

import dataclasses
import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

import tyro
from tyro.conf import Positional

from ..diagnostics import totals
from ..errors import Diagnostic, Severity, counted
from ..options import Options
from .arguments import OptionFlags, Output, OutputFlags
from .program import BAD_INPUT, DONE, FAULT, FINDING
from .terminal import console_on, listed, one_line, print_diagnostic, print_json, printable, remark

_GITHUB_LEVELS = {Severity.ERROR: "error", Severity.WARNING: "warning", Severity.INFO: "notice"}


@dataclass(frozen=True, slots=True)
class Lint:
    """List everything doubtful in scenes, their robots and meshes, and what touches at home.

    Of each file a few findings of each code are listed, all with --verbose; totals by code stand at the end.
    Folders are searched for .env, .robot and .xml files. An error in one file does not keep the others from being
    looked at. The exit status is 1 if there is an error; with --strict also if there is a warning; 3 if a path does not
    exist; 4 if a fault of env2mjcf, or too little memory, ended the look at a file.

    Examples:
      env2mjcf lint scenes/
      env2mjcf lint a.env b.env part.g --strict
      env2mjcf lint scenes/ --github                  annotations for GitHub Actions
      env2mjcf lint scenes/ --json | jq .errors

    Attributes:
        paths: Folders, scenes, robot files or meshes.
        github: Print GitHub annotations.
    """

    paths: Annotated[tuple[str, ...], tyro.conf.arg(metavar="PATH [PATH ...]"), Positional]
    github: bool = False
    output: OutputFlags = field(default_factory=Output)
    options: OptionFlags = field(default_factory=Options)

    def run(self) -> int:
        """Print all findings and a summary; 1 if there is an error, or in strict mode a warning; 3 without a path."""
        from ..linting import lint

        if not self.paths:
            raise ValueError("a path is missing; expected folders, scenes, robot files or meshes")
        if self.github and self.output.json:
            raise ValueError("--json and --github exclude each other")
        results = lint(self.paths, self.options, progress=True)
        errors, warnings, notes = (sum(r.count(s) for r in results) for s in reversed(Severity))
        counts = [(errors, "error"), (warnings, "warning"), (notes, "note")]
        summary = f"{counted(len(results), 'file')}: {', '.join(counted(n, what) for n, what in counts)}"
        by_code = totals(d for r in results for d in r.diagnostics)
        results = [dataclasses.replace(r, diagnostics=listed(r.diagnostics, self.output.verbose)) for r in results]
        if self.output.json:
            sums = {"errors": errors, "warnings": warnings, "notes": notes, "codes": by_code}
            print_json({**sums, "files": results})
        elif self.github:
            for result in results:
                for diagnostic in result.diagnostics:
                    print(github_annotation(diagnostic, result.path))
            print(*(f"{code} {count}" for code, count in by_code.items()), summary, sep="\n", file=sys.stderr)
        else:
            console = console_on(sys.stdout, soft_wrap=True)
            for result in results:
                for diagnostic in result.diagnostics:
                    print_diagnostic(console, diagnostic, result.path)
            for code, count in by_code.items():
                print(f"{code} {count}")
            print(summary)
        if not results:
            remark("lint: no scene, robot or mesh was found")
        return self._status(by_code, errors, warnings)

    def _status(self, by_code: Mapping[str, int], errors: int, warnings: int) -> int:
        from ..linting import FAULT as FAULT_CODE

        if FAULT_CODE in by_code:
            return FAULT
        if not all(os.path.lexists(path) for path in self.paths):
            return BAD_INPUT  # what the error says
        return FINDING if errors or (self.options.strict and warnings) else DONE


def github_annotation(diagnostic: Diagnostic, path: str) -> str:
    """Return the workflow command that makes GitHub show a diagnostic beside its line.

    Args:
        diagnostic: What was found.
        path: The file to show it at where it has no place of its own.
    """
    span = diagnostic.span
    properties = {"file": span.path if span else path}
    if span:
        properties |= {"line": str(span.line), "col": str(span.column), "endColumn": str(span.column + span.length)}
    properties["title"] = f"env2mjcf {diagnostic.code}"
    listed = ",".join(f"{k}={_github_property(v)}" for k, v in properties.items())
    message = diagnostic.message + (f"\nhint: {diagnostic.hint}" if diagnostic.hint else "")
    return f"::{_GITHUB_LEVELS[diagnostic.severity]} {listed}::{_github_text(printable(message))}"


def _github_text(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _github_property(text: str) -> str:
    return _github_text(one_line(text)).replace(":", "%3A").replace(",", "%2C")
