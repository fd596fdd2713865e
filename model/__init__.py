"""From a video of a handled soft object to a simulatable twin."""
