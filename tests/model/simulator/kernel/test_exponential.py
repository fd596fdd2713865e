"""The engine's exponential function and hyperbolic tangent beside those of a library."""

import ctypes

import numpy as np
import pytest
import torch

from model.simulator.kernel import build
from model.simulator.kernel.emit import ENGINE, TYPES

LANES = 8
EACH = """
extern "C" void each(const R *from, R *to, int64_t count) {
  for (int64_t i = 0; i < count; i += LANES) store(to + i, FUNCTION(load(from + i)));
}
"""
FUNCTIONS = {"exponential": np.exp, "tangent": np.tanh}
LOSES = {"exponential": 2.0, "tangent": 4.0}
"""Units in the last place, at most."""
KINDS = {"float32": torch.float32, "float64": torch.float64}


@pytest.fixture(params=[(name, kind) for name in FUNCTIONS for kind in KINDS], ids="-".join)
def ours(request):
    """One of them as compiled, the same of numpy in more digits, units that it may be off, and its type."""
    name, kind = request.param
    number, whole = TYPES[KINDS[kind]]
    head = [
        f"typedef {number} R;\ntypedef {whole} N;",
        f"#define SINGLE {int(kind == 'float32')}\n#define LANES {LANES}\n#define FUNCTION {name}",
    ]
    files = [(ENGINE / f"{file}.cpp").read_text() for file in ("vectors", "exponential")]
    library = build.load("\n".join(["#include <cstdint>", *head, *files, EACH]))

    def each(values):
        padded = np.zeros(-(-len(values) // LANES) * LANES, kind)
        padded[: len(values)] = values
        found = np.empty_like(padded)
        pointers = (each.ctypes.data_as(ctypes.c_void_p) for each in (padded, found))
        library.each(*pointers, ctypes.c_int64(len(padded)))
        return found[: len(values)]

    return each, FUNCTIONS[name], LOSES[name], np.dtype(kind)


def test_they_are_right_to_the_last_places_over_all_sizes(ours):
    each, exact, loses, kind = ours
    rng = np.random.default_rng(0)
    sizes = 10.0 ** rng.uniform(-12, np.log10(80 if kind == np.float32 else 700), 20000)
    values = np.concatenate([sizes, -sizes, np.linspace(-3, 3, 6001)]).astype(kind)
    expected = exact(values.astype(np.longdouble))
    unit = np.spacing(np.abs(expected).astype(kind)).astype(np.longdouble)
    assert np.max(np.abs(each(values) - expected) / unit) < loses


def test_what_is_not_finite_or_out_of_range_is_as_in_the_library(ours):
    each, exact, _, kind = ours
    values = np.array([np.inf, -np.inf, np.nan, 0.0, -0.0, 1e4, -1e4, np.finfo(kind).max], kind)
    with np.errstate(over="ignore"):
        np.testing.assert_array_equal(each(values), exact(values))


def test_the_smallest_and_largest_that_a_number_can_be_are_reached(ours):
    each, exact, _, kind = ours
    ends = np.log([np.finfo(kind).smallest_subnormal * 4, np.finfo(kind).tiny, np.finfo(kind).max / 2])
    values = ends.astype(kind)
    np.testing.assert_allclose(each(values), exact(values), rtol=1e-4 if kind == np.float32 else 1e-12)
