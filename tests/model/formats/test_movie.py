import io
import os
import platform
import subprocess
import sys

import av
import numpy as np
import pytest

from model.formats.movie import encode_mp4


def gradient(t, height=49, width=65):
    y, x = np.mgrid[:height, :width]
    return np.stack([x * 3, y * 4, np.full_like(x, 20 * t)], axis=-1).clip(0, 255).astype(np.uint8)


def test_images_and_uneven_times_come_back():
    times = np.array([0.5, 0.533, 0.6, 0.7, 0.734])
    data = encode_mp4((gradient(t) for t in range(5)), times)
    with av.open(io.BytesIO(data)) as container:
        stream = container.streams.video[0]
        assert stream.codec_context.name == "h264"
        assert stream.codec_context.pix_fmt == "yuv420p"
        frames = list(container.decode(stream))
    np.testing.assert_allclose([frame.time for frame in frames], times - times[0], atol=1e-4)
    for t, frame in enumerate(frames):
        assert (frame.height, frame.width) == (50, 66)
        decoded = frame.to_ndarray(format="rgb24")[:49, :65].astype(float)
        assert np.abs(decoded - gradient(t)).mean() < 6


def test_same_images_same_bytes_with_the_index_first():
    times = np.arange(4) / 30
    first, second = (encode_mp4([gradient(t) for t in range(4)], times) for _ in range(2))
    assert first == second
    assert first != encode_mp4([gradient(t + 1) for t in range(4)], times)
    assert first.index(b"moov") < first.index(b"mdat")
    assert b"Lavf" not in first


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="MALLOC_PERTURB_ is glibc's")
def test_bytes_do_not_depend_on_what_memory_held_before():
    code = (
        "import hashlib, numpy as np; from model.formats.movie import encode_mp4; "
        "ramp = np.arange(50 * 96 * 3, dtype=np.uint32).reshape(50, 96, 3); "
        "images = [(ramp * (t + 3) % 251).astype(np.uint8) for t in range(4)]; "
        "print(hashlib.sha256(encode_mp4(images, np.arange(4) / 30)).hexdigest())"
    )
    printed = {
        subprocess.run(
            [sys.executable, "-c", code],
            env=os.environ | {"MALLOC_PERTURB_": fill},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for fill in ("0", "85", "170")
    }
    assert len(printed) == 1


def test_no_images():
    with pytest.raises(ValueError, match="at least one"):
        encode_mp4([], np.zeros(0))
