"""The openai prior asks the same question once."""

import numpy as np


def test_the_same_question_is_asked_once(serve, client, good, view):
    server = serve(good())
    first = client(server).material(view())
    again = client(server).material(view())
    assert len(server.requests) == 1
    np.testing.assert_array_equal(first.distribution, again.distribution)
    assert first.properties == again.properties


def test_another_question_is_asked(serve, client, good, view):
    server = serve(good(), good(), good())
    client(server).material(view())
    client(server, model="other").material(view())
    brighter = view()
    client(server).material(view(image=255 - brighter.image))
    assert len(server.requests) == 3


def test_what_does_not_fit_is_not_kept(serve, client, completion, good, view, refused):
    server = serve((200, {}, completion("no")), good())
    refused(client(server))
    assert client(server).material(view()).shape_class == "solid"


def test_a_damaged_memory_is_asked_anew_and_mended(serve, client, tmp_path, good, view, key):
    server = serve(good(), good())
    client(server).material(view())
    (kept,) = (tmp_path / "cache").iterdir()
    kept.write_text('{"materials": ')
    client(server).material(view())
    client(server).material(view())
    assert len(server.requests) == 2
    assert list((tmp_path / "cache").iterdir()) == [kept]
    assert key not in kept.read_text()


def test_a_memory_that_cannot_be_written_costs_only_the_question(serve, client, tmp_path, good, view):
    (tmp_path / "file").write_text("")
    server = serve(good(), good())
    for _ in range(2):
        client(server, cache=tmp_path / "file" / "cache").material(view())
    assert len(server.requests) == 2
