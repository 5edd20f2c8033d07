"""Verdicts on files of configurations that may be larger than memory."""

from .runner import WHAT as WHAT
from .runner import BatchResult as BatchResult
from .runner import What as What
from .runner import run as run
