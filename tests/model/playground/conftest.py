"""Small twins to play with."""

import json

import numpy as np
import pytest

from model.bundle import TwinBundle
from model.gap.carried import CATALOGUE, record_of
from model.playground.session import Session


@pytest.fixture
def twin(write_twin):
    """A cube of 27 points in two parts, held by two controllers that move for 5 frames; no ground."""
    return TwinBundle.load(write_twin())


@pytest.fixture
def plain_twin(write_twin):
    """The same without self-contact, which a session takes more coarsely than a rollout."""
    parameters = {
        "dashpot_damping": {"value": 0.05, "unit": "N*s/m", "source": "prior", "std": 0.01},
        "drag_rate": {"value": 0.8, "unit": "1/s", "source": "prior"},
        "friction": {"value": 0.4, "unit": "1", "source": "prior"},
        "restitution": {"value": 0.1, "unit": "1", "source": "prior"},
        "ground_height": {"value": 0.1, "unit": "m", "source": "prior"},
    }
    return TwinBundle.load(write_twin(files={"parameters.json": json.dumps(parameters).encode()}))


@pytest.fixture
def session(plain_twin):
    return Session(plain_twin)


@pytest.fixture
def steps():
    """Moves a session on by so many frames; gives the last moment."""

    def go(session, count):
        for _ in range(count):
            moment = session.step()
        return moment

    return go


@pytest.fixture
def effect():
    """The record of an effect of the catalogue, with the values it starts a fit with, or given ones."""

    def make(name, **values):
        quantities = CATALOGUE[name].quantities
        start = {each: quantity.start for each, quantity in quantities.items()}
        return record_of(CATALOGUE[name], start | values)

    return make


@pytest.fixture
def above():
    """A line of sight straight down on a point of a cloud."""

    def aim(point):
        return np.asarray(point, np.float64) + np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])

    return aim
