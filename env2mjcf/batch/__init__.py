"""Verdicts on files of configurations that may be larger than memory."""

from .running import WHAT as WHAT
from .running import BatchResult as BatchResult
from .running import What as What
from .running import run as run
