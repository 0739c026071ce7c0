"""How long the viewer takes from a move of a slider to the new edges: a table for 100,000, 650,000 and 3,000,000 points.

Run: python benchmarks/view_latency.py [POINTS...]. Medians of ten moves of the threshold, in milliseconds:

- server: from the new setting to everything handed to viser, without a browser
- count: in Chromium, from the key to the new number of edges on the page
- picture: in Chromium, from the key until the first frame with the new edges is drawn: WebGL says when (a fence), since
  frames are handed over long before they are drawn
- frame: what Chromium needs to draw one frame of the cloud, in software.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import edgel
from edgel import synth
from edgel._viewer.server import Viewer, running
from edgel._viewer.settings import Settings

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
from browser import chromium, input_of

SIZES = (100_000, 650_000, 3_000_000)
MOVES = 10
PATIENCE = 300_000

# Types a number into a slider's field as a user does, and waits for the page's text, and for the picture.
MOVE = """async ([field, value]) => {
    const status = document.querySelector('.edgel-status').innerText;
    const gl = document.querySelector('canvas[data-engine]').getContext('webgl2'), edges = [];
    window.__viserMutable.nodeRefFromName['/edges0'].traverse(node => { if (node.isPoints) edges.push(node); });
    const positions = () => edges[0].geometry.attributes.position.array, old = positions();
    let fence = null;
    edges[0].onAfterRender = () => {
        if (fence === null && positions() !== old) {
            fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
            gl.flush();
        }
    };
    const set = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, 'value').set;
    const start = performance.now();
    set.call(field, value);
    field.dispatchEvent(new Event('input', {bubbles: true}));
    const since = () => performance.now() - start, is_drawn = () => gl.clientWaitSync(fence, 0, 0) !== gl.TIMEOUT_EXPIRED;
    let count = null, picture = null;
    while (count === null || picture === null) {
        if (count === null && document.querySelector('.edgel-status').innerText !== status) count = since();
        if (picture === null && fence !== null && is_drawn()) picture = since();
        await new Promise(r => setTimeout(r, 1));
    }
    return [count, picture];
}"""
FRAMES = """async () => {
    const start = performance.now();
    for (let i = 0; i < 10; i++) {
        window.__viserMutable.requestRender();
        await new Promise(requestAnimationFrame);
    }
    return (performance.now() - start) / 10;
}"""


@dataclass(frozen=True)
class Latency:
    """Medians of the moves, and what a frame takes, in milliseconds."""

    count: float
    picture: float
    frame: float


def in_server(viewer: Viewer) -> float:
    """Median milliseconds from settings to handles, without a browser."""
    taken = []
    for move in range(MOVES):
        start = time.perf_counter()
        viewer.session.settings = Settings(strength=0.6 + 0.03 * move)
        viewer.page.refresh()
        assert viewer.page.wait_idle(PATIENCE / 1000)
        taken.append(1000 * (time.perf_counter() - start))
    viewer.session.settings = Settings()
    return statistics.median(taken)


def in_browser(tab: Any) -> Latency:
    counts, pictures = [], []
    field = input_of(tab, "Strength ≥").element_handle()
    for move in range(MOVES):
        count, picture = tab.evaluate(MOVE, [field, f"{0.6 + 0.03 * move:.2f}"])
        counts.append(count)
        pictures.append(picture)
        tab.wait_for_timeout(300)
    return Latency(statistics.median(counts), statistics.median(pictures), tab.evaluate(FRAMES))


def measure(browser: Any, num_points: int, folder: Path) -> str:
    path = folder / "tee.ply"
    edgel.write(path, synth.scan(synth.tee(), num_points=num_points).cloud)
    with running([str(path)]) as viewer:
        assert viewer.session.wait_idle(PATIENCE / 1000)
        assert viewer.page.wait_idle(PATIENCE / 1000)
        server = in_server(viewer)
        tab = browser.new_page(viewport={"width": 1280, "height": 800})
        tab.set_default_timeout(PATIENCE)
        tab.goto(viewer.url)
        tab.locator(".edgel-pane", has_text="edge points shown").wait_for()
        tab.wait_for_timeout(3000)
        seen = in_browser(tab)
        answer = viewer.session.panes()[0].answer
        assert answer is not None
        assert answer.edges is not None
        found = len(answer.edges)
        tab.close()
    times = (server, seen.count, seen.picture, seen.frame)
    return f"| {num_points:,} | {found:,} | " + " | ".join(f"{value:.0f}" for value in times) + " |"


def main() -> None:
    sizes = [int(word) for word in sys.argv[1:]] or SIZES
    print(
        "| points | edge points found | server, ms | count, ms | picture, ms | frame, ms |\n|---|---|---|---|---|---|"
    )
    with tempfile.TemporaryDirectory() as folder, chromium() as browser:
        for size in sizes:
            print(measure(browser, size, Path(folder)), flush=True)


if __name__ == "__main__":
    main()
