"""Surfaces, and maps and labels at their vertices: what is written comes back, what is
broken is named."""

import nibabel as nib
import numpy as np
import pytest
from facts import Facts
from nibabel.freesurfer.io import write_geometry
from nibabel.gifti import GiftiCoordSystem, GiftiDataArray, GiftiImage
from nibabel.nifti1 import intent_codes
from shapes import moved, sphere

from gyriflow.errors import InputError
from gyriflow.io.surfaces import (
    read_hemispheres,
    read_surface,
    read_surface_map,
    read_surface_maps,
    read_vertex_labels,
    read_vertex_maps,
    surface_space_structure,
    write_surface,
    write_vertex_labels,
    write_vertex_maps,
)


@pytest.fixture
def ball():
    return sphere(10.0, 2, (30.0, -20.0, 5.0))


def gifti(path, vertices, faces):
    points = GiftiDataArray(vertices.astype(np.float32), intent="NIFTI_INTENT_POINTSET")
    triangles = GiftiDataArray(
        faces.astype(np.int32),
        intent="NIFTI_INTENT_TRIANGLE",
        datatype="NIFTI_TYPE_INT32",
    )
    nib.save(GiftiImage(darrays=[points, triangles]), path)
    return path


TURN = np.array([[0, -1, 0, 7], [1, 0, 0, 8], [0, 0, 1, 9], [0, 0, 0, 1.0]])
SCALE = np.diag([1.16, 1.16, 1.16, 1.0])
NAMES = dict(
    enumerate(("UNKNOWN", "SCANNER_ANAT", "ALIGNED_ANAT", "TALAIRACH", "MNI_152"))
)
U, SCANNER, ALIGNED, TALAIRACH, MNI = NAMES


def in_spaces(path, ball, *systems):
    """Write a surface whose points have one coordinate system or several, as (data
    space, space, matrix)."""
    gifti(path, ball.vertices, ball.faces)
    blocks = "".join(
        "<CoordinateSystemTransformMatrix>"
        f"<DataSpace><![CDATA[NIFTI_XFORM_{NAMES[data]}]]></DataSpace>"
        f"<TransformedSpace><![CDATA[NIFTI_XFORM_{NAMES[to]}]]></TransformedSpace>"
        f"<MatrixData>{' '.join(map(str, matrix.ravel()))}</MatrixData>"
        "</CoordinateSystemTransformMatrix>"
        for data, to, matrix in systems
    )
    head, points, *rest = path.read_text().split("<DataArray")
    before, data = points.split("<Data>", 1)
    before = before.split("<CoordinateSystemTransformMatrix")[0]
    path.write_text("<DataArray".join([head, f"{before}{blocks}<Data>{data}", *rest]))
    return path


@pytest.mark.parametrize("to", [SCANNER, ALIGNED])
def test_rigid_matrix_into_scanner_space_is_applied(tmp_path, ball, to):
    back, space, _ = surface_space_structure(
        in_spaces(tmp_path / "a.gii", ball, (U, to, TURN))
    )
    assert back.vertices == pytest.approx(
        ball.vertices @ TURN[:3, :3].T + TURN[:3, 3], abs=1e-3
    )
    assert space == f"NIFTI_XFORM_{NAMES[to]}"


@pytest.mark.parametrize(
    ("systems", "facts", "expected"),
    [
        ([(U, TALAIRACH, SCALE)], ["NIFTI_XFORM_TALAIRACH", 1.16], None),
        ([(U, MNI, SCALE)], ["NIFTI_XFORM_MNI_152", 1.16], None),
        ([(U, U, TURN)], ["NIFTI_XFORM_UNKNOWN", 1], None),
        ([(SCANNER, U, TURN)], ["NIFTI_XFORM_UNKNOWN"], "NIFTI_XFORM_SCANNER_ANAT"),
        (
            [(SCANNER, TALAIRACH, SCALE)],
            ["NIFTI_XFORM_TALAIRACH"],
            "NIFTI_XFORM_SCANNER_ANAT",
        ),
    ],
)
def test_other_matrices_leave_the_coordinates_and_that_is_said(
    tmp_path, ball, caplog, systems, facts, expected
):
    back, space, _ = surface_space_structure(
        in_spaces(tmp_path / "a.gii", ball, *systems)
    )
    assert back.vertices == pytest.approx(ball.vertices, abs=1e-4)
    assert caplog.messages == [Facts(tmp_path / "a.gii", *facts, expected or "")]
    assert space == expected


@pytest.mark.parametrize("matrix", [SCALE, np.diag([-1.0, 1, 1, 1])])
def test_matrix_into_scanner_space_that_is_not_rigid_is_refused(tmp_path, ball, matrix):
    with pytest.raises(
        InputError, check=Facts("a.gii", "NIFTI_XFORM_SCANNER_ANAT", matrix[0, 0])
    ):
        read_surface(in_spaces(tmp_path / "a.gii", ball, (U, SCANNER, matrix)))


@pytest.mark.parametrize(
    ("system", "centre", "said"),
    [
        ((U, TALAIRACH, np.eye(4)), (5.3, -17.0, 6.0), True),
        ((U, U, np.eye(4)), (5.3, -17.0, 6.0), True),
        ((U, U, np.eye(4)), (0.0, 0.0, 0.0), False),
        ((SCANNER, SCANNER, np.eye(4)), (5.3, -17.0, 6.0), False),
        ((U, SCANNER, TURN), (5.3, -17.0, 6.0), False),
    ],
)
def test_coordinates_that_may_be_relative_to_freesurfers_volume_are_reported(
    tmp_path, ball, caplog, system, centre, said
):
    image = nib.load(gifti(tmp_path / "lh.pial.surf.gii", ball.vertices, ball.faces))
    image.darrays[0].coordsys = GiftiCoordSystem(*system)
    # as mris_convert writes the centre of its volume, with the points
    for axis, place in zip("RAS", centre, strict=True):
        image.darrays[0].meta[f"VolGeomC_{axis}"] = f"{place:.6f}"
    nib.save(image, tmp_path / "lh.pial.surf.gii")
    read_surface(tmp_path / "lh.pial.surf.gii")
    assert ("C_RAS" in caplog.text) == ("(5.3, -17, 6) mm" in caplog.text) == said


AXES = {
    "xras": [0.0, -1.0, 0.0],
    "yras": [0.0, 0.0, -1.0],
    "zras": [-1.0, 0.0, 0.0],
    "cras": [5.0, 6.0, 7.0],
}


def volume(**changed):
    shape = {
        "head": [2, 0, 20],
        "valid": "1  # volume info valid",
        "filename": "orig.mgz",
        "volume": [256] * 3,
    }
    return shape | {"voxelsize": [1.0, 1.0, 1.0]} | AXES | changed


def test_freesurfer_surface_is_brought_to_scanner_space(tmp_path, ball):
    write_geometry(
        tmp_path / "lh.pial", ball.vertices, ball.faces, volume_info=volume()
    )
    back, space, structure = surface_space_structure(tmp_path / "lh.pial")
    # Norig inv(Torig) of surfer.nmr.mgh.harvard.edu/fswiki/CoordinateSystems, voxels of
    # 1 mm
    torig = np.array(
        [[-1, 0, 0, 128], [0, 0, 1, -128], [0, -1, 0, 128], [0, 0, 0, 1.0]]
    )
    norig = np.eye(4)
    norig[:3, :3] = np.column_stack([AXES["xras"], AXES["yras"], AXES["zras"]])
    norig[:3, 3] = np.array(AXES["cras"]) - norig[:3, :3] @ np.full(3, 128.0)
    matrix = norig @ np.linalg.inv(torig)
    assert back.vertices == pytest.approx(
        ball.vertices @ matrix[:3, :3].T + matrix[:3, 3], abs=1e-3
    )
    assert (space, structure) == ("NIFTI_XFORM_SCANNER_ANAT", "CortexLeft")


def test_a_file_of_the_other_hemisphere_is_refused(tmp_path, ball, caplog):
    write_surface(tmp_path / "a.surf.gii", ball, "CortexRight")
    write_geometry(
        tmp_path / "rh.pial", ball.vertices, ball.faces, volume_info=volume()
    )
    for name in ("a.surf.gii", "rh.pial"):
        assert len(read_surface(tmp_path / name, "right").faces) == len(ball.faces)
        with pytest.raises(
            InputError,
            check=Facts(f"{name}:", "CortexRight", "CortexLeft", "left", "right"),
        ):
            read_surface(tmp_path / name, "left")
    # the matrix of a file is told once
    files = [
        in_spaces(tmp_path / name, mesh, (U, SCANNER, TURN))
        for name, mesh in (("b.gii", ball), ("c.gii", moved(ball, 30.0)))
    ]
    assert read_hemispheres(*files)[2]
    assert caplog.messages == [
        Facts(file, "NIFTI_XFORM_SCANNER_ANAT") for file in files
    ]
    write_surface(tmp_path / "d.stl", moved(ball, 30.0))
    assert not read_hemispheres(files[0], tmp_path / "d.stl")[2]


@pytest.mark.parametrize("scanner", [True, False])
def test_a_freesurfer_surface_that_is_marked_as_in_scanner_space_stays_there(
    tmp_path, ball, caplog, scanner
):
    write_geometry(
        tmp_path / "lh.pial", ball.vertices, ball.faces, volume_info=volume()
    )
    content = (tmp_path / "lh.pial").read_bytes()
    tag = b"\0\0\0\2\0\0\0\0\0\0\0\x14"
    assert tag in content
    (tmp_path / "lh.pial").write_bytes(
        content.replace(tag, b"\0\0\0\2\0\0\0\1\0\0\0\x14") if scanner else content
    )
    back, space, _ = surface_space_structure(tmp_path / "lh.pial")
    assert space == "NIFTI_XFORM_SCANNER_ANAT"
    assert (np.abs(back.vertices - ball.vertices).max() < 1e-3) == scanner
    assert caplog.messages == []


@pytest.mark.parametrize(
    "name",
    ["sub-01_hemi-R_pial.surf.gii", "rh.pial.stl", "case.R.pial.ply", "right.gii"],
)
def test_a_side_in_a_name_counts_where_the_file_has_none(tmp_path, ball, name):
    write_surface(tmp_path / name, ball)
    assert len(read_surface(tmp_path / name, "right").faces) == len(ball.faces)
    with pytest.raises(
        InputError, check=Facts(f"{name}:", "CortexRight", "CortexLeft")
    ):
        read_surface(tmp_path / name, "left")
    write_surface(tmp_path / "right.surf.gii", ball, "CortexLeft")
    assert read_surface(tmp_path / "right.surf.gii", "left")


def test_maps_and_labels_of_the_other_hemisphere_are_refused(tmp_path, ball):
    for side, structure in (("left", "CortexLeft"), ("right", "CortexRight")):
        write_surface(tmp_path / f"{side}.surf.gii", ball, structure)
        write_vertex_maps(
            tmp_path / f"a{side}.gii", {"x": ball.vertices[:, 0]}, structure
        )
        write_vertex_labels(
            tmp_path / f"{side}.label.gii", np.ones(162, int), {1: "frontal"}, structure
        )
    write_surface(tmp_path / "unnamed.ply", ball)
    left = tmp_path / "aleft.gii"
    right = tmp_path / "aright.gii"
    surfaces = [tmp_path / "left.surf.gii"]
    read_surface_map(left, surfaces[0])
    read_surface_map(right, tmp_path / "unnamed.ply")
    facts = Facts("CortexLeft", "CortexRight")
    with pytest.raises(InputError, check=facts):
        read_surface_map(right, surfaces[0])
    with pytest.raises(InputError, check=facts):
        read_surface_map(right, tmp_path / "unnamed.ply", "left")
    # two are left and right
    with pytest.raises(InputError, check=facts):
        read_surface_maps(
            [right, left], [tmp_path / "right.surf.gii", tmp_path / "left.surf.gii"]
        )
    assert len(read_vertex_labels(tmp_path / "left.label.gii", "left")[0]) == 162
    with pytest.raises(InputError, check=facts):
        read_vertex_labels(tmp_path / "left.label.gii", "right")


def test_one_surface_is_not_both_hemispheres(tmp_path, ball):
    left, copy, other = (tmp_path / f"{name}.surf.gii" for name in "abc")
    write_surface(left, ball)
    write_surface(copy, ball)
    write_surface(other, moved(ball, 40.0))
    for right in (left, copy):
        with pytest.raises(InputError, check=Facts(left, right, "same surface")):
            read_hemispheres(left, right)
    assert read_hemispheres(left, other)[2]


def test_hemispheres_whose_files_name_different_spaces_are_reported(
    tmp_path, ball, caplog
):
    files = [
        in_spaces(tmp_path / "a.gii", ball, (U, SCANNER, TURN)),
        tmp_path / "b.ply",
    ]
    write_surface(files[1], ball)
    assert not read_hemispheres(*files)[2]
    assert caplog.messages[1:] == [
        Facts(*files, "NIFTI_XFORM_SCANNER_ANAT", "no space")
    ]


def legacy(path, ball, order, kind="f4"):
    """Write a surface as MRtrix does (order "<") or as VTK does (">")."""
    count = len(ball.faces)
    cells = np.column_stack([np.full(len(ball.faces), 3), ball.faces]).astype(
        f"{order}i4"
    )
    name = {"f4": "float", "f8": "double"}[kind]
    head = (
        "# vtk DataFile Version 1.0\nmesh\nBINARY\nDATASET POLYDATA\n"
        f"POINTS {len(ball.vertices)} {name}\n"
    )
    points = ball.vertices.astype(order + kind).tobytes()
    path.write_bytes(
        head.encode()
        + points
        + f"POLYGONS {count} {4 * count}\n".encode()
        + cells.tobytes()
    )
    return path


@pytest.mark.parametrize("kind", ["f4", "f8"])
@pytest.mark.parametrize("order", ["<", ">"])
def test_vtk_files_in_either_byte_order_are_read(tmp_path, ball, order, kind):
    back = read_surface(legacy(tmp_path / "a.vtk", ball, order, kind))
    assert back.vertices == pytest.approx(ball.vertices, abs=1e-5)
    assert (back.faces == ball.faces).all()


def test_a_file_that_crashes_vtk_is_refused(tmp_path, ball):
    content = bytearray(legacy(tmp_path / "a.vtk", ball, ">").read_bytes())
    place = content.index(b"\n", content.index(b"POLYGONS")) + 1
    content[place : place + 4] = (10**9).to_bytes(4, "big")
    (tmp_path / "a.vtk").write_bytes(bytes(content))
    with pytest.raises(InputError, check=Facts("a.vtk:")):
        read_surface(tmp_path / "a.vtk")


def test_vertices_that_are_no_places_and_faces_beyond_the_vertices_are_refused(
    tmp_path, ball
):
    vertices = ball.vertices.copy()
    vertices[3:5, 1] = np.nan
    for points, faces, facts in (
        (vertices, ball.faces, [2]),
        (ball.vertices, ball.faces + 1, [1, 162, 0, 161]),
    ):
        with pytest.raises(InputError, check=Facts(tmp_path / "a.gii", *facts)):
            read_surface(gifti(tmp_path / "a.gii", points, faces))


def test_named_maps_come_back_and_are_what_workbench_calls_metric_files(tmp_path):
    maps = {"shape_index": np.linspace(-1, 1, 50), "curvedness": np.arange(50)}
    write_vertex_maps(tmp_path / "a.shape.gii", maps, "CortexRight")
    back = read_vertex_maps(tmp_path / "a.shape.gii")
    image = nib.load(tmp_path / "a.shape.gii")
    assert list(back) == list(maps)
    assert image.meta["AnatomicalStructurePrimary"] == "CortexRight"
    for (name, values), array in zip(maps.items(), image.darrays, strict=True):
        assert back[name] == pytest.approx(values, abs=1e-6)
        assert intent_codes.niistring[array.intent] == "NIFTI_INTENT_SHAPE"


def test_labels_and_names_come_back(tmp_path):
    path = tmp_path / "left.label.gii"
    labels = np.array([0, 3, 3, 12])
    write_vertex_labels(path, labels, {3: "frontal", 12: "insula"}, "CortexLeft")
    found, names = read_vertex_labels(path)
    assert found.tolist() == labels.tolist()
    # the label of no region is none of the names
    assert names == {3: "frontal", 12: "insula"}
    assert nib.load(path).meta["AnatomicalStructurePrimary"] == "CortexLeft"


@pytest.mark.parametrize("name", ["ball.surf.gii", "ball.ply", "ball.obj", "ball.off"])
def test_maps_of_hemispheres_stand_side_by_side_each_value_at_its_vertex(
    tmp_path, ball, name
):
    left = moved(ball, -60.0)
    paths = [tmp_path / "a.shape.gii", tmp_path / "b.shape.gii"]
    surfaces = [tmp_path / "left.surf.gii", tmp_path / name]
    for path, file, mesh in zip(paths, surfaces, (left, ball), strict=True):
        write_surface(file, mesh)
        write_vertex_maps(path, {"x": mesh.vertices[:, 0]})
    surface, values = read_surface_maps(paths, surfaces)
    assert values == pytest.approx(
        np.concatenate([left.vertices[:, 0], ball.vertices[:, 0]]), abs=1e-5
    )
    assert surface.vertices[:, 0] == pytest.approx(values, abs=1e-5)
    assert np.array_equal(
        surface.faces[len(ball.faces) :], ball.faces + len(ball.vertices)
    )


@pytest.mark.parametrize(
    ("name", "counts", "surface", "facts"),
    [
        ("a.shape.gii", [100], "ball.surf.gii", [100, 162, "ball.surf.gii"]),
        ("a.func.gii", [], "ball.surf.gii", [".func.gii"]),
        ("a.func.gii", [162, 162], "ball.surf.gii", ["NIFTI_INTENT_SHAPE", "(162,)"]),
        ("a.shape.gii", [162], "ball.stl", ["ball.stl:", "GIFTI"]),
        (
            "ball.surf.gii",
            None,
            "ball.surf.gii",
            ["NIFTI_INTENT_TRIANGLE", "(162, 3)", "(320, 3)"],
        ),
    ],
)
def test_what_is_no_map_of_a_surface_is_refused(
    tmp_path, ball, name, counts, surface, facts
):
    write_surface(tmp_path / surface, ball)
    if counts is not None:
        arrays = [
            GiftiDataArray(np.ones(count, np.float32), intent="NIFTI_INTENT_SHAPE")
            for count in counts
        ]
        nib.save(GiftiImage(darrays=arrays), tmp_path / name)
    with pytest.raises(InputError, check=Facts(tmp_path / name, *facts)):
        read_surface_map(tmp_path / name, tmp_path / surface)


@pytest.mark.parametrize(
    ("arrays", "found"),
    [
        ([np.array([1.0, 2.5], np.float32)], ""),
        ([np.array([1, 2], np.int32)] * 2, "(2,), (2,)"),
    ],
)
def test_what_is_no_array_of_labels_is_refused(tmp_path, arrays, found):
    nib.save(
        GiftiImage(darrays=[GiftiDataArray(array) for array in arrays]),
        tmp_path / "a.gii",
    )
    with pytest.raises(InputError, check=Facts(tmp_path / "a.gii", found)):
        read_vertex_labels(tmp_path / "a.gii")
