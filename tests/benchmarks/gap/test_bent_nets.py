"""How much nets resist bending."""

import numpy as np
import pytest

from benchmarks.gap.bent_nets import WEIGHT, anywhere, main, regular, rigidity, sheet_of, themselves
from model.gap.size import size_of
from model.gap.slight_bending import SLIGHT


def meant(body):
    """Flexural rigidity [N·m]."""
    return SLIGHT["sheet"] * WEIGHT * size_of(body.points)


def test_a_regular_net_bends_alike_in_all_directions_and_at_all_curvatures():
    """Rows in three directions, each √¾ of a spacing apart: 9/8 of the squared curvature in sum."""
    body = themselves(regular())
    found = np.stack([rigidity(body, curvature) for curvature in (0.5, 2.0)])
    np.testing.assert_allclose(found[0], found[1], rtol=0.01)
    # rows end at the rim, which bears nothing
    assert found.mean() == pytest.approx(9 / 8 / np.sqrt(0.75) * meant(body), rel=0.15)
    assert np.ptp(found) < 0.15 * found.mean()


@pytest.mark.parametrize("places", [regular(), anywhere(0), anywhere(1)], ids=["regular", "lot", "other lot"])
def test_a_sheet_has_such_a_net_wherever_its_points_were_tracked(places):
    body = sheet_of(places)
    found = np.stack([rigidity(body, curvature) for curvature in (0.5, 6.0)])
    np.testing.assert_allclose(found[0], found[1], rtol=0.05)
    assert found.mean() == pytest.approx(meant(body), rel=0.2)
    assert np.ptp(found[0]) < 0.2 * found.mean()


def test_a_net_of_points_anywhere_hardly_does(capsys):
    body = themselves(anywhere(0))
    assert rigidity(body, 0.5).mean() < rigidity(body, 6.0).mean() < 0.01 * meant(body)
    assert main([]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 10


def test_says_that_it_takes_nothing(capsys):
    assert main(["more"]) == 2
    assert "takes no arguments" in capsys.readouterr().err
