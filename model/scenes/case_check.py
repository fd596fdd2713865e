"""The arrays and numbers of a case that somebody wrote, checked before anyone uses them."""

from collections.abc import Mapping

import numpy as np

from model.errors import InputError
from model.formats.shapes import Shape, check_shape
from model.priors.materials import MATERIALS
from model.types import Array, MaterialPrior
from model.units import PROPERTY_UNITS

SHAPES: Mapping[str, Shape] = {
    "topology.points": ("P", 3),
    "topology.mass": ("P",),
    "topology.part": ("P",),
    "topology.springs": ("E", 2),
    "topology.rest_length": ("E",),
    "topology.binding_index": ("B", "b"),
    "topology.binding_weight": ("B", "b"),
    "topology.controller_points": ("C", 3),
    "topology.controller_springs": ("S", 2),
    "topology.controller_rest_length": ("S",),
    "rest": ("N", 3),
    "anchors.index": ("N", "k"),
    "anchors.weight": ("N", "k"),
    "observation.points": ("T", "N", 3),
    "observation.controllers": ("T", "C", 3),
    "complete": ("T", "N", 3),
    "gaussians.means": ("G", 3),
    "gaussians.scales": ("G", 3),
    "gaussians.quaternions": ("G", 4),
    "gaussians.opacities": ("G",),
    "gaussians.colors": ("G", 3),
    "gaussians.volumes": ("G",),
    "camera.intrinsics": (3, 3),
    "camera.world_from_camera": (4, 4),
    "truth.material": ("K",),
    "truth.modulus": ("K",),
}
"""A letter is one number throughout; K is that of the priors."""
GAPS = ("observation.points", "complete")
"""May be NaN where nothing is known."""
INDICES: Mapping[str, str] = {
    "topology.springs": "P",
    "topology.binding_index": "P",
    "topology.part": "K",
    "anchors.index": "P",
}
"""What they count; those of `topology.controller_springs` count two things."""
POSITIVE = ("topology.mass", "topology.rest_length", "truth.modulus")
TOLERANCE = 1e-3
"""Of a sum of shares."""


def check_arrays(arrays: Mapping[str, Array], parts: int, where: str) -> None:
    """Refuse arrays that do not fit each other, or that hold what no such quantity can be.

    Args:
        arrays: Those of a case, by name; a missing one is not looked for, nor what only it could refuse.
        parts: K, how many priors there are.
        where: What messages call the source.

    Raises:
        InputError: names the first that is wrong, the expected and the found.
    """
    sizes = {"K": parts}
    for name, shape in SHAPES.items():
        if name in arrays:
            check_shape(name, arrays[name].shape, shape, sizes, where)
            _check_numbers(name, arrays[name], where)
    if not sizes.get("P", 1):
        raise InputError(f"{where}: topology.points: expected at least one point, found none")
    for name, of in INDICES.items():
        if name in arrays and of in sizes:
            _check_indices(name, arrays[name], sizes[of], where)
    grips = arrays.get("topology.controller_springs")
    for column, of in enumerate("CP"):
        if grips is not None and of in sizes:
            _check_indices(f"topology.controller_springs[:, {column}]", grips[:, column], sizes[of], where)
    if "topology.springs" in arrays:
        _check_springs(arrays["topology.springs"], where)
    if "anchors.weight" in arrays:
        _check_shares("anchors.weight", arrays["anchors.weight"], where)
    if "truth.material" in arrays:
        _check_indices("truth.material", arrays["truth.material"], len(MATERIALS), where)


def check_prior(prior: MaterialPrior, where: str) -> None:
    """Refuse a belief that is none.

    Raises:
        InputError: a property is absent or cannot be, or the distribution is none.
    """
    if set(prior.properties) != set(PROPERTY_UNITS):
        expected, found = (", ".join(sorted(names)) for names in (PROPERTY_UNITS, prior.properties))
        raise InputError(f"{where}: priors: expected the properties {expected}, found {found}")
    for name, one in prior.properties.items():
        if not (np.isfinite(one.mean) and one.mean > 0.0 and np.isfinite(one.spread) and one.spread >= 0.0):
            raise InputError(
                f"{where}: priors: {name}: expected a median above 0 and a spread of 0 or more, "
                f"found {one.mean:g} and {one.spread:g}"
            )
        if name == "restitution" and one.mean >= 1.0:
            raise InputError(f"{where}: priors: restitution: expected a median below 1, found {one.mean:g}")
    share = prior.distribution
    if not (share >= 0.0).all() or abs(float(share.sum()) - 1.0) > TOLERANCE:
        raise InputError(
            f"{where}: priors: distribution: expected shares that sum to 1, found {share.sum():g}"
        )


def _check_numbers(name: str, array: Array, where: str) -> None:
    if array.dtype.kind not in "biuf":
        raise InputError(f"{where}: {name}: expected numbers, found {array.dtype}")
    if name not in GAPS and not np.isfinite(array).all():
        raise InputError(f"{where}: {name}: expected finite numbers, found NaN or infinity")
    if name in POSITIVE and array.size and not array.min() > 0.0:
        raise InputError(f"{where}: {name}: expected more than 0, found {array.min():g}")


def _check_indices(name: str, array: Array, limit: int, where: str) -> None:
    if array.size and not (array.min() >= 0 and array.max() < limit):
        found = f"{array.min():g} to {array.max():g}"
        raise InputError(f"{where}: {name}: expected indices below {limit}, found {found}")


def _check_springs(springs: Array, where: str) -> None:
    if not len(springs):
        raise InputError(f"{where}: topology.springs: expected at least one spring, found none")
    loops = np.flatnonzero(springs[:, 0] == springs[:, 1])
    if len(loops):
        raise InputError(
            f"{where}: topology.springs: expected two points each, found one twice in spring {loops[0]}"
        )


def _check_shares(name: str, array: Array, where: str) -> None:
    sums = array.sum(axis=1, dtype=np.float64)
    wrong = np.flatnonzero(np.abs(sums - 1.0) > TOLERANCE)
    if len(wrong):
        row = wrong[0]
        raise InputError(f"{where}: {name}: expected rows that sum to 1, found {sums[row]:g} in row {row}")
