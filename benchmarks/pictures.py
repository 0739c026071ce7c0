"""Five scenes with the truth and every method's answer side by side: docs/benchmarks/pictures.md.

Run: python benchmarks/pictures.py, after bench.py has chosen the rivals' parameters.
"""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import scenes
from answers import answer
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image
from rivals import RIVALS

from edgel import EdgeKind, Edges, plot
from edgel._faces import Faces
from edgel.synth import Scene

DOCS = Path(__file__).parent.parent / "docs" / "benchmarks"
TUNED = Path(__file__).parent / "tuned.json"
PANEL = (520, 400)


def answers(scene: Scene, tuned: dict[str, dict[str, dict]]) -> list[tuple[str, np.ndarray]]:
    """The truth, and each method's mask with the best of its grid for the scene's noise."""
    found = [("truth", scene.point_kind != 0)]
    for rival in RIVALS:
        if rival.missing() is not None or (rival.organized_only and not scene.cloud.is_organized):
            continue
        best = tuned.get(rival.name, {}).get(scene.name.split("/")[2])
        found.append((rival.name, answer(rival, scene, best["best"] if best else rival.defaults).mask))
    return found


def as_edges(scene: Scene, mask: np.ndarray) -> Edges:
    """Edges of one kind and without normals, as most rivals find no more."""
    index = np.flatnonzero(mask)
    return Edges(
        index=index,
        kind=np.full(len(index), EdgeKind.CREASE, np.uint8),
        strength=np.ones(len(index)),
        **vars(Faces.of_points(scene.cloud.xyz[index], np.full((len(index), 3), np.nan))),
        orientation="unknown",
        num_points=len(scene.cloud),
        num_dropped=0,
        method="",
        reason="",
        parameters={},
        seconds={},
    )


def draw(scene: Scene, panels: list[tuple[str, np.ndarray]], path: Path) -> None:
    columns = 4
    lines = -(-len(panels) // columns)
    figure = Figure(figsize=(4 * columns, 3.3 * lines), layout="constrained")
    for place, (title, mask) in enumerate(panels, start=1):
        axes = figure.add_subplot(lines, columns, place, title=f"{title}: {np.count_nonzero(mask):,}")
        axes.imshow(plot.picture(scene.cloud, as_edges(scene, mask), size=PANEL, legend=False))
        axes.axis("off")
    figure.suptitle(f"{scene.name}: {np.isfinite(scene.cloud.xyz[:, 0]).sum():,} points")
    buffer = io.BytesIO()
    FigureCanvasAgg(figure).print_png(buffer)
    Image.open(buffer).convert("RGB").quantize(128).save(path, optimize=True)


def main() -> None:
    DOCS.mkdir(parents=True, exist_ok=True)
    tuned = json.loads(TUNED.read_text()) if TUNED.exists() else {}
    lines = [
        "## Pictures\n\nThe truth and every answer, rivals with the best of their grid for the scene's noise; red is what each calls an edge."
    ]
    for number, name in enumerate(scenes.PICTURES, start=1):
        scene = scenes.load(name)
        path = DOCS / f"scene-{number}.png"
        draw(scene, answers(scene, tuned), path)
        lines.append(f"`{name}`\n\n![{name}](benchmarks/{path.name})")
    (DOCS / "pictures.md").write_text("\n\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
