"""Shared fixtures. Array shapes in annotations are checked by beartype while tests run."""

from jaxtyping import install_import_hook

install_import_hook(("model",), "beartype.beartype")
