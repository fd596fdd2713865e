"""Reading a mesh file into evenly sampled surface points with normals and colours."""

import hashlib
import io
import warnings
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import trimesh
from jaxtyping import Float64

from model.errors import InputError
from model.types import Array

FORMATS = {".glb": "glb", ".obj": "obj", ".ply": "ply"}
MAXIMUM_BYTES = 200_000_000
MAXIMUM_FACES = 3_000_000
SAMPLES = 120_000
POINTERS = (b"mtllib", b"TextureFile")
"""How an OBJ and a PLY name the file that their colours are in."""


@dataclass(frozen=True)
class Surface:
    """A surface as points, centred on its bounding box and scaled to a largest side of 1."""

    points: Float64[Array, "N 3"]
    normals: Float64[Array, "N 3"]
    """Outward unit normals."""
    colors: Float64[Array, "N 3"] | None
    """RGB 0..1, None where the mesh has none."""
    warnings: tuple[str, ...] = ()


def read_mesh(path: Path) -> tuple[Surface, str]:
    """Sample the surface of a mesh file; returns it with the sha256 of the file.

    Only the file itself is read: nothing it refers to (textures beside it, web addresses) is opened, so
    textures must be inside a GLB.

    Raises:
        InputError: unknown format, unreadable, too large, empty, or not finite.
    """
    kind = FORMATS.get(path.suffix.lower())
    if kind is None:
        raise InputError(f"{path}: a mesh must be a .glb, .obj or .ply file")
    try:
        size = path.stat().st_size
        if size > MAXIMUM_BYTES:
            raise InputError(
                f"{path}: the mesh has {size} bytes, at most {MAXIMUM_BYTES} are read; simplify it"
            )
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: the mesh cannot be read ({error.strerror})") from None
    mesh = _loaded(data, kind, path)
    if len(mesh.faces) > MAXIMUM_FACES:
        raise InputError(
            f"{path}: the mesh has {len(mesh.faces)} faces, at most {MAXIMUM_FACES}; simplify it"
        )
    if len(mesh.faces) == 0 or not np.isfinite(mesh.vertices).all():
        raise InputError(f"{path}: the mesh has no faces or vertices that are not finite; export it again")
    surface = _sampled(mesh, kind, path)
    if surface.colors is None and kind != "glb" and any(pointer in data for pointer in POINTERS):
        note = (
            f"the colours of {path.name} are in another file, which is not read: they are taken from the clip"
        )
        surface = replace(surface, warnings=(f"{note}; a GLB holds its textures itself",))
    return surface, hashlib.sha256(data).hexdigest()


def _loaded(data: bytes, kind: str, path: Path) -> trimesh.Trimesh:
    """One mesh of everything in the file."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of parsers, about materials that are not there
        try:
            # From a stream and without a resolver: trimesh has no way to reach other files.
            loaded = trimesh.load(io.BytesIO(data), file_type=kind)
            mesh = loaded.to_mesh() if isinstance(loaded, trimesh.Scene) else loaded
        except Exception as error:  # the parsers raise whatever a malformed file leads them to
            reason = str(error).splitlines()[0][:100] if str(error) else type(error).__name__
            raise InputError(f"{path}: not a readable {kind.upper()} mesh ({reason})") from None
    if not isinstance(mesh, trimesh.Trimesh):
        raise InputError(f"{path}: holds no triangles (a point cloud?); give a mesh")
    return mesh


def _sampled(mesh: trimesh.Trimesh, kind: str, path: Path) -> Surface:
    low, high = mesh.bounds
    extent = float((high - low).max())
    if extent <= 0:
        raise InputError(f"{path}: all vertices of the mesh coincide; export it again")
    if mesh.is_watertight and mesh.volume < 0:
        mesh.invert()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        points, faces = trimesh.sample.sample_surface(mesh, SAMPLES, seed=0)
        colors = _colors(mesh, kind, points, faces)
    centred = (np.asarray(points, np.float64) - 0.5 * (low + high)) / extent
    return Surface(centred, np.asarray(mesh.face_normals[faces], np.float64), colors)


def _colors(mesh: trimesh.Trimesh, kind: str, points: Array, faces: Array) -> Float64[Array, "N 3"] | None:
    """Colours (0..1) at sampled points, from the texture, the material or the vertices, if any is given."""
    visual = mesh.visual
    if not visual.defined:
        return None
    if visual.kind == "texture" and kind != "glb":
        return None  # its picture is another file, in whose place trimesh puts a grey one
    corners = np.asarray(mesh.triangles)[faces]
    weights = trimesh.triangles.points_to_barycentric(corners, points)
    if visual.kind == "texture":
        picture = getattr(visual.material, "baseColorTexture", None) or getattr(
            visual.material, "image", None
        )
        if picture is not None and visual.uv is not None:
            uv = np.einsum("nc,ncd->nd", weights, np.asarray(visual.uv)[mesh.faces[faces]])
            texel = np.asarray(picture.convert("RGB"), np.float64) / 255.0
            column = np.floor((uv[:, 0] % 1.0) * texel.shape[1]).astype(int) % texel.shape[1]
            row = np.floor((1.0 - uv[:, 1] % 1.0) * texel.shape[0]).astype(int) % texel.shape[0]
            textured: Float64[Array, "N 3"] = texel[row, column]
            return textured
        if getattr(visual.material, "baseColorFactor", None) is None:
            return None  # trimesh would call it grey
        plain = np.asarray(visual.material.main_color, np.float64)[:3] / 255.0
        return np.tile(plain, (len(points), 1))
    vertex = np.asarray(visual.vertex_colors, np.float64)[:, :3] / 255.0
    blended: Float64[Array, "N 3"] = np.einsum("nc,ncd->nd", weights, vertex[mesh.faces[faces]])
    return blended
