"""One file that needs nothing else, whatever the report says."""

import re
import shutil
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from html.parser import HTMLParser

import pytest
from playwright.sync_api import sync_playwright

from model.gap.report.figures import ALL_DRAWINGS
from model.gap.report.page import bound, page
from model.gap.report.statement import stated
from model.gap.report.style import png

EVIL = '<script>alert(1)</script><img src="http://example.org/x.png">'
VOID = {"meta", "img", "link", "br"}


class Reader(HTMLParser):
    """Tags, and what they point to; fails on tags that are not closed."""

    def __init__(self):
        super().__init__()
        self.open, self.tags, self.targets, self.words = [], [], [], []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.targets += [value for name, value in attrs if name in ("src", "href", "srcset")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


def written(findings):
    images = {each.file: png(each.draw(findings)) for each in ALL_DRAWINGS}
    return page(stated(findings.report), images)


def read(html):
    reader = Reader()
    reader.feed(html)
    assert reader.open == []
    return reader


def test_it_is_self_contained(findings):
    reader = read(written(findings))
    assert "script" not in reader.tags
    assert "link" not in reader.tags
    assert reader.tags.count("img") == len(ALL_DRAWINGS)
    assert all(target.startswith("data:image/png;base64,") for target in reader.targets)


def test_it_says_what_the_report_says(alike):
    words = " ".join(" ".join(read(written(alike)).words).split())
    report = stated(alike.report)
    assert report.verdict.statement in words
    assert "Parameters of wind" in words
    assert "0.41 to 0.63 1/m" in words
    assert "Parameters of gravity tilt" in words
    assert "physics 58 %" in words
    assert report.warnings[0] in words
    assert "What to film next" in words
    for effect in report.effects:
        assert effect.name.replace("_", " ") in words


@pytest.mark.parametrize("case", ["nothing", "unknown"])
def test_without_an_effect_there_are_no_parameters(case, request):
    words = " ".join(read(written(request.getfixturevalue(case))).words)
    assert "Parameters of" not in words


def test_what_others_wrote_into_a_report_stays_text(findings):
    where = findings.report.where
    parts = (where.parts[0].model_copy(update={"part": EVIL}), *where.parts[1:])
    report = findings.report.model_copy(
        update={"warnings": (EVIL,), "where": where.model_copy(update={"parts": parts})}
    )
    reader = read(written(replace(findings, report=report)))
    assert "script" not in reader.tags
    assert reader.tags.count("img") == len(ALL_DRAWINGS)
    assert any(EVIL in words for words in reader.words)


def test_numbers_stay_with_their_units():
    assert bound("goes to 3.7 mm, 96 % of it in 2 sets") == "goes to 3.7\u00a0mm, 96\u00a0% of it in 2 sets"
    assert bound("(< 1 %)") == "(<\u00a01\u00a0%)"


@pytest.mark.slow
@pytest.mark.parametrize("width", [390, 1200])
def test_nothing_is_wider_than_the_screen_and_nothing_is_loaded(alike, tmp_path, width):
    path = next((found for name in ("chromium", "google-chrome") if (found := shutil.which(name))), None)
    if path is None:
        pytest.skip("no Chromium on the PATH: apt-get install chromium")
    file = tmp_path / "report.html"
    file.write_text(written(alike), encoding="utf-8")
    with ThreadPoolExecutor(1) as thread:  # playwright allows one loop per thread, others may have one here
        wide, asked = thread.submit(_look, path, file, width).result()
    assert wide == width
    assert [url for url in asked if not re.match(r"data:|file:", url)] == []


def _look(path, file, width):
    asked = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox", "--disable-gpu"])
        view = browser.new_page(viewport={"width": width, "height": 800})
        view.on("request", lambda request: asked.append(request.url))
        view.goto(file.as_uri())
        wide = view.evaluate("document.documentElement.scrollWidth")
        browser.close()
    return wide, asked
