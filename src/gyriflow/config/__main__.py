"""`python -m gyriflow.config` writes config/README.md anew."""

from ..shipped import SHIPPED
from .documentation import documentation

if __name__ == "__main__":
    page = SHIPPED / "config" / "README.md"
    page.write_text(documentation(), encoding="utf-8")
    print(f"wrote {page}")
