"""Scans, ages and files of folders as public data sets and pipelines have them, and
files that cannot be used."""

import pytest
from facts import Facts
from scan_trees import make_tree
from shapes import cerebrum_surface, phantom

from gyriflow.cli.recognition import recognise
from gyriflow.errors import InputError
from gyriflow.io.surfaces import write_surface


def both(*patterns):
    """Return the paths of both sides, L and R or lh and rh for @."""
    paths = []
    for pattern in patterns:
        sides = ("lh", "rh") if "/@." in pattern else ("L", "R")
        paths += [pattern.replace("@", side) for side in sides]
    return paths


def brains(folder, **options):
    """Return week, files and causes of each scan by id."""
    found = recognise(folder, **options).brains
    return {
        brain.entry["id"]: (brain.entry["week"], brain.files, " ".join(brain.causes))
        for brain in found
    }


TABLE = "participants.tsv"
KEEP_ONE = Facts("2 files", "keep one")
FETA = "sub-026/anat/sub-026_rec-mial_dseg.nii.gz"
DHCP = "derivatives/dhcp/sub-CC00856XX15/ses-3530/anat/sub-CC00856XX15_ses-3530"
DHCP_SESSIONS = "sub-CC00856XX15/sub-CC00856XX15_sessions.tsv"
FETPYPE = "derivatives/nesvor_bounti/sub-01/ses-01/anat/sub-01_ses-01_dseg.nii.gz"
NIBABIES = "derivatives/nibabies/sub-01/ses-1/anat/sub-01_ses-1"
HCP = "100307/T1w/Native/100307.@.{}.native.surf.gii"
DATA_SETS = {
    "FeTA": (
        {
            "labels": [FETA],
            "text": {TABLE: "participant_id\tGestational age\nsub-026\t23.3"},
        },
        {"sub-026": (23.3, FETA, "")},
    ),
    # several kinds of one scan are asked for, with ages at the scan of sessions
    "dHCP": (
        {
            "labels": [f"{DHCP}_desc-drawem9_dseg.nii.gz"],
            "surfaces": both(f"{DHCP}_hemi-@_pial.surf.gii"),
            "tables": {
                TABLE: ["participant_id sex birth_age", "CC00856XX15 F 39.1"],
                DHCP_SESSIONS: ["session_id scan_age", "3530 29.71"],
            },
        },
        {
            "sub-CC00856XX15_ses-3530": (
                29.71,
                ", ".join(both(f"{DHCP}_hemi-@_pial.surf.gii")),
                KEEP_ONE,
            ),
            "sub-CC00856XX15_ses-3530-2": (
                29.71,
                f"{DHCP}_desc-drawem9_dseg.nii.gz",
                KEEP_ONE,
            ),
        },
    ),
    "fetpype": (
        {
            "labels": [FETPYPE],
            "tables": {TABLE: ["participant_id session_id ga", "sub-01 ses-01 24+3"]},
        },
        {"sub-01_ses-01": (24.43, FETPYPE, "")},
    ),
    # a template's space and meshes beside the subject's own
    "NiBabies": (
        {
            "labels": [f"{NIBABIES}_space-MNIInfant_cohort-1_dseg.nii.gz"],
            "surfaces": both(
                f"{NIBABIES}_hemi-@_pial.surf.gii",
                f"{NIBABIES}_hemi-@_white.surf.gii",
                f"{NIBABIES}_hemi-@_space-fsLR_den-32k_pial.surf.gii",
            ),
            "text": {f"{NIBABIES}_label-GM_probseg.nii.gz": "no labels"},
            "tables": {TABLE: ["participant_id pma", "sub-01 41.2"]},
        },
        {
            "sub-01_ses-1": (
                41.2,
                ", ".join(both(f"{NIBABIES}_hemi-@_pial.surf.gii")),
                "",
            )
        },
    ),
    # with its template
    "FreeSurfer": (
        {
            "surfaces": both(
                "subjects/sub-01/surf/@.pial",
                "subjects/sub-01/surf/@.pial.T1",
                "subjects/sub-01/surf/@.white",
                "subjects/sub-01/surf/@.sphere",
                "subjects/sub-02/surf/@.pial.T1",
                "subjects/fsaverage/surf/@.pial",
            ),
            "labels": [f"subjects/sub-01/mri/{name}aseg.mgz" for name in ("", "aparc")],
            "tables": {
                f"subjects/{TABLE}": ["participant_id week", "sub-01 36", "sub-02 37"]
            },
        },
        {
            "sub-01": (36.0, ", ".join(both("subjects/sub-01/surf/@.pial")), ""),
            "sub-02": (37.0, ", ".join(both("subjects/sub-02/surf/@.pial.T1")), ""),
        },
    ),
    # without sub-
    "Infant FreeSurfer": (
        {
            "surfaces": both("case7/surf/@.pial", "case8/surf/@.pial"),
            "labels": ["case7/mri/aseg.mgz"],
            "tables": {TABLE: ["participant_id week", "case7 36", "case8 37"]},
        },
        {
            "case7": (36.0, ", ".join(both("case7/surf/@.pial")), ""),
            "case8": (37.0, ", ".join(both("case8/surf/@.pial")), ""),
        },
    ),
    "HCP": (
        {
            "surfaces": both(
                HCP.format("pial"),
                HCP.format("white"),
                "100307/T1w/fsaverage_LR32k/100307.@.pial.32k_fs_LR.surf.gii",
                "100307/MNINonLinear/Native/100307.@.pial.native.surf.gii",
            ),
            "tables": {TABLE: ["participant_id week", "100307 36"]},
        },
        {"100307": (36.0, ", ".join(both(HCP.format("pial"))), "")},
    ),
    # a clone with and without contents
    "git-annex": (
        {
            "lost": ["sub-01_week24_dseg.nii.gz", *both("sub-02_week25/surf/@.pial")],
            "labels": ["sub-03_week26_dseg.nii.gz"],
        },
        {
            "sub-01": (
                24.0,
                "sub-01_week24_dseg.nii.gz",
                Facts("sub-01_week24_dseg.nii.gz"),
            ),
            "sub-02": (25.0, Facts("lh.pial"), Facts("lh.pial")),
            "sub-03": (26.0, "sub-03_week26_dseg.nii.gz", ""),
        },
    ),
}


@pytest.mark.parametrize(("contents", "expected"), DATA_SETS.values(), ids=DATA_SETS)
def test_a_data_set_is_read_as_it_is(tmp_path, contents, expected):
    assert brains(make_tree(tmp_path, **contents)) == expected


WEEK = "sub-01_week24"


@pytest.mark.parametrize(
    ("kind", "files", "facts"),
    [
        ("labels", [f"{WEEK}_space-MNI152NLin6Asym_dseg.nii.gz"], ["MNI152NLin6Asym"]),
        ("labels", [f"{WEEK}_space-dhcpSym_dseg.nii.gz"], ["dhcpSym"]),
        ("labels", [f"{WEEK}_space-T2w_dseg.nii.gz"], []),
        ("labels", [f"tpl-x/{WEEK}_dseg.nii.gz"], ["tpl-x"]),
        ("labels", [f"sub-02/{WEEK}_dseg.nii.gz"], ["sub-01", "sub-02"]),
        ("labels", ["week24/sub-mü_dseg.nii.gz"], ["sub-mü"]),
        ("torn", [f"{WEEK}_dseg.nii.gz"], [f"{WEEK}_dseg.nii.gz"]),
        ("surfaces", both(f"{WEEK}/@.white"), ["white", "pial"]),
        ("surfaces", [f"{WEEK}/lh.pial"], []),
        ("surfaces", [f"{WEEK}/lh.pial", f"{WEEK}/rh.sphere"], ["right", "rh.sphere"]),
        ("surfaces", [f"{WEEK}/lh.pial", f"{WEEK}/label/rh.a.annot"], ["rh.a.annot"]),
        ("surfaces", [*both(f"{WEEK}/@.pial"), f"{WEEK}/lh.white"], ["lh.white"]),
        ("surfaces", both(f"{WEEK}_hemi-@_space-fsLR_den-32k_pial.surf.gii"), []),
        # the second is a link to nowhere
        ("lost", [f"{WEEK}/lh.pial", f"{WEEK}/rh.pial"], ["rh.pial"]),
        (
            "lost",
            [*both(f"{WEEK}/@.pial"), f"{WEEK}/lh.white", f"{WEEK}/rh.white"],
            ["rh.white"],
        ),
    ],
)
def test_files_that_cannot_be_used_are_named(tmp_path, kind, files, facts):
    contents = {kind: files}
    if kind == "torn":
        contents = {"text": {files[0]: "no labels"}}
    elif kind == "lost":
        contents = {"surfaces": files[:-1], "lost": files[-1:]}
    ((_, _, cause),) = brains(make_tree(tmp_path, **contents)).values()
    assert cause == (Facts(*facts) if facts else "")


@pytest.mark.parametrize(
    ("files", "surfaces", "cause"),
    [
        # of one data set
        (["anat/sub-01_dseg.nii.gz"], "surf/sub-01_hemi-@_pial.surf.gii", KEEP_ONE),
        (["a/sub-01_dseg.nii.gz"], "b/sub-01_hemi-@_pial.surf.gii", KEEP_ONE),
        (["anat/sub-01_dseg.nii.gz", "seg/sub-01_desc-x_dseg.nii.gz"], "", KEEP_ONE),
        # of two
        (
            ["siteA/anat/sub-01_dseg.nii.gz", "siteB/anat/sub-01_dseg.nii.gz"],
            "",
            Facts("siteA", "siteB"),
        ),
    ],
)
def test_folders_of_kinds_of_data_are_not_data_sets(tmp_path, files, surfaces, cause):
    make_tree(tmp_path, labels=files, surfaces=both(surfaces) if surfaces else [])
    assert [found for _, _, found in brains(tmp_path).values()] == [cause] * 2


def test_a_resampled_surface_is_used_with_a_warning(tmp_path):
    make_tree(tmp_path, surfaces=both("sub-01_hemi-@_space-fsLR_den-32k_pial.surf.gii"))
    (brain,) = recognise(tmp_path).brains
    assert (len(brain.warnings), brain.problem) == (1, "")


def test_closed_surfaces_of_whole_brains_are_recognised(tmp_path):
    brain = cerebrum_surface(*phantom(24.0, 2.0))
    for name in ("24.stl", "week25.ply", "skull.stl"):
        write_surface(tmp_path / name, brain)
    write_surface(tmp_path / "nut.stl", type(brain)(0.1 * brain.vertices, brain.faces))
    assert brains(tmp_path) == {
        "week25": (25.0, "week25.ply", ""),
        "24": ("CHOOSE", "24.stl", Facts("week")),
    }
    assert recognise(tmp_path).unused == {"nut.stl": Facts("mL", 15, 700)}


@pytest.mark.parametrize(
    "files",
    [
        # sides in other folders, in another order of parts, as single letters
        ["sub-01/lh/lh.pial", "sub-01/rh/rh.pial"],
        ["sub-01_run-1_hemi-L_pial.surf.gii", "sub-01_hemi-R_run-1_pial.surf.gii"],
        ["sub-01_L.stl", "sub-01_R.stl"],
    ],
)
def test_both_sides_of_a_scan_are_found_wherever_they_are(tmp_path, files):
    (brain,) = recognise(make_tree(tmp_path, surfaces=files)).brains
    assert (brain.entry["id"], brain.problem) == ("sub-01", "")
    assert brain.entry["hemispheres"] == dict(
        zip(("left", "right"), files, strict=True)
    )


def test_a_torn_file_beside_a_good_one_and_other_meshes_are_not_chosen_between(
    tmp_path,
):
    torn = {"sub-01_desc-x_dseg.nii.gz": "torn", "sub-01_placenta.stl": "x"}
    make_tree(tmp_path, labels=["sub-01_dseg.nii.gz"], text=torn)
    first, _ = recognise(tmp_path).brains
    assert (first.entry["id"], first.problem) == ("sub-01", "")
    assert not [note for note in first.notes if "keep one" in note]


def test_links_to_folders_that_are_not_there_are_scans_that_cannot_be_read(tmp_path):
    make_tree(tmp_path, labels=["sub-01_week24_dseg.nii.gz"])
    (tmp_path / "sub-02").symlink_to("nowhere")
    assert brains(tmp_path)["sub-02"] == ("CHOOSE", "sub-02", Facts("link"))


def test_only_results_of_gyriflow_are_passed_over(tmp_path):
    own = "own/results/brains/a/week25_dseg.nii.gz"
    make_tree(
        tmp_path,
        labels=["results/week24_dseg.nii.gz", own],
        text={"own/results/study/study.json": "{}"},
    )
    assert list(brains(tmp_path)) == ["week24"]
    with pytest.raises(InputError, check=Facts(tmp_path / "own")):
        recognise(tmp_path / "own")


def test_labels_of_other_participants_are_not_read(tmp_path):
    torn = {"sub-02_week25_dseg.nii.gz": "torn"}
    make_tree(tmp_path, labels=["sub-01_week24_dseg.nii.gz"], text=torn)
    assert list(brains(tmp_path, participants=["01"])) == ["sub-01"]
    ((_, _, cause),) = brains(tmp_path, participants=["02"]).values()
    assert cause == Facts("sub-02_week25_dseg.nii.gz")


def test_scans_and_tables_in_formats_that_are_not_read_are_named(tmp_path):
    foreign = {
        "case3_week26.seg.nrrd": "NRRD0005",
        "case4_week27_label.mha": "NDims = 3",
        # exported, too
        "case1_week24_seg.seg.nrrd": "NRRD0005",
        "image.nrrd": "NRRD0005",
        "participants.xlsx": "PK",
    }
    labels = ["case1_week24_seg.nii.gz", "case2_week25_seg.nii.gz"]
    found = recognise(make_tree(tmp_path, labels=labels, text=foreign))
    assert [brain.entry["week"] for brain in found.brains] == [24, 25]
    assert found.unused == {
        "case3_week26.seg.nrrd": Facts("NIfTI"),
        "case4_week27_label.mha": Facts("NIfTI"),
        "participants.xlsx": Facts(".tsv"),
    }
    for path in tmp_path.glob("*.nii.gz"):
        path.unlink()
    with pytest.raises(InputError, check=Facts("case3_week26.seg.nrrd", "NIfTI")):
        recognise(tmp_path)
