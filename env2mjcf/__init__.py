"""Motion-planning environments of the Parasol Lab in MuJoCo: read, convert, load, simulate, query contacts."""

from __future__ import annotations

from . import starting as _starting

if _starting.is_program():
    _starting.begin()

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .errors import ConversionError as ConversionError
from .errors import Diagnostic as Diagnostic
from .errors import Env2MjcfError as Env2MjcfError
from .errors import FormatError as FormatError
from .errors import GeometryError as GeometryError
from .errors import KinematicsError as KinematicsError
from .errors import Severity as Severity
from .errors import Span as Span
from .formats import byu as _byu
from .formats.reading import read as read
from .model import Environment as Environment
from .options import Limits as Limits
from .options import Options as Options

if TYPE_CHECKING:
    from .companions import PathRecord as PathRecord
    from .companions import Roadmap as Roadmap
    from .companions import read_path as read_path
    from .companions import read_query as read_query
    from .companions import read_roadmap as read_roadmap
    from .companions import write_path as write_path
    from .companions import write_query as write_query
    from .companions import write_roadmap as write_roadmap
    from .contact.types import Contact as Contact
    from .contact.types import PackedContacts as PackedContacts
    from .contact.types import PathReport as PathReport
    from .conversion import Conversion as Conversion
    from .conversion import convert as convert
    from .report import Report as Report
    from .simulation.preparing import load as load
    from .simulation.scene import Query as Query
    from .simulation.scene import Scene as Scene
    from .space import ConfigurationSpace as ConfigurationSpace
    from .translation import Translation as Translation
    from .translation import translate as translate
    from .translation import write_environment as write_environment

# These need MuJoCo, which reading does not: they are imported when they are first used.
_LAZY = {
    "PathRecord": ".companions",
    "Roadmap": ".companions",
    "read_path": ".companions",
    "read_query": ".companions",
    "read_roadmap": ".companions",
    "write_path": ".companions",
    "write_query": ".companions",
    "write_roadmap": ".companions",
    "Contact": ".contact.types",
    "PackedContacts": ".contact.types",
    "PathReport": ".contact.types",
    "Conversion": ".conversion",
    "convert": ".conversion",
    "Report": ".report",
    "load": ".simulation.preparing",
    "Query": ".simulation.scene",
    "Scene": ".simulation.scene",
    "ConfigurationSpace": ".space",
    "Translation": ".translation",
    "translate": ".translation",
    "write_environment": ".translation",
}

_byu.register()


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        value = getattr(import_module(_LAZY[name], __name__), name)
        globals()[name] = value
        return value
    if name == "__version__":
        from importlib.metadata import version

        return version(__name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_LAZY, "__version__"} - {"annotations"})
