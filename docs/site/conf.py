"""Configuration of the site for Sphinx; ``make docs`` builds it.

The sources are the Markdown files of the repository where they are, so that a link between them
leads to the same place on the site as in the repository. Nothing on a page comes from elsewhere:
fonts are those of the system, and the theme brings its own scripts.
"""

from __future__ import annotations

import os
import sys
import tomllib
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

project = "ppy-rig"
author = "the ppy-rig authors"
project_copyright = "the ppy-rig authors, BSD 3-Clause"
release = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
version = release

extensions = ["myst_nb", "sphinx_copybutton", "docs.site.pages"]
root_doc = "docs/index"
source_suffix = {".md": "myst-nb"}
include_patterns = [
    "docs/*.md",
    "docs/*/*.md",
    "fmus/*/README.md",
    "benchmarks/README.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
]
exclude_patterns = [".*", "build", "dist"]

# The pages below a page, in their order. A pattern is also listed on that page; pages by name are
# linked from its text, which the repository shows too.
navigation = {
    "docs/index": [
        "docs/tutorial",
        "docs/gallery/index",
        "docs/how-to/index",
        "docs/reference/index",
        "docs/explanation",
        "docs/studies",
        "docs/decisions/index",
        "docs/project",
    ],
    "docs/gallery/index": [
        "docs/gallery/battery",
        "docs/gallery/motor",
        "docs/gallery/another_tool",
        "docs/gallery/actuator",
        "docs/gallery/own_law",
        "docs/gallery/bench",
        "docs/gallery/force_loop",
        "docs/gallery/rig",
    ],
    "docs/how-to/index": [
        "docs/how-to/diagnose",
        "docs/how-to/own-record",
        "docs/how-to/identify",
        "docs/how-to/characterise",
        "docs/how-to/ageing",
        "docs/how-to/frequency",
        "docs/how-to/laws",
        "docs/how-to/new-component",
        "docs/how-to/own-components",
        "docs/how-to/sweeps",
        "docs/how-to/linearise",
        "docs/how-to/design",
        "docs/how-to/systems",
        "docs/how-to/stance",
        "docs/how-to/work-loops",
        "docs/how-to/other-tools",
        "docs/how-to/continuous-integration",
        "docs/how-to/hardware-in-the-loop",
        "docs/how-to/commission",
        "docs/how-to/retune",
        "docs/how-to/own-hardware",
        "docs/how-to/own-backend",
        "docs/how-to/thesis",
    ],
    "docs/reference/index": [
        "docs/reference/commands",
        "docs/reference/python",
        "docs/reference/records",
        "docs/reference/diagnosis",
        "docs/reference/experiments",
        "docs/reference/master",
        "docs/reference/calling-sequence",
        "docs/reference/fmu-contract",
        "docs/reference/calibration",
        "docs/reference/protocol",
        "docs/reference/security",
        "docs/reference/glossary",
        "docs/reference/components",
    ],
    "docs/reference/components": [
        "fmus/ppy_actuator/README",
        "fmus/galvanostat/README",
        "fmus/voice_coil_dma/README",
        "fmus/isotonic_stand/README",
        "fmus/degradation_estimator/README",
        "fmus/foot/README",
        "fmus/controllers/README",
        "fmus/rig_proxy/README",
    ],
    "docs/studies": [
        "docs/hidden-records",
        "docs/misused-records",
        "docs/bench-records",
        "docs/hidden-laws",
        "docs/public-records",
        "docs/foreign-fmus",
        "docs/black-box-structures",
        "docs/compatibility",
        "docs/hil-faults",
        "docs/proxy-faults",
        "docs/commissioning",
        "docs/rig-latency",
        "docs/rig-soak",
        "docs/benchmarks",
        "benchmarks/README",
    ],
    "docs/decisions/index": ["docs/decisions/0*", "docs/decisions/archive"],
    "docs/project": [
        "docs/architecture",
        "docs/errata",
        "docs/coverage",
        "CONTRIBUTING",
        "CHANGELOG",
    ],
}

# What a page is called in the navigation, where its heading is too long for that.
short_titles = {
    "docs/tutorial": "Tutorial",
    "docs/explanation": "Explanation",
    "docs/reference/security": "Security",
}

myst_heading_anchors = 4

# Outputs are those of the code that is documented: never out of a cache, unless that is asked for.
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_timeout = 300  # s a cell, on a busy machine; a test holds notebooks under a minute
nb_execution_raise_on_error = True
nb_merge_streams = True
nb_ipywidgets_js: dict[str, Any] = {}  # by default they are loaded from elsewhere

copybutton_prompt_text = r"\$ |>>> |\.\.\. "
copybutton_prompt_is_regexp = True

html_theme = "pydata_sphinx_theme"
html_title = "ppy-rig"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_favicon = "static/icon.svg"
html_context = {"default_mode": "auto"}
html_extra_path = ["extra"]
html_show_sphinx = False
html_copy_source = False
html_use_index = False
html_sidebars = {"docs/index": []}
html_theme_options: dict[str, Any] = {
    "logo": {"text": "ppy-rig", "image_light": "static/icon.svg", "image_dark": "static/icon.svg"},
    "header_links_before_dropdown": 8,
    "navbar_end": ["theme-switcher"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "secondary_sidebar_items": {"**": ["page-toc"], "docs/index": []},
    "show_toc_level": 2,
}

# Where several versions stand beside each other; docs/site/versions.py says where that is.
if address := os.environ.get("PPY_SITE_ADDRESS"):
    html_theme_options |= {
        "navbar_end": ["version-switcher", "theme-switcher"],
        "switcher": {"json_url": f"{address}/versions.json", "version_match": release},
        "check_switcher": False,  # the list is written after the build
    }
