"""The policy of the report lets one script run: the one whose hash it states.

What Chromium makes of the page is seen by report_pages.py, which CI does not run.
"""

import base64
import hashlib
import re
from pathlib import Path

SOURCES = Path(__file__).parents[2] / "crates/report/src"


def test_the_stated_hash_is_the_scripts():
    stated = re.search(r'SCRIPT_SHA256: &str = "([^"]*)"', (SOURCES / "page.rs").read_text(encoding="utf-8"))[1]
    # Between the tags stands the file as it is.
    digest = hashlib.sha256((SOURCES / "zoom.js").read_bytes()).digest()
    assert base64.b64encode(digest).decode() == stated
