"""The picture at the head of README.md: a part sampled all round and a depth image, with their edges by kind.

Run: python benchmarks/readme_picture.py [DATA] (default ../shared/data).
"""

import sys
from pathlib import Path

import numpy as np

import edgel
from edgel import plot

PANEL = (800, 640)


def main() -> None:
    data = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("../shared/data")
    part = edgel.read(data / "truth" / "abc_7010.ply")
    frame = edgel.read(data / "structured_light" / "depth_0.npy", intrinsics=data / "structured_light" / "phoxi.intr")
    panels = [plot.picture(cloud, edgel.detect(cloud), size=PANEL) for cloud in (part, frame)]
    plot.save(Path(__file__).parent.parent / "docs" / "images" / "edges.png", np.hstack(panels))


if __name__ == "__main__":
    main()
