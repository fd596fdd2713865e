"""The HTTP front. Imports `worker` and `model.schema`, and never torch."""
