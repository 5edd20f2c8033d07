"""The compiled part of the exact engine; importing it needs numba."""
