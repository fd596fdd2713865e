"""Fits of one effect from everywhere: found where it is at work, refused where it cannot act."""

import pytest

from benchmarks.gap.law_form import main
from model.observation import write_observation


@pytest.fixture
def recording(tmp_path, tilted):
    write_observation(tmp_path / "tilted.npz", tilted((7.0, 4.0)))
    return str(tmp_path / "tilted.npz")


def test_a_tilt_explains_a_tilted_rope(recording, capsys):
    assert main(["gravity_tilt", recording, "--looks", "24"]) == 0
    name, shape, noise, left, with_it, values = (
        capsys.readouterr().out.splitlines()[2].strip("| ").split(" | ")
    )
    assert (name, shape) == ("tilted", "rope")
    assert float(with_it) < 0.5 * float(left)
    assert float(with_it) < 2.0
    assert 0.4 < float(noise) < 1.2
    found = dict(one.split() for one in values.split(", "))
    assert float(found["about_x"]) == pytest.approx(0.3, abs=0.05)
    assert float(found["about_y"]) == pytest.approx(-0.2, abs=0.05)


def test_what_cannot_act_is_said(recording):
    with pytest.raises(SystemExit, match="adhesion cannot act in this recording: there is no ground"):
        main(["adhesion", recording])
