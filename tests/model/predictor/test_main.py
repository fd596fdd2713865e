"""The commands, run as a user would; every configuration that is shipped really trains."""

import csv
import json
from itertools import count

import numpy as np
import pytest
import torch
import yaml

from model.predictor.checkpoint import load_predictor
from model.predictor.held_out import HeldOut
from model.predictor.main import main
from model.predictor.module import PredictorModule
from model.predictor.trained import SHIPPED
from model.scenes.files import INDEX, write_index
from tests.model.predictor.quick import CONFIGS, SMALL, common, fit

ABLATIONS = sorted(path.stem for path in CONFIGS.glob("without_*.yaml"))


def figures(run):
    """Last value of each column of the log."""
    found = {}
    with (run / "metrics.csv").open() as file:
        for row in csv.DictReader(file):
            found |= {name: float(value) for name, value in row.items() if value}
    return found


def test_training_leaves_logs_checkpoints_a_predictor_and_its_card(trained):
    for name in ("metrics.csv", "config.yaml", "checkpoints/best.ckpt", "checkpoints/last.ckpt"):
        assert (trained / name).is_file()
    assert list(trained.glob("events.out.tfevents.*"))
    found = figures(trained)
    for name in ("train/loss", "train/track", "train/chamfer", "train/prior", "train/parts", "val/loss"):
        assert np.isfinite(found[name]), name
    known = load_predictor(trained / "predictor.safetensors")
    assert known.about.encoder == "kinematic"
    assert known.about.data["cases"] == 5
    assert known.about.training["epochs"] == 2
    assert yaml.safe_load(known.about.config)["trainer"]["max_epochs"] == 2
    assert "held-out" in (trained / "predictor.md").read_text()
    log = (trained / "predictor.csv").read_text()
    assert {"epoch", "train/loss", "val/loss", "val/rank_uniform"} <= set(log.splitlines()[0].split(","))
    assert log == (trained / "metrics.csv").read_text()


def test_a_network_that_no_epoch_trained_is_exported_without_a_log(case_folder, tmp_path):
    assert fit(case_folder, tmp_path, epochs=0) == 0
    assert load_predictor(tmp_path / "run-0" / "predictor.safetensors").about.training["epochs"] == 0
    assert not (tmp_path / "run-0" / "predictor.csv").exists()


@pytest.mark.parametrize("name", ["default", "quick", *ABLATIONS])
def test_every_configuration_trains_two_steps(name, case_folder, tmp_path):
    configs = ("default", name) if name.startswith("without") else (name,)
    small = ["--model.network.dim=16", "--model.network.layers=1"]
    assert fit(case_folder, tmp_path, "--trainer.max_steps=2", *small, configs=configs) == 0
    options = load_predictor(tmp_path / "run-0" / "predictor.safetensors").options
    switched_off = [n for n in ("codebook", "parts", "motion", "geometry") if not getattr(options, n)]
    assert switched_off == [n for n in (name.removeprefix("without_"),) if hasattr(options, n)]
    text = yaml.safe_load((tmp_path / "run-0" / "config.yaml").read_text())
    assert (text["model"]["weights"]["prior"] == 0.0) == (name == "without_prior_loss")


def test_training_goes_on_as_if_it_had_not_stopped(case_folder, tmp_path, monkeypatch):
    whole, halves = tmp_path / "whole", tmp_path / "halves"
    step, rising = PredictorModule.training_step, count()
    # no epoch is better than the one before: what is the last one does not hang on which is the best, and
    # that is the first with rollouts as long as those of the last, nearly
    monkeypatch.setattr(HeldOut, "figures", lambda held, weights: {"loss": float(next(rising))})

    def crash(module, batch, batch_idx):
        if module.current_epoch == 2:
            raise RuntimeError("the power is cut")
        return step(module, batch, batch_idx)

    assert fit(case_folder, whole, epochs=3) == 0
    with monkeypatch.context() as patch:
        patch.setattr(PredictorModule, "training_step", crash)
        assert fit(case_folder, halves, epochs=3) == 1
    last = halves / "run-0" / "checkpoints" / "last.ckpt"
    assert torch.load(last, weights_only=True)["global_step"] == 4
    assert fit(case_folder, halves, f"--ckpt_path={last}", epochs=3) == 0
    assert (halves / "run-1" / "metrics.csv").is_file()
    assert not (halves / "run-1" / "checkpoints").exists()
    ends, firsts = (
        [torch.load(out / "run-0" / "checkpoints" / name, weights_only=True) for out in (whole, halves)]
        for name in ("last.ckpt", "best.ckpt")
    )
    assert [end["global_step"] for end in ends] == [6, 6]
    assert [first["global_step"] for first in firsts] == [4, 4]
    for name, value in ends[0]["state_dict"].items():
        torch.testing.assert_close(ends[1]["state_dict"][name], value, rtol=0.0, atol=0.0, msg=name)


def test_the_best_has_learned_from_rollouts(case_folder, tmp_path, monkeypatch):
    rising = count()
    # by the figures of its validation the first epoch is the best
    monkeypatch.setattr(HeldOut, "figures", lambda held, weights: {"loss": float(next(rising))})
    late, never = tmp_path / "late", tmp_path / "never"
    assert fit(case_folder, late, "--model.rollouts.warm_up=2", epochs=3) == 0
    assert fit(case_folder, never, "--model.rollouts.warm_up=9", epochs=3) == 0
    for out, epochs in ((late, 3), (never, 1)):
        best = torch.load(out / "run-0" / "checkpoints" / "best.ckpt", weights_only=True)
        card = load_predictor(out / "run-0" / "predictor.safetensors").about.training
        assert (best["epoch"] + 1, best["global_step"]) == (card["epochs"], card["steps"])
        assert card["epochs"] == epochs


def test_the_best_was_validated(case_folder, tmp_path, monkeypatch):
    """Of four epochs the second and the fourth are: the third still has the figures of the second."""
    rising = count()
    monkeypatch.setattr(HeldOut, "figures", lambda held, weights: {"loss": float(next(rising))})
    seldom = ("--model.rollouts.warm_up=2", "--trainer.check_val_every_n_epoch=2")
    assert fit(case_folder, tmp_path, *seldom, epochs=4) == 0
    best = torch.load(tmp_path / "run-0" / "checkpoints" / "best.ckpt", weights_only=True)
    assert best["epoch"] + 1 == 4
    assert best["figures"]["val/loss"] == 1.0


def test_a_named_checkpoint_is_really_gone_on_from(case_folder, tmp_path):
    assert fit(case_folder, tmp_path, epochs=1) == 0
    assert fit(case_folder, tmp_path, "--ckpt_path=last", epochs=2) == 0
    last = torch.load(tmp_path / "run-0" / "checkpoints" / "last.ckpt", weights_only=True)
    assert (last["epoch"], last["global_step"]) == (1, 4)
    assert not (tmp_path / "run-1" / "checkpoints").exists()


def test_validate_and_test_judge_what_was_trained(trained, case_folder, tmp_path, capsys):
    common = [
        f"--config={CONFIGS / 'quick.yaml'}",
        f"--data.folder={case_folder}",
        f"--out={tmp_path}",
        *SMALL,
    ]
    best = trained / "checkpoints" / "best.ckpt"
    assert main(["validate", *common, f"--ckpt_path={best}"]) == 0
    assert "val/loss" in capsys.readouterr().out
    assert main(["test", *common, f"--model.start={trained / 'predictor.safetensors'}"]) == 0
    out = capsys.readouterr().out
    assert "test/future" in out
    assert "test/log_error_right" in out


def test_predict_writes_parameters_of_every_case(trained, case_folder, tmp_path):
    start = f"--model.start={trained / 'predictor.safetensors'}"
    common = [f"--config={CONFIGS / 'quick.yaml'}", f"--data.folder={case_folder}", *SMALL]
    assert main(["predict", *common, f"--out={tmp_path}", start]) == 0
    written = sorted(path.stem for path in tmp_path.glob("*.npz"))
    assert written == sorted(path.name.removesuffix(".case.npz") for path in case_folder.glob("*.case.npz"))
    text = json.loads((tmp_path / f"{written[0]}.json").read_text())
    assert set(text["parameters"]) >= {"dashpot_damping", "drag_rate", "friction", "restitution"}
    assert text["parameters"]["friction"]["source"] == "predicted"
    with np.load(tmp_path / f"{written[0]}.npz") as arrays:
        assert (arrays["stiffness"] > 0.0).all()
        assert len(text["parts"]) == len(arrays["part_log_modulus"]) == 2


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["fit", "--model.network.dims=3"], "dims"),
        (["fit", "--trainer.max_epochs=many"], "max_epochs"),
        (["fit", "--data.folder=nowhere", "--data.objects=0"], "nowhere"),
        (["fit", "--config=nowhere.yaml"], "nowhere.yaml"),
        (["validate", "--ckpt_path=nowhere.ckpt"], "nowhere.ckpt"),
        (["predict", "--model.start=nowhere.safetensors"], "nowhere.safetensors"),
        (["validate"], "--model.start"),
        (["test"], "--model.start"),
        (["predict"], "--ckpt_path"),
        (["fit", "--ckpt_path=last"], "last.ckpt"),
        (["validate", "--ckpt_path=best"], "best.ckpt"),
        (["test", "--ckpt_path=mine.safetensors"], "--model.start"),
        (["fit", "--ckpt_path=mine.safetensors"], "--model.start"),
        (["fit", "--data.validation_share=2"], "validation_share"),
        (["fit", "--data.batch_size=0"], "data.batch_size is 0"),
        (["fit", "--data.workers=0"], "data.workers is 0"),
        (["fit", "--data.objects=-3"], "data.objects is -3"),
        (["fit", "--data.objects=1"], "data.objects is 1"),
        (["fit", "--data.seed=-1"], "data.seed is -1"),
        (
            ["fit", "--data.folder=elsewhere", "--data.objects=2", "--data.folds=3", "--data.fold=3"],
            "data.fold 3",
        ),
        (["fit", "--model.seed=-1"], "model.seed is -1"),
        (["fit", "--model.learning_rate=0"], "model.learning_rate is 0"),
        (["fit", "--model.weight_decay=-0.1"], "model.weight_decay is -0.1"),
        (["fit", "--model.warm_up_steps=-5"], "model.warm_up_steps is -5"),
        (["fit", "--model.weights.prior=-1"], "model.weights.prior is -1"),
        (["fit", "--data.opinions.right=-1"], "data.opinions"),
        (["fit", "--data.opinions.wrong_probability=2"], "wrong_probability is 2"),
        (["fit", "--model.network.heads=3"], "model.network.heads is 3"),
        (["fit", "--model.network.layers=0"], "model.network.layers is 0"),
        (["fit", "--model.network.dropout=1"], "model.network.dropout is 1"),
        (["fit", "--model.rollouts.per_batch=-1"], "model.rollouts.per_batch is -1"),
        (["fit", "--model.rollouts.first_horizon=50"], "first_horizon is 50"),
        (["fit", "--trainer.max_epochs=-1"], "trainer.max_epochs is -1"),
        (["fit", "--trainer.max_epochs=null", "--trainer.max_steps=3"], "trainer.max_epochs is null"),
        (["fit", "--trainer.logger=false"], "trainer.logger: logs and checkpoints go to --out"),
        (["fit", "--trainer.default_root_dir=elsewhere"], "trainer.default_root_dir: logs and"),
        (["validate", "--export=mine.safetensors"], "--export is of what `fit` trains"),
        (
            ["fit", "--model.learning_rate=1e30", "--trainer.gradient_clip_val=null"],
            "lower model.learning_rate",
        ),
        (  # the only step of each epoch ruins the weights after its loss
            [
                *("fit", "--model.learning_rate=1e30", "--trainer.gradient_clip_val=null"),
                *("--data.batch_size=9", "--trainer.check_val_every_n_epoch=1"),
            ],
            "lower model.learning_rate",
        ),
        (
            [
                *("fit", "--model.learning_rate=1e30", "--trainer.gradient_clip_val=null"),
                *("--data.batch_size=9", "--trainer.check_val_every_n_epoch=2", "--trainer.max_epochs=1"),
            ],
            "lower model.learning_rate",
        ),
        (["fit", "--model.learning_rate=1e39"], "model.learning_rate is 1e+39"),
        (["fit", "--model.learning_rate=.inf"], "model.learning_rate is inf"),
        (["fit", "--model.weights.prior=.nan"], "model.weights.prior is nan"),
        (["fit", "--trainer.precision=64-true"], "trainer.precision is 64-true: expected 32"),
        (["validate", f"--model.start={SHIPPED}", "--trainer.precision=bf16-mixed"], "is bf16-mixed"),
        (["fit", "--export=checkpoints"], "expected a file NAME.safetensors"),
        (["fit", "--export=mine.bin"], "expected a file NAME.safetensors"),
        (["fit", f"--config={CONFIGS / 'videomae.yaml'}"], "set MATPHYS_VIDEOMAE"),
        (["validate", f"--ckpt_path={CONFIGS / 'quick.yaml'}"], "found another file"),
        (["fit", f"--out={CONFIGS / 'quick.yaml'}"], "quick.yaml is not a folder"),
        (["predict", f"--model.start={SHIPPED}", f"--out={CONFIGS / 'quick.yaml'}/in"], "is not a folder"),
        (["frobnicate"], "frobnicate"),
        ([], "subcommand"),
    ],
)
def test_bad_input_is_one_line_and_2(arguments, says, case_folder, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    given = arguments
    if arguments and arguments[0] != "frobnicate":
        given = [arguments[0], *common(case_folder, tmp_path), *arguments[1:]]
    assert main(given) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("matphys:")]
    assert len(lines) == 1
    assert says in lines[0]
    assert not (tmp_path / "elsewhere").exists()


def test_no_checkpoint_is_written_of_weights_that_a_step_has_ruined(
    case_folder, tmp_path, monkeypatch, capsys
):
    """The first of two epochs, which is not validated."""

    def ruin(module, outputs, batch, batch_idx):
        with torch.no_grad():
            next(module.network.parameters()).view(-1)[0] = torch.nan

    monkeypatch.setattr(PredictorModule, "on_train_batch_end", ruin)
    one_step = ("--data.batch_size=9", "--trainer.check_val_every_n_epoch=2")
    assert fit(case_folder, tmp_path, *one_step, epochs=2) == 2
    assert "training diverged in epoch 0: weights of" in capsys.readouterr().err
    assert not list(tmp_path.rglob("*.ckpt"))


def test_an_unknown_key_of_a_configuration_is_named(tmp_path, case_folder, capsys):
    path = tmp_path / "mine.yaml"
    path.write_text(f"data:\n  folder: {case_folder}\n  batchsize: 3\n")
    assert main(["fit", f"--config={path}"]) == 2
    assert "batchsize" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["predict", "test"])
def test_a_folder_without_cases_is_refused(command, trained, case_folder, tmp_path, capsys):
    empty = tmp_path / "empty"
    empty.mkdir()
    write_index(empty, seed=0)
    given = [f"--data.test_folder={empty}", f"--model.start={trained / 'predictor.safetensors'}"]
    assert main([command, *common(case_folder, tmp_path), *given]) == 2
    assert f"{empty / INDEX}: names no cases: expected at least one" in capsys.readouterr().err


def test_prediction_reads_the_folder_it_is_given_and_no_other(trained, case_folder, tmp_path):
    arguments = [
        *("predict", f"--config={CONFIGS / 'quick.yaml'}", *SMALL, "--data.objects=9"),
        *(f"--data.folder={tmp_path / 'unmade'}", f"--data.test_folder={case_folder}"),
        # dropout is none of what was trained
        *(f"--model.start={trained / 'predictor.safetensors'}", "--model.network.dropout=0.3"),
    ]
    assert main([*arguments, f"--out={tmp_path / 'said'}"]) == 0
    assert not (tmp_path / "unmade").exists()
    assert len(list((tmp_path / "said").glob("*.npz"))) == len(list(case_folder.glob("*.case.npz")))
