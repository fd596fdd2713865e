"""What materials look like, and what a scene stands in: textures, gloss, pile; lights, tables, cameras."""

from model.scenes.looks.paint import ALL_LOOKS, paint, wardrobe

__all__ = ["ALL_LOOKS", "paint", "wardrobe"]
