"""Scenes in MuJoCo."""
