"""The playground in a browser: a thin layer of viser over a session."""
