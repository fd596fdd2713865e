"""What exports to simulators are written from."""

from dataclasses import replace

import pytest

from model.exports.mechanics import FPS, mechanics_of


def test_a_motion_of_one_frame_has_the_time_step_of_a_longer_one(sheet):
    """It has not moved yet; whoever loads the file will let it."""
    still = mechanics_of(replace(sheet, controls=sheet.controls[:1]))
    moved = mechanics_of(sheet)
    assert still.interval == 1.0 / FPS
    assert still.step == pytest.approx(moved.step, rel=0.3)
    assert still.needed == pytest.approx(1.2 * still.step)
