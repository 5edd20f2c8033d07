"""The program `env2mjcf`: finds the verb, runs it, turns what goes wrong into an exit status."""

from __future__ import annotations

import io
import os
import sys
import traceback
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from typing import TYPE_CHECKING

from ..errors import Env2MjcfError, abridged, did_you_mean
from ..system.imports import installed_version
from . import program
from .program import BAD_INPUT, BROKEN_PIPE, DONE, FAULT, WRONG_USAGE, ResultsError
from .terminal import listed, print_diagnostics, print_json, printable, remark, tame_libraries

if TYPE_CHECKING:
    from .arguments import Verb

# Lines of a traceback that are shown at most.
_TRACEBACK = 400

# Each verb: its module here, its class there, what it does.
VERBS = {
    "convert": ("convert", "Convert", "write a scene as a folder of MJCF and assets"),
    "info": ("info", "Info", "say what a scene holds and how it is read"),
    "check": ("check", "Check", "tell whether configurations are valid, and who touches whom"),
    "lint": ("lint", "Lint", "list everything doubtful in scenes, robots and meshes"),
    "batch": ("batch", "Batch", "write verdicts on files of configurations, larger than memory if need be"),
    "render": ("render", "Render", "draw a scene into a PNG file, without a screen"),
    "play": ("play", "Play", "film robots that follow a path"),
    "view": ("view", "View", "show a scene on a web page: sliders, live contacts, paths that play"),
    "plan": ("plan", "Plan", "find a way from start to goal, prove it, and write it as a path"),
    "translate": ("translate", "Translate", "write a scene in another dialect of the format"),
    "cache": ("cache", "Cache", "say what is kept between runs, remove it, or compile the engine"),
}

_HELP = f"""\
usage: env2mjcf VERB ...

Motion-planning environments (.env scenes, BYU meshes, DH robots) in MuJoCo.

verbs:
{"".join(f"  {verb:9} {summary}{chr(10)}" for verb, (_, _, summary) in VERBS.items())}
examples:
  env2mjcf info scene.env                         what is in it
  env2mjcf convert scene.env out/                 out/scene.xml, for MuJoCo
  env2mjcf check scene.env --query scene.query    are start and goal free
  env2mjcf batch scene.env q.npy -o hits.npy      millions of verdicts
  env2mjcf view scene.env                         a page with sliders
  env2mjcf plan scene.env --query scene.query     a way from start to goal
  env2mjcf lint scenes/                           what is doubtful in a folder
  env2mjcf translate scene.env -o new.env --dialect D
  env2mjcf convert --help                         all options of a verb

exit status: 0 done, free or valid; 1 a finding (collision, invalid configuration, lint error); 2 wrong usage;
3 bad input, or results that cannot be written; 4 a fault of env2mjcf, or too little memory or too many
open files; 128 and the number of a signal that ended it. Results go to stdout, everything else to stderr.
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program and return its exit status.

    Args:
        arguments: What stands behind the program's name; None takes it from `sys.argv`.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    if arguments is None:
        tame_libraries()  # the process is the program's own
    if isinstance(sys.stdout, io.TextIOWrapper):
        # Names of files come out as they are where that is possible, and never as an error.
        utf8 = sys.stdout.encoding.lower() in ("utf-8", "utf8")
        sys.stdout.reconfigure(errors="surrogateescape" if utf8 else "backslashreplace")
    try:
        status = _dispatch(words)
        sys.stdout.flush()
    except BrokenPipeError:
        _abandon_stdout()
        return BROKEN_PIPE
    except ResultsError as error:
        _abandon_stdout()
        remark(f"the results cannot be written to standard output: {error.strerror}")
        return BAD_INPUT
    except KeyboardInterrupt:
        return program.interrupted_status()
    except Exception as error:
        return _fault(error, "--debug" in words)
    return status


def _dispatch(words: list[str]) -> int:
    name = words[0] if words else ""
    if name in ("-h", "--help"):
        print(_HELP, end="")
        return DONE
    if name == "--version":
        print(installed_version() or "a checkout that is not installed")
        return DONE
    if name not in VERBS:
        guess = did_you_mean(name, VERBS)
        what = f"there is no verb {name!r}{f'; {guess}' if guess else ''}" if name else "a verb is missing"
        remark(f"{what} (verbs: {', '.join(VERBS)}; env2mjcf --help tells more)")
        return WRONG_USAGE
    # Imported here, because help and version need neither tyro nor numpy.
    from .arguments import parse

    module, class_name, _ = VERBS[name]
    kind: type[Verb] = getattr(import_module(f".{module}", __package__), class_name)
    try:
        verb = parse(kind, name, words[1:])
    except SystemExit as ended:  # tyro has printed its help, or what is wrong
        return ended.code if isinstance(ended.code, int) else WRONG_USAGE
    except ValueError as error:  # options check themselves
        remark(f"{name}: {error}")
        return WRONG_USAGE
    # The verbs need it and what it loads. Before all else: a signal in the middle of it may come out as another error,
    # and OpenBLAS never comes back from being loaded where too little memory is left.
    import_module("trimesh")
    program.end_tidily()
    return _run(name, verb)


def _run(name: str, verb: Verb) -> int:
    from ..view.offscreen import RenderError, refuse_unknown

    try:
        refuse_unknown()  # or whatever imports MuJoCo would fail
        return verb.run()
    except Env2MjcfError as error:
        _show_traceback(verb.output.debug)
        print_diagnostics(error.diagnostics, verb.output.verbose)
        if verb.output.json:
            print_json({"error": error.diagnostic, "diagnostics": listed(error.diagnostics, verb.output.verbose)})
        return BAD_INPUT
    except (BrokenPipeError, ResultsError):
        raise
    except Exception as error:
        if program.interrupted:
            return program.interrupted_status()
        # Options are refused with just these; what derives from them (LinAlgError, UnicodeError) is a fault.
        if type(error) is not ValueError and not isinstance(error, RenderError):
            return _fault(error, verb.output.debug)
        _show_traceback(verb.output.debug)
        remark(f"{name}: {error}")
        return WRONG_USAGE


def _fault(error: Exception, debug: bool = False) -> int:
    """Report what should not have happened, unless it happened because of Ctrl-C, which libraries turn into others."""
    if program.interrupted:
        return program.interrupted_status()
    _show_traceback(debug)
    remark(program.describe(error))
    return FAULT


def _show_traceback(debug: bool) -> None:
    if debug or os.environ.get("ENV2MJCF_DEBUG") == "1":
        print(printable(abridged(traceback.format_exc(), lines=_TRACEBACK)), end="", file=sys.stderr)


def _abandon_stdout() -> None:
    """Point stdout nowhere, so that nothing complains when the interpreter flushes it at the end."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
