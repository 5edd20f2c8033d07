"""Meshes: found, loaded, analysed, turned into convex cells and inertias."""
