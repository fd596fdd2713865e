from dataclasses import replace

import numpy as np
import pytest

from model.gap.bodies.body import body_of
from model.gap.diagnosis import Diagnosis
from model.gap.given import given_twin
from model.gap.graph import Graph
from model.gap.plain import PlainTwin
from model.gap.same_hand import led
from model.gap.write_back import twin_of
from model.types import Observation


@pytest.fixture
def hung() -> Observation:
    """A strip of cloth that is held at one end by two markers, and swung."""
    u, v = np.meshgrid(np.linspace(0, 0.3, 10), np.linspace(0, 0.12, 5), indexing="ij")
    places = np.stack([u, v, 1 - 0.2 * u], -1).reshape(-1, 3).astype(np.float32)
    hand = np.repeat(places[None, [1, 3]], 12, 0)
    hand[..., 1] += np.linspace(0, 0.05, 12, dtype=np.float32)[:, None]
    return Observation(np.arange(12) / 25, np.repeat(places[None], 12, 0), hand)


@pytest.fixture
def made(hung, found):
    """The twin that a diagnosis of it saves."""
    return twin_of(hung, Diagnosis(found(hung), ()), PlainTwin.of(body_of(hung), hung))


def test_a_twin_that_a_diagnosis_made_is_held_by_its_own_hand(hung, made):
    """Its controllers are at the points that are held, more than those of the recording."""
    count = made.topology.controller_points.shape[0]
    assert count > hung.controllers.shape[1]
    plain = given_twin(made, hung)
    assert plain.hand_known
    np.testing.assert_array_equal(plain.body.grip, made.topology.controller_springs)
    np.testing.assert_array_equal(plain.controls, made.controls)
    usual = float(np.median(made.parameters.stiffness))
    firm = float(np.median(made.parameters.controller_stiffness)) / usual
    assert plain.quantities["grip"].start == pytest.approx(firm)


def test_another_motion_of_that_hand_leads_them(hung, made):
    away = np.zeros_like(hung.controllers)
    away[:, :, 0] = 0.1 * np.linspace(0, 1, 12)[:, None] ** 2
    plain = given_twin(made, replace(hung, controllers=hung.controllers[:1] + away))
    assert plain.hand_known
    ridden = plain.controls - made.topology.controller_points
    np.testing.assert_allclose(ridden, np.broadcast_to(away[:, :1], ridden.shape), atol=1e-3)


def test_a_hand_that_holds_more_or_less_is_another(hung, made):
    graph = Graph.of(made)
    assert led(graph, graph.spacing, made.controls, hung) is not None
    farther = np.concatenate([hung.controllers, hung.points[:, -1:]], 1)
    aside = hung.controllers + np.float32([0.2, 0, 0])
    nobody = hung.controllers[:, :0]
    for other in (farther, aside, nobody):
        assert led(graph, graph.spacing, made.controls, replace(hung, controllers=other)) is None


def test_a_motion_that_is_not_of_this_recording_is_not_taken_for_it(hung, made):
    elsewhere = made.controls + np.linspace(0, 0.1, 12, dtype=np.float32)[:, None, None]
    graph = Graph.of(made)
    controls = led(graph, graph.spacing, elsewhere, hung)
    assert controls is not None
    assert np.abs(controls - made.controls).max() < 0.02
