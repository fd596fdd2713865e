"""What is told of development worlds: gathered, asked of other lattices, taken over, read again."""

import json
from dataclasses import asdict, replace

import numpy as np
import pytest

from benchmarks.gap.accounts import Told, main
from benchmarks.reality.labels import write_labels
from model.errors import InputError
from model.gap.account import MEANING, MOST, Account, Explained
from model.gap.schema import EFFECT_NAMES

ALIKE = dict.fromkeys(EFFECT_NAMES, 1.0 / len(EFFECT_NAMES))


def told(number, right, magnitude=3.0):
    explained = {"wind": Explained(0.1, 0.05, 0.0)}
    account = Account("rope", ALIKE, explained, explained, (2.0, 2.0))
    return Told(f"{number:03d}", "made", "mujoco", right, None if "none" in right else magnitude, account)


def test_a_faint_effect_is_not_learned_from_and_nothing_missing_is():
    assert told(0, ("none",)).clear
    assert told(0, ("wind",)).clear
    assert not told(0, ("wind",), magnitude=0.5).clear


def test_worlds_too_faint_to_learn_from_are_not_diagnosed(tmp_path, capsys):
    label = {"world": "faint", "effects": [], "accepted": ["wind"], "generator": "mujoco", "magnitude": 0.5}
    label |= {"kind": "rope"}
    write_labels(tmp_path, [label], sealed=False)
    assert main(["gather", str(tmp_path), "--out", str(tmp_path / "told")]) == 0
    assert "1 of 1 worlds are too faint to learn from" in capsys.readouterr().out
    assert list((tmp_path / "told").iterdir()) == []


def test_objects_of_other_kinds_are_not_diagnosed(tmp_path, capsys):
    label = {"world": "cloth", "kind": "sheet", "effects": [], "accepted": ["none"], "generator": "mujoco"}
    write_labels(tmp_path, [label], sealed=False)
    assert main(["gather", str(tmp_path), "--kind", "rope", "--out", str(tmp_path / "told")]) == 0
    assert list((tmp_path / "told").iterdir()) == []


@pytest.mark.parametrize("part", ["lattices", "flexible"])
def test_what_was_not_gathered_is_asked_for(part, tmp_path, capsys):
    times = np.arange(16) / 30.0
    hanging = np.stack([np.linspace(0.0, 0.12, 8), np.zeros(8), -np.linspace(0.0, 0.2, 8)], -1)
    for name, rate in (("rope", 6.0), ("rope.transfer", 4.0)):
        hand = hanging[0] + np.stack([0.02 * np.sin(rate * times), 0 * times, 0 * times], -1)
        moved = hanging + (hand - hand[0])[:, None] * np.linspace(1.0, 0.8, 8)[:, None]
        places = moved + np.random.default_rng(0).normal(0, 1e-3, moved.shape)
        np.savez(tmp_path / f"{name}.npz", times=times, points=places, controllers=hand[:, None])
    label = {"world": "rope", "kind": "rope", "effects": [], "accepted": ["none"], "generator": "mujoco"}
    write_labels(tmp_path, [label, label | {"world": "untold"}], sealed=False)
    out = tmp_path / "told"
    out.mkdir()
    before = replace(told(0, ("none",)), world="rope")
    path = out / before.write(out)
    assert main([part, str(tmp_path), "--workers", "1", "--out", str(out)]) == 0
    after = Told.read(path).account
    assert replace(after, **{part: getattr(before.account, part)}) == before.account
    if part == "lattices":
        assert len(after.lattices) == 2
        assert all(one >= 0.0 for one in after.lattices)
    else:
        assert 0.0 < after.flexible.fitted <= MOST[1], "what lags behind a hand is no rope"
    written = path.stat().st_mtime_ns
    assert main([part, str(tmp_path), "--workers", "1", "--out", str(out)]) == 0
    assert path.stat().st_mtime_ns == written, "what is told already is not asked again"
    assert [one.name for one in out.iterdir()] == [path.name]


def test_a_world_that_cannot_be_diagnosed_is_said_and_the_others_go_on(tmp_path, capsys):
    label = {"kind": "rope", "effects": [], "accepted": ["none"], "generator": "mujoco"}
    write_labels(tmp_path, [label | {"world": name} for name in ("broken", "worse")], sealed=False)
    for name in ("broken", "worse"):
        (tmp_path / f"{name}.npz").write_bytes(b"no archive")
    assert main(["gather", str(tmp_path), "--workers", "1", "--out", str(tmp_path / "told")]) == 0
    out = capsys.readouterr().out
    assert out.count("refused: broken.npz") == out.count("refused: worse.npz") == 1
    assert list((tmp_path / "told").iterdir()) == []


def test_accounts_of_before_are_refused_in_one_line(tmp_path):
    content = {"meaning": MEANING - 1} | asdict(told(0, ("wind",)))
    (tmp_path / "old.json").write_text(json.dumps(content))
    with pytest.raises(SystemExit, match="gather again"):
        Told.read(tmp_path / "old.json")


def test_worlds_of_a_test_are_taken_over_once_it_was_opened(tmp_path, capsys):
    worlds = [told(0, ("wind",)), told(1, ("damage",)), told(2, ("none",))]
    test, checked, out = tmp_path / "test", tmp_path / "checked", tmp_path / "told"
    labels = [
        {"world": one.world, "effects": [], "accepted": list(one.right), "generator": "fem"} for one in worlds
    ]
    write_labels(test, labels, sealed=True)
    kept = checked / "diagnoses"
    kept.mkdir(parents=True)
    for one, meaning in zip(worlds, (MEANING, MEANING - 1), strict=False):
        content = {"meaning": meaning, "account": asdict(one.account)}
        (kept / f"{one.world}.json").write_text(json.dumps(content))
    with pytest.raises(InputError, match="sealed"):
        main(["opened", str(test), str(checked), "--out", str(out)])
    (checked / "predictions.json").write_text("{}")
    assert main(["opened", str(test), str(checked), "--out", str(out)]) == 0
    assert "wrote 1 worlds" in capsys.readouterr().out
    (told_of,) = out.glob("*.json")
    assert Told.read(told_of) == replace(worlds[0], group="test", generator="fem", magnitude=None)


def test_sealed_labels_are_refused(tmp_path, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["gather", str(tmp_path), "--out", str(tmp_path / "out")])
    assert ended.value.code == 2
    assert "has no open labels" in capsys.readouterr().err
