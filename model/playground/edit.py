"""A twin as the user of a playground has changed it."""

from dataclasses import asdict, replace

import numpy as np
from jaxtyping import Float32

from model.bundle import TwinBundle
from model.formats.parameters import UNITS
from model.gap.carried import CATALOGUE, record_of
from model.playground.settings import Settings, settings_of, wind_of
from model.schema import EffectRecord, PartRecord, StageRecord, StiffnessRecord, content_id
from model.types import Array, Parameter, Parameters
from model.version import __version__


def edited(bundle: TwinBundle, settings: Settings) -> TwinBundle:
    """The twin with the settings as its own; what was not touched keeps its value and source.

    Wind becomes the effect `wind`. The preview and the metrics, which show the twin as it was, go.
    """
    before = settings_of(bundle)
    if settings == before:
        return bundle
    parameters = _parameters(bundle.parameters, before, settings)
    effects = _effects(bundle.effects, before, settings)
    if settings.stiffness == before.stiffness:
        changed = replace(bundle, parameters=parameters, effects=effects)
    else:
        stiffness = scaled_stiffness(bundle, settings.stiffness)
        changed = replace(
            bundle,
            parameters=replace(parameters, stiffness=stiffness),
            effects=effects,
            parts=_parts(bundle, stiffness),
        )
    chosen = {name: list(v) if isinstance(v, tuple) else v for name, v in asdict(settings).items()}
    identity = content_id(bundle.manifest.id, chosen, __version__)
    touched = StageRecord(name="playground", method="by hand", version=__version__)
    manifest = bundle.manifest.model_copy(
        update={"id": identity, "stages": (*bundle.manifest.stages, touched), "metrics": {}}
    )
    return replace(changed, manifest=manifest, preview=None)


def scaled_stiffness(bundle: TwinBundle, factors: tuple[float, ...]) -> Float32[Array, " E"]:
    """Stiffness of the springs [N/m] with a factor for each part; a spring between two takes their mean."""
    logarithms = np.log(np.array(factors))[bundle.topology.part[bundle.topology.springs]]
    scaled: Float32[Array, " E"] = (bundle.parameters.stiffness * np.exp(logarithms.mean(axis=1))).astype(
        np.float32
    )
    return scaled


def _parameters(given: Parameters, before: Settings, after: Settings) -> Parameters:
    entries = dict(given.globals)
    for name in ("gravity", "friction", "restitution", "dashpot_damping", "drag_rate"):
        if getattr(after, name) != getattr(before, name):
            entries[name] = Parameter(getattr(after, name), UNITS[name], "user")
    grounds = [(each.ground, each.ground_height) for each in (before, after)]
    if not after.ground:
        entries.pop("ground_height", None)
    elif grounds[0] != grounds[1]:
        entries["ground_height"] = Parameter(after.ground_height, UNITS["ground_height"], "user")
    if before.self_contact and not after.self_contact:
        entries["collision_distance"] = Parameter(0.0, UNITS["collision_distance"], "user")
    return replace(given, globals=entries)


def _effects(given: tuple[EffectRecord, ...], before: Settings, after: Settings) -> tuple[EffectRecord, ...]:
    """The effects with the wind of the settings; none where they are switched off, but for that."""
    kept = tuple(record for record in given if after.effects and record.name != "wind")
    carried = next((record for record in given if record.name == "wind"), None)
    if (before.wind, before.air_grip) == (after.wind, after.air_grip):
        return given if after.effects else kept
    if carried is None and after.wind == (0.0, 0.0):
        return kept
    start = {name: quantity.start for name, quantity in CATALOGUE["wind"].quantities.items()}
    values = (
        start | wind_of(given) | {"drag_per_mass": after.air_grip, "x": after.wind[0], "y": after.wind[1]}
    )
    wind = record_of(CATALOGUE["wind"], values)
    if carried is not None:
        wind = wind.model_copy(update={"acts_on": carried.acts_on})
    return (*kept, wind)


def _parts(bundle: TwinBundle, stiffness: Float32[Array, " E"]) -> tuple[PartRecord, ...]:
    """The records of the parts with the statistics of their changed springs."""
    ends = bundle.topology.part[bundle.topology.springs]

    def statistics(part: int) -> StiffnessRecord:
        inside = stiffness[(ends == part).all(axis=1)].astype(np.float64)
        if not len(inside):
            return StiffnessRecord(springs=0)
        return StiffnessRecord(
            springs=len(inside),
            mean=float(inside.mean()),
            std=float(inside.std()),
            minimum=float(inside.min()),
            median=float(np.median(inside)),
            maximum=float(inside.max()),
        )

    return tuple(
        record.model_copy(update={"stiffness": statistics(part)}) for part, record in enumerate(bundle.parts)
    )
