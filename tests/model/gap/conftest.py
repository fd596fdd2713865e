"""Small worlds in which every effect has something to act on."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from model.gap.bodies.body import body_of
from model.gap.classifier import CLASSES, Jury
from model.gap.confirm import Fitted
from model.gap.effects import StaticFriction
from model.gap.estimate import Estimate
from model.gap.evidence import BLOCKS, Column, Evidence
from model.gap.forecast import forecast
from model.gap.hypothesis import Hypothesis
from model.gap.learn import Example
from model.gap.misfit import Misfit, Span
from model.gap.observer import Observer
from model.gap.plain import PlainTwin
from model.gap.sight import Sight
from model.gap.study import Study
from model.gap.transfer import transferred
from model.gap.world import World
from model.simulator.build import build_simulator
from model.simulator.simulator import Simulator
from model.types import Observation

SPACING = 0.04


@pytest.fixture
def block():
    """A block of 4 × 3 × 3 points, one edge held and carried up, to the side and back; float64."""
    return _block()


@pytest.fixture
def smooth():
    """The same block over a ground that it never meets, so that its motion has a derivative."""
    world = _block()
    simulator = world.simulator
    free = Simulator(simulator.system, [simulator.force(name) for name in simulator.forces])
    return replace(world, simulator=free)


def _block():
    grid = np.stack(np.meshgrid(np.arange(4), np.arange(3), np.arange(3), indexing="ij"), -1).reshape(-1, 3)
    points = SPACING * grid + np.array([0.0, 0.0, 0.002])
    apart = np.linalg.norm(points[:, None] - points[None], axis=-1)
    springs = np.argwhere(np.triu(apart < 1.8 * SPACING, 1))
    held = np.flatnonzero((grid[:, 0] == 0) & (grid[:, 2] == 2))
    times = np.arange(16) / 30.0
    swing = 0.15 * np.stack([np.sin(8 * times), 0 * times, 1 - np.cos(6 * times)], -1)
    controls = torch.from_numpy(points[held][None] + swing[:, None])
    simulator = build_simulator(
        points=points,
        mass=np.full(len(points), 0.01),
        springs=springs,
        rest_length=apart[springs[:, 0], springs[:, 1]],
        stiffness=20.0,
        controller_springs=np.stack([np.arange(len(held)), held], -1),
        controller_rest_length=np.full(len(held), 1e-3),
        controller_stiffness=60.0,
        controller_points=points[held] + np.array([0.0, 0.0, 1e-3]),
        dashpot_damping=0.02,
        drag_rate=1.0,
        friction=0.4,
        restitution=0.1,
        ground_height=0.0,
        dtype=torch.float64,
    )
    count = len(points)
    sight = Sight(torch.arange(count)[:, None], torch.ones((count, 1), dtype=torch.float64))
    return World(simulator, sight, times, controls, ground_height=0.0)


@pytest.fixture
def loose():
    """Four points that nothing joins, holds or stands under."""
    simulator = build_simulator(
        points=torch.eye(4, 3, dtype=torch.float64),
        mass=1.0,
        springs=torch.zeros((0, 2), dtype=torch.long),
        rest_length=torch.zeros(0),
        stiffness=torch.zeros(0),
        gravity=(0.0, 0.0, 0.0),
        dtype=torch.float64,
    )
    sight = Sight(torch.arange(4)[:, None], torch.ones((4, 1), dtype=torch.float64))
    return World(simulator, sight, np.arange(3) / 30.0)


@pytest.fixture
def hung():
    """A sheet held by its upper edge, which is shaken, as an observation of 40 frames that has not moved."""
    u, v = np.meshgrid(np.linspace(0, 0.3, 9), np.linspace(0, 0.2, 7), indexing="ij")
    places = np.stack([u, 0 * u, -v], -1).reshape(-1, 3)
    jitter = np.random.default_rng(3).normal(0, 1e-3, places.shape)
    places = places + jitter * ((v.ravel() > 0) & (u.ravel() > 0) & (u.ravel() < 0.3))[:, None]
    times = np.arange(40) / 30.0
    held = places[places[:, 2] > -0.01]
    swing = np.stack([0.05 * np.sin(9 * times), 0.08 * np.sin(7 * times), 0 * times], -1)
    return Observation(
        times=times,
        points=np.repeat(places[None].astype(np.float32), len(times), 0),
        controllers=(held[None] + swing[:, None]).astype(np.float32),
    )


@pytest.fixture
def egg():
    """200 points all over an egg of 0.3 × 0.2 × 0.14 m, none of which is like another."""
    i = np.arange(200) + 0.5
    z, angle = 1 - i / 100, np.pi * (1 + 5**0.5) * i
    across = np.sqrt(1 - z**2)
    return np.stack([across * np.cos(angle) * 0.15, across * np.sin(angle) * 0.1, 0.07 * z], -1)


@pytest.fixture(scope="session")
def studied():
    """A function: what moves like a world with some effects, and the plain twin that lacks them, unfitted."""
    return _studied


def _studied(still, effects=(), values=(), where=None, noise=5e-4, softer=0.1):
    twin = PlainTwin.of(body_of(still), still)
    plain = Hypothesis(twin)
    start = {name: quantity.start for name, quantity in plain.quantities.items()}
    start["stiffness"] *= softer
    with torch.no_grad():
        full = replace(plain, effects=effects, where=where)
        default = {name: quantity.start for name, quantity in full.quantities.items()}
        world = full.at({**default, **start, **dict(values)})
        points = world.sight(world.rollout().points).double().numpy()
    points = points + np.random.default_rng(1).normal(0, noise, points.shape)
    points[0] = still.points[0]
    return _study_of(replace(still, points=points.astype(np.float32)), twin, start, noise)


@pytest.fixture(scope="session")
def study_of():
    """A function: what was seen and its twin, with these parameters, unfitted."""
    return _study_of


def _study_of(seen, twin, start, noise):
    twin = replace(twin, observation=seen)
    plain = Hypothesis(twin)
    observer = Observer(seen, plain.at(start), 0.3)
    split = round(0.7 * len(seen.times))
    misfit = Misfit(plain, observer, Span(0, split - 1), noise)
    vector = misfit.coordinates.vector(start)
    residuals = misfit(vector[None])[0]
    base = Estimate(start, vector, residuals, misfit.jacobian(vector), 0, misfit.belief(residuals, vector))
    return Study(seen, plain, observer, misfit, start, base, noise, split)


@pytest.fixture
def fitted():
    """A function: the plain twin of a study with an effect at these values, as if they had been fitted."""
    return _fitted


def _fitted(study, effect, values, slopes=True):
    misfit = study.misfit.of(study.plain.with_effect(effect))
    full = {name: quantity.start for name, quantity in misfit.coordinates.quantities.items()}
    vector = misfit.coordinates.vector({**full, **study.base.values, **values})
    if not slopes:
        flat = np.zeros((len(study.base.residuals), len(vector)))
        return replace(study.base, values=misfit.coordinates.values(vector), vector=vector, jacobian=flat)
    residuals = misfit(vector[None])[0]
    return Estimate(
        misfit.coordinates.values(vector),
        vector,
        residuals,
        misfit.jacobian(vector),
        0,
        misfit.belief(residuals, vector),
    )


@pytest.fixture
def pulled(hung):
    """The same sheet held by its left and right edges, which are pulled apart and let back twice."""
    places = hung.points[0].astype(float)
    left, right = (places[np.abs(places[:, 0] - x) < 1e-3] for x in (places[:, 0].min(), places[:, 0].max()))
    way = 0.02 * (1.0 - np.cos(9 * hung.times))[:, None, None] * np.array([1.0, 0.0, 0.0])
    hands = np.concatenate([left[None] - way, right[None] + way], 1)
    return replace(hung, controllers=hands.astype(np.float32))


@pytest.fixture(scope="session")
def short():
    """A rope of 8 markers held by its upper end, which is shaken, as 16 frames that have not moved."""
    places = np.stack([np.linspace(0.0, 0.12, 8), np.zeros(8), -np.linspace(0.0, 0.2, 8)], -1)
    times = np.arange(16) / 30.0
    swing = np.stack([0.05 * np.sin(12 * times), 0.06 * np.sin(9 * times), 0 * times], -1)
    return Observation(
        times=times,
        points=np.repeat(places[None].astype(np.float32), len(times), 0),
        controllers=(places[:1][None] + swing[:, None]).astype(np.float32),
    )


@pytest.fixture(scope="session")
def thick_rope():
    """A function: a recording of the skin of a rope, and where its middle is in the first frame."""
    return _thick_rope


def _thick_rope(seed, radius=0.009, count=120, bend=1.2, roll=0.0, length=0.8, lying=False, noise=1e-3):
    """It is bent evenly, rolled about itself by so much, and carried to and fro as a whole, by one end.

    Hanging in the x-z plane, or lying on the ground at z = 0. Where on the skin places are follows from the
    seed, their noise from the roll too.
    """
    rng = np.random.default_rng(seed)
    along, around = rng.uniform(0, length, count), rng.uniform(0, 2 * np.pi, count) + roll
    noisy = np.random.default_rng((seed, int(1e3 * (roll + 10.0))))

    def middle(at):
        angle = bend * np.asarray(at) / length
        out = np.stack([-np.cos(angle), np.zeros_like(angle), np.sin(angle)], -1)
        if bend == 0.0:
            return np.stack([0 * angle, 0 * angle, np.asarray(at)], -1), out
        return length / bend * (out + np.array([1.0, 0.0, 0.0])), out

    line, out = middle(along)
    places = line + radius * (np.cos(around)[:, None] * out + np.sin(around)[:, None] * [0.0, 1.0, 0.0])
    fine = middle(np.linspace(0, length, 401))[0]
    held = fine[:1]
    if lying:
        turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
        places, fine, held = (one @ turn.T + [0.0, 0.0, radius] for one in (places, fine, held))
    times = np.arange(40) / 30.0
    away = np.stack([0.1 * np.sin(4 * times), np.zeros(40), np.zeros(40)], 1)[:, None]
    points = places + away + noise * noisy.normal(size=(40, count, 3))
    seen = Observation(
        times,
        points.astype(np.float32),
        (held + away).astype(np.float32),
        ground_height=0.0 if lying else None,
    )
    return seen, fine


@pytest.fixture
def made():
    """A function: evidence of a few columns, each with what it changes, the innovations last."""
    return _made


def _made(ways, plain, cells=2 * BLOCKS):
    """Columns as (kind, values, way), of as many residuals as `plain` has, in cells of equal size."""
    matrix = np.stack([*(way for _, _, way in ways), plain], axis=1)
    cell = np.arange(len(plain)) * cells // len(plain)
    columns = (*(Column(kind, dict(values)) for kind, values, _ in ways), Column("plain", {}))
    grams = np.stack([matrix[cell == c].T @ matrix[cell == c] for c in range(cells)])
    return Evidence(columns, grams, np.bincount(cell, minlength=cells))


@pytest.fixture
def evened():
    """A function: residuals of which each cell of `made` has as much: to weigh them changes nothing."""
    return _evened


def _evened(plain, cells=2 * BLOCKS):
    cell = np.arange(len(plain)) * cells // len(plain)
    power = np.bincount(cell, plain**2) / np.bincount(cell)
    return plain / np.sqrt(power / (plain**2).mean())[cell]


@pytest.fixture
def worlds():
    """A function: examples of hand-made evidence, in which the way of the effect at work explains the gap."""
    return _worlds


def _worlds(count, seed=0, names=("plasticity", "wind", "gravity_tilt", "damage")):
    """Every third is healthy: noise alone. Effects differ by nothing but how the innovations look."""
    rng = np.random.default_rng(seed)
    examples = []
    for i in range(count):
        ways = {name: rng.normal(size=600) for name in names}
        twin = [("twin", {"stiffness": 0.0}, rng.normal(size=600)) for _ in range(2)]
        sensors = [("sensor", {}, rng.normal(size=600)) for _ in range(2)]
        noise = rng.normal(size=600)
        acting = () if i % 3 == 0 else (names[int(rng.integers(len(names)))],)
        plain = noise - sum((1.5 * ways[name] for name in acting), np.zeros(600))
        made = _made([*twin, *sensors, *((name, {"size": 1.0}, way) for name, way in ways.items())], plain)
        cost = float((plain**2).mean())
        examples.append(Example(made, ("rope", "sheet", "solid")[i % 3], cost, bool(i % 2), acting, "made"))
    return examples


@pytest.fixture
def shaken():
    """A function: the same object, its hand going another way, so far [m]."""
    return _shaken


def _shaken(still, reach):
    times = still.times[:, None]
    swing = reach * np.concatenate([0 * times, np.sin(8 * times), np.cos(5 * times) - 1.0], -1)
    return replace(still, controllers=(still.controllers + swing[:, None]).astype(np.float32))


@pytest.fixture
def twin():
    """A function: a twin of a study with effects at these values, as if they had been fitted to it."""
    return _twin


def _twin(study, effects=(), values=()):
    misfit = study.misfit.of(replace(study.plain, effects=effects))
    start = {name: quantity.start for name, quantity in misfit.hypothesis.quantities.items()}
    known = {**start, **study.base.values, **dict(values)}
    vector = misfit.coordinates.vector(known)
    residuals = misfit(vector[None])[0]
    slopes = np.zeros((len(residuals), len(vector)))
    found = replace(study.base, values=known, vector=vector, residuals=residuals, jacobian=slopes)
    return Fitted(misfit, found, forecast(study.observer, misfit.hypothesis.at(known), study.split))


@pytest.fixture
def grounded(hung):
    """A recording over a ground, another without one, and a twin of the first that sticks to it."""
    over = replace(hung, ground_height=float(hung.points[0, :, 2].min()) - 0.01)
    study = _studied(over)
    other = transferred(study, _studied(hung).observation)
    sticky = {f"static_friction.{name}": q.start for name, q in StaticFriction.quantities.items()}
    return study, other, _twin(study, (StaticFriction(),), sticky)


@pytest.fixture
def chain():
    """A function: a recording of a rope that so many hands hold, of which the last is shaken."""
    return _chain


def _chain(hands: int) -> Observation:
    times = np.arange(30) / 30
    places = np.column_stack([np.linspace(0.0, 0.6, 40), np.zeros(40), np.ones(40)])
    points = np.repeat(places[None], 30, 0)
    held = places[np.linspace(0, 39, hands).round().astype(int)]
    controllers = np.repeat(held[None], 30, 0)
    controllers[:, -1, 1] += 0.02 * np.sin(9.0 * times)
    return Observation(times, points.astype(np.float32), controllers.astype(np.float32))


@pytest.fixture
def jury_sure_of(monkeypatch):
    """A function: from now on juries are sure of this answer, and the catalogue is these effects."""

    def of(answer, tried):
        class Sure(Jury):
            def probabilities(self, signs):
                rest = 0.2 / (len(CLASSES) - 1)
                return np.array([[0.8 if name == answer else rest for name in CLASSES] for _ in signs])

        monkeypatch.setattr(Jury, "shipped", classmethod(lambda cls: Sure(())))
        monkeypatch.setattr("model.gap.meeting.ALL_EFFECTS", tried)
        monkeypatch.setattr("model.gap.study.STARTS", 6)

    return of
