"""An assembled scene in, MJCF text and asset files out."""
