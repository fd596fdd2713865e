"""The material table, and mixtures of beliefs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from model.errors import InputError
from model.priors.materials import MATERIALS, combine, mixture, normalised, typical
from model.priors.table import SPECIFIC_STIFFNESS_CEILING, TABLE
from model.types import Estimate
from model.units import PROPERTY_UNITS

SHAPES = ("sheet", "rope", "solid")


def test_every_material_has_every_property_once_and_each_says_why():
    pairs = [(row.material, row.property) for row in TABLE]
    assert sorted(pairs) == sorted((material, name) for material in MATERIALS for name in PROPERTY_UNITS)
    assert all(len(row.source) > 8 for row in TABLE)


def test_values_are_possible():
    for row in TABLE:
        assert row.spread > 0
        for value in (row.solid, row.sheet, row.rope):
            assert value > 0
            if row.property in ("damping", "restitution"):
                assert value * np.exp(row.spread) < 1


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("material", MATERIALS)
def test_an_explicit_twin_can_afford_every_material(material, shape):
    estimates = typical(material, shape)
    ratio = estimates["stiffness"].mean / estimates["density"].mean
    assert ratio <= SPECIFIC_STIFFNESS_CEILING


@pytest.mark.parametrize("shape", SHAPES)
def test_order_is_that_of_experience(shape):
    of = {material: typical(material, shape) for material in MATERIALS}
    assert of["fur"]["stiffness"].mean < of["rubber"]["stiffness"].mean < of["metal"]["stiffness"].mean
    assert of["fabric"]["density"].mean < of["rubber"]["density"].mean < of["metal"]["density"].mean
    assert of["fabric"]["restitution"].mean < of["rubber"]["restitution"].mean
    assert of["metal"]["damping"].mean < of["fur"]["damping"].mean


def test_shape_matters_where_it_should():
    assert typical("fabric", "sheet")["density"].mean > 2 * typical("fabric", "solid")["density"].mean
    assert typical("silk", "sheet")["drag_rate"].mean > 3 * typical("silk", "rope")["drag_rate"].mean
    assert typical("rubber", "sheet")["friction"] == typical("rubber", "solid")["friction"]


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("index", range(10))
def test_certainty_gives_back_the_material(index, shape):
    combined = combine(np.eye(10)[index], shape)
    for name, estimate in typical(MATERIALS[index], shape).items():
        assert combined[name].mean == pytest.approx(estimate.mean)
        assert combined[name].spread == pytest.approx(estimate.spread)
        assert combined[name].unit == PROPERTY_UNITS[name]


def test_two_equal_components_in_closed_form():
    """Means at ± d in the logarithm: the middle is their geometric mean, the spread sqrt(s² + d²)."""
    low, high = Estimate(1.0, 0.3, "Pa"), Estimate(float(np.exp(2.0)), 0.3, "Pa")
    combined = mixture([low, high], np.array([0.5, 0.5]))
    assert combined.mean == pytest.approx(np.e)
    assert combined.spread == pytest.approx(np.sqrt(0.3**2 + 1.0))


@given(st.lists(st.floats(0.01, 1.0), min_size=10, max_size=10), st.sampled_from(SHAPES))
def test_moments_match_a_sampled_mixture_in_closed_form(weights, shape):
    distribution = np.array(weights) / np.sum(weights)
    combined = combine(distribution, shape)
    for name in PROPERTY_UNITS:
        each = [typical(material, shape)[name] for material in MATERIALS]
        first = sum(w * np.log(e.mean) for w, e in zip(distribution, each, strict=True))
        second = sum(w * (e.spread**2 + np.log(e.mean) ** 2) for w, e in zip(distribution, each, strict=True))
        assert np.log(combined[name].mean) == pytest.approx(first, abs=1e-9)
        assert combined[name].spread ** 2 == pytest.approx(second - first**2, rel=1e-6)


def test_moments_match_samples():
    rng = np.random.default_rng(0)
    distribution = normalised({"fabric": 2.0, "rubber": 1.0, "metal": 1.0})
    each = [typical(material, "solid")["stiffness"] for material in MATERIALS]
    drawn = rng.choice(10, size=200_000, p=distribution)
    logs = np.log([e.mean for e in each])[drawn] + np.array([e.spread for e in each])[
        drawn
    ] * rng.standard_normal(len(drawn))
    combined = combine(distribution, "solid")["stiffness"]
    assert np.log(combined.mean) == pytest.approx(logs.mean(), abs=0.02)
    assert combined.spread == pytest.approx(logs.std(), rel=0.01)


def test_weights_become_a_distribution_in_the_order_of_the_materials():
    distribution = normalised({"fur": 3.0, "fabric": 1.0})
    assert distribution[MATERIALS.index("fur")] == 0.75
    assert distribution[MATERIALS.index("fabric")] == 0.25
    assert distribution.sum() == 1.0


@pytest.mark.parametrize("weights", [{}, {"fur": 0.0}, {"fur": -1.0, "silk": 2.0}, {"fur": float("nan")}])
def test_weights_that_are_none_are_refused(weights):
    with pytest.raises(InputError, match="material weights"):
        normalised(weights)
