"""How much nets resist bending."""

import numpy as np
import pytest

from benchmarks.gap.bent_nets import WEIGHT, anywhere, main, regular, rigidity, sheet_of
from model.gap.size import size_of
from model.gap.slight_bending import SLIGHT


def test_a_regular_net_bends_alike_in_all_directions_and_at_all_curvatures():
    """Rows in three directions, each √¾ of a spacing apart: 9/8 of the squared curvature in sum."""
    body = sheet_of(regular())
    found = np.stack([rigidity(body, curvature) for curvature in (0.5, 2.0)])
    np.testing.assert_allclose(found[0], found[1], rtol=0.01)
    meant = 9 / 8 / np.sqrt(0.75) * SLIGHT["sheet"] * WEIGHT * size_of(body.points)
    # rows end at the rim, which bears nothing
    assert found.mean() == pytest.approx(meant, rel=0.15)
    assert np.ptp(found) < 0.15 * found.mean()


def test_a_net_of_points_anywhere_hardly_does(capsys):
    body = sheet_of(anywhere(0))
    assert (
        rigidity(body, 0.5).mean()
        < rigidity(body, 6.0).mean()
        < 0.1 * rigidity(sheet_of(regular()), 6.0).mean()
    )
    assert main([]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 6


def test_says_that_it_takes_nothing(capsys):
    assert main(["more"]) == 2
    assert "takes no arguments" in capsys.readouterr().err
