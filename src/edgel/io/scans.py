"""Scans that a file holds as grids, each seen from where its scanner stood."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel.cloud import Cloud
from edgel.io.cells import grid_of, in_cells
from edgel.io.e57_write import GRID


@dataclass(frozen=True, eq=False)
class Scan:
    """A scan of a cloud.

    Attributes
    ----------
    cloud : Cloud
        Its points, organized, without attributes.
    rows : (H * W,) int64
        Which point of the whole cloud each cell holds; -1 where it is empty.
    """

    cloud: Cloud
    rows: np.ndarray


def organized_scans(cloud: Cloud) -> list[Scan]:
    """Take apart what a file holds of organized scans: one, several of PTX or E57, or none, if any of them is a list.

    Examples
    --------
    >>> cloud = Cloud(np.eye(3), {"scan_index": np.array([0, 1, 1])})
    >>> organized_scans(cloud)
    []
    """
    if cloud.is_organized:
        return [Scan(cloud, np.arange(len(cloud)))]
    if "scan_positions" not in cloud.metadata:
        return []
    shapes, scans = cloud.metadata.get("scan_shapes"), []
    for number, position in enumerate(cloud.metadata["scan_positions"]):
        rows = np.flatnonzero(cloud.attributes["scan_index"] == number)
        if shapes is not None:
            cells = (np.arange(len(rows)), shapes[number]) if min(shapes[number]) > 1 else None
        else:
            named = len(rows) > 0 and all(name in cloud.attributes for name in GRID)
            cells = grid_of(*(cloud.attributes[name][rows].astype(np.int64) for name in GRID)) if named else None
        if cells is None:
            return []
        index, shape = cells
        place = None if position is None else np.array(position)
        organized = in_cells(Cloud(cloud.xyz[rows], viewpoint=place), index, shape)
        scans.append(Scan(organized, np.where(index >= 0, rows[index], -1)))
    return scans
