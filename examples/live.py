"""Edges of a depth camera's frames as they come, and the rate: the loop to put your own camera into.

    python examples/live.py                                     # a simulated sensor, until Ctrl-C
    python examples/live.py FOLDER --intrinsics camera.json     # the depth PNGs of a folder, by name
    python examples/live.py FOLDER --intrinsics 525 525 319.5 239.5 --kinds crease --picture last.png

With a RealSense, for example, `frames` would yield
``np.asanyarray(pipeline.wait_for_frames().get_depth_frame().get_data())`` and the ``rs.intrinsics`` of its stream.
"""

import argparse
import itertools
import time
from collections import deque
from pathlib import Path

import numpy as np
from PIL import Image

import edgel
from edgel.plot.palette import kind_colors


def recorded(folder: Path, camera: edgel.Intrinsics):
    """Play the depth PNGs of a folder in the order of their names."""
    for path in sorted(folder.glob("*.png")):
        with Image.open(path) as picture:
            yield np.asarray(picture), camera


def simulated():
    """Circle slowly over a part with steps and a pocket; counts of 0.1 mm, 0 where the sensor sees nothing."""
    part = edgel.synth.stepped_block()
    for number in itertools.count():
        turn = 0.05 * number
        direction = (-0.5 + 0.15 * np.cos(turn), 0.65 + 0.15 * np.sin(turn), -0.6)
        scene = edgel.synth.view(part, projection="pinhole", spacing=0.3, noise=0.3, seed=number, direction=direction)
        # The camera, from what it saw: x / z = (column - cx) / fx, y / z = (row - cy) / fy.
        rows, cols = np.nonzero(np.isfinite(scene.depth))
        x, y, z = scene.cloud.xyz.reshape(*scene.depth.shape, 3)[rows, cols].T
        (x_step, x_first), (y_step, y_first) = np.polyfit(cols, x / z, 1), np.polyfit(rows, y / z, 1)
        camera = edgel.Intrinsics(1 / x_step, 1 / y_step, -x_first / x_step, -y_first / y_step, depth_scale=1e-4)
        yield np.rint(10 * np.nan_to_num(scene.depth)).astype(np.uint16), camera


def draw(depth: np.ndarray, edges: edgel.Edges) -> Image.Image:
    """Draw the edge pixels over the depth image, near light and far dark, in the colors of their kinds."""
    seen = depth > 0
    near, far = np.percentile(depth[seen], [1, 99])
    grey = np.where(seen, 220 - 160 * np.clip((depth - near) / max(far - near, 1e-9), 0, 1), 0).astype(np.uint8)
    pixels = np.repeat(grey[:, :, None], 3, axis=2)
    pixels.reshape(-1, 3)[edges.index] = kind_colors(edges.kind)  # a row of an organized cloud is a pixel
    return Image.fromarray(pixels)


def camera_of(words: list[str]) -> edgel.Intrinsics:
    """Read the camera from its JSON file, or from four numbers."""
    if len(words) == 1:
        return edgel.io.read_intrinsics(words[0])
    fx, fy, cx, cy = map(float, words)
    return edgel.Intrinsics(fx, fy, cx, cy)  # here also width, height, or depth_scale where a count is no millimetre


def main() -> None:
    """Find the edges of frame after frame and keep one line of the terminal up to date."""
    parser = argparse.ArgumentParser(description="Edges of a depth camera's frames, and the rate.")
    parser.add_argument("folder", nargs="?", type=Path, help="depth PNGs; without it a sensor is simulated")
    parser.add_argument("--intrinsics", nargs="+", help="a JSON file, or fx fy cx cy")
    parser.add_argument("--kinds", nargs="+", help="such as crease boundary (default: all there are without color)")
    parser.add_argument("--frames", type=int, help="stop after so many")
    parser.add_argument("--picture", help="write the last frame with its edges to this file")
    asked = parser.parse_args()
    if asked.folder and len(asked.intrinsics or ()) not in (1, 4):
        parser.error("a folder needs --intrinsics FILE or --intrinsics FX FY CX CY")
    frames = recorded(asked.folder, camera_of(asked.intrinsics)) if asked.folder else simulated()
    options = {"kinds": asked.kinds} if asked.kinds else {}
    seconds, last = deque(maxlen=30), None
    try:
        for number, (depth, camera) in enumerate(itertools.islice(frames, asked.frames), start=1):
            if np.count_nonzero(depth) < 100:  # a covered lens: detect needs something to look at
                continue
            start = time.perf_counter()
            edges = edgel.detect(edgel.from_depth(depth, camera), **options)
            seconds.append(time.perf_counter() - start)  # of our work, not of waiting for the camera
            last = depth, edges
            counts = ", ".join(f"{count} {name}" for name, count in edges.count_kinds().items()) or "no edges"
            line = f"frame {number}: {1 / np.median(seconds):.1f} frames/s, {counts}"
            print(f"\r{line:<100}", end="", flush=True)
    except KeyboardInterrupt:
        pass  # the usual way to stop a live program
    print()
    if last is None:
        parser.exit(1, "no frame with depth came\n")
    elif asked.picture:
        draw(*last).save(asked.picture)


if __name__ == "__main__":
    main()
