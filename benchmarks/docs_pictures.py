"""The pictures of docs/start.md, docs/concepts.md and docs/guides/research.md.

Run: python benchmarks/docs_pictures.py [NAME ...]. Everything they show is simulated, so that they can be made anywhere.
"""

import sys
from pathlib import Path

import matplotlib
import numpy as np

import edgel
from edgel import plot, synth

matplotlib.use("Agg")
from matplotlib import pyplot

IMAGES = Path(__file__).parent.parent / "docs" / "images"
PANEL = (800, 600)


def beside(name: str, *panels: np.ndarray) -> None:
    """Save pictures side by side."""
    height = max(panel.shape[0] for panel in panels)
    padded = [np.pad(one, ((0, height - len(one)), (0, 0), (0, 0)), constant_values=255) for one in panels]
    plot.save(IMAGES / name, np.hstack(padded))


def start() -> None:
    cloud = synth.scan(synth.tee(), num_points=200_000).cloud
    plot.save(IMAGES / "start.png", plot.picture(cloud, edgel.detect(cloud), size=(1000, 700), crop=True))


def kinds() -> None:
    cloud = synth.view(synth.stepped_block(), projection="pinhole", spacing=0.3, noise=0.1).cloud
    edges = edgel.detect(cloud)
    turned = plot.picture(cloud, edges, size=PANEL, direction=(0.5, 0.35, 0.8))
    beside("concepts-kinds.png", plot.picture(cloud, edges, size=PANEL, direction="sensor"), turned)


def strength() -> None:
    cloud = synth.view(synth.stepped_block(), projection="pinhole", spacing=0.5, noise=0.8).cloud
    looks = [edgel.detect(cloud, min_strength=least) for least in (0.1, 0.5)]
    beside("concepts-strength.png", *(plot.picture(cloud, one, size=PANEL, edge_color="strength") for one in looks))


def position() -> None:
    """A cut across the edge of a block: points, places on the edge, and how sure they are."""
    scene = synth.sample(synth.stepped_block(), pattern="blue_noise", spacing=0.8, noise=0.15)
    edges = edgel.detect(scene.cloud, kinds="crease")
    figure, axes = pyplot.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
    away = synth.nearest_edge(edges.position, synth.stepped_block().edges).distance / scene.spacing
    before = synth.nearest_edge(scene.cloud.xyz[edges.index], synth.stepped_block().edges).distance / scene.spacing
    bins = np.linspace(0, 1.2, 49)
    axes[0].hist(before, bins, color="0.75", label="the edge points themselves")
    axes[0].hist(away, bins, color="tab:red", alpha=0.8, label="Edges.position")
    axes[0].set(xlabel="distance from the true edge, spacings", ylabel="edge points")
    axes[0].legend()
    known = np.isfinite(edges.position_std)
    std = edges.position_std[known] / scene.spacing
    steps = np.quantile(std, np.linspace(0, 1, 11))
    group = np.clip(np.searchsorted(steps, std, side="right") - 1, 0, 9)
    said = [np.sqrt(np.mean(std[group == one] ** 2)) for one in range(10)]
    true = [np.sqrt(np.mean(away[known][group == one] ** 2)) for one in range(10)]
    axes[1].plot(said, true, "o", color="tab:red")
    axes[1].plot([0, max(said + true)], [0, max(said + true)], color="0.5", linewidth=1)
    axes[1].set(xlabel="Edges.position_std, spacings (a tenth of the points each)", ylabel="true deviation, spacings")
    figure.savefig(IMAGES / "concepts-position.png", dpi=110)


def steps() -> None:
    found = edgel.paper.detect(synth.scan(synth.tee(), num_points=300_000).cloud)
    figure, axes = pyplot.subplots(2, 3, figsize=(12, 6.4), layout="constrained")
    names = ["projection", "image", "smoothed", "gradient", "thinned", "edge_map"]
    for axis, name in zip(axes.flat, names, strict=True):
        axis.imshow(getattr(found, name), origin="lower", extent=found.grid.extent, cmap="gray")
        axis.set_title(name)
    figure.savefig(IMAGES / "paper-steps.png", dpi=100)


if __name__ == "__main__":
    wanted = sys.argv[1:]
    for make in (start, kinds, strength, position, steps):
        if wanted and make.__name__ not in wanted:
            continue
        make()
        print(make.__name__, flush=True)
