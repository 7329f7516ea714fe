"""Damage a sound brain in the ways that inputs are usually wrong, run the workflow on
each, and draw what is wrong.

    ./run python benchmarks/gallery.py FOLDER [--figures docs/images/gallery]

The sound brain is the shipped one of 25 GW (operated). FOLDER gets the damaged files, a
study of them and its results up to the surface stage. Printed are the messages about
each brain without those about the sound one, and the verdict that follows from them:
the words in docs/how-to/bad-inputs.md. A
picture has the sound brain on the left and the damaged one on the right, at one scale,
with the outline of the surface if one was made.
"""

import argparse
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from common import ROOT
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from PIL import Image
from scipy.ndimage import binary_closing, distance_transform_edt, map_coordinates

from gyriflow.anatomy.pial import PialSurface, from_labels
from gyriflow.anatomy.thickness import white_from_labels
from gyriflow.geometry.deformations import voxel_index
from gyriflow.geometry.triangles import (
    Floats,
    TriangleMesh,
    corners,
    merged,
    submesh,
    transformed,
)
from gyriflow.io.files import atomic_write
from gyriflow.io.surfaces import read_pose, read_surface, write_surface
from gyriflow.io.volumes import LabelVolume, read_label_volume, write_label_volume
from gyriflow.io.yaml_files import SCHEMES, write_yaml
from gyriflow.messages import Message, study_messages
from gyriflow.report.quality import (
    INNER_COLOUR,
    PIAL_COLOUR,
    TISSUE_COLOURS,
    tissue_groups,
)
from gyriflow.report.scene import VIEWS, half_extents, render, uniform_colours
from gyriflow.report.sections import PLANES, draw_outline
from gyriflow.report.style import OBSERVED_SURFACE_COLOUR, styled
from gyriflow.report.tables import VERDICTS
from gyriflow.settings.terms import SIDES

Labels = np.ndarray

SCHEME_NAME = "spina-bifida-atlas"
SCHEME = SCHEMES[SCHEME_NAME]
(CORTEX,), (CEREBELLUM,) = SCHEME.cortex, SCHEME.cerebellum
OUTER_CSF, WHITE = 4, 1
WEEK, WRONG_WEEK = 25, 31
ATLAS = ROOT / "atlases/spina-bifida"
VOLUME = "fetal_SB_atlas_GA{week}_operated/parcellation.nii.gz"
SOUND = "sound"

CROPPED_SHARE = 0.25
PATCH_MM = 12.0
LOST_MM = 7.0
FISSURE_MM, FISSURE_VOXELS = 4.0, 8
SLICE_VOXELS = 6
SWOLLEN_MM = 2.5
SHIFT_VOXELS = 3
HOLE_MM = 8.0
WHITE_SHIFT_MM = 4.0
SPIKE_MM, SPIKE_WIDTH_MM = 60.0, 4.0
METRES_PER_MM = 1e-3

MARGIN_MM, PIXEL_MM = 4.0, 0.2
PANEL_IN, DOTS_PER_INCH, COLOURS = 2.6, 120, 128


@dataclass(frozen=True, eq=False)
class Sound:
    """The sound brain: its labels and the surfaces that gyriflow makes of them."""

    volume: LabelVolume

    @property
    def labels(self) -> Labels:
        return self.volume.labels

    @property
    def affine(self) -> Floats:
        return self.volume.affine

    @cached_property
    def cerebrum(self) -> np.ndarray:
        return np.isin(self.labels, SCHEME.cerebrum)

    @cached_property
    def places_mm(self) -> Floats:
        """Coordinates of the voxels from the middle of the cerebrum, (3, i, j, k)."""
        index = np.indices(self.labels.shape).reshape(3, -1)
        places = (self.affine[:3, :3] @ index).T + self.affine[:3, 3]
        inside = places[self.cerebrum.ravel()]
        places -= (inside.min(axis=0) + inside.max(axis=0)) / 2
        return places.T.reshape(3, *self.labels.shape)

    @cached_property
    def pial(self) -> PialSurface:
        return from_labels(self.labels, self.affine, SCHEME, week=WEEK, open_sulci=True)

    @cached_property
    def posed_sides(self) -> dict[str, TriangleMesh]:
        """The hemispheres by side, in the brain's pose."""
        assert self.pial.left is not None
        assert self.pial.right is not None
        return {"left": self.pial.left, "right": self.pial.right}

    @cached_property
    def posed_whites(self) -> dict[str, TriangleMesh]:
        """The white surfaces by side, in the brain's pose."""
        return white_from_labels(
            self.labels, self.affine, SCHEME, self.posed_sides, self.pial.pose
        )

    def placed(self, mesh: TriangleMesh) -> TriangleMesh:
        """Return a surface in the coordinates of the labels."""
        return transformed(mesh, np.linalg.inv(self.pial.pose.world))

    @cached_property
    def sides(self) -> dict[str, TriangleMesh]:
        """The hemispheres by side, in the coordinates of the labels."""
        return {side: self.placed(mesh) for side, mesh in self.posed_sides.items()}

    @cached_property
    def whole(self) -> TriangleMesh:
        """The whole brain, in the coordinates of the labels."""
        return self.placed(self.pial.whole)

    @cached_property
    def whites(self) -> dict[str, TriangleMesh]:
        """The white surfaces by side, in the coordinates of the labels."""
        return {side: self.placed(mesh) for side, mesh in self.posed_whites.items()}

    def within(self, centre: tuple[float, float, float], radius_mm: float) -> Labels:
        """Return the mask of a ball, its centre in mm from the middle."""
        away = self.places_mm - np.array(centre)[:, None, None, None]
        return np.linalg.norm(away, axis=0) < radius_mm


@dataclass(frozen=True, eq=False)
class Damaged:
    """A brain of the study: files to write, further keys, and what its picture has.

    Exactly one of `volume` and `surfaces` is given. `view` is one of `PLANES` for a
    volume, of `VIEWS` for surfaces; a plane is `at` mm from the brain's middle.
    """

    volume: LabelVolume | None = None
    surfaces: Mapping[str, TriangleMesh] = field(default_factory=dict)
    whites: Mapping[str, TriangleMesh] = field(default_factory=dict)
    keys: Mapping[str, Any] = field(default_factory=dict)
    view: str = "coronal"
    at: float = 0.0
    is_drawn: bool = True


def of_labels(sound: Sound, labels: Labels, **further: Any) -> Damaged:
    """Return a brain with other labels in the same voxels."""
    volume = LabelVolume(labels.astype(np.int32), sound.affine)
    return Damaged(volume, **further)


def cropped(sound: Sound) -> Damaged:
    """The upper quarter of the cerebrum lies outside the field of view."""
    filled = np.flatnonzero(sound.cerebrum.any(axis=(0, 1)))
    top = int(filled[-1] - CROPPED_SHARE * len(filled))
    return of_labels(sound, sound.labels[:, :, :top])


def cerebellum(sound: Sound) -> Damaged:
    """The cerebellum has the label of the cortex."""
    labels = np.where(sound.labels == CEREBELLUM, CORTEX, sound.labels)
    return of_labels(sound, labels, view="sagittal")


def missing_cortex(sound: Sound) -> Damaged:
    """A patch of the right cortex has the label of the outer CSF."""
    x, _, _ = sound.places_mm
    patch = sound.within((x[sound.cerebrum].max(), 0.0, 0.0), PATCH_MM)
    is_lost = patch & (sound.labels == CORTEX)
    return of_labels(sound, np.where(is_lost, OUTER_CSF, sound.labels))


def lost_white_matter(sound: Sound) -> Damaged:
    """White matter up to the surface has the label of the outer CSF."""
    ball = sound.within((14.0, -16.0, 4.0), LOST_MM)
    is_lost = ball & (sound.labels == WHITE)
    return of_labels(sound, np.where(is_lost, OUTER_CSF, sound.labels), at=-16.0)


def fused(sound: Sound) -> Damaged:
    """What lies between the hemispheres has the label of the cortex."""
    x, _, _ = sound.places_mm
    filled = binary_closing(sound.cerebrum, iterations=FISSURE_VOXELS)
    fissure = filled & ~sound.cerebrum & (np.abs(x) < FISSURE_MM)
    return of_labels(sound, np.where(fissure, CORTEX, sound.labels))


def one_hemisphere(sound: Sound) -> Damaged:
    """The right half was not segmented."""
    x, _, _ = sound.places_mm
    return of_labels(sound, np.where(x > 0, 0, sound.labels))


def swollen_cortex(sound: Sound) -> Damaged:
    """Fluid within 2.5 mm of the cortex has its label, also in sulci."""
    reached = distance_transform_edt(
        sound.labels != CORTEX, sampling=np.abs(np.diag(sound.affine)[:3])
    )
    is_swallowed = (sound.labels == OUTER_CSF) & (reached < SWOLLEN_MM)
    return of_labels(sound, np.where(is_swallowed, CORTEX, sound.labels))


def ragged(sound: Sound) -> Damaged:
    """Slices are shifted against each other, as by motion between them."""
    random = np.random.default_rng(1)
    slices = [
        np.roll(plane, random.integers(-SHIFT_VOXELS, SHIFT_VOXELS + 1, 2), (0, 1))
        for plane in np.moveaxis(sound.labels, 2, 0)
    ]
    return of_labels(sound, np.stack(slices, axis=2))


def thick_slices(sound: Sound) -> Damaged:
    """Only every sixth axial slice was segmented."""
    affine = sound.affine.copy()
    affine[:, 2] *= SLICE_VOXELS
    labels = sound.labels[:, :, ::SLICE_VOXELS]
    return Damaged(LabelVolume(labels.astype(np.int32), affine))


def wrong_scheme(sound: Sound) -> Damaged:
    """The labels are read by the scheme of FeTA."""
    return of_labels(sound, sound.labels, keys={"scheme": "feta-7"})


def wrong_week(sound: Sound) -> Damaged:
    """The week of birth in place of that of the scan."""
    return of_labels(sound, sound.labels, keys={"week": WRONG_WEEK})


def voxel_indices(sound: Sound) -> Damaged:
    """Surfaces in voxel indices, not in mm."""
    scale = np.linalg.inv(sound.affine)
    return Damaged(
        surfaces={side: transformed(m, scale) for side, m in sound.sides.items()},
        view="left",
    )


def metres(sound: Sound) -> Damaged:
    """Surfaces in metres, too small to draw."""
    scale = np.diag([METRES_PER_MM] * 3 + [1.0])
    return Damaged(
        surfaces={side: transformed(m, scale) for side, m in sound.sides.items()},
        is_drawn=False,
    )


def exchanged(sound: Sound) -> Damaged:
    """The file of each hemisphere is given as that of the other."""
    left, right = (sound.sides[side] for side in SIDES)
    return Damaged(surfaces={"left": right, "right": left}, view="top")


def hole(sound: Sound) -> Damaged:
    """The surface of the whole brain has a hole on its right side."""
    mesh = sound.whole
    outermost = mesh.vertices[mesh.vertices[:, 0].argmax()]
    away = np.linalg.norm(corners(mesh).mean(axis=1) - outermost, axis=1)
    return Damaged(surfaces={"whole": submesh(mesh, away > HOLE_MM)[0]}, view="right")


def spike(sound: Sound) -> Damaged:
    """A few vertices are far off the surface."""
    mesh = sound.whole
    highest = mesh.vertices[mesh.vertices[:, 2].argmax()]
    away = np.linalg.norm(mesh.vertices - highest, axis=1)
    lifted = mesh.vertices.copy()
    lifted[:, 2] += SPIKE_MM * np.exp(-((away / SPIKE_WIDTH_MM) ** 2))
    return Damaged(surfaces={"whole": TriangleMesh(lifted, mesh.faces)}, view="left")


def shifted_white(sound: Sound) -> Damaged:
    """The white surfaces lie 4 mm too far in front."""
    shift = np.array([0.0, WHITE_SHIFT_MM, 0.0])
    return Damaged(
        surfaces=sound.sides,
        whites={
            side: TriangleMesh(mesh.vertices + shift, mesh.faces)
            for side, mesh in sound.whites.items()
        },
        view="axial",
    )


CASES: dict[str, Callable[[Sound], Damaged]] = {
    case.__name__: case
    for case in (
        cropped,
        cerebellum,
        missing_cortex,
        lost_white_matter,
        fused,
        one_hemisphere,
        swollen_cortex,
        ragged,
        thick_slices,
        wrong_scheme,
        wrong_week,
        voxel_indices,
        metres,
        exchanged,
        hole,
        spike,
        shifted_white,
    )
}
"""The damages by the name of their brain."""


def read_sound(week: int = WEEK) -> Sound:
    """Return the shipped brain of a week."""
    return Sound(read_label_volume(ATLAS / VOLUME.format(week=week), cropped=True))


def write_study(folder: Path, brains: Mapping[str, Damaged]) -> Path:
    """Write the files of brains and the configuration of a study of them; return its
    path."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for name, brain in brains.items():
        row: dict[str, Any] = {"id": name, "week": WEEK}
        if brain.volume is not None:
            row |= {"labels": f"{name}.nii.gz", "scheme": SCHEME_NAME}
            write_label_volume(folder / row["labels"], brain.volume)
        files = {side: f"{name}.{side}.surf.gii" for side in brain.surfaces}
        for side, file in files.items():
            write_surface(folder / file, brain.surfaces[side])
        if "whole" in files:
            row["pial"] = files["whole"]
        elif files:
            row["hemispheres"] = files
        whites = {side: f"{name}.{side}.white.surf.gii" for side in brain.whites}
        for side, file in whites.items():
            write_surface(folder / file, brain.whites[side])
        if whites:
            row["white"] = [whites[side] for side in SIDES]
        rows.append(row | dict(brain.keys))
    path = folder / "gallery.yaml"
    write_yaml(path, {"brains": rows})
    return path


def run(config: Path, cores: int) -> dict[str, list[Message]]:
    """Run the surface stage of a study in its folder; return the messages by brain.

    Brains that are refused stop no other.
    """
    environment = os.environ | {"PYTHONPATH": str(ROOT / "src")}
    command = [sys.executable, "-m", "gyriflow.cli", "run", str(config)]
    options = ["-d", str(config.parent), "--cores", str(cores)]
    subprocess.run(
        [*command, *options, "--stage", "surface", "--keep-going"],
        env=environment,
        check=False,
    )
    messages: dict[str, list[Message]] = {}
    for message in study_messages(config.parent):
        messages.setdefault(message.brain, []).append(message)
    return messages


def verdict(messages: list[Message]) -> str:
    """Return the verdict on a brain that follows from messages, as on its page."""
    fine, needs_review, refused = VERDICTS
    levels = {message.level for message in messages}
    if "error" in levels:
        return refused
    return needs_review if levels else fine


def in_folder(text: str, folder: Path) -> str:
    """Return a message with the paths of its files in the folder of the study."""
    return text.replace(f"{folder.resolve()}/", "")


def without_numbers(text: str) -> str:
    """Return a message without its numbers."""
    return re.sub(r"[\d.]+", "", text)


def unlike(messages: list[Message], known: list[Message]) -> list[Message]:
    """Return the messages that, but for their numbers, are not among the known ones."""
    texts = {without_numbers(message.text) for message in known}
    return [
        message for message in messages if without_numbers(message.text) not in texts
    ]


@styled
def draw(sound: Sound, brain: Damaged, folder: Path, name: str) -> Figure:
    """Draw the sound brain beside the damaged one, at one scale."""
    figure = Figure(figsize=(2 * PANEL_IN, PANEL_IN), layout="constrained")
    panels = figure.subplots(1, 2)
    scheme = SCHEMES[brain.keys.get("scheme", SCHEME_NAME)]
    if name == "wrong_week":
        later = read_sound(WRONG_WEEK)
        pictures = [
            (later.volume, SCHEME, f"{WRONG_WEEK} GW"),
            (sound.volume, SCHEME, f"{WEEK} GW, given as {WRONG_WEEK}"),
        ]
        _draw_volumes(panels, pictures, brain, [None, None])
    elif brain.volume is not None:
        pictures = [
            (sound.volume, SCHEME, SOUND),
            (brain.volume, scheme, name.replace("_", " ")),
        ]
        made = [_made(folder, SOUND), _made(folder, name)]
        _draw_volumes(panels, pictures, brain, made)
    elif brain.whites:
        _draw_whites(panels, sound, brain)
    else:
        _draw_surfaces(panels, sound, brain, name.replace("_", " "))
    return figure


def _made(folder: Path, name: str) -> TriangleMesh | None:
    """Return the surface of a brain in the coordinates of its labels, None if it was
    refused."""
    surface = folder / f"results/brains/{name}/surface"
    if not (surface / "pial.surf.gii").exists():
        return None
    back = np.linalg.inv(read_pose(surface / "surface.json").world)
    return transformed(read_surface(surface / "pial.surf.gii"), back)


def _draw_volumes(
    panels: np.ndarray,
    pictures: list[tuple[LabelVolume, Any, str]],
    brain: Damaged,
    surfaces: list[TriangleMesh | None],
) -> None:
    """Draw a plane of two volumes, with the outlines of surfaces."""
    first, scheme, _ = pictures[0]
    low, high = _extent_mm(first, scheme)
    middle = (low + high) / 2
    normal, right, up = PLANES[brain.view]
    if brain.view == "sagittal":
        # beside the fissure
        middle[0] += 6.0
    middle[normal] += brain.at
    axes_mm = [
        np.arange(low[axis] - MARGIN_MM, high[axis] + MARGIN_MM, PIXEL_MM)
        for axis in range(3)
    ]
    points = np.empty((len(axes_mm[up]), len(axes_mm[right]), 3))
    points[..., normal] = middle[normal]
    points[..., right] = axes_mm[right]
    points[..., up] = axes_mm[up][:, None]
    extent = (*axes_mm[right][[0, -1]], *axes_mm[up][[0, -1]])
    for axes, (volume, scheme, title), surface in zip(
        panels, pictures, surfaces, strict=True
    ):
        groups = tissue_groups(volume.labels, scheme)
        index = voxel_index(points, volume.affine)
        seen = map_coordinates(groups, index, order=0, mode="constant")
        axes.imshow(
            seen,
            cmap=ListedColormap(TISSUE_COLOURS),
            vmin=-0.5,
            vmax=4.5,
            origin="lower",
            extent=extent,
            interpolation="none",
        )
        if surface is not None:
            draw_outline(axes, surface, brain.view, middle[normal], PIAL_COLOUR, 1.0)
        _finish(axes, title, extent)


def _extent_mm(volume: LabelVolume, scheme: Any) -> tuple[Floats, Floats]:
    """Return the lower and the upper corner of all that is labelled."""
    places = np.argwhere(volume.labels > 0)
    points = places @ volume.affine[:3, :3].T + volume.affine[:3, 3]
    return points.min(axis=0), points.max(axis=0)


def _draw_whites(panels: np.ndarray, sound: Sound, brain: Damaged) -> None:
    """Draw pial and white outlines in an axial plane."""
    pial = merged(*brain.surfaces.values())
    low, high = pial.vertices.min(axis=0), pial.vertices.max(axis=0)
    normal, right, up = PLANES[brain.view]
    at = (low + high)[normal] / 2
    ends = [(low[axis] - MARGIN_MM, high[axis] + MARGIN_MM) for axis in (right, up)]
    pairs = ((sound.whites, SOUND), (brain.whites, "shifted white"))
    for axes, (whites, title) in zip(panels, pairs, strict=True):
        draw_outline(axes, merged(*whites.values()), brain.view, at, INNER_COLOUR, 1.0)
        draw_outline(axes, pial, brain.view, at, PIAL_COLOUR, 1.0)
        _finish(axes, title, (*ends[0], *ends[1]))


def _draw_surfaces(
    panels: np.ndarray, sound: Sound, brain: Damaged, title: str
) -> None:
    """Draw surfaces from one side at one scale; hemispheres in two colours if the
    damaged brain's are two surfaces."""
    view = VIEWS[brain.view]
    colours = (OBSERVED_SURFACE_COLOUR, "#8FB4DC")
    has_sides = "whole" not in brain.surfaces
    damaged = merged(*brain.surfaces.values())
    given = [(sound.sides, SOUND), (brain.surfaces, title)]
    wide, tall = np.max(
        [half_extents(sound.whole, view), half_extents(damaged, view)], axis=0
    )
    half = 1.05 * max(wide, tall)
    pixels_per_mm = PANEL_IN * DOTS_PER_INCH / (2 * half)
    for axes, (parts, name) in zip(panels, given, strict=True):
        mesh = merged(*parts.values())
        painted = np.concatenate(
            [
                uniform_colours(part, colours[has_sides and side == "right"])
                for side, part in parts.items()
            ]
        )
        axes.imshow(render(mesh, painted, view, (half, half), pixels_per_mm))
        axes.set_axis_off()
        axes.set_title(name, fontsize=8, pad=2)


def _finish(axes: Axes, title: str, extent: tuple[float, ...]) -> None:
    left, right, bottom, top = extent
    axes.set(xlim=(left, right), ylim=(bottom, top), aspect="equal")
    axes.set_axis_off()
    axes.set_title(title, fontsize=8, pad=2)


def save(figure: Figure, path: Path) -> None:
    """Write a picture as a small PNG of few colours."""
    buffer = BytesIO()
    figure.savefig(buffer, format="png", dpi=DOTS_PER_INCH)
    picture = Image.open(buffer).convert("RGB").quantize(COLOURS)
    with atomic_write(path) as temporary:
        picture.save(temporary, format="png", optimize=True)


def main() -> None:
    """Make the study, run it, print its messages and draw its brains."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--figures", type=Path)
    parser.add_argument("--cores", type=int, default=2)
    parser.add_argument("--cases", nargs="+", choices=list(CASES), default=list(CASES))
    arguments = parser.parse_args()

    sound = read_sound()
    brains = {name: CASES[name](sound) for name in arguments.cases}
    whole = {SOUND: Damaged(sound.volume), **brains}
    messages = run(write_study(arguments.folder, whole), arguments.cores)
    rows: dict[str, dict[str, Any]] = {}
    for name in whole:
        found = messages.get(name, [])
        if name != SOUND:
            found = unlike(found, messages.get(SOUND, []))
        texts = [in_folder(message.text, arguments.folder) for message in found]
        rows[name] = {"verdict": verdict(found), "messages": texts}
        print(f"{name}: {rows[name]['verdict']}")
        for text in texts:
            print(f"  {text}")
    if arguments.figures:
        arguments.figures.mkdir(parents=True, exist_ok=True)
        for name, brain in brains.items():
            if not brain.is_drawn:
                continue
            figure = draw(sound, brain, arguments.folder, name)
            save(figure, arguments.figures / f"{name}.png")
    print(json.dumps(rows))


if __name__ == "__main__":
    main()
