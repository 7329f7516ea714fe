"""Print what a run of the paper's studies found beside what the paper reports, as a table in Markdown.

    ./run gyriflow run config/examples/paper.yaml -d paper --stage replication
    ./run python benchmarks/replication.py paper

Rows that cannot be compared (costs on another machine, statements about other brains) are left out; the page
`results/study/replication.html` has them.
"""

import argparse
from pathlib import Path

from gyriflow.compare.published import NOT_COMPARABLE, NOT_RUN, NOT_TESTED
from gyriflow.io.files import read_table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="working directory of the run")
    table = read_table(parser.parse_args().folder / "results" / "study" / "replication.csv")
    print("| result | the paper | here | verdict |\n| --- | --- | --- | --- |")
    for row in table[~table["verdict"].isin([NOT_RUN, NOT_COMPARABLE, NOT_TESTED])].itertuples():
        print(f"| {row.result} | {row.paper} | {row.here} | {row.verdict} |")


if __name__ == "__main__":
    main()
