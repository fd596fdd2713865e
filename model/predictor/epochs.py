"""Checkpoints of a training: which epochs are kept, under which names, and which of them is meant."""

from pathlib import Path
from typing import Any

from pytorch_lightning import Callback, LightningModule, Trainer
from pytorch_lightning.callbacks import ModelCheckpoint

from model.errors import InputError
from model.predictor.module import PredictorModule

CHECKPOINTS = "checkpoints"
"""Folder in that of a run."""
NEWEST = ("last", "best")
"""Checkpoints that are named instead of given: those of the newest run."""


class KeepFigures(Callback):
    """The figures of the last validation go with every checkpoint."""

    def on_save_checkpoint(
        self, trainer: Trainer, pl_module: LightningModule, checkpoint: dict[str, Any]
    ) -> None:
        """Add them."""
        checkpoint["figures"] = figures_of(trainer)


FAR = 0.8
"""Of the longest rollouts: epochs with shorter ones are not done learning, whatever validation says."""


class BestMoved(ModelCheckpoint):
    """The best validated of the epochs whose rollouts are long; of all, where there are no rollouts.

    What is left of a look at a body that falls or flies is chance, and with it the mean over some looks: it
    cannot tell an epoch of short rollouts and large steps from one of the last. And after an epoch that
    is not validated the figures are still those of the one before it.
    """

    def on_train_epoch_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Write it where it is the best."""
        assert isinstance(pl_module, PredictorModule)
        every = trainer.check_val_every_n_epoch
        if every is not None and (trainer.current_epoch + 1) % every:
            return
        rollouts, epochs = pl_module.rollouts, trainer.max_epochs or 1
        if rollouts.horizon(trainer.current_epoch, epochs) >= FAR * rollouts.horizon(epochs - 1, epochs):
            super().on_train_epoch_end(trainer, pl_module)


def every_epoch(folder: Path, name: str, monitor: str | None = None) -> ModelCheckpoint:
    """After every epoch write NAME.ckpt; with a monitor, where that is less than it ever was."""
    # not its save_last, which writes nothing in an epoch that is not the best
    kind = ModelCheckpoint if monitor is None else BestMoved
    return kind(
        dirpath=folder,
        filename=name,
        monitor=monitor,
        every_n_epochs=1,
        save_on_train_epoch_end=True,
        enable_version_counter=False,
    )


def figures_of(trainer: Trainer) -> dict[str, float]:
    """Of the last validation."""
    return {name: float(v) for name, v in trainer.callback_metrics.items() if name.startswith("val/")}


def newest(out: Path, name: str) -> Path:
    """The checkpoint of this name in the run below `out` that was written to last; it may be an older one's.

    Raises:
        InputError: no run has written one.
    """
    written = list(out.glob(f"run-*/{CHECKPOINTS}/*.ckpt"))
    folder = max(written, key=lambda path: path.stat().st_mtime_ns).parent if written else None
    if folder is None or not (folder / f"{name}.ckpt").is_file():
        raise InputError(
            f"ckpt_path: {name}: no {name}.ckpt of the newest run in {out}: give its file, or the run's --out"
        )
    return folder / f"{name}.ckpt"


def next_version(out: Path) -> str:
    """The first run's folder is `run-0`, the next one's `run-1`."""
    taken = [path.name.removeprefix("run-") for path in out.glob("run-*")] if out.is_dir() else []
    return f"run-{max((int(name) for name in taken if name.isdigit()), default=-1) + 1}"
