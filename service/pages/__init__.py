"""The page at `/`: one server-rendered template, its style and its script; the API does everything else."""
