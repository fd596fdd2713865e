"""A simulator's springs as plain lists, for simulators that are not ours."""

import torch

from model.simulator.simulator import Simulator


def springs(simulator: Simulator) -> tuple[list[float], list[float], float]:
    """Stiffness [N/m] and rest length [m] of springs, then controller springs; the dashpot [N·s/m]."""
    system, edges = simulator.system, simulator.system.edges
    stiffness = [simulator.force("spring").value("stiffness").expand(edges.spring_count)]
    lengths = [system.value("rest_length").expand(edges.spring_count)]
    if held := edges.controller_spring_count:
        stiffness.append(simulator.force("controller_spring").value("stiffness").expand(held))
        lengths.append(system.value("controller_rest_length").expand(held))
    damped = "dashpot" in simulator.forces
    damping = float(simulator.force("dashpot").value("dashpot_damping")) if damped else 0.0
    return torch.cat(stiffness).tolist(), torch.cat(lengths).tolist(), damping
