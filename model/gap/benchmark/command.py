"""`matphys gap-benchmark`; nothing heavy is imported before it runs."""

import json
import shlex
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from model.progress import progress


@click.command("gap-benchmark", short_help="Score diagnoses of worlds whose labels are sealed.")
@click.argument("worlds", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    required=True,
    metavar="DIR",
    help="Where diagnoses and predictions.json go; what this version has done is not done again.",
)
@click.option(
    "--docs",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="PAGE.md",
    help="Also write a section of this page.",
)
@click.option("--title", default="Worlds", show_default=True, help="Heading of that section.")
@click.option("--workers", type=click.IntRange(1, 64), default=2, show_default=True, help="Processes.")
@click.option(
    "--json", "as_json", is_flag=True, help="Print the scores as JSON, and nothing else, on stdout."
)
@click.option("--quiet", is_flag=True, help="No progress, no warnings, no table.")
def gap_benchmark(
    worlds: Path, out: Path, docs: Path | None, title: str, workers: int, as_json: bool, quiet: bool
) -> None:
    """Diagnose every world in the folder WORLDS, then open its labels and score.

    A world is NAME.npz, with NAME.transfer.npz for another interaction; labels are labels.json or
    labels.sealed. Sealed ones are opened once all predictions are written and hashed.
    """
    from model.formats.files import check_writable
    from model.formats.page import check_section, write_section
    from model.gap.benchmark.check import benchmark
    from model.gap.benchmark.document import COMMAND, HEAD, printed, section
    from model.gap.benchmark.predict import PREDICTIONS
    from model.gap.diagnose import diagnose

    check_writable(out / PREDICTIONS)
    if docs is not None:
        check_section(docs, COMMAND, title)
    options = ["--out", str(out), "--title", title, "--workers", str(workers)]
    options += [] if docs is None else ["--docs", str(docs)]
    command = shlex.join(["matphys", COMMAND, str(worlds), *options])
    with progress(quiet) as report:
        done = benchmark(
            worlds, out, diagnose, workers=workers, title=title, command=command, progress=report
        )
    if not quiet:
        for name, why in done.refused.items():
            click.echo(f"warning: {name}: {why}", err=True)
    if docs is not None:
        write_section(docs, section(done.run, done.table, done.worlds), HEAD)
    if as_json:
        content: Mapping[str, Any] = {"run": asdict(done.run), **asdict(done.table)}
        click.echo(json.dumps(content, ensure_ascii=False, indent=1, allow_nan=False))
    elif not quiet:
        click.echo(printed(done.run, done.table))
