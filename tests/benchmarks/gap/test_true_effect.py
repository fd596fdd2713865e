"""What an effect that is known explains: found where it is at work, and told of both recordings."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.gap.true_effect import main, widths_off
from benchmarks.reality.labels import write_labels
from model.gap.coordinates import Coordinates
from model.gap.effects.base import Quantity
from model.observation import write_observation

PULL = 9.81 * np.array([-np.cos(0.3) * np.sin(-0.2), np.sin(0.3), 1.0 - np.cos(0.3) * np.cos(-0.2)])
"""What the tilt adds to gravity [m/s²]."""
SIZE = float(np.linalg.norm(PULL))
EFFECT = {"name": "gravity_tilt", "amplitude": SIZE, "options": {"direction": (PULL / SIZE).tolist()}}
LABEL = {"world": "tilted", "kind": "rope", "category": "single", "accepted": ["gravity_tilt"]}
LABEL |= {"effects": [EFFECT]}
LABEL |= {"generator": "made", "magnitude": 4.0}


def test_a_tilt_that_is_known_explains_what_the_plain_twin_leaves(tmp_path, capsys, tilted):
    write_observation(tmp_path / "tilted.npz", tilted((7.0, 4.0)))
    write_observation(tmp_path / "tilted.transfer.npz", tilted((3.0, 8.0)))
    faint = LABEL | {"world": "faint", "magnitude": 0.5}
    healthy = LABEL | {"world": "healthy", "accepted": ["none"], "magnitude": None}
    write_labels(tmp_path, [LABEL, faint, healthy], sealed=False)
    assert main([str(tmp_path)]) == 0
    rows = capsys.readouterr().out.splitlines()
    assert len(rows) == 6, "those that are too faint, or healthy, are not asked"
    cells = rows[2].split(" | ")
    assert cells[:3] == ["| tilted", "rope", "gravity_tilt"]
    left, with_it, later, later_with_it, elsewhere, elsewhere_with_it = map(float, cells[3:9])
    assert with_it < 1.5 < 0.5 * left
    assert later_with_it < 0.5 * later
    assert elsewhere_with_it < 0.8 * elsewhere
    assert float(cells[9]) > 0.2
    off = dict(one.split() for one in cells[10].rstrip(" |").split(", "))
    assert set(off) == {"about_x", "about_y"}
    assert max(map(float, off.values())) < 2.0
    for row, which in (
        (rows[3], "1 worlds: e-folds explained "),
        (rows[4], "1 of signal-to-noise 2 or more: "),
    ):
        assert row.startswith(which)
        assert row.endswith("; 0 are worse there with it")
    assert " of 2 intervals of strengths hold the truth, nine of ten " in rows[5]


def test_a_strength_is_off_by_what_its_interval_reaches_to_that_side():
    """Logarithms of what spans decades."""
    excess = "mass_heterogeneity.excess"
    coordinates = Coordinates({excess: Quantity("1", (0.1, 50.0), 1.0, log=True)})
    found = SimpleNamespace(
        intervals={excess: (2.0, 16.0)},
        estimate=SimpleNamespace(values={excess: 4.0}),
        misfit=SimpleNamespace(coordinates=coordinates),
    )

    def off(amplitude):
        effect = {"name": "mass_heterogeneity", "amplitude": amplitude, "options": {}}
        return widths_off({"accepted": ["mass_heterogeneity"], "effects": [effect]}, found)["excess"]

    assert off(2.0) == pytest.approx(1.0)
    assert off(8.0) == pytest.approx(0.5)
    assert off(0.5) == pytest.approx(3.0)
    assert widths_off({"accepted": ["wind"], "effects": []}, found) == {}
    assert widths_off({"accepted": ["actuation_delay", "none"], "effects": []}, found) == {}


def test_sealed_worlds_are_not_looked_at(tmp_path, capsys):
    write_labels(tmp_path, [LABEL], sealed=True)
    with pytest.raises(SystemExit) as ended:
        main([str(tmp_path)])
    assert ended.value.code == 2
    assert "no open labels" in capsys.readouterr().err
