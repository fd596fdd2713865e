"""Turns at something scarce: whoever waits is served one tenant after the other, however much each wants."""

import asyncio
from collections import deque
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager


class Turns:
    """A few turns at a time; those who wait take theirs tenant by tenant.

    A tenant alone may have all of them. Another one waits for one to end, not for all that was asked before.

    Args:
        parallel: How many at the same time.
    """

    def __init__(self, parallel: int) -> None:
        """All are free."""
        self._free = parallel
        self._waiting: dict[str, deque[asyncio.Future[None]]] = {}
        """The next tenant first; those who have none waiting are not there."""

    @asynccontextmanager
    async def turn(self, tenant: str, patience: float) -> AsyncIterator[None]:
        """One turn, for as long as the block takes.

        Args:
            tenant: Whose turn it is.
            patience: How long it is waited for [s].

        Raises:
            TimeoutError: none came in time.
        """
        await self._take(tenant, patience)
        try:
            yield
        finally:
            self._pass_on()

    async def _take(self, tenant: str, patience: float) -> None:
        if self._free:
            self._free -= 1
            return
        mine = asyncio.get_running_loop().create_future()
        self._waiting.setdefault(tenant, deque()).append(mine)
        try:
            async with asyncio.timeout(patience):
                await mine
        except BaseException:
            if mine.done() and not mine.cancelled():  # it came just now, and nobody will use it
                self._pass_on()
            raise

    def _pass_on(self) -> None:
        while self._waiting:
            tenant = next(iter(self._waiting))
            line = self._waiting.pop(tenant)
            following = line.popleft()
            if line:
                self._waiting[tenant] = line  # behind all others
            if not following.done():
                following.set_result(None)
                return
        self._free += 1
