"""Scenes of our own making: what they show, how it moves, and how it is filmed."""
