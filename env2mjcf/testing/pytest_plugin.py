"""The pytest plugin of env2mjcf: the fixture `load_scene` and the option `--env2mjcf-pictures`.

pytest imports it at every start: nothing but pytest is loaded until a test asks for a scene.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Unpack

import pytest

if TYPE_CHECKING:
    from env2mjcf import Options, Scene
    from env2mjcf.options import OptionKeywords

# What env2mjcf.testing reads (PICTURES_VARIABLE there); xdist's workers are configured with the same options.
_PICTURES = "ENV2MJCF_PICTURES"


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add `--env2mjcf-pictures`."""
    parser.getgroup("env2mjcf").addoption(
        "--env2mjcf-pictures",
        metavar="DIR",
        help="draw a picture of each configuration or path that an assertion of env2mjcf.testing fails on",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Hand the folder on."""
    folder = config.getoption("--env2mjcf-pictures")
    if folder:
        patch = pytest.MonkeyPatch()
        patch.setenv(_PICTURES, str(config.invocation_params.dir / folder))
        config.add_cleanup(patch.undo)


@pytest.fixture(scope="session")
def load_scene() -> Callable[..., Scene]:
    """Return `env2mjcf.load`, which loads each scene once a session for the same options.

    Queries leave a scene alone; a test that simulates takes a `copy.deepcopy` of it.
    """
    from env2mjcf import Options, load

    scenes: dict[tuple[str, Options], Scene] = {}

    def load_scene(path: str | os.PathLike[str], **options: Unpack[OptionKeywords]) -> Scene:
        key = (os.path.abspath(path), Options.from_keywords(options))
        if key not in scenes:
            scenes[key] = load(path, **options)
        return scenes[key]

    return load_scene
