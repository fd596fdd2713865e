import numpy as np

from model.part_views import view_parts
from model.types import Camera, Gaussians, Parts


def test_each_object_pixel_goes_to_the_part_in_front():
    means = np.array([[-0.1, 0, 1], [0.1, 0, 1], [-0.1, 0, 2]], np.float32)
    count = len(means)
    gaussians = Gaussians(
        means,
        np.full((count, 3), 0.01, np.float32),
        np.tile(np.float32([1, 0, 0, 0]), (count, 1)),
        np.full(count, 0.9, np.float32),
        np.zeros((count, 3), np.float32),
        np.full(count, 1e-6, np.float32),
    )
    camera = Camera(np.array([[100.0, 0, 20], [0, 100.0, 10], [0, 0, 1]]), np.eye(4), 40, 20)
    mask = np.zeros((20, 40), bool)
    mask[5:15, 5:35] = True
    visible = np.array([True, True, False])
    views = view_parts(
        np.zeros((20, 40, 3), np.uint8),
        mask,
        gaussians,
        Parts(np.array([0, 1, 2], np.int32), 3),
        visible,
        camera,
        "rope",
    )
    assert {view.shape_class for view in views} == {"rope"}
    assert [view.label for view in views] == ["part 0", "part 1", "part 2"]
    np.testing.assert_array_equal(views[0].mask | views[1].mask, mask)
    assert not (views[0].mask & views[1].mask).any()
    assert views[0].mask[:, :20].sum() == mask[:, :20].sum()
    assert not views[2].mask.any()
