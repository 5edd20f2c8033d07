"""Mesh files: BYU, OBJ and others, as arrays."""
