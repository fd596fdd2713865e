"""A first look at uploads, in a process that may do next to nothing."""

import asyncio
import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from service.errors import ProblemError
from service.turns import Turns

WALL_SECONDS: Final = 20.0
"""How long a look may take; the process itself may use 10 s of a processor."""
WAIT_SECONDS: Final = 60.0
WAIT_AGAIN_SECONDS: Final = 30
"""How long files wait for their turn, and what a client is told to wait then."""
ENVIRONMENT: Final = {"PATH": os.defpath, "LC_ALL": "C.UTF-8", "OPENBLAS_NUM_THREADS": "1"}
"""No address, password or key of ours."""


class Inspector:
    """Looks into files, a few at a time.

    Args:
        parallel: How many processes may look at the same time; the others wait.
    """

    def __init__(self, parallel: int) -> None:
        """Start nothing yet."""
        self._turns = Turns(parallel)

    async def inspect(self, tenant: str, files: Mapping[str, tuple[str, Path]]) -> dict[str, str]:
        """Look into files.

        Args:
            tenant: Whose they are.
            files: Name of the input → its kind (a module of `worker.inspection`) and where it lies.

        Returns:
            Name of the input → the suffix that suits its content.

        Raises:
            ProblemError: the first file that is refused, and why; or too many are looked into.
        """
        request = json.dumps([[name, kind, str(path)] for name, (kind, path) in files.items()])
        try:
            async with self._turns.turn(tenant, WAIT_SECONDS):
                output = await _run(request)
        except TimeoutError:
            raise ProblemError(
                "unavailable", "too many uploads are being looked into", retry_after=WAIT_AGAIN_SECONDS
            ) from None
        try:
            verdict = json.loads(output)
        except ValueError:
            verdict = {}
        if "suffixes" in verdict:
            return dict(verdict["suffixes"])
        if "refused" in verdict:
            name = "unsupported-media-type" if verdict["unknown_format"] else "bad-input"
            raise ProblemError(name, f"{verdict['refused']}: {verdict['detail']}")
        several = " or ".join(files) or "upload"  # nobody says which one it was
        raise ProblemError(
            "bad-input", f"{several}: cannot be read within the limits of an upload: re-encode it"
        )


async def _run(request: str) -> bytes:
    """What the process printed before it ended; nothing when it had to be ended."""
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-I", "-m", "worker.inspection", request),
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.DEVNULL,
        env=ENVIRONMENT,
        cwd="/",
    )
    try:
        async with asyncio.timeout(WALL_SECONDS):
            output, _ = await process.communicate()
            return output
    except TimeoutError:
        return b""
    finally:
        if process.returncode is None:  # too slow, or the client has gone
            process.kill()
            await process.wait()
