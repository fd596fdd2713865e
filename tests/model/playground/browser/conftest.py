"""A playground in a headless Chromium that draws in software; where none is installed, tests skip."""

import contextlib
import io
import re
import shutil
import socket
import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import expect, sync_playwright
from scipy import ndimage

from model.playground.browser.server import open_playground

FLAGS = (
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
NEAR = 20.0
"""Pixels by which what is seen may be off the middle of the points: a ball covers some of it."""
FARTHER = 1.7
"""Times as far as the page shows it at first: then all of it is in the picture wherever it falls."""
PANEL = 340
"""Pixels that the controls take, at the right."""
PATIENCE = 120.0
"""Seconds: software WebGL on a busy machine is slow."""


@pytest.fixture(scope="module")
def chromium():
    path = next((found for name in NAMES if (found := shutil.which(name))), None)
    if path is None:
        pytest.skip(f"no Chromium on the PATH (looked for {', '.join(NAMES)}): apt-get install chromium")
    expect.set_options(timeout=1000 * PATIENCE)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=list(FLAGS))
        yield browser
        browser.close()


@pytest.fixture
def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture
def green_twin(plain_twin, tmp_path):
    """The file of a small twin of a colour that nothing else on the page has."""
    gaussians = plain_twin.gaussians
    green = np.tile(np.float32([0.05, 0.6, 0.1]), (len(gaussians), 1))
    bundle = replace(plain_twin, gaussians=replace(gaussians, colors=green))
    bundle.save(tmp_path / "cube.twin.zip")
    return tmp_path / "cube.twin.zip"


class Play:
    """A playground as its user has it before them."""

    def __init__(self, playground, page):
        self.playground, self.session, self.page = playground, playground.session, page

    def wait(self, reached, what):
        end = time.monotonic() + PATIENCE
        while not reached():
            assert time.monotonic() < end, f"waited in vain: {what}"
            self.page.wait_for_timeout(50)

    def step_back(self, times):
        """Look from so many times as far as the page does at first, once it does."""
        (client,) = self.playground.server.get_clients().values()
        camera, first = client.camera, np.asarray(self.playground.server.initial_camera.position)
        # A page connects before it looks where it is told to, and says where it looks when it connects.
        self.wait(lambda: np.allclose(camera.position, first, atol=1e-2), "the first view")
        goal = np.asarray(camera.look_at) + times * (np.asarray(camera.position) - camera.look_at)
        camera.position = goal
        self.wait(lambda: np.allclose(client.camera.position, goal, atol=1e-3), "the view to change")

    def settled(self):
        """Wait until the object moves no more; then its points."""

        def still():
            before = self.session.moment
            self.wait(lambda: self.session.moment.frame > before.frame + 5, "frames")
            return np.abs(self.session.moment.points[0] - before.points[0]).max() < 5e-4

        self.wait(still, "the object to come to rest")
        return self.session.moment.points[0]

    def pixel(self, place):
        """Where a place [m] is on the page [px]."""
        (client,) = self.playground.server.get_clients().values()
        longest = max(client.camera.image_width, client.camera.image_height)
        pixels, _ = self.playground.scene.camera(client.camera, longest).project(np.asarray(place)[None])
        return pixels[0]

    def click(self, place, **options):
        self.page.mouse.click(*self.pixel(place), **options)

    def drag(self, place, by):
        """Move the mouse, pressed, from a place [m] by so many pixels; it stays pressed."""
        start = self.pixel(place)
        self.page.mouse.move(*start)
        self.page.mouse.down()
        for share in np.linspace(0.1, 1.0, 10):
            self.page.mouse.move(*(start + share * np.array(by)))
            self.page.wait_for_timeout(60)

    def named(self, label):
        """The control that a label is for."""
        words = self.page.locator("label", has_text=re.compile(f"^{re.escape(label)}$"))
        return self.page.locator(f'[id="{words.get_attribute("for")}"]')

    def choose(self, label, option):
        """Choose from a drop-down list."""
        self.named(label).click()
        self.page.get_by_role("option", name=option, exact=True).click()

    def stage(self):
        """What the page shows to the left of its controls, shape [H, W, 3]."""
        data = self.page.screenshot()
        shown = self.page.viewport_size["width"] - PANEL
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(int)[:, :shown]

    def green(self):
        """Where the stage is green, shape [H, W]."""
        red, green, blue = np.moveaxis(self.stage(), -1, 0)
        return (green > red + 40) & (green > blue + 40)

    def slide(self, label, share):
        """Click a slider's track, so far along it."""
        track = self.named(label).locator(".mantine-Slider-track")
        track.scroll_into_view_if_needed()
        self.page.wait_for_timeout(300)  # scrolling takes its time
        box = track.bounding_box()
        self.page.mouse.click(box["x"] + share * box["width"], box["y"] + box["height"] / 2)

    def blobs(self):
        """Middles of what is green [px], from left to right."""
        labels, count = ndimage.label(ndimage.binary_dilation(self.green(), iterations=8))
        sizes = np.bincount(labels.ravel(), minlength=count + 1)
        middles = [
            np.argwhere(labels == i)[:, ::-1].mean(axis=0) for i in range(1, count + 1) if sizes[i] > 300
        ]
        return sorted(middles, key=lambda middle: middle[0])

    def seen(self):
        """Where the page shows the object [px]: the middle of what is green on the stage."""
        green = self.green()
        return np.argwhere(green)[:, ::-1].mean(axis=0) if green.sum() > 50 else None

    def seen_at(self, points):
        """Wait until the page shows the object where its points are; then where that is [px]."""
        goal, found = self.pixel(points.astype(np.float64).mean(axis=0)), []

        def there():
            found.append(self.seen())
            return found[-1] is not None and np.linalg.norm(found[-1] - goal) < NEAR

        self.wait(there, f"the object to be shown at {goal}")
        return found[-1]

    def button(self, name):
        return self.page.get_by_role("button", name=name, exact=True)


@pytest.fixture
def play(chromium, green_twin, free_port):
    """Opens a playground in a page; what goes wrong in the page fails the test."""
    troubles, stack = [], contextlib.ExitStack()

    def start(path=green_twin, **options):
        playground = open_playground(path, port=free_port, **options)
        thread = threading.Thread(target=playground.run)
        thread.start()
        stack.callback(thread.join, 30)
        stack.callback(playground.stop)
        context = chromium.new_context(viewport={"width": 1000, "height": 700}, accept_downloads=True)
        stack.callback(context.close)
        page = context.new_page()
        page.on("pageerror", lambda error: troubles.append(str(error)))
        page.goto(playground.url)
        made = Play(playground, page)
        made.wait(playground.server.get_clients, "the browser to connect")
        expect(made.button("Pause")).to_be_visible()
        made.step_back(FARTHER)
        made.wait(lambda: made.seen() is not None, "the object to be shown")
        return made

    with stack:
        yield start
    assert troubles == []
