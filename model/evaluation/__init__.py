"""How well a method knows an object it saw move: metrics, settings, baselines, tables."""
