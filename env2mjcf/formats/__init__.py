"""Text in, Environment out: every file format of the planners, and nothing that comes after."""

from .reading import read as read
