"""`matphys edit`: another material for a part of a twin."""

from pathlib import Path
from typing import cast

import click

from model.commands.common import InputFile, OutputFile, check_outputs, print_json, warn
from model.doubts import collect_doubts
from model.types import ShapeClass


@click.command(short_help="Make a part of a twin of another material.")
@click.argument("twin", type=InputFile)
@click.option(
    "--part", type=click.IntRange(min=0), required=True, metavar="N", help="Its number in the twin."
)
@click.option("--material", required=True, metavar="NAME", help="fabric, leather, rubber, plastic, metal, …")
@click.option(
    "--out", type=OutputFile, required=True, metavar="NEW.twin.zip", help="Where the new twin goes."
)
@click.option(
    "--shape",
    type=click.Choice(["auto", "sheet", "rope", "solid"]),
    default="auto",
    help="What the object is, which says how springs share a modulus.",
)
@click.option(
    "--predictor",
    default="auto",
    metavar="NAME|FILE",
    help="Who predicts: auto (as the twin was made), matphys, prior-mean, or a file of `matphys fit`.",
)
@click.option(
    "--json", "as_json", is_flag=True, help="Print the result as JSON, and nothing else, on stdout."
)
def edit(twin: Path, part: int, material: str, out: Path, shape: str, predictor: str, as_json: bool) -> None:
    """Make a part of TWIN of another material: its springs are predicted anew.

    A twin keeps no motion of its object, and that was the old material's anyway: the trained predictor is
    asked about the motion that the twin has with the new material's usual properties. A twin whose mechanics
    are the material prior's means gets those of the new material.
    """
    check_outputs((twin,), out)
    from model.bundle import TwinBundle
    from model.edit import edit_part, predictor_of
    from model.predictor.named import predictor_named

    before = TwinBundle.load(twin)
    with collect_doubts() as doubts:
        shape_class = None if shape == "auto" else cast(ShapeClass, shape)
        asked = predictor_of(before) if predictor == "auto" else predictor_named(predictor, "auto")
        after = edit_part(before, part, material, shape_class, asked)
        after.save(out)
    inside = before.topology.part == part
    springs = inside[before.topology.springs].any(axis=1)
    old, new = (float(each.parameters.stiffness[springs].mean()) for each in (before, after))
    light, heavy = (float(each.topology.mass[inside].sum(dtype=float)) for each in (before, after))
    if as_json:
        facts = {"twin": str(out), "part": part, "material": material, "springs": int(springs.sum())}
        print_json(facts | {"stiffness": [old, new], "mass": [light, heavy]})
    else:
        click.echo(
            f"wrote {out}: {springs.sum()} springs of part {part}, {old:.3g} → {new:.3g} N/m on average, "
            f"{1e3 * light:.3g} → {1e3 * heavy:.3g} g"
        )
    warn([*after.manifest.warnings[len(before.manifest.warnings) + 1 :], *doubts])
