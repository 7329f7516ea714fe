"""Surfaces, and maps and labels at their vertices: what is written comes back, what is
broken is named."""

from types import SimpleNamespace

import nibabel as nib
import numpy as np
import pytest
from facts import Facts
from nibabel.freesurfer.io import write_geometry
from nibabel.gifti import GiftiCoordSystem, GiftiDataArray, GiftiImage
from nibabel.nifti1 import intent_codes
from shapes import moved, save_gifti, sphere

from gyriflow.errors import InputError
from gyriflow.geometry.triangles import transformed
from gyriflow.io.surfaces import (
    read_hemispheres,
    read_surface,
    read_surface_maps,
    read_vertex_labels,
    read_vertex_maps,
    surface_space_structure,
    write_surface,
    write_vertex_labels,
    write_vertex_maps,
)

BALL = sphere(10.0, 2, (30.0, -20.0, 5.0))
TURN = np.array([[0, -1, 0, 7], [1, 0, 0, 8], [0, 0, 1, 9], [0, 0, 0, 1.0]])
SCALE = np.diag([1.16, 1.16, 1.16, 1.0])
UNKNOWN, SCANNER, ALIGNED, TALAIRACH = (
    f"NIFTI_XFORM_{name}"
    for name in ("UNKNOWN", "SCANNER_ANAT", "ALIGNED_ANAT", "TALAIRACH")
)


def in_space(path, data, to, matrix, **metadata):
    """Write a surface whose points have a coordinate system: its space, another one,
    and the matrix to that."""
    save_gifti(path, BALL)
    image = nib.load(path)
    codes = (nib.nifti1.xform_codes[space] for space in (data, to))
    image.darrays[0].coordsys = GiftiCoordSystem(*codes, matrix)
    image.darrays[0].meta.update(metadata)
    nib.save(image, path)
    return path


@pytest.mark.parametrize(
    ("system", "space", "is_applied", "facts"),
    [
        ((UNKNOWN, SCANNER, TURN), SCANNER, True, [SCANNER]),
        ((UNKNOWN, ALIGNED, TURN), ALIGNED, True, [ALIGNED]),
        ((UNKNOWN, TALAIRACH, SCALE), None, False, [TALAIRACH, 1.16]),
        ((SCANNER, TALAIRACH, SCALE), SCANNER, False, [SCANNER, TALAIRACH]),
    ],
)
def test_a_matrix_is_applied_if_it_leads_to_scanner_space_and_reported_if_not(
    tmp_path, caplog, system, space, is_applied, facts
):
    path = in_space(tmp_path / "a.gii", *system)
    found, found_space, _ = surface_space_structure(path)
    expected = transformed(BALL, system[2] if is_applied else np.eye(4))
    assert found.vertices == pytest.approx(expected.vertices, abs=1e-3)
    assert found_space == space
    assert caplog.messages == [Facts(path, *facts)]


@pytest.mark.parametrize("matrix", [SCALE, np.diag([-1.0, 1, 1, 1])])
def test_a_matrix_into_scanner_space_that_is_not_rigid_is_refused(tmp_path, matrix):
    path = in_space(tmp_path / "a.gii", UNKNOWN, SCANNER, matrix)
    with pytest.raises(InputError, check=Facts(path, SCANNER, matrix[0, 0])):
        read_surface(path)


@pytest.mark.parametrize(
    ("space", "centre", "is_reported"),
    [
        (UNKNOWN, (5.3, -17.0, 6.0), True),
        (UNKNOWN, (0.0, 0.0, 0.0), False),
        (SCANNER, (5.3, -17.0, 6.0), False),
    ],
)
def test_coordinates_that_may_be_relative_to_freesurfers_volume_are_reported(
    tmp_path, caplog, space, centre, is_reported
):
    # as mris_convert writes the centre of its volume, with the points
    named = {f"VolGeomC_{axis}": f"{centre[n]:.6f}" for n, axis in enumerate("RAS")}
    read_surface(in_space(tmp_path / "a.gii", space, space, np.eye(4), **named))
    assert ("C_RAS = (5.3, -17, 6) mm" in caplog.text) == is_reported


GEOMETRY = {
    "head": [2, 0, 20],
    "valid": "1  # volume info valid",
    "filename": "orig.mgz",
    "volume": [256] * 3,
    "voxelsize": [1.0, 1.0, 1.0],
    "xras": [0.0, -1.0, 0.0],
    "yras": [0.0, 0.0, -1.0],
    "zras": [-1.0, 0.0, 0.0],
    "cras": [5.0, 6.0, 7.0],
}


def save_freesurfer(path):
    write_geometry(path, BALL.vertices, BALL.faces, volume_info=GEOMETRY)


def test_a_freesurfer_surface_is_brought_to_scanner_space_unless_it_is_there(
    tmp_path, caplog
):
    path = tmp_path / "lh.pial"
    save_freesurfer(path)
    # Norig inv(Torig) of surfer.nmr.mgh.harvard.edu/fswiki/CoordinateSystems, voxels of
    # 1 mm
    torig = np.array(
        [[-1, 0, 0, 128], [0, 0, 1, -128], [0, -1, 0, 128], [0, 0, 0, 1.0]]
    )
    norig = np.eye(4)
    norig[:3, :3] = np.column_stack([GEOMETRY[f"{axis}ras"] for axis in "xyz"])
    norig[:3, 3] = GEOMETRY["cras"] - norig[:3, :3] @ np.full(3, 128.0)
    expected = transformed(BALL, norig @ np.linalg.inv(torig))
    content = path.read_bytes()
    tag = b"\0\0\0\2\0\0\0\0\0\0\0\x14"
    in_scanner_space = content.replace(tag, b"\0\0\0\2\0\0\0\1\0\0\0\x14")
    for written, mesh in ((content, expected), (in_scanner_space, BALL)):
        path.write_bytes(written)
        found, *named = surface_space_structure(path)
        assert found.vertices == pytest.approx(mesh.vertices, abs=1e-3)
        assert named == [SCANNER, "CortexLeft"]
    assert caplog.messages == []


@pytest.mark.parametrize(
    "name",
    [
        "named_in_the_file.surf.gii",
        "rh.pial",
        "sub-01_hemi-R_pial.surf.gii",
        "case.R.pial.ply",
        "right.gii",
    ],
)
def test_a_surface_of_the_other_hemisphere_is_refused(tmp_path, name):
    path = tmp_path / name
    if name == "rh.pial":
        save_freesurfer(path)
    else:
        write_surface(path, BALL, "CortexRight" if "in_the_file" in name else None)
    assert len(read_surface(path, "right").faces) == len(BALL.faces)
    with pytest.raises(InputError, check=Facts(f"{path}:", "CortexRight", "left")):
        read_surface(path, "left")
    # the content counts before the name
    write_surface(tmp_path / "right.surf.gii", BALL, "CortexLeft")
    assert read_surface(tmp_path / "right.surf.gii", "left")


def test_maps_and_labels_of_the_other_hemisphere_are_refused(tmp_path):
    surfaces, maps = {}, {}
    for side in ("left", "right"):
        structure = f"Cortex{side.title()}"
        surfaces[side] = tmp_path / f"{side[0]}.surf.gii"
        maps[side] = tmp_path / f"{side[0]}.shape.gii"
        write_surface(surfaces[side], BALL, structure)
        write_vertex_maps(maps[side], {"x": BALL.vertices[:, 0]}, structure)
    unnamed, labels = tmp_path / "unnamed.ply", tmp_path / "l.label.gii"
    write_surface(unnamed, BALL)
    write_vertex_labels(labels, np.ones(162, int), {1: "frontal"}, "CortexLeft")
    read_surface_maps([maps["left"]], [surfaces["left"]])
    read_surface_maps([maps["right"]], [unnamed])
    read_vertex_labels(labels, "left")
    for read, *arguments in (
        (read_surface_maps, [maps["right"]], [surfaces["left"]]),
        (read_surface_maps, [maps["right"]] * 2, [unnamed] * 2),
        # two are left and right
        (read_surface_maps, [*maps.values()][::-1], [*surfaces.values()][::-1]),
        (read_vertex_labels, labels, "right"),
    ):
        with pytest.raises(InputError, check=Facts("CortexLeft", "CortexRight")):
            read(*arguments)


def test_hemispheres_are_two_surfaces_whose_spaces_are_compared(tmp_path, caplog):
    left = in_space(tmp_path / "first.gii", UNKNOWN, SCANNER, TURN)
    copy, right, unnamed = (tmp_path / f"{name}.gii" for name in "abc")
    write_surface(copy, transformed(BALL, TURN))
    write_surface(right, moved(BALL, 40.0))
    save_gifti(unnamed, moved(BALL, 40.0))
    for same in (left, copy):
        with pytest.raises(InputError, check=Facts(left, same, "same surface")):
            read_hemispheres(left, same)
    caplog.clear()
    *_, is_one_space = read_hemispheres(left, right)
    # the matrix of a file is reported once
    assert (is_one_space, caplog.messages) == (True, [Facts(left, SCANNER)])
    *_, is_one_space = read_hemispheres(left, unnamed)
    assert not is_one_space
    assert caplog.messages[2:] == [Facts(left, unnamed, SCANNER, "no space")]


def legacy(path, order, kind="f4"):
    """Write a surface as MRtrix does (order "<") or as VTK does (">")."""
    count = len(BALL.faces)
    cells = np.column_stack([np.full(count, 3), BALL.faces]).astype(f"{order}i4")
    name = {"f4": "float", "f8": "double"}[kind]
    head = (
        "# vtk DataFile Version 1.0\nmesh\nBINARY\nDATASET POLYDATA\n"
        f"POINTS {len(BALL.vertices)} {name}\n"
    )
    points = BALL.vertices.astype(order + kind).tobytes()
    polygons = f"POLYGONS {count} {4 * count}\n".encode()
    path.write_bytes(head.encode() + points + polygons + cells.tobytes())
    return path


@pytest.mark.parametrize("kind", ["f4", "f8"])
def test_vtk_files_of_mrtrix_in_little_endian_order_are_read(tmp_path, kind):
    back = read_surface(legacy(tmp_path / "a.vtk", "<", kind))
    assert back.vertices == pytest.approx(BALL.vertices, abs=1e-5)
    assert (back.faces == BALL.faces).all()


def test_a_file_that_crashes_vtk_is_refused(tmp_path):
    content = bytearray(legacy(tmp_path / "a.vtk", ">").read_bytes())
    place = content.index(b"\n", content.index(b"POLYGONS")) + 1
    content[place : place + 4] = (10**9).to_bytes(4, "big")
    (tmp_path / "a.vtk").write_bytes(bytes(content))
    with pytest.raises(InputError, check=Facts("a.vtk:")):
        read_surface(tmp_path / "a.vtk")


def test_vertices_that_are_no_places_and_faces_beyond_the_vertices_are_refused(
    tmp_path,
):
    path, vertices = tmp_path / "a.gii", BALL.vertices.copy()
    vertices[3:5, 1] = np.nan
    for points, faces, facts in (
        (vertices, BALL.faces, [2]),
        (BALL.vertices, BALL.faces + 1, [1, 162, 0, 161]),
        (BALL.vertices.T, BALL.faces, ["(3, 162)", "(n, 3)"]),
    ):
        save_gifti(path, SimpleNamespace(vertices=points, faces=faces))
        with pytest.raises(InputError, check=Facts(path, *facts)):
            read_surface(path)


def test_maps_and_labels_come_back_with_names_and_what_workbench_reads(tmp_path):
    maps = {"shape_index": np.linspace(-1, 1, 50), "curvedness": np.arange(50)}
    write_vertex_maps(tmp_path / "a.shape.gii", maps, "CortexRight")
    found = read_vertex_maps(tmp_path / "a.shape.gii")
    assert list(found) == list(maps)
    assert found["shape_index"] == pytest.approx(maps["shape_index"], abs=1e-6)
    labels, regions = np.array([0, 3, 3, 12]), {3: "frontal", 12: "insula"}
    write_vertex_labels(tmp_path / "a.label.gii", labels, regions, "CortexLeft")
    back, names = read_vertex_labels(tmp_path / "a.label.gii")
    # the label of no region is none of the names
    assert (back.tolist(), names) == (labels.tolist(), regions)
    for name, intent, structure in (
        ("a.shape.gii", "NIFTI_INTENT_SHAPE", "CortexRight"),
        ("a.label.gii", "NIFTI_INTENT_LABEL", "CortexLeft"),
    ):
        image = nib.load(tmp_path / name)
        assert intent_codes.niistring[image.darrays[0].intent] == intent
        assert image.meta["AnatomicalStructurePrimary"] == structure


def test_maps_of_hemispheres_are_joined_with_each_value_at_its_vertex(tmp_path):
    meshes = moved(BALL, -60.0), BALL
    surfaces = [tmp_path / name for name in ("left.surf.gii", "right.ply")]
    maps = [tmp_path / name for name in ("a.shape.gii", "b.shape.gii")]
    for surface, path, mesh in zip(surfaces, maps, meshes, strict=True):
        write_surface(surface, mesh)
        write_vertex_maps(path, {"x": mesh.vertices[:, 0]})
    whole, values = read_surface_maps(maps, surfaces)
    x = np.concatenate([mesh.vertices[:, 0] for mesh in meshes])
    assert values == pytest.approx(x, abs=1e-5)
    assert whole.vertices[:, 0] == pytest.approx(x, abs=1e-5)
    assert (whole.faces == np.vstack([BALL.faces, BALL.faces + 162])).all()


@pytest.mark.parametrize(
    ("counts", "surface", "facts"),
    [
        ([100], "ball.surf.gii", ["a.gii", 100, 162, "ball.surf.gii"]),
        ([162, 162], "ball.surf.gii", ["a.gii", "NIFTI_INTENT_SHAPE", "(162,)"]),
        ([162], "ball.stl", ["ball.stl:", "GIFTI"]),
        (None, "ball.surf.gii", ["a.gii", "NIFTI_INTENT_TRIANGLE", "(320, 3)"]),
    ],
)
def test_what_is_no_map_of_a_surface_is_refused(tmp_path, counts, surface, facts):
    write_surface(tmp_path / surface, BALL)
    write_surface(tmp_path / "a.gii", BALL)
    if counts:
        arrays = [
            GiftiDataArray(np.ones(count, np.float32), intent="NIFTI_INTENT_SHAPE")
            for count in counts
        ]
        nib.save(GiftiImage(darrays=arrays), tmp_path / "a.gii")
    with pytest.raises(InputError, check=Facts(*facts)):
        read_surface_maps([tmp_path / "a.gii"], [tmp_path / surface])


@pytest.mark.parametrize(
    ("arrays", "found"),
    [
        ([np.array([1.0, 2.5], np.float32)], ""),
        ([np.array([1, 2], np.int32)] * 2, "(2,), (2,)"),
    ],
)
def test_what_is_no_array_of_labels_is_refused(tmp_path, arrays, found):
    image = GiftiImage(darrays=[GiftiDataArray(array) for array in arrays])
    nib.save(image, tmp_path / "a.gii")
    with pytest.raises(InputError, check=Facts(tmp_path / "a.gii", found)):
        read_vertex_labels(tmp_path / "a.gii")
