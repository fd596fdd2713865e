"""`matphys export`: a twin in the format of another program."""

from pathlib import Path

import click

from model.commands.common import InputFile, OutputFile, print_json, warn
from model.doubts import collect_doubts
from model.errors import InputError


@click.command(short_help="Write a twin for another program.")
@click.argument("twin", type=InputFile)
@click.option(
    "--to", "target", required=True, metavar="FORMAT", help="mujoco, newton, usd, ply, glb or phystwin."
)
@click.option(
    "--out", type=OutputFile, required=True, metavar="PATH", help="A file or folder, as the format has it."
)
@click.option(
    "--points", type=click.IntRange(min=8), metavar="N", help="Coarsen the twin to about N points before."
)
@click.option("--frames", is_flag=True, help="ply: a folder with a file per frame of the recorded motion.")
@click.option(
    "--json", "as_json", is_flag=True, help="Print the result as JSON, and nothing else, on stdout."
)
def export(twin: Path, target: str, out: Path, points: int | None, frames: bool, as_json: bool) -> None:
    """Write TWIN in the format of another program."""
    if out.resolve() == twin.resolve():
        raise InputError(f"{out} is the input: give the output another name")
    from model.bundle import TwinBundle
    from model.exports import exporter_of
    from model.exports.coarsen import coarsen
    from model.exports.ply import PlyExporter

    exporter, bundle = exporter_of(target, every_frame=frames), TwinBundle.load(twin)
    if points is not None and target == PlyExporter.name and not frames:
        raise InputError("--points: a PLY at rest has none of the mass points: add --frames, or leave it out")
    with collect_doubts() as doubts:
        coarse = None if points is None else coarsen(bundle, points)
        written = [str(path) for path in exporter(bundle if coarse is None else coarse.twin, out)]
    if as_json:
        deviation = {} if coarse is None else {"coarsening": dict(coarse.deviation)}
        print_json({"format": target, "files": written} | deviation)
    else:
        said = [] if coarse is None else [coarse.statement]
        click.echo("\n".join([*said, *(f"wrote {path}" for path in written)]))
    warn([*exporter.losses(bundle), *doubts])
