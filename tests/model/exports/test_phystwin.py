"""The folder against PhysTwin's own rule, written here once more from its description."""

import json
import pickle
from dataclasses import replace

import numpy as np
import pytest
import torch
import trimesh

from model.errors import InputError
from model.exports.phystwin import PhystwinExporter
from model.types import Parameter

RADIUS, NEIGHBOURS, GRIP_RADIUS, GRIP_NEIGHBOURS, MASS = 0.055, 9, 0.05, 4, 0.01


def rebuild(points, controllers, options):
    """Springs as its playground makes them: by point, nearest first, none twice; then by controller."""
    made, pairs = set(), []
    for i, place in enumerate(points):
        away = np.linalg.norm(points - place, axis=1)
        near = [j for j in np.argsort(away, kind="stable") if away[j] <= options["object_radius"]]
        for j in near[: options["object_max_neighbours"]][1:]:
            if frozenset((i, j)) not in made and away[j] > 1e-4:
                made.add(frozenset((i, j)))
                pairs.append((i, int(j)))
    count = len(pairs)
    for i, place in enumerate(controllers):
        away = np.linalg.norm(points - place, axis=1)
        near = [j for j in np.argsort(away, kind="stable") if away[j] <= options["controller_radius"]]
        pairs += [(len(points) + i, int(j)) for j in near[: options["controller_max_neighbours"]]]
    return pairs, count


@pytest.fixture
def ruled(rope):
    """A twin whose springs PhysTwin's rule gives, in another order, of equal masses."""
    points, hands = rope.topology.points, rope.topology.controller_points
    options = {"object_radius": RADIUS, "object_max_neighbours": NEIGHBOURS}
    options |= {"controller_radius": GRIP_RADIUS, "controller_max_neighbours": GRIP_NEIGHBOURS}
    pairs, count = rebuild(points, hands, options)
    rng, nodes = np.random.default_rng(0), np.concatenate([points, hands])
    springs = rng.permutation(np.array(pairs[:count], np.int32))
    grips = rng.permutation(np.array(pairs[count:], np.int32))[:, :] - np.int32([len(points), 0])
    length = np.linalg.norm(points[springs[:, 0]] - points[springs[:, 1]], axis=1)
    held = np.linalg.norm(hands[grips[:, 0]] - points[grips[:, 1]], axis=1)
    assert len(nodes) == len(points) + len(hands)
    topology = replace(
        rope.topology,
        mass=np.full(len(points), MASS, np.float32),
        springs=springs,
        rest_length=length.astype(np.float32),
        controller_springs=grips,
        controller_rest_length=held.astype(np.float32),
    )
    parameters = replace(
        rope.parameters,
        stiffness=rng.uniform(20, 60, len(springs)).astype(np.float32),
        controller_stiffness=rng.uniform(20, 60, len(grips)).astype(np.float32),
        globals=rope.parameters.globals | {"ground_height": Parameter(0.02, "m", "user")},
    )
    return replace(rope, topology=topology, parameters=parameters)


def load(folder, name):
    return pickle.loads(next(folder.rglob(name)).read_bytes())


def test_its_rule_makes_the_same_springs_with_the_same_stiffness(ruled, tmp_path):
    PhystwinExporter()(ruled, tmp_path)
    data, options = load(tmp_path, "final_data.pkl"), load(tmp_path, "optimal_params.pkl")
    points, hands = (data[name][0].astype(float) for name in ("object_points", "controller_points"))
    pairs, count = rebuild(points, hands, options)
    checkpoint = torch.load(next(tmp_path.rglob("best_0.pth")), weights_only=True)
    assert checkpoint["num_object_springs"] == count == len(ruled.topology.springs)
    nodes = np.concatenate([points, hands]).astype(np.float64)
    ours = {
        frozenset(pair): stiffness
        for pair, stiffness in zip(ruled.topology.springs.tolist(), ruled.parameters.stiffness, strict=True)
    }
    ours |= {
        frozenset((point, len(points) + hand)): stiffness
        for (hand, point), stiffness in zip(
            ruled.topology.controller_springs.tolist(), ruled.parameters.controller_stiffness, strict=True
        )
    }
    assert len(pairs) == len(ours) == len(checkpoint["spring_Y"])
    for (i, j), strength in zip(pairs, checkpoint["spring_Y"].tolist(), strict=True):
        # k = Y / L, and everything over the mass of a point.
        stiffness = MASS * strength / np.linalg.norm(nodes[i] - nodes[j])
        assert stiffness == pytest.approx(ours[frozenset((i, j))], rel=1e-4)


def test_the_frame_is_z_down_with_the_ground_at_zero(ruled, tmp_path):
    PhystwinExporter()(ruled, tmp_path)
    data = load(tmp_path, "final_data.pkl")
    there, here = data["object_points"][0], ruled.topology.points
    np.testing.assert_allclose(there, (here - [0, 0, 0.02]) * [1, -1, -1], atol=1e-6)
    splats = trimesh.load(next(tmp_path.rglob("point_cloud.ply"))).vertices
    np.testing.assert_allclose(splats, there, atol=1e-6)
    frames = len(ruled.controls)
    assert data["controller_points"].shape == (frames, len(ruled.topology.controller_points), 3)
    assert data["object_visibilities"].all()
    assert data["surface_points"].shape == data["interior_points"].shape == (0, 3)


def test_the_camera_looks_at_the_object(ruled, tmp_path):
    PhystwinExporter()(ruled, tmp_path)
    (pose,), facts = (
        load(tmp_path, "calibrate.pkl"),
        json.loads(next(tmp_path.rglob("metadata.json")).read_text()),
    )
    points = load(tmp_path, "final_data.pkl")["object_points"][0]
    local = np.linalg.inv(pose) @ np.append(points.mean(axis=0), 1)
    pixel = (np.array(facts["intrinsics"][0]) @ local[:3])[:2] / local[2]
    assert local[2] > 0
    assert (0 < pixel).all()
    assert (pixel < facts["WH"]).all()
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1)


def test_global_parameters_are_per_mass(ruled, tmp_path):
    PhystwinExporter()(ruled, tmp_path)
    options = load(tmp_path, "optimal_params.pkl")
    assert options["dashpot_damping"] == pytest.approx(0.02 / MASS)
    assert (options["drag_damping"], options["collide_fric"], options["collide_elas"]) == (1.5, 0.5, 0.2)
    assert isinstance(options["object_max_neighbours"], int)
    text = (tmp_path / "README.md").read_text()
    assert "z down" in text
    assert "5e-5 s" in text


def test_harmonics_turn_with_the_world():
    """Half a turn about x, on the polynomials of degree 1 to 3 that a 3DGS file uses."""
    from model.exports.phystwin import TURNED

    def basis(x, y, z):
        return np.array([
            y, z, x, x * y, y * z, 2 * z * z - x * x - y * y, x * z, x * x - y * y, y * (3 * x * x - y * y),
            x * y * z, y * (4 * z * z - x * x - y * y), z * (2 * z * z - 3 * x * x - 3 * y * y),
            x * (4 * z * z - x * x - y * y), z * (x * x - y * y), x * (x * x - 3 * y * y),
        ])  # fmt: skip

    x, y, z = 0.3, -0.5, 0.7
    np.testing.assert_allclose(basis(x, -y, -z), TURNED * basis(x, y, z), atol=1e-12)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"topology": "mass"}, "masses differ"),
        ({"topology": "spring"}, "no radius and number of neighbours"),
        ({"topology": "loose"}, "nothing is held"),
        ({"topology": "stretched"}, "stretched or pressed at rest"),
        ({"gaussians": "flat"}, "not isotropic"),
        ({"parameters": "stiff"}, "up to 100000"),
        ({"parameters": "moon"}, "gravity is not 9.8"),
        ({"parameters": "damped"}, "it steps at 5e-05 s, and this twin needs"),
    ],
)
def test_a_twin_that_breaks_a_rule_is_refused_with_the_reason(ruled, tmp_path, change, reason):
    ((_, what),) = change.items()
    topology, parameters, gaussians = ruled.topology, ruled.parameters, ruled.gaussians
    if what == "mass":
        topology = replace(
            topology, mass=topology.mass * np.linspace(0.9, 1.1, len(topology.mass), dtype="f4")
        )
    elif what == "spring":
        topology = replace(topology, springs=topology.springs[1:], rest_length=topology.rest_length[1:])
        parameters = replace(parameters, stiffness=parameters.stiffness[1:])
    elif what == "loose":
        none = np.zeros((0, 2), np.int32), np.zeros(0, np.float32), np.zeros((0, 3), np.float32)
        topology = replace(
            topology, controller_springs=none[0], controller_rest_length=none[1], controller_points=none[2]
        )
        parameters = replace(parameters, controller_stiffness=none[1])
        ruled = replace(ruled, controls=None)
    elif what == "stretched":
        topology = replace(topology, rest_length=topology.rest_length * np.float32(0.98))
    elif what == "flat":
        gaussians = replace(gaussians, scales=gaussians.scales * np.float32([1, 1, 0.5]))
    elif what == "stiff":
        strong = np.full_like(parameters.stiffness, 6e4)
        parameters = replace(parameters, stiffness=strong)
    elif what == "damped":
        damped = Parameter(5e3 * float(topology.mass.min()), "N*s/m", "user")
        parameters = replace(parameters, globals=parameters.globals | {"dashpot_damping": damped})
    elif what == "moon":
        moon = Parameter((0.0, 0.0, -1.6), "m/s^2", "user")
        parameters = replace(parameters, globals=parameters.globals | {"gravity": moon})
    twin = replace(ruled, topology=topology, parameters=parameters, gaussians=gaussians)
    with pytest.raises(InputError, match=reason):
        PhystwinExporter()(twin, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_equal_distances_are_refused(ruled, tmp_path):
    """On a perfect grid the order of its springs would be chance."""
    from model.exports.phystwin_rule import spring_rule

    grid = np.stack(np.meshgrid(*[np.arange(3.0)] * 3), -1).reshape(-1, 3)
    apart = np.linalg.norm(grid[:, None] - grid, axis=-1)
    with pytest.raises(InputError, match="equally long"):
        spring_rule(grid.astype(np.float32), np.argwhere(np.triu((apart < 1.1) & (apart > 0))))
