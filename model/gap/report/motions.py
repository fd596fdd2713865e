"""What to film next: the motions that would settle what this observation leaves open."""

from collections.abc import Mapping

from model.gap.effects import ALL_EFFECTS
from model.gap.report.wording import companions, plain
from model.gap.schema import GapReport

DOUBTFUL = 0.05
"""An effect with this probability beside the verdict is worth a recording."""
CATALOGUE: Mapping[str, Mapping[str, str]] = {effect.name: effect.confused_with for effect in ALL_EFFECTS}
"""For each effect those that look alike, and the motion that tells them apart."""


def next_motions(report: GapReport) -> tuple[str, ...]:
    """Sentences, the most useful first; none where nothing is missing and nothing is in doubt."""
    rivals = dict.fromkeys([*companions(report), *_doubtful(report)])
    subject = report.effects[0].name if report.named is None else report.verdict.effect
    wanted: dict[str, list[str]] = {}
    for rival in rivals:
        motion = CATALOGUE[subject].get(rival) or CATALOGUE[rival].get(subject)
        if motion is not None and rival != subject:
            wanted.setdefault(motion, []).append(plain(rival))
    told = [
        f"{motion[0].upper()}{motion[1:]}: that tells {plain(subject)} from {' and '.join(names)}."
        for motion, names in wanted.items()
    ]
    return (*told, *_general(report))


def _doubtful(report: GapReport) -> list[str]:
    """Effects beside the verdict's that are not ruled out."""
    settled = (report.verdict.effect, report.verdict.second)
    return [e.name for e in report.effects if e.probability >= DOUBTFUL and e.name not in settled]


def _general(report: GapReport) -> tuple[str, ...]:
    """What is worth filming whatever the verdict."""
    if report.verdict.effect == "none":
        return ()
    if report.gap.transfer is None:
        return (
            "Move the object in another way and give that recording as a second interaction (--transfer):"
            " what is found here is only confirmed where it also shrinks the gap there.",
        )
    return ()
