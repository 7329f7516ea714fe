"""The file formats of surfaces and volumes that can be given, by the ends of names, and
some that cannot, by content.

Each format has a reader of its `name` in `io.surfaces` or `io.volumes`.
"""

import re
import zlib
from dataclasses import dataclass
from os import PathLike
from typing import Literal, NamedTuple

Content = Literal["surface", "volume"]


@dataclass(frozen=True)
class FileFormat:
    """A format of surfaces or volumes; `suffixes` are those of the files by which data
    are named, in lower case.

    `data_suffixes` are those of second files that belong to these, such as the values
    of a pair.
    """

    name: str
    content: Content
    suffixes: tuple[str, ...]
    data_suffixes: tuple[str, ...] = ()


FORMATS = (
    FileFormat("GIFTI", "surface", (".gii", ".gii.gz")),
    FileFormat("VTK", "surface", (".vtk", ".vtp")),
    FileFormat("STL", "surface", (".stl",)),
    FileFormat("PLY", "surface", (".ply",)),
    FileFormat("OBJ", "surface", (".obj",)),
    FileFormat("OFF", "surface", (".off",)),
    FileFormat("FreeSurfer", "surface", (".pial", ".white")),
    FileFormat("NIfTI", "volume", (".nii", ".nii.gz")),
    FileFormat(
        "NIfTI pair",
        "volume",
        (".hdr", ".hdr.gz"),
        (".img", ".img.gz"),
    ),
    FileFormat("MGH", "volume", (".mgz", ".mgh")),
)
SURFACE_SUFFIXES = tuple(
    suffix for form in FORMATS if form.content == "surface" for suffix in form.suffixes
)
VOLUME_SUFFIXES = tuple(
    suffix for form in FORMATS if form.content == "volume" for suffix in form.suffixes
)
ALL_SUFFIXES = tuple(
    suffix for form in FORMATS for suffix in form.suffixes + form.data_suffixes
)
READ_COMPRESSED = tuple(suffix for suffix in ALL_SUFFIXES if suffix.endswith(".gz"))
FOREIGN_VOLUME_SUFFIXES = (".nrrd", ".nhdr", ".mha", ".mhd", ".mnc", ".gipl")
"""Ends of names of volumes in formats that are not read."""
FOREIGN_TABLE = re.compile(
    r"(.*_)?(participants|sessions|scans)\.(xlsx?|ods|txt)", re.IGNORECASE
)
"""Names of tables of participants and sessions in formats that are not read."""


CIFTI_NAME = re.compile(
    r"\.(?:d|p|dp|pd)(?:label|scalar|tseries|conn|connseries|connscalar|fan)\.nii$",
    re.IGNORECASE,
)
"""End of the names of CIFTI files, whose values are at vertices and voxels of the grey
matter: no NIfTI volumes."""


def format_of(path: str | PathLike[str], content: Content) -> FileFormat | None:
    """Return the format of surfaces or of volumes that a file has by its name, or
    None."""
    name = str(path).lower()
    if CIFTI_NAME.search(name):
        return None
    for form in FORMATS:
        suffixes = form.suffixes + form.data_suffixes
        if form.content == content and name.endswith(suffixes):
            return form
    return None


def is_volume(path: str | PathLike[str]) -> bool:
    """Return whether a file is named as a volume."""
    return format_of(path, "volume") is not None


SIDE_NAME = re.compile(
    r"(?:(?<=[._-])|^)(?:(left|lh|hemi-L|(?<=[._])L)|(right|rh|hemi-R|(?<=[._])R))(?=[._-])",
    re.IGNORECASE,
)


def side_in_name(name: str) -> Literal["left", "right"] | None:
    """Return the hemisphere that a file's name has, such as `lh.pial` or
    `sub-01_hemi-R_pial.surf.gii`, or None."""
    found = {"left" if left else "right" for left, _ in SIDE_NAME.findall(name)}
    return found.pop() if len(found) == 1 else None  # type: ignore[return-value]


class ForeignFormat(NamedTuple):
    """A format recognised by a file's first bytes, and the remedy unless the file's
    name ends in `suffixes`."""

    start: bytes
    name: str
    remedy: str
    suffixes: tuple[str, ...] = ()


START_BYTES = 512
"""Number of bytes that identify the format of a file."""
GZIP_START = b"\x1f\x8b"
TO_NIFTI = (
    "Save it as NIfTI (.nii.gz), for example with 3D Slicer, ITK-SNAP or SimpleITK."
)
TO_TABLE = "Save it as text separated by tabs (.tsv)."
UNPACK = "Unpack it; a workbook of Excel has to be saved as text separated by tabs."
FOREIGN_FORMATS = (
    ForeignFormat(rb"NRRD\d{4}", "an NRRD volume", TO_NIFTI),
    ForeignFormat(
        rb"(Comment[^\n]*\n)?(ObjectType|NDims) *=", "a MetaImage volume", TO_NIFTI
    ),
    ForeignFormat(
        rb".{128}DICM",
        "a DICOM file",
        "Convert the series to NIfTI, for example with dcm2niix.",
    ),
    ForeignFormat(rb"PK\x03\x04", "an Excel workbook or another ZIP archive", UNPACK),
    ForeignFormat(rb"\xd0\xcf\x11\xe0", "an Excel workbook", TO_TABLE),
    ForeignFormat(
        rb"(?i)\s*(<!doctype html|<html)",
        "a web page",
        "Download the file itself; it may need a login.",
    ),
    ForeignFormat(
        rb"#!ascii",
        "a FreeSurfer surface as text",
        "Convert it with mris_convert, for example to .surf.gii.",
    ),
    ForeignFormat(
        rb"\xfd7zXZ|\x28\xb5\x2f\xfd",
        "compressed by xz or zstd",
        "Uncompress it, or compress it with gzip instead.",
    ),
    ForeignFormat(
        GZIP_START,
        "compressed by gzip",
        "Uncompress it with gunzip. NIfTI and GIFTI may stay compressed if .gz is added"
        " to the name, MGH if it is named .mgz.",
        (*READ_COMPRESSED, ".mgz"),
    ),
    ForeignFormat(
        rb".{344}(n\+1|ni1)\0",
        "NIfTI without compression",
        "Name it .nii.",
        (".nii", ".hdr"),
    ),
    ForeignFormat(
        rb"\x00\x00\x00\x01\x00", "MGH without compression", "Name it .mgh.", (".mgh",)
    ),
)
TWICE = ForeignFormat(
    GZIP_START, "compressed by gzip twice", "Uncompress it once, with gunzip."
)


def foreign_format(path: str | PathLike[str], start: bytes) -> ForeignFormat | None:
    """Return the format that a file's first `START_BYTES` show, None if its name has
    the same one or it is unknown.

    A compressed file shows that of its content.
    """
    name = str(path).lower()
    form = _shown_format(name, start)
    if form is not None or not start.startswith(GZIP_START):
        return form
    content = _uncompressed(start)
    if content.startswith(GZIP_START):
        return TWICE
    return _shown_format(
        name.replace(".mgz", ".mgh").removesuffix(".gz"),
        content,
    )


def _shown_format(name: str, start: bytes) -> ForeignFormat | None:
    for form in FOREIGN_FORMATS:
        is_shown = re.match(form.start, start, re.DOTALL)
        if is_shown and not name.endswith(form.suffixes):
            return form
    return None


def _uncompressed(start: bytes) -> bytes:
    """Return what can be read of a file's content from its first compressed bytes."""
    try:
        return zlib.decompressobj(wbits=zlib.MAX_WBITS | 16).decompress(start)
    except zlib.error:
        return b""
