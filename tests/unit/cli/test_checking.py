"""What `gyriflow check` says of input files, of the mesh and of what a study takes, and
what it leaves behind."""

import os
import re
import tempfile
from pathlib import Path

import nibabel as nib
import numpy as np
import pytest
import yaml
from atlas_brains import atlas_halves
from configurations import LABELLED, labelled, resolved
from facts import Facts
from shapes import hemisphere, inner, moved

from gyriflow.anatomy.plausible import expected_volume_ml
from gyriflow.cli import check as checking
from gyriflow.cli.check import (
    check_study,
    coarse_cortices,
    export_problems,
    input_problems,
    plan,
    work_of,
)
from gyriflow.errors import InputError
from gyriflow.geometry.alignment import MIRROR
from gyriflow.geometry.triangles import TriangleMesh, transformed
from gyriflow.io.files import write_json
from gyriflow.io.surfaces import write_surface, write_vertex_labels, write_vertex_maps
from gyriflow.io.volumes import LabelVolume, write_label_volume
from gyriflow.running.cost import (
    DEEP_FOLDS_FACTOR,
    ERROR_FACTOR,
    MIN_SURFACE_MIB,
    PREDICTION_SECONDS,
    PREDICTION_SECONDS_PER_ELEMENT_AND_WEEK,
    SECONDS_PER_ELEMENT_AND_STEP,
    SECONDS_PER_ML,
    SERIES_SECONDS_PER_ELEMENT_AND_WEEK,
    SHAPES_SECONDS_PER_ELEMENT_AND_STEP,
    START_SECONDS,
    job_limits,
    job_seconds,
    linear_elements,
    simulation_needs,
    surface_memory_mib,
)
from gyriflow.running.status import format_duration
from gyriflow.settings.stages import MeshSettings
from gyriflow.settings.terms import ELEMENTS_NEEDED, element_error, is_too_coarse
from gyriflow.shipped import SHIPPED
from gyriflow.study import resolve
from gyriflow.study.loading import load

STUDY = {
    "brains": [{"id": "a", "week": 21, "shape": {"semi_axes_mm": [20, 20, 20]}}],
    "start": "a",
    "mesh": {
        "mesher": "tetgen",
        "order": 1,
        "surface_edge_mm": 0.67,
        "core_edge_mm": 4.0,
    },
    "folding": {"end_week": 25, "step_s": 86400, "ranks": 1},
}


def problems(folder, **keys):
    brain = {"id": "a", "week": 23} | keys
    config = load(
        {"brains": [brain], "start": "a", "folding": {"end_week": brain["week"] + 3}},
        folder,
    )
    return [text for _, text, bad in input_problems(config) if bad]


def test_the_labels_of_one_hemisphere_are_read_as_labels(tmp_path):
    # a block of white matter with cortex on one side only
    labels = np.zeros((20, 20, 20), np.int32)
    labels[4:16, 4:16, 4:16] = 1
    labels[4:6, 4:16, 4:16] = 5
    write_label_volume(tmp_path / "l.nii.gz", LabelVolume(labels, np.eye(4)))
    labels[0, 0, 0] = 99
    write_label_volume(tmp_path / "unknown.nii.gz", LabelVolume(labels, np.eye(4)))
    scheme = "spina-bifida-atlas"
    # its wall towards the side that is not there may have no cortex
    assert problems(tmp_path, labels="l.nii.gz", side="left", scheme=scheme) == []
    assert problems(tmp_path, labels="l.nii.gz", scheme=scheme)[0] == Facts(
        scheme, "cortex", "32 %", "50 %"
    )
    found = problems(tmp_path, labels="unknown.nii.gz", side="left", scheme=scheme)
    assert found == [Facts(scheme, "99 among 1, 5, 99")]


def test_the_surface_of_one_hemisphere_is_of_its_side(tmp_path):
    write_surface(tmp_path / "r.surf.gii", hemisphere(1), "CortexRight")
    assert problems(tmp_path, pial="r.surf.gii", side="right") == []
    found = problems(tmp_path, pial="r.surf.gii", side="left")
    assert found == [Facts(tmp_path / "r.surf.gii", "CortexRight", "CortexLeft")]


def test_white_surfaces_outside_their_pial_ones_are_refused_before_a_run(tmp_path):
    pial = hemisphere(-1), hemisphere(1)
    for n, mesh in enumerate(pial):
        write_surface(tmp_path / f"pial{n}.surf.gii", mesh)
        write_surface(tmp_path / f"white{n}.surf.gii", inner(mesh, 1.5))
        write_surface(tmp_path / f"shifted{n}.surf.gii", moved(inner(mesh, 1.5), 6.0))
    brain = {
        "hemispheres": {"left": "pial0.surf.gii", "right": "pial1.surf.gii"},
        "coordinates": "ras",
    }

    def found(*names):
        return problems(tmp_path, **brain, white=[f"{name}.surf.gii" for name in names])

    assert found("white0", "white1") == []
    outside = Facts("white surface (left)", "100 %", "swapped")
    assert found("white1", "white0") == [outside]
    assert found("white1", "white1") == [outside]
    # as where FreeSurfer's centre of the volume was added to one of them
    assert found("shifted0", "shifted1") == [
        Facts("white surface (left)", "coordinates")
    ]


def checked(folder, monkeypatch, **keys):
    """Return the lines of check on a configuration of a pair of hemispheres of 23 GW,
    and those that are problems."""
    monkeypatch.setattr(checking, "work_of", lambda *_: iter(()))
    for side, sign in (("left", -1), ("right", 1)):
        if not (folder / f"{side}.surf.gii").exists():
            write_surface(
                folder / f"{side}.surf.gii", hemisphere(sign), f"Cortex{side.title()}"
            )
    pair = {side: f"{side}.surf.gii" for side in ("left", "right")}
    brain = {
        "id": "sub-1",
        "week": 23,
        "hemispheres": pair,
        "coordinates": "ras",
    } | keys.pop("brain", {})
    config = {
        "brains": [brain],
        "start": "sub-1",
        "folding": {"end_week": 25} | keys.pop("folding", {}),
        **keys,
    }
    (folder / "study.yaml").write_text(yaml.safe_dump(config))
    lines = list(check_study(folder / "study.yaml", folder, 1))
    return [line for line, _ in lines], [line for line, bad in lines if bad]


def test_every_file_is_reported_with_its_size_side_and_number_of_vertices(
    tmp_path, monkeypatch
):
    count = len(hemisphere(1).vertices)
    write_vertex_maps(
        tmp_path / "thick.shape.gii", {"t": np.full(count, 2.5)}, "CortexLeft"
    )
    mapped = {
        "map": ["thick.shape.gii", "right.shape.gii"],
        "surface": ["left.surf.gii", "right.surf.gii"],
    }
    write_vertex_maps(
        tmp_path / "right.shape.gii", {"t": np.full(count, 1.5)}, "CortexRight"
    )
    write_label_volume(
        tmp_path / "regions.nii.gz",
        LabelVolume(np.ones((4, 5, 6), np.int32), np.diag([2, 1, 0.5, 1])),
    )
    regions = {"sub-1": {"labels": "regions.nii.gz", "names": {1: "a"}}}
    lines, bad = checked(
        tmp_path,
        monkeypatch,
        folding={"thickness_mm": mapped},
        metrics={"regions": regions},
    )
    assert bad == []
    assert Facts("left.surf.gii", count, "mm", "left", "scanner_anat") in lines
    assert Facts("thick.shape.gii", count, 2.5, "left") in lines
    assert Facts("regions.nii.gz", "4 x 5 x 6", "2 x 1 x 0.5 mm") in lines


def test_a_surface_in_the_space_of_a_template_is_doubted_once(tmp_path, monkeypatch):
    for side, sign in (("left", -1), ("right", 1)):
        path = tmp_path / f"{side}.surf.gii"
        write_surface(path, hemisphere(sign), f"Cortex{side.title()}")
        image = nib.load(path)
        for array in image.darrays:
            array.coordsys.dataspace = array.coordsys.xformspace = (
                nib.nifti1.xform_codes["talairach"]
            )
        nib.save(image, path)
    lines, bad = checked(tmp_path, monkeypatch)
    assert bad == []
    assert [line for line in lines if "warning:" in line and "talairach" in line] == [
        Facts("brain sub-1", tmp_path / f"{side}.surf.gii", "talairach")
        for side in ("left", "right")
    ]
    assert lines[-2].split()[-1] == "warning"


def test_a_warning_of_a_reader_is_that_of_its_brain_and_comes_once(
    tmp_path, monkeypatch, caplog
):
    for side, sign in (("left", -1), ("right", 1)):
        write_surface(
            tmp_path / f"{side}.surf.gii", hemisphere(sign), f"Cortex{side.title()}"
        )
    image = nib.load(tmp_path / "left.surf.gii")
    for array in image.darrays:
        array.coordsys.dataspace = 0
        array.coordsys.xformspace = nib.nifti1.xform_codes["talairach"]
        array.coordsys.xform = np.diag([1.2, 1.2, 1.2, 1.0])
    nib.save(image, tmp_path / "left.surf.gii")
    lines, _ = checked(tmp_path, monkeypatch)
    warning = Facts("warning: brain sub-1:", "1.2", tmp_path / "left.surf.gii")
    assert lines.count(warning) == 1
    assert lines[-2].split()[-1] == "warning"
    assert not caplog.records


@pytest.mark.parametrize(
    ("metres", "facts"),
    [(1e-3, [0.0025, "metres"]), (1e3, [2500, "micrometres"]), (0.0, ["thickness"])],
)
def test_a_thickness_map_in_another_unit_is_refused(
    tmp_path, monkeypatch, metres, facts
):
    count = len(hemisphere(1).vertices)
    write_vertex_maps(tmp_path / "thick.shape.gii", {"t": np.full(count, 2.5 * metres)})
    mapped = {"map": "thick.shape.gii", "surface": "left.surf.gii"}
    _, bad = checked(tmp_path, monkeypatch, folding={"thickness_mm": mapped})
    assert bad == [Facts("thickness_mm", tmp_path / "thick.shape.gii", *facts)]
    # a map that a curve multiplies
    if metres:
        curve = {"weeks": {22: 0.5 / metres, 24: 1.5 / metres}}
        assert (
            checked(tmp_path, monkeypatch, folding={"thickness_mm": mapped | curve})[1]
            == []
        )


def test_files_of_regions_and_white_surfaces_are_opened(tmp_path, monkeypatch):
    count = len(hemisphere(1).vertices)
    for side, structure, number in (
        ("l", "CortexLeft", count),
        ("r", "CortexRight", count - 1),
    ):
        write_vertex_labels(
            tmp_path / f"{side}.label.gii", np.ones(number, int), {1: "a"}, structure
        )
    given = {
        "labels": ["l.label.gii", "r.label.gii"],
        "surface": ["left.surf.gii", "right.surf.gii"],
    }
    _, bad = checked(tmp_path, monkeypatch, metrics={"regions": {"sub-1": given}})
    assert bad == [
        Facts("regions of sub-1", tmp_path / "r.label.gii", count, count - 1)
    ]
    given["labels"] = ["r.label.gii", "r.label.gii"]
    _, bad = checked(tmp_path, monkeypatch, metrics={"regions": {"sub-1": given}})
    assert bad == [Facts("r.label.gii", "CortexRight", "CortexLeft")]
    (tmp_path / "white.surf.gii").write_text("torn")
    _, bad = checked(
        tmp_path, monkeypatch, brain={"white": ["white.surf.gii", "white.surf.gii"]}
    )
    assert bad == [Facts("brain sub-1", tmp_path / "white.surf.gii")]


@pytest.mark.parametrize("scale", [1e-3, 10.0])
def test_surfaces_in_other_units_are_refused_before_a_run(tmp_path, monkeypatch, scale):
    for side, sign in (("left", -1), ("right", 1)):
        mesh = hemisphere(sign)
        write_surface(
            tmp_path / f"{side}.surf.gii",
            TriangleMesh(mesh.vertices * scale, mesh.faces),
        )
    _, bad = checked(tmp_path, monkeypatch)
    assert bad == [Facts("brain sub-1", "metres" if scale < 1 else 23)]


def test_mirrored_hemispheres_are_refused_before_a_run(tmp_path, monkeypatch):
    for side, half in zip(("left", "right"), atlas_halves(), strict=True):
        write_surface(tmp_path / f"{side}.surf.gii", transformed(half, MIRROR))
    _, bad = checked(tmp_path, monkeypatch, brain={"week": 24})
    assert bad == [
        Facts("brain sub-1", "coordinates: auto", "do not swap `left` and `right`")
    ]
    _, bad = checked(tmp_path, monkeypatch, brain={"week": 24, "coordinates": "auto"})
    assert bad == [Facts("brain sub-1", "exchanged", "mirrored", "RAS", "LAS")]


def test_subjects_that_would_be_one_in_the_export_are_reported_before_a_run():
    scans = [
        {**brain, "subject": name}
        for brain, name in zip(labelled(21, 22), ("1-12", "11-2"), strict=True)
    ]
    assert list(export_problems(resolved(scans))) == [Facts("sub-112", "1-12", "11-2")]
    assert list(export_problems(resolved(labelled(21, 22)))) == []


def test_files_named_as_of_another_subject_or_space_are_reported(tmp_path, monkeypatch):
    name = "sub-2_space-MNI152_hemi-L_pial.surf.gii"
    write_surface(tmp_path / name, hemisphere(-1))
    lines, bad = checked(
        tmp_path,
        monkeypatch,
        brain={"hemispheres": {"left": name, "right": "right.surf.gii"}},
    )
    assert bad == []
    doubts = [line for line in lines if "warning: brain" in line and name in line]
    assert doubts == [Facts(name, "sub-2"), Facts(name, "MNI152")]


@pytest.mark.parametrize(
    ("mm", "doubts"), [(1.0, [(Facts("%", 38), False)]), (1.7, [])]
)
def test_a_size_that_is_not_that_of_the_week_is_reported(tmp_path, mm, doubts):
    write_label_volume(
        tmp_path / "l.nii.gz",
        LabelVolume(np.ones((45, 45, 40), np.int32), mm * np.eye(4)),
    )
    brain = {"id": "a", "week": 38, "labels": "l.nii.gz", "scheme": "binary"}
    config = load(
        {"brains": [brain], "start": "a", "folding": {"end_week": 39}}, tmp_path
    )
    assert [(text, bad) for _, text, bad in input_problems(config)] == doubts


def test_labels_that_lie_as_those_of_another_scheme_are_refused():
    labels = "fetal_SB_atlas_GA28_operated/parcellation.nii.gz"
    said = problems(
        SHIPPED / "atlases" / "spina-bifida", week=28, labels=labels, scheme="dhcp-19"
    )
    assert said[0] == Facts(labels, "spina-bifida-atlas", "dhcp-19", "49%")
    assert (
        problems(
            SHIPPED / "atlases" / "spina-bifida",
            week=28,
            labels=labels,
            scheme="spina-bifida-atlas",
        )
        == []
    )


def test_a_header_without_a_unit_is_reported_once_and_is_no_warning(
    tmp_path, monkeypatch, caplog
):
    monkeypatch.setattr(checking, "work_of", lambda *_: iter(()))
    for name, unit in (("a", "unknown"), ("b", "unknown"), ("c", "mm")):
        image = nib.Nifti1Image(np.ones((45, 45, 40), np.uint8), 1.7 * np.eye(4))
        image.header.set_xyzt_units(unit)
        nib.save(image, tmp_path / f"{name}.nii")
    brains = [
        {"id": name, "week": 38, "labels": f"{name}.nii", "scheme": "binary"}
        for name in "abc"
    ]
    text = yaml.safe_dump({"brains": brains, "start": "a", "folding": {"end_week": 39}})
    (tmp_path / "gyriflow.yaml").write_text(text)
    lines = [line for line, _ in check_study(tmp_path / "gyriflow.yaml", tmp_path, 1)]
    without = [line for line in lines if "no unit given" in str(line)]
    assert without == [Facts("a.nii"), Facts("b.nii")]
    assert [record for record in caplog.records if record.levelname == "WARNING"] == []


def coarse(mesh, **folding):
    return list(
        coarse_cortices(
            resolved(labelled(23), mesh=mesh, folding={"end_week": 24} | folding)
        )
    )


def test_a_mesh_too_coarse_for_the_cortex_is_reported_before_it_is_made():
    fine = {"surface_edge_mm": 0.7}
    assert coarse(fine | {"order": 1}, thickness_mm=1.0) == [
        Facts(1.4, 2, "32 %", "mesh.surface_edge_mm: 0.47")
    ]
    assert coarse(fine, thickness_mm=1.5) == []
    assert (
        "mesh.surface_edge_mm: 0.48"
        in coarse(fine, thickness_mm={"weeks": {22: 0.5, 24: 1.5}})[0]
    )


def test_growth_without_layers_needs_no_elements_through_the_cortex():
    coarse_mesh = {"surface_edge_mm": 1.2, "order": 1}
    for growth, warnings in (("rates", 1), ("sizes", 1), ("shapes", 0)):
        folding = {"end_week": 24, "growth": growth}
        study = resolved(labelled(22, 23, 24), mesh=coarse_mesh, folding=folding)
        assert len(list(coarse_cortices(study))) == warnings


def test_as_many_elements_as_needed_are_never_called_too_few():
    verdicts = set()
    for edge_mm in np.linspace(0.47, 0.53, 13):
        (text,) = coarse({"surface_edge_mm": edge_mm, "order": 1}, thickness_mm=1.0)
        found = float(re.search(r"about (\S+) linear", text).group(1))
        assert ("fewer than the 2 needed" in text) == (found < 2), edge_mm
        verdicts.add(found < 2)
    assert verdicts == {True, False}


@pytest.mark.parametrize(
    ("edge_mm", "facts"),
    [
        (0.47, ["2 linear", "32 %", "4 %", "mesh.order: 2"]),
        (0.235, ["4 linear", "13 %"]),
        (0.12, None),
    ],
)
def test_linear_elements_that_are_enough_are_reported_with_their_error(edge_mm, facts):
    found = coarse({"surface_edge_mm": edge_mm, "order": 1}, thickness_mm=1.0)
    assert found == ([Facts(*facts)] if facts else [])


@pytest.fixture
def config(tmp_path):
    """The configuration of one brain."""
    path = tmp_path / "a.yaml"
    path.write_text(yaml.safe_dump(STUDY))
    return path


def test_a_look_leaves_nothing_behind(tmp_path, config):
    assert plan(config, tmp_path / "new" / "study", ["surface"])
    ((said, _),) = work_of(config, tmp_path / "new" / "study", 1, ["calibrate"])
    assert not any(character.isdigit() for character in said)
    assert [path.name for path in tmp_path.iterdir()] == ["a.yaml"]


def test_the_exit_code_of_an_earlier_process_with_the_same_number_does_not_count(
    tmp_path, config
):
    Path(tempfile.gettempdir(), f"gyriflow-exit-{os.getpid()}").write_text("3")
    assert plan(config, tmp_path / "new", ["surface"])


@pytest.mark.parametrize("directory", ["", "/proc/self", "a.yaml/below"])
def test_a_look_needs_no_folder_to_write_in(tmp_path, config, directory):
    (tmp_path / ".snakemake").touch()
    assert plan(config, tmp_path / directory, ["surface"])


def test_a_study_is_checked_from_its_working_directory(tmp_path):
    folder = tmp_path / "l'étude 100% {wk} #1"
    folder.mkdir()
    write_label_volume(
        folder / "l.nii.gz",
        LabelVolume(np.ones((45, 45, 40), np.int32), 1.7 * np.eye(4)),
    )
    (folder / "gyriflow.yaml").write_text(
        "brains: [{id: a, week: 38, labels: l.nii.gz, scheme: binary}]\n"
    )
    lines = list(check_study(folder / "gyriflow.yaml", folder, 1, ["surface"]))
    assert "to run: 1 step" in [line for line, _ in lines]
    assert not any(bad for _, bad in lines)
    # the path of its labels from elsewhere has braces
    with pytest.raises(
        InputError, check=Facts("brains[0].labels", folder / "l.nii.gz")
    ):
        list(check_study(folder / "gyriflow.yaml", tmp_path, 1, ["surface"]))


@pytest.mark.parametrize(
    ("week", "mesher", "edge", "core", "elements"),
    [
        (21, "tetgen", 0.67, 4.0, 156_307),
        (21, "pytetwild", 0.72, 2.5, 463_621),
        (22, "tetgen", 1.6, 5.0, 31_232),
    ],
)
def test_a_mesh_has_about_as_many_elements_as_those_that_were_made(
    week, mesher, edge, core, elements
):
    mesh = MeshSettings(mesher=mesher, surface_edge_mm=edge, core_edge_mm=core)
    assert elements / 1.5 < linear_elements(week, mesh) < 1.5 * elements


def reference(raw):
    """Return the simulation of the run `reference` and the settings of its mesh."""
    study = resolve(load(raw))
    return study.simulations["reference", "a"], study.config.mesh


@pytest.mark.parametrize(
    ("order", "elements", "steps", "seconds"),
    [
        # `reference` of the demo and of a brain over nine weeks, half a brain
        (1, 129_958, 28, 24),
        (1, 498_358, 126, 331),
        (1, 215_812, 72, 67),
        # the twelve of the paper, in all
        (1, 470_220, 1071, 1747),
        # the same half, by 27 k and 45 k elements
        (2, 217_000, 72, 186),
        (2, 360_000, 72, 344),
    ],
)
def test_a_folding_takes_as_long_as_measured_ones_within_the_error(
    order, elements, steps, seconds
):
    predicted = SECONDS_PER_ELEMENT_AND_STEP[order] * elements * steps
    assert seconds / 1.6 < predicted < 1.6 * seconds
    assert ERROR_FACTOR > 1.6


def test_the_limits_of_a_job_are_what_is_predicted_with_its_error():
    # a small one has what every job needs
    asked = reference(STUDY)
    assert job_limits(*asked) == (2000, 60)
    asked = reference(STUDY | {"folding": {"end_week": 40, "step_s": 600, "ranks": 4}})
    needs = simulation_needs(*asked)
    assert job_limits(*asked) == pytest.approx(
        (2 * needs.memory_mib, 2 * needs.seconds / 4 / 60), abs=1
    )


def test_the_time_and_work_of_a_study_are_those_of_its_foldings_and_other_steps(
    tmp_path, monkeypatch
):
    study = resolve(
        load(
            STUDY
            | {
                "runs": {
                    "reference": {},
                    "long": {"end_week": 33, "step_s": 3600, "ranks": 2},
                }
            }
        )
    )
    long, short = (
        simulation_needs(study.simulations[run, "a"], study.config.mesh)
        for run in ("long", "reference")
    )
    planned = [
        ("simulate", {"run": "long", "brain": "a"}, 2),
        ("simulate", {"run": "reference", "brain": "a"}, 1),
    ]
    planned += [("measure", {}, 1)] * 7
    jobs = [checking.PlannedJob(*job, "Missing output files: x") for job in planned]
    monkeypatch.setattr(checking, "plan", lambda *_, **__: jobs)
    folding_s = long.seconds + short.seconds + 2 * START_SECONDS
    work_s = folding_s + 7 * START_SECONDS
    for cores, seconds in (
        (1, work_s),
        (3, max(work_s / 3, (long.seconds + START_SECONDS) / 2)),
    ):
        lines = [
            line for line, _ in work_of(tmp_path / "x.yaml", tmp_path, cores, [], study)
        ]
        assert lines[:2] == [
            "to run: 9 steps",
            "  Missing output files: simulate×2, measure×7",
        ]
        assert f"time    about {format_duration(seconds)} on {cores} core" in lines[2]
        assert lines[3] == Facts(
            f"{work_s / 3600:.2g} core hours",
            f"{(long.seconds + short.seconds) / work_s:.0%}",
        )
        # the two largest of the foldings that run at the same time
        memory = (
            long.memory_mib if cores == 1 else max(long.memory_mib, short.memory_mib)
        )
        assert lines[4] == Facts("memory", f"{memory / 1024:.1f} GB")


def test_a_prediction_takes_the_time_of_its_atlas_path_its_shapes_and_its_folding(
    tmp_path, monkeypatch
):
    weeks = (22, 24, 25, 27, 30, 34)
    atlas = [
        {"id": f"x{week}", "week": week, "population": "x", **LABELLED}
        for week in weeks
    ]
    brains = [{"id": "a", "week": 23, "population": "a", **LABELLED}, *atlas]
    expected = {"preset": "expected", "end_week": 25}
    growth = {"brains": {"x": [f"x{week}" for week in weeks]}}
    study = resolve(
        load(
            STUDY
            | {
                "brains": brains,
                "folding": expected,
                "growth": growth,
                "runs": {"p": {}},
            }
        )
    )
    mesh, reason = study.config.mesh, "Missing output files: x"
    made = "results/brains/x22/path/shapes.h5", "results/brains/a/mesh/targets.atlas.h5"
    needed = ["results/brains/x22/path/brain.xdmf"]
    path = checking.PlannedJob(
        "atlas_path", {"brain": "x22"}, 1, reason, needed, made[:1]
    )
    kept = checking.PlannedJob("kept_path", {"brain": "x22"}, 1, reason, [], made[:1])
    targets = checking.PlannedJob(
        "predicted_targets",
        {"brain": "a", "origin": "atlas"},
        1,
        reason,
        ["x.xdmf", *made[:1]],
        made[1:],
    )
    folding = checking.PlannedJob(
        "simulate", {"run": "p", "brain": "a"}, 2, reason, made[1:]
    )
    simulation = study.simulations["p", "a"]
    steps = 2 * 7 * 86400 / simulation.settings.step_s
    folding_s = (
        START_SECONDS
        + SHAPES_SECONDS_PER_ELEMENT_AND_STEP[mesh.order]
        * linear_elements(23, mesh)
        * steps
    )
    assert simulation_needs(simulation, mesh).seconds == pytest.approx(
        folding_s - START_SECONDS
    )
    # the path has 12 weeks, two of them after 32 GW; the prediction ends at the second
    # week at or past the end
    per_week_s = SERIES_SECONDS_PER_ELEMENT_AND_WEEK * linear_elements(
        22, study.config.growth.path_mesh
    )
    path_s = START_SECONDS + per_week_s * (10 + 2 * DEEP_FOLDS_FACTOR)
    following_s = (
        PREDICTION_SECONDS_PER_ELEMENT_AND_WEEK * linear_elements(23, mesh) * (27 - 23)
    )
    targets_s = START_SECONDS + PREDICTION_SECONDS + following_s
    for jobs, cores, seconds in (
        ([path, targets, folding], 1, path_s + targets_s + folding_s),
        ([path, targets, folding], 2, path_s + targets_s + folding_s / 2),
        ([kept, targets, folding], 2, START_SECONDS + targets_s + folding_s / 2),
        ([targets, folding], 1, targets_s + folding_s),
    ):
        monkeypatch.setattr(checking, "plan", lambda *_, jobs=jobs, **__: jobs)
        lines = [
            line for line, _ in work_of(tmp_path / "x.yaml", tmp_path, cores, [], study)
        ]
        assert next(line for line in lines if line.startswith("time")) == Facts(
            format_duration(seconds), cores
        )
        on_path = [line for line in lines if "path of" in line]
        if jobs[0] is path:
            assert on_path == [Facts("x22", "has to be made", format_duration(path_s))]
        else:
            assert ["kept" in line for line in on_path] == [True] * (len(jobs) - 2)
    # of its own series, all weeks of it
    measured = {
        "start": "x22",
        "folding": {"preset": "measured", "end_week": 30},
        "growth": growth,
    }
    own = resolve(load(STUDY | {"brains": brains} | measured))
    jobs = [
        checking.PlannedJob("targets", {"brain": "x22", "origin": "self"}, 1, reason)
    ]
    monkeypatch.setattr(checking, "plan", lambda *_, **__: jobs)
    lines = [line for line, _ in work_of(tmp_path / "x.yaml", tmp_path, 1, [], own)]
    own_s = (
        START_SECONDS
        + SERIES_SECONDS_PER_ELEMENT_AND_WEEK * linear_elements(22, mesh) * 8
    )
    assert lines[2] == Facts(f"about {format_duration(own_s)} on")


def test_stages_of_a_brain_take_time_by_its_size(tmp_path):
    config = {
        "brains": [
            {"id": "a", "week": 24, **LABELLED},
            {"id": "b", "week": 34, **LABELLED},
        ]
    }
    study = resolve(load(config | {"surface": {"edge_length_mm": 1.0}}))
    sizes = [expected_volume_ml(week) for week in (24, 34)]
    seconds = {}
    for rule in ("pial_with_thickness", "measure"):
        seconds[rule] = [
            job_seconds(study, rule, {"brain": brain}) - START_SECONDS for brain in "ab"
        ]
    assert seconds["pial_with_thickness"] == pytest.approx(
        [SECONDS_PER_ML["pial"] * size for size in sizes]
    )
    # the area of the surface grows by 0.74 of the volume, and by the banks of sulci
    # that are opened
    ratio = seconds["measure"][1] / seconds["measure"][0]
    assert ratio == pytest.approx((sizes[1] / sizes[0]) ** 0.74 * (1 + 0.11 * 9))
    fused = resolve(
        load(config | {"surface": {"edge_length_mm": 1.0, "open_sulci": False}})
    )
    fused_s = job_seconds(fused, "measure", {"brain": "b"}) - START_SECONDS
    assert fused_s == pytest.approx(seconds["measure"][1] / (1 + 0.11 * 9))
    fused_s = job_seconds(fused, "pial_with_thickness", {"brain": "b"}) - START_SECONDS
    assert fused_s < 0.6 * seconds["pial_with_thickness"][1]
    fine = resolve(load(config | {"surface": {"edge_length_mm": 0.5}}))
    fine_s = job_seconds(fine, "measure", {"brain": "a"}) - START_SECONDS
    assert fine_s == pytest.approx(4 * seconds["measure"][0])
    # a registration by the later of two brains; a simulated brain by its mesh
    registered_s = (
        job_seconds(study, "register", {"earlier": "a", "later": "b"}) - START_SECONDS
    )
    assert registered_s == pytest.approx(SECONDS_PER_ML["register"] * sizes[1])
    simulated_s = (
        job_seconds(
            study, "measure_simulated", {"run": "r", "brain": "a", "week": "34.00"}
        )
        - START_SECONDS
    )
    assert simulated_s == pytest.approx(
        seconds["measure"][0] / study.config.mesh.surface_edge_mm**2
    )


def test_a_path_is_said_to_be_of_this_study_or_of_all_with_its_folder(
    tmp_path, monkeypatch
):
    jobs = [
        checking.PlannedJob(
            "atlas_path",
            {"brain": "spina-bifida-unoperated-22"},
            1,
            "Missing output files: x",
        )
    ]
    monkeypatch.setattr(checking, "plan", lambda *_, **__: jobs)
    prediction = {
        "brains": [{"id": "a", "week": 23, "population": "a", **LABELLED}],
        "start": "a",
    }
    prediction |= {"folding": {"preset": "expected", "end_week": 24}}
    atlas = {"name": "spina-bifida", "series": "unoperated", "weeks": [22, 23, 24]}
    in_study = {"folder": str(tmp_path / "study" / "atlas")}
    outside = {"folder": str(tmp_path / "atlas")}
    # by default in the working directory, which need not be the current folder
    for more, fact in (
        ({}, "this study only"),
        (in_study, "this study only"),
        (outside, tmp_path / "atlas"),
    ):
        study = resolve(load(prediction | {"atlas": atlas | more}))
        lines = [
            line
            for line, _ in work_of(
                tmp_path / "x.yaml", tmp_path / "study", 1, [], study
            )
        ]
        (line,) = [line for line in lines if line.startswith("path of")]
        assert line == Facts("path of spina-bifida", fact)


@pytest.mark.parametrize(
    ("reason", "words"),
    [
        ("Missing output files: a.csv, b.csv", "Missing output files"),
        (
            "Input files updated by another job: pial",
            "Input files updated by another job",
        ),
        ("changed input a b.nii.gz, c.nii", "changed input a b.nii.gz, c.nii"),
        ("changed code", "changed code (gyriflow 0.1, now 0.2)"),
        ("changed settings weeks", "changed settings weeks"),
    ],
)
def test_why_a_step_runs_is_said_in_words(tmp_path, monkeypatch, reason, words):
    monkeypatch.setattr(checking, "version", lambda: "0.2")
    write_json(tmp_path / "results" / "report" / "provenance.json", {"gyriflow": "0.1"})
    monkeypatch.setattr(
        checking, "plan", lambda *_, **__: [checking.PlannedJob("rule", {}, 1, reason)]
    )
    assert [
        line for line, _ in work_of(tmp_path, tmp_path, 1, [], resolve(load(STUDY)))
    ][1] == f"  {words}: rule"


@pytest.mark.parametrize("order", [1, 2])
def test_a_number_of_elements_as_shown_is_not_fewer_than_itself(order):
    for elements in np.linspace(0.8, 1.2, 401) * ELEMENTS_NEEDED[order]:
        shown = float(element_error(order, elements)[1].split()[0])
        assert is_too_coarse(order, elements) == (shown < ELEMENTS_NEEDED[order])


def test_the_memory_of_a_surface_follows_the_header(tmp_path):
    for name, edge, size in (
        ("usual", 0.8, 100),
        ("fine", 0.25, 320),
        ("padded", 0.8, 512),
    ):
        affine = np.diag([edge] * 3 + [1.0])
        image = nib.Nifti1Image(np.zeros((1, 1, 1), dtype=np.uint8), affine)
        image.header.set_xyzt_units("mm")
        image.header.set_data_shape((size,) * 3)
        # voxels that take no room on the disk
        with (tmp_path / f"{name}.nii").open("wb") as file:
            image.header.write_to(file)
            file.truncate(352 + size**3)
    usual, fine, padded = (
        surface_memory_mib(str(tmp_path / f"{n}.nii"), 25.0)
        for n in ("usual", "fine", "padded")
    )
    assert (
        usual == surface_memory_mib(str(tmp_path / "none.nii"), 25.0) == MIN_SURFACE_MIB
    )
    assert fine > 1.2 * MIN_SURFACE_MIB
    assert padded < fine
