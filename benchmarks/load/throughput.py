"""How many jobs a minute so many workers do: two fronts, one Redis, moto's S3 server.

    python benchmarks/load/throughput.py [--workers 1 2 3 6] [--jobs 60] [--seconds 0.5]

Jobs are naps (`nap.py`): each sleeps so many seconds, reads an uploaded input and publishes it again, so
what is measured is the service and not how many cores this machine has. `per job` is the time from the
first submission to the last end, times the workers, per job.
"""

import argparse
import json
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx
from cluster import Cluster, cluster

LATEST_S = 600.0
SUBMITTERS = 4


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2, 3, 6])
    parser.add_argument("--jobs", type=int, default=60)
    parser.add_argument("--seconds", type=float, default=0.5, help="that each job sleeps")
    parser.add_argument("--fronts", type=int, default=2)
    options = parser.parse_args()
    print(f"{options.jobs} jobs of {options.seconds} s, {options.fronts} fronts")
    print(f"{'workers':>8}{'s':>8}{'jobs/min':>10}{'per job s':>11}{'jobs of each worker':>22}")
    for workers in options.workers:
        with (
            tempfile.TemporaryDirectory(prefix="matphys-load-") as folder,
            cluster(Path(folder), options.fronts, workers, naps=True) as it,
        ):
            seconds = _run(it, options.jobs, options.seconds)
            shares = "/".join(map(str, it.jobs_per_worker()))
            per_minute, per_job = 60 * options.jobs / seconds, seconds * workers / options.jobs
            print(f"{workers:>8}{seconds:>8.1f}{per_minute:>10.0f}{per_job:>11.2f}{shares:>22}", flush=True)


def _run(it: Cluster, jobs: int, seconds: float) -> float:
    """Submit them to the fronts in turn, a few at a time; seconds until the last has ended."""
    started = time.monotonic()
    with (
        httpx.Client(headers={"Authorization": f"Bearer {it.key}"}, timeout=60) as http,
        ThreadPoolExecutor(SUBMITTERS) as pool,
    ):

        def submit(number: int) -> None:
            note = json.dumps({"intrinsics": [[number, 0, 0], [0, number, 0], [0, 0, 1]]})
            http.post(
                f"{it.fronts[number % len(it.fronts)].url}/naps",
                files={"note": ("note.json", note)},
                data={"seconds": str(seconds)},
            ).raise_for_status()

        list(pool.map(submit, range(1, jobs + 1)))
    while sum(it.jobs_per_worker()) < jobs:
        if time.monotonic() - started > LATEST_S:
            raise TimeoutError("not all jobs ended")
        time.sleep(0.02)
    return time.monotonic() - started


if __name__ == "__main__":
    main()
