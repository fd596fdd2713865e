"""A training of seconds, run as a user would."""

from pathlib import Path

from model.predictor.main import main

CONFIGS = Path(__file__).parents[3] / "configs"
SMALL = [
    *("--data.objects=0", "--data.batch_size=2", "--data.workers=1", "--data.validation_share=0.4"),
    *("--model.rollouts.warm_up=0", "--model.rollouts.per_batch=1", "--model.rollouts.first_horizon=3"),
    *(
        "--model.rollouts.last_horizon=4",
        "--model.rollouts.validated=1",
        "--trainer.enable_progress_bar=false",
    ),
    *("--trainer.enable_model_summary=false", "--trainer.accelerator=cpu"),
]


def fit(folder, out, *arguments, configs=("quick",), epochs=1):
    """Train with shipped configurations on a few cases."""
    given = [f"--config={CONFIGS / name}.yaml" for name in configs]
    return main(
        [
            *("fit", *given, f"--data.folder={folder}", f"--out={out}", *SMALL),
            *(f"--trainer.max_epochs={epochs}", "--trainer.check_val_every_n_epoch=1", *arguments),
        ]
    )


def common(folder, out):
    """Options of any command, on a few cases."""
    return [f"--config={CONFIGS / 'quick.yaml'}", f"--data.folder={folder}", f"--out={out}", *SMALL]
