"""`matphys scenes`: a folder of generated cases."""

from pathlib import Path

import click

from model.commands.common import print_json, warn
from model.doubts import collect_doubts
from model.progress import progress

KINDS = ("plush", "cloth", "rope", "foam", "bag", "mixed")


@click.command()
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
@click.option("--workers", type=click.IntRange(1, 64), default=2, show_default=True, help="Processes.")
@click.option("--json", "as_json", is_flag=True, help="Print the index as JSON, and nothing else, on stdout.")
@click.option("--quiet", is_flag=True, help="No progress.")
def scenes(
    folder: Path,
    count: int,
    seed: int,
    first: int,
    kinds: tuple[str, ...],
    video: bool,
    workers: int,
    as_json: bool,
    quiet: bool,
) -> None:
    """Make objects of the procedural world, each in several interactions, into the empty folder FOLDER.

    Equal seeds give equal files, whatever the number of processes. The format is in docs/scenes.md.
    """
    from model.scenes.generate import generate
    from model.scenes.world.shapes import CLASSES

    classes = tuple(kind for kind in CLASSES if kind in kinds) if kinds else CLASSES
    with collect_doubts() as doubts, progress(quiet) as report:
        index = generate(
            folder, count, seed, workers=workers, classes=classes, first=first, films=video, report=report
        )
    warn(doubts)
    if as_json:
        print_json(index.model_dump(by_alias=True))
    elif not quiet:
        things = len({entry.object_name for entry in index.cases})
        click.echo(f"wrote {len(index.cases)} cases of {things} objects to {folder}")
