"""`matphys-serve`: the service, alone on a machine or as one front of many."""

import asyncio
import os
import signal
import socket
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import click
import uvicorn
from fastapi import FastAPI

from model.errors import InputError
from model.version import __version__
from service.app import create_app
from service.companions import Companions
from service.connections import PromptProtocol
from service.keys import api_keys_at, keys
from service.logs import log_as_json
from service.settings import DATA_DIR, Settings
from worker.embedded import EmbeddedRedis
from worker.storage import Storage

DONE, OUR_FAULT, BAD_INPUT = 0, 1, 2
DRAIN_SECONDS = 5
"""How long requests under way may take to end when the front is stopped."""
BACKLOG = 2048
REDIS_PATIENCE = 30.0
"""How long a front waits at its start for a Redis that starts too [s]."""
WORKER_GRACE = "10"
"""Seconds that a job may go on when all is stopped: somebody waits at a terminal."""


class FrontServer(uvicorn.Server):
    """Ends streams of events when it is to stop, and leaves the process to whoever started it."""

    def __init__(self, config: uvicorn.Config, app: FastAPI, address: str) -> None:
        """Say `address` once requests are answered."""
        super().__init__(config)
        self._app, self._address = app, address

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Begin to answer."""
        await super().startup(sockets)
        if self.started:
            click.echo(f"MatPhys is at {self._address}")

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Take the signals; uvicorn raises them again afterwards, and our children would not be stopped."""
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, self.handle_exit, number, None)
        yield

    def handle_exit(self, sig: int, frame: object) -> None:
        """Begin to stop."""
        del frame
        super().handle_exit(sig, None)
        if hasattr(self._app.state, "front"):
            self._app.state.front.closing.set()


@click.group(invoke_without_command=True, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="matphys-serve")
@click.option("--host", default="127.0.0.1", show_default=True, help="The address to listen at.")
@click.option(
    "--port", default=8000, show_default=True, type=click.IntRange(0, 65535), help="0: any free one."
)
@DATA_DIR
@click.pass_context
def serve(context: click.Context, host: str, port: int, data_dir: Path) -> None:
    """Serve MatPhys over HTTP.

    Alone, it runs a Redis and a worker of its own and keeps everything in the data folder. With
    REDIS_URL (and STORE_URL) it is a front of a service whose workers (`matphys-worker`) run elsewhere.
    """
    if context.invoked_subcommand is not None:
        return
    data_dir = data_dir.absolute()  # the processes that are started do not all run in this folder
    listener = _listen(host, port)
    address = f"http://{host if ':' not in host else f'[{host}]'}:{listener.getsockname()[1]}"
    store_url = os.environ.get("STORE_URL") or (data_dir / "store").as_uri()
    redis_url = os.environ.get("REDIS_URL")
    if redis_url:
        settings = Settings.from_environment(
            os.environ, data_dir=data_dir, redis_url=redis_url, store_url=store_url
        )
        log_as_json(settings.log_level)
        _serve(settings, listener, address, None)
        return
    redis = EmbeddedRedis(data_dir / "redis")
    settings = Settings.from_environment(
        os.environ, data_dir=data_dir, redis_url=redis.url, store_url=store_url
    )
    log_as_json(settings.log_level)
    companions = Companions(
        redis,
        {"MATPHYS_GRACE": WORKER_GRACE, "MATPHYS_SCRATCH": str(data_dir / "scratch")}
        | os.environ
        | {"REDIS_URL": redis.url, "STORE_URL": store_url},
    )
    try:
        companions.start_redis()
        _serve(settings, listener, address, companions)
    finally:
        companions.stop()


serve.add_command(keys)


def _serve(settings: Settings, listener: socket.socket, address: str, companions: Companions | None) -> None:
    """Answer requests until a signal comes."""
    try:
        settings.data_dir.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{settings.data_dir}: cannot keep data there ({error.strerror})") from None
    Storage(settings.store_url)  # says now, in one line, what is wrong with it
    with api_keys_at(settings.redis_url, REDIS_PATIENCE) as api_keys:
        first_key = api_keys.create_first()
    if first_key is not None:
        click.echo(f"API key: {first_key}")
    app = create_app(settings)
    config = uvicorn.Config(
        app,
        http=PromptProtocol,
        ws="none",
        log_config=None,
        access_log=False,
        server_header=False,
        timeout_graceful_shutdown=DRAIN_SECONDS,
    )
    asyncio.run(_run(FrontServer(config, app, address), listener, companions))


async def _run(server: FrontServer, listener: socket.socket, companions: Companions | None) -> None:
    keeping = asyncio.create_task(companions.keep()) if companions is not None else None
    try:
        await server.serve(sockets=[listener])
    finally:
        if keeping is not None:
            keeping.cancel()


def _listen(host: str, port: int) -> socket.socket:
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        listener = socket.create_server((host, port), family=family, backlog=BACKLOG)
        # Connections inherit it. Asyncio would set it, but not where a socket's protocol is left to the
        # system; without it every answer waits 40 ms for the acknowledgement of its headers.
        listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return listener
    except (OSError, OverflowError, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(
            f"cannot listen at {host}:{port} ({reason}): choose another --host or --port"
        ) from None


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0 done, 1 our fault, 2 bad input."""
    try:
        serve.main(arguments, prog_name="matphys-serve", standalone_mode=False)
        return DONE
    except (click.Abort, KeyboardInterrupt):
        return 130
    except click.ClickException as error:
        return _fail(error.format_message())
    except InputError as error:
        return _fail(str(error))


def _fail(message: str) -> int:
    click.echo(f"matphys-serve: {' '.join(message.split())}", err=True)
    return BAD_INPUT


if __name__ == "__main__":
    sys.exit(main())
