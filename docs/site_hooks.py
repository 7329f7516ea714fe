"""What the site adds to docs: pages that lie elsewhere in the checkout, and links to
files that are no pages."""

import posixpath
import re
from pathlib import Path
from typing import Any

from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files

from gyriflow.version import version

CHECKOUT = Path(__file__).parents[1]
PAGES = {
    "config/README.md": "configuration.md",
    "CONTRIBUTING.md": "how-to/extend.md",
    "README.md": "index.md",
    "CHANGELOG.md": "changes.md",
}
"""Files of the checkout that are pages of the site."""
LINK = re.compile(r"\[([^\]]*)\]\((?![a-z]+:|#)([^)\s#]+)(#[^)\s]*)?\)")


def on_config(config: Any) -> Any:
    """Names the version at the foot of each page."""
    config.copyright = f"gyriflow {version()}"
    return config


def on_files(files: Files, config: Any) -> Files:
    """Add the pages that lie elsewhere in the checkout."""
    for source, page in PAGES.items():
        files.append(
            File.generated(
                config, page, content=(CHECKOUT / source).read_text(encoding="utf-8")
            )
        )
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Make links to files that are no pages of the site into their names, and mend
    those between pages."""
    sources = {site: source for source, site in PAGES.items()}
    here = sources.get(page.file.src_uri, f"docs/{page.file.src_uri}")

    def mended(match: re.Match[str]) -> str:
        text, link, anchor = match[1], match[2], match[3] or ""
        path = posixpath.normpath(posixpath.join(posixpath.dirname(here), link))
        if not (CHECKOUT / path).exists():
            raise PluginError(f"{here}: {link} leads nowhere")
        if path not in PAGES and not path.startswith("docs/"):
            return f"{text} (`{path}`)" if path not in text else f"`{text}`"
        to = posixpath.relpath(
            PAGES.get(path, path.removeprefix("docs/")),
            posixpath.dirname(page.file.src_uri) or ".",
        )
        return f"[{text}]({to}{anchor})"

    return LINK.sub(mended, markdown)
