"""Motion-planning environments of the Parasol Lab in MuJoCo: read, convert, load, simulate, query contacts."""

from .formats import read as read
