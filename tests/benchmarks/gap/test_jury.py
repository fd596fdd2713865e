"""The command that makes the jury: what it writes loads, and labels that are closed stay so."""

import numpy as np
import pytest
from safetensors.torch import load_file

from benchmarks.gap import jury as command
from model.gap import learn
from model.gap.benchmark.labels import SEALED, seal
from model.gap.classifier import Jury
from model.gap.evidence import BLOCKS, Column, Evidence
from model.gap.learn import Example, write_example

NAMES = ("plasticity", "wind", "damage")


def example(seed, *effects):
    """Columns of noise; those of the effects at work are in the gap."""
    rng = np.random.default_rng(seed)
    kinds = ("twin", "sensor", *NAMES, "plain")
    matrix = rng.normal(size=(200, len(kinds)))
    for name in effects:
        matrix[:, -1] -= 2.0 * matrix[:, kinds.index(name)]
    cells = matrix.reshape(2 * BLOCKS, -1, len(kinds))
    columns = tuple(Column(kind, {"size": 1.0}) for kind in kinds)
    evidence = Evidence(columns, cells.swapaxes(1, 2) @ cells, np.full(2 * BLOCKS, 20))
    return Example(evidence, ("rope", "sheet")[seed % 2], 2.0, False, effects, "one" if seed < 3 else "two")


@pytest.fixture
def written(tmp_path):
    folder = tmp_path / "evidence"
    folder.mkdir()
    for seed, effects in enumerate([(), ("wind",), ("damage",), (), (), ("wind",)]):
        write_example(folder / f"{seed}.npz", example(seed, *effects))
    return folder


def test_six_examples_make_weights_that_load(written, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(learn, "EPOCHS", 2)
    out = tmp_path / "verdict.safetensors"
    assert command.main(["train", str(written), "--out", str(out), "--leave-out"]) == 0
    jury = Jury.of(load_file(out))
    assert len(jury.jurors) == learn.JURORS
    chances = jury.probabilities([example(9, "wind").signs()])
    assert chances.sum() == pytest.approx(1.0)
    said = capsys.readouterr().out
    for title in ("a fifth at a time", "source one", "shape rope", "effect wind"):
        assert f"| {title} |" in said
    assert "| effect plasticity |" not in said
    assert f"wrote {out}" in said


def test_nothing_to_learn_from_is_said_in_one_line(tmp_path, capsys):
    with pytest.raises(SystemExit) as ended:
        command.main(["train", str(tmp_path), "--out", str(tmp_path / "verdict.safetensors")])
    assert ended.value.code == 2
    assert "no examples" in capsys.readouterr().err
    assert not (tmp_path / "verdict.safetensors").exists()


@pytest.mark.parametrize("sealed", [True, False])
def test_worlds_whose_labels_are_sealed_or_missing_are_refused(sealed, tmp_path, capsys):
    worlds, out = tmp_path / "worlds", tmp_path / "evidence"
    worlds.mkdir()
    if sealed:
        (worlds / SEALED).write_bytes(seal(b"[]"))
    with pytest.raises(SystemExit) as ended:
        command.main(["folder", str(worlds), "--out", str(out)])
    assert ended.value.code == 2
    assert "no open labels" in capsys.readouterr().err
    assert not list(tmp_path.rglob("*.npz"))
