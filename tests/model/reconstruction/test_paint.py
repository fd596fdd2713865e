import numpy as np

from model.reconstruction.fill import fill
from model.reconstruction.paint import colors_from_image, visible, without_rim
from model.reconstruction.volume import Volume, grid_around


def test_colours_come_from_their_pixels_and_the_back_mirrors_the_front(scene_of):
    scene = scene_of([((0, 0, 0.05), (0.05, 0.05, 0.05))])
    shape, origin, spacing = grid_around(np.full(3, -0.05), np.full(3, 0.05), np.eye(3), 0.002)
    origin = origin + np.array([0, 0, 0.05])
    volume = Volume(np.zeros(shape, np.float32), origin, np.eye(3), spacing)
    distance = 0.05 - np.linalg.norm(volume.points - [0, 0, 0.05], axis=-1)
    filling = fill(Volume(distance.astype(np.float32), origin, np.eye(3), spacing))
    colors = colors_from_image(filling, scene.camera, scene.image, scene.mask)
    left, right = filling.means[:, 0] < -0.012, filling.means[:, 0] > 0.012
    assert np.all(colors[left, 0] > colors[left, 2])  # red everywhere on the left, hidden or not
    assert np.all(colors[right, 2] > colors[right, 0])
    assert np.abs(colors.mean(1)[:, None] * 255 - 205).min() > 20  # no table on the rim

    seen = visible(filling, scene.camera)
    towards = scene.camera.position - np.array([0, 0, 0.05])
    front = (filling.means - [0, 0, 0.05]) @ towards > 0
    assert seen[filling.surface & front].mean() > 0.7
    assert not seen[~front].any()


def test_the_rim_takes_the_colour_of_the_inside():
    image = np.full((20, 20, 3), 255, np.uint8)
    mask = np.zeros((20, 20), bool)
    mask[5:15, 5:15] = True
    image[7:13, 7:13] = 10
    assert without_rim(image, mask).max() == 10.0


def test_a_thin_object_keeps_its_middle():
    image = np.full((20, 20, 3), 255, np.uint8)
    mask = np.zeros((20, 20), bool)
    mask[9:11] = True
    image[9:11] = 10
    assert without_rim(image, mask).max() == 10.0
