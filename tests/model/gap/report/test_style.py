"""Scales that stay readable in grey and for colour-blind people."""

import numpy as np
import pytest

from model.gap.report.style import ACTION_SCALE, BASELINE, CEILING, EFFECT, FLOOR, GAP_SCALE, REFIT


def luminance(colour):
    linear = np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)
    return linear @ np.array([0.2126, 0.7152, 0.0722])


@pytest.mark.parametrize("scale", [GAP_SCALE, ACTION_SCALE])
def test_more_is_darker_throughout_and_visible_on_white(scale):
    light = luminance(np.asarray(scale.colors)[:, :3])
    assert (np.diff(light) < 0).all()
    assert light[0] < 0.8


def test_lines_and_bars_have_five_colours():
    assert len({BASELINE, REFIT, EFFECT, CEILING, FLOOR}) == 5
