"""Turns an environment of one dialect into one of another that means the same."""

from __future__ import annotations

from .outputs import Written as Written
from .outputs import write_environment as write_environment
from .robots import DofMap as DofMap
from .translator import Translation as Translation
from .translator import translate as translate
