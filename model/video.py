"""A video file, or a folder of numbered images, becomes Frames: bounded, upright, in order."""

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import av
import av.container
import av.error
import av.stream
import av.video
import av.video.frame
import av.video.stream
import numpy as np
from av.sidedata.sidedata import SideData
from jaxtyping import UInt8

from model.errors import InputError
from model.frame_keeper import FrameKeeper, check_duration, check_size, sha256_of
from model.image_folder import read_folder
from model.types import Array, Frames

CONTAINERS: Final = "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpegts,mpeg,flv"
"""libavformat's names of what we open: no playlists, no concatenations, no image readers, no network."""
VIDEO_SUFFIXES: Final = ".mp4, .mov, .mkv, .webm or .avi"

MAX_FRAMES: Final = 300
MAX_PIXELS: Final = 4096 * 2304
MAX_SECONDS: Final = 60.0
FOLDER_FPS: Final = 30.0
"""Of a folder of images whose frame rate nobody tells [1/s]."""


@dataclass(frozen=True)
class VideoInfo:
    """What the header of a video says; nothing was decoded to learn it."""

    container: str
    codec: str
    width: int
    """As coded [px], before any rotation for display."""
    height: int
    frame_count: int
    """An estimate from duration and rate where the container does not count its frames."""
    fps: float
    duration: float
    """[s]; 0 where the header does not say."""


def probe_video(path: str | Path) -> VideoInfo:
    """Read the header of a video file.

    Raises:
        InputError: the file is missing, empty, or no video in a container we open.
    """
    path = _existing_file(Path(path))
    with _opened(path) as container:
        return _info(container, _video_stream(container, path))


def read_video(
    path: str | Path,
    *,
    max_frames: int = MAX_FRAMES,
    max_pixels: int = MAX_PIXELS,
    max_seconds: float = MAX_SECONDS,
    fps: float | None = None,
) -> Frames:
    """Decode a clip, upright, at a working size of at most 960 px on the longest side.

    A clip with more than `max_frames` frames is thinned evenly, with a warning: the whole interaction
    stays, only its sampling in time gets coarser. Too many pixels or seconds are refused from the
    header, before anything is decoded.

    Args:
        path: A video file, or a folder of numbered PNG or JPEG images (read in numeric order).
        max_frames: Frames kept at most.
        max_pixels: Pixels of one coded frame at most.
        max_seconds: Duration at most [s].
        fps: Frame rate of a folder of images [1/s], `FOLDER_FPS` if not given; a video file carries its own
            times.

    Raises:
        InputError: the clip cannot be used; one line says why.
    """
    path = Path(path)
    if path.is_dir():
        path = path if path.name not in ("", "..") else path.resolve()  # messages name it
        return read_folder(path, max_frames, max_pixels, max_seconds, FOLDER_FPS if fps is None else fps)
    if fps is not None:
        raise InputError(f"{path.name}: --fps is for a folder of images; a video file carries its own times")
    path = _existing_file(path)
    with _opened(path) as container:
        stream = _video_stream(container, path)
        info = _info(container, stream)
        check_size(path, info.width, info.height, max_pixels)
        check_duration(path, max(info.duration, info.frame_count / info.fps), max_seconds)
        _check_complete(path, container, stream)
        # Only a count that the container itself gives: a rate of 1000 fps, which tools write where the rate
        # varies, makes thirty frames a thousand.
        # An AVI counts the empty chunks that stand for frames shown for longer.
        counted = 0 if "avi" in container.format.name else stream.frames
        keeper = FrameKeeper(max_frames, stride=-(-counted // max_frames))
        end = 0.0
        for index, frame in enumerate(_decoded(container, stream, path, info, max_pixels)):
            time = index / info.fps if frame.time is None else float(frame.time)
            end = time + 1.0 / info.fps
            check_duration(path, end - keeper.start(time), max_seconds)
            if keeper.wants(time):
                keeper.keep(_upright(frame), time, _pixel_aspect(frame, stream))
        _check_reached_end(path, container, stream, end, keeper.seen, info)
    return keeper.frames(path, sha256_of([path]))


def _existing_file(path: Path) -> Path:
    if not path.exists():
        raise InputError(f"{path}: no such file")
    if not path.is_file():
        raise InputError(f"{path}: not a regular file")
    if path.stat().st_size == 0:
        raise InputError(f"{path.name}: the file is empty")
    return path


def _opened(path: Path) -> av.container.InputContainer:
    """Open by an explicit `file:` URL, with only our containers and no protocol but files."""
    options = {"format_whitelist": CONTAINERS, "protocol_whitelist": "file"}
    try:
        return av.open(f"file:{path}", options=options, metadata_errors="replace")
    except (av.error.FFmpegError, ValueError):
        raise InputError(
            f"{path.name}: not a readable video; its header is damaged or it is no {VIDEO_SUFFIXES} file"
        ) from None


def _video_stream(container: av.container.InputContainer, path: Path) -> av.video.stream.VideoStream:
    if not container.streams.video:
        raise InputError(f"{path.name}: holds no video stream")
    stream = container.streams.video[0]
    if stream.codec_context is None or not stream.codec_context.width:
        raise InputError(f"{path.name}: its video stream is of a kind we cannot decode")
    return stream


def _info(container: av.container.InputContainer, stream: av.video.stream.VideoStream) -> VideoInfo:
    duration = _duration(container, stream)
    rate = stream.average_rate or stream.guessed_rate
    fps = float(rate) if rate else 30.0
    return VideoInfo(
        container=container.format.name,
        codec=stream.codec_context.name,
        width=stream.codec_context.width,
        height=stream.codec_context.height,
        frame_count=stream.frames or round(duration * fps),
        fps=fps,
        duration=duration,
    )


def _duration(container: av.container.InputContainer, stream: av.video.stream.VideoStream) -> float:
    """Duration of the video stream [s], or of the whole file where the stream does not say; else 0."""
    if stream.duration and stream.time_base:
        return float(stream.duration * stream.time_base)
    tag = re.fullmatch(r"(\d+):(\d+):([\d.]+)", stream.metadata.get("DURATION", ""))  # Matroska's way
    if tag:
        return int(tag[1]) * 3600 + int(tag[2]) * 60 + float(tag[3])
    return container.duration / av.time_base if container.duration else 0.0


def _broken_off(path: Path, have: int, total: int) -> InputError:
    # A twin replays the recorded interaction: from a clip that silently lost its end it would learn
    # another interaction than the one recorded, so an incomplete clip is refused, not shortened.
    return InputError(
        f"{path.name}: breaks off after frame {have} of {total}; copy it again, or re-encode what is there"
    )


def _check_complete(
    path: Path, container: av.container.InputContainer, stream: av.video.stream.VideoStream
) -> None:
    """Refuse an MP4/MOV whose index points behind the end of the file; needs no decoding."""
    if "mp4" not in container.format.name:
        return
    size = path.stat().st_size
    entries = stream.index_entries
    ends = [entry.pos + entry.size for entry in (entries[i] for i in range(len(entries)))]
    have = sum(end <= size for end in ends)
    if have < len(ends):
        raise _broken_off(path, have, len(ends))


def _check_reached_end(
    path: Path,
    container: av.container.InputContainer,
    stream: av.video.stream.VideoStream,
    end: float,
    seen: int,
    info: VideoInfo,
) -> None:
    """Refuse a clip whose last frame ends well before its header says the video does."""
    shared = len(container.streams) > 1 and not (stream.duration or "DURATION" in stream.metadata)
    if shared or not info.duration or "mp4" in container.format.name:
        return  # the sound may be longer than the pictures; an MP4 was checked by its index
    start = float((stream.start_time or 0) * stream.time_base) if stream.time_base else 0.0
    # A cut-off AVI has lost its index, and with it its duration, but not its count of frames.
    expected = max(info.duration, stream.frames / info.fps)
    if expected - (end - min(start, 0.0)) > max(0.1, 3.0 / info.fps):
        raise _broken_off(path, seen, max(info.frame_count, seen + 1))


def _decoded(
    container: av.container.InputContainer,
    stream: av.video.stream.VideoStream,
    path: Path,
    info: VideoInfo,
    max_pixels: int,
) -> Iterator[av.video.frame.VideoFrame]:
    """Decode lazily; the decoder itself refuses pictures larger than the header promised to be legal."""
    stream.codec_context.options = {"max_pixels": str(max_pixels)}
    stream.thread_type = "AUTO"
    count = 0
    try:
        for frame in container.decode(stream):
            if frame.is_corrupt:
                raise _broken_off(path, count, max(info.frame_count, count + 1))
            yield frame
            count += 1
    except av.error.FFmpegError:
        raise _broken_off(path, count, max(info.frame_count, count + 1)) from None


def _upright(frame: av.video.frame.VideoFrame) -> UInt8[Array, "H W 3"]:
    """RGB, turned (and mirrored) as the display matrix asks."""
    image = frame.to_ndarray(format="rgb24")
    matrix = frame.side_data.get("DISPLAYMATRIX")
    if not isinstance(matrix, SideData):
        return image
    # Row vectors: (x', y') = (x, y) · [[a, b], [c, d]], with nine 16.16 numbers in row order.
    a, b, _, c, d = struct.unpack("=9i", bytes(matrix))[:5]
    if abs(b) + abs(c) > abs(a) + abs(d):
        image, flip_x, flip_y = image.transpose(1, 0, 2), c < 0, b < 0
    else:
        flip_x, flip_y = a < 0, d < 0
    return np.ascontiguousarray(image[:: -1 if flip_y else 1, :: -1 if flip_x else 1])


def _pixel_aspect(frame: av.video.frame.VideoFrame, stream: av.video.stream.VideoStream) -> float:
    """Width over height of a pixel of the upright picture."""
    aspect = float(stream.sample_aspect_ratio or 1) or 1.0
    return 1 / aspect if frame.rotation % 180 == 90 else aspect
