"""`matphys fit`, `validate`, `test`, `predict`: Lightning's command line over our module and data."""

from pathlib import Path
from typing import Any

import torch
from pytorch_lightning import Callback, LightningModule, Trainer
from pytorch_lightning.callbacks import LearningRateMonitor
from pytorch_lightning.cli import ArgsType, LightningArgumentParser, LightningCLI
from pytorch_lightning.loggers import CSVLogger, TensorBoardLogger
from torch import Tensor

from model.encoders.motion import EncoderIdentity
from model.errors import InputError
from model.formats.files import check_writable
from model.predictor.datamodule import CaseDataModule
from model.predictor.epochs import (
    CHECKPOINTS,
    NEWEST,
    KeepFigures,
    every_epoch,
    newest,
    next_version,
)
from model.predictor.export import Export
from model.predictor.module import CONTINUED, ENCODER, Answers, PredictorModule, check_encoder
from model.predictor.named import FILE
from model.predictor.prediction_file import write_prediction

BEST = "val/loss"
"""What the best checkpoint has least of."""
PARALLEL = "ddp_find_unused_parameters_true"
"""Epochs without rollouts, and rollouts that diverge, leave parameters without a gradient: a mistake to DDP,
unless it is told."""
SINGLE = ("None", "32", "32-true")
"""Precisions of numbers that samples and rollouts can have."""
WRITTEN = ("state_dict", "optimizer_states", "loops", "pytorch-lightning_version")
"""What every checkpoint of `fit` has."""


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

    _trained_with: EncoderIdentity | None = None
    """The motion encoder of the checkpoint to go on from; None: there is none, or it does not say."""

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

    def parse_arguments(self, parser: LightningArgumentParser, args: ArgsType) -> None:
        """Look at the checkpoint first: Lightning takes any file for one, and asks it for options.

        Raises:
            InputError: it is none.
        """
        super().parse_arguments(parser, args)
        path = self.config[self.config.subcommand].ckpt_path
        if path is not None and (path not in NEWEST or Path(path).is_file()):
            self._trained_with = _check_checkpoint(Path(path))

    def before_instantiate_classes(self) -> None:
        """Refuse early what can only fail later.

        Raises:
            InputError: there is no checkpoint of such a name, or it is none, there is no network that was
                trained, or what is logged, predicted or exported cannot be written.
        """
        epochs = self._get(self.config, "trainer.max_epochs")
        if self.subcommand == "fit" and (epochs is None or epochs < 0):
            raise InputError(
                f"trainer.max_epochs is {'null' if epochs is None else epochs}: expected 0 or more: the "
                "learning rate falls, and rollouts grow, over a number of epochs that is known"
            )
        self._refuse_options()
        if self.subcommand in ("fit", "predict"):
            check_writable(Path(self._get(self.config, "out")) / "anything")
        export = self._get(self.config, "export") if self.subcommand == "fit" else None
        if export is not None:
            if Path(export).suffix != FILE:
                raise InputError(
                    f"--export: {export}: expected a file NAME{FILE}: `matphys twin` reads no other"
                )
            check_writable(Path(export))
        path = self._get(self.config, "ckpt_path")
        if path in NEWEST:
            path = newest(Path(self._get(self.config, "out")), path)
            self.config[str(self.subcommand)].ckpt_path = str(path)
            self._trained_with = _check_checkpoint(path)
        if self.subcommand != "fit" and path is None and self._get(self.config, "model.start") is None:
            raise InputError(
                f"{self.subcommand}: no network that was trained: "
                "give --model.start FILE.safetensors or --ckpt_path FILE.ckpt, which `fit` writes"
            )

    def instantiate_classes(self) -> None:
        """Module, data and trainer; data of another motion encoder is not described first.

        Raises:
            InputError: the weights to go on or to start from were trained with another motion encoder.
        """
        super().instantiate_classes()
        assert isinstance(self.model, PredictorModule)
        assert isinstance(self.datamodule, CaseDataModule)
        given = self.datamodule.encoder.identity
        self.model.check_start(given)
        if self._trained_with is not None:
            check_encoder(CONTINUED, self._trained_with, given)

    def _refuse_options(self) -> None:
        """What else would be ignored without a word, or end in an error of torch.

        Raises:
            InputError: logs are sent elsewhere than to `--out`, something is exported that is not trained, or
                numbers are to have another precision than the data.
        """
        for name in ("logger", "default_root_dir"):
            if self._get(self.config, f"trainer.{name}") is not None:
                raise InputError(f"trainer.{name}: logs and checkpoints go to --out: leave it out")
        if self.subcommand != "fit" and self._get(self.config, "export") is not None:
            raise InputError(f"{self.subcommand}: --export is of what `fit` trains: leave it out")
        precision = self._get(self.config, "trainer.precision")
        if str(precision) not in SINGLE:
            raise InputError(
                f"trainer.precision is {precision}: expected 32, as samples and rollouts have it"
            )

    def instantiate_trainer(self, **kwargs: Any) -> Trainer:  # noqa: ANN401 - Lightning's own signature
        """With logs, checkpoints and exports in `--out`."""
        out = self._get(self.config_init, "out")
        callbacks: list[Callback] = []
        if self.subcommand == "fit":
            board = TensorBoardLogger(out, name="", version=next_version(out))
            kwargs["logger"] = [board, CSVLogger(out, name="", version=board.version)]
            checkpoints = self._checkpoints(Path(board.log_dir))
            callbacks = [
                KeepFigures(),
                every_epoch(checkpoints, "best", BEST),  # before the last, which remembers it
                every_epoch(checkpoints, "last"),
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


def _check_checkpoint(path: Path) -> EncoderIdentity | None:
    """See that a file is what `fit` has written, before anything is made for it.

    Returns:
        The motion encoder that it was trained with; None: it is of before checkpoints said so.

    Raises:
        InputError: there is none, or it is damaged or something else.
    """
    if path.suffix == FILE:
        raise InputError(f"ckpt_path: {path}: a predictor, not a checkpoint: give it as --model.start")
    if not path.is_file():
        raise InputError(f"ckpt_path: {path}: no such file: expected a checkpoint that `fit` has written")
    try:
        found = torch.load(path, weights_only=True, map_location="cpu")
    except Exception:  # what torch raises depends on where the file is broken
        found = None
    whole = isinstance(found, dict) and all(name in found for name in WRITTEN)
    weights = found["state_dict"] if whole else None
    if not isinstance(weights, dict) or not all(isinstance(value, Tensor) for value in weights.values()):
        raise InputError("--ckpt_path: expected a checkpoint that `fit` has written, found another file")
    return EncoderIdentity(*found[ENCODER]) if ENCODER in found else None
