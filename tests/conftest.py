"""Shared fixtures. Array shapes in annotations are checked by beartype while tests run."""

import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest
from jaxtyping import install_import_hook

install_import_hook(("model",), "beartype.beartype")


def _film(
    frames: int = 6,
    size: tuple[int, int] = (64, 48),
    container: str = "mp4",
    rate: int = 30,
    codec: str = "mpeg4",
) -> bytes:
    import av
    import numpy as np

    options = {"movflags": "faststart"} if container == "mp4" else {}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "clip"
        with av.open(str(path), "w", format=container, options=options) as out:
            stream = out.add_stream(codec, rate=rate)
            stream.width, stream.height = size
            stream.pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
            for index in range(frames):
                image = np.zeros((size[1], size[0], 3), np.uint8)
                image[:, index % size[0] :][:, :8] = 255
                out.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
            out.mux(stream.encode())
        return path.read_bytes()


@pytest.fixture(scope="session")
def film() -> Callable[..., bytes]:
    """Makes tiny clips of something that moves: `film(frames=…, size=…, container=…, rate=…, codec=…)`."""
    return _film
