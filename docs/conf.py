"""Sphinx configuration: Markdown pages with MyST, API pages from docstrings."""

from __future__ import annotations

import robust

project = "robust"
author = "The robust developers"
version = release = robust.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_heading_anchors = 3
source_suffix = {".md": "markdown"}
exclude_patterns = ["build"]

autodoc_typehints = "description"
autodoc_member_order = "bysource"

html_theme = "furo"
html_title = f"robust {release}"

# Links to files of the repository that are no pages of the manual.
suppress_warnings = ["myst.xref_missing"]
