"""Rivals of `edgel.register`: FPFH with RANSAC and FGR (Open3D), SC2-PCR, KISS-Matcher, and refinements.

Every global method is followed by Open3D's ICP, point to plane. SC2-PCR (Chen et al. 2022, doi:10.1109/CVPR52688.2022.01286)
is written here after its paper, without a network, on Open3D's FPFH: the authors' code is no package.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import open3d as o3d

from edgel import Cloud

o3d.utility.set_verbosity_level(o3d.utility.VerbosityLevel.Error)
_REG = o3d.pipelines.registration
VOXELS = (2.5, 5.0)
"""Spacings: both are tried, the better one counts."""
_FEATURES = 5.0  # voxels, radius of FPFH, as in Open3D's tutorial; normals 2
_MATCHES = 2000  # correspondences of SC2-PCR


def cloud_of(cloud: Cloud, voxel: float) -> tuple[Any, Any]:
    """Down-sample, with normals turned to the sensor where there is one, and FPFH."""
    xyz = cloud.xyz[np.isfinite(cloud.xyz).all(axis=1)]
    down = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(xyz)).voxel_down_sample(voxel)
    down.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(2 * voxel, 30))
    if cloud.viewpoint is not None:
        down.orient_normals_towards_camera_location(cloud.viewpoint)
    else:
        down.orient_normals_consistent_tangent_plane(12)
    search = o3d.geometry.KDTreeSearchParamHybrid(_FEATURES * voxel, 100)
    return down, _REG.compute_fpfh_feature(down, search)


def ransac(source: Cloud, target: Cloud, h: float, voxel: float) -> np.ndarray:
    (a, fa), (b, fb) = cloud_of(source, voxel * h), cloud_of(target, voxel * h)
    o3d.utility.random.seed(0)
    reach = 1.5 * voxel * h
    checks = [_REG.CorrespondenceCheckerBasedOnEdgeLength(0.9), _REG.CorrespondenceCheckerBasedOnDistance(reach)]
    found = _REG.registration_ransac_based_on_feature_matching(
        a, b, fa, fb, True, reach, _REG.TransformationEstimationPointToPoint(False), 3, checks,
        _REG.RANSACConvergenceCriteria(100_000, 0.999),
    )  # fmt: skip
    return icp(source, target, h, found.transformation)


def fgr(source: Cloud, target: Cloud, h: float, voxel: float) -> np.ndarray:
    (a, fa), (b, fb) = cloud_of(source, voxel * h), cloud_of(target, voxel * h)
    o3d.utility.random.seed(0)
    option = _REG.FastGlobalRegistrationOption(maximum_correspondence_distance=0.5 * voxel * h)
    found = _REG.registration_fgr_based_on_feature_matching(a, b, fa, fb, option)
    return icp(source, target, h, found.transformation)


def sc2_pcr(source: Cloud, target: Cloud, h: float, voxel: float) -> np.ndarray:
    (a, fa), (b, fb) = cloud_of(source, voxel * h), cloud_of(target, voxel * h)
    tree = o3d.geometry.KDTreeFlann(fb)
    rows = np.unique(np.linspace(0, fa.data.shape[1] - 1, _MATCHES).astype(int))
    match = np.array([tree.search_knn_vector_xd(fa.data[:, i], 1)[1][0] for i in rows])
    x, y = np.asarray(a.points)[rows], np.asarray(b.points)[match]
    found = consistent_pose(x, y, voxel * h)
    return icp(source, target, h, found)


def consistent_pose(x: np.ndarray, y: np.ndarray, tau: float, *, seeds: int = 100, size: int = 30) -> np.ndarray:
    """Find the pose that most correspondences (N, 3), (N, 3) agree with, by second-order spatial compatibility."""
    apart = [np.linalg.norm(p[:, None] - p[None], axis=2) for p in (x, y)]
    off = np.abs(apart[0] - apart[1])
    first = np.maximum(1 - (off / tau) ** 2, 0)
    hard = (off < tau).astype(np.float32)
    second = hard * (hard @ hard)
    vector = np.ones(len(x))
    for _ in range(10):
        vector = first @ vector
        vector /= np.linalg.norm(vector)
    near = (apart[0] < tau) & (vector[None] > vector[:, None])  # seeds are local maxima
    chosen = np.argsort(-np.where(near.any(axis=1), 0, vector), kind="stable")[:seeds]
    best, pose = -1, np.eye(4)
    for seed in chosen:
        rows = np.argsort(-second[seed], kind="stable")[:size]
        local = second[np.ix_(rows, rows)]
        weight = np.ones(len(rows))
        for _ in range(10):
            weight = local @ weight
            weight /= max(np.linalg.norm(weight), 1e-12)
        candidate = weighted_pose(x[rows], y[rows], weight)
        inside = int((np.linalg.norm(x @ candidate[:3, :3].T + candidate[:3, 3] - y, axis=1) < tau).sum())
        if inside > best:
            best, pose = inside, candidate
    for _ in range(20):
        inside = np.linalg.norm(x @ pose[:3, :3].T + pose[:3, 3] - y, axis=1) < tau
        if inside.sum() < 3:
            break
        pose = weighted_pose(x[inside], y[inside], np.ones(inside.sum()))
    return pose


def weighted_pose(x: np.ndarray, y: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Kabsch."""
    weight = weight / max(weight.sum(), 1e-12)
    cx, cy = weight @ x, weight @ y
    u, _, vt = np.linalg.svd((weight[:, None] * (x - cx)).T @ (y - cy))
    rotation = vt.T @ np.diag([1, 1, np.linalg.det(vt.T @ u.T)]) @ u.T
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, cy - rotation @ cx
    return pose


def kiss(source: Cloud, target: Cloud, h: float, voxel: float) -> np.ndarray:
    import kiss_matcher

    scale = 0.3 / (voxel * h)  # its bounds are in metres, for voxels of 0.3 m
    a, b = (scale * c.xyz[np.isfinite(c.xyz).all(axis=1)] for c in (source, target))
    matcher = kiss_matcher.KISSMatcher(kiss_matcher.KISSMatcherConfig(0.3))
    found = matcher.estimate(a, b)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = np.array(found.rotation), np.array(found.translation).ravel() / scale
    return icp(source, target, h, pose)


def icp(
    source: Cloud, target: Cloud, h: float, pose: np.ndarray, reaches: tuple[float, ...] = (4.0, 2.0)
) -> np.ndarray:
    """Open3D's ICP, point to plane, on the whole clouds."""
    a, b = (
        o3d.geometry.PointCloud(o3d.utility.Vector3dVector(c.xyz[np.isfinite(c.xyz).all(axis=1)]))
        for c in (source, target)
    )
    b.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(16))
    for reach in reaches:
        estimate = _REG.TransformationEstimationPointToPlane()
        pose = _REG.registration_icp(
            a, b, reach * h, pose, estimate, _REG.ICPConvergenceCriteria(max_iteration=40)
        ).transformation
    return np.asarray(pose)


def small_gicp(source: Cloud, target: Cloud, h: float, pose: np.ndarray) -> np.ndarray:
    """small_gicp's GICP, from a pose."""
    import small_gicp as gicp

    a, b = (c.xyz[np.isfinite(c.xyz).all(axis=1)] for c in (source, target))
    found = gicp.align(
        b, a, init_T_target_source=pose, registration_type="GICP", downsampling_resolution=h,
        max_correspondence_distance=6 * h, num_threads=1, max_iterations=60,
    )  # fmt: skip
    return np.asarray(found.T_target_source)


GLOBAL: dict[str, Callable[[Cloud, Cloud, float, float], np.ndarray]] = {
    "FPFH RANSAC": ransac, "FGR": fgr, "SC2-PCR": sc2_pcr, "KISS-Matcher": kiss,
}  # fmt: skip
