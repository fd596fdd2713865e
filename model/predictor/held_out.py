"""What held-out objects say of a predictor, gathered over all batches of a validation."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float64
from scipy.stats import spearmanr
from torch import distributed

from model.predictor.batches import Batch
from model.predictor.losses import covered
from model.predictor.objective import Judged, LossWeights, belief_counts, belief_terms
from model.predictor.sample import Prediction
from model.types import Array

FEWEST = 3
"""Parts below which a rank correlation says nothing."""


class HeldOut:
    """Figures over all held-out parts and cases; a mean of figures per batch would not be the same."""

    def __init__(self) -> None:
        """Nothing is gathered yet."""
        self._terms: list[dict[str, tuple[float, int]]] = []
        self._parts: list[tuple[str, Float64[Array, "K 4"]]] = []
        self._motions: list[Judged] = []

    def add_beliefs(self, prediction: Prediction, batch: Batch) -> None:
        """Of a batch."""
        terms, counts = belief_terms(prediction, batch), belief_counts(batch)
        self._terms.append({name: (float(term), counts[name]) for name, term in terms.items()})
        inside = covered(
            prediction.part_log_modulus, prediction.part_log_spread, batch.truth.part_log_modulus
        )
        columns = (
            prediction.part_log_modulus,
            batch.truth.part_log_modulus,
            batch.sample.prior_log_modulus,
            inside,
        )
        rows = np.stack([column.detach().cpu().double().numpy() for column in columns], axis=1)
        scenes = batch.sample.part_scene.cpu().numpy()
        for number, example in enumerate(batch.examples):
            own = rows[scenes == number]
            self._parts.append((example.opinion or "stored", own[np.isfinite(own[:, 1])]))

    @property
    def rolled(self) -> int:
        """How many cases were rolled out, those that diverged among them."""
        return len(self._motions)

    def add_motion(self, judged: Judged) -> None:
        """Of a case that was rolled out."""
        self._motions.append(judged)

    @classmethod
    def joined(cls, several: Sequence["HeldOut"]) -> "HeldOut":
        """What several of them have gathered."""
        whole = cls()
        for one in several:
            whole._terms += one._terms
            whole._parts += one._parts
            whole._motions += one._motions
        return whole

    def gathered(self) -> "HeldOut":
        """What all processes have gathered, the same in each of them; the own where there is but one."""
        if not (distributed.is_available() and distributed.is_initialized()):
            return self
        each: list[Any] = [None] * distributed.get_world_size()
        distributed.all_gather_object(each, self)
        return self.joined(each)

    def figures(self, weights: LossWeights) -> dict[str, float]:
        """By name; what could not be measured is left out.

        `loss` is the whole loss; `rank_OPINION`, `log_error_OPINION` the rank correlation and the root mean
        square error of the logarithm of the parts' moduli under each opinion (`prior_rank_OPINION`: of the
        prior's own); `coverage` the share of true moduli within the 90 % interval; `past`, `future` mean
        distances of points over the object's size before and from the split on; `diverged` the share of cases
        that did, which count in the others as objects that do not move.
        """
        found = {"loss": sum(getattr(weights, name) * value for name, value in self._means().items())}
        for opinion in sorted({name for name, _ in self._parts}):
            found |= _beliefs(
                opinion, np.concatenate([rows for name, rows in self._parts if name == opinion])
            )
        every = np.concatenate([rows for _, rows in self._parts]) if self._parts else np.zeros((0, 4))
        if len(every):
            found["coverage"] = float(every[:, 3].mean())
        if self._motions:
            found["diverged"] = float(np.mean([judged.diverged for judged in self._motions]))
            for name in ("track", "chamfer", "past", "future"):
                values = np.array([getattr(judged, name) for judged in self._motions])
                if np.isfinite(values).any():
                    found[name] = float(np.nanmean(values))
            moved = {"track": weights.track, "chamfer": weights.chamfer}
            found["loss"] += sum(weight * found.get(name, 0.0) for name, weight in moved.items())
        return found

    def _means(self) -> dict[str, float]:
        """Of the terms that need no rollout, over all beliefs: not over batches, which differ in size."""
        means = {}
        for name in self._terms[0] if self._terms else ():
            each = [terms[name] for terms in self._terms]
            means[name] = sum(mean * count for mean, count in each) / max(sum(count for _, count in each), 1)
        return means


def _beliefs(opinion: str, rows: Float64[Array, "K 4"]) -> dict[str, float]:
    if len(rows) < FEWEST:
        return {}
    predicted, truth, prior, _ = rows.T
    found = {f"log_error_{opinion}": float(np.sqrt(np.mean((predicted - truth) ** 2)))}
    for name, values in (("rank", predicted), ("prior_rank", prior)):
        if np.ptp(values) > 1e-9 and np.ptp(truth) > 1e-9:
            found[f"{name}_{opinion}"] = float(spearmanr(values, truth).statistic)
    return found
