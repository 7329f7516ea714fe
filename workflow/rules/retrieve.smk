# Downloads missing files of atlases. No rule makes a file that exists, so a user's own copy is never deleted or
# replaced.
from gyriflow.study.atlases import retrieval_note

ATLAS_FILES = {row.file.removeprefix("/"): row for row in study.downloads.values()}

if PRINTS:
    for atlas in study.used_atlases:
        if atlas.missing:
            print(f"gyriflow: {retrieval_note(atlas)}", file=sys.stderr)


rule atlas_file:
    output:
        # a file that has appeared meanwhile is checked by the job instead of deleted before it
        update("/{file}"),
    log:
        f"{STUDY}/logs/atlas_file/{{file}}.log",
    wildcard_constraints:
        file=one_of(ATLAS_FILES),
    conda:
        ENVIRONMENT
    params:
        url=lambda w: ATLAS_FILES[w.file].url,
        sha256=lambda w: ATLAS_FILES[w.file].sha256,
    script:
        "../scripts/retrieve.py"


rule retrieve:
    input:
        [f"/{file}" for file in ATLAS_FILES],


# nodes of a cluster may have no network
localrules:
    atlas_file,
