"""Parts of the benchmark that need a CAD kernel, as solids with exactly known edges; lengths in millimetres.

Every B-rep face is tessellated so that its chords are off the surface by less than 1 % of the usual spacing, and the
true normals of the faces are evaluated at every corner of the mesh; the creases follow as for any `edgel.synth.Solid`.
The results are cached; without the cache, `pip install 'edgel[bench]'` (build123d) is needed.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from edgel.synth import Solid, make_solid

try:
    import build123d as cad
    from OCP.BRep import BRep_Tool
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.GeomLProp import GeomLProp_SLProps
    from OCP.TopAbs import TopAbs_REVERSED
    from OCP.TopLoc import TopLoc_Location
except ImportError:  # the cache may do
    cad = None

VERSION = 1  # raise it when a part changes
CACHE = Path(__file__).parent / "cache"
CHORD = 0.005  # of the usual spacing
_MIN_SHARP = 1e-7


def tee() -> Any:
    """An equal tee to ASME B16.9 DN 100, hollow: run along x, branch along +y, seams without fillets."""
    outer, inner, end = 114.3 / 2, 114.3 / 2 - 6.02, 105.0

    def pipes(radius: float, beyond: float) -> Any:
        run = cad.Rot(0, 90, 0) * cad.Cylinder(radius, 2 * (end + beyond))
        branch = cad.Pos(0, (end + beyond) / 2, 0) * cad.Rot(90, 0, 0) * cad.Cylinder(radius, end + beyond)
        return run + branch

    return pipes(outer, 0.0) - pipes(inner, 10.0)


def elbow() -> Any:
    """A long-radius 90 degree elbow to ASME B16.9 DN 100, hollow, its bend about the z axis."""
    outer, inner, bend = 114.3 / 2, 114.3 / 2 - 6.02, 152.4
    ring = cad.Plane.XZ * cad.Pos(bend, 0) * (cad.Circle(outer) - cad.Circle(inner))
    return cad.revolve(ring, cad.Axis.Z, 90)


def flange() -> Any:
    """A welding-neck flange: 8 bolt holes, a raised face, a conical hub and a bore."""
    body = cad.Cylinder(60, 14, align=(cad.Align.CENTER, cad.Align.CENTER, cad.Align.MIN))
    face = cad.Pos(0, 0, -2) * cad.Cylinder(40, 2, align=(cad.Align.CENTER, cad.Align.CENTER, cad.Align.MIN))
    hub = cad.Pos(0, 0, 14) * cad.Cone(36, 27, 24, align=(cad.Align.CENTER, cad.Align.CENTER, cad.Align.MIN))
    holes = [cad.Rot(0, 0, 45 * i + 22.5) * cad.Pos(49, 0, 0) * cad.Cylinder(5.5, 80) for i in range(8)]
    solid = body + face + hub - cad.Cylinder(21, 200)
    for hole in holes:
        solid -= hole
    return solid


def bracket() -> Any:
    """An angle bracket with a triangular rib, two bolt holes and one round corner."""
    foot = cad.Pos(35, 0, 4) * cad.Box(70, 60, 8)
    wall = cad.Pos(4, 0, 40) * cad.Box(8, 60, 80)
    profile = cad.Plane.XZ * cad.make_face(cad.Polyline((8, 8), (55, 8), (8, 62), close=True))
    rib = cad.Pos(0, 4, 0) * cad.extrude(profile, 8)
    solid = foot + wall + rib
    for y in (-18, 18):
        solid -= cad.Pos(50, y, 0) * cad.Cylinder(6, 60)
        solid -= cad.Pos(0, y, 60) * cad.Rot(0, 90, 0) * cad.Cylinder(5, 60)
    upright = solid.edges().filter_by(cad.Axis.Z).group_by(cad.Axis.X)[-1]
    return cad.fillet(upright, 9)


def chamfered_block() -> Any:
    """A block with a chamfer on one side of its top, a fillet on the other, and a spherical dimple."""
    solid = cad.Box(80, 60, 36)
    along = solid.edges().filter_by(cad.Axis.X).group_by(cad.Axis.Z)[-1].sort_by(cad.Axis.Y)
    solid = cad.chamfer(along[0], 7)
    along = solid.edges().filter_by(cad.Axis.X).group_by(cad.Axis.Z)[-1].sort_by(cad.Axis.Y)
    solid = cad.fillet(along[-1], 8)
    upright = solid.edges().filter_by(cad.Axis.Z).sort_by(lambda edge: edge.center().X + edge.center().Y)
    solid = cad.fillet(upright[0], 10)
    return solid - cad.Pos(10, -2, 18 + 12) * cad.Sphere(20)


def sheet_metal() -> Any:
    """A bent sheet 2 mm thick: a hat profile with four bends of 4 mm inside radius, and a slot."""
    line = cad.Polyline((-65, 0), (-32, 0), (-24, 34), (24, 34), (40, 0), (65, 0))
    bent = cad.fillet(line.vertices().sort_by(cad.Axis.X)[1:-1], 5)
    profile = cad.offset(bent, 1, side=cad.Side.BOTH, kind=cad.Kind.INTERSECTION)
    solid = cad.extrude(cad.Plane.XZ * cad.make_face(profile), 70)
    middle = solid.bounding_box().center()
    slot = cad.Pos(0, middle.Y, 34) * cad.Box(24, 26, 12)
    return solid - cad.fillet(slot.edges().filter_by(cad.Axis.Z), 6)


PARTS: dict[str, tuple[Callable[[], Any], float]] = {
    "tee": (tee, 2.2),
    "elbow": (elbow, 2.2),
    "flange": (flange, 1.1),
    "bracket": (bracket, 0.9),
    "chamfered_block": (chamfered_block, 0.8),
    "sheet_metal": (sheet_metal, 0.8),
}
"""The maker of each part and its usual spacing, mm."""


def part(name: str) -> Solid:
    """Make a part, or read it from the cache.

    Raises
    ------
    ImportError
        If it is not cached and build123d is not installed.
    """
    if name not in PARTS:
        raise ValueError(f"name: expected one of {tuple(PARTS)}, got {name!r}")
    path = CACHE / f"part-v{VERSION}-{name}.npz"
    if not path.exists():
        if cad is None:
            raise ImportError(
                f"the part {name!r} is made with build123d: pip install 'edgel[bench]', or pip install build123d"
            )
        maker, spacing = PARTS[name]
        solid = tessellate(name, maker(), spacing)
        path.parent.mkdir(exist_ok=True)
        whole = path.with_name(f"{path.stem}.{os.getpid()}.part.npz")
        np.savez(whole, corners=solid.corners, face=solid.face, normals=solid.normals)
        whole.replace(path)
    with np.load(path) as stored:
        return make_solid(name, stored["corners"], stored["face"], stored["normals"], spacing=PARTS[name][1])


def tessellate(name: str, shape: Any, spacing: float) -> Solid:
    """Turn a build123d shape into a solid."""
    BRepMesh_IncrementalMesh(shape.wrapped, CHORD * spacing, False, 0.2, False)
    corners, normals, face = [], [], []
    for number, brep in enumerate(shape.faces()):
        triangles, normal = _face(brep.wrapped)
        corners.append(triangles)
        normals.append(normal)
        face.append(np.full(len(triangles), number))
    return make_solid(name, np.concatenate(corners), np.concatenate(face), np.concatenate(normals), spacing=spacing)


def _face(face: Any) -> tuple[np.ndarray, np.ndarray]:
    """Corners and true outward normals of the triangles of a B-rep face, both (T, 3, 3)."""
    place = TopLoc_Location()
    mesh = BRep_Tool.Triangulation_s(face, place)
    transform = place.Transformation()
    surface = BRep_Tool.Surface_s(face)  # with the face's own location
    turned = -1.0 if face.Orientation() == TopAbs_REVERSED else 1.0
    points, normals = np.empty((mesh.NbNodes(), 3)), np.empty((mesh.NbNodes(), 3))
    for i in range(mesh.NbNodes()):
        at = mesh.Node(i + 1).Transformed(transform)
        uv = mesh.UVNode(i + 1)
        points[i] = at.X(), at.Y(), at.Z()
        local = GeomLProp_SLProps(surface, uv.X(), uv.Y(), 1, _MIN_SHARP)
        if not local.IsNormalDefined():
            raise ValueError(f"no normal at {points[i]}: the part has a face with a singular point")
        direction = local.Normal()
        normals[i] = turned * direction.X(), turned * direction.Y(), turned * direction.Z()
    rows = np.array([mesh.Triangle(i + 1).Get() for i in range(mesh.NbTriangles())]) - 1
    if turned < 0:
        rows = rows[:, ::-1]
    return points[rows], normals[rows]
