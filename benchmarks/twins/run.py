"""Turn every real clip into a twin, as a user would, and print what it cost and how well it fits.

    python benchmarks/twins/run.py [CLIP ...] [--out DIR] [--repeat] [--predictor NAME]

Each clip is one `matphys twin` process without any option but the predictor. Peak memory is the process's own
maximum resident set. `--repeat` runs each clip twice and compares the bundles' bytes.
"""

import argparse
import hashlib
import json
import os
import subprocess
import sys
import time
import zipfile
from pathlib import Path

BAR_SECONDS, BAR_GIB, BAR_KEYFRAME = 90, 4, 0.90


def data_folder() -> Path:
    """Where the real clips are, or exit with one line that says they are absent."""
    default = Path(__file__).resolve().parents[2] / ".." / "shared" / "data"
    folder = Path(os.environ.get("MATPHYS_DATA", default)) / "videos"
    if not folder.is_dir():
        sys.exit(f"no real clips at {folder}: set MATPHYS_DATA to the folder that holds videos/")
    return folder


def run_clip(clip: Path, bundle: Path, preview: Path | None, predictor: str) -> dict:
    """Run `matphys twin` on one clip; return its JSON result with wall seconds and peak GiB added."""
    matphys = Path(sys.executable).parent / "matphys"
    command = [str(matphys), "twin", str(clip), "--out", str(bundle), "--json", "--quiet"]
    command += ["--predictor", predictor]
    if preview is not None:
        command += ["--preview", str(preview)]
    started = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    out, err = process.stdout.read(), process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        sys.exit(f"{clip.name}: exit {process.returncode}: {err.strip()}")
    return json.loads(out) | {"wall_s": time.perf_counter() - started, "peak_gib": usage.ru_maxrss / 2**20}


def member_hashes(bundle: Path) -> dict[str, str]:
    """sha256 of every member, `created` left out of the manifest."""
    hashes = {}
    with zipfile.ZipFile(bundle) as archive:
        for name in archive.namelist():
            content = archive.read(name)
            if name == "twin.json":
                manifest = json.loads(content)
                manifest.pop("created")
                content = json.dumps(manifest).encode()
            hashes[name] = hashlib.sha256(content).hexdigest()
    return hashes


def main() -> None:
    """Print two Markdown tables: fit and cost per clip, and seconds per stage."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clips", nargs="*", help="names without .mp4; default: all")
    parser.add_argument("--out", type=Path, default=Path("out/twins"))
    parser.add_argument("--repeat", action="store_true")
    parser.add_argument("--predictor", default="matphys", help="as of `matphys twin`")
    arguments = parser.parse_args()
    wanted = set(arguments.clips)
    clips = [clip for clip in sorted(data_folder().glob("*.mp4")) if not wanted or clip.stem in wanted]
    arguments.out.mkdir(parents=True, exist_ok=True)
    results = {}
    columns = ("clip", "keyframe IoU", "replay IoU, mean", "first–last third", "points / springs")
    columns += ("substeps", "s", "peak GiB", "same bytes")
    print("| " + " | ".join(columns) + " |")
    print("|---" * len(columns) + "|")
    for clip in clips:
        bundle = arguments.out / f"{clip.stem}.twin.zip"
        result = results[clip.stem] = run_clip(
            clip, bundle, arguments.out / f"{clip.stem}.preview.mp4", arguments.predictor
        )
        same = "–"
        if arguments.repeat:
            again = arguments.out / f"{clip.stem}.again.twin.zip"
            run_clip(clip, again, None, arguments.predictor)
            same = "yes" if member_hashes(bundle) == member_hashes(again) else "NO"
            again.unlink()
        m = result["metrics"]
        series = [value for value in m["silhouette_iou_per_frame"] if value is not None]
        third = max(len(series) // 3, 1)
        print(
            f"| {clip.stem} | {m['keyframe_iou']:.3f} | {m['silhouette_iou']:.3f} | "
            f"{sum(series[:third]) / third:.3f} – {sum(series[-third:]) / third:.3f} | "
            f"{m['points']} / {m['springs']} | {m['substeps']} | "
            f"{result['wall_s']:.0f} | {result['peak_gib']:.2f} | {same} |",
            flush=True,
        )
        bars = {"seconds": (result["wall_s"], BAR_SECONDS), "GiB": (result["peak_gib"], BAR_GIB)}
        for unit, (value, limit) in bars.items():
            if value > limit:
                print(f"<!-- {clip.stem}: {value:.1f} {unit} is over the bar of {limit} -->")
    stages = list(next(iter(results.values()))["seconds"])
    print("\nSeconds per stage:\n")
    print("| clip | " + " | ".join(stages) + " |")
    print("|---" * (len(stages) + 1) + "|")
    for name, result in results.items():
        seconds = [f"{result['seconds'].get(stage, 0):.1f}" for stage in stages]
        print(f"| {name} | " + " | ".join(seconds) + " |")
    for name, result in results.items():
        for warning in result["warnings"]:
            print(f"\n{name}: {warning}")


if __name__ == "__main__":
    main()
