"""Weights to go on from: which checkpoints and predictors a command takes, and which it refuses."""

import shutil

import pytest
import torch

from model.encoders.kinematic import KinematicEncoder
from model.predictor.datamodule import CaseDataModule
from model.predictor.main import main
from model.predictor.module import ENCODER
from tests.model.predictor.quick import common, fit


def test_it_does_not_start_from_another_network(trained, case_folder, tmp_path, capsys):
    start = f"--model.start={trained / 'predictor.safetensors'}"
    assert fit(case_folder, tmp_path, start, "--model.network.dim=48") == 2
    said = capsys.readouterr().err
    assert "model.network.dim 32" in said
    assert "it is 48" in said


def test_a_checkpoint_of_another_network_is_refused_in_one_line(trained, case_folder, tmp_path, capsys):
    other = f"--ckpt_path={trained / 'checkpoints' / 'best.ckpt'}"
    assert main(["validate", *common(case_folder, tmp_path), other, "--model.network.dim=48"]) == 2
    assert "the checkpoint is of another network" in capsys.readouterr().err


def _start(trained, kind):
    """Options to start from what was trained."""
    files = {"ckpt_path": "checkpoints/best.ckpt", "model.start": "predictor.safetensors"}
    return f"--{kind}={trained / files[kind]}"


@pytest.mark.parametrize("kind", ["ckpt_path", "model.start"])
@pytest.mark.parametrize("command", ["fit", "predict"])
def test_weights_of_another_motion_encoder_are_refused(
    command, kind, trained, case_folder, tmp_path, monkeypatch, capsys
):
    """As wide as the one in training, and of another version; told before cases are described with it."""

    def described(self):
        raise AssertionError("cases were described")

    version = KinematicEncoder.version
    monkeypatch.setattr(KinematicEncoder, "version", "next")
    monkeypatch.setattr(CaseDataModule, "prepare_data", described)
    assert main([command, *common(case_folder, tmp_path), _start(trained, kind)]) == 2
    said = capsys.readouterr().err
    assert kind in said
    assert f"was trained with motion encoder kinematic {version}, data.encoder is kinematic next" in said


def _changed(trained, path, change):
    """A checkpoint of the training, changed."""
    content = torch.load(trained / "checkpoints" / "best.ckpt", weights_only=True)
    change(content)
    torch.save(content, path)
    return f"--ckpt_path={path}"


def test_a_checkpoint_of_before_that_does_not_say_its_encoder_is_taken(trained, case_folder, tmp_path):
    given = _changed(trained, tmp_path / "old.ckpt", lambda content: content.pop(ENCODER))
    assert main(["predict", *common(case_folder, tmp_path), given]) == 0


@pytest.mark.parametrize("command", ["fit", "validate", "test", "predict"])
def test_a_checkpoint_of_what_diverged_is_refused_in_one_line(
    command, trained, case_folder, tmp_path, capsys
):
    def ruin(content):
        next(iter(content["state_dict"].values())).view(-1)[0] = torch.nan

    given = _changed(trained, tmp_path / "ruined.ckpt", ruin)
    assert main([command, *common(case_folder, tmp_path), given]) == 2
    assert "--ckpt_path: weights that are NaN or infinite" in capsys.readouterr().err


def _no_lightning(content):
    content.pop("pytorch-lightning_version")


def _no_optimiser(content):
    content.pop("optimizer_states")


def _no_tensors(content):
    content["state_dict"] = {"weight": "none"}


@pytest.mark.parametrize(
    "write",
    [
        lambda trained, path: torch.save({"a": 1}, path),
        lambda trained, path: torch.save([1, 2], path),
        lambda trained, path: torch.save({"state_dict": {}}, path),
        lambda trained, path: torch.save(torch.nn.Linear(1, 1), path),
        lambda trained, path: path.write_bytes(b""),
        lambda trained, path: path.write_bytes((trained / "checkpoints" / "best.ckpt").read_bytes()[:-999]),
        lambda trained, path: shutil.copyfile(trained / "predictor.safetensors", path),
        lambda trained, path: _changed(trained, path, _no_lightning),
        lambda trained, path: _changed(trained, path, _no_optimiser),
        lambda trained, path: _changed(trained, path, _no_tensors),
    ],
    ids=[
        *("dict", "list", "bare", "module", "empty", "cut", "safetensors"),
        *("no lightning", "no optimiser", "no tensors"),
    ],
)
def test_a_file_that_is_no_checkpoint_is_refused_in_one_line(write, trained, case_folder, tmp_path, capsys):
    path = tmp_path / "other.ckpt"
    write(trained, path)
    assert main(["validate", *common(case_folder, tmp_path), f"--ckpt_path={path}"]) == 2
    said = capsys.readouterr().err
    assert "--ckpt_path: expected a checkpoint that `fit` has written, found another file" in said
