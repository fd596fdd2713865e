"""`matphys`: the command line (contract 6).

Imports nothing heavy until a command needs it, so that `--help` answers at once.
"""

import os
import sys
import traceback
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from model.commands.common import (
    InputFile,
    OutputFile,
    check_outputs,
    default_to_one_thread,
    one_line,
    print_json,
    warn,
)
from model.commands.diagnose import diagnose
from model.commands.edit import edit
from model.commands.evaluate import evaluate
from model.commands.export import export
from model.commands.learn import COMMANDS as LEARNING
from model.commands.scenes import scenes
from model.commands.view import view
from model.doubts import collect_doubts
from model.errors import InputError
from model.formats.files import replacing
from model.gap.benchmark.command import gap_benchmark
from model.progress import StageReport, progress
from model.version import __version__

if TYPE_CHECKING:
    from model.bundle import TwinBundle
    from model.types import Observation, Trajectory

DONE, OUR_FAULT, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130

JUMP_LIMIT = 0.01
"""How far [m] controls may start from where the controllers rest before a word is said about it."""


def _box(_: click.Context, __: click.Parameter, value: str | None) -> tuple[int, int, int, int] | None:
    """Parse `x,y,w,h` [px]."""
    if value is None:
        return None
    try:
        x, y, width, height = (int(number) for number in value.split(","))
    except ValueError:
        raise click.BadParameter(f"{value!r} is not of the form x,y,w,h, like 120,80,200,150") from None
    if width <= 0 or height <= 0:
        raise click.BadParameter(f"{value!r} has no area")
    return x, y, width, height


class _Commands(click.Group):
    """Commands in which the end of a file is an error, as any other.

    click takes an EOFError for the end of what a person types, and stops without a word.
    """

    def invoke(self, ctx: click.Context) -> object:
        try:
            return super().invoke(ctx)
        except EOFError as error:
            raise RuntimeError(f"a file ended where more was expected: {error}") from error


@click.group(
    cls=_Commands, invoke_without_command=True, context_settings={"help_option_names": ["-h", "--help"]}
)
@click.version_option(__version__, prog_name="matphys")
@click.option(
    "--debug", is_flag=True, help="Show the traceback of an error. (MATPHYS_DEBUG=1 does the same.)"
)
@click.pass_context
def matphys(context: click.Context, debug: bool) -> None:
    """Turn a video of a handled soft object into a simulatable twin."""
    context.meta["debug"] = debug
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


@matphys.command(short_help="Turn a clip into a twin.")
@click.argument("video", type=click.Path(exists=True, path_type=Path))
@click.option("--out", type=OutputFile, required=True, metavar="NAME.twin.zip", help="Where the twin goes.")
@click.option(
    "--preview", type=OutputFile, metavar="MP4", help="Also write the preview as a file of its own."
)
@click.option("--fps", type=float, metavar="N", help="Frames per second of a folder of images (30).")
@click.option("--mask", type=InputFile, metavar="PNG", help="The object on the keyframe, white on black.")
@click.option("--box", callback=_box, metavar="x,y,w,h", help="A box around the object on the keyframe [px].")
@click.option("--keyframe", type=click.IntRange(min=0), metavar="N", help="The frame to reconstruct from.")
@click.option("--camera", type=InputFile, metavar="JSON", help="Intrinsics and pose of the camera.")
@click.option(
    "--size-m",
    type=click.FloatRange(min=0.0, min_open=True),
    metavar="M",
    help="The longest side of the object [m].",
)
@click.option("--mesh", type=InputFile, metavar="GLB", help="A mesh of the object (GLB, OBJ, PLY).")
@click.option("--depth", type=click.Path(exists=True, path_type=Path), help="Depth of the keyframe [mm].")
@click.option(
    "--controllers", type=InputFile, metavar="NPZ", help="The motion of the hand, instead of its own."
)
@click.option(
    "--shape", type=click.Choice(["auto", "sheet", "rope", "solid"]), help="What fills the silhouette."
)
@click.option("--prior", metavar="NAME", help="Who names the materials: stub, openai.")
@click.option(
    "--predictor",
    metavar="NAME|FILE",
    help="Who predicts the mechanics: matphys (as it comes), prior-mean, or a file that `matphys fit` made.",
)
@click.option("--parts", type=click.IntRange(1, 64), metavar="N", help="How many parts to look for.")
@click.option("--points", type=click.IntRange(16, 100_000), metavar="N", help="About how many mass points.")
@click.option("--segmentation", metavar="NAME", help="Method: classical, sam2.")
@click.option("--tracking", metavar="NAME", help="Method: opencv, cotracker.")
@click.option("--reconstruction", metavar="NAME", help="Method: silhouette, mesh, depth.")
@click.option("--encoder", metavar="NAME", help="Semantic features: texture, dinov2.")
@click.option("--renderer", metavar="NAME", help="Who draws the preview: splat, gsplat.")
@click.option(
    "--seed", type=click.IntRange(0, 2**31 - 1), metavar="N", help="Of everything that is drawn by lot."
)
@click.option(
    "--json", "as_json", is_flag=True, help="Print the result as JSON, and nothing else, on stdout."
)
@click.option("--quiet", is_flag=True, help="No progress, no warnings, no tables.")
def twin(video: Path, out: Path, preview: Path | None, as_json: bool, quiet: bool, **options: object) -> None:
    """Turn the clip VIDEO (a file, or a folder of numbered images) into a twin.

    Nothing but the clip is needed: what is not given is estimated, and the twin says how.
    """
    named = (options.get(name) for name in ("mask", "camera", "mesh", "depth", "controllers"))
    given_files = [video, *(path for path in named if isinstance(path, Path))]
    if str(options.get("predictor") or "").endswith(".safetensors"):
        given_files.append(Path(str(options["predictor"])))
    check_outputs(given_files, out, preview)
    from model.pipeline import TwinOptions, build_twin

    default_to_one_thread()
    given: dict[str, Any] = {name: value for name, value in options.items() if value is not None}
    with progress(quiet) as report, collect_doubts() as doubts:
        result = build_twin(video, TwinOptions(**given), report)
        result.bundle.save(out)
        if preview is not None and result.bundle.preview is not None:
            with replacing(preview) as temporary:
                temporary.write_bytes(result.bundle.preview)
    from model.summary import describe, print_stages

    if as_json:
        print_json({"twin": str(out), "seconds": dict(result.seconds)} | describe(result.bundle))
    elif not quiet:
        print_stages(result.bundle, result.seconds)
        click.echo(f"wrote {out} ({out.stat().st_size / 1e6:.1f} MB, {sum(result.seconds.values()):.1f} s)")
        if preview is not None and result.bundle.preview is not None:
            click.echo(f"wrote {preview}")
    if not quiet:
        warn([*result.bundle.manifest.warnings, *doubts])


@matphys.command(short_help="Move a twin as recorded, or otherwise.")
@click.argument("twin", type=InputFile)
@click.option(
    "--out", type=OutputFile, required=True, metavar="TRAJECTORY.npz", help="times [T], points [T, N, 3]."
)
@click.option(
    "--controls", type=InputFile, metavar="NPZ", help="Another motion: controls [T, C, 3], times [T]."
)
@click.option("--video", type=OutputFile, metavar="MP4", help="Also draw the motion.")
@click.option(
    "--substeps", type=click.IntRange(1, 100_000), metavar="N", help="Per frame, instead of enough."
)
@click.option(
    "--json", "as_json", is_flag=True, help="Print the result as JSON, and nothing else, on stdout."
)
@click.option("--quiet", is_flag=True, help="No progress, no warnings.")
def simulate(
    twin: Path,
    out: Path,
    controls: Path | None,
    video: Path | None,
    substeps: int | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Move TWIN, by the recorded motion of the hand or by another."""
    check_outputs((twin, controls), out, video)
    from model.bundle import TwinBundle
    from model.formats.trajectory import write_trajectory

    bundle = TwinBundle.load(twin)
    with progress(quiet) as report, collect_doubts() as doubts:
        trajectory = _roll(bundle, controls, substeps, report)
        write_trajectory(out, trajectory)
        if video is not None:
            _draw(video, bundle, trajectory, report)
    frames, points = trajectory.points.shape[:2]
    result = {
        "trajectory": str(out),
        "frames": frames,
        "points": points,
        "seconds": _lasting(trajectory),
    }
    if as_json:
        print_json(result | dict(trajectory.metadata) | {"video": None if video is None else str(video)})
    elif not quiet:
        click.echo(f"wrote {out} ({frames} frames of {points} points, {_lasting(trajectory):.2f} s)")
        if video is not None:
            click.echo(f"wrote {video}")
    if not quiet:
        warn(doubts)


@matphys.command(short_help="Say what really moved in a clip, as points over time.")
@click.argument("source", type=click.Path(exists=True, path_type=Path))
@click.option(
    "--out", type=OutputFile, required=True, metavar="OBSERVATION.npz", help="Where the observation goes."
)
@click.option("--twin", type=InputFile, metavar="TWIN", help="The twin of the clip SOURCE.")
@click.option(
    "--fps", type=float, metavar="N", help="Frames per second of a PhysTwin case or folder of images (30)."
)
@click.option("--mask", type=InputFile, metavar="PNG", help="The object on the keyframe, white on black.")
@click.option("--box", callback=_box, metavar="x,y,w,h", help="A box around the object on the keyframe [px].")
@click.option("--segmentation", metavar="NAME", help="Method: classical, sam2.")
@click.option("--tracking", metavar="NAME", help="Method: opencv, cotracker.")
@click.option(
    "--json", "as_json", is_flag=True, help="Print the result as JSON, and nothing else, on stdout."
)
@click.option("--quiet", is_flag=True, help="No progress, no warnings.")
def observe(
    source: Path,
    out: Path,
    twin: Path | None,
    fps: float | None,
    mask: Path | None,
    box: tuple[int, int, int, int] | None,
    segmentation: str | None,
    tracking: str | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Say what really moved in SOURCE: a PhysTwin case (final_data.pkl), or a clip with its --twin."""
    check_outputs((source, twin, mask), out)
    from model.observation import write_observation
    from model.observation_doubts import observation_doubts

    with progress(quiet) as report, collect_doubts() as doubts:
        if twin is None:
            from model.observe.phystwin import FPS, observe_phystwin

            if source.suffix != ".pkl":
                raise InputError(f"{source.name}: expected a .pkl of PhysTwin, or a clip with its --twin")
            given = {"mask": mask, "box": box, "segmentation": segmentation, "tracking": tracking}
            if unused := [f"--{name}" for name, value in given.items() if value is not None]:
                raise InputError(
                    f"{', '.join(unused)}: only for a clip with its --twin, not for {source.name}"
                )
            observation = observe_phystwin(source, FPS if fps is None else fps)
        else:
            from model.pipeline import observe as run

            default_to_one_thread()
            methods = segmentation or "classical", tracking or "opencv"
            observation = run(source, twin, *methods, mask, report, box, fps)
        write_observation(out, observation)
    frames, points = observation.points.shape[:2]
    if as_json:
        controllers = observation.controllers.shape[1]
        counts = {"frames": frames, "points": points, "controllers": controllers}
        print_json({"observation": str(out), **counts, "seconds": _lasting(observation)})
    elif not quiet:
        click.echo(f"wrote {out} ({frames} frames of {points} points, {_lasting(observation):.2f} s)")
    if not quiet:
        warn([*doubts, *observation_doubts(observation)])


@matphys.command(short_help="Say what is inside a twin.")
@click.argument("twin", type=InputFile)
@click.option("--json", "as_json", is_flag=True, help="Print it as JSON.")
def inspect(twin: Path, as_json: bool) -> None:
    """Say what is inside TWIN."""
    from model.bundle import TwinBundle
    from model.summary import describe, print_twin

    bundle = TwinBundle.load(twin)
    if as_json:
        print_json(describe(bundle))
    else:
        print_twin(bundle)


matphys.add_command(diagnose)
matphys.add_command(edit)
matphys.add_command(export)
matphys.add_command(gap_benchmark)
matphys.add_command(view)
matphys.add_command(scenes)
matphys.add_command(evaluate)
for command in LEARNING:
    matphys.add_command(command)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code: 0 done, 1 our fault, 2 bad input, 130 interrupted."""
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    try:
        code = matphys.main(arguments, prog_name="matphys", standalone_mode=False)
        return code if isinstance(code, int) else DONE
    except (click.Abort, KeyboardInterrupt):
        return INTERRUPTED
    except click.ClickException as error:
        return _fail(_usage(error), BAD_INPUT)
    except Exception as error:
        if "--debug" in arguments or os.environ.get("MATPHYS_DEBUG", "0") not in ("", "0"):
            traceback.print_exc()
        if isinstance(error, InputError):
            return _fail(f"matphys: {error}", BAD_INPUT)
        hint = "set MATPHYS_DEBUG=1 for the traceback"
        return _fail(f"matphys: internal error: {type(error).__name__}: {error} ({hint})", OUR_FAULT)


def _fail(message: str, code: int) -> int:
    click.echo(one_line(message), err=True)
    return code


def _usage(error: click.ClickException) -> str:
    context = getattr(error, "ctx", None)
    command = context.command_path if context is not None else "matphys"
    message = error.format_message().rstrip(".")
    return f"{command}: {message[:1].lower()}{message[1:]} (see {command} --help)"


def _lasting(motion: "Trajectory | Observation") -> float:
    """From the first frame to the last [s]."""
    return float(motion.times[-1] - motion.times[0])


def _roll(
    bundle: "TwinBundle", controls: Path | None, substeps: int | None, report: StageReport
) -> "Trajectory":
    report("simulation", 0.0)

    def follow(share: float) -> None:
        report("simulation", share)

    if controls is None:
        return bundle.rollout(None, follow, substeps=substeps)
    from model.formats.controls import read_controls

    given = read_controls(controls, len(bundle.topology.controller_points))
    jump = float(abs(given.motion[0] - bundle.topology.controller_points).max(initial=0.0))
    if not len(bundle.topology.controller_springs):
        moved = "moves nothing: no spring joins the controllers of this twin to its points"
        warnings.warn(f"{controls.name} {moved}", stacklevel=2)
    elif jump > JUMP_LIMIT:
        where = f"{jump:.3g} m from where the controllers are at rest"
        warnings.warn(f"{controls.name} starts {where}: a jerk follows", stacklevel=2)
    return bundle.rollout(given.motion, follow, times=given.times, substeps=substeps)


def _draw(path: Path, bundle: "TwinBundle", trajectory: "Trajectory", report: StageReport) -> None:
    from model.preview import write_rollout_video
    from model.rendering import best_renderer

    report("video", 0.0)
    write_rollout_video(path, bundle, trajectory, best_renderer())
