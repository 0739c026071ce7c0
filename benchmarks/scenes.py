"""The scenes of the benchmark: clouds with exactly known edges, each made again from its name alone.

A name says everything: ``flange/pinhole/n0.3/o1`` is the flange, seen by a pinhole camera, with noise of 0.3 spacings
and 1 % outliers. The second part is a view (orthographic, pinhole, spherical) or a pattern of the whole surface (uniform,
blue_noise, scan_lines, graded); a digit after it takes another of the poses below (views) or another seed (patterns).

TEST holds every shape in all seven views and patterns (17 x 7). Noise (0, 0.1, 0.3, 1) and outliers (0, 1, 5 %; three
fifths have none) go round along shapes and views, so that every level meets every view, pattern and shape family. To that
come two shapes at all four noises with nothing else changed (LADDER): the curves over noise compare like with like.
SENSED holds nine shapes as three real sensors see them (kinect, stereo, spinning: `edgel.synth.SENSORS`), whose own errors
take the place of noise and outliers.
TUNE holds other shapes, poses and seeds, three scenes for each noise: parameters chosen there have seen nothing of TEST.
"""

from __future__ import annotations

import hashlib
import os
from functools import cache
from pathlib import Path

import numpy as np

from edgel import Cloud, synth
from edgel.synth import Scene, Solid, TrueEdges

VERSION = 2  # raise it when the same name would give other bytes
CACHE = Path(__file__).parent / "cache"

NEGATIVES = ("sphere", "torus", "wavy_sheet", "plane")
"""No crease anywhere; plane and wavy sheet have boundaries, spheres and tori in a view their outline."""
SYNTHETIC = ("frustum", "stepped_block", "cube_fractal", "wedge_fan", "thin_plate", "gear", "bezier_ridge")
CAD = ("tee", "elbow", "flange", "bracket", "chamfered_block", "sheet_metal")
"""Made by `parts`, with build123d."""
SHAPES = (*SYNTHETIC, *CAD, *NEGATIVES)
TUNE_SHAPES = {
    "pyramid": lambda: synth.frustum(sides=5, bottom=42.0, top=12.0, height=38.0),
    "tall_frustum": lambda: synth.frustum(sides=9, bottom=26.0, top=32.0, height=60.0),
    "cylinder": synth.cylinder,
    "wedge_bar": lambda: synth.wedge_fan(angles=(25, 55, 85, 115, 145), flank=14.0, width=60.0),
    "small_gear": lambda: synth.gear(teeth=9, root=28.0, tip=38.0, bore=12.0, thick=22.0),
    "ring": lambda: synth.torus(radius=26.0, tube=14.0),
}

VIEWS = synth.PROJECTIONS
SENSORS = tuple(synth.SENSORS)
PATTERNS = ("uniform", "blue_noise", "scan_lines", "graded")
POSES = (
    {"direction": (-0.48, 0.66, -0.58), "roll": 0.2},
    {"direction": (0.62, 0.41, -0.67), "roll": -0.35},
    {"direction": (0.35, -0.72, -0.60), "roll": 0.5},
)
NOISES = (0, 0.1, 0.3, 1)
OUTLIERS = (0, 0, 1, 0, 5)


def _latin() -> list[str]:
    """Every shape in every view and pattern, once."""
    return [
        f"{shape}/{seen}/n{NOISES[(i + j) % 4]:g}/o{OUTLIERS[(2 * i + j) % 5]}"
        for i, shape in enumerate(SHAPES)
        for j, seen in enumerate((*VIEWS, *PATTERNS))
    ]


LADDER = [
    f"{shape}/{seen}/n{noise:g}/o0"
    for shape in ("flange", "stepped_block")
    for seen in ("pinhole", "blue_noise")
    for noise in NOISES
]
TEST = list(dict.fromkeys([*_latin(), *LADDER]))
SENSED = [
    f"{shape}/{sensor}/n0/o0"
    for shape in ("frustum", "stepped_block", "wedge_fan", "thin_plate", "gear", "tee", "flange", "sphere", "plane")
    for sensor in SENSORS
]
TUNE = [
    "pyramid/pinhole2/n0/o0",
    "wedge_bar/uniform2/n0/o1",
    "small_gear/orthographic2/n0/o0",
    "tall_frustum/spherical2/n0.1/o0",
    "cylinder/blue_noise2/n0.1/o5",
    "wedge_bar/pinhole2/n0.1/o0",
    "small_gear/graded2/n0.3/o0",
    "pyramid/orthographic1/n0.3/o1",
    "ring/pinhole2/n0.3/o0",
    "wedge_bar/spherical2/n1/o0",
    "tall_frustum/pinhole1/n1/o5",
    "cylinder/scan_lines2/n1/o0",
]
QUICK = [name for name in TEST if name.startswith(("frustum/", "stepped_block/", "flange/", "sphere/"))][::3]
PICTURES = [
    "stepped_block/pinhole/n0/o0",
    "bracket/orthographic/n0.3/o0",
    "wedge_fan/spherical/n0.1/o0",
    "flange/blue_noise/n0.1/o0",
    "gear/uniform/n0/o0",
]


def load(name: str) -> Scene:
    """Make a scene, or read it from the cache.

    Raises
    ------
    ValueError
        If the name is none of a scene.
    ImportError
        If the shape needs build123d and it is not installed.
    """
    path = CACHE / f"v{VERSION}-{name.replace('/', '-')}.npz"
    if not path.exists():
        _write(make(name), path)
    return _read(path)


def make(name: str) -> Scene:
    """Make a scene of its name."""
    try:
        shape, seen, noise, outliers = name.split("/")
        kind, variant = seen.rstrip("0123456789"), int(seen[len(seen.rstrip("0123456789")) :] or 0)
        degraded = {"noise": float(noise.removeprefix("n")), "outliers": float(outliers.removeprefix("o")) / 100}
    except ValueError:
        raise ValueError(f"name: expected shape/view/n<noise>/o<percent>, got {name!r}") from None
    if kind not in (*VIEWS, *SENSORS, *PATTERNS):
        raise ValueError(f"name: expected a view of {(*VIEWS, *SENSORS, *PATTERNS)}, got {kind!r}")
    if kind in SENSORS and any(degraded.values()):
        raise ValueError(f"name: {kind} has errors of its own, expected n0/o0, got {noise}/{outliers}")
    part = solid(shape)
    seed = int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "little")
    if kind in PATTERNS:
        scene = synth.sample(part, pattern=kind, spacing=part.spacing, seed=seed, **degraded)
    elif kind in SENSORS:
        scene = synth.sense(part, synth.SENSORS[kind], spacing=view_spacing(part), seed=seed, **POSES[variant])
    else:
        spacing = view_spacing(part)
        scene = synth.view(part, projection=kind, spacing=spacing, seed=seed, **degraded, **POSES[variant])
    return Scene(**{key: getattr(scene, key) for key in Scene.__dataclass_fields__} | {"name": name})


def view_spacing(part: Solid) -> float:
    """Spacing at which a view of a solid has about as many points as a sample of all of it."""
    return part.spacing * (1.0 if part.boundaries or part.name == "thin_plate" else 0.8)


@cache
def solid(shape: str) -> Solid:
    """The solid of that name."""
    if shape in TUNE_SHAPES:
        return TUNE_SHAPES[shape]()
    if shape in CAD:
        import parts

        return parts.part(shape)
    if shape not in SHAPES:
        raise ValueError(f"name: expected a shape of {(*SHAPES, *TUNE_SHAPES)}, got {shape!r}")
    return getattr(synth, shape)()


def _write(scene: Scene, path: Path) -> None:
    path.parent.mkdir(exist_ok=True)
    columns = {f"edge_{key}": getattr(scene.edges, key) for key in TrueEdges.__dataclass_fields__}
    columns |= {
        key: getattr(scene, key) for key in ("spacing", "point_kind", "normals", "noise_free", "outlier", "pose")
    }
    if scene.depth is not None:
        columns["depth"] = scene.depth
    # Whole or not at all: several processes may fill the cache.
    part = path.with_name(f"{path.stem}.{os.getpid()}.part.npz")
    np.savez(part, name=scene.name, xyz=scene.cloud.xyz, **columns)
    part.replace(path)


def _read(path: Path) -> Scene:
    with np.load(path) as stored:
        columns = dict(stored)
    depth = columns.pop("depth", None)
    edges = TrueEdges(*(columns.pop(f"edge_{key}") for key in TrueEdges.__dataclass_fields__))
    name, spacing, xyz = str(columns.pop("name")), float(columns.pop("spacing")), columns.pop("xyz")
    viewed = {} if depth is None else {"shape": depth.shape, "viewpoint": np.zeros(3)}
    return Scene(name=name, cloud=Cloud(xyz, **viewed), spacing=spacing, edges=edges, depth=depth, **columns)
