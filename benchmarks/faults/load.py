"""Clients that keep asking for errands, each again under the same key until it is accepted."""

import itertools
import json
import threading
import time
import uuid
from concurrent.futures import Future, ThreadPoolExecutor

import httpx

TRY_S = 0.2
GIVE_UP_S = 120.0


class Load:
    """Continuous submission to one front.

    Args:
        url: Of the front.
        key: API key.
        per_second: How many errands.
        least: How many at least, before `stop` lets go.
    """

    def __init__(self, url: str, key: str, per_second: float, least: int) -> None:
        """Begin to ask."""
        self._url, self._headers = url, {"Authorization": f"Bearer {key}"}
        self._pause, self._least = 1.0 / per_second, least
        self._pool = ThreadPoolExecutor(8)
        self._numbers = itertools.count(1)
        self._stopping = threading.Event()
        self.futures: list[Future[str]] = []
        self.repeats = 0
        self._thread = threading.Thread(target=self._keep_asking)
        self._thread.start()

    def ask(self, seconds: float = 0.2, **options: object) -> "Future[str]":
        """Ask for an errand; gives its id once it is accepted."""
        future = self._pool.submit(
            self._ask, next(self._numbers), {"seconds": seconds, "bytes": 20_000, **options}
        )
        self.futures.append(future)
        return future

    def stop(self) -> None:
        """End when there are enough."""
        self._stopping.set()

    def done(self) -> bool:
        """Whether everything that was asked for is accepted."""
        return not self._thread.is_alive() and all(future.done() for future in self.futures)

    def close(self) -> None:
        """End now."""
        self.stop()
        self._least = 0
        self._thread.join()
        self._pool.shutdown(wait=False, cancel_futures=True)

    def _keep_asking(self) -> None:
        while not self._stopping.is_set() or len(self.futures) < self._least:
            self.ask()
            time.sleep(self._pause)

    def _ask(self, number: int, options: dict[str, object]) -> str:
        headers = {**self._headers, "Idempotency-Key": f"{number}-{uuid.uuid4().hex}"}
        # Every note differs, or the service would give the same job again.
        note = json.dumps({"intrinsics": [[number, 0, 0], [0, number, 0], [0, 0, 1]]}).encode()
        deadline = time.monotonic() + GIVE_UP_S
        while True:
            try:
                answer = httpx.post(
                    f"{self._url}/errands",
                    headers=headers,
                    files={"note": ("note.json", note)},
                    data={
                        name: json.dumps(value) if not isinstance(value, str) else value
                        for name, value in options.items()
                    },
                    timeout=20.0,
                )
                if answer.status_code == 202:
                    job_id: str = answer.json()["id"]
                    return job_id
                if answer.status_code < 500 and answer.status_code != 429:
                    raise RuntimeError(f"refused: {answer.status_code} {answer.text}")
            except httpx.TransportError:
                pass
            if time.monotonic() > deadline:
                raise TimeoutError("never accepted")
            self.repeats += 1
            time.sleep(TRY_S)
