"""Sphinx configuration. `scripts/docs` builds the pages, and treats every warning as an error."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import make_scene_reference
import plain_docstrings

import pgfmd

project = "pgfmd"
author = "The pgfmd developers"
copyright = "2026, The pgfmd developers"
release = version = pgfmd.__version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.mathjax", "sphinx-mathjax-offline"]
myst_enable_extensions = ["amsmath", "dollarmath", "deflist", "colon_fence"]
myst_heading_anchors = 3
source_suffix = {".md": "myst-nb", ".ipynb": "myst-nb"}
# Notebooks are shown as they are kept, with their outputs (scripts/studies/notebooks).
nb_execution_mode = "off"
exclude_patterns = ["_build"]

html_theme = "furo"
html_title = f"pgfmd {release}"
html_copy_source = False
html_show_sphinx = False
html_static_path = ["static"]
html_css_files = ["site.css"]

# Types in signatures belong to other packages, or to modules of pgfmd that have no page of their own.
nitpick_ignore_regex = [("py:(class|data|obj)", ".*")]

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 110


def setup(app) -> None:
    """Docstrings are plain text; the page of the scene's keys is made from the models before Sphinx looks for pages."""
    app.connect("autodoc-process-docstring", plain_docstrings.process)
    make_scene_reference.PAGE.write_text(make_scene_reference.page(), encoding="utf-8")
