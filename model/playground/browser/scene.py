"""The stage in the browser: Gaussians, control points, the hand, the ground."""

from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float64

from model.playground.actor import Actor
from model.playground.colors import ColorBy, Colors
from model.playground.grip import Grip, spring_length
from model.playground.look import Look
from model.playground.moment import Moment
from model.playground.session import Session
from model.types import Array, Camera

if TYPE_CHECKING:
    import viser

SCALE = 100.0
"""The browser is told centimetres: it keeps covariances in half precision, too coarse for metres."""
FREE, DRAGGED, PINNED, HAND = (60, 130, 246), (255, 170, 40), (225, 60, 60), (235, 80, 40)
"""Colours of control points and of the clip's hand."""
BALL = 1.3
"""Radius of a control point, in lengths of a spring."""
VIEW = 0.9
"""Field of view [rad], from top to bottom."""


class Scene:
    """Shows moments of a session, and hears clicks and drags.

    A click on the object makes a control point; dragging its ball pulls the object, a click on the ball pins
    it or frees it, and a click with shift removes it. Dragging anything else turns the view.
    """

    def __init__(self, server: "viser.ViserServer", session: Session, colors: Colors) -> None:
        """Put everything on the stage."""
        self._server, self._session, self.colors = server, session, colors
        self._radius = BALL * spring_length(session.bundle)
        self._looks = [Look(actor.bundle) for actor in session.actors]
        self._splats: list[Any] = []
        self._balls: dict[tuple[int, int], Any] = {}
        self._pulls: dict[tuple[int, int], Float64[Array, " 3"]] = {}
        self._shown: tuple[object, ...] | None = None
        server.scene.world_axes.visible = False
        self._ground = self._add_ground()
        self._hands = [self._add_hand(i) for i in range(len(session.actors))]
        for i, actor in enumerate(session.actors):
            self._splats.append(self._add_splats(i, actor))
        self._look_from()
        server.scene.on_click()(self._clicked)

    def show(self, moment: Moment, by: ColorBy) -> None:
        """Send what has changed."""
        now = (moment.frame, moment.settings, moment.grips, by)
        if now == self._shown:
            return
        self._shown = now
        ground = moment.settings
        with self._server.atomic():
            self._ground.visible = ground.ground
            self._ground.position = (0.0, 0.0, SCALE * ground.ground_height)
            for i, (actor, points) in enumerate(zip(self._session.actors, moment.points, strict=True)):
                centers, covariances = self._looks[i](points)
                self._splats[i].set_gaussians(
                    (SCALE * (centers + actor.shift)).astype(np.float32),
                    SCALE**2 * covariances,
                    self.colors(by, moment.settings, points),
                    self._session.bundle.gaussians.opacities[:, None],
                )
                self._hands[i].visible = moment.hand
                if moment.hand:
                    self._hands[i].points = (SCALE * self._places(moment, i)).astype(np.float32)
            self._show_grips(moment.grips)

    def camera(self, seen_by: "viser.CameraHandle", longest_side: int) -> Camera:
        """What a browser looks with, in metres, with `longest_side` pixels along its longer side."""
        aspect = float(seen_by.image_width) / float(seen_by.image_height)
        width = longest_side if aspect >= 1 else round(longest_side * aspect)
        height = longest_side if aspect < 1 else round(longest_side / aspect)
        width, height = width // 2 * 2, height // 2 * 2
        focal = height / 2 / np.tan(float(seen_by.fov) / 2)
        w, x, y, z = (float(part) for part in seen_by.wxyz)
        pose = np.eye(4)
        pose[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
        pose[:3, 3] = np.asarray(seen_by.position, np.float64) / SCALE
        intrinsics = np.array(
            [[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]], np.float64
        )
        return Camera(intrinsics, pose, width, height)

    def _add_splats(self, i: int, actor: Actor) -> Any:  # noqa: ANN401 - viser's own handle
        points = self._session.moment.points[i]
        centers, covariances = self._looks[i](points)
        if actor.name:
            low, high = actor.positions.min(axis=0), actor.positions.max(axis=0)
            above = float(high[2] + 0.15 * (high - low).max())
            place = SCALE * (np.array([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, above]) + actor.shift)
            self._server.scene.add_label(f"/names/{i}", actor.name, position=place, anchor="bottom-center")
        return self._server.scene.add_gaussian_splats(
            f"/twins/{i}",
            (SCALE * (centers + actor.shift)).astype(np.float32),
            SCALE**2 * covariances,
            self._session.bundle.gaussians.colors,
            self._session.bundle.gaussians.opacities[:, None],
        )

    def _add_ground(self) -> Any:  # noqa: ANN401 - viser's own handle
        return self._server.scene.add_grid(
            "/ground",
            width=300.0,
            height=300.0,
            cell_size=5.0,
            section_size=50.0,
            cell_color=(205, 208, 212),
            section_color=(180, 184, 190),
            plane_color=(244, 245, 246),
            plane_opacity=1.0,
        )

    def _add_hand(self, i: int) -> Any:  # noqa: ANN401 - viser's own handle
        return self._server.scene.add_point_cloud(
            f"/hands/{i}",
            (SCALE * (self._places(self._session.moment, i))).astype(np.float32),
            HAND,
            point_size=0.5 * SCALE * self._radius,
            point_shape="circle",
            visible=self._session.moment.hand,
        )

    def _places(self, moment: Moment, i: int) -> Float64[Array, "C 3"]:
        """Where the hand holds an actor [m]; one place where it does not, as nothing cannot be drawn."""
        places: Float64[Array, "C 3"] = moment.hands[i] + self._session.actors[i].shift
        return places if len(places) else np.zeros((1, 3))

    def _look_from(self) -> None:
        """Before the stage, slightly above, with all of it in view."""
        points = np.concatenate(
            [actor.bundle.topology.points + actor.shift for actor in self._session.actors]
        )
        low, high = points.min(axis=0), points.max(axis=0)
        reach = 0.85 * float(np.linalg.norm(high - low)) / np.tan(VIEW / 2)
        center = (low + high) / 2
        camera = self._server.initial_camera
        camera.fov = VIEW
        camera.look_at = tuple(SCALE * center)
        camera.position = tuple(SCALE * (center + reach * np.array([0.0, -0.82, 0.57])))

    def _show_grips(self, grips: tuple[Grip, ...]) -> None:
        """A ball for each control point and actor: where it pulls, or where its point is."""
        wanted = {(grip.number, i): grip for grip in grips for i in range(len(self._session.actors))}
        for gone in set(self._balls) - set(wanted):
            self._balls.pop(gone).remove()
        for key, grip in wanted.items():
            color = DRAGGED if grip.dragged else PINNED if grip.pinned else FREE
            if key not in self._balls:
                self._balls[key] = self._add_ball(key)
            ball, actor = self._balls[key], self._session.actors[key[1]]
            place = grip.place if grip.holds else actor.positions[grip.point]
            ball.position = tuple(SCALE * (place + actor.shift))
            if tuple(ball.color) != color:
                ball.color = color

    def _add_ball(self, key: tuple[int, int]) -> Any:  # noqa: ANN401 - viser's own handle
        ball = self._server.scene.add_icosphere(
            f"/grips/{key[0]}/{key[1]}", radius=SCALE * self._radius, color=FREE, cast_shadow=False
        )

        @ball.on_drag
        async def _(event: "viser.SceneNodeDragEvent[viser.IcosphereHandle]") -> None:
            self._dragged(key, event.phase, np.array(event.end_position), np.array(event.start_position))

        @ball.on_click
        async def _(event: object) -> None:
            grip = next((g for g in self._session.moment.grips if g.number == key[0]), None)
            if grip is not None:
                self._session.pin(key[0], not grip.pinned)

        @ball.on_click(modifier="shift")
        async def _(event: object) -> None:
            self._session.let_go(key[0])

        return ball

    def _dragged(
        self,
        key: tuple[int, int],
        phase: str,
        pointer: Float64[Array, " 3"],
        start: Float64[Array, " 3"],
    ) -> None:
        """The ball keeps its distance to the pointer, which took it anywhere."""
        number, shift = key[0], self._session.actors[key[1]].shift
        if phase == "start":
            self._pulls[key] = np.array(self._balls[key].position) - start
        if phase == "end":
            self._pulls.pop(key, None)
            self._session.drop(number)
        elif key in self._pulls:
            self._session.drag(number, (pointer + self._pulls[key]) / SCALE - shift)

    def _clicked(self, event: "viser.SceneClickEvent") -> None:
        """A click that meets no ball means the object, if it meets that."""
        origin, way = np.array(event.ray_origin) / SCALE, np.array(event.ray_direction)
        for key, ball in list(self._balls.items()):
            to = np.array(ball.position) / SCALE - origin
            beside = np.linalg.norm(to - (to @ way) * way / (way @ way))
            if key in self._balls and beside <= 1.2 * self._radius:
                return
        best = min(
            range(len(self._session.actors)),
            key=lambda i: _beside(self._session.actors[i], origin, way),
        )
        self._session.grab(best, origin - self._session.actors[best].shift, way)


def _beside(actor: Actor, origin: Float64[Array, " 3"], way: Float64[Array, " 3"]) -> float:
    """How far a line of sight passes from an actor [m]."""
    to = actor.positions + actor.shift - origin
    along = (to @ way) / (way @ way)
    return float(np.linalg.norm(to - along[:, None] * way, axis=1).min())
