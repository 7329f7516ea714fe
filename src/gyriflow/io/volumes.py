"""Volumes of labels and other numbers in NIfTI (and MGH) files, always in RAS+ mm and
with axes in that order."""

import gzip
import logging
import math
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import nibabel as nib
import numpy as np
from nibabel.fileholders import FileHolder
from nibabel.openers import ImageOpener
from nibabel.spatialimages import HeaderDataError, SpatialImage
from numpy.typing import NDArray

from ..errors import InputError
from ..formats import VOLUME_SUFFIXES, format_of
from ..geometry.boxes import box_of
from ..geometry.deformations import voxel_size
from ..geometry.triangles import Floats
from ..grouping import counted
from ..settings.schemes import LabelScheme
from ..settings.terms import AffineSource
from ..units import ML_PER_MM3
from .files import AGAIN, AnyPath, atomic_write, reading, require_finite

log = logging.getLogger(__name__)

MM_PER_NIFTI_UNIT = {
    "mm": 1.0,
    "meter": 1e3,
    "micron": 1e-3,
    "unknown": 1.0,
}
# two header matrices agree if they place every corner within this share of a voxel
AGREEMENT_VOXELS = 0.1
ANISOTROPY_WARNED = 2.0
# relative difference of sizes of voxels in a header that gives a warning
SIZE_TOL = 0.01
WHICH_MATRIX = (
    "Find out which one holds, for example from the scan that was labelled, and name it"
    " with the brain's affine_from: qform or sform. The wrong one may exchange left and"
    " right."
)
# labels stored as floats or with a slope may differ by this from whole numbers
MAX_LABEL_ERROR = 0.05
# decimals in mm of the place of a volume
PLACE_DECIMALS = 3
GZIP_SUFFIXES = (".gz", ".mgz")
PACKED_SUFFIXES = (*GZIP_SUFFIXES, ".bz2", ".zst")
GOOD_RAS_OFFSET = 28
"""Offset in bytes of the flag for valid directions in an MGH header."""
MAX_COMPRESSION = 1100
"""How many times shorter gzip makes a file at most (1032 times), with some room."""


@dataclass(frozen=True, eq=False)
class LabelVolume:
    """The (i, j, k) tissue label of each voxel, and the (4, 4) affine from voxel
    indices to RAS+ positions in mm.

    As read, i, j and k increase to the right, to the front and upwards, however the
    file stores them.
    """

    labels: NDArray[np.int32]
    affine: Floats

    @property
    def volumes_ml(self) -> dict[int, float]:
        """The volume of each label in mL, without the background."""
        inside = self.labels[self.labels > 0]
        numbers, voxels = np.unique(inside, return_counts=True)
        axes = self.affine[:3, :3]
        voxel_ml = float(abs(np.linalg.det(axes))) * ML_PER_MM3
        volumes = {}
        for number, count in zip(numbers, voxels, strict=True):
            volumes[int(number)] = int(count) * voxel_ml
        return volumes


class LabelSource(NamedTuple):
    """A file of tissue labels, which of NIfTI's two matrices counts, and what its
    labels mean."""

    path: str
    affine_from: AffineSource
    scheme: LabelScheme

    def read(self, *, cropped: bool = False) -> LabelVolume:
        """Read the volume as `read_label_volume` does."""
        return read_label_volume(self.path, self.affine_from, cropped=cropped)


def read_label_volume(
    path: AnyPath,
    affine_from: AffineSource = "auto",
    *,
    cropped: bool = False,
) -> LabelVolume:
    """Return the label volume of a NIfTI or MGH file, in RAS+ mm, ending a voxel beyond
    its labels if `cropped`.

    `affine_from` selects one of NIfTI's matrices; "auto" takes the one that is set and
    refuses two that disagree. InputError for invalid files, non-integer values, NaN,
    and ambiguous orientation.
    """
    values, affine = read_values(path, affine_from, "labels")
    if cropped:
        values, affine = _without_empty_border(values, affine)
    return LabelVolume(_whole_numbers(values, path), affine)


def _without_empty_border(
    values: NDArray[np.number], affine: Floats
) -> tuple[NDArray[np.number], Floats]:
    """Return a volume cut to its values other than zero and one voxel around them, and
    its affine."""
    is_filled = values != 0
    if not is_filled.any():
        return values, affine
    box = box_of(is_filled, 1)
    moved = affine.copy()
    moved[:3, 3] += moved[:3, :3] @ [side.start for side in box]
    return values[box], moved


class VolumeHeader(NamedTuple):
    """Numbers of voxels along three axes, their sizes in mm, the unit ("unknown": mm)
    and space, such as "mni"."""

    shape: tuple[int, ...]
    voxel_mm: tuple[float, ...]
    unit: str
    space: str


def read_header(path: AnyPath) -> VolumeHeader:
    """Return the header of a volume without reading its values; InputError if it cannot
    be read."""
    image = _load(path)
    header: Any = image.header
    unit = "mm"
    space = "scanner"
    if isinstance(image, nib.Nifti1Pair):
        unit = _length_unit(header, path)
        space = header.get_value_label("sform_code")
        if space == "unknown":
            space = header.get_value_label("qform_code")
    shape = tuple(map(int, image.shape[:3]))
    mm_per_unit = MM_PER_NIFTI_UNIT[unit]
    voxel_mm = tuple(mm_per_unit * float(size) for size in header.get_zooms()[:3])
    return VolumeHeader(shape, voxel_mm, unit, space)


def read_values(
    path: AnyPath,
    affine_from: AffineSource,
    content: str,
) -> tuple[NDArray[np.number], Floats]:
    """Return the (i, j, k) values of a NIfTI or MGH file, and the (4, 4) matrix to RAS+
    positions in mm.

    Values have the type in which they are stored; their axes are brought to the order
    right, front, up. `content` names the values in messages. InputError for invalid
    files, other numbers of axes, unclear orientation.
    """
    image = _load(path, content)
    with reading(path, "an image", _expected(content)):
        if nib.is_proxy(image.dataobj):
            _require_its_size(image, path)
            _require_values_after_header(image, path)
        values = _stored_values(image, path)
    shape = tuple(n for axis, n in enumerate(values.shape) if axis < 3 or n != 1)
    if len(shape) != 3 or values.dtype.kind not in "biuf":
        raise InputError(
            f"is not a volume of {content}",
            path=path,
            found=f"shape {values.shape}, type {values.dtype}",
            expected="three axes (further ones of length 1) of numbers",
        )
    affine = np.array(
        _affine(image, affine_from, path),
        dtype=float,
    )
    sizes = voxel_size(affine)
    if (
        not np.isfinite(affine).all()
        or abs(np.linalg.det(affine[:3, :3])) < 1e-6 * sizes.prod()
        or not sizes.all()
    ):
        raise InputError(
            "has no usable affine",
            path=path,
            found=f"\n{affine}\n",
            expected="an invertible matrix",
        )
    if sizes.max() > ANISOTROPY_WARNED * sizes.min():
        log.warning(
            "%s: voxels of %.3g x %.3g x %.3g mm are not resampled", path, *sizes
        )
    return _in_canonical_order(values.reshape(shape), affine)


def _in_canonical_order(
    values: NDArray[np.number], affine: Floats
) -> tuple[NDArray[np.number], Floats]:
    """Return a volume with the axes that are closest to RAS+, and its affine: results
    must not depend on storage."""
    axes = nib.io_orientation(affine)
    reordered = nib.apply_orientation(values, axes)
    canonical = affine @ nib.orientations.inv_ornt_aff(axes, values.shape)
    # headers hold the place of another corner in each order, in single precision
    canonical[:3, 3] = canonical[:3, 3].round(PLACE_DECIMALS)
    return reordered, canonical


VOLUME_READERS: dict[str, Callable[[AnyPath], Any]] = {
    "NIfTI": nib.load,
    "NIfTI pair": nib.load,
    "MGH": nib.load,
}
"""The reader of each format of volumes; it returns an image of nibabel, in mm if it is
not NIfTI."""


def _load(path: AnyPath, content: str = "numbers") -> SpatialImage:
    found = format_of(path, "volume")
    with reading(path, "an image", _expected(content)):
        # nibabel recognises other formats by their contents
        image = VOLUME_READERS[found.name if found else "NIfTI"](path)
        if not isinstance(image, SpatialImage):
            raise InputError(
                "is not a volume",
                path=path,
                found=type(image).__name__,
                expected=_expected(content),
            )
    return image


def _expected(content: str) -> str:
    return f"a whole volume of {content} ({', '.join(VOLUME_SUFFIXES)})"


def read_volume_map(
    path: AnyPath, affine_from: AffineSource = "auto"
) -> tuple[Floats, Floats]:
    """Return (i, j, k) values of a NIfTI or MGH file, NaN if undefined, and the affine,
    as `read_label_volume`."""
    values, affine = read_values(path, affine_from, "numbers")
    return values.astype(float), affine


def write_label_volume(path: AnyPath, volume: LabelVolume) -> None:
    """Write a label volume as NIfTI in mm, in the smallest integer type that holds its
    labels."""
    labels = volume.labels
    kind = (
        np.min_scalar_type(int(labels.max(initial=0)))
        if labels.min(initial=0) >= 0
        else np.int32
    )
    image = nib.Nifti1Image(labels.astype(kind), volume.affine)
    image.header.set_xyzt_units("mm")
    image.set_sform(volume.affine, code="scanner")
    # a quaternion cannot express shear: if it cannot match the sform, it stays unset
    image.set_qform(volume.affine, code="scanner")
    if not np.allclose(
        image.get_qform(),
        volume.affine,
        atol=1e-3,
    ):
        image.set_qform(None, code="unknown")
        image.set_sform(volume.affine, code="scanner")
    with atomic_write(path) as temporary:
        nib.save(image, temporary)


def _require_its_size(image: SpatialImage, path: AnyPath) -> None:
    needed = math.prod(map(int, image.shape)) * image.get_data_dtype().itemsize
    # of a pair of files the one with the values, not the header
    data = Path(image.file_map["image"].filename or path)
    packed = data.name.lower().endswith(PACKED_SUFFIXES)
    size = data.stat().st_size
    if needed < 0 or needed > size * (MAX_COMPRESSION if packed else 1):
        raise InputError(
            "is shorter than its header specifies",
            path=data,
            found=f"{size} bytes",
            expected=(
                f"{needed} bytes for {' x '.join(map(str, image.shape))} values of"
                f" {image.get_data_dtype()}"
            ),
            remedy=AGAIN,
        )


def _require_values_after_header(image: SpatialImage, path: AnyPath) -> None:
    """Raise InputError if the values of a single NIfTI file begin in its header, which
    shifts them."""
    header: Any = image.header
    if not isinstance(image, nib.Nifti1Image) or not header.is_single:
        return
    values: Any = image.dataobj
    first = int(values.offset)
    least = int(header.single_vox_offset)
    if first < least:
        raise InputError(
            "says that its values begin within its header, so they would be shifted",
            path=path,
            found=f"vox_offset {first}",
            expected=f"{least} or more",
            remedy="Write the file again with the program that made it.",
        )


def _stored_values(image: SpatialImage, path: AnyPath) -> NDArray[np.number]:
    """Return the values of an image; compressed files are read to the end, so that
    checksums are verified."""
    packed: dict[str, Any] = {}
    with ExitStack() as opened:
        for part, holder in image.file_map.items():
            name = str(holder.filename).lower()
            if name.endswith(PACKED_SUFFIXES):
                # nibabel's own reader of gzip may not verify checksums
                opener: Any = gzip.open if name.endswith(GZIP_SUFFIXES) else ImageOpener
                packed[part] = FileHolder(
                    fileobj=opened.enter_context(opener(holder.filename))
                )
        values = np.asanyarray(
            type(image).from_file_map({**image.file_map, **packed}).dataobj
        )
        for holder in packed.values():
            try:
                while holder.fileobj.read(2**20):
                    pass
            except gzip.BadGzipFile as error:
                if not str(error).startswith("Not a gzipped file"):
                    raise
                log.warning(
                    "%s: further data follow the compressed data; they are ignored, as"
                    " by gzip",
                    path,
                )
    return values


def _affine(
    image: SpatialImage,
    affine_from: AffineSource,
    path: AnyPath,
) -> Floats:
    # a single NIfTI file is a special kind of pair to nibabel, and a pair a special
    # kind of Analyze
    if isinstance(image, nib.Nifti1Pair):
        return _nifti_affine(image, affine_from, path)
    if isinstance(image, nib.AnalyzeImage):
        raise InputError(
            "is in the Analyze format, which holds no orientation, so left and right"
            " are unknown",
            path=path,
            expected="NIfTI (.nii, .nii.gz, or a pair of .hdr and .img) or MGH (.mgz)",
        )
    if not isinstance(image, nib.MGHImage):
        return image.affine
    sizes = image.header.get_zooms()[:3]
    if not min(sizes) > 0:
        raise InputError(
            "has voxels without a positive size, so left and right are unknown",
            path=path,
            found=f"{_sizes_in_words(sizes)} mm",
            expected="sizes above 0",
        )
    if not _has_directions(path):
        raise InputError(
            "has no valid directions (goodRASFlag), so left and right are unknown",
            path=path,
            found=0,
            expected=1,
            remedy=(
                "Set them as in the scan that was labelled, for example with"
                " mri_convert --in_orientation."
            ),
        )
    return image.affine


def _has_directions(path: AnyPath) -> bool:
    # nibabel takes FreeSurfer's usual ones where they are not valid, and sets the flag
    opener: Any = gzip.open if str(path).lower().endswith(GZIP_SUFFIXES) else open
    with opener(path, "rb") as file:
        start = file.read(GOOD_RAS_OFFSET + 2)
    flag = int.from_bytes(start[GOOD_RAS_OFFSET:], "big")
    return flag == 1


def _nifti_affine(
    image: nib.Nifti1Pair,
    affine_from: AffineSource,
    path: AnyPath,
) -> Floats:
    header = image.header
    needed = ("sform", "qform") if affine_from == "auto" else (affine_from,)
    try:
        matrices = {name: getattr(header, f"get_{name}")() for name in needed}
    except (HeaderDataError, ValueError) as error:
        raise InputError(
            f"has a broken qform: {error}",
            path=path,
            remedy=(
                "If the sform holds, as in the scan that was labelled, set affine_from:"
                " sform."
            ),
        ) from error
    codes = {
        "sform": int(header["sform_code"]),
        "qform": int(header["qform_code"]),
    }
    unit = _length_unit(header, path)
    if unit == "unknown":
        log.info("%s: no unit of length in the header, mm taken", path)
    # row by row: a product of matrices would take 0 times infinite entries
    scale = np.array([[MM_PER_NIFTI_UNIT[unit]]] * 3 + [[1.0]])
    if (affine_from == "auto" and codes["sform"] > 0) or affine_from == "sform":
        _warn_of_other_sizes(header, matrices["sform"], unit, path)
    if affine_from != "auto":
        return scale * matrices[affine_from]
    present = [name for name, code in codes.items() if code > 0]
    if not present:
        raise InputError(
            "neither qform nor sform is set, so left and right are unknown",
            path=path,
            expected="a code > 0 of one",
            remedy=WHICH_MATRIX,
        )
    if len(present) == 2:
        voxel = np.linalg.norm(
            matrices["sform"][:3, :3],
            axis=0,
        ).min()
        difference = matrices["sform"] - matrices["qform"]
        ends = np.array(np.meshgrid(*[[0, n - 1] for n in image.shape[:3]]))
        ends = ends.reshape(3, -1)
        distance = float(
            np.linalg.norm(
                difference[:3, :3] @ ends + difference[:3, 3:],
                axis=0,
            ).max()
        )
        if not distance <= AGREEMENT_VOXELS * voxel:
            problem = f"qform and sform disagree by up to {distance:.3g} {unit}"
            both = "".join(
                f"\n{name} (code {codes[name]})\n{matrices[name]}"
                for name in ("qform", "sform")
            )
            raise InputError(
                problem,
                path=path,
                found=f"{both}\n",
                remedy=WHICH_MATRIX,
            )
    return scale * matrices[present[0]]


def _warn_of_other_sizes(
    header: nib.Nifti1Header,
    sform: Floats,
    unit: str,
    path: AnyPath,
) -> None:
    """Warn if the sizes of voxels in the header (pixdim), which programs may show, are
    not those of the sform, which counts."""
    in_header = np.abs(header["pixdim"][1:4])
    in_sform = np.linalg.norm(
        sform[:3, :3],
        axis=0,
    )
    # a broken sform is refused
    if not in_sform.all() or not np.isfinite(in_sform).all():
        return
    if np.abs(in_header / in_sform - 1.0).max() > SIZE_TOL:
        log.warning(
            "%s: the sizes of its voxels disagree: found pixdim %s and sform %s %s; the"
            " sform is used. Is it the one of the scan that was labelled?",
            path,
            _sizes_in_words(in_header),
            _sizes_in_words(in_sform),
            {"unknown": "mm"}.get(unit, unit),
        )


def _sizes_in_words(sizes: Iterable[float]) -> str:
    return " x ".join(f"{size:.3g}" for size in sizes)


def _length_unit(header: nib.Nifti1Header, path: AnyPath) -> str:
    code = int(header["xyzt_units"])
    try:
        unit = str(header.get_xyzt_units()[0])
    except KeyError:
        unit = ""
    if unit not in MM_PER_NIFTI_UNIT:
        raise InputError(
            "has a unit of length that is not in NIfTI",
            path=path,
            found=f"xyzt_units {code}",
            expected="2 (mm), 1 (metres), 3 (micrometres) or 0",
        )
    return unit


def _whole_numbers(values: NDArray, path: AnyPath) -> NDArray[np.int32]:
    if values.dtype.kind == "f":
        require_finite(values.ravel(), path, "values", "voxels")
        errors = np.abs(values - np.rint(values))
        # values that all round to zero were divided by their slope
        broken = (errors > MAX_LABEL_ERROR) | (
            not np.rint(values).any() and values != 0
        )
        if broken.any():
            raise InputError(
                "contains values that are not labels, whole numbers within"
                f" {MAX_LABEL_ERROR:g}",
                path=path,
                found=(
                    f"{counted(int(broken.sum()), 'voxel')}, for example"
                    f" {values[broken][0]:.4g}"
                ),
                remedy=(
                    "Resample labels with nearest neighbour. gyriflow does not segment"
                    " images."
                ),
            )
        if (error := errors.max(initial=0)) > 1e-3:
            log.warning(
                "%s: labels differ by up to %.3g from whole numbers and were rounded",
                path,
                error,
            )
        values = np.rint(values)
    least = values.min(initial=0)
    largest = values.max(initial=0)
    bounds = np.iinfo(np.int32)
    if least < bounds.min or largest > bounds.max:
        raise InputError(
            "contains values that are not tissue labels",
            path=path,
            found=f"{least:.6g} to {largest:.6g}",
            expected=f"whole numbers up to {bounds.max}",
        )
    return values.astype(np.int32, order="C")
