"""What `gyriflow check` says of input files and of the mesh, and what it leaves
behind."""

import nibabel as nib
import numpy as np
import pytest
import yaml
from atlas_brains import atlas_halves
from configurations import labelled
from facts import Facts
from shapes import hemisphere, inner, moved, phantom, save_labels

from gyriflow.cli import check as checking
from gyriflow.cli import check as module
from gyriflow.cli.check import check_study, work_of
from gyriflow.errors import InputError
from gyriflow.geometry.alignment import MIRROR
from gyriflow.geometry.triangles import transformed
from gyriflow.io.surfaces import write_surface, write_vertex_labels, write_vertex_maps
from gyriflow.io.volumes import LabelVolume, write_label_volume
from gyriflow.settings.terms import ELEMENTS_NEEDED, element_error, is_too_coarse

SIDES = {"left": -1, "right": 1}
N_VERTICES = len(hemisphere(1).vertices)


def write_labels(path, labels, affine):
    write_label_volume(path, LabelVolume(labels.astype(np.int32), np.asarray(affine)))


def write_hemispheres(folder, change=lambda mesh: mesh):
    for side, sign in SIDES.items():
        structure = f"Cortex{side.title()}"
        path = folder / f"{side}.surf.gii"
        write_surface(path, change(hemisphere(sign)), structure)


@pytest.fixture
def check(tmp_path, monkeypatch):
    """Return the lines of check on a configuration of some brains, the first of which
    is folded, and those that are problems."""
    monkeypatch.setattr(checking, "work_of", lambda *_: iter(()))

    def lines(*brains, **keys):
        first = brains[0]
        config = {"start": first["id"], "folding": {"end_week": first["week"] + 2}}
        config |= {"brains": list(brains)} | keys
        (tmp_path / "study.yaml").write_text(yaml.safe_dump(config))
        found = list(check_study(tmp_path / "study.yaml", tmp_path, 1))
        return [line for line, _ in found], [line for line, bad in found if bad]

    return lines


@pytest.fixture
def refusals(check):
    """Return the problems of the files of a brain."""
    return lambda **keys: check({"id": "a", "week": 23} | keys)[1]


def warnings(lines):
    return [line for line in lines if "warning:" in line]


PAIR = {
    "id": "sub-1",
    "week": 23,
    "hemispheres": {"left": "left.surf.gii", "right": "right.surf.gii"},
    "coordinates": "ras",
}


def test_the_labels_of_one_hemisphere_are_read_as_labels(tmp_path, refusals):
    # a block of white matter with cortex on one side only
    labels = np.zeros((20, 20, 20))
    labels[4:16, 4:16, 4:16] = 1
    labels[4:6, 4:16, 4:16] = 5
    write_labels(tmp_path / "l.nii.gz", labels, np.eye(4))
    labels[0, 0, 0] = 99
    write_labels(tmp_path / "unknown.nii.gz", labels, np.eye(4))
    scheme = "spina-bifida-atlas"
    # its wall towards the side that is not there may have no cortex
    assert refusals(labels="l.nii.gz", side="left", scheme=scheme) == []
    found = refusals(labels="l.nii.gz", scheme=scheme)
    assert found[0] == Facts(scheme, "cortex", "32 %", "50 %")
    found = refusals(labels="unknown.nii.gz", side="left", scheme=scheme)
    assert found == [Facts(scheme, "99 among 1, 5, 99")]


RIGHT = {"pial": "right.surf.gii"}
OUTSIDE = "white surface (left)"


@pytest.mark.parametrize(
    ("scale", "brain", "facts"),
    [
        (1.0, RIGHT | {"side": "right"}, None),
        (1.0, RIGHT | {"side": "left"}, ["right.surf.gii", "CortexRight"]),
        (1.0, PAIR | {"white": ["white0.ply", "white1.ply"]}, None),
        (1.0, PAIR | {"white": ["white1.ply", "white0.ply"]}, [OUTSIDE, "swapped"]),
        # as where FreeSurfer's centre of the volume was added to one of them
        (1.0, PAIR | {"white": ["far0.ply", "far1.ply"]}, [OUTSIDE, "coordinates"]),
        (1e-3, PAIR, ["brain sub-1", "metres"]),
        (10.0, PAIR, ["brain sub-1", 23]),
    ],
)
def test_surfaces_of_another_side_place_or_unit_are_refused(
    tmp_path, refusals, scale, brain, facts
):
    matrix = np.diag([scale, scale, scale, 1.0])
    write_hemispheres(tmp_path, lambda mesh: transformed(mesh, matrix))
    for number, sign in enumerate(SIDES.values()):
        white = inner(hemisphere(sign), 1.5)
        write_surface(tmp_path / f"white{number}.ply", white)
        write_surface(tmp_path / f"far{number}.ply", moved(white, 6.0))
    assert refusals(**brain) == ([Facts(*facts)] if facts else [])


def test_labels_that_lie_as_those_of_another_scheme_are_refused(tmp_path, refusals):
    save_labels(tmp_path / "l.nii.gz", *phantom(24.0, 2.0))
    found = refusals(labels="l.nii.gz", scheme="dhcp-19")
    assert found[0] == Facts("l.nii.gz", "spina-bifida-atlas", "dhcp-19")


@pytest.mark.parametrize(
    ("mm", "facts"), [(1.0, [Facts("%", 38)]), (1.7, [])], ids=["small", "usual"]
)
def test_a_size_that_is_not_that_of_the_week_is_doubted(tmp_path, check, mm, facts):
    write_labels(tmp_path / "l.nii.gz", np.ones((45, 45, 40)), mm * np.eye(4))
    brain = {"id": "a", "week": 38, "labels": "l.nii.gz", "scheme": "binary"}
    lines, bad = check(brain)
    assert bad == []
    assert [line for line in warnings(lines) if "brain a" in line] == facts


def test_every_file_is_reported_with_its_size_side_and_number_of_vertices(
    tmp_path, check, caplog
):
    write_hemispheres(tmp_path)
    for side, thickness in (("left", 2.5), ("right", 1.5)):
        maps = {"t": np.full(N_VERTICES, thickness)}
        path = tmp_path / f"{side}.shape.gii"
        write_vertex_maps(path, maps, f"Cortex{side.title()}")
    # without a unit, which is no warning
    regions = nib.Nifti1Image(np.ones((4, 5, 6), np.uint8), np.diag([2, 1, 0.5, 1]))
    nib.save(regions, tmp_path / "regions.nii.gz")
    mapped = {
        "map": ["left.shape.gii", "right.shape.gii"],
        "surface": ["left.surf.gii", "right.surf.gii"],
    }
    regions = {"sub-1": {"labels": "regions.nii.gz", "names": {1: "a"}}}
    folding = {"end_week": 25, "thickness_mm": mapped}
    lines, bad = check(PAIR, folding=folding, metrics={"regions": regions})
    assert bad == []
    assert Facts("left.surf.gii", N_VERTICES, "mm", "left", "scanner_anat") in lines
    assert Facts("left.shape.gii", N_VERTICES, 2.5, "left") in lines
    size = "4 x 5 x 6", "2 x 1 x 0.5 mm"
    assert Facts("regions.nii.gz", *size, "no unit given") in lines
    assert caplog.records == []


def with_space(path, data, to, matrix):
    """Write the coordinate system of a surface: its space, another one, and the matrix
    to that."""
    image = nib.load(path)
    codes = [nib.nifti1.xform_codes[space] for space in (data, to)]
    for array in image.darrays:
        array.coordsys = nib.gifti.GiftiCoordSystem(*codes, matrix)
    nib.save(image, path)


@pytest.mark.parametrize(
    ("data", "scale", "facts"),
    [("talairach", 1.0, ["talairach"]), ("unknown", 1.2, ["1.2"])],
    ids=["a template's space", "a warning of the reader"],
)
def test_a_doubt_about_a_surface_is_that_of_its_brain_and_comes_once(
    tmp_path, check, caplog, data, scale, facts
):
    write_hemispheres(tmp_path)
    matrix = np.diag([scale, scale, scale, 1.0])
    for side in SIDES:
        with_space(tmp_path / f"{side}.surf.gii", data, "talairach", matrix)
    lines, bad = check(PAIR)
    assert bad == []
    found = [line for line in warnings(lines) if "surf.gii" in line]
    assert found == [
        Facts("warning: brain sub-1:", tmp_path / f"{side}.surf.gii", *facts)
        for side in SIDES
    ]
    assert lines[-2].split()[-1] == "warning"
    assert not caplog.records


@pytest.mark.parametrize(
    ("metres", "facts"),
    [(1e-3, [0.0025, "metres"]), (1e3, [2500, "micrometres"]), (0.0, ["thickness"])],
)
def test_a_thickness_map_in_another_unit_is_refused(tmp_path, check, metres, facts):
    write_hemispheres(tmp_path)
    path = tmp_path / "thick.shape.gii"
    write_vertex_maps(path, {"t": np.full(N_VERTICES, 2.5 * metres)})
    mapped = {"map": path.name, "surface": "left.surf.gii"}
    folding = {"end_week": 25, "thickness_mm": mapped}
    _, bad = check(PAIR, folding=folding)
    assert bad == [Facts("thickness_mm", path, *facts)]
    # a map that a curve multiplies
    if metres:
        mapped["weeks"] = {22: 0.5 / metres, 24: 1.5 / metres}
        assert check(PAIR, folding=folding)[1] == []


def test_files_of_regions_and_white_surfaces_are_opened(tmp_path, check):
    write_hemispheres(tmp_path)
    for side, number in (("left", N_VERTICES), ("right", N_VERTICES - 1)):
        path = tmp_path / f"{side}.label.gii"
        labels = np.ones(number, int)
        write_vertex_labels(path, labels, {1: "a"}, f"Cortex{side.title()}")
    surfaces = ["left.surf.gii", "right.surf.gii"]
    for labels, facts in (
        (["left", "right"], [N_VERTICES, N_VERTICES - 1]),
        (["right", "right"], ["CortexRight", "CortexLeft"]),
    ):
        files = [f"{side}.label.gii" for side in labels]
        regions = {"sub-1": {"labels": files, "surface": surfaces}}
        _, bad = check(PAIR, metrics={"regions": regions})
        right = tmp_path / "right.label.gii"
        assert bad == [Facts("regions of sub-1", right, *facts)]
    (tmp_path / "white.surf.gii").write_text("torn")
    white = {"white": ["white.surf.gii", "white.surf.gii"]}
    _, bad = check(PAIR | white)
    assert bad == [Facts("brain sub-1", tmp_path / "white.surf.gii")]


@pytest.mark.parametrize(
    ("coordinates", "facts"),
    [
        ("ras", ["coordinates: auto", "do not swap `left` and `right`"]),
        ("auto", ["exchanged", "mirrored", "RAS", "LAS"]),
    ],
)
def test_mirrored_hemispheres_are_refused(tmp_path, check, coordinates, facts):
    for side, half in zip(SIDES, atlas_halves(), strict=True):
        write_surface(tmp_path / f"{side}.surf.gii", transformed(half, MIRROR))
    _, bad = check(PAIR | {"week": 24, "coordinates": coordinates})
    assert bad == [Facts("brain sub-1", *facts)]


def test_the_first_line_counts_brains_simulations_and_members(check):
    vary = {"thickness_mm": [1.0, 2.0, 3.0]}
    sweep = {"base": "run1", "vary": vary, "compare_week": 24}
    runs = {f"run{number}": {} for number in range(1, 8)}
    lines, _ = check(*labelled(23, 24), runs=runs, sweeps={"thick": sweep})
    assert lines[0] == Facts("2 brains", 7, "run1", "run6, …", "3 of sweep thick")


def test_subjects_that_would_be_one_in_the_export_are_reported(check):
    first, second = labelled(21, 22)
    assert not [line for line in check(first, second)[0] if "no export" in line]
    lines, _ = check(first | {"subject": "1-12"}, second | {"subject": "11-2"})
    assert Facts("warning: no export", "sub-112", "1-12", "11-2") in lines


def test_files_named_as_of_another_subject_or_space_are_reported(tmp_path, check):
    write_hemispheres(tmp_path)
    name = "sub-2_space-MNI152_hemi-L_pial.surf.gii"
    write_surface(tmp_path / name, hemisphere(-1))
    pair = {"hemispheres": {"left": name, "right": "right.surf.gii"}}
    lines, bad = check(PAIR | pair)
    assert bad == []
    found = [line for line in warnings(lines) if name in line]
    assert found == [Facts(name, "sub-2"), Facts(name, "MNI152")]


def advice(lines):
    """Return the warnings on the mesh."""
    return [line for line in warnings(lines) if "mesh." in line]


@pytest.mark.parametrize(
    ("edge_mm", "order", "thickness_mm", "facts"),
    [
        (0.7, 1, 1.0, [1.4, 2, "32 %", "mesh.surface_edge_mm: 0.47"]),
        (0.7, 2, 1.5, None),
        (0.7, 2, {"weeks": {22: 0.5, 24: 1.5}}, ["mesh.surface_edge_mm: 0.48"]),
        # enough, with an error that quadratic ones do not have
        (0.47, 1, 1.0, ["2 linear", "32 %", "4 %", "mesh.order: 2"]),
        (0.235, 1, 1.0, ["4 linear", "13 %"]),
        (0.12, 1, 1.0, None),
    ],
)
def test_a_mesh_too_coarse_for_the_cortex_is_reported(
    check, edge_mm, order, thickness_mm, facts
):
    mesh = {"surface_edge_mm": edge_mm, "order": order}
    folding = {"end_week": 24, "thickness_mm": thickness_mm}
    lines, _ = check(*labelled(23), mesh=mesh, folding=folding)
    assert advice(lines) == ([Facts(*facts)] if facts else [])


@pytest.mark.parametrize(("growth", "n"), [("rates", 1), ("sizes", 1), ("shapes", 0)])
def test_growth_without_layers_needs_no_elements_through_the_cortex(check, growth, n):
    mesh = {"surface_edge_mm": 1.2, "order": 1}
    folding = {"end_week": 24, "growth": growth}
    lines, _ = check(*labelled(22, 23, 24), mesh=mesh, folding=folding)
    assert len(advice(lines)) == n


@pytest.mark.parametrize(
    ("order", "end_week", "is_warned_of"),
    [(2, 34, True), (2, 30, False), (1, 34, False)],
)
def test_quadratic_elements_are_warned_of_on_the_way_to_deep_folds(
    check, order, end_week, is_warned_of
):
    folding = {"end_week": end_week, "growth": "shapes"}
    lines, _ = check(*labelled(25, 30, 34), mesh={"order": order}, folding=folding)
    facts = Facts("run reference from a", "mesh.order: 1")
    assert advice(lines) == ([facts] if is_warned_of else [])


@pytest.mark.parametrize("order", [1, 2])
def test_a_number_of_elements_as_shown_is_not_fewer_than_itself(order):
    for elements in np.linspace(0.8, 1.2, 401) * ELEMENTS_NEEDED[order]:
        shown = float(element_error(order, elements)[1].split()[0])
        assert is_too_coarse(order, elements) == (shown < ELEMENTS_NEEDED[order])


@pytest.fixture
def config(tmp_path):
    """The configuration of one brain."""
    brain = {"id": "a", "week": 21, "shape": {"semi_axes_mm": [20, 20, 20]}}
    study = {"brains": [brain], "start": "a", "folding": {"end_week": 25}}
    (tmp_path / "a.yaml").write_text(yaml.safe_dump(study))
    return tmp_path / "a.yaml"


def test_a_look_leaves_nothing_behind(tmp_path, config):
    ((said, _),) = work_of(config, tmp_path / "new" / "study", 1, ["calibrate"])
    assert not any(character.isdigit() for character in said)
    assert [path.name for path in tmp_path.iterdir()] == ["a.yaml"]


@pytest.mark.parametrize("directory", ["", "/proc/self"])
def test_a_look_needs_no_folder_to_write_in(tmp_path, config, directory):
    (tmp_path / ".snakemake").touch()
    assert module._plan(config, tmp_path / directory, ["surface"])


def test_a_study_is_checked_from_its_working_directory(tmp_path):
    folder = tmp_path / "l'étude 100% {wk} #1"
    folder.mkdir()
    write_labels(folder / "l.nii.gz", np.ones((45, 45, 40)), 1.7 * np.eye(4))
    (folder / "gyriflow.yaml").write_text(
        "brains: [{id: a, week: 38, labels: l.nii.gz, scheme: binary}]\n"
    )
    lines = list(check_study(folder / "gyriflow.yaml", folder, 1, ["surface"]))
    assert ("to run: 1 step", False) in lines
    assert not any(bad for _, bad in lines)
    # the path of its labels from elsewhere has braces
    facts = Facts("brains[0].labels", folder / "l.nii.gz")
    with pytest.raises(InputError, check=facts):
        list(check_study(folder / "gyriflow.yaml", tmp_path, 1, ["surface"]))
