"""Verdicts on triangles by an engine of our own: moving links only, boxes first, the first contact ends."""
