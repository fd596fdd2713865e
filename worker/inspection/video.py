"""A first look at a clip: container, size, length, and whether its first picture can be decoded."""

from pathlib import Path
from typing import Final

import av
import av.container
import av.error
import av.video.stream
from av.stream import Disposition

from worker.inspection.verdict import BrokenFileError, UnknownFormatError

# The limits of `model.video`, which imports too much for so short a look; a test keeps them alike.
CONTAINERS: Final = "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpegts,mpeg,flv"
MAX_PIXELS: Final = 4096 * 2304
MAX_SECONDS: Final = 60.0
MAX_PACKETS: Final = 60_000
"""Frames of one minute at 1000 per second."""
SUFFIXES: Final = {
    "mov": ".mp4",
    "matroska": ".mkv",
    "avi": ".avi",
    "mpegts": ".ts",
    "mpeg": ".mpg",
    "flv": ".flv",
}


def inspect(path: Path) -> str:
    """Look at a video file; returns the suffix that suits its content.

    Raises:
        UnknownFormatError: no container that we open.
        BrokenFileError: no moving pictures in it, too large, too long, or it breaks off.
    """
    options = {"format_whitelist": CONTAINERS, "protocol_whitelist": "file"}
    try:
        with av.open(f"file:{path}", options=options, metadata_errors="replace") as container:
            stream = _video_stream(container)
            _check_index(container, stream, path.stat().st_size)
            _check_packets(container, stream)
            container.seek(0)
            _check_first_picture(container, stream)
            return SUFFIXES[container.format.name.partition(",")[0]]
    except (av.error.FFmpegError, ValueError) as error:
        if isinstance(error, UnknownFormatError | BrokenFileError):
            raise
        raise UnknownFormatError(
            "no video that can be read: send an MP4, MOV, MKV, WebM or AVI file"
        ) from None


def _video_stream(container: av.container.InputContainer) -> av.video.stream.VideoStream:
    moving = [each for each in container.streams.video if not each.disposition & Disposition.attached_pic]
    if not moving:
        raise BrokenFileError("holds no video stream")
    stream = moving[0]
    if stream.codec_context is None or not stream.codec_context.width or not stream.codec_context.height:
        raise BrokenFileError("its video stream is of a kind that cannot be decoded")
    _check_size(stream.codec_context.width, stream.codec_context.height)
    return stream


def _check_size(width: int, height: int) -> None:
    if width * height > MAX_PIXELS:
        raise BrokenFileError(f"{width}×{height} pixels are too many: scale it to at most 4096×2304")


def _check_index(
    container: av.container.InputContainer, stream: av.video.stream.VideoStream, size: int
) -> None:
    """Refuse an MP4 whose index points behind the end of the file."""
    if "mp4" not in container.format.name:
        return
    entries = stream.index_entries
    ends = [entry.pos + entry.size for entry in (entries[i] for i in range(len(entries)))]
    whole = sum(end <= size for end in ends)
    if whole < len(ends):
        raise BrokenFileError(f"breaks off after frame {whole} of {len(ends)}: send the whole file")


def _check_packets(container: av.container.InputContainer, stream: av.video.stream.VideoStream) -> None:
    """Count and time the coded pictures, without decoding them: headers may say anything."""
    first, last, count = None, 0.0, 0
    for packet in container.demux(stream):
        if packet.pts is None or not packet.size:
            continue
        count += 1
        time = float(packet.pts * packet.time_base) if packet.time_base else 0.0
        first = time if first is None else min(first, time)
        last = max(last, time)
        if count > MAX_PACKETS or last - first > MAX_SECONDS:
            raise BrokenFileError(f"longer than {MAX_SECONDS:g} s: cut it to the interaction")
    if count == 0:
        raise BrokenFileError("holds no pictures")


def _check_first_picture(container: av.container.InputContainer, stream: av.video.stream.VideoStream) -> None:
    stream.codec_context.options = {"max_pixels": str(MAX_PIXELS)}
    stream.thread_type = "NONE"
    try:
        frame = next(container.decode(stream), None)
    except av.error.FFmpegError:
        frame = None
    if frame is None:
        raise BrokenFileError("its pictures cannot be decoded: re-encode it")
    _check_size(frame.width, frame.height)
