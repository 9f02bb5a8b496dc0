"""Sphinx configuration: Markdown pages with MyST, notebooks that are run, API pages from docstrings.

The source directory is the whole checkout, so that a link from a page to any other file is the same in both places:
`python -m sphinx -W -c docs -b html . build/docs`.
"""

from __future__ import annotations

import ast
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "extensions"))

import robust
import robust.api
import robust.reading

for module in (robust.api, robust.reading):
    for statement in ast.parse(Path(module.__file__).read_text(encoding="utf-8")).body:
        if isinstance(statement, ast.If):  # what is imported for type checkers only: names are resolved, not guessed
            exec(compile(ast.Module(statement.body, []), "types", "exec"), vars(module))  # noqa: S102 - our own

project = "robust"
author = "The robust developers"
project_copyright = f"2026, {author}"
version = release = robust.__version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "reference"]
root_doc = "docs/index"
include_patterns = [
    "README.md",
    "ARCHITECTURE.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "benchmarks/RESULTS.md",
    "benchmarks/conformance/README.md",
    "benchmarks/domains/**.md",
    "docs/**",
]
exclude_patterns = ["build", ".venv", ".git", "mutants", "robust", "tests", "proofs", "benchmarks/parts"]

myst_heading_anchors = 4
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_execution_in_temp = True

autodoc_typehints = "description"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
default_role = "literal"  # names in docstrings
smartquotes_action = "qe"  # two hyphens begin an option

html_theme = "furo"
html_title = f"robust {release}"
templates_path = ["templates"]
html_static_path = ["static"]
html_css_files = ["wide.css"]
html_additional_pages = {"index": "index.html"}
