"""The generators against closed forms: they are what a diagnosis is judged by."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.reality import fem, flex, lattice, shapes
from benchmarks.reality.hands import glide, stage
from benchmarks.reality.recipe import draw_material
from benchmarks.reality.world import Effect, Hand, Material, Motion, Scene, World

Simulate = Callable[[World], Motion]
ALL = pytest.mark.parametrize(
    "simulate", [fem.simulate, lattice.simulate, flex.simulate], ids=["fem", "mujoco", "flex"]
)
CONTINUA = pytest.mark.parametrize("simulate", [fem.simulate, flex.simulate], ids=["fem", "flex"])
BOTH = pytest.mark.parametrize("simulate", [fem.simulate, lattice.simulate], ids=["fem", "mujoco"])
UPRIGHT = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
"""Turns x downwards."""


def rope() -> shapes.Shape:
    return shapes.rope(np.random.default_rng(3), 120, False)


def bar() -> shapes.Shape:
    return shapes.block(np.random.default_rng(3), 120, "box")


def still(place: np.ndarray, reach: float, seconds: float) -> Hand:
    nothing = glide([], seconds)
    return Hand(place, reach, nothing, nothing)


def make(shape: shapes.Shape, hands: tuple[Hand, ...], seconds: float, turn: np.ndarray, **changes) -> World:
    density = {"rope": 0.1, "sheet": 0.3, "solid": 200.0}[shape.kind]
    young = density * 9.81 * shape.length / 0.04
    material = Material(density, (young, young), 0.0, 1e-3, 2.0, 0.5, 0.1)
    scene = Scene(np.linspace(0, seconds, 31), hands, turn, np.zeros(3), None)
    spacing = 0.02 if shape.kind == "rope" else 0.025
    return World(shape, replace(material, **changes), scene, (), spacing)


@BOTH
def test_a_rope_hanging_from_its_end_stretches_by_its_weight(simulate: Simulate):
    shape = rope()
    seconds, length = 2.5, shape.length
    top = UPRIGHT @ shape.curve(np.zeros(1))[0]
    world = make(shape, (still(top, 0.005, seconds),), seconds, UPRIGHT, drag_rate=8.0)
    motion = simulate(world)
    tip = motion.nodes[-1, :, 2].min() - motion.nodes[0, :, 2].min()
    expected = 0.1 * 9.81 * length**2 / (2 * world.material.stiffness[0])
    assert -tip == pytest.approx(expected, rel=0.15), "the hand gives a little as well"


@CONTINUA
def test_a_bar_of_tetrahedra_hangs_as_a_bar(simulate: Simulate):
    shape = bar()
    seconds = 2.0
    length, far = shape.length, 2.0
    # A sphere so large that it cuts the bar in a plane, an eighth of its length below the top.
    top = UPRIGHT @ np.array([shape.box[0, 0] - far, 0.0, shape.box[1, 2] / 2])
    world = make(shape, (still(top, far + length / 8, seconds),), seconds, UPRIGHT, drag_rate=10.0)
    motion = simulate(replace(world, spacing=0.0125 if simulate is fem.simulate else 0.018))
    heights = motion.nodes[0, :, 2]
    tip = (heights - motion.nodes[-1, :, 2])[heights < heights.min() + 1e-4].mean()
    held = np.linalg.norm(motion.nodes[0] - top, axis=1) <= far + length / 8
    free = heights[held].min() - heights.min()
    expected = 200 * 9.81 * free**2 / (2 * world.material.stiffness[0])
    assert tip == pytest.approx(expected, rel=0.05)


@CONTINUA
@pytest.mark.parametrize("poisson", [0.0, 0.3])
def test_a_sheet_of_triangles_hangs_as_a_membrane(simulate: Simulate, poisson: float):
    shape = shapes.sheet(np.random.default_rng(3), 120, "rectangle")
    seconds, far, length = 2.0, 2.0, shape.box[1, 0] - shape.box[0, 0]
    # A sphere so large that it cuts the sheet in a line, an eighth of its length below the top.
    top, reach = UPRIGHT @ np.array([shape.box[0, 0] - far, 0.0, 0.0]), far + length / 8
    world = make(shape, (still(top, reach, seconds),), seconds, UPRIGHT, drag_rate=10.0, poisson=poisson)
    motion = simulate(replace(world, spacing=length / 16))
    heights = motion.nodes[0, :, 2]
    lowest = heights < heights.min() + length / 100
    tip = (heights - motion.nodes[-1, :, 2])[lowest].mean()
    held = np.linalg.norm(motion.nodes[0] - top, axis=1) <= reach
    free = heights[held].min() - heights.min()
    expected = 0.3 * 9.81 * free**2 / (2 * world.material.stiffness[0])
    assert tip == pytest.approx(expected, rel=0.12), "of the free length a row of nodes is a fourteenth"


@ALL
def test_what_nothing_holds_falls_freely(simulate: Simulate):
    world = make(bar(), (), 0.5, np.eye(3), drag_rate=0.0)
    motion = simulate(world)
    fallen = motion.points[:, :, 2] - motion.points[0, :, 2]
    expected = -0.5 * 9.81 * world.scene.times**2
    np.testing.assert_allclose(fallen, expected[:, None] + 0 * fallen, atol=0.006)


@ALL
def test_drag_limits_the_fall(simulate: Simulate):
    rate = 4.0
    motion = simulate(make(bar(), (), 1.0, np.eye(3), drag_rate=rate))
    fallen = (motion.points[-1, :, 2] - motion.points[0, :, 2]).mean()
    assert fallen == pytest.approx(-9.81 / rate * (1.0 - (1 - np.exp(-rate)) / rate), rel=0.02)


def test_energy_is_kept_where_nothing_takes_it():
    shape = rope()
    end = shape.curve(np.zeros(1))[0]
    world = make(shape, (still(end, 0.005, 1.0),), 1.0, np.eye(3), drag_rate=0.0, damping=0.0)
    energy = fem.simulate(world).energy
    assert energy[:, 0].max() > 0.05, "it swings"
    total = energy[:, :3].sum(axis=1)
    # The spring of the hand damps and stores a little; it is the only one that may.
    assert np.abs(total - total[0]).max() < 0.03 * energy[:, 0].max()


def test_a_finer_mesh_changes_less_and_less():
    shape = rope()
    end = shape.curve(np.zeros(1))[0]
    world = make(shape, (still(end, 0.03, 1.0),), 1.0, np.eye(3))
    coarse, middle, fine = (fem.simulate(replace(world, spacing=h)).points for h in (0.04, 0.02, 0.01))
    assert np.abs(fine - middle).mean() < 0.6 * np.abs(middle - coarse).mean()


@BOTH
def test_a_stiff_rope_is_a_cantilever(simulate: Simulate):
    shape = rope()
    length, seconds, held = shape.length, 3.0, 0.1
    end = shape.curve(np.zeros(1))[0]
    world = make(shape, (still(end, held, seconds),), seconds, np.eye(3), drag_rate=6.0)
    world = replace(world, material=replace(world.material, stiffness=(1500.0, 1500.0), damping=1e-4))
    stiff = Effect("bending_stiffness", 0.5)
    try:
        motion = simulate(replace(world, spacing=0.04).with_effects(stiff))
    except fem.Runaway:
        pytest.fail("a coarse chain can be this stiff")
    # The first angle that can bend is at the last node held: half a segment before it begins the beam.
    nodes = motion.nodes[0, :, 0] - motion.nodes[0, :, 0].min()
    free = length - nodes[nodes <= held].max() + length / (len(nodes) - 1) / 2
    expected = free**4 / (8 * 0.5 * length**3)
    drop = motion.nodes[0, :, 2].min() - motion.nodes[-1, :, 2].min()
    assert drop == pytest.approx(expected, rel=0.1)


@ALL
@pytest.mark.parametrize(("tilt", "slides"), [(2.0, False), (8.0, True)])
def test_friction_holds_up_to_its_coefficient(simulate: Simulate, tilt: float, slides: bool):
    world = make(bar(), (), 0.8, np.eye(3), drag_rate=0.0, friction=0.5, restitution=0.0)
    world = replace(world, scene=replace(world.scene, ground=0.0))
    motion = simulate(world.with_effects(Effect("gravity_tilt", tilt, {"direction": (1.0, 0.0, 0.0)})))
    moved = (motion.points[-1] - motion.points[0])[:, 0].mean()
    if slides:
        assert moved == pytest.approx(0.5 * (tilt - 0.5 * 9.81) * 0.8**2, rel=0.15)
    else:
        assert abs(moved) < 0.03
    assert motion.points[-1, :, 2].min() > -0.004


def pulled(name: str, simulate: Simulate, amount: list[float], **options) -> np.ndarray:
    """Middle of a rope that is pulled between two hands, under gravity."""
    shape = rope()
    seconds = 3.0
    first, second = shape.handles["end"], shape.handles["other end"]
    t = np.linspace(0.1, 0.95, len(amount)) * seconds
    stops = [(when, (a * shape.length, 0.0, 0.0)) for when, a in zip(t, amount, strict=True)]
    hands = (still(first, 0.02, seconds), Hand(second, 0.02, glide(stops, seconds), glide([], seconds)))
    world = make(shape, hands, seconds, np.eye(3), drag_rate=6.0)
    plain = simulate(world).points
    changed = simulate(world.with_effects(Effect(name, options.pop("amplitude"), options))).points
    middle = plain.shape[1] // 2
    return changed[:, middle, 2] - plain[:, middle, 2]


@BOTH
def test_plastic_stays_longer_after_a_pull(simulate: Simulate):
    rise = pulled(
        "plasticity", simulate, [0, 0.15, 0.15, 0, 0], amplitude=0.8, sharpness=2.0, **{"yield": 0.01}
    )
    assert rise[-1] < -0.01, "it sags more where it was stretched for good"


@BOTH
def test_prony_stiffens_while_it_moves_and_lets_go(simulate: Simulate):
    rise = pulled("viscoelasticity", simulate, [0, 0.0, 0.1, 0.1, 0.1], amplitude=2.0, fast=0.05, slow=0.3)
    assert np.abs(rise).max() > 0.003
    assert abs(rise[-1]) < 0.3 * np.abs(rise).max(), "in a hold it forgets"


@BOTH
def test_mullins_softens_only_after_a_larger_strain(simulate: Simulate):
    rise = pulled("damage", simulate, [0, 0.15, 0.15, 0.02, 0.02], amplitude=0.8, scale=0.03)
    assert abs(rise[2]) < 0.2 * abs(rise[-1]), "at first loading it is as stiff as ever"
    assert rise[-1] < -0.005, "after the pull it sags more"


@BOTH
def test_stiffening_lifts_a_stretched_rope(simulate: Simulate):
    rise = pulled(
        "strain_stiffening", simulate, [0, 0.12, 0.12], amplitude=3.0, form=0.0, exponent=2.0, scale=0.1
    )
    assert rise[-1] > 0.0003


def test_both_generators_drag_and_lift_a_rope_alike():
    """Without effects, two codes that share nothing see the same: what each adds by itself is small."""
    for script, seed in (("drag", 3), ("lift", 1)):
        rng = np.random.default_rng(seed)
        shape = shapes.rope(rng, 60, False)
        scene = stage(script, shape, np.linspace(0, 2.0, 61), np.eye(3), np.zeros(3), rng)
        world = World(shape, draw_material(shape, rng), scene, (), 0.02)
        one, other = fem.simulate(world).points, lattice.simulate(world).points
        moved = np.linalg.norm(one[-1] - one[0], axis=1).max()
        assert np.linalg.norm(one - other, axis=2).mean() < 0.1 * moved
