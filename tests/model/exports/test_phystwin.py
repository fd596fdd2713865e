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
from model.formats.ply import decode_ply
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
        ({"topology": "few"}, "no radius and number of neighbours"),
        ({"topology": "loose"}, "nothing is held"),
        ({"topology": "stretched"}, "stretched or pressed at rest"),
        ({"parameters": "stiff"}, "up to 100000"),
        ({"parameters": "moon"}, "gravity is not 9.8"),
        ({"parameters": "damped"}, "it steps at 5e-05 s, and this twin needs"),
    ],
)
def test_a_twin_that_breaks_a_rule_is_refused_with_the_reason(ruled, tmp_path, change, reason):
    ((_, what),) = change.items()
    topology, parameters, gaussians = ruled.topology, ruled.parameters, ruled.gaussians
    if what == "few":
        longest = [int(topology.rest_length.argmax())]
        topology = replace(
            topology, springs=topology.springs[longest], rest_length=topology.rest_length[longest]
        )
        parameters = replace(parameters, stiffness=parameters.stiffness[longest])
    elif what == "loose":
        none = np.zeros((0, 2), np.int32), np.zeros(0, np.float32), np.zeros((0, 3), np.float32)
        topology = replace(
            topology, controller_springs=none[0], controller_rest_length=none[1], controller_points=none[2]
        )
        parameters = replace(parameters, controller_stiffness=none[1])
        ruled = replace(ruled, controls=None)
    elif what == "stretched":
        topology = replace(topology, rest_length=topology.rest_length * np.float32(0.98))
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


def test_what_the_rule_makes_and_the_twin_has_not_is_left_out(ruled, tmp_path):
    """As of a twin from a video, whose springs also ask whether the body lies between two points."""
    topology, stiffness = ruled.topology, ruled.parameters.stiffness
    kept = np.setdiff1d(np.arange(len(topology.springs)), [1, 7])
    gone = [frozenset(pair) for pair in topology.springs[[1, 7]].tolist()]
    fewer = replace(
        ruled,
        topology=replace(topology, springs=topology.springs[kept], rest_length=topology.rest_length[kept]),
        parameters=replace(ruled.parameters, stiffness=stiffness[kept]),
    )
    PhystwinExporter()(fewer, tmp_path)
    data, options = load(tmp_path, "final_data.pkl"), load(tmp_path, "optimal_params.pkl")
    pairs, count = rebuild(data["object_points"][0], data["controller_points"][0], options)
    checkpoint = torch.load(next(tmp_path.rglob("best_0.pth")), weights_only=True)
    assert checkpoint["num_object_springs"] == count == len(kept) + 2
    strength = checkpoint["spring_Y"]
    assert {frozenset(pairs[i]) for i in range(count) if strength[i] == 0} == set(gone)
    assert torch.exp(torch.log(strength[strength == 0])).eq(0).all(), "what its simulator asks"


def playground(folder, frames):
    """Its simulator from the files alone, controllers at rest; step after step, as its kernels are written.

    Reference:
        Jianghanxiao/PhysTwin, qqtt/model/diff_simulator/spring_mass_warp.py: `eval_springs`,
        `update_vel_from_force`, `integrate_ground_collision`.
    """
    data, options = load(folder, "final_data.pkl"), load(folder, "optimal_params.pkl")
    points, hands = (data[name][0].astype(float) for name in ("object_points", "controller_points"))
    pairs = np.array(rebuild(points, hands, options)[0])
    checkpoint = torch.load(next(folder.rglob("best_0.pth")), weights_only=True)
    strength, dt = checkpoint["spring_Y"].numpy().astype(float), 5e-5
    nodes, speed = np.concatenate([points, hands]), np.zeros((len(points) + len(hands), 3))
    with np.errstate(divide="ignore"):
        acts = np.exp(np.log(strength)) > 0
    (i, j), strength = pairs[acts].T, strength[acts, None]
    rest = np.linalg.norm(nodes[i] - nodes[j], axis=1, keepdims=True)
    count, made, fall = len(points), [points.copy()], np.array([0.0, 0.0, 9.8])
    for step in range(667 * frames):
        apart = nodes[j] - nodes[i]
        length = np.linalg.norm(apart, axis=1, keepdims=True)
        along = apart / length
        closing = ((speed[j] - speed[i]) * along).sum(1, keepdims=True)
        pull = (strength * (length / rest - 1) + options["dashpot_damping"] * closing) * along
        force = np.zeros_like(nodes)
        np.add.at(force, i, pull)
        np.add.at(force, j, -pull)
        moved = (speed[:count] + (force[:count] + fall) * dt) * np.exp(-dt * options["drag_damping"])
        assert (nodes[:count, 2] + moved[:, 2] * dt < 0).all(), "above the ground, z down"
        speed[:count] = moved
        nodes[:count] += moved * dt
        if (step + 1) % 667 == 0:
            made.append(nodes[:count].copy())
    return np.array(made)


def test_its_simulator_moves_the_files_as_the_twin_moves(ruled, tmp_path):
    """Springs that the rule makes beyond the twin's own do nothing."""
    topology = ruled.topology
    kept = np.setdiff1d(np.arange(len(topology.springs)), [1, 7, 20])
    held = np.repeat(ruled.controls[:1], 6, axis=0)
    fewer = replace(
        ruled,
        topology=replace(topology, springs=topology.springs[kept], rest_length=topology.rest_length[kept]),
        parameters=replace(
            ruled.parameters,
            stiffness=ruled.parameters.stiffness[kept],
            globals=ruled.parameters.globals | {"ground_height": Parameter(-1.0, "m", "user")},
        ),
        controls=held,
    )
    PhystwinExporter()(fewer, tmp_path)
    theirs = playground(tmp_path, 5) * [1, -1, -1] + [0, 0, -1]
    ours = fewer.rollout(times=np.arange(6) * 667 * 5e-5).points
    assert np.linalg.norm(ours - ours[0], axis=-1).max() > 0.01
    assert np.linalg.norm(theirs - ours, axis=-1).max() < 5e-4


def test_unequal_masses_and_flat_gaussians_cost_what_is_said(ruled, tmp_path):
    assert not any("heavy" in line or "round" in line for line in PhystwinExporter().losses(ruled))
    mass = ruled.topology.mass * np.linspace(0.5, 1.5, len(ruled.topology.mass), dtype="f4")
    flat = replace(ruled.gaussians, scales=ruled.gaussians.scales * np.float32([1, 1, 0.5]))
    twin = replace(ruled, topology=replace(ruled.topology, mass=mass), gaussians=flat)
    apart = 1e3 * np.linalg.norm(twin.rollout().points - ruled.rollout().points, axis=-1)
    heavy, broad = PhystwinExporter().losses(twin)[-2:]
    assert f"{apart.mean():.2g} mm on average, {apart.max():.2g} mm at most" in heavy
    assert apart.max() > 0.1
    assert "round" in broad
    PhystwinExporter()(twin, tmp_path)
    assert heavy in (tmp_path / "README.md").read_text()
    splats = decode_ply(next(tmp_path.rglob("point_cloud.ply")).read_bytes(), "ply")
    np.testing.assert_allclose(splats.scales, ruled.gaussians.scales, rtol=1e-5)


def test_equal_distances_are_refused(ruled, tmp_path):
    """On a perfect grid the order of its springs would be chance."""
    from model.exports.phystwin_rule import spring_rule

    grid = np.stack(np.meshgrid(*[np.arange(3.0)] * 3), -1).reshape(-1, 3)
    apart = np.linalg.norm(grid[:, None] - grid, axis=-1)
    with pytest.raises(InputError, match="equally long"):
        spring_rule(grid.astype(np.float32), np.argwhere(np.triu((apart < 1.1) & (apart > 0))))
