"""Build the manual as a static site, without network; warnings are errors: ``python docs [FOLDER]`` (default: ``site``)."""

import sys
from pathlib import Path

from sphinx.cmd.build import main

DOCS = Path(__file__).resolve().parent

if __name__ == "__main__":
    target = sys.argv[1] if len(sys.argv) > 1 else "site"
    sys.exit(
        main(["-q", "-W", "--keep-going", "-j", "auto", "-d", str(DOCS / "_built" / "doctrees"), str(DOCS), target])
    )
