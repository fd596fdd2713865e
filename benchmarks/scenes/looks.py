"""The pictures of docs/scenes.md: one animal in each of the ten materials, and films of five classes.

    python benchmarks/scenes/looks.py docs/images

It writes `looks.jpg` and `films.jpg`.
"""

from dataclasses import replace
from itertools import islice
from pathlib import Path

import click
import cv2
import numpy as np
from jaxtyping import UInt8

from model.priors.materials import MATERIALS
from model.scenes.case import Case
from model.scenes.film import set_scene, shoot
from model.scenes.world.cases import draw_cases
from model.types import Array

FILMED, SIZE = (800, 600), (400, 300)
COLUMNS = 5
SHOWN = ("plush", "lift"), ("cloth", "fold"), ("rope", "shake"), ("foam", "push"), ("bag", "double_lift")
MOMENTS = 4
QUALITY = 82


@click.command()
@click.argument("folder", type=click.Path(file_okay=False, path_type=Path))
@click.option("--seed", default=3, show_default=True)
def main(folder: Path, seed: int) -> None:
    """Draw both pictures into FOLDER."""
    _write(folder / "looks.jpg", materials(seed))
    _write(folder / "films.jpg", np.concatenate([strip(*shown, seed) for shown in SHOWN]))


def materials(seed: int) -> UInt8[Array, "H W 3"]:
    """The first moment of one case, with all of its parts made of each material in turn."""
    case = draw_cases(seed, 0, "plush", interactions=1)[0]
    tiles = []
    for number, name in enumerate(MATERIALS):
        assert case.truth is not None
        made = replace(case, truth=replace(case.truth, material=np.full_like(case.truth.material, number)))
        tiles.append(_labelled(_moments(made, 1, FILMED)[0], name))
    rows = [np.concatenate(tiles[begin : begin + COLUMNS], axis=1) for begin in range(0, len(tiles), COLUMNS)]
    return np.concatenate(rows)


def strip(object_class: str, interaction: str, seed: int) -> UInt8[Array, "H W 3"]:
    """Some moments of the first case of that kind."""
    cases = (case for number in range(40) for case in draw_cases(seed, number, object_class))
    case = next(case for case in cases if case.interaction == interaction)
    pictures = _moments(case, MOMENTS, SIZE)
    first = _labelled(pictures[0], f"{object_class}: {interaction.replace('_', ' ')}")
    return np.concatenate([first, *pictures[1:]], axis=1)


def _moments(case: Case, count: int, filmed: tuple[int, int]) -> list[UInt8[Array, "H W 3"]]:
    wanted = np.linspace(0, len(case.observation.times) - 1, count).round().astype(int)
    shots = islice(shoot(set_scene(case, filmed, 0), np.random.default_rng(0)), int(wanted[-1]) + 1)
    pictures = [shot.picture for frame, shot in enumerate(shots) if frame in wanted]
    return [np.asarray(cv2.resize(picture, SIZE, interpolation=cv2.INTER_AREA)) for picture in pictures]


def _labelled(picture: UInt8[Array, "H W 3"], text: str) -> UInt8[Array, "H W 3"]:
    for color, width in ((0, 4), (255, 1)):
        cv2.putText(picture, text, (8, 22), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (color,) * 3, width, cv2.LINE_AA)
    return picture


def _write(path: Path, picture: UInt8[Array, "H W 3"]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    click.echo(f"wrote {path} ({path.stat().st_size / 1e3:.0f} kB)")


if __name__ == "__main__":
    main()
