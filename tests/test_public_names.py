"""Every public name is still there, and means what it meant: names, parameters, defaults, flags, codes.

`public_names.json` holds the list; `python tests/test_public_names.py` writes it anew. A name, an optional
parameter or a choice may be added. What is lost, reordered or given another default has a reason in `CHANGED`.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import json
import os
import re
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from enum import Enum
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import env2mjcf

_OF_THE_FILE = "None: what a problem XML says, else the default of before; so that the default, given, overrules it"
_VERBS = ("convert", "info", "check", "lint", "batch", "render", "play", "view", "plan")
# The path of an entry of the list, as a failure prints it, and why it is another now.
CHANGED: dict[str, str] = {
    "names/env2mjcf/Options/constructor/parameters": _OF_THE_FILE,
    **{f"options/Options/{name}": _OF_THE_FILE for name in ("self_collision", "adjacent_links", "gravity")},
    **{
        f"commands/{verb}/flags/{flag}/default": _OF_THE_FILE
        for verb in _VERBS
        for flag in ("--self-collision", "--adjacent-links", "--gravity")
    },
    "entry_points/pytest11/env2mjcf": "the plugin is part of the package; only its entry point is public",
    **dict.fromkeys(
        ("names/env2mjcf/Scene/methods/step", "instances/Scene/step"),
        "now `resolution`: in a class about MuJoCo `step` would step physics",
    ),
    **dict.fromkeys(
        ("names/env2mjcf/ConfigurationSpace/methods/of_task", "instances/ConfigurationSpace/of_task"),
        "now `of_tasks`: where the robots of one task stand in another takes all of them",
    ),
    **dict.fromkeys(
        ("names/env2mjcf.model/Task/fields", "names/env2mjcf.model/Task/constructor/parameters"),
        "a task has several `robots`, of which `robot` is the first",
    ),
    **dict.fromkeys(
        (
            "names/env2mjcf/Limits/constructor/parameters",
            "options/Limits/bodies",
            *(f"commands/{verb}/flags/--limits.bodies/default" for verb in (*_VERBS, "translate")),
        ),
        "20,000 bodies: the time of MuJoCo's parser grows with their square",
    ),
}

ROOT = Path(__file__).resolve().parents[1]
LIST = Path(__file__).with_name("public_names.json")
PACKAGE = Path(env2mjcf.__file__).resolve().parent
SEED = ROOT / "models" / "seed" / "seed.env"

# Modules that names are imported from, and which names; None is all that the module offers.
MODULES: dict[str, tuple[str, ...] | None] = {
    "env2mjcf": None,
    "env2mjcf.batch": ("BatchResult", "WHAT", "What", "run"),
    "env2mjcf.companions": None,
    "env2mjcf.diagnostics": ("CATALOGUE",),
    "env2mjcf.formats.writers": None,
    "env2mjcf.model": None,
    "env2mjcf.planning": None,
    "env2mjcf.testing": None,
    "env2mjcf.transforms": ("dh_matrix", "rotation_matrix", "transform"),
    "env2mjcf.translation": None,
    "env2mjcf.view": None,
    "env2mjcf.view.offscreen": ("backend", "missing"),
}
# Nobody but the package makes these.
MADE_BY_THE_PACKAGE = ("ConfigurationSpace", "Scene")
SPECIAL = ("__call__", "__contains__", "__enter__", "__exit__", "__getitem__", "__iter__", "__len__", "__str__")
KINDS = {
    inspect.Parameter.POSITIONAL_ONLY: "positional-only",
    inspect.Parameter.POSITIONAL_OR_KEYWORD: "positional",
    inspect.Parameter.VAR_POSITIONAL: "var-positional",
    inspect.Parameter.KEYWORD_ONLY: "keyword-only",
    inspect.Parameter.VAR_KEYWORD: "var-keyword",
}
# Runs in a process of its own: the program, once for each list of words; prints status and stdout of each as JSON.
PROGRAM = """
import contextlib, io, json, sys
from env2mjcf.cli.main import main
done = []
for words in json.loads(sys.argv[1]):
    text = io.TextIOWrapper(io.BytesIO(), encoding="utf-8")
    with contextlib.redirect_stdout(text), contextlib.redirect_stderr(io.StringIO()):
        status = main(words)
    text.flush()
    done.append((status, text.buffer.getvalue().decode()))
print(json.dumps(done))
"""


# Names of modules.


def offered(module: ModuleType) -> list[str]:
    """Return the public names of a module: what it lists, offers lazily, defines or (a package) re-exports."""
    if hasattr(module, "__all__"):
        return sorted(module.__all__)
    lazy = set(getattr(module, "_LAZY", ()))
    names = lazy | {n for n in dir(module) if is_public(n) and is_ours(module, getattr(module, n))}
    return sorted(names | ({"__version__"} if module is env2mjcf else set()))


def is_public(name: str) -> bool:
    return not name.startswith("_")


def is_ours(module: ModuleType, value: Any) -> bool:
    """Return whether a value of a module is its own, or of the package where the module is one."""
    home = getattr(value, "__module__", None)
    if isinstance(value, ModuleType) or not isinstance(home, str):
        return False
    return home.split(".")[0] == "env2mjcf" if hasattr(module, "__path__") else home == module.__name__


def names(recorded: dict[str, Any]) -> dict[str, Any]:
    """Describe the names of all modules, those that are recorded among them, if they are still there."""
    found: dict[str, Any] = {}
    for name, chosen in MODULES.items():
        try:
            module = import_module(name)
        except ImportError:
            continue
        wanted = {*(chosen or offered(module)), *recorded.get(name, ())}
        found[name] = {n: describe(getattr(module, n)) for n in sorted(wanted) if hasattr(module, n)}
    return found


def describe(value: Any) -> Any:
    """Return what matters of a value: of functions their parameters, of classes what they have."""
    if isinstance(value, type):
        return describe_class(value)
    if callable(value) and hasattr(value, "__code__"):
        return {"kind": "function", **signature(value)}
    if isinstance(value, (dict, tuple, list, set, frozenset)) and len(value) < 50:
        return {"kind": "constant", "holds": [str(v) for v in value]}
    return {"kind": "constant"}


def describe_class(cls: type) -> dict[str, Any]:
    found: dict[str, Any] = {"kind": "exception" if issubclass(cls, BaseException) else "class"}
    if issubclass(cls, BaseException):
        found["bases"] = [c.__name__ for c in cls.__mro__[1:-1]]
    if issubclass(cls, Enum):
        return {**found, "kind": "enumeration", "members": {m.name: repr(m.value) for m in cls}}
    if dataclasses.is_dataclass(cls):
        found["fields"] = [f.name for f in dataclasses.fields(cls)]
    elif hasattr(cls, "_fields"):
        found["fields"] = list(cls._fields)
    if cls.__name__ not in MADE_BY_THE_PACKAGE and (found.get("fields") or "__init__" in of_the_package(cls)):
        found["constructor"] = signature(cls)
    members = of_the_package(cls)
    methods = {n: method(cls, n) for n in sorted(members) if is_method(members[n]) and is_public(n)}
    attributes = {n for n, value in members.items() if is_public(n) and not is_method(value)}
    found["attributes"] = sorted(attributes | {n for n in annotated(cls) if is_public(n)})
    found["methods"] = methods
    found["special"] = [n for n in SPECIAL if n in members]
    return found


def of_the_package(cls: type) -> dict[str, Any]:
    """Return what a class and its bases in the package define."""
    members: dict[str, Any] = {}
    for base in reversed(cls.__mro__):
        if base.__module__.split(".")[0] == "env2mjcf":
            members.update(vars(base))
    return members


def annotated(cls: type) -> Iterator[str]:
    for base in cls.__mro__:
        if base.__module__.split(".")[0] == "env2mjcf":
            yield from inspect.get_annotations(base)


def is_method(value: Any) -> bool:
    return inspect.isfunction(value) or isinstance(value, (staticmethod, classmethod))


def method(cls: type, name: str) -> dict[str, Any]:
    static = inspect.getattr_static(cls, name)
    kind = type(static).__name__ if isinstance(static, (staticmethod, classmethod)) else "method"
    shown = signature(getattr(cls, name))
    return {"kind": kind, "parameters": shown["parameters"][1:] if kind == "method" else shown["parameters"]}


def signature(function: Any) -> dict[str, list[str]]:
    """Return the parameters in order: kind, name, and the default if there is one."""
    made = {f.name: f for f in dataclasses.fields(function)} if dataclasses.is_dataclass(function) else {}
    shown: list[str] = []
    for p in inspect.signature(function).parameters.values():
        default = p.default
        if p.name in made and made[p.name].default_factory is not dataclasses.MISSING:
            default = made[p.name].default_factory()
        text = f"{KINDS[p.kind]} {p.name}"
        shown.append(text if default is inspect.Parameter.empty else f"{text} = {stable(default)}")
    return {"parameters": shown}


def stable(value: Any) -> str:
    """Return a default as text that is the same in every run."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return f"{type(value).__name__}(...)"
    return re.sub(r" at 0x[0-9a-fA-F]+", "", repr(value))


def exceptions(described: dict[str, Any]) -> dict[str, list[str]]:
    """Return the bases of all exceptions among the names."""
    found = {n: d for names_of in described.values() for n, d in names_of.items()}
    return {n: d["bases"] for n, d in sorted(found.items()) if d["kind"] == "exception"}


def options(described: dict[str, Any]) -> dict[str, Any]:
    """Return the options and limits with their defaults, and which functions take options as keywords."""
    takers = [
        f"{module}.{name}"
        for module, names_of in described.items()
        for name, d in names_of.items()
        if "var-keyword options" in d.get("parameters", ())
    ]
    values = {"Options": env2mjcf.Options(), "Limits": env2mjcf.Limits()}
    return {
        "taken_by": takers,
        **{n: {f.name: stable(getattr(v, f.name)) for f in dataclasses.fields(v)} for n, v in values.items()},
        "accepted": [f.name for f in dataclasses.fields(env2mjcf.Options) if accepts(f.name)],
    }


def accepts(option: str) -> bool:
    """Return whether the functions that take options take this one."""
    try:
        return env2mjcf.Options.from_keywords({option: getattr(env2mjcf.Options(), option)}) is not None
    except TypeError:
        return False


# What objects have.


def instances() -> dict[str, list[str]]:
    """Return the public attributes of one object of each kind."""
    scene = env2mjcf.load(SEED, query=SEED.with_suffix(".query"), engine="mujoco")
    rows = np.concatenate([scene.space.home[None], scene.space.sample(200, 0)])
    hit = rows[scene.in_collision(rows)][0]
    with tempfile.TemporaryDirectory() as folder:
        file = env2mjcf.write_path(scene, rows[:2], Path(folder) / "seed.path")
        record = env2mjcf.read_path(scene, file)
        conversion = env2mjcf.convert(SEED, Path(folder) / "out")
    translation = env2mjcf.translate(scene.environment, "E")
    found = [
        scene,
        scene.space,
        scene.environment,
        scene.report,
        scene.queries[0],
        scene.contacts(hit)[0],
        scene.packed_contacts(rows[:2]),
        scene.check_path(rows[:2]),
        record,
        env2mjcf.Roadmap.of(rows[:2], [(0, 1)]),
        conversion,
        translation,
        translation.robots[0],
        next(d for o in (scene, translation.environment, conversion) for d in o.diagnostics),
    ]
    return {
        type(o).__name__: [n for n in dir(o) if is_public(n)] for o in sorted(found, key=lambda o: type(o).__name__)
    }


# The program.


def run(words: list[str], **how: Any) -> subprocess.CompletedProcess[str]:
    """Run Python, with this package and nothing of the caller's that changes what it prints."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("PYTEST_", "ENV2MJCF_DEBUG"))}
    path = [str(PACKAGE.parent), environment.get("PYTHONPATH", "")]
    environment |= {"PYTHONPATH": os.pathsep.join(p for p in path if p), "PYTHONUTF8": "1", "COLUMNS": "100"}
    return subprocess.run(
        [sys.executable, *words],
        env=environment,
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
        check=False,
        **how,
    )


def program(folder: Path) -> dict[str, Any]:
    """Return the verbs, their flags, and how the program ends."""
    bad = folder / "bad.env"
    bad.write_text("nonsense\n", encoding="utf-8")
    (head_status, head), *rest = program_runs([["--help"]])
    assert (head_status, rest) == (0, [])
    verbs = re.findall(r"^  (\w+) ", head.split("verbs:")[1].split("examples:")[0], re.MULTILINE)
    endings = {
        "-h": ["-h"],
        "--help": ["--help"],
        "--version": ["--version"],
        "unknown verb": ["no-such-verb"],
        "unknown flag": ["info", str(SEED), "--no-such-flag"],
        "no such file": ["info", str(folder / "missing.env")],
        "finding of lint": ["lint", str(bad)],
    }
    done = program_runs([*([verb, "--help"] for verb in verbs), *endings.values()])
    helps, ends = done[: len(verbs)], done[len(verbs) :]
    return {
        "commands": {verb: flags(text) for verb, (_, text) in zip(verbs, helps, strict=True)},
        "endings": {what: status for what, (status, _) in zip(endings, ends, strict=True)},
    }


def program_runs(calls: list[list[str]]) -> list[tuple[int, str]]:
    done = run(["-c", PROGRAM, json.dumps(calls)], stdout=subprocess.PIPE)
    assert done.returncode == 0, done.stderr
    return [(status, text) for status, text in json.loads(done.stdout)]


def flags(text: str) -> dict[str, Any]:
    """Return positionals and flags out of the boxes that `--help` prints."""
    found: dict[str, Any] = {"positional": [], "flags": {}}
    entries: list[list[str]] = []
    section = ""
    for line in text.splitlines():
        if title := re.match(r"╭─ (.+?) ─", line):
            section = title[1]
        elif re.match(r"│ \S", line):
            head, _, about = line.strip("│ ").partition("  ")
            entries.append([section, head.strip(), about.strip()])
        elif line.startswith("│") and entries:
            entries[-1][2] += " " + line.strip("│ ")
    for section, head, about in entries:
        if section == "positional arguments":
            found["positional"].append(head)
        elif head.startswith("-"):
            spellings = re.findall(r"(?:^|[ ,])(--?[A-Za-z][\w.-]*)", head)
            entry: dict[str, Any] = {"spellings": spellings}
            if choices := re.search(r"\{(.+?)\}", head):
                entry["choices"] = choices[1].split(",")
            if default := re.search(r"\((?:default: (.*?)|(required))\)$", " ".join(about.split())):
                entry["default"] = (default[1] or default[2] or "").strip()
            longest = next((s for s in spellings if s.startswith("--")), spellings[0])
            found["flags"][longest] = entry
    return found


def broken_pipe() -> int:
    """Return how the program ends when nobody reads its results."""
    reading, writing = os.pipe()
    os.close(reading)
    try:
        return run(["-m", "env2mjcf", "--help"], stdout=writing).returncode
    finally:
        os.close(writing)


def described_statuses() -> list[int]:
    """Return the exit statuses that the page on the command line lists."""
    text = (ROOT / "docs" / "cli.md").read_text(encoding="utf-8")
    return sorted({int(n) for n in re.findall(r"\b\d+\b", text.split("Exit status:")[1].split("No failure")[0])})


# What surrounds the package.


def plugin(folder: Path) -> dict[str, list[str]]:
    """Return the fixtures and options that pytest lists, of this plugin."""
    words = ["-m", "pytest", "-p", "no:cacheprovider", "-c", os.devnull, "--rootdir", str(folder)]
    with ThreadPoolExecutor(2) as pool:
        asked = [[*words, "--fixtures", "-q"], [*words, "--help"]]
        fixtures, helped = pool.map(lambda w: run(w, stdout=subprocess.PIPE, cwd=folder).stdout, asked)
    return {
        "fixtures": re.findall(r"^(\w+).* -- .*pytest_plugin\.py", fixtures, re.MULTILINE),
        "options": sorted(set(re.findall(r"--env2mjcf-[a-z-]+", helped))),
    }


def variables() -> list[str]:
    """Return the environment variables that the sources name."""
    text = "".join(f.read_text(encoding="utf-8") for f in PACKAGE.rglob("*.py"))
    return sorted(set(re.findall(r"ENV2MJCF_[A-Z_]+", text)))


def entry_points() -> dict[str, dict[str, str]]:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return {"scripts": project["scripts"], **project["entry-points"]}


def collect(recorded: dict[str, Any]) -> dict[str, Any]:
    """Return everything that is public today."""
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(3) as pool:
        folder = Path(name)
        (folder / "empty").mkdir()
        program_part = pool.submit(program, folder)
        plugin_part = pool.submit(plugin, folder / "empty")
        pipe_part = pool.submit(broken_pipe)
        described = names(recorded.get("names", {}))
        found = {
            "names": described,
            "instances": instances(),
            "options": options(described),
            "exceptions": exceptions(described),
            "diagnostics": sorted(catalogue()),
            "severities": {s.name: s.value for s in env2mjcf.Severity},
            "variables": variables(),
            "entry_points": entry_points(),
            "commands": program_part.result()["commands"],
            "statuses": {
                "described": described_statuses(),
                "observed": {**program_part.result()["endings"], "nobody reads": pipe_part.result()},
            },
            "pytest": plugin_part.result(),
        }
    return json.loads(json.dumps(found))


def catalogue() -> dict[str, str]:
    from env2mjcf import diagnostics

    return diagnostics.CATALOGUE


# Comparing.


def differences(old: Any, new: Any, path: str) -> Iterator[str]:
    """Yield what is recorded and is gone, or is another."""
    if path in CHANGED:
        return
    if isinstance(old, dict) and isinstance(new, dict):
        for key, value in old.items():
            if key in new:
                yield from differences(value, new[key], f"{path}/{key}")
            elif f"{path}/{key}" not in CHANGED:
                yield f"{path}/{key}: is gone"
    elif isinstance(old, list) and isinstance(new, list):
        if path.endswith("/parameters"):
            yield from (f"{path}: {what}" for what in parameter_differences(old, new))
        else:
            gone = [entry for entry in old if entry not in new and f"{path}/{entry}" not in CHANGED]
            yield from (f"{path}: {entry} is gone" for entry in gone)
            kept = [entry for entry in new if entry in old]
            if path.endswith(("/fields", "/positional", "/bases")) and sorted(kept) == sorted(old) and kept != old:
                yield f"{path}: the order was {', '.join(old)}"
    elif old != new:
        yield f"{path}: was {old!r}, is {new!r}"


def parameter_differences(old: list[str], new: list[str]) -> Iterator[str]:
    """Yield what a call that was right may stumble over."""
    was, now = (positionals(p) for p in (old, new))
    if now[: len(was)] != was:
        yield f"positional parameters were ({', '.join(was)}), are ({', '.join(now)})"
    named = {name_of(p): p for p in new}
    for parameter in old:
        kind, name = parameter.split()[:2]
        if kind.startswith("positional"):
            continue
        found = named.get(name, "")
        # A parameter that can be told by name may be told by place, too.
        if parameter != found and parameter.replace("keyword-only", "positional") != found:
            yield f"was {parameter!r}, is {found or 'gone'!r}"
    known = {name_of(p) for p in old}
    for parameter in new:
        if name_of(parameter) not in known and " = " not in parameter and not parameter.startswith("var-"):
            yield f"{parameter!r} is new and has no default"


def positionals(parameters: list[str]) -> list[str]:
    return [p for p in parameters if p.startswith("positional")]


def name_of(parameter: str) -> str:
    return parameter.split()[1]


# The tests.


def read_list() -> dict[str, Any]:
    return json.loads(LIST.read_text(encoding="utf-8")) if LIST.exists() else {}


RECORDED = read_list()


@functools.cache
def today() -> dict[str, Any]:
    return collect(RECORDED)


@pytest.mark.parametrize("kind", sorted(RECORDED))
def test_what_is_public_stays(kind: str) -> None:
    missing = list(differences(RECORDED[kind], today()[kind], kind))
    assert not missing, "\n".join(["no longer as it was:", *missing])


def test_exceptions_are_entries_of_the_list() -> None:
    known = set(paths(RECORDED))
    assert not [path for path in CHANGED if path not in known]


def paths(tree: dict[str, Any], above: str = "") -> Iterator[str]:
    for key, value in tree.items():
        yield f"{above}{key}"
        if isinstance(value, list):
            yield from (f"{above}{key}/{entry}" for entry in value)
        if isinstance(value, dict):
            yield from paths(value, f"{above}{key}/")


def test_every_documented_name_is_in_the_list() -> None:
    # A name may be newer than the list.
    names_of = (*RECORDED["names"].items(), *today()["names"].items())
    listed = {f"{module}.{name}" for module, offers in names_of for name in offers}
    missing = sorted(set(documented()) - listed)
    assert not missing, f"documented, but not in {LIST.name}: {', '.join(missing)}"


def documented() -> Iterator[str]:
    """Yield the names that the pages of the API show."""
    for page in sorted((ROOT / "docs" / "api").glob("*.md")):
        module = ""
        text = page.read_text(encoding="utf-8")
        for kind, name in re.findall(
            r"^\.\. (currentmodule|auto(?:function|class|exception)):: (\S+)", text, re.MULTILINE
        ):
            if kind == "currentmodule":
                module = name
            else:
                yield name if name.startswith("env2mjcf.") else f"{module}.{name}"


if __name__ == "__main__":
    LIST.write_text(json.dumps(collect({}), indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
