"""The prior that only looks at colour, texture and outline."""

import cv2
import numpy as np
import pytest

from model.priors.materials import MATERIALS, combine
from model.priors.stub import StubPrior, measure
from model.types import PartView
from model.units import PROPERTY_UNITS

SIZE = (160, 200)
WHOLE = np.zeros(SIZE, bool)
WHOLE[30:130, 30:170] = True


def plain(color, roughness=0.0, seed=0):
    noise = np.random.default_rng(seed).normal(0, 1, (*SIZE, 1)) * roughness
    return np.clip(np.array(color) + noise, 0, 255).astype(np.uint8)


def believe(image, mask=WHOLE, object_mask=WHOLE, label="object"):
    return StubPrior().material(PartView(image=image, mask=mask, object_mask=object_mask, label=label))


def weight(prior, material):
    return prior.distribution[MATERIALS.index(material)]


IMAGES = {
    "plush": plain((140, 125, 110), 25),
    "jeans": plain((50, 70, 120), 12),
    "skin": plain((95, 60, 35)),
    "bag": plain((200, 40, 40)),
    "page": plain((250, 250, 250)),
    "black": plain((0, 0, 0)),
    "noise": np.random.default_rng(1).integers(0, 256, (*SIZE, 3), dtype=np.uint8),
}


@pytest.mark.parametrize("image", IMAGES.values(), ids=IMAGES)
def test_the_answer_is_a_wide_distribution(image):
    prior = believe(image)
    assert prior.distribution.sum() == pytest.approx(1.0)
    assert (prior.distribution > 0).all()
    entropy = -(prior.distribution * np.log(prior.distribution)).sum()
    assert entropy > 0.6 * np.log(10)
    assert prior.distribution.max() < 0.6


@pytest.mark.parametrize("image", IMAGES.values(), ids=IMAGES)
def test_properties_follow_from_the_distribution(image):
    prior = believe(image)
    assert set(prior.properties) == set(PROPERTY_UNITS)
    assert prior.properties == combine(prior.distribution, prior.shape_class)


def test_it_says_that_it_is_a_stub():
    assert any(
        "stub" in line and "colour, texture and outline" in line for line in believe(IMAGES["bag"]).warnings
    )


def test_same_pixels_same_answer():
    first, second = believe(IMAGES["noise"]), believe(IMAGES["noise"].copy())
    assert first.distribution.tobytes() == second.distribution.tobytes()
    assert first.properties == second.properties


def test_what_it_sees_moves_the_answer():
    prior = {name: believe(image) for name, image in IMAGES.items()}
    assert weight(prior["plush"], "fur") > 1.5 * weight(prior["bag"], "fur")
    assert weight(prior["jeans"], "denim") > 1.5 * weight(prior["plush"], "denim")
    assert weight(prior["skin"], "leather") > 1.4 * weight(prior["page"], "leather")
    assert weight(prior["bag"], "plastic") > 1.5 * weight(prior["plush"], "plastic")
    assert prior["plush"].properties["stiffness"].mean < prior["bag"].properties["stiffness"].mean


def test_parts_of_one_object_share_its_shape_and_differ_in_material():
    image = plain((140, 125, 110), 25)
    image[:, 100:] = (90, 55, 30)
    left, right = WHOLE.copy(), WHOLE.copy()
    left[:, 100:], right[:, :100] = False, False
    one, other = believe(image, left, label="part 0"), believe(image, right, label="part 1")
    assert one.shape_class == other.shape_class
    assert weight(one, "fur") > weight(other, "fur")


def test_only_the_masked_pixels_count():
    image, other = plain((140, 125, 110), 25), plain((140, 125, 110), 25)
    other[:20] = 0
    np.testing.assert_array_equal(believe(image).distribution, believe(other).distribution)


def test_a_rope_is_called_one():
    mask = cv2.line(np.zeros(SIZE, np.uint8), (15, 80), (185, 90), 1, thickness=9) > 0
    prior = believe(IMAGES["plush"], mask, mask)
    assert prior.shape_class == "rope"
    assert prior.properties["density"].mean > 250


def test_a_hidden_part_is_judged_by_the_whole_and_says_so():
    hidden = believe(IMAGES["plush"], mask=np.zeros_like(WHOLE), label="part 3")
    np.testing.assert_array_equal(hidden.distribution, believe(IMAGES["plush"]).distribution)
    assert any("part 3 is not visible" in line for line in hidden.warnings)


def test_nothing_visible_at_all_still_gets_an_answer():
    empty = np.zeros_like(WHOLE)
    assert believe(IMAGES["plush"], empty, empty).distribution.sum() == pytest.approx(1.0)


def test_measures_are_what_they_are_called():
    light = measure(plain((200, 200, 200)), WHOLE)
    assert light.lightness == pytest.approx(80.6, abs=0.5)
    assert light.chroma < 1
    assert light.contrast < 0.01
    assert light.gloss == 0
    assert measure(plain((30, 60, 160)), WHOLE).hue == pytest.approx(290, abs=20)
    assert measure(plain((140, 140, 140), 25), WHOLE).contrast > 4
    spot = plain((150, 30, 30))
    spot[40:60, 40:60] = 255
    assert measure(spot, WHOLE).gloss == pytest.approx(400 / WHOLE.sum())


def test_a_shape_that_is_known_is_believed():
    part = PartView(IMAGES["plush"], WHOLE, WHOLE, "part 0", shape_class="rope")
    prior = StubPrior().material(part)
    assert believe(IMAGES["plush"]).shape_class != "rope"
    assert prior.shape_class == "rope"
    assert prior.properties == combine(prior.distribution, "rope")
