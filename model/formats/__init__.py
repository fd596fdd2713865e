"""Bytes on disk: one file format, or one member of a bundle, a file."""
