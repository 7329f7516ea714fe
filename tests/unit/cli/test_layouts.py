"""Scans, ages and files of folders as public data sets and pipelines have them, and
files that cannot be used."""

import pytest
from facts import Facts
from scan_trees import make_tree
from shapes import cerebrum_surface, phantom

from gyriflow.cli.recognition import recognise
from gyriflow.errors import InputError
from gyriflow.io.surfaces import write_surface


def both(pattern):
    """Return the paths of both sides, L and R or lh and rh for @."""
    return [
        pattern.replace("@", side)
        for side in (("lh", "rh") if "/@." in pattern else ("L", "R"))
    ]


def brains(folder, **options):
    """Return week, files and causes of each scan by id."""
    found = recognise(folder, **options).brains
    return {
        brain.entry["id"]: (brain.entry["week"], brain.files, " ".join(brain.causes))
        for brain in found
    }


NIBABIES = "derivatives/nibabies/sub-01/ses-1/anat/sub-01_ses-1"
DHCP = "derivatives/dhcp/sub-CC00856XX15/ses-3530/anat/sub-CC00856XX15_ses-3530"
HCP = "100307/{}/100307.@.{}"

FETPYPE = (
    "derivatives/nesvor_bounti/sub-01/ses-01/anat"
    "/sub-01_ses-01_rec-nesvor_seg-bounti_dseg.nii.gz"
)
TABLE = "participants.tsv"
KEEP_ONE = Facts("2 files", "keep one")


@pytest.mark.parametrize(
    ("contents", "expected"),
    [
        # FeTA 2.x
        (
            {
                "labels": [
                    f"sub-0{n}/anat/sub-0{n}_rec-mial_dseg.nii.gz" for n in (26, 27)
                ],
                "text": {
                    TABLE: (
                        "participant_id\tPathology\tGestational age\n"
                        "sub-026\tNeurotypical\t23.3\nsub-027\tPathological\t26.9"
                    )
                },
            },
            {
                f"sub-0{n}": (week, f"sub-0{n}/anat/sub-0{n}_rec-mial_dseg.nii.gz", "")
                for n, week in ((26, 23.3), (27, 26.9))
            },
        ),
        # dHCP: several kinds of one scan are asked for, with ages at the scan of
        # sessions
        (
            {
                "labels": [f"{DHCP}_desc-drawem9_dseg.nii.gz"],
                "surfaces": both(f"{DHCP}_hemi-@_pial.surf.gii"),
                "tables": {
                    TABLE: ["participant_id sex birth_age", "CC00856XX15 F 39.1"],
                    "sub-CC00856XX15/sub-CC00856XX15_sessions.tsv": [
                        "session_id scan_age",
                        "3530 29.71",
                    ],
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
        # fetpype's derivatives
        (
            {
                "labels": [FETPYPE],
                "tables": {
                    TABLE: ["participant_id session_id ga", "sub-01 ses-01 24+3"]
                },
            },
            {
                "sub-01_ses-01": (
                    24.43,
                    Facts("sub-01_ses-01_rec-nesvor_seg-bounti_dseg.nii.gz"),
                    "",
                )
            },
        ),
        # NiBabies: a template's space and meshes beside the subject's own
        (
            {
                "labels": [f"{NIBABIES}_space-MNIInfant_cohort-1_dseg.nii.gz"],
                "surfaces": [
                    *both(f"{NIBABIES}_hemi-@_pial.surf.gii"),
                    *both(f"{NIBABIES}_hemi-@_white.surf.gii"),
                    *both(f"{NIBABIES}_hemi-@_space-fsLR_den-32k_pial.surf.gii"),
                ],
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
        # FreeSurfer, with its template
        (
            {
                "surfaces": (
                    [
                        path
                        for layer in ("pial", "pial.T1", "white", "sphere")
                        for path in both(f"subjects/sub-01/surf/@.{layer}")
                    ]
                    + both("subjects/sub-02/surf/@.pial.T1")
                    + both("subjects/fsaverage/surf/@.pial")
                ),
                "labels": [
                    "subjects/sub-01/mri/aseg.mgz",
                    "subjects/sub-01/mri/aparc+aseg.mgz",
                ],
                "tables": {
                    f"subjects/{TABLE}": [
                        "participant_id week",
                        "sub-01 36",
                        "sub-02 37",
                    ]
                },
            },
            {
                "sub-01": (
                    36.0,
                    "subjects/sub-01/surf/lh.pial, subjects/sub-01/surf/rh.pial",
                    "",
                ),
                "sub-02": (
                    37.0,
                    "subjects/sub-02/surf/lh.pial.T1, subjects/sub-02/surf/rh.pial.T1",
                    "",
                ),
            },
        ),
        # Infant FreeSurfer, without sub-
        (
            {
                "surfaces": [*both("case7/surf/@.pial"), *both("case8/surf/@.pial")],
                "labels": ["case7/mri/aseg.mgz"],
                "tables": {TABLE: ["participant_id week", "case7 36", "case8 37"]},
            },
            {
                f"case{n}": (
                    29.0 + n,
                    f"case{n}/surf/lh.pial, case{n}/surf/rh.pial",
                    "",
                )
                for n in (7, 8)
            },
        ),
        # HCP
        (
            {
                "surfaces": [
                    *both(HCP.format("T1w/Native", "pial.native.surf.gii")),
                    *both(HCP.format("T1w/Native", "white.native.surf.gii")),
                    *both(HCP.format("T1w/fsaverage_LR32k", "pial.32k_fs_LR.surf.gii")),
                    *both(HCP.format("MNINonLinear/Native", "pial.native.surf.gii")),
                ],
                "tables": {TABLE: ["participant_id week", "100307 36"]},
            },
            {
                "100307": (
                    36.0,
                    ", ".join(both(HCP.format("T1w/Native", "pial.native.surf.gii"))),
                    "",
                )
            },
        ),
        # a clone of git-annex with and without contents
        (
            {
                "lost": [
                    "sub-01_week24_dseg.nii.gz",
                    *both("sub-02_week25/surf/@.pial"),
                ],
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
    ],
    ids=[
        "FeTA",
        "dHCP",
        "fetpype",
        "NiBabies",
        "FreeSurfer",
        "Infant FreeSurfer",
        "HCP",
        "git-annex",
    ],
)
def test_a_data_set_is_read_as_it_is(tmp_path, contents, expected):
    assert brains(make_tree(tmp_path, **contents)) == expected


WEEK = "sub-01_week24"


@pytest.mark.parametrize(
    ("contents", "cause"),
    [
        (
            {"labels": [f"{WEEK}_space-MNI152NLin6Asym_dseg.nii.gz"]},
            Facts("MNI152NLin6Asym"),
        ),
        ({"labels": [f"{WEEK}_space-dhcpSym_dseg.nii.gz"]}, Facts("dhcpSym")),
        ({"labels": [f"{WEEK}_space-T2w_dseg.nii.gz"]}, ""),
        ({"labels": [f"tpl-x/{WEEK}_dseg.nii.gz"]}, Facts("tpl-x")),
        ({"labels": [f"sub-02/{WEEK}_dseg.nii.gz"]}, Facts("sub-01", "sub-02")),
        ({"text": {f"{WEEK}_dseg.nii.gz": "no labels"}}, Facts(f"{WEEK}_dseg.nii.gz")),
        ({"surfaces": both(f"{WEEK}/@.white")}, Facts("white", "pial")),
        ({"surfaces": both(f"{WEEK}/@.pial")}, ""),
        ({"surfaces": [f"{WEEK}/lh.pial"]}, ""),
        (
            {"surfaces": [f"{WEEK}/lh.pial", f"{WEEK}/rh.sphere"]},
            Facts("right", "rh.sphere"),
        ),
        (
            {"surfaces": [f"{WEEK}/lh.pial"], "lost": [f"{WEEK}/rh.pial"]},
            Facts("rh.pial"),
        ),
        (
            {"surfaces": [*both(f"{WEEK}/@.pial"), f"{WEEK}/lh.white"]},
            Facts("white", "lh.white"),
        ),
        (
            {
                "surfaces": [*both(f"{WEEK}/@.pial"), f"{WEEK}/lh.white"],
                "lost": [f"{WEEK}/rh.white"],
            },
            Facts("rh.white"),
        ),
        ({"surfaces": [f"{WEEK}/lh.pial"], "text": {f"{WEEK}/rh.pial": ""}}, ""),
        ({"surfaces": both(f"{WEEK}_hemi-@_space-fsLR_den-32k_pial.surf.gii")}, ""),
    ],
)
def test_files_that_cannot_be_used_are_named(tmp_path, contents, cause):
    ((_, _, found),) = brains(make_tree(tmp_path, **contents)).values()
    assert found == cause


@pytest.mark.parametrize(
    ("labels", "surfaces", "cause"),
    [
        # of one data set
        (["anat/sub-01_dseg.nii.gz"], "surf/sub-01_hemi-@_pial.surf.gii", KEEP_ONE),
        (
            ["volumes/sub-01_dseg.nii.gz"],
            "meshes/sub-01_hemi-@_pial.surf.gii",
            KEEP_ONE,
        ),
        (["anat/sub-01_dseg.nii.gz", "seg/sub-01_desc-x_dseg.nii.gz"], None, KEEP_ONE),
        (
            ["siteA/anat/sub-01_dseg.nii.gz", "siteB/anat/sub-01_dseg.nii.gz"],
            None,
            Facts("siteA", "siteB"),
        ),
    ],
)
def test_folders_of_kinds_of_data_are_not_data_sets(tmp_path, labels, surfaces, cause):
    make_tree(tmp_path, labels=labels, surfaces=both(surfaces) if surfaces else [])
    assert all(found == cause for _, _, found in brains(tmp_path).values())


def test_a_resampled_surface_is_used_with_a_warning(tmp_path):
    make_tree(tmp_path, surfaces=both("sub-01_hemi-@_space-fsLR_den-32k_pial.surf.gii"))
    (brain,) = recognise(tmp_path).brains
    assert (len(brain.warnings), brain.problem) == (1, "")


def test_closed_surfaces_of_whole_brains_are_recognised(tmp_path):
    brain = cerebrum_surface(*phantom(24.0, 2.0))
    write_surface(tmp_path / "24.stl", brain)
    write_surface(tmp_path / "week25.ply", brain)
    write_surface(tmp_path / "skull.stl", brain)
    write_surface(tmp_path / "nut.stl", type(brain)(0.1 * brain.vertices, brain.faces))
    assert brains(tmp_path) == {
        "week25": (25.0, "week25.ply", ""),
        "24": ("CHOOSE", "24.stl", Facts("week")),
    }

    assert recognise(tmp_path).unused == {"nut.stl": Facts("mL", 15, 700)}


@pytest.mark.parametrize(
    "contents",
    [
        # sides in other folders, in another order of parts, as single letters
        {"surfaces": ["sub-01/lh/lh.pial", "sub-01/rh/rh.pial"]},
        {
            "surfaces": [
                "sub-01_run-1_hemi-L_pial.surf.gii",
                "sub-01_hemi-R_run-1_pial.surf.gii",
            ]
        },
        {"surfaces": ["sub-01_L.stl", "sub-01_R.stl"]},
        # a torn file beside a good one, and a mesh of something else
        {
            "labels": ["sub-01_dseg.nii.gz"],
            "text": {"sub-01_desc-x_dseg.nii.gz": "torn", "sub-01_placenta.stl": "x"},
        },
    ],
)
def test_what_belongs_to_a_scan_is_found_and_nothing_else(tmp_path, contents):
    first, *others = recognise(make_tree(tmp_path, **contents)).brains
    assert (first.entry["id"], first.problem, len(others)) == (
        "sub-01",
        "",
        "text" in contents,
    )
    assert not [note for note in first.notes if "keep one" in note]
    assert len(first.entry.get("hemispheres", ())) in (0, 2)


@pytest.mark.parametrize(
    ("contents", "facts"),
    [
        (
            {"labels": ["siteA/sub-01_dseg.nii.gz", "siteB/sub-01_dseg.nii.gz"]},
            [1, "siteA", "siteB"],
        ),
        ({"labels": ["sub-mü_dseg.nii.gz"]}, ["sub-mü"]),
        (
            {
                "surfaces": ["sub-01/surf/lh.pial"],
                "text": {"sub-01/label/rh.aparc.annot": ""},
            },
            ["rh.aparc.annot"],
        ),
    ],
)
def test_what_is_not_of_one_scan_is_refused(tmp_path, contents, facts):
    assert all(
        brain.problem == Facts(*facts[-2:])
        for brain in recognise(make_tree(tmp_path, **contents)).brains
    )


def test_links_to_folders_that_are_not_there_are_scans_that_cannot_be_read(tmp_path):
    make_tree(tmp_path, labels=["sub-01_week24_dseg.nii.gz"])
    (tmp_path / "sub-02").symlink_to("nowhere")
    assert brains(tmp_path)["sub-02"] == ("CHOOSE", "sub-02", Facts("link"))


def test_only_results_of_gyriflow_are_passed_over(tmp_path):
    make_tree(
        tmp_path,
        labels=[
            "results/week24_dseg.nii.gz",
            "own/results/brains/a/week25_dseg.nii.gz",
        ],
        text={"own/results/study/study.json": "{}"},
    )
    assert list(brains(tmp_path)) == ["week24"]
    with pytest.raises(InputError, check=Facts(tmp_path / "own")):
        recognise(tmp_path / "own")


def test_labels_of_other_participants_are_not_read(tmp_path, monkeypatch):
    make_tree(
        tmp_path,
        labels=["sub-01_week24_dseg.nii.gz"],
        text={"sub-02_week25_dseg.nii.gz": "torn"},
    )
    assert list(brains(tmp_path, participants=["01"])) == ["sub-01"]
    ((_, _, cause),) = brains(tmp_path, participants=["02"]).values()
    assert cause == Facts("sub-02_week25_dseg.nii.gz")


def test_scans_and_tables_in_formats_that_are_not_read_are_named(tmp_path):
    make_tree(
        tmp_path,
        labels=["case1_week24_seg.nii.gz", "case2_week25_seg.nii.gz"],
        text={
            "case3_week26.seg.nrrd": "NRRD0005",
            "case4_week27_label.mha": "NDims = 3",
            # exported, too
            "case1_week24_seg.seg.nrrd": "NRRD0005",
            "image.nrrd": "NRRD0005",
            "participants.xlsx": "PK",
        },
    )
    found = recognise(tmp_path)
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
