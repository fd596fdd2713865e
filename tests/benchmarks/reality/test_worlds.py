import ast
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.reality import fem, flex, generate, lattice
from benchmarks.reality.effects import ALL, CATALOGUE, OUTSIDE, draw
from benchmarks.reality.hands import SCRIPTS, stage
from benchmarks.reality.magnitude import Simulate, Yardstick, checked_gap, gap, measure, tune
from benchmarks.reality.meshes import mesh
from benchmarks.reality.recipe import OBJECTS, category_of, draw_material, draw_recipe
from benchmarks.reality.sensor import draw_sensor, report
from benchmarks.reality.skin import attach, carry
from benchmarks.reality.world import Effect, Field, World
from model.observation import parse_observation
from model.observation_doubts import observation_doubts

FOLDER = Path(generate.__file__).parent
ALLOWED = "model.gap.benchmark.labels"
"""How labels are read is known to those who judge; nothing else of the model is of use here."""
NAMES = (
    "strain_stiffening viscoelasticity plasticity damage tension_only anisotropy bending_stiffness "
    "volume_preservation quadratic_air_drag wind gravity_tilt mass_heterogeneity grip_slip actuation_delay "
    "adhesion static_friction self_collision"
)


def small(kind: str, script: str, split: str = "test", seconds: float = 0.7) -> World:
    """A coarse, short world."""
    rng = np.random.default_rng(5)
    shape = OBJECTS[split][kind][0](rng, 40)
    times = np.arange(round(seconds * 30)) / 30.0
    scene = stage(script, shape, times, np.eye(3), np.zeros(3), rng)
    spacing = {"rope": 0.03, "sheet": shape.length / 9, "solid": 0.034}[kind]
    return World(shape, draw_material(shape, rng), scene, (), spacing)


def test_no_code_is_shared_with_what_is_judged():
    for path in FOLDER.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names = [name for name in names if name != ALLOWED]
            assert not any(name.split(".")[0] in ("model", "worker", "service") for name in names), path


def test_not_even_the_labels_bring_in_what_is_judged():
    text = (
        "import sys, benchmarks.reality.generate, benchmarks.reality.fem, benchmarks.reality.flex;"
        "print(*sorted(name for name in sys.modules if name.split('.')[0] == 'model'))"
    )
    done = subprocess.run([sys.executable, "-c", text], cwd=FOLDER.parents[1], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["model", "model.errors", "model.gap", "model.gap.benchmark", ALLOWED]


def test_the_catalogue_is_that_of_the_contract():
    assert set(CATALOGUE) == set(NAMES.split())
    assert len(OUTSIDE) >= 4
    for name in ALL:
        assert hasattr(fem._Run, f"_{name}"), name
        assert hasattr(lattice.Run, f"_{name}") or name in ("actuation_delay", "hand_torque"), name


@pytest.mark.parametrize("split", ["dev", "test"])
def test_shares_of_categories(split: str):
    counts = Counter(category_of(3, split, index) for index in range(200))
    assert counts["null"] == 60
    assert counts["pair"] == 30
    assert counts["outside"] == 20
    assert counts["single"] == 70
    assert min(counts[each] for each in ("perception", "actuation", "topology")) >= 5


def test_recipes_depend_on_seed_and_index_alone():
    first, again = draw_recipe(1, "test", 7), draw_recipe(1, "test", 7)
    np.testing.assert_array_equal(first.world.shape.surface, again.world.shape.surface)
    assert first.world.material == again.world.material
    other = draw_recipe(2, "test", 7)
    assert first.world.material != other.world.material


def test_worlds_with_and_without_effects_look_alike():
    """Object, interaction, frame and point counts are drawn the same way for both."""
    recipes = [draw_recipe(0, "test", index) for index in range(160)]
    for group in ("null", "single"):
        chosen = [r for r in recipes if r.category == group]
        kinds = Counter(r.world.shape.kind for r in chosen)
        assert all(kinds[kind] > 0.08 * len(chosen) for kind in ("rope", "sheet", "solid")), group
        assert len({r.world.scene.interaction for r in chosen}) >= 7
        frames = np.mean([len(r.world.scene.times) for r in chosen])
        assert 131 < frames < 141
    assert all(r.world.scene.interaction != r.transfer.scene.interaction for r in recipes)


@pytest.mark.parametrize("name", [name for name in ALL if name not in ("adhesion", "self_collision")])
def test_each_effect_moves_something_and_none_moves_nothing(name: str):
    kindred = ALL[name]
    kind = kindred.kinds[-1]
    script = next(s for s in kindred.excited_by if kind in SCRIPTS[s].kinds)
    world = small(kind, script)
    effect = draw(
        name, world.shape, kindred.range[1] ** 0.7 * kindred.range[0] ** 0.3, np.random.default_rng(1)
    )
    plain = fem.simulate(world).points
    np.testing.assert_array_equal(plain, fem.simulate(world).points)
    changed = fem.simulate(world.with_effects(effect))
    assert np.abs(changed.points - plain).max() > 2e-4
    nothing = fem.simulate(world.with_effects(replace(effect, amplitude=1e-9))).points
    assert np.abs(nothing - plain).mean() < 0.05 * np.abs(changed.points - plain).mean() + 1e-5
    acts = changed.acts[name]
    assert acts.shape == (plain.shape[1],)
    assert (acts >= 0).all()
    assert (acts <= 1).all()
    assert acts.max() > 0.3


@pytest.mark.parametrize("simulate", [fem.simulate, lattice.simulate], ids=["fem", "mujoco"])
def test_each_of_two_effects_has_its_own_place(simulate: Simulate):
    world = small("rope", "stretch")
    middle = tuple(world.shape.surface.mean(axis=0))
    left, right = (Field("half", middle, (side, 0.0, 0.0), 0.02) for side in (-1.0, 1.0))
    flow = Effect("viscoelasticity", 3.0, {"fast": 0.05, "slow": 0.3}, left)
    faint = Effect("plasticity", 1e-9, {"yield": 0.02, "sharpness": 2.0}, right)
    alone, both = simulate(world.with_effects(flow)).points, simulate(world.with_effects(flow, faint)).points
    elsewhere = simulate(world.with_effects(replace(flow, where=right))).points
    assert np.abs(both - alone).max() < 0.01 * np.abs(elsewhere - alone).max()


@pytest.mark.parametrize(
    "name", ["tension_only", "volume_preservation", "anisotropy", "wind", "grip_slip", "magnet"]
)
@pytest.mark.parametrize("simulate", [lattice.simulate, flex.simulate], ids=["springs", "flex"])
def test_mujoco_has_the_effects_too(name: str, simulate: Simulate):
    kindred = ALL[name]
    script = next(s for s in kindred.excited_by if "solid" in SCRIPTS[s].kinds)
    world = small("solid", script, "dev", 0.5)
    effect = draw(
        name, world.shape, kindred.range[1] ** 0.6 * kindred.range[0] ** 0.4, np.random.default_rng(1)
    )
    plain, changed = simulate(world).points, simulate(world.with_effects(effect)).points
    assert np.abs(changed - plain).max() > 2e-4


@pytest.mark.parametrize(("kind", "script"), [("rope", "stretch"), ("sheet", "fold"), ("solid", "press")])
def test_reports_are_observations_within_the_contract(kind: str, script: str):
    world = small(kind, script, seconds=1.0)
    rng = np.random.default_rng(2)
    motion = fem.simulate(world)
    sensor = replace(draw_sensor(rng), noise=0.002)
    arrays = report(motion.points, world.scene, sensor, rng)
    observation = parse_observation(arrays, "w.npz")
    assert observation.controllers.shape[1] >= 4
    assert [d for d in observation_doubts(observation) if "controllers" in d or "lost track" in d] == []
    seen = ~np.isnan(observation.points[..., 0])
    assert 0.6 < seen.mean() < 1.0
    error = (observation.points - motion.points)[seen]
    assert 0.001 < error.std() < 0.02
    # The hand is near what it holds, at every time.
    nearest = np.linalg.norm(motion.points[:, :, None] - observation.controllers[:, None], axis=3).min(
        axis=(1, 2)
    )
    assert nearest.max() < 0.06


def test_points_of_the_surface_follow_affine_motions():
    shape = OBJECTS["test"]["solid"][0](np.random.default_rng(0), 60)
    nodes = mesh(shape, 0.025, 0).nodes
    index, weight = attach(shape.surface, nodes)
    matrix = np.array([[1.1, 0.2, 0.0], [0.0, 0.9, 0.1], [0.0, 0.0, 1.2]])
    np.testing.assert_allclose(
        carry((nodes @ matrix.T)[None], index, weight)[0], shape.surface @ matrix.T, atol=1e-6
    )


def test_meshes_have_the_measure_of_the_shape():
    rng = np.random.default_rng(4)
    cloth = OBJECTS["test"]["sheet"][0](rng, 60)
    half = cloth.box[1, :2]
    assert mesh(cloth, 0.02, 0).measure.sum() == pytest.approx(np.pi * half.prod(), rel=0.12)
    box = OBJECTS["dev"]["solid"][0](rng, 60)
    whole = mesh(box, 0.022, 0)
    assert whole.measure.sum() == pytest.approx((box.box[1] - box.box[0]).prod(), rel=0.05)
    # Faces look outwards: the volume they enclose is the whole.
    a, b, c = (whole.nodes[whole.faces[:, k]] for k in range(3))
    assert np.einsum("nk,nk->n", a, np.cross(b, c)).sum() / 6 == pytest.approx(whole.measure.sum(), rel=1e-6)


def test_a_refit_explains_what_base_parameters_do():
    world = small("rope", "hang", seconds=1.2)
    stick = measure(world, fem.simulate, 0.001)
    softer = replace(world.material, stiffness=tuple(0.95 * k for k in world.material.stiffness))
    assert gap(stick, fem.simulate(replace(world, material=softer)).points) < 0.3
    assert gap(stick, stick.base) == pytest.approx(0.0, abs=1e-9)
    effect = draw("wind", world.shape, 1.0, np.random.default_rng(0))
    tuned = tune(stick, effect, ALL["wind"].range, 1.0, fem.simulate)
    assert tuned is not None
    assert tuned.magnitude == pytest.approx(1.0, rel=0.3)
    blown = fem.simulate(world.with_effects(tuned.effect)).points
    np.testing.assert_array_equal(blown, tuned.motion.points)
    assert checked_gap(stick, blown, fem.simulate) == pytest.approx(tuned.magnitude)
    assert tuned.magnitude <= gap(stick, blown), "a simulated refit explains no less than a linear one"
    assert isinstance(stick, Yardstick)


def test_command_writes_pairs_with_neutral_names(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    index = next(
        i
        for i in range(60)
        if draw_recipe(0, "test", i).category == "null"
        and draw_recipe(0, "test", i).world.shape.kind == "rope"
    )
    options = ["--split", "test", "--count", "1", "--first", str(index), "--workers", "1", "--out"]
    for folder in ("a", "b"):
        assert generate.main([*options, str(tmp_path / folder)]) == 0
    assert "1/1 worlds" in capsys.readouterr().out
    names = sorted(path.name for path in (tmp_path / "a").iterdir())
    assert names[-1] == "labels.sealed"
    stem = names[0].split(".")[0]
    assert names[:2] == [f"{stem}.npz", f"{stem}.transfer.npz"]
    assert not set(stem) - set("0123456789abcdef")
    for name in names:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes(), (
            "deterministic by seed"
        )
    capsys.readouterr()
    assert generate.main([*options, str(tmp_path / "a")]) == 0
    assert capsys.readouterr().out == "", "it is there already"
    with np.load(tmp_path / "a" / names[0]) as world:
        assert set(world) <= {"times", "points", "controllers", "gravity", "ground_height"}
    with pytest.raises(SystemExit):
        generate.main([*options, str(tmp_path / "c"), "--generator", "mujoco"])
