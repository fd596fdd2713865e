"""A case folder of PhysTwin → a case: points, hands and the split that its fits were made with."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float64, Int, UInt8
from scipy.spatial import cKDTree

from model.errors import InputError
from model.mass_points import place_points
from model.observe.arrays_pickle import read_pickled_arrays
from model.observe.phystwin import FPS, TURN, observe_arrays
from model.priors.base import PriorClient
from model.priors.stub import StubPrior
from model.scenes.anchors import anchor
from model.scenes.case import Case, Interaction, ObjectClass
from model.skinning import bind
from model.topology import build_topology
from model.types import Array, Controllers, Gaussians, Observation, Parts, PartView, ShapeClass

NAMES: tuple[tuple[str, ObjectClass, ShapeClass], ...] = (
    ("cloth", "cloth", "sheet"),
    ("rope", "rope", "rope"),
    ("package", "bag", "solid"),
    ("sloth", "plush", "solid"),
    ("zebra", "plush", "solid"),
    ("dinosor", "plush", "solid"),
)
"""What the names of its cases say of the object."""
MOTIONS: tuple[tuple[str, Interaction], ...] = (
    ("double_lift", "double_lift"),
    ("double_stretch", "stretch"),
    ("stretch", "stretch"),
    ("push", "push"),
    ("fold", "fold"),
    ("lift", "lift"),
)
"""What they say of the interaction."""
HAND = "hand"
"""What its masks call the hand."""
SPLIT = 0.7
"""Share of the frames to learn from, where nothing is said: as its own processing splits."""
OPACITY = 0.95


def read_phystwin_case(
    folder: Path,
    *,
    prior: PriorClient | None = None,
    shape_class: ShapeClass | None = None,
    point_count: int = 600,
    observed: int = 300,
    fps: float = FPS,
    seed: int = 0,
) -> Case:
    """Read `final_data.pkl` and `split.json`; of the rest, the first picture and its mask, if they are there.

    The body is what its tracked, surface and interior points fill; its mass points and springs are ours
    (`build_topology`), as for any twin. z is turned up, the table is z = 0, controllers are its own.
    It says nothing of parts: there is one. Nothing but arrays is read from the pickle.

    Args:
        folder: Of one case, like `data/different_types/single_lift_sloth`.
        prior: Who names the material of the first picture; None: the stub.
        shape_class: What fills it; None: what the name of the folder says, else solid.
        point_count: Mass points, at most.
        observed: Points that are kept of those tracked, spread over the object.
        fps: Of its cameras [1/s].
        seed: Of the sampling.

    Raises:
        InputError: the folder is no such case, or its split is not one.

    Reference:
        Jiang et al. (2025), PhysTwin: physics-informed reconstruction and simulation of deformable objects
        (its `data_process` writes these files).
    """
    if folder.name in ("", ".."):  # a case is known by the name of its folder
        folder = folder.resolve()
    path = folder / "final_data.pkl"
    if not fps > 0.0:
        raise InputError(f"{folder.name}: {fps:g} frames per second: expected more than 0")
    arrays = read_pickled_arrays(path)
    whole = observe_arrays(arrays, path.name, fps)
    first = arrays["object_points"][0].astype(np.float64) * TURN
    there = np.flatnonzero(np.isfinite(first).all(axis=1))
    if len(there) < 2:
        raise InputError(
            f"{path.name}: object_points: expected points in the first frame, found {len(there)}"
        )
    frames, split = read_split(folder / "split.json", len(whole.times))
    object_class, named_shape = _described(folder.name)
    shape = shape_class or named_shape
    filled = fill_points(_body_points(arrays, first[there], path.name))
    body = _colored(filled, first[there], None if whole.colors is None else whole.colors[there])
    view = _first_view(folder, shape)
    belief = (prior or StubPrior()).material(view)
    topology = build_topology(
        body,
        Parts(np.zeros(len(body), np.int32), 1),
        (belief,),
        shape,
        Controllers(whole.controllers[:frames], np.zeros(whole.controllers.shape[1], np.int64)),
        bind=bind,
        point_count=point_count,
        seed=seed,
    )
    chosen = there[_spread(first[there], observed, seed)]
    rest = first[chosen].astype(np.float32)
    return Case(
        name=folder.name,
        object_name=folder.name,
        object_class=object_class,
        interaction=_interaction(folder.name),
        shape_class=shape,
        topology=topology,
        priors=(belief,),
        observation=_kept(whole, chosen, frames),
        rest=rest,
        anchors=anchor(rest, topology.points, topology.springs),
        split=split,
        gaussians=body,
    )


def read_split(path: Path, frames: int) -> tuple[int, int]:
    """How many frames there are to use, and how many of them are to learn from.

    `{"frame_len": 100, "train": [0, 70], "test": [70, 100]}`; without the file, 7 of 10 frames.

    Raises:
        InputError: the file is damaged, or does not split the frames in two.
    """
    if not path.is_file():
        return frames, max(2, int(SPLIT * frames))
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        (begin, middle), (again, end) = record["train"], record["test"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path.name}: expected train and test as pairs of frames ({error!r})") from None
    whole = all(isinstance(value, int) for value in (begin, middle, again, end))
    if not whole or begin != 0 or again != middle or not 2 <= middle < end:
        raise InputError(
            f"{path.name}: expected train [0, n] and test [n, m] with 2 <= n < m, "
            f"found {record['train']} and {record['test']}"
        )
    if middle >= frames:
        raise InputError(f"{path.name}: expected train to end before frame {frames}, found {middle}")
    return min(end, frames), middle


def fill_points(points: Float64[Array, "P 3"]) -> Gaussians:
    """Gaussians in the places of points that fill a body evenly, each as large as the room it has.

    PhysTwin keeps one point of each cube of 5 mm: then nine of ten are at most about one side apart.
    """
    near = cKDTree(points).query(points, 2)[0][:, 1]
    side = float(np.quantile(near, 0.9))
    ones = np.ones(len(points), np.float32)
    return Gaussians(
        means=points.astype(np.float32),
        scales=np.full((len(points), 3), 0.6 * side, np.float32),
        quaternions=np.tile(np.array([1, 0, 0, 0], np.float32), (len(points), 1)),
        opacities=OPACITY * ones,
        colors=np.full((len(points), 3), 0.6, np.float32),
        volumes=np.float32(side**3) * ones,
    )


def _body_points(
    arrays: dict[str, Array], tracked: Float64[Array, "N 3"], name: str
) -> Float64[Array, "P 3"]:
    """Tracked, surface and interior points, those that coincide once, none below the table."""
    pieces = [tracked]
    for key in ("surface_points", "interior_points"):
        given = arrays.get(key, np.zeros((0, 3)))
        if given.size and (given.ndim != 2 or given.shape[1] != 3):
            raise InputError(f"{name}: {key}: expected shape [P, 3], found {list(given.shape)}")
        pieces.append(given.reshape(-1, 3).astype(np.float64) * TURN)
    points = np.concatenate(pieces)
    points = points[np.isfinite(points).all(axis=1)]
    points[:, 2] = np.maximum(points[:, 2], 0.0)
    distinct: Float64[Array, "P 3"] = points[
        np.sort(np.unique(points.round(5), axis=0, return_index=True)[1])
    ]
    if len(distinct) < 2:
        raise InputError(f"{name}: expected points apart from each other, found {len(distinct)}")
    return distinct


def _colored(
    body: Gaussians, tracked: Float64[Array, "N 3"], colors: UInt8[Array, "N 3"] | None
) -> Gaussians:
    """In the colours of the nearest tracked points, where there are any."""
    if colors is None:
        return body
    nearest = cKDTree(tracked).query(body.means)[1]
    return replace(body, colors=(colors[nearest] / 255.0).astype(np.float32))


def _kept(whole: Observation, chosen: Int[Array, " n"], frames: int) -> Observation:
    return replace(
        whole,
        times=whole.times[:frames],
        points=np.ascontiguousarray(whole.points[:frames, chosen]),
        controllers=whole.controllers[:frames],
        colors=None if whole.colors is None else whole.colors[chosen],
    )


def _spread(points: Float64[Array, "N 3"], count: int, seed: int) -> Int[Array, " n"]:
    """At most `count` of the points, far from each other."""
    return np.sort(place_points(fill_points(points), "solid", count, seed)[1])


def _described(name: str) -> tuple[ObjectClass, ShapeClass]:
    for word, object_class, shape_class in NAMES:
        if word in name:
            return object_class, shape_class
    return "unknown", "solid"


def _interaction(name: str) -> Interaction:
    for word, interaction in MOTIONS:
        if word in name:
            return interaction
    return "unknown"


def _first_view(folder: Path, shape_class: ShapeClass) -> PartView:
    """The first picture of the first camera and the object in it; empty where they are not there."""
    picture = _picture(folder / "color" / "0" / "0.png", cv2.IMREAD_COLOR)
    if picture is None:
        nothing = np.zeros((1, 1), bool)
        return PartView(np.zeros((1, 1, 3), np.uint8), nothing, nothing, "object", shape_class)
    mask = np.zeros(picture.shape[:2], bool)
    table = folder / "mask" / "mask_info_0.json"
    try:
        names = json.loads(table.read_text(encoding="utf-8")) if table.is_file() else {}
    except ValueError:
        raise InputError(f"{table.name}: expected JSON, found something else") from None
    if not isinstance(names, dict):
        raise InputError(f"{table.name}: expected names by number, found {type(names).__name__}")
    for key, label in names.items():
        if not str(key).isdigit():  # it becomes part of a path
            raise InputError(f"{table.name}: expected names by number, found {key!r}")
        found = _picture(folder / "mask" / "0" / str(key) / "0.png", cv2.IMREAD_GRAYSCALE)
        if label != HAND and found is not None and found.shape == mask.shape:
            mask |= found > 127
    image = np.ascontiguousarray(picture[..., ::-1])
    return PartView(image, mask, mask, "object", shape_class)


def _picture(path: Path, kind: int) -> Array | None:
    """None where there is none: OpenCV would complain of that on stderr."""
    return cv2.imread(str(path), kind) if path.is_file() else None
