"""Where a list goes on: an opaque text, which clients give back as they got it."""

import base64
import binascii
import re
from typing import Final

from service.errors import ProblemError

JOB_ID: Final = re.compile(r"[0-9a-f]{32}")
CURSOR_PATTERN: Final = r"^[A-Za-z0-9_-]{21}[AQgw]$"
"""What every cursor looks like: 16 bytes in base64."""


def encode_cursor(job_id: str) -> str:
    """The cursor of the jobs that follow this one."""
    return base64.urlsafe_b64encode(bytes.fromhex(job_id)).decode().rstrip("=")


def decode_cursor(cursor: str) -> str:
    """The job a cursor stands for.

    Raises:
        ProblemError: it is none of ours.
    """
    try:
        job_id = base64.b64decode(cursor + "==", altchars=b"-_", validate=True).hex()
    except (binascii.Error, ValueError):
        job_id = ""
    if not JOB_ID.fullmatch(job_id) or encode_cursor(job_id) != cursor:
        raise ProblemError("invalid-request", "cursor: give back what next_cursor said, unchanged")
    return job_id
