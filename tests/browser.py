"""A headless Chromium, for tests and pictures of the viewer."""

from __future__ import annotations

import io
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from PIL import Image

CHROMIUM = shutil.which("chromium")
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


def picture(page: Any) -> np.ndarray:
    """The scene as it is drawn, (H, W, 3) int."""
    return np.asarray(Image.open(io.BytesIO(page.locator("canvas").last.screenshot())).convert("RGB")).astype(int)
