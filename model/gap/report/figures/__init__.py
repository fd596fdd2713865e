"""The figures of a report. One figure, one file; listed here, it is drawn, inlined and tested."""

from collections.abc import Callable
from dataclasses import dataclass

from matplotlib.figure import Figure

from model.gap.report.figures import closure, course, place, ranking, rollouts
from model.gap.report.findings import Findings


@dataclass(frozen=True)
class Drawing:
    """One figure of the report."""

    file: str
    """Name of its PNG."""
    heading: str
    caption: str
    """How to read it."""
    draw: Callable[[Findings], Figure]


ALL_DRAWINGS = (
    Drawing(
        "closure.png",
        "How far",
        "How far the twin's points are from the observed ones, on time that no fit has seen; black lines are"
        " 95 % intervals. “With any force” is a flexible force fitted to the same data: what any missing"
        " physics could explain.",
        closure.draw,
    ),
    Drawing(
        "ranking.png",
        "Which effect",
        "The effects of the catalogue by probability. Bracketed ones look alike in this recording.",
        ranking.draw,
    ),
    Drawing(
        "place.png",
        "Where",
        "The object at rest, dark where the refitted twin departs most from what really happened.",
        place.draw,
    ),
    Drawing(
        "course.png",
        "When",
        "How far free runs of the twin are off, which adds up over time. Phases of the motion are named, with"
        " their share of the gap: of what surprises a twin that is led by the observation, squared, so that a"
        " phase answers for what goes wrong in it and not for what went wrong before.",
        course.draw,
    ),
    Drawing(
        "rollouts.png",
        "Beside the observation",
        "What was observed as dots, the twin as rings, and lines between those that belong together."
        " At most 250 points are shown, spread evenly; the moments are the middles of four equal parts of the"
        " recording.",
        rollouts.draw,
    ),
)
