"""The routes: one resource, one file; what all kinds of jobs share is in `jobs.py`."""
