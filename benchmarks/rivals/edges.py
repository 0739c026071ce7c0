"""The detectors of edges. Where each default comes from stands in README.md."""

from __future__ import annotations

import importlib.util
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

import edgel
from edgel.edges import EdgeKind

from . import programs, sensor
from .interface import OUTLINE, THREADS, Found, Rival, finite_rows, found, grid, spread

METRES = 1e-3  # scenes are in mm; PCL's organized normals know metres (integral_image_normal.hpp adds 1 to the depth)
ALL = OUTLINE | EdgeKind.CREASE

# Open3D 0.20 finds no boundary where a normal is exactly along Z (its two directions in the plane come out as 0), which
# only happens to faces along the axes without any noise. Turned by some rotation, the cloud is the same to a detector.
_TURN = np.linalg.qr(np.array([[0.8, -0.5, 0.3], [0.4, 0.9, -0.2], [-0.3, 0.35, 0.85]]))[0]


def _pcl_organized(cloud: edgel.Cloud, spacing: float, parameters: Mapping) -> Found:
    pose = sensor.locate(cloud, spacing)
    place = {"axes": pose.axes, "origin": pose.origin, "scale": METRES, "use_range": int(pose.wide)}
    options = dict(parameters)
    # PCL's threshold is relative to the depth; a step in spacings is the same demand on every sensor.
    step = options.pop("depth_step", None)
    if step is not None:
        options["depth_threshold"] = step * spacing / pose.depth(cloud)
    bits, seconds = programs.run("pcl_organized", cloud, "u1", **place, **options)
    # PCL's bits are NAN_BOUNDARY 1, OCCLUDING 2, OCCLUDED 4, HIGH_CURVATURE 8: the same as EdgeKind's.
    return Found(bits != 0, bits, seconds)


def _pcl_boundary(cloud: edgel.Cloud, spacing: float, parameters: Mapping) -> Found:
    flags, seconds = programs.run(
        "pcl_boundary",
        cloud,
        "u1",
        radius=parameters["radius"] * spacing,
        normal_radius=parameters["normal_radius"] * spacing,
        angle=math.radians(parameters["angle"]),
        threads=THREADS,
    )
    return found(flags != 0, EdgeKind.BOUNDARY, seconds)


def _cgal_vcm(cloud: edgel.Cloud, spacing: float, parameters: Mapping) -> Found:
    flags, seconds = programs.run(
        "cgal_vcm",
        cloud,
        "u1",
        offset_radius=parameters["offset_radius"] * spacing,
        convolution_radius=parameters["convolution_radius"] * spacing,
        threshold=parameters["threshold"],
    )
    return found(flags != 0, EdgeKind.CREASE, seconds)


def _open3d_boundary(cloud: edgel.Cloud, spacing: float, parameters: Mapping) -> Found:
    import open3d as o3d

    rows = finite_rows(cloud)
    xyz = cloud.xyz[rows]
    points = o3d.t.geometry.PointCloud(o3d.core.Tensor(np.ascontiguousarray((xyz - xyz.mean(axis=0)) @ _TURN.T)))
    radius = parameters["radius"] * spacing
    begin = time.perf_counter()
    points.estimate_normals(parameters["max_nn"], radius)
    _, mask = points.compute_boundary_points(radius, parameters["max_nn"], parameters["angle"])
    seconds = time.perf_counter() - begin
    return found(spread(rows, mask.numpy().astype(bool), len(cloud)), EdgeKind.BOUNDARY, seconds)


def surface_variation(xyz: np.ndarray, scale: float, k: int) -> np.ndarray:
    """Return the smallest eigenvalue over the sum of all of the covariance of the k nearest, the point among them.

    pgeof, because it takes the k nearest as the classical analysis does; jakteristics takes a radius alone. Its
    "curvature" is made of the roots of the eigenvalues, so the variation is put together from two others of it:
    linearity ``(s1 - s2) / s1`` and scattering ``s3 / s1`` with ``s = sqrt(eigenvalue)``.
    """
    import pgeof

    # pgeof is float32 and adds 1e-3 to s1: coordinates are centred, and scaled so that this is nothing.
    points = ((xyz - xyz.mean(axis=0)) * (1e3 / scale)).astype(np.float32)
    k = min(k, len(points))
    neighbors, _ = pgeof.knn_search(points, points, k)
    starts = np.arange(0, k * len(points) + 1, k, dtype=np.uint32)
    features = pgeof.compute_features(points, neighbors.ravel().astype(np.uint32), starts)
    middle, smallest = 1.0 - features[:, 0].astype(float), features[:, 2].astype(float)
    return smallest**2 / (1.0 + middle**2 + smallest**2)


def _surface_variation(cloud: edgel.Cloud, spacing: float, parameters: Mapping) -> Found:
    rows = finite_rows(cloud)
    begin = time.perf_counter()
    edge = surface_variation(cloud.xyz[rows], spacing, parameters["k"]) > parameters["threshold"]
    return found(spread(rows, edge, len(cloud)), EdgeKind.CREASE, time.perf_counter() - begin)


def _edgel_paper(cloud: edgel.Cloud, spacing: float, parameters: Mapping) -> Found:
    # The method looks down along Z: a view is turned so that its sensor is above.
    if cloud.shape is not None:
        pose = sensor.locate(cloud, spacing)
        cloud = edgel.Cloud((cloud.xyz - pose.origin) @ (pose.axes * [[1], [-1], [-1]]).T)
    begin = time.perf_counter()
    edges = edgel.paper.detect(cloud, **parameters)
    return _from_edges(edges, time.perf_counter() - begin)


def _edgel_default(cloud: edgel.Cloud, spacing: float, parameters: Mapping) -> Found:
    begin = time.perf_counter()
    edges = edgel.detect(cloud, **parameters)
    found = _from_edges(edges, time.perf_counter() - begin)
    normals = np.full((len(cloud), 3), np.nan)
    normals[edges.index] = edges.normals[:, 0]
    return replace(found, normals=normals)


def _from_edges(edges: edgel.Edges, seconds: float) -> Found:
    kind = np.zeros(edges.num_points, np.uint8)
    kind[edges.index] = edges.kind
    return Found(kind != 0, kind, seconds)


def module_missing(name: str) -> Callable[[], str | None]:
    return lambda: None if importlib.util.find_spec(name) else f"{name} is not installed: pip install {name}"


def program_missing(name: str) -> Callable[[], str | None]:
    return lambda: programs.missing(name)


_PCL_ORGANIZED = {
    "method": "covariance",
    "smoothing": 10.0,
    "max_depth_change": 0.02,
    "depth_threshold": 0.02,
    "max_search": 50,
    "low": 0.4,
    "high": 1.1,
}
_PCL_BOUNDARY = {"radius": 10.5, "normal_radius": 10.5, "angle": 90.0}
_CGAL_VCM = {"offset_radius": 3.0, "convolution_radius": 1.5, "threshold": 0.16}
_OPEN3D_BOUNDARY = {"radius": 3.4, "max_nn": 30, "angle": 90.0}
_SURFACE_VARIATION = {"k": 51, "threshold": 0.03}  # 50 and the point itself

RIVALS = (
    Rival(
        name="PCL organized",
        finds=ALL,
        organized_only=True,
        defaults=_PCL_ORGANIZED,
        grid=grid(
            _PCL_ORGANIZED,
            *(
                {"smoothing": size, "method": method, "depth_step": step, "low": low, "high": high}
                for size, method, step, low, high in (
                    (3.0, "covariance", 5.0, 0.4, 1.1),
                    (3.0, "covariance", 10.0, 0.4, 1.1),
                    (3.0, "covariance", 10.0, 0.2, 0.5),
                    (3.0, "covariance", 20.0, 0.2, 0.5),
                    (3.0, "gradient", 10.0, 0.2, 0.5),
                    (3.0, "gradient", 10.0, 0.8, 1.6),
                    (5.0, "covariance", 5.0, 0.4, 1.1),
                    (5.0, "gradient", 10.0, 0.2, 0.5),
                    (5.0, "gradient", 10.0, 0.4, 1.1),
                    (5.0, "gradient", 10.0, 0.8, 1.6),
                    (5.0, "gradient", 20.0, 0.4, 1.1),
                    (10.0, "covariance", 10.0, 0.2, 0.5),
                )
            ),
        ),
        missing=program_missing("pcl_organized"),
        run=_pcl_organized,
    ),
    Rival(
        name="PCL boundary",
        finds=OUTLINE,
        organized_only=False,
        defaults=_PCL_BOUNDARY,
        grid=grid(
            _PCL_BOUNDARY,
            *({"radius": r, "normal_radius": r, "angle": a} for r in (2.5, 3.5, 5.0) for a in (90.0, 110.0, 130.0)),
        ),
        missing=program_missing("pcl_boundary"),
        run=_pcl_boundary,
    ),
    Rival(
        name="CGAL VCM",
        finds=ALL,
        organized_only=False,
        defaults=_CGAL_VCM,
        grid=grid(
            _CGAL_VCM,
            *(
                {"offset_radius": R, "convolution_radius": r, "threshold": t}
                for R, r in ((3.0, 1.5), (5.0, 1.5), (5.0, 3.0), (8.0, 5.0))
                for t in (0.1, 0.16, 0.22)
                if (R, r, t) != (3.0, 1.5, 0.16)
            ),
        ),
        missing=program_missing("cgal_vcm"),
        run=_cgal_vcm,
    ),
    Rival(
        name="Open3D boundary",
        finds=OUTLINE,
        organized_only=False,
        defaults=_OPEN3D_BOUNDARY,
        grid=grid(
            _OPEN3D_BOUNDARY,
            *(
                {"radius": r, "max_nn": n, "angle": a}
                for r, n in ((2.5, 30), (3.4, 30), (5.0, 80))
                for a in (90.0, 110.0, 130.0)
                if (r, a) != (3.4, 90.0)
            ),
        ),
        missing=module_missing("open3d"),
        run=_open3d_boundary,
    ),
    Rival(
        name="surface variation",
        finds=EdgeKind.CREASE,
        organized_only=False,
        defaults=_SURFACE_VARIATION,
        grid=grid(
            _SURFACE_VARIATION,
            *(
                {"k": k, "threshold": t}
                for k, thresholds in (
                    (10, (0.02, 0.04)),
                    (16, (0.02, 0.04, 0.08)),
                    (30, (0.03, 0.06)),
                    (51, (0.06, 0.1, 0.15)),
                    (100, (0.06, 0.1)),
                )
                for t in thresholds
            ),
        ),
        missing=module_missing("pgeof"),
        run=_surface_variation,
    ),
    Rival(
        name="edgel paper",
        finds=ALL,
        organized_only=False,
        defaults={},
        grid=(),
        missing=lambda: None,
        run=_edgel_paper,
    ),
    Rival(
        name="edgel default",
        finds=ALL,
        organized_only=False,
        defaults={},
        grid=(),
        missing=lambda: None,
        run=_edgel_default,
    ),
)
