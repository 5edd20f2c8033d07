"""Poses as 4 x 4 matrices, under the name that the documentation gives them; they live in `kinematics.transforms`."""

from .kinematics.transforms import dh_matrix, rotation_matrix, transform

__all__ = ["dh_matrix", "rotation_matrix", "transform"]
