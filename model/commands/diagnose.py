"""`matphys diagnose`: what a twin lacks, by what really moved."""

from pathlib import Path

import click

from model.commands.common import (
    InputFile,
    OutputFile,
    check_outputs,
    default_to_one_thread,
    print_json,
    warn,
)
from model.doubts import collect_doubts
from model.errors import InputError
from model.progress import progress


@click.command(short_help="Say what a twin lacks, by what really moved.")
@click.argument("observation", type=InputFile)
@click.option(
    "--twin", type=InputFile, metavar="TWIN", help="The twin to question; without one, one is made."
)
@click.option(
    "--transfer",
    type=InputFile,
    metavar="OTHER.npz",
    help="A second interaction with the object, to confirm.",
)
@click.option(
    "--out", type=OutputFile, required=True, metavar="DIR", help="report.json, report.html and figures."
)
@click.option(
    "--save-twin",
    type=OutputFile,
    metavar="NAME.twin.zip",
    help="The twin with what the diagnosis adds to it.",
)
@click.option(
    "--json", "as_json", is_flag=True, help="Print the result as JSON, and nothing else, on stdout."
)
@click.option("--quiet", is_flag=True, help="No progress, no warnings.")
def diagnose(
    observation: Path,
    twin: Path | None,
    transfer: Path | None,
    out: Path,
    save_twin: Path | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Say where a twin departs from OBSERVATION, which effect it lacks, and how far the gap shrinks.

    OBSERVATION is what really moved: a .npz that `matphys observe` made of a clip and its twin or of a
    PhysTwin case, or one of your own with `times` [T], `points` [T, N, 3] and `controllers` [T, C, 3], in
    metres.
    """
    for given in (observation, transfer):
        if given is not None and given.suffix.lower() != ".npz":
            raise InputError(
                f"{given}: expected an observation, a .npz: `matphys observe` makes one of a clip"
            )
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file: give a folder for the report")
    from model.gap.report.write import report_files

    check_outputs((observation, transfer), *report_files(out), save_twin)
    if save_twin is not None and twin is not None and save_twin.resolve() == twin.resolve():
        raise InputError(f"{save_twin} is the twin that is questioned: give the output another name")
    from model.pipeline import diagnose as run

    default_to_one_thread()
    with progress(quiet) as report, collect_doubts() as doubts:
        result = run(observation, twin, transfer, report)
        written = [str(path) for path in result.write_report(out)]
        saved = None if save_twin is None else result.twin()
        if saved is not None and save_twin is not None:
            saved.save(save_twin)
            written.append(str(save_twin))
    if save_twin is not None and not result.diagnosis.effects:
        doubts.append(f"{save_twin} was not written: the verdict names no effect that a twin could carry")
    verdict = result.report.verdict
    if as_json:
        print_json(
            {
                "verdict": verdict.model_dump(mode="json"),
                "gap": result.report.gap.model_dump(mode="json"),
                "files": written,
                "warnings": list(dict.fromkeys([*result.report.warnings, *doubts])),
            }
        )
    elif not quiet:
        click.echo(verdict.statement)
        click.echo("\n".join(f"wrote {path}" for path in written))
    if not quiet:
        warn([*result.report.warnings, *doubts])
