"""Serves a playground to browsers until it is told to stop."""

import contextlib
import importlib.util
import io
import socket
import threading
from pathlib import Path
from typing import TYPE_CHECKING

from model.bundle import TwinBundle
from model.errors import InputError
from model.playground.browser.panel import Panel
from model.playground.browser.scene import Scene
from model.playground.colors import Colors
from model.playground.movie import Recording
from model.playground.report import read_where
from model.playground.session import Session

if TYPE_CHECKING:
    import viser

PICTURES = 30.0
"""Pictures a second that a browser is sent, at most."""
INSTALL = "matphys view needs viser: pip install 'viser>=1.1'"


class Playground:
    """A session in a browser: one thread simulates, one sends what there is to see, viser's hear the user.

    Args:
        session: What moves.
        colors: Of its Gaussians.
        name: Of the twin.
        host: Address to listen on.
        port: The same.

    Raises:
        InputError: the port is taken.
    """

    def __init__(self, session: Session, colors: Colors, name: Path, host: str, port: int) -> None:
        """Start listening."""
        self.session, self.server = session, _serve(host, port)
        shown = "localhost" if host in ("0.0.0.0", "::") else host
        self.url = f"http://{shown if ':' not in shown else f'[{shown}]'}:{port}"
        self._stop = threading.Event()
        self._failure: BaseException | None = None
        self._open = True
        recording = Recording(session.interval)
        self.scene = Scene(self.server, session, colors)
        self._panel = Panel(self.server, session, self.scene, recording, name)
        self.recording = recording

    def run(self) -> None:
        """Simulate and send until `stop`; what goes wrong in the simulation is raised here."""
        # not a daemon: an interrupt before the join would leave one in torch, which aborts as Python ends
        mover = threading.Thread(target=self._move, name="playground")
        mover.start()
        try:
            while not self._stop.wait(1.0 / PICTURES):
                if self.server.get_clients():
                    moment = self.session.moment
                    self.scene.show(moment, self._panel.color_by)
                    self._panel.show(moment)
        finally:
            self.stop()
            mover.join()
            self.close()
        if self._failure is not None:
            raise self._failure

    def stop(self) -> None:
        """Let `run` return."""
        self._stop.set()

    def close(self) -> None:
        """Listen no longer."""
        self.stop()
        if self._open:
            self._open = False
            with contextlib.redirect_stdout(io.StringIO()):  # it says so
                self.server.stop()

    def _move(self) -> None:
        try:
            self.session.keep_going(self._stop, lambda m: self.recording.see(m, self._panel.color_by))
        except BaseException as error:
            self._failure = error
            self._stop.set()


def open_playground(
    twin: Path,
    host: str = "127.0.0.1",
    port: int = 8080,
    compare: bool = False,
    report: Path | None = None,
    observation: Path | None = None,
) -> Playground:
    """The playground of a twin's file, listening; `run` makes it move.

    Args:
        twin: The bundle.
        host: Address to listen on.
        port: The same.
        compare: Beside it stands the twin without its effects.
        report: Of a diagnosis, to colour by.
        observation: What the report is about, where its points are not the twin's.

    Raises:
        InputError: one of the files cannot be used, the port is taken, or viser is not installed.
    """
    if importlib.util.find_spec("viser") is None:
        raise InputError(INSTALL)
    if observation is not None and report is None:
        raise InputError("--observation: only with --report, which says where the gap lies")
    bundle = TwinBundle.load(twin)
    where = None if report is None else read_where(report, bundle, observation)
    return Playground(Session(bundle, compare), Colors(bundle, where), twin, host, port)


def _serve(host: str, port: int) -> "viser.ViserServer":
    """A viser server, which by itself would silently take another port."""
    import viser

    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            raise InputError(
                f"{host}:{port}: cannot listen ({error.strerror}): give another --port"
            ) from None
    with contextlib.redirect_stdout(io.StringIO()):  # it prints a table of its own
        return viser.ViserServer(host=host, port=port, label="MatPhys", verbose=False)
