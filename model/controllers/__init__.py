"""Where the hand holds the object, and how that place moves: found in the clip, or brought by the user."""

from model.controllers.find import find_controllers, read_controllers
from model.controllers.grip_paths import grip_paths

__all__ = ["find_controllers", "grip_paths", "read_controllers"]
