"""Turns an environment of one dialect into one of another that means the same."""

from __future__ import annotations

from .files import Written as Written
from .files import write_environment as write_environment
from .tasks import DofMap as DofMap
from .translating import Translation as Translation
from .translating import translate as translate
