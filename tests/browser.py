"""A headless Chromium, for tests and pictures of the viewer, and what its page shows."""

from __future__ import annotations

import io
import re
import shutil
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
from PIL import Image

from edgel import EdgeKind
from edgel.plot.palette import KIND_COLORS

CHROMIUM = shutil.which("chromium")
TIMEOUT = 60.0  # seconds
# WebGL in software, and no calls home.
_ARGUMENTS = [
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]


@contextmanager
def chromium() -> Iterator[Any]:
    """Start Chromium and yield Playwright's browser."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=_ARGUMENTS)
        try:
            yield browser
        finally:
            browser.close()


def input_of(page: Any, label: str) -> Any:
    """The input that follows a label of the side panel; of sliders the field for the number."""
    return page.locator(f"xpath=//label[text()='{label}']/following::input[not(@type='hidden')][1]")


def choose(page: Any, label: str, option: str) -> None:
    """Choose from a list of the side panel."""
    input_of(page, label).click()
    page.get_by_role("option", name=option, exact=True).click()


def type_number(page: Any, label: str, value: float) -> None:
    """Type a number into the field of a slider."""
    field = input_of(page, label)
    field.fill(str(value))
    field.press("Enter")


def set_slowly(page: Any, values: Mapping[str, float]) -> None:
    """Type numbers no faster than users can: of all that changes within 50 ms viser sends the last alone."""
    for label, value in values.items():
        type_number(page, label, value)
        page.wait_for_timeout(100)


def wait_for(condition: Callable[[], bool], what: str) -> None:
    """Wait until something holds."""
    end = time.monotonic() + TIMEOUT
    while time.monotonic() < end:
        if condition():
            return
        time.sleep(0.05)
    raise AssertionError(f"waited in vain for {what}")


def shown(page: Any) -> int:
    """The number of edge points that the page says it shows."""
    return number_in(page.locator(".edgel-status").inner_text(), r"([\d,]+) edge points shown")


def number_in(text: str, pattern: str) -> int:
    """The number that a pattern finds in a text."""
    found = re.search(pattern, text)
    assert found is not None, text
    return int(found[1].replace(",", ""))


def picture(page: Any) -> np.ndarray:
    """The scene as it is drawn, (H, W, 3) int."""
    return np.asarray(Image.open(io.BytesIO(page.locator("canvas").last.screenshot())).convert("RGB")).astype(int)


def count_pixels(page: Any, kind: EdgeKind) -> int:
    """How many pixels of the scene have the color of a kind."""
    return int((abs(picture(page) - KIND_COLORS[kind]).max(axis=2) < 12).sum())
