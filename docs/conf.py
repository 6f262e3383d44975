"""Settings of the documentation site: `make docs` builds it into out/docs, without the network.

Notebooks are executed while the site is built, each in an empty folder with an empty record. A cell that fails, a
link that leads nowhere and a docstring that cannot be read are errors (`-W`).
"""

from __future__ import annotations

import os
import sys
import tempfile
from importlib.metadata import version as installed
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "docs" / "extensions")]

# The kernels of the notebooks get this environment.
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
os.environ["RIG_HOME"] = tempfile.mkdtemp(prefix="rig-docs-")
os.environ["COLUMNS"] = "160"  # the page wraps a line that is longer than its blocks
os.environ["RIG_PROJECT"] = str(ROOT)
os.environ["PYDEVD_DISABLE_FILE_VALIDATION"] = "1"

project = "rig"
author = "the authors of rig"
release = installed("inertial-rig")
version = release

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "mathml",
    "plain_docstrings",
    "command_reference",
    "repository_pages",
    "whole_streams",
]
exclude_patterns = ["extensions"]
suppress_warnings = ["config.cache"]
smartquotes = False  # options begin with two hyphens

myst_enable_extensions = ["dollarmath", "amsmath", "deflist"]
myst_heading_anchors = 3
nb_execution_mode = "cache"
nb_execution_cache_path = str(ROOT / "out" / "docs-cache")
nb_execution_in_temp = True
nb_execution_timeout = 120
nb_execution_raise_on_error = True
nb_execution_show_tb = True
nb_output_stderr = "remove"  # progress

nb_number_source_lines = False

autodoc_typehints = "signature"
autodoc_typehints_format = "short"
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 88
autodoc_member_order = "bysource"
html_math_renderer = "mathml"

html_theme = "furo"
html_title = "rig"
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_show_sphinx = False
html_show_copyright = False
html_copy_source = False
html_theme_options = {"navigation_with_keys": True}
