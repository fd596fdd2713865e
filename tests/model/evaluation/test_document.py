import pytest

from model.errors import InputError
from model.evaluation.document import END, START, Run, write_folder, write_section
from model.evaluation.figures import figures
from model.evaluation.tables import tables

RUN = Run("Held-out objects", "matphys evaluate x", "2030-01-02", "x", "right", 1, 2)


@pytest.fixture
def content(make_record):
    records = [make_record("ours", "a"), make_record("ours", "b", track=0.02)]
    return tables(records, ("ours",), ("future",)), figures({"ours": records}, ("future",))


def test_the_folder_of_a_run(content, tmp_path):
    written = write_folder(tmp_path / "out", RUN, *content)
    assert {path.name for path in written} == {"tables.md", "tables.csv", "errors.png", "time.png"}
    text = (tmp_path / "out" / "tables.md").read_text()
    assert "# Held-out objects" in text
    assert "matphys evaluate x" in text
    assert "1 objects and 2 clips of `x`, priors peaked on the true material; 2030-01-02" in text
    assert (tmp_path / "out" / "errors.png").read_bytes().startswith(b"\x89PNG")


def test_a_section_takes_its_own_place_again_and_leaves_the_rest(content, tmp_path):
    page = tmp_path / "page.md"
    other = f"{START.format('Other')}\n\nold\n\n{END.format('Other')}"
    page.write_text(f"# Page\n\nWords before.\n\n{other}\n\nWords after.\n")
    write_section(page, RUN, *content)
    once = page.read_text()
    assert once.startswith(f"# Page\n\nWords before.\n\n{other}\n\nWords after.\n\n{START.format(RUN.title)}")
    write_section(page, RUN, *content)
    assert page.read_text() == once
    write_section(page, Run("Other", *list(vars(RUN).values())[1:]), *content)
    both = page.read_text()
    assert "old" not in both
    assert both.index("Words before.") < both.index("## Other") < both.index("Words after.")
    assert (tmp_path / "images" / "evaluation-held-out-objects-errors.png").is_file()
    assert (
        "![Track error by setting, with 95 % intervals over objects](images/evaluation-other-errors.png)"
        in both
    )


def test_a_page_that_is_not_there_or_lost_a_marker(content, tmp_path):
    with pytest.raises(InputError, match="no such page"):
        write_section(tmp_path / "none.md", RUN, *content)
    page = tmp_path / "page.md"
    page.write_text(START.format(RUN.title))
    with pytest.raises(InputError, match="once each, in this order"):
        write_section(page, RUN, *content)
    assert page.read_text() == START.format(RUN.title)
