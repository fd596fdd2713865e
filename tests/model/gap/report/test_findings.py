"""Report and arrays have to speak of the same points and frames."""

from dataclasses import replace

import numpy as np
import pytest


def test_other_points_are_refused(findings):
    where = findings.report.where.model_copy(update={"points": (1.0,), "acts_on": (1.0,)})
    with pytest.raises(ValueError, match="the report is of 90 frames and 1 points"):
        replace(findings, report=findings.report.model_copy(update={"where": where}))


def test_a_rollout_without_its_error_is_refused(findings):
    with pytest.raises(ValueError, match="come together"):
        replace(findings, error_after=None)


def test_a_rest_shape_is_finite(findings):
    with pytest.raises(ValueError, match="rest has values"):
        replace(findings, rest=np.full_like(findings.rest, np.nan))


def test_visible_is_the_share_that_is_seen(findings):
    observed = findings.observed.copy()
    observed[0] = np.nan
    observed[1] = 0.0
    observed[1, :30, 2] = np.nan
    seen = replace(findings, observed=observed).visible()
    assert seen[0] == 0.0
    assert seen[1] == 1.0 - 30 / observed.shape[1]
