"""Registration on real frames: two halves of one, the second moved by a pose that is known.

Run: python benchmarks/register_real.py [--data ../shared/data]. Halves overlap by a quarter of the frame. What their errors
do not show: the halves share sensor and moment, so they are easier than two frames.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
import register_pairs as pairs

import edgel
from edgel import Cloud

FRAMES = (
    "kinect_organized/table_scene_mug_stereo_textured.pcd",
    "kinect_organized/milk_cartoon_all_small_clorox.pcd",
    "kinect_objects/learn0.pcd",
)
SWEEP = "lidar_sweeps/small_gicp_target.ply"


def halves(cloud: Cloud) -> tuple[Cloud, Cloud]:
    """The left and the right part of a frame, which overlap by a quarter of it; of a list by azimuth."""
    if cloud.shape is not None and min(cloud.shape) > 1:
        rows, columns = cloud.shape
        grid = cloud.xyz.reshape(rows, columns, 3)
        left, right = grid[:, : 5 * columns // 8], grid[:, 3 * columns // 8 :]
        eye = cloud.viewpoint if cloud.viewpoint is not None else np.zeros(3)
        return Cloud(left, viewpoint=eye), Cloud(right, viewpoint=eye)
    turn = np.arctan2(cloud.xyz[:, 1], cloud.xyz[:, 0])
    return (
        Cloud(cloud.xyz[turn < np.pi / 4], viewpoint=np.zeros(3)),
        Cloud(cloud.xyz[turn > -np.pi / 4], viewpoint=np.zeros(3)),
    )


def moved(cloud: Cloud, pose: np.ndarray) -> Cloud:
    """Move a cloud and its sensor."""
    assert cloud.viewpoint is not None
    eye = pose[:3, :3] @ cloud.viewpoint + pose[:3, 3]
    return Cloud(cloud.xyz @ pose[:3, :3].T + pose[:3, 3], shape=cloud.shape, viewpoint=eye)


def main(data: Path) -> None:
    rng = np.random.default_rng(0)
    print("| frame | degrees | shift | margin | found by | CPU s |\n|---|---|---|---|---|---|")
    for name in (*FRAMES, SWEEP):
        source, target = halves(edgel.read(data / name))
        size = float(np.nanmax(np.abs(source.xyz)))
        pose = pairs.random_pose(rng, 0.3 * size)
        start = time.process_time()
        answer = edgel.register(source, moved(target, pose))
        seconds = time.process_time() - start
        if not answer.found:
            print(f"| {name} | - | - | - | {answer.reason} | {seconds:.1f} |", flush=True)
            continue
        rotation = answer.T_target_source[:3, :3].T @ pose[:3, :3]
        degrees = np.degrees(np.arccos(np.clip((np.trace(rotation) - 1) / 2, -1, 1)))
        middle = np.append(np.nanmedian(source.xyz, axis=0), 1)
        shift = np.linalg.norm(((answer.T_target_source - pose) @ middle)[:3])
        print(
            f"| {name} | {degrees:.3f} | {shift:.4f} | {answer.margin:.2f} | {answer.method} | {seconds:.1f} |",
            flush=True,
        )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=Path(__file__).parents[2] / "shared" / "data")
    main(parser.parse_args().data)
