"""Find the edges of 3D point clouds, and their normals, without tuning."""

from edgel.cloud import Cloud

__all__ = ["Cloud"]
