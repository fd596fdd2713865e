"""`matphys view`: a twin to play with, in a browser."""

import contextlib
from pathlib import Path

import click

from model.commands.common import InputFile, default_to_one_thread, warn
from model.doubts import collect_doubts


@click.command(short_help="Play with a twin in a browser.")
@click.argument("twin", type=InputFile)
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen on.")
@click.option("--port", type=click.IntRange(1, 65535), default=8080, show_default=True, help="The same.")
@click.option("--compare", is_flag=True, help="Beside it the same twin without the effects that it carries.")
@click.option(
    "--report",
    type=click.Path(exists=True, path_type=Path),
    metavar="JSON",
    help="report.json of a diagnosis, or its folder, to colour by.",
)
@click.option(
    "--observation",
    type=InputFile,
    metavar="NPZ",
    help="What the report is about, where its points are not the twin's.",
)
def view(
    twin: Path, host: str, port: int, compare: bool, report: Path | None, observation: Path | None
) -> None:
    """Play with TWIN in a browser: pull at it, change what acts on it, keep what came of it."""
    from model.playground.browser.server import open_playground

    default_to_one_thread()
    with collect_doubts() as doubts:
        playground = open_playground(twin, host, port, compare, report, observation)
    warn(doubts)
    with contextlib.suppress(KeyboardInterrupt), contextlib.closing(playground):
        click.echo(f"{playground.url} (end with Ctrl-C)")
        playground.run()
