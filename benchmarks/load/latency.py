"""How long submissions and looks at a job take while workers are busy, and how much memory the fronts hold.

    python benchmarks/load/latency.py [--fronts 1] [--workers 2] [--seconds 20] [--clip CLIP]

`matphys-serve` and `matphys-worker` as they are, on one Redis and moto's S3 server or a folder. wrk
(needed on the PATH) submits a clip of 1 MB in raw bodies, then asks how jobs stand, then both at once;
what is submitted keeps the workers busy with real twins all the while. wrk waits for an answer before it
asks again, so the figures hold for so many clients at a time, not for a rate of arrival. `cpu ms` is
processor time of the front for each answer, and after the plus that of the processes that look into the
uploads; unlike the times it depends little on what else the machine does.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import httpx
from cluster import Cluster, Process, cluster

HERE = Path(__file__).parent
MEGABYTE = 1_000_000


@dataclass(frozen=True)
class Request:
    """What wrk asks."""

    name: str
    script: str
    connections: int


POST, GET = Request("submit 1 MB", "post.lua", 4), Request("status", "get.lua", 16)


def main() -> None:
    """Measure and print."""
    options = _options()
    if shutil.which("wrk") is None:
        sys.exit("wrk is not on the PATH: apt-get install wrk")
    with tempfile.TemporaryDirectory(prefix="matphys-load-") as folder:
        clip = _clip(Path(folder), options.clip)
        with cluster(Path(folder), options.fronts, options.workers, naps=False, s3=not options.file) as it:
            store = "a folder" if options.file else "moto's S3"
            print(f"{options.fronts} front(s), {options.workers} worker(s), {os.cpu_count()} cores, {store}")
            for front in it.fronts:
                own, _ = front.cpu_s
                loaded = "with torch" if front.maps_torch else "without torch"
                print(
                    f"a front answered after {front.started_s:.2f} s ({own:.2f} s of a processor), {loaded}"
                )
            _measure(it, clip, options.seconds)
            _memory(it)


def _measure(it: Cluster, clip: Path, seconds: int) -> None:
    first = [_submit(it, clip, bytes([number])) for number in range(8)]
    base = {"KEY": it.key, "CLIP": str(clip), "URLS": " ".join(f"/twins/{job}" for job in first)}
    titles = ("connections", "per s", "p50 ms", "p90 ms", "p99 ms", "max ms", "cpu ms")
    print(f"\n{'what':<20}" + "".join(f"{title:>12}" for title in titles))
    for together in ((POST,), (GET,), (POST, GET)):
        before = [front.cpu_s for front in it.fronts]
        running = [(what, _start(front, what, seconds, base)) for what in together for front in it.fronts]
        rows = [(what, _result(what, wrk)) for what, wrk in running]
        spent = _spent(it, before, sum(row["ok"] for _, row in rows)) if len(together) == 1 else "-"
        for what, row in rows:
            _print(what.name + (", both" if len(together) > 1 else ""), what.connections, row, spent)
        _busy(it)


def _spent(it: Cluster, before: list[tuple[float, float]], answers: float) -> str:
    """Processor time for each answer [ms]: of the fronts, and of what they started."""
    after = [front.cpu_s for front in it.fronts]
    own, theirs = (sum(a[i] - b[i] for a, b in zip(after, before, strict=True)) for i in (0, 1))
    return f"{1e3 * own / answers:.1f} + {1e3 * theirs / answers:.0f}"


def _print(name: str, connections: int, row: Mapping[str, float], spent: str) -> None:
    cells = [str(connections), f"{row['ok'] / row['seconds']:.1f}"]
    cells += [f"{row[each]:.0f}" for each in ("p50", "p90", "p99", "max")]
    turned_away = f"  {row['busy']:.0f} turned away" if row["busy"] else ""
    print(f"{name:<20}" + "".join(f"{cell:>12}" for cell in (*cells, spent)) + turned_away, flush=True)


def _start(
    front: Process, what: Request, seconds: int, environment: Mapping[str, str]
) -> subprocess.Popen[str]:
    command = ["wrk", "-t", "1", "-c", str(what.connections), "-d", f"{seconds}s", "--timeout", "60s"]
    command += ["-s", str(HERE / what.script), front.url]
    return subprocess.Popen(
        command,
        env={**os.environ, **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def _result(what: Request, wrk: subprocess.Popen[str]) -> dict[str, float]:
    output = wrk.communicate()[0]
    found = [line for line in output.splitlines() if line.startswith("RESULT ")]
    if not found:
        sys.exit(f"wrk failed: {output}")
    row: dict[str, float] = json.loads(found[0].removeprefix("RESULT "))
    if row["wrong"] or not row["ok"]:
        sys.exit(f"{what.name}: {row['ok']:.0f} answers were right, {row['wrong']:.0f} wrong")
    return row


def _submit(it: Cluster, clip: Path, mark: bytes) -> str:
    content = clip.read_bytes() + b"\0\0\0\x09free" + mark
    headers = {"Authorization": f"Bearer {it.key}", "Content-Type": "video/mp4"}
    answer = httpx.post(f"{it.fronts[0].url}/twins", content=content, headers=headers, timeout=30)
    answer.raise_for_status()
    return str(answer.json()["id"])


def _busy(it: Cluster) -> None:
    states = [worker.state for worker in it.queues.workers()]
    if states.count("busy") < len(it.workers):
        print(f"  (workers were not all busy: {', '.join(states)})")


def _memory(it: Cluster) -> None:
    for number, front in enumerate(it.fronts, 1):
        now, most = front.memory_mb
        print(f"front {number}: resident {now:.0f} MB, at most {most:.0f} MB")
    waiting = it.queues.depth()["twins"]
    print(f"jobs that wait now: {waiting}")


def _clip(folder: Path, given: Path | None) -> Path:
    """The clip, filled up to 1 MB with a box that players skip."""
    if given is None:
        given = folder / "film.mp4"
        subprocess.run(
            [sys.executable, "-m", "model.scenes.demo", str(given)], check=True, stdout=subprocess.DEVNULL
        )
    content = given.read_bytes()
    room = MEGABYTE - len(content)
    if room >= 8:
        content += room.to_bytes(4, "big") + b"free" + os.urandom(room - 8)
    clip = folder / "clip.mp4"
    clip.write_bytes(content)
    return clip


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--fronts", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seconds", type=int, default=20, help="of each measurement")
    parser.add_argument("--clip", type=Path, help="an MP4; the demo's otherwise")
    parser.add_argument("--file", action="store_true", help="a folder as the store, not an S3 server")
    return parser.parse_args()


if __name__ == "__main__":
    main()
