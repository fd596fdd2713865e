import asyncio

import pytest

from service.turns import Turns


def served(turns: Turns, tenants: str) -> list[str]:
    """In which order tenants, who ask in this one, have had their turns; no more than two ran at once."""
    ended: list[str] = []
    running = 0

    async def one(tenant: str) -> None:
        nonlocal running
        async with turns.turn(tenant, 5.0):
            running += 1
            assert running <= 2
            await asyncio.sleep(0.002)
            running -= 1
            ended.append(tenant)

    async def run() -> None:
        async with asyncio.TaskGroup() as group:
            for tenant in tenants:
                group.create_task(one(tenant))

    asyncio.run(run())
    return ended


def test_a_tenant_alone_has_all_turns():
    assert served(Turns(2), "aaaa") == list("aaaa")


def test_who_asks_for_much_keeps_no_other_waiting():
    assert served(Turns(2), "aaaaaaaabc")[2:5] == ["a", "b", "c"]


def test_who_waits_for_too_long_is_told_and_blocks_nobody():
    turns = Turns(1)

    async def run() -> None:
        async with turns.turn("a", 1.0):
            with pytest.raises(TimeoutError):
                async with turns.turn("b", 0.001):
                    pass
        async with turns.turn("c", 0.1):
            pass

    asyncio.run(run())
    assert served(turns, "ab") == ["a", "b"]


def test_a_turn_of_who_has_gone_is_passed_on():
    turns = Turns(1)

    async def run() -> None:
        async with turns.turn("a", 1.0):
            waiting = asyncio.create_task(_hold(turns, "b"))
            await asyncio.sleep(0)
        waiting.cancel()  # its turn has come, and it does not know yet
        with pytest.raises(asyncio.CancelledError):
            await waiting
        async with turns.turn("c", 0.1):
            pass

    asyncio.run(run())


async def _hold(turns: Turns, tenant: str) -> None:
    async with turns.turn(tenant, 1.0):
        await asyncio.sleep(10)
