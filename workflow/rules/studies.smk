# Studies: runs that differ from one in a few parameters, measured at one week and compared with real brains of it.
#
# results/study/STUDY/ holds members (a row a run: values, resolution, outcome with its cause, time), comparison (how far
# each is from each real brain by each measure), and nearest (which is nearest, with the paper's beside it). A run that has diverged before the week of comparison stands in `members` alone.
PUBLISHED = f"{workflow.basedir}/workflow/published/fetalfoldsim.yaml"


def files_of_member(wildcards):
    """Return the files of a run at the week of comparison and of the real brains, none where it has not come there."""
    run, brain, compared = (
        wildcards.run,
        wildcards.brain,
        study.comparisons[wildcards.study],
    )
    return compared.files(run, brain) if reaches(run, brain, compared.week) else {}


rule compare_member:
    input:
        unpack(files_of_member),
        # solved in any case
        summary=FOLDING["summary"],
    output:
        COMPARED_MEMBER,
    params:
        real=lambda w: {real.id: real.population for real in study.comparisons[w.study].real[w.brain]},
        population=from_brain("population"),
        parts=lambda w: ["whole", *study.brains[w.brain].sides],
    script:
        "../scripts/compare_member.py"


rule study_tables:
    input:
        unpack(lambda w: study.comparisons[w.study].inputs),
        published=PUBLISHED,
    output:
        members=f"{STUDY}/{{study}}/members.csv",
        comparison=f"{STUDY}/{{study}}/comparison.csv",
        nearest=f"{STUDY}/{{study}}/nearest.csv",
    params:
        members=lambda w: study.comparisons[w.study].rows,
        week=lambda w: study.comparisons[w.study].week,
    script:
        "../scripts/study_tables.py"


# each result of the paper beside the same here, with a verdict
rule replication:
    input:
        **{
            name: expand(f"{STUDY}/{{study}}/{name}.csv", study=study.comparisons)
            for name in ("members", "comparison", "nearest")
        },
        published=PUBLISHED,
        displacement=study.files(DISPLACEMENT)[:1],
        summary=study.files(FOLDING["summary"])[:1],
    output:
        csv=f"{STUDY}/replication.csv",
        page=f"{STUDY}/replication.html",
    params:
        studies={
            name: {"varied": list(asked.vary), "week": asked.compare_week}
            for name, asked in CONFIG.studies.items()
            if name in study.comparisons
        },
        run=next(iter(study.pairs), None),
    script:
        "../scripts/replication.py"


rule studies:
    input:
        expand(list(rules.study_tables.output), study=study.comparisons),
