"""What is changed of an observation, what is not, and what is counted of the answers; no diagnosis is run."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.gap import invariance
from benchmarks.gap.invariance import VARIANTS, Said, change_of, table
from model.observation import write_observation
from model.types import Observation

FRAMES, POINTS = 18, 9


@pytest.fixture
def seen():
    rng = np.random.default_rng(5)
    points = rng.normal(0, 0.1, (FRAMES, POINTS, 3)).astype(np.float32)
    points[..., 0] += np.linspace(0.0, 4.0, FRAMES, dtype=np.float32)[:, None]  # farther than its noise
    points[2, 4] = np.nan
    return Observation(
        times=np.arange(FRAMES) / 30.0,
        points=points,
        controllers=rng.normal(0, 0.1, (FRAMES, 2, 3)).astype(np.float32),
        ground_height=-0.3,
        gravity=(1.0, 0.0, -9.7),
        colors=np.arange(3 * POINTS, dtype=np.uint8).reshape(POINTS, 3),
        parts=np.arange(POINTS),
    )


@pytest.mark.parametrize("name", ["turned", "shifted", "lifted"])
def test_a_rigid_motion_keeps_distances_and_what_is_unseen(name, seen):
    moved = VARIANTS[name](seen)
    both = [np.concatenate([one.points, one.controllers], 1) for one in (seen, moved)]
    apart = [np.linalg.norm(each[:, :, None] - each[:, None], axis=-1) for each in both]
    np.testing.assert_allclose(apart[1], apart[0], atol=1e-6)
    assert np.abs(both[1] - both[0])[0].max() > 0.05
    assert moved.points.dtype == moved.controllers.dtype == np.float32
    assert np.isnan(moved.points[2, 4]).all()


def test_a_turn_is_about_the_vertical_and_turns_gravity_as_well(seen):
    moved = VARIANTS["turned"](seen)
    np.testing.assert_array_equal(moved.points[..., 2], seen.points[..., 2])
    assert moved.ground_height == seen.ground_height
    assert moved.gravity[2] == seen.gravity[2]
    assert np.hypot(*moved.gravity[:2]) == pytest.approx(1.0)
    # the angle between gravity and what is seen stays
    for before, after in ((seen.points, moved.points), (seen.controllers, moved.controllers)):
        np.testing.assert_allclose(
            after @ np.array(moved.gravity), before @ np.array(seen.gravity), atol=1e-5
        )
    x, y, _ = moved.gravity
    assert np.rad2deg(np.arctan2(y, x)) == pytest.approx(37.0)


def test_the_ground_is_lifted_along_and_only_then(seen):
    shifted, lifted = VARIANTS["shifted"](seen), VARIANTS["lifted"](seen)
    assert shifted.ground_height == seen.ground_height
    np.testing.assert_array_equal(shifted.points[..., 2], seen.points[..., 2])
    assert lifted.ground_height == pytest.approx(seen.ground_height + 0.45)
    up = lifted.points[..., 2] - seen.points[..., 2]
    np.testing.assert_allclose(up[np.isfinite(up)], 0.45, atol=1e-6)
    assert VARIANTS["lifted"](Observation(seen.times, seen.points, seen.controllers)).ground_height is None


def test_another_order_is_the_same_for_both_recordings_and_all_keys(seen):
    moved, again = (VARIANTS["permuted"](seen) for _ in range(2))
    np.testing.assert_array_equal(moved.parts, again.parts)
    assert sorted(moved.parts) == list(range(POINTS))
    assert list(moved.parts) != list(range(POINTS))
    np.testing.assert_array_equal(moved.points, seen.points[:, moved.parts])
    np.testing.assert_array_equal(moved.colors, seen.colors[moved.parts])
    np.testing.assert_array_equal(moved.controllers, seen.controllers)


def test_half_of_the_points_are_every_other(seen):
    moved = VARIANTS["halved"](seen)
    np.testing.assert_array_equal(moved.parts, [0, 2, 4, 6, 8])
    np.testing.assert_array_equal(moved.points, seen.points[:, ::2])


def of(verdict, probability, **effects):
    return Said(verdict, probability, effects, 1.0)


def test_a_change_is_the_largest_of_any_probability():
    first = of("wind", 0.8, wind=0.8, damage=0.1)
    assert change_of(first, of("wind", 0.7, wind=0.7, damage=0.3)) == pytest.approx(0.2)
    assert change_of(of("none", 0.9, wind=0.1), of("none", 0.6, wind=0.1)) == pytest.approx(0.3)
    # the probability of another verdict is not one to compare with
    assert change_of(of("none", 0.9, wind=0.1), of("unknown", 0.6, wind=0.2)) == pytest.approx(0.1)
    assert change_of(first, of(invariance.REFUSED, 1.0)) == pytest.approx(0.8)


def test_the_table_counts_verdicts_that_stay():
    results = {(world, name): of("wind", 0.8, wind=0.8) for world in "ab" for name in VARIANTS}
    results["b", "turned"] = of("damage", 0.5, wind=0.2, damage=0.5)
    rows = {
        line.split(" | ")[0].strip("| "): line.strip("| ").split(" | ")
        for line in table(results).splitlines()
    }
    assert rows["b"][2] == "**damage** 0.50"
    assert rows["b"][-1] == "0.60"
    assert rows["a"] == ["a", *["wind 0.80"] * len(VARIANTS), "0.00"]
    assert rows["same verdict"] == ["same verdict", "1.00", "0.50", *["1.00"] * 4, "0.50"]
    assert rows["largest change"][2] == "0.60"


@pytest.fixture
def worlds(seen, tmp_path):
    folder = tmp_path / "worlds"
    folder.mkdir()
    for name in ("a", "b"):
        write_observation(folder / f"{name}.npz", seen)
        other = replace(seen, points=1.1 * seen.points)
        write_observation(folder / f"{name}.transfer.npz", other)
    return folder


@pytest.fixture
def asked(monkeypatch):
    """A stand-in for the diagnosis: wind, unless it was turned; and what it was asked."""
    asked = []

    def diagnose(observation, transfer=None):
        asked.append((observation, transfer))
        name = "damage" if observation.gravity[1] else "wind"
        finding = SimpleNamespace(name=name, probability=0.7)
        verdict = SimpleNamespace(effect=name, probability=0.7)
        return SimpleNamespace(
            findings=SimpleNamespace(report=SimpleNamespace(verdict=verdict, effects=[finding]))
        )

    monkeypatch.setattr(invariance, "diagnose", diagnose)
    return asked


def test_every_variant_is_asked_once_and_kept(worlds, asked, tmp_path, capsys):
    arguments = [str(worlds), "--count", "1", "--out", str(tmp_path / "out")]
    assert invariance.main(arguments) == 0
    first = capsys.readouterr().out
    assert len(asked) == len(VARIANTS)
    assert all(transfer is None for _, transfer in asked)
    assert "| a | wind 0.70 | **damage** 0.70 | wind 0.70 |" in first
    assert "| b |" not in first
    assert invariance.main(arguments) == 0
    assert len(asked) == len(VARIANTS)
    assert capsys.readouterr().out == first


def test_another_file_of_the_name_is_asked_again(worlds, asked, seen, tmp_path, capsys):
    arguments = [str(worlds), "--count", "1", "--out", str(tmp_path / "out")]
    invariance.main(arguments)
    write_observation(worlds / "a.npz", Observation(seen.times, seen.points[:, :-1], seen.controllers))
    invariance.main(arguments)
    assert len(asked) == 2 * len(VARIANTS)
    capsys.readouterr()


def test_the_other_recording_is_changed_in_the_same_way(worlds, asked, tmp_path, capsys):
    assert invariance.main([str(worlds), "--transfer", "--out", str(tmp_path / "out")]) == 0
    assert len(asked) == 2 * len(VARIANTS)
    for one, other in asked:
        np.testing.assert_allclose(
            other.points - other.points[0], 1.1 * (one.points - one.points[0]), atol=1e-5
        )
        assert one.gravity == other.gravity
    capsys.readouterr()


def test_nothing_to_change_is_said_in_one_line(tmp_path, worlds, capsys):
    (worlds / "b.transfer.npz").unlink()
    for arguments, line in (
        ([str(tmp_path)], "expected worlds NAME.npz, found none"),
        ([str(worlds), "--transfer"], "expected the other recording of b.npz"),
    ):
        with pytest.raises(SystemExit) as ended:
            invariance.main([*arguments, "--out", str(tmp_path / "out")])
        assert ended.value.code == 2
        assert line in capsys.readouterr().err
