"""Health check of a worker's container: whether a worker of this machine was heard of lately.

Exits 0 when one was. Needs `REDIS_URL`.
"""

import os
import sys

from redis.exceptions import RedisError

from worker.queues import Queues, connect
from worker.records import Records

PATIENCE_S = 2.0


def alive(redis_url: str, machine: str) -> bool:
    """Whether Redis knows a live worker of the machine."""
    client = connect(redis_url, PATIENCE_S)
    try:
        workers = Queues(client, Records(client)).workers()
    except RedisError:
        return False
    return any(worker.name.startswith(f"{machine}-") for worker in workers)


if __name__ == "__main__":
    sys.exit(0 if alive(os.environ["REDIS_URL"], os.uname().nodename.partition(".")[0]) else 1)
