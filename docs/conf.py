"""Configuration of the documentation site; `make docs` builds it."""

import sys
from importlib.metadata import version as version_of
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_extensions"))

project = "hprs"
author = "hprs contributors"
project_copyright = "hprs contributors, MIT licence"
version = release = version_of("hprs")

extensions = [
    "docstrings",
    "hprs_lexer",
    "mathml",
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
]
exclude_patterns = ["_extensions"]
# Fences without a language are output, not Python.
highlight_language = "text"

myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 4

# Docstrings put code between single backticks.
default_role = "code"

autodoc_member_order = "groupwise"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
napoleon_google_docstring = True
napoleon_numpy_docstring = False
copybutton_prompt_text = "$ "

html_theme = "furo"
html_title = "hprs"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False
