"""What was found, written into a twin: its effects, and the parameters that were fitted with them."""

import hashlib
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import numpy as np
import torch
from jaxtyping import Float32, Float64, Int64, UInt8
from scipy.spatial import cKDTree
from torch import Tensor

from model.bundle import TwinBundle
from model.errors import InputError
from model.formats.parameters import UNITS, encode_parameters
from model.gap.bodies.first import first_places
from model.gap.by_graph import by_graph
from model.gap.carried import CATALOGUE, carrying_able, record_of, values_of
from model.gap.diagnosis import Diagnosis
from model.gap.effects.bending_stiffness import BendingStiffness
from model.gap.effects.tension_only import TensionOnly
from model.gap.given import MOST, given_twin
from model.gap.graph import Graph
from model.gap.plain import PlainTwin
from model.gap.slight_bending import SlightBending
from model.gap.world import World
from model.gap.wrinkling import Wrinkling
from model.schema import (
    SCHEMA,
    BundleManifest,
    EffectRecord,
    SourceRecord,
    StageRecord,
    content_id,
    write_json,
)
from model.timing import evenly_timed
from model.types import Array, Gaussians, Observation, Parameter, Parameters, Topology
from model.version import __version__

SCALED = ("stiffness", "damping", "grip")
"""Quantities that a coarser twin has other values of: a fit is written back by how much it changed them."""
GREY = 0.6
"""Of an observation without colours."""
OPACITY = 0.95
STAGE = "diagnosis"
NOTE = "of the plain twin, which every diagnosis takes for granted; not part of the verdict"


@dataclass(frozen=True)
class Mechanics:
    """Parameters of a world, as arrays of a bundle."""

    rest_length: Float32[Array, " E"]
    parameters: Parameters

    @classmethod
    def of(cls, world: World) -> "Mechanics":
        """Read them off a world without effects."""
        simulator, springs = world.simulator, world.system.springs
        held = "controller_spring" in simulator.forces
        count = world.system.edges.controller_spring_count
        values = {
            "dashpot_damping": float(simulator.force("dashpot").value("dashpot_damping").mean()),
            "drag_rate": float(simulator.force("drag").value("drag_rate").mean()),
        }
        if "ground" in simulator.contacts:
            values["friction"] = float(simulator.contact("ground").value("friction").mean())
        return cls(
            _row(world.system.value("rest_length"), len(springs)),
            Parameters(
                stiffness=_row(simulator.force("spring").value("stiffness"), len(springs)),
                controller_stiffness=_row(simulator.force("controller_spring").value("stiffness"), count)
                if held
                else np.zeros(0, np.float32),
                globals={name: Parameter(value, UNITS[name], "fitted") for name, value in values.items()},
            ),
        )


def with_findings(
    bundle: TwinBundle, observation: Observation, diagnosis: Diagnosis, most: int = MOST
) -> TwinBundle:
    """A twin with the effects of a diagnosis, and its own parameters as they were fitted with them.

    Its shape, its look and the recorded motion stay; its preview, which shows it without them, goes.

    Args:
        bundle: The twin that was given.
        observation: What was diagnosed.
        diagnosis: Its result.
        most: Points, as `given_twin` was told.

    Raises:
        InputError: as `given_twin` does.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # `given_twin` has told them to whoever diagnosed
        coarse = given_twin(bundle, observation, most)
        fine = given_twin(bundle, observation, len(bundle.topology.points))
    whole = Graph.of(bundle)
    merged, became = whole.within(most)
    found = tuple(by_graph(_spread(record, became), merged, whole) for record in diagnosis.effects)
    # what was found was fitted on top of a carried effect of its kind, or instead of it
    changed = {record.name for record in found if not CATALOGUE[record.name].stacks}
    kept = tuple(record for record in bundle.effects if record.name not in changed)
    place = _there(bundle.parameters, fine)
    twin = replace(bundle, effects=(*kept, *found), parameters=place, preview=None)
    if diagnosis.fitted is not None:
        # what it has already and what was found stand beside each other, on lengths that balance both
        whole_twin = replace(fine, carried=kept, along=coarse.body)
        rest = _world(whole_twin, diagnosis.fitted, coarse, found).system.value("rest_length")
        plain = _world(replace(whole_twin, carried=()), diagnosis.fitted, coarse)
        mechanics = Mechanics.of(plain.with_system(plain.system.with_values(rest_length=rest)))
        same_hand = np.array_equal(fine.body.grip, bundle.topology.controller_springs)
        twin = _refitted(twin, mechanics, same_hand)
    return replace(twin, manifest=_signed(bundle.manifest, bundle.manifest.id, twin))


def cannot_act(twin: TwinBundle) -> str | None:
    """Why an effect of a twin cannot act in it; None where all can."""
    try:
        twin.world(np.arange(2.0))
    except InputError as error:
        return str(error)
    return None


def twin_of(observation: Observation, diagnosis: Diagnosis, plain: PlainTwin) -> TwinBundle:
    """A twin of an observation alone: what it is made of, with Gaussians where its points were seen.

    Args:
        observation: What was diagnosed.
        diagnosis: Its result.
        plain: The twin that it was compared with.
    """
    body, seen = plain.body, first_places(observation)
    known = np.isfinite(seen[:, 0])
    world = _world(plain, diagnosis.fitted or {}, plain, diagnosis.effects)
    mechanics, held = Mechanics.of(world), world.system.controller_points
    topology = Topology(
        points=body.points.astype(np.float32),
        mass=plain.matter.mass.astype(np.float32),
        springs=body.springs.astype(np.int32),
        rest_length=mechanics.rest_length,
        part=np.zeros(len(body.points), np.int32),
        binding_index=body.index[known].astype(np.int32),
        binding_weight=body.weight[known].astype(np.float32),
        controller_points=np.zeros((0, 3), np.float32) if held is None else held.float().numpy(),
        controller_springs=body.grip.astype(np.int32),
        controller_rest_length=_row(world.system.value("controller_rest_length"), len(body.grip)),
    )
    fps = (len(observation.times) - 1) / float(observation.times[-1] - observation.times[0])
    motion = None if world.controls is None else world.controls.float().numpy()
    colors = None if observation.colors is None else observation.colors[known]
    own = {name: quantity.start for name, quantity in plain.quantities.items()} | dict(diagnosis.fitted or {})
    memory = own.get("memory_of_shape", 1.0)
    twin = TwinBundle(
        manifest=BundleManifest.model_validate({"schema": SCHEMA}),
        gaussians=_dots(seen[known], colors),
        topology=topology,
        parameters=_of_the_place(mechanics.parameters, plain, diagnosis.fitted or {}),
        controls=None if motion is None else evenly_timed(motion, observation.times, fps),
        effects=_with_wrinkling(world, _with_slight_bending(world, diagnosis.effects, memory)),
    )
    source = SourceRecord(fps=fps, frames=len(observation.times), keyframe=0, scale="the observation's")
    origin = hashlib.sha256(observation.points.tobytes()).hexdigest()
    return replace(twin, manifest=_signed(twin.manifest.model_copy(update={"source": source}), origin, twin))


def _world(
    plain: PlainTwin,
    fitted: Mapping[str, float],
    like: PlainTwin,
    effects: Sequence[EffectRecord] = (),
) -> World:
    """The world of a fit that was made of another twin, maybe a coarser one.

    It is without these effects, and as it has to be for them: they find it at rest and held as in the fit.
    """
    values = {}
    for name, quantity in plain.quantities.items():
        scale = quantity.start / like.quantities[name].start if name in SCALED else 1.0
        values[name] = torch.tensor(scale * fitted[name] if name in fitted else quantity.start)
    known = {name: value.double() for name, value in values.items()}
    with torch.no_grad():
        world = plain.world(known)
        return plain.eased(world, carrying_able(world, effects), known)(world)


def _refitted(twin: TwinBundle, mechanics: Mechanics, same_hand: bool) -> TwinBundle:
    old, new = twin.parameters, mechanics.parameters
    parameters = Parameters(
        stiffness=new.stiffness,
        controller_stiffness=new.controller_stiffness if same_hand else old.controller_stiffness,
        globals={**old.globals, **new.globals},
    )
    topology = replace(twin.topology, rest_length=mechanics.rest_length)
    return replace(twin, topology=topology, parameters=parameters)


def _spread(record: EffectRecord, became: Int64[Array, " P"]) -> EffectRecord:
    """An effect of a coarser twin on all the points that were merged for it."""
    if record.acts_on is None:
        return record
    return record.model_copy(update={"acts_on": tuple(record.acts_on[i] for i in became)})


def _signed(manifest: BundleManifest, origin: str, twin: TwinBundle) -> BundleManifest:
    """The manifest of a twin with findings: an id of its own, and what was done."""
    effects = write_json(list(twin.effects)).decode()
    mechanics = hashlib.sha256(encode_parameters(twin.parameters) + twin.parameters.stiffness.tobytes())
    stage = StageRecord(name=STAGE, method="gap", version=__version__)
    return manifest.model_copy(
        update={
            "id": content_id(origin, {"effects": effects, "mechanics": mechanics.hexdigest()}, __version__),
            "created": datetime.now(UTC).isoformat(timespec="seconds"),
            "version": __version__,
            "stages": (*manifest.stages, stage),
        }
    )


def _of_the_place(parameters: Parameters, plain: PlainTwin, fitted: Mapping[str, float]) -> Parameters:
    """The parameters with all that a bundle has to say: ground, gravity, contact, how zigzags die out."""
    decay = "bending_decay"
    calm = Parameter(plain.matter.bending_decay, "1/s", "prior")
    own: dict[str, Parameter] = {
        "friction": Parameter(plain.matter.start["friction"], "1", "prior"),
        "restitution": Parameter(plain.matter.restitution, "1", "prior"),
        "collision_distance": Parameter(plain.matter.collision_distance, "m", "prior"),
        decay: Parameter(fitted[decay], "1/s", "fitted") if decay in fitted else calm,
        **parameters.globals,
    }
    return _there(replace(parameters, globals=own), plain)


def _there(parameters: Parameters, plain: PlainTwin) -> Parameters:
    """With the gravity of its observation, and the ground as its points meet it: fits were made there."""
    own = {**parameters.globals, "gravity": Parameter(plain.observation.gravity, "m/s^2", "user")}
    if plain.ground_height is not None:
        own["ground_height"] = Parameter(plain.ground_height, "m", "user")
    return replace(parameters, globals=own)


def _with_slight_bending(
    world: World, effects: tuple[EffectRecord, ...], remembered: float
) -> tuple[EffectRecord, ...]:
    """With the bending that every plain cloth and rope has, which a bundle has no other place for.

    It is at ease in so much of the shape that is seen first.

    What resists bending as an effect as well is one with it: energies of two hinges in one place, each at
    ease in its own turn, are that of one, but for a number. One that acts in a part stands for both: a twin
    has one such effect.
    """
    if SlightBending.name not in world.simulator.forces:
        return effects
    least, most = BendingStiffness.quantities["bending_stiffness"].bounds
    slight = max(least, float(world.simulator.force(SlightBending.name).value("bending_stiffness").max()))
    found = [effect for effect in effects if effect.name == BendingStiffness.name]
    if not found:
        record = record_of(BendingStiffness, {"bending_stiffness": slight, "memory_of_shape": remembered})
        return (_granted(record), *effects)
    if found[0].acts_on is not None:
        return effects
    own = values_of(found[0], BendingStiffness.name)
    whole = min(own["bending_stiffness"] + slight, most)
    memory = min((own["bending_stiffness"] * own["memory_of_shape"] + slight * remembered) / whole, 1.0)
    record = record_of(BendingStiffness, {"bending_stiffness": whole, "memory_of_shape": memory})
    return tuple(record if effect is found[0] else effect for effect in effects)


def _with_wrinkling(world: World, effects: tuple[EffectRecord, ...]) -> tuple[EffectRecord, ...]:
    """With the slack springs that every plain cloth has, which a bundle has no other place for."""
    if Wrinkling.name not in world.simulator.forces:
        return effects
    slackness = float(world.simulator.force(Wrinkling.name).value("slackness"))
    return (_granted(record_of(TensionOnly, {"slackness": slackness})), *effects)


def _granted(record: EffectRecord) -> EffectRecord:
    return EffectRecord.model_validate({**record.model_dump(), "note": NOTE})


def _dots(places: Float64[Array, "G 3"], colors: UInt8[Array, "G 3"] | None) -> Gaussians:
    """A round Gaussian at each place, as wide as half the way to the next."""
    count = len(places)
    near = cKDTree(places).query(places, k=min(4, count))[0][:, 1:].mean(1)
    width = 0.5 * np.maximum(near, 1e-4)
    look = np.full((count, 3), GREY) if colors is None else colors / 255.0
    return Gaussians(
        means=places.astype(np.float32),
        scales=np.repeat(width[:, None], 3, 1).astype(np.float32),
        quaternions=np.tile(np.array([1, 0, 0, 0], np.float32), (count, 1)),
        opacities=np.full(count, OPACITY, np.float32),
        colors=look.astype(np.float32),
        volumes=(4.0 / 3.0 * np.pi * width**3).astype(np.float32),
    )


def _row(values: Tensor, count: int) -> Float32[Array, " n"]:
    row: Float32[Array, " n"] = values.detach().expand(count).float().numpy().copy()
    return row
