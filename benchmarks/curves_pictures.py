"""Pictures of curves: ten results, and the plate with holes to scale with its diameters beside the truth.

Run: python benchmarks/curves_pictures.py. Writes docs/images/curves.png and docs/images/plate.svg, and prints the table.
"""

from __future__ import annotations

from pathlib import Path

import curves as bench
import numpy as np

import edgel
from edgel import synth
from edgel.curves import FAINT, CurveKind, Curves, trace, write

HERE = Path(__file__).parent
IMAGES = HERE.parent / "docs" / "images"
SCENES = [
    ("plate", 0.1), ("bracket", 0.1), ("flange", 0.0), ("gear", 0.3), ("stepped_block", 0.3),
    ("cube_fractal", 0.1), ("wedge_fan", 0.1), ("tee", 0.1), ("chamfered_block", 0.1), ("sheet_metal", 0.0),
]  # fmt: skip
COLORS = {
    CurveKind.LINE: "#1f4e9e",
    CurveKind.ARC: "#1a8a4a",
    CurveKind.CIRCLE: "#b02a8f",
    CurveKind.POLYLINE: "#d0402a",
}


def result(name: str, noise: float) -> tuple[synth.Solid, synth.Scene, Curves]:
    """A part, its sample, and the curves found."""
    solid = bench.solid_of(name, Path("../shared/data"))
    assert solid is not None
    scene = synth.sample(solid, pattern="blue_noise", spacing=solid.spacing, noise=noise, seed=1)
    return solid, scene, trace(scene.cloud, edgel.detect(scene.cloud, min_strength=FAINT))


def ten(path: Path) -> None:
    """Draw ten results: lines blue, arcs green, circles magenta, polylines red, corners black; true edges grey below."""
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(20, 9))
    for place, (name, noise) in enumerate(SCENES):
        solid, _, curves = result(name, noise)
        axes = figure.add_subplot(2, 5, place + 1, projection="3d")
        for curve in solid.edges:
            axes.plot(*curve.points.T, color="0.8", linewidth=2.5)
        for k in range(len(curves)):
            axes.plot(*curves.points_of(k).T, color=COLORS[CurveKind(curves.kind[k])], linewidth=0.9)
        axes.plot(*curves.corners.T, "k.", markersize=3)
        axes.set_box_aspect(np.ptp(np.concatenate([curve.points for curve in solid.edges]), axis=0) + 1e-9)
        axes.set_axis_off()
        axes.set_title(f"{name}, noise {noise:g} spacings", fontsize=10)
    figure.tight_layout()
    figure.savefig(path, dpi=80)


def plate(path: Path) -> list[tuple[float, float, float]]:
    """Draw the plate to scale, and return true diameters, measured ones and their standard deviations, of its holes."""
    solid, scene, curves = result("plate", 0.1)
    write(path, curves, view="top", unit="mm")
    rows = []
    for centre, radius in bench.true_circles(list(solid.edges)):
        found = np.flatnonzero(curves.kind == CurveKind.CIRCLE)
        off = np.linalg.norm(curves.centre[found] - centre, axis=1)
        k = found[off.argmin()]
        rows.append((2 * radius, float(curves.diameter[k]), float(2 * curves.radius_std[k])))
    print(f"plate: spacing {scene.spacing:.3f} mm, noise {0.1 * scene.spacing:.3f} mm")
    return rows


if __name__ == "__main__":
    for row in plate(IMAGES / "plate.svg"):
        print("| {:.2f} | {:.3f} | {:.3f} |".format(*row))
    ten(IMAGES / "curves.png")
