"""Cases of real recordings as a folder that training and evaluation read."""

import warnings
from collections.abc import Sequence
from pathlib import Path

from model.errors import InputError
from model.formats.files import check_writable
from model.progress import StageReport
from model.scenes.case import Case
from model.scenes.files import SUFFIX, CaseIndex, check_no_cases, save_case, write_index
from model.scenes.phystwin_case import read_phystwin_case


def gather(
    folder: Path, recordings: Sequence[Path], report: StageReport = lambda stage, share: None
) -> CaseIndex:
    """Read cases in PhysTwin's format into a folder, and index it.

    All are read before any is written: one that is refused leaves nothing half done. What is doubtful about
    one, such as a hand too far off to hold it, is warned of.

    Args:
        folder: Where the files go: an empty or a new one.
        recordings: Folders of one case each, like `data/different_types/single_lift_sloth`.
        report: Told how far the work is.

    Raises:
        InputError: the folder has cases already or cannot be written to, a recording is refused, or two have
            the same name.
    """
    check_no_cases(folder)
    check_writable(folder / "index.json")
    cases = []
    for done, recording in enumerate(recordings, start=1):
        cases.append(_read(recording))
        report("scenes", done / (len(recordings) + 1))
    names = [case.name for case in cases]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise InputError(
            f"{twice[0]}: two recordings have this name: cases are known by the name of their folder"
        )
    folder.mkdir(parents=True, exist_ok=True)
    for case in cases:
        save_case(case, folder / f"{case.name}{SUFFIX}")
    index = write_index(folder)
    report("done", 1.0)
    return index


def _read(recording: Path) -> Case:
    """The case; what is wrong with it, or doubtful, is said of the recording by name.

    Raises:
        InputError: it is refused.
    """
    try:
        case = read_phystwin_case(recording)
    except InputError as error:
        where = "" if str(recording) in str(error) else f"{recording}: "
        raise InputError(f"{where}{error}") from None
    for doubt in case.topology.warnings:
        warnings.warn(f"{case.name}: {doubt}", stacklevel=2)
    return case
