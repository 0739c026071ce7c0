"""The fittings in closed form: what their meshes and scans are held against."""

import numpy as np

from edgel import synth

R, END, BEND = 57.15, 105.0, 152.4
PARTS = {"tee": synth.tee(), "elbow": synth.elbow()}
BOUNDS = {"tee": [[-END, -R], [END, END]], "elbow": [[0, 0], [BEND + R, BEND + R]]}


def distance_to_surface(name, xyz):
    x, y, z = xyz.T
    if name == "elbow":
        return np.hypot(np.hypot(x, y) - BEND, z) - R
    return np.where((y > 0) & (np.abs(x) < y), np.hypot(x, z), np.hypot(y, z)) - R


def height(name, x, y):
    """Height of the part in closed form; NaN where there is none."""
    if name == "elbow":
        across = np.where((x < 0) | (y < 0), np.inf, np.hypot(x, y) - BEND)
    else:
        run = np.where(np.abs(x) <= END, np.abs(y), np.inf)
        across = np.minimum(run, np.where((y >= 0) & (y <= END), np.abs(x), np.inf))
    square = R**2 - across**2
    return np.sqrt(np.where(square < 0, np.nan, square))


def lengths(part, name):
    return sorted(edge.length for edge in part.edges if edge.name == name)
