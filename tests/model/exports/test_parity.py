"""Exported twins, run by the scripts that they carry, against our own rollout."""

import pytest


@pytest.mark.parametrize(
    ("simulator", "shape", "bar"),
    [
        ("mujoco", "sheet", 1e-4),
        ("mujoco", "rope", 1e-4),
        ("mujoco", "solid", 1e-4),
        ("newton", "rope", 5e-4),
    ],
)
def test_a_hanging_twin_moves_there_as_it_does_here(bench, tmp_path, simulator, shape, bar):
    twin = bench("procedural").SHAPES[shape](size=4)
    parity = bench("parity").compare(twin, simulator, tmp_path)
    assert parity.travel > 0.02
    assert parity.maximum < bar


@pytest.mark.parametrize(
    ("simulator", "bar"), [("mujoco", 5e-4), ("mujoco, own contact", 5e-3), ("newton", 5e-4)]
)
def test_a_falling_twin_meets_the_ground_there_as_it_does_here(bench, falling, tmp_path, simulator, bar):
    parity = bench("parity").compare(falling, simulator, tmp_path)
    assert parity.travel > 0.05
    assert parity.maximum < bar


def test_a_lively_block_bounces_as_it_does_here(bench, tmp_path):
    lively = bench("procedural").solid(ground=True, restitution=0.5)
    parity = bench("parity").compare(lively, "mujoco", tmp_path)
    assert parity.travel > 0.05
    assert parity.maximum < 5e-4


def test_a_wrong_stiffness_would_be_seen(bench, rope, tmp_path, monkeypatch):
    """A tenth less is far above the bar: the comparison can fail."""
    from model.exports import mujoco

    monkeypatch.setattr(mujoco, "_tendons", _softened(mujoco._tendons))
    assert bench("parity").compare(rope, "mujoco", tmp_path).maximum > 1e-3


def _softened(tendons):
    from dataclasses import replace

    return lambda mechanics: tendons(replace(mechanics, stiffness=0.9 * mechanics.stiffness))
