"""The modulus a lattice shows against the one it was built for, statics solved independently."""

import numpy as np
import pytest
from scipy.linalg import eigvalsh
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree

from model.predictor import ALL_PREDICTORS, PriorMeanPredictor
from model.registry import by_name
from model.types import Estimate, MaterialPrior, Topology

DENSITY = 150.0


def material(stiffness=5e4, **values):
    means = {"density": DENSITY, "damping": 0.1, "drag_rate": 0.5, "friction": 0.5, "restitution": 0.1}
    means |= {"stiffness": stiffness, **values}
    properties = {name: Estimate(value, 0.3, "1") for name, value in means.items()}
    return MaterialPrior(np.full(10, 0.1), properties, "solid")


def network(points, reach, volume, part=None, grips=0):
    points = points.astype(np.float32)
    springs = cKDTree(points).query_pairs(reach, output_type="ndarray").astype(np.int32)
    springs = springs[np.lexsort(springs.T[::-1])]
    length = np.linalg.norm(points[springs[:, 0]] - points[springs[:, 1]], axis=1)
    count = len(points)
    held = np.argsort(points[:, 0], kind="stable")[:grips].astype(np.int32)
    return Topology(
        points=points,
        mass=np.full(count, DENSITY * volume / count, np.float32),
        springs=springs,
        rest_length=length.astype(np.float32),
        part=np.zeros(count, np.int32) if part is None else part.astype(np.int32),
        binding_index=np.zeros((1, 1), np.int32),
        binding_weight=np.ones((1, 1), np.float32),
        controller_points=points[held] + np.float32([0, 0, 0.004]),
        controller_springs=np.stack([np.arange(grips), held], axis=1).astype(np.int32),
        controller_rest_length=np.full(grips, 0.004, np.float32),
    )


def predict(topology, priors, shape="solid", ground=0.1):
    return PriorMeanPredictor().from_priors(topology, priors, shape, (0.0, 0.0, -9.81), ground)


def stretch_force(topology, stiffness, dimensions=3, strain=1e-3):
    """Force [N] that stretches the network along x by `strain`; its ends slide freely across."""
    points = topology.points.astype(np.float64)
    first, second = topology.springs.T
    offset = points[second] - points[first]
    axis = (offset / np.linalg.norm(offset, axis=1, keepdims=True))[:, :dimensions]
    rows = np.repeat(np.arange(len(first)), dimensions)

    def placed(ends, sign):
        columns = (dimensions * ends[:, None] + np.arange(dimensions)).ravel()
        shape = (len(first), dimensions * len(points))
        return coo_matrix((sign * axis.ravel(), (rows, columns)), shape=shape)

    compatibility = (placed(second, 1.0) + placed(first, -1.0)).tocsr()
    matrix = (compatibility.T @ compatibility.multiply(stiffness[:, None])).tocsr()
    x = points[:, 0]
    thickness = 0.1 * np.ptp(x)
    left, right = x < x.min() + thickness, x > x.max() - thickness
    given = np.zeros((len(points), dimensions), bool)
    given[left | right, 0] = True
    given[np.argmin(x), 1:] = True
    value = np.zeros((len(points), dimensions))
    middle = np.ptp(x) - 2 * thickness
    value[right, 0] = strain * middle
    fixed, known = given.ravel(), value.ravel()
    rest = matrix + 1e-9 * matrix.diagonal().mean() * coo_matrix(np.eye(len(known))).tocsr()
    solved = known.copy()
    solved[~fixed] = spsolve(rest[~fixed][:, ~fixed].tocsc(), -(rest[~fixed][:, fixed] @ known[fixed]))
    reaction = (matrix @ solved).reshape(-1, dimensions)
    return float(reaction[right, 0].sum()), strain


def bar(shape, spacing=0.01, seed=0):
    axes = [np.arange(n) * spacing for n in shape]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    moving = np.array([n > 1 for n in shape])
    jitter = np.random.default_rng(seed).uniform(-0.25, 0.25, points.shape) * spacing * moving
    sides = np.array([n * spacing for n in shape])
    return points + jitter, sides


@pytest.mark.parametrize(("modulus", "width"), [(1e4, 7), (3e4, 7), (1e4, 4), (1e4, 3)])
def test_a_bar_has_the_modulus_it_was_built_for(modulus, width):
    points, sides = bar((24, width, width))
    topology = network(points, 0.024, float(np.prod(sides)))
    parameters = predict(topology, [material(modulus)])
    assert parameters.warnings == ()
    force, strain = stretch_force(topology, parameters.stiffness.astype(np.float64))
    found = force / (strain * sides[1] * sides[2])
    assert abs(found / modulus - 1) < 0.08


def test_a_sheet_has_the_stiffness_it_was_built_for():
    points, sides = bar((36, 20, 1))
    thickness, modulus = 0.002, 2e4
    topology = network(points, 0.024, float(sides[0] * sides[1] * thickness))
    parameters = predict(topology, [material(modulus)], "sheet")
    assert parameters.warnings == ()
    force, strain = stretch_force(topology, parameters.stiffness.astype(np.float64), dimensions=2)
    assert abs(force / (strain * sides[1] * thickness * modulus) - 1) < 0.08


def test_a_chain_carries_the_load_along_its_axis():
    points = np.stack([np.arange(20) * 0.01, np.zeros(20), np.zeros(20)], axis=1)
    area, modulus = 1e-4, 1e4
    topology = network(points, 0.011, 0.19 * area)
    stiffness = predict(topology, [material(modulus)], "rope").stiffness
    np.testing.assert_allclose(stiffness, modulus * area / 0.01, rtol=1e-5)


def test_a_rope_is_as_stiff_in_tension_as_a_rod_but_softer_at_its_surface():
    points, sides = bar((30, 5, 5))
    topology = network(points, 0.02, float(np.prod(sides)))
    stiffness = predict(topology, [material(1e4)], "rope").stiffness.astype(np.float64)
    force, strain = stretch_force(topology, stiffness)
    assert abs(force / (strain * sides[1] * sides[2] * 1e4) - 1) < 0.15
    away = np.linalg.norm(points[:, 1:] - points[:, 1:].mean(axis=0), axis=1)[topology.springs].max(axis=1)
    per_strain = stiffness * topology.rest_length
    assert per_strain[away < 0.012].mean() > 4 * per_strain[away > 0.024].mean()


def test_parts_have_their_own_stiffness_and_borders_the_mean_of_logarithms():
    points, sides = bar((20, 6, 6))
    part = points[:, 0] > 0.1
    topology = network(points, 0.02, float(np.prod(sides)), part)
    per_strain = predict(topology, [material(1e4), material(4e4)]).stiffness * topology.rest_length
    first, second = part[topology.springs].T
    soft, hard = per_strain[~first & ~second], per_strain[first & second]
    np.testing.assert_allclose(soft, soft[0], rtol=1e-5)
    np.testing.assert_allclose(hard, hard[0], rtol=1e-5)
    assert hard[0] == pytest.approx(4 * soft[0], rel=0.1)
    np.testing.assert_allclose(per_strain[first != second], 0.5 * (2.0 * soft[0] + 0.5 * hard[0]), rtol=1e-5)


def test_stiffer_than_affordable_is_limited_and_said():
    points, sides = bar((8, 4, 4))
    topology = network(points, 0.02, float(np.prod(sides)), grips=4)
    free, limited = predict(topology, [material(1e4)]), predict(topology, [material(1e8)])
    assert free.warnings == ()
    assert "stiffness limited from 1e+08 Pa to" in limited.warnings[0]
    stated = float(limited.warnings[0].split(" to ")[1].split(" Pa")[0])
    ratio = limited.stiffness[0] / free.stiffness[0]
    assert stated == pytest.approx(1e4 * ratio, rel=0.06)
    assert 100 < substeps(topology, limited) <= 250
    assert substeps(topology, free) < 250


def substeps(topology, parameters):
    """Per 1/30 s at 1.2 × the bound, from dense matrices with grips and dashpots."""
    count = len(topology.points)
    points = topology.points.astype(np.float64)
    stiff, damped = np.zeros((3 * count, 3 * count)), np.zeros((3 * count, 3 * count))
    dashpot = parameters.globals["dashpot_damping"].value
    pairs = [
        (i, j, points[j] - points[i], k)
        for (i, j), k in zip(topology.springs, parameters.stiffness, strict=True)
    ]
    for (c, j), k in zip(topology.controller_springs, parameters.controller_stiffness, strict=True):
        pairs.append((None, j, points[j] - topology.controller_points[c], k))
    for i, j, offset, k in pairs:
        row = np.zeros(3 * count)
        unit = offset / np.linalg.norm(offset)
        row[3 * j : 3 * j + 3] = unit
        if i is not None:
            row[3 * i : 3 * i + 3] = -unit
        stiff += k * np.outer(row, row)
        damped += dashpot * np.outer(row, row)
    scale = 1 / np.sqrt(np.repeat(topology.mass.astype(np.float64), 3))
    stiff, damped = stiff * np.outer(scale, scale), damped * np.outer(scale, scale)

    def stable(dt):
        return eigvalsh(dt**2 * stiff + 2 * dt * damped, subset_by_index=[3 * count - 1] * 2)[0] < 4

    low, high = 1e-5, 1e-1
    for _ in range(14):
        middle = np.sqrt(low * high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return int(np.ceil(1.2 / (30 * low)))


def test_grips_are_firmer_than_the_springs_they_hold():
    points, sides = bar((8, 4, 4))
    topology = network(points, 0.02, float(np.prod(sides)), grips=4)
    parameters = predict(topology, [material(1e4)])
    assert parameters.controller_stiffness.min() >= 0.99 * parameters.stiffness.min()
    assert parameters.controller_stiffness.mean() > 1.5 * np.median(parameters.stiffness)


def test_globals_are_volume_weighted_means_with_their_spread():
    points, sides = bar((20, 6, 6))
    part = points[:, 0] > 0.145
    topology = network(points, 0.02, float(np.prod(sides)), part)
    found = predict(topology, [material(friction=0.2), material(friction=0.8)]).globals
    share = part.mean()
    assert found["friction"].value == pytest.approx(0.2 ** (1 - share) * 0.8**share, rel=1e-6)
    spread = np.sqrt(0.3**2 + share * (1 - share) * np.log(4) ** 2)
    assert found["friction"].std == pytest.approx(found["friction"].value * spread, rel=1e-6)
    assert found["drag_rate"].value == pytest.approx(0.5)
    assert found["gravity"].value == (0.0, 0.0, -9.81)
    assert found["ground_height"].value == 0.1
    assert {entry.source for entry in found.values()} == {"prior"}
    gaps = cKDTree(topology.points).query(topology.points, 2)[0][:, 1]
    assert 0 < found["collision_distance"].value < gaps.min()
    assert "ground_height" not in predict(topology, [material()] * 2, ground=None).globals


def test_more_damping_more_dashpot_up_to_what_integration_affords():
    points, sides = bar((8, 4, 4))
    topology = network(points, 0.02, float(np.prod(sides)))
    values = [
        predict(topology, [material(1e4, damping=ratio)]).globals["dashpot_damping"].value
        for ratio in (0.02, 0.04, 5.0, 50.0)
    ]
    assert values[1] == pytest.approx(2 * values[0], rel=1e-6)
    assert values[2] == pytest.approx(values[3], rel=1e-6)
    assert values[2] > values[1]


def test_it_is_chosen_by_name():
    assert by_name(ALL_PREDICTORS, "prior-mean", "predictor") is PriorMeanPredictor
