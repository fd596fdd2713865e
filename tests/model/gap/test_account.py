"""What an effect explains, by part of what was seen."""

import json
from dataclasses import asdict, astuple, replace

import numpy as np
import pytest

from model.gap.account import BEYOND, FINEST, MOST, Account, Explained, against_ordinary


def total(explained):
    """Of all parts."""
    return sum(astuple(explained))


def test_halves_count_the_same_however_much_there_was():
    halved = Explained.of((40.0, 20.0), (2.0, 1.0), (9.0, 4.5))
    assert (halved.fitted, halved.later, halved.elsewhere) == pytest.approx((np.log(2.0),) * 3)
    assert total(halved) == pytest.approx(3.0 * np.log(2.0))
    assert total(Explained.of((40.0, 20.0), (1.0, 2.0))) == pytest.approx(0.0)
    assert total(Explained()) == 0.0


def test_a_recording_in_which_a_twin_goes_astray_or_fits_all_too_well_does_not_decide_alone():
    assert Explained.of((4.0, 1.0), (1.0, 1e9)).later == MOST[0]
    assert total(Explained.of((1.0, 0.0), (1.0, 0.0))) == 2.0 * MOST[1]


def test_what_the_fitted_frames_hardly_show_others_do_not_decide():
    faint = np.exp(0.04)
    assert total(Explained.of((faint, 1.0), (2.0, 1.0))) == pytest.approx((1.0 + BEYOND) * 0.04)
    assert total(Explained.of((1.0, 1.0), (9.0, 1.0))) == 0.0
    assert total(Explained.of((1.0, faint), (9.0, 1.0))) == pytest.approx(-0.04)
    assert Explained.of((faint, 1.0), (1.0, 2.0)).later == pytest.approx(-np.log(2.0)), "harm counts in full"


def test_what_is_seen_slowly_counts_by_itself():
    """It may be much where the fitted frames, seen quickly, show little: that is what it is for."""
    faint = np.exp(0.04)
    both = Explained.of((faint, 1.0), (1.0, 1.0), (1.0, 1.0), slowly=(2.0, -9.0))
    assert (both.slowly, both.slowly_elsewhere) == (2.0, MOST[0])
    assert total(both) == pytest.approx(0.04 + 2.0 + MOST[0])
    alone = Explained.of((faint, 1.0), (1.0, 1.0), slowly=(2.0,))
    assert (alone.slowly, alone.slowly_elsewhere) == (2.0, 0.0)


def test_without_the_other_recording():
    here, both = {"wind": Explained(0.5, 0.4)}, {"wind": Explained(0.4, 0.3, 0.9)}
    account = Account("rope", {"wind": 0.1}, here, both, (4.0, 2.0), lattices=(0.5, None))
    assert account.told == both
    alone = account.alone
    assert alone == Account("rope", {"wind": 0.1}, here, {}, (4.0,), lattices=(0.5,))
    assert alone.told == alone.explained


def test_a_better_sensor_makes_no_twin_worse():
    """A lattice is off by lengths, which do not shrink with the noise that they are compared with."""
    off = 2.5e-3
    left = [1.0 + (off / noise) ** 2 for noise in (0.3e-3, 0.5e-3, FINEST)]
    told = [against_ordinary(one, noise) for one, noise in zip(left, (0.3e-3, 0.5e-3, FINEST), strict=True)]
    assert max(told) == told[-1] == left[-1]
    assert min(told) > 0.8 * told[-1]
    assert against_ordinary(3.0, 5e-3) == 3.0


def test_a_twin_that_follows_itself_no_better_is_of_its_lattice():
    """If that is more than noise: of a twin that leaves next to nothing its lattice leaves any share."""
    account = Account("sheet", {}, {}, {}, (20.0, 1.5))
    assert not account.of_lattice
    assert not replace(account, lattices=(None, 1.4)).of_lattice
    assert not replace(account, lattices=(3.0, 9.0)).of_lattice
    assert replace(account, lattices=(15.0, 0.1)).of_lattice
    assert replace(account, lattices=(30.0, None)).of_lattice
    assert not replace(account, left=(1.5, 20.0), lattices=(1.4, 19.0)).of_lattice


@pytest.mark.parametrize("flexible", [Explained(0.3, -0.1, slowly=0.2), None])
def test_comes_back_as_it_was_told(flexible):
    here = {"wind": Explained(0.5, 0.4)}
    account = Account("rope", {"wind": 0.1}, here, {}, (4.0,), flexible, (0.5,))
    content = json.loads(json.dumps(asdict(account)))
    assert Account.of(content) == account
    assert Account.of(content).alone == account
    if flexible is None:
        del content["flexible"], content["lattices"]
        before = replace(account, lattices=())
        assert Account.of(content) == before, "as accounts are that were told before anybody asked"
