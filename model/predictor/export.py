"""What a training leaves for `matphys twin`: a network that is calibrated, its card and its log."""

import shutil
from pathlib import Path

import torch
from pytorch_lightning import Callback, LightningModule, Trainer
from pytorch_lightning.callbacks import ModelCheckpoint
from pytorch_lightning.loggers import CSVLogger

from model.formats.files import replacing
from model.predictor.calibration import calibrate
from model.predictor.checkpoint import About, save_predictor
from model.predictor.epochs import figures_of
from model.predictor.module import PredictorModule


class Export(Callback):
    """After training: the best network, calibrated on held-out objects, with card and log of the training.

    Args:
        path: Where it goes; None: `predictor.safetensors` beside the logs.
        config: The configuration of the training.
    """

    def __init__(self, path: Path | None, config: str) -> None:
        """See the class."""
        self._path, self._config = path, config
        self._validated = -1

    def on_validation_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Remember which steps the figures are of."""
        self._validated = trainer.global_step

    def on_fit_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Write it; in one process, for which the others wait."""
        # the folder of logs is agreed on by all processes: each has to ask
        path = self._path or Path(trainer.log_dir or trainer.default_root_dir) / "predictor.safetensors"
        if trainer.is_global_zero:
            self._write(trainer, pl_module, path)
        trainer.strategy.barrier("export")

    def _write(self, trainer: Trainer, pl_module: LightningModule, path: Path) -> None:
        assert isinstance(pl_module, PredictorModule)
        data = pl_module.cases
        best = trainer.checkpoint_callback
        # of these weights, or of none: a training may end between validations
        figures = figures_of(trainer) if self._validated == trainer.global_step else {}
        if isinstance(best, ModelCheckpoint) and best.best_model_path:
            state = torch.load(best.best_model_path, weights_only=True, map_location="cpu")
            pl_module.load_state_dict(state["state_dict"])
            figures = state["figures"]
            epochs, steps = state["epoch"] + 1, state["global_step"]
        else:
            epochs, steps = trainer.current_epoch, trainer.global_step
        calibration = calibrate(pl_module.network, data.held_out())
        about = About(
            schema="matphys.predictor/1",
            options=pl_module.options.as_dict(),
            motion_dim=data.motion_dim,
            motion_global_dim=data.motion_global_dim,
            encoder=data.encoder.name,
            encoder_version=data.encoder.version,
            encoder_weights=data.encoder.weights,
            data=data.origin(),
            training={"epochs": epochs, "steps": steps, "seed": pl_module.seed},
            validation={name.removeprefix("val/"): value for name, value in figures.items()},
            calibration=calibration.as_dict(),
            config=self._config,
        )
        save_predictor(path, pl_module.network, about)
        self._keep_log(trainer, path.with_suffix(".csv"))
        print(f"wrote {path}")  # noqa: T201 - the answer of the command

    @staticmethod
    def _keep_log(trainer: Trainer, path: Path) -> None:
        """The log as CSV beside the predictor, unless there was no epoch to log."""
        for logger in trainer.loggers:
            if isinstance(logger, CSVLogger):
                logger.save()
                log = Path(logger.experiment.metrics_file_path)
                if log.is_file():
                    with replacing(path) as temporary:
                        shutil.copyfile(log, temporary)
