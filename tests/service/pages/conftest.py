"""A headless Chromium on the page of a real front; where none is installed, tests skip and say so."""

import base64
import io
import json
import shutil
import struct
import zlib

import av
import numpy as np
import pytest
from playwright.sync_api import expect, sync_playwright

FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
EXPECTED = "Failed to load resource"
"""What the service refuses, or a test cuts off, is in the console too."""


@pytest.fixture(scope="module")
def chromium():
    """For as long as a module of tests: its event loop would be in the way of others."""
    path = next((found for name in NAMES if (found := shutil.which(name))), None)
    if path is None:
        pytest.skip(f"no Chromium on the PATH (looked for {', '.join(NAMES)}): apt-get install chromium")
    expect.set_options(timeout=10_000)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=list(FLAGS))
        yield browser
        browser.close()


@pytest.fixture
def open_page(chromium, serving):
    """Opens the page in a fresh session: `open_page(width=390)`; what went wrong in it fails the test."""
    contexts, troubles = [], []

    def start(width=1280, height=800, at=serving, key=True, **options):
        context = chromium.new_context(
            viewport={"width": width, "height": height}, accept_downloads=True, **options
        )
        contexts.append(context)
        page = context.new_page()
        page.on("pageerror", lambda error: troubles.append(str(error)))
        page.on("console", lambda said: troubles.append(said.text) if said.type == "error" else None)
        page.goto(at.url)
        if key:
            enter_key(page, at)
        return page

    yield start
    for context in contexts:
        context.close()
    assert [text for text in troubles if EXPECTED not in text] == []


def enter_key(page, serving):
    page.get_by_label("API key", exact=True).fill(
        serving.keys.create("test", "default", ("submit", "read"))[1]
    )
    page.get_by_role("button", name="Continue").click()
    expect(page.get_by_role("heading", name="New twin")).to_be_visible()


@pytest.fixture(scope="session")
def film():
    """A clip that browsers play."""
    target = io.BytesIO()
    with av.open(target, "w", format="mp4") as out:
        stream = out.add_stream("libx264", rate=30)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for index in range(20):
            image = np.full((48, 64, 3), 40, np.uint8)
            image[:, index : index + 8] = 255
            for packet in stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")):
                out.mux(packet)
        for packet in stream.encode():
            out.mux(packet)
    return target.getvalue()


@pytest.fixture
def clip_file(tmp_path, film):
    path = tmp_path / "my toy.mp4"
    path.write_bytes(film)
    return path


@pytest.fixture(scope="session")
def twin_files(film):
    """What a worker publishes, small; its texts try to be markup."""
    manifest = {
        "schema": "matphys.twin/1",
        "version": "0.1.0",
        "source": {
            "frames": 20,
            "fps": 30.0,
            "width": 64,
            "height": 48,
            "keyframe": 0,
            "scale": "assumed: <b>0.3 m</b>",
        },
        "stages": [
            {"name": "prior", "method": "stub", "version": "1", "weights": None, "warnings": ["is a stub"]}
        ],
        "metrics": {"silhouette_iou_per_frame": [1.0, 0.8, 0.6]},
        "warnings": ["prior: is a stub", "<img src=x onerror=document.title='hacked'>"],
    }
    part = {
        "label": "part 0",
        "materials": {"fabric": 0.7, "fur": 0.2, "denim": 0.1},
        "prior": {"stiffness": {"mean": 4243.5, "spread": 1.8, "unit": "Pa"}},
        "stiffness": {
            "springs": 42,
            "mean": 6.5556,
            "std": 1.9,
            "minimum": 2.0,
            "median": 6.0,
            "maximum": 12.0,
        },
        "size": {"points": 9, "gaussians": 20, "mass": 0.0444, "extent": [0.1222, 0.17, 0.06]},
        "overlay": base64.b64encode(dot()).decode(),
    }
    parameters = {
        "dashpot_damping": {"value": 0.00551765, "unit": "N*s/m", "source": "prior", "std": 0.004},
        "gravity": {"value": [0.0, 0.0, -9.81], "unit": "m/s^2", "source": "user", "std": None},
    }
    return {
        "bundle.twin.zip": b"PK" + bytes(3000),
        "preview.mp4": film,
        "twin.json": json.dumps(manifest).encode(),
        "parts.json": json.dumps([part]).encode(),
        "parameters.json": json.dumps(parameters).encode(),
    }


def dot():
    """A PNG of one pixel."""

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", 1, 1, 8, 2, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"IDAT", zlib.compress(b"\0abc"))
        + chunk(b"IEND", b"")
    )


@pytest.fixture
def new_twin(serving, clip_file):
    """Submits a clip as a program would; gives the id."""

    def submit(at=serving):
        with at.client() as http:
            answer = http.post(
                "/twins", content=clip_file.read_bytes(), headers={"Content-Type": "video/mp4"}
            )
        assert answer.status_code == 202, answer.text
        return answer.json()["id"]

    return submit
