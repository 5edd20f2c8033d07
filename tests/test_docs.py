"""The documentation tells the truth: its examples run, and pages that scripts write are those that are committed."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import trimesh
from extras import skip_without
from snippets import RUN, SHOWN, blocks, commands

import env2mjcf

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = sorted(p for p in DOCS.rglob("*.md") if "_build" not in p.parts)
WITH_EXAMPLES = [p for p in PAGES if any(b.language in RUN for b in blocks(p.read_text(encoding="utf-8")))]
# What the examples of a page cannot do without.
EXTRAS = {
    "cluster.md": ("dask",),
    "engines.md": ("fast",),
    "pictures.md": ("view",),
    "planning.md": ("planning",),
    "tutorial.md": ("fast", "view", "planning"),
}
TUTORIAL = DOCS / "tutorial.md"


def name(page: Path) -> str:
    return page.relative_to(DOCS).as_posix()


def follow(page: Path, folder: Path) -> None:
    """Run a page's examples in a folder, in a process of their own, and fail with what differs."""
    for extra in EXTRAS.get(page.name, ()):
        skip_without(extra)
    words = [sys.executable, str(ROOT / "tests/support/snippets.py"), str(page)]
    # Whatever make thinks, it must not install the clone into the environment that it only borrows.
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "MAKEFLAGS": "PIP=true"}
    done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.fail(done.stderr)


@pytest.mark.slow_but("engines", "format/kinematics", "format/readings", "testing")
@pytest.mark.parametrize("page", [p for p in WITH_EXAMPLES if p != TUTORIAL], ids=name)
def test_the_examples_of_a_page_run(page: Path, tmp_path: Path) -> None:
    # As a reader in the checkout would run them, one after the other; what they write stays in the copy.
    shutil.copytree(ROOT / "models", tmp_path / "models")
    follow(page, tmp_path)


@pytest.mark.slow
@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="not in a checkout of git")
def test_a_newcomer_gets_through_the_tutorial(tmp_path: Path) -> None:
    for extra in EXTRAS[TUTORIAL.name]:
        skip_without(extra)
    clone = tmp_path / "env2mjcf"
    subprocess.run(["git", "clone", "--quiet", ROOT, clone], check=True)
    install(clone)
    follow(TUTORIAL, clone)


def install(clone: Path) -> None:
    """Make this interpreter's environment the clone's, as `make` would in some minutes."""
    venv = clone / ".venv"
    venv.mkdir()
    for part in ("bin", "lib", "include", "pyvenv.cfg"):
        if (source := Path(sys.prefix) / part).exists():
            (venv / part).symlink_to(source)
    # Newer than pyproject.toml, so that nothing is installed anew.
    (venv / "demo.stamp").touch()


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_a_page_says_why_an_example_is_not_run(page: Path) -> None:
    for block in blocks(page.read_text(encoding="utf-8")):
        where = f"{page}:{block.line}"
        directive = block.language.startswith("{")
        assert directive or block.language in (*RUN, *SHOWN, "sh"), f"{where}: a block of an unknown kind"
        idle = block.language.startswith("{code-block}") and ":caption:" not in block.body
        assert block.reason or not (idle or block.language == "sh"), f"{where}: why is it <!-- not run: ... -->?"


def test_every_public_name_is_described() -> None:
    described = " ".join(p.read_text(encoding="utf-8") for p in (DOCS / "api").glob("*.md"))
    public = {n for n, value in ((n, getattr(env2mjcf, n)) for n in dir(env2mjcf)) if callable(value) and n[0] != "_"}
    public -= {"import_module", "Any"}
    assert {n for n in public if not re.search(rf":: (env2mjcf\.)?{n}\n", described)} == set()


def test_the_picture_of_a_connection_is_what_its_script_draws() -> None:
    done = subprocess.run([sys.executable, DOCS / "figures" / "connection.py", "--check"], check=False)
    assert done.returncode == 0, "run `make tables`"


def test_the_picture_of_the_rooms_shows_their_imports() -> None:
    done = subprocess.run([sys.executable, DOCS / "figures" / "architecture.py", "--check"], check=False)
    assert done.returncode == 0, "run `make tables`"


def test_the_page_of_diagnostics_lists_every_code() -> None:
    done = subprocess.run([sys.executable, DOCS / "diagnostics.py", "--check"], check=False)
    assert done.returncode == 0, "run `make tables`"


def test_a_console_block_is_commands_and_what_they_print() -> None:
    (block,) = blocks("text\n\n```console\n$ echo one \\\n    two\none two\n$ true\n$ seq 3\n1\n...\n```\n")
    assert list(commands(block)) == [(4, "echo one \\\n    two", "one two"), (7, "true", ""), (8, "seq 3", "1\n...")]


@pytest.mark.parametrize(
    ("page", "complaint"),
    [
        ("```python\nx = 1\n```\n\n```python\nprint(x)\n```\n\n```text\n1\n```\n", ""),
        ("```python\nprint(1)\n```\n\n```text\n2\n```\n", "page.md:2: the page shows\n2\nbut printed was\n1\n"),
        ("```console\n$ echo 1.25 s\n... s\n```\n", ""),
        ("\n```console\n$ echo a; echo b >&2\na\n```\n", "page.md:3: the page shows\na\nbut printed was\na\nb\n"),
        ("```console\n$ false\n```\n", "page.md:2: `false` ended with status 1"),
        ("```console\n$ (exit 3) || echo status $?\nstatus 3\n```\n", ""),
        ("```{code-block} text\n:caption: new.txt\n\nhello\n```\n\n```console\n$ cat new.txt\nhello\n```\n", ""),
        ("\n```python\n\nraise OSError\n```\n", 'page.md", line 4'),
    ],
)
def test_an_example_that_differs_is_found(page: str, complaint: str, tmp_path: Path) -> None:
    (tmp_path / "page.md").write_text(page)
    if not complaint:
        follow(tmp_path / "page.md", tmp_path)
        return
    with pytest.raises(pytest.fail.Exception) as failure:
        follow(tmp_path / "page.md", tmp_path)
    assert complaint in str(failure.value)


ARCHITECTURE = DOCS / "architecture.md"
PACKAGE = ROOT / "env2mjcf"


def test_the_page_on_architecture_names_what_is_there() -> None:
    text = ARCHITECTURE.read_text(encoding="utf-8")
    paths = {p for p in re.findall(r"`([\w/]+\.pyi?)`", text) if "/" in p}
    gone = sorted(p for p in paths if not (PACKAGE / p).is_file() and not (ROOT / p).is_file())
    assert gone == []
    for row in re.findall(r"^\| [^|]+ \| (`[^|]+`) \| (`[^|]+`) \| .+ \|$", text, re.MULTILINE):
        code = "".join((PACKAGE / p).read_text(encoding="utf-8") for p in re.findall(r"`([\w/.]+)`", row[0]))
        for name in re.findall(r"`(\w+)`", row[1]):
            assert re.search(rf"^(?:def|class) {name}\b", code, re.MULTILINE), f"{row[0]} has no {name}"


def test_modules_of_unusual_size_have_a_reason() -> None:
    table = ARCHITECTURE.read_text(encoding="utf-8").split("\n## Sizes\n")[1]
    explained = {p for row in re.findall(r"^\| (`.+?`) \|", table, re.MULTILINE) for p in re.findall(r"`(.+?)`", row)}
    modules = [p for p in PACKAGE.rglob("*.py") if p.name != "__init__.py"]
    sizes = {p.relative_to(PACKAGE).as_posix(): len(p.read_text(encoding="utf-8").splitlines()) for p in modules}
    assert {p for p, lines in sizes.items() if not 80 <= lines <= 350} == explained


def test_the_citation_names_this_version() -> None:
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.search(rf"^version: {re.escape(env2mjcf.__version__)}$", citation, re.MULTILINE)


def shown(page: str, begins: str) -> str:
    """Return the block of a page on the formats that begins with some words."""
    found = [b.body for b in blocks((DOCS / "format" / page).read_text(encoding="utf-8")) if b.body.startswith(begins)]
    assert len(found) == 1
    return found[0]


def test_scenes_written_by_the_pages_on_formats_read_alike(tmp_path: Path) -> None:
    texts = {
        "a.env": shown("env.md", "2\nMultiBody Active"),
        "d.env": shown("env.md", "Boundary Box ["),
        "scene.env": shown("xml.md", "<Environment"),
        "arm.robot": shown("xml.md", "<Robot>"),
        "problem.xml": shown("xml.md", "<MotionPlanning>"),
    }
    for file, text in texts.items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    scenes = [env2mjcf.read(tmp_path / file) for file in ("a.env", "d.env", "problem.xml")]
    assert [str(s.dialect) for s in scenes] == ["A", "D", "E"]
    for scene in scenes:
        (robot,), (wall,) = scene.robots, scene.obstacles
        assert [b.filename for b in robot.bodies] == ["base.g", "arm.g"]
        assert robot.connections[0].dh.a == robot.connections[0].to_body.position[0] == 0.5
        assert wall.bodies[0].pose is not None
        assert wall.bodies[0].pose.position == (3, 0, 0)
        assert {d.code for d in scene.diagnostics} <= {"ENV309"}  # what the problem says about pairs
    assert [len(c) for t in scenes[2].tasks for c in t.configurations] == [7, 7]


def test_the_mesh_on_the_page_on_meshes_is_a_tetrahedron(tmp_path: Path) -> None:
    (tmp_path / "corner.g").write_text(shown("meshes.md", "1 4 4 12"), encoding="utf-8")
    mesh = trimesh.load_mesh(tmp_path / "corner.g")
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(1 / 6)
