"""Bodies beside objects of which it is known how hard they are to turn."""

import numpy as np

from benchmarks.gap.gyration import gyration, main


def test_a_box_has_the_gyration_of_a_box():
    size = np.array([0.4, 0.3, 0.1])
    places = np.random.default_rng(0).uniform(0.0, size, (100_000, 3))
    found = gyration(places, np.full(len(places), 1.0 / len(places)))
    np.testing.assert_allclose(found, size / np.sqrt(12.0), rtol=0.01)


def test_bodies_are_as_hard_to_turn_as_objects(capsys):
    assert main(["--count", "6"]) == 0
    rows = capsys.readouterr().out.splitlines()[2:]
    assert rows
    for row in rows:
        _, _, _, found, _, off, _ = row.split("|")
        assert all(abs(float(one) - 1.0) < 0.05 for one in found.split(","))
        assert float(off) < 0.06
