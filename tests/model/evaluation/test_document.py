import pytest

from model.evaluation.document import Run, section, write_folder
from model.evaluation.figures import figures
from model.evaluation.tables import markdown, tables
from model.formats.page import write_section

WEIGHTS = {"ours": "0123456789abcdef"}
RUN = Run("Held-out objects", "matphys evaluate x", "2030-01-02", "x", "right", 1, 2, WEIGHTS)


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


def test_a_section_says_of_what_and_shows_tables_and_figures(content, tmp_path):
    page = tmp_path / "page.md"
    page.write_text("# Page\n")
    write_section(page, section(RUN, *content))
    text = page.read_text()
    assert "## Held-out objects\n\n1 objects and 2 clips of `x`, priors peaked on the true material; " in text
    of = "Weights (SHA-256): `ours` 0123456789abcdef. Means over objects"
    assert f"```\nmatphys evaluate x\n```\n\n{of}" in text
    for table in content[0]:
        assert markdown(table) in text
    assert (
        "![Track error by setting, with 95 % intervals over objects](images/evaluation-held-out-objects-err"
        in text
    )
    image = (tmp_path / "images" / "evaluation-held-out-objects-errors.png").read_bytes()
    assert image.startswith(b"\x89PNG")
