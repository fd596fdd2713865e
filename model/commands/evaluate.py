"""`matphys evaluate`: methods against each other on a folder of cases."""

import shlex
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from model.commands.common import default_to_one_thread, print_json, warn
from model.errors import InputError
from model.progress import progress

if TYPE_CHECKING:
    from model.evaluation.records import Record
    from model.evaluation.run import Plan

SETTINGS = ("reconstruction", "future", "unseen_interaction", "unseen_object")
OPINIONS = ("given", "right", "uniform", "wrong")


def _settings(_: click.Context, __: click.Parameter, value: str) -> tuple[str, ...]:
    """Parse comma-separated names of settings."""
    names = tuple(name.strip().replace("-", "_") for name in value.split(",") if name.strip())
    unknown = [name for name in names if name not in SETTINGS]
    if unknown or not names:
        raise click.BadParameter(f"{value!r}: choose from {', '.join(SETTINGS)}")
    return tuple(name for name in SETTINGS if name in names)


@click.command(short_help="Compare methods on objects of known stuff.")
@click.argument("data", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option(
    "--methods",
    default="all",
    show_default=True,
    metavar="A,B,…",
    help="Names, `all`, or NAME=FILE for a predictor (NAME=DIR: the one in it that left out the object); the "
    "first is what the others are compared with. A predictor's twin is led through the seen frames, but not "
    "where its name ends with `-open-loop`; baselines of springs are where theirs ends with `-synchronised`.",
)
@click.option(
    "--settings",
    callback=_settings,
    default=",".join(SETTINGS),
    show_default=True,
    metavar="A,B,…",
    help="What is predicted.",
)
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    required=True,
    metavar="DIR",
    help="Where results, tables and figures go; what is measured there already is not done again.",
)
@click.option(
    "--priors",
    type=click.Choice(OPINIONS),
    default="given",
    show_default=True,
    help="What methods are told of the materials: as the cases say, or what a good, an undecided or a "
    "sometimes mistaken expert would say.",
)
@click.option(
    "--fits", type=click.IntRange(1), default=1, show_default=True, help="Clips of each object to learn from."
)
@click.option("--limit", type=click.IntRange(1), metavar="N", help="Objects, evenly from all classes.")
@click.option("--pictures/--no-pictures", default=True, help="Also compare pictures, where cases have looks.")
@click.option(
    "--lpips",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    metavar="DIR",
    help="Weights of LPIPS: alexnet.pth and alex.pth.",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of clips and priors.")
@click.option("--workers", type=click.IntRange(1, 64), default=2, show_default=True, help="Processes.")
@click.option(
    "--docs",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="PAGE.md",
    help="Also put the tables into this page.",
)
@click.option("--title", default="Evaluation", show_default=True, help="Heading of the tables.")
@click.option(
    "--json", "as_json", is_flag=True, help="Print the figures as JSON, and nothing else, on stdout."
)
@click.option("--quiet", is_flag=True, help="No progress, no warnings, no tables.")
@click.pass_context
def evaluate(
    context: click.Context,
    /,
    data: Path,
    out: Path,
    docs: Path | None,
    as_json: bool,
    quiet: bool,
    **options: object,
) -> None:
    """Measure how well methods know the objects of DATA, a folder that `matphys scenes` has written.

    Each method learns from the first seven tenths of a clip, and predicts the rest of it and the object's
    other clips. An evaluation that was stopped goes on where it was.
    """
    from model.evaluation.document import COMMAND, Run, section, write_folder
    from model.evaluation.figures import figures
    from model.evaluation.run import evaluate as measure
    from model.evaluation.tables import as_plain, markdown, tables
    from model.formats.page import check_section, write_section

    given: dict[str, Any] = dict(options)
    if docs is not None and not docs.is_file():
        raise InputError(f"--docs {docs}: no such page: give one that is there")
    if docs is not None:
        check_section(docs, COMMAND, given["title"])
    default_to_one_thread()
    plan = _plan(data, given)
    with progress(quiet) as report:
        records = measure(plan, out, given["workers"], report)
    made = tables(records, tuple(plan.methods), plan.settings)
    drawn = figures({name: [r for r in records if r.method == name] for name in plan.methods}, plan.settings)
    run = Run(
        title=given["title"],
        command=_command(context),
        date=time.strftime("%Y-%m-%d", time.gmtime()),
        data=data.name,
        opinion=given["priors"],
        objects=len({record.thing for record in records}),
        clips=len({record.case for record in records}),
        weights={name: known for name, method in plan.methods.items() if (known := method.weights())},
    )
    written = write_folder(out, run, made, drawn)
    if docs is not None:
        written += write_section(docs, section(run, made, drawn))
    if as_json:
        print_json({"run": asdict(run), "tables": as_plain(made), "files": [str(path) for path in written]})
    elif not quiet:
        for table in made:
            click.echo(markdown(table))
        click.echo("\n".join(f"wrote {path}" for path in written))
    if not quiet:
        warn(_failures(records))


def _plan(data: Path, options: Mapping[str, Any]) -> "Plan":
    from model.evaluation.methods import chosen
    from model.evaluation.run import Plan

    if options["lpips"] is not None and not options["pictures"]:
        raise InputError("--lpips compares pictures, and --no-pictures says not to: give one of them")
    return Plan(
        data=data,
        methods=chosen(options["methods"]),
        settings=options["settings"],
        opinion=None if options["priors"] == "given" else options["priors"],
        fits=options["fits"],
        limit=options["limit"],
        pictures=options["pictures"],
        lpips=options["lpips"],
        seed=options["seed"],
    )


def _command(context: click.Context) -> str:
    """The command line without what does not change its figures."""
    words = ["matphys", "evaluate", str(context.params["data"])]
    for option in context.command.params:
        name = option.name or ""
        given = context.get_parameter_source(name) is ParameterSource.COMMANDLINE
        if isinstance(option, click.Option) and given and name not in ("workers", "quiet", "as_json"):
            value = context.params[name]
            if isinstance(value, bool):
                words.append((option.opts if value else option.secondary_opts)[0])
            else:
                words += [option.opts[0], ",".join(value) if isinstance(value, tuple) else str(value)]
    return shlex.join(words)


def _failures(records: Iterable["Record"]) -> Iterator[str]:
    for record in records:
        reasons = {each.failed for each in record.unseen if each.failed is not None}
        for reason in sorted(reasons | ({record.failed} if record.failed is not None else set())):
            yield f"{record.method} on {record.case}: {reason}"
