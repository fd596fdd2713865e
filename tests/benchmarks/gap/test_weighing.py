"""Weights learned from worlds whose answers follow a known rule; others are judged by them."""

import json
from dataclasses import asdict, replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import norm

from benchmarks.gap.accounts import Told, told_in
from benchmarks.gap.weighing import (
    USUAL,
    beside_lattices,
    learned,
    left_over,
    main,
    scores,
    unseen,
    usual,
    usual_beside_lattices,
)
from model.gap.account import MEANING, Account, Explained
from model.gap.schema import EFFECT_NAMES
from model.gap.weighing import HEALTHY, RESIDUE, WEIGHTS, WIDTH, Weighing

TOLD = Path(__file__).parents[3] / "benchmarks" / "gap" / "told"
ALIKE = dict.fromkeys(EFFECT_NAMES, 1.0 / len(EFFECT_NAMES))


def told(number, right, explained, left=(2.0, 2.0), shape="rope", magnitude=3.0, generator="mujoco"):
    account = Account(shape, ALIKE, explained, explained, left)
    return Told(f"{number:03d}", "made", generator, right, None if "none" in right else magnitude, account)


@pytest.fixture
def worlds():
    """What is at work explains about 1.5, what is not about 0.2; what leaves much, with whatever effect, is
    of no catalogue.
    """
    rng = np.random.default_rng(3)
    found = []
    for number in range(60):
        shape = ("rope", "sheet", "solid")[number % 3]
        little = Explained(*rng.uniform(0.0, 0.15, 3))
        if number % 4 == 0:
            found.append(told(number, ("none",), {"wind": little, "damage": little}, shape=shape))
        elif number % 4 == 1:
            left = tuple(rng.uniform(40.0, 90.0, 2))
            found.append(told(number, ("unknown",), {"wind": little}, left, shape))
        else:
            much = Explained(*rng.uniform(0.4, 0.9, 3))
            name, other = ("wind", "damage") if number % 4 == 2 else ("damage", "wind")
            found.append(told(number, (name,), {other: little, name: much}, shape=shape))
    return found


def test_what_is_right_is_learned_and_holds_for_worlds_not_learned_from(worlds):
    found = scores(list(unseen(worlds, lambda one: one.world[-1])))
    assert found["worlds"] == 60
    assert found["top-1 of effects"] == found["recall of unknown"] == 1.0
    assert found["false alarms"] == 0.0
    weighing = learned(worlds)
    assert weighing.fitted > 0
    assert weighing.left > 0
    assert weighing.effect < 0


def test_what_a_force_explains_and_no_effect_teaches_what_is_unknown(worlds):
    """And a world of which nobody asked it teaches nothing of it."""

    def asked(one, force):
        near = replace(one.account, left=(2.0, 2.0))
        return replace(one, account=replace(near, flexible=None if force is None else Explained(force)))

    forces = {"unknown": 2.0, "none": 0.0}
    of_all = [asked(one, forces.get(one.right[0], 0.3)) for one in worlds]
    assert learned(of_all).flexible > USUAL.flexible
    assert learned([asked(one, None) for one in worlds]).flexible == pytest.approx(USUAL.flexible, abs=1e-3)
    assert scores(list(unseen(of_all, lambda one: one.world[-1])))["recall of unknown"] == 1.0
    shares = left_over([*of_all, *of_all, asked(worlds[0], None)])
    assert {name: len(each) for name, each in shares.items()} == {
        "where nothing is missing": 15,
        "with something else": 15,
        "with an effect": 30,
    }
    assert min(shares["with something else"]) > 0.5
    assert max(shares["where nothing is missing"]) == 0.0


def test_what_healthy_twins_usually_leave_is_told_by_the_middle_half_of_all_recordings():
    left = [(4.0, 9.0), (16.0, 4.0), (16.0, 1e6)]
    worlds = [told(i, ("none",), {}) for i in range(3)] + [told(3, ("wind",), {})]
    worlds = [
        replace(one, account=replace(one.account, left=each))
        for one, each in zip(worlds, [*left, (900.0, 900.0)], strict=True)
    ]
    alone = [replace(one, account=one.account.alone) for one in worlds]
    found = usual([*worlds, *alone])
    assert set(found) == {"rope"}
    median, width, count = found["rope"]
    assert count == 6, "no recording counts twice"
    assert median == pytest.approx(np.log(12.0)), "between 9 and 16, as geometric means go"
    # quartiles of 4, 4, 9, 16, 16, 1e6: a quarter of the way from 4 to 9, and 16
    assert norm.cdf(0.5 * (np.log(16.0) - np.log(4.0**0.75 * 9.0**0.25)) / width) == pytest.approx(
        0.75, abs=1e-4
    )


def test_beside_other_lattices_healthy_twins_leave_a_residue():
    """Half of the recordings leave less than it and their lattices together, whatever these leave."""
    lattices = [(0.0, 10.0), (3.0, 30.0), (None, 1.0)]
    factors = [(1.0, 0.5), (2.0, 1.0), (9.0, 1.0)]
    worlds = [told(i, ("none",), {}) for i in range(3)] + [told(3, ("wind",), {})]
    for i, (each, by) in enumerate(zip(lattices, factors, strict=True)):
        left = tuple(factor * (1.5 + (one or 0.0)) for one, factor in zip(each, by, strict=True))
        account = replace(worlds[i].account, left=left, lattices=each)
        worlds[i] = replace(worlds[i], account=account)
    pairs = beside_lattices([*worlds, *(replace(one, account=one.account.alone) for one in worlds)])
    assert len(pairs) == 5, "no recording counts twice, nor one of which nobody asked"
    residue, width = usual_beside_lattices(pairs)
    assert residue == pytest.approx(1.5)
    # tenths of the logarithms of 0.5, 1, 1, 1, 2: 0.6 of the way from the middle to the ends
    assert norm.cdf(0.6 * np.log(2.0) / width) == pytest.approx(0.9)


def test_no_world_is_judged_by_weights_that_know_it(worlds, monkeypatch):
    known = []
    monkeypatch.setattr(
        "benchmarks.gap.weighing.learned",
        lambda some: known.append({one.world for one in some}) or USUAL,
    )
    for one, _ in unseen(worlds[:6], lambda one: one.world):
        assert one.world not in known[-1]
        assert len(known[-1]) == 5


def test_the_weights_that_ship_are_those_of_the_accounts_in_this_repository():
    folders = sorted(path for path in TOLD.iterdir() if path.is_dir())
    worlds = told_in(folders)
    about = json.loads(files("model.gap").joinpath(WEIGHTS).read_text())["learned from"]
    assert about == {
        "worlds": len({one.world for one in worlds}),
        "folders": [folder.name for folder in folders],
    }
    found, shipped = asdict(learned(worlds)), asdict(Weighing.shipped())
    assert found == pytest.approx(shipped, abs=0.02)
    for shape, (median, width, _) in usual(worlds).items():
        assert (median, width) == pytest.approx(HEALTHY[shape], abs=0.006)
    assert usual_beside_lattices(beside_lattices(worlds)) == pytest.approx((RESIDUE, WIDTH), abs=0.006)


def test_of_a_hand_that_errs_by_itself_two_answers_are_right(worlds):
    """A recording whose hand lags lacks nothing, and who calls it a delay accuses nobody."""
    weighing = learned(worlds)
    account = {"actuation_delay": Explained(0.9, 0.9, 0.9)}
    late = told(100, ("actuation_delay", "none"), account)
    found = scores([(late, weighing.judged(late.account))])
    assert weighing.judged(late.account).best == "actuation_delay"
    assert (found["right"], found["false alarms"]) == (1.0, 0.0)
    assert np.isnan(found["top-1 of effects"])


def test_a_missed_effect_and_a_false_alarm_are_counted(worlds):
    weighing = learned(worlds)
    healthy, ill = worlds[0], worlds[2]
    accused = told(100, ("none",), ill.account.explained)
    missed = told(101, ill.right, healthy.account.explained)
    found = scores([(one, weighing.judged(one.account)) for one in (healthy, accused, missed, ill)])
    assert (found["right"], found["false alarms"], found["top-1 of effects"]) == (0.5, 0.5, 0.5)


def test_worlds_count_as_they_come_however_many_of_a_kind_were_picked(worlds):
    healthy = [one for one in worlds if one.kind == "none"]
    once, twice = learned(worlds), learned([*worlds, *healthy])
    strange = [one for one in worlds if one.kind == "unknown"]
    chances = [
        np.mean([weighing.judged(one.account).chances["none"] for one in [*healthy, *strange]])
        for weighing in (once, twice)
    ]
    assert chances[1] == pytest.approx(chances[0], abs=0.01)
    assert {one.kind for one in worlds} == {"none", "unknown", None}


def test_trained_by_one_command(worlds, tmp_path, capsys):
    folder = tmp_path / "made"
    folder.mkdir()
    for one in worlds:
        (folder / f"{one.world}.json").write_text(json.dumps({"meaning": MEANING} | asdict(one)))
        assert Told.read(folder / f"{one.world}.json") == one
    out = tmp_path / "weighing.json"
    assert main([str(folder), "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "| one world at a time | two | 60 | 1.00 |" in printed
    assert "| a whole effect | one recording |" in printed
    content = json.loads(out.read_text())
    assert content["learned from"] == {"worlds": 60, "folders": ["made"]}
    assert content["weights"] == pytest.approx(
        asdict(learned([*worlds, *(_alone(one) for one in worlds)])), abs=0.01
    )


def _alone(one):
    return Told(one.world, one.group, one.generator, one.right, one.magnitude, one.account.alone)


def test_weights_are_judged_by_a_generator_that_they_have_not_seen(worlds, tmp_path, capsys):
    """What one generator calls wind moves as damage does in the other: neither teaches the other a thing."""
    other = {"wind": "damage", "damage": "wind"}
    for one in worlds:
        odd = int(one.world) % 2 == 1
        right = tuple(other.get(name, name) for name in one.right) if odd else one.right
        replace(one, generator="fem" if odd else "mujoco", right=right).write(tmp_path)
    assert main([str(tmp_path)]) == 0
    rows = [line.split(" | ") for line in capsys.readouterr().out.splitlines() if "a whole generator" in line]
    assert [row[1:3] for row in rows] == [["one recording", "60"], ["two", "60"]]


def test_folders_without_accounts_are_refused(tmp_path, capsys):
    with pytest.raises(SystemExit) as ended:
        main([str(tmp_path)])
    assert ended.value.code == 2
    assert "nothing gathered in" in capsys.readouterr().err
