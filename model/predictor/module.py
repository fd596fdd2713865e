"""The training of the predictor, as Lightning wants it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from pytorch_lightning import LightningModule
from pytorch_lightning.trainer.states import TrainerFn
from torch import Tensor
from torch.optim import AdamW
from torch.optim.lr_scheduler import LambdaLR

from model.encoders.motion import EncoderIdentity
from model.errors import InputError
from model.predictor.batches import Batch, Example
from model.predictor.checkpoint import Trained, load_predictor
from model.predictor.checks import at_least, finite
from model.predictor.datamodule import CaseDataModule
from model.predictor.held_out import HeldOut
from model.predictor.joining import split_prediction
from model.predictor.objective import LossWeights, belief_terms, judge_motion, motion_terms
from model.predictor.options import NetworkOptions
from model.predictor.parametrisation import to_parameters
from model.predictor.rollout import mechanics_of
from model.predictor.sample import Prediction
from model.types import Parameters

MOVED = ("track", "chamfer")
"""Terms of the loss that need rollouts."""
LARGEST_RATE = 1e30
"""Beyond, the first step of AdamW is no number of single precision."""
ENCODER = "motion_encoder"
"""Entry of a checkpoint: `EncoderIdentity`, as a plain tuple, which is all that is read back."""
CONTINUED = "--ckpt_path: the checkpoint"
"""How messages name the one that training goes on from."""


@dataclass(frozen=True)
class Rollouts:
    """When training rolls cases out, and how far.

    Attributes:
        warm_up: Epochs that learn from truth and prior alone, which takes milliseconds a case.
        per_batch: Cases of each batch that are rolled out after that, drawn anew each time; 0: none ever.
        first_horizon: Frames in the first epoch with rollouts.
        last_horizon: Frames in the last; the horizon grows evenly in between.
        validated: Looks at held-out cases that are rolled out in validation, through all of their frames.
    """

    warm_up: int = 20
    per_batch: int = 4
    first_horizon: int = 8
    last_horizon: int = 40
    validated: int = 24

    def __post_init__(self) -> None:
        """Refuse what cannot be rolled out.

        Raises:
            InputError: see the message.
        """
        counts = {"warm_up": self.warm_up, "per_batch": self.per_batch, "validated": self.validated}
        at_least(0, "model.rollouts", **counts)
        if not 2 <= self.first_horizon <= self.last_horizon:
            raise InputError(
                f"model.rollouts: first_horizon is {self.first_horizon}, last_horizon {self.last_horizon}: "
                "expected 2 or more, the last no less than the first"
            )

    def horizon(self, epoch: int, epochs: int) -> int:
        """Frames to go in this epoch of so many; 0: no rollouts."""
        if not self.per_batch or epoch < self.warm_up:
            return 0
        share = (epoch - self.warm_up) / max(epochs - 1 - self.warm_up, 1)
        return round(self.first_horizon + share * (self.last_horizon - self.first_horizon))


class Answers:
    """Of a batch, by case: its name, its parameters as a twin takes them, and what was predicted.

    No dataclass and no list, which Lightning would take apart.
    """

    def __init__(self, cases: Sequence[tuple[str, Parameters, Prediction]]) -> None:
        """Of these cases."""
        self.cases = tuple(cases)


class PredictorModule(LightningModule):
    """Learns what parts are made of from how they move, through the simulator.

    It minimises the sum that `LossWeights` names. Everything drawn by lot depends on seed, epoch and batch,
    so that training goes on from a checkpoint as if it had not stopped.

    Args:
        motion_dim: Motion features per mass point; follows from the encoder of the data.
        motion_global_dim: Motion features per clip; likewise.
        network: What can be chosen about the network.
        weights: Of the terms of the loss.
        rollouts: When and how far cases are rolled out.
        learning_rate: Its peak.
        weight_decay: Of AdamW.
        warm_up_steps: In which the learning rate rises to its peak, at most a tenth of all;
            then it falls as a cosine.
        seed: Of dropout and of which cases are rolled out.
        start: A predictor to start from (or to validate, test or predict with).
    """

    def __init__(
        self,
        motion_dim: int,
        motion_global_dim: int,
        network: NetworkOptions = NetworkOptions(),  # noqa: B008 - frozen, as are the others
        weights: LossWeights = LossWeights(),  # noqa: B008
        rollouts: Rollouts = Rollouts(),
        learning_rate: float = 1e-3,
        weight_decay: float = 0.01,
        warm_up_steps: int = 100,
        seed: int = 0,
        start: Path | None = None,
    ) -> None:
        """See the class.

        Raises:
            InputError: a number that it cannot be, or the predictor to start from was made with other options
                or another encoder.
        """
        super().__init__()
        at_least(0, "model", warm_up_steps=warm_up_steps, seed=seed, weight_decay=weight_decay)
        if not 0.0 < learning_rate <= LARGEST_RATE:
            raise InputError(
                f"model.learning_rate is {learning_rate}: expected more than 0, at most {LARGEST_RATE:g}"
            )
        self.options, self.weights, self.rollouts = network, weights, rollouts
        self.learning_rate, self.weight_decay, self.warm_up_steps = learning_rate, weight_decay, warm_up_steps
        self.seed, self._start = seed, start
        self.network = network.build(motion_dim, motion_global_dim)
        self._held = HeldOut()
        self._source: Trained | None = None
        if start is not None:
            self._source = known = load_predictor(start)
            _check_alike(start, known, network, (motion_dim, motion_global_dim))
            self.network.load_state_dict(known.network.state_dict())

    def forward(self, batch: Batch) -> Prediction:
        """Predict a batch.

        Raises:
            InputError: what is predicted is no number.
        """
        prediction: Prediction = self.network(batch.sample)
        if prediction.lost:
            raise InputError(self._diverged(f"what is predicted for {', '.join(prediction.lost)} is"))
        return prediction

    def setup(self, stage: str) -> None:
        """See that the data's motion encoder is the one that the weights to start from know.

        Raises:
            InputError: it is another one.
        """
        self.check_start(self.cases.encoder.identity)

    def check_start(self, given: EncoderIdentity) -> None:
        """See that the predictor to start from, if any, knows the motion encoder that is given.

        Raises:
            InputError: it was trained with another one.
        """
        if self._source is not None:
            check_encoder(f"model.start: {self._start}", self._source.encoder, given)

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Say which motion encoder the weights know."""
        checkpoint[ENCODER] = tuple(self.cases.encoder.identity)

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """See that the data's motion encoder is the checkpoint's, and that its weights are numbers.

        Raises:
            InputError: it is another one, or a weight is NaN or infinite.
        """
        if ENCODER in checkpoint:  # those of earlier versions do not say
            given = self.cases.encoder.identity
            check_encoder(CONTINUED, EncoderIdentity(*checkpoint[ENCODER]), given)
        lost = [name for name, value in checkpoint["state_dict"].items() if not finite(value)]
        if lost:
            raise InputError(
                f"--ckpt_path: weights that are NaN or infinite, in {lost[0]}: the training diverged"
            )

    @property
    def cases(self) -> CaseDataModule:
        """What it is trained on, judged by or asked about."""
        data = self.trainer.datamodule  # type: ignore[attr-defined]
        assert isinstance(data, CaseDataModule)
        return data

    def on_fit_start(self) -> None:
        """Fit the scales of the inputs to the training set, unless training goes on from somewhere."""
        if self._start is not None or self.trainer.ckpt_path is not None:
            return
        self.network.standardise([sample.to(self.device) for sample in self.cases.typical()])

    def on_train_batch_start(self, batch: Batch, batch_idx: int) -> None:
        """Dropout depends on epoch and batch, not on what was drawn before."""
        lot = np.random.SeedSequence((self.seed, self.current_epoch, batch_idx, self.global_rank))
        torch.manual_seed(int(lot.generate_state(1)[0]))

    def training_step(self, batch: Batch, batch_idx: int) -> Tensor:
        """Loss of a batch."""
        prediction = self(batch)
        terms = belief_terms(prediction, batch)
        self._check_finite(terms)
        horizon = self.rollouts.horizon(self.current_epoch, self.trainer.max_epochs or 1)
        if horizon:
            moved, diverged = motion_terms(prediction, batch, self._chosen(len(batch), batch_idx), horizon)
            terms |= moved
            self.log(
                "train/diverged",
                float(diverged),
                batch_size=1,
                reduce_fx="sum",
                on_step=False,
                on_epoch=True,
                sync_dist=True,
            )
        loss = self.weights.total(terms)
        for name, value in {**terms, "loss": loss}.items():
            shown = name == "loss"
            self.log(
                f"train/{name}",
                value.detach(),
                batch_size=len(batch),
                prog_bar=shown,
                on_step=False,
                on_epoch=True,
                sync_dist=name not in MOVED,  # all of a process's rollouts may diverge: it has none to add
            )
        return loss

    def _check_finite(self, terms: Mapping[str, Tensor]) -> None:
        """Stop where nothing can be learned any more.

        Raises:
            InputError: a term is NaN or infinite.
        """
        lost = [name for name, value in terms.items() if not finite(value)]
        if lost:
            raise InputError(self._diverged(f"the loss of {', '.join(lost)} is"))

    def _diverged(self, lost: str) -> str:
        if self.trainer.state.fn != TrainerFn.FITTING:
            return f"{lost} not finite: the network's training diverged: give another one"
        return (
            f"training diverged in epoch {self.current_epoch}: {lost} not finite: lower model.learning_rate "
            f"({self.learning_rate:g}), or clip with trainer.gradient_clip_val"
        )

    def on_train_epoch_end(self) -> None:
        """Stop where the last step has ruined the weights, of which no loss and no validation may tell.

        Raises:
            InputError: a weight is NaN or infinite.
        """
        lost = [name for name, value in self.network.named_parameters() if not finite(value)]
        if lost:
            raise InputError(self._diverged(f"weights of {lost[0]} are"))

    def on_validation_epoch_start(self) -> None:
        """Forget the last validation."""
        self._held = HeldOut()

    def validation_step(self, batch: Batch, batch_idx: int) -> None:
        """Judge a batch of held-out objects."""
        self._judge(batch, -(-self.rollouts.validated // self.trainer.world_size))

    def on_validation_epoch_end(self) -> None:
        """What is judged over all cases together."""
        self._summarise("val")

    def on_test_epoch_start(self) -> None:
        """As in validation."""
        self.on_validation_epoch_start()

    def test_step(self, batch: Batch, batch_idx: int) -> None:
        """Judge a batch; all cases are rolled out."""
        self._judge(batch, None)

    def on_test_epoch_end(self) -> None:
        """What is judged over all cases together."""
        self._summarise("test")

    def predict_step(self, batch: Batch, batch_idx: int) -> "Answers":
        """What a batch's cases are like."""
        each = split_prediction(self(batch), [example.sample for example in batch.examples])
        return Answers(
            [
                (example.case.name, _parameters(one, example), one)
                for example, one in zip(batch.examples, each, strict=True)
            ]
        )

    def configure_optimizers(self) -> Any:  # noqa: ANN401 - Lightning's own type is private
        """AdamW; the learning rate rises, then falls as a cosine."""
        optimiser = AdamW(self.network.parameters(), lr=self.learning_rate, weight_decay=self.weight_decay)
        steps = int(self.trainer.estimated_stepping_batches)
        rise = min(self.warm_up_steps, max(steps // 10, 1))

        def share(step: int) -> float:
            if step < rise:
                return (step + 1) / rise
            fallen = min((step - rise) / max(steps - rise, 1), 1.0)
            return 0.01 + 0.99 * 0.5 * (1.0 + float(np.cos(np.pi * fallen)))

        return {
            "optimizer": optimiser,
            "lr_scheduler": {"scheduler": LambdaLR(optimiser, share), "interval": "step"},
        }

    def _judge(self, batch: Batch, most: int | None) -> None:
        prediction = self(batch)
        self._held.add_beliefs(prediction, batch)
        for example, mechanics in zip(
            batch.examples, mechanics_of(prediction, batch.sample, batch.cases), strict=True
        ):
            if most is None or self._held.rolled < most:
                self._held.add_motion(judge_motion(example.case, mechanics))

    def _summarise(self, stage: str) -> None:
        figures = self._held.gathered().figures(self.weights)
        for name, value in figures.items():
            self.log(f"{stage}/{name}", value, sync_dist=True, prog_bar=name == "loss")

    def _chosen(self, count: int, batch_idx: int) -> Sequence[int]:
        rng = np.random.default_rng((self.seed, self.current_epoch, batch_idx, self.global_rank))
        return [int(number) for number in rng.permutation(count)[: self.rollouts.per_batch]]


def check_encoder(what: str, theirs: EncoderIdentity, given: EncoderIdentity) -> None:
    """See that weights know the motion encoder that is given.

    Raises:
        InputError: they were trained with another one; the message begins with `what`.
    """
    if given != theirs:
        raise InputError(
            f"{what} was trained with motion encoder {theirs}, data.encoder is {given}: give the "
            "configuration that it was trained with"
        )


def _check_alike(start: Path, known: Trained, network: NetworkOptions, widths: tuple[int, int]) -> None:
    """Refuse weights of another network; dropout has none, and may be another.

    Raises:
        InputError: the first option that differs, or the motion encoder.
    """
    theirs, asked = known.options.as_dict(), network.as_dict()
    for name in sorted(asked.keys() - {"dropout"}):
        if theirs[name] != asked[name]:
            raise InputError(
                f"model.start: {start} was made with model.network.{name} {theirs[name]}, "
                f"here it is {asked[name]}: give the configuration that it was trained with"
            )
    if known.widths != widths:
        raise InputError(
            f"model.start: {start} was made with motion encoder {known.about.encoder}, which has "
            f"{known.widths[0]} features per point and {known.widths[1]} per clip, data.encoder has "
            f"{widths[0]} and {widths[1]}: give the configuration that it was trained with"
        )


def _parameters(prediction: Prediction, example: Example) -> Parameters:
    seen, topology = example.case.observation, example.case.topology
    return to_parameters(prediction, example.sample, topology, seen.gravity, seen.ground_height)
