"""Who does what of the making of a twin."""

from dataclasses import dataclass
from pathlib import Path

from model.encoders import ALL_ENCODERS, SemanticEncoder
from model.errors import InputError
from model.pipeline.options import TwinOptions
from model.predictor import ParameterPredictor
from model.predictor.named import predictor_named
from model.priors import ALL_PRIORS
from model.priors.base import PriorClient
from model.reconstruction import ALL_RECONSTRUCTORS, Reconstructor
from model.reconstruction.depth import DepthReconstructor
from model.reconstruction.mesh import MeshReconstructor
from model.registry import by_name
from model.rendering import ALL_RENDERERS, Renderer, best_renderer
from model.segmentation import ALL_SEGMENTERS, Segmenter
from model.tracking import ALL_TRACKERS, Tracker


@dataclass(frozen=True)
class Methods:
    """One for each stage that has several."""

    segmenter: Segmenter
    reconstructor: Reconstructor
    encoder: SemanticEncoder
    prior: PriorClient
    tracker: Tracker
    predictor: ParameterPredictor
    renderer: Renderer


def choose(options: TwinOptions) -> Methods:
    """Look all methods up before any work, so that a wrong name costs no time.

    Raises:
        InputError: there is no such method, or what it needs was not given.
    """
    return Methods(
        segmenter=by_name(ALL_SEGMENTERS, options.segmentation, "segmentation")(),
        reconstructor=_reconstructor(options),
        encoder=by_name(ALL_ENCODERS, options.encoder, "encoder")(),
        prior=by_name(ALL_PRIORS, options.prior, "prior")(),
        tracker=by_name(ALL_TRACKERS, options.tracking, "tracking")(),
        predictor=predictor_named(options.predictor),
        renderer=by_name(ALL_RENDERERS, options.renderer, "renderer")()
        if options.renderer
        else best_renderer(),
    )


def _reconstructor(options: TwinOptions) -> Reconstructor:
    """The method the user named, or the one that what they gave is for."""
    if options.mesh and options.reconstruction not in (None, "mesh"):
        raise InputError(
            f"--reconstruction {options.reconstruction} has no use for --mesh: choose one of them"
        )
    name = options.reconstruction or ("mesh" if options.mesh else "depth" if options.depth else "silhouette")
    method = by_name(ALL_RECONSTRUCTORS, name, "reconstruction")
    if method is MeshReconstructor:
        return MeshReconstructor(_given(options.mesh, name))
    if method is DepthReconstructor:
        return DepthReconstructor(_given(options.depth, name))
    return method()


def _given(path: Path | None, name: str) -> Path:
    if path is None:
        raise InputError(f"--reconstruction {name} needs --{name} PATH")
    return path
