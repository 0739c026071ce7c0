"""Neighbourhoods: the k-d tree, the k nearest, plane fits, normals, thinning and spacing."""
