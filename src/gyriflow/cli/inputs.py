"""Open each file that a study names once, describe its content, and find what a run
would refuse minutes later."""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..anatomy.plausible import (
    require_left_and_right,
    require_plausible_size,
    require_plausible_thickness,
    require_single_hemisphere,
)
from ..errors import GyriflowError, InputError
from ..formats import is_volume
from ..geometry.poses import CONVENTIONS
from ..geometry.triangles import (
    TriangleMesh,
    convex_hull,
    is_closed,
    outward,
    signed_volume,
    transformed,
)
from ..grouping import counted
from ..io.downloads import require_checksums
from ..io.surfaces import (
    read_hemispheres,
    read_surface,
    read_surface_maps,
    read_vertex_arrays,
    read_vertex_labels,
    surface_space_structure,
)
from ..io.volumes import read_header, read_label_volume, read_volume_map
from ..settings.brains import BrainConfig, GivenRegions
from ..settings.folding import mapped_parameters
from ..settings.schemes import LabelScheme
from ..settings.terms import SIDES, AffineSource
from ..settings.varying import files_of, mean_of_curve
from ..study.study import Study
from .recognition import NATIVE_SPACES, SPACE_NAME, require_fit, scheme_fits

SUBJECT_NAME = re.compile(r"(?<![A-Za-z0-9])sub-([A-Za-z0-9]+)")
TEMPLATE_SPACES = ("mni", "mni_152", "talairach", "template")
"""Spaces of NIfTI and GIFTI files in which a brain may have the size of a template."""
HULL_SHARE = 0.8
"""About the volume of a hemisphere over that of its convex hull, where a surface is
open."""


def _describe(path: str) -> str:
    """Return what a file holds: size, unit, side and numbers of vertices or voxels;
    InputError as its reader's."""
    if is_volume(path):
        header = read_header(path)
        shape = " x ".join(map(str, header.shape))
        text = f"{shape} voxels of {_sizes(header.voxel_mm)} mm"
        if header.unit == "unknown":
            text += ", no unit given"
        elif header.unit != "mm":
            text += f", given in {header.unit}"
        return f"{text}, {header.space} space"
    if path.lower().endswith((".shape.gii", ".func.gii", ".label.gii")):
        arrays, structure = read_vertex_arrays(path)
        counts = ", ".join(str(len(values)) for values in arrays)
        spans = []
        for values in arrays:
            if values.size:
                spans.append(f"{values.min():.4g} to {values.max():.4g}")
        return f"{counts} values, {', '.join(spans)}{_side(structure)}"
    mesh, space, structure = surface_space_structure(path)
    kind = "closed" if is_closed(mesh) else "open"
    size = _sizes(np.ptp(mesh.vertices, axis=0))
    text = f"{kind} surface of {len(mesh.vertices)} vertices, {size} mm"
    text += _side(structure)
    if space:
        text += f", {_plain_space(space)} space"
    return text


def _sizes(sizes: Iterable[float]) -> str:
    return " x ".join(f"{size:.3g}" for size in sizes)


def _plain_space(space: str) -> str:
    return space.removeprefix("NIFTI_XFORM_").lower()


def _side(structure: str | None) -> str:
    return {"CortexLeft": ", left", "CortexRight": ", right"}.get(structure or "", "")


def input_facts(study: Study) -> Iterator[str]:
    """Yield a line about each file of brains, regions and maps that can be read, in the
    order of the configuration."""
    owners: dict[str, list[str]] = {}
    for brain in study.config.brains:
        for path in (
            *brain.files,
            *brain.white_files.values(),
            brain.image,
        ):
            if path is not None:
                owners.setdefault(path, []).append(brain.id)
    for owner, files, _ in _other_files(study):
        for path in files:
            owners.setdefault(path, []).append(owner)
    for path, names in owners.items():
        # problems are those of `doubts_about_files` and `check_other_files`; files of
        # atlases may be missing yet
        if Path(path).is_file():
            with suppress(GyriflowError):
                named = ", ".join(dict.fromkeys(names))
                yield f"{named}: {Path(path).name}: {_describe(path)}"


def doubts_about_files(
    files: Sequence[str],
    brain: BrainConfig,
    scheme: LabelScheme | None,
    checksums: Mapping[str, tuple[str, str]],
) -> Iterator[str]:
    """Yield doubts about a brain's files; InputError for what a run would refuse.

    `checksums` has atlas and SHA-256 of files of atlases. Missing `files` are left out.
    """
    present = {path for path in files if Path(path).is_file()}
    require_checksums({path: checksums[path] for path in checksums if path in present})
    if brain.labels in present and scheme is not None:
        yield from _check_labels(brain.labels, brain, scheme)
    yield from _check_surfaces(brain)


def _check_labels(
    volume: str,
    brain: BrainConfig,
    scheme: LabelScheme,
) -> Iterator[str]:
    # takes half a second, which kept results need not wait for
    from ..anatomy.labels import (
        MIN_CORTEX_OUTSIDE,
        layout_of,
        read_cerebrum,
        scheme_contradictions,
    )

    read = read_label_volume(volume, brain.affine_from, cropped=True)
    # the wall of a hemisphere that is alone may have no cortex
    whole = brain.side is None
    cerebrum = read_cerebrum(
        read.labels, read.affine, scheme, MIN_CORTEX_OUTSIDE if whole else 0.0
    )
    yield from cerebrum.warnings
    if not whole:
        return
    doubts = list(scheme_contradictions(layout_of(read.labels), scheme))
    if doubts:
        require_fit(
            scheme_fits(read.labels),
            scheme.name,
            volume,
            "; ".join(doubts),
        )
        yield from doubts
    yield from require_plausible_size(cerebrum.volume_mm3, brain.week)


def _check_surfaces(brain: BrainConfig) -> Iterator[str]:
    """Yield doubts about a brain's surfaces and its image, and about the names of all
    its files."""
    for path in (*brain.files, *brain.white_files.values()):
        yield from _named_otherwise(path, brain)
    if brain.image and Path(brain.image).is_file():
        read_volume_map(brain.image, brain.affine_from)
    if brain.labels or not all(Path(path).is_file() for path in brain.files):
        return
    # not for labels
    from ..anatomy.pose import pose_of_hemisphere, pose_of_surface

    whites = {
        side: read_surface(path, side) for side, path in brain.white_files.items()
    }
    if brain.hemispheres is not None:
        left, right, declared = read_hemispheres(
            brain.hemispheres.left, brain.hemispheres.right
        )
        yield from _check_pair(brain, left, right, declared=declared)
        _check_whites({"left": left, "right": right}, whites)
    elif brain.files:
        own_side = brain.side
        mesh = outward(read_surface(brain.files[0], own_side))
        yield from _check_size(brain, mesh)
        if own_side and is_closed(mesh):
            require_single_hemisphere(mesh)
            yield from pose_of_hemisphere(mesh, own_side, brain.coordinates).warnings
        elif is_closed(mesh):
            yield from pose_of_surface(mesh, brain.coordinates).warnings
        _check_whites(dict.fromkeys(whites, mesh), whites)


def _check_whites(
    pials: Mapping[str, TriangleMesh], whites: Mapping[str, TriangleMesh]
) -> None:
    """Raise InputError if a white surface is not inside the pial one of its side."""
    # takes a third of a second, which labels need not wait for
    from ..anatomy.thickness import require_inside

    for side, white in whites.items():
        # the walls of open surfaces are capped by their repair
        pial = outward(pials[side])
        if is_closed(pial):
            require_inside(pial, white, side)


def _check_pair(
    brain: BrainConfig,
    left: TriangleMesh,
    right: TriangleMesh,
    *,
    declared: bool,
) -> Iterator[str]:
    from ..anatomy.pose import pose_of_pair, require_coordinates

    left = outward(left)
    right = outward(right)
    yield from _check_size(brain, left, right)
    if brain.coordinates != "auto":
        left, right = (
            transformed(mesh, CONVENTIONS[brain.coordinates]) for mesh in (left, right)
        )
        require_left_and_right(left, right, brain.coordinates)
    # shapes of open surfaces are compared after their repair
    if is_closed(left) and is_closed(right):
        if brain.coordinates == "auto":
            yield from pose_of_pair(left, right, declared=declared).warnings
        else:
            yield from require_coordinates(left, right, brain.coordinates)


def _check_size(brain: BrainConfig, *meshes: TriangleMesh) -> list[str]:
    sides = 1 if brain.side is None else 2
    closed = all(map(is_closed, meshes))
    volumes = [signed_volume(mesh if closed else convex_hull(mesh)) for mesh in meshes]
    doubts = require_plausible_size(
        sides * sum(volumes) * (1.0 if closed else HULL_SHARE), brain.week
    )
    return doubts if closed else []


def _named_otherwise(path: str, brain: BrainConfig) -> Iterator[str]:
    name = Path(path).name
    own_names = set(SUBJECT_NAME.findall(f"{brain.id} {brain.subject}"))
    other_names = set(SUBJECT_NAME.findall(name)) - own_names
    if own_names and other_names:
        yield f"{path} has a name of sub-{', sub-'.join(sorted(other_names))}"
    spaces = set()
    for space in SPACE_NAME.findall(name):
        if space.lower() not in NATIVE_SPACES:
            spaces.add(space)
    if Path(path).is_file():
        spaces |= {_template_space(path)} - {""}
    if spaces:
        yield (
            f"{path} is in the space {', '.join(sorted(spaces))}: has the brain its own"
            " size and shape there?"
        )


def _template_space(path: str) -> str:
    """Return the space of a template that a file names for its coordinates, or ""."""
    if is_volume(path):
        space = read_header(path).space
    else:
        _, named, _ = surface_space_structure(path)
        space = _plain_space(named or "")
    return space if space in TEMPLATE_SPACES else ""


def check_other_files(study: Study) -> Iterator[tuple[str, str]]:
    """Yield each problem of files of regions and maps: whose it is, and the text."""
    seen = set()
    for owner, files, check in _other_files(study):
        what = owner.partition(" of ")[0]
        # runs may share a map
        key = (what, *files)
        if key in seen:
            continue
        seen.add(key)
        try:
            check()
        except InputError as error:
            yield owner, str(error)


def _other_files(study: Study) -> Iterator[tuple[str, list[str], Callable[[], None]]]:
    """Yield whose each group of files of regions and maps is, the files, and the
    function that checks them."""
    for name, regions in study.config.metrics.regions.items():
        brain = study.brains.get(name)
        affine_from = brain.affine_from if brain else "auto"
        files = list(regions.files.values())
        check = partial(_check_regions, regions, affine_from)
        yield f"regions of {name}", files, check
    for simulation in study.run_simulations:
        for name, value in mapped_parameters(simulation.settings).items():
            files = [*files_of(value.map), *files_of(value.surface)]
            check = partial(_check_map, name, value)
            yield f"{name} of run {simulation.run}", files, check


def _check_regions(regions: GivenRegions, affine_from: AffineSource) -> None:
    if regions.volume is not None:
        read_label_volume(regions.volume, affine_from)
        return
    for side in SIDES:
        path = regions.files[f"{side}_labels"]
        surface_path = regions.files[f"{side}_surface"]
        labels = read_vertex_labels(path, side)[0]
        surface = read_surface(surface_path, side)
        if len(labels) != len(surface.vertices):
            raise InputError(
                "does not belong to its surface",
                path=path,
                found=counted(len(labels), "label"),
                expected=(
                    f"{len(surface.vertices)}, the number of vertices of {surface_path}"
                ),
            )


def _check_map(name: str, value: Any) -> None:
    paths = files_of(value.map)
    surfaces = files_of(value.surface)
    if surfaces:
        _, values = read_surface_maps(paths, surfaces)
    else:
        volume, _ = read_volume_map(paths[0])
        values = volume.ravel()
    if name == "thickness_mm":
        require_plausible_thickness(values, mean_of_curve(value), ", ".join(paths))
