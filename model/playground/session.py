"""A playground without its browser: twins that move, and what the user asks of them."""

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from queue import Empty, SimpleQueue
from typing import Any, Literal

import numpy as np
from jaxtyping import Float64

from model.bundle import TwinBundle
from model.errors import InputError
from model.playground.actor import Actor
from model.playground.edit import edited
from model.playground.grip import Grip, grip_on, pick, spring_length
from model.playground.moment import Moment
from model.playground.pulse import Pulse
from model.playground.settings import Settings, settings_of
from model.types import Array

SMOOTH = 24.0
"""Frames per second, at least: slower clips are moved in equal shares of their frames."""
PATIENCE = 0.15
"""Settings are taken over at most every so many seconds of simulated time: each costs a tenth of a second."""
TRUSTED = 1.0
"""Settings that went well for so long [s] are what a motion that goes wrong comes back to."""
APART = 1.5
"""How far twins stand from each other, in widths of them."""


@dataclass
class _Wishes:
    """What was asked for and is not done yet."""

    settings: Settings
    rebuild: bool = True
    since: float = np.inf
    """Simulated time since settings were last taken over [s]."""


class Session:
    """Twins on a stage, moved frame by frame by one thread; every other method may be called from any.

    What users ask for is done between two frames, in order.

    Args:
        bundle: The twin.
        compare: Beside it stands the same twin without the effects that it carries.

    Raises:
        InputError: there is nothing to compare, or an effect of the twin cannot be simulated.
    """

    def __init__(self, bundle: TwinBundle, compare: bool = False) -> None:
        """See the class."""
        if compare and not bundle.effects:
            raise InputError("effects.json: the twin carries no effect, so there is nothing to compare")
        fps = bundle.manifest.source.fps or 30.0
        self.bundle, self.interval = bundle, 1.0 / fps / max(1, int(np.ceil(SMOOTH / fps)))
        self.actors = _actors(bundle, self.interval, compare)
        self.moving = bundle.controls is not None and len(bundle.topology.controller_springs) > 0
        """There is a recorded motion."""
        self._commands = SimpleQueue[Callable[[], None]]()
        self._wishes = _Wishes(settings_of(bundle))
        self._settings = self._trusted = self._wishes.settings
        self._resets = 0
        self._grips: dict[int, Grip] = {}
        self._numbers = self._frame = 0
        self._running, self._hand = True, len(bundle.topology.controller_springs) > 0
        self._motion: float | None = None
        self._message = ""
        self._pulse = Pulse(self.interval)
        self._build()
        self.moment = self._look()

    def change(self, **settings: Any) -> None:  # noqa: ANN401 - as Settings has them
        """Set some of the fields of `Settings`."""
        self._commands.put(partial(self._change, settings))

    def change_one(self, name: Literal["wind", "stiffness"], index: int, value: float) -> None:
        """Set one number of a field of `Settings` that has several."""
        self._commands.put(partial(self._change_one, name, index, value))

    def grab(self, actor: int, origin: Float64[Array, " 3"], direction: Float64[Array, " 3"]) -> None:
        """Make the point of an actor that a line of sight meets a control point; none where it misses."""
        self._commands.put(partial(self._grab, actor, origin, direction))

    def drag(self, number: int, place: Float64[Array, " 3"]) -> None:
        """Pull a control point to `place` [m]; the object follows."""
        self._commands.put(partial(self._drag, number, np.asarray(place, np.float64)))

    def drop(self, number: int) -> None:
        """Stop pulling: where it is not pinned, the object is free again, and the point rides along."""
        self._commands.put(partial(self._regrip, number, dragged=False))

    def pin(self, number: int, pinned: bool) -> None:
        """Let a control point hold the object where it is, or no longer."""
        self._commands.put(partial(self._regrip, number, pinned=pinned))

    def let_go(self, number: int | None = None) -> None:
        """Remove a control point; None: all of them."""
        self._commands.put(partial(self._let_go, number))

    def play(self) -> None:
        """From rest, the hand of the clip moves as it was recorded."""
        self._commands.put(partial(self._restart, True))

    def rest(self) -> None:
        """Back to rest, held by the hand of the clip as in its first frame."""
        self._commands.put(partial(self._restart, False))

    def free(self) -> None:
        """The hand of the clip lets go."""
        self._commands.put(self._free)

    def run(self, running: bool) -> None:
        """Let time go on, or stand still."""
        self._commands.put(partial(self._run, running))

    def remake(self, bundle: TwinBundle) -> None:
        """Go on with the same twin of other materials; what the user has set stays set."""
        self._commands.put(partial(self._remake, bundle))

    def edited(self) -> TwinBundle:
        """The twin with the settings of now."""
        return edited(self.bundle, self.moment.settings)

    def step(self) -> Moment:
        """Do what was asked, then move on by one frame if time goes on.

        A motion that leaves the numbers is told in the moment's message, and starts again from rest with
        settings that are known to go well.
        """
        while True:
            try:
                self._commands.get_nowait()()
            except Empty:
                break
        try:
            self._take_over()
            if self._running:
                self._advance()
        except InputError as error:
            self._recover(f"{error}: back to rest")
        self.moment = self._look()
        return self.moment

    def keep_going(self, stop: threading.Event, seen: Callable[[Moment], None] = lambda _: None) -> None:
        """Step in real time, or as fast as it goes, until told to stop; `seen` gets every moment."""
        while not stop.is_set():
            seen(self.step())
            if self._running:
                self._pulse.beat(time.monotonic())
                stop.wait(self._pulse.wait(time.monotonic()))
            else:
                self._pulse.pause()
                stop.wait(self.interval)

    def _advance(self) -> None:
        if self._motion is not None:
            self._motion += self.interval
        for number, grip in self._grips.items():
            self._grips[number] = grip.later(self.interval, self.actors[0].positions)
        for actor in self.actors:
            actor.advance(self._motion or 0.0, list(self._grips.values()))
        if self._wishes.since >= TRUSTED:
            self._trusted = self._settings
        self._frame += 1

    def _recover(self, message: str) -> None:
        self._message, self._resets = message, self._resets + 1
        self._settings = self._wishes.settings = self._trusted
        self._restart(False)
        self._build()

    def _take_over(self) -> None:
        """Build the simulators again if something about them has changed."""
        wishes = self._wishes
        wishes.since += self.interval
        due = wishes.settings != self._settings and (wishes.since >= PATIENCE or not self._running)
        if due or wishes.rebuild:
            self._settings, wishes.since = wishes.settings, 0.0
            self.moment = replace(self.moment, building=True)
            self._build()

    def _build(self) -> None:
        for actor in self.actors:
            effects = self._settings.effects and actor.name != WITHOUT
            settings = replace(self._settings, effects=effects)
            actor.build(settings, self._hand, list(self._grips.values()), self._motion or 0.0)
        self._wishes.rebuild = False

    def _look(self) -> Moment:
        return Moment(
            frame=self._frame,
            points=tuple(actor.positions for actor in self.actors),
            hands=tuple(actor.hand_places(self._motion or 0.0) for actor in self.actors),
            grips=tuple(self._grips.values()),
            settings=self._settings,
            running=self._running,
            motion=self._motion,
            hand=self._hand,
            speed=self._pulse.speed if self._running else None,
            message=self._message,
            idle=self.actors[-1].idle,
            resets=self._resets,
        )

    def _change(self, settings: Mapping[str, Any]) -> None:
        self._wishes.settings = replace(self._wishes.settings, **settings)

    def _change_one(self, name: str, index: int, value: float) -> None:
        numbers = list(getattr(self._wishes.settings, name))
        numbers[index] = value
        self._change({name: tuple(numbers)})

    def _remake(self, bundle: TwinBundle) -> None:
        before, wished = asdict(settings_of(self.bundle)), asdict(self._wishes.settings)
        mine = {name: value for name, value in wished.items() if value != before[name]}
        self.bundle = bundle
        for actor in self.actors:
            actor.bundle = bundle
        self._wishes.settings = self._settings = self._trusted = replace(settings_of(bundle), **mine)
        self._wishes.rebuild, self._resets = True, self._resets + 1

    def _grab(self, actor: int, origin: Float64[Array, " 3"], direction: Float64[Array, " 3"]) -> None:
        positions = self.actors[actor].positions
        point = pick(positions, origin, direction, spring_length(self.bundle))
        if point is not None:
            self._numbers += 1
            here = self.actors[0].positions
            self._grips[self._numbers] = grip_on(self._numbers, point, self.bundle, here)

    def _drag(self, number: int, place: Float64[Array, " 3"]) -> None:
        self._regrip(number, dragged=True)
        if number in self._grips:
            self._grips[number] = replace(self._grips[number], target=place)

    def _regrip(self, number: int, dragged: bool | None = None, pinned: bool | None = None) -> None:
        """Change how a grip holds; one that begins to hold does so as the points are now."""
        if number not in self._grips:
            return
        before = self._grips[number]
        after = replace(
            before,
            dragged=before.dragged if dragged is None else dragged,
            pinned=before.pinned if pinned is None else pinned,
        )
        if after.holds != before.holds:
            self._wishes.rebuild = True
            if after.holds:
                after = after.taking_hold(self.actors[0].positions)
        elif not after.dragged:
            after = replace(after, target=after.place)
        self._grips[number] = after

    def _let_go(self, number: int | None) -> None:
        for gone in list(self._grips) if number is None else [number]:
            grip = self._grips.pop(gone, None)
            self._wishes.rebuild |= grip is not None and grip.holds

    def _restart(self, playing: bool) -> None:
        if not playing or self.moving:
            self._grips.clear()
            self._hand = len(self.bundle.topology.controller_springs) > 0
            self._motion = 0.0 if playing else None
            self._wishes.rebuild, self._running = True, True
            for actor in self.actors:
                actor.rest()

    def _free(self) -> None:
        self._wishes.rebuild |= self._hand
        self._hand, self._motion = False, None

    def _run(self, running: bool) -> None:
        self._running = running


WITHOUT = "without"


def _actors(bundle: TwinBundle, interval: float, compare: bool) -> tuple[Actor, ...]:
    """The twin; in a comparison without its effects on the left, with them on the right."""
    if not compare:
        return (Actor("", bundle, interval),)
    width = APART * float(max(np.ptp(bundle.topology.points, axis=0)[:2]))
    names = ", ".join(dict.fromkeys(record.name for record in bundle.effects))
    return (
        Actor(WITHOUT, bundle, interval),
        Actor(f"with {names}", bundle, interval, (width, 0.0, 0.0)),
    )
