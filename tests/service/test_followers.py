import asyncio
from contextlib import ExitStack

import pytest

from service.errors import ProblemError
from service.followers import MOST, MOST_OF_ONE_KEY, Followers
from service.front import Front
from service.metrics import Metrics
from service.settings import Settings

MANY = 150
"""More than the hundred that redis-py opens if nothing is said."""


def test_a_key_may_have_so_many_and_no_more():
    followers = Followers()
    with ExitStack() as streams:
        for _ in range(MOST_OF_ONE_KEY):
            followers.check("a")
            streams.enter_context(followers.one("a"))
        with pytest.raises(ProblemError) as error:
            followers.check("a")
        assert (error.value.status, "Retry-After" in error.value.headers) == (429, True)
        followers.check("b")
    followers.check("a")


def test_a_front_may_have_so_many_and_no_more():
    followers = Followers()
    with ExitStack() as streams:
        for number in range(MOST):
            streams.enter_context(followers.one(str(number)))
        with pytest.raises(ProblemError) as error:
            followers.check("another")
        assert (error.value.status, "Retry-After" in error.value.headers) == (503, True)


def test_streams_are_counted_until_they_end(serving, http, clip, monkeypatch):
    monkeypatch.setattr("service.followers.MOST_OF_ONE_KEY", 1)
    twin = http.post("/twins", content=clip, headers={"Content-Type": "video/mp4"}).json()["id"]
    url = f"/twins/{twin}/events"
    with http.stream("GET", url) as answer:
        lines = answer.iter_lines()  # kept: the stream is closed with it
        next(lines)
        with http.stream("GET", url) as second:
            assert second.status_code == 429
    http.post(f"/twins/{twin}/cancel")
    for _ in range(100):
        with http.stream("GET", url) as answer:
            if answer.status_code == 200:
                return
    raise AssertionError("a stream that has ended still counts")


def test_every_stream_has_a_connection_to_redis(redis_url, tmp_path):
    """Else those beyond the hundredth wait for one, and learn of nothing before others have ended."""
    settings = Settings(redis_url, f"file://{tmp_path}/store", tmp_path)

    async def wait_at_once():
        front = Front.open(settings, Metrics())
        waits = [front.async_redis.xread({"matphys:events:none": "0"}, block=500) for _ in range(MANY)]
        try:
            return await asyncio.gather(*waits)
        finally:
            await front.close()

    assert len(asyncio.run(wait_at_once())) == MANY
