"""Another material for a part of a twin."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from pydantic import JsonValue

from model.bundle import TwinBundle
from model.errors import InputError
from model.formats.parameters import gravity, ground_height
from model.gap.bodies.guess import guess_shape
from model.imagine import imagine
from model.manifest import stiffness_record
from model.predictor import ParameterPredictor, PriorMeanPredictor, TrainedPredictor
from model.predictor.prior_mean import POOLED
from model.priors.materials import MATERIALS, typical
from model.schema import PartRecord, PropertyRecord, StageRecord, content_id
from model.types import Estimate, MaterialPrior, Parameters, ShapeClass, Topology
from model.units import PROPERTY_UNITS
from model.version import __version__


def predictor_of(twin: TwinBundle) -> ParameterPredictor:
    """The network that comes with the package, if a network made the twin; else the prior's means."""
    made = _made_by(twin)
    predicted = any(entry.source == "predicted" for entry in twin.parameters.globals.values())
    return TrainedPredictor() if made is not None and predicted else PriorMeanPredictor()


def _made_by(twin: TwinBundle) -> StageRecord | None:
    """The stage that predicted the twin's mechanics, if that was a network."""
    stages = (stage for stage in twin.manifest.stages if stage.name == "parameters")
    return next((stage for stage in stages if stage.method == TrainedPredictor.name), None)


def edit_part(
    twin: TwinBundle,
    part: int,
    material: str,
    shape_class: ShapeClass | None = None,
    predictor: ParameterPredictor | None = None,
) -> TwinBundle:
    """The twin with one part of another material, its springs predicted anew.

    The part's points weigh what that material weighs in the same volume. Springs with an end in the part and
    controller springs that hold it are predicted for the new materials; all others stay. Global parameters
    that were predicted, or come from the prior, are predicted anew as well; those that were fitted or given
    stay. What was measured of the old twin (metrics, preview) goes.

    The prior's means of the new material come first. A network reads the motion of the object too, which is
    that of the old material, and which a bundle does not keep; so it is asked about the motion that the twin
    has with those means. Where it cannot tell from that, the means stay, and a warning says why.

    Args:
        twin: From the pipeline, so that it says what its other parts are made of.
        part: Its number in `parts.json`.
        material: One of the ten.
        shape_class: What the object is; None: told from how its points lie.
        predictor: None: the prior's means are all. `predictor_of` tells what the twin was made by.

    Raises:
        InputError: no such part or material, a part that no spring touches, or parts whose material prior the
            twin does not say.

    Reference:
        As `model.predictor.prior_mean.PriorMeanPredictor` and `model.predictor.network.PredictorNetwork`.
    """
    if material not in MATERIALS:
        raise InputError(f"--material {material}: choose one of {', '.join(MATERIALS)}")
    if not 0 <= part < len(twin.parts):
        what = f"0 to {len(twin.parts) - 1}" if twin.parts else "none: parts.json is empty"
        raise InputError(f"--part {part}: the parts of this twin are {what}")
    if not (twin.topology.part[twin.topology.springs] == part).any():
        raise InputError(f"--part {part}: no spring of the twin touches it: choose a part that has springs")
    shape = shape_class or guess_shape(twin.topology.points.astype(np.float64))
    before = [_prior(record, number, shape) for number, record in enumerate(twin.parts)]
    distribution = np.array([float(name == material) for name in MATERIALS])
    after = list(before)
    after[part] = MaterialPrior(distribution, typical(material, shape), shape)
    weighed = replace(twin, topology=_weighed(twin.topology, part, before[part], after[part]))
    predicted, made = _predicted(weighed, part, after, shape, predictor)
    parameters = _mixed(twin, part, predicted)
    said = f"part {part} was made {material} by its user"
    choice: dict[str, JsonValue] = {"part": part, "material": material, "shape": shape}
    manifest = twin.manifest.model_copy(
        update={
            "id": content_id(twin.manifest.id, choice | {"predictor": made.weights or ""}, __version__),
            "stages": (*twin.manifest.stages, made),
            "warnings": (*twin.manifest.warnings, said, *predicted.warnings),
            "metrics": {},
        }
    )
    parts = _records(twin.parts, part, after[part], weighed.topology, parameters)
    return replace(weighed, manifest=manifest, parameters=parameters, parts=parts, preview=None)


def _predicted(
    weighed: TwinBundle,
    part: int,
    priors: Sequence[MaterialPrior],
    shape: ShapeClass,
    predictor: ParameterPredictor | None,
) -> tuple[Parameters, StageRecord]:
    """The mechanics of a twin whose points weigh what they will, and what they came from."""
    first, means = _means(weighed, priors, shape), PriorMeanPredictor
    fallback = StageRecord(name="edit", method=means.name, version=means.version)
    if predictor is None or isinstance(predictor, PriorMeanPredictor):
        return first, fallback
    imagined = replace(weighed, parameters=_mixed(weighed, part, first), effects=())
    try:
        predicted = predictor(imagine(imagined, priors, shape))
    except InputError as error:
        doubt = f"edit: the prior's means are used, not {predictor.name}: {error}"
        return replace(first, warnings=(*first.warnings, doubt)), fallback
    made = StageRecord(
        name="edit", method=predictor.name, version=predictor.version, weights=predictor.weights
    )
    others = _made_by(weighed)
    if others is not None and others.weights != made.weights:
        doubt = f"edit: the other springs are from another predictor ({(others.weights or 'unknown')[:12]})"
        predicted = replace(predicted, warnings=(*predicted.warnings, doubt))
    return predicted, made


def _means(twin: TwinBundle, priors: Sequence[MaterialPrior], shape: ShapeClass) -> Parameters:
    parameters = twin.parameters
    return PriorMeanPredictor().from_priors(
        twin.topology, priors, shape, gravity(parameters), ground_height(parameters)
    )


def _prior(record: PartRecord, number: int, shape: ShapeClass) -> MaterialPrior:
    """What the twin believed a part to be made of."""
    missing = [name for name in PROPERTY_UNITS if name not in record.prior]
    if missing:
        raise InputError(
            f"parts.json: part {number} has no prior of its {missing[0]}: edit twins that matphys made"
        )
    properties = {
        name: Estimate(
            mean=record.prior[name].mean, spread=record.prior[name].spread, unit=PROPERTY_UNITS[name]
        )
        for name in PROPERTY_UNITS
    }
    return MaterialPrior(np.array([record.materials.get(name, 0.0) for name in MATERIALS]), properties, shape)


def _weighed(topology: Topology, part: int, before: MaterialPrior, after: MaterialPrior) -> Topology:
    """The part's points of the new density, in the same volume."""
    ratio = after.properties["density"].mean / before.properties["density"].mean
    mass = np.where(topology.part == part, topology.mass * np.float32(ratio), topology.mass)
    return replace(topology, mass=mass.astype(np.float32))


def _mixed(twin: TwinBundle, part: int, predicted: Parameters) -> Parameters:
    """New values where the part is, and where a prediction speaks for the whole."""
    topology, old = twin.topology, twin.parameters
    touched = (topology.part[topology.springs] == part).any(axis=1)
    held = topology.part[topology.controller_springs[:, 1]] == part
    entries = dict(old.globals)
    for name in ("dashpot_damping", *POOLED):
        if name in entries and entries[name].source in ("prior", "predicted"):
            entries[name] = predicted.globals[name]
    return replace(
        old,
        stiffness=np.where(touched, predicted.stiffness, old.stiffness),
        controller_stiffness=np.where(held, predicted.controller_stiffness, old.controller_stiffness),
        globals=entries,
    )


def _records(
    parts: Sequence[PartRecord], part: int, prior: MaterialPrior, topology: Topology, parameters: Parameters
) -> tuple[PartRecord, ...]:
    """`parts.json` with the new material, and the statistics of the springs as they are now."""
    ends, records = topology.part[topology.springs], list(parts)
    for number, record in enumerate(parts):
        inside = (ends == number).all(axis=1)
        records[number] = record.model_copy(
            update={"stiffness": stiffness_record(parameters.stiffness[inside])}
        )
    record, weight = records[part], float(topology.mass[topology.part == part].sum(dtype=np.float64))
    update: dict[str, object] = {
        "materials": {name: float(share) for name, share in zip(MATERIALS, prior.distribution, strict=True)},
        "prior": {
            name: PropertyRecord(mean=belief.mean, spread=belief.spread, unit=belief.unit)
            for name, belief in prior.properties.items()
        },
    }
    if record.size is not None:
        update["size"] = record.size.model_copy(update={"mass": weight})
    records[part] = record.model_copy(update=update)
    return tuple(records)
