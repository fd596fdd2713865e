from dataclasses import replace

import pytest

from model.errors import InputError
from model.formats.page import EARLIER, END, START, Section, write_section

SECTION = Section(
    command="check",
    title="Test worlds (other seed)",
    run="2 worlds, 2030-01-02. Predictions `abc`.",
    body="| score |\n|---|\n| 0.5 |\n\nIntervals are wide.\n",
    figures={"matrix.png": ("Verdicts", b"png")},
)
WHOLE = """\
<!-- check: Test worlds (other seed) -->

## Test worlds (other seed)

2 worlds, 2030-01-02. Predictions `abc`.

| score |
|---|
| 0.5 |

Intervals are wide.

![Verdicts](images/check-test-worlds-other-seed-matrix.png)

<!-- end of check: Test worlds (other seed) -->
"""
REMARK = "\n### What this shows\n\nThat half of it is right.\n"
NEXT = "\n## By hand\n\n### A part\n\nWords.\n"
LATER = replace(SECTION, run="2 worlds, 2031-01-02. Predictions `def`.", body="| score |\n|---|\n| 0.6 |\n")


@pytest.fixture
def page(tmp_path):
    path = tmp_path / "page.md"
    path.write_text("# Page\n\nWords before.\n")
    return path


def test_a_section_goes_to_the_end_and_its_figures_beside_the_page(page):
    image = page.parent / "images" / "check-test-worlds-other-seed-matrix.png"
    assert write_section(page, SECTION) == (page, image)
    assert page.read_text() == f"# Page\n\nWords before.\n\n{WHOLE}"
    assert image.read_bytes() == b"png"


def test_a_page_that_is_not_there_begins_with_a_head_or_is_refused(tmp_path):
    path = tmp_path / "new" / "page.md"
    with pytest.raises(InputError, match=r"page\.md: no such page"):
        write_section(path, SECTION)
    write_section(path, SECTION, head="# Head\n")
    assert path.read_text() == f"# Head\n\n{WHOLE}"


def test_a_section_takes_its_own_place_again_and_leaves_the_rest(page):
    other = replace(LATER, title="Test worlds")
    write_section(page, SECTION)
    write_section(page, other)
    page.write_text(page.read_text() + NEXT)
    once = page.read_text()
    write_section(page, SECTION)
    assert page.read_text() == once
    write_section(page, replace(LATER, figures={}))
    again = page.read_text()
    assert "0.5" not in again
    assert again.index("Words before.") < again.index("2031-01-02") < again.index("## Test worlds\n")
    assert again.endswith(NEXT)


def test_what_people_wrote_below_stays_and_is_told_to_be_of_the_run_that_they_saw(page):
    write_section(page, SECTION)
    page.write_text(page.read_text() + REMARK + NEXT)
    write_section(page, LATER)
    remark = f"\n### What this shows\n\n{EARLIER}{SECTION.run}*\n\nThat half of it is right.\n"
    assert page.read_text().endswith(f"{END.format(LATER.command, LATER.title)}\n{remark}{NEXT}")
    once = page.read_text()
    write_section(page, replace(LATER, body="| score |\n|---|\n| 0.7 |\n"))
    assert page.read_text() == once.replace("0.6", "0.7")


def test_words_stay_as_they_are_where_a_later_run_says_the_same(page):
    write_section(page, SECTION)
    page.write_text(page.read_text() + REMARK)
    before = page.read_text()
    write_section(page, replace(SECTION, run=LATER.run))
    assert page.read_text() == before.replace(SECTION.run, LATER.run)


@pytest.mark.parametrize("text", ["{start}", "{end}", "{end} {start}", "{start} {start} {end}"])
def test_a_marker_that_was_lost_or_moved_is_told_and_nothing_is_written(page, text):
    names = (SECTION.command, SECTION.title)
    page.write_text(text.format(start=START.format(*names), end=END.format(*names)))
    before = page.read_text()
    with pytest.raises(InputError, match="once each, in this order"):
        write_section(page, SECTION)
    assert page.read_text() == before
