"""A finely drawn body follows the points of a case: where its Gaussians are in every frame."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import torch
from jaxtyping import Float32, Float64, Int32
from scipy.spatial.transform import Rotation

from model.errors import InputError
from model.rotations import matrices
from model.scenes.case import Case
from model.scenes.replay import case_simulator, roll
from model.scenes.true_parameters import true_parameters
from model.simulator.divergence import SimulationDiverged
from model.skinning import Skin, bind
from model.types import Array, Gaussians

FOLLOWED = 8
"""Mass points that a Gaussian follows."""
SMOOTH, STILL = 2e-3, 1e-6
"""How much corrections of neighbours shall be alike, and small, beside making observed points right."""
CORRECTIONS = 3
"""Per frame."""


def carried(
    case: Case, gaussians: Gaussians
) -> Iterator[tuple[Float32[Array, "G 3"], Float32[Array, "G 4"], Float32[Array, "G 3 3"]]]:
    """Means [m], quaternions and turns since rest of Gaussians that move as `case.complete` does.

    They are skinned to the twin's mass points, which move as its true parameters let them (where those are
    not known: rigidly), corrected smoothly so that observed points are where they really were.

    Raises:
        InputError: the case does not say where its points really were.
    """
    if case.complete is None:
        raise InputError(f"case {case.name}: a film needs to know where all points are in all frames")
    skin = _skin(case, gaussians)
    laid = matrices(torch.as_tensor(gaussians.quaternions))
    for points in _corrected(case, _roughly(case)):
        with torch.no_grad():
            means, quaternions = skin(torch.as_tensor(points))
            turns = matrices(quaternions) @ laid.transpose(1, 2)
        yield means.numpy(), quaternions.numpy(), turns.numpy()


def _roughly(case: Case) -> Float32[Array, "T P 3"]:
    """Where the mass points about are [m]."""
    frames = len(case.observation.times)
    if case.truth is not None and frames == len(case.complete if case.complete is not None else ()):
        try:
            with torch.no_grad():
                return roll(case, case_simulator(case, true_parameters(case))).numpy().astype(np.float32)
        except SimulationDiverged:
            pass  # then as if it were not known
    assert case.complete is not None
    moved = []
    middle = case.rest.astype(np.float64).mean(axis=0)
    for points in case.complete.astype(np.float64):
        turn, _ = Rotation.align_vectors(points - points.mean(axis=0), case.rest - middle)
        moved.append(turn.apply(case.topology.points - middle) + points.mean(axis=0))
    return np.stack(moved).astype(np.float32)


def _corrected(case: Case, rough: Float32[Array, "T P 3"]) -> Iterator[Float32[Array, "P 3"]]:
    """The same, so that the observed points are right."""
    assert case.complete is not None
    skin, correction = _skin(case, _dots(case.rest)), _correction(case)
    for points, wanted in zip(rough, case.complete, strict=True):
        right = points
        for _ in range(CORRECTIONS):
            with torch.no_grad():
                missing = wanted - skin(torch.as_tensor(right))[0].numpy()
            right = (right + correction @ missing).astype(np.float32)
        yield right


def _correction(case: Case) -> Float64[Array, "P N"]:
    """What is missing at observed points → smooth shifts of the mass points that add it."""
    topology = case.topology
    index, weight = _bound(case, case.rest)
    mean = np.zeros((len(index), len(topology.points)))
    np.add.at(mean, (np.arange(len(index))[:, None], index), weight)
    difference = np.zeros((len(topology.springs), len(topology.points)))
    rows = np.arange(len(topology.springs))
    difference[rows, topology.springs[:, 0]], difference[rows, topology.springs[:, 1]] = 1.0, -1.0
    normal = mean.T @ mean + SMOOTH * difference.T @ difference + STILL * np.eye(len(topology.points))
    correction: Float64[Array, "P N"] = np.linalg.solve(normal, mean.T)
    return correction


def _skin(case: Case, gaussians: Gaussians) -> Skin:
    index, weight = _bound(case, gaussians.means)
    return Skin(gaussians, replace(case.topology, binding_index=index, binding_weight=weight))


def _bound(case: Case, places: Float32[Array, "G 3"]) -> tuple[Int32[Array, "G k"], Float32[Array, "G k"]]:
    return bind(places, case.topology.points, k=FOLLOWED, springs=case.topology.springs)


def _dots(points: Float32[Array, "N 3"]) -> Gaussians:
    """Gaussians where observed points are: what is done to the others is done to them."""
    ones = np.ones(len(points), np.float32)
    upright = np.tile(np.array([1, 0, 0, 0], np.float32), (len(points), 1))
    return Gaussians(points, np.ones_like(points), upright, 0.5 * ones, np.ones_like(points), ones)
