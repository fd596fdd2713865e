"""Methods that a predictor is measured against, one per file."""
