"""What the answer of a trained predictor hangs on: each input is taken away from it, without training again.

    python benchmarks/predictor/inputs.py CASES [--predictor FILE.safetensors] [--every N]

CASES is the folder that it was trained on, as `matphys fit` leaves it; looked at are the objects that were
held out there. This is no ablation: a network that never had the input may find another way. It says what the
network that there is makes use of.
"""

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import get_args

import torch
from torch import Tensor

from model.encoders.kinematic import KinematicEncoder
from model.predictor.batches import make_batch
from model.predictor.checkpoint import load_predictor
from model.predictor.codebook import Codebook
from model.predictor.datamodule import CaseDataset, Look, Opinions
from model.predictor.network import PredictorNetwork
from model.predictor.object_split import split_objects
from model.predictor.sample import Prediction, Sample
from model.predictor.trained import SHIPPED
from model.predictor.views import WithoutMotion, WithoutParts
from model.scenes.files import describe
from model.scenes.priors import Opinion

SHARE, SEED = 0.15, 0
"""Of `configs/default.yaml`: who was held out."""


def as_is(network: PredictorNetwork, sample: Sample) -> Prediction:
    """Everything is seen."""
    answer: Prediction = network(sample)
    return answer


def without_motion(network: PredictorNetwork, sample: Sample) -> Prediction:
    """Zeros for motion, as in the ablation."""
    return as_is(network, WithoutMotion()(sample))


def without_geometry(network: PredictorNetwork, sample: Sample) -> Prediction:
    """Every spring has the features of the mean spring."""
    usual = sample.edge_features.mean(dim=0).expand_as(sample.edge_features)
    return as_is(network, replace(sample, edge_features=usual))


def without_codebook(network: PredictorNetwork, sample: Sample) -> Prediction:
    """One embedding, the mean of all, for every material."""
    assert isinstance(network.material, Codebook)
    learned = network.material.embeddings.data.clone()
    network.material.embeddings.data[:] = learned.mean(dim=0)
    answer = as_is(network, sample)
    network.material.embeddings.data[:] = learned
    return answer


def without_parts(network: PredictorNetwork, sample: Sample) -> Prediction:
    """Every object is one part, as in the ablation."""
    whole = WithoutParts()(sample)
    answer = as_is(network, whole)
    return replace(answer, part_log_modulus=answer.part_log_modulus[sample.part_scene])


VIEWS: tuple[Callable[[PredictorNetwork, Sample], Prediction], ...] = (
    as_is,
    without_motion,
    without_geometry,
    without_codebook,
    without_parts,
)


def rms(difference: Tensor) -> float:
    """Root mean square of what is known."""
    return float(difference.square().nanmean().sqrt())


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("cases", type=Path)
    parser.add_argument("--predictor", type=Path, default=SHIPPED)
    parser.add_argument("--every", type=int, default=3, help="of the held-out cases")
    given = parser.parse_args()
    torch.set_num_threads(1)
    network = load_predictor(given.predictor).network
    _, held = split_objects(describe(given.cases).cases, SHARE, SEED)
    paths = [given.cases / entry.file for entry in held][:: given.every]
    data = CaseDataset(paths, KinematicEncoder(), Opinions())
    print(f"{len(paths)} held-out cases; RMS over their parts, of ln E")
    print("| priors | input | error | change of the answer | of its springs |\n|---|---|---|---|---|")
    for opinion in get_args(Opinion):
        batch = make_batch([data[Look(index, opinion, (SEED, index, 1))] for index in range(len(paths))])
        with torch.no_grad():
            whole = as_is(network, batch.sample)
            for view in VIEWS:
                answer = view(network, batch.sample)
                error = rms(answer.part_log_modulus - batch.truth.part_log_modulus)
                parts, springs = (
                    rms(getattr(answer, name) - getattr(whole, name))
                    for name in ("part_log_modulus", "log_modulus")
                )
                name = view.__name__.replace("_", " ")
                print(f"| {opinion} | {name} | {error:.2f} | {parts:.2f} | {springs:.2f} |")


if __name__ == "__main__":
    main()
