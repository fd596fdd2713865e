from dataclasses import replace

import numpy as np

from model.scenes.looks.setting import Sensor, Setting
from model.views import look_at

CAMERA = look_at(np.array([0.5, 0.3, 0.4]), np.zeros(3), 90.0, 80, 60)


def test_the_table_looks_the_same_from_every_side():
    setting = Setting.draw(np.random.default_rng(0))
    pictures = []
    for angle in (0.0, 1.3):
        eye = np.array([0.5 * np.cos(angle), 0.5 * np.sin(angle), 0.4])
        camera = look_at(eye, np.zeros(3), 90.0, 80, 60)
        view, on_table = setting.empty(camera, np.zeros(3), 0.0, np.random.default_rng(1))
        assert on_table[45:].min() > 0.99
        pictures.append(view)
    np.testing.assert_allclose(*pictures, atol=1e-4)
    raised, _ = setting.empty(camera, np.zeros(3), 0.1, np.random.default_rng(1))
    assert np.abs(raised - pictures[1]).max() > 0.01


def test_without_a_ground_there_is_no_table_and_no_shadow():
    setting = Setting.draw(np.random.default_rng(0))
    view, on_table = setting.empty(CAMERA, np.zeros(3), None, np.random.default_rng(1))
    assert on_table.max() == 0
    means = np.zeros((5, 3), np.float32)
    assert setting.shaded(view, on_table, means, np.ones(5, np.float32), None, CAMERA) is view


def test_shadows_fall_away_from_the_lamp():
    setting = Setting.draw(np.random.default_rng(0))
    view, on_table = np.full((60, 80, 3), 0.5, np.float32), np.ones((60, 80), np.float32)
    means = np.tile(np.array([[0.0, 0.0, 0.12]], np.float32), (30, 1))
    volumes = np.full(30, 0.02**3, np.float32)
    for angle in (0.3, 2.4, 4.0):
        towards = (0.8 * np.cos(angle), 0.8 * np.sin(angle), 0.6)
        lamp = replace(setting, light=replace(setting.light, towards=towards))
        dark = view - lamp.shaded(view, on_table, means, volumes, 0.0, CAMERA)
        y, x = np.mgrid[:60, :80]
        weight = dark[..., 0] / dark[..., 0].sum()
        spot = np.array([(weight * x).sum(), (weight * y).sum()])
        under = CAMERA.project(np.zeros((1, 3)))[0][0]
        away = CAMERA.project(np.array([[-0.04 * np.cos(angle), -0.04 * np.sin(angle), 0.0]]))[0][0]
        assert (spot - under) @ (away - under) > 0


def test_sensors_add_noise_dark_corners_and_their_own_white():
    sensor = Sensor(noise=0.01, shot=0.0, blur=0.3, vignette=0.2, balance=(1.1, 1.0, 0.9))
    flat = np.full((60, 80, 3), 0.5)
    picture = sensor.expose(flat, np.random.default_rng(0)) / 255
    middle, corner = picture[25:35, 35:45], picture[:8, :8]
    assert middle.mean() > corner.mean() + 0.05
    assert middle[..., 0].mean() > middle[..., 2].mean() + 0.08
    assert 0.006 < middle[..., 1].std() < 0.014
    np.testing.assert_array_equal(picture, sensor.expose(flat, np.random.default_rng(0)) / 255)
