"""Writes environments and robots as text, in any of the five dialects."""

from __future__ import annotations

from .environment import env_text as env_text
from .environment import robot_text as robot_text
