"""Turns an environment of one dialect into one of another that means the same."""

from __future__ import annotations

from .translating import Translation as Translation
from .translating import translate as translate
