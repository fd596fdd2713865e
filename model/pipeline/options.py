"""What a user may choose of how a clip becomes a twin."""

import hashlib
from dataclasses import asdict, dataclass
from pathlib import Path

from pydantic import JsonValue


@dataclass(frozen=True)
class TwinOptions:
    """What a user may choose; every field is an option of `matphys twin`."""

    fps: float | None = None
    """Frame rate of a folder of images [1/s]; None: 30."""
    mask: Path | None = None
    box: tuple[int, int, int, int] | None = None
    """x, y, width, height [px]."""
    keyframe: int | None = None
    camera: Path | None = None
    size_m: float | None = None
    """Largest extent of the object [m]."""
    mesh: Path | None = None
    depth: Path | None = None
    controllers: Path | None = None
    shape: str = "auto"
    prior: str = "stub"
    predictor: str = "matphys"
    """`matphys`: the trained one that comes with the package; a file: another one; `prior-mean`."""
    parts: int = 5
    points: int = 1500
    segmentation: str = "classical"
    tracking: str = "opencv"
    reconstruction: str | None = None
    """None: `mesh` with a mesh, `depth` with depth, else `silhouette`."""
    encoder: str = "texture"
    renderer: str | None = None
    """None: the fastest that runs here."""
    seed: int = 0


def fingerprint(options: TwinOptions, weights: str | None = None) -> dict[str, JsonValue]:
    """The options as JSON, files by their content: what makes one twin another.

    Args:
        options: What was chosen.
        weights: sha256 of the predictor's, where it is a file; None: it is known by its name.
    """

    def plain(value: object) -> JsonValue:
        if isinstance(value, Path):
            files = sorted(file for file in value.rglob("*") if file.is_file()) if value.is_dir() else [value]
            return [hashlib.sha256(file.read_bytes()).hexdigest() for file in files]
        if isinstance(value, tuple):
            return list(value)
        assert value is None or isinstance(value, str | int | float)
        return value

    named = {name: plain(value) for name, value in asdict(options).items()}
    return named if weights is None else named | {"predictor": weights}
