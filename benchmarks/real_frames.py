"""The small set of real frames in this repository (benchmarks/real), and figures of the sweeps whose truth is known.

Source, licence and how each file was made stand in `benchmarks/real/README.md`.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

import edgel

FOLDER = Path(__file__).parent / "real"
OFF_PLANE = 0.05  # m: a return no farther from the board's plane, and from its outline, is on the board
OUTSIDE = 0.04
INSIDE = 0.06  # m inside the outline from which an edge is false
FEWEST = 4  # shots of a ring on the board


@dataclass(frozen=True, eq=False)
class Frame:
    """One view of a real sensor.

    Attributes
    ----------
    name : str
    cloud : edgel.Cloud
        Organized, in metres, the sensor at the origin; NaN where it saw nothing.
    board : (4, 3) float64 or None
        Corners of the board that stands in a sweep, in order around it.
    """

    name: str
    cloud: edgel.Cloud
    board: np.ndarray | None = None


def frames() -> list[Frame]:
    """All frames of the repository, by name."""
    return [load(file) for file in sorted(FOLDER.glob("*.npz"))]


def load(file: Path) -> Frame:
    """Read a depth image (``depth``, ``intrinsics``) or a sweep (``xyz``, ``board``)."""
    with np.load(file) as stored:
        if "depth" in stored:
            return Frame(file.stem, back_projected(stored["depth"], stored["intrinsics"]))
        xyz = stored["xyz"].astype(np.float64)
        return Frame(file.stem, edgel.Cloud(xyz, viewpoint=np.zeros(3)), stored["board"])


def back_projected(depth: np.ndarray, intrinsics: np.ndarray | tuple[float, ...]) -> edgel.Cloud:
    """Cloud of a depth image (H, W) of a pinhole camera of fx, fy, cx, cy; nothing where the depth is 0."""
    fx, fy, cx, cy = intrinsics
    z = np.where(depth > 0, depth, np.nan).astype(np.float64)
    v, u = np.mgrid[: z.shape[0], : z.shape[1]]
    return edgel.Cloud(np.dstack([(u - cx) * z / fx, (v - cy) * z / fy, z]), viewpoint=np.zeros(3))


def board_figures(frame: Frame, kind: np.ndarray) -> dict[str, float]:
    """How much of the board's rim is found, and how much is false inside it.

    Parameters
    ----------
    frame : Frame
        A sweep with a board.
    kind : (N,) uint8
        `EdgeKind` flags of each point.

    Returns
    -------
    dict
        rim: share of the rings' first and last shots on the board that are edge points, or whose neighbour along the ring is (a beam that is
        half beside the board still returns); false: edge points in 1000 of those more than 6 cm inside and not on its first or last ring.
    """
    assert frame.cloud.shape is not None
    assert frame.board is not None
    xyz, edge = frame.cloud.xyz.reshape(*frame.cloud.shape, 3), (kind > 0).reshape(frame.cloud.shape)
    depth, off = inside_board(xyz, frame.board)
    with np.errstate(invalid="ignore"):
        on = (np.abs(off) < OFF_PLANE) & (depth > -OUTSIDE)
    hits = []
    for ring, seen in enumerate(np.isfinite(depth)):
        shots = np.flatnonzero(seen)
        places = np.flatnonzero(on[ring, shots])  # among the shots that returned
        if len(places) >= FEWEST:
            hits += [edge[ring, shots[max(end - 1, 0) : end + 2]].any() for end in (places[0], places[-1])]
    rings = np.flatnonzero(on.any(axis=1))
    inner = on & (depth > INSIDE)
    inner[[rings[0], rings[-1]]] = False
    return {"rim": float(np.mean(hits)), "false": 1000 * float(edge[inner].mean())}


def inside_board(xyz: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Metres inside the outline of a rectangle (negative outside), and off its plane, of points (..., 3)."""
    centre = corners.mean(axis=0)
    sides = corners[1] - corners[0], corners[3] - corners[0]
    lengths = [float(np.linalg.norm(side)) for side in sides]
    unit = [side / length for side, length in zip(sides, lengths, strict=True)]
    margins = [length / 2 - np.abs((xyz - centre) @ way) for way, length in zip(unit, lengths, strict=True)]
    return np.minimum(*margins), (xyz - centre) @ np.cross(*unit)
