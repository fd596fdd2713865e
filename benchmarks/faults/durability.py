"""What it costs to have an accepted job on disk: time of one acceptance by the sync policy of Redis.

    python benchmarks/faults/durability.py [--url redis://...] [--jobs 300]

Without --url, the embedded Redis. Policies take turns, job by job, so that what else the machine does hits
all alike. `everysec` loses nothing when Redis is killed, and up to a second when the power fails;
`everysec + WAITAOF` (Redis 7.2) and `always` lose nothing.
"""

import argparse
import statistics
import sys
import tempfile
import time
from pathlib import Path

import redis.exceptions
from redis import Redis

from worker.embedded import EmbeddedRedis
from worker.queues import connect
from worker.record import JobRecord, new_id
from worker.records import Records


def accept(records: Records) -> None:
    """One job."""
    job = JobRecord(id=new_id(), kind="errand", queue="twins", tenant="a", digest=new_id())
    records.create(job, most_queued=10**9, most_active=10**9)


def measure(client: Redis, jobs: int) -> dict[str, list[float]]:
    """Seconds of every acceptance, by policy."""
    waiting, plain = Records(client), Records(client)
    plain._run._tells = False
    policies = {"everysec": (plain, "everysec"), "always": (plain, "always")}
    try:
        client.waitaof(0, 0, 0)
        policies["everysec + WAITAOF"] = (waiting, "everysec")
    except redis.exceptions.ResponseError:
        print("this Redis has no WAITAOF")
    seconds: dict[str, list[float]] = {name: [] for name in policies}
    for _ in range(jobs):
        for name, (records, policy) in policies.items():
            client.config_set("appendfsync", policy)
            began = time.perf_counter()
            accept(records)
            seconds[name].append(time.perf_counter() - began)
    return seconds


def main() -> int:
    """Measure and print."""
    arguments = argparse.ArgumentParser(description="Cost of durable acceptance.")
    arguments.add_argument("--url", default="")
    arguments.add_argument("--jobs", type=int, default=300)
    given = arguments.parse_args()
    with (
        EmbeddedRedis(Path(tempfile.mkdtemp()) / "redis") as server,
        connect(given.url or server.url) as client,
    ):
        print(f"Redis {client.info('server')['redis_version']}, {given.jobs} acceptances each")
        print(f"{'policy':<22}{'median ms':>10}{'p99 ms':>9}")
        for name, seconds in measure(client, given.jobs).items():
            p99 = statistics.quantiles(seconds, n=100)[98]
            print(f"{name:<22}{1e3 * statistics.median(seconds):>10.2f}{1e3 * p99:>9.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
