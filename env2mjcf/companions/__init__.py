"""Files that stand beside a scene: paths, roadmaps and queries, read and written in the scene's own terms."""

from .configurations import read_configurations as read_configurations
from .paths import PathRecord as PathRecord
from .paths import read_path as read_path
from .paths import write_path as write_path
from .query_files import read_query as read_query
from .query_files import write_query as write_query
from .roadmaps import Roadmap as Roadmap
from .roadmaps import read_roadmap as read_roadmap
from .roadmaps import write_roadmap as write_roadmap
