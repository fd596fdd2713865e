"""The controls beside the stage."""

import html
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from model.playground.browser.materials import MaterialPicker
from model.playground.browser.scene import Scene
from model.playground.colors import ColorBy, Legend
from model.playground.moment import Moment
from model.playground.movie import Recording, draw
from model.playground.pulse import SLOW
from model.playground.session import Session
from model.playground.settings import Settings
from model.rendering import best_renderer

if TYPE_CHECKING:
    import viser

TELL = 0.25
"""Seconds between two looks at the speed: a number that flickers cannot be read."""
STATE_HEIGHT = 6.0
"""Of what the user should know, in lines of text one em high: four lines of it."""
MOVIE_SIDE = 640
"""Longer side of a recorded video [px]."""
HELP = (
    "**Click** the object to make a control point. **Drag** its ball to pull. **Click** the ball to pin it, "
    "**shift-click** to remove it. Drag elsewhere to turn the view."
)


class Panel:
    """Sliders and buttons, and what the user should know."""

    def __init__(
        self, server: "viser.ViserServer", session: Session, scene: Scene, recording: Recording, name: Path
    ) -> None:
        """Put everything beside the stage."""
        self._gui, self._session, self._scene = server.gui, session, scene
        self._recording, self._name = recording, name.name.removesuffix(".twin.zip").removesuffix(".zip")
        self._colors = scene.colors
        self.color_by: ColorBy = "appearance"
        self._told, self._drawing, self._resets = 0.0, "", 0
        self._shown: list[tuple[Any, Callable[[Settings], object]]] = []
        server.gui.configure_theme(show_share_button=False, show_logo=False, control_width="medium")
        self._state = server.gui.add_html("")
        self._add_motion()
        self._add_colors()
        self._add_surroundings(session.moment.settings)
        self._add_material(session.moment.settings)
        self._materials = MaterialPicker(server.gui, session, scene.colors)
        self._add_results()
        server.gui.add_markdown(HELP)

    def show(self, moment: Moment) -> None:
        """Say how things are."""
        now = time.monotonic()
        if now - self._told < TELL:
            return
        self._told = now
        _set(self._state, "content", state_html(state_lines(moment, self._drawing)))
        if moment.resets != self._resets:
            self._resets = moment.resets
            for handle, value in self._shown:
                _put(handle, value(moment.settings))
            self._explain(moment.settings)
        self._run.label = "Pause" if moment.running else "Go on"
        self._free.disabled = not moment.hand
        self._record.label = record_label(self._recording)

    def _add_motion(self) -> None:
        gui, session = self._gui, self._session
        self._run = gui.add_button("Pause")
        self._run.on_click(lambda _: session.run(not session.moment.running))
        play = gui.add_button("Play the recorded motion", disabled=not session.moving)
        play.on_click(lambda _: session.play())
        gui.add_button("Back to rest").on_click(lambda _: session.rest())
        self._free = gui.add_button("Let the hand go", disabled=not session.moment.hand)
        self._free.on_click(lambda _: session.free())
        gui.add_button("Remove the control points").on_click(lambda _: session.let_go())

    def _add_colors(self) -> None:
        choice = self._gui.add_dropdown("Colour by", self._colors.choices, initial_value=self.color_by)
        self._legend = self._gui.add_html("")

        @choice.on_update
        def _(event: object) -> None:
            self.color_by = choice.value
            self._explain(self._session.moment.settings)

    def _explain(self, settings: Settings) -> None:
        """Say what the colours mean."""
        _set(self._legend, "content", legend_html(self._colors.legend(self.color_by, settings)))

    def _add_surroundings(self, settings: Settings) -> None:
        gui, change, one = self._gui, self._session.change, self._session.change_one
        with gui.add_folder("Surroundings"):
            gravity = gui.add_vector3("Gravity m/s²", settings.gravity, step=0.1)
            self._hear(
                gravity, lambda s: s.gravity, lambda v: change(gravity=tuple(float(part) for part in v))
            )
            for axis, name in enumerate("xy"):
                wind = self._slider(f"Wind {name} m/s", settings.wind[axis], (-8.0, 8.0), 0.1)
                self._hear(wind, partial(_item, "wind", axis), partial(one, "wind", axis))
            grip = self._slider("Air grip 1/m", settings.air_grip, (0.02, 10.0), 0.02)
            self._hear(grip, lambda s: s.air_grip, lambda v: change(air_grip=v))
            ground = gui.add_checkbox("Ground", settings.ground)
            self._hear(ground, lambda s: s.ground, lambda v: change(ground=v))
            low, room = 100 * settings.ground_height, 100 * self._size()
            height = self._slider("Ground height cm", low, (round(low - room, 1), round(low + room, 1)), 0.1)
            self._hear(height, lambda s: 100 * s.ground_height, lambda v: change(ground_height=v / 100))
            friction = self._slider("Friction", settings.friction, (0.0, 2.0), 0.01)
            self._hear(friction, lambda s: s.friction, lambda v: change(friction=v))
            bounce = self._slider("Restitution", settings.restitution, (0.0, 1.0), 0.01)
            self._hear(bounce, lambda s: s.restitution, lambda v: change(restitution=v))

    def _add_material(self, settings: Settings) -> None:
        gui, bundle = self._gui, self._session.bundle
        change, one = self._session.change, self._session.change_one
        with gui.add_folder("Material"):
            gui.add_markdown("Stiffness, times what it was:")
            for part in range(len(settings.stiffness)):
                label = bundle.parts[part].label if part < len(bundle.parts) else f"part {part}"
                factor = self._slider(f"{label} ×", 1.0, (0.1, 10.0), 0.05)
                self._hear(factor, partial(_item, "stiffness", part), partial(one, "stiffness", part))
            high = 5 * settings.dashpot_damping or 0.1
            damping = self._slider("Damping N·s/m", settings.dashpot_damping, (0.0, high), high / 200)
            self._hear(damping, lambda s: s.dashpot_damping, lambda v: change(dashpot_damping=v))
            drag = self._slider("Drag 1/s", settings.drag_rate, (0.0, 10.0), 0.05)
            self._hear(drag, lambda s: s.drag_rate, lambda v: change(drag_rate=v))
            if settings.self_contact:
                contact = gui.add_checkbox("Self-contact", True)
                self._hear(contact, lambda s: s.self_contact, lambda v: change(self_contact=v))
            if bundle.effects and len(self._session.actors) == 1:
                names = ", ".join(dict.fromkeys(record.name for record in bundle.effects))
                effects = gui.add_checkbox(f"Effects: {names}", True)
                self._hear(effects, lambda s: s.effects, lambda v: change(effects=v))

    def _add_results(self) -> None:
        self._record = self._gui.add_button("Record a video")
        self._record.on_click(self._recorded)
        self._gui.add_button("Save the edited twin").on_click(self._saved)

    def _slider(self, label: str, value: float, bounds: tuple[float, float], step: float) -> Any:  # noqa: ANN401
        """One whose bounds include its value."""
        return self._gui.add_slider(label, min(bounds[0], value), max(bounds[1], value), step, value)

    def _hear(
        self,
        handle: Any,  # noqa: ANN401 - viser's own handle
        value: Callable[[Settings], object],
        changed: Callable[[Any], None],
    ) -> None:
        """Pass on what the user sets; `value` says what there is to show when settings come back."""
        handle.on_update(lambda _: changed(handle.value))
        self._shown.append((handle, value))

    def _size(self) -> float:
        return float(np.ptp(self._session.bundle.topology.points, axis=0).max())

    def _recorded(self, event: Any) -> None:  # noqa: ANN401 - viser's event
        """Begin to record; or stop, draw the video beside all else, and hand it to who asked for it."""
        if not self._recording.on and not len(self._recording):
            self._recording.start()
            return
        shots, interval = self._recording.stop(), self._session.interval
        camera, client = self._scene.camera(event.client.camera, MOVIE_SIDE), event.client

        def finish() -> None:
            self._drawing = f"drawing the video: {len(shots)} frames"
            try:
                movie = draw(shots, interval, self._session.actors, self._colors, camera, best_renderer())
                client.send_file_download(f"{self._name}.mp4", movie, save_immediately=True)
            finally:
                self._drawing = ""

        if shots:
            threading.Thread(target=finish, name="movie", daemon=True).start()

    def _saved(self, event: Any) -> None:  # noqa: ANN401 - viser's event
        """Hand the edited twin to who asked for it: nothing is written on the machine that simulates."""
        name = f"{self._name}.edited.twin.zip"
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / name
            self._session.edited().save(path)
            event.client.send_file_download(name, path.read_bytes(), save_immediately=True)


def state_lines(moment: Moment, drawing: str = "") -> list[str]:
    """How fast time passes, and what the user should know."""
    lines = ["paused" if not moment.running else "starting" if moment.speed is None else _speed(moment.speed)]
    if moment.building:
        lines.append("making the simulator: the first time a kind of it takes seconds")
    if moment.motion is not None:
        lines.append(f"recorded motion: {moment.motion:.1f} s")
    if moment.idle:
        lines.append(f"cannot act now: {', '.join(moment.idle)}")
    return lines + [line for line in (drawing, moment.message) if line]


def state_html(lines: Sequence[str]) -> str:
    """As high however much there is to say: else what is below would jump under a click."""
    first, *rest = (html.escape(line) for line in lines)
    words = "<br>".join([f"<b>{first}</b>", *rest])
    return f'<div style="height:{STATE_HEIGHT}em;overflow-y:auto;padding:0 1em;line-height:1.5">{words}</div>'


def record_label(recording: Recording) -> str:
    """What the button of the video does next."""
    if recording.on:
        return f"Stop recording ({recording.seconds:.0f} s)"
    return f"Draw the recording ({recording.seconds:.0f} s)" if len(recording) else "Record a video"


def legend_html(legend: Legend) -> str:
    """Dots and words; the words come from a bundle, so they are escaped."""
    rows = (
        f'<span style="color:rgb({",".join(str(round(255 * part)) for part in color)})">&#9679;</span> '
        f"{html.escape(words)}"
        for words, color in legend
    )
    return '<div style="padding:0 1em;font-size:0.85em">' + "<br>".join(rows) + "</div>"


def _speed(speed: float) -> str:
    return "real time" if speed >= SLOW else f"{speed:.2f} × real time: slower than real time"


def _item(name: str, index: int, settings: Settings) -> float:
    return float(getattr(settings, name)[index])


def _put(handle: Any, value: Any) -> None:  # noqa: ANN401 - viser's own handle
    """Show a value, also one that a slider did not go to."""
    if hasattr(handle, "min") and isinstance(value, float):
        handle.min, handle.max = min(handle.min, value), max(handle.max, value)
    handle.value = value


def _set(handle: Any, name: str, value: object) -> None:  # noqa: ANN401 - viser's own handle
    """Send a property only where it changes."""
    if getattr(handle, name) != value:
        setattr(handle, name, value)
