"""Measure surfaces with fused and with opened sulci, on phantoms of known shape and on shipped brains.

`python benchmarks/open_sulci.py [FOLDER …]`: without folders, phantoms; with folders named by their week, each with a
`parcellation.nii.gz` in the labels of the spina bifida atlas, pial area, thickness and the ratio of the area to the
cortex's volume divided by its thickness.
"""

import json
import re
import sys
import time
from itertools import product
from pathlib import Path

import numpy as np
from scipy import ndimage
from scipy.spatial.transform import Rotation

from gyriflow.anatomy.extraction import remove_bridges, smooth_mask
from gyriflow.anatomy.pial import from_labels
from gyriflow.anatomy.repair import surface_of_mask
from gyriflow.anatomy.sulci import open_fused_sulci
from gyriflow.anatomy.thickness import cortical_thickness, thickness_from_labels
from gyriflow.geometry.triangles import area, convex_hull, euler_number, vertex_areas
from gyriflow.io.volumes import read_label_volume
from gyriflow.io.yaml_files import SCHEMES
from gyriflow.metrics.gyrification import sulcal_depth

# a ball with sulci around it, at x = ±X + A sin(y/L), all in mm
RADIUS_MM, DEPTH_MM, THICKNESS_MM = 20.0, 6.0, 2.0
PLACES_MM, WAVE_MM, LENGTH_MM = (-6.0, 6.0), 1.5, 4.0
WIDTHS_MM, VOXELS_MM, TURNS_DEG = (0.0, 0.2, 0.5, 1.0), (0.5, 0.8, 1.0), ((0, 0, 0), (20, 30, 10), (45, 35, 0))
# cells of a voxel along each axis; the label is that of most cells
CELLS = 3
EDGE_MM = 1.0
SULCI = ("fused", "opened")


def off_sulci(points: np.ndarray) -> np.ndarray:
    """Return the distance (mm) of (…, 3) points from the middle of the nearest sulcus."""
    wave = points[..., 1] / LENGTH_MM
    offset = (points[..., 0] - WAVE_MM * np.sin(wave)) / np.sqrt(1.0 + (WAVE_MM / LENGTH_MM * np.cos(wave)) ** 2)
    return np.min([np.abs(offset - place) for place in PLACES_MM], axis=0)


def truth(width_mm: float) -> dict[str, float]:
    """Return the area of the ball with sulci of a width, its mean depth below the hull, and its gyrification."""
    step = 0.02
    y, z = np.meshgrid(*[np.arange(-RADIUS_MM, RADIUS_MM, step)] * 2, indexing="ij")
    stretch = np.sqrt(1.0 + (WAVE_MM / LENGTH_MM * np.cos(y / LENGTH_MM)) ** 2)
    hull = 4.0 * np.pi * RADIUS_MM**2
    walls = depth = 0.0
    for place in PLACES_MM:
        below = RADIUS_MM - np.sqrt((place + WAVE_MM * np.sin(y / LENGTH_MM)) ** 2 + y**2 + z**2)
        wall = 2.0 * stretch * step**2 * ((below > 0) & (below < DEPTH_MM))
        walls, depth = walls + wall.sum(), depth + (wall * below).sum()
    # area of the sulci's mouths, which the ball loses, and of their bottoms
    height, turn = np.meshgrid(np.arange(-1, 1, 0.001) + 0.0005, np.arange(0, 2 * np.pi, 0.002), indexing="ij")
    radial = np.sqrt(1.0 - height**2)
    directions = np.stack([radial * np.cos(turn), radial * np.sin(turn), height], axis=-1)
    mouth, bottom = (
        4.0 * np.pi * radius**2 * float((off_sulci(radius * directions) < 0.5 * width_mm).mean())
        for radius in (RADIUS_MM, RADIUS_MM - DEPTH_MM)
    )
    whole = hull - mouth + walls + bottom
    depth = (depth + bottom * DEPTH_MM) / whole
    return {"area_mm2": whole, "depth_mm": depth, "gi": whole / hull, "thickness_mm": THICKNESS_MM}


def phantom(width_mm: float, voxel_mm: float, turn_deg: tuple[float, float, float]):
    """Return the (i, j, k) masks of the body and of its core inside the cortex, and their affine."""
    count = int(np.ceil(RADIUS_MM / voxel_mm)) + 6
    axis = np.arange(-count, count + 1) * voxel_mm + 0.13
    cells = (axis[:, None] + voxel_mm * ((np.arange(CELLS) + 0.5) / CELLS - 0.5)).ravel()
    turn = Rotation.from_euler("xyz", turn_deg, degrees=True).as_matrix()
    points = np.stack(np.meshgrid(cells, cells, cells, indexing="ij"), axis=-1) @ turn
    below = RADIUS_MM - np.linalg.norm(points, axis=-1)
    off = off_sulci(points)
    # distance to the walls: that to the middle of the sulci less half their width
    middle = (off < 0.6 * voxel_mm / CELLS) & (below < DEPTH_MM)
    to_walls = ndimage.distance_transform_edt(~middle, sampling=voxel_mm / CELLS) - 0.5 * width_mm
    outside = (below < 0) | ((off < 0.5 * width_mm) & (below < DEPTH_MM))
    core = (below > THICKNESS_MM) & (to_walls > THICKNESS_MM)
    shape = (len(axis), CELLS) * 3
    body, core = (mask.reshape(shape).mean(axis=(1, 3, 5)) > 0.5 for mask in (~outside, core))
    affine = np.diag([voxel_mm] * 3 + [1.0])
    affine[:3, 3] = axis[0]
    return body, core & body, affine


def measure(mesh, body, core, affine) -> dict[str, float]:
    """Measure the quantities of `truth` on a surface of the body, and its Euler number."""
    hull, weights = convex_hull(mesh), vertex_areas(mesh)
    thickness = cortical_thickness(mesh, body, body & ~core, affine, fissure_x_mm=-1e3)
    depth = float(np.average(sulcal_depth(mesh, hull), weights=weights))
    result = {"area_mm2": area(mesh), "depth_mm": depth, "gi": area(mesh) / area(hull)}
    return result | {"thickness_mm": thickness.report["mean_mm"], "euler": euler_number(mesh)}


def try_phantom(width_mm: float, voxel_mm: float, turn_deg: tuple[float, float, float]) -> dict:
    """Measure the surfaces of a phantom with fused and with opened sulci."""
    body, core, affine = phantom(width_mm, voxel_mm, turn_deg)
    # as for brains: slits one voxel wide are opened
    field, _ = remove_bridges(body, smooth_mask(body), np.zeros_like(body))
    volume = float(body.sum() * voxel_mm**3)
    fused = surface_of_mask(field, affine, volume, EDGE_MM).mesh
    field, fine, report = open_fused_sulci(field, affine, core)
    opened = surface_of_mask(field, fine, volume, EDGE_MM, taken_mm3=1e3 * report["opened_mL"]).mesh
    row = {"width_mm": width_mm, "voxel_mm": voxel_mm, "turn_deg": turn_deg}
    return row | {name: measure(mesh, body, core, affine) for name, mesh in zip(SULCI, (fused, opened), strict=True)}


def try_brain(path: Path, week: float) -> dict:
    """Return area, thickness and area ratio of a brain with fused and with opened sulci."""
    volume, scheme, row = read_label_volume(path, cropped=True), SCHEMES["spina-bifida-atlas"], {"week": week}
    for name in SULCI:
        began = time.process_time()
        brain = from_labels(volume.labels, volume.affine, scheme, week=week, open_sulci=name == "opened")
        seconds = time.process_time() - began
        surface = brain.whole, brain.pose, brain.fissure_x_mm
        report = thickness_from_labels(volume.labels, volume.affine, scheme, *surface).report
        found = {"area_cm2": brain.report["area_cm2"]["whole"], "thickness_mm": report["mean_mm"]}
        row[name] = found | {"area_ratio": report["area_ratio"], "euler": brain.report["euler_number"], "s": seconds}
    return row


if __name__ == "__main__":
    true, phantoms, brains = {width: truth(width) for width in WIDTHS_MM}, [], {}
    for voxel, width, turn in product(VOXELS_MM, WIDTHS_MM, TURNS_DEG) if not sys.argv[1:] else []:
        phantoms.append(row := try_phantom(width, voxel, turn))
        fused, opened = (
            {key: f"{row[name][key] / exact - 1:+.1%}" for key, exact in true[width].items()} for name in SULCI
        )
        print(f"{voxel} mm voxels, {width} mm wide, rotated {turn}: fused {fused}, opened {opened}", flush=True)
    for folder in sys.argv[1:]:
        week = re.findall(r"\d+", Path(folder).name)[0]
        brains[Path(folder).name] = row = try_brain(Path(folder) / "parcellation.nii.gz", float(week))
        print(f"{Path(folder).name}: {row}", flush=True)
    print(json.dumps({"truth": true, "phantoms": phantoms, "brains": brains}))
