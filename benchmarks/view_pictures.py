"""Pictures of the viewer on several clouds: docs/view/*.png, shown in docs/view.md.

Run: python benchmarks/view_pictures.py [DATA [NAME...]] (default ../shared/data, all). Needs Chromium and Playwright, as the browser
test does.
"""

from __future__ import annotations

import io
import sys
import tempfile
from collections.abc import Callable
from contextlib import chdir
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

import edgel
from edgel import synth
from edgel._viewer.server import running
from edgel._viewer.session import Session

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
from browser import choose, chromium, input_of, picture, type_number

DOCS = Path(__file__).resolve().parent.parent / "docs" / "view"
SIZE = {"width": 1280, "height": 800}
PATIENCE = 90_000  # ms: without a GPU, and beside other work, a frame of a large cloud may take seconds


@dataclass(frozen=True)
class Shot:
    """Files of a folder, and what is done on their page before the picture is taken."""

    folder: Path
    files: list[str]
    act: Callable[[Any, Session], None]


def shoot(browser: Any, name: str, shot: Shot) -> None:
    with chdir(shot.folder), running(shot.files) as viewer:  # so that the page shows the names alone
        viewer.session.wait_idle(PATIENCE / 1000)  # before the browser takes what power there is
        page = browser.new_page(viewport=SIZE)
        page.set_default_timeout(PATIENCE)
        page.goto(viewer.url)
        page.locator(".edgel-pane", has_text="found in").first.wait_for()
        close = page.locator(".mantine-Notification-closeButton")  # viser's remark that this browser has no GPU
        if close.count():
            close.first.click()
        shot.act(page, viewer.session)
        viewer.session.wait_idle(PATIENCE / 1000)
        page.mouse.move(SIZE["width"] - 20, SIZE["height"] - 10)
        settle(page)
        picture_of_page = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
        page.close()
    # 256 colors, the most different ones, and a third of the size.
    picture_of_page.quantize(256, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(
        DOCS / f"{name}.png", optimize=True
    )
    print(DOCS / f"{name}.png", flush=True)


def settle(page: Any) -> None:
    """Wait until the picture stays the same."""
    before = picture(page)
    for _ in range(20):
        page.wait_for_timeout(1500)
        after = picture(page)
        if (before == after).all() and np.ptp(after) > 0:
            return
        before = after


def click_edge(page: Any, _session: Session) -> None:
    """Click an edge point in the middle of the picture."""
    settle(page)
    seen = picture(page)
    edge = (seen.max(axis=2) - seen.min(axis=2)) > 120
    rows, columns = np.nonzero(edge)
    middle = np.argmin(np.hypot(rows - seen.shape[0] * 0.3, columns - seen.shape[1] * 0.7))
    page.locator("canvas").last.click(position={"x": int(columns[middle]), "y": int(rows[middle])})
    page.locator(".edgel-point").wait_for()
    page.get_by_text("Clicked point").scroll_into_view_if_needed()
    page.locator(".edgel-code").scroll_into_view_if_needed()


def nothing(_page: Any, _session: Session) -> None:
    pass


def side_by_side(page: Any, session: Session) -> None:
    choose(page, "Method", "side by side")
    page.get_by_text("edge map").first.wait_for()
    session.wait_idle(PATIENCE / 1000)


def segments(page: Any, _session: Session) -> None:
    input_of(page, "Tangents").click()
    input_of(page, "Normals").click()


def by_height(page: Any, _session: Session) -> None:
    choose(page, "Color cloud by", "height")


def at_scale(page: Any, session: Session) -> None:
    type_number(page, "Scale", 3)
    session.wait_idle(PATIENCE / 1000)


def main() -> None:
    data = Path(sys.argv[1] if len(sys.argv) > 1 else "../shared/data").resolve()
    DOCS.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as made, chromium() as browser:
        edgel.write(Path(made) / "tee.ply", synth.scan(synth.tee(), num_points=200_000).cloud)
        shots = {
            "tee": Shot(Path(made), ["tee.ply"], nothing),
            "tee-side-by-side": Shot(Path(made), ["tee.ply"], side_by_side),
            "depth-frame": Shot(data / "kinect_objects", ["learn0.pcd"], nothing),
            "lidar-sweep": Shot(data / "lidar_sweeps", ["small_gicp_target.ply"], at_scale),
            "airborne": Shot(data / "airborne", ["autzen_trim.laz"], by_height),
            "part": Shot(data / "truth", ["abc_7010.ply"], segments),
            "clicked": Shot(data / "truth", ["abc_7010.ply"], click_edge),
            "two-files": Shot(data / "truth", ["abc_7010.ply", "abc_7029.ply", "gone.ply"], nothing),
        }
        for name in sys.argv[2:] or shots:
            shoot(browser, name, shots[name])


if __name__ == "__main__":
    main()
