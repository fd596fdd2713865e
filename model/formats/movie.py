"""Images → an MP4 that every browser plays."""

import tempfile
from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from av.codec.context import Flags
from jaxtyping import Float64, UInt8

from model.types import Array

CLOCK = 90_000
"""Ticks per second of the time stamps."""
STEADY = "threads=1:asm=sse4.2"
"""x264's AVX-512 routines read memory behind the picture that nobody has written, and the bytes then differ
from run to run (seen with MALLOC_PERTURB_); its older ones do not."""
QUALITY = 20
"""x264's constant rate factor: 18 looks lossless, 23 is its default."""


def encode_mp4(images: Iterable[UInt8[Array, "H W 3"]], times: Float64[Array, " T"]) -> bytes:
    """Encode images as H.264 with their own presentation times; equal images give equal bytes.

    One thread and bit-exact flags keep the bytes free of the machine's core count and of library
    versions in the headers; the index comes first, so that playback starts at once.

    Args:
        images: RGB, all of one size; an odd last row or column is repeated, as 4:2:0 asks for.
        times: Presentation times [s], strictly increasing, one per image.
    """
    spacing = float(np.median(np.diff(times))) if len(times) > 1 else 1 / 30
    rate = Fraction(1 / spacing).limit_denominator(1001)
    # libavformat moves the index to the front by reading the file again, so it has to be a real file.
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "movie.mp4"
        options = {"movflags": "+faststart", "fflags": "+bitexact"}
        with av.open(str(path), "w", format="mp4", options=options) as container:
            stream = None
            for image, time in zip(images, times, strict=True):
                image = _even(image)
                if stream is None:
                    stream = container.add_stream("libx264", rate=rate)
                    stream.height, stream.width = image.shape[:2]
                    stream.pix_fmt = "yuv420p"
                    stream.codec_context.time_base = Fraction(1, CLOCK)
                    stream.codec_context.thread_count = 1
                    stream.codec_context.flags |= Flags.bitexact
                    stream.options = {"crf": str(QUALITY), "preset": "fast", "x264-params": STEADY}
                frame = av.VideoFrame.from_ndarray(image, format="rgb24")
                frame.pts, frame.time_base = round((time - times[0]) * CLOCK), Fraction(1, CLOCK)
                container.mux(stream.encode(frame))
            if stream is None:
                raise ValueError("a movie needs at least one image")
            container.mux(stream.encode(None))
        return path.read_bytes()


def _even(image: UInt8[Array, "H W 3"]) -> UInt8[Array, "h w 3"]:
    """The image with even sides, contiguous."""
    height, width = image.shape[:2]
    padded = np.pad(image, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
    return np.ascontiguousarray(padded)
