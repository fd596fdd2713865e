"""Scripts that travel with an export, copied as they are: they import nothing of ours."""
