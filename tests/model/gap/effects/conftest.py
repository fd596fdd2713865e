"""Springs that are strained in turn."""

import numpy as np
import pytest
import torch


@pytest.fixture
def strained():
    """A function: tensions [N] of a linear spring of 1 m and of a law that remembers, by its constants.

    Each strain is held for so many `looks` of `dt` [s]; without `dt` the law knows of no time.
    """

    def of(law, strains, stiffness, dt=None, looks=1, **constants):
        everything = {"stiffness": stiffness, "share": 1.0, "slackness": 0.0, **constants}
        known = {name: torch.tensor(value, dtype=torch.float64) for name, value in everything.items()}
        if dt is not None:
            known["dt"] = torch.tensor(dt, dtype=torch.float64)
        rest, (name,) = torch.ones((), dtype=torch.float64), law.memory
        memory, found = torch.zeros((), dtype=torch.float64), []
        for strain in strains:
            for _ in range(looks):
                lost, memory = law.law(rest + strain, rest, **known, **{name: memory})
            found.append(float(stiffness * strain + lost))
        return np.array(found)

    return of
