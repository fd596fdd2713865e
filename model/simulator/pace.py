"""How many substeps each frame of a rollout takes."""

import math
import warnings

from model.errors import InputError
from model.simulator.backend import Path
from model.simulator.divergence import SimulationDiverged, finite
from model.simulator.drive import Drive
from model.simulator.dynamics import Dynamics
from model.simulator.stability import StabilityWatch
from model.simulator.system import Anchors, State

MARGIN = 1.2
"""How many more substeps than the stability bound asks for at the state it was computed at."""
LONGEST = 5e-4
"""The longest substep [s], for systems so soft that stability asks for less: a first-order step errs by about
dt/2 in time, and so by 0.5 % of the motion in 0.1 s."""
KEPT = (1.1 / MARGIN, 1.6 / MARGIN)
"""Substeps stay as they are while the bound is within these factors of the one that they were chosen for."""
CALM = 0.02
"""Relative change of the bound between two looks below which the wait for the next is doubled."""
WAIT = 8
"""The longest wait, in frames."""
BURST = 4.0
"""Growth of the kinetic energy since the last look at which the wait is over."""
REPEATS = 3
"""How often a frame that left the bound is done again with more substeps."""
MOST = 1_000_000
"""Substeps of a frame above which a rollout is refused: ten times as many as the command line takes."""


class StabilityWarning(UserWarning):
    """The substeps asked for are fewer than the stability bound allows.

    Attributes:
        frame: Where that was seen; 0: at the start.
        needed: Substeps per frame that the bound asks for there, without a margin.
        used: Substeps per frame that were asked for.
    """

    def __init__(self, frame: int, needed: int, used: int) -> None:
        """Say it in one line."""
        self.frame, self.needed, self.used = frame, needed, used
        where = f"in frame {frame}" if frame else "at the start"
        super().__init__(f"{used} substeps per frame: stability needs {needed} {where}")


class TooManySubsteps(SimulationDiverged):
    """A frame would take more substeps than `MOST`; who tries candidates gives it up as one that diverges."""

    def __init__(self, interval: float, count: int) -> None:
        """Say it in one line."""
        self.frame, self.point, self.term = 0, 0, "unknown"
        InputError.__init__(
            self,
            f"a frame of {interval:.3g} s would take {count:.3g} substeps, and {MOST} are the most: "
            "give times in seconds, or springs less stiff, less damped or on heavier points",
        )


class Pace:
    """Keeps the substeps of a rollout within the stability bound, or says where given ones leave it.

    The bound is found at the start and looked at again after frames: seldom while it stays what it is, and at
    once when the motion speeds up, for that is what instability does. Substeps that are not given follow the
    bound; a frame that ended outside of it, or in no finite numbers, is done again with more.

    Args:
        dynamics: The terms and their constants.
        path: What computes the rollout.
        given: Substeps per frame; None: what the bound asks for, with a margin.

    Raises:
        InputError: fewer substeps than one.
        TooManySubsteps: more than `MOST`, given or found to be needed.
    """

    def __init__(self, dynamics: Dynamics, path: Path, given: int | None) -> None:
        """See the class."""
        self._watch = StabilityWatch(dynamics, path.slopes)
        self._given, self._unit = None if given is None else some(given), path.look
        self._limit, self._repeats, self._warned = math.inf, 0, False
        self._seen, self._energy = math.inf, 0.0
        self._due = self._wait = 2 * path.look

    def start(self, state: State, anchors: Anchors | None, longest: float) -> None:
        """Find the bound at the start, for intervals of up to `longest` [s]."""
        self._limit = self._seen = self._watch.find(state, anchors)
        if self._given is not None and longest / self._given >= self._limit:
            self._tell(0, longest, self._limit, self._given)

    def count(self, interval: float) -> int:
        """Substeps of a frame interval [s]."""
        return affordable(interval, self._given or substeps_for(interval, self._limit, MARGIN))

    def accepts(self, before: State, after: State, drive: Drive) -> bool:
        """Whether a frame stands; if not, `count` says more for it than before."""
        dt, sound = drive.interval / drive.count, finite(after)
        if self._given is None and not sound and finite(before):
            return not self._again(dt, 0.0)
        if not sound or not self._look_is_due(before, after, drive.frame):
            return True
        limit = self._watch.follow(after, drive(drive.count - 1))
        outside = dt >= limit
        if outside and self._given is None and self._again(dt, limit):
            return False
        if outside:
            self._tell(drive.frame, drive.interval, limit, drive.count)
        elif not KEPT[0] <= limit / self._limit <= KEPT[1]:
            self._limit = limit
        self._looked(limit, after, drive.frame)
        return True

    def _look_is_due(self, before: State, after: State, frame: int) -> bool:
        known = self._energy or _square(before)
        return frame >= self._due or 0 < BURST * known < _square(after)

    def _looked(self, limit: float, state: State, frame: int) -> None:
        calm = math.isinf(limit) or abs(limit - self._seen) < CALM * limit
        self._wait = min(2 * self._wait, WAIT * self._unit) if calm else self._unit
        self._seen, self._due, self._energy, self._repeats = limit, frame + self._wait, _square(state), 0

    def _again(self, dt: float, limit: float) -> bool:
        """Choose substeps for the bound found, but no shorter than a fourth: the state may be spoilt."""
        if self._repeats == REPEATS:
            return False
        self._repeats += 1
        self._limit = max(limit, MARGIN * dt / 4)
        return True

    def _tell(self, frame: int, interval: float, limit: float, count: int) -> None:
        """Warn once."""
        if not self._warned:
            self._warned = True
            warnings.warn(StabilityWarning(frame, math.ceil(interval / limit), count), stacklevel=5)


class Steady:
    """As many substeps as are given, whatever stability asks for: who has found out saves the look.

    Args:
        given: Substeps per frame.

    Raises:
        InputError: fewer substeps than one.
        TooManySubsteps: more than `MOST`.
    """

    def __init__(self, given: int) -> None:
        """See the class."""
        self._given = some(given)

    def start(self, state: State, anchors: Anchors | None, longest: float) -> None:
        """Nothing is to be found."""

    def count(self, interval: float) -> int:
        """Substeps of any frame."""
        return affordable(interval, self._given)

    def accepts(self, before: State, after: State, drive: Drive) -> bool:
        """Every frame stands."""
        return True


def some(given: int) -> int:
    """Substeps per frame that may be asked for."""
    if given < 1:
        raise InputError(f"substeps is {given}: give at least 1, or leave it out")
    return given


def affordable(interval: float, count: int) -> int:
    """So many substeps of a frame interval [s], if they can be paid."""
    if count > MOST:
        raise TooManySubsteps(interval, count)
    return count


def _square(state: State) -> float:
    """In the place of the kinetic energy [m²/s²]."""
    return float(state.velocities.detach().square().sum())


def substeps_for(interval: float, limit: float, margin: float) -> int:
    """Substeps of `interval` [s], each at most `limit` / `margin` and at most LONGEST [s]."""
    return math.ceil(interval * max(margin / limit, 1 / LONGEST))
