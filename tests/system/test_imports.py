"""Importing env2mjcf costs next to nothing, and takes nothing over from the program that does it."""

from __future__ import annotations

import compileall
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import folders
import pytest

import env2mjcf

TRIANGLE = "1 3 1 3\n1 1\n0 0 0\n1 0 0\n0 1 0\n1 2 -3\n"
HEAVY = {"numpy", "trimesh", "lxml", "scipy", "mujoco", "tyro", "rich"}


def python(code: str, folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *(words or ("-c", code))],
        cwd=folder,
        env=folders.ENVIRONMENT,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )


def said(code: str, folder: Path) -> str:
    done = python(code, folder)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.strip()


@pytest.mark.parametrize(
    "code",
    [
        "import env2mjcf",
        "import env2mjcf.view, env2mjcf.planning, env2mjcf.testing; dir(env2mjcf), dir(env2mjcf.view)",
        "import sys; sys.argv[1:] = ['--help']; from env2mjcf.cli.main import main; main()",
        "import sys; sys.argv[1:] = ['--version']; from env2mjcf.cli.main import main; main()",
    ],
)
def test_nothing_heavy_is_loaded_before_it_is_used(code: str, tmp_path: Path) -> None:
    loaded = said(f"{code}\nimport sys; print('|', *sys.modules)", tmp_path).split("|")[-1].split()
    assert "env2mjcf" in loaded
    assert not HEAVY & set(loaded)


def test_a_script_of_the_same_name_keeps_its_signals_streams_and_exceptions(tmp_path: Path) -> None:
    (tmp_path / "env2mjcf").write_text(
        "import signal, sys\n"
        "before = [signal.getsignal(s) for s in signal.valid_signals()], sys.excepthook, sys.stdout, sys.stderr\n"
        "import env2mjcf\n"
        "env2mjcf.read, env2mjcf.view.picture, env2mjcf.Options()\n"
        "after = [signal.getsignal(s) for s in signal.valid_signals()], sys.excepthook, sys.stdout, sys.stderr\n"
        "print(before == after)\n"
        "raise ValueError('mine')\n"
    )
    done = python("", tmp_path, "env2mjcf")
    assert (done.returncode, done.stdout) == (1, "True\n")
    assert done.stderr.startswith("Traceback (most recent call last):\n")
    assert done.stderr.endswith("ValueError: mine\n")


@pytest.mark.parametrize(
    "order",
    [
        "import env2mjcf, trimesh",
        "import trimesh, env2mjcf",
        "import trimesh.exchange.load, env2mjcf",
        "from importlib import reload; import env2mjcf; reload(env2mjcf); import trimesh; reload(env2mjcf)",
        "import threading, env2mjcf; t = threading.Thread(target=__import__, args=('trimesh',)); t.start(); t.join()\n"
        "import trimesh",
    ],
)
def test_trimesh_reads_and_writes_byu_whichever_is_imported_first(order: str, tmp_path: Path) -> None:
    (tmp_path / "a.g").write_text(TRIANGLE)
    code = (
        f"{order}\nimport sys\nmesh = trimesh.load('a.g', force='mesh')\nmesh.export('b.g')\n"
        "print(trimesh.load('b.g', force='mesh').area, len(mesh.vertices), trimesh.exchange.load.__loader__.name,\n"
        "      trimesh.exchange.load.__spec__.loader is trimesh.exchange.load.__loader__,\n"
        "      *(f for f in sys.meta_path if 'env2mjcf' in type(f).__module__))"
    )
    assert said(code, tmp_path) == "0.5 3 trimesh.exchange.load True"


@pytest.mark.parametrize("again", ["", "from importlib import reload; reload(env2mjcf)"])
def test_a_trimesh_that_is_blocked_or_broken_is_no_hindrance(again: str, tmp_path: Path) -> None:
    (tmp_path / "trimesh" / "exchange").mkdir(parents=True)
    for folder in ("trimesh", "trimesh/exchange"):
        (tmp_path / folder / "__init__.py").touch()
    code = (
        f"import env2mjcf, sys\n{again}\n"
        "try: import trimesh.exchange.load\n"
        "except ImportError as error: print(error)\n"
        "sys.modules['trimesh'] = sys.modules['trimesh.exchange.load'] = None\n"
        f"{again}\nprint(env2mjcf.Limits().bodies)"
    )
    assert said(code, tmp_path).splitlines() == ["No module named 'trimesh.exchange.load'", "20000"]


@pytest.mark.parametrize("name", ["env2mjcf", "env2mjcf.view", "env2mjcf.planning", "env2mjcf.testing"])
def test_a_package_shows_its_names_and_has_them(name: str) -> None:
    module = import_module(name)
    assert dir(module) == module.__all__ == sorted(set(module.__all__))
    assert all(getattr(module, listed) is not None for listed in module.__all__)
    with pytest.raises(AttributeError, match=f"'{name}' has no attribute 'nonsense'"):
        _ = module.nonsense
    stars: dict[str, object] = {}
    exec(f"from {name} import *", stars)
    assert set(module.__all__) <= set(stars)


def test_many_threads_may_use_a_name_for_the_first_time(tmp_path: Path) -> None:
    code = (
        "import env2mjcf\nfrom concurrent.futures import ThreadPoolExecutor\n"
        "def first(i): return [env2mjcf.Scene, env2mjcf.read, env2mjcf.load, env2mjcf.convert][i % 4]\n"
        "with ThreadPoolExecutor(8) as pool: print(len(set(pool.map(first, range(64)))))"
    )
    assert said(code, tmp_path) == "4"


def test_compiled_code_alone_has_the_names_too(tmp_path: Path) -> None:
    package = tmp_path / "env2mjcf"
    shutil.copytree(Path(env2mjcf.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    assert compileall.compile_dir(package, quiet=1, legacy=True)
    for source in package.rglob("*.py"):
        source.unlink()
    code = "import env2mjcf, env2mjcf.view; env2mjcf.Options(); print(env2mjcf.__file__, *env2mjcf.view.__all__[:1])"
    assert said(f"import sys; sys.path.insert(0, {str(tmp_path)!r}); {code}", tmp_path).endswith(".pyc Direction")


def test_submodules_are_there_and_the_version_is_known() -> None:
    assert env2mjcf.options.Options is env2mjcf.Options
    assert env2mjcf.batch.run.__module__ == "env2mjcf.batch.runner"
    assert env2mjcf.transforms.dh_matrix.__name__ == "dh_matrix"
    assert env2mjcf.__version__[0].isdigit()
