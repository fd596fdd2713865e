"""How soon a front answers, and what that costs: `python benchmarks/front/start.py`."""

import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import httpx

from worker.embedded import EmbeddedRedis

STARTS = 7


def start(folder: Path, redis_url: str) -> tuple[float, float, float]:
    """Seconds by the clock until /livez answers, seconds of a processor, peak MB."""
    began = time.perf_counter()
    front = subprocess.Popen(
        [sys.executable, "-m", "service.main", "--port", "0", "--data-dir", str(folder)],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=os.environ | {"REDIS_URL": redis_url},
    )
    assert front.stdout is not None
    with front.stdout as lines:
        address = next(found[1] for line in lines if (found := re.search(r"is at (\S+)", line)))
        httpx.get(f"{address}/livez").raise_for_status()
        clock = time.perf_counter() - began
        fields = Path(f"/proc/{front.pid}/stat").read_text().rpartition(")")[2].split()
        peak = re.search(r"VmHWM:\s+(\d+)", Path(f"/proc/{front.pid}/status").read_text())
        assert peak is not None
        front.terminate()
        front.wait()
    return clock, (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK"), int(peak[1]) / 1024


def main() -> None:
    """Print the medians, and how busy the machine was."""
    with tempfile.TemporaryDirectory() as folder, EmbeddedRedis(Path(folder) / "redis") as redis:
        runs = [start(Path(folder) / "data", redis.url) for _ in range(STARTS)]
    clock, processor, peak = (statistics.median(column) for column in zip(*runs, strict=True))
    print(f"load of the machine before: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    print(f"first answer after {clock:.2f} s ({min(run[0] for run in runs):.2f} s at best)")
    print(f"processor {processor:.2f} s, peak {peak:.0f} MB")


if __name__ == "__main__":
    main()
