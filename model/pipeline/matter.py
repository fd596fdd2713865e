"""What is seen → what it is made of."""

from dataclasses import dataclass

from model.lifting import lift_features, visible_gaussians
from model.part_views import view_parts
from model.parts import segment_parts
from model.pipeline.methods import Methods
from model.pipeline.options import TwinOptions
from model.pipeline.sight import Sight
from model.priors.base import PriorClient
from model.stage_log import StageLog, Step
from model.types import MaterialPrior, Parts, PartView


@dataclass(frozen=True)
class Matter:
    """What the object is made of."""

    parts: Parts
    views: list[PartView]
    priors: list[MaterialPrior]
    warnings: tuple[str, ...] = ()


def understand(sight: Sight, options: TwinOptions, methods: Methods, log: StageLog) -> Matter:
    """Gaussians → features → parts → what each is made of."""
    encoder, prior = methods.encoder, methods.prior
    camera, gaussians = sight.calibration.camera, sight.gaussians
    features = log.run(
        "features",
        encoder,
        lambda: lift_features(encoder(sight.keyframe), gaussians, camera, sight.object_mask),
    )
    parts = log.run(
        "parts",
        Step("normalised cuts", "1"),
        lambda: segment_parts(gaussians, features, options.parts, options.seed),
    )
    visible = visible_gaussians(gaussians, camera, sight.object_mask)
    views = view_parts(
        sight.keyframe, sight.object_mask, gaussians, parts, visible, camera, sight.shape_class
    )
    return log.run("prior", prior, lambda: _believe(prior, parts, views))


def _believe(prior: PriorClient, parts: Parts, views: list[PartView]) -> Matter:
    priors = [prior.material(view) for view in views]
    warnings = dict.fromkeys(warning for belief in priors for warning in belief.warnings)
    return Matter(parts, views, priors, tuple(warnings))
