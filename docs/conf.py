"""How Sphinx makes a site of these pages (docs/decisions/0020-site.md). The command is in docs/development.md."""

import rtsim

project = "rtsim"
author = "The rtsim authors"
copyright = f"{author}. Apache-2.0"  # noqa: A001
version = release = rtsim.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_enable_extensions = ["deflist"]
myst_heading_anchors = 4
highlight_language = "text"
exclude_patterns = ["_build"]

html_theme = "furo"
html_title = f"rtsim {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False

# What the packages hand out, as their docstrings say it. ``Legend:`` is a section of arguments like ``Args:``.
autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
napoleon_google_docstring, napoleon_numpy_docstring = True, False
napoleon_custom_sections = [("Legend", "params_style")]


def list_decisions(_app, docname, source):
    """Put every decision below the page that lists them."""
    if docname == "decisions/README":
        source[0] += "\n```{toctree}\n:hidden:\n:glob:\n\n0*\n```\n"


def no_type_in_text(_app, what, _name, _object, _options, lines):
    """Keep napoleon from reading what stands before a colon as the type of a field: types are annotations here."""
    if what in {"attribute", "data", "property"}:
        lines[:0] = ["..", ""]  # an empty comment


def setup(app):
    """Connect both."""
    app.connect("source-read", list_decisions)
    app.connect("autodoc-process-docstring", no_type_in_text, priority=400)
