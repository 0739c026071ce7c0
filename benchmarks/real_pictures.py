"""Frames and sweeps of real sensors with what edgel finds in them, pixel by pixel: pictures to look at, before and after a change.

Run: python benchmarks/real_pictures.py OUT [--data ../shared/data]. Draws the frames of this repository (benchmarks/real), and those of
the shared data where it is present. Each picture is the depth image, shaded, with edge points in the color of their
kind; a sweep is unrolled, its rings drawn several pixels high; what is not organized is drawn as `edgel.plot` does. Prints a line of counts a picture.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import real_frames
from PIL import Image

import edgel
from edgel import EdgeKind, plot
from edgel.plot.palette import THEMES, kind_colors

LEAST_WIDTH = 640
RING = 8  # a sweep of fewer rows than this share of its columns has its rows drawn higher


def shared(data: Path) -> Iterator[tuple[str, edgel.Cloud]]:
    """Frames of depth cameras and sweeps of the shared data, in metres, the sensor at the origin."""
    for file in sorted(data.glob("structured_light/depth_*.npy")):
        yield f"phoxi_{file.stem}", depth_image(file, data / "structured_light" / "phoxi.intr")
    for name in ("ensenso", "primesense"):
        folder = data / "two_depth_sensors" / name
        if folder.is_dir():
            yield f"{name}_depth_0", depth_image(folder / "depth_0.npy", next(folder.glob("*.intr")))
    for file in sorted([*data.glob("kinect_*/*.pcd"), *data.glob("lidar_sweeps/*.ply")]):
        cloud = edgel.read(file)
        viewpoint = np.zeros(3) if cloud.is_organized else cloud.viewpoint
        yield f"{file.parent.name}_{file.stem}", edgel.Cloud(cloud.xyz, shape=cloud.shape, viewpoint=viewpoint)


def depth_image(file: Path, intrinsics: Path) -> edgel.Cloud:
    """Cloud of a depth image, 0 where there is none."""
    camera = edgel.io.read_intrinsics(intrinsics)
    return real_frames.back_projected(np.squeeze(np.load(file)), (camera.fx, camera.fy, camera.cx, camera.cy))


def picture(cloud: edgel.Cloud, edges: edgel.Edges) -> np.ndarray:
    """RGB (H, W, 3) uint8 of an organized cloud pixel by pixel, of others as `edgel.plot` draws them."""
    if cloud.shape is None:
        return plot.picture(cloud, edges, size=(1200, 900))
    rgb = shaded(cloud)
    rgb.reshape(-1, 3)[edges.index] = kind_colors(edges.kind)
    rows, columns = cloud.shape
    high = max(1, round(columns / rows / RING))
    scale = -(-LEAST_WIDTH // columns)
    return rgb.repeat(high * scale, axis=0).repeat(scale, axis=1)


def save(cloud: edgel.Cloud, edges: edgel.Edges, path: Path) -> None:
    """Write the picture, in 128 colors, the most different ones: enough for grey and the kinds, and half the size."""
    image = Image.fromarray(picture(cloud, edges)).quantize(128, method=Image.Quantize.MAXCOVERAGE)
    image.save(path, optimize=True)


def shaded(cloud: edgel.Cloud) -> np.ndarray:
    """The surface lit from the sensor's upper left, RGB (H, W, 3); white where nothing was seen."""
    assert cloud.shape is not None
    xyz = cloud.xyz.reshape(*cloud.shape, 3)
    across, down = np.full_like(xyz, np.nan), np.full_like(xyz, np.nan)
    across[:, 1:-1], down[1:-1] = xyz[:, 2:] - xyz[:, :-2], xyz[2:] - xyz[:-2]
    normal = np.cross(down, across)
    with np.errstate(invalid="ignore"):
        light = (normal / np.linalg.norm(normal, axis=2, keepdims=True)) @ (np.array([-0.4, -0.5, -0.77]))
    dark, pale = THEMES["light"].greys
    grey = np.where(np.isfinite(light), dark + (pale - dark) * np.clip(np.abs(light), 0, 1), (dark + pale) / 2)
    grey = np.where(np.isfinite(xyz[..., 2]), grey, THEMES["light"].background[0])
    return np.repeat(grey[..., None], 3, axis=2).astype(np.uint8)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    own = [(f"repository_{frame.name}", frame.cloud) for frame in real_frames.frames()]
    edgel.detect(own[0][1])  # compiles
    for name, cloud in [*own, *shared(options.data)]:
        start = time.perf_counter()
        edges = edgel.detect(cloud)
        seconds = time.perf_counter() - start
        save(cloud, edges, options.out / f"{name}.png")
        print(f"{name}: {counts(cloud, edges)}, {1e3 * seconds:.0f} ms", flush=True)


def counts(cloud: edgel.Cloud, edges: edgel.Edges) -> str:
    """How many points are edge points of each kind."""
    kinds = (EdgeKind.BOUNDARY, EdgeKind.OCCLUDING, EdgeKind.OCCLUDED, EdgeKind.CREASE)
    by_kind = ", ".join(f"{(kind.name or '').lower()} {np.count_nonzero(edges.kind & kind):,}" for kind in kinds)
    return f"{np.isfinite(cloud.xyz[:, 0]).sum():,} points: {by_kind}"


if __name__ == "__main__":
    main()
