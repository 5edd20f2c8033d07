# Each public name, once: what type checkers and editors read, and `__init__.py` exports when it is first used.

__version__: str

from . import companions as companions
from . import diagnostics as diagnostics
from . import errors as errors
from . import limits as limits
from . import model as model
from . import options as options
from . import planning as planning
from . import testing as testing
from . import translation as translation
from . import view as view
from .companions import PathRecord as PathRecord
from .companions import Roadmap as Roadmap
from .companions import read_configurations as read_configurations
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
from .errors import ConversionError as ConversionError
from .errors import Diagnostic as Diagnostic
from .errors import Env2MjcfError as Env2MjcfError
from .errors import FormatError as FormatError
from .errors import GeometryError as GeometryError
from .errors import KinematicsError as KinematicsError
from .errors import Severity as Severity
from .errors import Span as Span
from .formats.reading import read as read
from .kinematics.space import ConfigurationSpace as ConfigurationSpace
from .limits import Limits as Limits
from .model.environment import Environment as Environment
from .options import Options as Options
from .report import Report as Report
from .simulation.loading import load as load
from .simulation.scene import Query as Query
from .simulation.scene import Scene as Scene
from .translation import Translation as Translation
from .translation import translate as translate
from .translation import write_environment as write_environment
