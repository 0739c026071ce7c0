"""Answers of today for a dozen small clouds: what must not change unless it is meant to.

``python tests/golden.py`` writes them anew into tests/golden.npz; do that only in a change that means to change
answers, and say in it what became better.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

import edgel
from edgel import Cloud, synth

FILE = Path(__file__).parent / "golden.npz"
FIELDS = ("index", "kind", "strength", "position", "position_std", "scale", "direction", "normals", "angle", "convex")
PLANES = ("normals", "offset", "residual", "variation")
EVERY = 20  # of how many points the plane fits are kept


def clouds() -> Iterator[tuple[str, Cloud]]:
    """Make the clouds; they are stored with the answers, since random numbers may change with NumPy."""
    yield "fan", synth.sample(synth.wedge_fan(), spacing=4.5, noise=0.1, seed=1).cloud
    yield "gear", synth.sample(synth.gear(), pattern="blue_noise", spacing=2.4, seed=2).cloud
    yield "gear_noisy", synth.sample(synth.gear(), pattern="uniform", spacing=2.4, noise=0.4, seed=3).cloud
    yield "fractal", synth.sample(synth.cube_fractal(), spacing=2.8, outliers=0.02, seed=4).cloud
    yield "block_lines", synth.sample(synth.stepped_block(), pattern="scan_lines", spacing=3.2, seed=5).cloud
    yield "sphere", synth.sample(synth.sphere(), pattern="uniform", spacing=2.4, noise=0.3, seed=6).cloud
    seen = synth.view(synth.stepped_block(), projection="pinhole", spacing=3.0, noise=0.1, seed=7).cloud
    yield "camera", seen
    finite = np.isfinite(seen.xyz).all(axis=1)
    yield "camera_list", Cloud(seen.xyz[finite], viewpoint=seen.viewpoint)
    yield "parallel", synth.view(synth.gear(), projection="orthographic", spacing=2.2, noise=0.3, seed=8).cloud
    yield "sweep", Cloud(_sweep())
    yield "print", _print()
    yield "utm", Cloud(_roof() + [512_000.0, 5_612_000.0, 128.0])


def answers(cloud: Cloud) -> dict[str, np.ndarray]:
    """Answer every question about a cloud, by question and field."""
    kinds = ["crease", "boundary", "color"] if "red" in cloud.attributes else ["crease"]
    asked: dict[str, Callable[[], edgel.Edges]] = {
        "detect": lambda: edgel.detect(cloud),
        "faint": lambda: edgel.detect(cloud, kinds=kinds, min_strength=0.2, num_neighbors=9),
        "scale": lambda: edgel.detect(cloud, scale=2.0),
        "paper": lambda: edgel.paper.detect(cloud),
    }
    found = {f"{name}.{field}": getattr(edges(), field) for name, edges in asked.items() for field in FIELDS}
    planes = edgel.estimate_normals(cloud, num_neighbors=12).take(np.arange(0, len(cloud), EVERY))
    return found | {f"planes.{name}": getattr(planes, name) for name in PLANES}


def _sweep() -> np.ndarray:
    """Return what a spinning sensor of 16 lasers sees in a room."""
    azimuth, elevation = np.meshgrid(np.arange(0, 2 * np.pi, 0.04), np.radians(np.linspace(-15, 15, 16)))
    rays = np.stack([np.cos(azimuth), np.sin(azimuth), np.tan(elevation)], axis=-1).reshape(-1, 3)
    return rays * (4 / np.abs(rays[:, :2] * [1, 0.7]).max(axis=1, keepdims=True))


def _print() -> Cloud:
    """Return a wavy sheet with a colored disc printed on it."""
    rng = np.random.default_rng(9)
    x, y = rng.uniform(0, 60, (2, 2500))
    inside = (x - 30) ** 2 + (y - 28) ** 2 < 300
    rgb = np.where(inside[:, None], [210, 180, 40], [50, 90, 60]) + rng.normal(0, 4, (2500, 3))
    levels = np.clip(rgb, 0, 255).astype(np.uint8)
    channels = {name: levels[:, i] for i, name in enumerate(("red", "green", "blue"))}
    return Cloud(np.column_stack([x, y, np.sin(x / 7)]), channels)


def _roof() -> np.ndarray:
    """Return a roof with repeated points and some that are not finite."""
    rng = np.random.default_rng(10)
    x, y = rng.uniform(0, 50, (2, 2000))
    roof = np.column_stack([x, y, -0.7 * np.abs(x - 24)])
    return np.concatenate([roof, roof[:100], np.full((4, 3), np.nan)])


def stored() -> dict[str, tuple[Cloud, dict[str, np.ndarray]]]:
    """Read the clouds and their answers, by name."""
    found: dict[str, tuple[Cloud, dict[str, np.ndarray]]] = {}
    with np.load(FILE) as file:
        for name in file["names"].tolist():
            parts = {key.removeprefix(f"{name}/"): file[key] for key in file if key.startswith(f"{name}/")}
            own = {key: parts.pop(f"cloud.{key}") for key in ("xyz", "shape", "viewpoint", "rgb")}
            attributes: dict[str, np.ndarray] = {}
            if own["rgb"].size:
                attributes |= zip(("red", "green", "blue"), own["rgb"].T, strict=True)
            cloud = Cloud(
                own["xyz"],
                attributes,
                shape=tuple(own["shape"].tolist()) or None,
                viewpoint=own["viewpoint"] if own["viewpoint"].size else None,
            )
            found[name] = cloud, parts
    return found


def write() -> None:
    """Write the clouds and the answers of this code."""
    arrays: dict[str, np.ndarray] = {}
    for name, made in clouds():
        # Single precision holds a part; far from the origin it does not.
        xyz = made.xyz if name == "utm" else made.xyz.astype(np.float32).astype(np.float64)
        cloud = Cloud(xyz, made.attributes, shape=made.shape, viewpoint=made.viewpoint)
        rgb = [cloud.attributes[channel] for channel in ("red", "green", "blue") if channel in cloud.attributes]
        own = {
            "xyz": xyz if name == "utm" else xyz.astype(np.float32),
            "shape": np.array(cloud.shape or (), np.int64),
            "viewpoint": np.array([] if cloud.viewpoint is None else cloud.viewpoint),
            "rgb": np.column_stack(rgb) if rgb else np.empty((0, 3), np.uint8),
        }
        arrays |= {f"{name}/cloud.{key}": values for key, values in own.items()}
        for key, values in answers(cloud).items():
            arrays[f"{name}/{key}"] = (
                values.astype(np.float32) if values.dtype == np.float64 and name != "utm" else values
            )
        print(f"{name}: {len(cloud):,} points")
    names = list(dict.fromkeys(key.split("/")[0] for key in arrays))
    np.savez_compressed(FILE, names=np.array(names), **arrays)  # pyright: ignore[reportArgumentType]


if __name__ == "__main__":
    write()
