"""A first look at a mesh: which of the three formats it is, and whether it is all there."""

from pathlib import Path
from typing import Final

from worker.inspection.verdict import BrokenFileError, UnknownFormatError

MAX_BYTES: Final = 200_000_000
"""As `model.reconstruction.mesh_file` has it."""
MAX_LINE: Final = 10_000
OBJ_WORDS: Final = frozenset(
    "v vn vt vp f l p o g s mg usemtl mtllib usemap maplib cstype deg bmat step curv curv2 surf parm trim "
    "hole scrv sp end con bevel c_interp d_interp lod shadow_obj trace_obj ctech stech call csh".split()
)
"""With which a line of an OBJ begins (Wavefront, Advanced Visualizer, appendix B1)."""


def inspect(path: Path) -> str:
    """Look at a mesh; returns the suffix that suits its content.

    Raises:
        UnknownFormatError: no GLB, PLY or OBJ.
        BrokenFileError: cut off, too large, or without faces.
    """
    size = path.stat().st_size
    if size > MAX_BYTES:
        raise BrokenFileError(f"{size} bytes, at most {MAX_BYTES} are read: simplify it")
    with path.open("rb") as file:
        head = file.read(20)
    if head.startswith(b"glTF"):
        return _glb(head, size)
    if head.startswith((b"ply\n", b"ply\r\n")):
        return _ply(path)
    return _obj(path)


def _glb(head: bytes, size: int) -> str:
    version, length = int.from_bytes(head[4:8], "little"), int.from_bytes(head[8:12], "little")
    if version != 2 or head[16:20] != b"JSON":
        raise BrokenFileError("not a GLB of version 2")
    if length > size:
        raise BrokenFileError(f"breaks off after {size} of {length} bytes: send the whole file")
    return ".glb"


def _ply(path: Path) -> str:
    with path.open("rb") as file:
        for _ in range(200):
            line = file.readline(MAX_LINE)
            if line.startswith(b"element face") and line.split()[-1] != b"0":
                return ".ply"
            if not line or line.strip() == b"end_header":
                break
    raise BrokenFileError("a PLY without faces: send a mesh")


def _obj(path: Path) -> str:
    """An OBJ has no signature: it is text whose every line begins with one of a few words."""
    found: set[str] = set()
    goes_on = False
    with path.open("rb") as file:
        while line := file.readline(MAX_LINE + 1):
            words = [] if goes_on else line.decode("utf-8-sig", "replace").split(maxsplit=1)
            goes_on = line.rstrip().endswith(b"\\")
            if len(line) > MAX_LINE or b"\0" in line or (words and not _known(words[0])):
                raise UnknownFormatError("neither a GLB, nor a PLY, nor an OBJ file")
            found.update(words[:1])
    if not {"v", "f"} <= found:
        raise BrokenFileError("an OBJ without vertices or faces: send a mesh")
    return ".obj"


def _known(word: str) -> bool:
    return word in OBJ_WORDS or word.startswith("#")
