"""An effect is found to act where it does, and everywhere where it does."""

from dataclasses import replace

import numpy as np
import torch

from model.gap.acts_on import ALL_ALIKE, Meeting, acting
from model.gap.effects import GripSlip, GroundAdhesion, MassHeterogeneity, SelfContact, StrainStiffening

SPRINGY = {"strain_stiffening.stiffening": 60.0}
FITTED = {"strain_stiffening.stiffening": 30.0}
"""Half of the body stiffens so much, all of it is taken to stiffen by half of that."""


def auc(score, truth):
    """Chance that a point where it acts has a higher score than one where it does not."""
    above, below = score[truth], score[~truth]
    return float(np.mean(above[:, None] > below) + 0.5 * np.mean(above[:, None] == below))


def test_a_half_that_stiffens(pulled, studied, fitted):
    places = torch.from_numpy(studied(pulled).plain.twin.body.points)
    study = studied(pulled, (StrainStiffening(),), SPRINGY, (places[:, 0] < 0.15).double())
    found = acting(study, fitted(study, StrainStiffening(), FITTED), StrainStiffening())
    assert found.local
    assert auc(found.points, pulled.points[0, :, 0] < 0.15) > 0.95
    assert found.points.max() == 1.0
    assert found.scale > 1.1
    np.testing.assert_array_equal(found.where.numpy(), found.field)


def test_all_of_it_stiffens(pulled, studied, fitted):
    study = studied(pulled, (StrainStiffening(),), SPRINGY)
    found = acting(study, fitted(study, StrainStiffening(), SPRINGY), StrainStiffening())
    assert not found.local
    assert found.where is None
    np.testing.assert_allclose(found.points, 1.0, atol=1e-6)


def test_a_half_of_which_little_is_told_is_told_as_little(pulled, studied, fitted, monkeypatch):
    """No fit takes it, and yet it says where to look first."""
    places = torch.from_numpy(studied(pulled).plain.twin.body.points)
    study = studied(pulled, (StrainStiffening(),), SPRINGY, (places[:, 0] < 0.15).double())
    estimate = fitted(study, StrainStiffening(), FITTED)
    monkeypatch.setattr("model.gap.acts_on.EFFECTIVE", 0.05)
    monkeypatch.setattr("model.gap.acts_on.LEAST", 9.0)
    found = acting(study, estimate, StrainStiffening())
    assert not found.local
    assert found.where is None
    assert auc(found.points, pulled.points[0, :, 0] < 0.15) > 0.9
    assert found.points.min() > ALL_ALIKE


def test_a_grip_acts_on_what_is_held(hung, studied, fitted):
    study = studied(hung)
    found = acting(study, fitted(study, GripSlip(), {}, slopes=False), GripSlip())
    top = hung.points[0, :, 2] > -0.01
    assert found.where is None
    # the edge is between the mass points that are held and those below
    assert found.points[top].min() > 0.6 > 0.5 > found.points[~top].max()


def test_a_load_acts_where_it_is(hung, studied, fitted):
    study = studied(hung)
    corner = {f"mass_heterogeneity.{axis}": 0.0 for axis in "xz"} | {"mass_heterogeneity.radius": 0.15}
    found = acting(study, fitted(study, MassHeterogeneity(), corner, slopes=False), MassHeterogeneity())
    nearest = np.argsort(np.linalg.norm(hung.points[0] - hung.points[0].min(0), axis=1))
    assert found.points[nearest[0]] == 1.0
    assert found.points[nearest[-1]] < 0.01
    assert found.where is None


def test_the_ground_acts_on_what_touches_it(hung, studied, fitted):
    low = float(hung.points[0, :, 2].min())
    study = studied(replace(hung, ground_height=low - 0.005))
    found = acting(study, fitted(study, GroundAdhesion(), {}, slopes=False), GroundAdhesion())
    top, bottom = hung.points[0, :, 2] > -0.05, hung.points[0, :, 2] < low + 0.01
    assert found.points[bottom].max() == 1.0
    assert found.points[top].max() == 0.0


def test_what_never_meets_itself_acts_on_all_alike(hung, studied, fitted):
    study = studied(hung, softer=1.0)
    found = acting(study, fitted(study, SelfContact(), {}, slopes=False), SelfContact())
    np.testing.assert_allclose(found.points, 1.0, atol=1e-6)


def test_parts_that_meet_are_where_it_acts(block):
    """Two mass points that come near each other, and no others."""
    points = block.system.points.clone()
    points[0] = points[-1] + 0.01
    near = Meeting(block, 0.02)(torch.stack([block.system.points, points]))
    assert near.any(0).nonzero().ravel().tolist() == [0, len(points) - 1]
