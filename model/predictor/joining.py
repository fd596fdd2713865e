"""Several samples as one, and a prediction of it taken apart again."""

from collections.abc import Sequence
from dataclasses import fields

import torch
from torch import Tensor

from model.predictor.sample import Prediction, Sample

_POINTS, _PARTS, _SCENES = "points", "parts", "scenes"
_REFERS = {
    "edges": _POINTS,
    "grips": _POINTS,
    "edge_part": _PARTS,
    "point_part": _PARTS,
    "part_scene": _SCENES,
}
"""Fields that hold indices, and what they count."""


def join_samples(samples: Sequence[Sample]) -> Sample:
    """Lay samples behind each other, so that one forward pass serves them all, whatever their sizes.

    Args:
        samples: At least one, all with features of the same widths; they may be joined ones themselves.
    """
    offsets = {_POINTS: 0, _PARTS: 0, _SCENES: 0}
    columns: dict[str, list[Tensor]] = {field.name: [] for field in fields(Sample)}
    for sample in samples:
        for name, value in sample.tensors():
            columns[name].append(value + offsets[_REFERS[name]] if name in _REFERS else value)
        offsets[_POINTS] += len(sample.point_part)
        offsets[_PARTS] += len(sample.part_scene)
        offsets[_SCENES] += sample.case_count
    return Sample(**{name: torch.cat(values) for name, values in columns.items()})


def split_prediction(prediction: Prediction, samples: Sequence[Sample]) -> list[Prediction]:
    """One prediction per sample, of what was predicted for `join_samples(samples)`."""
    springs = [len(sample.edges) for sample in samples]
    parts = [len(sample.part_scene) for sample in samples]
    grips = [len(sample.grips) for sample in samples]
    scenes = [sample.case_count for sample in samples]
    sizes = (springs, springs, parts, parts, grips, scenes, scenes)
    columns = [
        torch.split(getattr(prediction, field.name), size)
        for field, size in zip(fields(Prediction), sizes, strict=True)
    ]
    return [Prediction(*values) for values in zip(*columns, strict=True)]
