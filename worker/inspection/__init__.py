"""A first look at what strangers upload, in a process of its own: one kind of file, one module.

`python -m worker.inspection` is told paths and kinds as JSON; it gives up most of what a process may do
before it opens anything. The readers here look at form and limits only: whether a clip can be made a twin is
for the pipeline to say.
"""
