"""Force terms. One law, one file; listed here, a term is in the shared property tests."""

from model.simulator.forces.bending import Bending
from model.simulator.forces.bending_damping import BendingDamping
from model.simulator.forces.controller import ControllerSpring
from model.simulator.forces.curved_bending import CurvedBending
from model.simulator.forces.dashpot import Dashpot
from model.simulator.forces.drag import Drag
from model.simulator.forces.gravity import Gravity
from model.simulator.forces.spring import Spring
from model.simulator.forces.unprojected_dashpot import UnprojectedDashpot
from model.simulator.forces.volume import Volume
from model.simulator.forces.weight import Weight

ALL_FORCES = (
    Spring,
    ControllerSpring,
    Dashpot,
    UnprojectedDashpot,
    Gravity,
    Drag,
    Bending,
    CurvedBending,
    BendingDamping,
    Volume,
    Weight,
)
