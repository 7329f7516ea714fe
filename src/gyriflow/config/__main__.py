"""`python -m gyriflow.config` writes config/README.md anew."""

from pathlib import Path

from .documentation import documentation

if __name__ == "__main__":
    page = Path(__file__).resolve().parents[3] / "config" / "README.md"
    page.write_text(documentation(), encoding="utf-8")
    print(f"wrote {page}")
