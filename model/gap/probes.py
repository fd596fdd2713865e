"""At which values an effect is tried on top of a twin that lacks it."""

from itertools import product

from model.gap.effects.base import Effect


def probes(effect: Effect) -> list[dict[str, float]]:
    """Values to try: the start of what makes it present, over a grid of what shapes it."""
    grid = effect.grid
    start = {name: quantity.start for name, quantity in effect.quantities.items()}
    chosen = product(*grid.values())
    return [{**start, **dict(zip(grid, each, strict=True))} for each in chosen]
