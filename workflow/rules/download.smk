# The files of the dHCP atlases, fetched into their own folder.
# They are no outputs: Snakemake would delete them before a rerun, and they may be the user's own copies.
rule download:
    log:
        "results/study/logs/download.log",
    conda:
        ENVIRONMENT
    resources:
        mem_mb=500,
        runtime=120,
    params:
        folder=CONFIG.atlas.folder if CONFIG.atlas else None,
        urls=CONFIG.downloads,
        optional=CONFIG.optional_downloads,
    script:
        "../scripts/download.py"
