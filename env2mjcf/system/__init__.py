"""Files, folders, locks: what the operating system is asked for."""
