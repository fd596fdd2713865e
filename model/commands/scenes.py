"""`matphys scenes`: a folder of cases, generated or recorded."""

from pathlib import Path

import click
from click.core import ParameterSource

from model.commands.common import print_json, warn
from model.doubts import collect_doubts
from model.progress import progress

KINDS = ("plush", "cloth", "rope", "foam", "bag", "mixed")
COMMANDLINE = ParameterSource.COMMANDLINE
GENERATED = ("count", "seed", "first", "kinds", "video", "workers")
"""Options that say how objects are made."""


@click.command(short_help="Make objects of known stuff, in several interactions.")
@click.argument("folder", type=click.Path(file_okay=False, path_type=Path))
@click.option(
    "--count", type=click.IntRange(min=1), default=24, show_default=True, help="Objects; 3 or 4 cases each."
)
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Of the world.")
@click.option(
    "--first", type=click.IntRange(min=0), default=0, show_default=True, help="Number of the first object."
)
@click.option(
    "--class", "kinds", type=click.Choice(KINDS), multiple=True, help="Only this one; may be repeated."
)
@click.option("--video", is_flag=True, help="Also film every case (half a minute each): FOLDER/films/CASE.")
@click.option(
    "--phystwin",
    "recordings",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    multiple=True,
    help="Make none: take this recorded case, in PhysTwin's format; may be repeated.",
)
@click.option("--workers", type=click.IntRange(1, 64), default=2, show_default=True, help="Processes.")
@click.option("--json", "as_json", is_flag=True, help="Print the index as JSON, and nothing else, on stdout.")
@click.option("--quiet", is_flag=True, help="No progress.")
@click.pass_context
def scenes(
    context: click.Context,
    folder: Path,
    count: int,
    seed: int,
    first: int,
    kinds: tuple[str, ...],
    video: bool,
    recordings: tuple[Path, ...],
    workers: int,
    as_json: bool,
    quiet: bool,
) -> None:
    """Make objects of the procedural world, each in several interactions, into the empty folder FOLDER.

    Equal seeds give equal files, whatever the number of processes. With --phystwin nothing is made: FOLDER
    gets the recorded cases, for `fit` and `evaluate`. The format is in docs/scenes.md.
    """
    with collect_doubts() as doubts, progress(quiet) as report:
        if recordings:
            given = (name for name in GENERATED if context.get_parameter_source(name) is COMMANDLINE)
            for name in given:
                option = "--class" if name == "kinds" else f"--{name}"
                raise click.UsageError(f"{option} is of objects that are made: not together with --phystwin")
            from model.scenes.recorded import gather

            index = gather(folder, recordings, report)
        else:
            from model.scenes.generate import generate
            from model.scenes.world.shapes import CLASSES

            classes = tuple(kind for kind in CLASSES if kind in kinds) if kinds else CLASSES
            index = generate(
                folder, count, seed, workers=workers, classes=classes, first=first, films=video, report=report
            )
    warn(doubts)
    if as_json:
        print_json(index.model_dump(by_alias=True))
    elif not quiet:
        things = len({entry.object_name for entry in index.cases})
        click.echo(f"wrote {len(index.cases)} cases of {things} objects to {folder}")
