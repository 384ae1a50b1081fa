"""The site as it is built in build/docs: its links lead somewhere; a browser, where there is one, has no complaint."""

from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import chromium
import pytest

SITE = Path(__file__).parents[1] / "build" / "docs"
PAGES = sorted(path.relative_to(SITE) for path in SITE.rglob("*.html"))

pytestmark = [
    pytest.mark.campaign,
    pytest.mark.skipif(not PAGES, reason="not built: sphinx-build docs build/docs"),
]


class Page(HTMLParser):
    """What a page links to, and what can be linked to in it."""

    def __init__(self, path):
        super().__init__()
        self.links, self.anchors, self.without_words = [], {""}, []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        self.anchors.add(given.get("id", ""))
        if tag == "img" and not given.get("alt"):
            self.without_words.append(given["src"])
        for name in ("href", "src"):
            if given.get(name):
                self.links.append(given[name])


@pytest.fixture(scope="module")
def read():
    return {path: Page(SITE / path) for path in PAGES}


def test_links_within_the_site_lead_somewhere(read):
    broken = []
    for path, page in read.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme:
                continue
            target = (SITE / path.parent / unquote(parts.path)).resolve() if parts.path else SITE / path
            known = read.get(target.relative_to(SITE)) if target.suffix == ".html" else None
            if not target.exists() or (known and unquote(parts.fragment) not in known.anchors):
                broken.append(f"{path}: {link}")
    assert broken == []


def test_nothing_is_fetched_from_elsewhere(read):
    for path in PAGES:
        text = (SITE / path).read_text(encoding="utf-8")
        for tag in ('<script src="http', '<link rel="stylesheet" href="http', '<img src="http'):
            assert tag not in text, path


@pytest.fixture(scope="module")
def browser():
    if chromium.PATH is None:
        pytest.skip("no Chromium here")
    with chromium.chromium() as browser:
        yield browser


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [400, 1280])
def test_a_browser_has_no_complaint_and_no_page_scrolls_sideways(browser, width, scheme):
    complaints = []
    for path in PAGES:
        browser.open((SITE / path).as_uri(), width=width, scheme=scheme)
        wide = browser.value("document.documentElement.scrollWidth")
        complaints += [f"{path}: {fault}" for fault in browser.faults]
        if wide > width:
            complaints.append(f"{path}: {wide} px wide on {width} px")
    assert complaints == []
