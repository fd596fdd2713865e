"""multipart/form-data, parsed as it arrives: files go to the disk piece by piece, fields stay small."""

from collections.abc import Callable, Collection
from email.message import Message

from python_multipart.exceptions import FormParserError
from python_multipart.multipart import MultipartParser

from service.errors import ProblemError

FIELD_LIMIT = 4096
"""Bytes of a text field."""
MAX_PARTS = 64


class FormReader:
    """Takes the bytes of a form apart.

    Args:
        boundary: As the Content-Type names it.
        files: Names of the parts that are files.
        write: Called with the name of a file and its next bytes; with no bytes when the file begins.
    """

    def __init__(self, boundary: str, files: Collection[str], write: Callable[[str, bytes], None]) -> None:
        """Nothing was read yet."""
        self.fields: dict[str, str] = {}
        self._files, self._write = files, write
        self._seen: set[str] = set()
        self._header = (b"", b"")
        self._disposition = ""
        self._name = ""
        self._text = b""
        self._complete = False
        try:
            self._parser = MultipartParser(
                boundary.encode("latin-1", "replace"),
                {
                    "on_part_begin": self._begin,
                    "on_header_field": self._header_name,
                    "on_header_value": self._header_value,
                    "on_header_end": self._header_end,
                    "on_headers_finished": self._named,
                    "on_part_data": self._data,
                    "on_part_end": self._end,
                    "on_end": self._finished,
                },
                max_header_count=8,
                max_header_size=2048,
            )
        except FormParserError:
            raise ProblemError("bad-request", "the boundary of the multipart form is not valid") from None

    def feed(self, data: bytes) -> None:
        """Take the next bytes.

        Raises:
            ProblemError: they are no form, or name a part twice, or a part that nobody reads is large.
        """
        try:
            self._parser.write(data)
        except FormParserError:
            raise ProblemError(
                "bad-request", "the body is not a multipart form as its Content-Type says"
            ) from None

    def close(self) -> None:
        """The body has ended.

        Raises:
            ProblemError: the form has not.
        """
        if not self._complete:
            raise ProblemError("bad-request", "the multipart form breaks off: its last boundary is missing")

    def _begin(self) -> None:
        self._disposition, self._name, self._text = "", "", b""
        if len(self._seen) >= MAX_PARTS:
            raise ProblemError("bad-request", f"the form has more than {MAX_PARTS} parts")

    def _header_name(self, data: bytes, start: int, end: int) -> None:
        self._header = (self._header[0] + data[start:end], self._header[1])

    def _header_value(self, data: bytes, start: int, end: int) -> None:
        self._header = (self._header[0], self._header[1] + data[start:end])

    def _header_end(self) -> None:
        name, value = self._header
        if name.lower() == b"content-disposition":
            self._disposition = value.decode("utf-8", "replace")
        self._header = (b"", b"")

    def _named(self) -> None:
        """All headers of a part are there: what is it?"""
        message = Message()
        message["Content-Disposition"] = self._disposition.replace("\r", " ").replace("\n", " ")
        name = message.get_param("name", header="content-disposition")
        if message.get_content_disposition() != "form-data" or not isinstance(name, str) or not name:
            raise ProblemError("bad-request", "a part of the form has no name")
        if name in self._seen:
            raise ProblemError("bad-request", f"the form has {name[:40]!r} twice")
        if name not in self._files and message.get_filename() is not None:
            known = ", ".join(self._files)
            raise ProblemError(
                "invalid-request", f"{name[:40]}: no file is read by this name: expected {known}"
            )
        self._seen.add(name)
        self._name = name
        if name in self._files:
            self._write(name, b"")

    def _data(self, data: bytes, start: int, end: int) -> None:
        if self._name in self._files:
            self._write(self._name, data[start:end])
            return
        self._text += data[start:end]
        if len(self._text) > FIELD_LIMIT:
            raise ProblemError("too-large", f"{self._name[:40]}: at most {FIELD_LIMIT} bytes are read")

    def _end(self) -> None:
        if self._name not in self._files:
            try:
                self.fields[self._name] = self._text.decode()
            except UnicodeDecodeError:
                raise ProblemError("bad-request", f"{self._name[:40]}: expected UTF-8 text") from None

    def _finished(self) -> None:
        self._complete = True
