"""The command that trains the predictor, as a process: what it says, and with which exit code it ends."""

import logging
import os
import sys
import traceback
import warnings
from collections.abc import Sequence

from jsonargparse import ArgumentError
from lightning_fabric.utilities.exceptions import MisconfigurationException

from model.errors import InputError
from model.predictor.datamodule import CaseDataModule
from model.predictor.module import PredictorModule
from model.predictor.training import TrainingCLI

DONE, OUR_FAULT, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
COMMANDS = ("fit", "validate", "test", "predict")
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


def _fail(message: str, code: int) -> int:
    sys.stderr.write(" ".join(message.split()) + "\n")
    return code


def _first_line(error: Exception) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return " ".join(lines)[:400] if lines else type(error).__name__


if __name__ == "__main__":
    sys.exit(main())
