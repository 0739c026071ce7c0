"""Normals of all points from their k nearest neighbours, the point itself among them; two threads each."""

from __future__ import annotations

import time

import numpy as np

import edgel

from . import programs
from .edges import module_missing, program_missing
from .interface import THREADS, NormalsRival


def _edgel(points: np.ndarray, k: int) -> tuple[np.ndarray, float]:
    begin = time.perf_counter()
    planes = edgel.estimate_normals(points, num_neighbors=k)
    return planes.normals, time.perf_counter() - begin


def _open3d(points: np.ndarray, k: int) -> tuple[np.ndarray, float]:
    import open3d as o3d

    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    begin = time.perf_counter()
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(k))
    seconds = time.perf_counter() - begin
    return np.asarray(cloud.normals), seconds


def _small_gicp(points: np.ndarray, k: int) -> tuple[np.ndarray, float]:
    import small_gicp

    cloud = small_gicp.PointCloud(points)
    begin = time.perf_counter()
    tree = small_gicp.KdTree(cloud, num_threads=THREADS)
    small_gicp.estimate_normals(cloud, tree, num_neighbors=k, num_threads=THREADS)
    seconds = time.perf_counter() - begin
    return np.asarray(cloud.normals())[:, :3], seconds


def _pcl(points: np.ndarray, k: int) -> tuple[np.ndarray, float]:
    values, seconds = programs.run("pcl_normals", edgel.Cloud(points), "<f4", k=k, threads=THREADS)
    return values.reshape(-1, 3).astype(float), seconds


def _scipy(points: np.ndarray, k: int) -> tuple[np.ndarray, float]:
    from scipy.spatial import cKDTree

    begin = time.perf_counter()
    _, neighbors = cKDTree(points).query(points, k, workers=THREADS)
    normals = np.empty((len(points), 3))
    for first in range(0, len(points), 100_000):  # in parts, or the neighbours' coordinates fill the memory
        part = points[neighbors[first : first + 100_000]]
        part -= part.mean(axis=1, keepdims=True)
        normals[first : first + 100_000] = np.linalg.eigh(part.transpose(0, 2, 1) @ part)[1][:, :, 0]
    return normals, time.perf_counter() - begin


NORMALS = (
    NormalsRival("edgel", lambda: None, _edgel),
    NormalsRival("Open3D", module_missing("open3d"), _open3d),
    NormalsRival("small_gicp", module_missing("small_gicp"), _small_gicp),
    NormalsRival("PCL OMP", program_missing("pcl_normals"), _pcl),
    NormalsRival("scipy", module_missing("scipy"), _scipy),
)
