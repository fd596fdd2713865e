"""Training in two processes, as a user would start it."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import torch

from model.predictor.checkpoint import load_predictor

CONFIGS = Path(__file__).parents[3] / "configs"
PATIENCE = 300.0
"""Seconds: ten, on an idle machine."""
WATCHED = """
import os, sys
from pathlib import Path
import torch
from model.predictor.main import main
from model.predictor.module import PredictorModule

seen, step = [], PredictorModule.training_step

def watched(module, batch, batch_idx):
    seen.append(sorted(case.name for case in batch.cases))
    return step(module, batch, batch_idx)

def kept(module):
    figures = dict(module.trainer.callback_metrics)
    state = {"seen": seen, "weights": module.network.state_dict(), "figures": figures}
    torch.save(state, Path(os.environ["KEPT"]) / f"{module.global_rank}.pt")

PredictorModule.training_step, PredictorModule.on_train_end = watched, kept
sys.exit(main())
"""


@pytest.fixture
def in_two(case_folder, tmp_path, living):
    """Runs `fit` in two processes, neither of which may be left; returns exit code and what was said."""
    script = tmp_path / "watched.py"
    script.write_text(WATCHED)
    ours = ("LOCAL_RANK", "NODE_RANK", "WORLD_SIZE", "MASTER_ADDR", "MASTER_PORT", "PL_GLOBAL_SEED")
    environment = {name: value for name, value in os.environ.items() if name not in ours}

    def run(*arguments):
        given = [f"--data.folder={case_folder}", f"--out={tmp_path / 'out'}", *arguments]
        process = subprocess.Popen(
            [sys.executable, script, "fit", f"--config={CONFIGS / 'quick.yaml'}", *SMALL, *given],
            env=environment | {"KEPT": str(tmp_path), "OMP_NUM_THREADS": "1"},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        try:
            said, _ = process.communicate(timeout=PATIENCE)
            end = time.monotonic() + 20.0
            while living(group=process.pid) and time.monotonic() < end:
                time.sleep(0.1)
            assert not living(group=process.pid)
        finally:
            if living(group=process.pid):
                os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
        return process.returncode, said

    return run


SMALL = [
    *("--data.objects=0", "--data.batch_size=1", "--data.workers=1", "--data.validation_share=0.4"),
    *("--model.network.dim=16", "--model.rollouts.warm_up=1", "--model.rollouts.first_horizon=3"),
    *("--model.rollouts.last_horizon=3", "--model.rollouts.validated=2", "--trainer.max_epochs=2"),
    *("--trainer.enable_progress_bar=false", "--trainer.enable_model_summary=false"),
    *("--trainer.accelerator=cpu", "--trainer.devices=2"),
]


def test_two_processes_train_one_network_on_cases_of_their_own(in_two, tmp_path):
    code, said = in_two("--trainer.strategy=ddp")
    assert code == 0, said
    first, second = (torch.load(tmp_path / f"{rank}.pt", weights_only=True) for rank in (0, 1))
    assert len(first["seen"]) == len(second["seen"]) == 4
    for mine, yours in zip(first["seen"], second["seen"], strict=True):
        assert not set(mine) & set(yours)
    for name, value in first["weights"].items():
        torch.testing.assert_close(second["weights"][name], value, rtol=0.0, atol=0.0, msg=name)
    for name, value in first["figures"].items():
        if name.startswith("val/"):
            torch.testing.assert_close(second["figures"][name], value, rtol=0.0, atol=0.0, msg=name)
    assert "val/rank_right" in first["figures"]
    out = tmp_path / "out"
    assert [path.name for path in out.iterdir()] == ["run-0"]
    about = load_predictor(out / "run-0" / "predictor.safetensors").about
    assert about.training["steps"] == 4
    assert said.count("wrote ") == 1


def test_what_is_wrong_is_said_once_and_ends_both_processes(in_two):
    code, said = in_two("--trainer.strategy=auto", "--data.folder=nowhere")
    assert code == 2, said
    assert [line for line in said.splitlines() if line.startswith("matphys:")] == [
        "matphys: nowhere/index.json: cannot be read: expected a folder that `matphys scenes` has written"
    ]
