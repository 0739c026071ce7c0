"""Run both methods on every cloud of the shared data, and the default on the frames here; write docs/real-data.md with a picture each.

Run: python benchmarks/real_data.py [DATA] (default ../shared/data). Remarks on each file are kept in REMARKS below: they
are what a person saw in the pictures, and are checked by looking again.
"""

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import real_frames
import real_pictures
from PIL import Image

import edgel
from edgel import plot
from edgel.io import READERS

DOCS = Path(__file__).parent.parent / "docs"
SKIP = {"malformed"}  # broken on purpose: the tests read them
SIZE = (560, 420)

REMARKS = {
    "airborne": "The default draws the border of the flat tile, the bridge and the breaks of the slopes; tree crowns are "
    "speckled with false edges. The paper marks wide bands: at this density its pixels are metres wide. "
    "`interesting.las`, the COPC and the UTM file are a thousand points spread over a town, several spacings "
    "to the next house: nothing to find.",
    "kinect_objects": "Depth quantised to steps of some millimetres: the default shows the outlines of the boxes and the "
    "folds of most; on bowls and bags some creases are false. The paper marks the "
    "outlines as wide bands and nothing inside.",
    "kinect_organized": "As above, with short false steps on the table of `milk_cartoon`, and false creases on the wall behind the mug, whose "
    "noise (a stereo camera's) is taken for independent. `organized_edge_1` is a rendered, noise-free frame: there the default finds the outlines and "
    "the folds. The paper finds the outlines only.",
    "lidar_sweeps": "The default knows the spinning sensor by its 32 rings and sees the sweep as it did: near and far sides "
    "of depth steps, and the end of the ground about the car; few creases. For the paper every pixel beside a ring is an edge.",
    "roofs": "About a thousand points a roof. The default finds most of the eaves and parts of the ridges, with gaps. "
    "The paper's image is 8 pixels wide.",
    "scan_vs_mesh": "The scans (`.npy`) have noise of one spacing: the default follows the rims of the first with gaps, and scatters "
    "creases over all of the second; the paper finds broad bands at the silhouette. The meshes (`.ply`) are vertices of large "
    "triangles, no scans: what is called an edge there means nothing.",
    "structured_light": "The paper's kind of sensor. The default follows the outlines of the parts in the bin, both sides of each "
    "step in depth, the screw heads, and the ragged ends of the surface where the sensor saw nothing; few "
    "false creases. The paper finds the outlines as bands, and with them every hole.",
    "truth": "Whole parts, sampled all round: the paper's single view from above can't see most edges and marks what "
    "changes height. The default follows sharp creases, on thin plates too (`abc_7034`); it calls small "
    "rounded knobs edges (`abc_7010`), finds about half of soft feature lines (`shrec_*`) and hardly any of "
    "the softest (`shrec_01`), and under noise it leaves gaps (`abc_noise_*`).",
    "two_depth_sensors": "Noise alike from pixel to pixel. The default draws the outlines, nearly closed, and the folds of the box and of the "
    "bin in pieces; on the ball a few short false creases. The paper marks "
    "the box only on its high side: the step on the other is below the threshold.",
}

FRAMES = """## Frames in this repository

`benchmarks/real`, so that anyone can run them; figures and times are in [benchmarks](benchmarks.md). Each picture is the sensor's own image, pixel by
pixel (`python benchmarks/real_pictures.py OUT`); edge points in the color of their kind.
"""

FRAME_REMARKS = {
    "ensenso": "A box, a half disc and a ball in a bin. Outlines are there, nearly closed; of the folds the front of the box and the rims of the half "
    "disc. The floor is clean. On the ball three short false creases.",
    "primesense": "The same scene. Outlines of the objects are closed, the far side of the bin is found as a fold, its others in pieces; hardly anything "
    "false.",
    "phoxi": "Outlines and screw heads are clean, both sides of each step are there; the fold round the floor of the bin is soft and "
    "is not found. Where the sensor saw little, single missing points make boundaries of their neighbours.",
    "vlp16": "Sixteen rings, drawn several pixels high. The board stands out by near and far sides; hardly a crease is found or "
    "missed between rings; missing shots make boundaries of their neighbours.",
    "ouster64": "Outlines of board, car and pillars are there, the folds of walls and floor in pieces; much clutter is called a crease.",
}

INTRO = """# Real data

Every file of the development data that the formats cover, through `edgel detect` with both methods: `python
benchmarks/real_data.py`. Left the paper's method, right the default; edge points in the color of their kind. Files of the same folder share one
remark. Meshes (STL, OBJ, STEP) and the ROS recording are no clouds and are refused with a message that says so.

The paper's method was measured on two dense scans of single parts ([decisions](decisions.md)). On sparse or cluttered clouds
its bands cover a large share of the whole, and where there are a thousand points its image is only 8 pixels wide.

"""


def clouds(data: Path) -> list[Path]:
    files = [f for f in sorted(data.rglob("*")) if f.suffix.lower() in READERS and f.is_file()]
    return [f for f in files if not SKIP & set(f.relative_to(data).parts) and f.suffix.lower() not in (".txt", ".csv")]


@dataclass(frozen=True)
class Run:
    """What a method finds in a cloud, in how many seconds of processor time, or why it cannot look at it."""

    edges: edgel.Edges | None
    seconds: float
    error: str = ""

    def cells(self) -> list[str]:
        if self.edges is None:
            return [self.error, ""]
        return [f"{len(self.edges):,} ({self.edges.share:.1%})", f"{self.seconds:.2f}"]


def run(detect: Callable[[edgel.Cloud], edgel.Edges], cloud: edgel.Cloud) -> Run:
    start = time.process_time()
    try:
        edges = detect(cloud)
    except ValueError as error:
        return Run(None, 0.0, str(error))
    return Run(edges, time.process_time() - start)


def picture(cloud: edgel.Cloud, found: list[edgel.Edges | None], path: Path) -> None:
    both = np.hstack([plot.picture(cloud, edges, size=SIZE) for edges in found])
    path.parent.mkdir(exist_ok=True)
    # 128 colors, the most different ones, are enough for grey and the kinds, and half the size.
    Image.fromarray(both).quantize(128, method=Image.Quantize.MAXCOVERAGE).save(path, optimize=True)


def of_frames() -> str:
    """The section on the repository's own frames, with a picture each."""
    table = ["| frame | points | found | ms |", "|---|---|---|---|"]
    pages: list[str] = []
    remarks = dict(FRAME_REMARKS)
    for frame in real_frames.frames():
        one = run(edgel.detect, frame.cloud)
        assert one.edges is not None
        points, found = real_pictures.counts(frame.cloud, one.edges).split(" points: ")
        table.append(f"| `{frame.name}` | {points} | {found} | {1e3 * one.seconds:.0f} |")
        image = DOCS / "real-data" / f"frame_{frame.name}.png"
        real_pictures.save(frame.cloud, one.edges, image)
        remark = remarks.pop(frame.name.split("_")[0], "")
        pages.append(f"`{frame.name}` {remark}\n\n![{frame.name}](real-data/{image.name})\n")
    return "\n".join([FRAMES, *table, "", *pages])


def main() -> None:
    data = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("../shared/data")
    table, pages = [], []
    folder = ""
    edgel.detect(np.random.default_rng(0).random((100, 3)))  # compile before anything is timed
    edgel.paper.detect(np.random.default_rng(0).random((100, 3)))
    for file in clouds(data):
        name = str(file.relative_to(data))
        try:
            cloud = edgel.read(file)
        except edgel.FormatError as error:
            print(name, error)
            table.append(f"| `{name}` | refused: {str(error).split(': ', 1)[1]} | | | | | |")
            continue
        runs = run(edgel.paper.detect, cloud), run(edgel.detect, cloud)
        dropped = int((~np.isfinite(cloud.xyz).all(axis=1)).sum())
        cells = [f"{len(cloud):,}", f"{dropped:,}", *runs[0].cells(), *runs[1].cells()]
        table.append(f"| `{name}` | " + " | ".join(cells) + " |")
        image = DOCS / "real-data" / (name.replace("/", "_") + ".png")
        picture(cloud, [one.edges for one in runs], image)
        if name.split("/")[0] != folder:
            folder = name.split("/")[0]
            pages.append(f"## {folder}\n\n{REMARKS.get(folder, '')}\n")
        pages.append(f"`{name}`\n\n![{name}](real-data/{image.name})\n")
        print(table[-1], flush=True)
    head = "| file | points | not finite | paper: edge points | s | default: edge points | s |\n|---|---|---|---|---|---|---|\n"
    text = (
        INTRO
        + head
        + "\n".join(table)
        + "\n\nTimes are those of the processor, of single warm runs on one thread (`EDGEL_NUM_THREADS=1`).\n\n"
        + "\n".join([of_frames(), *pages])
    )
    (DOCS / "real-data.md").write_text(text)


if __name__ == "__main__":
    main()
