"""Commands of `matphys` that fill a file of their own, and what all commands share."""
