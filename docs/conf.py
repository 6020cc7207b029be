"""Settings of the documentation site."""

import sys
from pathlib import Path

import forest

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

project = "forest"
author = "the forest authors"
copyright = "2026, the forest authors"
release = version = forest.__version__

extensions = ["myst_parser", "definition_tables"]
myst_enable_extensions = ["deflist"]
myst_heading_anchors = 3
exclude_patterns = ["_build", "_ext"]
html_theme = "alabaster"
html_theme_options = {"description": "Forest stands, bud by bud", "page_width": "1100px"}
html_show_sourcelink = False
