from pathlib import Path

import pytest

from model.errors import InputError
from service.settings import Settings, default_data_dir


def settings(environment):
    return Settings.from_environment(
        environment, data_dir=Path("/d"), redis_url="redis://:s3cret@host", store_url="file:///d/store"
    )


def test_what_nobody_sets_has_a_default():
    chosen = settings({"MATPHYS_UNRELATED": "1"})
    assert chosen == Settings("redis://:s3cret@host", "file:///d/store", Path("/d"))
    assert chosen.max_upload_bytes == 512 << 20
    assert chosen.staging == Path("/d/staging")


def test_every_number_is_a_variable():
    chosen = settings(
        {"MATPHYS_MAX_JOBS": "7", "MATPHYS_RETENTION_HOURS": "0.5", "MATPHYS_LOG_LEVEL": "debug"}
    )
    assert (chosen.max_jobs, chosen.retention_hours, chosen.log_level) == (7, 0.5, "DEBUG")


@pytest.mark.parametrize("value", ["", "0", "-1", "1.5", "many", "1e99", "nan"])
def test_a_number_that_makes_no_sense_is_named(value):
    with pytest.raises(InputError, match=f"MATPHYS_MAX_JOBS={value}: expected a positive whole number"):
        settings({"MATPHYS_MAX_JOBS": value})


def test_jobs_are_not_kept_beyond_all_dates():
    assert settings({"MATPHYS_RETENTION_HOURS": "1000000"}).retention_hours == 1e6
    with pytest.raises(InputError, match="MATPHYS_RETENTION_HOURS=1e8: at most 1000000"):
        settings({"MATPHYS_RETENTION_HOURS": "1e8"})


def test_a_password_is_not_shown():
    assert "s3cret" not in repr(settings({}))


def test_the_data_folder_follows_the_desktop(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    assert default_data_dir() == tmp_path / "matphys"
    monkeypatch.delenv("XDG_DATA_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert default_data_dir() == tmp_path / ".local/share/matphys"
