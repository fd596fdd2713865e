"""`matphys fit`, `validate`, `test`, `predict`: Lightning's command line over our module and data."""

import logging
import os
import pickle
import shutil
import sys
import traceback
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch
from jsonargparse import ArgumentError
from lightning_fabric.utilities.exceptions import MisconfigurationException
from pytorch_lightning import Callback, LightningModule, Trainer
from pytorch_lightning.callbacks import LearningRateMonitor, ModelCheckpoint
from pytorch_lightning.cli import LightningArgumentParser, LightningCLI
from pytorch_lightning.loggers import CSVLogger, TensorBoardLogger

from model.errors import InputError
from model.formats.files import check_writable, replacing
from model.predictor.calibration import calibrate
from model.predictor.checkpoint import About, save_predictor
from model.predictor.datamodule import CaseDataModule
from model.predictor.module import Answers, PredictorModule
from model.predictor.named import FILE
from model.predictor.prediction_file import write_prediction

DONE, OUR_FAULT, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
COMMANDS = ("fit", "validate", "test", "predict")
CHECKPOINTS = "checkpoints"
"""Folder in that of a run."""
NEWEST = ("last", "best")
"""Checkpoints that are named instead of given: those of the newest run."""
BEST = "val/loss"
"""What the best checkpoint has least of."""
PARALLEL = "ddp_find_unused_parameters_true"
"""Epochs without rollouts, and rollouts that diverge, leave parameters without a gradient: a mistake to DDP,
unless it is told."""
LOST = "Connection closed by peer"
"""What a process of several reads when another one has ended."""
OTHER_NETWORK = "Error(s) in loading state_dict"
"""What torch says first of weights whose shapes are others."""
NO_UNION = "Does not validate against any of the Union subtypes"
"""What jsonargparse says first where an object could not be made."""
QUIET = (
    ".*does not have many workers.*",  # examples are made in a millisecond
    ".*args parameter is intended to run from within Python.*",
    ".*Experiment logs directory .* exists.*",  # that of the other logger of this run
    ".*number of training batches .* is smaller than the logging interval.*",
    ".*Checkpoint directory .* exists and is not empty.*",
    ".*LeafSpec.*",  # Lightning and torch between themselves
    ".*callbacks used to create the checkpoint.*",
    ".*could not find the monitored key.*",  # before the first validation
    ".*log\\('train/(track|chamfer)', ..., sync_dist=True.*",  # of one of several processes
)


class Export(Callback):
    """After training: the best network, calibrated on held-out objects, with card and log of the training.

    Args:
        path: Where it goes; None: `predictor.safetensors` beside the logs.
        config: The configuration of the training.
    """

    def __init__(self, path: Path | None, config: str) -> None:
        """See the class."""
        self._path, self._config = path, config

    def on_fit_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Write it; in one process, for which the others wait."""
        # the folder of logs is agreed on by all processes: each has to ask
        path = self._path or Path(trainer.log_dir or trainer.default_root_dir) / "predictor.safetensors"
        if trainer.is_global_zero:
            self._write(trainer, pl_module, path)
        trainer.strategy.barrier("export")

    def _write(self, trainer: Trainer, pl_module: LightningModule, path: Path) -> None:
        data: Any = trainer.datamodule  # type: ignore[attr-defined]
        assert isinstance(pl_module, PredictorModule)
        assert isinstance(data, CaseDataModule)
        best = trainer.checkpoint_callback
        figures = _figures(trainer)
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


class KeepFigures(Callback):
    """The figures of the last validation go with every checkpoint."""

    def on_save_checkpoint(
        self, trainer: Trainer, pl_module: LightningModule, checkpoint: dict[str, Any]
    ) -> None:
        """Add them."""
        checkpoint["figures"] = _figures(trainer)


class BestMoved(ModelCheckpoint):
    """The best validated of the epochs that learned from rollouts; of all, where there are no such epochs.

    Before those nothing was learned through the simulator, whatever validation says; and after an epoch that
    is not validated the figures are still those of the one before it.
    """

    def on_train_epoch_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Write it where it is the best."""
        assert isinstance(pl_module, PredictorModule)
        every = trainer.check_val_every_n_epoch
        if every is not None and (trainer.current_epoch + 1) % every:
            return
        rollouts, epochs = pl_module.rollouts, trainer.max_epochs or 1
        if rollouts.horizon(trainer.current_epoch, epochs) or not rollouts.horizon(epochs - 1, epochs):
            super().on_train_epoch_end(trainer, pl_module)


class WriteParameters(Callback):
    """`predict`: two files per case, see `write_prediction`."""

    def __init__(self, folder: Path) -> None:
        """Into this folder."""
        self._folder, self._count = folder, 0

    def on_predict_batch_end(
        self,
        trainer: Trainer,
        pl_module: LightningModule,
        outputs: Any,  # noqa: ANN401 - what predict_step returned
        batch: Any,  # noqa: ANN401
        batch_idx: int,
        dataloader_idx: int = 0,
    ) -> None:
        """Write a batch."""
        assert isinstance(outputs, Answers)
        for name, parameters, prediction in outputs.cases:
            write_prediction(self._folder, name, parameters, prediction)
            self._count += 1

    def on_predict_end(self, trainer: Trainer, pl_module: LightningModule) -> None:
        """Say what was written."""
        print(f"wrote {self._count} predictions to {self._folder}")  # noqa: T201 - the answer of the command


class TrainingCLI(LightningCLI):
    """Options of module, data and trainer, of the file `--config`; widths follow from the encoder."""

    def add_arguments_to_parser(self, parser: LightningArgumentParser) -> None:
        """What is neither the module's, nor the data's, nor the trainer's."""
        for name in ("motion_dim", "motion_global_dim"):
            parser.link_arguments(f"data.{name}", f"model.{name}", apply_on="instantiate")
        parser.add_argument(
            "--out",
            type=Path,
            default=Path("out/predictor"),
            help="Folder of logs and checkpoints, or of what is predicted.",
        )
        parser.add_argument(
            "--export",
            type=Path | None,
            default=None,
            help="Where the trained predictor goes; null: predictor.safetensors beside the logs.",
        )

    def before_instantiate_classes(self) -> None:
        """Refuse early what can only fail later.

        Raises:
            InputError: there is no such checkpoint, it is none, there is no network that was trained, or what
                is exported cannot be written.
        """
        epochs = self._get(self.config, "trainer.max_epochs")
        if epochs is not None and epochs < 0:
            raise InputError(
                f"trainer.max_epochs is {epochs}: expected 0 or more: the learning rate falls, and rollouts "
                "grow, over a number of epochs that is known"
            )
        export = self._get(self.config, "export") if self.subcommand == "fit" else None
        if export is not None:
            if Path(export).suffix != FILE:
                raise InputError(
                    f"--export: {export}: expected a file NAME{FILE}: `matphys twin` reads no other"
                )
            check_writable(Path(export))
        path = self._get(self.config, "ckpt_path")
        if path in NEWEST:
            path = _newest(Path(self._get(self.config, "out")), path)
            self.config[str(self.subcommand)].ckpt_path = str(path)
        if path is not None and Path(path).suffix == FILE:
            raise InputError(f"ckpt_path: {path}: a predictor, not a checkpoint: give it as --model.start")
        if self.subcommand != "fit" and path is None and self._get(self.config, "model.start") is None:
            raise InputError(
                f"{self.subcommand}: no network that was trained: "
                "give --model.start FILE.safetensors or --ckpt_path FILE.ckpt, which `fit` writes"
            )
        if path is not None and not Path(path).is_file():
            raise InputError(f"ckpt_path: {path}: no such file: expected a checkpoint that `fit` has written")

    def instantiate_trainer(self, **kwargs: Any) -> Trainer:  # noqa: ANN401 - Lightning's own signature
        """With logs, checkpoints and exports in `--out`."""
        out = self._get(self.config_init, "out")
        callbacks: list[Callback] = []
        if self.subcommand == "fit":
            board = TensorBoardLogger(out, name="", version=_next_version(out))
            kwargs["logger"] = [board, CSVLogger(out, name="", version=board.version)]
            checkpoints = self._checkpoints(Path(board.log_dir))
            callbacks = [
                KeepFigures(),
                _every_epoch(checkpoints, "best", BEST),  # before the last, which remembers it
                _every_epoch(checkpoints, "last"),
                LearningRateMonitor("epoch"),
                Export(self._get(self.config_init, "export"), self._written()),
            ]
        else:
            kwargs["logger"] = kwargs["enable_checkpointing"] = False
            callbacks = [WriteParameters(out)] if self.subcommand == "predict" else []
        self.trainer_defaults["callbacks"] = callbacks
        if self._in_parallel():
            kwargs["strategy"] = PARALLEL
        trainer = super().instantiate_trainer(default_root_dir=out, **kwargs)
        return trainer

    def _in_parallel(self) -> bool:
        """Whether several processes train the same network, each on its own cases."""
        strategy, devices, nodes = (
            self._get(self.config_init, f"trainer.{name}") for name in ("strategy", "devices", "num_nodes")
        )
        return strategy == "ddp" or (strategy == "auto" and (str(devices), nodes) != ("1", 1))

    def _checkpoints(self, run: Path) -> Path:
        """Of a run of its own; of the run that goes on, which knows its best one so far."""
        before = self._get(self.config, "ckpt_path")
        if before is not None and Path(before).parent.name == CHECKPOINTS:
            return Path(before).parent.absolute()
        return (run / CHECKPOINTS).absolute()

    def _written(self) -> str:
        """The configuration as a file that trains the same again."""
        return str(self._parser(self.subcommand).dump(self.config[str(self.subcommand)], skip_none=True))


def run(arguments: Sequence[str]) -> None:
    """Run `fit`, `validate`, `test` or `predict` with these arguments.

    Raises:
        InputError: an option there is not, a value that it cannot have, a file that is missing.
    """
    logging.getLogger("pytorch_lightning.utilities.rank_zero").setLevel(logging.WARNING)  # advertisements
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # libraries among themselves
        for message in QUIET:
            warnings.filterwarnings("ignore", message)
        try:
            TrainingCLI(
                PredictorModule,
                CaseDataModule,
                args=list(arguments),
                seed_everything_default=0,
                save_config_kwargs={"overwrite": True},
                trainer_defaults={
                    "max_epochs": 60,
                    "gradient_clip_val": 1.0,
                    "num_sanity_val_steps": 0,
                    "use_distributed_sampler": False,
                    "accelerator": "auto",
                    "devices": 1,
                },
                parser_kwargs={
                    "exit_on_error": False,
                    **{name: {"exit_on_error": False} for name in COMMANDS},
                },
                auto_configure_optimizers=False,
            )
        except (ArgumentError, MisconfigurationException) as error:
            raise InputError(_first_line(error)) from None
        except pickle.UnpicklingError:
            raise InputError(
                "--ckpt_path: expected a checkpoint that `fit` has written, found another file"
            ) from None
        except ValueError as error:  # of an object whose making failed jsonargparse keeps the message alone
            if not str(error).startswith(NO_UNION):
                raise
            reasons = [line.strip("- ") for line in str(error).splitlines() if line.startswith("  - ")]
            raise InputError(reasons[0] if reasons else _first_line(error)) from None
        except RuntimeError as error:
            if OTHER_NETWORK in str(error):
                raise InputError(
                    "--ckpt_path: the checkpoint is of another network than the one that is configured: give "
                    "the --config that it was trained with"
                ) from None
            if os.environ.get("LOCAL_RANK", "0") != "0" and LOST in str(error):
                raise SystemExit(DONE) from None  # the process that failed says why, and with which exit code
            raise


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0 done, 1 our fault, 2 bad input, 130 interrupted."""
    given = sys.argv[1:] if arguments is None else arguments
    try:
        run(given)
    except InputError as error:
        return _fail(f"matphys: {error}", BAD_INPUT)
    except KeyboardInterrupt:
        return INTERRUPTED
    except SystemExit as error:  # --help, and Lightning after Ctrl-C
        return error.code if isinstance(error.code, int) else OUR_FAULT
    except Exception as error:
        if os.environ.get("MATPHYS_DEBUG", "0") not in ("", "0"):
            traceback.print_exc()
        hint = "set MATPHYS_DEBUG=1 for the traceback"
        return _fail(f"matphys: internal error: {type(error).__name__}: {error} ({hint})", OUR_FAULT)
    return DONE


def _every_epoch(folder: Path, name: str, monitor: str | None = None) -> ModelCheckpoint:
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


def _figures(trainer: Trainer) -> dict[str, float]:
    """Of the last validation."""
    return {name: float(v) for name, v in trainer.callback_metrics.items() if name.startswith("val/")}


def _fail(message: str, code: int) -> int:
    sys.stderr.write(" ".join(message.split()) + "\n")
    return code


def _first_line(error: Exception) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return " ".join(lines)[:400] if lines else type(error).__name__


def _newest(out: Path, name: str) -> Path:
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


def _next_version(out: Path) -> str:
    """The first run's folder is `run-0`, the next one's `run-1`."""
    taken = [path.name.removeprefix("run-") for path in out.glob("run-*")] if out.is_dir() else []
    return f"run-{max((int(name) for name in taken if name.isdigit()), default=-1) + 1}"


if __name__ == "__main__":
    sys.exit(main())
