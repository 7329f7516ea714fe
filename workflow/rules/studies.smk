# Studies: runs that differ from one in a few parameters, measured at one week and compared with real brains of it.
#
# results/study/STUDY/ holds members (a row a run: values, resolution, outcome with its cause, time), comparison (how far
# each is from each real brain by each measure), and nearest (which is nearest, with the paper's beside it). A run that has diverged before the week of comparison stands in `members` alone.
PUBLISHED = f"{workflow.basedir}/workflow/published/fetalfoldsim.yaml"


def tables_of_member(wildcards):
    """Returns the tables of a run at the week of comparison and of the real brains, none where it has not come there."""
    week = PLAN.studying.week(wildcards.study)
    reached = reaches(wildcards.run, wildcards.brain, week)
    return of(PLAN.studying.tables)(wildcards) if reached else {}


rule compare_member:
    input:
        unpack(tables_of_member),
        # solved in any case
        summary=FOLDING["summary"],
    output:
        COMPARED_MEMBER,
    wildcard_constraints:
        study=one_of(CONFIG.studies),
    params:
        real=of(PLAN.studying.populations),
        population=of(PLAN.brains.population),
    script:
        "../scripts/compare_member.py"


rule study_tables:
    input:
        unpack(of(PLAN.studying.inputs)),
        published=PUBLISHED,
    output:
        members=f"{STUDY}/{{study}}/members.csv",
        comparison=f"{STUDY}/{{study}}/comparison.csv",
        nearest=f"{STUDY}/{{study}}/nearest.csv",
    wildcard_constraints:
        study=one_of(CONFIG.studies),
    params:
        members=of(PLAN.studying.rows),
        week=of(PLAN.studying.week),
    script:
        "../scripts/study_tables.py"


# each result of the paper beside the same here, with a verdict
rule replication:
    input:
        **{
            name: expand(f"{STUDY}/{{study}}/{name}.csv", study=CONFIG.studies)
            for name in ("members", "comparison", "nearest")
        },
        published=PUBLISHED,
        displacement=PLAN.runs.of(DISPLACEMENT)[:1],
        summary=PLAN.runs.of(FOLDING["summary"])[:1],
    output:
        csv=f"{STUDY}/replication.csv",
        page=f"{STUDY}/replication.html",
    params:
        studies={
            name: {"varied": list(study.vary), "week": study.compare_week}
            for name, study in CONFIG.studies.items()
        },
        run=PLAN.runs.folded[0],
        power=CONFIG.report.power,
    script:
        "../scripts/replication.py"


rule studies:
    input:
        expand(list(rules.study_tables.output), study=CONFIG.studies),
