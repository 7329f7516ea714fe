"""The file formats of surfaces and volumes that can be given: how the names of their files end.

Each format has a reader of its `name` in `io.surfaces` or `io.volumes`.
"""

from dataclasses import dataclass
from os import PathLike
from typing import Literal

Content = Literal["surface", "volume"]


@dataclass(frozen=True)
class FileFormat:
    """A format of surfaces or volumes; `suffixes` are those of the files by which data are named, in lower case.

    `data_suffixes` are those of second files that belong to these, such as the values of a pair.
    """

    name: str
    content: Content
    suffixes: tuple[str, ...]
    data_suffixes: tuple[str, ...] = ()

    @property
    def all_suffixes(self) -> tuple[str, ...]:
        return (*self.suffixes, *self.data_suffixes)


FORMATS = (
    FileFormat("GIFTI", "surface", (".gii", ".gii.gz")),
    FileFormat("VTK", "surface", (".vtk", ".vtp")),
    FileFormat("STL", "surface", (".stl",)),
    FileFormat("PLY", "surface", (".ply",)),
    FileFormat("OBJ", "surface", (".obj",)),
    FileFormat("OFF", "surface", (".off",)),
    FileFormat("FreeSurfer", "surface", (".pial", ".white")),
    FileFormat("NIfTI", "volume", (".nii", ".nii.gz")),
    FileFormat("NIfTI pair", "volume", (".hdr", ".hdr.gz"), (".img", ".img.gz")),
    FileFormat("MGH", "volume", (".mgz", ".mgh")),
)
SURFACE_SUFFIXES = tuple(suffix for form in FORMATS if form.content == "surface" for suffix in form.suffixes)
VOLUME_SUFFIXES = tuple(suffix for form in FORMATS if form.content == "volume" for suffix in form.suffixes)
ALL_SUFFIXES = tuple(suffix for form in FORMATS for suffix in form.all_suffixes)


def format_of(path: str | PathLike[str], content: Content) -> FileFormat | None:
    """Return the format of surfaces or of volumes that a file has by its name, or None."""
    name = str(path).lower()
    return next((form for form in FORMATS if form.content == content and name.endswith(form.all_suffixes)), None)


def is_volume(path: str | PathLike[str]) -> bool:
    """Return whether a file is named as a volume."""
    return format_of(path, "volume") is not None
