"""Kernels are compiled once, safely, and their absence is said."""

import ctypes
import os
import subprocess
import sys
import textwrap

import pytest

from model.simulator.kernel import build

ANSWER = 'extern "C" int answer() { return %d; }\n'


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    build.load.cache_clear()
    yield tmp_path / "matphys" / "kernels"
    build.load.cache_clear()


def test_a_text_is_compiled_once(cache, monkeypatch):
    assert build.load(ANSWER % 41).answer() == 41
    assert [path.suffix for path in cache.iterdir()] == [".so"]
    build.load.cache_clear()
    monkeypatch.setattr(build, "_compile", lambda *_: pytest.fail("compiled again"))
    assert isinstance(build.load(ANSWER % 41), ctypes.CDLL)


def test_other_texts_and_other_flags_are_other_kernels(cache, monkeypatch):
    build.load(ANSWER % 1)
    build.load(ANSWER % 2)
    build.load.cache_clear()
    monkeypatch.setattr(build, "FLAGS", (*build.FLAGS, "-DOTHER"))
    build.load(ANSWER % 1)
    assert len(list(cache.iterdir())) == 3


def test_a_wish_that_a_compiler_does_not_know_is_left_out(cache, monkeypatch):
    wishes = (("-fno-such-wish", ""), ("-fopenmp", "#include <no/such/header>\n"), ("-DWISH=5", ""))
    monkeypatch.setattr(build, "WISHES", wishes)
    build._wishes.cache_clear()
    try:
        assert build.load(ANSWER.replace("%d", "WISH")).answer() == 5
        assert build._wishes(build._compiler()) == ("-DWISH=5",)
    finally:
        build._wishes.cache_clear()


def test_two_processes_building_at_once_do_not_collide(cache):
    script = textwrap.dedent("""
        import sys
        from model.simulator.kernel.build import load
        assert load(sys.argv[1]).answer() == 7
    """)
    source = ANSWER % 7 + "// " + "slow " * 1000
    environment = {**os.environ, "XDG_CACHE_HOME": str(cache.parents[1])}
    running = [
        subprocess.Popen([sys.executable, "-c", script, source], env=environment, stderr=subprocess.PIPE)
        for _ in range(2)
    ]
    assert [process.communicate()[1] for process in running] == [b"", b""]
    assert [process.returncode for process in running] == [0, 0]
    assert len(list(cache.iterdir())) == 1


def test_the_compiler_may_be_several_words(cache, monkeypatch):
    """As `ccache g++`: here `env c++`, and an argument with a space."""
    monkeypatch.setenv("CXX", "env c++ '-DWORDS=1 + 1'")
    assert build.load(ANSWER.replace("%d", "WORDS")).answer() == 2


@pytest.mark.parametrize(
    ("compiler", "line"), [("'c++", "CXX is no command"), ("no-such-thing g++", "no-such-thing is not on")]
)
def test_what_is_no_compiler_is_said(cache, monkeypatch, compiler, line):
    monkeypatch.setenv("CXX", compiler)
    with pytest.raises(build.CannotBuild, match=line):
        build.load(ANSWER % 4)


def test_without_a_compiler_it_says_so(cache, monkeypatch):
    monkeypatch.setenv("PATH", "")
    with pytest.raises(build.CannotBuild, match=r"no C\+\+ compiler"):
        build.load(ANSWER % 3)


def test_a_text_that_does_not_compile_is_said_in_one_line(cache):
    with pytest.raises(build.CannotBuild, match=r"refuses the kernel: .*error") as caught:
        build.load("this is not C++;")
    assert "\n" not in str(caught.value)
    assert list(cache.iterdir()) == []


def test_a_home_that_cannot_be_written_is_no_obstacle(tmp_path, monkeypatch):
    blocked = tmp_path / "file"
    blocked.write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(blocked))
    build.load.cache_clear()
    assert build.load(ANSWER % 5).answer() == 5
    build.load.cache_clear()
