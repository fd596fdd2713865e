"""What `matphys-serve` runs beside itself on a machine that has nothing: a Redis and a worker."""

import asyncio
import logging
import os
import signal
import subprocess
import sys
from collections.abc import Mapping

from model.errors import InputError
from worker.child import ends_with_us
from worker.embedded import EmbeddedRedis

LOOK_SECONDS = 0.2
"""How often it is looked whether both live [s]."""
PAUSE_SECONDS = 1.0
"""After one of them could not be started [s]."""
LONGEST_PAUSE = 10.0
"""Between two starts of a worker that does not stay [s]."""
STEADY_SECONDS = 30.0
"""A worker that has lived this long [s] is started again at once when it ends."""
GRACE_SECONDS = 60.0
"""How long a worker may take to end [s], the grace it gives its job included."""

log = logging.getLogger("matphys.companions")


class Companions:
    """A Redis and a worker: started, started again when they die, stopped in order.

    Args:
        redis: The Redis.
        environment: Of the worker.
    """

    def __init__(self, redis: EmbeddedRedis, environment: Mapping[str, str]) -> None:
        """Start nothing yet."""
        self._redis, self._environment = redis, dict(environment)
        self._worker: subprocess.Popen[bytes] | None = None

    def start_redis(self) -> None:
        """Start Redis and wait until it answers.

        Raises:
            InputError: it does not start; one line says why.
        """
        self._redis.start()

    async def keep(self) -> None:
        """Keep both alive, until canceled. Runs on the main thread, which their lives are tied to."""
        pause, started = 0.0, 0.0
        clock = asyncio.get_running_loop().time
        while True:
            if self._redis.pid is None:
                log.error("redis has ended and is started again", extra={"child": "redis"})
                try:
                    self._redis.launch()
                except (InputError, OSError) as error:
                    log.error("redis cannot be started: %s", error, extra={"child": "redis"})
                    await asyncio.sleep(PAUSE_SECONDS)
            if self._worker is None or self._worker.poll() is not None:
                if self._worker is not None:
                    lived = clock() - started
                    pause = 0.0 if lived > STEADY_SECONDS else min(LONGEST_PAUSE, max(0.5, 2 * pause))
                    code = self._worker.returncode
                    log.error(
                        "the worker has ended (%d) and is started again", code, extra={"child": "worker"}
                    )
                    await asyncio.sleep(pause)
                try:
                    self._worker, started = self._start_worker(), clock()
                except (OSError, subprocess.SubprocessError) as error:
                    self._worker = None
                    log.error("the worker cannot be started: %s", error, extra={"child": "worker"})
                    await asyncio.sleep(PAUSE_SECONDS)
            await asyncio.sleep(LOOK_SECONDS)

    def stop(self) -> None:
        """Stop the worker, then Redis, which the worker needs to hand back what it has."""
        if self._worker is not None:
            self._worker.terminate()
            try:
                self._worker.wait(GRACE_SECONDS)
            except subprocess.TimeoutExpired:
                os.killpg(self._worker.pid, signal.SIGKILL)
                self._worker.wait()
            self._worker = None
        self._redis.stop()

    def _start_worker(self) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, "-m", "worker.main"],
            stdin=subprocess.DEVNULL,
            env=self._environment,
            start_new_session=True,  # Ctrl-C reaches us, and we stop it
            preexec_fn=ends_with_us(),
        )
