"""Configuration of the site: `make docs`."""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
from pathlib import Path

from sphinx.application import Sphinx

import airtruth

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
sys.path.insert(0, str(HERE / "_ext"))

project = "airtruth"
author = "airtruth contributors"
copyright = author
version = release = airtruth.__version__

extensions = [
    "mathml",
    "parameters",
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_design",
]
exclude_patterns = ["_build", "images/*.md"]
source_suffix = {".md": "myst-nb", ".ipynb": "myst-nb"}

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4
myst_links_external_new_tab = True
suppress_warnings = ["myst.header"]  # pages of the repository begin where they need to

html_theme = "pydata_sphinx_theme"
html_title = f"airtruth {version}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_math_renderer = "mathml"
html_show_sourcelink = False
html_theme_options = {
    "navigation_with_keys": False,
    "show_prev_next": True,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": ["theme-version"],
    "pygments_light_style": "friendly",
}
html_sidebars = {"tutorial": [], "comparison": [], "glossary": []}

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_default_options = {"members": True, "show-inheritance": False}
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True
default_role = "code"
add_module_names = False
python_use_unqualified_type_names = True

linkcheck_ignore = [r"^#", r"https://doi\.org/.*"]  # publishers refuse programs
linkcheck_timeout = 15
linkcheck_workers = 2

CACHE = Path(os.environ.get("AIRTRUTH_DOCS_CACHE", ROOT / "out" / "docs-cache"))
"""Outputs of the pages; they are kept until the code of a page, or airtruth, or its data change."""


def _digest() -> str:
    """SHA-256 of everything that the pages run."""
    total = hashlib.sha256()
    for folder, pattern in (("src/airtruth", "*.py"), ("aircraft", "*"), ("data", "*")):
        for file in sorted(p for p in (ROOT / folder).rglob(pattern) if p.is_file()):
            total.update(file.relative_to(ROOT).as_posix().encode() + file.read_bytes())
    return total.hexdigest()


def _fresh_cache() -> None:
    """Remove the outputs of another version of airtruth, unless AIRTRUTH_DOCS_KEEP asks to keep them."""
    stamp, now = CACHE / "digest", _digest()
    if stamp.is_file() and stamp.read_text() != now and not os.environ.get("AIRTRUTH_DOCS_KEEP"):
        shutil.rmtree(CACHE)
    CACHE.mkdir(parents=True, exist_ok=True)
    if not stamp.is_file():
        stamp.write_text(now)


_fresh_cache()
nb_execution_mode = "cache"
nb_execution_cache_path = str(CACHE / "jupyter")
nb_execution_in_temp = True
nb_execution_timeout = 1800
nb_execution_show_tb = True  # in the log; a page that fails is a warning, and `make docs` ends at the end
nb_merge_streams = True
nb_render_markdown_format = "myst"
os.environ["PYTHONPATH"] = os.pathsep.join([str(ROOT / "src"), os.environ.get("PYTHONPATH", "")]).rstrip(
    os.pathsep
)
os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
os.environ["JUPYTER_PLATFORM_DIRS"] = "1"
os.environ["TERM"] = "dumb"  # no changing lines in the outputs


def _read(app: object, page: str, source: list[str]) -> None:
    """Lead links to a document outside of this folder to the page that includes it."""
    source[0] = source[0].replace("(../aircraft/gtm/README.md", "(gtm.md").replace("(../../docs/", "(")


def setup(app: Sphinx) -> None:
    """Register the changes to the pages as they are read."""
    app.connect("source-read", _read)
    app.connect("include-read", lambda app, path, page, source: _read(app, page, source))
