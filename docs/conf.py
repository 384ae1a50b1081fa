"""The site: ``sphinx-build -W docs build/docs``, without a network. Notebooks are executed, validation is computed."""

import os
import sys
from pathlib import Path

from docutils.nodes import SkipNode
from docutils.utils.math.latex2mathml import tex2mathml

HERE = Path(__file__).parent
ROOT = HERE.parent
sys.path[:0] = [str(ROOT), str(HERE)]
# Kernels of the notebooks show this package, not another that may be installed.
os.environ["PYTHONPATH"] = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])

import powertrain_ctrl  # noqa: E402

project = "powertrain_ctrl"
author = "The powertrain_ctrl developers"
copyright = f"2026, {author}"
release = version = powertrain_ctrl.__version__

extensions = ["sphinx.ext.autodoc", "numpydoc", "myst_nb"]
exclude_patterns = ["*.py", "published"]
default_role = "py:obj"

html_theme = "furo"
html_title = f"powertrain_ctrl {release}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False
html_math_renderer = "mathml"

autodoc_typehints = "none"
autodoc_member_order = "bysource"
# How results print is seen where they print.
PRINTING = "headers, rows, heading, title, note, quantities"
autodoc_default_options = {"inherited-members": "tuple", "exclude-members": PRINTING}
add_module_names = False
toc_object_entries_show_parents = "hide"
numpydoc_show_class_members = False
numpydoc_xref_param_type = False

myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence", "deflist"]
myst_heading_anchors = 3
nb_execution_mode = "cache"
nb_execution_cache_path = str(ROOT / "build" / "notebooks")
nb_execution_timeout = 300
nb_execution_raise_on_error = True
# Nothing is fetched when a page is read: no widgets, whose pictures the notebooks show beside them as well.
nb_ipywidgets_js = {}
nb_mime_priority_overrides = [("html", "application/vnd.jupyter.widget-view+json", None)]
nb_merge_streams = True
nb_render_markdown_format = "gfm"


def copy_notebooks(app):
    """The notebooks as they are in the repository, with links that fit the site."""
    for path in sorted((ROOT / "notebooks").glob("*.ipynb")):
        text, copy = path.read_text(encoding="utf-8").replace("../docs/", "../"), HERE / "tutorial" / path.name
        if not copy.exists() or copy.read_text(encoding="utf-8") != text:
            copy.write_text(text, encoding="utf-8")


def inline_math(translator, node):
    translator.body.append(tex2mathml(node.astext(), as_block=False))
    raise SkipNode


def block_math(translator, node):
    translator.body.append(f'<div class="math">{tex2mathml(node.astext(), as_block=True)}</div>')
    raise SkipNode


def setup(app):
    app.add_html_math_renderer("mathml", inline_renderers=(inline_math, None), block_renderers=(block_math, None))
    app.connect("config-inited", lambda app, config: copy_notebooks(app))
