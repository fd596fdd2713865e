"""The catalogue of effects that a plain twin lacks. One effect, one file; listed here, it is tested."""

from model.gap.effects.actuation_delay import ActuationDelay
from model.gap.effects.adhesion import GroundAdhesion
from model.gap.effects.anisotropy import Anisotropy
from model.gap.effects.bending_stiffness import BendingStiffness
from model.gap.effects.damage import Damage
from model.gap.effects.gravity_tilt import GravityTilt
from model.gap.effects.grip_slip import GripSlip
from model.gap.effects.mass_heterogeneity import MassHeterogeneity
from model.gap.effects.plasticity import Plasticity
from model.gap.effects.quadratic_air_drag import QuadraticAirDrag
from model.gap.effects.self_collision import SelfContact
from model.gap.effects.static_friction import StaticFriction
from model.gap.effects.strain_stiffening import StrainStiffening
from model.gap.effects.tension_only import TensionOnly
from model.gap.effects.viscoelasticity import Viscoelasticity
from model.gap.effects.volume_preservation import VolumePreservation
from model.gap.effects.wind import SteadyWind

ALL_EFFECTS = (
    StrainStiffening,
    Viscoelasticity,
    Plasticity,
    Damage,
    TensionOnly,
    Anisotropy,
    BendingStiffness,
    VolumePreservation,
    QuadraticAirDrag,
    SteadyWind,
    GravityTilt,
    MassHeterogeneity,
    GripSlip,
    ActuationDelay,
    GroundAdhesion,
    StaticFriction,
    SelfContact,
)
