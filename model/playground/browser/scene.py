"""The stage in the browser: Gaussians, control points, the hand, the ground."""

from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float, Float32, Float64

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
BALL, SHARE = 1.3, 0.04
"""Radius of a control point, in lengths of a spring, and at most this share of the object."""
FALL = 3.0
"""A ground so far below, in sizes of the object, is in view at first."""
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
        size = float(np.linalg.norm(np.ptp(session.bundle.topology.points, axis=0)))
        self._radius = min(BALL * spring_length(session.bundle), SHARE * size)
        self._looks = [Look(actor.bundle) for actor in session.actors]
        self._splats: list[Any] = []
        self.balls: dict[tuple[int, int], Any] = {}
        self._pulls: dict[tuple[int, int], Float64[Array, " 3"]] = {}
        self._shown: tuple[object, ...] | None = None
        server.scene.world_axes.visible = False
        self._ground = self._add_ground()
        self._hands = [self._add_hand(i) for i in range(len(session.actors))]
        self._names = [self._add_name(i) for i in range(len(session.actors))]
        for i, actor in enumerate(session.actors):
            self._splats.append(self._add_splats(i, actor))
        self._look_from()
        server.scene.on_click()(self._clicked)
        server.scene.on_click(modifier="shift")(self._clicked_with_shift)

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
                self._names[i].position = self._above(actor, points)
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
        return self._server.scene.add_gaussian_splats(
            f"/twins/{i}",
            (SCALE * (centers + actor.shift)).astype(np.float32),
            SCALE**2 * covariances,
            self._session.bundle.gaussians.visible_colors,
            self._session.bundle.gaussians.opacities[:, None],
        )

    def _add_name(self, i: int) -> Any:  # noqa: ANN401 - viser's own handle
        actor = self._session.actors[i]
        return self._server.scene.add_label(
            f"/names/{i}",
            actor.name,
            position=self._above(actor, self._session.moment.points[i]),
            anchor="bottom-center",
            visible=bool(actor.name),
        )

    def _above(self, actor: Actor, points: Float32[Array, "N 3"]) -> tuple[float, float, float]:
        """Where the name of an actor stands."""
        low, high = points.min(axis=0), points.max(axis=0)
        x, y, z = SCALE * (np.array([*(low[:2] + high[:2]) / 2, high[2] + 2 * self._radius]) + actor.shift)
        return float(x), float(y), float(z)

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
        """Before the stage, slightly above, with all in view that will move, and the ground if it is near."""
        bundle, settings = self._session.bundle, self._session.moment.settings
        low, high = (side(bundle.topology.points, axis=0).astype(np.float64) for side in (np.min, np.max))
        size = float(np.linalg.norm(high - low))
        if bundle.controls is not None and bundle.controls.size:
            low = np.minimum(low, bundle.controls.min(axis=(0, 1)))
            high = np.maximum(high, bundle.controls.max(axis=(0, 1)))
        if settings.ground and low[2] - settings.ground_height < FALL * size:
            low[2] = min(low[2], settings.ground_height)
        high = high + self._session.actors[-1].shift
        reach = 0.6 * float(np.linalg.norm(high - low)) / np.tan(VIEW / 2)
        camera, center = self._server.initial_camera, (low + high) / 2
        camera.fov = VIEW
        camera.look_at = tuple(SCALE * center)
        camera.position = tuple(SCALE * (center + reach * np.array([0.0, -0.82, 0.57])))

    def _show_grips(self, grips: tuple[Grip, ...]) -> None:
        """A ball for each control point and actor: where it pulls, or where its point is."""
        wanted = {(grip.number, i): grip for grip in grips for i in range(len(self._session.actors))}
        for gone in set(self.balls) - set(wanted):
            self.balls.pop(gone).remove()
        for key, grip in wanted.items():
            color = DRAGGED if grip.dragged else PINNED if grip.pinned else FREE
            if key not in self.balls:
                self.balls[key] = self._add_ball(key)
            ball, actor = self.balls[key], self._session.actors[key[1]]
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
            self._pulls[key] = np.array(self.balls[key].position) - start
        if phase == "end":
            self._pulls.pop(key, None)
            self._session.drop(number)
        elif key in self._pulls:
            self._session.drag(number, (pointer + self._pulls[key]) / SCALE - shift)

    def _clicked(self, event: "viser.SceneClickEvent") -> None:
        """Pin the control point that is meant, or free it; else make one where the object is meant."""
        origin, way = _sight(event)
        number, actors = self._ball_at(origin, way), self._session.actors
        if number is not None:
            pinned = any(grip.number == number and grip.pinned for grip in self._session.moment.grips)
            self._session.pin(number, not pinned)
            return
        meant = min(
            range(len(actors)), key=lambda i: _beside(actors[i].positions + actors[i].shift, origin, way)
        )
        self._session.grab(meant, origin - actors[meant].shift, way)

    def _clicked_with_shift(self, event: "viser.SceneClickEvent") -> None:
        """Remove the control point that is meant."""
        number = self._ball_at(*_sight(event))
        if number is not None:
            self._session.let_go(number)

    def _ball_at(self, origin: Float64[Array, " 3"], way: Float64[Array, " 3"]) -> int | None:
        """The control point that a line of sight meets."""
        places = {key: np.array([ball.position]) / SCALE for key, ball in list(self.balls.items())}
        beside = {key: _beside(place, origin, way) for key, place in places.items()}
        met = [key for key in beside if beside[key] <= 1.2 * self._radius]
        return min(met, key=lambda key: beside[key])[0] if met else None


def _sight(event: "viser.SceneClickEvent") -> tuple[Float64[Array, " 3"], Float64[Array, " 3"]]:
    """Where a click looks from [m], and which way."""
    return np.array(event.ray_origin, np.float64) / SCALE, np.array(event.ray_direction, np.float64)


def _beside(places: Float[Array, "n 3"], origin: Float64[Array, " 3"], way: Float64[Array, " 3"]) -> float:
    """How far a line of sight passes from the nearest of some places [m]."""
    to = places - origin
    along = (to @ way) / (way @ way)
    return float(np.linalg.norm(to - along[:, None] * way, axis=1).min())
