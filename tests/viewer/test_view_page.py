"""The viewer in a real browser: Chromium, headless, driven by Playwright."""

import importlib.util
import re

import numpy as np
import pytest
from browser import (
    CHROMIUM,
    TIMEOUT,
    choose,
    chromium,
    count_pixels,
    input_of,
    number_in,
    picture,
    set_slowly,
    shown,
    type_number,
    wait_for,
)

import edgel
from edgel import EdgeKind, synth
from edgel.plot.palette import KIND_COLORS

for needed in ("viser", "playwright"):
    if importlib.util.find_spec(needed) is None:
        pytest.skip(f"{needed} is not installed (extras view and dev)", allow_module_level=True)
if CHROMIUM is None:
    pytest.skip("chromium is not installed (apt install chromium)", allow_module_level=True)

HOLD_FRAMES = """async () => {
    const draw = window.requestAnimationFrame.bind(window), held = [];
    window.requestAnimationFrame = callback => held.push(callback);
    window.release = () => { window.requestAnimationFrame = draw; held.forEach(draw); };
    await new Promise(draw);  // the frame asked for before
}"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("view")


@pytest.fixture(scope="module")
def tee(folder):
    """A tee of 40,000 points, which software draws in no time."""
    path = folder / "tee.ply"
    edgel.write(path, synth.scan(synth.tee(), num_points=40_000).cloud)
    return path


@pytest.fixture(scope="module")
def served(folder, tee):
    from edgel._viewer.server import running

    damaged = folder / "<b>damaged.ply"
    damaged.write_bytes(tee.read_bytes()[:5000])
    with running([str(tee), str(damaged)]) as viewer:
        yield viewer


@pytest.fixture(scope="module")
def browser():
    with chromium() as browser:
        yield browser


@pytest.fixture(scope="module")
def errors():
    return []


@pytest.fixture(scope="module")
def page(browser, served, errors):
    return open_tab(browser, served.url, errors)


@pytest.fixture(autouse=True)
def no_console_errors(errors):
    yield
    assert errors == []


def open_tab(browser, url, errors):
    page = browser.new_page(viewport={"width": 900, "height": 600})
    page.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(url)
    page.locator(".edgel-pane", has_text="edge points shown").first.wait_for(timeout=1000 * TIMEOUT)
    wait_for(lambda: count_pixels(page, EdgeKind.BOUNDARY) > 50, "the edges in the picture")
    return page


def test_slider_on_a_large_cloud(browser, folder, errors):
    from edgel._viewer.server import running

    path = folder / "large.ply"
    edgel.write(path, synth.scan(synth.tee(), num_points=647_984).cloud)
    with running([str(path)]) as viewer:
        page = open_tab(browser, viewer.url, errors)
        assert "647,984 points" in page.locator(".edgel-status").inner_text()
        answer = viewer.session.panes()[0].answer
        assert answer is not None
        assert answer.edges is not None
        strength = answer.edges.strength
        assert shown(page) == (strength >= 0.5).sum()
        before = picture(page)
        type_number(page, "Strength ≥", 0.9)
        wait_for(lambda: shown(page) == (strength >= 0.9).sum(), "fewer edges")
        wait_for(lambda: (picture(page) != before).any(axis=2).sum() > 50, "another picture")
        page.close()


def test_a_move_sends_the_edges_and_not_the_cloud(browser, served, errors):
    sizes = []
    page = browser.new_page(viewport={"width": 900, "height": 600})
    page.on("websocket", lambda socket: socket.on("framereceived", lambda content: sizes.append(len(content))))
    page.goto(served.url)
    page.locator(".edgel-pane", has_text="edge points shown").first.wait_for(timeout=1000 * TIMEOUT)
    wait_for(lambda: count_pixels(page, EdgeKind.BOUNDARY) > 50, "the edges in the picture")
    cloud = 15 * 40_000  # bytes: three coordinates and a color a point
    assert sum(sizes) > cloud / 3  # it is compressed
    before = shown(page)
    sizes.clear()
    type_number(page, "Strength ≥", 0.8)
    wait_for(lambda: shown(page) < before, "fewer edges")
    page.wait_for_timeout(500)
    assert 0 < sum(sizes) < cloud / 10
    type_number(page, "Strength ≥", 0.5)
    wait_for(lambda: shown(page) == before, "all edges")
    page.close()


def test_the_number_of_edges_does_not_wait_for_a_frame(page):
    before = shown(page)
    page.evaluate(HOLD_FRAMES)
    type_number(page, "Strength ≥", 0.8)
    wait_for(lambda: shown(page) < before, "fewer edges, though nothing is drawn")
    page.evaluate("() => window.release()")
    type_number(page, "Strength ≥", 0.5)
    wait_for(lambda: shown(page) == before, "all edges")


def test_a_large_cloud_is_drawn_in_part_until_every_point_is_asked_for(browser, folder, errors, monkeypatch):
    from edgel._viewer import source
    from edgel._viewer.server import running

    monkeypatch.setattr(source, "FEW", 10_000)
    with running([str(folder / "tee.ply")]) as viewer:
        page = open_tab(browser, viewer.url, errors)
        drawn = number_in(page.locator(".edgel-status").inner_text(), r"only ([\d,]+) points are drawn")
        assert 5_000 < drawn <= 10_000
        before, edges = picture(page), shown(page)
        input_of(page, "Every point").click()
        wait_for(lambda: "points are drawn" not in page.locator(".edgel-status").inner_text(), "nothing left out")
        wait_for(lambda: (picture(page) != before).any(axis=2).sum() > 50, "another picture")
        assert shown(page) == edges
        page.close()


def test_the_view_fits_the_window_until_it_is_turned(browser, served, errors):
    page = open_tab(browser, served.url, errors)
    where = "() => window.__viserMutable.camera.position.length()"
    near = page.evaluate(where)
    page.set_viewport_size({"width": 700, "height": 600})
    wait_for(lambda: page.evaluate(where) > 1.1 * near, "a step back from the narrow window")
    far = page.evaluate(where)
    page.mouse.move(100, 300)
    page.mouse.wheel(0, -300)
    wait_for(lambda: page.evaluate(where) < 0.95 * far, "a step forward")
    page.wait_for_timeout(1000)
    chosen = page.evaluate(where)
    page.set_viewport_size({"width": 900, "height": 600})
    page.wait_for_timeout(1000)
    assert abs(page.evaluate(where) - chosen) < 0.01 * chosen
    page.close()


def test_kinds_are_switched(page):
    all_edges = shown(page)
    input_of(page, "boundary").click()
    wait_for(lambda: shown(page) < all_edges, "the creases alone")
    wait_for(lambda: count_pixels(page, EdgeKind.BOUNDARY) == 0, "no boundary in the picture")
    assert count_pixels(page, EdgeKind.CREASE) > 0
    input_of(page, "boundary").click()
    wait_for(lambda: shown(page) == all_edges, "all edges")


def test_saved_file_is_what_detect_answers(page, tee, tmp_path):
    with page.expect_download() as download:
        page.get_by_role("button", name="Save edges").click()
    download.value.save_as(tmp_path / "saved.ply")
    cloud = edgel.read(tee)
    edges = edgel.detect(cloud)
    expected, saved = edges.take(edges.strength >= 0.5).to_cloud(cloud), edgel.read(tmp_path / "saved.ply")
    np.testing.assert_array_equal(saved.xyz, expected.xyz)
    assert set(saved.attributes) == set(expected.attributes)
    for name, values in expected.attributes.items():
        np.testing.assert_array_equal(saved.attributes[name], values, err_msg=name)
    with page.expect_download() as download:
        page.get_by_role("button", name="Save picture").click()
    assert download.value.suggested_filename == "tee_edges.png"


def test_unreadable_file_says_why(page):
    message = page.get_by_text("Cannot read <b>damaged.ply")
    assert message.is_visible()
    status = page.locator(".edgel-status").inner_text()
    assert "Traceback" not in status
    assert "points" in status.split("damaged", 2)[-1]  # the reader's own words: how many points are missing


def test_click_shows_the_numbers(page):
    blue = abs(picture(page) - KIND_COLORS[EdgeKind.BOUNDARY]).max(axis=2) < 12
    rows, columns = np.nonzero(blue)
    page.locator("canvas").last.click(position={"x": int(columns[0]), "y": int(rows[0])})
    page.locator(".edgel-point", has_text="boundary").wait_for()
    row = number_in(page.locator(".edgel-point").inner_text(), r"row\s+([\d,]+)")
    assert 0 <= row < 40_000
    choose(page, "Color edges by", "strength")
    wait_for(lambda: count_pixels(page, EdgeKind.BOUNDARY) == 0, "other colors")
    marked = "() => Boolean(window.__viserMutable.nodeRefFromName['/picked'])"
    assert page.evaluate(marked)
    choose(page, "Color edges by", "kind")
    input_of(page, "boundary").click()
    page.locator(".edgel-point", has_text="boundary").wait_for(state="detached")
    wait_for(lambda: not page.evaluate(marked), "no mark where there is no edge point")
    input_of(page, "boundary").click()


def test_two_clicks_show_the_distance(page):
    points = page.locator(".edgel-point")
    blue = abs(picture(page) - KIND_COLORS[EdgeKind.BOUNDARY]).max(axis=2) < 12
    rows, columns = np.nonzero(blue)
    places = []
    for at in (0, len(rows) // 2):
        text = points.inner_text() if points.count() else ""
        page.locator("canvas").last.click(position={"x": int(columns[at]), "y": int(rows[at])})
        wait_for(lambda text=text: points.count() and points.inner_text() not in ("", text), "the numbers of a point")
        line = next(line for line in points.inner_text().splitlines() if line.startswith("place on the edge"))
        places.append(np.array(line.split()[-3:], float))
    told = next(line for line in points.inner_text().splitlines() if line.startswith("distance"))
    assert float(told.split()[1]) == pytest.approx(np.linalg.norm(places[1] - places[0]), rel=1e-4)
    assert page.evaluate("() => Boolean(window.__viserMutable.nodeRefFromName['/distance'])")


def test_every_control_has_a_name_and_the_page_a_title(page):
    assert page.title() == "tee.ply, <b>damaged.ply - edgel view"
    for role in ("slider", "textbox", "button", "checkbox", "combobox"):
        controls = page.get_by_role(role)
        assert controls.count() > 0
        assert controls.count() == page.get_by_role(role, name=re.compile(r"\w")).count(), role
    assert page.get_by_role("slider", name="Strength").count() == 1


def test_keys_move_a_slider_and_not_the_camera(page):
    camera = "() => JSON.stringify(window.__viserMutable.camera.position)"
    before, everything = page.evaluate(camera), shown(page)
    slider = page.get_by_role("slider", name="Strength")
    for key, wanted in (("End", 1.0), ("ArrowLeft", 0.99)):
        slider.press(key, delay=300)
        wait_for(lambda wanted=wanted: float(slider.get_attribute("aria-valuenow")) == wanted, "the slider to follow")
    page.wait_for_timeout(500)
    assert page.evaluate(camera) == before
    type_number(page, "Strength ≥", 0.5)
    wait_for(lambda: shown(page) == everything, "all edges")


def test_kinds_that_a_cloud_cannot_have_are_grey(page):
    assert input_of(page, "color").is_disabled()  # there are no colors
    for possible in ("boundary", "crease", "frame"):
        assert input_of(page, possible).is_enabled()


def test_published_method_beside_with_its_images(page, served):
    choose(page, "Method", "side by side")
    page.get_by_text("tee.ply: edge map").wait_for()
    page.locator(".edgel-pane", has_text="paper").wait_for()
    wait_for(lambda: count_pixels(page, EdgeKind.IMAGE) > 50, "the edges of the published method")
    assert served.session.wait_idle(TIMEOUT)
    assert count_pixels(page, EdgeKind.BOUNDARY) > 10
    choose(page, "Method", "edgel")
    wait_for(lambda: count_pixels(page, EdgeKind.IMAGE) == 0, "edgel's edges alone")


def test_crop_and_colors(page):
    before = shown(page)
    page.get_by_text("Crop", exact=True).click()
    type_number(page, "x to (%)", 60)
    wait_for(lambda: shown(page) < before, "fewer edges")
    wait_for(lambda: "--crop" in page.locator(".edgel-code").inner_text(), "the crop in the command line")
    page.get_by_role("button", name="Whole cloud").click()
    wait_for(lambda: shown(page) == before, "all edges")
    grey = np.ptp(picture(page), axis=2).mean()
    choose(page, "Color cloud by", "height")
    wait_for(lambda: np.ptp(picture(page), axis=2).mean() > grey + 8, "a colored cloud")
    choose(page, "Color cloud by", "grey")


def test_python_lines_of_the_page_find_what_it_shows(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    everything = shown(page)
    set_slowly(page, {"Strength ≥": 0.6, "Angle ≥ (°)": 20, "Scale": 2})
    wait_for(lambda: "at scale 2" in page.locator(".edgel-status").inner_text(), "the edges at a scale")
    lines = page.locator(".edgel-code pre").last
    wait_for(lambda: "min_strength=0.6" in lines.inner_text() and "radians(20)" in lines.inner_text(), "the lines")
    found = {}
    exec(lines.inner_text(), found)
    assert 0 < len(found["edges"]) == shown(page) < everything
    assert "--min-angle 20" in page.locator(".edgel-code pre").first.inner_text()
    set_slowly(page, {"Strength ≥": 0.5, "Angle ≥ (°)": 0, "Scale": 1})
    wait_for(lambda: shown(page) == everything, "all edges")


def test_two_tabs_twenty_moves_and_a_tab_closed_meanwhile(page, browser, served, errors):
    session = served.session
    other = open_tab(browser, served.url, errors)
    for step in range(20):
        type_number(other, "Scale", 1.5 + 0.5 * (step % 10))
    wait_for(lambda: session.settings.scale == 6.0, "the last move")
    other.close()
    assert session.wait_idle(TIMEOUT)
    (pane,) = session.panes()
    assert pane.is_current
    wait_for(lambda: "at scale 6" in page.locator(".edgel-status").inner_text(), "the other tab to follow")
    assert shown(page) == len(pane.edges)
    type_number(page, "Scale", 1)
    assert session.wait_idle(TIMEOUT)


def test_pages_from_elsewhere_are_kept_out(served):
    import viser
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect
    from websockets.typing import Origin, Subprotocol

    address = served.url.replace("http", "ws")
    protocol = [Subprotocol(f"viser-v{viser.__version__}")]
    with pytest.raises(InvalidStatus, match="403"):
        connect(address, origin=Origin("http://example.com"), subprotocols=protocol)
    connect(address, origin=Origin(served.url), subprotocols=protocol).close()
