"""Connections that wait for a request: not for ever."""

import asyncio

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

HEAD_SECONDS = 15.0
"""How long the head of a request may take to arrive [s], from the connection or from its first byte; and the
rest of a body that has been answered already."""


class PromptProtocol(H11Protocol):
    """Hangs up on who connects and does not ask, or asks byte by byte.

    uvicorn bounds the pause between two requests alone, so anybody without a key could hold connections, each
    a file descriptor, for as long as they like. Bodies have a bound of their own (`service.uploads`).
    """

    _patience: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to wait."""
        super().connection_made(transport)
        self._wait()

    def data_received(self, data: bytes) -> None:
        """Wait on when this was a part of a head, or of what nobody wants any more."""
        super().data_received(data)
        if self._nobody_listens():
            self._wait()
        else:
            self._wait_no_more()

    def connection_lost(self, exc: Exception | None) -> None:
        """There is nothing to wait for."""
        self._wait_no_more()
        super().connection_lost(exc)

    def _wait(self) -> None:
        if self._patience is None:
            self._patience = self.loop.call_later(HEAD_SECONDS, self._hang_up)

    def _wait_no_more(self) -> None:
        if self._patience is not None:
            self._patience.cancel()
            self._patience = None

    def _hang_up(self) -> None:
        self._patience = None
        if self._nobody_listens():
            self.transport.close()

    def _nobody_listens(self) -> bool:
        """Whether there is no request yet, or an answer to it before all of its body has come."""
        theirs = self.conn.their_state
        return theirs is h11.IDLE or (theirs is h11.SEND_BODY and self.conn.our_state is h11.DONE)
